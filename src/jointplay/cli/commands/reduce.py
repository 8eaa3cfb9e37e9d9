"""`jointplay reduce`: model play as dead band and friction, for MuJoCo, Gazebo, ROS, Newton.

Fit a hinge with dead band, stiffness, damping and friction to the full model of one joint's play,
by reversals about a pose, and write it as MJCF (MuJoCo), SDF (Gazebo), URDF and YAML (ROS), USD
(Newton), JSON with ranges for domain randomisation. The dead band about the axis comes from the
gear; the bearing contributes friction and tilt, which --tilt writes. --joint names the joint. With
--all: the play of all joints in one file of each format. --batch adds random copies. See
docs/decisions.md.

Example: jointplay reduce ur5 --joint elbow_joint --clearance "0.05 mm" --gear elbow_joint="2
arcmin" --gear-stiffness 2e4 --rotor-inertia 0.5 --out elbow

    FILE | ROBOT  robot, joints with clearance, gears
    --pose JOINT=X,...  pose about which the joint reverses
  reversals:
    --amplitude ANGLE  amplitude of the reversals (default: 0.1)
    --period TIME  period of a reversal, there and back (default: 2)
  output:
    --encoder {motor,link}  whether the encoder is before or after the play (default motor)
    --tilt  let the axes tilt as well, which only MJCF and JSON can hold
    --format {mjcf,sdf,urdf,json,usd} ...  file format; by default all
    --spread SHARE  JSON and --batch: relative half width of ranges without measured values, such as
        20% (default: 0.3)
    --check  run the MJCF in MuJoCo and compare it with the full model
    --out DIR  folder for the files (required)
  whole robot, random copies:
    --all  write all joints with play into one file of each format
    --batch N  write N copies besides, their play, friction and stiffness random
    --seed N  seed of the random numbers (default: 0)
    --identified FILE  draw from the 95 % intervals that jointplay identify found (its
        identified.json), and within --spread where it found none
    --plugin NAME  URDF: hardware of ros2_control's tags (default: gz_ros2_control/GazeboSimSystem)
    --quiet
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_non_negative
from jointplay.base.imports import how_to_install
from jointplay.base.tables import Column, Table
from jointplay.cli.commands import Outputs, given
from jointplay.cli.commands.inputs import chosen_preset, named_joints
from jointplay.cli.commands.mechanism import Task, task

FORMATS = {
    "mjcf": (".xml",),
    "sdf": (".sdf",),
    "urdf": (".urdf", ".yaml"),
    "json": (".json",),
    "usd": (".usda",),
}
"""Endings of the files of each format."""
PARAMETERS = (".yaml", ".json")
"""Those that random copies have not: `batch.csv` has their numbers."""
NEEDS = {
    "mjcf": ("mujoco", "MuJoCo compiles the URDF"),
    "usd": ("newton_usd_schemas", "Newton's schemas and OpenUSD write USD"),
}
"""Packages that formats need, and for what."""
TILTED = ("mjcf", "json")
"""Formats that can hold the tilt of an axis."""


def run(options: argparse.Namespace) -> int:
    if options.spread is not None:
        options.spread = _share(options.spread)
    count = _copies(options)
    joint = None if options.all else _joint(options)
    stem = "robot" if joint is None else joint.replace("/", "_")
    formats, notes = _formats(options)
    endings = [ending for one in formats for ending in FORMATS[one]]
    width = len(str(count))
    copies = [f"{stem}_{i:0{width}d}" for i in range(1, count + 1)]
    names = [f"{stem}{ending}" for ending in endings]
    names += [f"{one}{ending}" for one in copies for ending in endings if ending not in PARAMETERS]
    names += ["batch.csv"] * bool(count) + ["reversals.png"] * (joint is not None)
    from jointplay.model.meshes import FOLDER

    out = Outputs(options.out, names + [FOLDER] * ("mjcf" in formats))
    from jointplay.bridges import random_copies, reduced_files
    from jointplay.bridges.reduction import reduce, reduce_all

    if options.spread is None:
        options.spread = reduced_files.SPREAD
    options.pose = [options.pose or ""]
    work = task(options)
    if not (joint is None or options.joint or work.simulation or joint in work.mechanism.gears):
        raise JointplayError("--clearance or --gear is missing: there is no play to reduce")
    mechanism = work.mechanism
    _require_whole_gears(options, work)
    play = [*mechanism.clearance, *mechanism.gears] if joint is None else [joint]
    _require_play(options, mechanism, play, formats)
    found = None
    if options.identified is not None:
        found = random_copies.read_identified(options.identified, mechanism.joints)
    out.claim()
    pose = _pose(mechanism, work)
    how = given(options, "amplitude", "period") | {"progress": not options.quiet}
    if joint is None:
        reductions, refused = reduce_all(mechanism, pose, **how)
        notes += [f"not reduced: {why}" for why in refused.values()]
    else:
        reductions = [reduce(mechanism, joint, pose, **how)]
    servos = _servos(options, work) if "mjcf" in formats else {}
    if servos:
        notes.append(f"servos (MJCF): {', '.join(servos)}")
    tilting = [one.joint for one in reductions if options.tilt and one.tilt > 0.0]
    shown = _overview(reductions, tilting) if joint is None else str(reductions[0])
    print("\n".join([*work.notes, shown]))
    later: list[str] = []
    makers, meshes = _makers(options, mechanism, reductions, pose, endings, later)
    written, own = reduced_files.reach(mechanism, reductions, pose, tilting)
    notes.append(
        f"the play written moves the tool by up to {1e3 * written:.5g} mm at the pose; the "
        f"budget's worst case is {1e3 * own.worst[0]:.5g} mm"
        + _unwritten(mechanism, reductions, tilting)
    )
    for one in reductions:
        if one.joint in tilting and one.tilt_error > one.tilt:
            notes.append(
                f"note: the error of the tilt of {one.joint} exceeds its dead band: its load does "
                "not turn the journal to the rim (a side force presses both rims to one side, or "
                "nothing does); leave --tilt out"
            )
    contents: dict[str, Any] = {
        f"{stem}{e}": make(reductions, servos) for e, make in makers.items()
    }
    if "urdf" in formats:
        contents[f"{stem}.yaml"] = reduced_files.to_yaml(reductions, options.encoder)
    if "json" in formats:
        text = reduced_files.to_json(reductions, options.encoder, options.spread)
        contents[f"{stem}.json"] = text
    if count:
        compiled = "mjcf" in formats
        ranges = random_copies.intervals(
            mechanism, reductions, options.spread, found, servos, tilting if compiled else ()
        )
        values = random_copies.draw(ranges, count, options.seed or 0)
        for name, row in zip(copies, values, strict=True):
            ones = random_copies.drawn(reductions, ranges, row)
            own_servos = random_copies.drawn_servos(servos, ranges, row)
            contents |= {f"{name}{e}": make(ones, own_servos) for e, make in makers.items()}
        contents["batch.csv"] = random_copies.table(ranges, values, copies).csv(17)
        known = [one.label for one in ranges if one.origin == "identified"]
        assumed = f"within +-{100.0 * options.spread:g} %, assumed"
        if known:
            assumed = f"within the intervals of {', '.join(known)}, all others {assumed}"
        print(f"{count} random copies, uniform {assumed}")
    if joint is not None:
        from jointplay.show.plots.design import reversals

        contents["reversals.png"] = reversals(reductions[0])
    print("\n".join([*notes, *later]))
    if meshes:
        (Path(options.out) / FOLDER).mkdir()
    for name, data in meshes.items():
        files.write(Path(options.out) / FOLDER / name, data)
    out.write(contents)
    if options.check:
        mjcf = contents[f"{stem}.xml"]
        _check(mjcf, meshes, reductions)
        if tilting:
            from jointplay.bridges.reduced_mjcf import find_reach

            moved = find_reach(mjcf, meshes, mechanism.tool, pose, own.direction[0])
            print(
                f"MuJoCo: the axes' tilt moves the tool by {1e3 * moved:.5g} mm along the "
                "budget's worst direction"
            )
    return 0


def _share(text: str) -> float:
    """A part of one: 0.2, or 20%."""
    try:
        part = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        raise JointplayError(f"--spread must be a number or a percentage, got {text!r}") from None
    return require_non_negative("--spread", part, "")


def _copies(options: argparse.Namespace) -> int:
    count: int = 0 if options.batch is None else options.batch
    if options.batch is not None and count < 1:
        raise JointplayError(f"--batch must be at least 1, got {count}")
    if options.seed is not None and options.seed < 0:
        raise JointplayError(f"--seed must not be negative, got {options.seed}")
    for option in ("seed", "identified"):
        if getattr(options, option) is not None and not count:
            raise JointplayError(f"--{option} is for random copies: add --batch N")
    if count and options.spread == 0.0 and options.identified is None:
        raise JointplayError("--spread 0 makes all copies alike: give one above 0, or --identified")
    return count


def _joint(options: argparse.Namespace) -> str:
    """The one joint that is named; if it has no clearance of its own, it is no option any more."""
    if len(options.joint) != 1:
        number = len(options.joint) or "none"
        raise JointplayError(f"--joint must name one joint, got {number}; --all reduces every one")
    ((joint, length),) = named_joints(options).items()
    if length is None and options.clearance is None:
        options.joint = []  # its play is the scenario's, or its gear's alone
    return joint


def _unwritten(mechanism: Any, reductions: list[Any], tilting: list[str]) -> str:
    """Which play is in no file, in words after those on the budget; empty if all is."""
    left = {name: "" for name in [*mechanism.clearance, *mechanism.gears]}
    for one in reductions:
        left.pop(one.joint)
    parts = [f"all play of {', '.join(left)}"] if left else []
    upright = [one.joint for one in reductions if one.tilt > 0.0 and one.joint not in tilting]
    if upright:
        parts.append(f"the tilt of {', '.join(upright)} (--tilt writes it)")
    if any(max(one.lateral, one.axial) > 0.0 for one in reductions):
        parts.append("the journals' travel aside and along")
    return f"; not written: {', '.join(parts)}" if parts else ""


def _formats(options: argparse.Namespace) -> tuple[list[str], list[str]]:
    """Formats to write, and why some that nobody asked for are left out."""
    from importlib.util import find_spec

    chosen, notes = list(dict.fromkeys(options.format or FORMATS)), []
    upright = [one for one in chosen if options.tilt and one not in TILTED]
    if upright:
        can = f"the tilt of an axis, which --tilt writes, is held by {' and '.join(TILTED)} only"
        if options.format:
            raise JointplayError(f"--format {upright[0]} with --tilt: {can}")
        chosen = [one for one in chosen if one in TILTED]
        notes.append(f"no {', '.join(upright)}: {can}")
    for name, (package, use) in NEEDS.items():
        if name not in chosen or find_spec(package) is not None:
            continue
        text = f"{use}, and the package {package} is missing: {how_to_install('simulators')}"
        if options.format:
            raise JointplayError(text)
        chosen.remove(name)
        notes.append(f"no {name}: {text}")
    if options.check and "mjcf" not in chosen:
        raise JointplayError("--check runs the MJCF in MuJoCo: it needs --format mjcf and mujoco")
    return chosen, notes


def _require_play(
    options: argparse.Namespace, mechanism: Any, joints: list[str], formats: list[str]
) -> None:
    """Refuse to write files without any play of a robot that has some.

    A journal has no play about its own axis, which is all that a dead band can say; JSON has the
    numbers of its tilt and travel, too.

    Raises:
        JointplayError: no file but JSON would have any.
    """
    gears = [mechanism.gears[name] for name in joints if name in mechanism.gears]
    reach = {
        name: mechanism.clearance[name].play(second_order=False).reach
        for name in dict.fromkeys(joints)
        if name in mechanism.clearance and mechanism.clearance[name].hinge is not None
    }
    loose = [name for name, far in reach.items() if max(far) > 0.0]
    tilts = options.tilt and any(turn > 0.0 for _, turn in reach.values())
    bands = any(gear.unloaded_range > 0.0 for gear in gears)
    empty = [name for name in dict.fromkeys(formats) if name != "json"]
    if not empty or not loose or tilts or bands:
        return
    remedy = "a gear's play (--gear NAME=ANGLE)"
    if not options.tilt:
        remedy = f"--tilt for the tilt, or {remedy}"
    raise JointplayError(
        f"{', '.join(empty)} would have no play: the clearance of {', '.join(loose)} gives none "
        f"about a journal's own axis, only tilt and travel, which move the tool; add {remedy}; "
        "--format json has all numbers"
    )


def _makers(
    options: argparse.Namespace,
    mechanism: Any,
    reductions: list[Any],
    pose: dict[str, float],
    endings: list[str],
    notes: list[str],
) -> tuple[dict[str, Callable[..., str]], dict[str, bytes]]:
    """What makes the simulators' files of reductions and servos, by ending; and their meshes."""
    from jointplay.bridges import reduced_files

    plugin, meshes = options.plugin or reduced_files.PLUGIN, {}
    makers: dict[str, Callable[..., str]] = {
        ".sdf": lambda ones, _: reduced_files.to_sdf(mechanism, *ones),
        ".urdf": lambda ones, _: reduced_files.to_urdf(mechanism, *ones, plugin=plugin),
    }
    if ".xml" in endings:
        from jointplay.bridges.reduced_mjcf import compile_robot

        compiled = compile_robot(mechanism, reductions, pose, options.tilt)
        notes += compiled.notes
        meshes = dict(compiled.meshes)
        makers[".xml"] = lambda ones, servos: compiled.mjcf(
            ones, encoder=options.encoder, servos=servos
        )
    if ".usda" in endings:
        from jointplay.bridges.usd import to_usd

        makers[".usda"] = lambda ones, _: to_usd(mechanism, *ones)
    follow = [n for n in mechanism.joints if mechanism.description.joints[n].mimic]
    if follow and {".sdf", ".usda"} & set(endings):
        notes.append(f"sdf and usd: that {', '.join(follow)} mimic others is not represented")
    return {ending: makers[ending] for ending in endings if ending in makers}, meshes


