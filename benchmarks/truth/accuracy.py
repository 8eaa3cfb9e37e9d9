"""How far a default run is from a converged one, and which errors no run states or warns of.

Without options: the SCARA's first motions with four friction laws, balanced and loaded; slider-
crank and four-bar of the shipped scenarios; a UR5 with a loose elbow. `--random N` draws cases
afresh instead (`random_cases.py`); the same seed draws the same ones, however many. `--only NUMBER`
shows one case with all its figures.

Each runs as a user would run it, or with `--tolerance`, and is compared with converged runs: small
steps, from the same start and from starts 1, 10 and 100 nm aside, and one with twice that step. The
truth of a figure is the interval of these. Steps are halved until the step moves no figure by more
than a quarter of its target, or by no more than the starts do; a figure for which that does not
succeed is not judged. `--rk4` takes another method for them, whose first step is as long: a
reference of the same method alone proves little. `--methods` has the runs themselves by all
integrators in turn (semi-implicit Euler, with a tolerance, rk4).

A figure is outside if it is further from the interval than its target: 2 % of peak forces, 0.5 % of
all else. It is silent if the run said nothing: no error that covers it, and no warning of the audit
that the run was integrated badly. The number of impacts is judged in certificates only. A
certificate is judged if the runs of different step agree to a tenth of a per cent or to the stated
error, and covers a figure that is no further from the interval than that.

The last line counts cases, silent figures, and the share of figures that certificates cover; the
one before has the largest errors of figures that do not hang on the start. Before these stand the
figures within the errors that runs stated, of all cases and of those with bristles.
"""

import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from common import JOINT, Benchmark, motion
from robots import UR5_WAYPOINTS, loosened
from truth.random_cases import KINDS, Among, Case, Vector, drawn

import jointplay as jp
from jointplay import analysis
from jointplay.base.processes import cores
from jointplay.physics.contact import FRICTION_LAWS
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation.analysis.headline import headline_of
from jointplay.simulation.analysis.tool_error import ideal_tool
from jointplay.simulation.result.audit import Audit
from jointplay.simulation.result.certificate import COUNTS, HEADLINE

TARGETS = {name: 0.02 if name == "peak joint force" else 0.005 for name in HEADLINE}
"""Largest error that a run may have without saying so, relative."""
FLOORS = {"N": 1e-3, "m": 1e-8, "rad": 1e-8, "J": 1e-7, "": 0.0}
"""Errors that nobody asks about, by unit."""
CALM = 0.25
"""A figure is calm if converged draws agree within this part of its target."""
OPEN = 1.5
"""If the step moves a figure by more than so many times what starts aside do, it is too long."""
AGREE = 1e-3
"""Relative difference up to which draws of different step agree, for certificates."""

STEP = 1e-6
"""Step of the first converged runs [s]; at most a quarter of the run's own."""
MACRO = 20
"""Steps in a macro step of converged runs."""
HALVINGS = 3
"""How often the step is halved at most."""
ASIDES = ((0.8e-9, 0.5e-9, -0.3e-9), (-5e-9, 8e-9, 3e-9), (3e-8, -8e-8, 5e-8))
"""Journals at the start of the other converged runs [m]; 1, 10 and 100 nm aside."""
METHODS = ({}, {"integrator": "semi-implicit-euler"}, {"tolerance": 1e-3}, {"integrator": "rk4"})

SCARA_S = 0.4
"""How much of the SCARA's cycle is run."""
FRICTION = ("ambrosio", "coulomb", "brown-mcphee", "lugre")
LINKAGES = {"slider-crank": ("0.1 mm", "0.2 mm", "0.5 mm"), "four-bar": ("0.05 mm", "0.2 mm")}
"""Cases of the shipped scenarios, with the steps that these state."""


def shipped() -> list[Callable[[], Case]]:
    """What makes each of the cases that are not drawn."""
    made = [
        partial(scara, play, friction, loaded)
        for loaded, play, friction in product((False, True), (2e-4, 5e-4), FRICTION)
    ]
    made += [partial(linkage, kind, case) for kind, cases in LINKAGES.items() for case in cases]
    return made + [partial(ur5, play) for play in (1e-4, 3e-4)]


