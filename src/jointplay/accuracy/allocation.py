"""Tolerance allocation: the cheapest clearances and bearings that keep the tool within a target.

Clearances of any size, remaining parts of other causes, and bearings, which are bought by class,
are chosen together (`cheapest`). That optimisation is linear in the sizes, but a clearance's play
has a second order: the play is computed anew at each solution until both agree.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jointplay.accuracy import cheapest
from jointplay.accuracy.causes import (
    CAUSES,
    Cause,
    cause_model,
    given_and_assumed,
    is_proportional,
    named,
)
from jointplay.accuracy.cheapest import COSTS, Error, Key, Problem, Sizes
from jointplay.accuracy.cures import KNOWN
from jointplay.accuracy.error_budget import LISTED, budget, holding_drives
from jointplay.accuracy.error_model import Contribution, ErrorModel, play_model
from jointplay.accuracy.jacobians import GEAR, configurations, with_force
from jointplay.accuracy.robot_errors import RobotErrors
from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_known,
    require_non_negative,
    require_positive,
    require_share,
    require_whole,
)
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import in_si, known_keywords
from jointplay.base.tables import Answer, Column, Table, few
from jointplay.base.units import readable, rounded
from jointplay.model.closed_loops import NOWHERE
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.physics.joints.bearings import PRELOADED
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, JointFriction

LEAST_M, MOST_M = 2e-6, 1e-3
"""Least and largest clearance that can be bought, unless others are given [m]."""
LEAST_RAD, MOST_RAD = 3e-5, 0.1
"""Least and largest play of gears that can be bought [rad], judged: from precision gears, 0.1
arcmin, to worn hobby servos, 6 degrees."""
_ARCMIN = math.radians(1.0 / 60.0)
"""One arcmin [rad], the unit of a gear's play in its price."""
LIMIT = 0.1
"""Least part of a cause that remains, unless one is given: assumed."""
PRICES = {"C2": 1.3, "CN": 1.0, "C3": 1.0, "C4": 1.1, "CC0": 1.5, "C0": 1.0, "C1": 1.0,
          PRELOADED: 2.0, **{f"IT{grade}": 1.6 ** (7 - grade) for grade in range(1, 19)},
}  # fmt: skip
"""Price of a class of bearings, or of a hole's or shaft's grade, relative to the usual one, unless
it is given: assumed, from no catalogue. That of a grade is the tolerance of IT7 over its own."""
PATIENCE_S = 2.0
"""Time after which a progress bar is shown [s]."""
COMPENSATION = "compensation"
"""Name among the offers under which `Correction`s are given."""
_NAMED = 4
"""Most sizes that the answer names (judged)."""
_MM = 1e3
"""Millimetres per metre: millimetres are the unit of clearances in their price."""
_RENEWALS = 12
"""Most rounds that recompute the plays at the latest sizes; a solution that has not converged by
then is refused (judged)."""
_USED, _USED_ROUGH = 1e-6, 5e-4
"""Part of the target that may be left unused: less than sizes can be made to; and the resolution of
the cuts where the error is not convex (judged)."""
_SETTLED = 1e-3
"""Relative change of sizes below which plays need not be computed anew: their second order then
changes by a thousandth of itself (judged)."""


@dataclass(frozen=True)
class Offer:
    """A bearing that can be bought for a joint, or a fit to which it can be made."""

    name: str
    """Class of the bearing, or the fit."""
    joint: Clearance
    """The joint with it."""
    price: float
    instead: str = ""
    """The fit that the joint had; empty for bearings."""

    def free(self, axis: str) -> float:
        """Free travel along x or z, with the loosest parts of a fit [m]."""
        fit = self.joint.fitted
        joint = self.joint if fit is None else self.joint.at_clearance(fit.most)
        return joint.travel[axis]


@dataclass(frozen=True)
class Correction:
    """A motion corrected for the play of all joints (`compensate`), at a price."""

    price: float = 1.0
    play: float = KNOWN
    """Relative uncertainty of the play that the correction assumes, to either side."""
    friction: float = 0.0
    """Relative uncertainty of the friction that it assumes, to either side."""

    def __post_init__(self) -> None:
        require_non_negative("price of a compensation", self.price, "")
        for name in ("play", "friction"):
            require_non_negative(f"part by which {name} may be off", getattr(self, name), "")


@dataclass(frozen=True)
class Corrected:
    """The error that a corrected motion leaves, with all sizes as they were given."""

    offer: Correction
    error: float
    """Error of the tool at rest, the largest of all poses [m]."""
    before: float
    """The worst case without a correction [m]."""

    @property
    def text(self) -> str:
        """The result in words."""
        known = [f"play known to {100 * self.offer.play:g} %"]
        if self.offer.friction:
            known.append(f"friction to {100 * self.offer.friction:g} %")
        error = readable(self.error, "m", 3)
        part = f", {100 * self.error / self.before:.0f} % of the worst case as it is"
        return f"compensated {error} at rest{part} (price {self.offer.price:g}, {', '.join(known)})"


