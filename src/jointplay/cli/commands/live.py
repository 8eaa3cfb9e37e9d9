"""`jointplay live`: change a machine's numbers and see at once what they do."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.base.errors import JointplayError, require_whole
from jointplay.cli.commands import add_option, add_switch
from jointplay.cli.commands.inputs import add_inputs, explain, scenario_of


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "live",
        usage="jointplay live [FILE | ROBOT] [--port N] [--no-browser] [options of jointplay run]",
        help="sliders for clearance, friction, payload, speed: see at once what they do",
        description="Serve a page on this machine that has a slider for the clearances, friction "
        "and restitution of each joint with play, for payload, speed of the motion, gravity and "
        "the temperature of rolling bearings. When one is moved, the static error budget follows, "
        "then a quick run of the motion, then the run as jointplay run makes it: the robot in "
        "motion, the orbits of its journals, tool error, forces, energy. Without FILE or ROBOT: "
        "the SCARA arm.",
        epilog="Only this machine reaches the page, and only by the address that is printed: it "
        "ends in a random token. Ctrl-C stops the server and its processes.",
        lazy=explain,
    )
    group = parser.add_argument_group("page")
    add_option(group, "--port N", "port to listen on", 7000)
    add_switch(group, "--no-browser", "do not open a browser")
    add_inputs(parser)


def run(options: argparse.Namespace) -> int:
    """Serve until told to stop."""
    require_whole("the port", options.port, 0, 65535)
    scenario = scenario_of(options)
    simulation = scenario.simulation(options.case)
    case = options.case or scenario.cases[0]
    if simulation.duration is None and simulation.motion is None:
        raise JointplayError("nothing says how long to simulate: give a motion, or --duration")
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
        say=_say,
    )
    return 0


def _say(text: str) -> None:
    """Print at once: who reads a pipe waits for the address."""
    print(text, flush=True)
