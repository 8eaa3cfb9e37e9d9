"""`jointplay reduce`: a joint's play as dead band and friction, for other simulators."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from jointplay.commands import add_quiet, name_and_value
from jointplay.commands.mechanism import add_robot, quantity, task
from jointplay.core.errors import JointplayError, require_non_negative

FORMATS = ("mjcf", "sdf", "urdf", "json")


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "reduce",
        help="a joint's play as dead band and friction, for MuJoCo, Gazebo, ROS",
        description="Fit a hinge with dead band, stiffness, damping and friction to the full model "
        "of one joint's play, by reversals about a pose, and write it: MJCF (MuJoCo), SDF "
        "(Gazebo), URDF and YAML, JSON with ranges for domain randomisation. The dead band about "
        "the axis is the gear's; the bearing gives friction and lean. See docs/decisions.md.",
        epilog='Example: jointplay reduce ur5 --joint elbow_joint --clearance "0.05 mm" --gear '
        'elbow_joint="2 arcmin" --gear-stiffness 2e4 --rotor-inertia 0.5 --out elbow',
    )
    add_robot(parser)
    parser.add_argument("--pose", metavar="JOINT=X,...", help="about which the joint reverses")
    group = parser.add_argument_group("gear (of a scenario, or these)")
    group.add_argument("--gear-stiffness", metavar="X", help="of the teeth [N m/rad]")
    group.add_argument("--gear-damping", metavar="X", help="of the teeth [N m s/rad] (default 0)")
    group.add_argument("--rotor-inertia", metavar="X", help="on the joint's side [kg m^2]")
    group = parser.add_argument_group("reversals")
    group.add_argument("--amplitude", metavar="ANGLE", help="(default 0.1 rad)")
    group.add_argument("--period", metavar="TIME", help="(default 2 s)")
    group = parser.add_argument_group("output")
    group.add_argument(
        "--encoder",
        choices=("motor", "link"),
        default="motor",
        help="before the play (default) or after it",
    )
    group.add_argument("--tilt", action="store_true", help="MJCF: the axis can lean, too")
    group.add_argument(
        "--format", action="append", choices=FORMATS, help="(repeatable; default: all)"
    )
    group.add_argument(
        "--spread",
        type=float,
        default=0.3,
        metavar="X",
        help="JSON: assumed relative half width of ranges that are not measured (default 0.3)",
    )
    group.add_argument("--check", action="store_true", help="run the MJCF in MuJoCo and compare")
    group.add_argument("--out", metavar="DIR", required=True, help="folder for the files")
    add_quiet(group)
    parser.set_defaults(motion=None, workspace=None)


def run(options: argparse.Namespace) -> int:
    """Fit, print, write."""
    from jointplay.core import files

    if len(options.joint) != 1:
        raise JointplayError(f"--joint must name one joint, got {len(options.joint)}")
    scenario = str(options.robot).endswith(".toml")
    joint = name_and_value(options.joint[0])[0]
    files_out = [*_names(joint, options.format), "reversals.png"]
    files.refuse_present(options.out, files_out)  # before anything is loaded that takes time
    from jointplay.design import reduced_files
    from jointplay.design.poses import middle
    from jointplay.design.reduction import AMPLITUDE, PERIOD, reduce

    if scenario and options.clearance is None and "=" not in options.joint[0]:
        options.joint = []  # the scenario says which play it has
    if options.pose is None:
        options.pose = ""
    if not options.joint or "=" in options.joint[0] or options.clearance is not None:
        work = task(options)
    else:
        options.joint = []
        work = task(options)
        if joint not in work.mechanism.gears:
            raise JointplayError(
                "--clearance is missing, or --gear: without play nothing is reduced"
            )
    require_non_negative("--spread", options.spread, "")
    mechanism = _with_gear(options, work.mechanism, scenario)
    out = files.claim(options.out, files_out)
    pose = {**middle(mechanism), **_pose(mechanism, work.q)}
    model = reduce(
        mechanism,
        joint,
        pose,
        amplitude=quantity(options.amplitude, "rad", "--amplitude")
        if options.amplitude
        else AMPLITUDE,
        period=quantity(options.period, "s", "--period") if options.period else PERIOD,
        progress=not options.quiet,
    )
    print("\n".join([*work.notes, str(model)]))
    if options.tilt and model.tilt_error > model.tilt > 0.0:
        print(
            "note: the error of the lean exceeds its dead band: its load does not turn the journal "
            "to the rim (a side force presses both rims to one side, or nothing does); leave "
            "--tilt out"
        )
    mjcf = reduced_files.to_mjcf(mechanism, model, encoder=options.encoder, tilt=options.tilt)
    makers: dict[str, Callable[[], str]] = {
        ".xml": lambda: mjcf,
        ".sdf": lambda: reduced_files.to_sdf(mechanism, model),
        ".urdf": lambda: reduced_files.to_urdf(mechanism, model),
        ".yaml": lambda: reduced_files.to_yaml(model, options.encoder),
        ".json": lambda: reduced_files.to_json(model, options.encoder, options.spread),
    }
    for name in files_out[:-1]:
        files.write(out / name, makers[name[name.rindex(".") :]]())
    from jointplay.plots.design import reversals

    files.picture(out / "reversals.png", reversals(model))
    if options.check:
        _compare(mjcf, model)
    print(f"written to {options.out}: {', '.join(files_out)}")
    return 0


def _compare(mjcf: str, model: Any) -> None:
    """Run the MJCF in MuJoCo, and print how it differs from the full model."""
    from jointplay.design import reduced_files

    seen = reduced_files.follow(mjcf, model)
    kept = "within" if seen.error <= model.angle_error else "beyond"
    print(
        f"MuJoCo: link's angle off by up to {1e6 * seen.error:.4g} urad, {kept} the stated "
        f"{1e6 * model.angle_error:.4g}; {1e6 * seen.step_seconds:.3g} us a step of "
        f"{1e3 * seen.step:.3g} ms"
    )
    if seen.lean_error is not None:
        kept = "within" if seen.lean_error <= model.tilt_error else "beyond"
        print(
            f"MuJoCo: axis' lean off by up to {1e3 * seen.lean_error:.4g} mrad, {kept} the "
            f"stated {1e3 * model.tilt_error:.4g}"
        )


def _names(joint: str, formats: Sequence[str] | None) -> list[str]:
    """Names of the models' files."""
    stem = joint.replace("/", "_")
    names = {
        "mjcf": [f"{stem}.xml"],
        "sdf": [f"{stem}.sdf"],
        "urdf": [f"{stem}.urdf", f"{stem}.yaml"],
        "json": [f"{stem}.json"],
    }
    return [name for one in dict.fromkeys(formats or FORMATS) for name in names[one]]


