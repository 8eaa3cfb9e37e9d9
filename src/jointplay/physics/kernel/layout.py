"""Memory layout of a run: records of named fields, and the arrays that they point to.

A compiled call costs about 0.1 us for every array it is given. The kernels are therefore given one
record, `RUN`, which holds numbers, and addresses of arrays and of the other records. Each array is
declared here once, with its shape in terms of the record's own sizes: `Workspace` allocates it so,
and in compiled code `run.minv` is that array (`access`), while in Python it is its address.

In order: how records are declared; the records of a joint, a contact, and what acts on single
coordinates; the columns of a recorded row; `RUN` itself; and what Python fills these from.
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
"""Indices of the powers (`constants.POWERS`) in `RUN.power`, `RUN.work` and alike."""

(
    START_SPEED, ACCELERATION, MIDDLE, MIDDLE_SPEED, HALF, JERK, MEAN, PATH_ROWS,
) = range(8)  # fmt: skip
"""Rows of `RUN.path`, the predicted path of a macro step: velocity and acceleration at its start,
position and velocity in its middle, `half` at its start, its constant jerk, and the mean
acceleration of the last macro step."""

(
    SPEED, PUSH, BASE, ERROR, STEP, LAST, MARKS, INERTIA, TRIAL_ROWS,
) = range(9)  # fmt: skip
"""Rows of `RUN.trial`, the velocity solve (`solve`): the velocity tried, the forces at it, the
velocity without them, the residual, Newton's step, the velocity before that step, which coordinates
take part, and their inertias."""

MIN_APPROACH_SPEED = 1e-9
"""Keeps ddelta/ddelta0 defined where a contact begins with no depth and no speed [m/s]."""
STORED = 0.4
"""Energy stored in a contact over its elastic force times its depth: Hertz's, 1/(1 + 3/2)."""
SPEED_LIMIT = 1e4
"""Sum of all generalised speeds beyond which a run counts as run away [m/s and rad/s]."""
NO_VIRTUAL_LINK = -1
"""Value of `JOINT.first` where bearing and journal are reached through their frames instead of the
coordinates of a virtual link."""
POSE = 12
"""Numbers of a pose: the journal's centre and its orientation row by row, in the bearing frame."""

# Declaring records.

_INT, _FLOAT = np.int64, np.float64

Size = int | str
"""A number, the name of a field that has it, or such a field times a number: "3*nh"."""


@dataclass(frozen=True)
class Array:
    """An array whose address is a field of a record."""

    kind: np.dtype
    shape: tuple[Size, ...]
    """Shape that compiled code sees."""
    room: tuple[Size, ...]
    """Shape that is allocated, the largest that `shape` can become."""
    changes: bool
    """Whether a macro step of the multi-rate method changes it."""


ARRAYS: dict[np.dtype, dict[str, Array]] = {}
"""Declared arrays of each record, by the fields that point to them."""
ADDRESSES: dict[np.dtype, frozenset[str]] = {}
"""Names of all fields of each record that are addresses: of its arrays, of laws, of numbers."""
_ADDRESS = object()
"""Kind of a field that is an address, but not of an array declared here."""


def _array(
    kind: Any, *shape: Size, room: tuple[Size, ...] | None = None, changes: bool = False
) -> Array:
    return Array(np.dtype(kind), shape, shape if room is None else room, changes)


def _floats(*shape: Size, **options: Any) -> Array:
    return _array(_FLOAT, *shape, **options)


def _integers(*shape: Size) -> Array:
    return _array(_INT, *shape)


def _record(**fields: Any) -> np.dtype:
    """Declare a record. Fields are numbers, (kind, shape) for several, an `Array` or `_ADDRESS`."""
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
    """Split a size into a factor and the name of the field that it multiplies, if any."""
    if isinstance(size, int):
        return size, None
    factor, _, name = size.rpartition("*")
    return int(factor or 1), name


def extents(shape: Sequence[Size], record: np.ndarray) -> tuple[int, ...]:
    """Evaluate a shape with the sizes that a record has."""
    terms = map(term, shape)
    return tuple(factor if name is None else factor * int(record[name]) for factor, name in terms)


# Records of joints and contacts, of drives, gears, loads and bodies.

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
"""Fields of what acts between two frames, a joint or a load: bearing (first frame), journal."""

