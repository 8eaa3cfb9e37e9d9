"""Siconos: rigid impacts with Newton's restitution, Moreau-Jean time stepping.

Siconos is Debian's python3-siconos, for the system's Python. This file is therefore two: imported,
it starts itself under that Python; run by it, it simulates. There is no contact force law: bearing
and journal are rigid, an impact has no duration and reverses the normal speed times e; there is
no friction here.

The slider-crank in the coordinates crank angle, absolute angle of the rod, place of the slider:
the crank turns at constant speed (an inertia of 1e8 kg m^2), the rod's pin is carried along, so
that its equation is I phi'' = -m l r w^2 sin(phi - theta), taken at mid-step. The gap is linearised
once per step, where the step leads to: with theta = 1/2 the mean of both speeds then follows the
bore's curvature, and a lasting contact does not drift in first order.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time

import numpy as np


def run(task, step: float, duration: float, every: int, restitution: float):
    """Simulate a planar `common.Problem`; returns a `trace.Trace`, force = impulse / step."""
    from truth.peer_engines.common import ARMATURE, elsewhere, siconos_python
    from truth.peer_engines.trace import Trace

    _, rod, slider = task.links
    q, v = task.start
    turned = [q[0], q[0] + q[1], q[2]], [v[0], v[0] + v[1], v[2]]
    given = {
        "r": rod.offset[0],
        "length": task.bearing[1][0],
        "moment": rod.mass * rod.com[0],
        "inertia": [ARMATURE, rod.inertia[2] + rod.mass * rod.com[0] ** 2, slider.mass],
        "clearance": task.clearance,
        "restitution": restitution,
        "q": list(map(float, turned[0])),
        "v": list(map(float, turned[1])),
        "step": step,
        "steps": round(duration / step),
        "every": every,
    }
    found = elsewhere(siconos_python(), __file__, given)
    q, v = found["q"], found["v"]
    for part in (q, v):
        part[:, 1] -= part[:, 0]
    return Trace(found["time"], q, v, found["force"], float(found["seconds"]), given["steps"])


def _version() -> str:
    command = ["dpkg-query", "-W", "-f=${Version}", "python3-siconos"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    return answer.stdout.strip() or "of unknown version"


VERSION = _version()
"""As Debian knows it."""


def _simulate(given: dict, out: str) -> None:
    import siconos.kernel as sk

    r, length, moment, h = (given[key] for key in ("r", "length", "moment", "step"))
    system = sk.LagrangianLinearTIDS(given["q"], given["v"], np.diag(given["inertia"]))
    system.setFExtPtr(np.zeros(3))
    push = system.fExt()
    relation = sk.LagrangianLinearTIR(np.zeros((1, 3)), np.ones(1))
    normal, rest = relation.C(), relation.e()  # views of Siconos's memory, as is push
    contact = sk.Interaction(sk.NewtonImpactNSL(given["restitution"]), relation)
    dynamics = sk.NonSmoothDynamicalSystem(0.0, (given["steps"] + 2) * h)
    dynamics.insertDynamicalSystem(system)
    dynamics.link(contact, system)
    simulation = sk.TimeStepping(
        dynamics, sk.TimeDiscretisation(0.0, h), sk.MoreauJeanOSI(0.5), sk.LCP()
    )
    count = given["steps"] // given["every"]
    q, v = np.zeros((2, count + 1, 3))
    force = np.zeros(count + 1)
    q[0], v[0] = system.q(), system.velocity()
    spent, impulse = time.process_time(), 0.0
    for i in range(1, given["steps"] + 1):
        at, speed = np.array(system.q()), system.velocity()
        theta, phi, s = at + 0.5 * h * speed
        push[1] = -moment * r * speed[0] ** 2 * np.sin(phi - theta)
        theta, phi, s = at + h * speed
        x = s - r * np.cos(theta) - length * np.cos(phi)
        y = -r * np.sin(theta) - length * np.sin(phi)
        d = max(np.hypot(x, y), 1e-15)
        # d(gap)/dq of gap = C_r - |journal - bearing|.
        normal[0] = (
            -(x * r * np.sin(theta) - y * r * np.cos(theta)) / d,
            -(x * length * np.sin(phi) - y * length * np.cos(phi)) / d,
            -x / d,
        )
        rest[0] = given["clearance"] - d - normal[0] @ np.array([theta, phi, s])
        simulation.computeOneStep()
        impulse += contact.lambda_(1)[0]
        simulation.nextStep()
        if i % given["every"] == 0:
            k = i // given["every"]
            q[k], v[k], force[k] = system.q(), system.velocity(), impulse / (h * given["every"])
            impulse = 0.0
    spent = time.process_time() - spent
    times = np.arange(count + 1) * (h * given["every"])
    np.savez(out, time=times, q=q, v=v, force=force, seconds=spent)


if __name__ == "__main__":
    _simulate(json.load(sys.stdin), sys.argv[1])
