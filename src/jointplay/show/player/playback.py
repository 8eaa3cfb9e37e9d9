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

from jointplay.accuracy.ellipsoids import ellipsoids
from jointplay.accuracy.error_model import play_model
from jointplay.base.errors import JointplayError, MissingName, require_finite, require_whole
from jointplay.base.tables import counted
from jointplay.base.units import round_below
from jointplay.model.mechanism import Mechanism
from jointplay.model.meshes import Surface
from jointplay.model.scene import Scene, quaternions, tool_places
from jointplay.model.visuals import Look
from jointplay.physics.contact import elastic, resultant
from jointplay.physics.geometry import touch
from jointplay.physics.joints import Coordinate, RollingBearing
from jointplay.physics.kernel import Status
from jointplay.show.player.tracks import Impacts, Packer, impacts, select_records, strongest
from jointplay.show.plots.palette import colours
from jointplay.simulation.analysis.twins import ideal_simulation, is_twin
from jointplay.simulation.result.result import Result

# The close-up of a joint with clearance: how its journal lies in its bearing, what acts where.
#
# Displacements are far smaller than bodies: seen at true size, no gap is visible. The close-up
# magnifies displacements and leaves sizes alone, as plots of elastic deformation do. The
# journal's pose (R, c) in the bearing frame is split into an ideal part (Q, t), which a joint
# without clearance could have, and the rest: the displacement d = c - t and the small rotation
# vector w of R Q^T. A journal point X is drawn with the factor M at
#
#     t + x + M (d + w x x),    x = Q X,
#
# and the bearing with M times its clearance around a journal of true size. To first order in w,
# which is below 0.03 rad in the joints simulated here, every gap then appears M times as large.


def close_up(
    mechanism: Mechanism,
    joint: str,
    q: np.ndarray,
    v: np.ndarray,
    records: np.ndarray,
    acting: np.ndarray,
    normal: np.ndarray,
    friction: np.ndarray,
    cage: np.ndarray | None = None,
) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """How the journal of `joint` lies, and what acts on it, at n records of a run; m contacts.

    Args:
        mechanism: with clearance in `joint`.
        joint: name.
        q, v: states at all records, shape (all, nv).
        records: those that are wanted, shape (n,).
        acting: for each of them and each contact the record whose force is shown (the largest since
            the last one that is wanted, say), shape (n, m).
        normal, friction: magnitudes of those forces, shape (n, m) [N].
        cage: azimuth of a rolling bearing's first element at all records, shape (all,) [rad].

    Returns:
        In bearing axes: `turn`, quaternions (x, y, z, w) of Q (n, 4); `slide`, t (n, 3) [m], zero
        but along the guide of a slider; `displacement`, d (n, 3) [m]; `tilt`, w (n, 3) [rad];
        `place`, x of each contact's point on the journal, and `shift`, d + w x x of that point
        (n, m, 3) [m]; `normal` and `friction`, forces on the journal (n, m, 3) [N]. And loads of
        rolling elements, row by row, shape (n, rows * Z) [N]; None without any.
    """
    clearance = mechanism.clearance[joint]
    n, m = acting.shape
    acts = normal > 0.0
    needed = np.union1d(records, acting[acts])
    rotation, centre, speed = _relative_motion(mechanism, joint, q[needed], v[needed])
    ideal, slide, tilt = np.empty_like(rotation), np.empty_like(centre), np.empty_like(centre)
    for i in range(len(needed)):
        ideal[i], slide[i] = clearance.ideal_part(rotation[i], centre[i])
        tilt[i] = pin.log3(rotation[i] @ ideal[i].T)
    displacement = centre - slide
    offset, direction = (np.zeros((n, m, 3)) for _ in range(2))
    dimensions = np.array(clearance.dimensions)
    then = np.searchsorted(needed, np.where(acts, acting, records[:, None]))
    bearing = clearance if isinstance(clearance, RollingBearing) else None
    azimuth = np.zeros(len(needed)) if cage is None else cage[needed]
    if bearing is not None:
        at_peak = rotation[then[:, 0]], centre[then[:, 0]], azimuth[then[:, 0]]
        offset[:, 0], direction[:, 0] = _most_loaded(bearing, *at_peak)
    for i, k in zip(*np.nonzero(acts & (bearing is None)), strict=True):
        at = then[i, k]
        contact = touch(
            int(clearance.shape), dimensions, 0, int(k), *centre[at], rotation[at].reshape(9), 0
        )
        offset[i, k], direction[i, k] = contact[1:4], contact[4:7]
    back = ideal[then] @ np.swapaxes(rotation[then], -1, -2)
    place = np.einsum("...ij,...j->...i", back, offset)
    shift = displacement[then] + np.cross(tilt[then], place)
    at_contact = speed[then, :3] + np.cross(speed[then, 3:], offset)
    sliding = at_contact - direction * np.sum(direction * at_contact, axis=2, keepdims=True)
    size = np.linalg.norm(sliding, axis=2, keepdims=True)
    against = np.divide(-sliding, size, out=np.zeros_like(sliding), where=size > 0.0)
    # Where nothing touches, the last point is kept: points that jump would not compress.
    for k in range(m):
        touches = np.flatnonzero(acts[:, k])
        if len(touches):
            last = np.maximum.accumulate(np.where(acts[:, k], np.arange(n), touches[0]))
            place[:, k], shift[:, k] = place[last, k], shift[last, k]
    now = np.searchsorted(needed, records)
    loads = None
    if bearing is not None:
        loads, _ = bearing.element_loads(centre[now], rotation[now][:, :, 2], azimuth[now])
    return {
        "turn": quaternions(ideal[now]),
        "slide": slide[now],
        "displacement": displacement[now],
        "tilt": tilt[now],
        "place": place,
        "shift": shift,
        "normal": normal[:, :, None] * direction,
        "friction": friction[:, :, None] * against,
    }, loads


