"""What the compiled code knows of a run: records of named fields, and the arrays they point to.

A compiled call costs about 0.1 us for every array it is given. The kernels are therefore given one
record, `RUN`, which holds numbers, and addresses of arrays and of the other records. Each array is
declared here once, with its shape in terms of the record's own sizes: `Workspace` allocates it so,
and in compiled code `run.minv` is that array (`access`), while in Python it is its address.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.physics.contact.law import BRISTLE_NUMBERS, FILM_NUMBERS
from jointplay.physics.contact.machine_code import MAX_PARAMETERS
from jointplay.physics.kernel.constants import AZIMUTHS, GEAR_BENDS, GEAR_ORDERS, NEVER, POWERS

DRIVE, NORMAL, FRICTION, JOINT_FRICTION, GEAR, FILM = range(len(POWERS))
"""Places of the powers in `RUN`'s arrays."""

(
    START, START_SPEED, ACCELERATION, MIDDLE, MIDDLE_SPEED, HALF, JERK, MEAN, PATH_ROWS,
) = range(9)  # fmt: skip
"""Rows of `RUN.path`: the state at the start of the predicted path and what changes it, the state
in its middle, `half` at its start, and the mean acceleration of the last macro step."""

(
    SPEED, PUSH, BASE, ERROR, STEP, LAST, MARKS, INERTIA, TRIAL_ROWS,
) = range(9)  # fmt: skip
"""Rows of `RUN.trial`; see `solve`."""

MIN_APPROACH_SPEED = 1e-9
"""Keeps ddelta/ddelta0 defined where a contact begins with no depth and no speed [m/s]."""
STORED = 0.4
"""Energy stored in a contact over its elastic force times its depth: Hertz's, 1/(1 + 3/2)."""
SPEED_LIMIT = 1e4
"""Generalised speed at which a run has run away [m/s or rad/s]."""
NO_VIRTUAL_LINK = -1
"""`first` of a joint whose bearing and journal are reached through their frames."""
POSE = 12
"""Numbers of a pose: the journal's centre and its orientation row by row, in the bearing frame."""

_INT, _FLOAT = np.int64, np.float64

Size = int | str
"""A number, the name of a field that has it, or such a field times a number: "3*nh"."""


@dataclass(frozen=True)
class Array:
    """An array whose address is a field of a record."""

    kind: np.dtype
    shape: tuple[Size, ...]
    """In which compiled code has it."""
    room: tuple[Size, ...]
    """In which it is allocated: the largest shape that it can have."""
    changes: bool
    """Whether a macro step of the multi-rate method changes it."""


ARRAYS: dict[np.dtype, dict[str, Array]] = {}
"""Arrays that records point to, by their fields."""
ADDRESSES: dict[np.dtype, frozenset[str]] = {}
"""All fields of records that are addresses: of these arrays, of laws and of their numbers."""
_ADDRESS = object()
"""Kind of a field that is an address of something else than a declared array."""


def _array(
    kind: Any, *shape: Size, room: tuple[Size, ...] | None = None, changes: bool = False
) -> Array:
    return Array(np.dtype(kind), shape, shape if room is None else room, changes)


def _floats(*shape: Size, **options: Any) -> Array:
    return _array(_FLOAT, *shape, **options)


def _integers(*shape: Size) -> Array:
    return _array(_INT, *shape)


def _record(**fields: Any) -> np.dtype:
    """Record of numbers, tuples (kind, shape) of numbers, `Array` or `_ADDRESS`."""
    arrays = {name: kind for name, kind in fields.items() if isinstance(kind, Array)}
    others = {name for name, kind in fields.items() if kind is _ADDRESS}
    fields |= dict.fromkeys(arrays.keys() | others, _INT)
    kinds = [
        (name, kind) if not isinstance(kind, tuple) else (name, *kind)
        for name, kind in fields.items()
    ]
    record = np.dtype(kinds, align=True)
    if arrays or others:
        ARRAYS[record], ADDRESSES[record] = arrays, frozenset(arrays.keys() | others)
    return record


