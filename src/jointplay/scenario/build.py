"""From a checked scenario to the simulation that it describes."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from jointplay.codec import Draft, Preset
from jointplay.errors import JointplayError, MissingName, within
from jointplay.joints import JOINT_WORDS, Clearance
from jointplay.mechanism.loop import Loop, refuse_name
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.urdf import read
from jointplay.scenario.acting import drive_of, friction_of, loads_of, payloads_of
from jointplay.scenario.fitting import beside, drafts, fit
from jointplay.scenario.model import ANGLE, ANGULAR_SPEED, Model
from jointplay.scenario.motions import motion_of
from jointplay.scenario.sources import locate
from jointplay.scenario.unnamed import complete
from jointplay.simulation.simulation import Simulation


def build(model: Model, folder: Path) -> tuple[Simulation, list[str]]:
    """Simulation that `model` describes; its paths are relative to `folder`.

    Returns:
        The simulation, and what was added that nobody asked for, a line each.

    Raises:
        JointplayError: what cannot be; `where` has the key.
    """
    mechanism = _mechanism(model, folder)
    start = {
        name: fit(mechanism, name, value, ANGLE, ("start", name))
        for name, value in model.start.items()
    }
    start_speed = {
        name: fit(mechanism, name, value, ANGULAR_SPEED, ("start_speed", name))
        for name, value in model.start_speed.items()
    }
    motion = motion_of(model, mechanism, folder, start)
    notes: list[str] = []
    if motion is not None:
        motion, notes = complete(model, mechanism, motion, start)
    drive = drive_of(model, mechanism, motion)
    integration = model.integration
    simulation = Simulation(
        mechanism,
        motion,
        drive=drive,
        duration=integration.duration,
        step=integration.step,
        integrator=integration.integrator,
        macro_step=integration.macro_step,
        tolerance=integration.tolerance,
        record_every=model.output.record_every,
        joint_friction=friction_of(model, mechanism),
        seed=integration.seed,
        payloads=payloads_of(model, mechanism),
        loads=loads_of(model, mechanism, folder),
        limits=model.robot.limits,
        state={name: (start.get(name), start_speed.get(name)) for name in {**start, **start_speed}},
        start=integration.start,
        settle=integration.settle,
        judge_from=integration.judge_from,
    )
    return simulation, notes


def _mechanism(model: Model, folder: Path) -> Mechanism:
    robot = model.robot
    with within("robot", "urdf"):
        path = locate(robot.urdf, folder)
        description = read(path, robot.allow_unphysical)
    loops = {}
    for name, ends in model.loops.items():
        bearing, journal = ends.bearing, ends.journal
        with within("loops", name):
            refuse_name(name, description.joints)
            loops[name] = Loop(
                bearing.link, journal.link, bearing.xyz, bearing.rpy, journal.xyz, journal.rpy
            )
    joints = {}
    for name, draft in drafts(model.joints).items():
        with within("joints", name):
            if name not in description.joints and name not in loops:
                raise MissingName("joint", name, [*description.joints, *loops])
            if draft.fields.get("ideal") and _plain_when_ideal(draft.word, name in loops):
                continue
            joints[name] = _joint(draft, folder)
    gears = {}
    for name, draft in drafts(model.gears).items():
        with within("gears", name):
            gears[name] = draft.make()
    with _in_scenario("robot", ("tool", "gravity", "allow_unphysical")):
        return Mechanism(
            path,
            joints,
            loops=loops,
            gears=gears,
            gravity=robot.gravity,
            tool=robot.tool,
            allow_unphysical=robot.allow_unphysical,
        )


@contextmanager
def _in_scenario(table: str, keys: Collection[str]) -> Iterator[None]:
    """Say of errors in the block at one of `keys` that they are at it in the `table`."""
    try:
        yield
    except JointplayError as error:
        if error.where and error.where[0] in keys:
            error.where = (table, *error.where)
        elif error.where[:1] == ("clearance",):
            error.where = ("joints", *error.where[1:])
        raise


def _plain_when_ideal(kind: str | None, loop: bool) -> bool:
    """Whether an ideal joint of this kind is what stands there anyway, and needs no dimensions."""
    if kind is None:
        return False
    chosen = JOINT_WORDS[kind]
    joint: Any = chosen.kind if isinstance(chosen, Preset) else chosen
    return not (joint.compound() or (loop and joint.slides()))


def _joint(draft: Draft, folder: Path) -> Clearance:
    laws = [one for one in draft.fields.values() if isinstance(one, Draft)]
    functions = [str(law.fields["function"]) for law in laws if "function" in law.fields]
    with ExitStack() as stack:
        for function in functions:
            stack.enter_context(beside(folder, function))
        joint: Clearance = draft.make()
        return joint
