"""Kinematic calibration with play, from static poses whose tool was measured (`calibrate`).

1. Poses of base and tool are unknown. The search begins at the best of a grid of rotations, without
   any errors of the chain (`Placed.begun`).
2. Offsets, lengths, compliance, play and encoder errors are fitted with them. A cause is kept only
   if it predicts held-back poses better (`selection`).
3. Every joint's play gets an interval or a bound, or the reason why there is none (`inference`).

Terms and methods are those of J. M. Hollerbach and C. W. Wampler (International Journal of Robotics
Research 15, 1996); play, priors and the rule for held-back poses are added here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from jointplay.accuracy.poses import moving
from jointplay.base.errors import JointplayError, require_a
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords
from jointplay.base.units import rounded
from jointplay.estimate import planning, static_poses
from jointplay.estimate.calibrated import Calibration
from jointplay.estimate.inference import infer
from jointplay.estimate.inference import notes as notes_on
from jointplay.estimate.kinematic_model import COORDINATE, Poses, Term
from jointplay.estimate.least_squares import LeastSquares
from jointplay.estimate.planning import MeasurementPlan
from jointplay.estimate.pose_problem import Problem
from jointplay.estimate.selection import Selection, Step, held_back
from jointplay.estimate.unknowns import (
    FARTHEST_M,
    NORMAL_QUANTILE,
    ROUNDING,
    TINY,
    TWO_SIDED,
    Estimate,
    Unknown,
)
from jointplay.model.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.model.payload import Payload

TERMS = ("offset", "placement", "compliance", "eccentricity", "play")
"""Causes that are tried if none are named."""
CANDIDATES = 200
"""Number of poses among which a plan chooses (measured: half widths of the SO-101's 30 poses from
48 are 5 % wider, from 32 they are 9 %, and a single one by 60 %)."""
DRAWS = 1000
"""Random draws of coefficients for an effect's interval, each end of which is beyond 25 of them."""
_FRAME = tuple(f"{what} {axis}" for what in ("base", "base r", "tool", "tool r") for axis in "xyz")
"""Names of the unknowns of base and tool: place and rotation vector of each."""
SCATTER = (1e-3, 5e-3)
"""Standard deviation of positions [m] and orientations [rad] about the model, where nothing is
known yet: of robots that were not calibrated. `calibrate` then estimates it from the fit of all
terms (judged: with three times as much the same is known of 6 robots of
benchmarks/truth/calibrate.py, within 0.3 %)."""
_SAME_POINT_M = 0.02
"""Prior width of the tool's point where only the point is the same each time, which cannot tell a
longer tool from a longer arm [m]: measured by hand (judged). Otherwise base, tool and their
rotations may be anywhere: `FARTHEST_M` [m, rad]."""
_SCATTER_ROUNDS = 4
"""Rounds in which the scatter is estimated, which depends on the fit, and this on the scatter by
the priors (measured: with 8 no interval of these 6 robots changes by more than 0.1 %)."""
_TURNS_TRIED = 4
"""Rounds in which, without orientations, base and tool are placed in turn from each rotation of the
grid: enough to tell which is the best start (measured: with 3 or 8 it is the same for these 6)."""


