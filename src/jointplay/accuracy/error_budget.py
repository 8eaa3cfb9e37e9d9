"""Error budgets: how far off the tool can be at many poses, and by which joint and which cause.

A budget is static: sets and variances are summed (`error_model`). `PlayBudget` is of play alone,
and has where the machine rests; `ErrorBudget` is of several causes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import overload

import numpy as np

from jointplay.accuracy.causes import GIVEN, RULED, Cause, cause_model, given_and_assumed, named
from jointplay.accuracy.cures import Cure, cures
from jointplay.accuracy.error_model import (
    ErrorModel,
    Farthest,
    States,
    covering,
    half_sphere,
    play_model,
)
from jointplay.accuracy.jacobians import (
    carrying,
    check_body,
    configurations,
    displaced,
    taken_up,
    tool_place,
    with_force,
)
from jointplay.accuracy.poses import poses_of
from jointplay.accuracy.rest import AGREES_M, RestPositions
from jointplay.accuracy.robot_errors import RobotErrors
from jointplay.base.errors import JointplayError, require_a, require_finite, require_known
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Answer, Column, Table, few
from jointplay.base.units import readable
from jointplay.model.closed_loops import NOWHERE, ClosedLoops, turns_in_place
from jointplay.model.mechanism import Mechanism, frame_index
from jointplay.model.payload import Payload
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import (
    ComputedTorque,
    Drive,
    JointFriction,
    Servo,
    urdf_friction,
)

LISTED = 2e-3
"""Part of the error below which a cause has no line of its own: less than a rounded percent."""
_ON_ARCS = 0.02
"""Part of the worst case by which the exact kinematics may differ without a note: two of its three
digits then still hold (judged)."""
_MENTIONED = 0.01
"""Smallest part of the error at rest for which a cause is named."""
_DECIDES = 0.5
"""Part of the error at rest from which on friction is said to determine it, if friction can shift
the tool so far."""
_LOOPS_AGREE = 0.25
"""Largest distance, relative to the error, between the tool of loops closed exactly and that of the
first order: it is larger near singular positions only, where the first order is void (judged)."""
AXES = ("x", "y", "z", "about x", "about y", "about z")
"""Components of the tool's error, in world axes [m, rad]."""


@dataclass(frozen=True, repr=False)
class Budget(Answer):
    """The error of the tool at n poses by k contributions; lengths in m, angles in rad.

    `worst` is a bound that can be reached: no state of the contributions is worse, up to the second
    order.
    """

    unit = "m"
    """``m``, or ``rad`` of a budget of the angles by which the tool is turned."""
    mechanism: Mechanism
    q: np.ndarray
    """Configurations, (n, nq)."""
    model: ErrorModel
    force: np.ndarray
    """Force on the tool, world axes, (3,) [N]."""
    driven: Sequence[str] | None
    """Joints of loops that stand; None: the first that determine the others."""
    relative_to: str | None
    """Body from which the tool is seen; None: the world."""
    positions: np.ndarray
    """Positions of the ideal tool, shape (n, 3)."""
    farthest: Farthest
    """The worst case at each pose."""

    @property
    def tool(self) -> str:
        return self.mechanism.tool

    @property
    def worst(self) -> np.ndarray:
        """Largest distance of the tool from the ideal one, shape (n,)."""
        return self.farthest.size

    @property
    def direction(self) -> np.ndarray:
        """Direction of the worst error, unit vectors in world axes, shape (n, 3)."""
        return self.farthest.direction

    @property
    def worst_parts(self) -> np.ndarray:
        """Share of each contribution in `worst`, shape (n, k)."""
        return self.farthest.parts.T

    @property
    def turns(self) -> Farthest:
        """Largest rotation of the tool at each pose."""
        return self.model.turned if self.unit == "m" else self.farthest

    @property
    def worst_turn(self) -> np.ndarray:
        """Largest rotation of the tool, shape (n,)."""
        return self.turns.size

    @property
    def components(self) -> slice:
        """The components of an error (6,) that the budget is of: displacement or rotation."""
        return slice(0, 3) if self.unit == "m" else slice(3, 6)

    @cached_property
    def axis_worst(self) -> np.ndarray:
        """Largest error along and about each world axis, by contribution, shape (n, k, 6)."""
        turned = self.components.start > 0
        ways_and_turns = [self.model.values(np.eye(3), turn) for turn in (turned, not turned)]
        return np.concatenate(ways_and_turns, axis=2).transpose(1, 0, 2)

    @property
    def worst_pose(self) -> int:
        return int(self.worst.argmax())


