"""Twins of a run, the same work without one cause of error after the other, and its inputs."""

from __future__ import annotations

import dataclasses
import json
import xml.etree.ElementTree as ElementTree
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base.errors import JointplayError, require_known
from jointplay.model.flexible import HINGE
from jointplay.model.frames import carried
from jointplay.model.free_base import BASE, FREE
from jointplay.model.urdf import BEYOND
from jointplay.physics.joints import (
    JOINT_KINDS,
    VIRTUAL_LINK,
    RollingBearing,
    SlidingClearance,
    class_of,
)
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.constants import DEFAULT, integrator
from jointplay.simulation.loads.drive import Drive, assign
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.stored import stored_coordinates

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

TOOL_MOTIONS = ("tool_position", "tool_velocity", "tool_orientation", "tool_angular_velocity")
"""Histories of the tool that are measured against those of the ideal mechanism."""
SLIDING_KINDS = {name for name, kind in JOINT_KINDS.items() if issubclass(kind, SlidingClearance)}
"""Kinds of joint whose surfaces slide on each other."""
ROLLING_KINDS = {name for name, kind in JOINT_KINDS.items() if issubclass(kind, RollingBearing)}
"""Kinds of joint with rolling elements."""

_MAY_DIFFER = (
    *("mechanism", "duration", "step", "integrator", "macro_step", "tolerance"),
    *("record_every", "seed", "settle", "judge_from"),
)
"""Inputs in which a run and the ideal run that it is measured against may differ."""


def inputs(result: Result) -> dict[str, Any]:
    """The run's inputs as plain data, as `Simulation.describe` wrote them."""
    description: dict[str, Any] = json.loads(result.dataset.attrs["simulation"])
    return description


def clearance_inputs(result: Result) -> dict[str, dict[str, Any]]:
    """The stored inputs of the joints that have clearance, by name."""
    joints = inputs(result)["mechanism"]["clearance"]
    return {name: joints[name] for name in result.joints if name in joints}


def hinges(result: Result) -> set[str]:
    """Joints of a result that are hinges of flexible links.

    Nothing is built unless a joint has the name of one.
    """
    if not any(HINGE in name for name in result.joints):
        return set()
    return {name for names in result.simulation.mechanism.hinges.values() for name in names}


def at_joint(result: Result, joint: str) -> str:
    """What the names of a joint's figures end with: nothing where there is only one."""
    soft = hinges(result)
    return "" if len(set(result.joints) - soft) == 1 else f", {joint}"


def rolls(result: Result, joint: str) -> bool:
    """Whether a joint with clearance has rolling elements: by the inputs, nothing is built."""
    return clearance_inputs(result).get(joint, {}).get("kind") in ROLLING_KINDS


def clearance_outline(result: Result, joint: str) -> np.ndarray | None:
    """Closed line within which the journal's centre can move untilted, bearing x and y (2, n) [m].

    The clearance circle, that of a rolling bearing in operation, or for a slider the rectangle of
    its clearances; None if the inputs tell neither, or without play.
    """
    joint_inputs = clearance_inputs(result).get(joint, {})
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = np.array([np.cos(angle), np.sin(angle)])
    if rolls(result, joint):
        room = result.simulation.mechanism.clearance[joint].radial_travel
        return room * circle if room > 0.0 else None
    if joint_inputs.get("radial_clearance") is not None:
        return float(joint_inputs["radial_clearance"]) * circle
    if joint_inputs.get("clearance") is not None:
        x = float(joint_inputs["clearance"])
        y = 0.0 if joint_inputs.get("planar") else float(joint_inputs.get("clearance_y") or x)
        return np.array([[x, x, -x, -x, x], [y, -y, -y, y, y]])
    return None


