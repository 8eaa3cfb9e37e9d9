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
"""

import argparse

from jointplay.base.errors import JointplayError
from jointplay.cli.commands import given, inputs
from jointplay.cli.commands.inputs import scenario_of
from jointplay.cli.options import REPEATED, Parser


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", required=True)
    add = parser.add_argument
    add("kind", metavar="KIND", help="turns, bifurcation, poincare, lyapunov, recurrence, "
        "waterfall, runup or basin")
    add("--vary", metavar="KEY=FROM:TO:COUNT", help="key of the scenario, its range of values, and "
        "their unit")
    add("--of", metavar="NAME", **REPEATED, help="quantity, such as guide.acceleration, "
        "crank_pin.moment, piston_pin.eccentricity; an unknown name lists all of them")
    add("--leave-out", metavar="N", type=int, help="turns left out at the start, while it settles "
        "(default: depends on KIND)")
    add("--keep", metavar="N", type=int, help="turns that are analysed (default: depends on KIND)")
    add("--phase", metavar="X", type=float, default=0.25, help="phase of the section [turns]")
    add("--records", metavar="N", type=int, default=1000, help="records per turn")
    add("--orders", metavar="X", type=float, default=20, help="highest order of spectra")
    add("--window", metavar="N", type=int, default=8, help="runup: turns per spectrum")
    add("--threshold", metavar="X", type=float, default=0.1, help="recurrence: distance that "
        "counts as near, as a share of all distances")
    add("--joint", metavar="NAME", help="basin: joint whose journal starts off centre")
    add("--grid", metavar="N", type=int, default=21, help="basin: number of starting positions "
        "along x and along y")
    add("--out", metavar="DIR", required=True, help="folder for the table and the figure")
    parser.share("--jobs", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.base import files, processes

    processes.number_of(options.jobs)
    from jointplay.study.nonlinear import Analysis, Varied

    names = ("leave_out", "keep", "phase", "records", "orders", "window", "threshold", "joint")
    analysis = Analysis.of(
        scenario_of(options),
        options.kind,
        options.case,
        Varied.parse(options.vary) if options.vary else None,
        options.of,
        **given(options, *names, "grid"),
    )
    out, mark = files.claim(options.out, []), f"jointplay study dynamics {options.kind}"
    path = out / f"{options.kind}.png"
    if path.exists() and not files.holds(path, mark):
        raise JointplayError(f"{str(path)!r} is no figure of this command; choose another folder")
    from jointplay.show.plots.nonlinear import figure

    outcome = analysis.run(out, options.jobs, not options.quiet)
    files.picture(path, figure(outcome), mark=mark)
    print(f"written to {options.out}: {options.kind}.csv, {path.name}")
    return 0
