"""How far a run at default settings is from a converged one.

SCARA, balanced and loaded, four friction laws; slider-crank and four-bar of the shipped scenarios,
with the steps that these state; UR5 with a loose elbow. Peak joint force in the first half and
over the run, peak and RMS tool error, dissipated energy.

Converged are runs with far smaller micro and macro steps. A reference of the same method alone
proves nothing: beginnings of some motions are compared with rk4 as well. A quantity counts as calm
if runs at three step sizes and from three starts 1, 10 and 100 nm aside, each in another direction,
all agree within its target. One small displacement proves nothing either: stick-slip hangs on
switches that a nanometre need not reach. Where they do not agree, means over runs with displaced
journals are compared, run by run, with the 95 % confidence of the mean difference.

The last line counts the errors of single runs in full, and those mean differences that exceed their
confidence; one in twenty of these does so by chance.
"""

import functools
import time
import warnings
from dataclasses import dataclass, field, fields, replace

import numpy as np
from common import JOINT, Benchmark, ensembles, motion
from scipy.stats import t as student

import jointplay as jp
from jointplay.model.robots import robot_urdf

QUANTITIES = {
    "half_N": "peak joint force, first half [N]",
    "peak_N": "peak joint force [N]",
    "tool_peak_um": "tool error, peak [µm]",
    "tool_rms_um": "tool error, RMS [µm]",
    "loss_J": "dissipated [J]",
}
TARGETS = {name: 0.02 if name.endswith("_N") else 0.005 for name in QUANTITIES}
ASIDES = ((1e-9, 0), (-1e-8, 1), (1e-7, 2))
"""Displacements of a journal by which chaos is told [m], and their directions."""

SCARA, CRANK, BAR, UR5 = "SCARA", "slider-crank", "four-bar", "UR5, elbow"
SCENARIOS = {CRANK: "slider_crank", BAR: "four_bar"}
ROCKER = 0.12
"""Length of the four-bar's rocker, whose end is its tool [m]."""
INTERVAL = {SCARA: 1e-4, CRANK: 1e-5, BAR: 1e-4, UR5: 1e-4}
"""Interval of records [s]."""
FRICTION = {
    "Ambrosio": jp.contact.Ambrosio,
    "Coulomb": jp.contact.Coulomb,
    "Brown-McPhee": jp.contact.BrownMcPhee,
    "LuGre": jp.contact.LuGre,
}
UR5_BEARING = {"bearing_radius": 30e-3, "bearing_length": 60e-3}
UR5_WAYPOINTS = (
    (0.0, -1.4, 1.2, -0.6, -1.57, 0.0),
    (0.8, -0.7, 0.6, -1.2, -1.0, 0.5),
    (0.2, -1.9, 1.9, 0.3, -1.57, 1.0),
)
"""At rest at 0, 1 and 2 s; the elbow turns back at the second [rad]."""


@dataclass(frozen=True)
class Settings:
    """How to integrate; what is None is left as it is."""

    step: float | None = None
    macro_step: float | None = None
    tolerance: float | None = None
    integrator: str | None = None

    def apply(self, simulation: jp.Simulation, interval: float) -> jp.Simulation:
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        simulation = replace(simulation, **{k: v for k, v in given.items() if v is not None})
        return replace(simulation, record_every=round(interval / simulation.step))


SHIPPED = Settings()
DEFAULT = Settings(step=jp.Simulation.step, integrator=jp.Simulation.integrator)
FINE = {SCARA: (1e-6, 2e-5), CRANK: (5e-7, 1e-5), BAR: (1e-6, 2e-5), UR5: (1e-6, 2e-5)}
"""Micro and macro step of level 0 [s]; -1 doubles both, 1, the finest, halves them."""
LEVELS = (-1, 0, 1)
RK4_STEP = {SCARA: 5e-7, CRANK: 2.5e-7, BAR: 1e-6, UR5: 1e-6}
"""Step of rk4 [s]: with 1e-6, Brown and McPhee's steep rise still throws it off by 4 %."""
RK4_DURATION = {SCARA: 0.4, CRANK: 2.4e-3, BAR: 0.1, UR5: 0.1}
"""How long rk4 is compared [s]: until some contacts, before chaos."""