@dataclass(frozen=True, repr=False)
class PlayBudget(Budget):
    """The error of the tool by play alone, of j joints and gears.

    No state of the journals without penetration is worse than `worst`, which has the loosest parts
    that fits allow. `rms` is that of states without friction. The machine's position of rest, with
    fits in the middle of their tolerances, is computed when it is asked for (`rest`,
    `rest_interval`); contacts deflect there, so that it may lie a little beyond `worst`.
    """

    rest_positions: RestPositions
    second_order: np.ndarray
    """The most that rotations can add to `worst` in the second order, shape (n,) [m].

    With closed loops it is no bound, but the distance between the tool of the first order and that
    of loops closed exactly with the journals of `worst`.
    """
    rms: np.ndarray
    """RMS distance under a load on the tool of random direction that exceeds all others, (n,).

    The sizes of fits are random, too.
    """
    rms_parts: np.ndarray
    """Share of each joint in `rms`: its mean part along the error, shape (n, j)."""
    unit: str = "m"
    """``rad`` of an output that turns about its origin, such as a rocker on its pivot: then worst
    cases, RMS and the joints' shares in them are angles."""

    @property
    def joints(self) -> tuple[str, ...]:
        return self.model.names

    @property
    def shares(self) -> np.ndarray:
        """Each joint's share of the worst case at the worst pose, sum one, shape (j,)."""
        return np.asarray(self._shares[self.worst_pose])

    @property
    def _shares(self) -> np.ndarray:
        """Each joint's share of the worst case at each pose, shape (n, j)."""
        total = self.worst_parts.sum(axis=1, keepdims=True)
        return np.asarray(self.worst_parts / np.maximum(total, 1e-300))

    @cached_property
    def alone(self) -> np.ndarray:
        """Largest distance of the tool if only this joint had play, shape (n, j) [m].

        It is along the joint's own worst direction, `worst_parts` along that of all together.
        """
        sizes = [self.model.subset([k]).farthest().size for k in range(len(self.joints))]
        return np.array(sizes).T

    @property
    def sentence(self) -> str:
        at = self.worst_pose
        poses = len(self.worst)
        where = f" at the worst of {poses} poses" if poses > 1 else ""
        turn = readable(self.worst_turn.max(), "rad", 3)
        turns = f", and turn by up to {turn}" if self.worst_turn.any() else ""
        resting = f"at rest it is {self._resting(at)}"
        if regulated := sorted(self.rest_positions.regulated):
            resting += f"; encoders behind their gears hold {few(regulated)} there"
        if not self.worst[at] and not self.worst_turn.any():
            return f"No play moves the tool {self.tool!r}; {resting}"
        most = int(self.shares.argmax())
        part = "all" if self.shares[most] > 1.0 - LISTED else f"{100 * self.shares[most]:.0f} %"
        source = f"{part} of it by {self.joints[most]}"
        if self.unit == "rad":
            rest = self.rest_positions.at(at)
            turned, sag = np.linalg.norm([rest.error[3:], rest.sag[3:]], axis=1).tolist()
            part = f" ({self._whose_sag} {readable(sag, 'rad', 3)})" if sag else ""
            return (
                f"Play turns the tool {self.tool!r} by up to {turn}{where} (RMS "
                f"{readable(self.rms[at], 'rad', 3)}), {source}; at rest it is turned "
                f"by {readable(turned, 'rad', 3)}{part}"
            )
        caveats = ""
        if any(c.fit is not None for c in self.model.contributions):
            caveats = (
                "; the limits are for the loosest parts that fits allow, the RMS for any, the "
                "position at rest for the middle ones"
            )
        more = float(self.second_order[at])
        if not more <= _ON_ARCS * self.worst[at]:
            caveats += (
                "; turns so large move the tool on arcs, by which all this may be "
                f"{readable(more, 'm', 2)} off"
            )
        return (
            f"Play lets the tool {self.tool!r} be up to {readable(self.worst[at], 'm', 3)} off"
            f"{where} (RMS {readable(self.rms[at], 'm', 3)}), {source}{turns}; {resting}{caveats}"
        )

    @property
    def from_side_to_side(self) -> str:
        """Reading of a dial gauge, where play is mostly that of a gear, in words; else empty."""
        worst = float(self.worst[self.worst_pose])
        most = self.model.contributions[int(self.shares.argmax())]
        if worst <= NOWHERE * self.worst_turn.max() or not most.gear:
            return ""
        return (
            f"pushed from side to side, a dial shows twice as much: {readable(2.0 * worst, 'm', 3)}"
        )

    def _resting(self, at: int) -> str:
        """The error at rest within the limits of friction, and its causes, in words."""
        rest, ends = self.rest_positions.at(at), self.rest_positions.interval(at)[3]
        limits = " to ".join(dict.fromkeys(f"{1e3 * end:.3g}" for end in ends))
        error = rest.error[:3]
        if np.isnan(error).any():
            return f"{limits} mm off"
        play = self._free(at)
        if not (size := float(np.linalg.norm(error))):
            return f"{limits} mm off"
        along = {
            "play": float(play @ error) / size,
            self._whose_sag: float(rest.sag[:3] @ error) / size,
        }
        beyond = size - sum(along.values())
        if beyond > 0.0:
            along["contacts and gears giving way"] = beyond
        else:  # on arcs play moves the tool less far than the first order says
            along["play"] += beyond
        parts = [
            f"{name} {1e3 * part:.3g}"
            for name, part in sorted(along.items(), key=lambda item: -abs(item[1]))
            if abs(part) > _MENTIONED * size
        ]
        return f"{limits} mm off{': ' * bool(parts)}{', '.join(parts)}"

    @property
    def _whose_sag(self) -> str:
        servos = any(isinstance(drive, Servo) for drive in self.rest_positions.drives.values())
        return "servos' sag" if servos else "drives' sag"

    def _free(self, pose: int) -> np.ndarray:
        """The tool's displacement at rest by play alone, without any deflection, (3,) [m]."""
        model = self.rest_positions.unregulated(self.rest_positions.model)
        free = model.subset(poses=[pose]).at_rest().error[:, 0, 0, :3]
        return np.asarray(free.sum(axis=0))

    def compensated(self, pose: int, trust: float, friction: float = 0.0) -> float:
        """Largest error at rest of a motion that compensates the play (`compensate`) [m].

        It is the sum of the distance from rest in which friction can hold the tool, of the unknown
        part of the play's displacement at rest, and of the displacement by journals that the joints
        cannot take back, as where an arm is stretched. Deflection and the sag of drives, which may
        be larger than the play, are taken as known. NaN where no position of rest is found, and
        with loops.

        Args:
            pose: index of the pose.
            trust: relative uncertainty of the play.
            friction: part by which friction may exceed the known one; -1: without any.
        """
        if self.mechanism.loops:
            return float("nan")
        rest = self.rest_positions.at(pose)
        place, ends = rest.error[:3], self.rest_positions.interval(pose)
        by_friction = np.abs(ends[:3] - place[:, None]).max(axis=1)
        shift = (1.0 + friction) * np.linalg.norm(by_friction)
        journals = [not c.gear for c in self.rest_positions.model.contributions]
        q, robot = self.rest_positions.q[pose], self.mechanism
        at = {name: float(q[robot.coordinate(name)]) for name in robot.joints}
        _, left = taken_up(self._ideal, at, rest.parts[journals].sum(axis=0))
        unknown = trust * np.linalg.norm(self._free(pose))
        return float(shift + unknown + np.linalg.norm(left[:3]))

    @cached_property
    def _ideal(self) -> Mechanism:
        return self.mechanism.ideal()

    @cached_property
    def cures(self) -> list[Cure]:
        """Changes that would make the machine more accurate, at most three, the best first."""
        return cures(self)

    @property
    def ranking(self) -> str:
        """Mean share of each joint in the worst case, and its range over poses, in words."""
        shares = 100.0 * self._shares
        mean, low, high = shares.mean(axis=0), shares.min(axis=0), shares.max(axis=0)
        texts = []
        for i in np.argsort(-mean, kind="stable"):
            spread = f" ({low[i]:.0f} to {high[i]:.0f})" if len(shares) > 1 else ""
            texts.append(f"{self.joints[i]} {mean[i]:.0f} %{spread}")
        return f"shares of the worst case: {', '.join(texts)}"

    def worst_of(self, names: Sequence[str]) -> str:
        """The range of the worst case over several poses, and the pose of which `table` is."""
        k = self.worst_pose
        place = ", ".join(f"{x:.3f}" for x in self.positions[k])
        return (
            f"worst-case error of {self.tool!r} [m{self.unit}]: least "
            f"{1e3 * self.worst.min():.4f}, mean {1e3 * self.worst.mean():.4f}, largest "
            f"{1e3 * self.worst.max():.4f} (pose {names[k] if names else k}, tool at {place} m), "
            "which is made up like this:"
        )

    def by_pose(self, names: Sequence[str]) -> Table:
        """A row for each pose, of these names: its worst case, and each joint's share in it."""
        columns = [Column("pose", names), Column("worst case", self.worst, self.unit)]
        columns.append(Column("rms", self.rms, self.unit))
        columns_by_joint = zip(self.joints, self._shares.T, strict=True)
        return Table(
            [*columns, *(Column(name, share, "1", digits=3) for name, share in columns_by_joint)]
        )

    @property
    def rest(self) -> np.ndarray:
        """Error at rest under gravity and the tool's load, without friction, by joint, (n, j, 6).

        By each joint's Jacobian [m, rad]; NaN where no position of rest is found, or loops tie
        plays to each other.
        """
        return np.array([self.rest_positions.at(i).parts for i in range(len(self.worst))])

    @property
    def rest_tool(self) -> np.ndarray:
        """Error of the tool at rest by all joints, exact kinematics, shape (n, 6) [m, rad]."""
        return np.array([self.rest_positions.at(i).error for i in range(len(self.worst))])

    @property
    def rest_error(self) -> np.ndarray:
        """Distance of the tool at rest from the ideal one, or its turn, shape (n,) [m or rad]."""
        return np.asarray(np.linalg.norm(self.rest_tool[:, self.components], axis=1))

    @property
    def rest_interval(self) -> np.ndarray:
        """Interval of errors in which friction can hold the tool: least and largest, (n, 4, 2) [m].

        Along world x, y, z, and the distance from the ideal tool; conservative. All joints of
        closed loops, and joints of kinds without contacts, may be anywhere in their play.
        """
        return np.array([self.rest_positions.interval(i) for i in range(len(self.worst))])

    def table(self, pose: int | None = None) -> Table:
        """A row for each joint at a pose, by default the worst one."""
        at = self.worst_pose if pose is None else pose
        rests, error, *_ = self.rest_positions.at(at)
        worst = float(self.worst[at])
        sums = (worst, worst, 1.0 if worst > 0.0 else None, np.linalg.norm(error[self.components]))
        resting = Column("at rest", np.linalg.norm(rests[:, :3], axis=1), "m")
        turn = [Column("worst turn", self.turns.parts[:, at], "rad")] * (self.unit == "m")
        if self.unit == "rad":  # joints' shares in an angle at rest are not computed
            resting = Column("at rest", [None] * len(rests), "rad")
        return Table(
            (
                Column("joint", self.joints),
                Column("alone", self.alone[at], self.unit),
                Column("part of worst case", self.worst_parts[at], self.unit),
                Column("share", self._shares[at], "1", digits=4),
                resting,
                Column("rms", self.rms_parts[at], self.unit),
                *turn,
            ),
            totals=[("all", *sums, self.rms[at], *([self.worst_turn[at]] * len(turn)))],
            notes=self._notes(at),
        )

    def _notes(self, at: int) -> list[str]:
        _, error, loads, _ = self.rest_positions.at(at)
        axes = [f"{1e3 * value:.4f}" for value in self.axis_worst[at].sum(axis=0)]
        lines = [
            "alone: with play in this joint only; part: along the worst direction of all; at rest: "
            "under gravity and the force on the tool, without friction (the first line has its "
            "parts along the error)",
            f"worst case along x, y, z: {', '.join(axes[:3])} mm; "
            f"about x, y, z: {', '.join(axes[3:])} mrad",
        ]
        if np.isnan(error).any():
            lines.append("at rest without friction: no equilibrium was found")
        else:
            place = ", ".join(f"{1e3 * value:.4f}" for value in error[:3])
            begins = " (the start of a run with start=rest)"
            begins = "" if self.rest_positions.force.any() else begins
            lines.append(f"at rest without friction, along x, y, z: {place} mm{begins}")
        if not np.isnan(loads).any():
            forces, entries = [], self.mechanism.description.joints
            for contribution, load in zip(self.model.contributions, loads, strict=True):
                turns = contribution.gear and not entries[contribution.joint].slides
                size = float(np.linalg.norm(load[3:] if turns else load[:3]))
                forces.append(f"{contribution.name} {size:.4g} {'N m' if turns else 'N'}")
            lines.append(f"the joints bear there: {', '.join(forces)}")
        return [*lines, *self._held(at)]

    def _held(self, at: int) -> list[str]:
        """Notes on where friction can hold the machine at a pose."""
        place, ends = self.rest_positions.at(at).error[:3], self.rest_positions.interval(at)
        box = [
            f"{axis} {1e3 * low:.4f} to {1e3 * high:.4f}"
            for axis, (low, high) in zip("xyz", ends[:3], strict=True)
        ]
        least, largest = 1e3 * ends[3]
        pressed = zip(self.joints, self.rest_positions.unpressed(at), strict=True)
        free = [name for name, none in pressed if none]
        lines = []
        if free:
            names = "any joint" if len(free) == len(self.joints) else ", ".join(free)
            lines.append(f"no force acts on {names}: the journals may rest anywhere in their play")
        if unknown := self.rest_positions.unsearched:
            complete = len(unknown) == len(self.rest_positions.coefficients)
            names = "all joints" if complete else ", ".join(unknown)
            lines.append(
                f"how far friction can hold {names} is not known (closed loops, or a kind without "
                "contacts): their entire play is assumed"
            )
        lines.append(
            f"with {self.rest_positions.friction_text} the tool may rest anywhere within "
            f"{', '.join(box)} mm; {least:.4f} to {largest:.4f} mm from the ideal one"
        )
        away = 1e3 * float(np.linalg.norm(np.abs(ends[:3] - place[:, None]).max(axis=1)))
        distance = 1e3 * float(np.linalg.norm(place))
        if len(free) < len(self.joints) and not unknown and np.isfinite(away):
            part = f", {100 * away / distance:.0f} % of the error there" if distance > 0.0 else ""
            effect = f"shifts the place of rest by up to {away:.4f} mm"
            if away > _DECIDES * distance:
                effect = f"determines where it rests: up to {away:.4f} mm from the place without"
            lines.append(f"friction {effect}{part}")
        return lines

    @property
    def validity(self) -> str:
        search = 1.0 / np.cos(covering()) - 1.0
        excess = max(play.excess for play in self.model.plays)
        more = f"{1e6 * self.second_order[self.worst_pose]:.3g} µm"
        second = f"rotations of second order up to {more}"
        if self.mechanism.loops:
            second = f"loops closed exactly put the tool {more} elsewhere"
        at_rest = "friction of servos, which may hold them before they have sagged, is left out"
        if not self.rest_positions.force.any():
            at_rest += f"; at rest within {1e6 * AGREES_M:g} µm of where a run begins"
        return (
            "free travel with rigid contacts, to which contacts and drives that give way add; "
            f"worst case missed by at most {100 * search:.2g} % "
            f"(directions), too large by at most {100 * excess:.2g} % (tilt of the journals, "
            f"second order), {second}; {at_rest}"
        )

    def data(self, names: Sequence[str] = ()) -> Table:
        """A row for each pose, by these names or numbered: tool, errors, shares of each joint.

        Positions of rest are given only at poses for which they have been computed already: ask
        for `rest` and `rest_interval` before to have them all.
        """
        columns = [Column("pose", names or range(len(self.worst)))]
        columns += [Column(f"tool {x}", self.positions[:, k], "m") for k, x in enumerate("xyz")]
        columns += [
            Column("worst", self.worst, self.unit),
            *[Column("worst turn", self.worst_turn, "rad")] * (self.unit == "m"),
            Column("rms", self.rms, self.unit),
            Column("second order", self.second_order, "m"),
        ]
        by_axis = self.axis_worst.sum(axis=1)
        for k, axis in enumerate(AXES):
            columns.append(Column(f"worst {axis}", by_axis[:, k], "m" if k < 3 else "rad"))
        for label, values in (("worst part", self.worst_parts), ("worst alone", self.alone)):
            for k, name in enumerate(self.joints):
                key = f"{label.replace(' ', '_')}_{name}_{self.unit}"
                columns.append(Column(f"{label} {name}", values[:, k], self.unit, key))
        rests: list[Sequence[float | None]] = [[None] * 12] * len(self.worst)
        for i in range(len(rests)):
            if self.rest_positions.is_known(i):
                at, ends = self.rest_positions.at(i).error[:3], self.rest_positions.interval(i)
                rests[i] = [*at, float(np.linalg.norm(at)), *ends.ravel()]
        heads = [f"rest {component}" for component in ("x", "y", "z", "distance")]
        heads += [f"{head} {end}" for head in heads for end in ("least", "largest")]
        for k, head in enumerate(heads):
            columns.append(Column(head, [row[k] for row in rests], "m"))
        return Table(columns)