def term(size: Size) -> tuple[int, str | None]:
    """A size as a factor and the field that it multiplies, if any."""
    if isinstance(size, int):
        return size, None
    factor, _, name = size.rpartition("*")
    return int(factor or 1), name


def extents(shape: Sequence[Size], record: np.ndarray) -> tuple[int, ...]:
    """A shape as numbers, given the record that it belongs to."""
    terms = map(term, shape)
    return tuple(factor if name is None else factor * int(record[name]) for factor, name in terms)


_BETWEEN_FRAMES = {
    "nsupport": _INT,
    "support": _integers("nsupport"),  # coordinates that move the two against each other
    "signs": _integers("nsupport"),  # +1 for those that move the journal, -1 for the bearing
    "jacobian": _floats(6, "nsupport"),  # motion of the journal per velocity of these coordinates
    "bearing_rotation": _floats(9),  # of the bodies, column by column
    "bearing_translation": _floats(3),
    "journal_rotation": _floats(9),
    "journal_translation": _floats(3),
    "bearing_placement": (_FLOAT, (12,)),  # in the bodies: rotation row by row, translation
    "journal_placement": (_FLOAT, (12,)),
}
"""Of what acts between two frames, a joint's or a load's: bearing (the first) and journal."""

JOINT = _record(
    # Addresses of laws and their numbers.
    normal_law=_ADDRESS,
    friction_law=_ADDRESS,
    film_law=_ADDRESS,
    element_law=_ADDRESS,  # of a rolling bearing, whose numbers are `dimensions`; and
    elements=_ADDRESS,  # what it answers, see `contact.rolling`
    dimensions=_ADDRESS,
    # Addresses of what is compiled apart (`access.PART`), where the joint has it.
    film_part=_ADDRESS,
    element_part=_ADDRESS,
    # Arrays.
    **_BETWEEN_FRAMES,
    sliding_work=_floats(2, "wearing", AZIMUTHS),  # of the bore, of the journal
    # What it is.
    resultant=_INT,  # whether a law answers for all of it (`rolling`)
    bristles=_INT,
    shape=_INT,
    count=_INT,
    first=_INT,
    must_not_touch=_INT,
    wearing=_INT,  # contacts whose sliding work is counted
    sections=_INT,  # of the film; 0 for none
    limit=_FLOAT,  # gap at which the journal has broken out [m]
    rest_mass=_FLOAT,  # whose impacts damping at rest is referred to [kg]
    friction_parameters=(_FLOAT, (MAX_PARAMETERS,)),
    # Film.
    section=_FLOAT,  # distance of the sections from the journal's centre [m]
    clearance=_FLOAT,
    thinnest=_FLOAT,  # eccentricity ratio at which the film is thinnest
    transition=_FLOAT,  # depth over which it fades [m]
    lag_mass=_FLOAT,  # of the explicit methods [kg]
    film_parameters=(_FLOAT, (MAX_PARAMETERS,)),
    film_memory=(_FLOAT, (2, 5)),  # by section: force and velocity at the last step; whether known
    # Now.
    touching=_INT,  # whether it takes part in the velocity solve
    cage=_FLOAT,  # azimuth of the first element [rad]
    cage_start=_FLOAT,  # of Runge-Kutta's step, and
    cage_sum=_FLOAT,  # the weighted sum of its rates so far
    pose=(_FLOAT, (POSE,)),
    sines=(_FLOAT, (4,)),  # sine and cosine of yaw, of pitch
    twist=(_FLOAT, (6,)),
    wrench=(_FLOAT, (6,)),  # force and moment about the journal's centre, in the bearing frame
    film_wrench=(_FLOAT, (6,)),  # its part that is the film's
    wrench_slope=(_FLOAT, (6, 6)),  # d(wrench)/d(twist)
    # For record and audit.
    mean_force=(_FLOAT, (3,)),  # over the stages of the last step, where there are stages
    mean_film_force=(_FLOAT, (3,)),
    impulse=(_FLOAT, (3,)),
    peak=(_FLOAT, (3,)),
    peak_square=_FLOAT,
)
"""One joint with clearance."""