def has_rims(result: Result, joint: str) -> bool:
    """Whether the journal of `joint` is a cylinder that can tilt, whose rims touch the bore."""
    places = {"radial_A", "radial_B"}.intersection(result["contact"].values)
    return len(places) == 2 and bool(
        np.isfinite(result["gap"].sel(joint=joint, contact=sorted(places)).values).any()
    )


def rim_centres(result: Result, joint: str) -> np.ndarray:
    """Centres of the two rims of a journal that `has_rims`, in the bearing frame (2, n, 3) [m].

    A tilted journal touches the bore by its rims: Figure 12 of the paper, in which penetration lies
    outside the clearance circle, can be read for these, not for the middle. End A is first.
    """
    pose = journal_poses(result, joint)
    half = result.simulation.mechanism.clearance[joint].dimensions[3] * pose[:, [5, 8, 11]]
    return np.stack([pose[:, :3] + half, pose[:, :3] - half])


def journal_poses(result: Result, joint: str) -> np.ndarray:
    """By records: the journal's centre [m], and its orientation row by row, in the bearing (12)."""
    mechanism = result.simulation.mechanism
    pairs = [mechanism.frames(joint)]
    return mechanism.tree.motion(result["q"].values, pairs=pairs).poses[0]


def places(result: Result, joint: str) -> list[str]:
    """Names of the contacts of `joint`; other joints' contacts hold no numbers there."""
    require_known("clearance joint", joint, result.joints)
    gaps = result["gap"].sel(joint=joint)
    if not gaps.sizes["time"]:
        return [str(name) for name in gaps["contact"].values]
    has = ~np.isnan(gaps.values[0])
    return [str(name) for name in gaps["contact"].values[has]]


def task(result: Result) -> dict[str, Any]:
    """Inputs that a run must share with its ideal twin: mechanism, motion, drives, loads, start.

    How it did start, that is. None: without play nothing gives way at the start, and it is the same
    at rest and centred.
    """
    description = inputs(result)
    if result.beside is not None:
        description["motion"] = result.beside
    description["state"] = _state(description)
    if description["start"] is None and has_play(result):
        description["start"] = "centred"  # nothing was to be found
    loads = {name: load | {"play": 0.0} for name, load in _loose(description).items()}
    description["loads"] = description["loads"] | loads
    mechanism = description["mechanism"]
    robot = {
        key: value
        for key, value in mechanism.items()
        if key not in ("clearance", "gears", "urdf", "urdf_text")
    }
    # The text counts, not the file's name; a rotor is the same behind a gear and without it.
    robot["text"], rotors = _without_armature(mechanism["urdf_text"])
    gears = mechanism.get("gears") or {}
    if gears and (drives := _through_teeth(result.simulation)):
        description["drive"] = {name: drive.describe() for name, drive in drives.items()}
    robot["armature"] = dict(
        sorted((rotors | {name: gear["rotor_inertia"] for name, gear in gears.items()}).items())
    )
    return {key: value for key, value in description.items() if key not in _MAY_DIFFER} | {
        "mechanism": robot
    }


def _through_teeth(simulation: Simulation) -> dict[str, Drive]:
    """Its drives if some have a bandwidth that teeth allow, which its twin may lack; else none."""
    from jointplay.simulation.initial import settled_drives  # takes long to import

    settled = settled_drives(simulation)
    assigned = assign(simulation.mechanism, simulation.motion, simulation.drive)
    return settled if settled != assigned else {}


@lru_cache(maxsize=8)
def _without_armature(text: str) -> tuple[str, dict[str, float]]:
    """A robot's text in which no armature stands, in one form, and that armature."""
    root = ElementTree.fromstring(text)
    armature: dict[str, float] = {}
    if (element := root.find(BEYOND)) is not None:
        beyond = json.loads(element.text or "{}")
        armature = beyond.pop("armature", {})
        element.text = json.dumps(beyond)
        if not beyond:
            root.remove(element)
    left = ElementTree.tostring(root, encoding="unicode")
    left = ElementTree.canonicalize(left, strip_text=True)
    return " ".join(left.split()), armature  # files have several blanks between numbers


