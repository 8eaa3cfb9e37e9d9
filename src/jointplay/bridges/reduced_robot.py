"""A robot with reduced joints: its files for all simulators, and their check in MuJoCo."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from jointplay.accuracy.error_budget import PlayBudget
from jointplay.base.errors import JointplayError
from jointplay.base.tables import Column, Table
from jointplay.bridges import reduced_files, webots
from jointplay.bridges.edited_mjcf import EditedRobot, edited_robot
from jointplay.bridges.reduced_formats import FORMATS
from jointplay.bridges.reduced_mjcf import (
    Comparison,
    CompiledRobot,
    compile_robot,
    find_play,
    find_reach,
    follow,
)
from jointplay.bridges.reduction import Reduction, from_mjcf_file, reduce, reduce_all
from jointplay.model.mechanism import Mechanism
from jointplay.model.mjcf_whole import compile_text
from jointplay.scenario.assumptions import by_rule
from jointplay.scenario.posed import PosedMachine
from jointplay.simulation.loads.drive import ENCODERS, Servo

EXCEEDS = "beyond"
"""Word in a line of `ReducedRobot.check` for a written file that exceeds its stated error."""
PLAY_TOLERANCE = 0.01
"""Largest relative difference between the play found in MuJoCo and the play written."""


def refuse_without_play(
    mechanism: Mechanism, joints: Collection[str], formats: Collection[str], tilt: bool
) -> None:
    """Raise an error if a robot has play, but the files to be written would have none of it.

    A journal has no play about its own axis, which is all that a dead band represents; JSON also
    has the numbers of its tilt and travel.

    Raises:
        JointplayError: no file but JSON would have any play.
    """
    bands = any(mechanism.gears[name].unloaded_range > 0.0 for name in joints
                if name in mechanism.gears)  # fmt: skip
    reach = {
        name: mechanism.clearance[name].play(second_order=False).reach
        for name in dict.fromkeys(joints)
        if name in mechanism.clearance and mechanism.clearance[name].hinge is not None
    }
    loose = [name for name, ranges in reach.items() if max(ranges) > 0.0]
    tilts = tilt and any(angle > 0.0 for _, angle in reach.values())
    empty = [name for name in dict.fromkeys(formats) if name != "json"]
    if not empty or not loose or tilts or bands:
        return
    remedy = "a gear's play (--gear NAME=ANGLE)"
    if not tilt:
        remedy = f"--tilt for the tilt, or {remedy}"
    raise JointplayError(
        f"{', '.join(empty)} would have no play: the clearance of {', '.join(loose)} gives none "
        f"about a journal's own axis, only tilt and travel, which move the tool; add {remedy}; "
        "--format json has all numbers"
    )


@dataclass(frozen=True)
class ReducedRobot:
    """A robot with reduced joints, and its files; MuJoCo compiles it only where that is needed.

    Raises:
        MissingName: no such format or place for an encoder.
        JointplayError: a package that a format needs is missing.
    """

    mechanism: Mechanism
    reductions: Sequence[Reduction]
    pose: Mapping[str, float]
    """Joint positions about which the joints were fitted [rad or m]."""
    formats: Collection[str] = tuple(FORMATS)
    tilt: bool = False
    """Whether axes tilt in the files."""
    encoder: str = "motor"
    servos: Mapping[str, Servo] = field(default_factory=dict)
    """Servos by joint; only MJCF has them."""
    spread: float = reduced_files.SPREAD
    """Relative half width of the ranges of numbers that are not measured."""
    plugin: str = reduced_files.PLUGIN
    """Hardware plugin of ros2_control's tags."""

    @classmethod
    def of(
        cls,
        posed: PosedMachine,
        joint: str | None,
        formats: Collection[str],
        tilt: bool,
        *,
        reversals: Mapping[str, float] | None = None,
        progress: bool = False,
        **options: Any,
    ) -> tuple[ReducedRobot, list[str]]:
        """Reduce a machine at a pose.

        Args:
            posed: the machine at the pose about which joints reverse.
            joint: joint to reduce; None: all that can be reduced.
            formats, tilt: see the fields.
            reversals: amplitude and period of the reversals, see `reduce`.
            progress: show a bar on standard error.
            options: further fields.

        Returns:
            The robot, and notes on joints that are not reduced and on assumptions.

        Raises:
            JointplayError: see `reduce`; encoders on different sides of the gears.
        """
        mechanism, pose, holding = posed.mechanism, posed.poses.positions(), posed.poses.holding
        frictions = holding["joint_friction"] or {}
        settings: dict[str, Any] = {**(reversals or {}), "progress": progress}
        notes = []
        if joint is None:
            reductions, refused = reduce_all(mechanism, pose, joint_friction=frictions, **settings)
            notes += [f"not reduced: {reason}" for reason in refused.values()]
        else:
            friction = frictions.get(joint)
            reductions = [reduce(mechanism, joint, pose, joint_friction=friction, **settings)]
        drives, servos = holding["drive"], {}
        if "mjcf" in formats and not from_mjcf_file(mechanism.description):
            servos = {name: drive for name, drive in drives.items() if isinstance(drive, Servo)}
            notes += [f"servos (MJCF): {', '.join(servos)}"] * bool(servos)
        names = [reduced.joint for reduced in reductions]
        sides = {name: getattr(drives.get(name), "encoder", ENCODERS[0]) for name in names}
        if len({*sides.values()}) > 1:
            places = ", ".join(f"of {name} on the {side}" for name, side in sides.items())
            raise JointplayError(
                f"encoders are {places}, but a file has all on one side: give --encoder"
            )
        options |= {"servos": servos, "encoder": next(iter(sides.values()), ENCODERS[0])}
        notes += by_rule(mechanism, "rotor_inertia")
        return cls(mechanism, reductions, pose, formats, tilt, **options), notes

    @property
    def tilting(self) -> list[str]:
        """Joints whose axes tilt in the files."""
        return [r.joint for r in self.reductions if self.tilt and r.tilt > 0.0]

    @cached_property
    def _compiled(self) -> CompiledRobot | EditedRobot:
        compiler = edited_robot if from_mjcf_file(self.mechanism.description) else compile_robot
        return compiler(self.mechanism, self.reductions, self.pose, self.tilt)

    @cached_property
    def _rigid(self) -> CompiledRobot:
        return compile_robot(self.mechanism.ideal(), (), self.pose)

    @property
    def meshes(self) -> dict[str, bytes]:
        """Meshes that MJCF and PROTO need, by file name, for the folder of `model.meshes`."""
        files = dict(self._compiled.meshes) if "mjcf" in self.formats else {}
        return files | (self._proto[1] if "proto" in self.formats else {})

    @property
    def notes(self) -> list[str]:
        """Differences of the files from the URDF, a line each."""
        lines = [*self._compiled.notes] if "mjcf" in self.formats else []
        entries = self.mechanism.description.joints
        mimics = [name for name in self.mechanism.joints if entries[name].mimic]
        if mimics and {"sdf", "usd", "proto"}.intersection(self.formats):
            lines.append(
                f"sdf, usd and proto: that {', '.join(mimics)} mimic others is not represented"
            )
        return lines

    def table(self) -> Table:
        """Table of the reduced joints' parameters, with a row for each joint."""
        heads = ("joint", ""), ("half play", "rad"), ("friction", "N*m"), ("stiffness", "N*m/rad")
        rows = [
            (r.joint, 0.5 * r.dead_band, r.friction, r.stiffness, r.rotor_inertia)
            for r in self.reductions
        ]
        table = Table.of([*heads, ("rotor", "kg*m^2")], rows)
        if not self.tilting:
            return table
        tilts = [r.tilt if r.joint in self.tilting else 0.0 for r in self.reductions]
        return Table([*table.columns, Column("tilt", tilts, "rad")])

    def files(self, stem: str) -> dict[str, str]:
        """Texts of the files by their names."""
        texts = {}
        if "sdf" in self.formats:
            texts[f"{stem}.sdf"] = reduced_files.to_sdf(
                self.mechanism, *self.reductions, encoder=self.encoder
            )
        if "mjcf" in self.formats:
            texts[f"{stem}.xml"] = self._mjcf
        if "usd" in self.formats:
            from jointplay.bridges.usd import to_usd

            texts[f"{stem}.usda"] = to_usd(self.mechanism, *self.reductions)
        if "urdf" in self.formats:
            texts[f"{stem}.urdf"] = reduced_files.to_urdf(
                self.mechanism, *self.reductions, plugin=self.plugin
            )
            texts[f"{stem}.yaml"] = reduced_files.to_yaml(self.reductions, self.encoder)
        if "proto" in self.formats:
            declared = self._proto[0].replace(f"PROTO {webots.NAME} [", f"PROTO {stem} [", 1)
            texts[f"{stem}.proto"] = declared
        if "json" in self.formats:
            text = reduced_files.to_json(
                self.reductions, self.encoder, self.spread, self.mechanism.rules
            )
            texts[f"{stem}.json"] = text
        if "py" in self.formats:
            text = reduced_files.to_python(self.mechanism, self.reductions, self.pose)
            texts[f"{stem}{FORMATS['py'][0]}"] = text
        return texts

    @cached_property
    def reach(self) -> tuple[float, PlayBudget]:
        """Largest error of the tool by the files' play at the pose [m], and the robot's budget."""
        return reduced_files.reach(self.mechanism, self.reductions, self.pose, self.tilting)

    @property
    def coverage(self) -> list[str]:
        """Notes on how much of the robot's play the files have, and on tilts they overstate."""
        reach, budget = self.reach
        omitted = dict.fromkeys([*self.mechanism.clearance, *self.mechanism.gears])
        for reduction in self.reductions:
            omitted.pop(reduction.joint)
        missing = [f"all play of {', '.join(omitted)}"] if omitted else []
        tilted = [r.joint for r in self.reductions if r.tilt > 0.0]
        if upright := [name for name in tilted if name not in self.tilting]:
            missing.append(f"the tilt of {', '.join(upright)} (--tilt writes it)")
        if any(max(r.lateral, r.axial) > 0.0 for r in self.reductions):
            missing.append("the journals' travel aside and along")
        omissions = f"; not written: {', '.join(missing)}" if missing else ""
        lines = [
            f"the play written moves the tool by up to {1e3 * reach:.5g} mm at the pose; the "
            f"budget's worst case is {1e3 * budget.worst[0]:.5g} mm{omissions}"
        ]
        return lines + [
            f"note: the error of the tilt of {r.joint} exceeds its dead band: its load does not "
            "turn the journal to the rim (a side force presses both rims to one side, or "
            "nothing does); leave --tilt out"
            for r in self.reductions
            if r.joint in self.tilting and r.tilt_error > r.tilt
        ]

    @cached_property
    def _mjcf(self) -> str:
        return self._compiled.mjcf(self.reductions, encoder=self.encoder, servos=self.servos)

    @cached_property
    def _proto(self) -> tuple[str, dict[str, bytes]]:
        return webots.to_proto(self.mechanism, self.reductions, self.encoder)

    @cached_property
    def _written(self) -> Any:
        """The written MJCF as compiled by MuJoCo."""
        return compile_text(self._mjcf, self.meshes)

    @cached_property
    def _followed(self) -> list[Comparison]:
        """The written MJCF in the reversals of each reduction, run in MuJoCo."""
        return [follow(self._written, r) for r in self.reductions]

    def stated(self) -> tuple[Reduction, str]:
        """The only reduction with the errors of the written files, and how these were found."""
        (reduction,) = self.reductions
        if "mjcf" not in self.formats:
            return reduction, "stated errors are those of the fit: no simulator has run the files"
        (comparison,) = self._followed
        reduction = replace(
            reduction,
            angle_error=max(reduction.angle_error, comparison.error),
            angle_rms=max(reduction.angle_rms, comparison.rms),
            tilt_error=max(reduction.tilt_error, comparison.tilt_error or 0.0),
        )
        formats = [name for name in ("sdf", "usd", "urdf") if name in self.formats]
        exceptions = f"; no simulator has run {', '.join(formats)}" if formats else ""
        basis = "stated errors are the larger of the fit's and the written MJCF's, run in MuJoCo"
        return reduction, f"{basis}{exceptions}"

    def check(self) -> Iterator[str]:
        """Run the MJCF in MuJoCo; yields lines on its errors, its play and the tool's reach."""
        for reduction, comparison in zip(self.reductions, self._followed, strict=True):
            yield f"MuJoCo: {reduction.joint}: {_angle_text(comparison, reduction)}"
            if (error := comparison.tilt_error) is not None:
                relation = "within" if error <= reduction.tilt_error else EXCEEDS
                yield (
                    f"MuJoCo: {reduction.joint}: axis' tilt off by up to {1e3 * error:.4g} mrad, "
                    f"{relation} the stated {1e3 * reduction.tilt_error:.4g}"
                )
        plays = find_play(self._written)
        for reduction in self.reductions:
            if reduction.joint in plays:
                play = plays[reduction.joint]
                pairs = (play.dead_band, reduction.dead_band), (play.stiffness, reduction.stiffness)
                agrees = all(abs(x - written) <= PLAY_TOLERANCE * written for x, written in pairs)
                yield (
                    f"MuJoCo: {reduction.joint} turns freely by {1e3 * play.dead_band:.5g} mrad "
                    f"(written: {1e3 * reduction.dead_band:.5g}), then {play.stiffness:.5g} "
                    f"N m/rad (written: {reduction.stiffness:.5g})"
                    f"{'' if agrees else f', {EXCEEDS} {PLAY_TOLERANCE:.0%} of what is written'}"
                )
        if "py" in self.formats:
            yield from self._check_actuator()
        if not plays:
            yield "MuJoCo: no joint has a dead band about its axis"
        if self.tilting:
            direction = self.reach[1].direction[0]
            reach = find_reach(self._written, self.mechanism.tool, self.pose, direction)
            yield (
                f"MuJoCo: the axes' tilt moves the tool by {1e3 * reach:.5g} mm along the "
                "budget's worst direction"
            )

    def _check_actuator(self) -> Iterator[str]:
        """Run the robot without play in MuJoCo, with the actuator's torques on its links."""
        try:
            robot = compile_text(self.without_play(), self._rigid.meshes)
        except JointplayError as error:
            yield f"the actuator was not run in MuJoCo: {error}"
            return
        for reduction in self.reductions:
            if reduction.dead_band <= 0.0:
                continue
            _, play = reduced_files.actuator([reduction])
            comparison = follow(robot, reduction, play)
            yield f"MuJoCo: {reduction.joint} by its actuator: {_angle_text(comparison, reduction)}"

    def without_play(self) -> str:
        """MJCF for the play as an actuator: the robot with friction and damping, no dead bands."""
        text = self._rigid.mjcf(replace(r, dead_band=0.0) for r in self.reductions)
        step = reduced_files.actuator_step(self.mechanism, self.reductions, self.pose)
        return re.sub('timestep="[^"]*"', f'timestep="{step:.6g}"', text, count=1)


def _angle_text(comparison: Comparison, stated: Reduction) -> str:
    relation = "within" if comparison.error <= stated.angle_error else EXCEEDS
    return (
        f"link's angle off by up to {1e6 * comparison.error:.4g} µrad, {relation} the stated "
        f"{1e6 * stated.angle_error:.4g}; {1e6 * comparison.step_seconds:.3g} µs a step of "
        f"{1e3 * comparison.step:.3g} ms"
    )