CONTACT = _record(
    parameters=(_FLOAT, (MAX_PARAMETERS,)),
    # Now: geometry, then what the contact answers to the velocity it meets.
    touching=_INT,
    gap=_FLOAT,
    direction=(_FLOAT, (3,)),  # from the bearing into the journal
    arm=(_FLOAT, (3,)),  # of the contact point from the journal's centre
    elastic=_FLOAT,
    rate=_FLOAT,
    speed=_FLOAT,
    normal_now=_FLOAT,
    tangential_now=_FLOAT,
    friction_power=_FLOAT,  # dissipated [W]
    mu=_FLOAT,
    friction=(_FLOAT, (3,)),
    slip=(_FLOAT, (3,)),  # sliding velocity
    approach=_FLOAT,
    reference=_FLOAT,  # speed that damping is referred to, at least `approach` [m/s]
    # Bristles now.
    bristle_now=(_FLOAT, (3,)),
    dwell_now=_FLOAT,
    # Memory of the contact that lasts.
    ddelta0=_FLOAT,
    steps=_FLOAT,
    own_impulse=_FLOAT,
    bristle=(_FLOAT, (3,)),
    dwell=_FLOAT,
    elapsed=_FLOAT,  # since the bristles were as they are kept [s]
    compliance=_FLOAT,  # inverse of the mass that it meets along its normal [1/kg]
    braking=_FLOAT,  # expected of an impact, as in `RUN`; until
    braking_end=_FLOAT,  # [s]
    # For record and audit.
    mean_normal=_FLOAT,  # over the stages of the last step, where there are stages
    mean_friction=(_FLOAT, (3,)),
    normal=_FLOAT,
    tangential=_FLOAT,
    normal_peak=_FLOAT,
    gap_min=_FLOAT,
    onsets=_FLOAT,
    ended=_FLOAT,
    shortest=_FLOAT,
    under=_FLOAT,
    impulse=_FLOAT,
    impulse_under=_FLOAT,
    deepest=_FLOAT,
    fastest=_FLOAT,
)
"""One place where a joint's journal and bearing can touch."""

DRIVE_ROW = _record(
    column=_INT,  # of the reference
    coordinate=_INT,  # that it acts on
    encoder=_INT,  # coordinate that its encoder measures
    kp=_FLOAT,
    kd=_FLOAT,
    armature=_FLOAT,  # > 0 prescribes the motion
    limit=_FLOAT,  # of the effort, infinite for none; not of prescribed motion
    implicit=_INT,  # whether its damping is part of the velocity solve
    taken_at=_FLOAT,  # speed of the encoder at which its effort was found
)
SERVO = _record(
    column=_INT,  # of the reference
    coordinate=_INT,  # that it acts on
    encoder=_INT,  # coordinate that its encoder measures
    stall=_FLOAT,  # effort per voltage at rest
    p_gain=_FLOAT,
    i_gain=_FLOAT,
    d_gain=_FLOAT,
    differences=_INT,  # whether the D term has the speed from readings
    dead_band=_FLOAT,
    resolution=_FLOAT,  # of its encoder, 0 for none
    voltage=_FLOAT,  # largest
    limit=_FLOAT,  # of the effort, infinite for none
    period=_FLOAT,  # of its samples, 0 for none
    next_sample=_FLOAT,
    sampled_at=_FLOAT,
    held=_FLOAT,  # voltage since the last sample, and before it
    held_before=_FLOAT,
    # Of the I and the D term, now and at the last state of the trajectory or sample.
    integral=_FLOAT,  # voltage
    integral_before=_FLOAT,
    error=_FLOAT,
    error_before=_FLOAT,
    reading=_FLOAT,
    reading_before=_FLOAT,
    integrated_until=_FLOAT,
)
"""The controller of one servo; see `kernel.drive`."""