def _overview(reductions: list[Any], tilting: list[str]) -> str:
    rows = [
        (one.joint, 0.5 * one.dead_band, one.friction, one.stiffness, one.rotor_inertia)
        for one in reductions
    ]
    heads = ("joint", ""), ("half play", "rad"), ("friction", "N*m"), ("stiffness", "N*m/rad")
    table = Table.of([*heads, ("rotor", "kg*m^2")], rows)
    if not tilting:
        return str(table)
    tilts = [one.tilt if one.joint in tilting else 0.0 for one in reductions]
    return str(Table([*table.columns, Column("tilt", tilts, "rad")]))


def _check(mjcf: str, meshes: dict[str, bytes], reductions: list[Any]) -> None:
    """Run the MJCF in MuJoCo; print how it differs from the full model, and which play it has."""
    from jointplay.bridges.reduced_mjcf import find_play, follow

    for one in reductions:
        seen = follow(mjcf, one, meshes)
        kept = "within" if seen.error <= one.angle_error else "beyond"
        print(
            f"MuJoCo: {one.joint}: link's angle off by up to {1e6 * seen.error:.4g} µrad, {kept} "
            f"the stated {1e6 * one.angle_error:.4g}; {1e6 * seen.step_seconds:.3g} µs a step of "
            f"{1e3 * seen.step:.3g} ms"
        )
        if seen.tilt_error is not None:
            kept = "within" if seen.tilt_error <= one.tilt_error else "beyond"
            print(
                f"MuJoCo: {one.joint}: axis' tilt off by up to {1e3 * seen.tilt_error:.4g} mrad, "
                f"{kept} the stated {1e3 * one.tilt_error:.4g}"
            )
    found = find_play(mjcf, meshes)
    for one in reductions:
        if one.joint in found:
            pushed = found[one.joint]
            print(
                f"MuJoCo: {one.joint} turns freely by {1e3 * pushed.dead_band:.5g} mrad (written: "
                f"{1e3 * one.dead_band:.5g}), then {pushed.stiffness:.5g} N m/rad (written: "
                f"{one.stiffness:.5g})"
            )
    if not found:
        print("MuJoCo: no joint has a dead band about its axis")


def _pose(mechanism: Any, work: Task) -> dict[str, float]:
    """Joint positions about which joints reverse [rad or m]."""
    from jointplay.accuracy.poses import middle, moving

    found = {name: float(work.q[0, mechanism.coordinate(name)]) for name in moving(mechanism)}
    return {**middle(mechanism), **found}


def _servos(options: argparse.Namespace, work: Task) -> dict[str, Any]:
    from jointplay.simulation.loads.drive import Drive, Servo

    drives: dict[str, Drive] = {}
    if (chosen := chosen_preset(options)) is not None:
        drives = chosen.drives(work.mechanism.description)
    if work.simulation is not None:
        own = work.simulation.drive
        joints = work.mechanism.joints
        drives |= dict.fromkeys(joints, own) if isinstance(own, Drive) else own
    return {name: one for name, one in drives.items() if isinstance(one, Servo)}


def _require_whole_gears(options: argparse.Namespace, work: Task) -> None:
    """Refuse gears of --gear of which a reduction does not know enough."""
    for option in ("gear_stiffness", "rotor_inertia"):
        if options.gear and work.simulation is None and getattr(options, option) is None:
            name = option.replace("_", "-")
            raise JointplayError(f"--{name} is missing: a gear with play needs it")