@dataclass(frozen=True, repr=False)
class ErrorBudget(Budget):
    """The error of the tool by several causes, each with its variance."""

    given: tuple[str, ...]
    """Numbers that were given, lines of text."""
    assumed: tuple[str, ...]
    """Numbers that were assumed, lines of text."""

    @property
    def mean(self) -> np.ndarray:
        """Mean displacement of the tool, by loads and heat, (n, 3) [m]."""
        return np.asarray(self.model.means.sum(axis=0))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the tool's displacement about its mean, (n, 3, 3) [m^2]."""
        return np.asarray(self.model.covariances.sum(axis=0))

    @property
    def rms(self) -> np.ndarray:
        """Root mean square distance, (n,) [m]."""
        return self.model.rms

    @cached_property
    def _at_worst(self) -> ErrorModel:
        """The model at the worst pose."""
        return self.model.subset(poses=[self.worst_pose])

    def halved(self, *indices: int) -> tuple[float, float]:
        """Decrease of `worst` and `rms` at the worst pose if contributions were halved [m]."""
        at, scale = self.worst_pose, self.model.scale.copy()
        scale[list(indices)] *= 0.5
        reduced = self._at_worst.scaled(scale)
        left = reduced.farthest(start=self.direction[at : at + 1]).size[0]
        return float(self.worst[at] - left), float(self.rms[at] - reduced.rms[0])

    def data(self) -> Table:
        """A row for each contribution, at the worst pose."""
        rows, at_worst = self.model.contributions, self._at_worst
        return Table(
            (
                Column("joint", [row.joint for row in rows]),
                Column("cause", [row.cause for row in rows]),
                Column("worst", self.worst_parts[self.worst_pose], "m"),
                Column("rms", [at_worst.subset([k]).rms[0] for k in range(len(rows))], "m"),
                *(Column(f"mean {x}", at_worst.means[:, 0, k], "m") for k, x in enumerate("xyz")),
                Column("origin", [row.source for row in rows]),
            )
        )

    def by(self, key: str) -> dict[str, tuple[float, float]]:
        """Part in the worst case [m] and share of the variance at the worst pose, summed by
        ``"joint"`` or ``"cause"``.
        """
        sums = dict[str, tuple[float, float]]()
        parts, variances = self.worst_parts[self.worst_pose], self.variances
        total = float(variances.sum()) or 1.0
        names = [getattr(contribution, key) for contribution in self.model.contributions]
        for name, part, variance in zip(names, parts, variances, strict=True):
            worst, share = sums.get(name, (0.0, 0.0))
            sums[name] = worst + float(part), share + float(variance) / total
        return sums

    @property
    def variances(self) -> np.ndarray:
        """Variance of the tool's position at the worst pose by contribution, (k,) [m^2]."""
        return np.asarray(np.trace(self._at_worst.covariances[:, 0], axis1=1, axis2=2))

    def sample(self, count: int, seed: int = 0) -> np.ndarray:
        """Random errors at the worst pose by the exact kinematics, (count, 3) [m]."""
        return self._displaced(self._at_worst.draw(np.random.default_rng(seed), count))

    @cached_property
    def reached(self) -> float:
        """Distance of the tool by the exact kinematics in the state of `worst` [m]."""
        direction = self.direction[self.worst_pose]
        points = self._at_worst.along(direction[None, None]).point[:, 0, 0]
        return float(np.linalg.norm(self._displaced(points[None])[0]))

    def _displaced(self, points: np.ndarray) -> np.ndarray:
        """Errors (m, 3) of the tool at the worst pose, contributions displaced by (m, k, 6)."""
        mechanism, q = self.mechanism, self.q[self.worst_pose]
        closing = ClosedLoops(mechanism, self.q[0], self.driven) if mechanism.loops else None
        tools = displaced(mechanism, q, self.model.names, points, closing, self.relative_to)
        return tools - self.positions[self.worst_pose]

    def table(self) -> Table:
        """A row for each joint and cause at the worst pose, the largest first."""
        at, worst = self.worst_pose, self.worst[self.worst_pose]
        same: dict[tuple[str, str], list[int]] = {}
        for i, contribution in enumerate(self.model.contributions):
            same.setdefault((contribution.joint, contribution.cause), []).append(i)
        parts = {key: float(self.worst_parts[at, indices].sum()) for key, indices in same.items()}
        small = [part for part in parts.values() if part <= LISTED * worst]
        rows: list[tuple] = []
        for key in sorted(same, key=lambda key: -parts[key])[: len(parts) - len(small)]:
            gain, less = self.halved(*same[key])
            rms = float(self._at_worst.subset(same[key]).rms[0])
            rows.append((*key, parts[key], parts[key] / worst, rms, -gain, -less))
        heads = [("joint", ""), ("cause", ""), ("worst case", "m"), ("share", "1"), ("rms", "m")]
        heads += [("halved: worst", "m"), ("halved: rms", "m")]
        totals: list[tuple] = (
            [(f"{len(small)} more", None, sum(small), *[None] * 4)] if small else []
        )
        totals.append(("all", None, worst, 1.0, self.rms[at], None, None))
        return replace(Table.of(heads, rows), totals=totals, notes=self._notes())

    @property
    def sentence(self) -> str:
        at = self.worst_pose
        where = f" at the worst of {len(self.worst)} poses" if len(self.worst) > 1 else ""
        causes = sorted(self.by("cause").items(), key=lambda item: -item[1][0])
        parts = [
            f"{cause} {100 * worst / self.worst[at]:.0f} %"
            for cause, (worst, _) in causes
            if worst > 0.5 * _MENTIONED * self.worst[at]
        ]
        origins = (origin for c in self.model.contributions for origin in c.numbers.values())
        kinds = dict.fromkeys(
            RULED if origin.startswith("by rule") else f"what {origin} has"
            for origin in origins
            if origin != GIVEN
        )
        assumptions = f"; assumed: {', '.join(kinds)}" if kinds else ""
        return (
            f"The tool {self.tool!r} is up to {readable(self.worst[at], 'm', 3)} off{where} (RMS "
            f"{readable(self.rms[at], 'm', 3)}), by {', '.join(parts)}{assumptions}"
        )

    def _notes(self) -> list[str]:
        at = self.worst_pose
        shares = ", ".join(
            f"{cause} {100 * worst / self.worst[at]:.0f} % (variance {100 * share:.0f} %)"
            for cause, (worst, share) in self.by("cause").items()
        )
        mean = ", ".join(f"{1e3 * x:.4f}" for x in self.mean[at])
        off = self.reached / self.worst[at] - 1.0
        fits = "" if abs(off) < _ON_ARCS else ": too far for Jacobians; is the class right?"
        return [
            f"by cause: {shares}",
            f"loads and heat always displace the tool by {mean} mm along x, y, z",
            f"{'warning: ' if fits else ''}by the exact kinematics the worst case is "
            f"{1e3 * self.reached:.4f} mm ({100 * off:+.2f} %{fits})",
            *(f"given: {line}" for line in self.given),
            *(f"assumed: {line}" for line in self.assumed),
        ]