def _pose(mechanism: Any, q: Any) -> dict[str, float]:
    from jointplay.design.poses import moving

    return {name: float(q[0, mechanism.coordinate(name)]) for name in moving(mechanism)}


def _with_gear(options: argparse.Namespace, mechanism: Any, scenario: bool) -> Any:
    """The gears with what the options say of teeth and rotor."""
    given = {
        "stiffness": (options.gear_stiffness, "N*m/rad", "--gear-stiffness"),
        "rotor_inertia": (options.rotor_inertia, "kg*m^2", "--rotor-inertia"),
        "damping": (options.gear_damping, "N*m*s/rad", "--gear-damping"),
    }
    values = {
        name: quantity(text, unit, option)
        for name, (text, unit, option) in given.items()
        if text is not None
    }
    if values and not mechanism.gears:
        option = given[next(iter(values))][2]
        raise JointplayError(f"{option} is of a gear, and no joint has one; name it by --gear")
    if options.gear and not scenario:
        for name in ("stiffness", "rotor_inertia"):
            if name not in values:
                raise JointplayError(f"{given[name][2]} is missing: a gear with play needs it")
    gears = {name: replace(gear, **values) for name, gear in mechanism.gears.items()}
    return mechanism.with_clearance(mechanism.clearance, gears)
