"""What the benchmark scripts share: the robot, ensembles of runs, tables and files."""

import argparse
import csv
import functools
import importlib.util
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import jointplay as jp
from jointplay.base.processes import cores
from jointplay.base.tables import Table
from jointplay.paper.cases import JUDGED_FROM_S
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation import PERTURBATION
from jointplay.simulation.result.certificate import plus_minus

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

JOINT = "joint_b"
RECORD_INTERVAL = 2e-4
"""Interval of the records, a multiple of every step used [s]."""

COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"),
    *("#000000", "#F0E442"),
)
"""Okabe and Ito's, told apart by colour-blind readers."""
MARKERS = "os^Dv<"


@dataclass(frozen=True)
class Case:
    """One SCARA simulation of the 3 s cycle; lengths in m, step in s."""

    radial: float = 0.2e-3
    axial: float = 0.2e-3
    restitution: float = 0.9
    friction: float = 0.1
    loaded: bool = False
    integrator: str = DEFAULT
    step: float = 1e-5

    @property
    def ideal(self) -> bool:
        return self.radial == 0.0

    def simulation(self, seed: int | None = None, **options) -> jp.Simulation:
        bearing = {} if self.ideal else {JOINT: self.bearing()}
        gravity = (0.0, 0.0, -9.81) if self.loaded else (0.0, 0.0, 0.0)
        options = {
            "step": self.step,
            "integrator": self.integrator,
            "record_every": round(RECORD_INTERVAL / self.step),
            "seed": seed,
            "start": "centred",
        } | options
        return jp.Simulation(
            jp.Mechanism(jp.shipped("scara.urdf"), bearing, gravity=gravity), motion(), **options
        )

    def bearing(self) -> jp.RevoluteClearance:
        return jp.RevoluteClearance(
            radial_clearance=self.radial,
            axial_clearance=self.axial,
            restitution=self.restitution,
            friction=jp.contact.Ambrosio(self.friction),
        )


@functools.cache
def motion() -> jp.Motion:
    return jp.Motion.from_csv(jp.shipped("scara_motion.csv"))


@functools.cache
def ideal_tool(loaded: bool) -> np.ndarray:
    """Where the ideal robot's tool is at each record [m]."""
    return Case(radial=0.0, loaded=loaded).simulation().run()["tool_position"].values


def completed(result: jp.Result) -> jp.Result:
    """The result; refused if its run failed, since that must not enter a mean."""
    if result.status != jp.Status.COMPLETED:
        raise jp.JointplayError(result.message)
    return result


def measure(case: Case, seed: int | None, **options: Any) -> dict[str, float]:
    """Run once and reduce the run to its figures, as the study judges them, at joint B.

    Options are of the simulation.
    """
    simulation = replace(case.simulation(seed, **options), judge_from=JUDGED_FROM_S)
    result = completed(simulation.run())
    judged = result.time >= result.judge_from
    away = result["tool_position"].values - ideal_tool(case.loaded)
    away = 1e3 * np.linalg.norm(away[judged], axis=1)
    force = "reaction_force" if case.ideal else "joint_force_peak"
    at = {"moving_joint" if case.ideal else "joint": JOINT}
    audit = result.audit
    lost = {
        name: float(np.ptp(result[name].values[judged]))  # which never fall
        for name in ("normal_dissipation", "friction_dissipation")
    }
    return {
        "judged_from_s": result.judge_from,
        "deviation_rms_mm": float(np.sqrt(np.mean(away**2))),
        "deviation_max_mm": float(away.max()),
        "peak_force_N": float(np.linalg.norm(result[force].sel(at).values[judged], axis=1).max()),
        "peak_contact_N": 0.0 if case.ideal else float(result["normal_force_peak"][judged].max()),
        "impacts": audit.judged_impacts,
        "normal_loss_J": lost["normal_dissipation"],
        "friction_loss_J": lost["friction_dissipation"],
        "energy_residual_J": audit.energy_residual,
        "shortest_contact_steps": audit.shortest_contact_steps,
        "wall_s": result.dataset.attrs["wall_time_s"],
    }


Ensemble = dict[str, np.ndarray]
"""Each figure of `measure` for every run of a case."""

Measure = Callable[[Any, int | None], dict[str, Any]]
"""What runs a case once, with a seed; at module level, for other processes to find it."""


