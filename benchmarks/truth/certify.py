"""Whether stated numerical errors cover the true ones. See docs/certificates.md.

Configurations drawn afresh at random, as random_cases.py draws them, by all integrators in turn:
the default, semi-implicit Euler, the default with a tolerance, rk4. Each is certified. The truth of
a figure is the interval of converged runs that random_cases.py makes: from the same start, from
starts 1, 10 and 100 nm aside, and with twice the step. A figure is judged if the runs of different
step agree to a tenth of a per cent or to the stated error, and covered if it is no further from the
interval than the stated error; a configuration is if all its judged figures are.
"""

from dataclasses import replace

import numpy as np
from common import COLOURS, new_figure
from tqdm import tqdm
from truth.random_cases import (
    HEADLINE,
    Case,
    Outcome,
    as_data,
    begin,
    benchmark,
    footnotes,
    judge_all,
    kind_of,
)

import jointplay as jp

WAYS = ({}, {"integrator": "semi-implicit-euler"}, {"tolerance": 1e-3}, {"integrator": "rk4"})


def by_any_method(case: Case) -> jp.Simulation:
    """The case by one of the integrators."""
    return replace(case.simulation, **WAYS[case.number % len(WAYS)])


def tell(outcome: Outcome) -> None:
    """Say which figures are not covered."""
    case = outcome.case
    if outcome.note:
        tqdm.write(f"case {case['number']}: {outcome.note}")
    for row in outcome.rows:
        if row["agreed"] and not row["covered"]:
            tqdm.write(
                f"not covered: case {row['number']}: {row['figure']}: {row['value']:.6g} ± "
                f"{row['certified_error']:.2g}, truth {row['low']:.6g} to {row['high']:.6g} "
                f"{row['unit']} ({row['case']}, {row['integrator']}, {row['step']:g} s)"
            )


def relative(row: dict, key: str) -> float:
    return float(row[key]) / max(abs(row["mean"]), 1e-300)


def main() -> None:
    made = benchmark("certify", __doc__, 44)
    args = begin(made)
    outcomes = judge_all(args.seed, range(args.cases), args.jobs, tell, True, False, by_any_method)
    rows = as_data(outcomes)
    table = []
    for name in HEADLINE:
        every = [row for row in rows if kind_of(row["figure"]) == name]
        those = [row for row in every if row["agreed"]]
        if not those:
            continue
        known = [row for row in those if np.isfinite(row["certified_error"]) and row["mean"]]
        stated, true = (
            np.array([relative(row, key) for row in known]) for key in ("certified_error", "away")
        )
        table.append(
            [
                name,
                f"{sum(row['covered'] for row in those)} of {len(those)}",
                f"{len(every) - len(those)}",
                f"{100 * np.median(true):.2g}",
                f"{100 * true.max():.2g}",
                f"{100 * np.median(stated):.2g}",
                f"{100 * stated.max():.2g}",
            ]
        )
    figure, axes = new_figure(1, 1, 5.0, 4.5)
    panel = axes[0, 0]
    for name, colour in zip(HEADLINE, COLOURS, strict=True):
        those = [row for row in rows if kind_of(row["figure"]) == name and row["mean"]]
        points = [
            [max(relative(row, key), 1e-8) for row in those] for key in ("away", "certified_error")
        ]
        panel.loglog(*points, ".", color=colour, label=name)
    panel.plot([1e-8, 10.0], [1e-8, 10.0], color="0.5", lw=0.8)
    panel.set_xlabel("true error, relative")
    panel.set_ylabel("stated error, relative")
    panel.legend(fontsize=7)
    header = [
        "figure",
        "covered",
        "converged runs differ",
        "true error, median [%]",
        "largest [%]",
        "stated error, median [%]",
        "largest [%]",
    ]
    made.finish(header, table, rows, figure)
    footnotes(outcomes)
    certified = [one for one in outcomes if one.rows]
    print(f"further runs cost {np.median([one.case['cost_in_runs'] for one in certified]):.0f} "
          "times the run, in the middle")  # fmt: skip
    covered = sum(all(r["covered"] for r in one.rows if r["agreed"]) for one in certified)
    print(f"covered {covered} of {len(certified)}")
