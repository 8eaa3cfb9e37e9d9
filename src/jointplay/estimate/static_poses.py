"""Static poses of a robot: readings of its encoders and measured poses of its tool, row by row.

Columns of a file (see `columns`):

    JOINT motor (or JOINT alone), JOINT link      encoders before and behind the joint's gear
    JOINT load                                    torque on the joint, if not gravity's
    tool x, tool y, tool z                        the tool's point, axes of the instrument
    tool rx, tool ry, tool rz                     its orientation, as a rotation vector
    marker NAME x, ... y, ... z                   markers of a rigid body, instead of the tool
    point, group                                  names: the same unknown point; a session
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from jointplay.base.errors import JointplayError, require_known
from jointplay.base.schema import known_keywords
from jointplay.estimate import columns
from jointplay.estimate.unknowns import MINOR
from jointplay.simulation.result.result import AXES

_JOINT_UNITS = {"motor": ("rad", "m"), "link": ("rad", "m"), "load": ("N*m", "N")}
"""Signals of a joint, and their units for one that turns and one that slides."""
_TOOL_UNITS = dict.fromkeys(AXES, "m") | {"rx": "rad", "ry": "rad", "rz": "rad"}
"""Components of the tool's pose, and their units."""
FEWEST = 6
"""Least number of poses: their positions are 18 numbers, of which base and tool take 9 (judged)."""
_MOST_LABELS = 6
"""Largest number of markers whose labels are checked: all permutations are tried."""
_SMALLEST_MOVE = 1e-6
"""Smallest move by which a joint is approached from a side [rad or m], below any encoder's step."""
_SHAPE_ROUNDS = 20
"""Rounds in which the shape and the poses of a rigid body are improved in turn."""
_NOT_ROTATION = 1e-3
"""Largest error of an entry of R^T R of a rotation matrix R (judged)."""


