"""Closed loops with known answers: slider-crank, four-bar, parallelogram, and one in space."""

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.loop import Loop, assemble, follow, misfit
from jointplay.physics.joints import SphericalClearance
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads.drive import ComputedTorque, Prescribed

FLAT = (0.0, 0.0, 0.0)
R, L = 0.05, 0.12
CRANK, ROD, SLIDER = 0.30, 0.21, 0.14
ROD_INERTIA = 2.5e-4
PIN = {"piston_pin": Loop("rod", "slider", bearing_xyz=(L, 0, 0))}
RPM = 2.0 * np.pi / 60.0


def slider_crank(clearance=None, gravity=FLAT):
    joints = {} if clearance is None else {"piston_pin": clearance}
    path = jp.shipped("slider_crank.urdf")
    return jp.Mechanism(path, joints, loops=PIN, gravity=gravity, tool="slider")


def turning(mechanism, speed, duration, **options):
    motion = jp.Motion(["crank_pin"], [0, duration], [[0], [speed * duration]], "constant-speed")
    options = {"state": {"guide": R + L}, "start": "centred", "integrator": "rk4"} | options
    return jp.simulate(mechanism, motion, drive={"crank_pin": Prescribed()}, **options)


def analytic(theta, w):
    """Slider position and rates, rod angle and rates, forces on rod and slider, crank moment.

    Newton and Euler by hand, for constant speed, without gravity and friction; centres of mass at
    mid-length.
    """
    s, c = np.sin(theta), np.cos(theta)
    beta = -np.arcsin(R / L * s)
    sb, cb = np.sin(beta), np.cos(beta)
    db = -R / L * w * c / cb
    ddb = (R / L * w**2 * s + db**2 * sb) / cb
    x = R * c + L * cb
    v = -R * w * s - L * db * sb
    a = -R * w**2 * c - L * (ddb * sb + db**2 * cb)
    tip = R * np.array([c, s])
    rod_a = -(w**2) * tip + L / 2 * np.array([-ddb * sb - db**2 * cb, ddb * cb - db**2 * sb])
    crank_a = -(w**2) * tip / 2
    px = SLIDER * a  # the rod pushes the slider along the frictionless guide
    # Moments about the rod's centre give the push across the guide.
    turn = cb * ROD * rod_a[1] - sb * ROD * rod_a[0]
    py = (sb * px - (ROD_INERTIA * ddb / L + 0.5 * turn)) / cb
    push = np.array([px, py])
    on_rod = ROD * rod_a + push
    on_crank = CRANK * crank_a + on_rod
    moment = tip[0] * on_rod[1] - tip[1] * on_rod[0]
    guide = np.array([np.zeros_like(py), -py])
    return {
        "x": x, "v": v, "a": a, "beta": beta, "db": db,
        "crank_pin": on_crank, "rod_pin": on_rod, "guide": guide, "piston_pin": push,
        "moment": moment,
    }  # fmt: skip


@pytest.fixture(scope="module")
def fast():
    """The slider-crank at 5000 rpm, one turn."""
    w = 5000 * RPM
    return turning(slider_crank(), w, 0.012, step=5e-6, record_every=4), w


def test_reactions_and_crank_moment_are_newtons(fast):
    result, w = fast
    exact = analytic(w * result.time, w)
    forces = result["reaction_force"]
    for name in ("crank_pin", "rod_pin", "guide", "piston_pin"):
        found = forces.sel(moving_joint=name).values
        size = np.linalg.norm(exact["rod_pin"], axis=0).max()
        assert np.abs(found[:, :2].T - exact[name]).max() < 1e-3 * size, name
        assert np.abs(found[:, 2]).max() < 1e-6 * size
    moment = result["drive"].values[:, 0]
    assert np.abs(moment - exact["moment"]).max() < 2e-3 * np.abs(exact["moment"]).max()
    assert result.audit.relative_energy_residual < 1e-4


@pytest.mark.parametrize(("method", "limit"), [("rk4", 1e-9), ("semi-implicit-euler", 2e-5)])
def test_drift_is_what_the_audit_says_and_falls_with_the_step(method, limit):
    drifts = []
    for step in (4e-5, 2e-5):
        result = turning(
            slider_crank(), 1000 * RPM, 0.03, integrator=method, step=step, record_every=1
        )
        q = result["q"].values
        rod = q[:, :2].sum(axis=1)
        tip = R * np.exp(1j * q[:, 0]) + L * np.exp(1j * rod)
        gap = (q[:, 2] - tip) * np.exp(-1j * rod)  # in the bearing's axes, which are the rod's
        gap = max(np.abs(gap.real).max(), np.abs(gap.imag).max())
        assert result.audit.loop_drift == pytest.approx(gap, rel=1e-6)
        drifts.append(gap)
    assert drifts[0] < limit
    assert drifts[0] / drifts[1] == pytest.approx(4.0, abs=0.3)


