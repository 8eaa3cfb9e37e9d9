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
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step, np.zeros(3)
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    flags = mujoco.mjtDisableBit
    spec.option.disableflags = int(flags.mjDSBL_CONTACT | flags.mjDSBL_EULERDAMP)
    bodies = {-1: spec.worldbody}
    for index, link in enumerate(task.links):
        if link.parent >= 0 and task.links[link.parent].mass == 0.0:
            body = bodies[link.parent]
        else:
            body = bodies[link.parent].add_body(name=link.name, pos=link.offset)
        bodies[index] = body
        kind = mujoco.mjtJoint.mjJNT_SLIDE if link.slides else mujoco.mjtJoint.mjJNT_HINGE
        heavy = ARMATURE if index == task.prescribed else 0.0
        body.add_joint(name=link.name, type=kind, axis=link.axis, armature=heavy)
        if link.mass > 0.0:
            body.mass, body.ipos, body.fullinertia = link.mass, link.com, link.inertia
            body.explicitinertial = True
        for name, (at, place) in (("bearing", task.bearing), ("journal", task.journal)):
            if at == index:
                body.add_site(name=name, pos=place)
    if limit is not None:
        ends = {"limited": True, "range": (0.0, task.clearance)}
        ends["solref_limit"] = -np.array(limit)
        ends["solimp_limit"] = (IMPEDANCE, IMPEDANCE, 1e-6, 0.5, 2.0)
        tendon = spec.add_tendon(**ends)
        for site in ("bearing", "journal"):
            tendon.wrap_site(site)
    return spec.compile()


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
