"""`jointplay run`: simulate one robot, or the cases of a scenario file.

Simulate all cases of a scenario file, or one robot with clearance in the joints named, and draw
figures that compare the cases, or an overview of one. Without FILE or ROBOT: the SCARA arm under
gravity, 0.2 mm in joint B, 3 s. Options override FILE.

DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load or any NetCDF
reader), and the figures as .png.

    [FILE | ROBOT]
    --out DIR  folder for the results (required)
    --case NAME ...  run only this case of FILE
    --beside FILE  the motion as it was meant, where the one that is run was corrected: the tool's
        error is its distance from the ideal mechanism's on that
  integration and output:
    --certify  repeat the run with finer steps to give the headline figures numerical error bounds;
        takes about two and a half times as long
    --no-error-estimate  leave out the further runs that estimate the numerical errors of the
        headline figures
    --resume  continue the interrupted runs in DIR, bit for bit; finished ones are kept
    --figures  draw all figures of a single case, too: the tool's motion and path, orbits, forces
    --no-figures  do not draw figures
    --pdf  draw each figure as .pdf, too
    --assumed  list what nobody gave: values, by which rule, and what another would change
    --jobs
    --detail
    --quiet
"""

import argparse
from pathlib import Path

from jointplay.cli.commands.inputs import is_scenario, scenario_of


def run(options: argparse.Namespace) -> int:
    from jointplay.cli.commands import run_scenario
    from jointplay.scenario.robot import LABEL

    if not options.resume and not is_scenario(options):
        run_scenario.check_output_folder(Path(options.out), [f"{LABEL}.nc"])
    return run_scenario.run(scenario_of(options), options)
