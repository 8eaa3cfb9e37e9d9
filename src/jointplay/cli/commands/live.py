"""`jointplay live`: sliders for clearance, friction, payload, speed in the browser.

Serve a page on this machine that has a slider for the clearances, friction and restitution of each
joint with play, for the play of each gear, for payload, speed of the motion, gravity and the
temperature of rolling bearings. When one is moved, the static error budget follows, then a quick
run of the motion, then the run as jointplay run makes it: the robot in motion, the orbits of its
journals, tool error, forces, energy.
Without FILE or ROBOT: the SCARA arm.

Only this machine reaches the page, and only by the address that is printed: it ends in a random
token. Ctrl-C stops the server and its processes.
"""

import argparse
from functools import partial

from jointplay.base.errors import JointplayError, require_whole
from jointplay.cli.commands import inputs
from jointplay.cli.commands.inputs import scenario_of
from jointplay.cli.options import Parser


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    parser.share("--assumed")
    parser.share("--port", "--no-browser", group="page")
# fmt: on


def run(options: argparse.Namespace) -> int:
    require_whole("the port", options.port, 0, 65535)
    scenario = scenario_of(options)
    simulation = scenario.simulation(options.case)
    case = options.case or scenario.cases[0]
    if simulation.duration is None and simulation.motion is None:
        raise JointplayError("nothing says how long to simulate: give a motion, or --duration")
    if options.assumed:
        from jointplay.simulation.values import assumed_table

        print(assumed_table(simulation, scenario.origins(case)))
    from jointplay.show.live.server import serve
    from jointplay.show.live.state import State

    title = scenario.title.rpartition(":")[2]
    title = title if len(scenario.cases) == 1 else f"{title}, {case}"
    serve(
        State.of(scenario, case, simulation),
        simulation,
        title,
        port=options.port,
        browser=not options.no_browser,
        say=partial(print, flush=True),
    )
    return 0