@overload
def budget(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float] | None = None,
    *,
    causes: None = None,
    force: Sequence[float] = ...,
    second_order: bool = ...,
    driven: Sequence[str] | None = ...,
    friction: float | None = ...,
    drive: Drive | Mapping[str, Drive] | None = ...,
    joint_friction: Mapping[str, JointFriction] | None = ...,
    payloads: Sequence[Payload] = ...,
    loads: Mapping[str, Load] | None = ...,
    relative_to: str | None = ...,
) -> PlayBudget: ...


@overload
def budget(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float] | None = None,
    *,
    causes: Collection[str | Cause],
    force: Sequence[float] = ...,
    errors: RobotErrors | None = ...,
    kind: str | None = ...,
    remaining: Mapping[tuple[str, str], float] | None = ...,
    driven: Sequence[str] | None = ...,
    drive: Drive | Mapping[str, Drive] | None = ...,
    joint_friction: Mapping[str, JointFriction] | None = ...,
    payloads: Sequence[Payload] = ...,
    loads: Mapping[str, Load] | None = ...,
    relative_to: str | None = ...,
) -> ErrorBudget: ...


@known_keywords
def budget(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float] | None = None,
    *,
    causes: Collection[str | Cause] | None = None,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    errors: RobotErrors | None = None,
    kind: str | None = None,
    remaining: Mapping[tuple[str, str], float] | None = None,
    second_order: bool = True,
    driven: Sequence[str] | None = None,
    friction: float | None = None,
    drive: Drive | Mapping[str, Drive] | None = None,
    joint_friction: Mapping[str, JointFriction] | None = None,
    payloads: Sequence[Payload] = (),
    loads: Mapping[str, Load] | None = None,
    relative_to: str | None = None,
) -> Budget:
    """The static error of the tool: by play alone, or by several causes.

    In closed loops the driven joints stand and the others follow, to first order; joints outside
    the loops stand. Where the joints of a loop constrain each other, as axes of a plane linkage do,
    only errors that leave it closed count.

    Args:
        mechanism: a machine with play; for several causes with or without.
        poses: joint positions by name [rad or m], the rest zero or in the middle of their limits;
            or configurations, (n, nq). Loops that are open there are closed by the joints that are
            not driven. None: the pose that the command `jointplay budget` takes by default
            (`poses_of`), with the base held.
        causes: the causes that count, such as `CAUSES`, by name or as a `Cause` of your own. None:
            play alone, of joints and gears, with where the machine rests.
        force: force on the tool besides gravity, in world axes, shape (3,) [N].
        errors: for several causes: known errors of the robot and of its joints.
        kind: for several causes: class of robots from which all other numbers are taken, of
            `ERROR_CLASSES`; None: that of `errors`, without which missing numbers are refused.
        remaining: for several causes: parts of them that remain, by joint and cause: factors on
            clearances, plays of gears, deflections, amplitudes and tolerances; of a joint with a
            rolling bearing and a gear, on the gear's play.
        second_order: for play alone, like friction and drive: widen the sets so that they contain
            all poses without penetration; otherwise all errors are proportional to the clearances.
        driven: joints of loops that stand; None: the first that determine the others.
        friction: coefficient of all contacts, with which a machine may rest elsewhere than without;
            None: the largest in the law of each joint.
        drive: drive of all joints that stand, or drives by joint; joints without one, or None, have
            computed torque. Servos sag under their whole load, computed torque under payloads,
            loads and the force on the tool, of which it does not know in a run either.
        joint_friction: friction of joints besides their bearings', which may hold the teeth of
            their gears on either side; None: the URDF's.
        payloads: payloads, carried at all poses, whenever they are picked up.
        loads: springs, wrenches and other loads, as for `Simulation`, as they are where a run
            begins; controllers are left out.
        relative_to: link or frame whose own motion does not count, such as a palm or a trunk:
            errors, directions and positions are those seen from it, in its axes. The base stays
            held, for loads. None: the world.

    Raises:
        JointplayError: a friction coefficient that is negative or not finite; nothing has play; a
            pose of the wrong shape; a force that is no vector; an axis without limit that the tool
            feels; loops that cannot be closed, or near a singular position, where the first order
            does not hold. Of several causes: a deflection or growth that a loop holds, which is
            statically indeterminate; springs of another kind of joint; a part that is not positive,
            or of the play of a rolling bearing, which is not proportional to its clearance.
        MissingName: no such joint, body, class or cause.
    """
    require_a("mechanism", mechanism, "Mechanism")
    if poses is None:
        standing = poses_of(mechanism)
        mechanism, poses, driven = standing.mechanism, standing.q, driven or standing.driven
    if relative_to is not None:
        check_body(mechanism, relative_to)
    drives = holding_drives(mechanism, drive)
    acting = with_force(mechanism, force, loads)
    losses = urdf_friction(mechanism) | dict(joint_friction or {})
    if causes is not None:
        if friction is not None:
            raise JointplayError("friction is for play alone: leave out friction or causes")
        q = configurations(mechanism, poses, driven)
        mechanism, model = cause_model(
            mechanism, q, acting, named(causes), RobotErrors() if errors is None else errors, kind,
            remaining or {}, driven, relative_to, drives, payloads,
        )  # fmt: skip
        seen = driven, relative_to, _positions(mechanism, q, relative_to)
        return ErrorBudget(
            mechanism, q, model, np.array(force, float), *seen, model.farthest(),
            *given_and_assumed(model),
        )  # fmt: skip
    if friction is not None and require_finite("friction coefficient", friction, "") < 0.0:
        raise JointplayError(f"the friction coefficient must be >= 0, got {friction:g}")
    if any(gear.error_terms for gear in mechanism.gears.values()):  # transmission error is no play
        exact = {name: gear.without_error() for name, gear in mechanism.gears.items()}
        mechanism = mechanism.with_clearance(mechanism.given_joints, exact)
    mechanism = carrying(mechanism, payloads)
    q = configurations(mechanism, poses, driven)
    model = play_model(
        mechanism, q, loads=acting, second_order=second_order, driven=driven, loops=True,
        relative_to=relative_to,
    )  # fmt: skip
    # The worst case: of the tool's displacement, or of its rotation if it only turns in place.
    unit, half, of_places = "m", half_sphere(), model
    turned = model.turned.size.max()
    states, worst = _worst(model, half)
    nowhere = worst.size.max() <= NOWHERE * turned
    if turned > 0.0 and (nowhere or (relative_to is None and turns_in_place(mechanism, q[0]))):
        unit, model = "rad", model.turning
        states, worst = _worst(model, half)
    # The RMS over loads of random direction: over the states just found, with fits in the middle of
    # their tolerances; the random sizes of fits add their variance, which is of first order.
    middle, varies = model.middle, np.array([c.looseness for c in model.contributions])
    typical = middle.along(np.broadcast_to(half, (len(q), *half.shape))) if varies.any() else states
    errors_of = typical.error[..., :3]
    total = errors_of.sum(axis=0)
    share = np.einsum("jnmk,nmk->nj", errors_of, total) / total.shape[1]
    looser = varies[:, None, None, None] * (states.error[..., :3] - errors_of)
    share += (looser**2).sum(axis=3).mean(axis=2).T
    rms = np.sqrt(share.sum(axis=1))
    rms_parts = np.divide(share, rms[:, None], out=np.zeros_like(share), where=rms[:, None] > 0.0)
    # The second order, and where the machine rests.
    outwards = relative_to is None or _carries(mechanism, relative_to)
    if unit == "rad":  # angles about one axis add up
        more = np.zeros(len(q))
    elif mechanism.loops:
        more = _second_order_of_loops(mechanism, q, model, worst.direction, driven)
    else:
        more = _second_order(model, outwards)
    push = np.array(force, float)
    rest = RestPositions(
        mechanism, q, of_places.middle, push, acting, driven, friction, drives, losses, more,
        relative_to,
    )  # fmt: skip
    if rest.regulated and not mechanism.loops:  # their links are held still
        rest = replace(rest, second_order=_second_order(rest.unregulated(of_places), outwards))
    seen = driven, relative_to, _positions(mechanism, q, relative_to)
    return PlayBudget(mechanism, q, model, push, *seen, worst, rest, more, rms, rms_parts, unit)


