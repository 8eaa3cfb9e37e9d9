"""A scenario for a bare robot: a URDF, and what stands for all that nobody said."""

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
"""Case of a bare robot, after which its file is named."""
ASSUMED_CLEARANCE = 2e-4
"""Clearance of a joint of which no more is said than its name [m]: the paper's first case."""
SWING = 0.2
SLIDE = 0.05
"""Way of a joint of which no motion is given, at most, there and back [rad, m]
(judged: large enough that play is run through, small enough to hit nothing)."""
PART = 0.25
"""Part of the way to its farther limit that it goes at most (judged)."""
ROOM = 0.01
"""Part of the way between its limits that it keeps from each: a drive overshoots a little."""
SWING_S = 1.0
"""Time that it takes to get there [s] (judged: at most 0.4 rad/s, as arms move at ease)."""
STEEPEST = 1.875
"""Largest speed on the way from rest to rest, by its mean: 15/8 of the quintic."""
BRISK = 0.9
"""Part of a joint's largest speed with which it moves at most (judged: drives overshoot)."""
SHORTEST_STEP = 1e-9
"""A shorter one is not chosen: bodies that need it have next to no mass (judged) [s]."""
MARGIN = 1.2
"""Impacts elsewhere on the way may be as many times as short (judged: an effective
mass that falls by a third on the way)."""


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
        joints: names of those with clearance; by default the SCARA's joint B.
        settings: keys that count more than what is taken for granted, such as
            ``"drive.encoder=link"``.
        ideal: none has clearance; those named still say which frame is the tool.
        moves: whether a motion is chosen if none is given, and play is needed; not for who looks
            at poses only.

    Returns:
        The scenario; its `assumptions` are what was chosen that nobody gave.

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
    # The robot alone: what is wrong elsewhere is said when the scenario is built.
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
    if beyond and len(geared) < len(gears) and "tool" not in tables.get("robot", {}):
        tool, why = choose_tool(description, {*joints, *tables.get("joints", {}), *geared})
        asked.append(Setting(("robot", "tool"), tool, why, ASSUMED))
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
    """Word for the kind of a joint: that of its `table`, or what can replace that of the URDF."""
    entry = description.joints.get(name)
    kinds = [] if entry is None else replacing(entry.kind)
    return str(table.get("kind", kinds[0] if kinds else UNNAMED_KIND.kind))


def class_of_joint(word: str) -> type[Clearance]:
    """Class of the joints of a kind; of a word that is none, that which the scenario refuses."""
    choice = JOINT_WORDS.get(word, UNNAMED_KIND)
    return choice.kind if isinstance(choice, Preset) else choice


def assumed_joint(
    name: str, description: Description, known: Mapping[str, Any], ideal: bool = False
) -> Setting:
    """A joint that has clearance because it was named: its kind, and a size where none is given."""
    word = kind_of_joint(name, description, known)
    kind = class_of_joint(word)
    table: dict[str, Any] = {"kind": word} | ({"ideal": True} if ideal else {})
    if issubclass(kind, SlidingClearance):
        across, instead = next(iter(kind.clearance_fields.items()))
        if across in known or not {instead, "fit"}.intersection(known):
            table[across] = ASSUMED_CLEARANCE
    return Setting(("joints", name), table, f"--joint {name}", ASSUMED)


def _steps(scenario: Scenario) -> tuple[list[Setting], str]:
    """Keys that choose the steps of a robot of which none are given, and why, in words."""
    data = scenario.data(scenario.cases[0])
    integration = data.get("integration", {})
    if {"step", "tolerance"}.intersection(integration):
        return [], ""
    if integration.get("integrator", DEFAULT) == DEFAULT and "macro_step" not in integration:
        return [Setting(("integration", "tolerance"), TOLERANCE, "steps chosen")], BY_ERROR
    choice = step_for(scenario)
    if choice is None:
        return [], ""
    step, reason = choice
    keys = [Setting(("integration", "step"), step, "step chosen")]
    if "record_every" not in data.get("output", {}):  # records as far apart as usual
        interval = round(RecordSettings.record_every * Integration.step / step)
        keys.append(Setting(("output", "record_every"), interval, "step chosen"))
    return keys, f"step: {step:g} s (chosen: {reason}; --step selects another)"


def step_for(scenario: Scenario) -> tuple[float, str] | None:
    """A step for a robot of which none is given, should the usual one be too long for its impacts.

    Returns:
        The step [s], 1, 2 or 5 times a power of ten, and the reason in words; None if the usual
        one will do.

    Raises:
        JointplayError: links that joints move have no mass, or so little that no step would do.
    """
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
        return None
    most = durations[shortest] / (MARGIN * WELL_RESOLVED_STEPS)
    if most < SHORTEST_STEP:
        link = mechanism.description.joints[shortest].child
        mass = effective_mass(mechanism, shortest, q)
        raise JointplayError(
            f"an impact in {shortest!r} would last {durations[shortest]:.2g} s, for what hits "
            f"there weighs next to nothing ({mass:.2g} kg): give link {link!r} and those beyond it "
            "an <inertial> of their size in the URDF, or put the clearance into another joint"
        )
    return round_below(most), f"an impact in {shortest} lasts {durations[shortest]:.2g} s"


def robot_place(place: str | None) -> str:
    """A robot as `robot_scenario` takes it, in the words of a scenario."""
    if place is None:
        return SCARA
    named = ":" in place or "/" in place or place.lower().endswith(SUFFIXES)
    return place if named or files.is_file(Path(place)) else with_package(place)


def _led_by(description: Description, name: str) -> tuple[str, float, float]:
    """The joint that another follows in the end, which follows none, and factor and offset."""
    factor, offset = 1.0, 0.0
    while (mimic := description.joints[name].mimic) is not None:
        offset += factor * mimic.offset
        factor *= mimic.multiplier
        name = mimic.leader
    return name, factor, offset


def _there_and_back(description: Description, free: Collection[str]) -> tuple[dict[str, Any], str]:
    """A motion for who gave none: every joint a little way there and back, within its limits.

    Those are its own, of position and speed, and those of the joints that mimic it and follow.
    Those in `free` are not moved.
    """
    from jointplay.model.design import parse

    followers: dict[str, list[str]] = {}
    for name, entry in description.joints.items():
        if entry.mimic:
            followers.setdefault(_led_by(description, name)[0], []).append(name)
    positions = {}
    for name in list(parse(description).names)[1:]:
        entry = description.joints[name]
        if entry.mimic or name in free:  # it follows others, or what acts on it
            continue
        low, high = entry.lower, entry.upper
        low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
        fastest = entry.speed or np.inf
        for follower in followers.get(name, ()):
            _, factor, offset = _led_by(description, follower)
            its = description.joints[follower]
            if factor and its.lower is not None and its.upper is not None:
                ends = sorted(((its.lower - offset) / factor, (its.upper - offset) / factor))
                if max(low, ends[0]) <= min(high, ends[1]):  # else no position is allowed
                    low, high = max(low, ends[0]), min(high, ends[1])
            if factor and its.speed:
                fastest = min(fastest, its.speed / abs(factor))
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