@known_keywords
@dataclass(frozen=True)
class StaticPoses:
    """n poses of j joints in the order of approach, with what was measured of the tool.

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
    """Positions by encoders behind the gears, nan where there is none, shape (n, j) [rad or m]."""
    position: np.ndarray | None = None
    """Positions of the tool's point, shape (n, 3) [m]."""
    orientation: np.ndarray | None = None
    """Rotations of the tool, shape (n, 3, 3)."""
    point: tuple[str, ...] | None = None
    """Name of the unknown point at which the tool was in each row."""
    distances: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    """Known distance of two such points and its standard deviation [m]."""
    group: tuple[str, ...] | None = None
    """Placement or session of each row."""
    load: np.ndarray | None = None
    """Torques on the joints, positive along them; gravity's if None, shape (n, j) [N m or N]."""
    ordered: bool = True
    """Whether each row was approached from the one before it (of its group)."""
    exchanged: tuple[int, ...] = ()
    """Rows in which labels of markers were exchanged, and have been put right."""
    source: str = "the poses"

    def __post_init__(self) -> None:
        n, j = np.shape(self.motor)[0], len(self.joints)
        shapes: dict[str, tuple[int, ...]] = {"motor": (n, j), "link": (n, j), "load": (n, j)}
        shapes |= {"position": (n, 3), "orientation": (n, 3, 3)}
        for name, shape in shapes.items():
            if (stated := getattr(self, name)) is None:
                continue
            values = np.asarray(stated, float)
            object.__setattr__(self, name, values)
            if values.shape != shape:
                raise self._wrong(f"{name} must have the shape {shape}, got {values.shape}")
            bad = np.argwhere(np.isinf(values) if name == "link" else ~np.isfinite(values))
            if bad.size:
                row, *indices = bad[0]
                label = self.joints[indices[0]] if shape == (n, j) else str(indices)
                raise self._wrong(
                    f"{name} {label} in row {row + 1} must be finite, got {values[tuple(bad[0])]}"
                )
        for name in ("point", "group"):
            if (labels := getattr(self, name)) is None:
                continue
            object.__setattr__(self, name, tuple(map(str, labels)))
            if len(labels) != n:
                raise self._wrong(f"{name} must have {n} names, one a row, got {len(labels)}")
        if n < FEWEST:
            raise self._wrong(f"{n} poses; at least {FEWEST} are needed")
        if self.position is not None and self.point is not None:
            raise self._wrong("give positions of the tool or names of points, not both")
        if self.orientation is not None:
            off = np.abs(np.swapaxes(self.orientation, 1, 2) @ self.orientation - np.eye(3))
            worst = int(off.max(axis=(1, 2)).argmax())
            if off[worst].max() > _NOT_ROTATION or np.linalg.det(self.orientation[worst]) < 0.0:
                raise self._wrong(f"the orientation in row {worst + 1} is not a rotation matrix")
        for pair in self.distances:
            for name in pair:
                require_known("point", name, dict.fromkeys(self.point or ()))

    def _wrong(self, text: str) -> JointplayError:
        return JointplayError(f"{self.source}: {text}")

    def __len__(self) -> int:
        return len(self.motor)

    @property
    def units(self) -> np.ndarray:
        """Number of the independent unit of each row, its point, group or itself, shape (n,).

        Errors at a point, or in a group, are common to all its rows.
        """
        return np.unique(self.point or self.group or np.arange(len(self)), return_inverse=True)[1]

    def rows(self, keep: Sequence[int] | np.ndarray) -> StaticPoses:
        """Some of the rows; one whose predecessor is left out counts as approached from the one
        before that."""
        keep = np.arange(len(self))[np.asarray(keep)]
        changed: dict[str, Any] = {}
        for name in ("point", "group", "motor", "link", "position", "orientation", "load"):
            if (values := getattr(self, name)) is not None:
                chosen = np.asarray(values)[keep]
                changed[name] = tuple(chosen) if isinstance(values, tuple) else chosen
        names = set(changed.get("point", ()))
        distances = {pair: d for pair, d in self.distances.items() if set(pair) <= names}
        return replace(self, **changed, distances=distances, exchanged=())

    def read_by_link(self, *joints: str) -> StaticPoses:
        """The same poses with the link encoders of these joints in place of the motors'.

        Raises:
            JointplayError: a joint without encoder on the link's side.
        """
        motor = self.motor.copy()
        for name in joints:
            require_known("joint", name, self.joints)
            column = self.joints.index(name)
            if self.link is None or np.isnan(self.link[:, column]).any():
                raise self._wrong(f"{name} has no encoder on the link's side in every row")
            motor[:, column] = self.link[:, column]
        return replace(self, motor=motor)

    def approach(self) -> np.ndarray:
        """Direction from which each joint came, -1, 0 (unknown) or 1, shape (n, j).

        A joint that did not move keeps its direction.
        """
        way = np.zeros(self.motor.shape)
        group = self.group or (None,) * len(self)
        for i in range(1, len(self) if self.ordered else 1):
            if group[i] == group[i - 1]:
                step = self.motor[i] - self.motor[i - 1]
                way[i] = np.where(np.abs(step) > _SMALLEST_MOVE, np.sign(step), way[i - 1])
        return way

    @classmethod
    def from_markers(
        cls,
        joints: Sequence[str],
        motor: np.ndarray,
        markers: np.ndarray,
        *,
        tool: int = -1,
        **further: Any,
    ) -> StaticPoses:
        """Poses of a rigid body of m markers (`rigid_body`), whose labels are checked first.

        Args:
            joints, motor: see the class.
            markers: positions, shape (n, m, 3) [m], m of at least 3.
            tool: the marker that is the tool's point.
            further: further fields of the class.
        """
        markers, exchanged = same_labels(markers)
        shape, rotations, origins, _ = rigid_body(markers)
        position = origins + rotations @ shape[tool]
        measured = {"position": position, "orientation": rotations, "exchanged": exchanged}
        return cls(tuple(joints), motor, **measured, **further)

    @classmethod
    def from_csv(cls, path: str | Path, joints: Mapping[str, bool]) -> StaticPoses:
        """Read a CSV file, with columns as listed in docs/calibrate.md.

        Args:
            path: the file.
            joints: the robot's joints, and whether each slides.

        Raises:
            JointplayError: see `columns.read` and the class.
        """
        path = Path(path)

        def known(name: str) -> tuple[columns.Key, str] | None:
            body, _, axis = name.removeprefix("marker ").rpartition(" ")
            if name.startswith("marker ") and axis in AXES:
                return ("marker", f"{body} {axis}"), "m"
            return columns.meaning(name, joints, _JOINT_UNITS, {"tool": _TOOL_UNITS})

        choices = (
            "JOINT (or JOINT motor), JOINT link, JOINT load, tool x (y, z, rx, ry, rz), marker "
            f"NAME x (y, z), point, group; joints: {', '.join(joints)}"
        )
        numbers, texts = columns.read(
            path, "table of poses", known, choices, ("point", "group"), gaps=("link",)
        )

        def block(kind: str, parts: Sequence[str], missing: float | None = None) -> np.ndarray:
            for name in parts:
                if (kind, name) not in numbers and missing is None:
                    raise JointplayError(f"{path}: the column '{kind} {name}' is missing")
            none = np.full(len(next(iter(numbers.values()))), missing)
            return np.column_stack([numbers.get((kind, name), none) for name in parts])

        names = tuple(name for name in joints if ("motor", name) in numbers)
        if not names:
            choices = f"such as 'elbow motor [rad]'; joints: {', '.join(joints) or 'none'}"
            raise JointplayError(f"{path} has no joint positions {choices}")
        for kind, name in numbers:
            if kind in ("link", "load") and name not in names:
                raise JointplayError(f"{path}: {name} has a {kind}, but no motor position")
        motor = block("motor", names)
        blocks: dict[str, Any] = {"source": str(path), **texts}
        for kind, missing in (("link", np.nan), ("load", 0.0)):
            if any((kind, name) in numbers for name in names):
                blocks[kind] = block(kind, names, missing)
        markers = list(dict.fromkeys(name[:-2] for kind, name in numbers if kind == "marker"))
        if markers and any(kind == "tool" for kind, _ in numbers):
            raise JointplayError(f"{path}: give the tool or markers, not both")
        if markers:
            places = [block("marker", [f"{name} {a}" for a in AXES]) for name in markers]
            return cls.from_markers(names, motor, np.stack(places, axis=1), **blocks)
        if ("tool", "x") in numbers:
            blocks["position"] = block("tool", AXES)
        if ("tool", "rx") in numbers:
            blocks["orientation"] = rotations_of(block("tool", ("rx", "ry", "rz")))
        return cls(names, motor, **blocks)


