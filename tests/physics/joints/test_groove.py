"""The groove: a pin guided by a plane curve, a kind with its own touch."""

import numpy as np
import pytest
from conftest import body, joint
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipk

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.model.loop import Loop, assemble, misfit
from jointplay.physics.geometry import touch
from jointplay.physics.geometry.curve import Curve, nearest_on_curve

FREE = {"drive": {}, "joint_friction": {}}
SMOOTH = jp.contact.Coulomb(0.0)
RADIUS, PLAY = 5e-3, 1e-5


def circle(radius, count=48, centre=0.0):
    """Points of a circle, to the left."""
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([centre + radius * np.cos(angle), radius * np.sin(angle)]).tolist()


def wavy(numbers, closed):
    """Points of a smooth curve that does not cross itself: waves about a circle or a line."""
    t = np.arange(24) / 24.0
    waves = sum(
        0.1 * a / k * np.cos(2.0 * np.pi * k * t + b)
        for k, (a, b) in enumerate(zip(numbers[::2], numbers[1::2], strict=True), 1)
    )
    if not closed:
        return np.column_stack([0.2 * t, 0.02 * waves]).tolist()
    radius = 0.05 * (1.0 + waves)
    angle = 2.0 * np.pi * t
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]).tolist()


waves = st.lists(st.floats(0.0, 3.0), min_size=8, max_size=8)
part = st.floats(-0.1, 1.1)
where = st.tuples(part, part)


def test_a_line_bent_by_less_than_roundoff_does_not_cross_itself():
    Curve(wavy([2.2250738585e-313, *[0.0] * 7], closed=False), closed=False)


@settings(max_examples=60, deadline=None)
@given(numbers=waves, closed=st.booleans(), places=st.lists(where, min_size=8, max_size=8))
def test_distance_is_the_least_of_all_of_the_curve(numbers, closed, places):
    curve = Curve(wavy(numbers, closed), closed)
    table = np.array(curve.numbers(RADIUS))
    t = np.linspace(0.0, curve.parameters[-1], 40_001)
    dense, tangents, _ = curve.at(t)
    low, high = dense.min(axis=0), dense.max(axis=0)
    for place in places:
        p = low + np.array(place) * (high - low)
        s, tx, ty, beyond = nearest_on_curve(table, 0, *p)
        away = np.linalg.norm(dense - p, axis=1)
        i = int(np.argmin(away))
        spacing = np.linalg.norm(dense[min(i + 1, 40_000)] - dense[i - 1])
        found = np.hypot(s, beyond)
        assert found <= away[i] + 1e-12
        assert found >= away[i] - spacing**2 / max(away[i], spacing)
        if beyond == 0.0 and away[i] > 1e-4 and closed:
            across = tangents[i, 0] * (p - dense[i])[1] - tangents[i, 1] * (p - dense[i])[0]
            assert np.sign(s) == np.sign(across)
        assert np.hypot(tx, ty) == pytest.approx(1.0, rel=1e-12)


def touched(clearance, k, x, y):
    answer = touch(
        clearance.shape, np.array(clearance.dimensions), 0, k, x, y, 0.0, np.eye(3).ravel(), 0
    )
    return answer[0], np.array(answer[1:4]), np.array(answer[4:])


@settings(max_examples=60, deadline=None)
@given(numbers=waves, closed=st.booleans(), at=st.floats(0.01, 0.99), aside=st.floats(-1.2, 1.2))
def test_normal_is_the_gradient_of_the_gap_of_each_wall(numbers, closed, at, aside):
    clearance = jp.GrooveClearance(
        points=wavy(numbers, closed), closed=closed, pin_radius=2e-3, wall_clearance=3e-4
    )
    curve = clearance.curve
    place, (tangent,), _ = curve.at(np.array([at * curve.parameters[-1]]))
    x, y = place[0] + aside * 3e-4 * np.array([-tangent[1], tangent[0]])
    for k in range(2):
        gap, arm, normal = touched(clearance, k, x, y)
        assert gap == pytest.approx(3e-4 * (1.0 - (aside, -aside)[k]), abs=1e-12)
        assert arm == pytest.approx(-2e-3 * normal)
        h = 1e-7
        ways = ((h, 0.0), (0.0, h))
        there, back = (
            np.array([touched(clearance, k, x + sign * a, y + sign * b)[0] for a, b in ways])
            for sign in (1, -1)
        )
        slope = (there - back) / (2.0 * h)
        assert slope == pytest.approx(normal[:2], abs=2e-6)


