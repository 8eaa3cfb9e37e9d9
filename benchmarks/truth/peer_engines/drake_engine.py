"""Drake: its convex contact with CENIC, its error-controlled integrator.

Drake's point contact knows no concave cylinder. The bore is therefore a polygon of boxes, the
journal a sphere among them: each wall pushes with a linear stiffness and Hunt-Crossley damping, and
the walls that a penetration reaches add up to Hertz's exponent of 3/2.

This file is two: imported, it starts itself in another process, away from Pinocchio's copies of the
same libraries; there it simulates.
"""

from __future__ import annotations

import json
import math
import sys
import time
from importlib.metadata import version

import numpy as np

VERSION = version("drake")
WALLS = 32
"""Of the bore: a polygon whose corners lie 0.5 % of C_r outside of the circle."""
BALL_M = 1e-3
"""Radius of the journal's sphere; only its distance to the walls matters."""
WALL_M = (1e-3, 1e-3, 1e-2)
"""Thickness, width and height of a wall: wide enough that its edges are never touched."""
FIRST_STEP_S = 1e-7
SOLVED = 1e-14
"""Relative residual at which a step's convex problem counts as solved."""


def wall_stiffness(stiffness: float, clearance: float) -> float:
    """Of one wall, so that all that a small penetration d reaches push with k d^1.5 [N/m].

    At the angle t from the contact a wall is penetrated by d - C_r t^2 / 2; summed over the walls,
    as an integral, that is 4 sqrt(2) / 3 d^1.5 / sqrt(C_r) WALLS / (2 pi).
    """
    share = WALLS / (2.0 * math.pi) * 4.0 * math.sqrt(2.0) / 3.0
    return stiffness * math.sqrt(clearance) / share


def run(task, duration: float, speed: float, *, accuracy: float = 0.0, step: float = 0.0):
    """A planar `common.Problem` without friction; returns a `trace.Trace` without forces.

    `speed` is that of the impact whose damping is that of the other engines [m/s]; `accuracy` is
    CENIC's, of a step: largest error of a coordinate [rad or m]; a `step` is constant instead [s].
    """
    from truth.peer_engines.common import ARMATURE, elsewhere
    from truth.peer_engines.trace import Trace

    given = {
        "links": [
            [one.name, one.parent, one.slides, one.axis, one.offset, one.mass, one.com, one.inertia]
            for one in task.links
        ],
        "heavy": [task.prescribed, ARMATURE],
        "bearing": task.bearing,
        "journal": task.journal,
        "clearance": task.clearance,
        "stiffness": wall_stiffness(float(task.law[0]), task.clearance),
        "dissipation": float(task.law[1]) / speed,
        "start": task.start.tolist(),
        "duration": duration,
        "accuracy": accuracy,
        "step": step,
    }
    found = elsewhere(sys.executable, __file__, given)
    none = np.full(len(found["time"]), np.nan)
    spent, steps = float(found["seconds"]), int(found["steps"])
    return Trace(found["time"], found["q"], found["v"], none, spent, steps)


def _diagram(given: dict):
    """The mechanism as a diagram, its plant, and its joints in order."""
    from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
    from pydrake.math import RigidTransform, RotationMatrix
    from pydrake.multibody import plant as parts
    from pydrake.multibody import tree
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, scene = parts.AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    bodies, joints = [], []
    for name, parent, slides, axis, offset, mass, com, inertia in given["links"]:
        own = tree.SpatialInertia.MakeFromCentralInertia(
            mass, np.array(com), tree.RotationalInertia(*inertia)
        )
        body = plant.AddRigidBody(f"{name}_body", own)
        carrier = plant.world_frame() if parent < 0 else bodies[parent].body_frame()
        at = plant.AddFrame(
            tree.FixedOffsetFrame(f"{name}_at", carrier, RigidTransform(np.array(offset)))
        )
        kind = tree.PrismaticJoint if slides else tree.RevoluteJoint
        joints.append(plant.AddJoint(kind(name, at, body.body_frame(), np.array(axis))))
        bodies.append(body)
    index, armature = given["heavy"]
    plant.AddJointActuator("crank", joints[index]).set_default_rotor_inertia(armature)
    material = ProximityProperties()
    # Of two equal stiffnesses in series half is left; of two equal dissipations, the same.
    AddContactMaterial(
        dissipation=given["dissipation"],
        point_stiffness=2.0 * given["stiffness"],
        friction=parts.CoulombFriction(0.0, 0.0),
        properties=material,
    )
    (bearing, place), (journal, centre) = given["bearing"], given["journal"]
    plant.RegisterCollisionGeometry(
        bodies[journal], RigidTransform(np.array(centre)), Sphere(BALL_M), "journal", material
    )
    for k, angle in enumerate(np.arange(WALLS) * 2.0 * math.pi / WALLS):
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        inner = BALL_M + given["clearance"] + 0.5 * WALL_M[0]
        pose = RigidTransform(RotationMatrix.MakeZRotation(angle), np.array(place) + inner * out)
        plant.RegisterCollisionGeometry(bodies[bearing], pose, Box(*WALL_M), f"wall{k}", material)
    plant.Finalize()
    assert scene is not None
    return builder.Build(), plant, joints


def _simulate(given: dict, path: str) -> None:
    import pydrake.multibody.cenic  # noqa: F401  (the type of the integrator)
    from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
    from pydrake.systems.framework import EventStatus

    diagram, plant, joints = _diagram(given)
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    own = plant.GetMyMutableContextFromRoot(context)
    order = [joint.position_start() for joint in joints]
    q, v = np.zeros((2, len(order)))
    q[order], v[order] = given["start"]
    plant.SetPositions(own, q)
    plant.SetVelocities(own, v)
    ResetIntegratorFromFlags(simulator, "cenic", given["step"] or 1e-4)
    integrator = simulator.get_mutable_integrator()
    integrator.set_fixed_step_mode(bool(given["step"]))
    if not given["step"]:
        integrator.set_target_accuracy(given["accuracy"])
        integrator.request_initial_step_size_target(FIRST_STEP_S)
    parameters = integrator.get_solver_parameters()
    parameters.min_tolerance = SOLVED
    integrator.SetSolverParameters(parameters)
    times, states = [], []

    def record(at):
        times.append(at.get_time())
        states.append(plant.GetPositionsAndVelocities(plant.GetMyContextFromRoot(at)))
        return EventStatus.DidNothing()

    simulator.set_monitor(record)
    simulator.Initialize()
    spent = time.process_time()
    simulator.AdvanceTo(given["duration"])
    spent = time.process_time() - spent
    unique, keep = np.unique(times, return_index=True)
    found = np.array(states)[keep]
    np.savez(
        path,
        time=unique,
        q=found[:, order],
        v=found[:, [len(order) + k for k in order]],
        seconds=spent,
        steps=integrator.get_num_steps_taken(),
    )


if __name__ == "__main__":
    _simulate(json.load(sys.stdin), sys.argv[1])