# Rotations and rigid bodies of markers.


def rotations_of(vectors: np.ndarray) -> np.ndarray:
    """Rotations by rotation vectors, shape (3,) or (n, 3) [rad]."""
    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotations, shape (3, 3) or (n, 3, 3) [rad]."""
    return np.asarray(Rotation.from_matrix(rotations).as_rotvec())


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation R that maximises the trace of R^T M (Kabsch), of a 3 x 3 matrix."""
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v)


def rigid_body(markers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mean shape of a body of m markers and its pose in each row (Procrustes analysis).

    Args:
        markers: positions, shape (n, m, 3) [m].

    Returns:
        The shape about its centre (m, 3) [m]; rotations (n, 3, 3); the centre's positions (n, 3)
        [m]; deviations of the markers from the rigid shape (n, m, 3) [m].
    """
    markers = np.asarray(markers, float)
    if markers.ndim != 3 or markers.shape[1] < 3 or markers.shape[2] != 3:
        raise JointplayError(
            f"a rigid body needs at least three markers: shape (n, m, 3), got {markers.shape}"
        )
    centre = markers.mean(axis=1)
    about = markers - centre[:, None]
    shape = about[0]
    for _ in range(_SHAPE_ROUNDS):
        rotations = np.array([nearest_rotation(row.T @ shape) for row in about])
        shape = np.mean(about @ rotations, axis=0)
    off = about - np.einsum("nij,kj->nki", rotations, shape)
    return shape, rotations, centre, off


def same_labels(markers: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    """Put labels of markers right that tracking systems exchange, by distances between markers.

    In each row the labels are permuted such that distances agree best with those of the row that
    most rows agree with as they are. Exchanges that leave all distances the same within their
    scatter cannot be seen.

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
    # Two rows agree within a part of the difference between the longest and the shortest side.
    limit = MINOR * float(np.ptp(np.median(np.sort(lengths, axis=1), axis=0)))
    reference = lengths[int((apart < limit).sum(axis=1).argmax())]
    orders = [np.array(order) for order in permutations(range(markers.shape[1]))]
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