def offers_of(
    joint: Clearance, prices: Mapping[str, float] | None = None, least: float = LEAST_M
) -> tuple[Offer, ...]:
    """The bearings or fits that can be bought for a joint.

    For a rolling bearing these are all classes of its size, and a preloaded pair; for a joint with
    a fit the fits that ISO 286-1 prefers at its size, the tightest of each pair of grades. Prices
    are by class and by grade, those of `PRICES` where not given; a fit costs the mean of its hole's
    and its shaft's.

    Args:
        least: the smallest clearance that other fits than its own may have [m].

    Raises:
        MissingName: a price of a class that does not exist.
        JointplayError: a negative price; a bearing of whose size no classes are known; a joint with
            neither.
    """
    known, fit = dict(PRICES), joint.fitted
    for name, price in (prices or {}).items():
        require_known("class of clearance", name, known)
        known[name] = require_non_negative(f"price of {name!r}", price, "")
    if isinstance(joint, RollingBearing):
        classes = joint.of_classes().items()
        return tuple(Offer(name, bearing, known.get(name, 1.0)) for name, bearing in classes)
    if fit is None:
        raise JointplayError(f"a {joint.kind} joint has neither a rolling bearing nor a fit")
    tightest = {fit.grades: fit}  # fits of the same grades cost the same
    for alternative in sorted(fit.alternatives(), key=lambda alternative: alternative.most):
        if alternative.least >= least:
            tightest.setdefault(alternative.grades, alternative)
    offers = []
    for other in tightest.values():
        price = sum(known[f"IT{grade}"] for grade in other.grades) / 2
        offers.append(Offer(str(other), joint.with_fit(other), price, str(fit)))
    return tuple(offers)


def is_bought(joint: Clearance) -> bool:
    """Whether a joint's play is chosen among `offers_of` instead of having any size."""
    return isinstance(joint, RollingBearing) or joint.fitted is not None


@dataclass(frozen=True)
class Choice:
    """The choice for one cause at one joint; numbers that do not apply to it are NaN."""

    joint: str
    cause: str
    remaining: float
    """Part of the cause that remains; 1 when only play is allocated, which may have any size."""
    clearance: float
    """Radial clearance (across x, of a slider), or play of a gear whose joint slides [m]."""
    play: float
    """Play of a gear that turns its joint [rad]."""
    offer: Offer | None
    """Bearing or fit that is bought."""
    before: float
    """Share in the error before; NaN when only play is allocated [m]."""
    after: float
    """Share in the error that is reached [m]."""
    gain: float
    """Error per clearance or play, where the target binds [1 or m/rad]."""
    price: float
    saved: float
    """Price that one more micrometre of clearance would save [1/µm]; for the gear of a revolute
    joint, one more arcmin of play."""
    held: str
    """The bound that is active: ``target``, ``least`` or ``most``; for causes ``limit``, ``as is``
    where nothing is bought, or ``kept``; ``class`` for bearings, ``fit`` for fits."""
    order: int
    """Order in which to buy improvements of causes: rank, from 1, by the error that the first unit
    of price saves; 0 where nothing is bought."""

    @property
    def gear(self) -> bool:
        """Whether it is the play of a gear by itself."""
        return self.joint.endswith(GEAR)

    @property
    def size(self) -> float:
        """The clearance or play [m or rad]; NaN of choices that have none."""
        return self.clearance if math.isnan(self.play) else self.play

    @property
    def size_text(self) -> str:
        """The clearance or play in words."""
        if math.isnan(self.play):
            return rounded(self.clearance, "m", 3, fine=self.clearance < 1.0 / _MM)
        return f"{self.play / _ARCMIN:.3g} arcmin"


def _first(names: Sequence[str], rest: str = "") -> str:
    """List the first names, and say how many others there are and, by `rest`, which."""
    if len(names) <= _NAMED + 1:  # a single other takes no more room by its name
        return ", ".join(names)
    return f"{', '.join(names[:_NAMED])}; {len(names) - _NAMED} others{rest}"


