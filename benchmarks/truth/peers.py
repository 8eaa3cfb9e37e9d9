"""Other engines side by side: MuJoCo, Exudyn, Siconos and Drake on the same mechanisms, in one run.

Writes docs/data/peers.json, from which the documentation's build makes the tables of docs/peers.md,
and its figures. Engines that are not installed are left out, and the page says so: pip install
'.[peers]' for MuJoCo and Exudyn, pip install drake for Drake, apt-get install python3-siconos for
Siconos.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import json
import os
import platform
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import DOCS, command, folder_of
from truth.peer_engines import pinocchio_engine
from truth.peer_engines.common import Problem, missing, read_links, scara, slider_crank, undriven
from truth.peer_engines.figures import draw_growth, draw_orbits, draw_work
from truth.peer_engines.jointplay_engine import run_jointplay
from truth.peer_engines.trace import Impact, Trace, impacts, offset

from jointplay.base.errors import JointplayError
from jointplay.base.tables import Table
from jointplay.physics.contact.hertzian import effective_restitution
from jointplay.simulation.motion.reference import REFERENCE_NODE_S
from jointplay.simulation.result.stored import versions

LABELS = ("MuJoCo", "Exudyn", "Siconos", "Drake")
ENGINES = tuple(map(str.lower, LABELS))
RIGID = ("Siconos", "Pinocchio, ADMM", "Pinocchio, PGS")
"""Contacts that have no duration."""
TIE = 1.1
"""Costs within this ratio are equal: so much do they vary from run to run."""

EULER = "jointplay, semi-implicit Euler"
"""MuJoCo's scheme."""

ONSET = "MuJoCo, law with Exudyn's d'_0"
"""The applied law, but d'_0 the speed at the onset: what Exudyn's contact should be."""

LONG = "jointplay, macro steps of 0.1 ms"
OWN = ("jointplay", LONG, "jointplay, error-controlled", "jointplay, rk4")

STARTS = 8
"""Of ensembles and of paths whose errors count."""
ROUNDS = 8
"""Times that a cost is measured."""
ONCE_S = 0.5
"""CPU time from which on a tenth of a run is measured; once only, if that takes as long."""
STEPS = tuple(1e-6 * us for us in (15, 12, 8, 6, 4, 3, 2, 1.5, 1, 0.75, 0.5, 0.375, 0.25))
"""Of the cost at equal error [s]."""
BY_ERROR = (
    (4e-2, 3e-4, 1.5e-5),
    (2.5e-2, 3e-4, 1.5e-5),
    (2e-2, 3e-4, 1.5e-5),
    (1e-2, 1e-4, 1.5e-5),
    (3e-3, None, 6e-6),
    (1e-3, None, 2e-6),
    (3e-4, None, 2e-6),
    (1e-4, 1.6e-5, 2e-6),
    (1e-5, 4e-6, 2e-6),
    (1e-6, 2e-6, 2e-6),
)
"""Tolerances of the error-controlled run, macro steps and times between records, there [s]."""
ACCURACIES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
"""Of CENIC, there [rad or m]."""

WANTED = (1e-1, 1e-2, 1e-3)
"""Errors whose cost is compared [C_r]."""


class Engines:
    """The engines that are installed; the others have a reason."""

    def __init__(self, without: Sequence[str] = ()) -> None:
        self.reasons = {name: missing(name) for name in ENGINES} | {
            name: "left out by --without" for name in without
        }
        self.mujoco, self.exudyn, self.siconos, self.drake = (
            None
            if self.reasons[name]
            else importlib.import_module(f"truth.peer_engines.{name}_engine")
            for name in ENGINES
        )

    def versions(self) -> str:
        modules = zip(LABELS, (self.mujoco, self.exudyn, self.siconos, self.drake), strict=True)
        return ", ".join(f"{label} {one.VERSION}" for label, one in modules if one) or "none"


# --- free flight --------------------------------------------------------------------------------