JOINT = _record(
    # Addresses of laws and their numbers.
    normal_law=_ADDRESS,
    friction_law=_ADDRESS,
    film_law=_ADDRESS,
    element_law=_ADDRESS,  # law of a whole joint, whose parameters are `dimensions`
    elements=_ADDRESS,  # its results: wrench, stiffness, ..., see `contact.resultant`
    dimensions=_ADDRESS,  # of the surfaces, for `geometry.touch`, or of `element_law`
    # Addresses of what is compiled apart (`access.PART`), where the joint has it.
    film_part=_ADDRESS,
    element_part=_ADDRESS,
    # Arrays.
    **_BETWEEN_FRAMES,
    sliding_work=_floats(2, "wearing", AZIMUTHS),  # of the bore, of the journal
    # What it is.
    resultant=_INT,  # whether one law gives the wrench of the whole joint (`rolling`)
    bristles=_INT,  # whether its friction law has bristles
    shape=_INT,  # `geometry.Shape`
    count=_INT,  # number of contacts
    first=_INT,  # first of the six coordinates of its virtual link, or `NO_VIRTUAL_LINK`
    must_not_touch=_INT,  # number of contacts, the first ones, that would break the film
    wearing=_INT,  # contacts whose sliding work is counted
    sections=_INT,  # of the film; 0 for none
    limit=_FLOAT,  # gap (negative) below which the journal has broken out [m]
    rest_mass=_FLOAT,  # whose impacts damping at rest is referred to [kg]
    friction_parameters=(_FLOAT, (MAX_PARAMETERS,)),
    # Film.
    section=_FLOAT,  # distance of the sections from the journal's centre [m]
    clearance=_FLOAT,
    thinnest=_FLOAT,  # eccentricity ratio at which the film is thinnest
    transition=_FLOAT,  # depth over which it fades [m]
    lag_mass=_FLOAT,  # mass that the lag of explicit steps keeps stable (`film`) [kg]
    film_parameters=(_FLOAT, (MAX_PARAMETERS,)),
    film_memory=(_FLOAT, (2, 5)),  # by section: force and velocity at the last step; whether known
    # Now.
    touching=_INT,  # whether it takes part in the velocity solve
    cage=_FLOAT,  # azimuth of the first element [rad]
    cage_start=_FLOAT,  # the same at the start of a Runge-Kutta step
    cage_sum=_FLOAT,  # weighted sum of its rates in that step so far
    pose=(_FLOAT, (POSE,)),  # of the journal in the bearing frame
    sines=(_FLOAT, (4,)),  # sine and cosine of yaw, of pitch
    twist=(_FLOAT, (6,)),  # velocity of the journal's centre, angular velocity, bearing frame
    wrench=(_FLOAT, (6,)),  # force and moment about the journal's centre, in the bearing frame
    film_wrench=(_FLOAT, (6,)),  # the film's part of it
    wrench_slope=(_FLOAT, (6, 6)),  # d(wrench)/d(twist)
    # For record and audit.
    mean_force=(_FLOAT, (3,)),  # over the stages of the last step, where there are stages
    mean_film_force=(_FLOAT, (3,)),
    impulse=(_FLOAT, (3,)),  # of the force, since the start [N s]
    peak=(_FLOAT, (3,)),  # largest force since the last record, and its square
    peak_square=_FLOAT,
)
"""One joint with clearance."""

