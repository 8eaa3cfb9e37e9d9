"""The arrays of one run, and the record through which the kernels reach them (`kernel.layout`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError
from jointplay.kernel import Command, Status, enter, layout
from jointplay.kernel.path import MIDDLE, MIDDLE_SPEED, ROWS
from jointplay.kernel.words import AZIMUTHS, NEVER, POWERS

Carriers = tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]
"""Two Pinocchio joints, and the placement of a frame in each."""


@dataclass(frozen=True)
class FilmSite:
    """What the kernels know of a film."""

    law: int
    """Address of the law."""
    sections: int
    """1, or 2 for a journal that can tilt."""
    section: float
    """Their distance from the journal's centre [m]."""
    clearance: float
    """c [m]."""
    thinnest: float
    """Eccentricity ratio at which the film is thinnest."""
    transition: float
    """Depth at which nothing of it is left [m]."""
    lag_mass: float
    """No more than the smallest mass that the film meets; of explicit methods [kg]."""
    parameters: tuple[float, ...]
    """Of the film law."""


@dataclass(frozen=True)
class ContactSite:
    """What the kernels know of one joint with clearance.

    Attributes:
        shape, dimensions: see `geometry.touch`.
        depth_limit: penetration at which the journal has broken out [m].
        normal, friction: addresses of the laws.
        bristles: whether the friction law has them.
        parameters: of the normal-force law, for each contact.
        friction_parameters: of the friction law.
        first: index of the virtual link's first coordinate, or None where bearing and journal are
            reached through their frames; then are needed
        carriers: Pinocchio joint that carries the bearing, and the bearing's placement in it; the
            same of the journal.
        film: None for a dry joint.
        wearing: this many contacts, from the first, count their sliding work.
        must_not_touch: this many contacts, from the first, end the run when they touch.
        signs: +1 for coordinates that move the journal only, -1 for those that move the bearing
            only, 0 for all others, shape (nv,).
    """

    shape: int
    dimensions: tuple[float, ...]
    depth_limit: float
    normal: int
    friction: int
    bristles: bool
    parameters: Sequence[tuple[float, ...]]
    friction_parameters: tuple[float, ...]
    first: int | None
    carriers: Carriers | None = None
    signs: np.ndarray | None = None
    film: FilmSite | None = None
    must_not_touch: int = 0
    wearing: int = 0


PARTS = ("bearing", "journal")

CarriedFrame = tuple[int, np.ndarray]
"""A body by its place, and a frame's rotation, row by row, and origin in it, shape (12,)."""


@dataclass(frozen=True)
class LoadSite:
    """What the kernels know of one load; see `kernel.load`.

    It acts either on coordinates or between two frames.
    """

    law: int
    """Address of its law."""
    numbers: np.ndarray
    """Of the law; what is written into it later, the law sees."""
    stores: bool = False
    """Whether its answer at rest is the slope of an energy."""
    implicit: int = NEVER
    """When the rest of it depends on velocity: `words.NEVER`, `ALWAYS` or `IF_PRESSED`."""
    seen: tuple[int, ...] = ()
    """Coordinates that the law sees."""
    pushed: tuple[int, ...] = ()
    """Coordinates on which it acts; if it is implicit, those that it sees."""
    bounds: tuple[float, ...] = ()
    """Largest effort on each of them, if it is limited [N m or N]."""
    carriers: Carriers | None = None
    """Between frames: Pinocchio joints that carry them, and the frames' placements in these."""
    signs: np.ndarray | None = None
    """See `ContactSite`."""

    @property
    def size(self) -> int:
        """Numbers that the law gives."""
        return len(self.pushed) if self.carriers is None else 6


