"""From the records of a run to its time histories: what a `Result` is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.geometry import Form, Mode, classify_many
from jointplay.joints import VIRTUAL_LINK
from jointplay.kernel import AZIMUTHS, Status
from jointplay.kernel.workspace import Workspace
from jointplay.loads.base import Load
from jointplay.loads.drive import JointFriction
from jointplay.loads.limits import beyond
from jointplay.loads.terms import TERMS
from jointplay.mechanism.impact import elastic_energy
from jointplay.mechanism.loop import ANGLE_ARM_M, locked
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.tree import Frame, Motion, Tree
from jointplay.result.audit import Audit, Judgement
from jointplay.result.loads import Acting, Pushes
from jointplay.result.result import AXES, FORMAT, Result

if TYPE_CHECKING:
    pass

QUATERNION = ("w", "x", "y", "z")
"""Components of orientations, in their order."""
CONVENTION = (
    "Hamilton quaternion w, x, y, z of the active rotation from the tool's axes to the world's: "
    "v_world = R(quaternion) v_tool; the scalar comes first, signs do not jump"
)


@dataclass(frozen=True)
class Phase:
    """A stretch of a run in which the bodies keep their inertias."""

    row: int
    """First record that belongs to it."""
    model: pin.Model
    energy: float = 0.0
    """What payloads have brought in since the start, when they were picked and released [J]."""


def histories(
    mechanism: Mechanism,
    simulation: dict[str, Any],
    workspace: Workspace,
    friction: Mapping[str, JointFriction],
    phases: Sequence[Phase],
    status: Status,
    message: str,
    wall_time: float,
    judgement: Judgement | None = None,
    loads: Mapping[str, Load] | None = None,
    reactions: bool = True,
) -> Result:
    """Make a `Result` of the records that a run left in its workspace.

    Args:
        mechanism: what was simulated.
        simulation: the whole simulation as plain data, to run it again.
        workspace: the records.
        friction: friction by joint.
        phases: bodies as payloads come and go.
        status, message: how the run ended.
        wall_time: what it took [s].
        judgement: how the run began and from when on it is judged; None: centred, from the start.
        loads: by name, in the order of the run's.
        reactions: whether the constraint forces of an ideal mechanism are found.
    """
    n = workspace.rows
    q, v = (np.ascontiguousarray(workspace.recorded(name)) for name in ("q", "v"))
    stretches = _stretches(phases, n)
    acting = Acting(mechanism, loads or {})
    body = _kinematics(mechanism, q, v, stretches, acting.pairs)
    variables: dict[str, tuple[tuple[str, ...], np.ndarray, str, str]] = {
        "q": (("time", "coordinate"), q, "", "generalised coordinates"),
        "v": (("time", "coordinate"), v, "", "generalised velocities"),
        "drive": (("time", "coordinate"), workspace.recorded("drive"), "", "drive efforts"),
        "tool_position": (("time", "axis"), body["position"], "m", f"{mechanism.tool}, world axes"),
        "tool_velocity": (("time", "axis"), body["velocity"], "m/s", "of the tool, world axes"),
        **_turning(body),
        "kinetic_energy": (("time",), body["kinetic"], "J", "kinetic energy"),
        "potential_energy": (("time",), body["potential"], "J", "potential energy of gravity"),
    }
    work = workspace.recorded("work")
    for index, term in enumerate(TERMS):
        text = f"{term.variable.replace('_', ' ')} since t = 0"
        variables[term.variable] = (("time",), work[:, index], "J", text)
    elastic = np.zeros(n)
    if mechanism.clearance:
        contact, elastic = _contact(mechanism, workspace, body)
        variables |= contact
    elif reactions:
        variables["reaction_force"] = (
            ("time", "moving_joint", "axis"),
            _reactions(
                mechanism,
                q,
                v,
                workspace.recorded("drive"),
                friction,
                stretches,
                acting.pushes(body, workspace),
            ),
            "N",
            "constraint force of the parent on the child at the joint, world axes",
        )
    closed = [name for name in mechanism.loops if name not in mechanism.clearance]
    strict = [*closed, *map(locked, mechanism.locks)]
    if strict:
        gaps = [_drift(mechanism, name, body["poses"][name]) for name in strict]
        drift = np.stack(gaps, axis=1)
        variables["loop_drift"] = (("time", "loop"), drift, "m", "gap of the ideal loop")
    variables["contact_elastic_energy"] = (("time",), elastic, "J", "stored in the contacts")
    if mechanism.gears:
        variables["gear_elastic_energy"] = (
            ("time",),
            stored := _gear_energy(mechanism, q),
            "J",
            "stored in the gears",
        )
        elastic = elastic + stored
    coordinates: dict[str, Any] = {}
    if acting.loads:
        found, coordinates = acting.histories(q, body, workspace)
        variables |= found
        elastic = elastic + found["load_energy"][1].sum(axis=1)
        work = np.hstack([work, -found["load_work"][1]])
    if len(phases) > 1:
        brought = np.concatenate([np.full(hi - lo, phase.energy) for lo, hi, phase in stretches])
        variables["payload_energy"] = (("time",), brought, "J", "brought in by payloads")
        work = work.copy()
        work[:, 0] += brought
    energy = body["kinetic"] + body["potential"] + elastic - work[:, 0] + work[:, 1:].sum(axis=1)
    residual = energy - energy[:1]
    variables["energy_residual"] = (("time",), residual, "J", "error of the energy balance")

    units = [_units(mechanism, name) for name in mechanism.coordinates]
    coordinates |= {
        "time": ("time", workspace.recorded("time")[:, 0], {"units": "s"}),
        "coordinate": list(mechanism.coordinates),
        "coordinate_unit": ("coordinate", units),
        "axis": list(AXES),
        "quaternion": list(QUATERNION),
    }
    if mechanism.clearance:
        coordinates |= {"joint": list(mechanism.clearance), "contact": contact_names(mechanism)}
    else:
        coordinates["moving_joint"] = [*mechanism.joints, *closed]
    if strict:
        coordinates["loop"] = strict
    if "sliding_work" in variables:
        azimuths = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        text = "around the bore, from the bearing's x axis"
        coordinates["azimuth"] = ("azimuth", azimuths, {"units": "rad", "long_name": text})
    drift = variables["loop_drift"][1] if strict else np.zeros(0)
    audit = Audit.of(
        mechanism,
        simulation,
        workspace,
        (body["kinetic"], body["potential"]),
        work,
        residual,
        drift,
        judgement,
        _beyond_limits(mechanism, simulation, workspace, acting),
    )
    import xarray as xr  # takes long to import

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
    dataset["tool_orientation"].attrs["comment"] = CONVENTION
    if mechanism.clearance:
        for name, kind in (("mode", Mode), ("form", Form)):
            members = [member.name.lower() for member in kind]  # type: ignore[var-annotated]
            dataset[name].attrs["flag_meanings"] = " ".join(members)
            dataset[name].attrs["flag_values"] = np.arange(len(members), dtype=np.int8)
        dataset["form"].attrs["comment"] = "-1 for joints that Figure 2 does not show"
    return Result(dataset)


def _beyond_limits(
    mechanism: Mechanism, simulation: Mapping[str, Any], workspace: Workspace, acting: Acting
) -> tuple[str, ...]:
    """In what the run went beyond the URDF's limits, unless they are to be ignored."""
    if simulation["limits"] == "ignore":
        return ()
    effort = workspace.recorded("drive") + acting.driven(workspace)
    time, q, v = (workspace.recorded(name) for name in ("time", "q", "v"))
    return beyond(mechanism, time[:, 0], q, v, effort)