CONTACT = _record(
    parameters=(_FLOAT, (MAX_PARAMETERS,)),  # of the normal-force law
    # Now: geometry, then the response to the velocity.
    touching=_INT,
    gap=_FLOAT,  # negative in contact [m]
    direction=(_FLOAT, (3,)),  # normal, from the bearing into the journal
    arm=(_FLOAT, (3,)),  # from the journal's centre to the contact point [m]
    elastic=_FLOAT,  # normal force at zero rate [N]
    rate=_FLOAT,  # of penetration [m/s]
    speed=_FLOAT,  # of sliding [m/s]
    normal_now=_FLOAT,
    tangential_now=_FLOAT,
    friction_power=_FLOAT,  # dissipated [W]
    mu=_FLOAT,
    friction=(_FLOAT, (3,)),
    slip=(_FLOAT, (3,)),  # sliding velocity
    approach=_FLOAT,  # largest rate since the contact began, this state's included [m/s]
    reference=_FLOAT,  # speed that damping is referred to, at least `approach` [m/s]
    bristle_now=(_FLOAT, (3,)),
    dwell_now=_FLOAT,
    # Memory of the contact that lasts.
    ddelta0=_FLOAT,  # `approach` at the last state of the trajectory
    steps=_FLOAT,  # since it began; 0 while there is none
    own_impulse=_FLOAT,  # normal impulse since it began [N s]
    bristle=(_FLOAT, (3,)),  # at `RUN.bent_at`
    dwell=_FLOAT,
    elapsed=_FLOAT,  # from the kept bristles to the state being evaluated [s]
    compliance=_FLOAT,  # inverse of the effective mass along the normal [1/kg]
    braking=_FLOAT,  # expected mean deceleration of an impact, measured as `RUN.braking`
    braking_end=_FLOAT,  # time until which it is expected [s]
    # For record and audit.
    mean_normal=_FLOAT,  # over the stages of the last step, where there are stages
    mean_friction=(_FLOAT, (3,)),
    normal=_FLOAT,  # forces to be recorded [N]
    tangential=_FLOAT,
    normal_peak=_FLOAT,  # since the last record
    gap_min=_FLOAT,  # since the last record
    onsets=_FLOAT,  # number of contacts begun
    ended=_FLOAT,  # number of contacts ended; of these
    shortest=_FLOAT,  # the fewest steps of one
    under=_FLOAT,  # the number of those with too few steps to be resolved
    impulse=_FLOAT,  # normal impulse since the start [N s]
    impulse_under=_FLOAT,  # its part in contacts that were not resolved
    deepest=_FLOAT,  # smallest gap since the start [m]
    fastest=_FLOAT,  # fastest approach of a contact that has ended [m/s]
)
"""One place where a joint's journal and bearing can touch."""

DRIVE_ROW = _record(
    column=_INT,  # of the reference
    coordinate=_INT,  # on which it acts
    encoder=_INT,  # coordinate that its encoder measures
    kp=_FLOAT,
    kd=_FLOAT,
    armature=_FLOAT,  # > 0 prescribes the motion
    limit=_FLOAT,  # largest effort, infinite for none; not of prescribed motion
    implicit=_INT,  # whether its damping is part of the velocity solve
    taken_at=_FLOAT,  # speed of the encoder at which its effort was found
)
"""A drive: position and speed feedback with feed-forward, or prescribed motion."""

SERVO = _record(
    column=_INT,  # of the reference
    coordinate=_INT,  # on which it acts
    encoder=_INT,  # coordinate that its encoder measures
    stall=_FLOAT,  # effort per voltage at rest
    p_gain=_FLOAT,
    i_gain=_FLOAT,
    d_gain=_FLOAT,
    differences=_INT,  # whether the D term takes the speed from differences of readings
    dead_band=_FLOAT,
    resolution=_FLOAT,  # of its encoder, 0 for none
    voltage=_FLOAT,  # largest
    limit=_FLOAT,  # largest effort, infinite for none
    period=_FLOAT,  # between samples, 0 for a continuous controller
    next_sample=_FLOAT,  # time [s]
    sampled_at=_FLOAT,  # time of the last sample [s]
    held=_FLOAT,  # voltage since the last sample
    held_before=_FLOAT,  # voltage before it
    # State of the I and the D term, now and at the last state of the trajectory or sample.
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
    stiction=_FLOAT,  # excess of the friction at rest over Coulomb's
    stribeck=_FLOAT,  # speed of the Stribeck curve
    viscous=_FLOAT,
    presliding=_FLOAT,  # deflection of its bristles at breakaway, 0 for none
    damping=_FLOAT,  # of the bristles
    bend=_FLOAT,  # deflection of the bristles now
    kept_bend=_FLOAT,  # deflection at `RUN.bent_at`
    torque=_FLOAT,
)
"""Friction of one joint; see `kernel.drive`."""

GEAR_ROW = _record(
    motor=_INT,  # coordinates of the motor and of the joint
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
    driving_loss=_FLOAT,  # friction per torque held where the motor drives
    driven_loss=_FLOAT,  # the same where the joint drives the motor
    # Now.
    twist=_FLOAT,
    lever=_FLOAT,  # turn of the joint per turn of the motor at constant twist
    elastic=_FLOAT,  # torque, without sign
    hysteresis=_FLOAT,  # torque of the bristles
    torque=_FLOAT,  # transmitted to the joint
    # At the last state of the trajectory.
    last_twist=_FLOAT,
    last_hysteresis=_FLOAT,
)
"""One gear; see `kernel.gear`."""

