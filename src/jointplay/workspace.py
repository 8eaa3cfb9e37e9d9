"""The arrays of one run, and the table through which the kernels reach them.

What stands where in the table is said in `kernel`, beside the compiled code that reads it: numba
notices changes of a constant only in the file of the function that uses it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointplay import kernel as k
from jointplay.contact.law import BRISTLE_NUMBERS, FILM_NUMBERS, MAX_PARAMETERS
from jointplay.kernel import Status


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
        frames: views of Pinocchio's memory: rotation and translation of the joints that carry
            bearing and journal.
        placements: of the bearing in its joint's frame and of the journal in its, rotation row by
            row and translation each, shape (24,).
        film: address of the film law, or 0 for a dry joint; then are needed
        film_numbers: see `film_numbers`.
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
    frames: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None = None
    placements: np.ndarray | None = None
    signs: np.ndarray | None = None
    film: int = 0
    film_numbers: np.ndarray | None = None
    must_not_touch: int = 0
    wearing: int = 0


class Workspace:
    """The arrays of one run and the table through which the kernels reach them.

    Args:
        acceleration: Pinocchio's `data.ddq`, a view of its memory, shape (nv,).
        jacobian: Pinocchio's `data.J`, a view of its memory, shape (6, nv).
        sites: one for each joint with clearance.
        coordinates: `coordinate_rows`.
        frictions: `friction_row` for each joint with friction, shape (nf, ...).
        gears: `gear_row` for each gear, shape (ng, ...).
        reference: rows of q, v and feed-forward effort of the nu driven coordinates at intervals
            of `node` seconds, shape (nref, 3 nu), nref >= 2.
        node: interval of `reference` [s].
        dt: time step [s].
        every: steps between records.
        rows: room for records.
    """

    def __init__(
        self,
        acceleration: np.ndarray,
        jacobian: np.ndarray,
        sites: Sequence[ContactSite],
        coordinates: np.ndarray,
        frictions: np.ndarray,
        gears: np.ndarray,
        reference: np.ndarray,
        node: float,
        dt: float,
        every: int,
        rows: int,
    ) -> None:
        """Allocate, and write the table."""
        nv, nj = len(acceleration), len(sites)
        width = max((len(site.parameters) for site in sites), default=0)
        self.fields, columns = _layout(nv, nj, width)
        self.acceleration = acceleration
        self.q = np.zeros(nv)
        self.v = np.zeros(nv)
        self.tau = np.zeros(nv)
        self.drive = np.zeros(nv)
        self.forces = np.zeros((nj, k._FORCE_SIZE))
        self.memory = np.zeros((nj, width, k._MEMORY_SIZE))
        self.memory[:, :, [k._SHORTEST, k._GAP_MIN, k._DEEPEST]] = np.inf
        self.record = np.zeros((rows, columns))
        self.power = np.zeros(3 * k._NP)  # works, powers at the start of the step, powers now
        self.clock = np.zeros(k._CLOCK_SIZE)
        self.clock[k._DT], self.clock[k._NODE] = dt, node
        self.law_numbers = np.zeros(max(BRISTLE_NUMBERS, FILM_NUMBERS))
        self.scratch = np.zeros(4 * nv + k._NP)
        self.coordinates = np.ascontiguousarray(coordinates, float)
        self.frictions = np.ascontiguousarray(frictions, float).reshape(-1, k._FRICTION_SIZE)
        self.gears = np.ascontiguousarray(gears, float).reshape(-1, k._GEAR_SIZE)
        self.reference = np.ascontiguousarray(reference, float)
        self.sliding_work: list[np.ndarray] = []
        """For each joint, normal force x sliding distance by contact and azimuth [N m]."""
        self._kept: list[np.ndarray] = [jacobian]  # what the table points to must live as long
        table = np.zeros(k._BLOCKS + nj * k._BLOCK_SIZE, np.int64)
        for entry, array in (
            (k._Q, self.q),
            (k._V, self.v),
            (k._A, acceleration),
            (k._J, jacobian),
            (k._TAU, self.tau),
            (k._DRIVE, self.drive),
            (k._SCRATCH, self.scratch),
            (k._COORDINATES, self.coordinates),
            (k._FRICTIONS, self.frictions),
            (k._GEARS, self.gears),
            (k._REFERENCE, self.reference),
            (k._RECORD, self.record),
            (k._POWER, self.power),
            (k._CLOCK, self.clock),
            (k._LAW_NUMBERS, self.law_numbers),
        ):
            table[entry] = array.ctypes.data
        table[k._NV], table[k._NJ], table[k._NU] = nv, nj, reference.shape[1] // 3
        table[k._NF], table[k._NG], table[k._WIDTH] = len(self.frictions), len(self.gears), width
        table[k._NREF], table[k._COLUMNS], table[k._EVERY] = len(reference), columns, every
        table[k._HAS_PRESCRIBED] = int(np.any(self.coordinates[k._ARMATURE] != 0.0))
        for j, site in enumerate(sites):
            block = table[k._BLOCKS + j * k._BLOCK_SIZE :][: k._BLOCK_SIZE]
            self._write(block, j, site)
            table[k._FRAMES] |= int(site.first is None)
        self.table = table

    def _write(self, block: np.ndarray, j: int, site: ContactSite) -> None:
        numbers = np.zeros(k._DIMENSIONS + max(len(site.dimensions), 4))
        numbers[k._LIMIT] = -site.depth_limit
        numbers[k._P_FRICTION : k._P_FRICTION + len(site.friction_parameters)] = (
            site.friction_parameters
        )
        numbers[k._DIMENSIONS : k._DIMENSIONS + len(site.dimensions)] = site.dimensions
        parameters = np.zeros((len(site.parameters), MAX_PARAMETERS))
        for row, values in zip(parameters, site.parameters, strict=True):
            row[: len(values)] = values
        pose = np.zeros(k._POSE_SIZE)
        arrays = {
            k._NUMBERS: numbers,
            k._PARAMETERS: parameters,
            k._MEMORY: self.memory[j],
            k._FORCE: self.forces[j],
            k._POSE: pose,
        }
        block[k._WEARING] = site.wearing
        self.sliding_work.append(np.zeros((site.wearing, k.AZIMUTHS)))
        arrays[k._SLIDING_WORK] = self.sliding_work[-1]
        if site.film_numbers is not None:
            arrays |= {
                k._FILM: site.film_numbers,
                k._FILM_MEMORY: np.zeros(2 * k._SECTION_SIZE),
            }
        if site.first is None:
            assert site.frames is not None
            assert site.placements is not None
            assert site.signs is not None
            places = (k._BEARING_R, k._BEARING_P, k._JOURNAL_R, k._JOURNAL_P)
            arrays |= dict(zip(places, site.frames, strict=True))
            arrays |= {
                k._PLACEMENTS: np.ascontiguousarray(site.placements, float),
                k._SIGNS: np.ascontiguousarray(site.signs, float),
            }
        block[k._NORMAL_LAW], block[k._FRICTION_LAW] = site.normal, site.friction
        block[k._BRISTLES] = int(site.bristles)
        block[k._FILM_LAW], block[k._MUST_NOT_TOUCH] = site.film, site.must_not_touch
        block[k._SHAPE], block[k._COUNT] = site.shape, len(site.parameters)
        block[k._FIRST] = k._NO_VIRTUAL_LINK if site.first is None else site.first
        for entry, array in arrays.items():
            block[entry] = array.ctypes.data
            self._kept.append(array)

    def make_room(self, rows: int) -> None:
        """Have room for `rows` records, before the first of them is written."""
        self.record = np.zeros((rows, self.record.shape[1]))
        self.table[k._RECORD] = self.record.ctypes.data

    @property
    def needs_jacobians(self) -> bool:
        """Whether `pin.computeJointJacobians` and `load` must come before `pin.aba`."""
        return bool(self.table[k._FRAMES])

    @property
    def rows(self) -> int:
        """Records written so far."""
        return int(self.table[k._ROW])

    @property
    def steps(self) -> int:
        """Steps done so far."""
        return int(self.table[k._STEP])

    @property
    def time(self) -> float:
        """Time of the current state [s]."""
        return float(self.clock[k._TIME])

    @property
    def status(self) -> Status:
        """Status of the run."""
        return Status(int(self.table[k._STATUS]))

    @property
    def bad_contact(self) -> tuple[int, int]:
        """(joint, contact) that stopped the run with `BROKE_OUT` or `BAD_FORCE`."""
        joint, contact = divmod(int(self.table[k._BAD_CONTACT]), max(self.memory.shape[1], 1))
        return joint, contact

    def recorded(self, name: str) -> np.ndarray:
        """Columns `name` of the records written so far, shape (rows, width)."""
        return self.record[: self.rows, self.fields[name]]

    def contact_statistics(self) -> dict[str, np.ndarray]:
        """Per joint and contact, (nj, width).

        Counts, steps, impulses [N s], smallest gap [m], fastest approach [m/s].
        """
        names = {
            "onsets": k._ONSETS,
            "ended": k._ENDED,
            "shortest_steps": k._SHORTEST,
            "under_resolved": k._UNDER,
            "impulse": k._IMPULSE,
            "under_resolved_impulse": k._IMPULSE_UNDER,
            "smallest_gap": k._DEEPEST,
        }
        found = {name: self.memory[:, :, index].copy() for name, index in names.items()}
        # A contact that has not ended keeps its approach to itself.
        fastest = np.maximum(self.memory[:, :, k._FASTEST], self.memory[:, :, k._DDELTA0])
        return found | {"fastest_approach": fastest}


def _layout(nv: int, nj: int, width: int) -> tuple[dict[str, slice], int]:
    """Columns of a record, and their number."""
    widths = {
        "time": 1,
        "q": nv,
        "v": nv,
        "drive": nv,
        "work": k._NP,
        "force": 3 * nj,
        "force_peak": 3 * nj,
        "film_force": 3 * nj,
        "normal": width * nj,
        "tangential": width * nj,
        "normal_peak": width * nj,
        "gap_min": width * nj,
    }
    fields, at = {}, 0
    for name, size in widths.items():
        fields[name] = slice(at, at + size)
        at += size
    return fields, at


def coordinate_rows(nv: int) -> np.ndarray:
    """Rows of `Workspace.coordinates` for nv coordinates, shape (..., nv); nothing driven."""
    rows = np.zeros((k._COORDINATE_ROWS, nv))
    rows[k._DRIVEN_BY] = -1.0
    rows[k._MEASURED] = np.arange(nv)
    return rows


def drive_column(
    driven_by: int, measured: int, kp: float = 0.0, kd: float = 0.0, armature: float = 0.0
) -> dict[int, float]:
    """Entries of one coordinate in `coordinate_rows`.

    Args:
        driven_by: column of the reference.
        measured: coordinate that its encoder sees.
        kp, kd: gains [N m/rad, N m s/rad, or N/m, N s/m].
        armature: > 0 prescribes the motion; the model must have this armature [kg m^2 or kg].
    """
    return {
        k._DRIVEN_BY: driven_by,
        k._MEASURED: measured,
        k._KP: kp,
        k._KD: kd,
        k._ARMATURE: armature,
    }


def friction_row(
    coordinate: int, coulomb: float, stiction: float, stribeck: float, viscous: float
) -> np.ndarray:
    """Row of `Workspace.frictions`; see `drive.JointFriction`."""
    return np.array([coordinate, coulomb, stiction, stribeck, viscous])


def gear_row(
    motor: int, link: int, half_play: float, stiffness: float, damping: float
) -> np.ndarray:
    """Row of `Workspace.gears`: coordinates, half the play [rad], stiffness and damping."""
    return np.array([motor, link, half_play, stiffness, damping])


def film_numbers(
    sections: int,
    section: float,
    clearance: float,
    thinnest: float,
    transition: float,
    lag_mass: float,
    parameters: tuple[float, ...],
) -> np.ndarray:
    """Array `ContactSite.film_numbers`.

    Args:
        sections: 1, or 2 for a journal that can tilt.
        section: their distance from the journal's centre [m].
        clearance: c [m].
        thinnest: eccentricity ratio at which the film is thinnest.
        transition: depth at which nothing of it is left [m].
        lag_mass: no more than the smallest mass that the film meets [kg].
        parameters: of the film law.
    """
    numbers = np.zeros(k._FILM_SIZE)
    numbers[: k._P_FILM] = sections, section, clearance, thinnest, transition, lag_mass
    numbers[k._P_FILM : k._P_FILM + len(parameters)] = parameters
    return numbers