FRICTION_ROW = _record(
    coordinate=_INT,
    coulomb=_FLOAT,
    stiction=_FLOAT,
    stribeck=_FLOAT,
    viscous=_FLOAT,
    presliding=_FLOAT,  # bend of its bristles at breakaway, 0 for none
    damping=_FLOAT,  # of the bristles
    bend=_FLOAT,  # now
    kept_bend=_FLOAT,  # at `RUN.bent_at`
    torque=_FLOAT,
)
GEAR_ROW = _record(
    motor=_INT,
    link=_INT,
    half_play=_FLOAT,
    damping=_FLOAT,
    slopes=(_FLOAT, (GEAR_BENDS + 1,)),  # of the elastic curve beyond the play
    bend_twists=(_FLOAT, (GEAR_BENDS,)),  # at which its slope changes, infinite for none
    bend_torques=(_FLOAT, (GEAR_BENDS,)),
    grip=_FLOAT,  # largest torque of its bristles
    presliding=_FLOAT,  # angle in which they let go
    orders=_INT,  # of its kinematic error, in cycles per turn of the joint
    order=(_FLOAT, (GEAR_ORDERS,)),
    amplitude=(_FLOAT, (GEAR_ORDERS,)),
    phase=(_FLOAT, (GEAR_ORDERS,)),
    running_torque=_FLOAT,  # friction on the motor without load
    viscous=_FLOAT,
    rubs=_INT,  # whether it has bristles or friction, which act within its play, too
    driving_loss=_FLOAT,  # friction per torque held where the motor drives, and where it is driven
    driven_loss=_FLOAT,
    # Now.
    twist=_FLOAT,
    lever=_FLOAT,  # turn of the joint per turn of the motor at constant twist
    elastic=_FLOAT,  # torque, without sign
    hysteresis=_FLOAT,
    torque=_FLOAT,  # transmitted to the joint
    # At the last state of the trajectory.
    last_twist=_FLOAT,
    last_hysteresis=_FLOAT,
)
"""One gear; see `kernel.gear`."""

BODY = _record(
    parent=_INT,  # place among the bodies; 0 is the ground
    coordinate=_INT,
    slides=_INT,  # along its z; else it turns about it
    turn=(_FLOAT, (9,)),  # orientation in the parent at coordinate zero, row by row
    shift=(_FLOAT, (3,)),  # origin in the parent at coordinate zero
    # Now, in the world.
    rotation=(_FLOAT, (9,)),  # column by column
    origin=(_FLOAT, (3,)),
    omega=(_FLOAT, (3,)),
    alpha=(_FLOAT, (3,)),  # angular acceleration, and that of the origin, at constant speeds
    lift=(_FLOAT, (3,)),
)
"""One body that a coordinate moves."""

HOLD = _record(body=_INT, partner=_INT, place=(_FLOAT, (3,)), partner_place=(_FLOAT, (3,)))
"""Two points of two bodies that a loop without clearance holds together."""

LOAD = _record(
    law=_ADDRESS,
    numbers=_ADDRESS,  # the law's p
    place=_floats("ninputs"),  # x; `pose` between frames
    rate=_floats("nrates"),  # dx; `twist` between frames
    out=_floats("nanswers"),  # what it answers now; `wrench` between frames
    elastic=_floats(2, "nanswers"),  # what it answers at rest, if it stores energy; room
    inputs=_integers("ninputs"),  # coordinates
    outputs=_integers("noutputs"),
    bounds=_floats("nbounds"),  # largest efforts on these, if they are limited
    **_BETWEEN_FRAMES,  # of its first and its second frame
    # What it is.
    frames=_INT,  # whether it acts between two frames; else on coordinates
    ninputs=_INT,
    noutputs=_INT,
    nrates=_INT,
    nanswers=_INT,
    nbounds=_INT,
    stores=_INT,  # whether its answer at rest is the slope of an energy
    implicit=_INT,  # whether the rest of it depends on velocity: NEVER, ALWAYS, IF_PRESSED
    # Now.
    active=_INT,  # whether it takes part in the velocity solve
    pose=(_FLOAT, (POSE,)),
    twist=(_FLOAT, (6,)),
    wrench=(_FLOAT, (6,)),
    wrench_slope=(_FLOAT, (6, 6)),
    power=_FLOAT,  # [W] of all of it, or of what it does not store
    before=_FLOAT,
    work=_FLOAT,  # since the start [J]
    gathered=_FLOAT,  # of Runge-Kutta
)
"""One load whose law is called by address; see `load`."""

