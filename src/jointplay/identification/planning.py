"""Which poses and motions would tell most: the Fisher information of what could be measured.

An experiment is a pose that is passed slowly in both directions, with or without a push on the
tool, or at which the machine stands and the tool is pushed one way and the other. Each adds its
information; the offset of its place, which nobody knows, is taken out first. What all experiments
share and nobody knows, how the machine gives way, is estimated with the unknowns; for that each
push is made with two sizes. Experiments are chosen one after the other, each time the one after
which the unknowns are told best: the largest fall of the sum of their logarithmic variances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from jointplay.core.errors import JointplayError, require_positive
from jointplay.design.poses import moving, over_workspace
from jointplay.identification.fit import BLIND, CONFIDENCE, SHARE, LeastSquares, offsets
from jointplay.identification.measurement import Key, Visits
from jointplay.identification.model import StaticModel, tool_positions
from jointplay.identification.parameters import (
    TOOL,
    UNKNOWN,
    WAYS,
    WOUND,
    Compliance,
    Given,
    Parameter,
    compliances,
    unknowns,
)
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.mechanism import Mechanism
from jointplay.result.result import AXES

NOISE = {"tool": 20e-6, "link": 1e-4, "torque": 0.1}
"""Of single records, where nothing better is known [m, rad, N m]."""
RECORDS = 25
"""Of a visit, whose mean is taken."""
SPEED = 0.2
"""At which poses are passed [rad/s or m/s]."""
PUSH_N = 20.0
"""With which the tool is pushed [N]."""
TOLD, SMALL = 0.5, 0.25
"""An unknown is told if half of its interval is less than this part of it; what is less than
`SMALL` of its scale counts as this much."""
POSES = 48
"""Among which a plan chooses."""
OFFERED = 16
"""Poses among which one is sought that tells what a measurement could not."""
SIZES = (1.0, 0.4)
"""Of a push, where play is to be told from elasticity."""
SOFT = {"rad/(N*m)": 1e-5, "m/N": 1e-7}
"""Scales of compliances, by unit; `_PRIOR` is relative to them, too."""
_OVERCOMES, _STRONGEST_N = 2.0, 100.0
"""Weights of the machine with which it is offered to push besides, and the most [N]."""
_APPROACH = 0.05
"""Way before a pose that is passed [rad or m]."""
_PRIOR = 1e-4
"""Information that unknowns have before, in their scales: next to none."""


@dataclass(frozen=True)
class Experiment:
    """Something that can be measured."""

    positions: tuple[float, ...]
    """Of the moving joints [rad or m]."""
    force: tuple[float, float, float] | None
    """With which the tool is pushed, this and the other way [N]; None: not at all."""
    passes: bool
    """Passed both ways (with each force, if any), or stood at."""
    sizes: tuple[float, ...] = SIZES
    """Parts of the force with which the tool is pushed, too."""

    def words(self, joints: Sequence[str]) -> str:
        """One line."""
        pose = ",".join(f"{n}={x:.3g}" for n, x in zip(joints, self.positions, strict=True))
        if self.force is None:
            return f"pass slowly both ways: {pose}"
        size = float(np.linalg.norm(self.force))
        push = " and ".join(f"{part * size:g} N" for part in self.sizes)
        axis = AXES[int(np.argmax(np.abs(self.force)))]
        if self.passes:
            words = f"with {push} on the tool along +{axis}, then with -{axis}"
            return f"pass slowly both ways {words}: {pose}"
        return f"push the tool {push} along +{axis}, then -{axis}, at {pose}"


@dataclass(frozen=True)
class MeasurementPlan:
    """Experiments in the order in which they should be made, and what they would tell."""

    joints: tuple[str, ...]
    unknowns: tuple[Parameter, ...]
    experiments: tuple[Experiment, ...]
    half_width: np.ndarray
    """Expected 95 % half widths after each experiment, (experiments, unknowns) [SI]."""
    partners: tuple[tuple[str, ...], ...]
    """Of each unknown, those that it cannot be told apart from."""
    signals: tuple[Key, ...]
    noise: Mapping[str, float]

    def __str__(self) -> str:
        """The experiments, then what they would tell together."""
        lines = [f"{i + 1:>2}. {one.words(self.joints)}" for i, one in enumerate(self.experiments)]
        lines.append(f"{'unknown':<34} {'nominal':>12}  expected 95 % interval")
        last = self.half_width[-1]
        for one, half, others in zip(self.unknowns, last, self.partners, strict=True):
            if one.sought:
                told = half <= TOLD * one.scale
                words = f"+- {one.shown(half)}" if told else _dark(one, half, others)
                lines.append(f"{one.label:<34} {one.shown(one.nominal):>12}  {words}")
        noise = ", ".join(
            f"{kind} {self.noise[kind]:g} {_unit(kind)}"
            for kind in dict.fromkeys(kind for kind, _ in self.signals)
        )
        lines.append(
            f"statistical, from the static model at the nominal values; noise of a record: {noise}"
            f"; {RECORDS} records a visit, passing at {SPEED:g} rad/s"
        )
        return "\n".join(lines)


def _dark(one: Parameter, half: float, others: Sequence[str]) -> str:
    if others:
        return f"cannot tell: acts only together with {', '.join(others)}"
    return "cannot tell" + ("" if half > 10.0 * one.scale else f" (+- {one.shown(half)})")


def _unit(kind: str) -> str:
    return {"tool": "m", "link": "rad", "torque": "N m"}[kind]


def plan_measurement(
    mechanism: Mechanism,
    *,
    signals: Sequence[str] = ("tool",),
    noise: Mapping[str, float] | None = None,
    count: int = 6,
    push: float = PUSH_N,
    joint_friction: Mapping[str, JointFriction] | None = None,
    also: Sequence[str] = (),
    known: Sequence[str] = (),
    stiffness: Given | None = None,
    poses: np.ndarray | None = None,
    seed: int = 0,
) -> MeasurementPlan:
    """Experiments that would tell most about a mechanism's play.

    Args:
        mechanism: with the play that is expected.
        signals: what can be measured besides the motors' encoders: ``tool``, ``link``, ``torque``.
        noise: standard deviation of a record by kind of signal [SI]; `NOISE` where not given.
        count: of experiments.
        push: with which the tool can be pushed [N]; 0: not at all.
        joint_friction: of the joints besides their bearings'; None takes the URDF's.
        also, known, stiffness: see `identify`.
        poses: configurations to choose from, (n, nq); None: spread over the workspace.
        seed: of these.

    Raises:
        JointplayError: nothing has play; loops; a signal or number that cannot be.
    """
    if count < 1:
        raise JointplayError(f"at least one experiment is needed, got {count}")
    friction = joint_friction if joint_friction is not None else urdf_friction(mechanism)
    names = tuple(moving(mechanism))
    keys = all_keys(mechanism, signals)
    spread = {**NOISE, **(noise or {})}
    if poses is None:
        poses = over_workspace(mechanism, POSES, seed)
    places = poses[:, [mechanism.coordinate(name) for name in names]]
    torqued = [name for kind, name in keys if kind == "torque"]
    given = compliances(mechanism, stiffness or {})
    sought = unknowns(mechanism, friction, torqued, push > 0.0, also, known, given)
    options = experiments(places, push, sizes(mechanism, sought, given))
    told = informations(mechanism, friction, sought, given, keys, spread, names, options)
    chosen, widths = _greedy(sought, told, count)
    others = _partners(sought, told, chosen)
    return MeasurementPlan(
        names, sought, tuple(options[i] for i in chosen), widths, others, keys, spread
    )


def sizes(
    mechanism: Mechanism, sought: Sequence[Parameter], given: Mapping[str, Compliance]
) -> tuple[float, ...]:
    """Parts of a push that are needed: one if the machine is known to be rigid."""
    ways = [f"{name} {way}" for name in moving(mechanism) for way in WAYS]
    ways = [
        label for label in (*ways, TOOL) if label.removesuffix(" torsional") not in mechanism.gears
    ]
    soft = any(given.get(label, UNKNOWN).spread > 0.0 for label in ways)
    soft |= any(one.name in WOUND for one in sought)
    return SIZES if soft else SIZES[:1]


def enough(one: Parameter, value: float) -> float:
    """Half width of an interval with which an unknown is told [SI]."""
    return TOLD * max(value, SMALL * one.scale)


def urdf_friction(mechanism: Mechanism) -> dict[str, JointFriction]:
    """What the URDF says of its joints' friction."""
    entries = mechanism.description.joints
    return {
        name: JointFriction(entries[name].friction, entries[name].damping)
        for name in mechanism.joints
        if name in entries
    }