def _measure(how: Measure, run: tuple[Any, int | None]) -> dict[str, Any]:
    case, seed = run
    return how(case, seed) | {"seed": -1 if seed is None else seed}


def ensembles(cases: Sequence[Any], runs: int, jobs: int, how: Measure = measure) -> list[Ensemble]:
    """Measure every case in `runs` runs of slightly displaced journals (an ideal robot in one)."""
    seeds = [[None] if case.ideal else list(range(runs)) for case in cases]
    plan = [(case, seed) for case, own in zip(cases, seeds, strict=True) for seed in own]
    found = iter(jp.Study(plan, functools.partial(_measure, how)).run(jobs, progress=True))
    groups = [[next(found) for _ in own] for own in seeds]
    return [{name: np.array([run[name] for run in group]) for name in group[0]} for group in groups]


def require(quick: bool, **packages: str) -> None:
    """End here if something is not installed: with status 0 and a line that says so if `quick`.

    Args:
        quick: whether this is a quick form, which tests and CI start wherever they run.
        packages: how to install each, by the name of its module.
    """
    for name, how in packages.items():
        if importlib.util.find_spec(name) is None:
            text = f"{name} is not installed: {how}"
            if not quick:
                raise SystemExit(text)
            print(f"skipped: {text}")
            sys.exit(0)


def command(
    doc: str, quick: str = "a rough answer, in a fraction of the time", out: str = "", **options
) -> argparse.ArgumentParser:
    """A command line with `--quick`, `--out` where something is written, and options.

    Args:
        doc: the script's docstring.
        quick: what the quick form does.
        out: folder that is written to, if none is given.
        options: default and help of each; what is False is a flag, others are of their default's
            type.
    """
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=doc, formatter_class=plain)
    parser.add_argument("--quick", action="store_true", help=quick)
    if out:
        parser.add_argument("--out", type=Path, help=f"folder for what it writes (default: {out})")
    for name, (default, text) in options.items():
        how = {"action": "store_true"} if default is False else {"type": type(default)}
        words = text if default is False else f"{text} (default: %(default)s)"
        parser.add_argument(f"--{name.replace('_', '-')}", default=default, help=words, **how)
    return parser


def folder_of(options: argparse.Namespace, name: str, docs: Path | None = None) -> Path:
    """Folder for what a script writes, made: `--out`, or else that of the documentation.

    Quick forms leave the documentation alone: theirs is in results/benchmarks.
    """
    plain = Path("results/benchmarks") / name
    folder: Path = options.out or (plain if options.quick or docs is None else docs)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


