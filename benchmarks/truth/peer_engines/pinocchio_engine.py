"""Pinocchio's own constraint solvers, ADMM and projected Gauss-Seidel, on a rigid point contact.

Pinocchio has no time stepping of its own: here it is Moreau's mid-point scheme, as Siconos has it,
with Pinocchio's mass matrix, bias and Jacobians, Newton's restitution in the normal speed, and one
`PointContactConstraintModel` whose 3 x 3 problem its solver is given in each step of contact. No
friction. The crank turns at constant speed by its inertia of 1e8 kg m^2.
"""

from __future__ import annotations

import math
import time

import numpy as np
import pinocchio as pin
from truth.peer_engines.common import ARMATURE, Problem
from truth.peer_engines.trace import Trace

VERSION = pin.__version__
SOLVERS = ("ADMM", "PGS")
REGULAR = 1e-10
"""Added to the problem's matrix: nothing moves across the plane of a planar mechanism [1/kg]."""


def _model(task: Problem) -> pin.Model:
    """The mechanism, from the numbers that all engines get."""
    made = pin.Model()
    made.gravity.linear = np.zeros(3)
    for link in task.links:
        kind = pin.JointModelPrismaticUnaligned if link.slides else pin.JointModelRevoluteUnaligned
        at = made.addJoint(
            link.parent + 1,
            kind(np.array(link.axis, float)),
            pin.SE3(np.eye(3), np.array(link.offset, float)),
            link.name,
        )
        inertia = pin.Inertia(link.mass, np.array(link.com, float), link.tensor)
        made.appendBodyToJoint(at, inertia, pin.SE3.Identity())
    if task.prescribed >= 0:
        made.armature[task.prescribed] = ARMATURE
    return made


class _Solver:
    """One contact without friction, by one of Pinocchio's solvers."""

    def __init__(self, kind: str, model: pin.Model) -> None:
        contact = pin.PointContactConstraintModel(model, 1)
        contact.setFriction(0.0)
        self.models, self.datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        self.models.append(pin.ConstraintModel(contact))
        self.datas.append(self.models[0].createData())
        self.solver = getattr(pin, f"{kind}ConstraintSolver")(3)
        self.settings = getattr(pin, f"{kind}SolverSettings")()
        self.result = getattr(pin, f"{kind}SolverResult")()
        self.settings.max_iterations = 1000
        for name in ("absolute", "relative"):
            for what in ("feasibility", "complementarity"):
                setattr(self.settings, f"{name}_{what}_tol", 1e-12)

    def __call__(self, matrix: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Impulse (two tangents, normal) for which matrix @ impulse + speed is admissible."""
        self.solver.solve(
            pin.DelassusOperatorDense(matrix), speed, self.models, self.datas, self.settings,
            self.result,
        )  # fmt: skip
        return self.result.retrieveConstraintImpulses()


def run(
    task: Problem, step: float, duration: float, every: int, restitution: float, solver: str
) -> Trace:
    """Simulate a planar problem; `solver` is one of `SOLVERS`. The force is impulse / step."""
    model = _model(task)
    data = model.createData()
    solve = _Solver(solver, model)
    (rod, bearing), (slider, journal) = task.bearing, task.journal
    q, v = (np.array(part) for part in task.start)
    steps = round(duration / step)
    count = steps // every
    (qs, vs), force = np.zeros((2, count + 1, len(q))), np.zeros(count + 1)
    qs[0], vs[0] = q, v
    matrix, rows = np.empty((3, 3)), np.empty((3, 3))
    impulse = 0.0
    spent = time.process_time()
    for i in range(1, steps + 1):
        middle = q + 0.5 * step * v
        mass = pin.crba(model, data, middle)
        bias = pin.nonLinearEffects(model, data, middle, v)
        inverse = np.linalg.inv(np.triu(mass) + np.triu(mass, 1).T)
        new = v - step * (inverse @ bias)
        pin.forwardKinematics(model, data, middle)
        away = data.oMi[slider + 1].act(np.array(journal)) - data.oMi[rod + 1].act(
            np.array(bearing)
        )
        size = math.sqrt(away @ away)
        if size >= task.clearance:
            slope = _slope(model, data, middle, slider, journal)
            slope -= _slope(model, data, middle, rod, bearing)
            n = -away / size
            rows[0] = -n[1], n[0], 0.0
            rows[1] = 0.0, 0.0, 1.0
            rows[2] = n
            jacobian = rows @ slope
            matrix[:] = jacobian @ inverse @ jacobian.T + REGULAR * np.eye(3)
            speed = jacobian @ new
            speed[2] += restitution * min(float(jacobian[2] @ v), 0.0)
            pushed = solve(matrix, speed)
            new = new + inverse @ (jacobian.T @ pushed)
            impulse += pushed[2]
        v = new
        q = middle + 0.5 * step * v
        if i % every == 0:
            k = i // every
            qs[k], vs[k], force[k] = q, v, impulse / (step * every)
            impulse = 0.0
    spent = time.process_time() - spent
    return Trace(np.arange(count + 1) * (step * every), qs, vs, force, spent, steps)


def _slope(model, data, q, index: int, point) -> np.ndarray:
    """Jacobian of a point of a link, world axes, shape (3, nv)."""
    jacobian = pin.computeJointJacobian(model, data, q, index + 1)
    placement = data.oMi[index + 1]
    local = jacobian[:3] + np.cross(jacobian[3:].T, np.array(point)).T
    return placement.rotation @ local