ROW: dict[str, tuple[Size, ...]] = {
    "time": (),
    "q": ("nv",),
    "v": ("nv",),
    "drive": ("nv",),
    "work": (len(POWERS),),
    "force": ("nj", 3),
    "force_peak": ("nj", 3),
    "film_force": ("nj", 3),
    "normal": ("nj", "width"),
    "tangential": ("nj", "width"),
    "normal_peak": ("nj", "width"),
    "gap_min": ("nj", "width"),
    "cage": ("cages",),
    "gear": ("ng", 2),
    "joint_bristles": ("bristled",),
    "load_force": ("load_columns",),
    "load_work": ("nl",),
}
"""Quantities of a record, in their order, and their shapes in terms of the run's sizes."""


class Quantity(NamedTuple):
    """Where a quantity stands in the records of a run."""

    columns: slice
    shape: tuple[int, ...]

    def of(self, rows: np.ndarray) -> np.ndarray:
        """Its values in records (n, columns), shape (n, *shape)."""
        return rows[:, self.columns].reshape(len(rows), *self.shape)


(
    TIME, Q, V, DRIVE_EFFORT, WORK, FORCE, FORCE_PEAK, FILM_FORCE, NORMAL_FORCE, TANGENTIAL_FORCE,
    NORMAL_PEAK, GAP_MIN, CAGE, GEAR_TORQUE, BRISTLE_TORQUE, LOAD_FORCE, LOAD_WORK,
) = range(len(ROW))  # fmt: skip
"""Their places in `RUN.columns`."""