def flying_scara() -> Problem:
    """The SCARA, undriven and fast, its journal far from everything for 20 ms."""
    task = undriven(scara(clearance=5e-3))
    q, v = task.start[0].copy(), np.zeros(len(task.links))
    q[3:7] += (1e-4, 0.3, 0.01, -0.005)
    v[:] = (2.0, 0.02, -0.03, 0.05, 3.0, 0.5, -0.8, 0.5, 20.0)
    return task.with_start(q, v)


def flying_slider_crank() -> Problem:
    """The slider-crank at 5000 rpm, its piston pin in a bore so wide that it is never reached."""
    task = slider_crank(clearance=0.08, mu=0.0, bearing_radius=0.1)
    v = task.start[1].copy()
    v[2] = 1.0
    return task.with_start(task.start[0], v)


def difference(a: Trace, b: Trace, duration: float) -> float:
    """Largest difference of any coordinate at 40 times [rad or m]."""
    times = np.linspace(0.0, 0.99 * duration, 40)
    return float(np.abs(a.at(times) - b.at(times)).max())


def free_flight(engines: Engines) -> Table:
    rows = [["mechanism", "against jointplay rk4", "largest difference [rad or m]"]]
    step = 5e-6
    for name, task, duration in (
        ("SCARA", flying_scara(), 0.02),
        ("slider-crank", flying_slider_crank(), 3e-3),
    ):
        ours = run_jointplay(task, step, duration, 4, "rk4")
        assert not ours.force.any(), "the journal touched"
        others = {
            "jointplay rk4, half the step": run_jointplay(task, step / 2.0, duration, 8, "rk4")
        }
        for label, engine in (("MuJoCo RK4", engines.mujoco), ("Exudyn RK44", engines.exudyn)):
            if engine:
                others[label] = engine.run_free(task, step, duration, 4)
        if engines.siconos and task.planar:
            for h in (4e-6, 2e-6, 1e-6):
                others[f"Siconos, h = {h:.0e} s"] = engines.siconos.run(task, h, duration, 1, 1.0)
        for label, theirs in others.items():
            rows.append([name, label, f"{difference(ours, theirs, duration):.1e}"])
    return Table.of_texts(rows)


