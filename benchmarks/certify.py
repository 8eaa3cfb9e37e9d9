"""Whether stated numerical errors cover the true ones. See docs/certificates.md.

30 configurations, drawn at random with a fixed seed: the SCARA, and the slider-crank, with several
clearances, friction laws and coefficients, with and without weight, by every integrator, steps of 2
to 20 us (slider-crank: 0.5 to 2 us); among them jammed journals and the explicit method where it is
wrong by a factor of two. Each is certified. Two judges say what is true: rk4 at 0.25 us (0.1 us),
and the multi-rate method at four times that step with macro steps of ten. A figure is judged if
they agree to a tenth of a per cent or to the stated error, and covered if |value - rk4's| is no
larger than the stated error; a configuration is if all its judged figures are. Where motion is
chaotic the truth is one draw, as the run is another.
"""

import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace

import numpy as np
from common import COLOURS, JOINT, Benchmark, motion, new_figure
from tqdm import tqdm

import jointplay as jp
from jointplay import analysis
from jointplay.analysis.certification import certify, figures
from jointplay.core.processes import cores

SEED = 2024
SCARA, KNOWN, CRANK = 23, 1, 6
REFERENCE_STEP = {"scara": 2.5e-7, "slider-crank": 1e-7}
COARSER = 4
"""Steps of the first judge in a step of the second, and in one of the ideal mechanism, which has no
contacts to follow."""
AGREE = 1e-3
"""Relative difference up to which both judges agree."""
QUICK = 8


@dataclass(frozen=True)
class Configuration:
    """One simulation; lengths in m, times in s."""

    robot: str
    clearance: float
    law: str
    friction: float
    loaded: bool
    integrator: str
    step: float
    duration: float
    seed: int
    macro_step: float | None = None
    tolerance: float | None = None

    def simulation(self) -> jp.Simulation:
        options = {
            "duration": self.duration,
            "step": self.step,
            "integrator": self.integrator,
            "macro_step": self.macro_step,
            "tolerance": self.tolerance,
            "record_every": max(round(1e-4 / self.step), 1),
            "seed": self.seed,
        }
        law = LAWS[self.law](self.friction)
        if self.robot == "scara":
            bearing = jp.RevoluteClearance(
                radial_clearance=self.clearance, axial_clearance=self.clearance, friction=law
            )
            gravity = (0.0, 0.0, -9.81 if self.loaded else 0.0)
            robot = jp.Mechanism(jp.shipped("scara.urdf"), {JOINT: bearing}, gravity=gravity)
            return jp.Simulation(robot, motion(), start="centred", **options)
        base = jp.Scenario.load("jointplay:slider_crank.toml").simulation(
            "0.1 mm",
            {
                "joints": {"piston_pin": {"radial_clearance": self.clearance}},
                "integration": {"start": "centred"},
            },
        )
        pin = base.mechanism.clearance["piston_pin"]
        pin = replace(pin, friction=law)
        return replace(
            base, mechanism=base.mechanism.with_clearance({"piston_pin": pin}), **options
        )


LAWS = {
    "ambrosio": lambda mu: jp.contact.Ambrosio(mu),
    "coulomb": lambda mu: jp.contact.Coulomb(mu),
    "bengisu-akay": lambda mu: jp.contact.BengisuAkay(1.3 * mu, mu),
    "brown-mcphee": lambda mu: jp.contact.BrownMcPhee(1.3 * mu, mu),
    "lugre": lambda mu: jp.contact.LuGre(mu, 1.3 * mu),
    "threlfall": lambda mu: jp.contact.Threlfall(mu),
}


def configurations() -> list[Configuration]:
    """The 30, the same at every call."""
    random = np.random.default_rng(SEED)
    found = []
    for robot, number in (("scara", SCARA), ("slider-crank", CRANK)):
        crank = robot == "slider-crank"
        steps = (5e-7, 1e-6, 2e-6) if crank else (2e-6, 5e-6, 1e-5, 2e-5)
        for index in range(number):
            how = ("multi-rate", "semi-implicit-euler", "multi-rate", "rk4")[index % 4]
            jammed = not crank and index % 5 < 2
            step = float(random.choice(steps))
            macro = random.choice([0.0, 0.0, 0.0, 2e-4]) * (0.1 if crank else 1.0)
            tolerance = 1e-3 if index % 8 == 6 else None
            found.append(
                Configuration(
                    robot,
                    float(random.uniform(0.1e-3, 0.6e-3)) * (0.5 if crank else 1.0),
                    str(random.choice(list(LAWS))),
                    float(random.uniform(0.15, 0.3) if jammed else random.uniform(0.02, 0.15)),
                    bool(random.integers(2)),
                    how,
                    step,
                    0.012 if crank else float(random.uniform(0.3, 0.5) if jammed else 0.25),
                    int(random.integers(1000)),
                    float(macro) if macro and how == "multi-rate" else None,
                    tolerance if how == "multi-rate" else None,
                )
            )
    known = Configuration(
        "scara", 0.3e-3, "ambrosio", 0.15, False, "semi-implicit-euler", 1e-5, 1.5, 0
    )
    return [known, *found]


