"""What must be how large, or better: the cheapest sizes and bearings that keep a tolerance.

Clearances of any size, parts of causes that remain, and bearings, which are bought by class, are
chosen together (`cheapest`). A clearance's play has a second order: it is found anew at each
solution until both agree.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from jointplay.accuracy import cheapest
from jointplay.accuracy.causes import (
    CAUSES,
    Cause,
    cause_model,
    is_proportional,
    named,
    told_apart,
)
from jointplay.accuracy.cheapest import COSTS, Error, Key, Problem, Sizes
from jointplay.accuracy.cures import KNOWN
from jointplay.accuracy.error_budget import NOWHERE, budget, holding_drives
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
from jointplay.base.tables import Column, Table, few
from jointplay.base.units import readable
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.physics.joints.bearings import PRELOADED
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, JointFriction

LEAST_M, MOST_M = 2e-6, 1e-3
"""Clearances that can be bought, unless others are given [m]."""
LEAST_RAD, MOST_RAD = 3e-5, 0.1
"""Plays of gears that can be bought [rad], judged: from precision gears, 0.1 arcmin, to worn hobby
servos, 6 degrees."""
_ARCMIN = math.radians(1.0 / 60.0)
"""[rad]: costs of gears that turn are of plays in arcmin."""
LIMIT = 0.1
"""Part of a cause that remains at least, unless it is given: assumed."""
PRICES = {"C2": 1.3, "CN": 1.0, "C3": 1.0, "C4": 1.1, "CC0": 1.5, "C0": 1.0, "C1": 1.0,
          PRELOADED: 2.0, **{f"IT{grade}": 1.6 ** (7 - grade) for grade in range(1, 19)},
}  # fmt: skip
"""Price of a class of bearings, or of a hole's or shaft's grade, relative to the usual one, unless
it is given: assumed, of no catalogue. Of a grade it is the tolerance of IT7 over its own."""
PATIENCE_S = 2.0
"""What takes longer has a bar [s]."""
COMPENSATION = "compensation"
"""Under which `Correction`s are offered."""
_MM = 1e3
"""Costs are of clearances in millimetres."""
_RENEWALS = 12
_USED, _USED_ROUGH = 1e-6, 5e-4
"""Part of the target that may be left, and where the error is not convex."""
_SETTLED = 1e-3
"""Relative change of sizes below which plays, of the second order, are as they were."""
_LISTED = 2e-3
"""Part of the error below which a cause has no line of its own."""


@dataclass(frozen=True)
class Offer:
    """A bearing that can be bought for a joint, or a fit to which it can be made."""

    name: str
    joint: Clearance
    price: float
    instead: str = ""
    """The fit that the joint had; empty for bearings."""

    def free(self, way: str) -> float:
        """How far it is free along x or z, with the loosest parts of a fit [m]."""
        fit = self.joint.fitted
        joint = self.joint if fit is None else self.joint.at_clearance(fit.most)
        return joint.travel[way]


@dataclass(frozen=True)
class Correction:
    """A motion corrected for the play of all joints (`compensate`), at a price."""

    price: float = 1.0
    play: float = KNOWN
    """Part by which play may be off from what the correction takes it to be."""
    friction: float = 0.0
    """Likewise friction."""

    def __post_init__(self) -> None:
        require_non_negative("price of a compensation", self.price, "")
        for name in ("play", "friction"):
            require_non_negative(f"part by which {name} may be off", getattr(self, name), "")


@dataclass(frozen=True)
class Corrected:
    """What a correction would leave of the error, with all sizes as they were given."""

    offer: Correction
    error: float
    """Of the tool at rest, the largest of all poses [m]."""
    before: float
    """The worst case as it was [m]."""

    @property
    def words(self) -> str:
        known = [f"play known to {100 * self.offer.play:g} %"]
        if self.offer.friction:
            known.append(f"friction to {100 * self.offer.friction:g} %")
        left = readable(self.error, "m", 3)
        part = f", {100 * self.error / self.before:.0f} % of the worst case as it is"
        return f"compensated {left} at rest{part} (price {self.offer.price:g}, {', '.join(known)})"


def offers_of(
    joint: Clearance, prices: Mapping[str, float] | None = None, least: float = LEAST_M
) -> tuple[Offer, ...]:
    """What can be bought instead: of a rolling bearing all classes of its size, and a pair
    preloaded; of a joint with a fit those that ISO 286-1 prefers of its size, the tightest of each
    pair of grades.

    Prices are by class and by grade, those of `PRICES` where not given; that of a fit is the mean
    of its hole's and its shaft's.

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
        return tuple(Offer(name, one, known.get(name, 1.0)) for name, one in classes)
    if fit is None:
        raise JointplayError(f"a {joint.kind} joint has neither a rolling bearing nor a fit")
    tightest = {fit.grades: fit}  # of each pair of grades, which cost the same
    for one in sorted(fit.alternatives(), key=lambda one: one.most):
        if one.least >= least:
            tightest.setdefault(one.grades, one)
    return tuple(
        Offer(str(one), joint.with_fit(one), sum(known[f"IT{g}"] for g in one.grades) / 2, str(fit))
        for one in tightest.values()
    )