@given(turn=st.floats(-1.5, 1.5), away=st.floats(1e-5, 3e-4))
def test_end_of_a_slot_is_a_half_circle(turn, away):
    slot = jp.GrooveClearance(points=[(0, 0), (0.03, 0)], pin_radius=2e-3, wall_clearance=1e-4)
    assert slot.contacts == ("left", "right", "end")
    way = np.array([np.cos(turn), np.sin(turn), 0.0])
    for place, sign in ((0.03, 1.0), (0.0, -1.0)):
        gap, arm, normal = touched(slot, 2, place + sign * away * way[0], sign * away * way[1])
        assert gap == pytest.approx(1e-4 - away, abs=1e-15)
        assert normal == pytest.approx(-sign * way, abs=1e-9)
        assert arm == pytest.approx(2e-3 * sign * way, abs=1e-11)
    assert touched(slot, 2, 0.02, 2e-4)[0] > 0.0


@pytest.fixture
def bead(urdf):
    """Runs of a body whose pin, at its centre of mass, slides in a groove of the ground."""

    def run(clearance, start, kind="floating", gravity=(0.0, -9.81, 0.0), **options):
        path = urdf(body("bead", 0.1, "0 0 0", 1e-5), joint("pin", "base", "bead", kind))
        robot = jp.Mechanism(path, {"pin": clearance}, gravity=gravity)
        state = {f"pin.{name}": value for name, value in start.items()}
        options = {"step": 1e-5, "estimate": False} | options
        return jp.simulate(robot, state=state, start="centred", **FREE, **options)

    return run


def test_pin_in_a_circular_groove_swings_as_a_pendulum(bead):
    """The pin runs on the outer wall, its centre by the play farther out and pressed in by 1 um.

    The period of that length is known by elliptic integrals.
    """
    length, angle = 0.1, 0.3
    pendulum = jp.GrooveClearance(
        points=circle(length, 96), closed=True, wall_clearance=PLAY, friction=SMOOTH
    )
    start = (length + PLAY) * np.sin(angle), -(length + PLAY) * np.cos(angle)
    result = bead(pendulum, {"x": start[0], "y": start[1]}, duration=1.3, step=2e-5)
    x, y, _ = result["q"].values.T
    swing = np.arctan2(x, -y)
    i, j, k, *_ = np.nonzero(np.diff(np.sign(swing)))[0]
    begun, ended = (
        result.time[n] - swing[n] * np.diff(result.time)[n] / np.diff(swing)[n] for n in (i, k)
    )
    period = 4.0 * np.sqrt((length + PLAY) / 9.81) * ellipk(np.sin(angle / 2.0) ** 2)
    assert ended - begun == pytest.approx(period, rel=2e-6)
    assert j > i
    assert np.abs(np.hypot(x, y) - length - PLAY).max() < 3e-6


def test_straight_slot_is_a_slider_in_its_guide(bead):
    """A pin and a round corner on a wall have the same stiffness, so they bounce alike."""
    law = {"restitution": 0.7, "friction": SMOOTH}
    slot = jp.GrooveClearance(points=[(-0.1, 0.0), (0.1, 0.0)], wall_clearance=2e-4, **law)
    guide = jp.PrismaticClearance(
        clearance=2e-4, corner_radius=slot.pin_radius, lock_tilt=True, planar=True, **law
    )
    assert slot.hertz_stiffness == pytest.approx(guide.hertz_stiffness, rel=1e-12)
    one = bead(slot, {"y": (0.0, 0.05), "x": (0.0, 0.1)}, duration=0.1)
    gravity = (-9.81, 0.0, 0.0)
    two = bead(guide, {"x": (0.0, 0.05)}, "prismatic", gravity, duration=0.1)
    assert one.audit.impacts == two.audit.impacts > 5
    side = two.simulation.mechanism.coordinates.index("pin.x")
    assert np.abs(one["q"].values[:, 1] - two["q"].values[:, side]).max() < 1e-9
    assert one["q"].values[-1, 0] == pytest.approx(0.01, rel=1e-9)
    peaks = [np.nanmax(run["normal_force_peak"].values) for run in (one, two)]
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-6)


