"""Causes of a tool's error, one class each: the displacements that each brings about at a joint.

Besides its play, an arm deflects under its weight, its payload and a force; encoders have a
resolution and a zero offset, gears a transmission error; axes are not where the drawing has them,
and links grow with heat. Numbers that nobody gave are taken from a class of robots
(`robot_errors`), and reported as assumed.

For a cause of your own write a class like these, in any file, and give an object of it to `budget`
or `allocate` among their `causes`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jointplay.accuracy.error_model import (
    Box,
    Contribution,
    ErrorModel,
    Line,
    play_of_gear,
    play_of_joint,
)
from jointplay.accuracy.jacobians import LINK, carrying, jacobians
from jointplay.accuracy.rest import deflected, held, standing_joints
from jointplay.accuracy.robot_errors import (
    CLASSES,
    ERROR_CLASSES,
    JointErrors,
    RobotErrors,
    refuse_misfit,
)
from jointplay.base.errors import JointplayError, MissingName, require_known, require_positive
from jointplay.model.closed_loops import ClosedLoops
from jointplay.model.design import parse
from jointplay.model.gear_rules import SPREAD, Rule, rated_efforts, stiffness_rule
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, Servo

GIVEN = "given"
"""Origin of the numbers that the user gave of this robot."""
RULED = f"gears' stiffness by rule, to a factor of {SPREAD:g}"
"""Note on an answer in which stiffnesses are those of `gear_rules`."""

_TURNING = ("encoder", "zero_offset", "gear_error")
"""Numbers that robots and their classes have for joints that turn, in rad."""
_PINION = 0.01
"""Radius of the pinion that turns a class's angles into the lengths of a slider [m]."""


@dataclass(frozen=True)
class JointAt:
    """A joint at n poses, as a cause sees it."""

    mechanism: Mechanism
    name: str
    load: np.ndarray
    """Load on the joint at rest, about its centre in its axes, (n, 6) [N, N m]."""
    stands: bool
    """Whether a drive and an encoder hold it; joints of closed loops may follow others instead."""
    errors: RobotErrors
    kind: str | None
    """Class of robots, of `ERROR_CLASSES`, from which numbers that nobody gave are taken."""
    stiffness: Rule | None = None
    """Stiffness of its gear by a rule, if nobody gave it."""
    sag: np.ndarray | None = None
    """Deflection of its drive, (n,) [rad or m]; None: none."""
    dead_band: float = 0.0
    """Dead band of its drive [rad or m]."""
    regulated: bool = False
    """Whether its encoder sees the link, which its drive then holds whatever its gear does."""

    @property
    def mount(self) -> bool:
        """Whether it is a mount: a joint that cannot move but deflects."""
        return self.name in self.mechanism.mounts

    @property
    def slides(self) -> bool:
        if self.name in self.mechanism.loops:
            return self.mechanism.loop_class(self.name).slides()
        return not self.mount and self.mechanism.description.joints[self.name].slides

    @property
    def about(self) -> int:
        """Component of a displacement along or about z, the joint's axis: that of its drive."""
        return 2 if self.slides else 5

    @property
    def unit(self) -> str:
        return "m" if self.slides else "rad"

    def driven(self, size: float) -> tuple[float, ...]:
        """A displacement of this size along or about the joint's axis, six numbers [m, rad]."""
        return tuple(size if k == self.about else 0.0 for k in range(6))

    def size(self, key: str, origins: dict[str, str], form: str, times: float = 1.0) -> float:
        """A number of the joint's errors, or else of the robot's, or else of its class.

        `origins` gets an entry: the text that `form` makes of the number, multiplied by `times`,
        and the number's origin.

        Raises:
            JointplayError: nobody gave it, and no class is named.
        """
        value = getattr(self.errors.joints.get(self.name), key, None)
        turns = self.slides and key in _TURNING
        if value is None and not turns:
            value = getattr(self.errors, key)
        origin = GIVEN
        if value is None:
            if self.kind is None:
                raise JointplayError(
                    f"nobody gave the {key.replace('_', ' ')} of joint {self.name!r}: name a class "
                    "of robots, from which all such numbers are taken (--whole CLASS, or assumed "
                    f"in [errors]): {', '.join(CLASSES)}"
                )
            origin = f"class {self.kind!r}"
            value = getattr(ERROR_CLASSES[self.kind], key) * (_PINION if turns else 1.0)
        origins[form.format(times * value)] = origin
        return float(value)