def _worst(model: ErrorModel, directions: np.ndarray) -> tuple[States, Farthest]:
    """States along directions (m, 3) at all poses, and the farthest, refined from the best one."""
    states = model.along(np.broadcast_to(directions, (model.poses, *directions.shape)))
    return states, model.farthest(start=directions[states.value.sum(axis=0).argmax(axis=1)])


def holding_drives(
    mechanism: Mechanism, drive: Drive | Mapping[str, Drive] | None
) -> dict[str, Drive]:
    """The drive of each joint, by name: the given one, or else computed torque.

    Raises:
        MissingName: no such joint.
        JointplayError: a drive that holds no position.
    """
    common = drive if isinstance(drive, Drive) else ComputedTorque()
    drives = dict.fromkeys(mechanism.joints, common)
    for name, joint_drive in drive.items() if isinstance(drive, Mapping) else ():
        require_known("moving joint", name, drives)
        drives[name] = joint_drive
    for joint_drive in drives.values():
        if not joint_drive.follows:
            raise JointplayError(
                f"a {joint_drive.kind} drive holds no position: the budget's drives must follow a "
                "motion, such as ComputedTorque() or Prescribed()"
            )
    return drives


def _positions(mechanism: Mechanism, q: np.ndarray, relative_to: str | None) -> np.ndarray:
    """Positions of the tool at configurations (n, nq), shape (n, 3) [m]."""
    return np.array([tool_place(mechanism, row, relative_to).translation for row in q])


