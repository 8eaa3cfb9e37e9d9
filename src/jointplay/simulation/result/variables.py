"""Variables of a result: their declarations, and how each is computed from records.

`HISTORIES` declares all time histories with dimensions and units. The functions below compute them
for a portion of records: body motion, contacts, gears, loads, and forces of ideal joints;
`histories.HistoryBuilder` puts them together.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.model.frames import WORLD_FRAME, Frame, carried
from jointplay.model.impact import elastic_energy
from jointplay.model.loop import ANGLE_ARM_M, locked
from jointplay.model.mechanism import Mechanism
from jointplay.model.tree import BodyMotion, Tree
from jointplay.physics.contact import elastic, resultant
from jointplay.physics.geometry import Mode, classify_many
from jointplay.physics.joints import VIRTUAL_LINK, Coordinate
from jointplay.physics.kernel import POWERS
from jointplay.physics.kernel.layout import Quantity
from jointplay.simulation.loads.base import Load
from jointplay.simulation.loads.drive import JointFriction

# Terms of the energy balance, one for each power that the kernels integrate.
#
# Results, the audit, the certificate and the energy chart go through this list.


@dataclass(frozen=True)
class Term:
    """Work of one kind of force since the start."""

    power: str
    """Name of the kernels' power."""
    variable: str
    """Name of the history."""
    label: str
    """Label in charts."""
    lost: bool = True
    """Whether it takes energy out of the mechanism; else it brings it in."""


TERMS = (
    Term("drive", "drive_work", "work of the drives", lost=False),
    Term("normal_dissipation", "normal_dissipation", "lost in normal contact"),
    Term("friction_dissipation", "friction_dissipation", "lost in sliding and rolling"),
    Term("joint_friction", "joint_friction_loss", "lost in joint friction"),
    Term("gear_dissipation", "gear_dissipation", "lost in gears"),
    Term("film_dissipation", "film_dissipation", "lost in oil"),
)
"""The terms, in the order of the kernels' powers."""

if tuple(term.power for term in TERMS) != POWERS:
    raise TypeError(f"the terms of the energy balance are not the kernels': {', '.join(POWERS)}")

LOSSES = tuple(term.variable for term in TERMS if term.lost)
"""Time histories of energy lost."""


# Declarations of time histories: what a run writes, and what a file must have.


@dataclass(frozen=True)
class History:
    """A time history, along the time and further dimensions."""

    dims: tuple[str, ...]
    """Dimensions after ``time``."""
    unit: str
    text: str
    """Description, the history's ``long_name``."""
    of: str = "all"
    """Results that have it: ``all``, those with ``play``, ``ideal`` ones, those that were
    ``compared`` with the ideal mechanism's; or ``some``."""


_EACH, _JOINT, _VECTOR = ("joint", "contact"), ("joint",), ("joint", "axis")

