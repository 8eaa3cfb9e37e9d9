"""What static poses tell of a robot: in a sentence, as tables, and as a corrected robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base import tables
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.tables import Table
from jointplay.base.units import readable
from jointplay.estimate.kinematic_model import COORDINATE, PARTS, Term
from jointplay.estimate.machine import preset_found
from jointplay.estimate.selection import Fitted, Step
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import Answer, Estimate, Loop, Unknown, data, listed

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.presets import Preset

CONSTANT = ("offset", "placement")
"""Kinds of terms that are the same in every pose."""
_BY_LOAD = ("play", "compliance", "gear", "hysteresis")
"""Kinds of terms that turn a joint by its load or by the way it came."""
_UNKNOWN = "not determined (other causes do the same, or nothing shows it)"


@dataclass(frozen=True, kw_only=True)
class Calibration(Answer):
    """What static poses tell of the causes of errors; SI units.

    Estimates are of every joint's play, by the side of its load, and of the coefficients of the
    terms that were kept, by joint; all candidates and everybody's play are free.
    """

    poses: StaticPoses
    steps: tuple[Step, ...]
    """All models that were tried, in order; the first has no causes but those always in it."""
    folds: str
    """What was held back, in words."""
    effects: tuple[Estimate, ...] = ()
    """What each term that was kept moves the tool by, RMS over the poses, beyond what other places
    of base and tool would do [m]."""
    whole: Fitted | None = field(default=None, repr=False)
    """With all candidates and everybody's play free, which the estimates are of."""

    def step(self) -> Step:
        return [one for one in self.steps if one.kept][-1]

    @property
    def mechanism(self) -> Mechanism:
        return self.step().fitted.problem.poses.mechanism

    @property
    def kept(self) -> tuple[Term, ...]:
        return self.step().terms

    @property
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """What was measured: unit and components by kind."""
        return self.step().fitted.problem.kinds

    @property
    def within(self) -> np.ndarray:
        """Which held-back rows lay in their predicted 95 % regions, shape (n,)."""
        return self.step().within

    @property
    def play(self) -> tuple[Estimate, ...]:
        """Of every joint."""
        return tuple(one for one in self.estimates if one.plays(one.joint))

    def play_of(self, joint: str) -> Estimate:
        """What is told of a joint's play by the side of its load."""
        plays = {one.joint: one for one in self.play}
        require_known("joint", joint, plays)
        return plays[joint]

    def corrections(self) -> dict[str, pin.SE3]:
        """By joint, where the kept model has its frame, in the nominal one and with the joint at
        zero by its encoder: what `placement` and `offset` find. `bridges.urdf.to_urdf` writes them
        into a URDF, whose tool is then where the model has it, but for causes that depend on the
        pose or on loads."""
        fitted = self.step().fitted
        poses, moved = fitted.problem.poses, np.zeros((len(fitted.problem.poses.names), 7))
        for one, value in zip(fitted.problem.columns, fitted.coefficients, strict=True):
            if one.term.kind in CONSTANT:
                moved[one.index, one.target] += value
        found = {}
        for name, axis, turns, own in zip(poses.names, poses.axis, poses.turns, moved, strict=True):
            if own.any():
                way = own[COORDINATE] * axis
                zero = (pin.exp3(way), np.zeros(3)) if turns else (np.eye(3), way)
                found[name] = pin.SE3(pin.exp3(own[3:6]), own[:3]) * pin.SE3(*zero)
        return found

    def preset(self, robot: str | Path | None = None) -> Preset:
        """The robot's joints with what was found: play and compliance as gears, and bearings, seats
        and gears of the scenario with theirs.

        Args:
            robot: name or path of the robot; None: the file of its URDF.

        Raises:
            JointplayError: nothing of it was found.
        """
        found = [
            one for one in self.estimates
            if one.unknown.name in PARTS.values()
            and one.identified and one.found and one.value > 0.0
        ]  # fmt: skip
        if not found:
            raise JointplayError(
                "these poses tell nothing of play or stiffness, which a preset would have"
            )
        return preset_found(self.mechanism, found, self.poses.source, robot)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Of each joint whose play was fitted: how far its load and the way it came turn it."""
        order = {joint: k for k, joint in enumerate(self.poses.joints)}
        made = () if self.whole is None else _loops(self.whole)
        return tuple(sorted(made, key=lambda one: order[one.joint]))

    @property
    def models(self) -> Table:
        columns = [
            tables.Column("model", [one.added for one in self.steps]),
            tables.Column("unknowns", [one.unknowns for one in self.steps]),
        ]
        for what in ("training", "held back"):
            errors = np.array([getattr(one, what.replace(" ", "_")) for one in self.steps])
            for k, (unit, _) in enumerate(self.kinds.values()):
                columns.append(tables.Column(f"{what}{', turn' * k}", errors[:, k], unit))
        columns.append(tables.Column("kept", ["yes" if one.kept else "no" for one in self.steps]))
        return Table(columns)

    @property
    def sentence(self) -> str:
        step, kinds = self.step(), self.kinds
        sizes = zip(kinds.values(), step.held_back, strict=True)
        errors = " and ".join(readable(float(size), unit, 3) for (unit, _), size in sizes)
        causes = ", ".join(map(str, step.terms)) or "no cause"
        return (
            f"These poses show {causes}: with it, poses that the fit has not seen are predicted "
            f"to {errors} (RMS)"
        )

    def brief(self) -> str:
        """What was found, without how."""
        return listed(self.estimates, vague=_UNKNOWN)

    def __str__(self) -> str:
        poses = self.poses
        units = "points" if poses.point is not None else "groups" if poses.group else "rows"
        lines = [
            *self.notes,
            str(self.models),
            f"{int(self.within.sum())} of {len(self.within)} held-back {next(iter(self.kinds))}s "
            "lie in their predicted 95 % regions",
            f"held back: {self.folds}; a term is kept if the squared errors of held-back "
            f"{units} shrink by more than chance (one-sided 90 %) and their RMS by 1 %",
        ]
        lines += ["", self.brief()]
        if self.effects:
            head = "moves the tool by (RMS), base and tool placed best without it"
            lines += ["", listed(self.effects, head)]
        return "\n".join(lines)

    @property
    def rows(self) -> list[Estimate]:
        """Errors of all models, effects, and what was found by joint [SI]."""
        errors = []
        for one in self.steps:
            name = " + ".join(map(str, one.terms)) or one.added
            note = "kept" if one.kept else "not kept"
            for what in ("training", "held_back"):
                for (kind, (unit, _)), size in zip(
                    self.kinds.items(), getattr(one, what), strict=True
                ):
                    error = Unknown("", f"{what} {kind}: {name}", unit, np.nan)
                    errors.append(Estimate(error, size, note=note))
        return [*errors, *self.effects, *self.estimates]

    @property
    def data(self) -> Table:
        return data(self.rows)

    @property
    def residuals(self) -> Table:
        """Errors of every pose, in training and held back."""
        count, group, point = len(self.poses), self.poses.group, self.poses.point
        columns = [
            tables.Column("row", range(1, count + 1)),
            tables.Column("group", group or [""] * count),
            tables.Column("point", point or [""] * count),
        ]
        for what, errors in self.step().errors.items():
            for (unit, axes), values in zip(self.kinds.values(), errors, strict=True):
                for axis, one in zip(axes, values.T, strict=True):
                    columns.append(tables.Column(f"{what.replace('_', ' ')} {axis}", one, unit))
        return Table(columns)

    def describe(self) -> dict[str, Any]:
        error = self.step().fitted.problem.error
        return super().describe() | {
            "joints": list(self.poses.joints),
            "poses": len(self.poses),
            "held_back": self.folds,
            "within_region": [bool(one) for one in self.within],
            "error": dict(zip(self.kinds, error, strict=True)),
            "kept": [str(term) for term in self.kept],
            "models": [one.describe() for one in self.steps],
            "effects": [one.describe() for one in self.effects],
        }


def _loops(fitted: Fitted) -> Iterator[Loop]:
    """By what a turn of the joint itself would do to what was measured in each row."""
    problem, rows = fitted.problem, fitted.rows
    poses, owner, first = problem.poses, problem.owner(rows), len(problem.frame)
    left = -fitted.residual[: len(owner)]
    mine = (owner[:, None] == np.arange(len(rows))).T  # (n, numbers)
    turns = fitted.coefficients * problem.features
    for i, one in enumerate(problem.columns):
        if one.term.kind != "play":
            continue
        bare = replace(one, feature=np.ones(len(poses)))
        plain = problem.having([*problem.columns[:i], bare, *problem.columns[i + 1 :]]).at(rows)
        effect = plain.effects(fitted.theta)[: len(owner), first + i] / one.unknown.scale
        own = sum(
            turns[:, k] for k, other in enumerate(problem.columns)
            if other.index == one.index and other.target == COORDINATE and other.moves is None
            and other.term.kind in _BY_LOAD
        )  # fmt: skip
        unit = one.unknown.unit
        yield Loop.beside(
            one.joint,
            (poses.load[rows, one.index], "load", "N" if unit == "m" else "N*m"),
            np.asarray(own)[rows],
            unit,
            np.sign(poses.approach[rows, one.index]).astype(int),
            mine * effect,
            mine * left,
        )