def ideal_torques() -> float:
    """Largest difference of MuJoCo's inverse dynamics and the SCARA's feed-forward torque [N m]."""
    import mujoco
    from truth.peer_engines.mujoco_engine import model

    task = scara()
    text = task.simulation.mechanism.description.text
    ideal = dataclasses.replace(
        task, links=tuple(read_links(text)), bearing=(0, (0, 0, 0)), journal=(1, (0, 0, 0))
    )
    made = model(ideal, 1e-5)
    data = mujoco.MjData(made)
    table = task.drive[0]
    nodes = np.arange(0, len(table), 500)
    motion = task.simulation.motion
    places, speeds, accelerations = motion(nodes * REFERENCE_NODE_S)
    apart = []
    for row, q, v, a in zip(table[nodes], places, speeds, accelerations, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(made, data)
        apart.append(np.abs(data.qfrc_inverse - row[2 * len(q) :]).max())
    return float(max(apart))


# --- the first impacts --------------------------------------------------------------------------


def first_impacts(found: dict[str, list[Impact]], count: int = 5) -> Table:
    rows = [["", *(f"{k + 1}" for k in range(count))]]
    for name, every in found.items():
        for what, form in (
            ("touch [µs]", lambda one: f"{1e6 * one.time:.3f}"),
            ("duration [µs]", lambda one: f"{1e6 * one.duration:.2f}"),
            ("impulse [N s]", lambda one: f"{one.impulse:.5f}"),
        ):
            if name not in RIGID or "duration" not in what:  # where there is none
                shown = [form(one) for one in every[:count]]
                rows.append([f"{name}: {what}", *shown, *[""] * (count - len(shown))])
    return Table.of_texts(rows)


def apart(these: list[Impact], those: list[Impact]) -> np.ndarray:
    """Differences of the times [s] and relative ones of the impulses, by contact, (n, 2)."""
    pairs = zip(these, those, strict=False)
    return np.array([(abs(a.time - b.time), abs(b.impulse / a.impulse - 1.0)) for a, b in pairs])


def touch_speed(trace: Trace, task: Problem) -> float:
    """Speed of the journal towards the bearing as the first contact begins [m/s]."""
    begin = impacts(trace, task)[0].time
    back = 1e-6
    before, at = np.linalg.norm(offset(task, trace.at(np.array([begin - back, begin]))), axis=1)
    return float((at - before) / back)


# --- statistics ---------------------------------------------------------------------------------


def figures(trace: Trace, task: Problem, rigid: bool) -> dict[str, float]:
    """A run in a few numbers that do not depend on single impacts."""
    away = np.linalg.norm(offset(task, trace.q)[:, :2], axis=1) / task.clearance
    met = impacts(trace, task, rigid)
    return {
        "contacts per ms": len(met) / (1e3 * trace.time[-1]),
        "time in contact [%]": 100.0 * float(np.mean(trace.force > 0.0)),
        "mean force [N]": float(np.mean(trace.force)),
        "mean eccentricity / C_r": float(np.mean(away)),
        "largest eccentricity / C_r": float(np.max(away)),
        "largest impulse of a contact [N s]": max(one.impulse for one in met),
    }


def displaced(task: Problem, count: int) -> Iterator[Problem]:
    """The same with starts displaced by up to 0.4 C_r."""
    for part in np.linspace(-0.4, 0.4, count):
        q = task.start[0].copy()
        q[2] += part * task.clearance
        yield task.with_start(q)


def ensemble(run: Callable[[Problem], Trace], task: Problem, count: int, rigid: bool = False):
    """Means and standard deviations over displaced starts, and the first trace."""
    every, kept = [], None
    for one in displaced(task, count):
        trace = run(one)
        kept = trace if kept is None else kept
        every.append(figures(trace, task, rigid))
    numbers = {name: [one[name] for one in every] for name in every[0]}
    return {n: (float(np.mean(x)), float(np.std(x, ddof=1))) for n, x in numbers.items()}, kept


def statistics_table(found: dict[str, dict[str, tuple[float, float]]]) -> Table:
    rows = [["", *next(iter(found.values()))]]
    for engine, values in found.items():
        rows.append([engine, *(f"{mean:.4g} ± {spread:.2g}" for mean, spread in values.values())])
    return Table.of_texts(rows)


# --- cost at equal error ------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Ladder:
    """An engine with what sets its accuracy, from coarse to fine."""

    run: Callable[[Problem, Any, float, int], Trace]
    """Of the problem, a setting, a duration, and steps per record."""
    settings: Sequence[Any]
    labels: Sequence[str]
    finest: Any
    """Setting of the path that errors are measured from."""
    steps: bool = True
    """Whether the settings are steps, of equal cost."""


def ladder(run: Callable[[Problem, float, float, int], Trace], finest: float) -> Ladder:
    """Of an engine with constant steps."""
    return Ladder(run, STEPS, [f"{1e6 * step:g}" for step in STEPS], finest)


@dataclasses.dataclass(frozen=True)
class Work:
    """What accuracy costs an engine."""

    errors: np.ndarray
    """By setting, from coarse to fine [C_r]."""
    costs: np.ndarray
    """CPU seconds per simulated second."""
    labels: Sequence[str]
    per_step: float
    """CPU time of a step of 1 µs [s]; nan without constant steps."""
    apart: float
    """Distance of the engine's limit from jointplay's [C_r]."""

    def cost(self, wanted: float) -> tuple[float, str]:
        """The cheapest setting such that it and all finer ones have that error; nan if none."""
        fine = len(self.errors)
        while fine and self.errors[fine - 1] <= wanted:
            fine -= 1
        if fine == len(self.errors):
            return np.nan, ""
        best = fine + int(np.argmin(self.costs[fine:]))
        return float(self.costs[best]), self.labels[best]


def work_precision(
    ladders: dict[str, Ladder], starts: Sequence[Problem], duration: float, cost_duration: float
) -> dict[str, Work]:
    """What accuracy costs each engine.

    The error is the largest distance of the journal's centre from that of the same engine at its
    finest setting, relative to C_r, at 60 times of each start: with a constant step it depends on
    where in a step contacts begin. The cost is that of the first start.
    """
    task = starts[0]
    times = np.linspace(0.0, 0.98 * duration, 60)
    failures = (JointplayError, RuntimeError, ValueError)  # of steps that are too large

    def cost(one: Ladder, setting: Any, span: float) -> float:
        with contextlib.suppress(*failures):
            return one.run(task, setting, span, 10).seconds / span
        return np.inf

    costs, spans = {}, {}
    for name, one in ladders.items():
        first = np.array([cost(one, setting, 0.1 * cost_duration) for setting in one.settings])
        fast = first * cost_duration < ONCE_S
        spans[name] = np.where(fast, 1.0, 0.1) * cost_duration
        costs[name] = np.where(fast, ONCE_S / cost_duration, first)
    # In turns, and the fastest of each: what else the machine does then hits all alike.
    for _ in range(ROUNDS):
        for name, one in ladders.items():
            for i, (setting, span) in enumerate(zip(one.settings, spans[name], strict=True)):
                if costs[name][i] * span <= ONCE_S:
                    costs[name][i] = min(costs[name][i], cost(one, setting, span))

    def path(one: Ladder, setting: Any) -> np.ndarray:
        traces = [one.run(start, setting, duration, 1) for start in starts]
        return np.array([offset(task, trace.at(times)) for trace in traces]) / task.clearance

    found, limit = {}, None
    for name, one in ladders.items():
        best = path(one, one.finest)
        limit = best if limit is None else limit
        errors = np.full(len(one.settings), np.inf)
        for i, setting in enumerate(one.settings):
            with contextlib.suppress(*failures):
                errors[i] = np.abs(path(one, setting) - best).max()
        per_step = 1e-6 * costs[name][one.settings.index(1e-6)] if one.steps else np.nan
        apart = float(np.abs(best - limit).max())
        found[name] = Work(errors, costs[name], one.labels, per_step, apart)
    return found


# --- the page -----------------------------------------------------------------------------------


def machine() -> str:
    known = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*: (.*)", known.read_text()) if known.exists() else None
    model = found[1] if found else platform.processor() or platform.machine()
    return f"{model}, {os.cpu_count()} cores, {platform.system()}"


def compare(engines: Engines, quick: bool, images: Path) -> dict[str, object]:
    """Run everything; numbers and tables for `texts`."""
    images.mkdir(parents=True, exist_ok=True)
    out: dict[str, object] = {}
    mj, ex, si, dr = engines.mujoco, engines.exudyn, engines.siconos, engines.drake

    def say(text: str) -> None:
        print(f"{text} ...", file=sys.stderr, flush=True)

    say("free flight")
    out["free"] = free_flight(engines)
    if mj:
        out["torques"] = ideal_torques()

    say("first impacts, same law")
    task, fine, short = slider_crank(), 1e-7, 1.0e-3
    traces = {
        "jointplay": run_jointplay(task, fine, short),
        EULER: run_jointplay(task, fine, short, 1, "semi-implicit-euler"),
        "jointplay, rk4": run_jointplay(task, fine, short, 1, "rk4"),
    }
    if mj:
        traces["MuJoCo, same law"] = mj.run_law(task, fine, short)
    if ex:
        traces["Exudyn, own contact"] = ex.run_own(task, fine, short)
    if mj and ex:
        traces[ONSET] = mj.run_law(task.with_onset_speed(), fine, short)
    met = {name: impacts(trace, task) for name, trace in traces.items()}
    out["first"] = first_impacts(met)
    out["first_apart"] = {
        f"{name}, against {base}": apart(met[base], met[name])
        for name, base in (
            ("MuJoCo, same law", EULER),
            ("Exudyn, own contact", "jointplay, rk4"),
            ("Exudyn, own contact", ONSET),
        )
        if name in met and base in met
    }
    if ex:
        elastic = slider_crank(mu=0.0, restitution=1.0)
        theirs = impacts(ex.run_own(elastic, fine, short), elastic)
        ours = impacts(run_jointplay(elastic, fine, short, 1, "rk4"), elastic)
        what = "Exudyn again with restitution 1 and no friction, where both laws are purely Hertz's"
        out["first_apart"][what] = apart(theirs, ours)

    say("contact models")
    smooth = slider_crank(mu=0.0)
    restitution = effective_restitution(float(smooth.law[1]))
    out["restitution"] = restitution
    first = impacts(run_jointplay(smooth, fine, 2.5e-4), smooth)[0]
    limit = mj.matched_limit(first.duration, restitution) if mj else (0.0, 0.0)
    out["limit"] = (first.duration, *limit)
    models = {"jointplay": run_jointplay}
    if ex:
        models["Exudyn, own contact"] = ex.run_own
    for kind in mj.INTEGRATORS if mj else ():
        label = "MuJoCo, own limit" + ("" if kind == "Euler" else f", {kind}")
        models[label] = partial(mj.run_own, limit=limit, integrator=kind)
    for kind in pinocchio_engine.SOLVERS:
        models[f"Pinocchio, {kind}"] = partial(
            pinocchio_engine.run, restitution=restitution, solver=kind
        )
    if si:
        models["Siconos"] = partial(si.run, restitution=restitution)
    met = {
        name: impacts(run(smooth, fine, short, 1), smooth, name in RIGID)
        for name, run in models.items()
    }
    out["model_first"] = first_impacts(met)

    say("five turns, ensembles")
    turns, count = (0.006, 2) if quick else (0.06, STARTS)
    stats, orbits = {}, {}
    for name, run in models.items():
        stats[name], orbits[name] = ensemble(
            lambda t, run=run: run(t, 1e-6, turns, 1), smooth, count, name in RIGID
        )
    if si:
        for large in (1e-5, 2e-5):
            stats[f"Siconos, {1e6 * large:g} µs"], _ = ensemble(
                lambda t, h=large: si.run(t, h, turns, 1, restitution), smooth, count, True
            )
    out["stats"] = statistics_table(stats)
    try:
        run_jointplay(smooth, 2e-5, 1e-4)
        out["refused"] = "jointplay accepts it"
    except JointplayError:
        out["refused"] = "jointplay refuses to start with it"
    out["mean_force"] = {name: values["mean force [N]"] for name, values in stats.items()}
    out["members"] = count
    draw_orbits(orbits, smooth, images / "orbits.png")

    say("cost at equal error")
    finest = 2e-7 if quick else 2e-8
    law = {
        "jointplay": ladder(models["jointplay"], finest),
        LONG: ladder(partial(run_jointplay, macro_step=1e-4), finest),
        "jointplay, error-controlled": Ladder(
            lambda t, how, T, n: run_jointplay(
                t, how[2], T, n, tolerance=how[0], macro_step=how[1]
            ),
            BY_ERROR,
            [f"{how:g}" + (f", {1e6 * m:g} µs" if m else "") for how, m, _ in BY_ERROR],
            (1e-9, 5e-7, 5e-7),
            steps=False,
        ),
        "jointplay, rk4": ladder(partial(run_jointplay, integrator="rk4"), finest),
    }
    if mj:
        law["MuJoCo, same law"] = ladder(mj.run_law, finest)
    law |= {name: ladder(run, finest) for name, run in models.items() if name != "jointplay"}
    if dr:
        speed = touch_speed(run_jointplay(smooth, fine, 2e-4), smooth)
        finest = {"step": 1e-8 if quick else 2.5e-9}
        for name, key, values, scale in (
            ("Drake, constant steps", "step", STEPS, 1e6),
            ("Drake, CENIC", "accuracy", ACCURACIES, 1.0),
        ):
            law[name] = Ladder(
                lambda t, how, T, n: dr.run(t, T, speed, **how),
                [{key: value} for value in values],
                [f"{scale * value:g}" for value in values],
                finest,
                steps=False,
            )
    horizon = 6e-4
    out["horizon"] = horizon
    starts = tuple(displaced(smooth, count))
    out["work"] = work_precision(law, starts, horizon, 2e-3 if quick else 3e-2)
    draw_work(out["work"], images / "work.png")

    say("SCARA, same law")
    robot, step, long = scara(), 1e-5, 0.1 if quick else 0.5
    pairs, grown, rows = [], {}, []
    kinds = ("semi-implicit-euler", "rk4")
    base = {kind: run_jointplay(robot, step, long, 1, kind) for kind in kinds}
    rows += zip((EULER, "jointplay, rk4"), base.values(), strict=True)
    if mj:
        pairs.append(("MuJoCo, same law", mj.run_law(robot, step, long), "semi-implicit-euler"))
    if ex:
        pairs.append(("Exudyn, same law", ex.run_law(robot, step, long), "rk4"))
    for name, trace, kind in pairs:
        rows.append((name, trace))
        times = np.linspace(0.0, 0.99 * long, 400)
        gone = np.abs(offset(robot, trace.at(times)) - offset(robot, base[kind].at(times)))
        grown[f"{name} against jointplay {kind}"] = times, gone.max(axis=1) / robot.clearance
    out["scara_long"] = long
    out["scara_apart"] = {name: float(values.max()) for name, (_, values) in grown.items()}
    out["scara"] = Table.of_texts(
        [
            ["", "mean force [N]", "time in contact [%]", "CPU per step [µs]"],
            *(
                [
                    name,
                    f"{trace.force.mean():.6f}",
                    f"{100 * np.mean(trace.force > 0):.3f}",
                    f"{1e6 * trace.seconds / trace.steps:.1f}",
                ]
                for name, trace in rows
            ),
        ]
    )
    if grown:
        draw_growth(grown, images / "scara.png")
    return out


def cost_table(out: dict) -> Table:
    heads = ["error 0.1 C_r", "0.01 C_r", "0.001 C_r", "its limit from jointplay's / C_r"]
    rows = [["", "CPU per step of 1 µs [µs]", *heads]]
    for name, work in out["work"].items():
        row = [name, "" if np.isnan(work.per_step) else f"{1e6 * work.per_step:.2f}"]
        for wanted in WANTED:
            cost, label = work.cost(wanted)
            row.append("not reached" if np.isnan(cost) else f"{cost:.2f} ({label})")
        rows.append([*row, f"{work.apart:.1e}"])
    return Table.of_texts(rows)


def costs_at(out: dict, wanted: float) -> dict[str, float]:
    """CPU seconds per simulated second at an error, of the engines that reach it."""
    costs = {name: work.cost(wanted)[0] for name, work in out["work"].items()}
    return {name: cost for name, cost in costs.items() if np.isfinite(cost)}


def cheapest(out: dict, wanted: float) -> str:
    """How much the cheapest peer costs, relative to the cheapest of jointplay's runs, and all."""
    costs = costs_at(out, wanted)
    order = sorted(costs, key=costs.__getitem__)
    ours = next((name for name in order if name in OWN), "")
    peer = next((name for name in order if name not in OWN), "")
    text = f"{ours or peer or 'none'} alone reaches it"
    if ours and peer:
        text = f"{peer} costs {costs[peer] / costs[ours]:.1f} times as much as {ours}"
    every = ", ".join(f"{name} {costs[name]:.2f} s/s" for name in order) or "none"
    return f"- At {wanted:g} C_r, {text}. Cheapest first: {every}."


def better(out: dict) -> list[str]:
    """What the numbers say in favour of others."""
    lines, cost = [], {name: work.per_step for name, work in out["work"].items()}
    for name, per_step in cost.items():
        if name not in OWN and per_step < TIE * cost["jointplay"]:
            lines.append(
                f"- **{name}** takes {1e6 * per_step:.2f} µs per step, jointplay's default "
                f"{1e6 * cost['jointplay']:.2f} µs."
            )
    for wanted in WANTED:
        costs = costs_at(out, wanted)
        ours = min((costs[name] for name in OWN if name in costs), default=np.inf)
        lines += [
            f"- **{name}** has an error of {wanted:g} C_r for {spent:.2f} CPU seconds per "
            f"simulated second, jointplay for {ours:.2f}."
            for name, spent in costs.items()
            if name not in OWN and spent < TIE * ours
        ]
    force = out["mean_force"]
    if "Siconos, 20 µs" in force:
        (fine, spread), (coarse, _) = force["Siconos"], force["Siconos, 20 µs"]
        lines.append(
            "- **Siconos** has no contact stiffness to resolve. At 20 µs, two or three steps per "
            f"impact of the others ({out['refused']}), its mean force is "
            f"{coarse:.4g} N, at 1 µs {fine:.4g} ± {spread:.2g} N. At that step it costs "
            f"{out['work']['Siconos'].per_step / 2e-5:.2f} s per simulated second."
        )
    if not lines:
        lines.append("- In none of the numbers of this run.")
    return lines


def texts(engines: Engines, out: dict) -> dict[str, str]:
    """The numbers of this run in Markdown, by what they are."""
    here = ", ".join(f"{name} {text}" for name, text in versions().items())
    duration, stiffness, damping = out["limit"]
    written = {
        "machine": [f"{machine()}; {here}; {engines.versions()}."],
        "free": [out["free"].markdown()],
        "law": [out["first"].markdown(), ""],
        "scara": [
            out["scara"].markdown(),
            f"\nOver {out['scara_long']:g} s the journal's centre differs by at most:\n",
            *(f"- {name}: {worst:.1e} C_r" for name, worst in out["scara_apart"].items()),
        ],
        "restitution": [
            f"All without friction; restitution {out['restitution']:.4f}, which is what "
            "Lankarani-Nikravesh delivers for c_e = 0.9."
        ],
        "models": [out["model_first"].markdown()],
        "turns": [
            "Five turns at a step of 1 µs, mean ± standard deviation over "
            f"{out['members']} starts displaced by up to 0.4 C_r:\n",
            out["stats"].markdown(),
        ],
        "cost": [cost_table(out).markdown()],
        "cheapest": [cheapest(out, wanted) for wanted in WANTED],
        "better": better(out),
    }
    for name, reason in engines.reasons.items():
        written["machine"] += [f"**Left out: {name}** ({reason})."] if reason else []
    if "torques" in out:
        written["free"].append(
            "\nMuJoCo's inverse dynamics of the ideal SCARA along the motion and the feed-forward "
            f"torques that jointplay's drive uses differ by at most {out['torques']:.1e} N m."
        )
    for name, gone in out["first_apart"].items():
        (when, how), (later, worse) = gone[0], gone.max(axis=0)
        written["law"].append(
            f"- {name}: first touch within {1e6 * when:.1e} µs, its impulse within "
            f"{100 * how:.1e} %; all {len(gone)} contacts of this millisecond, taken in order, "
            f"within {1e6 * later:.1e} µs and {100 * worse:.1e} %."
        )
    if engines.mujoco:
        written["restitution"].append(
            f"MuJoCo's limit has solref = (-{stiffness:.4g}, -{damping:.4g}): an impact of "
            f"{1e6 * duration:.1f} µs, the duration of jointplay's first, with that restitution."
        )
    return {name: "\n".join(lines) for name, lines in written.items()}


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command(__doc__, "shorter, coarser", "docs; --quick: results/benchmarks")
    parser.add_argument("--without", nargs="*", choices=ENGINES, default=[], help="leave out")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", DeprecationWarning)
    engines = Engines(options.without)
    for name, reason in engines.reasons.items():
        if reason:
            print(f"{name}: skipped ({reason})", file=sys.stderr)
    folder = folder_of(options, "peers", DOCS)
    out = compare(engines, options.quick, folder / "images" / "peers")
    written = texts(engines, out)
    path = folder / "data" / "peers.json"
    path.parent.mkdir(exist_ok=True)
    data = json.dumps(written, indent=1, ensure_ascii=False)
    path.write_text(data + "\n", encoding="utf-8")
    print("\n\n".join(written.values()))
    print(f"\nwritten: {path}")
    return 0