HISTORIES = {
    "q": History(("coordinate",), "see coordinate_unit", "generalised coordinates"),
    "v": History(("coordinate",), "coordinate_unit per second", "generalised velocities"),
    "drive": History(("coordinate",), "N m for rad, N for m", "drive efforts"),
    "tool_position": History(("axis",), "m", "{tool}, world axes"),
    "tool_velocity": History(("axis",), "m/s", "of the tool, world axes"),
    "tool_orientation": History(
        ("quaternion",), "1", "orientation of the tool in the world, unit quaternion w, x, y, z"
    ),
    "tool_angular_velocity": History(
        ("axis",), "rad/s", "angular velocity of the tool, world axes"
    ),
    "kinetic_energy": History((), "J", "kinetic energy"),
    "potential_energy": History((), "J", "potential energy of gravity"),
    **{
        term.variable: History((), "J", f"{term.variable.replace('_', ' ')} since t = 0")
        for term in TERMS
    },
    "reaction_force": History(
        ("moving_joint", "axis"),
        "N",
        "constraint force of the parent on the child at the joint, world axes",
        "ideal"
    ),
    "journal_centre": History(_VECTOR, "m", "journal centre in the bearing frame", "play"),
    "tilt": History(_JOINT, "rad", "angle between the axes", "play"),
    "gap": History(_EACH, "m", "gap; negative in penetration", "play"),
    "gap_min": History(_EACH, "m", "smallest gap since the last record", "play"),
    "normal_force": History(_EACH, "N", "normal force", "play"),
    "normal_force_peak": History(_EACH, "N", "largest since the last record", "play"),
    "friction_force": History(_EACH, "N", "friction force, magnitude", "play"),
    "joint_force": History(_VECTOR, "N", "contact force on the journal, world axes", "play"),
    "joint_force_peak": History(
        _VECTOR, "N", "joint_force where its magnitude was largest since the last record", "play"
    ),
    "film_force": History(
        _VECTOR, "N", "part of joint_force that is the film's, world axes", "some"
    ),
    "mode": History(_JOINT, "1", "mode of the joint (Table 1)", "play"),
    "form": History(_JOINT, "1", "contact form (Figure 2)", "play"),
    "joint_moment": History(
        _VECTOR, "N m", "of the loaded elements on the inner ring about its centre, world axes",
        "some"
    ),
    "loaded_elements": History(_JOINT, "1", "elements that bear load", "some"),
    "cage_angle": History(_JOINT, "rad", "azimuth of the first element", "some"),
    "loop_drift": History(("loop",), "m", "gap of the ideal loop", "some"),
    "contact_elastic_energy": History((), "J", "stored in the contacts"),
    "payload_energy": History((), "J", "brought in by payloads", "some"),
    "energy_residual": History((), "J", "error of the energy balance"),
    "tool_error": History((), "m", "distance of the tool from the ideal one", "compared"),
    "tool_error_vector": History(
        ("axis",), "m", "position of the tool less the ideal one's, world axes", "compared"
    ),
    "tool_turn": History((), "rad", "angle between the tool and the ideal one", "compared"),
    "ideal_tool_position": History(
        ("axis",), "m", "tool of the ideal mechanism, world axes", "compared"
    ),
    "ideal_tool_velocity": History(("axis",), "m/s", "of the ideal tool, world axes", "compared"),
    "ideal_tool_orientation": History(
        ("quaternion",), "1", "orientation of the ideal tool, unit quaternion w, x, y, z",
        "compared"
    ),
    "ideal_tool_angular_velocity": History(
        ("axis",), "rad/s", "angular velocity of the ideal tool, world axes", "compared"
    )
}  # fmt: skip
"""Time histories by name; gears and loads add their own."""


# Records of a run, all or a portion of them, wherever they are kept.


@dataclass(frozen=True)
class Records:
    """Some consecutive records; their columns are those of `Workspace.recorded`."""

    rows_of: np.ndarray
    """One record a row, shape (n, columns)."""
    fields: Mapping[str, Quantity]
    """Columns of each quantity, by name."""
    first: int = 0
    """Number of the run's records before these."""

    @property
    def rows(self) -> int:
        return len(self.rows_of)

    def recorded(self, name: str) -> np.ndarray:
        """A quantity of `layout.ROW`, shape (n, ...)."""
        return self.fields[name].of(self.rows_of)

    def part(self, begin: int, end: int) -> Records:
        """The records from `begin` to `end`, counted from the first one here."""
        return Records(self.rows_of[begin:end], self.fields, self.first + begin)

    def parts(self, size: int) -> Iterator[Records]:
        """All records, `size` at a time; at least one part, empty without records."""
        for begin in range(0, max(self.rows, 1), size):
            yield self.part(begin, begin + size)


# Loads: their energies, works and own histories, and the bodies that they push.


Variables = dict[str, tuple[tuple[str, ...], np.ndarray, str, str]]
"""Dimensions, values, unit and description of each variable, by name."""