@dataclass(frozen=True, repr=False)
class Allocation(Answer):
    """Sizes and bearings that keep a target."""

    target: float
    """Largest error of the tool that is allowed [m or rad]."""
    unit: str
    """Unit of the error: m, or rad where it is the angle by which the tool is turned."""
    kind: str
    """Which error it is, in words: a worst case, a quantile or the root mean square."""
    choices: tuple[Choice, ...]
    was: float
    """The error before; NaN when only play is allocated [m]."""
    error: float
    """The error that is reached, by the static model with its second order [m]."""
    spread: tuple[float, float]
    """95 % interval of a quantile, which comes from samples; otherwise the error itself [m]."""
    free: float
    """Price without a target."""
    relief: float
    """Price saved by a target one metre wider [1/m]; 0 where only bearings are chosen."""
    mechanism: Mechanism
    """The mechanism with these sizes and bearings; of causes only the clearances are changed."""
    notes: tuple[str, ...]
    """Numbers given and assumed, and plays that stay as they are, as lines of text."""
    corrections: tuple[Corrected, ...] = ()
    """The errors that the corrected motions on offer would leave instead."""

    def column(self, name: str) -> np.ndarray:
        """One field of `Choice` of all choices."""
        return np.array([getattr(choice, name) for choice in self.choices])

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(choice.joint for choice in self.choices)

    @property
    def clearance(self) -> np.ndarray:
        """Radial clearances; NaN of choices that have none [m]."""
        return self.column("clearance")

    @property
    def total(self) -> float:
        """Price of all choices."""
        return float(self.column("price").sum())

    @property
    def parts(self) -> dict[Key, float]:
        """Parts below 1 that remain by joint and cause: the `remaining` of `budget`."""
        return {(o.joint, o.cause): o.remaining for o in self.choices if o.remaining < 1.0}

    def table(self) -> Table:
        """A row for each choice; of causes those that matter, the first to be bought first."""
        small = [abs(c.before) <= LISTED * self.was and not c.order for c in self.choices]
        listed = [choice for choice, left in zip(self.choices, small, strict=True) if not left]
        if not np.isnan(self.was):
            listed.sort(key=lambda choice: (choice.order == 0, -choice.before))
        table, totals, notes = self._rows(listed), [], [self._headline()]
        if any(small):
            sums = {"added": self.column("before")[small].sum()}
            sums["adds"] = self.column("after")[small].sum()
            heads = [column.head for column in table.columns if column.only != "data"]
            totals = [(f"{sum(small)} more", *(sums.get(head) for head in heads[1:]))]
        if self.corrections:
            corrected = ", ".join(correction.text for correction in self.corrections)
            allocated = f"allocated {readable(self.error, 'm', 3)} (price {self.total:.5g})"
            notes.append(f"{corrected}; {allocated}")
        return replace(table, totals=totals, notes=[*notes, *self.notes])

    def data(self) -> Table:
        """A row for each choice."""
        return self._rows(self.choices)

    def _rows(self, choices: Sequence[Choice]) -> Table:
        """A table of these choices, without the columns in which none has a value."""

        def of(head: str, name: str, unit: str = "", **more: Any) -> Column:
            return Column(head, [getattr(choice, name) for choice in choices], unit, **more)

        def where(turns: bool, name: str, factor: float = 1.0) -> list[float | None]:
            """A field of the choices of gears that turn a joint, or of all others."""
            applies = [np.isnan(choice.play) != turns for choice in choices]
            values = [getattr(choice, name) for choice in choices]
            return [factor * x if does else None for x, does in zip(values, applies, strict=True)]

        total, offers = self.total or 1.0, [choice.offer for choice in choices]
        alone = len({choice.cause for choice in self.choices}) == 1
        columns = [
            of("joint", "joint"),
            of("cause", "cause", only="data" if alone else ""),
            of("clearance", "clearance", "m", fine=True),
            of("play", "play", "rad", only="data"),
            Column("play [arcmin]", [choice.play / _ARCMIN for choice in choices], only="text"),
            Column("class", [offer and offer.name for offer in offers]),
        ]
        for direction, axis in (("across", "x"), ("along", "z")):
            far = [np.nan if offer is None else offer.free(axis) for offer in offers]
            columns.append(Column(f"free {direction}", far, "m", fine=True, digits=3))
        per_arcmin = where(True, "gain", _MM * _ARCMIN)
        columns += [
            Column("error per clearance", where(False, "gain")),
            Column(f"m{self.unit} per arcmin", per_arcmin, only="text"),
            Column("error per play", where(True, "gain"), only="data"),
            of("added", "before", self.unit),
            of("adds", "after", self.unit),
            *([] if np.isnan(self.was) else [of("remains", "remaining", key="remaining")]),
            of("price", "price", digits=4),
            Column("of all", [c.price / total for c in choices], "1", only="text", digits=4),
            Column("bought", [choice.order or None for choice in choices]),
            Column("a µm more saves", where(False, "saved"), key="saved_by_a_micrometre"),
            Column("an arcmin more saves", where(True, "saved"), key="saved_by_an_arcmin"),
            of("held by", "held"),
        ]
        return Table([c for c in columns if not all(x is None or x != x for x in c.values)])

    @property
    def sentence(self) -> str:
        """The answer in plain words."""
        by_cause = not np.isnan(self.was)
        if by_cause:
            kinds = ["improvements"]
        else:
            kinds = ["clearances"] * any(not c.gear and not c.offer for c in self.choices)
            kinds += ["plays of gears"] * any(choice.gear for choice in self.choices)
        bearings = "bearings" if by_cause else "classes of bearings"
        offers = [choice.offer for choice in self.choices if choice.offer]
        kinds += dict.fromkeys("fits" if offer.instead else bearings for offer in offers)
        text = (
            f"These are the cheapest {' and '.join(kinds)} that keep the tool "
            f"{self.mechanism.tool!r} within {readable(self.target, self.unit, 3)}: {self.chosen}"
        )
        if self.corrections:
            least = min(correction.error for correction in self.corrections)
            keeps = "keep it, too, at rest" if least <= self.target else "do not"
            text += f"; sizes as given, compensated, {keeps}: {readable(least, 'm', 3)}"
        return text

    @property
    def chosen(self) -> str:
        """The choices in words: the tightest sizes and bearings, the first improvements to buy."""
        parts = []
        improved = sorted((c for c in self.choices if c.order), key=lambda c: c.order)
        if improved:
            names = [f"{c.cause} of {c.joint} to {100 * c.remaining:.2g} %" for c in improved]
            parts.append(_first(names))
        elif np.isnan(self.was):
            for gear in (False, True):
                sized = [c for c in self.choices if c.gear == gear and not math.isnan(c.size)]
                sized.sort(key=lambda c: (math.isnan(c.play), c.size))
                names = [f"{c.joint.removesuffix(GEAR)} {c.size_text}" for c in sized]
                if names:
                    said = _first(names, f" up to {sized[-1].size_text}")
                    parts.append(f"gears: {said}" if parts else said)
        bought = [(c.offer, c.joint) for c in self.choices if c.offer]
        joints = dict[str, list[str]]()
        for offer, joint in sorted(bought, key=lambda pair: pair[0].free("x")):
            changed = offer.instead not in ("", offer.name)
            name = f"{offer.instead} becomes {offer.name}" if changed else offer.name
            joints.setdefault(name, []).append(joint)
        parts += [f"{name} in {few(names, 2)}" for name, names in joints.items()]
        return "; ".join(parts) or "none is needed"

    def _headline(self) -> str:
        """The error that is reached, the target and the price, in one line."""
        sizes = self.error, *self.spread, self.target, self.was
        error, low, high, target, was = (f"{1e3 * size:#.5g}" for size in sizes)
        interval = f" (95 %: {low} to {high})" if low != high else ""
        unit = f"m{self.unit}"
        line = f"{self.kind}: {error} {unit}{interval} of {target} {unit}"
        line += "" if np.isnan(self.was) else f" (as it is {was} {unit})"
        line += f"; price {self.total:.5g}"
        if self.total <= self.free * (1.0 + cheapest.TOLERANCE):
            return line + "; already within the target, so nothing is spent"
        line += f" (without a target {self.free:.4g})" if self.free else ""
        if self.relief:
            line += f"; a target 1 % wider saves {0.01 * self.target * self.relief:.4g}"
        return line


