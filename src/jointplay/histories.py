"""From the records of a run to its time histories: what a `Result` is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
import xarray as xr

from jointplay.audit import Audit
from jointplay.drive import JointFriction
from jointplay.geometry import CONTACTS, Form, Mode, classify_many, journal_axis
from jointplay.impact import elastic_energy
from jointplay.kernel import POWERS, Status, Workspace
from jointplay.mechanism import Mechanism
from jointplay.result import AXES, FORMAT, Result


def assemble(
    mechanism: Mechanism,
    simulation: dict[str, Any],
    workspace: Workspace,
    friction: Mapping[str, JointFriction],
    status: Status,
    message: str,
    wall_time: float,
) -> Result:
    """Make a `Result` of the records that a run left in its workspace.

    Args:
        mechanism: what was simulated.
        simulation: the whole simulation as plain data, to run it again.
        workspace: the records.
        friction: friction by joint.
        status, message: how the run ended.
        wall_time: what it took [s].
    """
    n = workspace.rows
    q, v = workspace.recorded("q"), workspace.recorded("v")
    body = _kinematics(mechanism, q, v)
    variables: dict[str, tuple[tuple[str, ...], np.ndarray, str, str]] = {
        "q": (("time", "coordinate"), q, "", "generalised coordinates"),
        "v": (("time", "coordinate"), v, "", "generalised velocities"),
        "drive": (("time", "coordinate"), workspace.recorded("drive"), "", "drive efforts"),
        "tool_position": (("time", "axis"), body["position"], "m", f"{mechanism.tool}, world axes"),
        "tool_velocity": (("time", "axis"), body["velocity"], "m/s", "of the tool, world axes"),
        "kinetic_energy": (("time",), body["kinetic"], "J", "kinetic energy"),
        "potential_energy": (("time",), body["potential"], "J", "potential energy of gravity"),
    }
    work = workspace.recorded("work")
    names = ("drive_work", "normal_dissipation", "friction_dissipation", "joint_friction_loss")
    for index in range(len(POWERS)):
        name = names[index]
        variables[name] = (("time",), work[:, index], "J", f"{name.replace('_', ' ')} since t = 0")
    elastic = np.zeros(n)
    if mechanism.clearance:
        contact, elastic = _contact(mechanism, workspace, q, body)
        variables |= contact
    else:
        variables["reaction_force"] = (
            ("time", "moving_joint", "axis"),
            _reactions(mechanism, q, v, workspace.recorded("drive"), friction),
            "N",
            "constraint force of the parent on the child at the joint, world axes",
        )
    variables["contact_elastic_energy"] = (("time",), elastic, "J", "stored in the contacts")
    energy = body["kinetic"] + body["potential"] + elastic - work[:, 0] + work[:, 1:].sum(axis=1)
    residual = energy - energy[:1]
    variables["energy_residual"] = (("time",), residual, "J", "error of the energy balance")

    units = [_units(mechanism, name) for name in mechanism.coordinates]
    coordinates: dict[str, Any] = {
        "time": ("time", workspace.recorded("time")[:, 0], {"units": "s"}),
        "coordinate": list(mechanism.coordinates),
        "coordinate_unit": ("coordinate", units),
        "axis": list(AXES),
    }
    if mechanism.clearance:
        coordinates |= {"joint": list(mechanism.clearance), "contact": list(CONTACTS)}
    else:
        coordinates["moving_joint"] = list(mechanism.joints)
    audit = Audit.of(mechanism, simulation, workspace, body["kinetic"], work, residual)
    dataset = xr.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": text})
            for name, (dims, values, unit, text) in variables.items()
        },
        coordinates,
        {
            "jointplay_format": FORMAT,
            "simulation": json.dumps(simulation),
            "audit": json.dumps(audit.describe()),
            "status": status.name.lower(),
            "message": message,
            "wall_time_s": wall_time,
            "versions": json.dumps(versions()),
        },
    )
    for name in ("q", "v", "drive"):
        dataset[name].attrs["units"] = {
            "q": "see coordinate_unit",
            "v": "coordinate_unit per second",
            "drive": "N m for rad, N for m",
        }[name]
    if mechanism.clearance:
        for name, kind in (("mode", Mode), ("form", Form)):
            members = [member.name.lower() for member in kind]  # type: ignore[var-annotated]
            dataset[name].attrs["flag_meanings"] = " ".join(members)
            dataset[name].attrs["flag_values"] = np.arange(len(members), dtype=np.int8)
    return Result(dataset)


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries that enter a result."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("jointplay", "pin", "numpy", "numba", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            found[name] = "unknown"
    return found


def _units(mechanism: Mechanism, coordinate: str) -> str:
    joint, _, part = coordinate.partition(".")
    if part:
        return "m" if part in AXES else "rad"
    return "m" if mechanism.description.joints[joint].kind == "prismatic" else "rad"


def _kinematics(mechanism: Mechanism, q: np.ndarray, v: np.ndarray) -> dict[str, Any]:
    """Tool motion, energies, and the orientation of each bearing, for every record."""
    model, data = mechanism.model, mechanism.data
    frame = model.frames[mechanism.tool_frame]
    carriers = {joint: mechanism.bearing_joint(joint)[0] for joint in mechanism.clearance}
    n = len(q)
    kinetic, potential = np.empty(n), np.empty(n)
    rotation, translation, twist = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 6))
    bearings = {joint: np.empty((n, 3, 3)) for joint in carriers}
    at = frame.parentJoint
    place, speed = data.oMi[at], data.v[at]
    place_r, place_p, speed_v = place.rotation, place.translation, speed.vector
    views = [(bearings[joint], data.oMi[index].rotation) for joint, index in carriers.items()]
    forward, energy_t, energy_v = (
        pin.forwardKinematics,
        pin.computeKineticEnergy,
        pin.computePotentialEnergy,
    )
    for i in range(n):
        forward(model, data, q[i], v[i])
        kinetic[i] = energy_t(model, data)
        potential[i] = energy_v(model, data)
        rotation[i], translation[i], twist[i] = place_r, place_p, speed_v
        for store, view in views:
            store[i] = view
    arm = frame.placement.translation
    position = translation + rotation @ arm
    local = twist[:, :3] + np.cross(twist[:, 3:], arm)
    for joint, store in bearings.items():
        bearings[joint] = store @ mechanism.bearing_joint(joint)[1].rotation
    return {
        "position": position,
        "velocity": np.einsum("nij,nj->ni", rotation, local),
        "kinetic": kinetic,
        "potential": potential,
        "bearings": bearings,
    }


def _contact(
    mechanism: Mechanism, workspace: Workspace, q: np.ndarray, body: dict[str, Any]
) -> tuple[dict[str, Any], np.ndarray]:
    """Variables of the clearance joints, and the energy stored in their contacts."""
    n, nj = len(q), len(mechanism.clearance)
    poses, tilt = np.empty((n, nj, 3)), np.empty((n, nj))
    gap = np.empty((n, nj, 4))
    mode, form = np.empty((n, nj), np.int8), np.empty((n, nj), np.int8)
    force = workspace.recorded("force").reshape(n, nj, 3).copy()
    peak = workspace.recorded("force_peak").reshape(n, nj, 3).copy()
    elastic = np.zeros(n)
    for j, (name, joint) in enumerate(mechanism.clearance.items()):
        at = mechanism.virtual_link(name)
        pose = np.column_stack([q[:, at : at + 3], journal_axis(q[:, at + 3 : at + 6])])
        poses[:, j] = pose[:, :3]
        tilt[:, j] = np.arctan2(np.hypot(pose[:, 3], pose[:, 4]), pose[:, 5])
        gap[:, j], mode[:, j], form[:, j] = classify_many(
            np.ascontiguousarray(pose), joint.ri, joint.li, joint.rj, joint.lj
        )
        for values in (force, peak):
            values[:, j] = np.einsum("nik,nk->ni", body["bearings"][name], values[:, j])
        for part, contact in (
            (slice(0, 2), joint.radial_contact),
            (slice(2, 4), joint.axial_contact),
        ):
            parameters = joint.normal.parameters(contact)
            elastic += elastic_energy(joint.normal, parameters, -gap[:, j, part]).sum(axis=1)

    def recorded(name: str) -> np.ndarray:
        return workspace.recorded(name).reshape(n, nj, 4)

    each = ("time", "joint", "contact")
    vector = ("time", "joint", "axis")
    variables = {
        "journal_centre": (vector, poses, "m", "journal centre in the bearing frame"),
        "tilt": (("time", "joint"), tilt, "rad", "angle between the axes"),
        "gap": (each, gap, "m", "gap; negative in penetration"),
        "gap_min": (each, recorded("gap_min"), "m", "smallest gap since the last record"),
        "normal_force": (each, recorded("normal"), "N", "normal force"),
        "normal_force_peak": (each, recorded("normal_peak"), "N", "largest since the last record"),
        "friction_force": (each, recorded("tangential"), "N", "friction force, magnitude"),
        "joint_force": (vector, force, "N", "contact force on the journal, world axes"),
        "joint_force_peak": (
            vector,
            peak,
            "N",
            "joint_force where its magnitude was largest since the last record",
        ),
        "mode": (("time", "joint"), mode, "1", "mode of the joint (Table 1)"),
        "form": (("time", "joint"), form, "1", "contact form (Figure 2)"),
    }
    return variables, elastic


def _reactions(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    drive: np.ndarray,
    friction: Mapping[str, JointFriction],
) -> np.ndarray:
    """Constraint forces at the joints of an ideal robot, world axes (n, joints, 3) [N]."""
    model, data = mechanism.model, mechanism.data
    forces = np.empty((len(q), len(mechanism.joints), 3))
    indices = [model.getJointId(name) for name in mechanism.joints]
    losses = np.zeros_like(v)
    for name, joint in friction.items():
        at = mechanism.coordinate(name)
        losses[:, at] = joint.torque(v[:, at])
    for i in range(len(q)):
        acceleration = pin.aba(model, data, q[i], v[i], drive[i] - losses[i])
        pin.rnea(model, data, q[i], v[i], acceleration)
        pin.forwardKinematics(model, data, q[i])  # rnea leaves the orientations oMi alone
        for k, index in enumerate(indices):
            forces[i, k] = data.oMi[index].rotation @ data.f[index].linear
    return forces