class BoundLoads:
    """The loads of a run, bound to its mechanism.

    Attributes:
        pairs: pairs of frames whose relative poses are needed, by a key: those of each load between
            frames, and the world with its second one.
    """

    def __init__(self, mechanism: Mechanism, loads: Mapping[str, Load]) -> None:
        self.mechanism, self.loads = mechanism, loads
        self._sites = {name: load.site(mechanism) for name, load in loads.items()}
        self.pairs: dict[Any, tuple[Frame, Frame]] = {}
        for name, site in self._sites.items():
            if site.frames is not None:
                self.pairs["load", name] = site.frames
                self.pairs["world", name] = (WORLD_FRAME, site.frames[1])

    def _answers(self, records: Records) -> dict[str, np.ndarray]:
        """Recorded answers of each load's law, (n, size)."""
        recorded, answers, at = records.recorded("load_force"), {}, 0
        for name, site in self._sites.items():
            size = len(site.outputs) if site.frames is None else 6
            answers[name] = recorded[:, at : at + size]
            at += size
        return answers

    def histories(
        self, q: np.ndarray, body: Mapping[str, Any], records: Records
    ) -> tuple[Variables, dict[str, Any]]:
        """Variables of the loads and their coordinates, for records with coordinates q (n, nq).

        `body["poses"]` has the poses of `pairs` (n, 12), by key.
        """
        n, names = len(q), list(self.loads)
        energy, answers = np.zeros((n, len(names))), self._answers(records)
        parts, values, units = [], [], []
        for i, (name, load) in enumerate(self.loads.items()):
            site = self._sites[name]
            x = q[:, list(site.inputs)] if site.frames is None else body["poses"]["load", name]
            energy[:, i] = load.energy(x, load.numbers(self.mechanism))
            for series in load.record(x, answers[name]):
                parts.append(f"{name}.{series.name}")
                values.append(series.values)
                units.append(series.unit)
        work = records.recorded("load_work").copy()
        by_load, part = ("time", "load"), ("time", "load_part")
        text = "work added by the load since t = 0, beyond its stored energy"
        variables: Variables = {
            "load_energy": (by_load, energy, "J", "energy stored in the load"),
            "load_work": (by_load, work, "J", text),
            "load_record": (part, np.stack(values, axis=1), "", "quantities that loads record"),
        }
        units_of_parts = ("load_part", units)
        return variables, {"load": names, "load_part": parts, "load_part_unit": units_of_parts}

    def driven(self, records: Records) -> np.ndarray:
        """Efforts of the loads that are actuators of joints, (n, nv) [N m or N]."""
        efforts = np.zeros((records.rows, self.mechanism.model.nv))
        for name, answers in self._answers(records).items():
            if self.loads[name].driven():
                efforts[:, list(self._sites[name].outputs)] += answers
        return efforts

    def pushes(
        self, body: Mapping[str, Any], records: Records
    ) -> tuple[np.ndarray, list[int], np.ndarray]:
        """Efforts and wrenches of all loads.

        Returns:
            Efforts on the coordinates (n, nv) [N m or N]; Pinocchio joints of the bodies that
            wrenches act on; and these wrenches: force [N], moment about the world's origin [N m],
            world axes, (n, bodies, 6).
        """
        n = records.rows
        efforts = np.zeros((n, self.mechanism.model.nv))
        bodies: list[int] = []
        wrenches = []
        for name, answers in self._answers(records).items():
            site = self._sites[name]
            if site.frames is None:
                efforts[:, list(site.outputs)] += answers
                continue
            turn = body["bearings"]["load", name]
            force = np.einsum("nik,nk->ni", turn, answers[:, :3])
            moment = np.einsum("nik,nk->ni", turn, answers[:, 3:])
            moment = moment + np.cross(body["poses"]["world", name][:, :3], force)
            wrench = np.hstack([force, moment])
            bodies += [site.frames[0][0], site.frames[1][0]]
            wrenches += [-wrench, wrench]
        stacked = np.stack(wrenches, axis=1) if wrenches else np.zeros((n, 0, 6))
        return efforts, bodies, stacked


@dataclass(frozen=True)
class Phase:
    """A stretch of a run in which the bodies keep their inertias."""

    row: int
    """First record that belongs to it."""
    model: pin.Model
    """The bodies, payloads in hand."""
    energy: float = 0.0
    """Energy that payloads have brought in since the start, by being picked and released [J]."""


