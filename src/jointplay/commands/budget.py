"""`jointplay budget`: how far off play lets the tool be, and which joint is to blame."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands.mechanism import add_poses, add_robot, quantity, task
from jointplay.core.errors import JointplayError


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "budget",
        help="how far off play lets the tool be, and which joint is to blame; no simulation",
        description="Error budget of the tool from the play of all joints, without dynamics: worst "
        "case along every direction, where everything rests under its weight and where friction "
        "may hold it, RMS for a load in a random direction, and each joint's share. At a pose, "
        "along a motion, or over the workspace. docs/decisions.md says what the numbers mean.",
        epilog='Example: jointplay budget panda --clearance "0.05 mm" --workspace 500 --out panda',
    )
    add_robot(parser)
    add_poses(parser)
    parser.add_argument("--force", metavar="FX,FY,FZ", help="on the tool, world axes [N]")
    parser.add_argument("--payload", metavar="MASS", help='held at the tool, "2 kg" or [kg]')
    parser.add_argument(
        "--friction",
        metavar="MU",
        help="coefficient with which friction may hold the journals elsewhere than they rest "
        "without it (default: the largest of each joint's friction law)",
    )
    parser.add_argument(
        "--rest-everywhere",
        action="store_true",
        help="find in budget.csv where the machine rests at every pose, not at the worst one only "
        "(0.4 s a pose with one joint, up to 3.5 s with six)",
    )
    parser.add_argument("--out", metavar="DIR", help="folder for budget.csv and the figures")


def run(options: argparse.Namespace) -> int:
    """Reckon, print, draw."""
    from jointplay.core import files

    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, ["budget.csv"])
    from jointplay.design.static_budget import FOLLOW, budget
    from jointplay.loads.drive import Drive

    work = task(options)
    force = load_on_tool(options, work.mechanism.gravity)
    names = ["budget.csv", "bars.png", "robot.png", "reach.png"]
    names += {"motion": ["course.png"], "workspace": ["map.png"]}.get(work.kind, [])
    out = files.claim(options.out, names) if options.out else None
    friction = options.friction and quantity(options.friction, "", "--friction")
    own = None if work.simulation is None else work.simulation.drive
    drive = own if isinstance(own, Drive) and own.follows else FOLLOW
    errors = budget(
        work.mechanism, work.q, force=force, driven=work.driven, friction=friction, drive=drive
    )
    for note in work.notes:
        print(note)
    print(f"at: {work.poses}")
    if len(errors.worst) > 1:
        at = errors.worst_pose
        place = ", ".join(f"{x:.3f}" for x in errors.positions[at])
        print(
            f"worst-case error of {errors.tool!r} [mm]: least {1e3 * errors.worst.min():.4f}, mean "
            f"{1e3 * errors.worst.mean():.4f}, largest {1e3 * errors.worst.max():.4f} (pose {at}, "
            f"tool at {place} m), which is made up like this:"
        )
    print(errors.table())
    print(errors.accuracy)
    if out is None:
        return 0
    from jointplay.plots import design as plots

    if options.rest_everywhere:
        errors.rest_interval  # noqa: B018  which finds the places of rest, too
    files.write(out / "budget.csv", errors.csv())
    files.picture(out / "bars.png", plots.bars(errors))
    files.picture(out / "robot.png", plots.robot(work.mechanism, errors, work.q), dpi=130)
    files.picture(out / "reach.png", plots.reachable(errors))
    if work.kind == "motion":
        from jointplay.design.poses import times_along

        assert work.motion is not None
        time = times_along(work.motion)
        files.picture(out / "course.png", plots.course(errors, time))
    if work.kind == "workspace":
        files.picture(out / "map.png", plots.workspace_map(errors))
    print(f"written to {options.out}: {', '.join(names)}")
    return 0


def load_on_tool(
    options: argparse.Namespace, gravity: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Force on the tool in world axes [N]: what --force and --payload say."""
    force = [0.0, 0.0, 0.0]
    if options.force is not None:
        parts = options.force.split(",")
        if len(parts) != 3:
            raise JointplayError(
                f"--force must be three numbers fx,fy,fz [N], got {options.force!r}"
            )
        force = [quantity(part, "N", "--force") for part in parts]
    if options.payload is not None:
        mass = quantity(options.payload, "kg", "--payload")
        force = [f + mass * g for f, g in zip(force, gravity, strict=True)]
    return force[0], force[1], force[2]