def _carries(mechanism: Mechanism, body: str) -> bool:
    """Whether a body carries the tool."""
    model, ends = mechanism.model, (frame_index(mechanism.model, body), mechanism.tool_frame)
    at, tool = ({*model.supports[model.frames[index].parentJoint]} for index in ends)
    return at <= tool


def _second_order(model: ErrorModel, outwards: bool) -> np.ndarray:
    """Bound on the part of the tool's displacement by products of small rotations, (n,) [m].

    A rotation by theta about a centre at the distance r adds theta^2 r / 2 to its linear part, and
    turns the displacements by sources farther from the base. Unless the sources are in order from
    the base `outwards`, any may turn the displacement by any other.
    """
    turn = 0.0 if outwards else sum(play.reach[1] for play in model.plays)
    total = np.zeros(model.poses)
    turned = np.zeros_like(total)
    for play, move in zip(model.plays, model.jacobian, strict=True):
        aside, angle = play.reach
        # The arm of a turn is the tool's distance from the axes about which the play has one.
        axes = 3 + np.flatnonzero(play.support(np.eye(6)[3:]).value > 0.0)
        arms = np.linalg.norm(move[:, :3, axes], 2, axis=(1, 2)) if len(axes) else 0.0
        felt = np.abs(move).max(axis=(1, 2)) > 0.0
        moved = np.where(felt, aside + angle * arms, 0.0)
        total += np.where(felt, 0.5 * angle**2 * arms, 0.0)
        total += turned * moved if outwards else (turn - angle) * moved
        turned += np.where(felt, angle, 0.0)
    return total


