"""`jointplay study maintenance`: cycles that it takes until wear puts the tool out of tolerance.

Estimate after how many cycles of a scenario wear of its bores lets the tool's error exceed a target
(static worst case along the motion), and which joint's wear causes it. Joints need a
clearance and a wear_rate, here or in the scenario: --set joints.NAME.radial_clearance="0.05 mm"
--set joints.NAME.wear_rate="1e-5 mm^3/(N*m)". One run is one cycle of the motion; BLOCKS x RUNS of
them are simulated, one block after the other. Begin with --blocks 1 --runs 1.
docs/wear.md explains the numbers.

    FILE | ROBOT  robot
    --blocks N  blocks of cycles (default 5)
    --runs N  runs per block, perturbed at the start if there are several (default 2)
    --cycles-per-run X  cycles in one run (default 1)
    --jobs
    --detail
    --quiet
    --target LENGTH  tolerance of the tool (required)
    --wear-factor X  factor within which wear rates are known (default 3)
    --out DIR  folder for maintenance.csv and the figure
"""

import argparse
from dataclasses import replace

from jointplay.base.signals import INTERRUPTED
from jointplay.cli.commands import Outputs, print_answer
from jointplay.cli.commands.inputs import simulation_of
from jointplay.cli.commands.study.wear import cycles


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["maintenance.csv", "maintenance.png"])
    from jointplay.study.maintenance import maintenance

    simulation = simulation_of(options)
    out.claim()
    estimate = maintenance(
        simulation, options.target, factor=options.wear_factor, **cycles(options)
    )
    table = estimate.table
    shares, life, known = table.notes
    print_answer(life, replace(table, notes=()), (shares, known), options.detail)
    if options.out:
        from jointplay.show.plots.design import wear_course

        out.write(
            {"maintenance.csv": estimate.table.csv(), "maintenance.png": wear_course(estimate)}
        )
    return 0 if estimate.reached else INTERRUPTED
