"""Every kind of joint: energy, momentum, and the limits in which kinds must agree."""

from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import jointplay as jp
from jointplay.model.loop import Loop
from jointplay.physics.joints import CylindricalClearance, PrismaticClearance, SphericalClearance
from jointplay.physics.kernel import Status

PLAY = 2e-4
FREE = {"drive": {}, "joint_friction": {}}
ELASTIC = {"normal": jp.contact.Hertz(), "restitution": 1.0, "friction": jp.contact.Ambrosio(0.0)}
ROUGH = {"normal": jp.contact.Hertz(), "friction": jp.contact.Ambrosio(0.2)}
LOCAL = ("x", "y", "z", "yaw", "pitch", "roll")


def revolute(**fields):
    return jp.RevoluteClearance(**({"radial_clearance": PLAY, "axial_clearance": PLAY} | fields))


def planar(**fields):
    return jp.RevoluteClearance.planar(**({"radial_clearance": PLAY} | fields))


def ball(**fields):
    return SphericalClearance(**({"radial_clearance": PLAY} | fields))


def slider(**fields):
    return PrismaticClearance(**({"clearance": PLAY, "clearance_y": 1.5 * PLAY} | fields))


def rod(**fields):
    return CylindricalClearance(**({"radial_clearance": PLAY} | fields))


def groove(**fields):
    """A slot in which the pin meets both walls and the ends, all equally stiff."""
    points = [(-5e-5, 0.0), (1e-4, 0.0)]
    return jp.GrooveClearance(
        **({"points": points, "wall_clearance": PLAY, "stiffness": 1e10} | fields)
    )


KINDS = {
    "full": revolute,
    "tilt locked": lambda **f: revolute(lock_tilt=True, **f),
    "axial locked": lambda **f: revolute(lock_axial=True, **f),
    "planar": planar,
    "open ends": lambda **f: revolute(open_ends=True, **f),
    "exchanged": lambda **f: revolute(exchanged=True, **f),
    "ball": ball,
    "exchanged ball": lambda **f: ball(exchanged=True, **f),
    "slider": slider,
    "planar slider": lambda **f: slider(planar=True, **f),
    "parallel slider": lambda **f: slider(lock_tilt=True, **f),
    "exchanged slider": lambda **f: slider(exchanged=True, **f),
    "rod": rod,
    "exchanged rod": lambda **f: rod(exchanged=True, **f),
    "groove": groove,
    "exchanged groove": lambda **f: groove(exchanged=True, **f),
}
TYPES = {
    "revolute": "revolute",
    "spherical": "floating",
    "prismatic": "prismatic",
    "cylindrical": "floating",
    "groove": "floating",
}
kinds = pytest.mark.parametrize("make", KINDS.values(), ids=KINDS.keys())


@pytest.fixture
def thrown(urdf):
    """A run of one body that only `clearance` holds to the ground; rates of what is free."""

    def prepare(clearance, rates, start=None, *, mass=2.0, com="0.03 0.02 0.01", **options):
        kind = TYPES[clearance.kind]
        path = urdf(body("arm", mass, com, 1e-2), joint("pin", "base", "arm", kind))
        robot = jp.Mechanism(path, {"pin": clearance}, gravity=(0, 0, 0))
        options = {"duration": 5e-3, "step": 1e-6, "integrator": "rk4", "record_every": 1} | options
        run = jp.Run(jp.Simulation(robot, **FREE, **options))
        for name, value in (start or {}).items():
            if name in clearance.freedoms:
                run.workspace.q[robot.coordinates.index(f"pin.{name}")] = value
        for name, value in rates.items():
            if name in clearance.freedoms:
                run.workspace.v[robot.coordinates.index(f"pin.{name}")] = value
        return run

    return prepare


RATES = {"x": 0.25, "y": -0.15, "z": 0.2, "yaw": 2.0, "pitch": 3.0, "roll": -2.0}


def stored(result, clearance, factor=0.4):
    """2/5 k delta^(5/2) over all contacts, reckoned here."""
    depth = np.maximum(-result["gap"].values[:, 0], 0.0)
    return factor * clearance.hertz_stiffness * (depth**2.5).sum(axis=1)


