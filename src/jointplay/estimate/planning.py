"""Planning of measurements: the experiments with the most Fisher information about the unknowns.

1. Experiments that can be done are listed (`experiments`). To identify play, each is a pose that is
   passed slowly in both directions, with or without a push on the tool, or at which the machine
   stands and the tool is pushed one way and the other. To calibrate, it is a pose at which the tool
   is measured. Poses, and the ways to them, are within the joints' limits and free of
   self-collision (`free_poses`), loads within the limits of effort (`_bearable`).
2. The Fisher information of each is computed by the static model at expected values
   (`informations`), the unknown offset of its place projected out first. Compliances, which all
   experiments share, are estimated with the unknowns; for that each push is made with two sizes.
3. Experiments are chosen one after the other (`planned`), each time the one after which the sum of
   the unknowns' logarithmic variances is least. No two are alike: where the same is done, some
   joint or the tool must be `APART` elsewhere (`distances`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, islice
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.accuracy.poses import moving, over_workspace
from jointplay.base.errors import JointplayError, require_a, require_positive
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Table, few
from jointplay.estimate.columns import Key
from jointplay.estimate.known import LARGEST_SHARE, narrow
from jointplay.estimate.least_squares import LeastSquares, basis, partners
from jointplay.estimate.machine import TOOL, WAYS, Given, Machine, compliances
from jointplay.estimate.measurement import SHOWN
from jointplay.estimate.model import StaticModel
from jointplay.estimate.nuisances import offsets
from jointplay.estimate.parts import WOUND
from jointplay.estimate.unknowns import MODEL_ERROR, NORMAL_QUANTILE, TINY, Unknown
from jointplay.estimate.visits import Visits, tool_positions
from jointplay.model.collisions import SelfCollision
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import JointFriction, urdf_friction
from jointplay.simulation.motion.cartesian import joint_limits
from jointplay.simulation.result.result import AXES

NOISE = {"tool": 20e-6, "link": 1e-4, "torque": 0.1}
"""Standard deviation of a record by kind of signal, where nothing better is known [m, rad, N m]
(judged; another can be given, and it is stated with the plan)."""
RECORDS = 25
"""Number of records of a visit, whose mean is taken (judged: half a second at 50 Hz; stated with
the plan)."""
SPEED = 0.2
"""Speed at which poses are passed [rad/s or m/s] (judged: slow for robots; stated with the
plan)."""
PUSH_N = 20.0
"""Force with which the tool is pushed, where none is given [N] (judged)."""
_STRONG_WEIGHTS, _STRONGEST_N = 2.0, 100.0
"""Stronger push of advice, in weights of the machine, and its limit [N] (judged: of 30 unknowns
that 15 machines of benchmarks/truth/identify.py leave open it is what helps 8)."""
POSES = 48
"""Number of poses among which a plan chooses; advice after a measurement, among a third (measured:
from 32 the widest interval of four plans of a UR5 is a fifth wider; with 32 advice determines as
many of these 30)."""
SIZES = (1.0, 0.4)
"""Sizes of a push, as parts of it, where play is to be told from elasticity: two at least
(judged)."""
_PASSING_WAY = 0.5
"""Way of joints before and beyond a pose, unless limits leave less room [rad or m] (judged: far
more than any play, so that all teeth have crossed it)."""
_TRIED_PER_POSE = 16
"""Poses that are tried for each that is offered, until enough are free of self-collision (judged:
robots in whose workspace fewer are free must be told which to use)."""
APART = 0.1
"""Distance below which two experiments that do the same are alike, as a part of the robot's reach
(judged)."""
_PRIOR = 1e-4
"""Information that all unknowns have before, in their scales: a prior a hundred scales wide, which
says nothing and keeps matrices regular."""
_MENTIONED = 10.0
"""Half width, in scales, up to which that of an unknown which cannot be told is mentioned."""


@dataclass(frozen=True)
class Experiment:
    """A pose at which something is measured: passed, stood at, pushed."""

    positions: tuple[float, ...]
    """Positions of the moving joints [rad or m]."""
    force: tuple[float, float, float] | None
    """Force on the tool, pushed this and the other way [N]; None: not at all."""
    passes: bool
    """Whether the pose is passed both ways (with each force, if any), or stood at."""
    sizes: tuple[float, ...] = SIZES
    """Parts of the force with which the tool is pushed."""

    def instruction(self, joints: Sequence[str]) -> str:
        """Instruction for who measures, in one line."""
        pose = ",".join(f"{n}={x:.3g}" for n, x in zip(joints, self.positions, strict=True))
        if self.force is None:
            return f"{'pass slowly both ways' if self.passes else 'measure the tool at'}: {pose}"
        size = float(np.linalg.norm(self.force))
        push = " and ".join(f"{part * size:g} N" for part in self.sizes)
        axis = AXES[int(np.argmax(np.abs(self.force)))]
        if not self.passes:
            return f"push the tool {push} along +{axis}, then -{axis}, at {pose}"
        pushed = f"with {push} on the tool along +{axis}, then with -{axis}"
        return f"pass slowly both ways {pushed}: {pose}"


@dataclass(frozen=True)
class MeasurementPlan:
    """A plan: experiments in their order, and the intervals that they would give."""

    joints: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
    experiments: tuple[Experiment, ...]
    half_width: np.ndarray
    """Expected 95 % half widths before any and after each experiment, (experiments + 1, unknowns)
    [SI]."""
    partners: tuple[tuple[str, ...], ...]
    """Labels from which each unknown cannot be told apart."""
    basis: str
    """Text of what the expectations rest on."""
    gains: np.ndarray
    """Factor by which each experiment multiplies the determinant of the information about the
    unknowns that are sought, (experiments,)."""
    notes: tuple[str, ...] = ()
    """Notes on what was left out of the choice, a line each."""

    def reason(self, number: int) -> str:
        """Why an experiment was chosen: its gain of information, and which unknown gains most."""
        was, now = self.half_width[number : number + 2]
        text = "tells most of all by itself"
        if number:
            text = f"information x {self.gains[number]:.3g} (its determinant)"
        known = [
            i for i, unknown in enumerate(self.unknowns)
            if unknown.sought and narrow(unknown, unknown.scale, now[i])
        ]  # fmt: skip
        if not known:
            return text
        best = max(known, key=lambda i: was[i] / now[i])
        unknown = self.unknowns[best]
        before = "unknown"
        if narrow(unknown, unknown.scale, was[best]):
            before = f"+- {unknown.shown(was[best])}"
        return f"{text}; most about {unknown.label}: {before} to +- {unknown.shown(now[best])}"

    def __str__(self) -> str:
        lines = []
        for i, experiment in enumerate(self.experiments):
            lines += [f"{i + 1:>2}. {experiment.instruction(self.joints)}", f"    {self.reason(i)}"]
        rows = [("unknown", "nominal", "expected 95 % interval")]
        expected = zip(self.unknowns, self.half_width[-1], self.partners, strict=True)
        for unknown, half, confounded in expected:
            text = f"+- {unknown.shown(half)}"
            if not narrow(unknown, unknown.scale, half):
                near = "" if half > _MENTIONED * unknown.scale else f" ({text})"
                acts = f": acts only together with {few(list(confounded))}" if confounded else near
                text = f"cannot tell{acts}"
            if unknown.sought:
                rows.append((unknown.label, unknown.shown(unknown.nominal), text))
        return "\n".join([*lines, *self.notes, str(Table.of_texts(rows)), self.basis])


@known_keywords
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
    """Plan the experiments that would tell most about a mechanism's play.

    Args:
        mechanism: with the play that is expected.
        signals: what can be measured besides the motors' encoders: ``tool``, ``link``, ``torque``.
        noise: standard deviation of a record by kind of signal [SI]; `NOISE` where not given.
        count: number of experiments.
        push: force with which the tool can be pushed [N]; 0: not at all.
        joint_friction: friction of joints besides that of their bearings; None takes the URDF's.
        also, known, stiffness: see `identify`.
        poses: configurations to choose from, (n, nq); None: spread over the workspace.
        seed: of the random poses.

    Raises:
        JointplayError: nothing has play; loops; a signal or number that cannot be; no pose is free
            of self-collision, or no load within the limits of effort.
    """
    require_a("mechanism", mechanism, "Mechanism")
    friction = joint_friction if joint_friction is not None else urdf_friction(mechanism)
    machine = Machine(mechanism, friction, compliances(mechanism, stiffness or {}))
    known_keys = {"tool": AXES, "link": [*mechanism.gears], "torque": moving(mechanism)}
    for kind in signals:
        if kind not in known_keys:
            raise JointplayError(f"no signal {kind!r} to plan with: {', '.join(known_keys)}")
    keys = tuple((kind, name) for kind in signals for name in known_keys[kind])
    if not keys:
        raise JointplayError(
            "link encoders are informative only for gears with play, and there are none"
        )
    free, notes = free_poses(mechanism, poses, seed)
    torqued = [name for kind, name in keys if kind == "torque"]
    unknowns = machine.unknowns(
        torqued, push > 0.0, also, known, [name for kind, name in keys if kind == "link"]
    )
    options = experiments(mechanism, free, push, sizes(machine, unknowns))
    able = _bearable(mechanism, options)
    if not able:
        raise JointplayError(
            "no experiment keeps the joints within their limits of effort; push less, or carry less"
        )
    if len(able) < len(options):
        notes.append(
            f"{len(options) - len(able)} of {len(options)} experiments were left out: their loads "
            "exceed a joint's limit of effort"
        )
    spread = {**NOISE, **(noise or {})}
    information = informations(machine, unknowns, keys, spread, able)
    records = ", ".join(
        f"{kind} {spread[kind]:g} {SHOWN[kind]}".replace("*", " ") for kind in signals
    )
    text = (
        f"statistical, from the static model at the nominal values; noise of a record: {records}; "
        f"{RECORDS} records a visit, passing at {SPEED:g} rad/s"
    )
    return planned(mechanism, unknowns, information, able, count, text, notes)


def planned(
    mechanism: Mechanism,
    unknowns: tuple[Unknown, ...],
    information: Information,
    options: Sequence[Experiment],
    count: int,
    basis: str,
    notes: Sequence[str] = (),
) -> MeasurementPlan:
    """Plan the best of k experiments, one after the other, by their information."""
    if count < 1:
        raise JointplayError(f"at least one experiment is needed, got {count}")
    alike = distances(mechanism, options) < APART
    chosen, widths, gains = _greedy(unknowns, information, count, alike)
    fewer = f"{count} were asked for, but no more than {len(chosen)} differ"
    return MeasurementPlan(
        tuple(moving(mechanism)),
        unknowns,
        tuple(options[i] for i in chosen),
        widths,
        _partners(unknowns, information, chosen),
        basis,
        gains,
        (*notes, *([fewer] if len(chosen) < count else [])),
    )


def _ways(mechanism: Mechanism) -> np.ndarray:
    """Way of each joint before and beyond a pose, (joints,); both are half its range at most."""
    low, high = joint_limits(mechanism, moving(mechanism))
    return np.minimum(_PASSING_WAY, np.where(high > low, high - low, np.inf) / 4.0)


def free_poses(
    mechanism: Mechanism, chosen: np.ndarray | None, seed: int, count: int = POSES
) -> tuple[np.ndarray, list[str]]:
    """Configurations that, with the ways to them, are free of self-collision, (n, nq), and notes.

    Of those that are `chosen`, (m, nq), or of random ones, of which `count` are enough.
    """
    shapes, names, steps = SelfCollision(mechanism), moving(mechanism), _ways(mechanism)
    at = [mechanism.coordinate(name) for name in names]
    if chosen is None:
        # Shrunk towards the middle of the limits, so that there is room for the ways.
        poses = over_workspace(mechanism, _TRIED_PER_POSE * count, seed)
        low, high = joint_limits(mechanism, names)
        ends = np.isfinite(low) & np.isfinite(high) & (high > low)
        low, high = np.where(ends, low, 0.0), np.where(ends, high, 0.0)
        shrunk = np.where(ends, 1.0 - 2.0 * steps / np.where(ends, high - low, 1.0), 1.0)
        middle, motors = 0.5 * (low + high), [mechanism.motor(name) for name in names]
        poses[:, at] = poses[:, motors] = middle + shrunk * (poses[:, at] - middle)
    else:
        poses = chosen
    clear = (
        row
        for row in poses
        if not any(
            shapes.hits(dict(zip(names, row[at] + side * steps, strict=True)))
            for side in (0.0, 1.0, -1.0)
        )
    )
    free = list(islice(clear, count if chosen is None else None))
    if not free:
        raise JointplayError(
            f"the robot hits itself at, or on the way to, each of the {len(poses)} poses tried"
        )
    return np.array(free), list(shapes.notes)


def _bearable(mechanism: Mechanism, options: Sequence[Experiment]) -> list[Experiment]:
    """Experiments whose loads are within the limits of effort that the URDF knows."""
    ideal, names = mechanism.ideal(), moving(mechanism)
    model, data = ideal.model, ideal.data
    at = [ideal.coordinate(name) for name in names]
    most = np.array([mechanism.description.joints[name].effort for name in names], float)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    able = []
    for experiment in options:
        q = ideal.configuration(dict(zip(names, experiment.positions, strict=True)))
        weight = pin.computeGeneralizedGravity(model, data, q)[at]
        arms = pin.computeFrameJacobian(model, data, q, ideal.tool_frame, frame)
        pushed = arms.reshape(6, model.nv)[:3, at].T @ np.array(experiment.force or np.zeros(3))
        # Of a joint without limit `most` is nan, which nothing exceeds.
        if not (np.maximum(np.abs(weight + pushed), np.abs(weight - pushed)) > most).any():
            able.append(experiment)
    return able


def distances(mechanism: Mechanism, options: Sequence[Experiment]) -> np.ndarray:
    """Distances between k experiments, (k, k), as parts of the robot's reach.

    The largest distance between the places that a joint, or the tool, has in both poses; infinite
    between experiments that do different things. The reach is the largest distance between two
    joints, or a joint and the tool, in any of the poses.
    """
    ideal, names = mechanism.ideal(), moving(mechanism)
    model, data = ideal.model, ideal.data
    places = []
    for experiment in options:
        pin.framesForwardKinematics(
            model, data, ideal.configuration(dict(zip(names, experiment.positions, strict=True)))
        )
        joints = [data.oMi[model.getJointId(name)].translation for name in names]  # views
        places.append(np.array([*joints, data.oMf[ideal.tool_frame].translation]))
    where = np.array(places)
    reach = np.linalg.norm(where[:, :, None] - where[:, None], axis=3).max()
    apart = np.linalg.norm(where[:, None] - where[None], axis=3).max(axis=2)
    kinds = [
        (experiment.force is not None and tuple(map(abs, experiment.force)), experiment.passes)
        for experiment in options
    ]
    alike = np.array([[a == b for b in kinds] for a in kinds])
    return np.where(alike, apart / max(reach, TINY), np.inf)


def sizes(machine: Machine, unknowns: Sequence[Unknown]) -> tuple[float, ...]:
    """Sizes of a push that are needed, as parts of it: one if the machine is known to be rigid."""
    ways = [f"{name} {way}" for name in moving(machine.mechanism) for way in WAYS]
    soft = any(
        machine.compliance(label).spread > 0.0
        for label in (*ways, TOOL)
        if label.removesuffix(" torsional") not in machine.mechanism.gears
    )
    return SIZES if soft or any(unknown.name in WOUND for unknown in unknowns) else SIZES[:1]


def experiments(
    mechanism: Mechanism, poses: np.ndarray, push: float, parts: tuple[float, ...]
) -> list[Experiment]:
    """All experiments at configurations (n, nq), with these parts of a push [N]."""
    if push:
        require_positive("push", push, "N")
    options = []
    for row in poses[:, [mechanism.coordinate(name) for name in moving(mechanism)]]:
        at = tuple(float(x) for x in row)
        options.append(Experiment(at, None, passes=True))
        for axis in np.eye(3) if push else ():
            x, y, z = (float(part) for part in push * axis)
            options += [Experiment(at, (x, y, z), passes, parts) for passes in (False, True)]
    return options


@dataclass(frozen=True)
class Information:
    """Fisher information of k experiments about p unknowns and c compliances, in their scales."""

    gains: np.ndarray
    """Information of each experiment, shape (k, p + c, p + c)."""
    before: np.ndarray
    """Information of the priors, shape (p + c, p + c)."""
    labels: tuple[str, ...]
    """Labels of the unknowns and the compliances, (p + c,)."""

    @classmethod
    def of(cls, problem: LeastSquares, theta: np.ndarray, part: np.ndarray) -> Information:
        """Information of the parts of a measurement at unknowns (p,).

        `part` is the number of the part that each measured number belongs to, (m,).
        """
        effect, m = problem.project(problem.effects(theta)), len(problem.measured)
        parts = [effect[:m][part == number] for number in range(int(part.max()) + 1)]
        prior = effect[m:].T @ effect[m:]
        labels = tuple(unknown.label for unknown in problem.unknowns)
        return cls(np.array([rows.T @ rows for rows in parts]), prior, labels)


def informations(
    machine: Machine,
    unknowns: tuple[Unknown, ...],
    keys: tuple[Key, ...],
    noise: Mapping[str, float],
    options: Sequence[Experiment],
    theta: np.ndarray | None = None,
) -> Information:
    """Fisher information of each experiment by the static model, at `theta` (p,) or the nominal
    values."""
    visits = _visits(machine.mechanism, options)
    model = StaticModel(machine, visits, keys, unknowns)
    tool = tool_positions(machine.mechanism, visits.joints, visits.position)
    n, c = len(visits), len(keys)
    error = np.array([noise[kind] / np.sqrt(RECORDS) for kind, _ in keys])
    torques = np.array([kind == "torque" for kind, _ in keys])
    held = visits.stopped[:, None] & torques  # the drive may hold any part of friction
    at = np.array([unknown.nominal for unknown in unknowns]) if theta is None else theta
    # At a play of zero no slope shows what more of it would do: half of the scale at least.
    least = [x.least if x.least < 0.0 else LARGEST_SHARE * x.scale for x in unknowns]
    at = np.maximum(at, least)
    problem = LeastSquares(
        unknowns, lambda x: model.predict(x).ravel(), np.zeros(n * c), np.tile(error, n)
    )
    gives = [give.unknown.scale * give.effect.reshape(n * c, -1) for give in model.elastic]
    effect = problem.effects(at)[: n * c]
    effect = np.column_stack([effect, *(give / problem.error[:, None] for give in gives)])
    effect = effect.reshape(n, c, -1)
    loose = model.loose()
    matrices = []
    for number in range(len(options)):
        members = visits.cell == number
        free = offsets(keys, visits.cell[members], visits.position[members], tool[members], "place")
        free = np.concatenate([free, loose[members]], axis=2)
        use = (model.certain[:, None] & ~held)[members]
        rows, span = effect[members][use], basis(free[use])
        rows = rows - span @ (span.T @ rows)
        matrices.append(rows.T @ rows)
    return Information(np.array(matrices), *prior(unknowns, model))


def prior(unknowns: Sequence[Unknown], model: StaticModel) -> tuple[np.ndarray, tuple[str, ...]]:
    """Information of the priors of unknowns and compliances, in their scales, and their labels."""
    soft = (give.unknown for give in model.elastic for _ in range(give.effect.shape[2]))
    priors = (*unknowns, *soft)
    known = [unknown.scale / unknown.spread for unknown in priors]
    return np.diag(np.square(known) + _PRIOR), tuple(unknown.label for unknown in priors)


def offers(
    machine: Machine,
    unknowns: tuple[Unknown, ...],
    keys: tuple[Key, ...],
    noise: Mapping[str, float],
    theta: np.ndarray,
) -> list[tuple[np.ndarray, list[str]]]:
    """What could be measured besides, by kind of experiment, the simplest first.

    Args:
        machine: whose.
        unknowns: p of them.
        keys: signals that are measured already.
        noise: standard deviation of a record by kind of signal [SI].
        theta: values of the unknowns, shape (p,).

    Returns:
        For each kind of experiment the information of k of them (`Information.gains`), and the
        text of each.
    """
    mechanism, parts = machine.mechanism, sizes(machine, unknowns)
    weight = sum(body.mass for body in mechanism.model.inertias) * np.linalg.norm(mechanism.gravity)
    strong = float(f"{min(_STRONG_WEIGHTS * weight, _STRONGEST_N):.1g}")

    def kind(option: Experiment) -> tuple[bool, bool, float]:
        return option.force is not None, option.passes, max(map(abs, option.force or (0.0,)))

    poses = over_workspace(mechanism, POSES // 3)
    options = experiments(mechanism, poses, PUSH_N, parts)
    if strong > PUSH_N:
        options += [x for x in experiments(mechanism, poses, strong, parts) if x.force is not None]
    options.sort(key=kind)
    sets = [(keys, "")]
    if tracker := tuple(("tool", axis) for axis in AXES if ("tool", axis) not in keys):
        sets.append(((*keys, *tracker), "with a tracker of the tool's position, "))
    for name in mechanism.gears:
        if ("link", name) not in keys:
            sets.append(((*keys, ("link", name)), f"with an encoder on the link of {name}, "))
    names, offered = tuple(moving(mechanism)), []
    for signals, text in sets:
        gains = informations(machine, unknowns, signals, noise, options, theta).gains
        for _, group in groupby(range(len(options)), lambda i: kind(options[i])):
            alike = list(group)
            offered.append((gains[alike], [text + options[i].instruction(names) for i in alike]))
    return offered


def _visits(mechanism: Mechanism, options: Sequence[Experiment]) -> Visits:
    """Visits of all experiments: passed this way and the other, under each push."""
    names, strides = tuple(moving(mechanism)), _ways(mechanism)
    fastest = [mechanism.description.joints[name].speed or np.inf for name in names]
    rates = np.minimum(SPEED, fastest)
    path, owner, pushes, near = [], [], [], []
    rows: list[tuple[Any, ...]] = []
    for number, experiment in enumerate(options):
        at = np.array(experiment.positions)
        strongest = np.zeros(3) if experiment.force is None else np.array(experiment.force)
        forces = [part * side * strongest for side in (1.0, -1.0) for part in experiment.sizes]
        for push in forces[: 1 if experiment.force is None else None]:
            for sense in (1.0, -1.0) if experiment.passes else (1.0,):
                away = sense * strides
                steps = [at + away, at - away, at]
                if not experiment.passes and rows and rows[-1][-1] == number:
                    steps = [at]  # it stands there already
                path += steps
                owner += [-1] * (len(steps) - 1) + [len(rows)]
                near += [len(rows)] * len(steps)  # loads on the way are those at its end
                pushes += [push] * len(steps)
                rate = sense * rates if experiment.passes else 0.0 * rates
                rows.append((at, rate, sense, not experiment.passes, push, number))
    position, speed, direction, stopped, force, cell = map(np.array, zip(*rows, strict=True))
    still = np.zeros_like(position)
    return Visits(
        names,
        time=np.arange(2.0 * len(rows)).reshape(-1, 2),
        position=position,
        speed=speed,
        acceleration=still,
        direction=(still + direction[:, None]).astype(int),
        stopped=stopped,
        force=force,
        cell=cell,
        path=np.array(path),
        path_visit=np.array(owner),
        path_near=np.array(near),
        path_force=np.array(pushes),
    )


def half_widths(unknowns: Sequence[Unknown], gain: np.ndarray) -> np.ndarray:
    """Expected half widths of 95 % intervals of p unknowns, shape (p,) [SI].

    By the information `gain` about them and about c compliances, shape (p + c, p + c).
    """
    covariance = np.linalg.inv(gain)[: len(unknowns), : len(unknowns)]
    scale = np.array([unknown.scale for unknown in unknowns])
    return np.asarray(NORMAL_QUANTILE * np.sqrt(np.diag(covariance)) * scale)


def _partners(
    unknowns: Sequence[Unknown], information: Information, chosen: Sequence[int]
) -> tuple[tuple[str, ...], ...]:
    """Labels from which each unknown cannot be told apart after the chosen experiments.

    Directions whose standard deviation is more than `LARGEST_SHARE` of the scales count as null.
    """
    gains, axes = np.linalg.eigh(information.before + information.gains[list(chosen)].sum(axis=0))
    null = axes[:, gains < 1.0 / LARGEST_SHARE**2]
    projector = null @ null.T
    return tuple(
        tuple(dict.fromkeys(information.labels[k] for k in partners(projector[i], i)))
        for i in range(len(unknowns))
    )


def _greedy(
    unknowns: Sequence[Unknown], information: Information, count: int, alike: np.ndarray
) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Choose experiments, each the best after those before and `alike` (k, k) to none of them.

    Returns:
        Their numbers; half widths before any and after each [SI]; factor by which each multiplies
        the determinant of the information about the unknowns that are sought.
    """
    chosen: list[int] = []
    widths, gains = [half_widths(unknowns, information.before)], []
    available = np.ones(len(information.gains), bool)
    scale = np.array([unknown.scale for unknown in unknowns])
    sought = np.array([unknown.sought for unknown in unknowns])
    total = information.before
    for _ in range(count):
        if not available.any():
            break
        after = np.array(
            [half_widths(unknowns, total + gain) / scale for gain in information.gains]
        )
        # An interval narrower than the model's own error tells no more; counted further, the plan
        # would leave friction of robots known by half as well.
        worth = np.log(np.maximum(after[:, sought], MODEL_ERROR)).sum(axis=1)
        best = int(np.where(available, worth, np.inf).argmin())
        chosen.append(best)
        available &= ~alike[best]
        was, total = total, total + information.gains[best]
        widths.append(half_widths(unknowns, total))
        about = np.flatnonzero(sought)[:, None], np.flatnonzero(sought)
        unsure = (np.linalg.slogdet(np.linalg.inv(sums)[about])[1] for sums in (was, total))
        gains.append(np.exp(next(unsure) - next(unsure)))
    return chosen, np.array(widths), np.array(gains)