def test_loops_stay_closed_though_pinocchio_is_asked_once_in_several_steps():
    mechanism = slider_crank()
    motion = jp.Motion(["crank_pin"], [0, 0.02], [[0], [2000 * RPM * 0.02]], "constant-speed")
    options = {"drive": {"crank_pin": Prescribed()}, "state": {"guide": R + L}, "duration": 0.02}
    run = jp.Run(jp.Simulation(mechanism, motion, step=1e-5, record_every=1, **options))
    result = run.finish()
    assert run.workspace.macro_steps < run.total_steps / 4
    assert result.audit.loop_drift < 2e-8
    exact = analytic(result["q"].values[:, 0], 2000 * RPM)
    assert np.abs(result["q"].values[:, 2] - exact["x"]).max() < 2e-7
    assert np.abs(result["v"].values[:, 2] - exact["v"]).max() < 1e-4


@pytest.mark.parametrize("kind", ["slider-crank", "four-bar", "in space"])
def test_acceleration_of_a_closed_loop_is_pinocchios(urdf, kind):
    """The open tree's, projected, against `pin.constraintDynamics`, with efforts and speeds."""
    robot, joint = {
        "slider-crank": lambda: (slider_crank(gravity=(1.0, -9.81, 2.0)), "crank_pin"),
        "four-bar": lambda: (four_bar(urdf, gravity=(1.0, 2.0, -9.81)), "a"),
        "in space": lambda: (rssr(urdf), "a"),
    }[kind]()
    drive = Prescribed() if kind == "in space" else ComputedTorque()
    motion = jp.Motion([joint], [0, 0.1], [[0.4], [2.5]], "constant-speed")
    found = []
    for integrator in ("multi-rate", "semi-implicit-euler"):
        run = jp.Run(
            jp.Simulation(
                robot, motion, drive={joint: drive}, integrator=integrator, step=1e-5, duration=0.1
            )
        )
        run.workspace.reference[:, 2] += 3.0  # an effort that the loop must bear
        run.begin()
        assert np.abs(run.workspace.v).max() > 1.0
        found.append(run.workspace.acceleration.copy())
    assert np.abs(found[0] - found[1]).max() < 1e-6 * np.abs(found[1]).max()


def test_weight_is_carried_where_it_must_be():
    """At rest the reactions hold the weights, by moments about the pins by hand."""
    robot = slider_crank(gravity=(0.0, -9.81, 0.0))
    result = turning(robot, 1e-6, 1e-3)
    force = result["reaction_force"].isel(time=-1)
    g = 9.81
    assert force.sel(moving_joint="piston_pin").values == pytest.approx(
        [0, -ROD * g / 2, 0], abs=1e-6
    )  # of the rod on the slider
    assert force.sel(moving_joint="guide").values == pytest.approx(
        [0, (SLIDER + ROD / 2) * g, 0], abs=1e-6
    )
    assert force.sel(moving_joint="rod_pin").values == pytest.approx([0, ROD * g / 2, 0], abs=1e-6)
    assert force.sel(moving_joint="crank_pin").values == pytest.approx(
        [0, (CRANK + ROD / 2) * g, 0], abs=1e-6
    )
    assert result["drive"].values[-1, 0] == pytest.approx(R * (CRANK + ROD) * g / 2, rel=1e-6)


def test_small_clearance_is_the_ideal_slider_crank():
    """Position within some clearances, velocity too: both vanish with the clearance."""
    w, plays = 300 * RPM, np.array([4e-4, 1e-4, 2.5e-5])
    errors = []
    for play in plays:
        joint = jp.RevoluteClearance.planar(
            radial_clearance=play, friction=jp.contact.Ambrosio(0.0)
        )
        result = turning(slider_crank(joint), w, 0.2, integrator="semi-implicit-euler")
        exact = analytic(w * result.time, w)
        place = result["tool_position"].values[:, 0] - exact["x"]
        speed = result["tool_velocity"].values[:, 0] - exact["v"]
        errors.append([np.abs(place).max(), np.sqrt((speed**2).mean())])
    errors = np.array(errors)
    assert (errors[:, 0] < 2.0 * plays).all()
    assert (errors[:, 0] > 0.5 * plays).all()
    slopes = np.polyfit(np.log(plays), np.log(errors), 1)[0]
    assert slopes[0] == pytest.approx(1.0, abs=0.15)
    assert slopes[1] > 0.3  # impacts set the speed