def finely(simulation, result, method, step, macro_step) -> jp.Simulation:
    """A judge's run of the same motion."""
    return replace(
        simulation,
        integrator=method,
        macro_step=macro_step,
        tolerance=None,
        step=step,
        record_every=round(simulation.record_every * simulation.step / step),
        duration=float(result.time[-1]),
    )


def measure(configuration: Configuration) -> list[dict]:
    """Certify, find the truth, and say of each figure whether it is covered."""
    warnings.simplefilter("ignore", RuntimeWarning)
    simulation = configuration.simulation()
    started = time.process_time()
    result = simulation.run()
    once = time.process_time() - started
    certificate = certify(result, simulation=simulation)
    cost = (time.process_time() - started - once) / once
    step = REFERENCE_STEP[configuration.robot]
    finest = finely(simulation, result, "rk4", step, None).run()
    smooth = analysis.ideal_simulation(finest)
    ideal = replace(smooth, step=COARSER * step, record_every=smooth.record_every // COARSER).run()
    truth = figures(finest, ideal)
    step *= COARSER
    second = figures(finely(simulation, result, "multi-rate", step, 10.0 * step).run(), ideal)
    rows = []
    for figure in certificate.headline:
        true, other = truth[figure.name][0], second[figure.name][0]
        away = abs(figure.value - true)
        rows.append(
            vars(configuration)
            | {
                "figure": figure.name,
                "value": figure.value,
                "stated_error": figure.error,
                "unit": figure.unit,
                "truth": true,
                "second_truth": other,
                "judged": abs(true - other) <= max(AGREE * abs(true), figure.error),
                "true_error": away,
                "covered": away <= figure.error,
                "cost_in_runs": cost,
            }
        )
    return rows


def main() -> None:
    benchmark = Benchmark("certify", __doc__, runs=0)
    benchmark.parser.add_argument(
        "--jobs", type=int, default=cores(), metavar="N", help="processes"
    )
    args = benchmark.parse()
    chosen = configurations()[: QUICK if args.quick else None]
    measure(replace(chosen[0], duration=0.01))  # has the kernels compiled
    found: list[list[dict]] = [[] for _ in chosen]
    with ProcessPoolExecutor(args.jobs) as pool:
        futures = {pool.submit(measure, one): index for index, one in enumerate(chosen)}
        for future in tqdm(as_completed(futures), total=len(chosen), unit="configuration"):
            found[futures[future]] = future.result()
            for row in future.result():
                if row["judged"] and not row["covered"]:
                    tqdm.write(
                        f"not covered: {row['figure']}: {row['value']:.6g} ± "
                        f"{row['stated_error']:.2g}, truth {row['truth']:.6g} {row['unit']} "
                        f"({row['robot']}, {row['law']} {row['friction']:.2g}, "
                        f"{row['clearance']:.2g} m, {row['integrator']}, {row['step']:g} s)"
                    )
    rows = [row for group in found for row in group]
    names = list(dict.fromkeys(row["figure"] for row in rows))
    table = []
    for name in names:
        those = [row for row in rows if row["figure"] == name and row["judged"]]
        if not those:
            continue
        stated, true = (
            np.array([row[key] / max(abs(row["truth"]), 1e-300) for row in those])
            for key in ("stated_error", "true_error")
        )
        table.append(
            [
                name,
                f"{sum(row['covered'] for row in those)} of {len(those)}",
                f"{sum(row['figure'] == name for row in rows) - len(those)}",
                f"{100 * np.median(true):.2g}",
                f"{100 * true.max():.2g}",
                f"{100 * np.median(stated):.2g}",
                f"{100 * stated.max():.2g}",
            ]
        )
    figure, axes = new_figure(1, 1, 5.0, 4.5)
    panel = axes[0, 0]
    for name, colour in zip(names, COLOURS, strict=False):
        those = [row for row in rows if row["figure"] == name]
        points = [
            [max(row[key] / max(abs(row["truth"]), 1e-300), 1e-8) for row in those]
            for key in ("true_error", "stated_error")
        ]
        panel.loglog(*points, ".", color=colour, label=name)
    panel.plot([1e-8, 10.0], [1e-8, 10.0], color="0.5", lw=0.8)
    panel.set_xlabel("true error, relative")
    panel.set_ylabel("stated error, relative")
    panel.legend(fontsize=7)
    header = [
        "figure",
        "covered",
        "judges differ",
        "true error, median [%]",
        "largest [%]",
        "stated error, median [%]",
        "largest [%]",
    ]
    benchmark.finish(header, table, rows, figure)
    print(f"further runs cost {np.median([group[0]['cost_in_runs'] for group in found]):.0f} times "
          "the run, in the middle")  # fmt: skip
    covered = sum(all(r["covered"] for r in group if r["judged"]) for group in found)
    print(f"covered {covered} of {len(found)}")


if __name__ == "__main__":
    main()