def is_bought(joint: Clearance) -> bool:
    """Whether a joint's play is chosen among `offers_of`, and not of any size."""
    return isinstance(joint, RollingBearing) or joint.fitted is not None


@dataclass(frozen=True)
class Choice:
    """What was chosen of a cause at a joint; numbers that say nothing of it are NaN."""

    joint: str
    cause: str
    remaining: float
    """How large it is, as a part of what it was; of play alone 1, for any size is sought."""
    clearance: float
    """Radial (across x, of a slider), or the play of a gear that moves its joint along [m]."""
    play: float
    """Of a gear that turns its joint [rad]."""
    offer: Offer | None
    before: float
    """What it added to the error as it was, of play alone NaN [m]."""
    after: float
    """What it adds in the end [m]."""
    gain: float
    """Error per clearance or play, where the target binds [1 or m/rad]."""
    price: float
    saved: float
    """What the last micrometre of the clearance costs: saved by one more [1/µm]; of a gear that
    turns the last arcmin of its play."""
    held: str
    """``target``, ``least``, ``most``, of causes ``limit``, ``as is`` where nothing is bought, or
    ``kept``; ``class`` of bearings, ``fit``."""
    order: int
    """Of causes, which is bought first: rank by what the first of its price saves, from 1 on; 0
    where nothing is bought."""

    @property
    def gear(self) -> bool:
        """Whether it is of a gear alone."""
        return self.joint.endswith(GEAR)


