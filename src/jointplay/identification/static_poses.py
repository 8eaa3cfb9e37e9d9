"""Static poses of a robot: what its encoders said and where its tool was, row by row."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.core import files
from jointplay.core.errors import JointplayError, MissingName
from jointplay.core.units import convert, plain_number
from jointplay.identification.measurement import split_title
from jointplay.result.result import AXES

# A column is called ``elbow motor [rad]``: what it is, and its unit in brackets.
#
#     JOINT motor (or JOINT alone), JOINT link      encoders before and behind the joint's gear
#     JOINT load                                    torque on the joint, if not gravity's
#     tool x, tool y, tool z                        the tool's point, axes of the instrument
#     tool rx, tool ry, tool rz                     its orientation, as a rotation vector
#     marker NAME x, ... y, ... z                   markers of a rigid body, instead of the tool
#     point, group                                  names: the same unknown point; a session

FEWEST = 6
"""Poses that a calibration needs."""
_MOST_LABELS = 6
"""Markers whose labels can be checked: all permutations are tried."""
_SHOWN = 60


@dataclass(frozen=True)
class StaticPoses:
    """Joint positions and what was measured there: n rows in the order of approach, j joints.

    Either `position` (and perhaps `orientation`) of the tool was measured, in axes and from an
    origin that need not be known; or `point` says in which rows the tool was at the same unknown
    point (closure).

    Raises:
        JointplayError: too few rows; arrays of other shapes; numbers that are not finite; neither
            positions nor points, or both.
    """

    joints: tuple[str, ...]
    motor: np.ndarray
    """Positions by the encoders on the motors' side, shape (n, j) [rad or m]."""
    link: np.ndarray | None = None
    """By encoders behind the gears, nan where there is none, shape (n, j) [rad or m]."""
    position: np.ndarray | None = None
    """Of the tool's point, shape (n, 3) [m]."""
    orientation: np.ndarray | None = None
    """Rotations of the tool, shape (n, 3, 3)."""
    point: tuple[str, ...] | None = None
    """Name of the unknown point at which the tool's point was, n names."""
    distances: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    """Known distance of two such points and its standard deviation [m]."""
    group: tuple[str, ...] | None = None
    """Placement or session of each row, n names."""
    load: np.ndarray | None = None
    """Torques on the joints, positive along them; gravity's if None, shape (n, j) [N m or N]."""
    ordered: bool = True
    """Whether each row was approached from the one before it (of its group)."""
    exchanged: tuple[int, ...] = ()
    """Rows in which labels of markers were exchanged, and have been put right."""
    source: str = "the poses"
    """Where they came from, for messages."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        n, j = np.shape(self.motor)[0], len(self.joints)
        shapes: dict[str, tuple[int, ...]] = {"motor": (n, j), "link": (n, j), "load": (n, j)}
        shapes |= {"position": (n, 3), "orientation": (n, 3, 3)}
        for name, shape in shapes.items():
            given = getattr(self, name)
            if given is None:
                continue
            values = np.asarray(given, float)
            object.__setattr__(self, name, values)
            if values.shape != shape:
                raise JointplayError(
                    f"{self.source}: {name} must have the shape {shape}, got {values.shape}"
                )
            bad = np.argwhere(np.isinf(values) if name == "link" else ~np.isfinite(values))
            if bad.size:
                row, *rest = bad[0]
                what = self.joints[rest[0]] if name in ("motor", "link", "load") else str(rest)
                raise JointplayError(
                    f"{self.source}: {name} {what} in row {row + 1} must be finite, got "
                    f"{values[tuple(bad[0])]}"
                )
        for name in ("point", "group"):
            labels = getattr(self, name)
            if labels is None:
                continue
            object.__setattr__(self, name, tuple(str(label) for label in labels))
            if len(labels) != n:
                raise JointplayError(
                    f"{self.source}: {name} must have {n} names, one a row, got {len(labels)}"
                )
        if n < FEWEST:
            raise JointplayError(f"{self.source}: {n} poses; at least {FEWEST} are needed")
        if self.position is not None and self.point is not None:
            raise JointplayError(
                f"{self.source}: give positions of the tool or names of points, not both"
            )
        if self.orientation is not None:
            off = np.abs(np.swapaxes(self.orientation, 1, 2) @ self.orientation - np.eye(3))
            worst = int(off.max(axis=(1, 2)).argmax())
            if off[worst].max() > 1e-3 or np.linalg.det(self.orientation[worst]) < 0.0:
                raise JointplayError(
                    f"{self.source}: the orientation in row {worst + 1} is not a rotation matrix"
                )
        for pair in self.distances:
            for name in pair:
                if name not in (self.point or ()):
                    raise MissingName("point", name, dict.fromkeys(self.point or ()))

    def __len__(self) -> int:
        """How many poses there are."""
        return len(self.motor)

    def rows(self, keep: Sequence[int] | np.ndarray) -> StaticPoses:
        """Some of the rows; a row whose predecessor is left out counts as approached from the
        one before that."""
        keep = np.asarray(keep)
        keep = np.flatnonzero(keep) if keep.dtype == bool else keep
        changed: dict[str, Any] = {}
        for name in ("point", "group"):
            labels = getattr(self, name)
            changed[name] = None if labels is None else tuple(labels[i] for i in keep)
        for name in ("motor", "link", "position", "orientation", "load"):
            values = getattr(self, name)
            changed[name] = None if values is None else values[keep]
        left = set(changed["point"] or ())
        distances = {pair: d for pair, d in self.distances.items() if set(pair) <= left}
        return replace(self, **changed, distances=distances, exchanged=())

    def read_by_link(self, *joints: str) -> StaticPoses:
        """The same poses with the link encoders of these joints in place of the motors'.

        Raises:
            JointplayError: a joint without encoder on the link's side.
        """
        motor = self.motor.copy()
        for name in joints:
            if name not in self.joints:
                raise MissingName("joint", name, self.joints)
            column = self.joints.index(name)
            if self.link is None or np.isnan(self.link[:, column]).any():
                raise JointplayError(
                    f"{self.source}: {name} has no encoder on the link's side in every row"
                )
            motor[:, column] = self.link[:, column]
        return replace(self, motor=motor)

    def approach(self) -> np.ndarray:
        """Direction from which each joint came, -1, 0 (unknown) or 1, shape (n, j).

        A joint that did not move keeps its direction.
        """
        way = np.zeros(self.motor.shape)
        if not self.ordered:
            return way
        for i in range(1, len(self)):
            if self.group is not None and self.group[i] != self.group[i - 1]:
                continue
            step = self.motor[i] - self.motor[i - 1]
            way[i] = np.where(np.abs(step) > 1e-6, np.sign(step), way[i - 1])
        return way

    @classmethod
    def from_markers(
        cls,
        joints: Sequence[str],
        motor: np.ndarray,
        markers: np.ndarray,
        *,
        tool: int = -1,
        **more: Any,
    ) -> StaticPoses:
        """Poses of a rigid body of m markers (`rigid_body`), whose labels are checked first.

        Args:
            joints, motor: see the class.
            markers: positions, shape (n, m, 3) [m], m of at least 3.
            tool: the marker that is the tool's point.
            more: further fields of the class.

        Raises:
            JointplayError: fewer than three markers; see also the class.
        """
        markers, exchanged = same_labels(markers)
        shape, rotations, origins, _ = rigid_body(markers)
        return cls(
            tuple(joints),
            motor,
            position=origins + rotations @ shape[tool],
            orientation=rotations,
            exchanged=exchanged,
            **more,
        )

    @classmethod
    def from_csv(cls, path: str | Path, joints: Mapping[str, bool]) -> StaticPoses:
        """Read a CSV file; lines beginning with # are comments.

        Args:
            path: the file, with columns as listed in docs/real_robots.md.
            joints: the robot's joints, and whether each slides.

        Raises:
            JointplayError: no such file; a column without unit, of an unknown name or given twice;
                a cell that is not a number (with its line); see also the class.
        """
        path = Path(path)
        table = _Table(path, joints)
        names = tuple(name for name in joints if ("motor", name) in table.numbers)
        if not names:
            raise JointplayError(
                f"{path} has no joint positions: columns such as '{next(iter(joints), 'elbow')} "
                f"motor [rad]' are needed; joints: {', '.join(joints) or 'none'}"
            )
        for kind, name in table.numbers:
            if kind in ("link", "load") and name not in names:
                raise JointplayError(f"{path}: {name} has a {kind}, but no motor position")
        motor = table.block("motor", names)
        more: dict[str, Any] = {"source": str(path)}
        for kind in ("link", "load"):
            if any((kind, name) in table.numbers for name in names):
                more[kind] = table.block(kind, names, missing=np.nan if kind == "link" else 0.0)
        for kind in ("point", "group"):
            if kind in table.words:
                more[kind] = tuple(table.words[kind])
        markers = list(dict.fromkeys(name[:-2] for kind, name in table.numbers if kind == "marker"))
        if markers and any(kind == "tool" for kind, _ in table.numbers):
            raise JointplayError(f"{path}: give the tool or markers, not both")
        if markers:
            places = [table.block("marker", [f"{name} {a}" for a in AXES]) for name in markers]
            return cls.from_markers(names, motor, np.stack(places, axis=1), **more)
        if ("tool", "x") in table.numbers:
            more["position"] = table.block("tool", AXES)
        turned = ("rx", "ry", "rz")
        if ("tool", "rx") in table.numbers:
            more["orientation"] = rotations_of(table.block("tool", turned))
        return cls(names, motor, **more)


class _Table:
    """Columns of a CSV file: numbers in SI units by kind and name, and words."""

    def __init__(self, path: Path, joints: Mapping[str, bool]) -> None:
        """Read it."""
        self.path = path
        rows = files.csv_rows(path, "table of poses")
        self.numbers: dict[tuple[str, str], np.ndarray] = {}
        self.words: dict[str, list[str]] = {}
        for column, title in enumerate(cell.strip() for cell in rows[0][1]):
            cells = [(line, row[column].strip()) for line, row in rows[1:]]
            if title in ("point", "group"):
                self.words[title] = [cell for _, cell in cells]
                continue
            name, unit = split_title(title, path)
            key, goal = self._meaning(name, joints, title)
            try:
                factor = float(convert(f"1 {unit}", goal))
            except ValueError as error:
                raise JointplayError(f"{path}, column {title!r}: {error}") from None
            if key in self.numbers:
                raise JointplayError(f"{path}: {name!r} appears twice")
            self.numbers[key] = factor * np.array([self._number(title, *one) for one in cells])

    def _number(self, title: str, line: int, cell: str) -> float:
        if not cell and title.split()[-2:-1] == ["link"]:
            return np.nan
        try:
            return plain_number(cell)
        except ValueError:
            raise JointplayError(
                f"{self.path}, line {line}: {title!r} must be a number, got {cell[:_SHOWN]!r}"
            ) from None

    def _meaning(
        self, name: str, joints: Mapping[str, bool], title: str
    ) -> tuple[tuple[str, str], str]:
        """What a column is, and the unit that it must fit."""
        if name in joints:
            return ("motor", name), "m" if joints[name] else "rad"
        first, _, last = name.rpartition(" ")
        if first in joints and last in ("motor", "link"):
            return (last, first), "m" if joints[first] else "rad"
        if first in joints and last == "load":
            return (last, first), "N" if joints[first] else "N*m"
        if first == "tool" and last in AXES:
            return ("tool", last), "m"
        if first == "tool" and last in ("rx", "ry", "rz"):
            return ("tool", last), "rad"
        if first.startswith("marker ") and last in AXES:
            return ("marker", name.removeprefix("marker ")), "m"
        raise JointplayError(
            f"{self.path}: column {title!r} is unknown; there are: JOINT motor, JOINT link, JOINT "
            "load, tool x (y, z, rx, ry, rz), marker NAME x (y, z), point, group; joints: "
            f"{', '.join(joints)}"
        )

    def block(self, kind: str, names: Collection[str], missing: float | None = None) -> np.ndarray:
        """Columns of a kind side by side, shape (n, names)."""
        lines = len(next(iter(self.numbers.values())))
        columns = []
        for name in names:
            if (kind, name) not in self.numbers and missing is None:
                raise JointplayError(f"{self.path}: the column '{kind} {name}' is missing")
            columns.append(self.numbers.get((kind, name), np.full(lines, missing)))
        return np.column_stack(columns)


# Rotations and rigid bodies of markers.


def rotations_of(vectors: np.ndarray) -> np.ndarray:
    """Rotations by rotation vectors, shape (..., 3) [rad] to (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    flat = np.reshape(vectors, (-1, 3))
    return np.asarray(Rotation.from_rotvec(flat).as_matrix().reshape(*np.shape(vectors), 3))


def rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotations, shape (..., 3, 3) to (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    flat = np.reshape(rotations, (-1, 3, 3))
    return np.asarray(Rotation.from_matrix(flat).as_rotvec().reshape(*np.shape(rotations)[:-1]))


def skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices of cross products, shape (..., 3) to (..., 3, 3)."""
    out = np.zeros((*np.shape(vectors), 3))
    out[..., 0, 1], out[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    out[..., 1, 0], out[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return out


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation R that maximises the trace of R^T M (Kabsch), of a 3 x 3 matrix."""
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v)


def rigid_body(
    markers: np.ndarray, rounds: int = 20
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mean shape of a body of m markers and its pose in each row.

    Args:
        markers: positions, shape (n, m, 3) [m].
        rounds: of improving shape and poses in turn.

    Returns:
        The shape about its centre (m, 3) [m]; rotations (n, 3, 3); the centre's positions (n, 3)
        [m]; what the markers are off the rigid shape (n, m, 3) [m].
    """
    markers = np.asarray(markers, float)
    if markers.ndim != 3 or markers.shape[1] < 3 or markers.shape[2] != 3:
        raise JointplayError(
            f"a rigid body needs at least three markers: shape (n, m, 3), got {markers.shape}"
        )
    centre = markers.mean(axis=1)
    about = markers - centre[:, None]
    shape = about[0]
    for _ in range(rounds):
        rotations = np.array([nearest_rotation(one.T @ shape) for one in about])
        shape = np.mean(about @ rotations, axis=0)
    off = about - np.einsum("nij,kj->nki", rotations, shape)
    return shape, rotations, centre, off


def same_labels(markers: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    """Markers with the same labels in all rows, by the distances between them.

    Tracking systems exchange labels of markers. In each row the labels are permuted such that
    distances agree best with those of the row that most rows agree with as they are. Exchanges that
    leave all distances the same within their scatter cannot be seen.

    Returns:
        The markers (n, m, 3) [m], and the rows whose labels were exchanged.
    """
    markers = np.array(markers, float)
    if markers.ndim != 3 or not 3 <= markers.shape[1] <= _MOST_LABELS:
        return markers, ()
    pairs = list(combinations(range(markers.shape[1]), 2))
    first, second = np.array(pairs).T
    lengths = np.linalg.norm(markers[:, first] - markers[:, second], axis=2)
    apart = np.abs(lengths[:, None] - lengths[None]).max(axis=2)
    # Most rows agree with this one: within a tenth of how much sides differ at all.
    limit = 0.1 * float(np.ptp(np.median(np.sort(lengths, axis=1), axis=0)))
    reference = lengths[int((apart < limit).sum(axis=1).argmax())]
    orders = [np.array(one) for one in permutations(range(markers.shape[1]))]
    exchanged = []
    for i, row in enumerate(markers):
        misfits = [
            float(np.abs(np.linalg.norm(row[o[first]] - row[o[second]], axis=1) - reference).max())
            for o in orders
        ]
        best = int(np.argmin(misfits))
        if best and misfits[best] < misfits[0] - limit:
            markers[i] = row[orders[best]]
            exchanged.append(i)
    return markers, tuple(exchanged)