@known_keywords
def allocate(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    target: float | str,
    *,
    turn: bool = False,
    causes: Collection[str | Cause] | None = None,
    statistical: bool = False,
    quantile: float | None = None,
    keep: Collection[str] = (),
    offers: Mapping[str, Sequence[Offer | Correction]] | None = None,
    prices: Mapping[str, float] | None = None,
    weights: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    cost: str = COSTS[0],
    least: float | str | None = None,
    most: float | str | None = None,
    force: Sequence[float | str] = (0.0, 0.0, 0.0),
    errors: RobotErrors | None = None,
    kind: str | None = None,
    seed: int = 0,
    driven: Sequence[str] | None = None,
    drive: Drive | Mapping[str, Drive] | None = None,
    joint_friction: Mapping[str, JointFriction] | None = None,
    payloads: Sequence[Payload] = (),
    loads: Mapping[str, Load] | None = None,
    progress: bool = False,
) -> Allocation:
    """The cheapest sizes and bearings that keep the tool's error within `target` at all poses.

    For play alone these are clearances of any size (the ratio of axial to radial clearance stays),
    plays of gears, classes of rolling bearings and fits of other joints, chosen together. For
    several causes they are the part of each cause that remains at each joint, and the bearings and
    fits for which there are `offers`.

    Args:
        mechanism: joints without play, and gears with hysteresis, stay as they are unless causes
            are improved.
        poses: as for `budget`.
        target: largest distance of the tool from where it should be [m].
        turn: the target is the largest angle by which the tool is turned instead [rad].
        causes: as for `budget`; None: play alone.
        statistical: for several causes: the target holds for the root mean square instead of the
            worst case.
        quantile: for play alone: the part of all states that must keep the target, such as 0.99;
            None: the worst case.
        keep: joints and causes that count but stay as they are.
        offers: bearings and fits by joint. For play alone, joints that are not named or have an
            empty list get those of `offers_of`. For several causes, a joint's compliance goes with
            its bearing, and is no size of its own. Under `COMPENSATION` one `Correction` or
            several, to compare: with sizes as given, a corrected motion leaves the unknown part of
            the play's error at rest, what friction can hold, and the other causes.
        prices: prices by class of bearing and grade, `PRICES` where not given; by cause, the price
            of halving it, 1 where not given.
        weights: factors by joint on the prices of its sizes; 1 where not given.
        limits: least part of a cause that remains, by cause; `LIMIT` where not given.
        cost: price of clearances in mm and of gears' plays in arcmin (mm, if they slide), one of
            `COSTS`.
        least, most: clearances that can be bought, and plays of gears that slide [m]; None:
            `LEAST_M`, `MOST_M`; gears that turn have `LEAST_RAD`, `MOST_RAD`.
        force, errors, kind: for several causes, as for `budget`.
        seed: seed of the sampled states.
        driven, drive, joint_friction, payloads, loads: as for `budget`.
        progress: show a count of the rounds on standard error, if it takes long.

    Raises:
        JointplayError: a target that cannot be reached, with what can be and what prevents it;
            nothing to allocate; invalid values; see `budget`.
        MissingName: no such cost, joint, cause or class.
    """
    require_a("mechanism", mechanism, "Mechanism")
    unit = "rad" if turn else "m"
    target = require_positive("target", in_si("target", target, unit), unit)
    least = None if least is None else in_si("least", least, "m")
    most = None if most is None else in_si("most", most, "m")
    push = [in_si("force", component, "N") for component in force]
    seed = require_whole("seed", seed)
    if quantile is not None:
        require_share("the quantile", quantile)
    goods: dict[str, Any] = dict(offers or {})
    corrections: Sequence[Correction] = goods.pop(COMPENSATION, ())
    market = _Market(goods, prices or {}, weights or {}, limits or {}, cost, least, most)
    holding = {
        "driven": driven, "drive": drive, "joint_friction": joint_friction, "payloads": payloads,
        "loads": loads,
    }  # fmt: skip
    search = _Search(
        mechanism, configurations(mechanism, poses, driven), holding,
        None if causes is None else named(causes), push,
        RobotErrors() if errors is None else errors, kind, turn, statistical, quantile, seed, keep,
        market,
    )  # fmt: skip
    bar = ProgressBar(
        desc="allocating", unit="round", disable=not progress, delay=PATIENCE_S, leave=False
    )
    with bar:
        try:
            allocation = search.allocated(target, bar)
        except cheapest.Unreachable as unreachable:
            left = [correction.text for correction in search.corrected(corrections, progress)]
            raise JointplayError("; ".join([str(search.refusal(unreachable)), *left])) from None
    return replace(allocation, corrections=search.corrected(corrections, progress))