class Cause(ABC):
    """A cause of the tool's error, which displaces joints."""

    name: ClassVar[str]
    """Name in tables and options."""
    of_mounts: ClassVar[bool] = False
    """Whether it acts at mounts, too, which cannot move but deflect."""

    @abstractmethod
    def at(self, joint: JointAt) -> Iterable[Contribution]:
        """The displacements that it causes at a joint; none where it has no effect."""


class ClearanceAndBacklash(Cause):
    """The clearances of joints, and the backlash of gears."""

    name = "play"

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        if joint.name in joint.mechanism.clearance:
            yield play_of_joint(joint.mechanism, joint.name)
        if joint.name in joint.mechanism.gears:
            yield play_of_gear(joint.mechanism, joint.name)


class Compliance(Cause):
    """Bearings, gears, links and mounts deflect under weight, payload and force."""

    name = "elasticity"
    of_mounts = True

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        bearing = joint.mechanism.clearance.get(joint.name)
        carried, origins = joint.load.copy(), dict[str, str]()
        if not joint.mount:  # the drive carries the rest
            carried[:, joint.about] = 0.0
        shift, sources = self._of_bearing(bearing, carried)
        joint_errors = joint.errors.joints.get(joint.name, JointErrors())
        if joint_errors.elasticity is not None:
            shift += joint_errors.elasticity.displacements(carried)
            origins[joint_errors.elasticity.summary] = GIVEN
        elif bearing is None:
            stiffness = joint.size("tilt_stiffness", origins, "{:g} N m/rad in tilt")
            shift[:, 3:5] += carried[:, 3:5] / stiffness
        yield self._shifted(joint, shift, origins, sources)
        if joint.stands and not joint.regulated:
            yield self._of_gear(joint)

    def _of_gear(self, joint: JointAt) -> Contribution:
        """Deflection of gear and shaft, about or along the joint's own axis.

        Its stiffness is the first that is known of: the joint's own, the robot's (of joints that
        turn without a gear), the gear's curve, a rule.
        """
        along, origins, load = joint.about, dict[str, str](), joint.load[:, joint.about]
        shift, gear = np.zeros_like(joint.load), joint.mechanism.gears.get(joint.name)
        unit = "N/m along the axis" if joint.slides else "N m/rad in torsion"
        joint_errors = joint.errors.joints.get(joint.name)
        stated = joint_errors and joint_errors.torsional_stiffness
        if stated is None and gear is None and not joint.slides:
            stated = joint.errors.torsional_stiffness
        if stated is not None:
            shift[:, along] = load / stated
            origins[f"{stated:g} {unit}"] = GIVEN
            return self._shifted(joint, shift, origins)
        rule = joint.stiffness
        if gear is not None:
            shift[:, along] = np.sign(load) * gear.curve().depth(np.abs(load))
        elif rule is not None:
            shift[:, along] = load / rule.value
        if rule is None:
            return self._shifted(joint, shift, origins, ["its gear"])
        origins[f"{rule.value:.3g} {unit}"] = f"by rule, {rule.reason}, to a factor of {SPREAD:g}"
        return Contribution(joint.name, self.name, None, shift, SPREAD - 1.0, numbers=origins)

    def _shifted(
        self,
        joint: JointAt,
        shift: np.ndarray,
        origins: dict[str, str],
        sources: Sequence[str] = (),
    ) -> Contribution:
        """A deflection of which stiffnesses are uncertain by the robot's `stiffness_spread`."""
        spread = 0.0
        if shift.any():
            spread = joint.size("stiffness_spread", origins, "either way {:g} %", 100.0)
        origin = ", ".join(sources)
        return Contribution(joint.name, self.name, None, shift, spread, origin, origins)

    def _of_bearing(
        self, bearing: Clearance | None, carried: np.ndarray
    ) -> tuple[np.ndarray, list[str]]:
        """Deflection of a bearing beyond its play under loads (n, 6), and its origin in words."""
        if bearing is None:
            return np.zeros_like(carried), []
        if bearing.springs is not None:
            return bearing.springs.displacements(carried), ["its springs"]
        play = bearing.play(second_order=False)
        point = play.support(carried).point
        pressed = play.pressed(carried, point)
        if pressed is None:
            return np.zeros_like(carried), []
        source = "its bearing" if isinstance(bearing, RollingBearing) else "its contacts"
        return deflected(bearing, carried, point, pressed) - point, [source]


