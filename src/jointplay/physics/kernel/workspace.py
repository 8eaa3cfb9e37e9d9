"""The arrays of one run, and the record through which the kernels reach them (`kernel.layout`)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.physics.contact.resultant import SEAT_ANSWERS
from jointplay.physics.kernel import Command, Status, caller_of, layout
from jointplay.physics.kernel.constants import AZIMUTHS
from jointplay.physics.kernel.entry import apart
from jointplay.physics.kernel.layout import (
    PARTS,
    CarriedFrame,
    Carriers,
    CoordinateTables,
    JointSite,
    LoadSite,
)

FIXED = (
    *("dimensions", "dt", "reference_interval"),
    *("micro_tolerance", "shortest_micro", "longest_micro"),
)
"""Fields and arrays of floats that `restore` leaves as they are: the simulation's settings."""

CACHE_LINE = 8
"""Floats in a cache line; a vector register that crosses two lines takes twice as long to load."""
LEFT_OUT = "reference"
"""Array that a simulation makes again, and that no snapshot needs."""

SUPPLIED = frozenset(
    (
        *("a", "found_minv", "found_free", "world_jacobian", "open_minv", "open_free"),
        *("joints", "contacts", "loads", "drives", "servos", "frictions", "gears"),
        *("reference", "record", "windows", "copies", "bodies", "holds"),
        *("loop_rows", "loop_residual", "loop_correction", "loop_minv"),
        *("row_before", "row_after", "earlier_a"),
    )
)
"""Arrays that `Workspace` does not allocate at once: those it is given, shares with Pinocchio, or
has only if they are needed."""


