"""MuJoCo: the same law through applied forces, or its own soft constraint.

MuJoCo has no concave cylinder. Its nearest own model of a planar joint with clearance is a tendon
between bearing and journal whose length is limited to C_r: a unilateral constraint with MuJoCo's
solref and solimp, without friction.
"""

from __future__ import annotations

import math
import time

import mujoco
import numpy as np
from scipy.optimize import brentq
from truth.peer_engines.common import ARMATURE, Problem
from truth.peer_engines.contact import drive_effort, world_wrench
from truth.peer_engines.trace import Trace

VERSION = mujoco.__version__
INTEGRATORS = tuple(
    name
    for name in ("Euler", "implicitfast", "discrete")
    if hasattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}")
)
"""MuJoCo's, as this version has them."""
IMPEDANCE = 0.9999
"""solimp: the constraint's share of the acceleration, as near to 1 as MuJoCo allows (mjMAXIMP)."""


def model(
    task: Problem, step: float, integrator: str = "Euler", limit: tuple[float, float] | None = None
) -> mujoco.MjModel:
    """The mechanism; massless links are further joints of the next body.

    `limit` = (stiffness, damping) per mass of the tendon's limit, [1/s^2, 1/s].
    """
    children: dict[int, list[int]] = {}
    for index, link in enumerate(task.links):
        children.setdefault(link.parent, []).append(index)

    def numbers(values: object) -> str:
        return " ".join(repr(float(x)) for x in values)

    def body(index: int) -> str:
        link = task.links[index]
        text = f'<body name="{link.name}" pos="{numbers(link.offset)}">'
        while True:
            kind = "slide" if link.slides else "hinge"
            heavy = f' armature="{ARMATURE}"' if index == task.prescribed else ""
            text += f'<joint name="{link.name}" type="{kind}" axis="{numbers(link.axis)}"{heavy}/>'
            if link.mass > 0.0:
                break
            (index,) = children[index]
            link = task.links[index]
            assert not any(link.offset)
        text += (
            f'<inertial pos="{numbers(link.com)}" mass="{link.mass!r}" '
            f'fullinertia="{numbers(link.inertia)}"/>'
        )
        for name, (at, place) in (("bearing", task.bearing), ("journal", task.journal)):
            if at == index:
                text += f'<site name="{name}" pos="{numbers(place)}"/>'
        return text + "".join(body(child) for child in children.get(index, [])) + "</body>"

    tendon = ""
    if limit is not None:
        stiffness, damping = limit
        tendon = (
            f'<tendon><spatial limited="true" range="0 {task.clearance!r}" '
            f'solreflimit="{-stiffness!r} {-damping!r}" '
            f'solimplimit="{IMPEDANCE} {IMPEDANCE} 1e-6">'
            '<site site="bearing"/><site site="journal"/></spatial></tendon>'
        )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{step!r}" gravity="0 0 0" '
        f'integrator="{integrator}"><flag contact="disable" eulerdamp="disable"/></option>'
        f"<worldbody>{''.join(body(root) for root in children[-1])}</worldbody>{tendon}</mujoco>"
    )


def matched_limit(duration: float, restitution: float) -> tuple[float, float]:
    """Stiffness and damping per mass of a half period of `duration` [s] with this restitution.

    Within the limit MuJoCo's constraint is r'' + b r' + k r = 0 for any mass, as long as the
    reaction does not pull: then it stops short of a half period, which is solved for here.
    """
    target = -math.log(restitution)

    def released(zeta: float) -> tuple[float, float]:
        """-ln of the restitution, and w0 times the duration, of an oscillator that never pulls."""
        phi = math.acos(zeta)
        bent = math.sqrt(1.0 - zeta * zeta)
        return 2.0 * phi * zeta / bent, 2.0 * phi / bent

    zeta = brentq(lambda zeta: released(zeta)[0] - target, 0.0, 0.999, xtol=1e-15)
    frequency = released(zeta)[1] / duration
    return frequency**2, 2.0 * zeta * frequency


def _start(task: Problem, step: float, **options: object):
    made = model(task, step, **options)
    data = mujoco.MjData(made)
    data.qpos[:], data.qvel[:] = task.start
    return made, data


def run_free(task: Problem, step: float, duration: float, every: int) -> Trace:
    """Nothing but inertia, with MuJoCo's RK4."""
    made, data = _start(task, step, integrator="RK4")
    return _stride(made, data, round(duration / step), every)


def run_own(
    task: Problem,
    step: float,
    duration: float,
    every: int,
    limit: tuple[float, float],
    integrator: str = "Euler",
) -> Trace:
    """MuJoCo's own soft limit; its Euler is semi-implicit. `integrator` is one of `INTEGRATORS`."""
    made, data = _start(task, step, limit=limit, integrator=integrator)
    return _stride(made, data, round(duration / step), every)


def _stride(made, data, steps: int, every: int) -> Trace:
    count = steps // every
    q, v = np.zeros((2, count + 1, made.nv))
    force = np.zeros(count + 1)
    q[0], v[0] = data.qpos, data.qvel
    spent = time.process_time()
    for i in range(1, count + 1):
        mujoco.mj_step(made, data, every)
        q[i], v[i] = data.qpos, data.qvel
        # The constraint's force is that of the step just done, so of the state before it.
        force[i - 1] = data.efc_force[0] if data.nefc else 0.0
    spent = time.process_time() - spent
    times = np.arange(count + 1) * (made.opt.timestep * every)
    return Trace(times, q, v, force, spent, steps)


def run_law(task: Problem, step: float, duration: float, every: int = 1) -> Trace:
    """The law of `common` applied to both bodies at the journal's centre, semi-implicit Euler.

    MuJoCo's own kinematics give the relative motion, and MuJoCo maps the wrenches on coordinates.
    """
    made, data = _start(task, step)
    sites = [made.site(name).id for name in ("bearing", "journal")]
    bodies = [int(made.site_bodyid[site]) for site in sites]
    memory, wrench = np.zeros(4), np.zeros(6)
    speeds = np.zeros((2, 6))
    # Views of MuJoCo's memory.
    places = [data.site_xpos[site] for site in sites] + [data.site_xmat[site] for site in sites]
    effort, reaction = np.zeros(made.nv), np.zeros(made.nv)
    steps = round(duration / step)
    count = steps // every
    q, v = np.zeros((2, count + 1, made.nv))
    force = np.zeros(count + 1)
    driven = task.driven
    spent = time.process_time()
    for i in range(steps + 1):
        mujoco.mj_step1(made, data)
        for site, out in zip(sites, speeds, strict=True):
            mujoco.mj_objectVelocity(made, data, mujoco.mjtObj.mjOBJ_SITE, site, out, 0)
        touching = world_wrench(task.planar, *places, *speeds, task.sizes, task.law, memory, wrench)
        if i % every == 0:
            at = i // every
            q[at], v[at], force[at] = data.qpos, data.qvel, math.sqrt(wrench[:3] @ wrench[:3])
        reaction[:] = 0.0
        if touching:
            push, couple = wrench[:3], wrench[3:]
            mujoco.mj_applyFT(made, data, push, couple, places[1], bodies[1], reaction)
            mujoco.mj_applyFT(made, data, -push, -couple, places[1], bodies[0], reaction)
        if driven:
            drive_effort(i * step, data.qpos, data.qvel, *task.drive, effort)
            reaction += effort
        data.qfrc_applied[:] = reaction
        mujoco.mj_step2(made, data)
    spent = time.process_time() - spent
    return Trace(np.arange(count + 1) * (step * every), q, v, force, spent, steps)