@dataclass(frozen=True)
class Allocation:
    """Sizes and bearings that keep a target."""

    target: float
    """Largest error of the tool [m or rad]."""
    unit: str
    """Of the error: m, or rad where it is the tool's turn."""
    kind: str
    """What the error is: a worst case, a quantile or the root mean square, in words."""
    choices: tuple[Choice, ...]
    was: float
    """The error as it was, of play alone NaN [m]."""
    error: float
    """What is reached, by the static model with its second order [m]."""
    spread: tuple[float, float]
    """95 % interval of a quantile, for it is of samples; else the error itself [m]."""
    free: float
    """Price without a target."""
    relief: float
    """Price saved by a target one metre wider [1/m]; 0 where only bearings are chosen."""
    mechanism: Mechanism
    """With these sizes and bearings; of causes the clearances alone."""
    notes: tuple[str, ...]
    """What was given and assumed, and what stays as it is, lines of text."""
    corrections: tuple[Corrected, ...] = ()
    """What corrected motions, which were offered, would leave instead."""

    def each(self, what: str) -> np.ndarray:
        """One of the fields of `Choice`, of all choices."""
        return np.array([getattr(one, what) for one in self.choices])

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(one.joint for one in self.choices)

    @property
    def clearance(self) -> np.ndarray:
        """Radial clearances, NaN of what is none [m]."""
        return self.each("clearance")

    @property
    def total(self) -> float:
        return float(self.each("price").sum())

    @property
    def parts(self) -> dict[Key, float]:
        """What remains by joint and cause, where less than all: `remaining` of `budget`."""
        return {(o.joint, o.cause): o.remaining for o in self.choices if o.remaining < 1.0}

    def table(self) -> Table:
        """A row for each; of causes those that matter, first those that were bought first."""
        small = [abs(o.before) <= _LISTED * self.was and not o.order for o in self.choices]
        kept = [one for one, left in zip(self.choices, small, strict=True) if not left]
        if not np.isnan(self.was):
            kept.sort(key=lambda one: (one.order == 0, -one.before))
        shown, more = self._rows(kept), []
        if any(small):
            sums = {head: self.each(what)[small].sum() for head, what in _SUMMED.items()}
            heads = [one.head for one in shown.columns if one.only != "data"]
            more = [(f"{sum(small)} more", *(sums.get(head) for head in heads[1:]))]
        return replace(shown, totals=more, notes=[self._headline(), *self._cures, *self.notes])

    @property
    def _cures(self) -> list[str]:
        if not self.corrections:
            return []
        tighter = f"allocated {readable(self.error, 'm', 3)} (price {self.total:.5g})"
        return [f"{', '.join(one.words for one in self.corrections)}; {tighter}"]

    def data(self) -> Table:
        """A row for each choice."""
        return self._rows(self.choices)

    def _rows(self, kept: Sequence[Choice]) -> Table:
        """All that is known of any choice."""

        def of(head: str, what: str, unit: str = "", **more: Any) -> Column:
            return Column(head, [getattr(one, what) for one in kept], unit, **more)

        total, offers = self.total or 1.0, [one.offer for one in kept]
        alone = len({one.cause for one in self.choices}) == 1
        improved = not np.isnan(self.was)
        lengths = [(one, np.isnan(one.play)) for one in kept]
        columns = [
            of("joint", "joint"),
            of("cause", "cause", only="data" if alone else ""),
            of("clearance", "clearance", "m", fine=True),
            of("play", "play", "rad", only="data"),
            Column("play [arcmin]", [one.play / _ARCMIN for one in kept], only="text"),
            Column("class", [None if one is None else one.name for one in offers]),
        ]
        for way, axis in (("across", "x"), ("along", "z")):
            far = [np.nan if one is None else one.free(axis) for one in offers]
            columns.append(Column(f"free {way}", far, "m", fine=True, digits=3))
        columns += [
            Column("error per clearance", [one.gain if own else None for one, own in lengths]),
            Column(
                f"m{self.unit} per arcmin",
                [None if own else _MM * _ARCMIN * one.gain for one, own in lengths],
                only="text",
            ),
            Column(
                "error per play", [None if own else one.gain for one, own in lengths], only="data"
            ),
            of("added", "before", self.unit),
            of("adds", "after", self.unit),
            *([of("remains", "remaining", key="remaining")] if improved else []),
            of("price", "price", digits=4),
            Column("of all", [o.price / total for o in kept], "1", only="text", digits=4),
            Column("bought", [one.order or None for one in kept]),
            Column(
                "a µm more saves",
                [one.saved if own else None for one, own in lengths],
                key="saved_by_a_micrometre",
            ),
            Column(
                "an arcmin more saves",
                [None if own else one.saved for one, own in lengths],
                key="saved_by_an_arcmin",
            ),
            of("held by", "held"),
        ]
        return Table([one for one in columns if not all(map(_is_none, one.values))])

    @property
    def sentence(self) -> str:
        """The answer in plain words."""
        whole, offers = not np.isnan(self.was), [one.offer for one in self.choices if one.offer]
        bearings = "bearings" if whole else "classes of bearings"
        kinds = dict.fromkeys("fits" if one.instead else bearings for one in offers)
        first, gears = ["improvements"] if whole else [], self._gears
        if not whole:
            first += ["clearances"] * any(not one.gear and not one.offer for one in self.choices)
            first += ["plays of gears"] * any(one.gear for one in self.choices)
        sizes = f": {few(gears, 7)}" if gears and not whole else ""
        return (
            f"These are the cheapest {' and '.join([*first, *kinds])} that keep the tool "
            f"{self.mechanism.tool!r} within {readable(self.target, self.unit, 3)}{sizes}"
            f"{self._exchanged}{self._corrected}"
        )

    @property
    def _gears(self) -> list[str]:
        """Plays of gears in words, of those that count."""
        return [
            f"{one.clearance * _MM:.3g} mm in {one.joint.removesuffix(GEAR)}"
            if np.isnan(one.play)
            else f"{float(f'{one.play / _ARCMIN:.2g}'):g} arcmin in {one.joint.removesuffix(GEAR)}"
            for one in self.choices
            if one.gear and one.held != "most"
        ]

    @property
    def _corrected(self) -> str:
        """Whether a corrected motion keeps the target, too, to add to a sentence."""
        if not self.corrections:
            return ""
        least = min(one.error for one in self.corrections)
        keeps = "keep it, too, at rest" if least <= self.target else "do not"
        return f"; sizes as given, compensated, {keeps}: {readable(least, 'm', 3)}"

    @property
    def _exchanged(self) -> str:
        """Which fits become which others, to add to a sentence."""
        changed = dict[str, list[str]]()
        for one in self.choices:
            if one.offer and one.offer.instead not in ("", one.offer.name):
                words = f"{one.offer.instead} becomes {one.offer.name}"
                changed.setdefault(words, []).append(one.joint)
        parts = [f"{words} in {few(joints, 2)}" for words, joints in changed.items()]
        return f": {'; '.join(parts)}" if parts else ""

    def _headline(self) -> str:
        sizes = self.error, *self.spread, self.target, self.was
        error, low, high, target, was = (f"{1e3 * one:#.5g}" for one in sizes)
        interval = f" (95 %: {low} to {high})" if low != high else ""
        unit = f"m{self.unit}"
        line = f"{self.kind}: {error} {unit}{interval} of {target} {unit}"
        line += "" if np.isnan(self.was) else f" (as it is {was} {unit})"
        line += f"; price {self.total:.5g}"
        if self.total <= self.free * (1.0 + cheapest.FITS):
            return line + "; within the target already, nothing is spent for it"
        line += f" (without a target {self.free:.4g})" if self.free else ""
        if self.relief:
            line += f"; a target 1 % wider saves {0.01 * self.target * self.relief:.4g}"
        return line

    def __str__(self) -> str:
        return str(self.table())


def _is_none(value: Any) -> bool:
    return value is None or value != value


