"""Problems of static poses: a measurement and the columns that may explain it, and their fit.

A `Problem` states what a model predicts by its own unknowns (the poses of base and tool) and by the
coefficients of columns, one for each cause of errors in a joint. `Problem.fit` gives a `Fitted`,
which says how well it predicts poses that it has not seen, and how far each joint is turned by its
load.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from scipy.stats import f as fisher

from jointplay.estimate.kinematic_model import COORDINATE, Column, Poses
from jointplay.estimate.least_squares import Fit, LeastSquares, minimum
from jointplay.estimate.unknowns import CONFIDENCE, ROUNDING, Loop, Unknown

CONSTANT = ("offset", "placement")
"""Kinds of terms that are the same in every pose, so that a corrected URDF can have them."""
_BY_LOAD = ("play", "compliance", "gear", "hysteresis")
"""Kinds of terms that turn a joint by its load or by the way it came, and show in its loop."""


@dataclass(frozen=True)
class Problem(ABC):
    """A measurement of static poses, and columns that may explain it."""

    poses: Poses
    error: tuple[float, ...]
    """Standard deviations about the model, by kind of number [SI]."""
    columns: tuple[Column, ...] = ()

    linear: ClassVar[bool] = False
    """Whether predictions are linear in all unknowns."""

    @property
    @abstractmethod
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """Kinds of measured numbers in a row, by name: unit and components."""

    @property
    @abstractmethod
    def frame(self) -> tuple[Unknown, ...]:
        """Unknowns besides the coefficients of columns."""

    @abstractmethod
    def at(self, rows: np.ndarray) -> LeastSquares:
        """Least squares of some rows.

        Its numbers are, by kind, one for each row and component, then others that belong to no row.
        Errors are only weights, and the groups those of `grouped`.
        """

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        return (*self.frame, *(column.unknown for column in self.columns))

    @cached_property
    def features(self) -> np.ndarray:
        """Features of the k columns, shape (n, k)."""
        none = np.zeros((len(self.poses), 0))
        return np.column_stack([none, *(column.feature for column in self.columns)])

    def owner(self, rows: np.ndarray) -> np.ndarray:
        """Index in `rows` of the row that each number of `at` belongs to; without the others."""
        return np.concatenate(
            [np.repeat(np.arange(len(rows)), len(axes)) for _, axes in self.kinds.values()]
        )

    def grouped(self, rows: np.ndarray, single: int = 0) -> np.ndarray:
        """Group of each number of `at`: its unit of poses; `single` others have one each, (m,)."""
        units = self.poses.measured.units[rows][self.owner(rows)]
        return np.concatenate([units, -1 - np.arange(single)])

    def having(self, columns: Iterable[Column]) -> Self:
        """The problem with other columns."""
        return replace(self, columns=tuple(columns))

    def errors(self, theta: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
        """Measured less predicted of some rows, for each kind (n, components) [SI]."""
        least = self.at(rows)
        off = -least.error * least.residual(theta)[: len(least.error)]
        ends = np.cumsum([len(rows) * len(axes) for _, axes in self.kinds.values()])
        return [part.reshape(len(rows), -1) for part in np.split(off, ends)[:-1]]

    def fit(self, rows: np.ndarray, start: np.ndarray) -> Fitted:
        """Fit some rows, from unknowns (p,) on."""
        least = self.at(rows)
        if self.linear:
            slope = least.project(least.effects(start))
            step = np.linalg.lstsq(slope, least.residual(start), rcond=None)[0]
            theta = start - least.scale * step
        else:
            theta = minimum(least, start)
        return Fitted(problem=self, rows=rows, least=least, theta=theta)


@dataclass(frozen=True, kw_only=True)
class Fitted(Fit):
    """A fit of some rows of a problem of static poses."""

    problem: Problem
    rows: np.ndarray

    @property
    def coefficients(self) -> np.ndarray:
        """Values of the coefficients of columns, (k,)."""
        return self.theta[len(self.problem.frame) :]

    def within(self, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compare held-back rows with the 95 % regions that this fit predicts, by the first kind.

        The regions follow from the unknowns' covariance and the scatter about the fit.

        Returns:
            Whether each row lies in its region; its mean square error over the predicted one.
        """
        least, axes = self.problem.at(out), len(next(iter(self.problem.kinds.values()))[1])
        m, shape = len(out) * axes, (len(out), axes)
        slope = least.project(least.effects(self.theta))[:m].reshape(*shape, -1)
        off = least.residual(self.theta)[:m].reshape(shape)
        scatter = 1.0 - np.sum(least.projected[:m] ** 2, axis=1).reshape(shape)  # about their means
        scatter = np.maximum(scatter, ROUNDING)  # a point that was visited once leaves none
        spread = slope @ self.covariance @ np.swapaxes(slope, 1, 2)
        spread = self.stretch**2 * (spread + scatter[:, :, None] * np.eye(axes))
        distance = np.einsum("na,na->n", off, np.linalg.solve(spread, off[:, :, None])[:, :, 0])
        limit = axes * fisher.ppf(CONFIDENCE, axes, max(self.freedom, 1.0))  # Hotelling's T squared
        return distance <= limit, distance / axes

    def loops(self) -> Iterator[Loop]:
        """Loops of joints whose play was fitted: how far load and approach turn each.

        Measured are partial residuals, by what a turn of the joint does to each row.
        """
        problem, rows = self.problem, self.rows
        poses, owner, first = problem.poses, problem.owner(rows), len(problem.frame)
        residual = -self.residual[: len(owner)]
        of_row = (owner[:, None] == np.arange(len(rows))).T  # (n, numbers)
        turns = self.coefficients * problem.features
        for i, play in enumerate(problem.columns):
            if play.term.kind != "play":
                continue
            bare = replace(play, feature=np.ones(len(poses)))
            plain = problem.having([*problem.columns[:i], bare, *problem.columns[i + 1 :]]).at(rows)
            effect = plain.effects(self.theta)[: len(owner), first + i] / play.unknown.scale
            turned = sum(
                turns[:, k] for k, column in enumerate(problem.columns)
                if column.index == play.index and column.target == COORDINATE
                and column.moves is None and column.term.kind in _BY_LOAD
            )  # fmt: skip
            unit = play.unknown.unit
            yield Loop.beside(
                play.joint,
                (poses.load[rows, play.index], "load", "N" if unit == "m" else "N*m"),
                np.asarray(turned)[rows],
                unit,
                np.sign(poses.approach[rows, play.index]).astype(int),
                of_row * effect,
                of_row * residual,
            )