def _state(description: dict[str, Any]) -> dict[str, list[float | None]]:
    """What is given of the state at the start, as the ideal mechanism has it.

    What only play has is left out: journals aside of their bearings, carriages, and motors turned
    against their joints. The coordinate that a joint has without clearance too is the joint's.
    """
    mechanism = description["mechanism"]
    known = stored_coordinates(mechanism)
    state: dict[str, list[float | None]] = {}
    for name, at in description["state"].items():
        coordinate = known.get(name)
        free_base = description["mechanism"].get("base") == FREE
        if coordinate is not None and not (free_base and coordinate.joint == BASE):
            joint, part = coordinate.joint, coordinate.part
            kind = class_of(mechanism["clearance"][joint]) if part in VIRTUAL_LINK else None
            if kind is None or joint in (mechanism.get("loops") or {}):
                continue
            if part not in kind.ideal_freedoms:
                continue
            name = name if kind.compound() else joint
        before = state.get(name, [None, None])
        state[name] = [old if new is None else new for old, new in zip(before, at, strict=True)]
    return state


def has_play(result: Result) -> bool:
    """Whether a joint has clearance, or a gear play."""
    given = inputs(result)
    return bool(result.joints or given["mechanism"].get("gears") or _loose(given))


def _loose(description: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Loads that have play: gears that mesh."""
    return {name: load for name, load in description["loads"].items() if load.get("play")}


def is_twin(result: Result, ideal: Result) -> bool:
    """Whether `ideal` has no play and is otherwise the same mechanism doing the same work."""
    if has_play(ideal):
        return False
    ours, its = task(result), task(ideal)
    return ours | ({"start": None} if its["start"] is None else {}) == its


def twin(result: Result, progress: bool = False) -> Result:
    """Run the `ideal_simulation` of a result, with a bar on standard error for `progress`."""
    simulation = ideal_simulation(result)
    # With loops, a step that resolves impacts is far smaller than motion without them asks for.
    check_step = not simulation.mechanism.loops
    return simulation.run(progress, check_step=check_step, estimate=False)


_MOST_RECENT, _LARGE_BYTES = 6, 1e7
_recent: OrderedDict[str, Result] = OrderedDict()
"""The last twins' motions, by what was run: whoever judges a run asks for the same ones. Those of
more bytes than `_LARGE_BYTES` are run again, lest memory grow with the length of runs."""


def tool_motion(
    simulation: Simulation,
    progress: bool = False,
    stop: Callable[[], bool] = lambda: False,
    also: Sequence[str] = (),
) -> Result:
    """A twin's run, of which only the tool's motion is kept, and what is `also` asked for; of a
    free base that of all bodies.

    Forces in its joints are found of linkages alone, and not how far it is off because of its step.
    It is interrupted as soon as `stop` says so.
    """
    from jointplay.simulation.run import Run  # takes long to import

    key = json.dumps([simulation.describe(), *also], default=str)
    if key not in _recent:
        run = Run(simulation, progress)
        run.label = "the ideal mechanism "
        run.stop_checks.append(stop)
        status = run.run_to_end(progress)
        # Seen from a free base it needs all velocities.
        more = ("q", "v") if simulation.mechanism.free_base is not None else ()
        if simulation.mechanism.loops:  # beside which the forces of loose pins are judged
            more = (*more, "reaction_force")
        motion = run.result(status, only=(*TOOL_MOTIONS, *also, *more))
        if status != Status.COMPLETED or motion.dataset.nbytes > _LARGE_BYTES:
            return motion
        _recent[key] = motion
    _recent.move_to_end(key)
    while len(_recent) > _MOST_RECENT:
        _recent.popitem(last=False)
    return _recent[key]


def without(result: Result, cause: str, progress: bool = False) -> Result | None:
    """The tool's motion in a run without one cause of its error, of what causes are left.

    They are taken out one after the other: ``"play"`` and ``"elasticity"`` as
    `Mechanism.without` has it, then the ``"drive"``: where the tool is if each joint is exactly
    where the motion has it at that time. Nothing is run for that.

    Returns:
        None if the motion does not say where all joints are: without one, with free joints, or with
        a free base. In closed loops only servos are told from the motion.

    Raises:
        JointplayError: the twin cannot be simulated, or did not run to its end.
    """
    if cause != "drive":
        run = tool_motion(ideal_simulation(result, cause), progress)
        return run.completed(f"the machine without {cause}")
    from jointplay.simulation.initial import initial_state  # these take long to import
    from jointplay.simulation.loads.drive import Servo
    from jointplay.simulation.motion.ideal import IdealMotion

    simulation = ideal_simulation(result)
    mechanism, motion = simulation.mechanism, simulation.motion
    if motion is None or mechanism.free_base is not None:
        return None
    drives = assign(mechanism, motion, simulation.drive)
    driven = [name for name, drive in drives.items() if drive.follows]
    # Loops are closed at nodes, between which other drives are nearer than a spline.
    nearer = mechanism.loops and not any(isinstance(acting, Servo) for acting in drives.values())
    if nearer or (len(driven) < len(drives) and not mechanism.loops):
        return None
    start = initial_state(simulation, driven).q
    try:
        ideal = IdealMotion(mechanism, motion, driven, float(result.time[-1]), start)
    except JointplayError:  # loops leave joints free
        return None
    frame = carried(mechanism.model, mechanism.tool_frame)
    bodies = mechanism.tree.motion(*ideal.states(result.time), tool=frame)
    places = (bodies.tool[:, :3], bodies.tool[:, 3:], bodies.orientation, bodies.spin)
    histories = result.dataset[list(TOOL_MOTIONS)]
    pairs = zip(TOOL_MOTIONS, places, strict=True)
    sent = histories.assign({name: histories[name].copy(data=values) for name, values in pairs})
    return Result(sent.assign_attrs(simulation=json.dumps(simulation.describe())))


def _start(simulation: Simulation) -> str:
    """How a run begins: at rest only where an equilibrium is found."""
    if simulation.start is None and simulation.starts_at_rest:
        from jointplay.simulation.run import Run  # takes long to import

        simulation = Run(simulation).simulation
    return "rest" if simulation.starts_at_rest else "centred"


def ideal_simulation(source: Simulation | Result, without: str = "elasticity") -> Simulation:
    """The ideal mechanism doing the same work: what a tool's error is measured against.

    By the run's own method, whose error both then share; where there are closed loops not by a
    method of first order, which leaves them: in a turn of the slider-crank by 0.2 µm, the
    multi-rate method by 1e-4 µm.

    It begins as the run does: where drives give way and loads bend, both at rest or neither.

    Args:
        source: the run with play; of a result, for as long as it lasted.
        without: see `Mechanism.without`; ``"play"`` leaves elasticity.
    """
    changes: dict[str, Any] = {}
    if isinstance(source, Result):
        simulation = source.simulation
        if source.beside is not None and without == "elasticity":
            changes["motion"] = Motion.from_description(source.beside)
        changes["duration"] = float(source.time[-1]) or simulation.step
        changes["start"] = source.audit.start
    else:
        simulation = source
        changes["start"] = _start(simulation)
    if drives := _through_teeth(simulation):
        changes["drive"] = drives
    if simulation.mechanism.loops and integrator(simulation.integrator).order == 1:
        changes["integrator"] = DEFAULT
    return dataclasses.replace(
        simulation,
        mechanism=simulation.mechanism.without(without),
        loads={name: load.tight() for name, load in simulation.loads.items()},
        seed=None,
        settle=None,
        judge_from=None,
        state={name: (at[0], at[1]) for name, at in _state(simulation.describe()).items()},
        **changes,
    )
