"""Which class of clearance each rolling bearing must have: the cheapest that keep a target.

Bearings are bought by class (C2, CN, C3, C4; CC0, C0, C1) or preloaded, not by the micrometre, and
what they are free by does not grow in proportion to their clearance. So each joint has a few
offers with a price, and the cheapest choice with which the static worst case stays below the target
at all poses is found by integer programming, on the poses and directions known to bind; the worst
ones of each choice are added until none exceeds the target.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from jointplay.core.errors import (
    JointplayError,
    MissingName,
    require_non_negative,
    require_positive,
)
from jointplay.core.tables import Column, Table
from jointplay.design.levers import PlaySources, sources
from jointplay.design.static_budget import half_sphere
from jointplay.joints import Clearance, RollingBearing
from jointplay.joints.bearings import PRELOADED
from jointplay.mechanism.mechanism import Mechanism

PRICES = {"C2": 1.3, "CN": 1.0, "C3": 1.0, "C4": 1.1, "CC0": 1.5, "C0": 1.0, "C1": 1.0}
"""Price of a class relative to the usual one, unless it is given: assumed, of no catalogue."""
PRELOAD_PRICE = 2.0
"""Of a preloaded pair, relative to the usual class."""
_ROUNDS, _TIE = 60, 1e-6
_CLIMBS = 5


@dataclass(frozen=True)
class Offer:
    """A bearing that can be bought for a joint."""

    name: str
    """Of the class."""
    joint: Clearance
    price: float


@dataclass(frozen=True)
class ClassAllocation:
    """Bearings that keep a target, of j joints."""

    target: float
    """Largest error of the tool [m]."""
    joints: tuple[str, ...]
    chosen: tuple[Offer, ...]
    """For each joint."""
    error: float
    """The static worst case that they lead to [m]."""
    parts: np.ndarray
    """What each adds to it, (j,) [m]."""
    total: float
    """Price of all."""
    cheapest: float
    """Price without any target."""
    mechanism: Mechanism
    """With these bearings."""

    @property
    def table(self) -> Table:
        """A row for each joint."""
        free = [_free(offer.joint) for offer in self.chosen]
        return Table(
            (
                Column("joint", self.joints),
                Column("class", [offer.name for offer in self.chosen]),
                Column("free across", [one[0] for one in free], "m", fine=True, digits=3),
                Column("free along", [one[1] for one in free], "m", fine=True, digits=3),
                Column("adds", self.parts, "m", "worst_part_m", fine=True),
                Column("price", [offer.price for offer in self.chosen], digits=4),
            ),
            notes=(
                f"static worst case {1e6 * self.error:.2f} um of {1e6 * self.target:.2f} um; price "
                f"{self.total:g} (without a target {self.cheapest:g})",
            ),
        )

    def __str__(self) -> str:
        """The table."""
        return str(self.table)


def _free(joint: Clearance) -> tuple[float, float]:
    """How far a joint is free across and along [m]."""
    return joint.travel["x"], joint.travel["z"]


def offers_of(
    joint: RollingBearing, prices: Mapping[str, float] | None = None
) -> tuple[Offer, ...]:
    """What can be bought instead of a bearing: all classes of its size, and a pair preloaded.

    Args:
        joint: the bearing.
        prices: by class; those of `PRICES` where not given.

    Raises:
        MissingName: a price of a class that does not exist.
        JointplayError: a negative price; a bearing of whose size no classes are known.
    """
    known = {**PRICES, PRELOADED: PRELOAD_PRICE}
    for name, price in (prices or {}).items():
        if name not in known:
            raise MissingName("class of clearance", name, known)
        known[name] = require_non_negative(f"price of {name!r}", price, "")
    made = joint.of_classes()
    return tuple(Offer(name, one, known.get(name, 1.0)) for name, one in made.items())


def allocate_classes(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    target: float,
    *,
    offers: Mapping[str, Sequence[Offer]] | None = None,
    prices: Mapping[str, float] | None = None,
    driven: Sequence[str] | None = None,
) -> ClassAllocation:
    """The cheapest bearings with which the tool's worst case stays below `target` at all poses.

    Args:
        mechanism: its rolling bearings are those to decide on; all else stays as it is.
        poses: as for `budget`.
        target: largest distance of the tool from the ideal one by play [m].
        offers: of some joints; `offers_of` the others.
        prices: by class, for joints whose offers are not given.
        driven: joints of loops that stand; see `budget`.

    Raises:
        JointplayError: no rolling bearing; a target that the tightest bearings miss, which says
            what can be reached.
        MissingName: no such joint.
    """
    target = require_positive("target", target, "m")
    names = [n for n, joint in mechanism.clearance.items() if isinstance(joint, RollingBearing)]
    if not names:
        raise JointplayError("no joint has a rolling bearing whose class could be chosen")
    for name in offers or {}:
        if name not in names:
            raise MissingName("joint with a rolling bearing", name, names)
    choice = {}
    for name in names:
        joint = mechanism.clearance[name]
        assert isinstance(joint, RollingBearing)
        choice[name] = tuple((offers or {}).get(name, ())) or offers_of(joint, prices)
    most = max(map(len, choice.values()))
    tables: list[PlaySources] = []
    for k in range(most):
        made = {n: offer[min(k, len(offer) - 1)].joint for n, offer in choice.items()}
        other = mechanism.with_clearance({**mechanism.clearance, **made})
        tables.append(sources(other, poses, driven=driven, loops=True))
    if tables[0].tied:
        raise JointplayError(
            "plays that constrain each other in a closed loop are no sum over joints: choose the "
            "classes by trying (jointplay budget)"
        )
    problem = _Problem(names, choice, tables)
    return problem.solve(target, mechanism)


class _Problem:
    """Choices by integer programming on a growing set of poses and directions."""

    def __init__(
        self, names: list[str], choice: dict[str, tuple[Offer, ...]], tables: list[PlaySources]
    ) -> None:
        self.names, self.choice, self.tables = names, choice, tables
        self._price = np.array([offer.price for name in names for offer in choice[name]])
        self._count = [len(choice[name]) for name in names]
        self._at = [tables[0].names.index(name) for name in names]
        self._rows: list[np.ndarray] = []
        self._rests: list[float] = []

    def solve(self, target: float, mechanism: Mechanism) -> ClassAllocation:
        """The cheapest choice that keeps the target."""
        half = half_sphere()
        cheapest = sum(min(o.price for o in self.choice[name]) for name in self.names)
        chosen = [int(np.argmin([o.price for o in self.choice[name]])) for name in self.names]
        for _ in range(_ROUNDS):
            error, pose, direction, parts = self._worst(chosen, half)
            if error <= target:
                break
            self._add(pose, direction)
            chosen = self._choose(target)
        else:
            raise JointplayError("the choice of classes did not settle; give fewer offers")
        offers = tuple(self.choice[name][k] for name, k in zip(self.names, chosen, strict=True))
        made = {name: offer.joint for name, offer in zip(self.names, offers, strict=True)}
        return ClassAllocation(
            target, tuple(self.names), offers, error, parts, sum(o.price for o in offers), cheapest,
            mechanism.with_clearance({**mechanism.clearance, **made}),
        )  # fmt: skip

    def _mixed(self, chosen: Sequence[int]) -> PlaySources:
        """Sources with the chosen plays."""
        first = self.tables[0]
        plays = list(first.plays)
        for at, k in zip(self._at, chosen, strict=True):
            plays[at] = self.tables[k].plays[at]
        return replace(first, plays=tuple(plays))

    def _worst(
        self, chosen: Sequence[int], half: np.ndarray
    ) -> tuple[float, int, np.ndarray, np.ndarray]:
        """Largest error of all poses, where, in which direction, and each joint's part."""
        mixed = self._mixed(chosen)
        n = mixed.move.shape[1]
        values = mixed.along(np.broadcast_to(half, (n, *half.shape))).value.sum(axis=0)
        d = mixed.climb(half[values.argmax(axis=1)], _CLIMBS)
        each = mixed.along(d[:, None]).value[:, :, 0]
        pose = int(each.sum(axis=0).argmax())
        return float(each[:, pose].sum()), pose, d[pose], each[self._at, pose]

    def _add(self, pose: int, direction: np.ndarray) -> None:
        """Take a pose and direction into account."""
        row, rest = [], None
        for at, count in zip(self._at, self._count, strict=True):
            for k in range(count):
                one = self.tables[k].subset(poses=[pose]).along(direction[None, None])
                row.append(float(one.value[at, 0, 0]))
                if rest is None:
                    others = [i for i in range(len(one.value)) if i not in self._at]
                    rest = float(one.value[others, 0, 0].sum())
        self._rows.append(np.array(row))
        self._rests.append(rest or 0.0)

    def _choose(self, target: float) -> list[int]:
        from scipy.optimize import Bounds, LinearConstraint, milp

        size, ends = len(self._price), np.cumsum([0, *self._count])
        one = np.zeros((len(self.names), size))
        for j in range(len(self.names)):
            one[j, ends[j] : ends[j + 1]] = 1.0
        room = (target - np.array(self._rests)) / target
        # Of equal prices the tighter bearing.
        row = self._rows[-1]
        found = milp(
            self._price + _TIE * self._price.max() * row / max(row.max(), 1e-300),
            constraints=[
                LinearConstraint(one, 1.0, 1.0),
                LinearConstraint(np.array(self._rows) / target, -np.inf, room),
            ],
            integrality=np.ones(size),
            bounds=Bounds(0.0, 1.0),
        )
        if not found.success:
            least = max(
                sum(row[a:b].min() for a, b in pairwise(ends)) + rest
                for row, rest in zip(self._rows, self._rests, strict=True)
            )
            raise JointplayError(
                f"a target of {1e6 * target:.4g} um cannot be reached: with the tightest bearings "
                f"offered the error is at least {1e6 * least:.4g} um"
            )
        return [int(found.x[a:b].argmax()) for a, b in pairwise(ends)]
