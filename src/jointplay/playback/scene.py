"""Everything that is played: robots, their ideal twins, traces, forces, close-ups.

A scene is made once, from results. What does not move is drawn with Pinocchio's MeshcatVisualizer
into a recorder that stands in for meshcat's server; what moves becomes tracks. Both are packed into
one block of bytes with a table of contents, which a page carries to the browser.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import meshcat
import numpy as np
import pinocchio as pin
import umsgpack
from pinocchio.visualize import MeshcatVisualizer

from jointplay.analysis.twins import ideal_simulation, is_twin
from jointplay.errors import JointplayError, MissingName
from jointplay.kernel import Status
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.visuals import Visuals, visuals
from jointplay.playback.closeup import close_up, continuous
from jointplay.playback.tracks import Impacts, Packer, impacts, keep, strongest
from jointplay.plots.figures import colours
from jointplay.result.result import Result

BUDGET = 60_000
"""Most moments of all cases together, which bounds memory and file alike.

A single minute of motion then has one each millisecond or more, and every record of its impacts.
"""

MICRON, MICRORADIAN = 1e-6, 1e-6
TWIN_RECORD_S = 1e-3
"""Time between two records of an ideal twin [s]."""

Notes = list[str]


class _Recorder:
    """Stands in for the connection to meshcat's server: keeps what would be sent."""

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []

    def send(self, command: Any) -> None:
        self.commands.append(command.lower())


@dataclass
class Scene:
    """What a page plays.

    Attributes:
        contents: what there is and where in `block` it lies, as plain data.
        block: tracks and meshcat's commands, compressed.
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
    drawn: dict[str, int] = {}
    for index, (case, colour) in enumerate(zip(taken, colours(cases), strict=True)):
        entry = case.pack(packer, max(budget // len(taken), 4))
        look = visuals(case.mechanism, meshes)
        if look.missing:
            notes.append(
                f"{case.label}: {len(look.missing)} of its meshes not found "
                f"({Path(look.missing[0]).name}, ...): simple shapes instead; "
                "name their folder with --meshes"
            )
        text = case.mechanism.description.text
        objects, commands = _drawn(case.mechanism, look, f"case{index}")
        entry |= {"objects": objects, "reach": look.reach, "drawn": drawn.setdefault(text, index)}
        if entry["drawn"] == index:
            entry["commands"] = [packer.raw(umsgpack.packb(command)) for command in commands]
        entry["ghost"] = None
        if ghosts and (case.result.joints or case.mechanism.gears):
            entry["ghost"] = _ghost(case, taken, packer, notes, progress)
        entry["colour"] = colour
        entries.append(entry)
    contents = {
        "cases": entries,
        "joints": names,
        "joint": joint or (names[0] if names else None),
        "magnification": magnification or _magnification(taken),
        "notes": notes,
    }
    return Scene(contents, packer.deflated(), notes)


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
    model, data = mechanism.model, mechanism.data
    frames = [model.getFrameId(link, pin.FrameType.BODY) for link in links]
    poses = np.empty((len(q), len(links), 7))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        for k, frame in enumerate(frames):
            poses[i, k] = pin.SE3ToXYZQUAT(data.oMf[frame])
    for k in range(len(links)):
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


def _drawn(
    mechanism: Mechanism, look: Visuals, name: str
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Draw a robot with Pinocchio's visualizer.

    Returns:
        Its objects, each with its path in meshcat's tree, its link and its constant matrix in
        there (column by column, mesh scale included), and meshcat's commands that create them.
    """
    recorder = _Recorder()
    picture = MeshcatVisualizer(mechanism.model, None, look.geometry)
    picture.initViewer(viewer=meshcat.Visualizer(window=recorder))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no collision shapes, textures
        picture.loadViewerModel(name)
        picture.display(pin.neutral(mechanism.model))
    model, data = mechanism.model, picture.data
    pin.updateFramePlacements(model, data)
    placed = {c["path"]: c["matrix"] for c in recorder.commands if c["type"] == "set_transform"}
    created = [c for c in recorder.commands if c["type"] == "set_object"]
    paths = {c["path"] for c in created}
    objects = []
    for shape, link in zip(look.geometry.geometryObjects, look.links, strict=True):
        path = f"/meshcat/{name}/visuals/{shape.name}"
        if path in paths:
            world = np.array(placed[path]).reshape(4, 4).T
            frame = data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
            matrix = frame.inverse().homogeneous @ world
            objects.append({"name": shape.name, "link": link, "matrix": matrix.T.ravel().tolist()})
    return objects, created


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