def test_lock_catches_the_pin_at_the_end_of_its_slot(bead):
    law = {"normal": jp.contact.Flores(), "restitution": 0.2, "friction": jp.contact.Coulomb(0.2)}
    slot = jp.GrooveClearance(points=[(0.0, 0.0), (0.02, 0.0)], **law)
    result = bead(slot, {"x": (0.0, 0.5)}, gravity=(9.81, 0.0, 0.0), duration=0.4)
    x, y, _ = result["q"].values[-1]
    assert x == pytest.approx(0.0201, abs=2e-6)
    assert y == 0.0
    force = result["normal_force"].sel(contact="end").values[-1, 0]
    assert force == pytest.approx(0.981, rel=1e-2)


def cam_and_follower(**fields):
    """An eccentric disc and a follower with a roller above it, which gravity keeps there."""
    lobe = jp.GrooveClearance(
        points=circle(0.035, centre=0.01), closed=True, walls="left",
        wall_clearance=PLAY, **fields,
    )  # fmt: skip
    linkage = jp.Linkage(
        points={"O": (0, 0), "F": (0, 0.03)},
        ground=["O"],
        links={
            "cam": jp.LinkageLink(["O"], mass=0.3),
            "follower": jp.LinkageLink(["F"], mass=0.2),
        },
        sliders={"stem": jp.LinkageSlider("follower", (0, 1))},
    )
    return jp.Mechanism(linkage, {"lobe": lobe}, loops={"lobe": Loop("cam", "follower")})


def test_follower_of_an_eccentric_cam_goes_as_the_closed_form_says():
    """y = e sin(a) + sqrt(rho^2 - (e cos(a))^2); rho is the sum of both radii."""
    robot, speed = cam_and_follower(friction=SMOOTH), 4.0 * np.pi
    motion = jp.Motion(["O"], [0, 0.5], [[0], [0.5 * speed]], "constant-speed")
    result = jp.simulate(
        robot, motion, drive={"O": jp.loads.Prescribed()}, step=1e-5, joint_friction={},
        estimate=False,
    )  # fmt: skip
    angle = result["q"].values[:, robot.coordinate("O")]
    lift = result["q"].values[:, robot.coordinate("stem")] + 0.03
    rho, e = 0.035 - PLAY, 0.01
    root = np.sqrt(rho**2 - (e * np.cos(angle)) ** 2)
    assert np.abs(lift - e * np.sin(angle) - root).max() < 1e-6
    # The force along the stem balances the follower's weight and inertia.
    first = e * np.cos(angle) + e**2 * np.sin(angle) * np.cos(angle) / root
    second = np.gradient(first, angle) * speed**2
    force = result["joint_force"].values[:, 0]
    up = np.abs(force @ [0, 0, 1])
    assert np.abs(up - 0.2 * (9.81 + second))[50:-50].max() < 0.02
    assert result["gap"].values.max() <= 0.0


def test_follower_is_put_on_its_cam_and_starts_at_its_speed():
    robot, speed = cam_and_follower(), 4.0 * np.pi
    motion = jp.Motion(["O"], [0, 0.5], [[0.7], [0.7 + 0.5 * speed]], "constant-speed")
    run = jp.Run(jp.Simulation(robot, motion, drive={"O": jp.loads.Prescribed()}, start="centred"))
    q, v = run.workspace.q, run.workspace.v
    assert np.abs(misfit(robot, q)["lobe"]).max() < 1e-9
    root = np.sqrt(0.035**2 - (0.01 * np.cos(0.7)) ** 2)
    slope = 0.01 * np.cos(0.7) + 1e-4 * np.sin(0.7) * np.cos(0.7) / root
    assert v[robot.coordinate("stem")] == pytest.approx(speed * slope, rel=1e-4)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"points": [(0, 0)]}, "it needs 2 or more"),
        ({"points": [(0, 0), (0.1, 0)], "closed": True}, "it needs 3 or more"),
        ({"points": [(0, 0), (0.1, 0), (0.1, 0), (0.2, 0)]}, "points 2 and 3 are in one place"),
        ({"points": [(0, 0), (1, 0), (1, 1), (0.5, -1)]}, "crosses itself at (622"),
        (
            {"points": [(0.1, 0.1), (-0.1, -0.1), (-0.1, 0.1), (0.1, -0.1)], "closed": True},
            "crosses itself at (0 m, 0 m)",
        ),
        ({"points": [(0, 0), (0.1, np.nan), (1, 1)]}, "point 2 is not finite"),
        ({"points": [(0, 0), (0.01, 0), (0.01, 0.01)]}, "radius of 2.35702 mm at (10 mm, 0 m)"),
        ({"points": circle(0.0052), "closed": True, "pin_radius": 5.2e-3}, "bends with a radius"),
        ({"points": [*circle(0.1), (0.1, 0.0)], "closed": True}, "leave out the last point"),
        ({"points": [(0, 0), (0.1, 0)], "walls": "middle"}, "walls"),
        ({"points": [(0, 0), (0.1, 0)], "fit": "10H7/g6"}, "has no fit"),
        ({"points": [(0, 0, 0), (0.1, 0, 0)]}, "two coordinates each"),
    ],
)
def test_impossible_grooves_are_refused_with_their_place(fields, words):
    with pytest.raises(JointplayError) as error:
        jp.GrooveClearance(**fields)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_curve_that_comes_back_beside_itself_needs_a_wall_between():
    leg = [(x, 0.0) for x in (0.0, 0.02, 0.04, 0.05)]
    bulb = [(0.06, -0.003), (0.075, -0.006), (0.085, 0.004), (0.075, 0.014), (0.06, 0.011)]
    hairpin = [*leg, *bulb, *((x, 0.008) for x, _ in reversed(leg))]
    with pytest.raises(JointplayError, match="comes back as near as"):
        jp.GrooveClearance(points=hairpin)
    jp.GrooveClearance(points=hairpin, pin_radius=2e-3)