def of(kind: str, simulation: jp.Simulation) -> Case:
    (joint,) = simulation.mechanism.clearance.values()
    return Case(0, 0, kind, kind, joint.normal.name, joint.friction.name, simulation)


def scara(play: float, friction: str, loaded: bool) -> Case:
    law = FRICTION_LAWS[friction]()
    bearing = jp.RevoluteClearance(radial_clearance=play, axial_clearance=play, friction=law)
    gravity = (0.0, 0.0, -9.81 if loaded else 0.0)
    arm = jp.Mechanism(jp.shipped("scara.urdf"), {JOINT: bearing}, gravity=gravity)
    return of("SCARA", jp.Simulation(arm, motion(), duration=SCARA_S))


def linkage(kind: str, case: str) -> Case:
    scenario = jp.Scenario.load(f"jointplay:{kind.replace('-', '_')}.toml")
    return of(kind, scenario.simulation(case))


def ur5(play: float) -> Case:
    arm = loosened("ur5", ("elbow_joint",), play=play, tool="tool0")
    return of("UR5", jp.Simulation(arm, jp.Motion(list(arm.joints), [0, 1, 2], UR5_WAYPOINTS)))


# ---- The truth ----------------------------------------------------------------------------------


class NoTruthError(Exception):
    """A converged run did not complete."""


def finer(simulation: jp.Simulation, times: int, integrator: str = DEFAULT) -> jp.Simulation:
    """The same with a step so many times smaller, and records at the same times."""
    step = simulation.step / times
    return replace(
        simulation,
        integrator=integrator,
        step=step,
        macro_step=MACRO * step if integrator == DEFAULT else None,
        tolerance=None,
        record_every=simulation.record_every * times,
    )


def converged(simulation: jp.Simulation, aside: Vector | None = None) -> jp.Result:
    """Run with the journals, or the motors of gears, so far aside.

    Raises:
        NoTruthError: the run did not complete, or was refused.
    """
    try:
        run = jp.Run(simulation)
    except jp.JointplayError as error:
        raise NoTruthError(str(error)) from None
    mechanism = simulation.mechanism
    if aside is not None and mechanism.clearance:
        run.displace(aside)
    elif aside is not None:
        for name in mechanism.gears:
            run.workspace.q[mechanism.motor(name)] += aside[0]
    result = run.finish(check_step=False)
    if result.status != jp.Status.COMPLETED:
        raise NoTruthError(result.message)
    return result


@dataclass(frozen=True)
class Truth:
    """One figure of converged runs."""

    draws: tuple[float, ...]
    """From starts ever further aside; the first from the start itself."""
    coarser: float
    """From the start itself, with twice the step."""
    unit: str
    target: float
    """Relative."""

    @property
    def interval(self) -> tuple[float, float]:
        every = (*self.draws, self.coarser)
        return min(every), max(every)

    @property
    def mean(self) -> float:
        return float(np.mean((*self.draws, self.coarser)))

    @property
    def allowed(self) -> float:
        """Error that is within the target, in the figure's unit."""
        return max(self.target * abs(self.mean), FLOORS[self.unit])

    @property
    def moved(self) -> float:
        """What halving the step changed."""
        return abs(self.draws[0] - self.coarser)

    @property
    def state(self) -> str:
        """Whether the motion is calm or sensitive, or the step still too long."""
        low, high = self.interval
        if high - low <= CALM * self.allowed:
            return "calm"
        by_starts = OPEN * float(np.ptp(self.draws))
        return "sensitive" if self.moved <= max(CALM * self.allowed, by_starts) else "open"

    def away(self, value: float) -> float:
        """Distance of a value from the interval."""
        low, high = self.interval
        return max(low - value, value - high, 0.0)

    def verdict(self, value: float, stated: float, warned: bool) -> str:
        """``outside`` the target, and ``silent`` if no stated error or warning told of it, or none.

        `stated` is the error as the run states it; not a number if it states none.
        """
        away = self.away(value)
        if self.state == "open" or away <= self.allowed:
            return ""
        return "outside" if warned or away <= stated else "silent"


def headline(result: jp.Result) -> dict[str, tuple[float, str]]:
    """Value and unit of a result's headline figures."""
    figures = headline_of(result, ideal_tool(result), claims=True)
    return {
        name: (figure.value, figure.unit)
        for name, figure in figures.items()
        if name.startswith(HEADLINE)
    }


