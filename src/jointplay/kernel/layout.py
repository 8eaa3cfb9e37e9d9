"""What the compiled code knows of a run: records of named fields.

A compiled call costs about 0.1 us for every array it is given. The kernels are therefore given one
record, `RUN`, which holds numbers, and addresses of the arrays and of the other records;
`Workspace` fills it in, and the functions of `access` open what it points to.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jointplay.contact.compiled import MAX_PARAMETERS
from jointplay.contact.law import BRISTLE_NUMBERS, FILM_NUMBERS
from jointplay.kernel.words import GEAR_BENDS, GEAR_ORDERS, POWERS

DRIVE, NORMAL, FRICTION, JOINT_FRICTION, GEAR, FILM = range(len(POWERS))
"""Places of the powers in `RUN`'s arrays."""

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


def _record(**fields: Any) -> np.dtype:
    kinds = [
        (name, kind) if not isinstance(kind, tuple) else (name, *kind)
        for name, kind in fields.items()
    ]
    return np.dtype(kinds, align=True)


RUN = _record(
    # Addresses of arrays of floats, their shapes behind them.
    q=_INT,  # (nv,)
    v=_INT,  # (nv,)
    half=_INT,  # (nv,) velocities half a step ago
    a=_INT,  # (nv,) accelerations; for single-rate methods Pinocchio's
    tau=_INT,  # (nv,)
    angular=_INT,  # (nv,) 1 for angles, 0 for lengths
    weights=_INT,  # (nv,) 0 for prescribed coordinates, whose inertia is no real one
    drive=_INT,  # (nv,) efforts of the drives
    velocity_forces=_INT,  # (nv,) generalised forces of what depends on velocity
    pushed=_INT,  # (3, nv) accelerations by these forces; how fast they changed; those before
    load_forces=_INT,  # (nv,) of the loads' part that does not
    minv=_INT,  # (nv, nv) inverse of the mass matrix now; then
    free=_INT,  # (nv,) acceleration without any of the forces reckoned here
    minv_rate=_INT,
    free_rate=_INT,  # their rates along the present chord; then as of the last middle
    minv_middle=_INT,
    free_middle=_INT,
    minv_slope=_INT,  # first and second divided differences of the middles
    free_slope=_INT,
    minv_curve=_INT,
    free_curve=_INT,
    found_minv=_INT,  # (nv, nv) Pinocchio's, its upper triangle, loops without clearance closed
    found_free=_INT,  # (nv,) likewise
    path=_INT,  # (9, nv) see `path`
    # The velocity solve, its arrays used for the n coordinates that take part.
    slope=_INT,  # (n, n) of d(velocity_forces)/dv
    compliance=_INT,  # (n, n) of `minv`, unless these are all
    inverse=_INT,  # (n, n), transposed, of the last matrix, of `factored` coordinates
    trial=_INT,  # (8, nv) see `solve`
    scratch=_INT,  # (4 nv + powers,) of Runge-Kutta
    # Adaptive micro steps.
    earlier_a=_INT,  # (3, nv) accelerations at the last two states; room
    row_before=_INT,  # (columns,) records of the states that others are interpolated between
    row_after=_INT,
    copies=_INT,  # (ncopies, 3) addresses of an array and of its copy, length in 8-byte words
    jacobian=_INT,  # (6, nv) column by column: Pinocchio's data.J, or of `bodies`
    open_minv=_INT,  # (nv, nv) and (nv,) Pinocchio's without loops, if there are `holds`
    open_free=_INT,
    loop_rows=_INT,  # see `loops`: (3 nh, nv)
    loop_residual=_INT,  # (2, 3 nh)
    loop_correction=_INT,  # (2, nv)
    loop_minv=_INT,  # (nv, nv)
    reference=_INT,  # (nref, 3 nu)
    record=_INT,  # (rows, columns)
    windows=_INT,  # (nwindows, 2) steps from which and to which every step is recorded
    # Addresses of whole numbers and records.
    touched=_INT,  # (nv,) coordinates of the velocity solve
    exchanged=_INT,  # (nv,) rows exchanged when `inverse` was found
    place=_INT,  # (nv,) places of the coordinates among them
    joints=_INT,
    contacts=_INT,
    drives=_INT,
    servos=_INT,
    frictions=_INT,
    gears=_INT,
    refined_gears=_INT,
    loads=_INT,
    bodies=_INT,
    holds=_INT,
    # Sizes.
    nv=_INT,
    nj=_INT,
    width=_INT,
    nu=_INT,
    nd=_INT,
    nf=_INT,
    ns=_INT,
    ng=_INT,
    nr=_INT,
    nl=_INT,
    nb=_INT,  # bodies, the ground among them; 0 if none need be placed
    nh=_INT,
    nref=_INT,
    record_columns=_INT,
    cages=_INT,  # recorded: all joints if one of them is a rolling bearing
    nwindows=_INT,
    ncopies=_INT,
    # How to go on.
    every=_INT,
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
    time=_FLOAT,
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
    law_numbers=(_FLOAT, (max(BRISTLE_NUMBERS, FILM_NUMBERS),)),
)
"""Everything about one run."""