class Workspace:
    """The arrays of one run and the record through which the kernels reach them.

    Args:
        data: Pinocchio's data of the run, whose results the kernels read in place.
        nv: number of coordinates.
        sites: one for each joint with clearance.
        tables: drives, friction, gears and reference.
        dt: time step [s].
        every: steps between records.
        rows: room for records.
        loads: what else acts.
        own_acceleration: the kernels reckon the acceleration; else it is Pinocchio's.

    Attributes:
        q, v: state, shape (nv,).
        drives, frictions, gears: records of what acts on single coordinates.
        contacts: records of the contacts, shape (nj, width).
        record: what was recorded, a row each.
        middle: q and v in the middle of the macro step that is planned, shape (nv,).
        inverse_mass: Pinocchio's, its upper triangle, shape (nv, nv).
    """

    def __init__(
        self,
        data: pin.Data,
        nv: int,
        sites: Sequence[ContactSite],
        tables: Tables,
        dt: float,
        every: int,
        rows: int,
        own_acceleration: bool,
        loads: Sequence[LoadSite] = (),
    ) -> None:
        """Allocate, and fill in the record."""
        nj = len(sites)
        width = max((len(site.parameters) for site in sites), default=0)
        self.fields, columns = _layout(nv, nj, width, loads)
        self._kept: list[np.ndarray] = []  # what the record points to must live as long
        self._arrays: dict[str, np.ndarray] = {}  # the same by name, but for Pinocchio's frames
        self._addresses: dict[str, set[str]] = {
            "run": {"record", "windows"},
            "joints": set(),
            "loads": set(),
        }
        self.run = np.zeros(1, layout.RUN)
        # Views of single fields: to look a field up costs more than to read it.
        self._row, self._step = self.run["row"], self.run["step"]
        self._time, self._status = self.run["time"], self.run["status"]
        self._macros = self.run["macros"]
        self.unresolved = 0
        """Macro steps in which the shortest adaptive micro steps did not reach the tolerance."""
        self.q, self.v, self.tau = (self._room(name, nv) for name in ("q", "v", "tau"))
        self.half, self.drive = self._room("half", nv), self._room("drive", nv)
        self._changing = [self.q, self.v, self.half, self.drive, self.tau]
        self._changing += [self._room(name, nv) for name in ("contact_push", "load_push", "free")]
        self._changing.append(self._room("minv", nv, nv))
        self._changing += [self._room("free_rate", nv), self._room("minv_rate", nv, nv)]
        for name in ("free_middle", "free_slope", "free_curve"):
            self._room(name, nv)
        for name in ("minv_middle", "minv_slope", "minv_curve", "compliance"):
            self._room(name, nv, nv)
        for name in ("slope", "system"):
            self._room(name, nv, nv)
        self._changing.append(self._room("inverse", nv, nv))
        self._room("trial", 7, nv)
        self._room("scratch", 4 * nv + len(POWERS))
        path = self._room("path", ROWS, nv)
        self.middle = (path[MIDDLE], path[MIDDLE_SPEED])
        for name in ("touched", "place"):
            self._point(name, np.zeros(nv, np.int64))
        self.inverse_mass = self._point("found_minv", data.Minv)
        self._point("found_free", data.ddq)
        self._point("jacobian", data.J)
        if own_acceleration:
            self.acceleration = self._room("a", nv)
            self._changing.append(self.acceleration)
        else:
            self.acceleration = self._point("a", data.ddq)
        self.joints = self._point("joints", np.zeros(nj, layout.JOINT))
        self.contacts = self._point("contacts", np.zeros((nj, width), layout.CONTACT))
        for name in ("shortest", "gap_min", "deepest"):
            self.contacts[name] = np.inf
        self.drives = self._point("drives", tables.drives)
        self.turning = self._room("turning", nv)
        weights = self._room("weights", nv)
        weights[:] = 1.0
        weights[self.drives["coordinate"][self.drives["armature"] > 0.0]] = 0.0
        self.frictions = self._point("frictions", tables.frictions)
        self.gears = self._point("gears", tables.gears)
        self.loads = self._point("loads", np.zeros(len(loads), layout.LOAD))
        for index, load in enumerate(loads):
            self._write_load(index, load, data)
        self.reference = self._point("reference", np.ascontiguousarray(tables.reference, float))
        self.windows = np.zeros((0, 2))
        self.record = np.zeros((rows, columns))
        self.sites, self.load_sites = tuple(sites), tuple(loads)
        self.sliding_work: list[np.ndarray] = []
        """For each joint, normal force x sliding distance by contact and azimuth [N m]."""
        for j, site in enumerate(sites):
            self._write(j, site, data)
        self._set(
            nv=nv,
            nj=nj,
            width=width,
            nu=self.reference.shape[1] // 3,
            nd=len(self.drives),
            nf=len(self.frictions),
            ng=len(self.gears),
            nl=len(self.loads),
            nref=len(self.reference),
            record_columns=columns,
            every=every,
            dt=dt,
            dt_before=dt,
            reference_interval=tables.interval,
            through_frames=int(any(site.first is None for site in sites))
            or int(self.loads["frames"].any()),
            prescribed=int(np.any(self.drives["armature"] > 0.0)),
            record=self.record.ctypes.data,
            rows=rows,
        )

    def _set(self, **fields: float) -> None:
        for name, value in fields.items():
            self.run[name] = value

    def _point(self, name: str, array: np.ndarray) -> np.ndarray:
        """Let the record's field `name` point to an array."""
        self.run[name] = array.ctypes.data
        self._kept.append(array)
        self._arrays[name] = array
        self._addresses["run"].add(name)
        return array

    def _room(self, name: str, *shape: int) -> np.ndarray:
        return self._point(name, np.zeros(shape))

    def _write(self, j: int, site: ContactSite, data: pin.Data) -> None:
        joint = self.joints[j]
        parameters = self.contacts["parameters"][j]
        for row, values in zip(parameters, site.parameters, strict=False):
            row[: len(values)] = values
        self.sliding_work.append(np.zeros((site.wearing, AZIMUTHS)))
        if site.first is None:
            assert site.carriers is not None
            assert site.signs is not None
            support, signs = self._reach("joints", joint, site.carriers, site.signs, data)
        else:
            support = site.first + np.arange(6)
            signs = np.ones(6, np.int64)
        n = len(support)
        arrays = {
            "dimensions": np.array([*site.dimensions, *(0.0,) * 4]),
            "support": support.astype(np.int64),
            "signs": signs,
            "reach": np.zeros((6, n)),
            "sliding_work": self.sliding_work[j],
        }
        for name, array in arrays.items():
            joint[name] = array.ctypes.data
            self._kept.append(array)
            self._arrays[f"{name}.{j}"] = array
        self._addresses["joints"] |= {*arrays, "normal_law", "friction_law", "film_law"}
        joint["friction_parameters"][: len(site.friction_parameters)] = site.friction_parameters
        joint["first"] = layout.NO_VIRTUAL_LINK if site.first is None else site.first
        joint["nsupport"], joint["shape"] = n, site.shape
        joint["normal_law"], joint["friction_law"] = site.normal, site.friction
        joint["bristles"], joint["count"] = int(site.bristles), len(site.parameters)
        joint["limit"], joint["wearing"] = -site.depth_limit, site.wearing
        joint["must_not_touch"] = site.must_not_touch
        if site.film is not None:
            joint["film_law"] = site.film.law
            for name in ("sections", "section", "clearance", "thinnest", "transition", "lag_mass"):
                joint[name] = getattr(site.film, name)
            joint["film_parameters"][: len(site.film.parameters)] = site.film.parameters

    def _reach(
        self, kind: str, row: np.ndarray, carriers: Carriers, signs: np.ndarray, data: pin.Data
    ) -> tuple[np.ndarray, np.ndarray]:
        """Let a joint or load be reached through its frames; returns support and signs."""
        for part, (index, placement) in zip(PARTS, carriers, strict=True):
            frame = data.oMi[index]
            for name in ("rotation", "translation"):
                view = getattr(frame, name)
                row[f"{part}_{name}"] = view.ctypes.data
                self._kept.append(view)
            row[f"{part}_placement"] = [*placement.rotation.ravel(), *placement.translation]
            self._addresses[kind] |= {f"{part}_rotation", f"{part}_translation"}
        support = np.flatnonzero(signs)
        return support, signs[support].astype(np.int64)

    def _write_load(self, index: int, site: LoadSite, data: pin.Data) -> None:
        load = self.loads[index]
        arrays = {
            "numbers": site.numbers,
            "elastic": np.zeros((2, site.size)),
            "seen": np.array(site.seen, np.int64),
            "pushed": np.array(site.pushed, np.int64),
            "bounds": np.array(site.bounds, float),
        }
        if site.carriers is None:
            arrays["place"], arrays["rate"] = np.zeros(len(site.seen)), np.zeros(len(site.seen))
            arrays["out"] = np.zeros(site.size)
            self._changing.append(arrays["out"])
        else:
            assert site.signs is not None
            support, signs = self._reach("loads", load, site.carriers, site.signs, data)
            n = len(support)
            arrays |= {"support": support.astype(np.int64), "signs": signs}
            arrays["reach"] = np.zeros((6, n))
            load["frames"], load["nsupport"] = 1, n
            places = layout.LOAD.fields
            assert places is not None
            here = self.loads.ctypes.data + index * layout.LOAD.itemsize
            for name, field in (("place", "pose"), ("rate", "twist"), ("out", "wrench")):
                load[name] = here + places[field][1]
        for name, array in arrays.items():
            load[name] = array.ctypes.data
            self._kept.append(array)
            self._arrays[f"load.{name}.{index}"] = array
        self._addresses["loads"] |= {*arrays, "law", "place", "rate", "out"}
        load["law"], load["stores"], load["implicit"] = site.law, site.stores, site.implicit
        load["nseen"], load["npushed"] = len(site.seen), len(site.pushed)
        load["bounded"] = int(bool(site.bounds))

    def place(self, bodies: np.ndarray, carried: Sequence[CarriedFrame]) -> None:
        """Have the kernels place the bodies that joints are reached through, instead of Pinocchio.

        Args:
            bodies: of `layout.BODY`, the ground first.
            carried: bearing and journal, in turn, of every joint that is reached through frames;
                then both frames of every load that acts between two.
        """
        self._point("bodies", bodies)
        self._room("jacobian", len(self.q), 6)
        frames = iter(carried)
        sites: list[ContactSite | LoadSite] = [*self.sites, *self.load_sites]
        for joint, site in zip([*self.joints, *self.loads], sites, strict=True):
            if site.carriers is None:
                continue
            for part, (carrier, place) in zip(PARTS, frames, strict=False):
                body = bodies[carrier : carrier + 1]
                joint[f"{part}_rotation"] = body["rotation"].ctypes.data
                joint[f"{part}_translation"] = body["origin"].ctypes.data
                joint[f"{part}_placement"] = place
        self._set(nb=len(bodies), through_frames=0)

    def hold(self, holds: np.ndarray) -> None:
        """Have the kernels close the loops without clearance; after `place`.

        Args:
            holds: of `layout.HOLD`.
        """
        nv, rows = len(self.q), 3 * len(holds)
        self._point("holds", holds)
        self.run["open_minv"], self.run["open_free"] = (
            self.run["found_minv"],
            self.run["found_free"],
        )
        self._addresses["run"] |= {"open_minv", "open_free"}
        self._room("found_free", nv)
        for name in ("found_minv", "closing_minv"):
            self._room(name, nv, nv)
        for name, shape in {"held": (rows, nv), "lacking": (2, rows), "closing": (2, nv)}.items():
            self._room(name, *shape)
        self._set(nh=len(holds))

    def state(self) -> list[np.ndarray]:
        """All arrays that a macro step changes, but for the records: to come back to a state."""
        records = [self.run, self.joints, self.contacts, self.loads]
        return [*records, *self._changing, *self.sliding_work]

    def snapshot(self) -> dict[str, np.ndarray]:
        """Copies of all that the run has written, by name: to come back to it in another process.

        The table of the reference is left out; addresses are zero.
        """
        found = {name: array.copy() for name, array in self._arrays.items() if name != "reference"}
        found["run"] = self.run.copy()
        for name, fields in self._addresses.items():
            for field in fields:
                found[name][field] = 0
        found["written"] = self.record[: self.rows].copy()
        return found

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Come back to what `snapshot` found in a workspace of the same simulation.

        Raises:
            JointplayError: the snapshot is that of another simulation.
        """
        own = {name: array for name, array in self._arrays.items() if name != "reference"}
        own["run"] = self.run
        for name, array in own.items():
            given = snapshot.get(name)
            if given is None or given.shape != array.shape or given.dtype != array.dtype:
                raise JointplayError(f"the state of {name!r} is not that of this simulation")
        written = snapshot["written"]
        if written.ndim != 2 or written.shape[1] != self.record.shape[1]:
            raise JointplayError("the records are not those of this simulation")
        rows = int(self.run["rows"][0])
        for name, array in own.items():
            if array.dtype.names is None:
                np.copyto(array, snapshot[name])
                continue
            for field in set(array.dtype.names) - self._addresses.get(name, set()):
                array[field] = snapshot[name][field]
        self._set(rows=rows, nwindows=len(self.windows))
        self.record[: len(written)] = written

    def make_room(self, rows: int) -> None:
        """Have room for `rows` records, before the first of them is written."""
        self.record = np.zeros((rows, self.record.shape[1]))
        self._set(record=self.record.ctypes.data, rows=rows)

    def watch(self, windows: Sequence[tuple[int, int]]) -> None:
        """Record every step from the first to the last of each of these pairs of steps, too."""
        self.windows = np.array(windows, float).reshape(-1, 2)
        self._set(windows=self.windows.ctypes.data, nwindows=len(self.windows))

    def do(self, command: Command) -> Status:
        """Let the kernels carry out a command; returns the run's status."""
        return Status(enter(self.run, int(command)))

    @property
    def needs_jacobians(self) -> bool:
        """Whether a joint is reached through Pinocchio's frames and Jacobians."""
        return bool(self.run["through_frames"][0])

    @property
    def rows(self) -> int:
        """Records written so far."""
        return self._row.item()

    @property
    def steps(self) -> int:
        """Steps done so far."""
        return self._step.item()

    @property
    def macro_steps(self) -> int:
        """Macro steps done so far, of the multi-rate method."""
        return self._macros.item()

    @property
    def time(self) -> float:
        """Time of the current state [s]."""
        return self._time.item()

    @property
    def failed(self) -> bool:
        """Whether something has stopped the run."""
        return self._status.item() != 0

    @property
    def status(self) -> Status:
        """Status of the run."""
        return Status(self._status.item())

    @property
    def bad_contact(self) -> tuple[int, int]:
        """(joint, contact) that stopped the run with `BROKE_OUT` or `BAD_FORCE`."""
        joint, contact = divmod(int(self.run["bad_contact"][0]), max(self.contacts.shape[1], 1))
        return joint, contact

    def recorded(self, name: str) -> np.ndarray:
        """Columns `name` of the records written so far, shape (rows, width)."""
        return self.record[: self.rows, self.fields[name]]

    def contact_statistics(self) -> dict[str, np.ndarray]:
        """Per joint and contact, (nj, width).

        Counts, steps, impulses [N s], smallest gap [m], fastest approach [m/s].
        """
        names = {
            "onsets": "onsets",
            "ended": "ended",
            "shortest_steps": "shortest",
            "under_resolved": "under",
            "impulse": "impulse",
            "under_resolved_impulse": "impulse_under",
            "smallest_gap": "deepest",
        }
        found = {name: self.contacts[field].copy() for name, field in names.items()}
        # A contact that has not ended keeps its approach to itself.
        fastest = np.maximum(self.contacts["fastest"], self.contacts["ddelta0"])
        return found | {"fastest_approach": fastest}