@kinds
def test_elastic_contact_of_every_kind_keeps_the_energy(thrown, make):
    clearance = make(**ELASTIC)
    errors = []
    for step in (8e-6, 1e-6):
        result = thrown(clearance, RATES, step=step).finish()
        assert result.audit.impacts > 2
        kinetic = result["kinetic_energy"].values
        total = kinetic + stored(result, clearance)
        errors.append(np.abs(total / total[0] - 1.0).max())
        assert not result["normal_dissipation"].values.any()
        assert not result["friction_dissipation"].values.any()
    assert kinetic.min() < 0.9 * kinetic[0]  # the energy truly goes into the contact and back
    assert np.abs((kinetic + stored(result, clearance, 0.5)) / kinetic[0] - 1.0).max() > 0.02
    assert errors[1] < 1e-5
    assert errors[1] < 0.1 * errors[0]


@kinds
@pytest.mark.parametrize("normal", [jp.contact.Hertz(), jp.contact.LankaraniNikravesh()])
def test_friction_of_every_kind_only_takes(thrown, make, normal):
    clearance = make(normal=normal, friction=jp.contact.Ambrosio(0.2), restitution=0.7)
    result = thrown(clearance, RATES).finish()
    taken = result["friction_dissipation"].values
    assert np.diff(taken).min() >= 0.0
    kinetic = result["kinetic_energy"].values
    assert taken[-1] > 1e-3 * kinetic[0]
    lost = taken + result["normal_dissipation"].values
    balance = kinetic + stored(result, clearance) + lost
    assert np.abs(balance / kinetic[0] - 1.0).max() < 1e-4


SLIDERS = (
    '<link name="a"/><link name="b"/>',
    body("one", 3.0, "0.02 0 0.1"),
    joint("sx", "base", "a", "prismatic", "1 0 0"),
    joint("sy", "a", "b", "prismatic", "0 1 0"),
    joint("sz", "b", "one", "prismatic", "0 0 1"),
)


@kinds
def test_force_and_reaction_of_every_kind_cancel(urdf, make):
    """The pair flies freely: its momentum is conserved to rounding, for it is linear in v."""
    clearance = make()
    kind = TYPES[clearance.kind]
    skew = {"at": "0.1 0 0.05", "rpy": "0.3 -0.2 0.5", "axis": "0.6 0 0.8"}
    path = urdf(*SLIDERS, body("two", 2.0, "0 0 0"), joint("pin", "one", "two", kind, **skew))
    robot = jp.Mechanism(path, {"pin": clearance}, gravity=(0, 0, 0))
    run = jp.Run(
        jp.Simulation(robot, **FREE, duration=6e-3, step=4e-6, integrator="rk4", record_every=5)
    )
    run.workspace.v[:3] = [0.1, -0.2, 0.05]
    for name in clearance.freedoms:
        run.workspace.v[robot.coordinates.index(f"pin.{name}")] = RATES[name]
    result = run.finish()
    assert result.audit.impacts > 2
    momenta, alone = [], []
    for q, v in zip(result["q"].values, result["v"].values, strict=True):
        pin.computeCentroidalMomentum(robot.model, robot.data, q, v)
        momenta.append(robot.data.hg.linear.copy())
        alone.append(3.0 * v[:3])
    momenta = np.array(momenta)
    # Where a lock carries more than contact does, it is internal too.
    assert np.abs(momenta - momenta[0]).max() < 1e-6 * np.linalg.norm(momenta[0])
    assert np.abs(np.array(alone) - alone[0]).max() > 1e-2 * np.linalg.norm(momenta[0])


# Limits