class Benchmark:
    """A benchmark's command line and files: `<name>.csv`, `<name>.md` and `<name>.png`."""

    def __init__(
        self, name: str, doc: str, runs: int = 8, docs: Path | None = None, **options
    ) -> None:
        self.name, self.docs, self.ensembles = name, docs, runs > 0
        plain = f"results/benchmarks/{name}"
        if runs:
            aside = f"with journals displaced by up to {100 * PERTURBATION:g} %% of their play"
            options |= {"runs": (runs, f"of each case, {aside}"), "jobs": (cores(), "processes")}
        options["force"] = (False, "overwrite files of an earlier run")
        where = f"{docs}; --quick: {plain}" if docs else plain
        self.parser = command(doc, out=where, **options)

    def parse(self) -> argparse.Namespace:
        """Parse the command line; stop if a file would be overwritten."""
        args = self.parser.parse_args()
        if (self.ensembles and args.runs < 2) or getattr(args, "jobs", 1) < 1:
            self.parser.error("--runs must be at least 2 and --jobs at least 1")
        if args.quick and self.ensembles:
            args.runs = min(args.runs, 2)
        self.folder = folder_of(args, self.name, self.docs)
        existing = [path for path in map(self.path, ("csv", "md", "png")) if path.exists()]
        if existing and not args.force:
            self.parser.error(f"{existing[0]} exists; give another --out, or --force")
        return args

    def path(self, kind: str) -> Path:
        return self.folder / f"{self.name}.{kind}"

    def compare(
        self,
        args: argparse.Namespace,
        cases: Sequence[Case],
        heads: Mapping[str, Callable[[Case], float]],
        shown: Sequence[str],
        draw: Callable[[Sequence[Case], Sequence[Ensemble]], Figure],
        words: str,
    ) -> None:
        """Run ensembles of SCARAs, and finish with a row for each: what it has, and what it does.

        `words` say what all have in common.
        """
        found = ensembles(cases, args.runs, args.jobs)
        rows = [
            [*(f"{of(case):g}" for of in heads.values()), *(spread(one[name]) for name in shown)]
            for case, one in zip(cases, found, strict=True)
        ]
        figure = draw(cases, found)
        how = f"mean ± standard deviation of {args.runs} runs"
        figure.suptitle(f"SCARA, {words}: {how}", fontsize=10)
        header = [*heads, *(QUANTITIES[name] for name in shown)]
        self.finish(header, rows, runs_as_rows(cases, found), figure)

    def finish(
        self,
        header: Sequence[str],
        rows: Sequence[Sequence[str]],
        data: list[dict],
        figure: Figure | None = None,
    ) -> None:
        """Print and write the table, write data and figure."""
        table = Table.of_texts([header, *rows]).markdown()
        print(table)
        self.path("md").write_text(table + "\n", encoding="utf-8")
        with self.path("csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(data[0]), restval="")
            writer.writeheader()
            writer.writerows(data)
        kinds = ["md", "csv"]
        if figure is not None:
            figure.savefig(self.path("png"), dpi=160)
            kinds.append("png")
        print(f"\nwritten: {', '.join(str(self.path(kind)) for kind in kinds)}")


def runs_as_rows(cases: Sequence[Case], found: Sequence[Ensemble]) -> list[dict]:
    """One row a run for the CSV: the case, then what was measured."""
    return [
        asdict(case) | {name: values[i] for name, values in ensemble.items()}
        for case, ensemble in zip(cases, found, strict=True)
        for i in range(len(ensemble["seed"]))
    ]


def spread(values: np.ndarray) -> str:
    """Mean ± standard deviation over the runs; the mean alone if they all agree."""
    error = 0.0 if np.ptp(values) == 0.0 else float(values.std(ddof=1))
    return plus_minus(float(values.mean()), error)


def draw_ensembles(axes, x: Sequence[float], values: Sequence[np.ndarray], **style) -> None:
    """Mean and standard deviation of each ensemble over `x`, single runs as faint dots."""
    means = [group.mean() for group in values]
    deviations = [group.std(ddof=1) if len(group) > 1 else 0.0 for group in values]
    bars = axes.errorbar(x, means, deviations, capsize=3, ms=4, lw=1.2, **style)
    for at, group in zip(x, values, strict=True):
        axes.plot(
            [at] * len(group), group, ".", ms=4, alpha=0.5, mew=0, color=bars.lines[0].get_color()
        )


def new_figure(rows: int, columns: int, width: float = 8.0, height: float = 6.0, **options):
    """Make a figure and its axes, as an array of shape (rows, columns)."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for panel in axes.flat:
        panel.grid(color="0.9", lw=0.6)
        panel.set_axisbelow(True)
        panel.spines[["top", "right"]].set_visible(False)
    return figure, axes


def show_grid(panel, table: np.ndarray, texts: Sequence[Sequence[str]]) -> None:
    """Heat map with the value of every cell written in it."""
    panel.imshow(table, cmap="cividis", origin="lower", aspect="auto")
    panel.grid(False)
    middle = 0.5 * (table.min() + table.max())
    for (row, column), value in np.ndenumerate(table):
        colour = "white" if value < middle else "black"
        panel.text(
            column, row, texts[row][column], ha="center", va="center", color=colour, fontsize=8
        )


def millimetres(length: float) -> str:
    return f"{1e3 * length:g}"


Labels = Mapping[str, str]
QUANTITIES: Labels = {
    "deviation_rms_mm": "tool deviation, RMS [mm]",
    "deviation_max_mm": "tool deviation, largest [mm]",
    "peak_force_N": "peak joint force [N]",
    "peak_contact_N": "peak force of one contact [N]",
    "impacts": "impacts",
    "normal_loss_J": "lost in impacts [J]",
    "friction_loss_J": "lost in friction [J]",
}
"""What is measured and its unit; the tool deviation is the distance from the ideal robot's tool.

The journal's fall into its bearing, before `JUDGED_FROM_S`, is left out."""