BODY = _record(
    parent=_INT,  # index among the bodies; 0 is the ground
    coordinate=_INT,
    slides=_INT,  # 1: it slides along its z axis; 0: it turns about it
    turn=(_FLOAT, (9,)),  # orientation in the parent at coordinate zero, row by row
    shift=(_FLOAT, (3,)),  # origin in the parent at coordinate zero
    # Now, in the world.
    rotation=(_FLOAT, (9,)),  # column by column
    origin=(_FLOAT, (3,)),
    omega=(_FLOAT, (3,)),  # angular velocity
    alpha=(_FLOAT, (3,)),  # angular acceleration at constant generalised speeds
    lift=(_FLOAT, (3,)),  # acceleration of the origin at constant generalised speeds
)
"""One body that a coordinate moves."""

HOLD = _record(body=_INT, partner=_INT, place=(_FLOAT, (3,)), partner_place=(_FLOAT, (3,)))
"""Two points of two bodies that a loop without clearance holds together."""

LOAD = _record(
    law=_ADDRESS,
    numbers=_ADDRESS,  # the law's p
    place=_floats("ninputs"),  # x; `pose` between frames
    rate=_floats("nrates"),  # dx; `twist` between frames
    out=_floats("nanswers"),  # efforts now; `wrench` between frames
    elastic=_floats(2, "nanswers"),  # efforts at rest, if it stores energy; scratch room
    inputs=_integers("ninputs"),  # coordinates that the law reads
    outputs=_integers("noutputs"),  # coordinates on which it acts
    bounds=_floats("nbounds"),  # largest efforts on these, if they are limited
    **_BETWEEN_FRAMES,  # of its first and its second frame
    # What it is.
    frames=_INT,  # 1: it acts between two frames; 0: on coordinates
    ninputs=_INT,
    noutputs=_INT,
    nrates=_INT,
    nanswers=_INT,
    nbounds=_INT,
    stores=_INT,  # whether its effort at rest is the gradient of an energy
    implicit=_INT,  # when the rest depends on velocity: `constants.NEVER`, `ALWAYS`, `IF_PRESSED`
    # Now.
    active=_INT,  # whether it takes part in the velocity solve
    pose=(_FLOAT, (POSE,)),
    twist=(_FLOAT, (6,)),
    wrench=(_FLOAT, (6,)),
    wrench_slope=(_FLOAT, (6, 6)),
    power=_FLOAT,  # of the load, or of its dissipative part if it stores energy [W]
    before=_FLOAT,  # power at the start of the step [W]
    work=_FLOAT,  # since the start [J]
    gathered=_FLOAT,  # work in a Runge-Kutta step so far [J]
)
"""One load whose law is called by address; see `load`."""

# A recorded row.

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
"""Quantities of a recorded row, in order, and their shapes in terms of the run's sizes."""


class Quantity(NamedTuple):
    """Columns of a quantity in the records of a run, and its shape."""

    columns: slice
    shape: tuple[int, ...]

    def of(self, rows: np.ndarray) -> np.ndarray:
        """Values of the quantity in records (n, columns), shape (n, *shape)."""
        return rows[:, self.columns].reshape(len(rows), *self.shape)


(
    TIME, Q, V, DRIVE_EFFORT, WORK, FORCE, FORCE_PEAK, FILM_FORCE, NORMAL_FORCE, TANGENTIAL_FORCE,
    NORMAL_PEAK, GAP_MIN, CAGE, GEAR_TORQUE, BRISTLE_TORQUE, LOAD_FORCE, LOAD_WORK,
) = range(len(ROW))  # fmt: skip
"""Indices of these quantities in `RUN.columns`."""