_SUMMED = {"added": "before", "adds": "after"}
"""Columns of which there are sums."""


def allocate(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    target: float,
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
    least: float | None = None,
    most: float | None = None,
    force: Sequence[float] = (0.0, 0.0, 0.0),
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
    """The cheapest sizes and bearings with which the tool's error keeps `target` at all poses.

    By play alone: clearances of any size, whose ratio of axial to radial clearance stays, plays of
    gears, and the classes of rolling bearings and the fits of others, together. By several causes:
    the part of each that remains at each joint, and bearings and fits for which there are `offers`.

    Args:
        mechanism: what has no play, and gears with hysteresis, stay unless causes are improved.
        poses: as for `budget`.
        target: largest distance of the tool from where it should be [m].
        turn: the target is the largest angle by which the tool is turned instead [rad].
        causes: as for `budget`; None: play alone.
        statistical: of several causes: the target is of the root mean square, not of the worst
            case.
        quantile: by play alone: the part of states that must keep it, such as 0.99; None: the worst
            case.
        keep: joints and causes that count but stay as they are.
        offers: bearings and fits for joints; of play alone `offers_of` all joints with such that
            are not named, as of a joint with an empty list. Of several causes, a joint's compliance
            goes with its bearing, and is no size of its own. Under `COMPENSATION` a `Correction`
            or several, beside which the result is put: with sizes as given, it leaves the part of
            the play's error at rest that is not known, what friction can hold, and other causes.
        prices: by class of bearing and grade, `PRICES` where not given; of halving a cause, by
            cause, 1 where not given.
        weights: of joints, which multiply the prices of their sizes; 1 where not given.
        limits: part of a cause that remains at least, by cause; `LIMIT` where not given.
        cost: of clearances in mm and plays of gears in arcmin (mm, if they slide), one of `COSTS`.
        least, most: clearances that can be bought, and plays of gears that slide [m]; None:
            `LEAST_M`, `MOST_M`; gears that turn have `LEAST_RAD`, `MOST_RAD`.
        force, errors, kind: of several causes, as for `budget`.
        seed: of the sampled states.
        driven, drive, joint_friction, payloads, loads: as for `budget`.
        progress: show a count of the rounds on standard error, if it takes long.

    Raises:
        JointplayError: a target that cannot be reached, which says what can be, and what prevents
            it; nothing to allocate; values that cannot be; see `budget`.
        MissingName: no such cost, joint, cause or class.
    """
    require_a("mechanism", mechanism, "Mechanism")
    target = require_positive("target", target, "rad" if turn else "m")
    seed = require_whole("seed", seed)
    whole = causes is not None
    prices, weights, limits = dict(prices or {}), dict(weights or {}), dict(limits or {})
    own = named(causes or ())
    _check(mechanism, own if whole else None, keep, prices, weights, limits)
    bought: dict[str, Any] = dict(offers or {})
    corrections: Sequence[Correction] = bought.pop(COMPENSATION, ())
    if quantile is not None:
        require_share("the quantile", quantile)
    given = RobotErrors() if errors is None else errors
    classes = {name: price for name, price in prices.items() if name not in own}
    make: Any = cheapest.RootMeanSquare if statistical else cheapest.WorstCase
    if quantile is not None:
        make = partial(cheapest.Quantile, quantile=quantile, seed=seed)
    holding = {
        "driven": driven, "drive": drive, "joint_friction": joint_friction, "payloads": payloads,
        "loads": loads,
    }  # fmt: skip
    search = _Search(
        mechanism, configurations(mechanism, poses, driven), holding, own if whole else None,
        force, given, kind, turn,
        _offers(mechanism, bought, classes, keep, whole, LEAST_M if least is None else least),
        keep, make,
    )  # fmt: skip
    keys = search.keys
    if not whole and search.first.farthest().size.max() <= NOWHERE * MOST_RAD:
        raise JointplayError(
            f"nothing that has play moves the tool {mechanism.tool!r} at these poses: name another "
            "frame as the tool (--tool), or give an angle as the target"
        )
    if whole:
        weight = [prices.get(cause, 1.0) * weights.get(joint, 1.0) for joint, cause in keys]
        low, ones = [limits.get(cause, LIMIT) for _, cause in keys], np.ones(len(keys))
        search.sizes = Sizes(keys, np.array(weight), np.array(low), ones, ones, COSTS[0])
    else:
        search.sizes = _clearances(mechanism, keys, cost, weights, least, most, quantile)
    if not keys and not search.offers:
        _refuse_nothing(mechanism, whole)
    if quantile is not None and (search.offers or whole):
        raise JointplayError(
            "a quantile is for clearances that can be any, not for classes nor other causes"
        )
    bar = ProgressBar(
        desc="allocating", unit="round", disable=not progress, delay=PATIENCE_S, leave=False
    )
    with bar:
        try:
            found = search.allocated(target, bar, search.notes(prices, limits))
        except cheapest.Unreachable as unreachable:
            left = [one.words for one in search.corrected(corrections, progress)]
            raise JointplayError("; ".join([str(search.refusal(unreachable)), *left])) from None
    return replace(found, corrections=search.corrected(corrections, progress))


@dataclass
class _Search:
    """A machine by what remains of its causes and by its bearings, of which both are sought."""

    mechanism: Mechanism
    q: np.ndarray
    holding: Mapping[str, Any]
    """What holds it, and what it carries, as `budget` takes that."""
    causes: Mapping[str, Cause] | None
    force: Sequence[float]
    errors: RobotErrors
    kind: str | None
    turn: bool
    offers: Mapping[str, Sequence[Offer]]
    keep: Collection[str]
    make: Any
    """The `Error` of a model, its choices and their sizes."""
    sizes: Sizes = field(init=False)

    def __post_init__(self) -> None:
        self.first = self.made({}, {})[1]
        self.keys = tuple(
            dict.fromkeys(
                self.key(one)
                for one in self.first.contributions
                if self._sizable(one) and not {one.joint, one.cause} & {*self.keep}
            )
        )

    def key(self, one: Contribution) -> Key:
        """What is chosen of a contribution: of play alone that of a gear by itself."""
        return (one.name if self.causes is None else one.joint), one.cause

    def _sizable(self, one: Contribution) -> bool:
        if one.gear and self.causes is None:
            gear = self.mechanism.gears[one.joint]
            return 0.0 < gear.unloaded_range == gear.play
        return one.proportional and not self._offered(one)

    def _offered(self, one: Contribution) -> bool:
        return one.joint in self.offers and one.cause in ("play", "elasticity") and not one.gear

    def made(
        self, remaining: Mapping[Key, float], chosen: Mapping[str, Offer]
    ) -> tuple[Mechanism, ErrorModel]:
        joints = {**self.mechanism.clearance, **{name: one.joint for name, one in chosen.items()}}
        if self.causes is not None:
            other = self.mechanism.with_clearance(joints) if chosen else self.mechanism
            driven, payloads = self.holding["driven"], self.holding["payloads"]
            drives = holding_drives(other, self.holding["drive"])
            other, model = cause_model(
                other, self.q, with_force(other, self.force, self.holding["loads"]), self.causes,
                self.errors, self.kind, remaining, driven, None, drives, payloads,
            )  # fmt: skip
            return other, model.turning if self.turn else model
        gears: dict[str, Any] = dict(self.mechanism.gears)
        for (name, _), x in remaining.items():
            if name in joints:
                joints[name] = joints[name].scaled(x)
            else:
                gear = gears[name.removesuffix(GEAR)]
                gears[name.removesuffix(GEAR)] = replace(gear, play=x * gear.play)
        other = self.mechanism.with_clearance(joints, gears)
        model = play_model(other, self.q, driven=self.holding["driven"], loops=True)
        return other, model.turning if self.turn else model

    def corrected(self, offers: Sequence[Correction], progress: bool) -> tuple[Corrected, ...]:
        """What is left of the error at rest by corrected motions, and of causes that are no play.

        Of play what friction holds elsewhere, and the part that is not known of the way to where it
        rests, or of its worst case if joints give way beyond that.

        Raises:
            JointplayError: closed loops, of which no motion is compensated; nothing has play; no
                place of rest was found.
        """
        if not offers:
            return ()
        if self.turn:
            raise JointplayError("what compensation leaves is a distance: give one as the target")
        if self.mechanism.loops:
            raise JointplayError("motions of closed loops are not compensated: leave it out")
        model = self.first
        play = budget(self.mechanism, self.q, force=self.force, **self.holding)
        beside = [k for k, one in enumerate(model.contributions) if one.cause != "play"]
        others = model.subset(beside).farthest().size if beside else np.zeros(len(self.q))
        left = np.zeros((len(offers), len(self.q)))
        poses = ProgressBar(
            range(len(self.q)),
            "places of rest",
            disable=not progress,
            delay=PATIENCE_S,
            leave=False,
        )
        for k in poses:
            rest = play.rest_positions.at(k)
            place = float(np.linalg.norm((rest.whole - rest.sag)[:3]))
            for one, own in zip(offers, left, strict=True):
                unknown = one.play * min(place, play.worst[k])  # what gives way stays
                own[k] = others[k] + play.compensated(k, 0.0, one.friction) + unknown
        if np.isnan(left).any():
            raise JointplayError(
                "no place of rest was found: what compensation leaves is not known"
            )
        before = float(model.farthest().size.max())
        return tuple(
            Corrected(one, float(own.max()), before) for one, own in zip(offers, left, strict=True)
        )

    def error(self, model: ErrorModel, x: np.ndarray) -> Error:
        return self.make(model, self.choice(model), x)  # type: ignore[no-any-return]

    def remaining(self, x: np.ndarray) -> dict[Key, float]:
        return {key: float(part) for key, part in zip(self.keys, x, strict=True) if part != 1.0}

    def with_offers(self, remaining: Mapping[Key, float]) -> tuple[ErrorModel, list[int]]:
        """The error with all bearings that are offered, and which choice each contribution is."""
        counts = [len(own) for own in self.offers.values()]
        first = dict(zip(self.offers, len(self.keys) + np.cumsum([0, *counts]), strict=False))
        models, of = [], []
        for k in range(max(counts, default=1)):
            chosen = {name: own[min(k, len(own) - 1)] for name, own in self.offers.items()}
            _, model = self.made(remaining, chosen)
            kept = []
            for i, (one, size) in enumerate(
                zip(model.contributions, self.choice(model), strict=True)
            ):
                offered = self._offered(one)
                if k < len(self.offers[one.joint]) if offered else k == 0:
                    kept.append(i)
                    of.append(int(first[one.joint]) + k if offered else size)
            models.append(model.subset(kept))
        if len(models) > 1 and models[0].tied:
            raise JointplayError(
                "plays that constrain each other in a closed loop are no sum over joints: choose "
                "the classes by trying (jointplay budget)"
            )
        return ErrorModel.join(models), of

    def _by_key(self, model: ErrorModel, parts: np.ndarray) -> dict[Key, float]:
        found = dict[Key, float]()
        for one, part in zip(model.contributions, parts, strict=True):
            found[self.key(one)] = found.get(self.key(one), 0.0) + float(part)
        return found

    def choice(self, model: ErrorModel) -> list[int]:
        """Which of the sizes each contribution is, -1 for none."""
        place = {key: i for i, key in enumerate(self.keys)}
        return [
            place.get(self.key(one), -1) if one.proportional else -1 for one in model.contributions
        ]

    def allocated(self, target: float, bar: Any, notes: Sequence[str]) -> Allocation:
        """Allocate, again with the play as it is at each solution until both agree."""
        keys, sizes, count = self.keys, self.sizes, len(self.keys)
        x, aim = np.ones(count), target * (1.0 - cheapest.FITS)
        curved = any(cause == "play" for _, cause in keys)
        offers = list(self.offers.values())
        start = last = self.error(self.first, x)
        for _ in range(_RENEWALS):
            before, error = x, last
            if offers:
                now = np.append(x, np.ones(sum(map(len, offers))))
                error = self.make(*self.with_offers(self.remaining(x)), now)
            own = [np.array([one.price for one in some]) for some in offers]
            problem = Problem(error, sizes, own, aim, bar)
            try:
                z = problem.solve()
            except cheapest.Unreachable as refused:
                least = refused.z[:count]
                if not curved or np.allclose(x, least, rtol=_SETTLED):
                    raise
                x = least  # where plays may be smaller than in proportion
                last = self.error(self.made(self.remaining(x), {})[1], x)
                continue
            x = z[:count]
            picked = zip(self.offers.items(), problem.chosen(z), strict=True)
            taken = {name: some[k] for (name, some), k in picked}
            mechanism, model = self.made(self.remaining(x), taken)
            if isinstance(error, cheapest.Quantile):  # its states stay, in the first order
                reached, ends = cheapest.spread(model, error.quantile, error.seed)
            else:
                last = self.error(model, x)
                reached = last.at(x) if last.convex else float(model.farthest().size.max())
                ends = reached, reached
            left = _USED if error.convex else _USED_ROUGH
            moved = np.abs(x / before - 1.0).max(initial=0.0)
            settled = not curved or not error.convex or moved < _SETTLED
            used = reached >= target * (1.0 - left) or "target" not in sizes.held(x)
            if settled and used and reached <= target:
                break
            if settled:
                aim *= target / reached * (1.0 - 0.5 * left)
        else:
            raise JointplayError(
                f"the allocation did not settle within {100 * abs(reached / target - 1.0):.2g} % "
                "of the target; keep play, or allocate clearances first"
            )
        whole = self.causes is not None
        free = problem.price(problem.free()) - (sizes.prices(sizes.most).sum() if whole else 0.0)
        choices = tuple(self._choices(problem, z, taken, start, last))
        was = start.at(np.ones(count)) if whole else np.nan
        return Allocation(
            target, "rad" if self.turn else "m", self._words(last), choices, was, reached, ends,
            float(free), problem.relief, mechanism, tuple(notes),
        )  # fmt: skip

    def _choices(
        self, problem: Problem, z: np.ndarray, taken: Mapping[str, Offer], start: Error, last: Error
    ) -> Iterator[Choice]:
        """By joint and cause; `start` and `last` are the error as it was and is."""
        sizes, whole, count = self.sizes, self.causes is not None, len(self.keys)
        x, ones = z[:count], np.ones(count)
        before = self._by_key(start.model, start.parts(ones)) if whole else {}
        after = self._by_key(last.model, last.parts(x))
        held, slopes, gains = sizes.held(x), sizes.slopes(x), problem.gains(z)
        paid = sizes.prices(x) - (sizes.prices(sizes.most) if whole else 0.0)
        worth = start.slopes(ones) / sizes.weight
        bought = [int(k) for k in np.argsort(-worth) if held[k] != "most"]
        place = {key: k for k, key in enumerate(self.keys)}
        of_joints = dict.fromkeys((name, "play") for name in self.mechanism.clearance)
        rows = [*before, *(key for key in of_joints if key[0] in taken and key not in before)]
        if not whole:
            of_joints |= dict.fromkeys((name + GEAR, "play") for name in self.mechanism.gears)
            rows = [key for key in of_joints if key in place or key[0] in taken]
        for key in rows:
            k, offer = place.get(key), taken.get(key[0]) if key[1] == "play" else None
            adds, cost = after.get(key, 0.0), 0.0 if offer is None else offer.price
            part, size, play, gain, saved, order = 1.0, np.nan, np.nan, np.nan, np.nan, 0
            how = "kept" if offer is None else "fit" if offer.instead else "class"
            if k is not None:
                how, cost = held[k], cost + float(paid[k])
                gear = self.mechanism.gears.get(key[0].removesuffix(GEAR))
                if key[1] == "play" and is_proportional(self.mechanism, key[0]):
                    size = self.mechanism.clearance[key[0]].radial_travel * x[k]
                elif not whole and gear is not None:
                    size = gear.play * x[k]
                if whole:
                    how, part = {"least": "limit", "most": "as is"}.get(how, how), float(x[k])
                    order = bought.index(k) + 1 if k in bought else 0
                else:
                    now = size / x[k]
                    gain, saved = gains[k] / now, -1e-6 * slopes[k] / now
                    adds = gain * size
                    if key[0].endswith(GEAR) and self._turns(key[0]):
                        play, size, saved = size, np.nan, saved * 1e6 * _ARCMIN
            had = before.get(key, 0.0) if whole else np.nan
            yield Choice(*key, part, size, play, offer, had, adds, gain, cost, saved, how, order)

    def _turns(self, gear: str) -> bool:
        return not self.mechanism.description.joints[gear.removesuffix(GEAR)].slides

    @staticmethod
    def _words(error: Error) -> str:
        if isinstance(error, cheapest.Quantile):
            return f"static {100 * error.quantile:g} % quantile, of {cheapest.SAMPLES} states"
        if isinstance(error, cheapest.RootMeanSquare):
            return "RMS"
        return "static worst case"

    def notes(self, prices: Collection[str], limits: Collection[str]) -> list[str]:
        """What was given and assumed of causes, prices and limits, and which plays stay."""
        if self.causes is None:
            arcmin = any(name.endswith(GEAR) and self._turns(name) for name, _ in self.keys)
            units = " and plays in arcmin" if arcmin else ""
            return [f"price of clearances in mm{units}: {self.sizes.cost}"] if self.keys else []
        given, assumed = told_apart(self.first)
        notes = [*(f"given: {one}" for one in given), *(f"assumed: {one}" for one in assumed)]
        causes = list(dict.fromkeys(cause for _, cause in self.keys))
        if unpriced := [cause for cause in causes if cause not in prices]:
            notes.append(
                f"assumed: prices: halving costs 1 at each joint, of {', '.join(unpriced)} "
                "(--price CAUSE=X, --weight JOINT=X)"
            )
        if unlimited := [cause for cause in causes if cause not in limits]:
            notes.append(
                f"assumed: limits: at least {LIMIT:g} remains, of {', '.join(unlimited)} "
                "(--limit CAUSE=X)"
            )
        every = self.first.contributions
        kept = [one for one in every if not one.proportional and one.joint not in self.offers]
        for noun, fitted in (("bearings", False), ("fits", True)):
            if names := [one.joint for one in kept if (one.fit is not None) == fitted]:
                notes.append(
                    f"kept: the play of the {noun} of {', '.join(names)}, which is not "
                    "proportional to their clearance: allocate by class (--by-class) chooses theirs"
                )
        return notes

    def refusal(self, unreachable: cheapest.Unreachable) -> JointplayError:
        """What prevents a target."""
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
            bought = [one for some in self.offers.values() for one in some]
            kinds = dict.fromkeys("fits" if one.instead else "bearings" for one in bought)
            means += [f"the tightest {' and '.join(kinds)} offered"] if kinds else []
            return JointplayError(f"{text}: with {' and '.join(means)} {error}")
        x = unreachable.z[:count]
        _, model = self.made(self.remaining(x), {})
        parts = self._by_key(model, self.error(model, x).parts(x))
        sums = dict[str, float]()
        for (_, cause), part in parts.items():
            sums[cause] = sums.get(cause, 0.0) + part
        kept = {cause for joint, cause in parts if (joint, cause) not in self.keys}
        kept |= {one.cause for one in model.contributions if not one.proportional}
        limit = {cause: low for (_, cause), low in zip(self.keys, sizes.least, strict=True)}
        words = []
        for cause, part in sorted(sums.items(), key=lambda one: -one[1])[:3]:
            why = [f"at least {limit[cause]:g} of it remains"] if cause in limit else []
            why += ["kept"] if cause in kept else []
            words.append(f"{cause} {readable(part, unit, 4)} ({' and '.join(why)})")
        error += f", most of it by {'; then '.join(words)}"
        return JointplayError(f"{text}: with all causes at their limits {error}")


# What is refused.


def _offers(
    mechanism: Mechanism,
    given: Mapping[str, Sequence[Offer]] | None,
    prices: Mapping[str, float],
    keep: Collection[str],
    whole: bool,
    least: float,
) -> dict[str, tuple[Offer, ...]]:
    own = {name: one for name, one in mechanism.clearance.items() if is_bought(one)}
    for name in given or {}:
        require_known("joint with a rolling bearing or a fit", name, own)
    names = [name for name in own if name not in keep and (not whole or name in (given or {}))]
    if prices and not names and not whole:
        raise JointplayError(
            f"prices of {', '.join(prices)} are for classes of rolling bearings and fits, and no "
            "joint has one; clearances have a cost and weights"
        )
    return {n: tuple((given or {}).get(n, ())) or offers_of(own[n], prices, least) for n in names}


def _clearances(
    mechanism: Mechanism,
    keys: tuple[Key, ...],
    cost: str,
    weights: Mapping[str, float],
    least: float | None,
    most: float | None,
    quantile: float | None,
) -> Sizes:
    require_known("cost", cost, COSTS)
    if quantile is not None and cost == "linear":
        raise JointplayError(
            "the cost 'linear' is possible for the worst case only, because a quantile is not "
            "convex; use " + " or ".join(COSTS[:2])
        )
    names = [name for name, _ in keys]
    joints = [name.removesuffix(GEAR) for name in names]
    for name in weights:
        require_known("joint with clearance", name, joints)
    geared = [name.endswith(GEAR) for name in names]
    entries = mechanism.description.joints
    turns = np.array([own and not entries[n].slides for n, own in zip(joints, geared, strict=True)])
    if turns.all() and len(keys) and not (least is None and most is None):
        raise JointplayError("least and most are of clearances, and there are plays of gears only")
    most = require_positive("the most clearance", MOST_M if most is None else most, "m")
    low = require_positive("least clearance", LEAST_M if least is None else least, "m")
    if low >= most:
        raise JointplayError(
            f"the least clearance {readable(low, 'm')} must be below the most, "
            f"{readable(most, 'm')}"
        )
    own = np.array([
        mechanism.gears[name].play if gear else mechanism.clearance[name].radial_travel
        for name, gear in zip(joints, geared, strict=True)
    ])  # fmt: skip
    weight = np.array([weights.get(name, 1.0) for name in joints])
    ends = np.where(turns, LEAST_RAD, low) / own, np.where(turns, MOST_RAD, most) / own
    return Sizes(keys, weight, *ends, own / np.where(turns, _ARCMIN, 1.0 / _MM), cost)


def _check(
    mechanism: Mechanism,
    causes: Mapping[str, Cause] | None,
    keep: Collection[str],
    prices: Mapping[str, float],
    weights: Mapping[str, float],
    limits: Mapping[str, float],
) -> None:
    joints = [*mechanism.joints, *mechanism.mounts, *mechanism.loops]
    known = [*CAUSES, *(causes or {})]
    if causes is None and limits:
        raise JointplayError("limits are of causes: give these, too, or least and most clearances")
    for name in keep:
        if name not in (*known, *joints):
            raise MissingName("cause of errors", name, known, " (nor is it a joint)")
    own_prices = prices if causes is not None else {n: x for n, x in prices.items() if n in known}
    for noun, kind, own, names in (
        ("limit", "cause of errors", limits, known),
        ("price", "cause of errors", own_prices, [*known, *PRICES]),
        ("weight", "joint with clearance", weights, joints),
    ):
        for name, value in own.items():
            if name not in names:
                raise MissingName(kind, name, known if noun == "price" else names)
            if noun != "price" or name in known:
                require_positive(f"{noun} of {name!r}", value, "")
            if noun == "limit" and value > 1.0:
                raise JointplayError(
                    f"limit of {name!r}: a part of at most 1 remains, got {value:g}"
                )


def _refuse_nothing(mechanism: Mechanism, whole: bool) -> None:
    if whole:
        raise JointplayError("no cause is left that may be improved: keep fewer")
    for name, joint in mechanism.clearance.items():
        if not joint.clearances:
            raise JointplayError(f"joint {name!r} is {joint.kind}: it has no clearance to allocate")
    raise JointplayError("no joint or gear has play to allocate")