def kind_of(figure: str) -> str:
    """The figure without its joint."""
    return figure.split(",")[0]


def truth(simulation: jp.Simulation, by: str = DEFAULT) -> tuple[dict[str, Truth], float]:
    """What converged runs by a method say of each headline figure, and their step [s].

    Raises:
        NoTruthError: one of them did not complete.
    """
    times = max(round(simulation.step / STEP), 4)
    ideal = converged(analysis.ideal_simulation(finer(simulation, times // 2)))

    def found(times: int, aside: Vector | None = None) -> dict[str, tuple[float, str]]:
        run = converged(finer(simulation, times, by), aside)
        return headline(analysis.measured_against(run, ideal))

    coarser = found(times // 2)
    for halving in range(HALVINGS + 1):
        own = found(times)
        draws = [own, *(found(times, aside) for aside in ASIDES)]
        known = {
            name: Truth(
                tuple(draw[name][0] for draw in draws),
                coarser[name][0],
                unit,
                TARGETS[kind_of(name)],
            )
            for name, (_, unit) in own.items()
        }
        judged = [one for name, one in known.items() if kind_of(name) not in COUNTS]
        if all(one.state != "open" for one in judged):
            break
        if halving < HALVINGS:
            coarser, times = own, 2 * times
    return known, simulation.step / times


# ---- The judgement ------------------------------------------------------------------------------


def stated_errors(result: jp.Result) -> dict[str, float]:
    """Error of each figure as the run itself states it, by name."""
    if result.certificate is None:
        return {}
    return {figure.name: figure.error for figure in result.certificate.figures}


def warnings_of_the_step(audit: Audit) -> list[str]:
    """What the audit says of how well the run was integrated, and not of laws, loads and limits."""
    model = {"law_warnings": (), "limit_warnings": ()}
    return replace(audit, **model, penetration_over_clearance=0.0, friction_fed=0.0).warnings


@dataclass(frozen=True)
class Outcome:
    """What became of a case: a row for every figure."""

    case: dict[str, object]
    rows: list[dict[str, object]]
    note: str = ""
    """Why there are none."""
    cpu: float = 0.0
    """[s]."""


def judge(
    make: Callable[[], Case],
    number: int = 0,
    certified: bool = True,
    methods: bool = False,
    tolerance: float | None = None,
    by: str = DEFAULT,
) -> Outcome:
    """Run a case, find the truth, compare.

    Args:
        make: makes it.
        number: of the case among others.
        certified: whether certificates are judged too.
        methods: whether the case runs by the integrators in turn.
        tolerance: of the run, in place of its fixed step.
        by: method of the converged runs.
    """
    warnings.simplefilter("ignore", RuntimeWarning)
    started = time.process_time()
    case = make()
    own_method = METHODS[number % len(METHODS)] if methods else {}
    if tolerance is not None:
        own_method = {"tolerance": tolerance}
    simulation = replace(case.simulation, **own_method)
    about: dict[str, object] = {
        name: getattr(case, name) for name in ("seed", "kind", "robot", "normal", "friction")
    }
    about |= {"number": number, "case": case.label}
    about |= {"integrator": simulation.integrator, "step": simulation.step}

    def outcome(rows: list[dict[str, object]], note: str = "") -> Outcome:
        return Outcome(about, rows, note, time.process_time() - started)

    once = time.process_time()
    try:
        result = simulation.run()
    except jp.JointplayError as error:
        return outcome([], f"refused: {error}")
    once = time.process_time() - once
    if result.status != jp.Status.COMPLETED:
        return outcome([], f"the run {result.message}")
    ideal = converged(analysis.ideal_simulation(result))
    own = headline(analysis.measured_against(result, ideal))
    try:
        known, step = truth(case.simulation, by)
    except NoTruthError as error:
        return outcome([], f"no truth: {error}")
    said, warned = stated_errors(result), warnings_of_the_step(result.audit)
    errors: dict[str, float] = {}
    if certified:
        cost = time.process_time()
        certificate = jp.certify(result, simulation=simulation)
        about["cost_in_runs"] = (time.process_time() - cost) / once
        errors = {figure.name: figure.error for figure in certificate.headline}
    rows = []
    for name, (value, unit) in own.items():
        if name not in known:
            continue
        true = known[name]
        away = true.away(value)
        stated = said.get(name, np.nan)
        verdict = "" if kind_of(name) in COUNTS else true.verdict(value, stated, bool(warned))
        row: dict[str, object] = about | {
            "figure": name, "unit": unit, "value": value, "low": true.interval[0],
            "high": true.interval[1], "mean": true.mean, "finest": true.draws[0],
            "coarser": true.coarser, "finest_step": step, "state": true.state, "away": away,
            "stated_error": stated, "warned": "; ".join(warned), "verdict": verdict,
        }  # fmt: skip
        if name in errors:
            row |= {
                "certified_error": errors[name],
                "agreed": true.moved <= max(AGREE * abs(true.draws[0]), errors[name]),
                "covered": away <= errors[name],
            }
        rows.append(row)
    return outcome(rows)


def named(row: dict) -> str:
    """A figure of a case, its value and the truth, in a line."""
    low, high = row["low"], row["high"]
    true = f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
    error = "none" if np.isnan(row["stated_error"]) else f"{row['stated_error']:.2g}"
    line = (
        f"{row['figure']}: {row['value']:.6g}, truth {true} {row['unit']} ({row['state']}, "
        f"{100 * row['away'] / (abs(row['mean']) or 1.0):+.2g} %), stated error {error}"
    )
    if "certified_error" in row:
        line += f", certified {row['certified_error']:.2g}"
    return line


def tell(outcome: Outcome) -> None:
    """Say what was missed in silence, or why nothing is known."""
    number, label = outcome.case["number"], outcome.case["case"]
    if outcome.note:
        print(f"case {number}: {outcome.note} ({label})")
    for row in outcome.rows:
        uncovered = row.get("agreed") and not row["covered"]
        verdict = "not covered" if uncovered else row["verdict"]
        if verdict in ("silent", "not covered"):
            print(f"{verdict}: case {number}: {named(row)} ({label}, {row['integrator']})")


HEADER = (
    "", "cases", "stopped", "figures", "calm", "sensitive", "not converged", "outside target",
    "stated", "silent", "certified", "true error, median [%]", "certified, median [%]",
    "calm, largest error: peak force [%]", "all else [%]",
)  # fmt: skip


def line(name: str, outcomes: Sequence[Outcome], figure: str = "") -> list[str]:
    """One row of the table: of all figures of these cases, or of one of them."""
    rows = [
        row
        for outcome in outcomes
        for row in outcome.rows
        if kind_of(row["figure"]).startswith(figure)
    ]
    judged = [row for row in rows if kind_of(row["figure"]) not in COUNTS]
    states = Counter(row["state"] for row in judged)
    verdicts = Counter(row["verdict"] for row in rows)
    agreed = [row for row in rows if row.get("agreed")]
    covered = f"{sum(row['covered'] for row in agreed)} of {len(agreed)}" if agreed else "-"
    counts = (
        len(outcomes), sum(not outcome.rows for outcome in outcomes), len(judged), states["calm"],
        states["sensitive"], states["open"], verdicts["outside"] + verdicts["silent"],
        verdicts["outside"], verdicts["silent"],
    )  # fmt: skip
    sizes = [
        100.0
        * float(np.median([row[key] / abs(row["mean"]) for row in agreed if row["mean"]] or [0]))
        for key in ("away", "certified_error")
    ]
    return [name, *map(str, counts), covered, *(f"{size:.2g}" for size in (*sizes, *worst(judged)))]


def worst(rows: Sequence[dict]) -> tuple[float, float]:
    """Largest errors of calm figures, of peak forces and of all others [%]."""
    known = [row for row in rows if row["state"] == "calm" and row["mean"]]
    forces, others = (
        [
            100.0 * row["away"] / abs(row["mean"])
            for row in known
            if row["unit"].startswith("N") == f
        ]
        for f in (True, False)
    )
    return max(forces, default=0.0), max(others, default=0.0)


def table(outcomes: Sequence[Outcome], by: str = "kind") -> list[list[str]]:
    """By mechanism (or case) and by figure."""
    names = dict.fromkeys(outcome.case[by] for outcome in outcomes)
    lines = [line(name, [one for one in outcomes if one.case[by] == name]) for name in names]
    lines += [line(figure, outcomes, figure) for figure in HEADLINE]
    return [*lines, line("all", outcomes)]


def main() -> None:
    made = Benchmark(
        "accuracy",
        __doc__,
        runs=0,
        random=(0, "so many cases drawn at random"),
        jobs=(cores(), "processes"),
        no_certify=(False, "judge no certificates"),
        methods=(False, "run cases by all integrators in turn"),
        rk4=(False, "converged runs by rk4, throughout"),
    )
    add = made.parser.add_argument
    add("--seed", type=int, metavar="N", help="of the draw (default: drawn, and printed)")
    add("--only", type=int, metavar="NUMBER", help="this case alone, with all its figures")
    add("--tolerance", type=float, help="of the runs judged, in place of their fixed step")
    for name, choices in (("kind", KINDS), ("friction", tuple(FRICTION_LAWS))):
        add(f"--{name}", action="append", choices=choices, help="draw these only (repeatable)")
    args = made.parse()
    if args.random < 0 or args.jobs < 1:
        made.parser.error("--random must not be negative, and --jobs at least 1")
    options = {"certified": not args.no_certify, "methods": args.methods}
    options |= {"tolerance": args.tolerance, "by": "rk4" if args.rk4 else DEFAULT}
    if args.random:
        seed = time.time_ns() // 1_000_000 % 1_000_000_000 if args.seed is None else args.seed
        print(f"seed {seed}", flush=True)
        among = Among(tuple(args.kind or KINDS), tuple(args.friction or FRICTION_LAWS))
        count = max(min(args.random, 3) if args.quick else args.random, (args.only or 0) + 1)
        cases = [partial(drawn, seed, number, among) for number in range(count)]
    else:
        cases = shipped()[::8] if args.quick else shipped()
    if args.only is not None:
        outcomes = [judge(cases[args.only], args.only, **options)]
        for name, value in outcomes[0].case.items():
            print(f"  {name}: {value}")
        print(f"  {outcomes[0].note}")
        rows = outcomes[0].rows
        for row in rows:
            print(f"{row['verdict']:8s}{named(row)}")
    else:
        study = jp.Study(list(enumerate(cases)), partial(_judge, options))
        for _, outcome in study.outcomes(args.jobs, progress=True, unit="case"):
            tell(outcome)
        outcomes = [study.store[number] for number in range(len(cases))]
        rows = [row | {"cpu_s": one.cpu} for one in outcomes for row in one.rows]
        names = dict.fromkeys(name for row in rows for name in row)
        rows = [dict.fromkeys(names, "") | row for row in rows]
        made.finish(HEADER, table(outcomes, "kind" if args.random else "case"), rows)
        footnotes(outcomes)
    agreed = [row for row in rows if row.get("agreed")]
    share = f"{100 * np.mean([row['covered'] for row in agreed]):.1f} %" if agreed else "-"
    silent = sum(row["verdict"] == "silent" for row in rows)
    judged = [row for row in rows if kind_of(row["figure"]) not in COUNTS]
    known = [row for row in judged if row["state"] != "open"]
    bent = [row for row in known if getattr(FRICTION_LAWS.get(row["friction"]), "bristles", False)]
    for which, some in (("", known), (", with bristles", bent)):
        within = sum(row["away"] <= row["stated_error"] for row in some)
        print(f"within the error that the run stated{which}: {within} of {len(some)} figures")
    print("worst peak force {:.1f} %, worst other {:.1f} %".format(*worst(judged)))
    print(f"cases {len(outcomes)} silent {silent} certified {share}")


def _judge(options: dict, case: tuple[int, Callable[[], Case]]) -> Outcome:
    number, make = case
    return judge(make, number, **options)


def footnotes(outcomes: Sequence[Outcome]) -> None:
    """Cases without figures, cost."""
    without = Counter(one.note.split(":")[0].split(" at ")[0] for one in outcomes if one.note)
    print(f"cases without figures: {sum(without.values())}"
          + "".join(f"; {count} x {text}" for text, count in without.items()))  # fmt: skip
    times = [one.cpu for one in outcomes]
    print(f"CPU time of a case {np.mean(times):.1f} s in the mean, {max(times):.0f} s at most")
    costs = [one.case["cost_in_runs"] for one in outcomes if "cost_in_runs" in one.case]
    if costs:
        print(f"certificates cost {np.median(costs):.0f} times the run, in the middle")
