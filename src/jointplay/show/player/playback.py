"""Scenes of the player: robots, their ideal twins, traces, forces, close-ups, static error sets.

A scene is made once, from results. Surfaces of bodies are packed once each, however many links,
cases and twins show them; everything that moves becomes a track, a table of numbers over the
moments played. All is one block of bytes with a table of contents, which a page carries to the
browser (`static/stage.js`).
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

from jointplay.accuracy.ellipsoids import ellipsoids
from jointplay.accuracy.error_model import play_model
from jointplay.base.errors import JointplayError, MissingName, require_finite, require_whole
from jointplay.base.tables import counted
from jointplay.base.units import round_below
from jointplay.model.mechanism import Mechanism
from jointplay.model.meshes import Surface
from jointplay.model.scene import Scene, tool_places
from jointplay.model.visuals import Look
from jointplay.physics.joints import Coordinate, RollingBearing
from jointplay.physics.kernel import Status
from jointplay.show.player.closeup import close_up
from jointplay.show.player.tracks import Impacts, Packer, impacts, select_records, strongest
from jointplay.show.plots.palette import colours
from jointplay.simulation.analysis.twins import ideal_simulation, is_twin
from jointplay.simulation.result.result import Result

BUDGET = 60_000
"""Most moments of all cases together, which bounds memory and file size. A minute of motion then
has a moment each millisecond or more, and every record of its impacts."""

MICRON, MICRORADIAN = 1e-6, 1e-6
_QUANTA = {
    **{"turn": 10 * MICRORADIAN, "tilt": MICRORADIAN, "slide": MICRON, "place": 10 * MICRON},
    **{"displacement": 0.1 * MICRON, "shift": 0.2 * MICRON},
}
"""Resolution of the close-up's tracks [m, rad]."""
TWIN_RECORD_S = 1e-3  # time between two records of an ideal twin [s]

MOST_MAGNIFIED = 1e4  # largest magnification of displacements in a close-up
SHARPNESS = 2**14  # resolution of a surface's points: parts of its largest extent
MOMENTS = 61  # instants of the static error set; between them the ellipsoid is interpolated
_ERROR_QUANTUM_M = 1e-8
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # entries of a symmetric matrix


@dataclass
class Packed:
    """A scene, packed for a page."""

    contents: dict[str, Any]  # plain data, with the places of tracks and surfaces in `block`
    block: bytes  # tracks and surfaces, compressed
    notes: list[str] = field(default_factory=list)
    """Notes for the user: stand-ins for meshes, missing twins."""


