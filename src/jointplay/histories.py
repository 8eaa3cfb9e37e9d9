"""From the records of a run to its time histories: what a `Result` is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
import xarray as xr

from jointplay.audit import Audit
from jointplay.drive import JointFriction
from jointplay.geometry import Form, Mode, classify_many
from jointplay.impact import elastic_energy
from jointplay.joints import VIRTUAL_LINK
from jointplay.kernel import AZIMUTHS, POWERS, Status
from jointplay.loops import PROXIMAL, misfit
from jointplay.mechanism import Mechanism
from jointplay.result import AXES, FORMAT, Result
from jointplay.workspace import Workspace


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
    """
    n = workspace.rows
    q, v = workspace.recorded("q"), workspace.recorded("v")
    stretches = _stretches(phases, n)
    body = _kinematics(mechanism, q, v, stretches)
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
    names = (
        "drive_work",
        "normal_dissipation",
        "friction_dissipation",
        "joint_friction_loss",
        "gear_dissipation",
        "film_dissipation",
    )
    for index in range(len(POWERS)):
        name = names[index]
        variables[name] = (("time",), work[:, index], "J", f"{name.replace('_', ' ')} since t = 0")
    elastic = np.zeros(n)
    if mechanism.clearance:
        contact, elastic = _contact(mechanism, workspace, body)
        variables |= contact
    else:
        variables["reaction_force"] = (
            ("time", "moving_joint", "axis"),
            _reactions(mechanism, q, v, workspace.recorded("drive"), friction, stretches),
            "N",
            "constraint force of the parent on the child at the joint, world axes",
        )
    closed = [name for name in mechanism.loops if name not in mechanism.clearance]
    if closed:
        drift = np.array([[np.abs(m[name]).max() for name in closed] for m in body["misfits"]])
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
    if len(phases) > 1:
        brought = np.concatenate([np.full(hi - lo, phase.energy) for lo, hi, phase in stretches])
        variables["payload_energy"] = (("time",), brought, "J", "brought in by payloads")
        work = work.copy()
        work[:, 0] += brought
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
        coordinates |= {"joint": list(mechanism.clearance), "contact": contact_names(mechanism)}
    else:
        coordinates["moving_joint"] = [*mechanism.joints, *closed]
    if closed:
        coordinates["loop"] = closed
    if "sliding_work" in variables:
        azimuths = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        text = "around the bore, from the bearing's x axis"
        coordinates["azimuth"] = ("azimuth", azimuths, {"units": "rad", "long_name": text})
    drift = variables["loop_drift"][1] if closed else np.zeros(0)
    audit = Audit.of(mechanism, simulation, workspace, body["kinetic"], work, residual, drift)
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
        dataset["form"].attrs["comment"] = "-1 for joints that Figure 2 does not show"
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
) -> dict[str, Any]:
    """Tool motion, energies, frames of bearings and journals, gaps of ideal loops, by record."""
    n = len(q)
    tool = mechanism.model.frames[mechanism.tool_frame]
    carriers = {
        name: (mechanism.bearing_frame(name), mechanism.journal_frame(name))
        for name in mechanism.clearance
    }
    wanted = {tool.parentJoint}
    wanted |= {index for pair in carriers.values() for index, _ in pair}
    kinetic, potential, twist = np.empty(n), np.empty(n), np.empty((n, 6))
    places = {index: (np.empty((n, 3, 3)), np.empty((n, 3))) for index in wanted}
    misfits = []
    ideal_loops = any(name not in mechanism.clearance for name in mechanism.loops)
    for first, end, phase in stretches:
        model, data = phase.model, phase.model.createData()
        speed = data.v[tool.parentJoint].vector
        views = [(places[i], data.oMi[i].rotation, data.oMi[i].translation) for i in wanted]
        for i in range(first, end):
            pin.forwardKinematics(model, data, q[i], v[i])
            kinetic[i] = pin.computeKineticEnergy(model, data)
            potential[i] = pin.computePotentialEnergy(model, data)
            twist[i] = speed
            for (rotations, translations), rotation, translation in views:
                rotations[i], translations[i] = rotation, translation
            if ideal_loops:
                misfits.append(misfit(mechanism, q[i]))
    rotation, translation = places[tool.parentJoint]
    arm = tool.placement.translation
    local = twist[:, :3] + np.cross(twist[:, 3:], arm)

    def frame(index: int, placement: pin.SE3) -> tuple[np.ndarray, np.ndarray]:
        turn, shift = places[index]
        return turn @ placement.rotation, shift + turn @ placement.translation

    joints = {}
    for name, (bearing, journal) in carriers.items():
        (turn, origin), (turn_j, origin_j) = frame(*bearing), frame(*journal)
        centre = np.einsum("nki,nk->ni", turn, origin_j - origin)
        joints[name] = turn, centre, np.einsum("nki,nkj->nij", turn, turn_j)
    return {
        "position": translation + rotation @ arm,
        "velocity": np.einsum("nij,nj->ni", rotation, local),
        "kinetic": kinetic,
        "potential": potential,
        "joints": joints,
        "misfits": misfits,
    }


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
        bearing, centre[:, j], turn = body["joints"][name]
        tilt[:, j] = np.arctan2(np.hypot(turn[:, 0, 2], turn[:, 1, 2]), turn[:, 2, 2])
        poses = np.concatenate([centre[:, j], turn.reshape(n, 9)], axis=1)
        count = len(joint.contacts)
        at = [names.index(contact) for contact in joint.contacts]
        gap[:, j, at], mode[:, j], form[:, j] = classify_many(
            int(joint.shape), np.array(joint.dimensions), count, np.ascontiguousarray(poses)
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
) -> np.ndarray:
    """Constraint forces at the joints of an ideal mechanism, world axes (n, joints, 3) [N].

    The joints of the tree come first, then those that close loops.
    """
    tree, loops = mechanism.joints, list(mechanism.loops)
    forces = np.zeros((len(q), len(tree) + len(loops), 3))
    effort = drive.copy()
    for name, joint in friction.items():
        at = mechanism.coordinate(name)
        effort[:, at] -= joint.torque(v[:, at])
    for first, end, phase in stretches:
        model = phase.model
        data = model.createData()
        indices = [model.getJointId(name) for name in tree]
        models = pin.StdVec_RigidConstraintModel()
        models.extend(mechanism.constraints(q[first], 0.0))
        datas = pin.StdVec_RigidConstraintData()
        datas.extend([constraint.createData() for constraint in models])
        pin.initConstraintDynamics(model, data, models, datas)
        for i in range(first, end):
            external = pin.StdVec_Force()
            external.extend([pin.Force.Zero()] * model.njoints)
            if loops:
                acceleration = pin.constraintDynamics(
                    model, data, q[i], v[i], effort[i], models, datas, PROXIMAL
                ).copy()
                pin.forwardKinematics(model, data, q[i])
                for constraint, found in zip(models, datas, strict=True):
                    one, two = constraint.joint1_id, constraint.joint2_id
                    push = constraint.joint1_placement.act(found.contact_force)
                    external[one] += push
                    world = data.oMi[one].act(push)
                    external[two] -= data.oMi[two].actInv(world)
                    k = len(tree) + loops.index(constraint.name)
                    forces[i, k] += world.linear
            else:
                acceleration = pin.aba(model, data, q[i], v[i], effort[i])
            pin.rnea(model, data, q[i], v[i], acceleration, external)
            pin.forwardKinematics(model, data, q[i])  # rnea leaves the orientations oMi alone
            for k, index in enumerate(indices):
                forces[i, k] = data.oMi[index].rotation @ data.f[index].linear
    return forces
