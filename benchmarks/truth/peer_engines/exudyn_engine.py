"""Exudyn: its own contact of a sphere in a hollow sphere, or the same law by a user function.

In planar motion a sphere in a hollow sphere touches like a journal in a bearing. Exudyn's contact
has an exponent, a Hunt-Crossley damping and a friction ramp, hence the same law (its d'_0 is the
speed at the onset, where jointplay takes the largest speed since).
"""

from __future__ import annotations

import math
import time
import warnings

import exudyn as exu
import exudyn.itemInterface as items
import numpy as np
from truth.peer_engines.common import ARMATURE, Problem
from truth.peer_engines.contact import drive_effort, spatial_wrench
from truth.peer_engines.trace import Trace

VERSION = exu.config.Version() if hasattr(exu, "config") else exu.GetVersionString()


def _tree(mbs, task: Problem, force=0):
    """Minimal coordinates: the same as jointplay's."""
    links = task.links
    node = mbs.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * len(links),
            initialCoordinates=task.start[0].tolist(),
            initialCoordinates_t=task.start[1].tolist(),
            numberOfODE2Coordinates=len(links),
        )
    )
    words = (("Prismatic" if link.slides else "Revolute", np.argmax(link.axis)) for link in links)
    kinds = [getattr(exu.JointType, word + "XYZ"[int(axis)]) for word, axis in words]
    inertias = [link.tensor for link in links]
    if task.prescribed >= 0:
        inertias[task.prescribed] = inertias[task.prescribed] + np.diag([0.0, 0.0, ARMATURE])
    tree = mbs.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=kinds,
            linkParents=[link.parent for link in links],
            jointTransformations=exu.Matrix3DList([np.eye(3)] * len(links)),
            jointOffsets=exu.Vector3DList([list(link.offset) for link in links]),
            linkInertiasCOM=exu.Matrix3DList(inertias),
            linkCOMs=exu.Vector3DList([list(link.com) for link in links]),
            linkMasses=[link.mass for link in links],
            forceUserFunction=force,
        )
    )
    return node, tree


def _solve(mbs, step: float, duration: float, every: int) -> float:
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime = duration
    integration.numberOfSteps = round(duration / step)
    integration.verboseMode = 0
    integration.adaptiveStep = False
    integration.explicit.computeEndOfStepAccelerations = False
    # A fixed explicit step: contact may begin and end within it, as in jointplay.
    integration.discontinuous.iterationTolerance = 1e300
    integration.discontinuous.useRecommendedStepSize = False
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step * every * (1.0 - 1e-6)
    spent = time.process_time()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
    return time.process_time() - spent


def _trace(mbs, node, step: float, duration: float, every: int, contact=None) -> Trace:
    """What the mechanism at a node does, and the force of a contact of its own."""
    kind = exu.OutputVariableType
    sensors = [
        mbs.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=one, storeInternal=True))
        for one in (kind.Coordinates, kind.Coordinates_t)
    ]
    if contact is not None:
        sensor = {"outputVariableType": kind.Force, "storeInternal": True}
        sensors.append(mbs.AddSensor(items.SensorObject(objectNumber=contact, **sensor)))
    mbs.Assemble()
    spent = _solve(mbs, step, duration, every)
    q, v, *forces = (mbs.GetSensorStoredData(sensor) for sensor in sensors)
    force = np.linalg.norm(forces[0][:, 1:], axis=1) if forces else np.zeros(len(q))
    return Trace(q[:, 0], q[:, 1:], v[:, 1:], force, spent, round(duration / step))


def _system():
    container = exu.SystemContainer()
    return container, container.AddSystem()


def run_free(task: Problem, step: float, duration: float, every: int) -> Trace:
    """Nothing but inertia."""
    _, mbs = _system()
    return _trace(mbs, _tree(mbs, task)[0], step, duration, every)


def run_own(task: Problem, step: float, duration: float, every: int = 1) -> Trace:
    """Exudyn's own contact; planar only."""
    assert task.planar
    _, mbs = _system()
    node, tree = _tree(mbs, task)
    places = [
        items.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=at, localPosition=list(place))
        for at, place in (task.journal, task.bearing)
    ]
    marks, begin = [mbs.AddMarker(one) for one in places], [task.clearance, 0.0, 0.0, 0.0]
    state = mbs.AddNode(items.NodeGenericData(initialCoordinates=begin, numberOfDataCoordinates=4))
    stiffness, hysteresis, mu, _, ramp, *_ = task.law
    contact = mbs.AddObject(
        items.ObjectContactSphereSphere(
            markerNumbers=marks,
            nodeNumber=state,
            spheresRadii=[task.sizes[1], task.sizes[0]],
            isHollowSphere1=True,
            dynamicFriction=mu,
            frictionProportionalZone=ramp,
            contactStiffness=stiffness,
            contactStiffnessExponent=1.5,
            impactModel=1,
            restitutionCoefficient=1.0 - hysteresis / 1.5,  # its factor is 3/2 (1 - e)
        )
    )
    return _trace(mbs, node, step, duration, every, contact)


def run_law(task: Problem, step: float, duration: float, every: int = 1) -> Trace:
    """The law of `common` in a Python user function on the virtual link; spatial only."""
    assert not task.planar
    _, mbs = _system()
    first, n = task.journal[0] - 5, len(task.links)
    memory, wrench, tau = np.zeros(4), np.zeros(6), np.zeros(n)
    log: list[tuple[float, np.ndarray, np.ndarray, float]] = []
    fresh = [True, 0]

    def before(_mbs, _t) -> bool:
        fresh[0] = True
        return True

    def efforts(_mbs, t, _item, q, v) -> np.ndarray:
        q, v = np.array(q), np.array(v)
        drive_effort(t, q, v, *task.drive, tau)
        (sy, cy), (sp, cp), (sr, cr) = (
            (math.sin(x), math.cos(x)) for x in q[first + 3 : first + 6]
        )
        turn = np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )
        axes = np.array([[0.0, 0.0, 1.0], [-sy, cy, 0.0], [cy * cp, sy * cp, -sp]])
        commit, fresh[0] = fresh[0], False
        c, u, w = q[first : first + 3], v[first : first + 3], v[first + 3 : first + 6] @ axes
        spatial_wrench(c, turn, u, w, task.sizes, task.law, memory, commit, wrench)
        tau[first : first + 3] += wrench[:3]
        tau[first + 3 : first + 6] += axes @ wrench[3:]
        if commit:
            if fresh[1] % every == 0:
                log.append((t, q, v, float(np.linalg.norm(wrench[:3]))))
            fresh[1] += 1
        return tau

    _tree(mbs, task, efforts)
    mbs.SetPreStepUserFunction(before)
    mbs.Assemble()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        spent = _solve(mbs, step, duration, 10**9)
    times, q, v, force = (np.array(part) for part in zip(*log, strict=True))
    return Trace(times, q, v, force, spent, round(duration / step))