CROSSED = (
    (2e-4, "Ambrosio", False),
    (2e-4, "LuGre", False),
    (5e-4, "Brown-McPhee", False),
    (2e-4, "Coulomb", True),
)
"""SCARAs that rk4 is asked about: clearance, friction, loaded."""


@dataclass(frozen=True)
class Case:
    """One mechanism; clearance in m."""

    mechanism: str
    clearance: float
    friction: str = "Ambrosio"
    loaded: bool = False
    settings: Settings = DEFAULT
    crossed: bool = False
    """Whether it is compared with rk4."""
    duration: float | None = None

    @property
    def label(self) -> str:
        words = [self.mechanism, f"{1e3 * self.clearance:g} mm"]
        if self.mechanism == SCARA:
            words += [self.friction, "loaded" if self.loaded else "balanced"]
        elif self.mechanism in SCENARIOS and self.settings.step is None:
            words.append("as shipped")
        return ", ".join(words)

    def level(self, number: int) -> Settings:
        micro, macro = (length / 2.0**number for length in FINE[self.mechanism])
        return Settings(micro, macro, None, jp.Simulation.integrator)

    def simulation(self, settings: Settings, ideal: bool = False) -> jp.Simulation:
        play = {"radial_clearance": self.clearance, "axial_clearance": self.clearance}
        if self.mechanism in SCENARIOS:
            scenario = jp.Scenario.load(f"jointplay:{SCENARIOS[self.mechanism]}.toml")
            simulation = scenario.simulation(f"{1e3 * self.clearance:g} mm")
        elif self.mechanism == UR5:
            elbow = jp.RevoluteClearance(**play, **UR5_BEARING)
            arm = jp.Mechanism(robot_urdf("ur5"), {"elbow_joint": elbow}, tool="tool0")
            way = jp.Motion(list(arm.joints), [0.0, 1.0, 2.0], UR5_WAYPOINTS)
            simulation = jp.Simulation(arm, way)
        else:
            bearing = jp.RevoluteClearance(**play, friction=FRICTION[self.friction]())
            gravity = (0.0, 0.0, -9.81 if self.loaded else 0.0)
            arm = jp.Mechanism(jp.shipped("scara.urdf"), {JOINT: bearing}, gravity=gravity)
            simulation = jp.Simulation(arm, motion())
        if ideal:
            simulation = replace(simulation, mechanism=simulation.mechanism.ideal())
        duration = simulation.duration if self.duration is None else self.duration
        simulation = replace(simulation, duration=duration, start="centred")
        return settings.apply(simulation, INTERVAL[self.mechanism])


@dataclass(frozen=True)
class Trial:
    """A case with certain settings, once or with several seeds."""

    case: Case
    settings: Settings
    aside: tuple[float, int] = (0.0, 0)
    """Of a journal at the start [m], and along which of its axes."""
    ideal: bool = field(default=True)
    """Once only: `ensembles` gives it no seeds."""


def tool(case: Case, result: jp.Result) -> np.ndarray:
    """Where the tool is at each record [m]."""
    if case.mechanism != BAR:
        return result["tool_position"].values
    angle = result["q"].sel(coordinate="rocker_pin").values
    return ROCKER * np.column_stack([np.cos(angle), np.sin(angle)])


@functools.cache
def ideal_tool(case: Case, settings: Settings) -> np.ndarray:
    return tool(case, case.simulation(settings, ideal=True).run())


def measure(trial: Trial, seed: int | None) -> dict[str, float]:
    case = trial.case
    # The reference does not depend on what only the joint with clearance has.
    ideal = replace(case, friction="Ambrosio", clearance=2e-4, settings=DEFAULT, crossed=False)
    run = jp.Run(replace(case.simulation(trial.settings), seed=seed))
    names = run.mechanism.coordinates
    ends = (".x", ".y", ".z")
    across = [i for i, name in enumerate(names) if name.endswith(ends)] or [len(names) - 1]
    distance, direction = trial.aside
    run.workspace.q[across[direction % len(across)]] += distance
    started = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # a run that fails must not enter a mean
        result = run.finish()
    spent = time.process_time() - started
    # Ideal loops by rk4, as `analysis.twin`: its tool is within 3e-4 µm of that with 2 µs.
    same_way = Settings(1e-5, integrator="rk4") if case.mechanism in SCENARIOS else trial.settings
    away = 1e6 * np.linalg.norm(tool(case, result) - ideal_tool(ideal, same_way), axis=1)
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
    half = result.time <= 0.5 * result.time[-1] + 1e-9
    loss = result["normal_dissipation"] + result["friction_dissipation"]
    return {
        "half_N": float(force[half].max()),
        "peak_N": float(force.max()),
        "tool_peak_um": float(away.max()),
        "tool_rms_um": float(np.sqrt(np.mean(away**2))),
        "loss_J": float(loss[-1]),
        "energy_residual_J": result.audit.energy_residual,
        "cpu_s": spent,
    }


