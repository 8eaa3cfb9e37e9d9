"""Twins of a run: the same work by a machine without one cause of error after the other.

The ideal twin (`ideal_simulation`) is what the tool error is measured against; `without` takes out
play alone, or the drives. The inputs of a result, by which twins are told, are read here too.
"""

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
"""Histories of the tool that are compared with those of the ideal mechanism."""
SLIDING_KINDS = {name for name, kind in JOINT_KINDS.items() if issubclass(kind, SlidingClearance)}
"""Kinds of joint whose surfaces slide on each other."""
ROLLING_KINDS = {name for name, kind in JOINT_KINDS.items() if issubclass(kind, RollingBearing)}
"""Kinds of joint with rolling elements."""

_MAY_DIFFER = (
    *("mechanism", "duration", "step", "integrator", "macro_step", "tolerance"),
    *("record_every", "seed", "settle", "judge_from"),
)
"""Inputs in which a run and its ideal twin may differ."""


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

    The mechanism is built only if a joint has a name like theirs.
    """
    if not any(HINGE in name for name in result.joints):
        return set()
    return {name for names in result.simulation.mechanism.hinges.values() for name in names}


def rolls(result: Result, joint: str) -> bool:
    """Whether a joint with clearance has rolling elements, by the inputs alone."""
    return clearance_inputs(result).get(joint, {}).get("kind") in ROLLING_KINDS


def clearance_outline(result: Result, joint: str) -> np.ndarray | None:
    """Closed line within which the centre of an untilted journal moves, bearing x and y (2, n) [m].

    It is the clearance circle (of a rolling bearing that in operation), or the rectangle of a
    slider's clearances; None if the inputs have neither, or without play.
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
    """Poses of a journal in its bearing over time: centre [m], rotation row by row; (n, 12)."""
    mechanism = result.simulation.mechanism
    pairs = [mechanism.frames(joint)]
    return mechanism.tree.motion(result["q"].values, pairs=pairs).poses[0]


def places(result: Result, joint: str) -> list[str]:
    """Names of the contacts of `joint`; where it has none of a name, histories hold NaN."""
    require_known("clearance joint", joint, result.joints)
    gaps = result["gap"].sel(joint=joint)
    if not gaps.sizes["time"]:
        return [str(name) for name in gaps["contact"].values]
    has = ~np.isnan(gaps.values[0])
    return [str(name) for name in gaps["contact"].values[has]]


def task(result: Result) -> dict[str, Any]:
    """Inputs that a run must share with its ideal twin: mechanism, motion, drives, loads, start.

    The start is that which it did take; None for a run without play, where nothing gives way and
    both starts are the same.
    """
    description = inputs(result)
    if result.beside is not None:
        description["motion"] = result.beside
    description["state"] = _state(description)
    if description["start"] is None and has_play(result):
        description["start"] = "centred"  # no equilibrium was searched
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
    """The drives, if teeth lower the bandwidth of some, which a twin without teeth must be given;
    else none.
    """
    from jointplay.simulation.initial import settled_drives  # takes long to import

    settled = settled_drives(simulation)
    assigned = assign(simulation.mechanism, simulation.motion, simulation.drive)
    return settled if settled != assigned else {}


@lru_cache(maxsize=8)
def _without_armature(text: str) -> tuple[str, dict[str, float]]:
    """A robot's text without armature, in canonical form, and its armature by joint."""
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
    """The given state at the start, by the coordinates of the ideal mechanism.

    Coordinates that only play has are left out: of journals aside of their bearings, carriages, and
    motors turned against their joints. The coordinate that the ideal joint has too is the joint's.
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
    """Whether a joint has clearance, or there are gears or teeth with play."""
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
    """Run the `ideal_simulation` of a result; `progress`: show a bar on standard error."""
    from jointplay.simulation.run import Run  # takes long to import

    simulation = ideal_simulation(result)
    # With loops, a step that resolves impacts is far smaller than motion without impacts needs.
    check_step = not simulation.mechanism.loops
    return Run(simulation, progress).finish(progress, check_step)


_MOST_RECENT, _LARGE_BYTES = 6, 1e7
"""Number of results in `_recent`, and the largest size of each [bytes]."""
_recent: OrderedDict[str, Result] = OrderedDict()
"""Motions of the last twins, by their simulation: several judgements of a run need the same ones.
Larger ones are run again, lest memory grow with the length of runs."""


def tool_motion(
    simulation: Simulation,
    progress: bool = False,
    stop: Callable[[], bool] = lambda: False,
    also: Sequence[str] = (),
) -> Result:
    """Run a twin, and keep only the tool's motion with the histories named in `also`.

    With a free base q and v are kept, of linkages the forces in their joints. The step is not
    checked. The run is interrupted as soon as `stop` returns True.
    """
    from jointplay.simulation.run import Run  # takes long to import

    key = json.dumps([simulation.describe(), *also], default=str)
    if key not in _recent:
        run = Run(simulation, progress)
        run.label = "the ideal mechanism "
        run.stop_checks.append(stop)
        status = run.run_to_end(progress)
        # To be seen from a free base, the tool needs all velocities.
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


def without(result: Result, cause: str) -> Result | None:
    """The tool's motion without a cause of its error, and without those that come before it.

    Causes are taken out one after the other: ``"play"`` and ``"elasticity"`` as in
    `Mechanism.without`, then the ``"drive"``: the tool's motion if each joint is exactly where the
    motion has it, for which nothing is run.

    Returns:
        A result; None if the motion does not determine all joints: without a motion, with free
        joints, or with a free base. In closed loops it is None unless there are servos.

    Raises:
        JointplayError: the twin cannot be simulated, or did not run to its end.
    """
    if cause != "drive":
        run = tool_motion(ideal_simulation(result, cause))
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
    # Loops are closed at nodes; between them, drives other than servos are nearer than the spline.
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


def ideal_simulation(source: Simulation | Result, without: str = "elasticity") -> Simulation:
    """The ideal mechanism doing the same work: the reference of the tool error.

    It runs by the run's own method, whose error both then share; but in closed loops not by a
    method of first order, which lets them drift: in a turn of the slider-crank by 0.2 µm, the
    multi-rate method by 1e-4 µm.

    It begins as the run does: where drives give way and loads bend, both at rest or neither.

    Args:
        source: the simulation with play, or a result, which gives its duration too.
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
        simulation = started = source
        if source.start is None and source.starts_at_rest:  # if an equilibrium is found
            from jointplay.simulation.run import Run  # takes long to import

            started = Run(source).simulation
        changes["start"] = "rest" if started.starts_at_rest else "centred"
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