# A four-bar

A, B, C, D = 0.1, 0.25, 0.2, 0.3
"""Crank, coupler, rocker, frame [m]."""
BARS = (
    body("crank", 0.5, "0.05 0 0", 1e-3),
    body("coupler", 0.8, "0.125 0.02 0", 2e-3),
    body("rocker", 0.6, "0.1 0 0", 1.5e-3),
)


def four_bar(urdf, clearance=None, frame=D, coupler=B, rocker=C, crank=A, bars=BARS, **options):
    path = urdf(
        *bars,
        joint("a", "base", "crank"),
        joint("b", "crank", "coupler", at=f"{crank} 0 0"),
        joint("d", "base", "rocker", at=f"{frame} 0 0"),
    )
    loop = Loop("coupler", "rocker", bearing_xyz=(coupler, 0, 0), journal_xyz=(rocker, 0, 0))
    joints = {} if clearance is None else {"c": clearance}
    return jp.Mechanism(path, joints, loops={"c": loop}, **({"gravity": FLAT} | options))


def four_bar_angles(theta):
    """Angles of coupler and rocker by the intersection of two circles, the upper one."""
    tip = A * np.array([np.cos(theta), np.sin(theta)])
    way = np.array([D - tip[0], -tip[1]])
    far = np.hypot(*way)
    along = (far**2 + B**2 - C**2) / (2 * far)
    up = np.sqrt(B**2 - along**2)
    pin = tip + along * way / far + up * np.array([-way[1], way[0]]) / far
    coupler = np.arctan2(pin[1] - tip[1], pin[0] - tip[0])
    return coupler, np.arctan2(pin[1], pin[0] - D)


def test_prescribed_four_bar_follows_its_circles(urdf):
    robot = four_bar(urdf)
    motion = jp.Motion(["a"], [0, 0.5], [[0.3], [0.3 + 2 * np.pi]])
    start = {"d": four_bar_angles(0.3)[1]}
    result = jp.simulate(robot, motion, drive={"a": Prescribed()}, state=start, integrator="rk4",
                         step=2e-5)  # fmt: skip
    theta = motion(result.time)[0][:, 0]
    coupler, rocker = four_bar_angles(theta)
    q = result["q"].values
    assert np.abs(q[:, 0] - theta).max() < 1e-9
    assert np.abs(q[:, 2] - rocker).max() < 1e-7
    assert np.abs(q[:, :2].sum(axis=1) - coupler).max() < 1e-7
    assert np.ptp(rocker) > 0.5
    assert result.audit.relative_energy_residual < 1e-5
    power = result["drive"].values[:, 0] * result["v"].values[:, 0]
    work = np.trapezoid(power, result.time)
    assert np.abs(work) < 1e-3 * np.trapezoid(np.abs(power), result.time)  # from rest to rest
    assert result["drive_work"].values[-1] == pytest.approx(work, abs=1e-4)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_free_four_bar_keeps_its_energy(urdf, integrator):
    robot = four_bar(urdf, gravity=(0.0, -9.81, 0.0))
    state = {"a": (1.0, 3.0), "d": four_bar_angles(1.0)[1]}
    result = jp.simulate(robot, drive={}, duration=0.5, state=state,
                         joint_friction={}, integrator=integrator, step=2e-5)  # fmt: skip
    total = result["kinetic_energy"] + result["potential_energy"]
    limit = 1e-9 if integrator == "rk4" else 1e-3
    assert np.ptp(total.values) < limit * np.ptp(result["kinetic_energy"].values)
    assert np.ptp(result["kinetic_energy"].values) > 0.1