JOINT = _record(
    # Addresses.
    normal_law=_INT,
    friction_law=_INT,
    film_law=_INT,
    dimensions=_INT,
    support=_INT,  # (nsupport,) coordinates that move journal and bearing against each other
    signs=_INT,  # (nsupport,) +1 for those that move the journal, -1 for the bearing
    jacobian=_INT,  # (6, nsupport) motion of the journal per velocity of these coordinates
    bearing_rotation=_INT,
    bearing_translation=_INT,
    journal_rotation=_INT,
    journal_translation=_INT,
    sliding_work=_INT,
    element_law=_INT,  # of a rolling bearing, whose numbers are `dimensions`; and
    elements=_INT,  # what it answers, see `contact.rolling`
    # What it is.
    resultant=_INT,  # whether a law answers for all of it (`rolling`)
    bristles=_INT,
    shape=_INT,
    count=_INT,
    first=_INT,
    nsupport=_INT,
    must_not_touch=_INT,
    wearing=_INT,
    sections=_INT,  # of the film; 0 for none
    limit=_FLOAT,  # gap at which the journal has broken out [m]
    rest_mass=_FLOAT,  # whose impacts damping at rest is referred to [kg]
    friction_parameters=(_FLOAT, (MAX_PARAMETERS,)),
    bearing_placement=(_FLOAT, (12,)),  # rotation row by row, translation
    journal_placement=(_FLOAT, (12,)),
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
    force=(_FLOAT, (3,)),
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
    d_gain=_FLOAT,
    dead_band=_FLOAT,
    resolution=_FLOAT,  # of its encoder, 0 for none
    voltage=_FLOAT,  # largest
    limit=_FLOAT,  # of the effort, infinite for none
    period=_FLOAT,  # of its samples, 0 for none
    next_sample=_FLOAT,
    sampled_at=_FLOAT,
    held=_FLOAT,  # voltage since the last sample, and before it
    held_before=_FLOAT,
)
"""The controller of one servo; see `kernel.servo`."""

FRICTION_ROW = _record(
    coordinate=_INT, coulomb=_FLOAT, stiction=_FLOAT, stribeck=_FLOAT, viscous=_FLOAT
)
GEAR_ROW = _record(motor=_INT, link=_INT, half_play=_FLOAT, stiffness=_FLOAT, damping=_FLOAT)
REFINED_GEAR = _record(
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
"""One gear that is more than play, a spring and a damper; see `kernel.gear`."""

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

HOLD = _record(one=_INT, other=_INT, place=(_FLOAT, (3,)), other_place=(_FLOAT, (3,)))
"""Two points of two bodies that a loop without clearance holds together."""

LOAD = _record(
    # Addresses.
    law=_INT,
    numbers=_INT,  # the law's p
    place=_INT,  # x: of `pose`, or (ninputs,)
    rate=_INT,  # dx: of `twist`, or (ninputs,)
    out=_INT,  # of `wrench`, or (noutputs,)
    elastic=_INT,  # (2, noutputs or 6) what it answers at rest, if it stores energy; room
    inputs=_INT,  # (ninputs,) coordinates
    outputs=_INT,  # (noutputs,)
    bounds=_INT,  # (noutputs,) largest efforts
    support=_INT,  # of frames, as in `JOINT`, with all that follows
    signs=_INT,
    jacobian=_INT,
    bearing_rotation=_INT,
    bearing_translation=_INT,
    journal_rotation=_INT,
    journal_translation=_INT,
    # What it is.
    frames=_INT,  # whether it acts between two frames; else on coordinates
    nsupport=_INT,
    ninputs=_INT,
    noutputs=_INT,
    stores=_INT,  # whether its answer at rest is the slope of an energy
    implicit=_INT,  # whether the rest of it depends on velocity: NEVER, ALWAYS, IF_PRESSED
    bounded=_INT,
    bearing_placement=(_FLOAT, (12,)),
    journal_placement=(_FLOAT, (12,)),
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