def test_outside_of_a_disc_smaller_than_the_roller_is_a_cam_all_the_same():
    """A disc of 1 mm and a roller of 5 mm: only the wall that exists needs room."""
    ring = circle(6e-3)
    cam = jp.GrooveClearance(points=ring, closed=True, walls="left", wall_clearance=1e-4)
    disc = 6e-3 - 5e-3 - 1e-4
    assert cam.effective_radius(0) == pytest.approx(1.0 / (1.0 / 5e-3 + 1.0 / disc), rel=1e-4)
    socket = jp.GrooveClearance(points=circle(1e-3), closed=True, walls="right")
    assert socket.effective_radius(0) == pytest.approx(1.0 / (1.0 / 5e-3 - 1.0 / 6.1e-3), rel=1e-4)


def test_budget_of_a_cam_is_its_clearance_over_the_cosine_of_the_pressure_angle():
    robot = cam_and_follower()
    angle = np.array([0.0, 0.7, 2.0, 3.5])
    poses = [assemble(robot, np.array([a, 0.01]), [robot.coordinate("O")]) for a in angle]
    budget = jp.budget(robot, poses, driven=["O"])
    cosine = np.sqrt(1.0 - (0.01 / 0.035 * np.cos(angle)) ** 2)
    assert budget.worst == pytest.approx(PLAY / cosine, rel=1e-4)


def test_computed_torque_turns_a_cam_as_its_follower_demands():
    """At constant speed the torque is the follower's power over the cam's speed."""
    robot, speed = cam_and_follower(friction=SMOOTH), 4.0 * np.pi
    motion = jp.Motion(["O"], [0, 0.2], [[0.3], [0.3 + 0.2 * speed]], "constant-speed")
    run = jp.simulate(robot, motion, step=1e-5, joint_friction={}, estimate=False)
    a, e, rho = run["q"].values[:, robot.coordinate("O")], 0.01, 0.035 - PLAY
    root = np.sqrt(rho**2 - (e * np.cos(a)) ** 2)
    slope = e * np.cos(a) + e**2 * np.sin(a) * np.cos(a) / root
    force = 0.2 * (9.81 + np.gradient(slope, a) * speed**2)
    torque = run["drive"].values[:, robot.coordinate("O")]
    assert np.abs(torque - force * slope)[50:-50].max() < 1e-3 * np.abs(torque).max()


def test_groove_without_clearance_is_refused_where_it_cannot_be_had(urdf):
    robot = cam_and_follower().ideal()
    assert not robot.clearance
    with pytest.raises(JointplayError, match="without clearance cannot be simulated") as error:
        jp.simulate(robot, None, duration=0.01, **FREE)
    assert error.value.where == ("joints", "lobe")
    path = urdf(body("bead", 0.1), joint("pin", "base", "bead", "floating"))
    slot = jp.GrooveClearance(points=[(0, 0), (0.1, 0)], wall_clearance=0.0)
    with pytest.raises(JointplayError, match="can only close a loop"):
        jp.Mechanism(path, {"pin": slot})