def build(
    cases: Mapping[str, Result],
    *,
    joint: str | None = None,
    magnification: float | None = None,
    meshes: Sequence[str | Path] = (),
    ghosts: bool = True,
    budget: int = BUDGET,
    progress: bool = False,
) -> Packed:
    """Make the scene of one or several results.

    Args:
        cases: results by label, in the order of display.
        joint: joint with clearance whose close-up is shown first; None takes the first that is not
            a hinge of a flexible link.
        magnification: of displacements in the close-up; None chooses one that shows the gap.
        meshes: folders in which meshes are looked for first.
        ghosts: show the ideal twin of each case, which may have to be simulated.
        budget: most moments of all cases together.
        progress: show the progress of simulating twins.

    Raises:
        JointplayError: no result, one without motion, no such joint, or a number out of range.
    """
    if not cases:
        raise JointplayError("no result to play")
    if magnification is not None and not (
        1.0 <= require_finite("magnification", magnification, "") <= MOST_MAGNIFIED
    ):
        raise JointplayError(f"magnification must lie between 1 and 10000, got {magnification:g}")
    budget = require_whole("budget", budget, 1)
    packer, notes = Packer(), list[str]()
    names = list(dict.fromkeys(name for result in cases.values() for name in result.joints))
    if joint is not None and joint not in names:
        raise MissingName("joint with clearance", joint, names)
    playable = [_Case(label, result, meshes) for label, result in cases.items()]
    if joint is None:
        views = [view for case in playable for view in case.scene.joints if view.play]
        joint = next((view.name for view in views if not view.hinge), None)
    entries = []
    surfaces = _Surfaces(packer)
    for case, colour in zip(playable, colours(cases), strict=True):
        entry = case.pack(packer, max(budget // len(playable), 4))
        visuals = case.scene.look
        if visuals.missing:
            notes.append(
                f"{case.label}: {len(visuals.missing)} of its meshes not found "
                f"({Path(visuals.missing[0]).name}, ...): simple shapes instead; "
                "name their folder with --meshes"
            )
        entry |= {"objects": surfaces.objects(visuals), "reach": visuals.reach}
        entry["ghost"] = None
        if ghosts and (case.result.joints or case.mechanism.gears):
            entry["ghost"] = _ghost(case, playable, packer, notes, progress)
        entry["error"] = None
        if entry["ghost"]:  # the static error set is drawn about the twin's tool
            try:
                entry["error"] = _static_error(case, packer)
            except JointplayError as reason:
                notes.append(f"{case.label}: no static error set: {reason}")
        entry["colour"] = colour
        entries.append(entry)
    contents = {
        "surfaces": surfaces.entries,
        "cases": entries,
        "joints": names,
        "joint": joint or (names[0] if names else None),
        "magnification": magnification,
        "notes": notes,
    }
    return Packed(contents, packer.deflated(), notes)


# Parts of a scene, for the live page: a machine's bodies once, its motion after each change.


def bodies(mechanism: Mechanism) -> Packed:
    """The surfaces of a mechanism's bodies and their placements on links."""
    packer = Packer()
    surfaces, visuals = _Surfaces(packer), Scene(mechanism).look
    objects = surfaces.objects(visuals)
    contents = {"surfaces": surfaces.entries, "objects": objects, "reach": visuals.reach}
    notes = [f"{counted(len(visuals.missing), 'mesh', 'meshes')} not found: simple shapes instead"]
    return Packed(contents, packer.deflated(), notes if visuals.missing else [])


def motion(label: str, result: Result, twin: Result, budget: int) -> Packed:
    """The tracks of a result and of its ideal twin, as in a case of `build`."""
    packer = Packer()
    case = _Case(label, result)
    entry = case.pack(packer, max(budget, 4))
    mechanism = twin.simulation.mechanism
    entry["ghost"] = _twin_tracks(case, mechanism, twin.time, twin["q"].values, packer)
    return Packed(entry | {"error": None}, packer.deflated())


class _Surfaces:
    """The surfaces of all bodies, each packed once."""

    def __init__(self, packer: Packer) -> None:
        self._packer = packer
        self._number: dict[bytes, int] = {}
        self.entries: list[dict[str, Any]] = []

    def objects(self, visuals: Look) -> list[dict[str, Any]]:
        """Bodies: link, number of the surface, colour, opacity, placement (4x4, by columns)."""
        return [
            {
                "link": shape.link,
                "surface": self._find(part),
                "colour": sum(
                    round(255 * min(max(value, 0.0), 1.0)) << shift
                    for value, shift in zip(colour, (16, 8, 0), strict=False)
                ),
                "opacity": round(colour[3], 3),
                "matrix": shape.placement.T.ravel().tolist(),
            }
            for shape in visuals.shapes
            for part, colour in zip(shape.parts, shape.colours, strict=True)
        ]

    def _find(self, part: Surface) -> int:
        """Number of a surface, which is packed if it is new."""
        key = hashlib.sha256(part.points.tobytes() + part.triangles.tobytes()).digest()
        if key not in self._number:
            self._number[key] = len(self.entries)
            extent = float(np.ptp(part.points, axis=0).max())
            points = self._packer.table(part.points, extent / SHARPNESS)
            triangles = self._packer.mesh(part.triangles)
            self.entries.append({"points": points, "triangles": triangles})
        return self._number[key]


class _Case:
    """A result, its mechanism, and the records up to the first that is not finite."""

    def __init__(self, label: str, result: Result, meshes: Sequence[str | Path] = ()) -> None:
        self.label, self.result = label, result
        try:
            self.simulation = result.simulation
            q, v = result["q"].values, result["v"].values
            finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
        except (KeyError, TypeError, json.JSONDecodeError) as error:
            raise JointplayError(f"result {label!r} is damaged: {error!r}") from None
        self.mechanism: Mechanism = self.simulation.mechanism
        self.scene = Scene(self.mechanism, meshes)
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
        """Choose the records to play, pack the tracks, and return the case's table of contents."""
        joints = list(self.mechanism.clearance)
        peaks = self.values("joint_force_peak") if joints else np.zeros((self.n, 0, 3))
        sizes = np.linalg.norm(peaks, axis=2)
        hits = [impacts(sizes[:, j]) for j in range(len(joints))]
        self.records = select_records(self.time, hits, budget)
        poses = self.scene.poses(self.q[self.records])
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
            "links": self.scene.links,
            "time": packer.table(self.time[self.records], 1e-7),
            "poses": _pack_poses(packer, poses),
            "tool": packer.table(tool, 0.1 * MICRON),
            "joints": [
                self._joint(packer, name, j, peaks[:, j], sizes[:, j], hits[j])
                for j, name in enumerate(joints)
            ],
        }

    def _joint(
        self, packer: Packer, name: str, j: int, peak: np.ndarray, size: np.ndarray, hits: Impacts
    ) -> dict[str, Any]:
        """Pack the close-up of joint `name`, number j.

        `peak` (n, 3) is its largest force since the record before, `size` (n,) the norm [N].
        """
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
        # Friction is recorded at the instant of the record, and the peak came before: it is scaled
        # by the ratio of the normal forces.
        now = np.take_along_axis(self.values("normal_force")[:, j, columns], acting, axis=0)
        rubbing *= np.divide(held, now, out=np.ones_like(held), where=now > 0.0)
        cage = None
        if isinstance(clearance, RollingBearing):
            cage = np.ascontiguousarray(self.values("cage_angle")[:, j])
        view, loads = close_up(
            mechanism, name, self.q, self.v, self.records, acting, held, rubbing, cage
        )
        largest = float(size.max(initial=0.0))
        pressing = normal.max(axis=1)
        newton = max(1e-4 * largest, 1e-9)
        n = len(self.records)
        force = peak[strongest(size[:, None], self.records)[:, 0]]
        joint_view = self.scene.joints[j]
        quanta = _QUANTA | {"normal": newton, "friction": newton}
        packed = {
            "force": packer.table(force, newton),
            "mode": packer.table(self.values("mode")[self.records, j], 1.0),
            "tilt_angle": packer.table(self.values("tilt")[self.records, j], MICRORADIAN),
        }
        for key, values in view.items():
            packed[key] = packer.table(values.reshape(n, -1), quanta[key])
        elements = None
        if isinstance(clearance, RollingBearing) and cage is not None and loads is not None:
            most = float(loads.max(initial=0.0))
            rollers = clearance.roller_elements
            elements = {
                "rollers": rollers,
                "count": clearance.count,
                "diameter": clearance.d_element,
                "length": getattr(clearance, "length", clearance.d_element),
                "pitch": 0.5 * clearance.d_pitch,
                "bore": 0.5 * clearance.d_bore,
                "outside": 0.5 * clearance.d_outside,
                "width": clearance.row_width or 1.25 * clearance.d_element,
                "rows": clearance.row_places,
                "reach": 0.0 if rollers else clearance.reach,
                "angle": math.pi / 4.0 if rollers else getattr(clearance, "alpha", 0.0),
                "groove": 0.5 if rollers else getattr(clearance, "inner_groove", 0.52),
                "room": max(float(clearance.cr), 0.0),
                "largest": most,
                "cage": packer.table(cage[self.records], 10 * MICRORADIAN),
                "loads": packer.table(loads, max(most / 1000.0, 1e-9)),
            }
        return packed | {
            "name": name,
            "kind": clearance.kind,
            "marked": not joint_view.hinge,
            "shape": asdict(clearance.outline),
            "contacts": list(clearance.contacts),
            "carrier": joint_view.link,
            "placement": joint_view.place.homogeneous.T.ravel().tolist(),
            "largest": largest,
            "typical": _typical(size, hits),
            "typical_contact": _typical(pressing, hits),
            "largest_contact": float(pressing.max(initial=0.0)),
            "impacts": {
                "time": self.time[hits.records].tolist(),
                "force": [float(f"{value:.4g}") for value in hits.force],
            },
            "magnification": self.magnification(name, j),
            "elements": elements,
        }

    def magnification(self, name: str, j: int) -> float:
        """A round factor that makes the widest gap about as wide as the journal's radius.

        In a rolling bearing it makes the radial play a third of an element, or less where the inner
        ring would move by more than half an element.
        """
        clearance = self.mechanism.clearance[name]
        if isinstance(clearance, RollingBearing):
            size, tilt = clearance.d_element, np.abs(self.values("tilt")[:, j]).max()
            offset = np.abs(self.values("journal_centre")[:, j]).max(axis=0)
            travel = max(float(np.hypot(offset[0], offset[1])), float(offset[2]))
            far = travel + float(tilt) * clearance.outline.size[0]
            pairs = [(0.35 * size, clearance.radial_travel), (0.5 * size, far)]
        else:
            outline = clearance.outline
            pairs = [(1.1 * a, b) for a, b in zip(outline.size, outline.room, strict=True)]
        factor = max(min((size / room for size, room in pairs if room > 0.0), default=1.0), 1.0)
        return min(round_below(factor), MOST_MAGNIFIED)


def _typical(force: np.ndarray, hits: Impacts) -> float:
    """Force of an arrow of ordinary length [N]: the median of the impacts, or of the records."""
    values = force[hits.records] if len(hits.records) else force
    values = values[values > 0.0]
    return float(np.median(values)) if len(values) else 1.0


def _pack_poses(packer: Packer, poses: np.ndarray) -> dict[str, Any]:
    n = len(poses)
    return {
        "position": packer.table(poses[:, :, :3].reshape(n, -1), 0.2 * MICRON),
        "turn": packer.table(poses[:, :, 3:].reshape(n, -1), 0.5 * MICRORADIAN),
    }


def _ghost(
    case: _Case, others: Sequence[_Case], packer: Packer, notes: list[str], progress: bool
) -> dict[str, Any] | None:
    """Tracks of the ideal twin at the moments of `case`: of one of `others`, or simulated here."""
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
            twin = simulation.run(progress, estimate=False)
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
    """Tracks of a twin with configurations `q` at `time` [s], at the moments of the case."""
    moments = case.time[case.records]
    at = np.column_stack([np.interp(moments, time, column) for column in q.T])
    twin = Scene(mechanism)
    order = [twin.links.index(link) for link in case.scene.links]
    poses = _pack_poses(packer, twin.poses(at)[:, order])
    return poses | {"tool": packer.table(tool_places(mechanism, at), 0.1 * MICRON)}


def centred(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Put the journals of `q` (n, nq) back to the middle, in place, except those in loops."""
    for name, joint in mechanism.clearance.items():
        for part in joint.freedoms if name not in mechanism.loops else ():
            if part not in joint.ideal_freedoms:
                q[:, mechanism.coordinates.index(Coordinate(name, part))] = 0.0
    return q


def _static_error(case: _Case, packer: Packer) -> dict[str, Any]:
    """Pack the set of places that play allows the tool at rest, as an ellipsoid over time.

    Returns:
        `time` [s], and `set`: the six entries of the symmetric matrix that maps the unit sphere to
        the ellipsoid about the ideal tool, and the worst and the RMS distance [m].

    Raises:
        JointplayError: as `error_model.play_model`.
    """
    mechanism, moved = case.mechanism, case.simulation.motion
    moments = np.linspace(case.time[0], case.time[-1], MOMENTS)
    poses = np.column_stack([np.interp(moments, case.time, column) for column in case.q.T])
    driven = None if moved is None else moved.joints
    model = play_model(mechanism, centred(mechanism, poses), driven=driven, loops=True)
    sets = ellipsoids(model.middle)
    rows = [sets.root[:, i, k] for i, k in _UPPER] + [sets.worst, sets.rms]
    return {
        "time": packer.table(moments, 1e-7),
        "set": packer.table(np.column_stack(rows), _ERROR_QUANTUM_M),
    }
