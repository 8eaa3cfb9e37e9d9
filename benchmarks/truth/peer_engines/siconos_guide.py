"""Siconos on the slider-crank with clearance in its guide: Moreau-Jean, four rigid corners.

The mechanism of P. Flores, R. Leine, C. Glocker, Multibody System Dynamics 23 (2010) 165-190,
Table 1, as Siconos's own example has it (github.com/siconos/siconos-tutorials, Apache-2.0), written
again here: crank, rod and slider by their absolute angles, Newton's impact and Coulomb's friction
at the four corners of the slider. Like `siconos_engine` two files in one: imported, it starts
itself under the Python that has Siconos; run by it, it simulates.
"""

from __future__ import annotations

import json
import math
import sys

import numpy as np

CRANK, ROD = 0.153, 0.306
"""Lengths [m]."""
HALF_LENGTH, HALF_WIDTH, CLEARANCE = 0.05, 0.025, 1e-3
"""Of the slider in its guide [m]."""
MASSES = 0.038, 0.038, 0.076
"""Crank, rod, slider [kg]."""
INERTIAS = 7.4e-5, 5.9e-4, 2.7e-6
"""About the centres [kg m^2]."""
GRAVITY = 9.81
START = 150.0, -75.0, 0.0
"""Angular velocities at the start, all angles zero [rad/s]."""
RESTITUTION, FRICTION = 0.4, 0.01


def run(step: float, duration: float, interval: float) -> np.ndarray:
    """Simulate; see `record` for the columns."""
    from truth.peer_engines.common import elsewhere, siconos_python

    given = {"step": step, "duration": duration, "interval": interval}
    return elsewhere(siconos_python(), __file__, given)["rows"]


INNER = INERTIAS[0] + (MASSES[0] / 4 + MASSES[1] + MASSES[2]) * CRANK**2
OUTER = INERTIAS[1] + (MASSES[1] / 4 + MASSES[2]) * ROD**2
BOTH = (MASSES[1] / 2 + MASSES[2]) * CRANK * ROD
"""Mass matrix of crank and rod: INNER, OUTER, and BOTH cos(difference) beside [kg m^2]."""
WEIGHTS = (
    (MASSES[0] / 2 + MASSES[1] + MASSES[2]) * GRAVITY * CRANK,
    (MASSES[1] / 2 + MASSES[2]) * GRAVITY * ROD,
)
"""Moments of the weight, level [N m]."""


def record(time: float, q: np.ndarray, v: np.ndarray) -> tuple[float, ...]:
    """Time [s], crank's turns and speed [rad/s], slider's y / clearance, energy [J] of a state."""
    y = CRANK * math.sin(q[0]) + ROD * math.sin(q[1])
    motion = INNER * v[0] ** 2 + OUTER * v[1] ** 2 + INERTIAS[2] * v[2] ** 2
    motion += 2 * BOTH * math.cos(q[0] - q[1]) * v[0] * v[1]
    height = WEIGHTS[0] * math.sin(q[0]) + WEIGHTS[1] * math.sin(q[1])
    return time, q[0] / (2 * math.pi), v[0], y / CLEARANCE, motion / 2 + height


def _simulate(given: dict, out: str) -> None:
    import siconos.kernel as sk

    class Mechanism(sk.LagrangianDS):
        """Written in place, through views of Siconos's own arrays."""

        def __init__(self):
            super().__init__(np.zeros(3), np.array(START))
            self.setMassPtr(np.diag([INNER, OUTER, INERTIAS[2]]))
            self.setFGyrPtr(np.zeros(3))
            self.setFIntPtr(np.zeros(3))

        def computeMass(self, q=None):
            q = self.q() if q is None else q
            mass = self.mass()
            mass[0, 1] = mass[1, 0] = BOTH * math.cos(q[0] - q[1])

        def computeFGyr(self, q=None, v=None):
            q, v = (self.q(), self.velocity()) if q is None else (q, v)
            lean = BOTH * math.sin(q[0] - q[1])
            self.fGyr()[:2] = lean * v[1] ** 2, -lean * v[0] ** 2

        def computeFInt(self, time, q=None, v=None):
            q = self.q() if q is None else q
            self.fInt()[:2] = WEIGHTS[0] * math.cos(q[0]), WEIGHTS[1] * math.cos(q[1])

    class Corner:
        """A corner of the slider against the wall on its side; `x` and `y` are its signs.

        Linearised once per step where the step leads to; Siconos's relations written in Python
        (4.4.0) end the process at the first contact.
        """

        def __init__(self, x, y):
            self.x, self.y, self.side = x * HALF_LENGTH, y * HALF_WIDTH, y
            self.relation = sk.LagrangianLinearTIR(np.ones((2, 3)), np.ones(2))
            self.slope, self.rest = self.relation.C(), self.relation.e()

        def linearise(self, q):
            sin, cos = math.sin(q[2]), math.cos(q[2])
            x = CRANK * math.cos(q[0]) + ROD * math.cos(q[1]) + self.x * cos - self.y * sin
            y = CRANK * math.sin(q[0]) + ROD * math.sin(q[1]) + self.x * sin + self.y * cos
            rise = CRANK * math.cos(q[0]), ROD * math.cos(q[1]), self.x * cos - self.y * sin
            run = -CRANK * math.sin(q[0]), -ROD * math.sin(q[1]), -self.x * sin - self.y * cos
            self.slope[0] = [-self.side * part for part in rise]
            self.slope[1] = run
            self.rest[0] = HALF_WIDTH + CLEARANCE - self.side * y - self.slope[0] @ q
            self.rest[1] = x - self.slope[1] @ q

    step, count = given["step"], round(given["duration"] / given["step"])
    system = Mechanism()
    dynamics = sk.NonSmoothDynamicalSystem(0.0, (count + 2) * step)
    dynamics.insertDynamicalSystem(system)
    corners = [Corner(x, y) for x, y in ((-1, 1), (1, 1), (-1, -1), (1, -1))]
    law = sk.NewtonImpactFrictionNSL(RESTITUTION, 0.0, FRICTION, 2)
    for corner in corners:
        dynamics.link(sk.Interaction(law, corner.relation), system)
    simulation = sk.TimeStepping(
        dynamics, sk.TimeDiscretisation(0.0, step), sk.MoreauJeanOSI(0.5), sk.FrictionContact(2)
    )
    simulation.setNewtonTolerance(1e-10)
    simulation.setNewtonMaxIteration(200)
    every = round(given["interval"] / step)
    rows = np.zeros((count // every + 1, 5))
    for i in range(count + 1):
        if i % every == 0:
            rows[i // every] = record(i * step, system.q(), system.velocity())
        if i < count:
            ahead = system.q() + step * system.velocity()
            for corner in corners:
                corner.linearise(ahead)
            simulation.computeOneStep()
            simulation.nextStep()
    np.savez(out, rows=rows)


if __name__ == "__main__":
    _simulate(json.load(sys.stdin), sys.argv[1])
