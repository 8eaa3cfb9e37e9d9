"""The scenario of a bare robot: a URDF, and defaults for all that nobody gave.

A joint that is named gets a clearance, every joint a small motion there and back, steps an error
tolerance. Each default is a setting with the origin ``assumed``, and a line in
`Scenario.assumptions`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, NothingHasPlay, require_a, require_names
from jointplay.base.origins import ASSUMED
from jointplay.base.schema import Preset, known_keywords, one_of
from jointplay.base.tables import few
from jointplay.base.units import round_below
from jointplay.model.robots import SHIPPED, SUFFIXES, with_package
from jointplay.model.tool import choose_tool
from jointplay.model.urdf import Description, between
from jointplay.physics.joints import (
    JOINT_WORDS,
    UNNAMED_KIND,
    Clearance,
    SlidingClearance,
    replacing,
)
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.scenario.reading import (
    BY_ERROR,
    TOLERANCE,
    Scenario,
    Setting,
    description_of,
    inline,
    parse,
    settings_beyond,
    tree,
    with_names,
)
from jointplay.simulation.result.settings import Integration, RecordSettings

SCARA = f"{SHIPPED}scara.urdf"
SCARA_JOINT = "joint_b"
SCARA_MOTION = f"{SHIPPED}scara_motion.csv"
LABEL = "result"
"""Label of a bare robot's only case, after which its result file is named."""
ASSUMED_CLEARANCE = 2e-4
"""Clearance of a joint that is named without a size [m]: the paper's first case."""
SWING = 0.2
SLIDE = 0.05
"""Largest amplitude of the default motion of joints that turn, and that slide [rad, m]
(judged: large enough that play is run through, small enough to hit nothing)."""
PART = 0.25
"""Largest amplitude relative to the distance from a joint's farther limit (judged)."""
ROOM = 0.01
"""Distance kept from each limit, relative to their range: a drive overshoots a little."""
SWING_S = 1.0
"""Duration of the way there [s] (judged: at most 0.4 rad/s, as arms move at ease)."""
STEEPEST = 1.875
"""Largest speed on the way from rest to rest relative to the mean: 15/8 for the quintic."""
BRISK = 0.9
"""Largest speed of the default motion relative to a joint's own (judged: drives overshoot)."""
SHORTEST_STEP = 1e-9
"""Shortest step that is chosen [s]: bodies that need shorter ones have next to no mass (judged)."""
MARGIN = 1.2
"""Duration of the shortest impact at the start relative to those elsewhere on the way (judged: an
effective mass that falls by a third)."""