class Sag(Cause):
    """Drives give way: servos to their whole load, computed torque to loads it does not know."""

    name = "sag"

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        if joint.sag is None or not joint.stands:
            return
        shift = np.zeros_like(joint.load)
        shift[:, joint.about] = joint.sag
        band = Line(joint.driven(joint.dead_band)) if joint.dead_band else None
        yield Contribution(joint.name, self.name, band, shift, origin="its drive")


class Encoder(Cause):
    """An encoder's resolution, half a step to either side, and its zero offset."""

    name = "encoder"

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        parts = {"encoder": (0.5, "resolution"), "zero_offset": (1.0, "zero offset")}
        if not joint.stands:
            return
        for key, (part, word) in parts.items():
            origins = dict[str, str]()
            size = joint.size(key, origins, f"{word} {{:.4g}} {joint.unit}")
            box = Box(joint.driven(part * size))
            yield Contribution(joint.name, self.name, box, numbers=origins)


class GearError(Cause):
    """Transmission error of a gear: its output deviates by a wave of unknown phase."""

    name = "gear error"

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        origins = dict[str, str]()
        if joint.regulated or not joint.stands:
            return
        gear = joint.mechanism.gears.get(joint.name)
        stated = getattr(joint.errors.joints.get(joint.name), "gear_error", None)
        if gear is not None and gear.error_terms and stated is None:
            size, source = sum(abs(amplitude) for _, amplitude, _ in gear.error_terms), "its gear"
        else:
            size = joint.size("gear_error", origins, f"amplitude {{:.4g}} {joint.unit}")
            source = ""
        wave = Line(joint.driven(size), wave=True)
        yield Contribution(joint.name, self.name, wave, origin=source, numbers=origins)


class Geometry(Cause):
    """The joint's axis is displaced and tilted against the drawing."""

    name = "geometry"

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        origins = dict[str, str]()
        offset = joint.size("axis_offset", origins, "offset {:.4g} m")
        tilt = joint.size("axis_tilt", origins, "tilt {:.4g} rad")
        box = Box((offset, offset, offset, tilt, tilt, 0.0))
        yield Contribution(joint.name, self.name, box, numbers=origins)


class Heat(Cause):
    """Links grow as they become warmer, by anything from none to all of the largest growth."""

    name = "heat"

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        origins = dict[str, str]()
        heating = joint.size("heating", origins, "up to {:g} K")
        expansion = joint.size("expansion", origins, "{:.3g} µm/(m K)", 1e6)
        if joint.name not in joint.mechanism.loops:
            shift = np.zeros_like(joint.load)
            shift[:, 0] = 0.5 * heating * expansion  # half the growth, uncertain by all of that
            yield Contribution(joint.name, self.name, None, shift, 1.0, numbers=origins, part=LINK)


ALL: dict[str, Cause] = {
    cause.name: cause
    for cause in (
        *(ClearanceAndBacklash(), Compliance(), Sag(), Encoder()),
        *(GearError(), Geometry(), Heat()),
    )
}
"""The built-in causes by name, in the order of tables."""
CAUSES = tuple(ALL)
"""Names of the built-in causes."""