def test_parallelogram_swings_as_one_pendulum(urdf):
    """Its coupler only translates: I = 2 I_bar + m l^2, although planar loops are redundant."""
    length, mass, gravity = 0.2, 1.3, 9.81
    bars = (
        body("crank", 0.5, "0.1 0 0", 1e-3),
        body("coupler", mass, "0.15 0.05 0", 2e-3),
        body("rocker", 0.5, "0.1 0 0", 1e-3),
    )
    robot = four_bar(urdf, frame=0.3, coupler=0.3, rocker=length, crank=length, bars=bars,
                     gravity=(0.0, -gravity, 0.0))  # fmt: skip
    result = jp.simulate(robot, drive={}, duration=1.0, state={"a": -1.0, "d": -1.0},
                         joint_friction={}, integrator="rk4", step=5e-5)  # fmt: skip
    q, v = result["q"].values, result["v"].values
    assert np.abs(q[:, 0] - q[:, 2]).max() < 1e-8
    assert np.abs(q[:, 0] + q[:, 1]).max() < 1e-8
    inertia = 2.0 * (1e-3 + 0.5 * 0.1**2) + mass * length**2
    moment = gravity * (2.0 * 0.5 * 0.1 + mass * length)
    swing = 0.5 * inertia * v[:, 0] ** 2 + moment * np.sin(q[:, 0])
    assert np.abs(swing - moment * np.sin(-1.0)).max() < 1e-8 * moment
    assert np.ptp(q[:, 0]) > 1.0


@pytest.mark.parametrize("drive", [{"a": ComputedTorque()}, ComputedTorque()])
def test_computed_torque_leads_a_four_bar(urdf, drive):
    """Its feed-forward is the projected inverse dynamics: little is left to the encoder."""
    robot = four_bar(urdf, gravity=(0.0, -9.81, 0.0))
    motion = jp.Motion(["a"], [0, 0.1], [[0.3], [1.1]])
    start = {"d": four_bar_angles(0.3)[1]}
    options = {"state": start, "integrator": "rk4", "step": 2e-5, "joint_friction": {}}
    led = jp.simulate(robot, motion, drive=drive, **options)
    exact = jp.simulate(robot, motion, drive={"a": Prescribed()}, **options)
    reference = motion(led.time)[0][:, 0]
    assert np.abs(led["q"].values[:, 0] - reference).max() < 1e-6
    torque = exact["drive"].values[:, 0]
    assert np.abs(led["drive"].values[:, 0] - torque).max() < 1e-3 * np.abs(torque).max()


def test_worn_four_bar_follows_within_its_clearance(urdf):
    play = 2e-4
    worn = four_bar(urdf, jp.RevoluteClearance.planar(radial_clearance=play))
    motion = jp.Motion(["a"], [0, 0.3], [[0.3], [2.3]])
    start = {"d": four_bar_angles(0.3)[1]}
    result = jp.simulate(worn, motion, drive={"a": Prescribed()}, state=start)
    _, rocker = four_bar_angles(result["q"].values[:, 0])
    error = np.abs(result["q"].values[:, 2] - rocker)
    assert 0.1 * play / C < error.max() < 5.0 * play / C
    assert result.audit.impacts > 0
    assert result.audit.relative_energy_residual < 0.01


# In space

RSSR_CRANK, RSSR_ROCKER, RSSR_ROD = 0.04, 0.15, 0.3  # the crank goes round
BASE = np.array([0.25, 0.1, 0.0])


def rssr(urdf, ideal=True):
    """Crank about z, rocker about x at BASE, a rod with a ball at either end."""
    path = urdf(
        body("crank", 0.3, "0.025 0 0", 1e-4),
        body("rod", 0.2, f"{RSSR_ROD / 2} 0 0", 1e-3),
        body("rocker", 0.5, f"0 0 {RSSR_ROCKER / 2}", 1e-3),
        joint("a", "base", "crank"),
        joint("ball", "crank", "rod", "floating", at=f"{RSSR_CRANK} 0 0"),
        joint("d", "base", "rocker", axis="1 0 0", at=" ".join(map(str, BASE))),
    )
    joints = {
        "ball": SphericalClearance(radial_clearance=1e-4, ideal=True),
        "tip": SphericalClearance(radial_clearance=1e-4, ideal=ideal),
    }
    loop = Loop("rod", "rocker", bearing_xyz=(RSSR_ROD, 0, 0), journal_xyz=(0, 0, RSSR_ROCKER))
    return jp.Mechanism(path, joints, loops={"tip": loop}, gravity=FLAT)


