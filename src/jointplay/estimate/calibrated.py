"""The answer of a calibration: estimates and models, as numbers, text and tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base import tables
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.tables import Table
from jointplay.base.units import readable
from jointplay.estimate.kinematic_model import COORDINATE, PARTS, Term
from jointplay.estimate.machine import preset_found
from jointplay.estimate.pose_problem import CONSTANT, Fitted
from jointplay.estimate.selection import Step
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import Estimate, Loop, Unknown, by_label, data, listed

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.presets import Preset

_NOT_DETERMINED = "not determined (other causes do the same, or nothing shows it)"


@dataclass(frozen=True)
class Calibration:
    """Estimates of the causes of a robot's errors from static poses; SI units."""

    poses: StaticPoses
    steps: tuple[Step, ...]
    """All models that were tried, in order; the first has no causes but those always in it."""
    coefficients: tuple[Estimate, ...]
    """Coefficients of the terms that were kept, except play; with all candidates free."""
    play: tuple[Estimate, ...]
    """Play of every joint; all candidates and every joint's play are free."""
    folds: str
    """Text of what was held back."""
    notes: tuple[str, ...] = ()
    effects: tuple[Estimate, ...] = ()
    """Effect of each kept term on the tool, RMS over the poses, beyond what other poses of base and
    tool would do [m]."""
    full: Fitted | None = field(default=None, repr=False)
    """The fit from which `play` and `coefficients` follow."""

    def step(self) -> Step:
        """The selected model."""
        return [step for step in self.steps if step.kept][-1]

    @property
    def mechanism(self) -> Mechanism:
        return self.step().fitted.problem.poses.mechanism

    @property
    def kept(self) -> tuple[Term, ...]:
        """Terms of the selected model."""
        return self.step().terms

    @property
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """Kinds of measured numbers by name: unit and components."""
        return self.step().fitted.problem.kinds

    @property
    def within(self) -> np.ndarray:
        """Which held-back rows lay in their predicted 95 % regions, shape (n,)."""
        return self.step().within

    def __getitem__(self, label: str) -> Estimate:
        """The estimate of a coefficient that is not play, by its label."""
        return by_label(self.coefficients, label)

    def play_of(self, joint: str) -> Estimate:
        """The estimate of a joint's play."""
        for play in self.play:
            if play.joint == joint:
                return play
        raise MissingName("joint", joint, [play.joint for play in self.play])

    def corrections(self) -> dict[str, pin.SE3]:
        """Poses of the joints' frames by the selected model in their nominal frames, by joint.

        `bridges.urdf.to_urdf` writes them into a URDF, whose tool is then where the model has it,
        except for causes that depend on the pose or on loads. With the joint at zero by its
        encoder: what `placement` and `offset` say.
        """
        fitted = self.step().fitted
        problem, poses = fitted.problem, fitted.problem.poses
        moved = np.zeros((len(poses.names), COORDINATE + 1))
        for column, value in zip(problem.columns, fitted.coefficients, strict=True):
            if column.term.kind in CONSTANT:
                moved[column.index, column.target] += value
        corrections = {}
        joints = zip(poses.names, poses.axis, poses.turns, moved, strict=True)
        for name, axis, turns, shift in joints:
            if shift.any():
                step = shift[COORDINATE] * axis
                zero = (pin.exp3(step), np.zeros(3)) if turns else (np.eye(3), step)
                corrections[name] = pin.SE3(pin.exp3(shift[3:6]), shift[:3]) * pin.SE3(*zero)
        return corrections

    def preset(self, robot: str | Path | None = None) -> Preset:
        """A preset of the robot's joints with the values that are known.

        Play and compliance as gears; bearings, seats and gears of the scenario with their own.

        Args:
            robot: name or path of the robot; None: the file of its URDF.

        Raises:
            JointplayError: nothing of it is known.
        """
        known = [
            estimate for estimate in self.estimates
            if estimate.unknown.name in PARTS.values()
            and estimate.known and estimate.value > 0.0
        ]  # fmt: skip
        if not known:
            raise JointplayError(
                "these poses tell nothing of play or stiffness, which a preset would have"
            )
        return preset_found(self.mechanism, known, self.poses.source, robot)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Loops of joints whose play was fitted: how far load and approach turn each."""
        order = {joint: k for k, joint in enumerate(self.poses.joints)}
        loops = () if self.full is None else self.full.loops()
        return tuple(sorted(loops, key=lambda loop: order[loop.joint]))

    @property
    def models(self) -> Table:
        """Table of the models that were tried, with their errors."""
        columns = [
            tables.Column("model", [step.added for step in self.steps]),
            tables.Column("unknowns", [step.unknowns for step in self.steps]),
        ]
        for rows in ("training", "held back"):
            errors = np.array([getattr(step, rows.replace(" ", "_")) for step in self.steps])
            for k, (unit, _) in enumerate(self.kinds.values()):
                columns.append(tables.Column(f"{rows}{', turn' * k}", errors[:, k], unit))
        columns.append(tables.Column("kept", ["yes" if step.kept else "no" for step in self.steps]))
        return Table(columns)

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        step, kinds = self.step(), self.kinds
        sizes = zip(kinds.values(), step.held_back, strict=True)
        errors = " and ".join(readable(float(size), unit, 3) for (unit, _), size in sizes)
        causes = ", ".join(map(str, step.terms)) or "no cause"
        return (
            f"These poses show {causes}: with it, poses that the fit has not seen are predicted "
            f"to {errors} (RMS)"
        )

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Play and coefficients, by joint."""
        order = {joint: k for k, joint in enumerate(self.poses.joints)}
        estimates = (*self.play, *self.coefficients)
        return tuple(sorted(estimates, key=lambda row: order.get(row.joint, len(order))))

    def brief(self) -> str:
        """Text of the estimates, without the models."""
        return listed(self.estimates, vague=_NOT_DETERMINED)

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
        """Errors of all models, effects, and estimates by joint [SI]."""
        errors = []
        for step in self.steps:
            name = " + ".join(map(str, step.terms)) or step.added
            note = "kept" if step.kept else "not kept"
            for rows in ("training", "held_back"):
                for (kind, (unit, _)), size in zip(
                    self.kinds.items(), getattr(step, rows), strict=True
                ):
                    error = Unknown("", f"{rows} {kind}: {name}", unit, np.nan)
                    errors.append(Estimate(error, size, note=note))
        return [*errors, *self.effects, *self.estimates]

    @property
    def data(self) -> Table:
        return data(self.rows)

    @property
    def residuals(self) -> Table:
        """Table of the selected model's errors in every pose, in training and held back."""
        count, group, point = len(self.poses), self.poses.group, self.poses.point
        columns = [
            tables.Column("row", range(1, count + 1)),
            tables.Column("group", group or [""] * count),
            tables.Column("point", point or [""] * count),
        ]
        for rows, errors in self.step().errors.items():
            for (unit, axes), values in zip(self.kinds.values(), errors, strict=True):
                for axis, along in zip(axes, values.T, strict=True):
                    columns.append(tables.Column(f"{rows.replace('_', ' ')} {axis}", along, unit))
        return Table(columns)

    def describe(self) -> dict[str, Any]:
        error = self.step().fitted.problem.error
        return {
            "joints": list(self.poses.joints),
            "poses": len(self.poses),
            "held_back": self.folds,
            "within_region": [bool(within) for within in self.within],
            "error": dict(zip(self.kinds, error, strict=True)),
            "kept": [str(term) for term in self.kept],
            "models": [step.describe() for step in self.steps],
            "unknowns": [row.describe() for row in self.estimates],
            "effects": [row.describe() for row in self.effects],
            "notes": list(self.notes),
        }