@dataclass(frozen=True)
class _Market:
    """The sizes and bearings that can be bought, and their prices; fields as for `allocate`."""

    offers: Mapping[str, Sequence[Offer]]
    prices: Mapping[str, float]
    weights: Mapping[str, float]
    limits: Mapping[str, float]
    cost: str
    least: float | None
    most: float | None

    def check(
        self, mechanism: Mechanism, causes: Mapping[str, Cause] | None, keep: Collection[str]
    ) -> None:
        """Refuse unknown names and invalid values."""
        joints = [*mechanism.joints, *mechanism.mounts, *mechanism.loops]
        known = [*CAUSES, *(causes or {})]
        if causes is None and self.limits:
            raise JointplayError(
                "limits apply to causes: give causes, too; of clearances give least and most"
            )
        for name in keep:
            if name not in (*known, *joints):
                raise MissingName("cause of errors", name, known, " (nor is it a joint)")
        for name, value in self.limits.items():
            require_known("cause of errors", name, known)
            if require_positive(f"limit of {name!r}", value, "") > 1.0:
                raise JointplayError(
                    f"limit of {name!r}: a part of at most 1 remains, got {value:g}"
                )
        for name, value in self.prices.items():
            if name in known:
                require_positive(f"price of {name!r}", value, "")
            elif causes is not None and name not in PRICES:
                raise MissingName("cause of errors", name, known)
        for name, value in self.weights.items():
            require_known("joint with clearance", name, joints)
            require_positive(f"weight of {name!r}", value, "")

    def offers_for(
        self, mechanism: Mechanism, causes: Mapping[str, Cause] | None, keep: Collection[str]
    ) -> dict[str, tuple[Offer, ...]]:
        """Offers by joint: for play alone of all joints with a bearing or fit, else those given."""
        joints = {name: joint for name, joint in mechanism.clearance.items() if is_bought(joint)}
        for name in self.offers:
            require_known("joint with a rolling bearing or a fit", name, joints)
        names = [
            name for name in joints if name not in keep and (causes is None or name in self.offers)
        ]
        prices = {name: price for name, price in self.prices.items() if name not in (causes or ())}
        if prices and not names and causes is None:
            raise JointplayError(
                f"prices of {', '.join(prices)} are for classes of rolling bearings and fits, and "
                "no joint has one; clearances have a cost and weights"
            )
        least = LEAST_M if self.least is None else self.least
        return {
            name: tuple(self.offers.get(name, ())) or offers_of(joints[name], prices, least)
            for name in names
        }

    def parts(self, keys: tuple[Key, ...]) -> Sizes:
        """The sizes to choose for several causes: the part of each that remains at each joint."""
        weight = [self.prices.get(n, 1.0) * self.weights.get(joint, 1.0) for joint, n in keys]
        low, ones = [self.limits.get(cause, LIMIT) for _, cause in keys], np.ones(len(keys))
        return Sizes(keys, np.array(weight), np.array(low), ones, ones, COSTS[0])

    def clearances(
        self, mechanism: Mechanism, keys: tuple[Key, ...], quantile: float | None
    ) -> Sizes:
        """The sizes to choose for play alone: clearances of joints and plays of gears."""
        require_known("cost", self.cost, COSTS)
        if quantile is not None and self.cost == "linear":
            raise JointplayError(
                "the cost 'linear' is possible for the worst case only, because a quantile is not "
                "convex; use " + " or ".join(COSTS[:2])
            )
        joints = [name.removesuffix(GEAR) for name, _ in keys]
        for name in self.weights:
            require_known("joint with clearance", name, joints)
        geared = [name.endswith(GEAR) for name, _ in keys]
        entries = mechanism.description.joints
        turns = np.array([
            gear and not entries[name].slides for name, gear in zip(joints, geared, strict=True)
        ])  # fmt: skip
        if turns.all() and len(keys) and not (self.least is None and self.most is None):
            raise JointplayError(
                "least and most are of clearances, and there are plays of gears only"
            )
        most, low = MOST_M if self.most is None else self.most, self.least
        most = require_positive("the most clearance", most, "m")
        low = require_positive("least clearance", LEAST_M if low is None else low, "m")
        if low >= most:
            raise JointplayError(
                f"the least clearance {readable(low, 'm')} must be below the most, "
                f"{readable(most, 'm')}"
            )
        size = np.array([
            mechanism.gears[name].play if gear else mechanism.clearance[name].radial_travel
            for name, gear in zip(joints, geared, strict=True)
        ])  # fmt: skip
        weight = np.array([self.weights.get(name, 1.0) for name in joints])
        ends = np.where(turns, LEAST_RAD, low) / size, np.where(turns, MOST_RAD, most) / size
        unit = np.where(turns, _ARCMIN, 1.0 / _MM)
        return Sizes(keys, weight, *ends, size / unit, self.cost)