def _turning(body: Mapping[str, Any]) -> dict[str, Any]:
    """The tool's orientation and angular velocity."""
    text = "orientation of the tool in the world, unit quaternion w, x, y, z"
    return {
        "tool_orientation": (("time", "quaternion"), body["orientation"], "1", text),
        "tool_angular_velocity": (
            ("time", "axis"),
            body["spin"],
            "rad/s",
            "angular velocity of the tool, world axes",
        ),
    }


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries that enter a result."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """The same, looked up once: that takes milliseconds."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("jointplay", "pin", "numpy", "numba", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            found[name] = "unknown"
    return found


def contact_names(mechanism: Mechanism) -> list[str]:
    """Names of the contacts of all joints, each once."""
    names = (name for joint in mechanism.clearance.values() for name in joint.contacts)
    return list(dict.fromkeys(names))


def _units(mechanism: Mechanism, coordinate: str) -> str:
    joint, _, part = coordinate.partition(".")
    if part in VIRTUAL_LINK:
        return "m" if part in AXES else "rad"
    return "m" if mechanism.description.joints[joint].kind == "prismatic" else "rad"


def _stretches(phases: Sequence[Phase], n: int) -> list[tuple[int, int, Phase]]:
    """First record, end and phase of each stretch of the n records; none of them empty."""
    ends = [min(phase.row, n) for phase in phases[1:]] + [n]
    return [
        (phase.row, end, phase) for phase, end in zip(phases, ends, strict=True) if phase.row < end
    ]