RUN = _record(
    # The state and what acts on it.
    q=_floats("nv", changes=True),
    v=_floats("nv", changes=True),
    half=_floats("nv", changes=True),  # velocities half a step ago
    a=_floats("nv", changes=True),  # accelerations; for single-rate methods Pinocchio's
    tau=_floats("nv", changes=True),
    angular=_floats("nv"),  # 1 for angles, 0 for lengths
    inertia=_floats("nv"),  # of each coordinate alone, as of the last middle
    weights=_floats("nv"),  # 0 for prescribed coordinates, whose inertia is no real one
    drive=_floats("nv", changes=True),  # efforts of the drives
    velocity_forces=_floats("nv", changes=True),  # of what depends on velocity
    # Accelerations by these; how fast they changed; those before; half of how fast that changed.
    pushed=_floats(4, "nv", changes=True),
    load_forces=_floats("nv", changes=True),  # of the loads' part that does not
    # Inverse of the mass matrix, and acceleration without any of the forces reckoned here:
    minv=_floats("nv", "nv", changes=True),  # now
    free=_floats("nv", changes=True),
    minv_rate=_floats("nv", "nv", changes=True),  # their rates along the present chord
    free_rate=_floats("nv", changes=True),
    minv_middle=_floats("nv", "nv"),  # as of the last middle
    free_middle=_floats("nv"),
    minv_slope=_floats("nv", "nv"),  # first and second divided differences of the middles
    free_slope=_floats("nv"),
    minv_curve=_floats("nv", "nv"),
    free_curve=_floats("nv"),
    found_minv=_floats("nv", "nv"),  # Pinocchio's, its upper triangle, ideal loops closed
    found_free=_floats("nv"),  # likewise
    path=_floats(PATH_ROWS, "nv"),
    # The velocity solve, its arrays used for those coordinates that take part.
    slope=_floats("active", "active", room=("nv", "nv")),  # of d(velocity_forces)/dv
    compliance=_floats("active", "active", room=("nv", "nv")),  # of `minv`, unless these are all
    inverse=_floats(  # transposed, of the last matrix, of `factored` coordinates
        "active", "active", room=("nv", "nv"), changes=True
    ),
    trial=_floats(TRIAL_ROWS, "nv"),
    scratch=_floats("nv"),
    stages=_floats(4, "nv"),  # of Runge-Kutta: q, v at the step's start, sums of their rates
    # Adaptive micro steps.
    earlier_a=_floats(3, "nv", changes=True),  # accelerations at the last two states; room
    row_before=_floats("record_columns"),  # records of the states that others are interpolated
    row_after=_floats("record_columns"),  # between
    copies=_integers("ncopies", 3),  # addresses of an array and its copy, length in 8-byte words
    world_jacobian=_floats("nv", 6),  # Pinocchio's data.J by columns, or of `frames.place_bodies`
    open_minv=_floats("nv", "nv"),  # Pinocchio's without loops, if there are `holds`
    open_free=_floats("nv"),
    loop_rows=_floats("3*nh", "nv"),  # see `loops`
    loop_residual=_floats(2, "3*nh"),
    loop_correction=_floats(2, "nv"),
    loop_minv=_floats("nv", "nv"),
    reference=_floats("nref", 3, "nu"),  # positions, speeds and feed-forward efforts by node
    record=_floats("rows", "record_columns"),
    windows=_floats("nwindows", 2),  # steps from which and to which every step is recorded
    touched=_integers("nv"),  # coordinates of the velocity solve
    exchanged=_integers("nv"),  # rows exchanged when `inverse` was found
    place=_integers("nv"),  # places of the coordinates among `touched`
    joints=_array(JOINT, "nj"),
    contacts=_array(CONTACT, "nj", "width"),
    drives=_array(DRIVE_ROW, "nd"),
    servos=_array(SERVO, "ns", changes=True),
    frictions=_array(FRICTION_ROW, "nf", changes=True),
    gears=_array(GEAR_ROW, "ng", changes=True),
    loads=_array(LOAD, "nl"),
    bodies=_array(BODY, "nb"),
    holds=_array(HOLD, "nh"),
    # Addresses of what is compiled apart, where the run has it.
    gear_part=_ADDRESS,
    loop_part=_ADDRESS,
    load_part=_ADDRESS,
    servo_part=_ADDRESS,
    # Sizes.
    nv=_INT,
    nj=_INT,
    width=_INT,
    nu=_INT,
    nd=_INT,
    nf=_INT,
    bristled=_INT,  # of these, those with bristles
    ns=_INT,
    ng=_INT,
    nl=_INT,
    nb=_INT,  # bodies, the ground among them; 0 if none need be placed
    nh=_INT,
    nref=_INT,
    record_columns=_INT,
    cages=_INT,  # recorded: all joints if one of them is a rolling bearing
    load_columns=_INT,  # recorded: what all loads answer
    nwindows=_INT,
    ncopies=_INT,
    # How to go on.
    record_every=_INT,  # steps
    until=_INT,  # step that no macro step goes beyond
    suggested=_INT,  # length that the next macro step should have, in steps
    longest=_INT,
    unit=_INT,  # macro steps are multiples of this, unless they are shorter from the first
    fixed=_INT,  # whether their length is given
    macro=_INT,  # planned length of the macro step
    rows=_INT,  # room for records
    fresh=_INT,  # whether no step has led to the state
    through_frames=_INT,  # whether any joint is reached through frames of Pinocchio's
    prescribed=_INT,  # whether any coordinate's motion is prescribed
    dt=_FLOAT,  # of the step that follows; then of the one before
    dt_before=_FLOAT,
    reference_interval=_FLOAT,
    # Where the run is.
    step=_INT,
    row=_INT,
    stage=_INT,
    status=_INT,
    bad_contact=_INT,
    pending=_INT,  # whether the works of the last step are not complete
    commit=_INT,  # whether `load` completes a step or a stage
    known_middles=_INT,  # middles of macro steps known so far, up to 3
    known_free=_INT,  # those since velocities jumped
    refused=_INT,  # whether a macro step is to be planned anew
    macros=_INT,  # macro steps done
    touching=_INT,
    active=_INT,  # coordinates of the velocity solve
    events=_INT,  # contacts that have begun or ended in this macro step
    factored=_INT,
    averaged=_INT,  # whether a step has stages, whose mean forces are recorded
    unsolved=_INT,  # velocity solves that did not converge
    unresolved=_INT,  # shortest micro steps whose error was not tolerable
    known_a=_INT,  # states of `earlier_a` since accelerations jumped, up to 2
    iterations=_INT,
    solves=_INT,
    pushed_bends=_INT,  # whether their parabola was nearer to the last ones than their line
    pushed_dt=_FLOAT,  # between the last two [s]
    time=_FLOAT,
    bent_at=_FLOAT,  # time at which bristles are kept [s]: half a step after the last state
    evaluated_at=_FLOAT,  # time of the state that the multi-rate method evaluated last [s]
    load_time=_FLOAT,
    path_start=_FLOAT,
    path_span=_FLOAT,
    fastest=_FLOAT,  # of the speeds of `angular` [rad/s]
    departure=_FLOAT,  # of these angles from the last path, about [rad]; and how much of it is
    departure_limit=_FLOAT,  # too much
    tolerance=_FLOAT,  # of `path_error`
    middle_time=_FLOAT,
    mean_time=_FLOAT,  # of the last mean acceleration in `path`
    middles_apart=_FLOAT,  # the last two
    chord_end=_FLOAT,  # until which time `minv_rate` and `free_rate` hold [s]
    micro_tolerance=_FLOAT,  # of micro steps, see `adaptive`
    shortest_micro=_FLOAT,  # micro step [s]
    longest_micro=_FLOAT,  # micro step that springs, gears and drives allow [s]
    stable_micro=_FLOAT,  # micro step that follows the contacts that touch now [s]
    refused_at=_FLOAT,  # time of the state from which a micro step has to be shorter [s]; and
    refused_step=_FLOAT,  # how long it is to be [s]
    refused_length=_FLOAT,  # length of the first step that was refused at this time [s]
    retried_at=_FLOAT,
    micro_step=_FLOAT,  # that the last error suggests [s]
    earlier_dt=_FLOAT,  # between the states of `earlier_a` [s]
    braking=_FLOAT,  # by impacts under way, as the root of twice a kinetic energy per time
    moved=_FLOAT,  # size of what forces and inertia move at the last state, likewise
    moved_by_forces=_FLOAT,  # by `velocity_forces` alone, at this one
    path_error=_FLOAT,  # of the acceleration at the middle of the path, relative
    work=(_FLOAT, (len(POWERS),)),  # since the start [J]
    before=(_FLOAT, (len(POWERS),)),  # powers at the start of the step [W]
    power=(_FLOAT, (len(POWERS),)),  # powers now [W]
    stage_work=(_FLOAT, (len(POWERS),)),  # of Runge-Kutta: sums of the powers
    columns=(_INT, (len(ROW),)),  # where the quantities of `ROW` begin in a record
    law_numbers=(_FLOAT, (max(BRISTLE_NUMBERS, FILM_NUMBERS),)),
)
"""Everything about one run."""