@dataclass
class _Search:
    """The allocation for one machine: its sizes and offers, and its error as a function of them."""

    mechanism: Mechanism
    q: np.ndarray
    holding: Mapping[str, Any]
    """The arguments of `budget` that hold and load the machine."""
    causes: Mapping[str, Cause] | None
    force: Sequence[float]
    errors: RobotErrors
    kind: str | None
    turn: bool
    statistical: bool
    quantile: float | None
    seed: int
    keep: Collection[str]
    market: _Market

    def __post_init__(self) -> None:
        self.market.check(self.mechanism, self.causes, self.keep)
        self.offers = self.market.offers_for(self.mechanism, self.causes, self.keep)
        self.first = self.build({}, {})[1]
        sizable = filter(self._sizable, self.first.contributions)
        sought = [c for c in sizable if not {c.joint, c.cause} & {*self.keep}]
        self.keys = tuple(dict.fromkeys(map(self.key, sought)))
        if self.causes is None:
            self.sizes = self.market.clearances(self.mechanism, self.keys, self.quantile)
        else:
            self.sizes = self.market.parts(self.keys)
        # Refuse a machine with nothing to choose, or whose choices would not move the tool.
        if self.causes is None and self.first.farthest().size.max() <= NOWHERE * MOST_RAD:
            raise JointplayError(
                f"nothing that has play moves the tool {self.mechanism.tool!r} at these poses: "
                "name another frame as the tool (--tool), or give an angle as the target"
            )
        if not self.keys and not self.offers:
            if self.causes is not None:
                raise JointplayError("no cause is left that may be improved: keep fewer")
            for name, joint in self.mechanism.clearance.items():
                if not joint.clearances:
                    raise JointplayError(
                        f"joint {name!r} is {joint.kind}: it has no clearance to allocate"
                    )
            raise JointplayError("no joint or gear has play to allocate")
        if self.quantile is not None and (self.offers or self.causes is not None):
            raise JointplayError(
                "a quantile is for clearances of any size only, not for classes nor other causes"
            )

    def key(self, contribution: Contribution) -> Key:
        """The size to which a contribution belongs; for play alone a gear has one of its own."""
        name = contribution.name if self.causes is None else contribution.joint
        return name, contribution.cause

    def _sizable(self, contribution: Contribution) -> bool:
        """Whether a contribution can have any size."""
        if contribution.gear and self.causes is None:  # without hysteresis
            gear = self.mechanism.gears[contribution.joint]
            return 0.0 < gear.unloaded_range == gear.play
        return contribution.proportional and not self._offered(contribution)

    def _offered(self, contribution: Contribution) -> bool:
        """Whether a contribution changes with the bearing or fit that is bought."""
        of_bearing = contribution.cause in ("play", "elasticity") and not contribution.gear
        return of_bearing and contribution.joint in self.offers

    def build(
        self, remaining: Mapping[Key, float], chosen: Mapping[str, Offer]
    ) -> tuple[Mechanism, ErrorModel]:
        """The mechanism with these sizes and bearings, and its error."""
        joints = self.mechanism.clearance | {name: o.joint for name, o in chosen.items()}
        if self.causes is not None:
            machine = self.mechanism.with_clearance(joints) if chosen else self.mechanism
            holding = self.holding
            machine, model = cause_model(
                machine, self.q, with_force(machine, self.force, holding["loads"]), self.causes,
                self.errors, self.kind, remaining, holding["driven"], None,
                holding_drives(machine, holding["drive"]), holding["payloads"],
            )  # fmt: skip
            return machine, model.turning if self.turn else model
        gears: dict[str, Any] = dict(self.mechanism.gears)
        for (name, _), x in remaining.items():
            if name in joints:
                joints[name] = joints[name].scaled(x)
            else:
                gear = gears[name.removesuffix(GEAR)]
                gears[name.removesuffix(GEAR)] = replace(gear, play=x * gear.play)
        machine = self.mechanism.with_clearance(joints, gears)
        model = play_model(machine, self.q, driven=self.holding["driven"], loops=True)
        return machine, model.turning if self.turn else model

    def corrected(self, offers: Sequence[Correction], progress: bool) -> tuple[Corrected, ...]:
        """The errors at rest that corrected motions leave.

        Of play there remain the states in which friction can hold it, and the unknown part of the
        displacement at rest (of the worst case, if joints give way beyond that); other causes
        remain with their worst case.

        Raises:
            JointplayError: closed loops, of which no motion is compensated; nothing has play; no
                place of rest was found.
        """
        if not offers:
            return ()
        if self.turn:
            raise JointplayError("what compensation leaves is a distance: give one as the target")
        if self.mechanism.loops:
            raise JointplayError("motions of closed loops cannot be compensated: offer none")
        model = self.first
        play = budget(self.mechanism, self.q, force=self.force, **self.holding)
        beside = [k for k, c in enumerate(model.contributions) if c.cause != "play"]
        others = model.subset(beside).farthest().size if beside else np.zeros(len(self.q))
        residuals = np.zeros((len(offers), len(self.q)))
        poses, quiet = range(len(self.q)), not progress
        for k in ProgressBar(poses, "places of rest", disable=quiet, delay=PATIENCE_S, leave=False):
            rest = play.rest_positions.at(k)
            place = float(np.linalg.norm((rest.error - rest.sag)[:3]))
            for offer, row in zip(offers, residuals, strict=True):
                unknown = offer.play * min(place, play.worst[k])
                row[k] = others[k] + play.compensated(k, 0.0, offer.friction) + unknown
        if np.isnan(residuals).any():
            raise JointplayError(
                "no place of rest was found: what compensation leaves is not known"
            )
        before, after = float(model.farthest().size.max()), residuals.max(axis=1).tolist()
        return tuple(Corrected(*pair, before) for pair in zip(offers, after, strict=True))

    def error(self, model: ErrorModel, x: np.ndarray, choice: Sequence[int] | None = None) -> Error:
        """The error of a model as a function of sizes x; `choice` maps contributions to sizes."""
        choice = self.choice(model) if choice is None else choice
        if self.quantile is not None:
            return cheapest.Quantile(model, choice, x, self.quantile, self.seed)
        if self.statistical:
            return cheapest.RootMeanSquare(model, choice, x)
        return cheapest.WorstCase(model, choice, x)

    def remaining(self, x: np.ndarray) -> dict[Key, float]:
        """Sizes by key, where they are not as given."""
        return {key: float(part) for key, part in zip(self.keys, x, strict=True) if part != 1.0}

    def with_offers(self, remaining: Mapping[Key, float]) -> tuple[ErrorModel, list[int]]:
        """One model with the contributions of all offers, and each one's component of the choice.

        It is joined from one model for the first offers of all joints, one for the second, and so
        on; contributions that no offer changes are taken from the first.
        """
        counts = [len(options) for options in self.offers.values()]
        first = dict(zip(self.offers, len(self.keys) + np.cumsum([0, *counts]), strict=False))
        models, of = [], []
        for k in range(max(counts, default=1)):
            chosen = {
                name: options[min(k, len(options) - 1)] for name, options in self.offers.items()
            }
            _, model = self.build(remaining, chosen)
            indices = []
            for i, (contribution, size) in enumerate(
                zip(model.contributions, self.choice(model), strict=True)
            ):
                offered = self._offered(contribution)
                if k < len(self.offers[contribution.joint]) if offered else k == 0:
                    indices.append(i)
                    of.append(int(first[contribution.joint]) + k if offered else size)
            models.append(model.subset(indices))
        if len(models) > 1 and models[0].tied:
            raise JointplayError(
                "plays that constrain each other in a closed loop are no sum over joints: choose "
                "the classes by trying (jointplay budget)"
            )
        return ErrorModel.join(models), of

    def _by_key(self, model: ErrorModel, parts: np.ndarray) -> dict[Key, float]:
        """Shares of contributions (k,) in the error, summed by joint and cause."""
        sums = dict[Key, float]()
        for contribution, part in zip(model.contributions, parts, strict=True):
            sums[self.key(contribution)] = sums.get(self.key(contribution), 0.0) + float(part)
        return sums

    def choice(self, model: ErrorModel) -> list[int]:
        """Index of the size that multiplies each contribution; -1 for none."""
        place = {key: i for i, key in enumerate(self.keys)}
        return [place.get(self.key(c), -1) if c.proportional else -1 for c in model.contributions]

    def allocated(self, target: float, bar: Any) -> Allocation:
        """Allocate, again with the plays computed anew at each solution, until both agree.

        The problem is solved for `aim`, which is adjusted until the error that the new plays have
        uses up the target.
        """
        keys, sizes, count = self.keys, self.sizes, len(self.keys)
        x, aim = np.ones(count), target * (1.0 - cheapest.TOLERANCE)
        curved = any(cause == "play" for _, cause in keys)
        offers = list(self.offers.values())
        prices = [np.array([offer.price for offer in options]) for options in offers]
        start = last = self.error(self.first, x)
        for _ in range(_RENEWALS):
            before, error = x, last
            if offers:
                now = np.append(x, np.ones(sum(map(len, offers))))
                model, choice = self.with_offers(self.remaining(x))
                error = self.error(model, now, choice)
            problem = Problem(error, sizes, prices, aim, bar)
            try:
                z = problem.solve()
            except cheapest.Unreachable as refused:
                least = refused.z[:count]
                if not curved or np.allclose(x, least, rtol=_SETTLED):
                    raise
                x = least  # try again where plays may be smaller than in proportion
                last = self.error(self.build(self.remaining(x), {})[1], x)
                continue
            x = z[:count]
            picked = zip(self.offers.items(), problem.chosen(z), strict=True)
            bought = {name: options[k] for (name, options), k in picked}
            mechanism, model = self.build(self.remaining(x), bought)
            if isinstance(error, cheapest.Quantile):  # `last` stays: its states are first-order
                reached, ends = cheapest.spread(model, error.quantile, error.seed)
            else:
                last = self.error(model, x)
                reached = last.at(x) if last.convex else float(model.farthest().size.max())
                ends = reached, reached
            tolerance = _USED if error.convex else _USED_ROUGH
            moved = np.abs(x / before - 1.0).max(initial=0.0)
            settled = not curved or not error.convex or moved < _SETTLED
            used = reached >= target * (1.0 - tolerance) or "target" not in sizes.held(x)
            if settled and used and reached <= target:
                break
            if settled:
                aim *= target / reached * (1.0 - 0.5 * tolerance)
        else:
            raise JointplayError(
                f"the allocation did not settle within {100 * abs(reached / target - 1.0):.2g} % "
                "of the target; keep play, or allocate clearances first"
            )
        by_cause = self.causes is not None
        # A cause that stays as it is costs nothing: prices count from there.
        free = problem.price(problem.free()) - (sizes.prices(sizes.most).sum() if by_cause else 0.0)
        choices = tuple(self._choices(problem, z, bought, start, last))
        was = start.at(np.ones(count)) if by_cause else np.nan
        return Allocation(
            target, "rad" if self.turn else "m", last.kind, choices, was, reached,
            ends, float(free), problem.relief, mechanism, tuple(self.notes()),
        )  # fmt: skip

    def _choices(
        self,
        problem: Problem,
        z: np.ndarray,
        offers: Mapping[str, Offer],
        start: Error,
        last: Error,
    ) -> Iterator[Choice]:
        """The choices by joint and cause; `start` and `last` are the error before and now."""
        sizes, by_cause, count = self.sizes, self.causes is not None, len(self.keys)
        x, ones = z[:count], np.ones(count)
        before = self._by_key(start.model, start.parts(ones)) if by_cause else {}
        after = self._by_key(last.model, last.parts(x))
        held, slopes, gains = sizes.held(x), sizes.slopes(x), problem.gains(z)
        paid = sizes.prices(x) - (sizes.prices(sizes.most) if by_cause else 0.0)
        worth = start.slopes(ones) / sizes.weight  # error saved by the first of the price
        bought = [int(k) for k in np.argsort(-worth) if held[k] != "most"]
        index = {key: k for k, key in enumerate(self.keys)}
        of_joints = dict.fromkeys((name, "play") for name in self.mechanism.clearance)
        rows = [*before, *(key for key in of_joints if key[0] in offers and key not in before)]
        if not by_cause:
            of_joints |= dict.fromkeys((name + GEAR, "play") for name in self.mechanism.gears)
            rows = [key for key in of_joints if key in index or key[0] in offers]
        for key in rows:
            joint, cause = key
            k, offer = index.get(key), offers.get(joint) if cause == "play" else None
            adds, cost = after.get(key, 0.0), 0.0 if offer is None else offer.price
            part, size, play, gain, saved, order = 1.0, np.nan, np.nan, np.nan, np.nan, 0
            how = "kept" if offer is None else "fit" if offer.instead else "class"
            if k is not None:
                how, cost = held[k], cost + float(paid[k])
                gear = self.mechanism.gears.get(joint.removesuffix(GEAR))
                if cause == "play" and is_proportional(self.mechanism, joint):
                    size = self.mechanism.clearance[joint].radial_travel * x[k]
                elif not by_cause and gear is not None:
                    size = gear.play * x[k]
                if by_cause:
                    how, part = {"least": "limit", "most": "as is"}.get(how, how), float(x[k])
                    order = bought.index(k) + 1 if k in bought else 0
                else:  # derivatives by x become those by the size: per metre, or radian of a gear
                    now = size / x[k]
                    gain, saved = gains[k] / now, -1e-6 * slopes[k] / now
                    adds = gain * size
                    if joint.endswith(GEAR) and self._turns(joint):
                        play, size, saved = size, np.nan, saved * 1e6 * _ARCMIN
            had = before.get(key, 0.0) if by_cause else np.nan
            yield Choice(*key, part, size, play, offer, had, adds, gain, cost, saved, how, order)

    def _turns(self, gear: str) -> bool:
        """Whether the joint of a gear turns."""
        return not self.mechanism.description.joints[gear.removesuffix(GEAR)].slides

    def notes(self) -> list[str]:
        """Numbers given and assumed of causes, prices and limits, and plays that stay, as text."""
        if self.causes is None:
            gears = [name for name, _ in self.keys if name.endswith(GEAR)]
            units = " or a play in arcmin" if any(map(self._turns, gears)) else ""
            prices = [f"cost of a clearance in mm{units}: {self.sizes.cost}"] if self.keys else []
            alone = "note: play alone counts: gears giving way and servos' sag add to it (--whole)"
            return [*prices, alone] if gears else prices
        given, assumed = given_and_assumed(self.first)
        notes = [*(f"given: {line}" for line in given), *(f"assumed: {line}" for line in assumed)]
        causes = list(dict.fromkeys(cause for _, cause in self.keys))
        if unpriced := [cause for cause in causes if cause not in self.market.prices]:
            notes.append(
                f"assumed: prices: halving costs 1 at each joint, of {', '.join(unpriced)} "
                "(--price CAUSE=X, --weight JOINT=X)"
            )
        if unlimited := [cause for cause in causes if cause not in self.market.limits]:
            notes.append(
                f"assumed: limits: at least {LIMIT:g} remains, of {', '.join(unlimited)} "
                "(--limit CAUSE=X)"
            )
        counted = self.first.contributions
        unchanged = [c for c in counted if not c.proportional and c.joint not in self.offers]
        for noun, fitted in (("bearings", False), ("fits", True)):
            if names := [c.joint for c in unchanged if (c.fit is not None) == fitted]:
                notes.append(
                    f"kept: the play of the {noun} of {', '.join(names)}, which is not "
                    "proportional to their clearance: allocate by class (--by-class) chooses theirs"
                )
        return notes

    def refusal(self, unreachable: cheapest.Unreachable) -> JointplayError:
        """The error that says what prevents a target, and what can be reached instead."""
        count, sizes = len(self.keys), self.sizes
        unit = "rad" if self.turn else "m"
        text = f"a target of {readable(unreachable.target, unit, 4)} cannot be reached"
        error = f"the error is {readable(unreachable.bound, unit, 4)} at least"
        if self.causes is None:
            least = {
                f"{low * size:.2g} arcmin in every gear"
                if turns
                else f"{readable(low * size / _MM, 'm', 4)} in every "
                f"{'gear' if name.endswith(GEAR) else 'joint'}": None
                for (name, _), low, size in zip(self.keys, sizes.least, sizes.unit, strict=True)
                for turns in [name.endswith(GEAR) and self._turns(name)]
            }
            means = list(least)
            bought = [offer for options in self.offers.values() for offer in options]
            kinds = dict.fromkeys("fits" if offer.instead else "bearings" for offer in bought)
            means += [f"the tightest {' and '.join(kinds)} offered"] if kinds else []
            return JointplayError(f"{text}: with {' and '.join(means)} {error}")
        x = unreachable.z[:count]
        _, model = self.build(self.remaining(x), {})
        parts = self._by_key(model, self.error(model, x).parts(x))
        sums = dict[str, float]()
        for (_, cause), part in parts.items():
            sums[cause] = sums.get(cause, 0.0) + part
        fixed = {cause for joint, cause in parts if (joint, cause) not in self.keys}
        fixed |= {c.cause for c in model.contributions if not c.proportional}
        limit = {cause: low for (_, cause), low in zip(self.keys, sizes.least, strict=True)}
        reasons = []
        for cause, part in sorted(sums.items(), key=lambda item: -item[1])[:3]:
            why = [f"at least {limit[cause]:g} of it remains"] if cause in limit else []
            why += ["kept"] if cause in fixed else []
            reasons.append(f"{cause} {readable(part, unit, 4)} ({' and '.join(why)})")
        error += f", most of it by {'; then '.join(reasons)}"
        return JointplayError(f"{text}: with all causes at their limits {error}")