def _layout(
    nv: int, nj: int, width: int, loads: Sequence[LoadSite]
) -> tuple[dict[str, slice], int]:
    """Columns of a record, and their number."""
    widths = {
        "time": 1,
        "q": nv,
        "v": nv,
        "drive": nv,
        "work": len(POWERS),
        "force": 3 * nj,
        "force_peak": 3 * nj,
        "film_force": 3 * nj,
        "normal": width * nj,
        "tangential": width * nj,
        "normal_peak": width * nj,
        "gap_min": width * nj,
        "load_force": sum(load.size for load in loads),
        "load_work": len(loads),
    }
    fields, at = {}, 0
    for name, size in widths.items():
        fields[name] = slice(at, at + size)
        at += size
    return fields, at


@dataclass(frozen=True)
class Tables:
    """What acts on single coordinates."""

    drives: np.ndarray
    """Of `layout.DRIVE_ROW`, see `drive_row`."""
    frictions: np.ndarray
    """Of `layout.FRICTION_ROW`."""
    gears: np.ndarray
    """Of `layout.GEAR_ROW`."""
    reference: np.ndarray
    """Rows of q, v and feed-forward effort of the nu driven coordinates, shape (nref, 3 nu),
    nref >= 2."""
    interval: float
    """Between the rows of `reference` [s]."""


