"""Which poses and motions would tell most: the Fisher information of what could be measured.

An experiment is a pose that is passed slowly in both directions, with or without a push on the
tool, or at which the machine stands and the tool is pushed one way and the other. Each adds its
information; the offset of its place, which nobody knows, is taken out first. Experiments are chosen
one after the other, each time the one after which the unknowns are told best: the largest fall of
the sum of their logarithmic variances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from jointplay.analysis.identify.fit import BLIND, CONFIDENCE, SHARE, Problem, offsets
from jointplay.analysis.identify.ideal import tool_positions
from jointplay.analysis.identify.model import StaticModel
from jointplay.analysis.identify.parameters import Parameter, unknowns
from jointplay.analysis.identify.reading import Key
from jointplay.analysis.identify.visits import Visits
from jointplay.analysis.poses import moving, over_workspace
from jointplay.errors import JointplayError, require_positive
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

    def words(self, joints: Sequence[str]) -> str:
        """One line."""
        pose = ",".join(f"{n}={x:.3g}" for n, x in zip(joints, self.positions, strict=True))
        if self.force is None:
            return f"pass slowly both ways: {pose}"
        size = float(np.linalg.norm(self.force))
        axis = AXES[int(np.argmax(np.abs(self.force)))]
        if self.passes:
            words = f"with {size:g} N on the tool along +{axis}, then with -{axis}"
            return f"pass slowly both ways {words}: {pose}"
        return f"push the tool {size:g} N along +{axis}, then -{axis}, at {pose}"


@dataclass(frozen=True)
class Plan:
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
    poses: np.ndarray | None = None,
    seed: int = 0,
) -> Plan:
    """Experiments that would tell most about a mechanism's play.

    Args:
        mechanism: with the play that is expected.
        signals: what can be measured besides the motors' encoders: ``tool``, ``link``, ``torque``.
        noise: standard deviation of a record by kind of signal [SI]; `NOISE` where not given.
        count: of experiments.
        push: with which the tool can be pushed [N]; 0: not at all.
        joint_friction: of the joints besides their bearings'; None takes the URDF's.
        also, known: see `identify`.
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
    sought = unknowns(mechanism, friction, torqued, push > 0.0, also, known)
    options = experiments(places, push)
    gains = informations(mechanism, friction, sought, keys, spread, names, options)
    chosen, widths = _greedy(sought, gains, count)
    others = _partners(sought, gains[chosen].sum(axis=0))
    return Plan(names, sought, tuple(options[i] for i in chosen), widths, others, keys, spread)


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


def experiments(places: np.ndarray, push: float) -> list[Experiment]:
    """All that can be done at joint positions (n, j)."""
    if push:
        require_positive("push", push, "N")
    options = []
    for row in places:
        at = tuple(float(x) for x in row)
        options.append(Experiment(at, None, passes=True))
        for axis in np.eye(3) if push else ():
            x, y, z = (float(part) for part in push * axis)
            options += [Experiment(at, (x, y, z), passes=passes) for passes in (False, True)]
    return options


def informations(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    sought: tuple[Parameter, ...],
    keys: tuple[Key, ...],
    noise: Mapping[str, float],
    names: tuple[str, ...],
    options: Sequence[Experiment],
    theta: np.ndarray | None = None,
) -> np.ndarray:
    """Fisher information of each experiment about the unknowns by their scales, (k, p, p)."""
    made = _visits(names, options)
    model = StaticModel(mechanism, made, keys, friction, sought)
    tool = tool_positions(mechanism, names, made.position)
    n, c = len(made), len(keys)
    error = np.array([noise[kind] / np.sqrt(RECORDS) for kind, _ in keys])
    measured = np.ones((n, c), bool)
    torques = np.array([kind == "torque" for kind, _ in keys])
    measured[made.stopped[:, None] & torques] = False  # the drive may hold any part of friction
    at = np.array([one.nominal for one in sought]) if theta is None else theta
    at = np.maximum(at, 0.05 * np.array([one.scale for one in sought]))
    problem = Problem(
        sought,
        lambda x: model.predict(x).ravel(),
        np.zeros(n * c),
        np.tile(error, n),
        np.zeros((n * c, 0)),
        (),
    )
    effect = problem.sensitivity(at).reshape(n, c, len(sought))
    loose = model.loose()
    matrices = []
    for number in range(len(options)):
        mine = made.cell == number
        free = offsets(keys, made.cell[mine], made.position[mine], tool[mine], "place")
        free = np.concatenate([free, loose[mine]], axis=2)
        use = (measured & model.certain[:, None])[mine].ravel()
        rows = effect[mine].reshape(-1, len(sought))[use]
        basis, sizes, _ = np.linalg.svd(free.reshape(-1, free.shape[2])[use], full_matrices=False)
        basis = basis[:, sizes > 1e-9]
        rows = rows - basis @ (basis.T @ rows)
        matrices.append(rows.T @ rows)
    return np.array(matrices)