RUN = _record(
    # The state and what acts on it.
    q=_floats("nv", changes=True),
    v=_floats("nv", changes=True),
    half=_floats("nv", changes=True),  # velocities half a step ago
    a=_floats("nv", changes=True),  # accelerations; for single-rate methods Pinocchio's
    tau=_floats("nv", changes=True),  # generalised forces; multi-rate: without `velocity_forces`
    angular=_floats("nv"),  # 1 for angles, 0 for lengths
    inertia=_floats("nv"),  # of each coordinate alone, 1/(M^-1)_ii at the last middle
    weights=_floats("nv"),  # 0 for prescribed coordinates, whose armature is no real inertia
    drive=_floats("nv", changes=True),  # efforts of the drives
    velocity_forces=_floats("nv", changes=True),  # forces tau_c that depend on velocity (`solve`)
    # M^-1 tau_c: the last, its rate of change, the one before, its second divided difference.
    pushed=_floats(4, "nv", changes=True),
    load_forces=_floats("nv", changes=True),  # forces of loads that do not depend on velocity
    # Inverse of the mass matrix M^-1, and free acceleration: that without any force found here.
    minv=_floats("nv", "nv", changes=True),  # now
    free=_floats("nv", changes=True),
    minv_rate=_floats("nv", "nv", changes=True),  # their rates along the present chord
    free_rate=_floats("nv", changes=True),
    minv_middle=_floats("nv", "nv"),  # at the last middle of a macro step
    free_middle=_floats("nv"),
    minv_slope=_floats("nv", "nv"),  # first and second divided differences of the middles
    free_slope=_floats("nv"),
    minv_curve=_floats("nv", "nv"),
    free_curve=_floats("nv"),
    found_minv=_floats("nv", "nv"),  # Pinocchio's, its upper triangle, ideal loops closed
    found_free=_floats("nv"),  # Pinocchio's, ideal loops closed
    path=_floats(PATH_ROWS, "nv"),  # predicted path of the macro step
    # The velocity solve on the `active` coordinates.
    slope=_floats("active", "active", room=("nv", "nv")),  # d(tau_c)/dv
    compliance=_floats("active", "active", room=("nv", "nv")),  # M^-1 of these, if they are not all
    inverse=_floats(  # transposed inverse of the last Newton matrix, of `factored` coordinates
        "active", "active", room=("nv", "nv"), changes=True
    ),
    trial=_floats(TRIAL_ROWS, "nv"),
    scratch=_floats("nv"),
    stages=_floats(4, "nv"),  # of Runge-Kutta: q, v at the step's start, weighted sums of v, a
    # Adaptive micro steps.
    earlier_a=_floats(3, "nv", changes=True),  # accelerations at the last two states; scratch room
    row_before=_floats("record_columns"),  # rows of the two states between which records are
    row_after=_floats("record_columns"),  # interpolated
    copies=_integers("ncopies", 3),  # addresses of an array and its copy, length in 8-byte words
    # Bodies and loops.
    world_jacobian=_floats("nv", 6),  # columns of Pinocchio's data.J, or of `frames.place_bodies`
    open_minv=_floats("nv", "nv"),  # Pinocchio's M^-1 and free acceleration of the open tree,
    open_free=_floats("nv"),  # if there are `holds`
    loop_rows=_floats("3*nh", "nv"),  # constraint Jacobian; see `loops`
    loop_residual=_floats(2, "3*nh"),
    loop_correction=_floats(2, "nv"),
    loop_minv=_floats("nv", "nv"),
    # Inputs and records.
    reference=_floats("nref", 3, "nu"),  # positions, speeds and feed-forward efforts by node
    record=_floats("rows", "record_columns"),
    windows=_floats("nwindows", 2),  # first and last of the steps all of which are recorded
    touched=_integers("nv"),  # coordinates of the velocity solve
    exchanged=_integers("nv"),  # rows exchanged when `inverse` was found
    place=_integers("nv"),  # index of each coordinate in `touched`
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
    nv=_INT,  # coordinates
    nj=_INT,  # joints with clearance
    width=_INT,  # most contacts of a joint
    nu=_INT,  # driven coordinates, the columns of the reference
    nd=_INT,  # drives
    nf=_INT,  # joints with friction of their own
    bristled=_INT,  # those of them with bristles
    ns=_INT,  # servos
    ng=_INT,  # gears
    nl=_INT,  # loads
    nb=_INT,  # bodies, the ground included; 0 if none need be placed
    nh=_INT,  # held pairs of points
    nref=_INT,  # nodes of the reference
    record_columns=_INT,
    cages=_INT,  # cages recorded: of all joints if one of them is a rolling bearing
    load_columns=_INT,  # efforts of all loads recorded
    nwindows=_INT,
    ncopies=_INT,
    # How to go on.
    record_every=_INT,  # steps between records
    until=_INT,  # step that no macro step goes beyond
    suggested=_INT,  # length that the next macro step should have [steps]
    longest=_INT,  # macro step [steps]
    unit=_INT,  # macro steps are multiples of this, unless one is shorter from the outset
    fixed=_INT,  # whether their length is given
    macro=_INT,  # planned length of the macro step [steps]
    rows=_INT,  # room for records
    fresh=_INT,  # whether the state is the first, to which no step has led
    through_frames=_INT,  # whether any joint is reached through Pinocchio's frames
    prescribed=_INT,  # whether any coordinate's motion is prescribed
    dt=_FLOAT,  # time step [s]
    dt_before=_FLOAT,  # length of the last micro step [s]
    reference_interval=_FLOAT,  # between nodes of the reference [s]
    # Where the run is.
    step=_INT,
    row=_INT,  # records written
    stage=_INT,  # of a Runge-Kutta step
    status=_INT,  # `constants.Status`
    bad_contact=_INT,  # joint*width + contact, or load, that stopped the run
    pending=_INT,  # whether the works of the last step have yet to be completed
    commit=_INT,  # whether forces are evaluated at a state of the trajectory, not at a stage
    known_middles=_INT,  # middles that the parabola of M^-1 goes through, up to 3
    known_free=_INT,  # the same of the free acceleration: those since velocities jumped
    refused=_INT,  # whether a macro step is to be planned anew
    macros=_INT,  # macro steps done
    touching=_INT,  # joints with a contact that touches
    active=_INT,  # coordinates of the velocity solve
    events=_INT,  # contacts that have begun or ended in this macro step
    factored=_INT,  # coordinates of the matrix in `inverse`
    averaged=_INT,  # whether a step has stages, whose mean forces are recorded
    unsolved=_INT,  # velocity solves that did not converge
    unresolved=_INT,  # shortest micro steps whose error was not tolerable
    known_a=_INT,  # states of `earlier_a` since accelerations jumped, up to 2
    iterations=_INT,  # trial velocities of all velocity solves
    solves=_INT,  # velocity solves
    pushed_bends=_INT,  # whether `pushed` is extrapolated by a parabola, else by a line
    pushed_dt=_FLOAT,  # between the last two values of `pushed` [s]
    time=_FLOAT,
    bent_at=_FLOAT,  # time at which bristles are kept [s]: half a step after the last state
    evaluated_at=_FLOAT,  # time of the state that the multi-rate method evaluated last [s]
    load_time=_FLOAT,  # time of the state that `singlerate.evaluate_forces` evaluates [s]
    path_start=_FLOAT,  # time at which the predicted path begins [s]
    path_span=_FLOAT,  # its duration [s]
    fastest=_FLOAT,  # largest speed of an angle [rad/s]
    departure=_FLOAT,  # of angles from the predicted path, about [rad]
    departure_limit=_FLOAT,  # departure beyond which a macro step ends [rad]
    tolerance=_FLOAT,  # of `path_error`
    middle_time=_FLOAT,  # time of the last middle [s]
    mean_time=_FLOAT,  # time to which the last mean acceleration in `path` belongs [s]
    middles_apart=_FLOAT,  # between the last two middles [s]
    chord_end=_FLOAT,  # time until which `minv_rate` and `free_rate` hold [s]
    micro_tolerance=_FLOAT,  # of micro steps, see `adaptive`
    shortest_micro=_FLOAT,  # shortest micro step [s]
    longest_micro=_FLOAT,  # micro step that springs, gears and drives allow [s]
    stable_micro=_FLOAT,  # micro step that follows the contacts that touch now [s]
    refused_at=_FLOAT,  # time of the state from which a micro step was refused [s]
    refused_step=_FLOAT,  # length of the shorter step to be tried from there [s]
    refused_length=_FLOAT,  # length of the first step refused there [s]
    retried_at=_FLOAT,  # time of the state from which a step was refused last [s]
    micro_step=_FLOAT,  # micro step that the last error suggests [s]
    earlier_dt=_FLOAT,  # between the states of `earlier_a` [s]
    # Sizes of accelerations: the root of twice the kinetic energy of a, a taken as a velocity.
    braking=_FLOAT,  # largest deceleration by impacts under way
    moved=_FLOAT,  # acceleration by forces and inertia at the last state
    moved_by_forces=_FLOAT,  # acceleration by `velocity_forces` alone, at this state
    path_error=_FLOAT,  # of the acceleration at the middle of the path, relative
    work=(_FLOAT, (len(POWERS),)),  # since the start [J]
    before=(_FLOAT, (len(POWERS),)),  # powers at the start of the step [W]
    power=(_FLOAT, (len(POWERS),)),  # powers now [W]
    stage_work=(_FLOAT, (len(POWERS),)),  # work in a Runge-Kutta step so far [J]
    columns=(_INT, (len(ROW),)),  # first column of each quantity of `ROW`
    law_numbers=(_FLOAT, (max(BRISTLE_NUMBERS, FILM_NUMBERS),)),  # results of the last such law
)
"""Everything about one run."""