def named(causes: Collection[str | Cause]) -> dict[str, Cause]:
    """Causes by name: the built-in ones in the order of `ALL`, then the user's own."""
    custom = {cause.name: cause for cause in causes if isinstance(cause, Cause)}
    for cause in causes:
        if isinstance(cause, str) and cause not in ALL:
            raise MissingName("cause of errors", cause, [*CAUSES, *custom])
    return {**{name: cause for name, cause in ALL.items() if name in causes}, **custom}


def cause_model(
    mechanism: Mechanism,
    q: np.ndarray,
    loads: Mapping[str, Load],
    causes: Mapping[str, Cause],
    errors: RobotErrors,
    kind: str | None,
    remaining: Mapping[tuple[str, str], float],
    driven: Sequence[str] | None,
    relative_to: str | None,
    drives: Mapping[str, Drive],
    payloads: Sequence[Payload],
) -> tuple[Mechanism, ErrorModel]:
    """The error by causes at configurations q (n, nq), and the mechanism with what remains of play.

    `drives` are those of all joints; the other arguments are those of `budget`.
    """
    kind = kind or errors.assumed
    if kind is not None:
        require_known("class of errors", kind, CLASSES)
    refuse_misfit(errors, mechanism)
    parts = _checked(mechanism, remaining, causes)
    smaller = {
        name: mechanism.clearance[name].scaled(part)
        for (name, cause), part in parts.items()
        if cause == "play" and is_proportional(mechanism, name)
    }
    if smaller:
        mechanism = mechanism.with_clearance({**mechanism.clearance, **smaller})
    names = [*mechanism.joints, *mechanism.mounts, *mechanism.loops]
    laden = carrying(mechanism, payloads)
    effects = jacobians(laden, q, names, loads, driven, relative_to)
    follows = set[str]()
    if mechanism.loops:
        passive = ClosedLoops(mechanism, q[0], driven).passive
        follows = {mechanism.coordinates[i].joint for i in passive} | {*mechanism.loops}
    sags = {}
    if Sag.name in causes:
        borne = dict(zip(names, effects.load, strict=True))
        sags = _sags(laden, q, drives, driven, borne, bool(payloads or loads))
    stiffness = _stiffnesses(mechanism) if Compliance.name in causes else {}
    contributions: list[Contribution] = []
    for k, name in enumerate(names):
        if effects.tool[k].any() or effects.tie[k].any():
            sag, dead_band = sags.get(name, (None, 0.0))
            at = JointAt(
                mechanism, name, effects.load[k], name not in follows, errors, kind,
                stiffness.get(name), sag, dead_band,
                getattr(drives.get(name), "encoder", "") == "link",
            )  # fmt: skip
            for cause in causes.values():
                if cause.of_mounts or not at.mount:
                    contributions += cause.at(at)
    counted = [c for c in contributions if _counts(c)]
    if not counted:
        raise JointplayError("nothing moves the tool, or no cause is counted")
    # Clearances have been made smaller in the mechanism already.
    scale = [
        1.0 if c.cause == "play" and not c.gear else parts.get((c.joint, c.cause), 1.0)
        for c in counted
    ]
    return mechanism, ErrorModel.of(counted, names, effects, scale)


def _stiffnesses(mechanism: Mechanism) -> dict[str, Rule]:
    """Stiffnesses by `gear_rules`, of gears that nobody gave one and of joints without a gear."""
    entries = mechanism.description.joints
    rules = mechanism.rules.items()
    ruled = {name: rule for (name, quantity), rule in rules if quantity == "stiffness"}
    needed = [n for n in mechanism.joints if n not in mechanism.gears and n in entries]
    if not needed:
        return ruled
    efforts = rated_efforts(mechanism.description, parse(mechanism.description), mechanism.tool)
    return ruled | {name: stiffness_rule(name, entries[name], efforts) for name in needed}