def _most_loaded(
    bearing: RollingBearing, rotation: np.ndarray, centre: np.ndarray, cage: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the most loaded element touches the inner ring, and which way it pushes it.

    Both in bearing axes, the place from the ring's centre, shape (n, 3) [m].
    """
    pose = np.hstack([centre, rotation.reshape(-1, 9)])
    load = elastic.answers(bearing.law, bearing.resultant, pose, cage)
    c, s, h = load[:, resultant.COSINE], load[:, resultant.SINE], load[:, resultant.PLACE]
    across, along = load[:, resultant.ACROSS], load[:, resultant.ALONG]
    radius = 0.5 * (bearing.d_pitch - across * bearing.d_element)
    place = np.column_stack([radius * c, radius * s, h - 0.5 * along * bearing.d_element])
    return place, -np.column_stack([across * c, across * s, along])


def _relative_motion(
    mechanism: Mechanism, joint: str, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotation (n, 3, 3), centre (n, 3) [m] and twist (n, 6) [m/s, rad/s] of a journal.

    Relative to the bearing, in bearing axes; the velocity is that of the journal's centre.
    """
    tree, pairs = mechanism.tree, [mechanism.frames(joint)]
    before, now, after = (
        tree.motion(q + step * v, pairs=pairs).poses[0] for step in (-_STEP_S, 0.0, _STEP_S)
    )
    rate = (after - before) / (2.0 * _STEP_S)
    rotation = now[:, 3:].reshape(-1, 3, 3)
    turning = rate[:, 3:].reshape(-1, 3, 3) @ np.swapaxes(rotation, 1, 2)
    spin = turning[:, (2, 0, 1), (1, 2, 0)]
    return rotation, now[:, :3], np.hstack([rate[:, :3], spin])


# What play lets the tool do at rest, as the track of an ellipsoid about the ideal tool.


MOMENTS = 61  # at which the set is reckoned; between them the ellipsoid is interpolated
_QUANTUM = 1e-8
_PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def centred(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Configurations (n, nq) with the journals of all but loops put back to the middle."""
    for name, joint in mechanism.clearance.items():
        for part in joint.freedoms if name not in mechanism.loops else ():
            if part not in joint.ideal_freedoms:
                q[:, mechanism.coordinates.index(Coordinate(name, part))] = 0.0
    return q


def static_error(
    mechanism: Mechanism,
    time: np.ndarray,
    q: np.ndarray,
    driven: Sequence[str] | None,
    packer: Packer,
) -> dict[str, Any]:
    """Pack the static error set of a run's tool; errors as of `error_model.play_model`.

    Of configurations q (n, nq) at times (n,) [s], whose journals count as centred. `driven` joints
    stand in closed loops.

    Returns:
        `time` [s], and `set`: the matrix that makes a unit sphere the ellipsoid, its six numbers,
        and the worst and the RMS distance [m].
    """
    moments = np.linspace(time[0], time[-1], MOMENTS)
    poses = np.column_stack([np.interp(moments, time, column) for column in q.T])
    model = play_model(mechanism, centred(mechanism, poses), driven=driven, loops=True)
    sets = ellipsoids(model.middle)
    rows = [sets.root[:, i, k] for i, k in _PLACES] + [sets.worst, sets.rms]
    return {
        "time": packer.table(moments, 1e-7),
        "set": packer.table(np.column_stack(rows), _QUANTUM),
    }


BUDGET = 60_000
"""Most moments of all cases together, which bounds memory and file alike.

A single minute of motion then has one each millisecond or more, and every record of its impacts.
"""

MICRON, MICRORADIAN = 1e-6, 1e-6
_STEP_S = 1e-7  # over which poses are differenced: rounding and curvature give 1e-9 m/s
_QUANTA = {
    **{"turn": 10 * MICRORADIAN, "tilt": MICRORADIAN, "slide": MICRON, "place": 10 * MICRON},
    **{"displacement": 0.1 * MICRON, "shift": 0.2 * MICRON},
}
"""To which tracks of the close-up are rounded."""
TWIN_RECORD_S = 1e-3  # time between two records of an ideal twin [s]

MOST_MAGNIFIED = 1e4

SHARPNESS = 2**14  # places of a surface's points along its largest extent


@dataclass
class Packed:
    """A scene as a page plays it."""

    contents: dict[str, Any]  # what there is and where in `block` it lies, as plain data
    block: bytes  # tracks and surfaces, compressed
    notes: list[str] = field(default_factory=list)
    """What the user should know: stand-ins for meshes, missing twins."""


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
        cases: results by label, in the order in which they stand.
        joint: joint with clearance whose close-up is shown first; None takes the first that is
            no hinge of a flexible link.
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
        1.0 <= require_finite("magnification", magnification, "") <= MOST_MAGNIFIED
    ):
        raise JointplayError(f"magnification must lie between 1 and 10000, got {magnification:g}")
    budget = require_whole("budget", budget, 1)
    packer, notes = Packer(), list[str]()
    names = list(dict.fromkeys(name for result in cases.values() for name in result.joints))
    if joint is not None and joint not in names:
        raise MissingName("joint with clearance", joint, names)
    taken = [_Case(label, result, meshes) for label, result in cases.items()]
    if joint is None:  # what bends is less to look at than what has play
        play = [joint_view for case in taken for joint_view in case.scene.joints if joint_view.play]
        joint = next((joint_view.name for joint_view in play if not joint_view.hinge), None)
    entries = []
    surfaces = _Surfaces(packer)
    for case, colour in zip(taken, colours(cases), strict=True):
        entry = case.pack(packer, max(budget // len(taken), 4))
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
            entry["ghost"] = _ghost(case, taken, packer, notes, progress)
        entry["error"] = None
        if entry["ghost"]:  # about which the tool's static error set stands
            moved = case.simulation.motion
            driven = None if moved is None else moved.joints
            try:
                error = static_error(case.mechanism, case.time, case.q, driven, packer)
                entry["error"] = error
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


# Parts of a scene, for who shows one machine that changes: its bodies once, its motion again.


def bodies(mechanism: Mechanism, meshes: Sequence[str | Path] = ()) -> Packed:
    """What does not move: surfaces of a mechanism's bodies, and where they stand."""
    packer = Packer()
    surfaces, visuals = _Surfaces(packer), Scene(mechanism, meshes).look
    objects = surfaces.objects(visuals)
    contents = {"surfaces": surfaces.entries, "objects": objects, "reach": visuals.reach}
    notes = [f"{counted(len(visuals.missing), 'mesh', 'meshes')} not found: simple shapes instead"]
    return Packed(contents, packer.deflated(), notes if visuals.missing else [])


def motion(label: str, result: Result, twin: Result, budget: int) -> Packed:
    """What moves: tracks of a result and of its ideal twin, as a case of `build` has them."""
    packer = Packer()
    case = _Case(label, result)
    entry = case.pack(packer, max(budget, 4))
    mechanism = twin.simulation.mechanism
    entry["ghost"] = _twin_tracks(case, mechanism, twin.time, twin["q"].values, packer)
    return Packed(entry | {"error": None}, packer.deflated())


class _Surfaces:
    """Surfaces of all bodies, each packed once."""

    def __init__(self, packer: Packer) -> None:
        self._packer = packer
        self._number: dict[bytes, int] = {}
        self.entries: list[dict[str, Any]] = []

    def objects(self, visuals: Look) -> list[dict[str, Any]]:
        """What stands where: link, surface by number, colour, constant matrix column by column."""
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
        key = hashlib.sha256(part.points.tobytes() + part.triangles.tobytes()).digest()
        if key not in self._number:
            self._number[key] = len(self.entries)
            extent = float(np.ptp(part.points, axis=0).max())
            points = self._packer.table(part.points, extent / SHARPNESS)
            triangles = self._packer.mesh(part.triangles)
            self.entries.append({"points": points, "triangles": triangles})
        return self._number[key]


class _Case:
    """A result, its mechanism, and the moments of it that are played."""

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
        """Choose the moments, pack the tracks; returns the case's entry in the contents."""
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
        seen = self.scene.joints[j]
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
            "marked": not seen.hinge,
            "shape": asdict(clearance.outline),
            "contacts": list(clearance.contacts),
            "carrier": seen.link,
            "placement": seen.place.homogeneous.T.ravel().tolist(),
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
        """A round factor with which the widest gap is about as wide as its journal's radius.

        With rolling bearings, as the play across is a third of an element, unless what the inner
        ring did would take it further than an element then.
        """
        clearance = self.mechanism.clearance[name]
        if isinstance(clearance, RollingBearing):
            size, tilt = clearance.d_element, np.abs(self.values("tilt")[:, j]).max()
            away = np.abs(self.values("journal_centre")[:, j]).max(axis=0)
            went = max(float(np.hypot(away[0], away[1])), float(away[2]))
            far = went + float(tilt) * clearance.outline.size[0]
            pairs = [(0.35 * size, clearance.radial_travel), (0.5 * size, far)]
        else:
            outline = clearance.outline
            pairs = [(1.1 * a, b) for a, b in zip(outline.size, outline.room, strict=True)]
        factor = max(min((size / room for size, room in pairs if room > 0.0), default=1.0), 1.0)
        return min(round_below(factor), MOST_MAGNIFIED)


def _typical(force: np.ndarray, hits: Impacts) -> float:
    """Force that an arrow of ordinary length shows [N]: half of the impacts exceed it."""
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
    moments = case.time[case.records]
    at = np.column_stack([np.interp(moments, time, column) for column in q.T])
    twin = Scene(mechanism)
    order = [twin.links.index(link) for link in case.scene.links]
    poses = _pack_poses(packer, twin.poses(at)[:, order])
    return poses | {"tool": packer.table(tool_places(mechanism, at), 0.1 * MICRON)}
