"""A leg of Jansen's linkage: clearance, impacts and wear together, in ensembles; Sobol indices.

    python benchmarks jansen [--runs 16] [--samples 64] [--phases 4] [--out docs/images/jansen]

arXiv 2606.22129 asks for studies in which wear, clearance and impacts are coupled on this linkage;
arXiv 2606.25208 is one (both CC BY 4.0; only their abstracts were seen). What the second says of
its leg is asked of ours, docs/gallery/jansen.toml, whose masses, pins and loads are our own:
whether clearance raises the largest force, whether single runs can mislead, how uneven wear is.
Writes jansen.txt and jansen.png.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from common import DOCS, command, folder_of, require

import jointplay as jp
from jointplay.physics.contact import Ambrosio
from jointplay.simulation.analysis.uncertainty import sobol_indices, standard_error
from jointplay.study.axes import points

SCENARIO = DOCS / "gallery" / "jansen.toml"
CASES = {"knee": ("knee",), "knee and rocker": ("knee", "rocker_pin")}
TURN_S = 1.0
DOCS = Path("docs/images/jansen")
STANCE = (265.0, 275.0, 455.0, 465.0)
"""Angles of the crank at which the load on the foot begins, is whole, ends to be, ends [deg]."""
LOAD_N = 20.0
RANGES = {
    "clearance [mm]": (0.05, 0.2),
    "friction": (0.05, 0.2),
    "turns a second": (0.5, 1.5),
    "load [N]": (10.0, 30.0),
}
PARTS_OF_WEAR = (0.5, 0.9)
DRAWN = 4  # runs whose wear is drawn


def machine(
    case: str, begin=0.0, clearance=1e-4, friction=0.1, rate=1.0, load=LOAD_N
) -> jp.Simulation:
    """The leg from a part of a turn on, `begin`: a turn to settle, and one that counts."""
    turns = [k + angle / 360.0 for k in range(-1, 4) for angle in STANCE]
    forces = [0.0, load, load, 0.0] * 5
    ends = np.array([begin, begin + 2.0])
    at = np.unique([*ends, *(turn for turn in turns if ends[0] < turn < ends[1])])
    ground = {
        "times": ((at - begin) / rate).tolist(),
        "forces": [[0.0, float(force), 0.0] for force in np.interp(at, turns, forces)],
    }
    changes = {
        "start": {"crank_pin": 2.0 * np.pi * (begin % 1.0)},
        "motion": {"speeds": {"crank_pin": 2.0 * np.pi * rate}},
        "integration": {"duration": 2.0 / rate, "settle": 1.0 / rate},
        "loads": {"ground": ground},
    }
    base = jp.Scenario.load(SCENARIO).simulation(case, changes)
    size, law = {"radial_clearance": clearance}, Ambrosio(friction, 1e-3, 1e-2)
    joints = {
        name: one if one.ideal else one.with_clearances(size).with_friction(law)
        for name, one in base.mechanism.clearance.items()
    }
    return replace(base, mechanism=base.mechanism.with_clearance(joints, base.mechanism.gears))


def measures(work: tuple[jp.Simulation, tuple[str, ...]]) -> dict[str, np.ndarray]:
    """Largest force [N] and worn depth a turn, around the bore [m], of joints in a run."""
    simulation, joints = work
    result = simulation.run(progress=False, estimate=False).completed()
    counts = result.time >= simulation.judged_from
    found = {}
    for name in joints:
        force = result["joint_force_peak"].sel(joint=name).values[counts]
        found[f"{name} force"] = np.array(np.nanmax(force))
        found[f"{name} depth"] = jp.study.worn_depth(result, name)[0] / 2.0
    return found


def arc(depth: np.ndarray, part: float) -> float:
    """Angle of the least part of a bore that holds a part of its wear [deg]."""
    sizes = np.sort(depth)[::-1].cumsum()
    count = int(np.searchsorted(sizes, part * sizes[-1])) + 1
    return 360.0 * count / len(depth)


def ensemble(case: str, runs: int, jobs: int, **options: float) -> list[dict[str, np.ndarray]]:
    """Runs that begin evenly spread over a turn."""
    work = [(machine(case, k / runs, **options), CASES[case]) for k in range(runs)]
    return jp.Study(work, measures).run(jobs, progress=True, desc=case)


def ideal_forces() -> dict[str, float]:
    """Largest force of each pin without clearance [N]."""
    simulation = machine("ideal")
    result = simulation.run(progress=False, estimate=False).completed()
    force = np.linalg.norm(result["reaction_force"].values, axis=2)
    most = force[result.time >= simulation.judged_from].max(axis=0)
    names = map(str, result["reaction_force"]["moving_joint"].values)
    return dict(zip(names, most.tolist(), strict=True))


def interval(values: np.ndarray, factor: float = 1.0) -> str:
    values = factor * values
    return (
        f"{values.mean():.3g} +- {standard_error(values):.2g} (one run: {values.min():.3g} to "
        f"{values.max():.3g})"
    )


def sensitivity(samples: int, phases: int, jobs: int) -> list[str]:
    """Sobol indices of force and wear: means of a few runs of other phases at each point."""
    names = tuple(RANGES)
    low, high = np.array(list(RANGES.values())).T
    drawn = low + points("saltelli", samples, len(names), seed=0) * (high - low)
    work = [
        (machine("knee", k / phases, 1e-3 * c, mu, rate, load), CASES["knee"])
        for c, mu, rate, load in drawn
        for k in range(phases)
    ]
    found = jp.Study(work, measures).run(jobs, progress=True, desc="sensitivity")
    lines = []
    for words, values in (
        ("largest force", np.array([one["knee force"] for one in found])),
        ("wear a turn", np.array([one["knee depth"].mean() for one in found])),
        ("deepest wear a turn", np.array([one["knee depth"].max() for one in found])),
    ):
        indices = sobol_indices(values.reshape(-1, phases).mean(axis=1), names)
        lines.append(f"Sobol indices of the {words} (first order; total), {len(work)} runs")
        for k, name in enumerate(names):
            lines.append(
                f"  {name:<16} {indices.first[k]:6.2f} +- {indices.first_confidence[k]:.2f};"
                f" {indices.total[k]:6.2f} +- {indices.total_confidence[k]:.2f}"
            )
    return lines


def draw(found: dict[str, list[dict[str, np.ndarray]]], ideal: float, path: Path) -> None:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 4.0), layout="constrained")
    left = figure.add_subplot(1, 2, 1)
    for place, runs in enumerate(found.values()):
        force = np.array([one["knee force"] for one in runs])
        left.plot(np.full(len(force), place), force, "o", alpha=0.5)
        left.plot(place, force.mean(), "k_", markersize=24)
    left.axhline(ideal, color="0.5", linestyle="--")
    left.text(0.5, ideal, "without clearance", ha="center", va="bottom", color="0.4")
    left.set_xticks(range(len(found)), [f"clearance in {case}" for case in found])
    left.set_xlim(-0.5, len(found) - 0.5)
    left.set_ylim(bottom=0.0)
    left.set_ylabel("largest force in the knee in a turn [N]")
    right = figure.add_subplot(1, 2, 2, projection="polar")
    runs = found["knee"]
    angles = np.linspace(0.0, 2.0 * np.pi, len(runs[0]["knee depth"]) + 1)
    for one in runs[:: max(len(runs) // DRAWN, 1)]:
        right.plot(angles, 1e9 * np.append(one["knee depth"], one["knee depth"][0]), lw=1)
    right.set_title("wear of the knee's bore in a turn [nm], four runs", fontsize=10)
    figure.savefig(path, dpi=130)


def main() -> None:
    options = command(
        __doc__,
        "two runs, two points, one phase",
        f"{DOCS}; --quick: results/benchmarks",
        runs=(16, "of each case"),
        samples=(64, "of the sensitivity"),
        phases=(4, "of each sample"),
        jobs=(2, "processes"),
    ).parse_args()
    require(options.quick, SALib="pip install 'jointplay[sensitivity]'")
    if options.quick:
        options.runs, options.samples, options.phases = 2, 2, 1
    out = folder_of(options, "jansen", DOCS)
    ideal = ideal_forces()
    forces = ", ".join(f"{name} {force:.1f}" for name, force in ideal.items())
    lines = [f"largest force without clearance [N]: {forces}"]
    found = {case: ensemble(case, options.runs, options.jobs) for case in CASES}
    for case, runs in found.items():
        lines.append(f"clearance 0.1 mm in {case}, {options.runs} runs that begin at other phases")
        for joint in CASES[case]:
            force = np.array([one[f"{joint} force"] for one in runs])
            depths = np.array([one[f"{joint} depth"] for one in runs])
            mean = depths.mean(axis=0)
            worn = ", ".join(
                f"{100 * part:g} % of the wear on {arc(mean, part):.0f} deg"
                for part in PARTS_OF_WEAR
            )
            lines += [
                f"  {joint}: largest force [N] {interval(force)}; {force.mean() / ideal[joint]:.3g}"
                " times that without clearance",
                f"  {joint}: wear a turn, mean depth [nm] {interval(depths.mean(axis=1), 1e9)}",
                f"  {joint}: {worn} of the bore; deepest over mean {mean.max() / mean.mean():.3g}",
            ]
    # Cycles until the knee's clearance has doubled where it is worn most.
    how = {"runs": 1 if options.quick else 4, "jobs": options.jobs}
    life = jp.wear(
        machine("knee"), "knee", 1e-4, blocks=1 if options.quick else 5, cycles_per_run=2.0, **how
    )
    lines += ["wear and clearance coupled, knee:", str(life)]
    lines += sensitivity(options.samples, options.phases, options.jobs)
    text = "\n".join(lines) + "\n"
    (out / "jansen.txt").write_text(text)
    draw(found, ideal["knee"], out / "jansen.png")
    print(text, end="")
