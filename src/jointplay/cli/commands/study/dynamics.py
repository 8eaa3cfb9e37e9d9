"""`jointplay study dynamics`: bifurcations, Poincare maps, Lyapunov exponents, basins.

Let a periodically driven mechanism settle over many turns, then analyse it: turns: quantities over
the crank's angle, compared with the ideal mechanism; bifurcation: a quantity sampled once per turn,
over the values of a key (--vary); poincare: two quantities sampled once per turn, plotted against
each other; lyapunov: largest Lyapunov exponent with its confidence interval, over a key with
--vary; recurrence: when the journal, or a quantity given by --of, returns to an earlier state;
waterfall: spectra over the values of a key, such as the crank's speed (--vary); runup: spectra
while the crank's speed rises evenly over the values of --vary; basin: the orbit on which the motion
settles, over the journal's starting position. Values run in parallel; finished ones are kept in the
folder, and the same command continues from it. docs/nonlinear.md explains the figures.

Example: jointplay study dynamics jointplay:slider_crank.toml bifurcation --case "0.5 mm" --vary
"motion.speeds.crank_pin=500:5000:400 rpm" --out speeds

    FILE | ROBOT  robot
    KIND  turns, bifurcation, poincare, lyapunov, recurrence, waterfall, runup or basin
    --vary KEY=FROM:TO:COUNT  key of the scenario, its range of values, and their unit
    --of NAME ...  quantity, such as guide.acceleration, crank_pin.moment, piston_pin.eccentricity;
        an unknown name lists all of them
    --leave-out N  turns left out at the start, while it settles (default: depends on KIND)
    --keep N  turns that are analysed (default: depends on KIND)
    --phase X  phase of the section [turns] (default 0.25)
    --records N  records per turn (default 1000)
    --orders X  highest order of spectra (default 20)
    --window N  runup: turns per spectrum (default 8)
    --threshold X  recurrence: distance that counts as near, as a share of all distances (default
        0.1)
    --joint NAME  basin: joint whose journal starts off centre
    --grid N  basin: number of starting positions along x and along y (default 21)
    --jobs
    --out DIR  folder for the table and the figure (required)
    --quiet
"""

import argparse

from jointplay.base.errors import JointplayError
from jointplay.cli.commands.inputs import scenario_of


def run(options: argparse.Namespace) -> int:
    from jointplay.base import files, processes

    processes.number_of(options.jobs)
    from jointplay.study.nonlinear import Analysis, Varied

    names = ("keep", "phase", "records", "orders", "window", "threshold", "joint", "grid")
    analysis = Analysis.of(
        scenario_of(options),
        options.kind,
        options.case,
        Varied.parse(options.vary) if options.vary else None,
        options.of,
        leave_out=options.leave_out,
        **{name: getattr(options, name) for name in names},
    )
    out, mark = files.claim(options.out, []), f"jointplay study dynamics {options.kind}"
    path = out / f"{options.kind}.png"
    if path.exists() and not files.holds(path, mark):
        raise JointplayError(f"{str(path)!r} is no figure of this command; choose another folder")
    from jointplay.show.plots.nonlinear import figure

    found = analysis.run(out, options.jobs, not options.quiet)
    files.picture(path, figure(found), mark=mark)
    print(f"written to {options.out}: {options.kind}.csv, {path.name}")
    return 0
