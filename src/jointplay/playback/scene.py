"""Everything that is played: robots, their ideal twins, traces, forces, close-ups.

A scene is made once, from results. What does not move are surfaces, each there once however many
links, cases and twins show it; what moves becomes tracks. Both are packed into one block of bytes
with a table of contents, which a page carries to the browser.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.analysis.twins import ideal_simulation, is_twin
from jointplay.errors import JointplayError, MissingName
from jointplay.kernel import Status
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.meshes import Colour, Part
from jointplay.mechanism.seen import Look, look
from jointplay.mechanism.tree import Motion, Tree
from jointplay.playback.closeup import close_up, continuous, quaternions
from jointplay.playback.static_error import static_error
from jointplay.playback.tracks import Impacts, Packer, impacts, keep, strongest
from jointplay.plots.palette import colours
from jointplay.result.result import Result

BUDGET = 60_000
"""Most moments of all cases together, which bounds memory and file alike.

A single minute of motion then has one each millisecond or more, and every record of its impacts.
"""

MICRON, MICRORADIAN = 1e-6, 1e-6
TWIN_RECORD_S = 1e-3
"""Time between two records of an ideal twin [s]."""

SHARPNESS = 2**14
"""Places of a surface's points along its largest extent."""

Notes = list[str]


@dataclass
class Scene:
    """What a page plays.

    Attributes:
        contents: what there is and where in `block` it lies, as plain data.
        block: tracks and surfaces, compressed.
        notes: what the user should know: stand-ins for meshes, missing twins.
    """

    contents: dict[str, Any]
    block: bytes
    notes: Notes = field(default_factory=list)