# Where the kernels act: what they know of a joint with clearance, its film, and a load.

Carriers = tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]
"""Two Pinocchio joints, and the placement of a frame in each."""


@dataclass(frozen=True)
class JointSite:
    """One joint with clearance, as the kernels have it."""

    record: np.ndarray
    """Of `JOINT`, shape (1,); what it points to is left to the workspace."""
    parameters: np.ndarray
    """Of the normal-force law, for each contact, shape (contacts, `MAX_PARAMETERS`)."""
    dimensions: tuple[float, ...]
    """Of its surfaces, as `geometry.touch` takes them [m]."""
    holds: bool = False
    """Whether springs, not surfaces, connect its bodies."""
    carriers: Carriers | None = None
    """Pinocchio joint that carries the bearing, and the bearing's placement in it; the same of the
    journal. None where the coordinates of a virtual link, from `first` on, move the journal."""
    signs: np.ndarray | None = None
    """With `carriers`: +1 for coordinates that move the journal only, -1 for those that move the
    bearing only, 0 for all others, shape (nv,)."""


PARTS = ("bearing", "journal")

CarriedFrame = tuple[int, np.ndarray]
"""A body by its place, and a frame's rotation, row by row, and origin in it, shape (12,)."""


@dataclass(frozen=True)
class LoadSite:
    """What the kernels know of one load (`kernel.load`), on coordinates or between two frames."""

    law: int
    """Address of its law."""
    numbers: np.ndarray
    """Of the law; what is written into it later, the law sees."""
    stores: bool = False
    """Whether its answer at rest is the slope of an energy."""
    implicit: int = NEVER
    """When the rest of it depends on velocity: `constants.NEVER`, `ALWAYS` or `IF_PRESSED`."""
    inputs: tuple[int, ...] = ()
    """Coordinates that the law reads."""
    outputs: tuple[int, ...] = ()
    """Coordinates on which it acts; if it is implicit, those that it reads."""
    bounds: tuple[float, ...] = ()
    """Largest effort on each of them, if it is limited [N m or N]."""
    carriers: Carriers | None = None
    """Between frames: Pinocchio joints that carry them, and the frames' placements in these."""
    signs: np.ndarray | None = None
    """Of the coordinates that move the frames, as of a `JointSite`."""

    @property
    def size(self) -> int:
        """Numbers that the law gives."""
        return len(self.outputs) if self.carriers is None else 6