def rssr_rocker(theta, near, rod=RSSR_ROD):
    """Rocker angle for which the rod fits: p cos(phi) + q sin(phi) = r, the root near `near`."""
    way = BASE[:, None] - RSSR_CRANK * np.array([np.cos(theta), np.sin(theta), 0 * theta])
    # The rocker's tip is at BASE + rho (0, -sin, cos).
    p, q = 2 * RSSR_ROCKER * way[2], -2 * RSSR_ROCKER * way[1]
    r = rod**2 - RSSR_ROCKER**2 - (way**2).sum(axis=0)
    middle, half = np.arctan2(q, p), np.arccos(r / np.hypot(p, q))
    both = np.array([middle + half, middle - half])
    both = np.angle(np.exp(1j * both))
    return both[np.abs(both[:, 0] - near).argmin()]


def test_spatial_loop_closes_and_keeps_closed(urdf):
    robot = rssr(urdf)
    w = 2 * np.pi
    motion = jp.Motion(["a"], [0, 1.0], [[0], [w]], "constant-speed")
    result = jp.simulate(robot, motion, drive={"a": Prescribed()}, integrator="rk4", step=1e-4)
    assert result.status.name == "COMPLETED"
    rocker = result["q"].values[:, robot.coordinate("d")]
    exact = rssr_rocker(w * result.time, rocker[0])
    assert np.ptp(exact) > 0.2
    assert np.abs(rocker - exact).max() < 1e-6
    assert result.audit.loop_drift < 1e-7
    assert result.audit.relative_energy_residual < 1e-5


def test_worn_ball_of_a_spatial_loop_follows_the_ideal(urdf):
    robot = rssr(urdf, ideal=False)
    w = 2 * np.pi
    motion = jp.Motion(["a"], [0, 0.2], [[0], [0.2 * w]], "constant-speed")
    result = jp.simulate(robot, motion, drive={"a": Prescribed()})
    rocker = result["q"].values[:, robot.coordinate("d")]
    exact = rssr_rocker(w * result.time, rocker[0])
    # The clearance makes the rod longer or shorter, and no more than that.
    room = 1e-4 + result.audit.largest_penetration
    ends = np.array([rssr_rocker(w * result.time, rocker[0], RSSR_ROD + d) for d in (room, -room)])
    assert (ends.min(axis=0) < rocker).all()
    assert (rocker < ends.max(axis=0)).all()
    assert np.abs(rocker - exact).max() > 0.5 * np.abs(ends - exact).max()
    assert result["tilt"].values.max() > 0.05  # a ball may tilt
    assert result.audit.impacts > 0


def test_following_a_loop_closes_it_as_assembling_does(urdf):
    """Revolute loop tilted in space, so that the axis' angles count; a ball; far off: assembled."""
    path = urdf(
        body("mount"),
        joint("tilt", "base", "mount", "fixed", rpy="0.3 0.2 0.1"),
        body("crank"),
        joint("a", "mount", "crank"),
        body("coupler"),
        joint("b", "crank", "coupler", at="0.05 0 0"),
        body("rocker"),
        joint("d", "mount", "rocker", at="0.2 0.05 0"),
    )
    flat = jp.Mechanism(
        path, loops={"c": Loop("coupler", "rocker", (0.2, 0, 0), FLAT, (0.2, 0, 0))}
    )
    for robot, driven in ((flat, "a"), (rssr(urdf), "a")):
        at = [robot.coordinate(driven)]
        q = assemble(robot, robot.configuration({driven: 0.3}), at)
        for step in (1e-3, 0.02, 0.4):
            start = q.copy()
            start[at] += step
            found = follow(robot, start, at)
            if robot is flat:  # a rod between two balls may spin
                assert np.abs(found - assemble(robot, start, at)).max() < 1e-8
            assert max(np.abs(part).max() for part in misfit(robot, found).values()) < 1e-11


@pytest.mark.parametrize("rpm", [600, 5000])
@pytest.mark.parametrize("play", [5e-5, 5e-4])
def test_a_rod_between_two_cylindrical_pins_starts_as_the_ideal_one_turns(rpm, play):
    clearance = jp.RevoluteClearance(radial_clearance=play)
    path, w = jp.shipped("slider_crank.urdf"), rpm * RPM
    mechanism = jp.Mechanism(
        path, {"rod_pin": clearance, "piston_pin": clearance}, loops=PIN, gravity=FLAT
    )
    motion = jp.Motion(["crank_pin"], [0, 1e-3], [[0], [w * 1e-3]], "constant-speed")
    drive, state = {"crank_pin": Prescribed()}, {"guide": R + L}
    run = jp.Run(jp.Simulation(mechanism, motion, drive=drive, state=state, tolerance=1e-3))
    assert run.rest.solved  # pressed and tilted, so that the rows of the loop are not exact
    speed = dict(zip(map(str, mechanism.coordinates), run.workspace.v, strict=True))
    # Journals lie aside by their play: the rod is longer by 2 of them at most.
    assert speed["rod_pin.yaw"] == pytest.approx(-w * (1 + R / L), rel=4 * play / R)
    assert max(abs(speed[f"rod_pin.{part}"]) for part in "xyz") < 1e-5 * R * w