class Workspace:
    """The arrays of one run and the record through which the kernels reach them.

    Args:
        data: Pinocchio's data of the run, whose results the kernels read in place.
        nv: number of coordinates.
        sites: the joints with clearance.
        tables: drives, friction, gears and reference.
        dt: time step [s].
        record_every: steps between records.
        rows: room for records.
        own_acceleration: whether the kernels compute the acceleration; else it is Pinocchio's.
        loads: what else acts on the mechanism.

    Attributes:
        run, address: the record `layout.RUN`, shape (1,), and its address.
        q, v: state, shape (nv,).
        drives, servos, frictions, gears: records of what acts on single coordinates.
        contacts: records of the contacts, shape (nj, width).
        record: recorded states, one row each.
        fields: columns of each recorded quantity, by name.
        middle: q and v in the middle of the macro step that is planned, each of shape (nv,).
    """

    def __init__(
        self,
        data: pin.Data,
        nv: int,
        sites: Sequence[JointSite],
        tables: CoordinateTables,
        dt: float,
        record_every: int,
        rows: int,
        own_acceleration: bool,
        loads: Sequence[LoadSite] = (),
    ) -> None:
        self.run = np.zeros(1, layout.RUN)
        self.address = self.run.ctypes.data
        self._pointed_to: list[np.ndarray] = []  # what records point to must live as long
        self._arrays: dict[str, np.ndarray] = {}  # these by name, Pinocchio's frames left out
        self._own_acceleration = own_acceleration
        self.sites, self.load_sites = tuple(sites), tuple(loads)
        # Views of single fields: looking a field up costs more than reading it.
        self._row, self._step = self.run["row"], self.run["step"]
        self._time, self._status = self.run["time"], self.run["status"]
        self._macros = self.run["macros"]
        rolling = any(site.record["resultant"][0] for site in sites)
        self._set(
            nv=nv,
            nj=len(sites),
            width=max((len(site.parameters) for site in sites), default=0),
            nd=len(tables.drives),
            ns=len(tables.servos),
            nf=len(tables.frictions),
            bristled=int((tables.frictions["presliding"] > 0.0).sum()),
            ng=len(tables.gears),
            nl=len(loads),
            nu=tables.reference.shape[1] // 3,
            nref=tables.nodes,
            cages=len(sites) if rolling else 0,
            load_columns=sum(load.size for load in loads),
            record_every=record_every,
            dt=dt,
            dt_before=dt,
            reference_interval=tables.interval,
        )
        self.fields = self._place_columns()
        for name in layout.ARRAYS[layout.RUN].keys() - SUPPLIED:
            self._allocate(name)
        names = ("q", "v", "half", "tau", "drive", "angular")
        self.q, self.v, self.half, self.tau, self.drive, self.angular = (
            self._arrays[name] for name in names
        )
        path = self._arrays["path"]
        self.middle = (path[layout.MIDDLE], path[layout.MIDDLE_SPEED])
        # The kernels read Pinocchio's results in place.
        self._point("found_minv", data.Minv)
        self._point("found_free", data.ddq)
        self._point("world_jacobian", data.J)
        self.acceleration = self._allocate("a") if own_acceleration else self._point("a", data.ddq)
        self._take_tables(tables)
        self.joints, self.contacts = self._allocate("joints"), self._allocate("contacts")
        for name in ("shortest", "gap", "gap_min", "deepest"):
            self.contacts[name] = np.inf
        self.loads = self._allocate("loads")
        if loads:
            self._set(load_part=apart("load"))
        self.sliding_work: list[np.ndarray] = []
        """Per joint, normal force times sliding distance, (part, contact, azimuth) [N m]."""
        for index, load in enumerate(loads):
            self._write_load(index, load, data)
        for j, site in enumerate(sites):
            self._write_joint(j, site, data)
        self.windows = np.zeros((0, 2))
        self.record = np.zeros((rows, int(self.run["record_columns"][0])))
        self.kept_elsewhere = 0
        """Number of records that are no longer in memory, see `release_records`."""
        through_frames = (
            any(site.carriers is not None for site in sites) or self.loads["frames"].any()
        )
        self._set(through_frames=int(through_frames))
        self._place_records()

    def _set(self, **fields: float) -> None:
        for name, value in fields.items():
            self.run[name] = value

    def _place_columns(self) -> dict[str, layout.Quantity]:
        """Lay out the columns of a recorded row; returns them by the quantity's name."""
        fields, at = {}, 0
        for place, (name, sizes) in enumerate(layout.ROW.items()):
            self.run["columns"][0, place], shape = at, layout.extents(sizes, self.run[0])
            fields[name] = layout.Quantity(slice(at, at + math.prod(shape)), shape)
            at += math.prod(shape)
        self._set(record_columns=at)
        return fields

    def _point(self, name: str, array: np.ndarray) -> np.ndarray:
        """Let the record's field `name` point to an array."""
        self._point_row(self.run[0], {name: array}, "{}")
        return array

    def _allocate(self, name: str) -> np.ndarray:
        """Let the record's field `name` point to an array of zeros, aligned to a cache line."""
        declared = layout.ARRAYS[layout.RUN][name]
        shape = layout.extents(declared.room, self.run[0])
        line = 8 * CACHE_LINE
        size = math.prod(shape) * declared.kind.itemsize
        room = np.zeros(size + line, np.uint8)
        first = -room.ctypes.data % line
        return self._point(name, room[first : first + size].view(declared.kind).reshape(shape))

    def _point_row(self, row: np.ndarray, arrays: Mapping[str, np.ndarray], called: str) -> None:
        """Let fields of a record point to arrays, kept by the names `called`."""
        for name, array in arrays.items():
            declared = layout.ARRAYS[row.dtype].get(name)
            if declared is not None:  # compiled code relies on what `layout` declares
                size = math.prod(layout.extents(declared.room, row))
                assert (array.dtype, array.size) == (declared.kind, size), (name, array.shape, size)
            row[name] = array.ctypes.data
            self._pointed_to.append(array)
            self._arrays[called.format(name)] = array

    def _owned_arrays(self) -> dict[str, np.ndarray]:
        arrays = {name: array for name, array in self._arrays.items() if name != LEFT_OUT}
        return arrays | {"run": self.run}

    def _write_back(
        self,
        copies: Mapping[str, np.ndarray],
        state: Mapping[str, Mapping[str, float]],
        fixed: Collection[str],
    ) -> None:
        """Write a snapshot into the arrays.

        Sizes, indices and addresses are not taken from it: it can come from a file, and compiled
        code would follow them wherever they lead.

        Args:
            copies: arrays of the snapshot, by name.
            state: whole numbers that steps change, each with its largest value: by name of the
                array, then of the field ("" for an array without fields). No other whole number is
                written.
            fixed: arrays of floats, and fields of the record, that are not written either.

        Raises:
            JointplayError: it is that of another simulation, or no step leads to it; nothing is
                written then.
        """
        arrays = self._owned_arrays()
        for name, array in arrays.items():
            copy = copies.get(name)
            if copy is None or copy.shape != array.shape or copy.dtype != array.dtype:
                raise JointplayError(f"the state of {name!r} is not that of this simulation")
        writes = []
        for name, array in arrays.items():
            addresses = layout.ADDRESSES.get(array.dtype, ())
            for field in array.dtype.names or ("",):
                if field in addresses or (field or name.split(".")[0]) in fixed:
                    continue
                source, target = copies[name], array
                if field:
                    source, target = source[field], target[field]
                if target.dtype.kind == "i":
                    most = state.get(name, {}).get(field)
                    if most is None:
                        continue
                    if source.size and not (source.min() >= 0 and source.max() <= most):
                        raise JointplayError(f"{field or name!r} has a value that no run has")
                writes.append((target, source))
        for target, source in writes:
            np.copyto(target, source)

    def _take_tables(self, tables: CoordinateTables) -> None:
        """Point the record to drives, servos, friction, gears and the reference."""
        self.drives = self._point("drives", tables.drives)
        prescribed = self.drives["armature"] > 0.0
        weights = self._arrays["weights"]
        weights[:] = 1.0
        weights[self.drives["coordinate"][prescribed]] = 0.0
        self._set(prescribed=int(prescribed.any()))
        self.servos = self._point("servos", tables.servos)
        if len(self.servos):
            self._set(servo_part=apart("servo"))
        self.frictions = self._point("frictions", tables.frictions)
        self.gears = self._point("gears", tables.gears)
        if len(self.gears):
            self._set(gear_part=apart("gear"))
        self.set_reference_block(tables.reference, 0)
        self._nodes = tables.nodes

    def _write_joint(self, j: int, site: JointSite, data: pin.Data) -> None:
        self.joints[j] = site.record[0]
        joint = self.joints[j]
        if joint["sections"]:
            joint["film_part"] = apart("film")
        if joint["resultant"]:
            joint["element_part"] = apart("element")
        self.contacts["parameters"][j, : len(site.parameters)] = site.parameters
        if site.holds:
            self.contacts["steps"][j] = 1.0  # it never begins
        self.sliding_work.append(np.zeros((2, joint["wearing"], AZIMUTHS)))
        if site.carriers is None:
            support, signs = joint["first"] + np.arange(6), np.ones(6, np.int64)
        else:
            assert site.signs is not None
            support, signs = self._link_frames(joint, site.carriers, site.signs, data)
        joint["nsupport"] = len(support)
        arrays = {
            "dimensions": np.array([*site.dimensions, *(0.0,) * 4]),
            "support": support.astype(np.int64),
            "signs": signs,
            "jacobian": np.zeros((6, len(support))),
            "sliding_work": self.sliding_work[j],
            "elements": np.zeros(SEAT_ANSWERS if joint["resultant"] else 1),
        }
        self._point_row(joint, arrays, "{}." + str(j))

    def _link_frames(
        self, row: np.ndarray, carriers: Carriers, signs: np.ndarray, data: pin.Data
    ) -> tuple[np.ndarray, np.ndarray]:
        """Point a joint's or load's record to Pinocchio's frames that carry it.

        Returns:
            Coordinates that move one frame and not the other, and the sign of each: +1 for those
            that move the journal, -1 for the bearing.
        """
        for part, (index, placement) in zip(PARTS, carriers, strict=True):
            frame = data.oMi[index]
            for name in ("rotation", "translation"):
                view = getattr(frame, name)
                row[f"{part}_{name}"] = view.ctypes.data
                self._pointed_to.append(view)
            row[f"{part}_placement"] = [*placement.rotation.ravel(), *placement.translation]
        support = np.flatnonzero(signs)
        return support, signs[support].astype(np.int64)

    def _write_load(self, index: int, site: LoadSite, data: pin.Data) -> None:
        load = self.loads[index]
        load["law"], load["stores"], load["implicit"] = site.law, site.stores, site.implicit
        load["ninputs"], load["noutputs"] = len(site.inputs), len(site.outputs)
        load["nanswers"], load["nbounds"] = site.size, len(site.bounds)
        load["nrates"] = len(site.inputs) if site.carriers is None else 6
        arrays = {
            "numbers": site.numbers,
            "elastic": np.zeros((2, site.size)),
            "inputs": np.array(site.inputs, np.int64),
            "outputs": np.array(site.outputs, np.int64),
            "bounds": np.array(site.bounds, float),
        }
        if site.carriers is None:
            arrays["place"], arrays["rate"] = np.zeros(len(site.inputs)), np.zeros(len(site.inputs))
            arrays["out"] = np.zeros(site.size)
        else:
            assert site.signs is not None
            support, signs = self._link_frames(load, site.carriers, site.signs, data)
            n = len(support)
            arrays |= {"support": support.astype(np.int64), "signs": signs}
            arrays["jacobian"] = np.zeros((6, n))
            load["frames"], load["nsupport"] = 1, n
            # The law reads pose and twist, and writes the wrench, within the record itself.
            offsets = layout.LOAD.fields
            assert offsets is not None
            address = self.loads.ctypes.data + index * layout.LOAD.itemsize
            for name, field in (("place", "pose"), ("rate", "twist"), ("out", "wrench")):
                load[name] = address + offsets[field][1]
        self._point_row(load, arrays, "load.{}." + str(index))

    def place(self, bodies: np.ndarray, carried: Sequence[CarriedFrame]) -> None:
        """Let the kernels, not Pinocchio, compute the poses of the bodies that carry joints.

        Args:
            bodies: records `layout.BODY`, the ground first.
            carried: bearing and journal, in turn, of every joint that is reached through frames;
                then both frames of every load that acts between two.
        """
        self._set(nb=len(bodies), through_frames=0)
        self._point("bodies", bodies)
        self._allocate("world_jacobian")
        frames = iter(carried)
        sites: list[JointSite | LoadSite] = [*self.sites, *self.load_sites]
        for joint, site in zip([*self.joints, *self.loads], sites, strict=True):
            if site.carriers is None:
                continue
            for part, (carrier, place) in zip(PARTS, frames, strict=False):
                body = bodies[carrier : carrier + 1]
                joint[f"{part}_rotation"] = body["rotation"].ctypes.data
                joint[f"{part}_translation"] = body["origin"].ctypes.data
                joint[f"{part}_placement"] = place

    def turn_body(self, coordinate: int, turn: np.ndarray) -> None:
        """Set the orientation (3, 3), at zero, of the body that a coordinate (index in q) turns."""
        bodies = self._arrays.get("bodies")
        if bodies is not None:
            moved = np.flatnonzero(bodies["coordinate"] == coordinate)
            bodies["turn"][moved[moved > 0]] = turn.ravel()

    def set_held_pairs(self, holds: np.ndarray) -> None:
        """Have the kernels close the loops without clearance (`layout.HOLD`); after `place`."""
        self._set(nh=len(holds), loop_part=apart("loop"))
        self._point("holds", holds)
        # Pinocchio's results are those of the open tree then, and the kernels write those of the
        # closed mechanism to arrays of their own.
        for name in ("minv", "free"):
            self._point(f"open_{name}", self._arrays[f"found_{name}"])
            self._allocate(f"found_{name}")
        for name in ("loop_rows", "loop_residual", "loop_correction", "loop_minv"):
            self._allocate(name)

    def state(self) -> list[np.ndarray]:
        """All arrays that a macro step changes, recorded rows left out: to come back to a state."""
        records = [self.run, self.joints, self.contacts, self.loads]
        changing = [
            self._arrays[name]
            for name, declared in layout.ARRAYS[layout.RUN].items()
            if declared.changes and name in self._arrays and (name != "a" or self._own_acceleration)
        ]
        out = [array for name, array in self._arrays.items() if name.startswith("load.out.")]
        return [*records, *changing, *out, *self.sliding_work]

    def snapshot(self) -> dict[str, np.ndarray]:
        """Copy everything the run has written, by name, for `restore` in another process.

        The reference is left out; addresses are zero.
        """
        copies = {name: array.copy() for name, array in self._owned_arrays().items()}
        for copy in copies.values():
            for field in layout.ADDRESSES.get(copy.dtype, ()):
                copy[field] = 0
        copies["written"] = self.record[: self.rows - self.kept_elsewhere].copy()
        copies["kept_elsewhere"] = np.array(self.kept_elsewhere)
        return copies

    def restore(self, copies: Mapping[str, np.ndarray]) -> None:
        """Come back to a snapshot of a workspace of the same simulation.

        Raises:
            JointplayError: the snapshot is that of another simulation.
        """
        written = copies["written"]
        if written.ndim != 2 or written.shape[1] != self.record.shape[1]:
            raise JointplayError("the records are not those of this simulation")
        if len(written) > len(self.record):
            raise JointplayError("there are more records than this simulation makes")
        elsewhere, now = int(copies["kept_elsewhere"]), copies["run"][0]
        if elsewhere < 0 or int(now["row"]) != elsewhere + len(written):
            raise JointplayError("its records are not as many as it says")
        dt, longest = float(self.run["dt"][0]), int(self.run["longest"][0])
        near = {"time": int(now["step"]) * dt}
        if self._own_acceleration:
            near |= {"path_start": near["time"], "path_span": 0.0}
        for name, about in near.items():
            if not abs(float(now[name]) - about) <= (longest + 1) * dt:
                raise JointplayError(f"{name!r} is not that of its step")
        self._write_back(copies, self._state_numbers(), FIXED)
        self.kept_elsewhere = elsewhere
        self._set(nwindows=len(self.windows), nref=self._nodes)
        self._place_records()
        self.record[: len(written)] = written

    def _state_numbers(self) -> dict[str, dict[str, float]]:
        """Whole numbers that steps change, each with the largest value that it can have."""
        last, longest = len(self.q) - 1, float(self.run["longest"][0])
        flags = ("fresh", "pending", "commit", "refused", "averaged", "pushed_bends")
        counts = (
            *("until", "step", "row", "macros", "touching", "events", "unsolved"),
            *("iterations", "solves", "unresolved"),
        )
        run = {
            **dict.fromkeys(flags, 1.0),
            **dict.fromkeys(counts, math.inf),
            **dict.fromkeys(("active", "factored"), last + 1.0),
            **dict.fromkeys(("known_middles", "known_free", "stage"), 3.0),
            "known_a": 2.0,
            **dict.fromkeys(("suggested", "macro"), max(longest, 1.0)),
            "status": float(max(Status)),
            "bad_contact": float(max(self.contacts.size - 1, 0)),
        }
        return {
            "run": run,
            "joints": {"touching": 1.0},
            "contacts": {"touching": 1.0},
            "loads": {"active": 1.0},
            "touched": {"": float(last)},
            "place": {"": float(last)},
            "exchanged": {"": float(last)},
        }

    def reserve_records(self, rows: int) -> None:
        """Make room for `rows` records, before the first of them is written."""
        self.record = np.zeros((rows, self.record.shape[1]))
        self._place_records()

    def release_records(self) -> np.ndarray:
        """Hand over the records in memory (n, columns), so that the next are written over them.

        They are valid until then.
        """
        records = self.record[: self.rows - self.kept_elsewhere]
        self.kept_elsewhere = self.rows
        self._place_records()
        return records

    def _place_records(self) -> None:
        """Set the address of the records, as if those that are elsewhere lay before them."""
        before = self.kept_elsewhere * self.record.strides[0]
        room = self.kept_elsewhere + len(self.record)
        self._set(record=self.record.ctypes.data - before, rows=room)

    def set_reference_block(self, reference: np.ndarray, first: int) -> None:
        """Let drives follow another part of the reference, which begins with its node `first`.

        The address is set as if the earlier nodes lay before it.
        """
        self.reference = self._arrays["reference"] = np.ascontiguousarray(reference, float)
        before = first * self.reference.strides[0]
        self._set(reference=self.reference.ctypes.data - before)

    def record_windows(self, windows: Sequence[tuple[int, int]]) -> None:
        """Record, besides, every step of these windows, each from its first to its last step."""
        self.windows = np.array(windows, float).reshape(-1, 2)
        self._set(windows=self.windows.ctypes.data, nwindows=len(self.windows))

    def execute(self, command: Command) -> Status:
        """Execute a command in the kernels; returns the run's status."""
        return Status(caller_of(command)(self.address, int(command)))

    @property
    def needs_jacobians(self) -> bool:
        """Whether a joint is reached through Pinocchio's frames and Jacobians."""
        return bool(self.run["through_frames"][0])

    def keep_copies(self) -> None:
        """Allocate what adaptive micro steps need: copies to come back to, and rows in between."""
        for name in ("row_before", "row_after", "earlier_a"):
            self._allocate(name)
        arrays = [array for array in self.state() if array.size]
        self._copies = [array.copy() for array in arrays]
        table = [
            (array.ctypes.data, copy.ctypes.data, array.nbytes // 8)
            for array, copy in zip(arrays, self._copies, strict=True)
        ]
        self._copy_table = np.array(table, np.int64)
        self._set(copies=self._copy_table.ctypes.data, ncopies=len(table))

    @property
    def unresolved(self) -> int:
        """Number of micro steps, the shortest allowed, whose error was still above tolerance."""
        return int(self.run["unresolved"][0])

    @property
    def rows(self) -> int:
        """Number of records written so far."""
        return self._row.item()

    @property
    def steps(self) -> int:
        """Number of steps done so far."""
        return self._step.item()

    @property
    def macro_steps(self) -> int:
        """Number of macro steps done so far by the multi-rate method."""
        return self._macros.item()

    @property
    def time(self) -> float:
        """Time of the current state [s]."""
        return self._time.item()

    @property
    def status(self) -> Status:
        """Whether the run goes on, or why it was stopped."""
        return Status(self._status.item())

    def fail(self, status: Status, joint: int) -> None:
        """Stop the run because of a joint, given by its index."""
        self.run["status"], self.run["bad_contact"] = status, joint * max(self.contacts.shape[1], 1)

    @property
    def bad_contact(self) -> tuple[int, int]:
        """Indices (joint, contact) of what stopped the run with `BROKE_OUT` or `BAD_FORCE`."""
        joint, contact = divmod(int(self.run["bad_contact"][0]), max(self.contacts.shape[1], 1))
        return joint, contact

    def recorded(self, name: str) -> np.ndarray:
        """Values of a quantity of `layout.ROW` in the records in memory, shape (rows, ...)."""
        return self.fields[name].of(self.record[: self.rows - self.kept_elsewhere])

    def contact_statistics(self) -> dict[str, np.ndarray]:
        """Statistics of each joint's contacts, each of shape (nj, width).

        Numbers of onsets and ends, fewest steps, impulses [N s], smallest gap [m], fastest approach
        [m/s].
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
        statistics = {name: self.contacts[field].copy() for name, field in names.items()}
        # A contact that has not ended keeps its approach to itself.
        fastest = np.maximum(self.contacts["fastest"], self.contacts["ddelta0"])
        return statistics | {"fastest_approach": fastest}