def declared(values: Mapping[str, np.ndarray], **insertions: str) -> Variables:
    """Variables with dimensions, units and texts of `HISTORIES`; `insertions` fill the texts."""
    return {
        name: (("time", *history.dims), array, history.unit, history.text.format(**insertions))
        for name, array in values.items()
        for history in (HISTORIES[name],)
    }


def contact_names(mechanism: Mechanism) -> list[str]:
    """Names of the contacts of all joints, each once."""
    names = (name for joint in mechanism.clearance.values() for name in joint.contacts)
    return list(dict.fromkeys(names))


def unit_of(mechanism: Mechanism, coordinate: Coordinate) -> str:
    """Unit of a coordinate, ``m`` or ``rad``."""
    if coordinate.part in VIRTUAL_LINK:
        return "m" if coordinate.length else "rad"
    return mechanism.description.joints[coordinate.joint].unit


def phase_stretches(phases: Sequence[Phase], first: int, n: int) -> list[tuple[int, int, Phase]]:
    """Begin, end and phase of each stretch of the n records from `first` on that is not empty."""
    begins = [max(phase.row - first, 0) for phase in phases]
    ends = [min(begin, n) for begin in begins[1:]] + [n]
    stretches = zip(begins, ends, phases, strict=True)
    return [(begin, end, phase) for begin, end, phase in stretches if begin < end]


_EFFORTS = {"rad": "N m", "m": "N"}
"""Unit of a joint's effort, by that of its position."""


def gear_variables(
    mechanism: Mechanism, records: Records, q: np.ndarray
) -> tuple[Variables, dict[str, Any], np.ndarray]:
    """Histories of the gears, their coordinates, and the energy stored in all of them (n,) [J]."""
    names = list(mechanism.gears)
    torque, hysteresis = np.moveaxis(records.recorded("gear"), 2, 0)
    energy = np.zeros(len(q))
    for index, (name, gear) in enumerate(mechanism.gears.items()):
        twist = gear.twist(q[:, mechanism.motor(name)], q[:, mechanism.coordinate(name)])
        energy += gear.stored_energy(twist, hysteresis[:, index])
    stored = "stored in the gears"
    variables: Variables = {"gear_elastic_energy": (("time",), energy, "J", stored)}
    units = {mechanism.description.joints[name].unit for name in names}
    unit = _EFFORTS[units.pop()] if len(units) == 1 else HISTORIES["drive"].unit
    text = "torque or force that the gear transmits to the joint"
    variables["gear_torque"] = (("time", "gear"), torque, unit, text)
    text = "part of it that hysteresis holds"
    variables["gear_hysteresis"] = (("time", "gear"), hysteresis, unit, text)
    return variables, {"gear": names}, energy


def kinematics(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    stretches: Sequence[tuple[int, int, Phase]],
    more: Mapping[Any, tuple[Frame, Frame]],
    trees: dict[int, Tree],
) -> dict[str, Any]:
    """Motion of the tool, energies, and relative poses, by record.

    Args:
        mechanism, q, v: the mechanism and its states, (n, nv).
        stretches: as of `phase_stretches`.
        more: pairs of frames beside those of joints with clearance, loops and locks.
        trees: keeps the trees of the phases, by row.

    Returns:
        `position`, `velocity`, `orientation` and `spin` of the tool, `kinetic` and `potential`
        energy; and of each pair of frames, by its name, `bearings`, the orientation of the first
        (n, 3, 3), and `poses`, those of the second in the first (n, 12).
    """
    names: list[Any] = list(dict.fromkeys([*mechanism.clearance, *mechanism.loops]))
    pairs = [mechanism.frames(name) for name in names]
    names += map(locked, mechanism.locks)
    pairs += mechanism.locks.values()
    names += more
    pairs += more.values()
    tool = carried(mechanism.model, mechanism.tool_frame)
    body, n = BodyMotion.of(len(q), len(pairs)), len(q)
    for first, end, phase in stretches:
        if phase.row not in trees:
            trees[phase.row] = Tree(phase.model)
        trees[phase.row].move(body, first, end, q, v, tool, pairs)
    return {
        "position": body.tool[:, :3],
        "velocity": body.tool[:, 3:],
        "orientation": body.orientation,
        "spin": body.spin,
        "kinetic": body.energy[:, 0],
        "potential": body.energy[:, 1],
        "bearings": dict(zip(names, body.bearings.reshape(len(pairs), n, 3, 3), strict=True)),
        "poses": dict(zip(names, body.poses, strict=True)),
    }