def test_untilted_journal_is_two_planar_ones_in_parallel(thrown):
    """Two rims of k each: the same motion as one line of 2 k, and not as one of k."""
    soft, hard = revolute(stiffness=1e10, **ROUGH), planar(stiffness=2e10, **ROUGH)
    rates = {"x": 0.3, "y": 0.1, "yaw": 5.0}
    start = {"x": 1e-4}
    runs = [thrown(c, rates, start, com="0 0 0").finish() for c in (soft, hard, planar(**ROUGH))]
    full, line, wrong = (run["journal_centre"].values[:, 0, :2] for run in runs)
    assert runs[0].audit.impacts == 2 * runs[1].audit.impacts > 3
    assert np.abs(full - line).max() < 1e-9
    assert np.abs(full - wrong).max() > 1e-6
    force = [run["joint_force"].values[:, 0] for run in runs]
    assert np.abs(force[0] - force[1]).max() < 1e-3 * np.abs(force[1]).max()
    rims = runs[0]["normal_force"].sel(contact=["radial_A", "radial_B"]).values[:, 0]
    assert rims.sum(axis=1).max() == pytest.approx(2.0 * rims[:, 0].max())
    assert runs[0]["q"].values[-1, 3] == pytest.approx(runs[1]["q"].values[-1, 2], rel=1e-6)


def hertz_impact(k, mass, speed):
    """Depth, force and duration of a Hertzian impact (Goldsmith, Impact, 1960)."""
    depth = (1.25 * mass * speed**2 / k) ** 0.4
    return depth, k * depth**1.5, 2.9432 * depth / speed


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, -1), (2, -3, 6)])
def test_ball_dropped_in_its_socket_bounces_as_hertz_says(thrown, direction):
    clearance = ball(**ELASTIC)
    way = np.array(direction) / np.linalg.norm(direction)
    speed, mass, step = 0.1, 2.0, 2e-7
    depth, force, duration = hertz_impact(clearance.hertz_stiffness, mass, speed)
    place = dict(zip("xyz", way * (PLAY - 1e-6), strict=True))
    rates = dict(zip("xyz", way * speed, strict=True))
    result = thrown(
        clearance, rates, place, mass=mass, com="0 0 0", step=step, duration=1.5 * duration
    ).finish()
    assert result.audit.impacts == 1
    assert result.audit.shortest_contact_steps * step == pytest.approx(duration, rel=2e-3)
    assert -result["gap"].values.min() == pytest.approx(depth, rel=1e-4)
    peak = result["joint_force_peak"].values[:, 0] @ way
    assert peak.min() == pytest.approx(-force, rel=1e-4)
    assert result["v"].values[-1, :3] == pytest.approx(-speed * way, rel=1e-6, abs=1e-9)


def test_slider_falls_flat_on_four_corners(thrown):
    """Each corner takes a quarter: as one of 4 k, which is what a parallel slider has."""
    full, parallel = (
        slider(stiffness=1e9, **ELASTIC),
        slider(stiffness=4e9, lock_tilt=True, **ELASTIC),
    )
    speed, mass = 0.1, 2.0
    depth, force, duration = hertz_impact(4e9, mass, speed)
    options = {"mass": mass, "com": "0 0 0", "step": 5e-7, "duration": 1.3 * duration}
    for wall, play in (("x", PLAY), ("y", 1.5 * PLAY)):
        one, two = (
            thrown(c, {wall: -speed}, {wall: 1e-6 - play}, **options).finish()
            for c in (full, parallel)
        )
        corners = [name for name in full.contacts if name.startswith(f"{wall}-")]
        assert len(corners) == 4
        shares = one["normal_force_peak"].sel(contact=corners).values[:, 0]
        assert shares.max(axis=0) == pytest.approx(force / 4, rel=1e-3)
        others = one["normal_force_peak"].drop_sel(contact=corners).values
        assert not np.nan_to_num(others).any()
        assert one["normal_force_peak"].values.sum(axis=2).max() == pytest.approx(force, rel=1e-3)
        assert two["normal_force_peak"].sel(contact=f"{wall}-").max() == pytest.approx(
            force, rel=1e-3
        )
        assert two.audit.shortest_contact_steps * 5e-7 == pytest.approx(duration, rel=5e-3)
        for result in (one, two):
            assert -result["gap"].min() == pytest.approx(depth, rel=1e-3)


# The same state, reached in two ways

CHAIN = ("prismatic", "prismatic", "prismatic", "continuous", "continuous", "continuous")
AXES = ("1 0 0", "0 1 0", "0 0 1", "0 0 1", "0 1 0", "1 0 0")


