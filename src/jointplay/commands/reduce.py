"""`jointplay reduce`: a joint's play as dead band and friction, for other simulators."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from jointplay.commands import (
    Outputs,
    add_option,
    add_repeatable,
    add_shared,
    add_switch,
    given,
    in_unit,
    name_and_value,
)
from jointplay.commands.mechanism import Task, add_robot, preset_chosen, task
from jointplay.core.errors import JointplayError, require_non_negative

FORMATS = {
    "mjcf": [".xml"],
    "sdf": [".sdf"],
    "urdf": [".urdf", ".yaml"],
    "json": [".json"],
}
"""Endings of the files of each format."""

GEAR = {
    "gear-stiffness": ("N*m/rad", "of the teeth"),
    "gear-damping": ("N*m*s/rad", "of the teeth (default 0)"),
    "rotor-inertia": ("kg*m^2", "referred to the joint's side of the gear"),
}
"""Options about a gear: units and explanations."""


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "reduce",
        help="model a joint's play as dead band and friction, for MuJoCo, Gazebo, ROS",
        description="Fit a hinge with dead band, stiffness, damping and friction to the full "
        "model of one joint's play, by reversals about a pose, and write it as MJCF "
        "(MuJoCo), SDF (Gazebo), URDF and YAML, JSON with ranges for domain "
        "randomisation. The dead band about the axis comes from the gear; the "
        "bearing contributes friction and tilt. See docs/decisions.md.",
        epilog='Example: jointplay reduce ur5 --joint elbow_joint --clearance "0.05 mm" --gear '
        'elbow_joint="2 arcmin" --gear-stiffness 2e4 --rotor-inertia 0.5 --out elbow',
    )
    add_robot(parser)
    add_option(parser, "--pose JOINT=X,...", "pose about which the joint reverses")
    group = parser.add_argument_group("gear (of a scenario, or these)")
    for name, (unit, text) in GEAR.items():
        add_option(group, f"--{name} X", f"{text} [{unit}]".replace("*", " "), type=in_unit(unit))
    group = parser.add_argument_group("reversals")
    add_option(group, "--amplitude ANGLE", "amplitude of the reversals (default 0.1)")
    add_option(group, "--period TIME", "period of a reversal, there and back (default 2)")
    group = parser.add_argument_group("output")
    add_option(
        group,
        "--encoder",
        "whether the encoder is before or after the play",
        "motor",
        choices=("motor", "link"),
    )
    add_switch(group, "--tilt", "MJCF: let the axis tilt as well")
    add_repeatable(group, "--format", "file format; by default all", choices=FORMATS)
    add_option(
        group, "--spread X", "JSON: relative half width of ranges without measured values", 0.3
    )
    add_switch(group, "--check", "run the MJCF in MuJoCo and compare it with the full model")
    add_option(group, "--out DIR", "folder for the files", required=True)
    add_shared(group, "--quiet")
    parser.set_defaults(motion=None, workspace=None)


def run(options: argparse.Namespace) -> int:
    """Fit, print, write."""
    if len(options.joint) != 1:
        raise JointplayError(f"--joint must name one joint, got {len(options.joint)}")
    from jointplay.joints.bearings import listed_kind

    joint, length = name_and_value(options.joint[0], is_value=listed_kind)
    stem = joint.replace("/", "_")
    endings = [ending for one in options.format or FORMATS for ending in FORMATS[one]]
    names = [f"{stem}{ending}" for ending in dict.fromkeys(endings)]
    out = Outputs(options.out, [*names, "reversals.png"])
    from jointplay.design import reduced_files
    from jointplay.design.poses import middle, moving
    from jointplay.design.reduction import reduce
    from jointplay.plots.design import reversals

    scenario = str(options.robot).endswith(".toml")
    if length is None and options.clearance is None:
        options.joint = []  # its play is the scenario's, or its gear's alone
    options.pose = [options.pose or ""]
    work = task(options)
    if not (options.joint or scenario or joint in work.mechanism.gears):
        raise JointplayError(
            "--clearance or --gear is missing: without play there is nothing to reduce"
        )
    require_non_negative("--spread", options.spread, "")
    mechanism = _with_gear(options, work.mechanism, scenario)
    out.claim()
    pose = middle(mechanism)
    pose |= {name: float(work.q[0, mechanism.coordinate(name)]) for name in moving(mechanism)}
    model = reduce(
        mechanism,
        joint,
        pose,
        **given(options, "amplitude", "period"),
        progress=not options.quiet,
    )
    print("\n".join([*work.notes, str(model)]))
    if options.tilt and model.tilt_error > model.tilt > 0.0:
        print(
            "note: the error of the lean exceeds its dead band: its load does not turn the journal "
            "to the rim (a side force presses both rims to one side, or nothing does); leave "
            "--tilt out"
        )
    servos = _servos(options, work)
    if servos:
        print(f"servos (MJCF): {', '.join(servos)}")
    mjcf = reduced_files.to_mjcf(
        mechanism, model, encoder=options.encoder, tilt=options.tilt, servos=servos
    )
    makers: dict[str, Callable[[], str]] = {
        ".xml": lambda: mjcf,
        ".sdf": lambda: reduced_files.to_sdf(mechanism, model),
        ".urdf": lambda: reduced_files.to_urdf(mechanism, model),
        ".yaml": lambda: reduced_files.to_yaml(model, options.encoder),
        ".json": lambda: reduced_files.to_json(model, options.encoder, options.spread),
    }
    contents: dict[str, Any] = {name: makers[Path(name).suffix]() for name in names}
    contents["reversals.png"] = reversals(model)
    out.write(contents)
    if options.check:
        _compare(mjcf, model)
    return 0


def _servos(options: argparse.Namespace, work: Task) -> dict[str, Any]:
    """Servos of the scenario, or of the preset, by joint."""
    from jointplay.loads.drive import Drive, Servo

    drives: dict[str, Drive] = {}
    if (chosen := preset_chosen(options)) is not None:
        drives = chosen.drives(work.mechanism.description)
    if work.simulation is not None:
        own = work.simulation.drive
        joints = work.mechanism.joints
        drives |= dict.fromkeys(joints, own) if isinstance(own, Drive) else own
    return {name: one for name, one in drives.items() if isinstance(one, Servo)}


def _compare(mjcf: str, model: Any) -> None:
    """Run the MJCF in MuJoCo, and print how it differs from the full model."""
    from jointplay.design import reduced_files

    followed = reduced_files.follow(mjcf, model)
    kept = "within" if followed.error <= model.angle_error else "beyond"
    print(
        f"MuJoCo: link's angle off by up to {1e6 * followed.error:.4g} urad, {kept} the stated "
        f"{1e6 * model.angle_error:.4g}; {1e6 * followed.step_seconds:.3g} us a step of "
        f"{1e3 * followed.step:.3g} ms"
    )
    if followed.lean_error is not None:
        kept = "within" if followed.lean_error <= model.tilt_error else "beyond"
        print(
            f"MuJoCo: axis' lean off by up to {1e3 * followed.lean_error:.4g} mrad, {kept} the "
            f"stated {1e3 * model.tilt_error:.4g}"
        )


def _with_gear(options: argparse.Namespace, mechanism: Any, scenario: bool) -> Any:
    """The mechanism, its gears with what the options say of teeth and rotor."""
    values = given(options, *(name.replace("-", "_") for name in GEAR))
    if values and not mechanism.gears:
        option = next(iter(values)).replace("_", "-")
        raise JointplayError(f"--{option} needs a gear, and no joint has one; add it with --gear")
    if options.gear and not scenario:
        for option in ("gear-stiffness", "rotor-inertia"):
            if option.replace("-", "_") not in values:
                raise JointplayError(f"--{option} is missing: a gear with play needs it")
    for name, gear in mechanism.gears.items():
        if values and gear.kind != "backlash":
            option = next(iter(values)).replace("_", "-")
            raise JointplayError(
                f"--{option} is for gears of kind backlash; that of {name!r} is of kind "
                f"{gear.kind}: change it in the scenario"
            )
    fields = {name.removeprefix("gear_"): value for name, value in values.items()}
    gears = {name: replace(gear, **fields) for name, gear in mechanism.gears.items()}
    return mechanism.with_clearance(mechanism.clearance, gears)