@known_keywords
def robot_scenario(
    place: str | None,
    joints: Sequence[str] = (),
    settings: Sequence[Setting | str] = (),
    ideal: bool = False,
    moves: bool = True,
) -> Scenario:
    """Scenario of one robot with clearance in some of its joints.

    Args:
        place: path of a URDF or xacro, ``jointplay:NAME``, ``example-robot-data:NAME``,
            ``robot_descriptions:NAME`` or just NAME; None takes the SCARA.
        joints: names of the joints with clearance; by default the SCARA's joint B.
        settings: keys that count more than the defaults, such as ``"drive.encoder=link"``.
        ideal: whether no joint has clearance; the named ones still decide which frame is the tool.
        moves: whether a motion is chosen if none is given, and some play is required; False where
            only poses are looked at.

    Returns:
        The scenario; its `assumptions` are lines on what was chosen because nobody gave it.

    Raises:
        JointplayError: the robot cannot be read, no joint was named, or see `Scenario`.
    """
    if place is not None:
        require_a("place", place, "str")
    require_a("settings", settings, "Iterable")
    asked = [parse(entry) if isinstance(entry, str) else entry for entry in settings]
    for entry in asked:
        require_a("a setting", entry, "Setting")
    joints = require_names("joints", joints, "names")
    scara = place is None
    place = robot_place(place)
    # The robot alone is read here; errors in other settings come up when the scenario is built.
    description = description_of(place, asked)
    path = description.path
    asked_tables = tree(asked)
    beyond = settings_beyond(description, ideal)
    asked = with_names([*beyond, *asked], description.joints)
    tables = tree(asked)
    from jointplay.model.fixing import without_floating_base  # imports Pinocchio

    description = without_floating_base(description, {*joints, *tables.get("joints", {})})
    description.require_moving()
    gears = tables.get("gears", {})
    geared = [name for name, entry in gears.items() if entry.get("play", True)]
    # Gears of the file without play do not decide which frame is the tool.
    if beyond and len(geared) < len(gears) and "tool" not in tables.get("robot", {}):
        tool, why = choose_tool(description, {*joints, *tables.get("joints", {}), *geared})
        asked.append(Setting(("robot", "tool"), tool, why, ASSUMED))
    # Something must err in a motion, or there would be nothing to see.
    servos = [entry for entry in tables.get("drives", {}).values() if entry.get("kind") != "free"]
    errs = joints or ideal or gears or servos or {"joints", "drive", "drives"} & asked_tables.keys()
    if moves and not errs:
        if not scara:
            raise NothingHasPlay(description.moving)
        joints = (SCARA_JOINT,)
    for name in joints:
        if name not in description.joints and name not in tables.get("loops", {}):
            wrong = one_of("joint", name, [*description.moving, *tables.get("loops", {})])
            raise JointplayError(f"--joint: {wrong}")
    # The scenario's text has the robot; joints, motion and steps are settings.
    assumptions = []
    chosen: list[Setting] = []
    name = place.rpartition(":")[2] if ":" in place else path.name
    loose = f", play in {few(list(joints))}" if joints and not ideal else ""
    title = f"{name.removesuffix('.xacro').removesuffix('.urdf')}{loose}"
    text: dict[str, Any] = {
        "title": title,
        "robot": {"urdf": place if ":" in place else str(path.resolve())},
    }
    if scara and "motion" not in tables:
        text["motion"] = {"file": SCARA_MOTION}
    elif moves and "motion" not in tables:
        free = [
            name for name, entry in tables.get("drives", {}).items() if entry.get("kind") == "free"
        ]
        motion, note = _there_and_back(description, free)
        chosen.append(Setting(("motion",), motion, "the default motion", ASSUMED, note))
        assumptions.append(note)
    named = [
        assumed_joint(name, description, tables.get("joints", {}).get(name, {}), ideal)
        for name in joints
    ]
    written = "\n".join(f"{key} = {inline(value)}" for key, value in text.items())
    scenario = Scenario(written, place, (*chosen, *named, *asked), LABEL)
    scenario.assumptions = [*description.beyond.notes, *assumptions]
    if scara or not moves:
        return scenario
    steps, note = _steps(scenario)
    if steps:
        scenario = Scenario(written, place, (*chosen, *named, *asked, *steps), LABEL)
        scenario.assumptions = [*description.beyond.notes, *assumptions, note]
    return scenario


def kind_of_joint(name: str, description: Description, table: Mapping[str, Any]) -> str:
    """Word for the kind of a joint: that in its `table`, or one that can replace the URDF's."""
    entry = description.joints.get(name)
    kinds = [] if entry is None else replacing(entry.kind)
    return str(table.get("kind", kinds[0] if kinds else UNNAMED_KIND.kind))


def class_of_joint(word: str) -> type[Clearance]:
    """Class of joints by the word for their kind; any for a word that the scenario will refuse."""
    choice = JOINT_WORDS.get(word, UNNAMED_KIND)
    return choice.kind if isinstance(choice, Preset) else choice


def assumed_joint(
    name: str, description: Description, known: Mapping[str, Any], ideal: bool = False
) -> Setting:
    """Setting that gives a named joint clearance: its kind, and a size where none is `known`."""
    word = kind_of_joint(name, description, known)
    kind = class_of_joint(word)
    table: dict[str, Any] = {"kind": word} | ({"ideal": True} if ideal else {})
    if issubclass(kind, SlidingClearance):
        across, instead = next(iter(kind.clearance_fields.items()))
        if across in known or not {instead, "fit"}.intersection(known):
            table[across] = ASSUMED_CLEARANCE
    return Setting(("joints", name), table, f"--joint {name}", ASSUMED)