# What Python fills these records from: joints with clearance, loads, drives, friction and gears.

Carriers = tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]
"""Two Pinocchio joints, and the placement of a frame in each."""


@dataclass(frozen=True)
class JointSite:
    """One joint with clearance, ready for the kernels."""

    record: np.ndarray
    """A record `JOINT`, shape (1,); the workspace sets its addresses of arrays."""
    parameters: np.ndarray
    """Parameters of the normal-force law of each contact, shape (contacts, `MAX_PARAMETERS`)."""
    dimensions: tuple[float, ...]
    """Dimensions of its surfaces, as `geometry.touch` takes them [m], or numbers of its law."""
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
"""Index of a body, and a frame's rotation, row by row, and origin in it, shape (12,)."""


@dataclass(frozen=True)
class LoadSite:
    """One load (`kernel.load`), on coordinates or between two frames, ready for the kernels."""

    law: int
    """Address of its law."""
    numbers: np.ndarray
    """Numbers p of the law, read in place: the law sees what is written here later."""
    stores: bool = False
    """Whether its effort at rest is the gradient of an energy."""
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
    """Coordinates that move one frame and not the other, as in a `JointSite`."""

    @property
    def size(self) -> int:
        """How many efforts the law gives."""
        return len(self.outputs) if self.carriers is None else 6