# What acts on single coordinates, as the kernels have it: drives, friction, gears.


@dataclass(frozen=True)
class CoordinateTables:
    """What acts on single coordinates."""

    drives: np.ndarray
    """Of `DRIVE_ROW`, see `drive_row`."""
    servos: np.ndarray
    """Of `SERVO`."""
    frictions: np.ndarray
    """Of `FRICTION_ROW`."""
    gears: np.ndarray
    """Of `GEAR_ROW`."""
    reference: np.ndarray
    """Rows of q, v and feed-forward effort of the nu driven coordinates, shape (nref, 3 nu),
    nref >= 2."""
    interval: float
    """Between the rows of `reference` [s]."""
    nodes: int
    """Rows of the whole reference, of which `reference` is the beginning."""


def drive_row(
    column: int,
    coordinate: int,
    encoder: int | None = None,
    kp: float = 0.0,
    kd: float = 0.0,
    armature: float = 0.0,
    limit: float = np.inf,
) -> np.ndarray:
    """Record of the drive of one coordinate, shape (1,).

    Args:
        column: of the reference.
        coordinate: that it acts on.
        encoder: coordinate that its encoder measures; None takes its own.
        kp, kd: gains [N m/rad, N m s/rad, or N/m, N s/m].
        armature: > 0 prescribes the motion; the model must have this armature [kg m^2 or kg].
        limit: largest effort, to which others are cut [N m or N].
    """
    encoder = coordinate if encoder is None else encoder
    values = (column, coordinate, encoder, kp, kd, armature, limit, 0, 0.0)
    return np.array([values], DRIVE_ROW)


def friction_row(coordinate: int, **fields: float) -> np.ndarray:
    """Record of a joint's friction, shape (1,): fields of `FRICTION_ROW`; see
    `drive.JointFriction`.
    """
    row = np.zeros(1, FRICTION_ROW)
    row["coordinate"], row["stribeck"] = coordinate, 1.0
    for name, value in fields.items():
        row[name] = value
    return row


def gear_row(**fields: Any) -> np.ndarray:
    """Record of a gear, shape (1,): fields of `GEAR_ROW`, lists shorter."""
    row = np.zeros(1, GEAR_ROW)
    row["bend_twists"], row["presliding"], row["lever"] = np.inf, 1.0, 1.0
    for name, value in fields.items():
        if np.ndim(value):
            row[name][0, : len(value)] = value
        else:
            row[name] = value
    return row


def stacked(rows: Sequence[np.ndarray], kind: np.dtype) -> np.ndarray:
    """All rows of one kind, an empty array if there are none."""
    return np.concatenate(rows) if rows else np.zeros(0, kind)