def test_journals_that_given_speeds_make_fly_are_said():
    mechanism = slider_crank(jp.RevoluteClearance(radial_clearance=2e-4))
    state = {
        "guide": (R + L, 20.0)
    }  # where the ideal slider stands, and the rod turns with its crank
    motion = jp.Motion(["crank_pin"], [0, 1e-3], [[0], [60e-3]], "constant-speed")
    drive = {"crank_pin": Prescribed()}
    with pytest.warns(RuntimeWarning, match="'piston_pin' starts at 22.5 m/s in its bearing"):
        jp.Run(jp.Simulation(mechanism, motion, drive=drive, state=state, start="centred"))


def folded(angle, clearance=None, **more):
    """A slider-crank at 30 degrees of its crank, the rod's angle given."""
    motion = jp.Motion(["crank_pin"], [0, 1e-3], [[np.pi / 6], [np.pi / 6]])
    state = {"rod_pin": angle, **more}
    start = None if clearance is None else "centred"
    mechanism = slider_crank(clearance)
    run = jp.Run(jp.Simulation(mechanism, motion, drive=Prescribed(), state=state, start=start))
    if clearance is not None:
        assert max(abs(part).max() for part in misfit(mechanism, run.workspace.q).values()) < 1e-9
    return dict(zip(map(str, run.mechanism.coordinates), run.workspace.q, strict=True))


def test_a_rounded_start_is_corrected_within_its_branch():
    right = -np.arcsin(R / L * 0.5) - np.pi / 6
    other = np.pi - np.arcsin(-R / L * 0.5) - np.pi / 6
    wide = jp.RevoluteClearance(radial_clearance=2e-3)  # that would hold what 2 digits leave open
    for exact, clearance in ((right, None), (other, None), (right, wide)):
        with pytest.warns(RuntimeWarning, match="start corrected, for loops determine it: rod_pin"):
            found = folded(round(exact, 2), clearance)
        assert found["rod_pin"] == pytest.approx(exact, abs=1e-8)
        assert found["crank_pin"] == pytest.approx(np.pi / 6, abs=1e-15)  # the motion's: a fact
    with pytest.raises(jp.JointplayError, match=f"rod_pin = {right:.6g}"):
        folded(right - 0.06)
    with pytest.raises(jp.JointplayError, match="contradict each other"):
        folded(right, guide=0.99 * (R * np.cos(np.pi / 6) + L) - 0.02)


def test_a_loop_is_not_closed_by_a_journal_beside_its_open_bearing(urdf):
    path = urdf(body("shaft"), joint("one", "base", "shaft"))
    bush = jp.RevoluteClearance(bearing_length=20e-3, radial_clearance=1e-4, open_ends=True)
    for aside in (0.0, 0.015, 0.125):
        two = {"two": Loop("base", "shaft", (0, 0, 0.5), journal_xyz=(0, 0, 0.5 + aside))}
        mechanism = jp.Mechanism(path, {"one": bush, "two": bush}, loops=two)
        if aside < 0.02:
            assemble(mechanism, np.zeros(mechanism.model.nq), [])
        else:
            with pytest.raises(jp.JointplayError, match="'two' stays open by"):
                assemble(mechanism, np.zeros(mechanism.model.nq), [])


@pytest.mark.parametrize("gap", [0.003, 0.125])
def test_planar_play_closes_no_loop_that_is_open_along_its_axis(gap):
    play = jp.RevoluteClearance(radial_clearance=1e-4, lock_tilt=True, lock_axial=True)
    pin = {"piston_pin": Loop("rod", "slider", bearing_xyz=(L, 0, gap))}
    made = jp.Mechanism(jp.shipped("slider_crank.urdf"), {"piston_pin": play}, loops=pin)
    with pytest.raises(jp.JointplayError, match="'piston_pin' stays open by"):
        assemble(made, np.zeros(made.model.nq), [])