def build(
    cases: Mapping[str, Result],
    *,
    joint: str | None = None,
    magnification: float | None = None,
    meshes: Sequence[str | Path] = (),
    ghosts: bool = True,
    budget: int = BUDGET,
    progress: bool = False,
) -> Scene:
    """Make the scene of one or several results.

    Args:
        cases: results by label, in the order in which they stand.
        joint: joint with clearance whose close-up is shown first; None takes the first.
        magnification: of displacements in the close-up; None chooses one that shows the gap.
        meshes: folders in which meshes are looked for first.
        ghosts: whether each case has its ideal twin, which may have to be simulated.
        budget: most moments of all cases together.
        progress: show the progress of simulating twins.

    Raises:
        JointplayError: no result, nothing to play in one, no such joint, or a number out of range.
    """
    if not cases:
        raise JointplayError("no result to play")
    if magnification is not None and not (
        math.isfinite(magnification) and 1.0 <= magnification <= 1e4
    ):
        raise JointplayError(f"magnification must lie between 1 and 10000, got {magnification:g}")
    packer, notes = Packer(), Notes()
    names = list(dict.fromkeys(name for result in cases.values() for name in result.joints))
    if joint is not None and joint not in names:
        raise MissingName("joint with clearance", joint, names)
    taken = [_Case(label, result) for label, result in cases.items()]
    entries = []
    surfaces = _Surfaces(packer)
    for case, colour in zip(taken, colours(cases), strict=True):
        entry = case.pack(packer, max(budget // len(taken), 4))
        seen = look(case.mechanism, meshes)
        if seen.missing:
            notes.append(
                f"{case.label}: {len(seen.missing)} of its meshes not found "
                f"({Path(seen.missing[0]).name}, ...): simple shapes instead; "
                "name their folder with --meshes"
            )
        entry |= {"objects": surfaces.objects(seen), "reach": seen.reach}
        entry["ghost"] = None
        if ghosts and (case.result.joints or case.mechanism.gears):
            entry["ghost"] = _ghost(case, taken, packer, notes, progress)
        entry["error"] = _error(case, packer, notes) if entry["ghost"] else None
        entry["colour"] = colour
        entries.append(entry)
    contents = {
        "surfaces": surfaces.entries,
        "cases": entries,
        "joints": names,
        "joint": joint or (names[0] if names else None),
        "magnification": magnification or _magnification(taken),
        "notes": notes,
    }
    return Scene(contents, packer.deflated(), notes)


class _Surfaces:
    """Surfaces of all bodies, each packed once."""

    def __init__(self, packer: Packer) -> None:
        self._packer = packer
        self._number: dict[bytes, int] = {}
        self.entries: list[dict[str, Any]] = []

    def objects(self, seen: Look) -> list[dict[str, Any]]:
        """What stands where: link, surface by number, colour, constant matrix column by column."""
        return [
            {
                "link": shape.link,
                "surface": self._find(part),
                "colour": _hexadecimal(colour),
                "opacity": round(colour[3], 3),
                "matrix": shape.placement.T.ravel().tolist(),
            }
            for shape in seen.shapes
            for part, colour in zip(shape.parts, shape.colours, strict=True)
        ]

    def _find(self, part: Part) -> int:
        key = hashlib.sha256(part.points.tobytes() + part.triangles.tobytes()).digest()
        if key not in self._number:
            self._number[key] = len(self.entries)
            extent = float(np.ptp(part.points, axis=0).max())
            points = self._packer.table(part.points, extent / SHARPNESS)
            triangles = self._packer.mesh(part.triangles)
            self.entries.append({"points": points, "triangles": triangles})
        return self._number[key]


def _hexadecimal(colour: Colour) -> int:
    red, green, blue = (round(255 * min(max(value, 0.0), 1.0)) for value in colour[:3])
    return red << 16 | green << 8 | blue


class _Case:
    """A result, its mechanism, and the moments of it that are played."""

    def __init__(self, label: str, result: Result) -> None:
        self.label, self.result = label, result
        try:
            self.simulation = result.simulation
            q, v = result["q"].values, result["v"].values
            finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
        except (KeyError, TypeError, json.JSONDecodeError) as error:
            raise JointplayError(f"result {label!r} is damaged: {error!r}") from None
        self.mechanism: Mechanism = self.simulation.mechanism
        n = len(q) if finite.all() else int(np.argmin(finite))
        if n < 2:
            raise JointplayError(f"result {label!r} has fewer than two records: nothing to play")
        if q.shape[1] != self.mechanism.model.nq:
            raise JointplayError(
                f"result {label!r} is damaged: {q.shape[1]} coordinates, its mechanism has "
                f"{self.mechanism.model.nq}"
            )
        self.q, self.v, self.time = q[:n], v[:n], result.time[:n]
        self.n = n

    def values(self, name: str) -> np.ndarray:
        return np.nan_to_num(self.result[name].values[: self.n], posinf=0.0, neginf=0.0)

    def pack(self, packer: Packer, budget: int) -> dict[str, Any]:
        """Choose the moments, pack the tracks; returns the case's entry in the contents."""
        joints = list(self.mechanism.clearance)
        peaks = self.values("joint_force_peak") if joints else np.zeros((self.n, 0, 3))
        sizes = np.linalg.norm(peaks, axis=2)
        hits = [impacts(sizes[:, j]) for j in range(len(joints))]
        self.records = keep(self.time, hits, budget)
        self.links = [
            frame.name for frame in self.mechanism.model.frames if frame.type == pin.FrameType.BODY
        ]
        poses = _poses(self.mechanism, self.q[self.records], self.links)
        tool = self.values("tool_position")[self.records]
        span = np.concatenate([poses[:, :, :3].reshape(-1, 3), tool])
        return {
            "label": self.label,
            "message": self.result.message,
            "completed": self.result.status == Status.COMPLETED,
            "start": float(self.time[0]),
            "end": float(self.time[-1]),
            "recorded": self.n,
            "low": span.min(axis=0).tolist(),
            "high": span.max(axis=0).tolist(),
            "links": self.links,
            "time": packer.table(self.time[self.records], 1e-7),
            "poses": _pack_poses(packer, poses),
            "tool": packer.table(tool, 0.1 * MICRON),
            "joints": [
                self._joint(packer, name, j, sizes[:, j], peaks[:, j], hits[j])
                for j, name in enumerate(joints)
            ],
        }

    def _joint(
        self,
        packer: Packer,
        name: str,
        j: int,
        size: np.ndarray,
        peak: np.ndarray,
        hits: Impacts,
    ) -> dict[str, Any]:
        mechanism, clearance = self.mechanism, self.mechanism.clearance[name]
        contacts = [str(contact) for contact in self.result["contact"].values]
        for contact in clearance.contacts:
            if contact not in contacts:
                raise JointplayError(f"result {self.label!r} is damaged: no contact {contact!r}")
        columns = [contacts.index(contact) for contact in clearance.contacts]
        normal = self.values("normal_force_peak")[:, j, columns]
        friction = self.values("friction_force")[:, j, columns]
        acting = strongest(normal, self.records)
        held = np.take_along_axis(normal, acting, axis=0)
        rubbing = np.take_along_axis(friction, acting, axis=0)
        # Recorded friction belongs to the instant of the record, the peak to one before it.
        now = np.take_along_axis(self.values("normal_force")[:, j, columns], acting, axis=0)
        rubbing *= np.divide(held, now, out=np.ones_like(held), where=now > 0.0)
        view = close_up(mechanism, name, self.q, self.v, self.records, acting, held, rubbing)
        largest = float(size.max(initial=0.0))
        pressing = normal.max(axis=1)
        newton = max(1e-4 * largest, 1e-9)
        n = len(self.records)
        force = peak[strongest(size[:, None], self.records)[:, 0]]
        index, placement = mechanism.bearing_frame(name)
        carrier, fixed = _carrier(mechanism, self.links, index, placement)
        return {
            "name": name,
            "kind": clearance.kind,
            "shape": asdict(clearance.outline),
            "contacts": list(clearance.contacts),
            "carrier": carrier,
            "placement": fixed.homogeneous.T.ravel().tolist(),
            "largest": largest,
            "typical": _typical(size, hits),
            "typical_contact": _typical(pressing, hits),
            "impacts": {
                "time": self.time[hits.records].tolist(),
                "force": [float(f"{value:.4g}") for value in hits.force],
            },
            "force": packer.table(force, newton),
            "mode": packer.table(self.values("mode")[self.records, j], 1.0),
            "tilt_angle": packer.table(self.values("tilt")[self.records, j], MICRORADIAN),
            "turn": packer.table(view.turn, 10 * MICRORADIAN),
            "slide": packer.table(view.slide, MICRON),
            "displacement": packer.table(view.displacement, 0.1 * MICRON),
            "tilt": packer.table(view.tilt, MICRORADIAN),
            "place": packer.table(view.place.reshape(n, -1), 10 * MICRON),
            "shift": packer.table(view.shift.reshape(n, -1), 0.2 * MICRON),
            "normal": packer.table(view.normal_force.reshape(n, -1), newton),
            "friction": packer.table(view.friction_force.reshape(n, -1), newton),
        }


def _typical(force: np.ndarray, hits: Impacts) -> float:
    """Force that an arrow of ordinary length shows [N]: half of the impacts exceed it."""
    values = force[hits.records] if len(hits.records) else force
    values = values[values > 0.0]
    return float(np.median(values)) if len(values) else 1.0


def _poses(mechanism: Mechanism, q: np.ndarray, links: Sequence[str]) -> np.ndarray:
    """World poses of link frames, shape (n, links, 7): position [m] and quaternion (x, y, z, w)."""
    model = mechanism.model
    ground = (0, pin.SE3.Identity())
    frames = [model.frames[model.getFrameId(link, pin.FrameType.BODY)] for link in links]
    pairs = [(ground, (frame.parentJoint, frame.placement)) for frame in frames]
    motion = Motion.of(len(q), len(links))
    states = np.ascontiguousarray(q), np.zeros((len(q), model.nv))
    Tree(model).move(motion, 0, len(q), *states, ground, pairs)
    poses = np.empty((len(q), len(links), 7))
    for k, places in enumerate(motion.poses):
        poses[:, k, :3] = places[:, :3]
        poses[:, k, 3:] = quaternions(places[:, 3:].reshape(-1, 3, 3))
        continuous(poses[:, k, 3:])
    return poses


def _pack_poses(packer: Packer, poses: np.ndarray) -> dict[str, Any]:
    n = len(poses)
    return {
        "position": packer.table(poses[:, :, :3].reshape(n, -1), 0.2 * MICRON),
        "turn": packer.table(poses[:, :, 3:].reshape(n, -1), 0.5 * MICRORADIAN),
    }


def _carrier(
    mechanism: Mechanism, links: Sequence[str], index: int, placement: pin.SE3
) -> tuple[int, pin.SE3]:
    """Link that moves with Pinocchio joint `index`, and a frame of that joint as seen from it."""
    model = mechanism.model
    for number, link in enumerate(links):
        frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
        if frame.parentJoint == index:
            return number, frame.placement.actInv(placement)
    raise AssertionError(f"no link moves with joint {model.names[index]!r}")


def _ghost(
    case: _Case, others: Sequence[_Case], packer: Packer, notes: Notes, progress: bool
) -> dict[str, Any] | None:
    """Tracks of the ideal twin at the moments of `case`: one of `others`, or simulated."""
    for other in others:
        long_enough = other.time[-1] >= case.time[-1] - 1e-9
        if long_enough and is_twin(case.result, other.result):
            return _twin_tracks(case, other.mechanism, other.time, other.q, packer)
    try:
        simulation = replace(
            ideal_simulation(case.result),
            duration=float(case.time[-1]),
            record_every=max(1, round(TWIN_RECORD_S / case.simulation.step)),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            twin = simulation.run(progress)
    except JointplayError as error:
        notes.append(f"{case.label}: no ideal twin: {error}")
        return None
    if twin.status != Status.COMPLETED:
        notes.append(f"{case.label}: no ideal twin: {twin.message}")
        return None
    return _twin_tracks(case, simulation.mechanism, twin.time, twin["q"].values, packer)


def _error(case: _Case, packer: Packer, notes: Notes) -> dict[str, Any] | None:
    """Track of the static error set of the tool, which stands about its twin's."""
    motion = case.simulation.motion
    driven = None if motion is None else motion.joints
    try:
        return static_error(case.mechanism, case.time, case.q, driven, packer)
    except JointplayError as error:
        notes.append(f"{case.label}: no static error set: {error}")
        return None


def _twin_tracks(
    case: _Case, mechanism: Mechanism, time: np.ndarray, q: np.ndarray, packer: Packer
) -> dict[str, Any]:
    moments = case.time[case.records]
    at = np.column_stack([np.interp(moments, time, column) for column in q.T])
    model, data = mechanism.model, mechanism.data
    tool = np.empty((len(at), 3))
    for i, row in enumerate(at):
        pin.framesForwardKinematics(model, data, row)
        tool[i] = data.oMf[mechanism.tool_frame].translation
    poses = _pack_poses(packer, _poses(mechanism, at, case.links))
    return poses | {"tool": packer.table(tool, 0.1 * MICRON)}


def _magnification(cases: Sequence[_Case]) -> float:
    """A round factor with which the widest gap is about as wide as its journal's radius."""
    wanted = []
    for case in cases:
        for joint in case.mechanism.clearance.values():
            pairs = zip(joint.outline.size, joint.outline.room, strict=True)
            wanted += [1.1 * size / room for size, room in pairs if room > 0.0]
    factor = max(min(wanted, default=1.0), 1.0)
    power = 10.0 ** math.floor(math.log10(factor))
    return float(max(step * power for step in (1, 2, 5) if step * power <= factor * 1.0001))