@dataclass(frozen=True)
class CoordinateTables:
    """Records of what acts on single coordinates, and the reference that drives follow."""

    drives: np.ndarray
    """Records `DRIVE_ROW`, see `drive_row`."""
    servos: np.ndarray
    """Records `SERVO`."""
    frictions: np.ndarray
    """Records `FRICTION_ROW`."""
    gears: np.ndarray
    """Records `GEAR_ROW`."""
    reference: np.ndarray
    """Rows of q, v and feed-forward effort of the nu driven coordinates, shape (nref, 3 nu),
    nref >= 2."""
    interval: float
    """Time between the rows of `reference` [s]."""
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
    """Make the record of the drive of one coordinate, shape (1,).

    Args:
        column: column of the reference that it follows.
        coordinate: coordinate on which it acts.
        encoder: coordinate that its encoder measures; None: its own.
        kp, kd: gains [N m/rad, N m s/rad, or N/m, N s/m].
        armature: > 0 prescribes the motion; the model must have this armature [kg m^2 or kg].
        limit: effort at which it saturates [N m or N].
    """
    encoder = coordinate if encoder is None else encoder
    values = (column, coordinate, encoder, kp, kd, armature, limit, 0, 0.0)
    return np.array([values], DRIVE_ROW)


def friction_row(coordinate: int, **fields: float) -> np.ndarray:
    """Make the record of a joint's friction, shape (1,), from fields of `FRICTION_ROW`."""
    row = np.zeros(1, FRICTION_ROW)
    row["coordinate"], row["stribeck"] = coordinate, 1.0
    for name, value in fields.items():
        row[name] = value
    return row


def gear_row(**fields: Any) -> np.ndarray:
    """Make the record of a gear, shape (1,), from fields of `GEAR_ROW`; lists may be shorter."""
    row = np.zeros(1, GEAR_ROW)
    row["bend_twists"], row["presliding"], row["lever"] = np.inf, 1.0, 1.0
    for name, value in fields.items():
        if np.ndim(value):
            row[name][0, : len(value)] = value
        else:
            row[name] = value
    return row


def stacked(rows: Sequence[np.ndarray], kind: np.dtype) -> np.ndarray:
    """Join records of one kind; an empty array if there are none."""
    return np.concatenate(rows) if rows else np.zeros(0, kind)