def _sags(
    mechanism: Mechanism,
    q: np.ndarray,
    drives: Mapping[str, Drive],
    driven: Sequence[str] | None,
    loads: Mapping[str, np.ndarray],
    carries: bool,
) -> dict[str, tuple[np.ndarray, float]]:
    """Deflections of drives at configurations q (n, nq), and their dead bands, by joint.

    Raises:
        JointplayError: a servo that cannot hold its joint.
    """
    holding = {name: drives[name] for name in standing_joints(mechanism, q[0], driven)}
    names = list(holding)
    if not carries:  # computed torque balances the machine that it knows without an error
        names = [name for name in names if isinstance(drives[name], Servo)]
    sags = {name: np.zeros(len(q)) for name in names}
    bands = dict.fromkeys(names, 0.0)
    for i, row in enumerate(q if names else ()):
        balance = held(mechanism, row, holding, {})
        for name in names:
            at = mechanism.motor(name)
            if getattr(drives[name], "encoder", "") == "link":
                at = mechanism.coordinate(name)
            effort = float(loads[name][i, mechanism.description.joints[name].component])
            sags[name][i], bands[name] = balance.gives_way(at, effort)
    for name, sag in sags.items():
        if not np.isfinite(sag).all():
            several = f" at {np.sum(~np.isfinite(sag))} of {len(q)} poses" if len(q) > 1 else ""
            unit = "N" if mechanism.description.joints[name].slides else "N m"
            most = np.abs(loads[name][:, mechanism.description.joints[name].component]).max()
            raise JointplayError(
                f"the servo of joint {name!r} cannot hold what it bears{several}, {most:.3g} {unit}"
            )
    return {name: (sags[name], bands[name]) for name in names}


def _counts(contribution: Contribution) -> bool:
    """Whether a contribution is listed: all but play and shifts that are zero."""
    region, shift = contribution.set, contribution.shift
    if contribution.cause == "play":
        return region is not None and max(region.reach) > 0.0
    return region is not None or (shift is not None and bool(shift.any()))


def is_proportional(mechanism: Mechanism, joint: str) -> bool:
    """Whether a joint has a clearance to which its play is proportional, to first order.

    The play of a rolling bearing along its axis and in tilt grows with the root of its clearance.
    """
    return joint in mechanism.clearance and play_of_joint(mechanism, joint).proportional


def _checked(
    mechanism: Mechanism, remaining: Mapping[tuple[str, str], float], causes: Mapping[str, Cause]
) -> dict[tuple[str, str], float]:
    """The parts that remain by joint and cause, each refused unless it can be chosen."""
    known = [*mechanism.joints, *mechanism.mounts, *mechanism.loops]
    parts = {}
    for (name, cause), part in remaining.items():
        require_known("joint", name, known)
        require_known("cause of errors", cause, [*CAUSES, *causes])
        parts[name, cause] = require_positive(f"part of {cause} of {name!r} that remains", part, "")
        if cause == "play" and not is_proportional(mechanism, name):
            joint = mechanism.clearance.get(name)
            if joint is not None and max(joint.play().reach) > 0.0 and name not in mechanism.gears:
                raise JointplayError(
                    f"the play of joint {name!r} ({joint.kind}) is not proportional to its "
                    "clearance; give the joint another class of bearing, or another fit"
                )
    return parts


def given_and_assumed(model: ErrorModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The numbers of a robot that were given, and those that were assumed, as lines of text."""
    lines: dict[tuple[str, str, str], list[str]] = {}
    for contribution in model.contributions:
        for origin, texts in contribution.by_origin.items():
            lines.setdefault((origin, contribution.cause, texts), []).append(contribution.joint)
    count = len({c.joint for c in model.contributions})
    given, assumed = [], []
    for (origin, cause, texts), names in lines.items():
        whose = "all joints" if len({*names}) == count else ", ".join(dict.fromkeys(names))
        if origin == GIVEN:
            given.append(f"{cause}: {texts} ({whose})")
        elif origin.startswith("class"):
            assumed.append(f"{cause}: {texts} ({origin})")
        else:
            assumed.append(f"{cause}: {texts} ({whose}; {origin})")
    return tuple(given), tuple(assumed)
