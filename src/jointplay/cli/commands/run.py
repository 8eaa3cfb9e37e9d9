"""`jointplay run`: simulate one robot, or the cases of a scenario file.

Simulate all cases of a scenario file, or one robot with clearance in the joints named, and draw
figures that compare the cases, or an overview of one. Without FILE or ROBOT: the SCARA arm under
gravity, 0.2 mm in joint B, 3 s. Options override FILE.

DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load or any NetCDF
reader), and the figures as .png.
"""

import argparse
from pathlib import Path

from jointplay.cli.commands import inputs
from jointplay.cli.commands.inputs import is_scenario, scenario_of
from jointplay.cli.options import FLAG, REPEATED, Parser


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument
    add("--out", metavar="DIR", required=True, help="folder for the results")
    add("--case", metavar="NAME", **REPEATED, help="run only this case of FILE")
    add("--beside", metavar="FILE", help="the motion as it was meant, where the one that is run "
        "was corrected: the tool's error is its distance from the ideal mechanism's on that")
    add = parser.add_argument_group("integration and output").add_argument
    add("--certify", **FLAG, help="repeat the run with finer steps to give the headline figures "
        "numerical error bounds; takes about two and a half times as long")
    add("--no-error-estimate", **FLAG, help="leave out the further runs that estimate the "
        "numerical errors of the headline figures")
    add("--resume", **FLAG, help="continue the interrupted runs in DIR, bit for bit; finished ones "
        "are kept")
    add("--figures", **FLAG, help="draw all figures of a single case, too: the tool's motion and "
        "path, orbits, forces")
    add("--no-figures", **FLAG, help="do not draw figures")
    add("--pdf", **FLAG, help="draw each figure as .pdf, too")
    add("--assumed", **FLAG, help="list what nobody gave: values, by which rule, and what another "
        "would change")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.cli.commands import run_scenario
    from jointplay.scenario.robot import LABEL

    if not options.resume and not is_scenario(options):
        run_scenario.check_output_folder(Path(options.out), [f"{LABEL}.nc"])
    return run_scenario.run(scenario_of(options), options)