def offers(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    sought: tuple[Parameter, ...],
    keys: tuple[Key, ...],
    noise: Mapping[str, float],
    theta: np.ndarray,
) -> list[tuple[np.ndarray, str]]:
    """What could be measured besides: information (p, p) and words, the simplest first.

    Args:
        mechanism: with the play that is expected.
        friction: of the joints besides their bearings'.
        sought: the unknowns.
        keys: signals that are measured already.
        noise: of a record by kind of signal [SI].
        theta: values of the unknowns, shape (p,).
    """
    names = tuple(moving(mechanism))
    poses = over_workspace(mechanism, OFFERED)
    places = poses[:, [mechanism.coordinate(name) for name in names]]
    weight = sum(body.mass for body in mechanism.model.inertias) * np.linalg.norm(mechanism.gravity)
    strong = float(f"{min(_OVERCOMES * weight, _STRONGEST_N):.1g}")
    options = experiments(places, PUSH_N)
    if strong > PUSH_N:
        options += [one for one in experiments(places, strong) if one.force is not None]
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
        gains = informations(mechanism, friction, sought, wanted, noise, names, options, theta)
        choices += [
            (gain, words + one.words(names)) for gain, one in zip(gains, options, strict=True)
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
        for push in (given, -given)[: 1 if one.force is None else 2]:
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
    """Expected half widths of 95 % intervals with an information (p, p), shape (p,) [SI]."""
    covariance = np.linalg.inv(gain + _PRIOR * np.eye(len(sought)))
    quantile = float(norm.ppf(0.5 + CONFIDENCE / 2.0))
    scale = np.array([one.scale for one in sought])
    return np.asarray(quantile * np.sqrt(np.diag(covariance)) * scale)


def _partners(sought: Sequence[Parameter], gain: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Unknowns that act together with each one in what an information (p, p) does not tell."""
    sizes, axes = np.linalg.eigh(gain)
    dark = axes[:, sizes < 1.0 / TOLD**2]
    blind = np.abs(dark @ dark.T)
    return tuple(
        tuple(
            sought[k].label
            for k in np.argsort(-row)
            if k != i and row[i] > BLIND and row[k] > SHARE * row[i]
        )
        for i, row in enumerate(blind)
    )


def _greedy(
    sought: Sequence[Parameter], gains: np.ndarray, count: int
) -> tuple[list[int], np.ndarray]:
    """Experiments, each the best after those before, and the half widths after each."""
    chosen: list[int] = []
    widths = []
    scale = np.array([one.scale for one in sought])
    mine = np.array([one.sought for one in sought])
    total = np.zeros(gains.shape[1:])
    for _ in range(min(count, len(gains))):
        after = np.array([half_widths(sought, total + gain) / scale for gain in gains])
        # Beyond what is told well, more of it counts for little.
        worth = np.log(np.maximum(after[:, mine], 0.02)).sum(axis=1)
        worth[chosen] += 1e-3
        best = int(worth.argmin())
        chosen.append(best)
        total = total + gains[best]
        widths.append(half_widths(sought, total))
    return chosen, np.array(widths)