def all_cases(quick: bool) -> list[Case]:
    scara = [
        Case(SCARA, clearance, friction, loaded, crossed=(clearance, friction, loaded) in CROSSED)
        for loaded in (False, True)
        for clearance in (2e-4, 5e-4)
        for friction in FRICTION
    ]
    linkages = [
        Case(mechanism, clearance, settings=SHIPPED, crossed=True)
        for mechanism, clearances in ((CRANK, (1e-4, 2e-4, 5e-4)), (BAR, (5e-5, 2e-4)))
        for clearance in clearances
    ]
    arms = [Case(UR5, clearance, crossed=clearance == 1e-4) for clearance in (1e-4, 3e-4)]
    if quick:
        scara = [replace(case, duration=0.4) for case in scara[:: len(scara) // 2]]
        linkages = [case for case in linkages if (case.mechanism, case.clearance) == (BAR, 2e-4)]
        arms = []
    return [*scara, *linkages, *arms]


def relative(found: float, truth: float) -> float:
    return (found - truth) / truth if truth else 0.0


@dataclass(frozen=True)
class Error:
    """Of one quantity of one case, relative."""

    truth: float
    error: float
    confidence: float = 0.0
    """95 % confidence of the error; 0 where single runs are compared."""
    runs: int = 1

    @property
    def counted(self) -> float:
        return abs(self.error) if abs(self.error) >= self.confidence else 0.0

    def __str__(self) -> str:
        text = f"{self.truth:.4g}, {100 * self.error:+.2g} %"
        return text if self.runs == 1 else f"{text} ± {100 * self.confidence:.1g} % ({self.runs})"


def compare(single, many, name: str) -> Error:
    """Error of quantity `name`: of single runs, or of means over `many` runs."""
    if many is None:
        truth, found = single
        return Error(truth[name][0], relative(found[name][0], truth[name][0]))
    truth, found = many
    apart = found[name] - truth[name]
    mean, n = truth[name].mean(), len(apart)
    half = student.ppf(0.975, n - 1) * apart.std(ddof=1) / np.sqrt(n)
    return Error(mean, apart.mean() / mean, half / mean, n)


def worst(pairs, names=tuple(QUANTITIES)) -> float:
    """Largest relative difference of two runs' figures."""
    truth, found = pairs
    return max(abs(relative(found[name][0], truth[name][0])) for name in names)


def spread(runs, name: str) -> float:
    """How far apart the runs' figures are, relative to the last one's."""
    values = [float(run[name][0]) for run in runs]
    return abs(relative(values[-1] + max(values) - min(values), values[-1]))


def run_all(cases: list[Case], args) -> dict[Trial, dict[str, np.ndarray]]:
    """All single runs, then the ensembles of the chaotic cases."""
    trials = []
    for case in cases:
        trials += [trial(case, case.settings), *levels(case), *asides(case)]
        trials += crossing(case) if case.crossed else []
    trials = list(dict.fromkeys(trials))
    found = dict(zip(trials, ensembles(trials, 1, args.jobs, measure), strict=True))
    wild = [case for case in cases if any(chaotic(case, found).values())]
    many = list(dict.fromkeys(trial for case in wild for trial in many_of(case)))
    if many:
        found |= dict(zip(many, ensembles(many, args.runs, args.jobs, measure), strict=True))
    return found


def trial(case: Case, settings: Settings, **options) -> Trial:
    """Of the case itself, whatever it is compared with: runs are shared."""
    return Trial(replace(case, settings=DEFAULT, crossed=False), settings, **options)


def levels(case: Case) -> list[Trial]:
    """Converged runs, the finest last."""
    return [trial(case, case.level(number)) for number in LEVELS]


def asides(case: Case) -> list[Trial]:
    """Runs of level 0 from starts aside."""
    return [trial(case, case.level(0), aside=aside) for aside in ASIDES]


def crossing(case: Case) -> list[Trial]:
    """The beginning, converged and by rk4."""
    duration = min(RK4_DURATION[case.mechanism], case.duration or np.inf)
    rk4 = Settings(RK4_STEP[case.mechanism], integrator="rk4")
    beginning = replace(case, duration=duration)
    return [trial(beginning, settings) for settings in (case.level(1), rk4)]


def many_of(case: Case) -> list[Trial]:
    return [trial(case, s, ideal=False) for s in (case.level(1), case.settings)]


def chaotic(case: Case, found) -> dict[str, bool]:
    """Which quantities of converged runs differ by more than their target."""
    runs = [found[trial] for trial in (*asides(case), *levels(case))]
    wild = {name: spread(runs, name) > target for name, target in TARGETS.items()}
    # Early peaks of force may be certain where what comes after is not; the rest is of all the run.
    late = any(wild[name] for name in wild if not name.endswith("_N"))
    return {name: value or (late and not name.endswith("_N")) for name, value in wild.items()}


def judge(case: Case, found) -> tuple[dict[str, Error], dict[str, float]]:
    """Errors of a case, and what its reference is worth."""
    single = tuple(found[trial(case, one)] for one in (case.level(1), case.settings))
    wild = chaotic(case, found)
    many = tuple(found[one] for one in many_of(case)) if any(wild.values()) else None
    errors = {name: compare(single, many if wild[name] else None, name) for name in QUANTITIES}
    fine = found[trial(case, case.level(0))]
    calm = [name for name in QUANTITIES if not wild[name]]
    worth = {
        "levels": worst((single[0], fine), calm) if calm else np.nan,
        "aside": max(worst((fine, found[trial])) for trial in asides(case)),
        "rk4": worst([found[trial] for trial in crossing(case)]) if case.crossed else np.nan,
    }
    return errors, worth


def report(benchmark, cases, found):
    def percent(value):
        return "" if np.isnan(value) else f"{100 * value:.1g}"

    judged = [judge(case, found) for case in cases]
    rows, data = [], []
    for case, (errors, worth) in zip(cases, judged, strict=True):
        rows.append([case.label, *map(str, errors.values()), *map(percent, worth.values())])
        own = found[trial(case, case.settings)]
        for name, error in errors.items():
            data.append(
                {
                    "case": case.label,
                    "quantity": name,
                    "converged": error.truth,
                    "error": error.error,
                    "confidence": error.confidence,
                    "runs": error.runs,
                    **worth,
                    "energy_residual_J": own["energy_residual_J"][0],
                    "cpu_s": own["cpu_s"][0],
                }
            )
    benchmark.finish(
        [
            "case",
            *QUANTITIES.values(),
            "converged levels differ [%]",
            "starts 1, 10, 100 nm aside [%]",
            "from rk4 [%]",
        ],
        rows,
        data,
    )
    means = [e for errors, _ in judged for e in errors.values() if e.runs > 1]
    if means:
        beyond = sum(error.counted > 0.0 for error in means)
        widest = 100 * max(error.confidence for error in means)
        print(
            f"ensemble means: {len(means)}, of which {beyond} differ by more than their "
            f"confidence, of up to {widest:.2g} %"
        )
    forces, others = (
        max(errors[n].counted for errors, _ in judged for n in QUANTITIES if n.endswith("_N") == f)
        for f in (True, False)
    )
    print(f"worst peak force {100 * forces:.1f} %, worst other {100 * others:.1f} %")


def main():
    benchmark = Benchmark("accuracy", __doc__)
    benchmark.parser.add_argument(
        "--tolerance", type=float, help="of the runs judged, in place of their fixed step"
    )
    benchmark.parser.add_argument(
        "--only",
        choices=(SCARA, CRANK, BAR, UR5),
        nargs="+",
        default=(SCARA, CRANK, BAR, UR5),
        help="mechanisms (default: all)",
    )
    args = benchmark.parse()
    cases = [case for case in all_cases(args.quick) if case.mechanism in args.only]
    if args.tolerance is not None:
        tried = {s: replace(s, tolerance=args.tolerance) for s in (DEFAULT, SHIPPED)}
        cases = [replace(case, settings=tried[case.settings]) for case in cases]
    report(benchmark, cases, run_all(cases, args))