def loop_drift(mechanism: Mechanism, name: str, poses: np.ndarray) -> np.ndarray:
    """Gap of an ideal loop or a lock, its largest `misfit`, at poses (n, 12) of the journal, (n,)
    [m].
    """
    parts = [poses[:, :3]]
    if name not in mechanism.loops:
        parts.append(ANGLE_ARM_M * poses[:, [5, 8, 6]])
    elif mechanism.loop_class(name).holds_axis():  # an ideal slider closes no loop
        parts.append(ANGLE_ARM_M * poses[:, [5, 8]])
    return np.abs(np.concatenate(parts, axis=1)).max(axis=1)


def contact_variables(
    mechanism: Mechanism, records: Records, body: Mapping[str, Any], only: Collection[str]
) -> tuple[Variables, np.ndarray]:
    """Variables of the joints with clearance that are in `only`, and their contacts' energy."""
    n, nj = records.rows, len(mechanism.clearance)
    names = contact_names(mechanism)
    mode, form = np.empty((n, nj), np.int8), np.empty((n, nj), np.int8)
    gap = np.full((n, nj, len(names)), np.nan)
    stored = np.zeros(n)
    rolls = any(joint.resultant is not None for joint in mechanism.clearance.values())
    moment, loaded = np.full((n, nj, 3), np.nan), np.full((n, nj), np.nan)
    cage = np.full((n, nj), np.nan)
    for j, (name, joint) in enumerate(mechanism.clearance.items()):
        poses = body["poses"][name]
        count = len(joint.contacts)
        at = [names.index(contact) for contact in joint.contacts]
        if joint.resultant is None:
            gap[:, j, at], mode[:, j], form[:, j] = classify_many(
                int(joint.shape), np.array(joint.dimensions), count, poses
            )
        else:  # rolling elements or springs: their law answers for the whole joint
            cage[:, j] = records.recorded("cage")[:, j]
            answers = elastic.answers(joint.law, joint.resultant, poses, cage[:, j])
            gap[:, j, at[0]], loaded[:, j] = (
                -answers[:, resultant.DEEPEST],
                answers[:, resultant.LOADED],
            )
            mode[:, j] = np.where(loaded[:, j] > 0.0, Mode.PSEUDO_PENETRATION, Mode.FREE_FLIGHT)
            form[:, j] = -1
            moment[:, j] = np.einsum("nik,nk->ni", body["bearings"][name], answers[:, 3:6])
            stored += answers[:, resultant.ENERGY]
        # Elastic energy, once for all contacts of the same properties.
        groups: dict[Any, list[int]] = {}
        for k in range(count if joint.resultant is None else 0):
            groups.setdefault(joint.contact_properties(k), []).append(at[k])
        for contact, members in groups.items():
            parameters = joint.normal.parameters(contact)
            stored += elastic_energy(joint.normal, parameters, -gap[:, j, members]).sum(axis=1)

    histories = {"gap": gap, "mode": mode, "form": form}
    if rolls:
        histories |= {"joint_moment": moment, "loaded_elements": loaded, "cage_angle": cage}
    histories |= _journals(mechanism, body, only)
    histories |= _recorded_contacts(mechanism, records, body, only)
    return declared(
        {name: histories[name] for name in HISTORIES if name in histories and name in only}
    ), stored