def _second_order_of_loops(
    mechanism: Mechanism,
    q: np.ndarray,
    model: ErrorModel,
    direction: np.ndarray,
    driven: Sequence[str] | None,
) -> np.ndarray:
    """Distance of the exact tool from that of the first order, in the farthest states, (n,) [m].

    Raises:
        JointplayError: a pose near a singular position, where they disagree.
    """
    closing = ClosedLoops(mechanism, q[0], driven)
    states = model.along(direction[:, None])
    largest = max(play.reach[0] for play in model.plays)
    away = np.zeros(len(q))
    for i, row in enumerate(q):
        linear = states.error[:, i, 0, :3].sum(axis=0)
        ideal = tool_place(mechanism, row).translation
        (exact,) = displaced(mechanism, row, model.names, states.point[None, :, i, 0], closing)
        away[i] = float(np.linalg.norm(exact - ideal - linear))
        if not away[i] <= _LOOPS_AGREE * max(float(np.linalg.norm(linear)), largest):
            reason = f"they put the tool {1e3 * away[i]:.4g} mm from where the first order does"
            if np.isnan(away[i]):
                reason = "the loops cannot be closed with the journals aside"
            raise JointplayError(
                f"near a singular position at {closing.stands(row, i, len(q))}: "
                f"{reason}; leave this pose out, or simulate (jointplay run)"
            )
    return away