def all_keys(mechanism: Mechanism, signals: Sequence[str]) -> tuple[Key, ...]:
    """All signals of these kinds.

    Raises:
        JointplayError: no such kind, or none that any joint has.
    """
    keys: list[Key] = []
    for kind in signals:
        if kind == "tool":
            keys += [("tool", axis) for axis in AXES]
        elif kind == "link":
            keys += [("link", name) for name in mechanism.gears]
        elif kind == "torque":
            keys += [("torque", name) for name in moving(mechanism)]
        else:
            raise JointplayError(f"no signal {kind!r} to plan with: tool, link, torque")
    if not keys:
        raise JointplayError("link encoders tell of gears with play only, and there are none")
    return tuple(keys)


def experiments(
    places: np.ndarray, push: float, parts: tuple[float, ...] = SIZES
) -> list[Experiment]:
    """All that can be done at joint positions (n, j), with these parts of a push [N]."""
    if push:
        require_positive("push", push, "N")
    options = []
    for row in places:
        at = tuple(float(x) for x in row)
        options.append(Experiment(at, None, passes=True))
        for axis in np.eye(3) if push else ():
            x, y, z = (float(part) for part in push * axis)
            options += [Experiment(at, (x, y, z), passes, parts) for passes in (False, True)]
    return options