def _gear_energy(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Energy stored in the teeth and shafts of all gears, shape (n,) [J]."""
    energy = np.zeros(len(q))
    for name, gear in mechanism.gears.items():
        twist = np.abs(q[:, mechanism.motor(name)] - q[:, mechanism.coordinate(name)])
        energy += 0.5 * gear.stiffness * np.maximum(twist - gear.play / 2.0, 0.0) ** 2
    return energy


def _kinematics(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    stretches: Sequence[tuple[int, int, Phase]],
    more: Mapping[Any, tuple[Frame, Frame]],
) -> dict[str, Any]:
    """Tool motion and energies by record; by joint with clearance, loop and pair of `more`.

    `bearings` (n, 3, 3) and `poses` (n, 12), by name.
    """
    names: list[Any] = list(dict.fromkeys([*mechanism.clearance, *mechanism.loops]))
    pairs = [(mechanism.bearing_frame(name), mechanism.journal_frame(name)) for name in names]
    names += map(locked, mechanism.locks)
    pairs += mechanism.locks.values()
    names += more
    pairs += more.values()
    frame = mechanism.model.frames[mechanism.tool_frame]
    tool = int(frame.parentJoint), frame.placement
    motion, n = Motion.of(len(q), len(pairs)), len(q)
    for first, end, phase in stretches:
        Tree(phase.model).move(motion, first, end, q, v, tool, pairs)
    return {
        "position": motion.tool[:, :3],
        "velocity": motion.tool[:, 3:],
        "orientation": motion.orientation,
        "spin": motion.spin,
        "kinetic": motion.energy[:, 0],
        "potential": motion.energy[:, 1],
        "bearings": dict(zip(names, motion.bearings.reshape(len(pairs), n, 3, 3), strict=True)),
        "poses": dict(zip(names, motion.poses, strict=True)),
    }


def _drift(mechanism: Mechanism, name: str, poses: np.ndarray) -> np.ndarray:
    """Largest `misfit` of an ideal loop or a lock, by the journal's poses (n, 12): (n,) [m]."""
    parts = [poses[:, :3]]
    if name not in mechanism.loops:
        parts.append(ANGLE_ARM_M * poses[:, [5, 8, 6]])
    elif mechanism.loop_class(name).holds_axis():  # an ideal slider closes no loop
        parts.append(ANGLE_ARM_M * poses[:, [5, 8]])
    return np.abs(np.concatenate(parts, axis=1)).max(axis=1)


def _contact(
    mechanism: Mechanism, workspace: Workspace, body: dict[str, Any]
) -> tuple[dict[str, Any], np.ndarray]:
    """Variables of the joints with clearance, and the energy stored in their contacts."""
    n, nj, width = workspace.rows, len(mechanism.clearance), workspace.contacts.shape[1]
    names = contact_names(mechanism)
    centre, tilt = np.empty((n, nj, 3)), np.empty((n, nj))
    mode, form = np.empty((n, nj), np.int8), np.empty((n, nj), np.int8)
    force = workspace.recorded("force").reshape(n, nj, 3).copy()
    peak = workspace.recorded("force_peak").reshape(n, nj, 3).copy()
    film = workspace.recorded("film_force").reshape(n, nj, 3).copy()
    gap = np.full((n, nj, len(names)), np.nan)
    by_contact = {
        name: (workspace.recorded(name).reshape(n, nj, width), np.full_like(gap, np.nan))
        for name in ("gap_min", "normal", "normal_peak", "tangential")
    }
    elastic = np.zeros(n)
    for j, (name, joint) in enumerate(mechanism.clearance.items()):
        bearing, poses = body["bearings"][name], body["poses"][name]
        centre[:, j] = poses[:, :3]
        tilt[:, j] = np.arctan2(np.hypot(poses[:, 5], poses[:, 8]), poses[:, 11])
        count = len(joint.contacts)
        at = [names.index(contact) for contact in joint.contacts]
        gap[:, j, at], mode[:, j], form[:, j] = classify_many(
            int(joint.shape), np.array(joint.dimensions), count, poses
        )
        for recorded, values in by_contact.values():
            values[:, j, at] = recorded[:, j, :count]
        for values in (force, peak, film):
            values[:, j] = np.einsum("nik,nk->ni", bearing, values[:, j])
        groups: dict[Any, list[int]] = {}
        for k in range(count):
            groups.setdefault(joint.contact_properties(k), []).append(at[k])
        for contact, members in groups.items():
            parameters = joint.normal.parameters(contact)
            elastic += elastic_energy(joint.normal, parameters, -gap[:, j, members]).sum(axis=1)

    each = ("time", "joint", "contact")
    vector = ("time", "joint", "axis")
    last = "largest since the last record"
    variables = {
        "journal_centre": (vector, centre, "m", "journal centre in the bearing frame"),
        "tilt": (("time", "joint"), tilt, "rad", "angle between the axes"),
        "gap": (each, gap, "m", "gap; negative in penetration"),
        "gap_min": (each, by_contact["gap_min"][1], "m", "smallest gap since the last record"),
        "normal_force": (each, by_contact["normal"][1], "N", "normal force"),
        "normal_force_peak": (each, by_contact["normal_peak"][1], "N", last),
        "friction_force": (each, by_contact["tangential"][1], "N", "friction force, magnitude"),
        "joint_force": (vector, force, "N", "contact force on the journal, world axes"),
        "joint_force_peak": (
            vector,
            peak,
            "N",
            "joint_force where its magnitude was largest since the last record",
        ),
        "film_force": (vector, film, "N", "part of joint_force that is the film's, world axes"),
        "mode": (("time", "joint"), mode, "1", "mode of the joint (Table 1)"),
        "form": (("time", "joint"), form, "1", "contact form (Figure 2)"),
    }
    if any(joint.wears for joint in mechanism.clearance.values()):
        counted = np.full((nj, len(names), AZIMUTHS), np.nan)
        for j, joint in enumerate(mechanism.clearance.values()):
            for k, work in enumerate(workspace.sliding_work[j]):
                counted[j, names.index(joint.contacts[k])] = work
        text = "normal force times sliding distance over the whole run"
        variables["sliding_work"] = (("joint", "contact", "azimuth"), counted, "N m", text)
    if all(joint.film is None for joint in mechanism.clearance.values()):
        del variables["film_force"]
    return variables, elastic


def _reactions(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    drive: np.ndarray,
    friction: Mapping[str, JointFriction],
    stretches: Sequence[tuple[int, int, Phase]],
    pushes: Pushes,
) -> np.ndarray:
    """Constraint forces at the joints of an ideal mechanism, world axes (n, joints, 3) [N].

    The joints of the tree come first, then those that close loops.
    """
    tree, loops = mechanism.joints, list(mechanism.loops)
    forces = np.zeros((len(q), len(tree) + len(loops), 3))
    effort = drive + pushes.efforts
    for name, joint in friction.items():
        at = mechanism.coordinate(name)
        effort[:, at] -= joint.torque(v[:, at])
    for first, end, phase in stretches:
        joints = [int(phase.model.getJointId(name)) for name in tree]
        held = mechanism.constraints(q[first], 0.0)
        found, holds = Tree(phase.model).reactions(
            first, end, q, v, effort, joints, held, pushes.bodies, pushes.wrenches
        )
        forces[first:end, : len(tree)] = found
        for k, constraint in enumerate(held):
            forces[first:end, len(tree) + loops.index(constraint.name)] += holds[:, k]
    return forces