@dataclass(frozen=True)
class Placed(Problem):
    """Poses of the tool, or of a tool that was at unknown points, with base and tool anywhere."""

    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """Nominal place of the tool's point in the tool frame, shape (3,) [m]."""
    point_width: float = FARTHEST_M
    """Width of the point's prior [m]."""
    turned: tuple[np.ndarray, np.ndarray] = (np.eye(3), np.eye(3))
    """Rotations from which the unknown ones are counted: of the mechanism's base in the
    instrument's axes, and of what was measured in the last body."""

    @property
    def closure(self) -> bool:
        """Whether the tool was at the same points, at unknown places, several times each."""
        return self.poses.measured.point is not None

    @cached_property
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        kinds: dict[str, tuple[str, tuple[str, ...]]] = {"position": ("m", ("x", "y", "z"))}
        if self.poses.measured.orientation is not None:
            kinds["orientation"] = ("rad", ("rx", "ry", "rz"))
        return kinds

    @cached_property
    def _free(self) -> np.ndarray:
        """Indices of the unknowns among the 12 of `_FRAME` and the coefficients.

        Closure says nothing of the base, positions alone nothing of the tool's rotation.
        """
        sizes = [6, 3, 3, len(self.columns)]
        return np.flatnonzero(np.repeat([not self.closure, True, len(self.kinds) > 1, True], sizes))

    @cached_property
    def _at_rest(self) -> np.ndarray:
        """Nominal values of `_FRAME`; of the tool's point in the last body's frame [m]."""
        placement = self.poses.tool
        point = placement.rotation @ self.point + placement.translation
        return np.asarray([*np.zeros(6), *point, *np.zeros(3)])

    @cached_property
    def frame(self) -> tuple[Unknown, ...]:
        widths = np.repeat([FARTHEST_M, FARTHEST_M, self.point_width, FARTHEST_M], 3)
        unknowns = [
            Unknown("", name, "", value, spread=width, least=-np.inf, sought=False, model_error=0.0)
            for name, value, width in zip(_FRAME, self._at_rest, widths, strict=True)
        ]
        return tuple(unknowns[i] for i in self._free if i < len(_FRAME))

    def at(self, rows: np.ndarray) -> LeastSquares:
        measured, n = self.poses.measured, len(rows)
        known, error = [np.zeros(3 * n)], [np.full(3 * n, self.error[0])]
        nuisance = None
        pairs: list[tuple[np.ndarray, np.ndarray]] = []
        if measured.position is not None:
            known = [measured.position[rows].ravel()]
        if len(self.kinds) > 1:
            known.append(np.zeros(3 * n))
            error.append(np.full(3 * n, self.error[1]))
        if self.closure:  # the points' places are nuisances
            names = np.array(measured.point)[rows]
            masks = {str(name): names == name for name in dict.fromkeys(names)}
            known_distances = {p: d for p, d in measured.distances.items() if set(p) <= set(masks)}
            pairs = [(masks[first], masks[second]) for first, second in known_distances]
            known.append(np.array([length for length, _ in known_distances.values()]))
            error.append(np.array([deviation for _, deviation in known_distances.values()]))
            nuisance = np.zeros((3 * n + len(known_distances), 3 * len(masks)))
            nuisance[: 3 * n] = np.kron(np.column_stack(list(masks.values())), np.eye(3))

        def apart(points: np.ndarray) -> list[np.ndarray]:
            return [points[a].mean(axis=0) - points[b].mean(axis=0) for a, b in pairs]

        def predicted(theta: np.ndarray) -> np.ndarray:
            rotations, points, *_ = self._place(theta, rows)
            parts = [points.ravel(), np.linalg.norm(np.reshape(apart(points), (-1, 3)), axis=1)]
            if measured.orientation is not None and len(self.kinds) > 1:
                off = measured.orientation[rows] @ np.swapaxes(rotations, 1, 2)
                parts.insert(1, -static_poses.rotation_vectors(off).ravel())
            return np.concatenate(parts)

        def slopes(theta: np.ndarray) -> np.ndarray:
            _, points, moves, turns = self._place(theta, rows, jacobian=True)
            parts = [moves.reshape(3 * n, -1)]
            if len(self.kinds) > 1:
                parts.append(turns.reshape(3 * n, -1))
            for between, (first, second) in zip(apart(points), pairs, strict=True):
                slope = moves[first].mean(axis=0) - moves[second].mean(axis=0)
                parts.append((between @ slope)[None] / max(float(np.linalg.norm(between)), TINY))
            return np.concatenate(parts)

        return LeastSquares(
            self.unknowns, predicted, np.concatenate(known), np.concatenate(error), nuisance,
            groups=(self.grouped(rows, len(pairs)),), jacobian=slopes, weights=True, safety=1.0,
        )  # fmt: skip

    def _place(
        self, theta: np.ndarray, rows: np.ndarray, jacobian: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotations (n, 3, 3) and points (n, 3) of the tool in some rows, and their derivatives.

        Derivatives of points, and of rotations as small rotation vectors from the left, by the
        unknowns are of shape (n, 3, unknowns) each; none without `jacobian`.
        """
        parameters = np.concatenate([self._at_rest, np.zeros(len(self.columns))])
        parameters[self._free] = theta
        frame, coefficients = np.split(parameters, [len(_FRAME)])
        place, base_turn, reach, grip_turn = frame.reshape(4, 3)
        base = static_poses.rotations_of(base_turn) @ self.turned[0]
        grip = self.turned[1] @ static_poses.rotations_of(grip_turn)
        # Errors are of a joint's coordinate, of one component of its placement, or of all six
        # together (`Column.moves`).
        poses, moved = self.poses, self.features[rows] * coefficients
        joints, targets = (
            np.array([getattr(column, name) for column in self.columns], int)
            for name in ("index", "target")
        )
        q = poses.q[rows].copy()
        displacements = {
            k: c.moves[rows] for k, c in enumerate(self.columns) if c.moves is not None
        }
        own_coordinate = (targets == COORDINATE) & ~np.isin(
            np.arange(len(joints)), list(displacements)
        )
        np.add.at(q.T, joints[own_coordinate], moved[:, own_coordinate].T)
        shift = None
        if not own_coordinate.all():
            placed = ~own_coordinate
            placed[list(displacements)] = False
            shift = np.zeros((len(rows), len(poses.names), 6))
            at = joints[placed], targets[placed]
            np.add.at(shift.transpose(1, 2, 0), at, moved[:, placed].T)
            for k, moves in displacements.items():
                shift[:, joints[k]] += moved[:, k, None] * moves
        body, origin, axes, origins, frames = poses.forward(q, shift)
        tip = origin + body @ reach
        rotations, points = base @ body @ grip, place + tip @ base.T
        if not jacobian:
            none = np.zeros((0, 3, len(theta)))
            return rotations, points, none, none
        # A coefficient turns the tool about, or moves it along, the axis of its joint or of the
        # frame of its placement.
        lines = np.where(
            own_coordinate[:, None, None], axes[joints], frames[joints, :, :, targets % 3]
        )
        turning = np.where(own_coordinate, poses.turns[joints], targets >= 3)[:, None, None]
        turn = np.where(turning, lines, 0.0)
        move = np.where(turning, np.cross(lines, tip - origins[joints]), lines)
        for k, moves in displacements.items():
            slid, turn[k] = (
                np.einsum("nab,nb->na", frames[joints[k]], part)
                for part in (moves[:, :3], moves[:, 3:])
            )
            move[k] = slid + np.cross(turn[k], tip - origins[joints[k]])
        scale = self.features[rows].T[:, :, None]
        moves = (scale * move @ base.T).transpose(1, 2, 0)
        turns = (scale * turn @ base.T).transpose(1, 2, 0)
        # Rotation vectors do not add: the Jacobians of their exponential say what a change turns.
        about, within = pin.Jexp3(-base_turn), pin.Jexp3(grip_turn)
        eye, none = np.tile(np.eye(3), (len(rows), 1, 1)), np.zeros((len(rows), 3, 3))
        arms = np.cross((tip @ base.T)[:, None], np.eye(3)) @ about
        moves = np.concatenate([eye, arms, base @ body, none, moves], axis=2)
        turns = np.concatenate([none, eye @ about, none, rotations @ within, turns], axis=2)
        return rotations, points, moves[:, :, self._free], turns[:, :, self._free]

    def begun(self) -> tuple[Placed, np.ndarray]:
        """The problem counted from the rough poses of base and tool, and the unknowns there.

        These are found without any errors of the chain, whatever the instrument's frame is: from
        each rotation of a grid, places follow from linear least squares, and rotations by Kabsch.
        """
        if self.closure:
            return self, self._at_rest[self._free]
        body, origin, *_ = self.poses.forward(self.poses.q, None)
        measured = self.poses.measured
        assert measured.position is not None
        position, n, eye = measured.position, len(self.poses), np.eye(3)
        centred = position - position.mean(axis=0)
        orientation = measured.orientation
        back = np.swapaxes(body, 1, 2)
        starts = []
        for base in _grid():
            grip = eye
            # Without orientations the base turns to where the points are; with them the grid is
            # enough for what follows.
            for _ in range(1 if orientation is not None else _TURNS_TRIED):
                mixed = base @ body.sum(axis=0)
                matrix = np.block([[n * eye, mixed], [mixed.T, n * eye]]) + ROUNDING * np.eye(6)
                goal = position - origin @ base.T
                inner = np.einsum("nab,nb->a", back, goal @ base)
                solved = np.linalg.solve(matrix, np.concatenate([goal.sum(axis=0), inner]))
                at, reach = solved[:3], solved[3:]
                tip = origin + body @ reach
                if orientation is None:
                    base = static_poses.nearest_rotation(centred.T @ (tip - tip.mean(axis=0)))
                    at = position.mean(axis=0) - base @ tip.mean(axis=0)
            cost = float(np.sum((position - at - tip @ base.T) ** 2)) / self.error[0] ** 2
            if orientation is not None:
                apart = back @ base.T @ orientation
                grip = static_poses.nearest_rotation(apart.sum(axis=0))
                # Half of the Frobenius norm's square is the angle's, where that is small.
                cost += 0.5 * float(np.sum((apart - grip) ** 2)) / self.error[1] ** 2
            starts.append((cost, at, base, reach, grip))
        _, at, base, reach, grip = min(starts, key=lambda option: option[0])
        start = np.concatenate([at, np.zeros(3), reach, np.zeros(3)])
        return replace(self, turned=(base, grip)), start[self._free]


@known_keywords
def calibrate(
    mechanism: Mechanism | str | Path,
    poses: static_poses.StaticPoses | str | Path,
    terms: Sequence[Term | str] = TERMS,
    *,
    always: Sequence[Term | str] = (),
    folds: int | str = 3,
    error: tuple[float, float] | None = None,
    payloads: Sequence[Payload] = (),
    point: Sequence[float] = (0.0, 0.0, 0.0),
    point_width: float | None = None,
    progress: bool = False,
) -> Calibration:
    """Fit causes of errors to static poses, and keep those that predict held-back poses better.

    Forward selection: to what is kept, the term is added whose fit predicts held-back poses best,
    as long as that is better by more than chance (`known.improves`); then terms are dropped without
    which predictions are not worse by more than chance. Base and tool are always unknown.
    Intervals are those of the linearised fit with priors, all candidates free, by Student's t, or
    of the sandwich over independent units where that is wider; all hold for every friction and
    transition of play whose fit is not significantly worse.

    Args:
        mechanism: open chain, or a URDF or robot's name; the tool is the mechanism's.
        poses: static poses, or the path of a CSV file (docs/calibrate.md).
        terms: candidates, as `Term` or text such as ``"compliance elbow,wrist"``.
        always: terms that are in every model.
        folds: every k-th row is held back in turn; ``"rows"``: each; ``"groups"``, ``"points"``:
            each of them. Closure data are held back by groups, or by points if there is one group.
        error: scatter of positions [m] and orientations [rad] about the model, by which they are
            weighted against each other and the priors; estimated from the fit of all `always` and
            `terms` if None. Intervals follow from the residuals.
        payloads: bodies that the mechanism carried all the time.
        point: nominal place of the measured point in the tool frame, shape (3,) [m].
        point_width: width of the point's prior [m]; None: 0.02 for closure, 10 otherwise.
        progress: whether to show a bar if it takes more than two seconds.

    Raises:
        JointplayError: see `StaticPoses`, `Term`, `Poses`; nothing measured; a number of
            folds that does not fit.
    """
    require_a("mechanism", mechanism, "Mechanism", "str", "Path")
    require_a("poses", poses, "StaticPoses", "str", "Path")
    if not isinstance(mechanism, Mechanism):
        mechanism = Mechanism(mechanism)
    if not isinstance(poses, static_poses.StaticPoses):
        poses = read_poses(mechanism, poses)
    if poses.position is None and poses.point is None:
        raise JointplayError(
            f"{poses.source}: nothing measured: neither positions of the tool nor points"
        )
    candidates = [term if isinstance(term, Term) else Term.parse(term) for term in terms]
    fixed = [term if isinstance(term, Term) else Term.parse(term) for term in always]
    all_poses = Poses(mechanism, poses, payloads)
    groups, held = held_back(poses, folds)
    if point_width is None:
        point_width = _SAME_POINT_M if poses.point is not None else FARTHEST_M
    scatter = error or SCATTER
    base = Placed(all_poses, scatter, (), np.asarray(point, float), point_width)
    base, start = replace(base, error=scatter[: len(base.kinds)]).begun()
    count = len(candidates)
    total = (count * (count + 1) // 2 + 1) * (len(groups) + 1)
    with ProgressBar(total=total, desc="models", delay=2.0, disable=not progress) as bar:
        fits = Selection(base, groups, start, all_poses.known, bar.update)
        if error is None:
            _estimate_scatter(fits, [*fixed, *candidates])
        name = "base and tool" + "".join(f" + {term.short}" for term in fixed)
        selected = fits.run(name, fixed, [[term] for term in candidates])
        known = infer(fits, selected, candidates)
        notes, effects = notes_on(fits, selected), _effects(fits, selected)
    if poses.exchanged:
        rows = ", ".join(str(i + 1) for i in poses.exchanged)
        notes.append(
            f"note: labels of markers are exchanged in {len(poses.exchanged)} of {len(poses)} rows "
            f"({rows}); put right"
        )
    return Calibration(
        poses, tuple(fits.steps), known.coefficients, known.play, folds=held, notes=tuple(notes),
        effects=effects, full=known.full,
    )  # fmt: skip


@known_keywords
def plan_calibration(
    mechanism: Mechanism,
    terms: Sequence[Term | str] = TERMS,
    *,
    count: int = 20,
    error: tuple[float, float] = SCATTER,
    payloads: Sequence[Payload] = (),
    point: Sequence[float] = (0.0, 0.0, 0.0),
    seed: int = 0,
) -> MeasurementPlan:
    """Plan the poses whose measurement would tell most of the coefficients of terms.

    Args:
        mechanism, terms, payloads, point: see `calibrate`.
        count: number of poses.
        error: scatter of positions [m] and orientations [rad] about the model.
        seed: of the poses to choose from, which are spread over the workspace.

    Raises:
        JointplayError: see `Term`, `Poses`; no pose is free of self-collision.
    """
    require_a("mechanism", mechanism, "Mechanism")
    ideal = mechanism.ideal()
    free, notes = planning.free_poses(ideal, None, seed, CANDIDATES)
    names = tuple(moving(ideal))
    motor = free[:, [ideal.coordinate(name) for name in names]]
    n = len(motor)
    still = static_poses.StaticPoses(
        names, motor, position=np.zeros((n, 3)), orientation=np.tile(np.eye(3), (n, 1, 1)),
        ordered=False,
    )  # fmt: skip
    poses = Poses(mechanism, still, payloads)
    columns = [
        # Of features that would be chosen, one from the middle.
        column if column.options is None else
        replace(column, feature=column.options[:, column.options.shape[1] // 2])
        for term in terms
        for column in poses.columns(term if isinstance(term, Term) else Term.parse(term))
    ]  # fmt: skip
    base = Placed(poses, error, tuple(columns), np.asarray(point, float))
    rows, nominal = np.arange(n), np.array([column.nominal for column in base.unknowns])
    information = planning.Information.of(base.at(rows), nominal, base.owner(rows))
    options = [planning.Experiment(tuple(row), None, passes=False) for row in motor.tolist()]
    text = (
        f"scatter of positions {rounded(error[0], 'm')}, of orientations {rounded(error[1], 'rad')}"
    )
    return planning.planned(
        ideal, base.unknowns, information, options, count, f"statistical, linearised; {text}", notes
    )


def read_poses(mechanism: Mechanism, path: str | Path) -> static_poses.StaticPoses:
    """Read static poses of a mechanism from a CSV file, see `StaticPoses.from_csv`."""
    entries = mechanism.description.joints
    joints = {name: name in entries and entries[name].slides for name in mechanism.ideal().joints}
    return static_poses.StaticPoses.from_csv(path, joints)


def _estimate_scatter(fits: Selection, terms: Sequence[Term]) -> None:
    """Set the errors of a selection's problem to the scatter about the fit of all terms, per axis.

    Degrees of freedom are the share of each coefficient that the poses determine.
    """
    m = 3 * len(fits.rows)
    for _ in range(_SCATTER_ROUNDS):
        fitted, _ = fits.fit(terms, fits.rows)
        fits.start = fitted.theta[: len(fits.start)]
        sizes = []
        for k, residual in enumerate(fitted.problem.errors(fitted.theta, fits.rows)):
            part = slice(k * m, (k + 1) * m)
            slope, span = fitted.effect[part], fitted.least.projected[part]
            determined = float(np.sum((slope @ fitted.covariance) * slope) + np.sum(span**2))
            sizes.append(
                max(float(np.sqrt(np.sum(residual**2) / max(m - determined, 1.0))), ROUNDING)
            )
        fits.base = replace(fits.base, error=tuple(sizes))


def _effects(fits: Selection, selected: Step) -> tuple[Estimate, ...]:
    """Effect of each kept term on the tool's position, RMS over the poses [m].

    Beyond what other poses of base and tool would do; intervals by draws of the coefficients.
    """
    n, fitted, first, effects = len(fits.rows), selected.fitted, len(fits.start), []
    half = fits.excess * fitted.half_widths()
    random, scale = np.random.default_rng(0), fitted.least.scale
    frame = fitted.effect[: 3 * n, :first]
    for term in selected.terms:
        numbers = [
            i for i, column in enumerate(fitted.problem.columns)
            if (column.term.kind, column.term.joints, column.term.by)
            == (term.kind, term.joints, term.by)
        ]  # fmt: skip
        if not numbers:
            continue
        at = first + np.array(numbers)
        slope = fitted.effect[: 3 * n, at]
        moved = slope - frame @ np.linalg.lstsq(frame, slope, rcond=None)[0]
        moved = fits.base.error[0] * moved / np.sqrt(n)
        covariance = fitted.covariance[np.ix_(at, at)]
        wider = half[at] / (NORMAL_QUANTILE * np.sqrt(np.diag(covariance)) * scale[at])
        value = fitted.theta[at] / scale[at]
        drawn = random.multivariate_normal(value, covariance * np.outer(wider, wider), DRAWS)
        size = float(np.linalg.norm(moved @ value))
        low, high = np.quantile(
            np.linalg.norm(moved @ drawn.T, axis=0), [1.0 - TWO_SIDED, TWO_SIDED]
        )
        ends = min(float(low), size), max(float(high), size)
        effect = Unknown("", term.short, "m", sought=False, fine=False)
        effects.append(Estimate(effect, size, ends=ends))
    return tuple(effects)


@cache
def _grid() -> list[np.ndarray]:
    """Rotations no more than some 40 degrees apart: those of the cube, each with four yaws."""
    yaws = Rotation.from_rotvec(np.outer(np.arange(4) * np.pi / 8.0, [0.0, 0.0, 1.0]))
    return [(rotation * yaw).as_matrix() for rotation in Rotation.create_group("O") for yaw in yaws]