def _steps(scenario: Scenario) -> tuple[list[Setting], str]:
    """Settings that choose a robot's steps, if none are given, and a line on why.

    The usual method chooses them by their error. Others have equal steps: the usual one, or if that
    is too long for the robot's impacts, one that resolves them, 1, 2 or 5 times a power of ten [s].

    Raises:
        JointplayError: links that joints move have no mass, or so little that no step would do.
    """
    data = scenario.data(scenario.cases[0])
    integration = data.get("integration", {})
    if {"step", "tolerance"}.intersection(integration):
        return [], ""
    if integration.get("integrator", DEFAULT) == DEFAULT and "macro_step" not in integration:
        return [Setting(("integration", "tolerance"), TOLERANCE, "steps chosen")], BY_ERROR
    from jointplay.model.impact import contact_duration, effective_mass
    from jointplay.model.massless import require_inertia
    from jointplay.physics.contact.resultant import HOLDING
    from jointplay.physics.kernel import WELL_RESOLVED_STEPS
    from jointplay.simulation.prepare import MIN_CONTACT_STEPS

    simulation = scenario.simulation()
    mechanism, motion = simulation.mechanism, simulation.motion
    begin = {} if motion is None else dict(zip(motion.joints, motion.positions[0], strict=True))
    q = mechanism.configuration(begin)
    require_inertia(mechanism, q)
    durations = {
        name: contact_duration(mechanism, name, q)
        for name, joint in mechanism.clearance.items()
        if joint.law not in HOLDING
    }
    shortest = min(durations, key=durations.__getitem__, default=None)
    if shortest is None or durations[shortest] >= MARGIN * MIN_CONTACT_STEPS * simulation.step:
        return [], ""
    most = durations[shortest] / (MARGIN * WELL_RESOLVED_STEPS)
    if most < SHORTEST_STEP:
        link = mechanism.description.joints[shortest].child
        mass = effective_mass(mechanism, shortest, q)
        raise JointplayError(
            f"an impact in {shortest!r} would last {durations[shortest]:.2g} s, for what hits "
            f"there weighs next to nothing ({mass:.2g} kg): give link {link!r} and those beyond it "
            "an <inertial> of their size in the URDF, or put the clearance into another joint"
        )
    step = round_below(most)
    keys = [Setting(("integration", "step"), step, "step chosen")]
    if "record_every" not in data.get("output", {}):  # records at the usual interval
        interval = round(RecordSettings.record_every * Integration.step / step)
        keys.append(Setting(("output", "record_every"), interval, "step chosen"))
    reason = f"an impact in {shortest} lasts {durations[shortest]:.2g} s"
    return keys, f"step: {step:g} s (chosen: {reason}; --step selects another)"


def robot_place(place: str | None) -> str:
    """A robot as `robot_scenario` takes it, as a scenario's ``robot.urdf``."""
    if place is None:
        return SCARA
    named = ":" in place or "/" in place or place.lower().endswith(SUFFIXES)
    return place if named or files.is_file(Path(place)) else with_package(place)


def _led_by(description: Description, name: str) -> tuple[str, float, float]:
    """The joint at the head of a chain of mimicking joints, and factor and offset against it."""
    factor, offset = 1.0, 0.0
    while (mimic := description.joints[name].mimic) is not None:
        offset += factor * mimic.offset
        factor *= mimic.multiplier
        name = mimic.leader
    return name, factor, offset


def _there_and_back(description: Description, free: Collection[str]) -> tuple[dict[str, Any], str]:
    """The default motion, and a line on it: every joint a little way there and back.

    It keeps within the limits of position and speed of each joint, and of those that mimic it.
    Joints in `free` are not moved.
    """
    from jointplay.model.design import parse

    followers: dict[str, list[str]] = {}
    for name, entry in description.joints.items():
        if entry.mimic:
            followers.setdefault(_led_by(description, name)[0], []).append(name)
    positions = {}
    for name in list(parse(description).names)[1:]:
        entry = description.joints[name]
        if entry.mimic or name in free:
            continue
        low, high = entry.lower, entry.upper
        low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
        fastest = entry.speed or np.inf
        for follower in followers.get(name, ()):
            _, factor, offset = _led_by(description, follower)
            limits = description.joints[follower]
            if factor and limits.lower is not None and limits.upper is not None:
                ends = sorted(((limits.lower - offset) / factor, (limits.upper - offset) / factor))
                if max(low, ends[0]) <= min(high, ends[1]):  # limits that contradict do not count
                    low, high = max(low, ends[0]), min(high, ends[1])
            if factor and limits.speed:
                fastest = min(fastest, limits.speed / abs(factor))
        inside = ROOM * (high - low) if np.isfinite(high - low) else 0.0
        begin = float(np.clip(between(low, high), low + inside, high - inside))
        room = max(high - begin, begin - low)
        distance = min(
            SLIDE if entry.slides else SWING, PART * room, BRISK * fastest * SWING_S / STEEPEST
        )
        end = begin + (distance if high - begin >= begin - low else -distance)
        positions[name] = [begin, end, begin]
    motion = {"times": [0.0, SWING_S, 2.0 * SWING_S], "joints": positions}
    note = (
        f"no motion given: every joint moves up to {SWING:g} rad or {SLIDE:g} m there and back in "
        f"{2.0 * SWING_S:g} s; --motion CSV or --set motion... replaces it"
    )
    return motion, note