@dataclass(frozen=True)
class Information:
    """Of k experiments, about p unknowns by their scales and c compliances by theirs."""

    gains: np.ndarray
    """Shape (k, p + c, p + c)."""
    before: np.ndarray
    """What is known before, shape (p + c, p + c)."""
    soft: tuple[str, ...]
    """Labels of the compliances."""


def informations(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    sought: tuple[Parameter, ...],
    given: Mapping[str, Compliance],
    keys: tuple[Key, ...],
    noise: Mapping[str, float],
    names: tuple[str, ...],
    options: Sequence[Experiment],
    theta: np.ndarray | None = None,
) -> Information:
    """Fisher information of each experiment."""
    made = _visits(names, options)
    model = StaticModel(mechanism, made, keys, friction, sought, given)
    tool = tool_positions(mechanism, names, made.position)
    n, c = len(made), len(keys)
    error = np.array([noise[kind] / np.sqrt(RECORDS) for kind, _ in keys])
    measured = np.ones((n, c), bool)
    torques = np.array([kind == "torque" for kind, _ in keys])
    measured[made.stopped[:, None] & torques] = False  # the drive may hold any part of friction
    at = np.array([one.nominal for one in sought]) if theta is None else theta
    at = np.maximum(at, 0.05 * np.array([one.scale for one in sought]))
    problem = LeastSquares(
        sought,
        lambda x: model.predict(x).ravel(),
        np.zeros(n * c),
        np.tile(error, n),
        np.zeros((n * c, 0)),
        (),
    )
    gives = [SOFT[one.unit] * one.effect.reshape(n * c, -1) for one in model.elastic]
    effect = np.column_stack([problem.sensitivity(at), *(problem.whiten(one) for one in gives)])
    count = effect.shape[1]
    effect = effect.reshape(n, c, count)
    loose = model.loose()
    matrices = []
    for number in range(len(options)):
        mine = made.cell == number
        free = offsets(keys, made.cell[mine], made.position[mine], tool[mine], "place")
        free = np.concatenate([free, loose[mine]], axis=2)
        use = (measured & model.certain[:, None])[mine].ravel()
        rows = effect[mine].reshape(-1, count)[use]
        basis, sizes, _ = np.linalg.svd(free.reshape(-1, free.shape[2])[use], full_matrices=False)
        basis = basis[:, sizes > 1e-9]
        rows = rows - basis @ (basis.T @ rows)
        matrices.append(rows.T @ rows)
    return Information(np.array(matrices), *prior(sought, model))


def prior(sought: Sequence[Parameter], model: StaticModel) -> tuple[np.ndarray, tuple[str, ...]]:
    """What is known of unknowns and compliances before, by their scales, and their labels."""
    known = [one.scale / one.spread for one in sought]
    soft: list[str] = []
    for one in model.elastic:
        known += [SOFT[one.unit] / one.known.spread] * one.effect.shape[2]
        soft += [one.label] * one.effect.shape[2]
    return np.diag(np.square(known) + _PRIOR), tuple(soft)


def offers(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    sought: tuple[Parameter, ...],
    given: Mapping[str, Compliance],
    keys: tuple[Key, ...],
    noise: Mapping[str, float],
    theta: np.ndarray,
) -> list[tuple[np.ndarray, str]]:
    """What could be measured besides: information (see `Information`) and words, simplest first.

    Args:
        mechanism: with the play that is expected.
        friction: of the joints besides their bearings'.
        sought: the unknowns.
        given: what is known of compliances.
        keys: signals that are measured already.
        noise: of a record by kind of signal [SI].
        theta: values of the unknowns, shape (p,).
    """
    names = tuple(moving(mechanism))
    poses = over_workspace(mechanism, OFFERED)
    places = poses[:, [mechanism.coordinate(name) for name in names]]
    weight = sum(body.mass for body in mechanism.model.inertias) * np.linalg.norm(mechanism.gravity)
    strong = float(f"{min(_OVERCOMES * weight, _STRONGEST_N):.1g}")
    parts = sizes(mechanism, sought, given)
    options = experiments(places, PUSH_N, parts)
    if strong > PUSH_N:
        options += [one for one in experiments(places, strong, parts) if one.force is not None]
    options.sort(key=lambda one: (one.force is not None, one.passes))
    sets = [(keys, "")]
    more = [key for key in all_keys(mechanism, ["tool"]) if key not in keys]
    if more:
        sets.append(((*keys, *more), "with a tracker of the tool's position, "))
    for name in mechanism.gears:
        if ("link", name) not in keys:
            sets.append(((*keys, ("link", name)), f"with an encoder on the link of {name}, "))
    choices = []
    for wanted, words in sets:
        told = informations(
            mechanism, friction, sought, given, wanted, noise, names, options, theta
        )
        choices += [
            (gain, words + one.words(names)) for gain, one in zip(told.gains, options, strict=True)
        ]
    return choices