def _journals(
    mechanism: Mechanism, body: Mapping[str, Any], only: Collection[str]
) -> dict[str, np.ndarray]:
    """Centres and tilts of the journals."""
    poses = [body["poses"][name] for name in mechanism.clearance]
    histories = {}
    if "journal_centre" in only:
        histories["journal_centre"] = np.stack([pose[:, :3] for pose in poses], axis=1)
    if "tilt" in only:
        tilts = (np.arctan2(np.hypot(pose[:, 5], pose[:, 8]), pose[:, 11]) for pose in poses)
        histories["tilt"] = np.stack([*tilts], axis=1)
    return histories


_BY_CONTACT = {
    "gap_min": "gap_min",
    "normal_force": "normal",
    "normal_force_peak": "normal_peak",
    "friction_force": "tangential",
}
"""Histories by contact, and the recorded quantity of each."""

_TURNED = {"joint_force": "force", "joint_force_peak": "force_peak", "film_force": "film_force"}
"""Histories in world axes, and the quantities that are recorded in the bearings' axes."""


def _recorded_contacts(
    mechanism: Mechanism, records: Records, body: Mapping[str, Any], only: Collection[str]
) -> dict[str, np.ndarray]:
    """Recorded quantities of the contacts, in the shape and axes of results."""
    names, joints = contact_names(mechanism), mechanism.clearance
    histories = {}
    for name in _BY_CONTACT.keys() & set(only):
        recorded = records.recorded(_BY_CONTACT[name])
        histories[name] = values = np.full((records.rows, len(joints), len(names)), np.nan)
        for j, joint in enumerate(joints.values()):
            at = [names.index(contact) for contact in joint.contacts]
            values[:, j, at] = recorded[:, j, : len(at)]
    turned = _TURNED.keys() & set(only)
    if all(joint.film is None for joint in joints.values()):
        turned -= {"film_force"}
    for name in turned:
        recorded = records.recorded(_TURNED[name])
        histories[name] = values = np.empty_like(recorded)
        for j, joint in enumerate(joints):
            values[:, j] = np.einsum("nik,nk->ni", body["bearings"][joint], recorded[:, j])
    return histories


def applied_effort(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    records: Records,
    friction: Mapping[str, JointFriction],
    loads: np.ndarray,
) -> np.ndarray:
    """Efforts of drives, `loads`, gears and joint friction on the coordinates, shape (n, nv).

    Friction of gears is left out: it acts on motors, which have no mass to be moved.
    """
    effort = records.recorded("drive") + loads
    torques = records.recorded("gear")[:, :, 0].T
    for torque, (name, gear) in zip(torques, mechanism.gears.items(), strict=True):
        motor, link = mechanism.motor(name), mechanism.coordinate(name)
        effort[:, motor] -= (1.0 + gear.kinematic_error(q[:, motor])[1]) * torque
        effort[:, link] += torque
    bristled = iter(records.recorded("joint_bristles").T)  # in the same order, then motors'
    for name, joint in friction.items():
        at = mechanism.coordinate(name)
        held = joint.presliding and (joint.coulomb or joint.excess)
        effort[:, at] -= next(bristled) if held else joint.torque(v[:, at])
    return effort


def reactions(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    effort: np.ndarray,
    stretches: Sequence[tuple[int, int, Phase]],
    constraints: Sequence[Sequence[pin.RigidConstraintModel]],
    bodies: Sequence[int],
    wrenches: np.ndarray,
) -> np.ndarray:
    """Constraint forces at the joints of an ideal mechanism, world axes (n, joints, 3) [N].

    The joints of the tree come first, then those that close loops: `constraints` holds these in
    each of the stretches. `bodies` and `wrenches` are those of `BoundLoads.pushes`.
    """
    tree, loops = mechanism.joints, list(mechanism.loops)
    forces = np.zeros((len(q), len(tree) + len(loops), 3))
    for (first, end, phase), held in zip(stretches, constraints, strict=True):
        joints = [int(phase.model.getJointId(name)) for name in tree]
        tree_forces, holds = Tree(phase.model).reactions(
            first, end, q, v, effort, joints, held, bodies, wrenches
        )
        forces[first:end, : len(tree)] = tree_forces
        for k, constraint in enumerate(held):
            forces[first:end, len(tree) + loops.index(constraint.name)] += holds[:, k]
    return forces