def chain(parent, end, at="0 0 0"):
    """Sliders and hinges with the six coordinates of a virtual link, without mass."""
    links = [parent, *(f"{end}{i}" for i in range(5)), end]
    elements = [f'<link name="{name}"/>' for name in links[1:-1]]
    for i, name in enumerate(LOCAL):
        place = at if i == 0 else "0 0 0"
        pair = links[i : i + 2]
        elements.append(joint(f"{end}_{name}", *pair, CHAIN[i], AXES[i], place))
    return "".join(elements)


SCHEMES = ("multi-rate", "semi-implicit-euler")
"""Methods that reach a joint through frames in different ways."""


def instant(robot, method):
    return jp.Run(jp.Simulation(robot, **FREE, duration=1e-3, step=1e-6, integrator=method))


def evaluate(run, q, v):
    """Acceleration and contact force (bearing axes) in a given state."""
    w = run.workspace
    w.q[:], w.v[:], w.contacts["steps"] = q, v, 0.0
    run.begin()
    assert w.status == Status.COMPLETED
    return w.acceleration.copy(), w.joints["wrench"][0, :3].copy()


place = st.floats(-2.1e-4, 2.1e-4)
angle = st.floats(-1.2e-2, 1.2e-2)
rate = st.floats(-1.0, 1.0)
# Pressed and approaching: at no rate at all, rounding of the frames decides on the damping.
pressed = st.floats(2.02e-4, 2.1e-4)
states = st.tuples(
    pressed,
    place,
    place,
    st.floats(-3, 3),
    angle,
    angle,
    st.tuples(rate, st.floats(0.05, 1.0), *[rate] * 5),
)


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """Runs of one arm by a virtual link and by a chain whose loop is cut: all kinds with six."""
    folder = tmp_path_factory.mktemp("twice")
    turned = {"at": "0.2 0.1 0", "rpy": "0 0 0"}
    pairs = {}
    for name, method in product(("full", "open ends", "ball", "slider", "rod"), SCHEMES):
        clearance = KINDS[name](friction=jp.contact.Ambrosio(0.15))
        one = body("one", 3.0, "0.1 0.03 0") + joint("hinge", "base", "one", axis="0 0.6 0.8")
        two = body("two", 2.0, "0.1 0.05 -0.1")
        link = joint("pin", "one", "two", TYPES[clearance.kind], **turned)
        loop = Loop("one", "two", bearing_xyz=(0.2, 0.1, 0.0))
        runs = []
        for text, loops in ((one + two + link, {}), (one + two + chain("one", "two", "0.2 0.1 0"),
                                                     {"pin": loop})):  # fmt: skip
            path = folder / "robot.urdf"
            path.write_text(f'<robot name="r"><link name="base"/>{text}</robot>')
            robot = jp.Mechanism(path, {"pin": clearance}, loops=loops, gravity=(0, 0, -9.81))
            runs.append(instant(robot, method))
        assert runs[0].workspace.joints["first"] >= 0
        assert runs[1].workspace.joints["first"] < 0
        pairs[name, method] = runs
    return pairs


@pytest.mark.parametrize("method", SCHEMES)
@pytest.mark.parametrize("name", ["full", "open ends", "ball", "slider", "rod"])
@settings(max_examples=25)
@given(state=states)
def test_loop_and_virtual_link_agree_in_any_state(twice, name, method, state):
    """Forces through the frames of both bodies are those of the six known coordinates."""
    *six, rates = state
    q, v = np.array([0.3, *six]), np.array(rates)
    if name == "slider":
        q[4] *= 1e-3  # a block that turns far leaves its guide
    (a, force), (b, same) = (evaluate(run, q, v) for run in twice[name, method])
    assert np.abs(force).max() > 1.0
    assert np.abs(force - same).max() <= 1e-7 * np.abs(force).max()
    assert np.abs(a - b).max() <= 1e-7 * np.abs(a).max()


def euler_rates(angles, omega):
    """Rates of yaw, pitch, roll that make the angular velocity omega (parent's axes)."""
    (cy, cp), (sy, sp) = np.cos(angles[:2]), np.sin(angles[:2])
    axes = np.array([[0, -sy, cy * cp], [0, cy, sy * cp], [1, 0, -sp]])
    return np.linalg.solve(axes, omega)