def _visits(names: tuple[str, ...], options: Sequence[Experiment]) -> Visits:
    """Each experiment's visits: passed this way and the other, under each push."""
    j = len(names)
    position: list[np.ndarray] = []
    speed, direction, stopped, force, cell = [], [], [], [], []
    path, owner, pushes = [], [], []
    for number, one in enumerate(options):
        at = np.array(one.positions)
        given = np.zeros(3) if one.force is None else np.array(one.force)
        forces = [part * side * given for side in (1.0, -1.0) for part in one.sizes]
        for push in forces[: 1 if one.force is None else None]:
            for side in (1.0, -1.0) if one.passes else (1.0,):
                visit = len(position)
                position.append(at)
                speed.append(np.full(j, side * SPEED if one.passes else 0.0))
                direction.append(np.full(j, side))
                stopped.append(not one.passes)
                force.append(push)
                cell.append(number)
                away = _APPROACH * side
                steps = [at + 10.0 * away, at - 10.0 * away, at - away, at]
                if not one.passes and cell[:-1][-1:] == [number]:
                    steps = [at]  # it stands there already
                path += steps
                owner += [-1] * (len(steps) - 1) + [visit]
                pushes += [push] * len(steps)
    owners = np.array(owner)
    # Loads on the way are those of the visit that it leads to.
    near = np.array([owners[i:][owners[i:] >= 0][0] for i in range(len(owners))])
    return Visits(
        names,
        np.arange(2.0 * len(position)).reshape(-1, 2),
        np.array(position),
        np.array(speed),
        np.zeros((len(position), j)),
        np.array(direction, int),
        np.array(stopped),
        np.array(force),
        np.array(cell),
        np.array(path),
        owners,
        near,
        np.array(pushes),
    )


def half_widths(sought: Sequence[Parameter], gain: np.ndarray) -> np.ndarray:
    """Expected half widths of 95 % intervals of p unknowns, shape (p,) [SI].

    Args:
        sought: the unknowns.
        gain: information about them and about c compliances, shape (p + c, p + c).
    """
    covariance = np.linalg.inv(gain)[: len(sought), : len(sought)]
    quantile = float(norm.ppf(0.5 + CONFIDENCE / 2.0))
    scale = np.array([one.scale for one in sought])
    return np.asarray(quantile * np.sqrt(np.diag(covariance)) * scale)


def _partners(
    sought: Sequence[Parameter], told: Information, chosen: Sequence[int]
) -> tuple[tuple[str, ...], ...]:
    """What acts together with each unknown in what chosen experiments do not tell."""
    labels = [one.label for one in sought] + [f"{label} compliance" for label in told.soft]
    lows, axes = np.linalg.eigh(told.before + told.gains[list(chosen)].sum(axis=0))
    dark = axes[:, lows < 1.0 / TOLD**2]
    blind = np.abs(dark @ dark.T)
    found = []
    for i, row in enumerate(blind[: len(sought)]):
        others = [k for k in np.argsort(-row) if k != i and row[k] > SHARE * row[i]]
        found.append(tuple(dict.fromkeys(labels[k] for k in others)) if row[i] > BLIND else ())
    return tuple(found)


def _greedy(
    sought: Sequence[Parameter], told: Information, count: int
) -> tuple[list[int], np.ndarray]:
    """Experiments, each the best after those before, and the half widths after each."""
    chosen: list[int] = []
    widths = []
    scale = np.array([one.scale for one in sought])
    mine = np.array([one.sought for one in sought])
    total = told.before
    for _ in range(min(count, len(told.gains))):
        after = np.array([half_widths(sought, total + gain) / scale for gain in told.gains])
        # Beyond what is told well, more of it counts for little.
        worth = np.log(np.maximum(after[:, mine], 0.02)).sum(axis=1)
        worth[chosen] += 1e-3
        best = int(worth.argmin())
        chosen.append(best)
        total = total + told.gains[best]
        widths.append(half_widths(sought, total))
    return chosen, np.array(widths)