def drive_row(
    column: int,
    coordinate: int,
    seen: int | None = None,
    kp: float = 0.0,
    kd: float = 0.0,
    armature: float = 0.0,
    limit: float = np.inf,
) -> np.ndarray:
    """Record of the drive of one coordinate, shape (1,).

    Args:
        column: of the reference.
        coordinate: that it acts on.
        seen: coordinate that its encoder sees; None takes its own.
        kp, kd: gains [N m/rad, N m s/rad, or N/m, N s/m].
        armature: > 0 prescribes the motion; the model must have this armature [kg m^2 or kg].
        limit: largest effort, to which others are cut [N m or N].
    """
    seen = coordinate if seen is None else seen
    return np.array([(column, coordinate, seen, kp, kd, armature, limit)], layout.DRIVE_ROW)


def friction_row(
    coordinate: int, coulomb: float, stiction: float, stribeck: float, viscous: float
) -> np.ndarray:
    """Record of a joint's friction, shape (1,); see `drive.JointFriction`."""
    return np.array([(coordinate, coulomb, stiction, stribeck, viscous)], layout.FRICTION_ROW)


def gear_row(
    motor: int, link: int, half_play: float, stiffness: float, damping: float
) -> np.ndarray:
    """Record of a gear, shape (1,): coordinates, half the play [rad], stiffness and damping."""
    return np.array([(motor, link, half_play, stiffness, damping)], layout.GEAR_ROW)


def stacked(rows: Sequence[np.ndarray], kind: np.dtype) -> np.ndarray:
    """All rows of one kind, an empty array if there are none."""
    return np.concatenate(rows) if rows else np.zeros(0, kind)