@pytest.mark.parametrize("method", SCHEMES)
@pytest.mark.parametrize("name", ["full", "ball", "slider"])
@settings(max_examples=20)
@given(state=states)
def test_exchanged_joint_is_the_plain_one_seen_from_the_other_body(exchanges, name, method, state):
    """Ground and arm exchange bearing and journal: same gap, same force, the other way round."""
    *six, rates = state
    plain, other = exchanges[name, method]
    q, v = np.array(six), np.array(rates[1:])
    if name == "slider":
        q[3] *= 1e-3
    _, force = evaluate(plain, q, v)
    turn = Rotation.from_euler("ZYX", q[3:])
    back = turn.inv()
    (cy, cp), (sy, sp) = np.cos(q[3:5]), np.sin(q[3:5])
    omega = np.array([[0, -sy, cy * cp], [0, cy, sy * cp], [1, 0, -sp]]) @ v[3:]
    angles = back.as_euler("ZYX")
    place = -back.apply(q[:3])
    speed = back.apply(np.cross(omega, q[:3]) - v[:3])
    rates = euler_rates(angles, -back.apply(omega))
    _, found = evaluate(other, [*place, *angles], [*speed, *rates])
    assert np.abs(force).max() > 1.0
    # Both in bearing axes, which are the arm's in the second case.
    assert np.abs(found - force).max() <= 1e-6 * np.abs(force).max()


@pytest.fixture(scope="module")
def exchanges(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exchanged")
    pairs = {}
    for name, method in product(("full", "ball", "slider"), SCHEMES):
        runs = []
        for exchanged in (False, True):
            clearance = KINDS[name](friction=jp.contact.Ambrosio(0.15), exchanged=exchanged)
            path = folder / "robot.urdf"
            link = joint("pin", "base", "two", TYPES[clearance.kind])
            text = body("two", 2.0, "0.1 0.05 -0.1") + link
            path.write_text(f'<robot name="r"><link name="base"/>{text}</robot>')
            robot = jp.Mechanism(path, {"pin": clearance}, gravity=(0, 0, 0))
            runs.append(instant(robot, method))
        pairs[name, method] = runs
    return pairs


def test_loops_conserve_both_momenta(urdf):
    """Two bodies on free chains, held together by nothing but a loop with clearance."""
    path = urdf(
        body("one", 3.0, "0.02 0 0.1"),
        body("two", 2.0, "0.1 0.05 -0.1"),
        chain("base", "one"),
        chain("base", "two"),
    )
    loop = Loop("one", "two", (0.1, 0.0, 0.05), (0.3, -0.2, 0.5), (0.0, 0.02, 0.0), (0.1, 0, 0))
    drifts = []
    for step in (4e-6, 2e-6):
        robot = jp.Mechanism(
            path, {"pin": revolute()}, loops={"pin": loop}, gravity=(0, 0, 0), tool="two"
        )
        speeds = {"one_x": 0.1, "one_y": -0.2, "one_yaw": 1.0, "two_z": 0.1, "two_roll": 2.0}
        run = jp.Run(
            jp.Simulation(robot, **FREE, duration=0.01, step=step, integrator="rk4", record_every=5)
        )
        for name, value in speeds.items():
            run.workspace.v[robot.coordinate(name)] = value
        result = run.finish()
        assert result.audit.impacts > 5
        momenta = []
        for q, v in zip(result["q"].values, result["v"].values, strict=True):
            h = pin.computeCentroidalMomentum(robot.model, robot.data, q, v)
            centre = pin.centerOfMass(robot.model, robot.data, q)
            momenta.append([h.linear, h.angular + np.cross(centre, h.linear)])
        momenta = np.array(momenta)
        change = np.abs(momenta - momenta[0]).max(axis=0).max(axis=1)
        drifts.append(change / np.linalg.norm(momenta[0], axis=1))
        exchange = result["kinetic_energy"].values
        assert np.ptp(exchange) > 1e-3 * exchange[0]
    assert max(drifts[0]) < 1e-6
