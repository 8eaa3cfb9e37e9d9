"""Compliant joints: springs alone, and in series with a rolling bearing."""

import math

import numpy as np
import pytest

import jointplay as jp
from jointplay.accuracy.error_budget import budget
from jointplay.base.errors import JointplayError
from jointplay.physics.contact import elastic, resultant
from jointplay.simulation.loads.drive import Prescribed

SOFT = jp.Elasticity(radial=2e7, axial=1e7, tilt=4e3)
ARM = """<robot name="arm"><link name="base"/><link name="arm"><inertial>
<origin xyz="0.1 0 0"/><mass value="2.0"/>
<inertia ixx="0.004" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>"""


GUIDE = jp.Elasticity(radial=2e7, tilt=4e3, torsion=3e3)
SLIDE = ARM.replace('type="revolute"', 'type="prismatic"').replace('xyz="0 0 1"', 'xyz="1 0 0"')


@pytest.fixture
def slide(tmp_path):
    """A slider along x, its centre of mass 0.1 m off its middle along x."""
    path = tmp_path / "slide.urdf"
    path.write_text(SLIDE)
    return lambda joint, **options: jp.Mechanism(path, {"pin": joint}, **options)


@pytest.fixture
def arm(tmp_path):
    """A horizontal arm on an upright compliant pin."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return lambda joint, **options: jp.Mechanism(path, {"pin": joint}, **options)


def whole_matrix(matrix, free):
    """The matrix (6, 6) of one (5, 5) without the free direction."""
    return np.insert(np.insert(matrix, free, 0.0, axis=0), free, 0.0, axis=1)


def held(robot, **options):
    """A simulation in which the drive holds the pin at zero."""
    motion = jp.Motion(["pin"], [0.0, 1.0], [[0.0], [0.0]])
    options = {"duration": 0.02, "estimate": False, "drive": "prescribed"} | options
    return jp.simulate(robot, motion, **options)


def test_an_arm_sags_by_its_weight_over_the_stiffness(arm):
    robot = arm(jp.CompliantJoint(elasticity=SOFT))
    result = held(robot, start="rest")
    weight, lever = 2.0 * 9.81, 0.1
    at = {name: float(result["q"].sel(coordinate=f"pin.{name}")[-1]) for name in ("z", "pitch")}
    # In the second order the sag shortens the lever a little.
    assert at["z"] == pytest.approx(-weight / 1e7, rel=1e-6)
    assert at["pitch"] == pytest.approx(weight * lever / 4e3, rel=1e-3)
    assert np.ptp(result["tool_position"].values, axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    assert result.audit.impacts == 0
    found = budget(robot, {}, drive=Prescribed())
    ideal = held(robot.ideal())
    away = result["tool_position"][-1] - ideal["tool_position"][-1]
    assert found.rest_tool[0, :3] == pytest.approx(away.values, abs=1e-9)
    assert found.worst[0] == 0.0


def test_damping_takes_what_it_should(arm):
    slow = jp.Elasticity(radial=2e7, axial=1e7, tilt=4e3, damping_time=4e-5)
    robot = arm(jp.CompliantJoint(elasticity=slow), gravity=(0, 0, 0))
    run = jp.Run(jp.Simulation(
        robot, None, drive="free", duration=10e-3, record_every=1, start="centred", step=2e-6
    ))  # fmt: skip
    run.workspace.q[robot.coordinates.index("pin.x")] = 1e-6
    result = run.finish()
    x = result["q"].sel(coordinate="pin.x").values
    omega = math.sqrt(2e7 / 2.0)
    expected = math.exp(-0.5 * omega**2 * 4e-5 * 9e-3)
    assert np.abs(x[result.time > 9e-3]).max() / 1e-6 == pytest.approx(expected, rel=0.1)
    assert result.audit.relative_energy_residual < 1e-3


def test_a_slider_sags_and_leans_wherever_it_is(slide):
    robot = slide(jp.CompliantSlider(elasticity=GUIDE))
    weight, lever = 2.0 * 9.81, 0.1
    for place in (0.0, 0.5):  # far beyond what springs give way: it is free along its axis
        motion = jp.Motion(["pin"], [0.0, 1.0], [[place], [place]])
        options = {"duration": 0.02, "estimate": False, "drive": "prescribed"}
        result = jp.simulate(robot, motion, start="rest", **options)
        ideal = jp.simulate(robot.ideal(), motion, **options)
        away = (result["tool_position"][-1] - ideal["tool_position"][-1]).values
        turn = weight * lever / 4e3
        assert away[2] == pytest.approx(-weight / 2e7, rel=1e-4)
        assert away[:2] == pytest.approx(np.zeros(2), abs=1e-9)
        _, x, y, z = result["tool_orientation"].values[-1]
        assert (x, y, z) == pytest.approx((0.0, 0.5 * turn, 0.0), abs=1e-8)
        found = budget(robot, {"pin": place}, drive=Prescribed())
        assert found.rest_tool[0, :3] == pytest.approx(away, abs=1e-9)
        assert found.worst[0] == 0.0


@pytest.mark.parametrize("coordinate", ["x", "y", "yaw", "pitch", "roll"])
def test_a_slider_that_slides_and_swings_keeps_its_energy(slide, coordinate):
    """Macro steps are short: centrifugal forces, in error by them, push the slider along."""
    stiff = jp.Elasticity(radial=2e7, tilt=4e3, torsion=3e3, damping_time=0.0)
    robot = slide(jp.CompliantSlider(elasticity=stiff), gravity=(0, 0, 0))
    run = jp.Run(jp.Simulation(
        robot, None, drive="free", duration=5e-3, record_every=1, start="centred", step=2e-6,
        macro_step=2e-5,
    ))  # fmt: skip
    size = 1e-6 if coordinate in "xy" else 1e-4
    run.workspace.q[robot.coordinates.index(f"pin.{coordinate}")] = size
    at = [name for name in robot.coordinates if name in ("pin", "pin.z")]
    run.workspace.v[robot.coordinates.index(at[0])] = 2.0
    result = run.finish()
    stored = 0.5 * (2e7 if coordinate in "xy" else 3e3) * size**2
    assert result.audit.energy_residual < 2e-3 * stored
    moved = result["q"].sel(coordinate=at[0]).values
    assert moved[-1] == pytest.approx(2.0 * 5e-3, rel=1e-3)


def test_a_curve_is_followed_and_stores_its_area():
    curve = [[1e-5, 100.0], [3e-5, 500.0]]
    stiff = jp.Elasticity(radial=1e6, axial=1e7, tilt=4e3, radial_curve=curve)
    joint = jp.CompliantJoint(elasticity=stiff)
    assert stiff.stiffness[0, 0] == pytest.approx(1e6 + 1e7)
    poses = np.zeros((3, 12))
    poses[:, 3:] = np.eye(3).ravel()
    poses[:, 0] = [0.5e-5, -2e-5, 4e-5]
    found = elastic.answers(joint.law, joint.resultant, poses)
    assert found[:, 0] == pytest.approx([-55.0, 320.0, -740.0])
    areas = [0.5 * 50 * 0.5e-5, 0.5e-3 + 1e-5 * 200, 0.5e-3 + 2e-5 * 300 + 1e-5 * 600]
    springs = 0.5e6 * poses[:, 0] ** 2
    assert found[:, 6] == pytest.approx(np.array(areas) + springs)


def _rotation(vector):
    import pinocchio as pin

    return pin.exp3(vector)


@pytest.mark.parametrize("load", [((500, 0, 100), (0, 5, 0)), ((0, 80, -300), (2, 1, 0))])
def test_a_bearing_and_its_seat_are_in_series(load):
    force, moment = map(np.array, load)
    stiff = jp.Elasticity(radial=2e8, axial=1e8, tilt=4e4)
    alone = jp.BallBearing(designation="6010/C3")
    seated = jp.BallBearing(designation="6010/C3", seat=stiff)
    given = np.concatenate([force / [2e8, 2e8, 1e8], moment / [4e4, 4e4, 1.0]])
    expected = alone.deflection(force, moment) + given
    found = seated.deflection(force, moment)
    assert found[:5] == pytest.approx(expected[:5], rel=1e-5, abs=1e-12)
    one, other = alone.load(alone.deflection(force, moment)), seated.load(found)
    assert other.loads == pytest.approx(one.loads, rel=1e-4, abs=1e-3)
    assert other.energy == pytest.approx(
        one.energy + 0.5 * np.concatenate([force, moment]) @ given, rel=1e-5
    )


def test_a_seat_changes_nothing_where_a_bearing_is_free():
    stiff = jp.Elasticity(radial=2e8, axial=1e8, tilt=4e4)
    seated = jp.BallBearing(designation="6010/C3", seat=stiff)
    assert seated.load([5e-6, 0, 0, 0, 0, 0]).wrench == pytest.approx(np.zeros(6))
    alone = jp.BallBearing(designation="6010/C3")
    loads = np.eye(6)[:5]
    assert seated.play().support(loads).value == pytest.approx(alone.play().support(loads).value)


PIN, SLIDER, MOUNT = jp.CompliantJoint, jp.CompliantSlider, jp.CompliantMount
ENOUGH = {"radial": 1e7, "axial": 1e7, "tilt": 1e3}


@pytest.mark.parametrize(
    ("joint", "given", "says"),
    [
        (PIN, {}, "every direction but about its axis: give radial, axial and tilt stiffness"),
        (PIN, {"radial": 1e7, "axial": 1e7}, "held in every direction"),
        (PIN, ENOUGH | {"radial": -1e7}, "radial stiffness"),
        (PIN, {"matrix": np.ones((6, 6))}, "positive definite"),
        (PIN, {"matrix": np.eye(5)}, r"\(6, 6\), got \(5, 5\)"),
        (PIN, {"matrix": np.eye(6)}, "about its axis a joint is free: it has no torsion"),
        (PIN, ENOUGH | {"torsion": 1e3}, "about its axis a joint is free: it has no torsion"),
        (PIN, {"matrix": np.eye(6) + np.eye(6, k=1)}, "symmetric"),
        (PIN, ENOUGH | {"matrix": np.eye(6)}, "not both"),
        (PIN, ENOUGH | {"axial_curve": [[1e-5, 0.0]]}, "must rise"),
        (PIN, ENOUGH | {"axial_curve": [1e-5, 10.0]}, "points"),
        (SLIDER, {"radial": 1e7, "tilt": 1e3}, "but along its axis: give radial, tilt and torsion"),
        (SLIDER, {"matrix": np.eye(6)}, "along its axis a joint is free: .* row and column 3"),
        (MOUNT, ENOUGH, "in every direction: give radial, axial, tilt and torsion"),
        (MOUNT, {"matrix": np.diag([1.0] * 5 + [-1.0])}, "positive definite"),
    ],
)
def test_stiffness_that_cannot_be_is_refused(joint, given, says):
    with pytest.raises(JointplayError, match=says):
        joint(elasticity=jp.Elasticity(**given))


def test_a_scenario_has_compliant_joints(tmp_path, arm):
    arm(jp.CompliantJoint(elasticity=SOFT))
    from jointplay.scenario import Scenario

    file = tmp_path / "soft.toml"
    file.write_text(
        '[robot]\nurdf = "arm.urdf"\n[joints.pin]\nkind = "compliant"\n'
        'elasticity = { radial = "20 N/um", axial = 1e7, tilt = 4e3 }\n'
        "[integration]\nduration = 0.01\n"
    )
    joint = Scenario.load(file).simulation().mechanism.clearance["pin"]
    assert joint == jp.CompliantJoint(elasticity=SOFT)


HELD = jp.Elasticity(radial=2e7, axial=1e7, tilt=4e3, torsion=3e3, damping_time=0.0)


@pytest.fixture
def table(tmp_path):
    """A body fixed to the ground, its weight in its middle; its mount's axes are the world's."""
    path = tmp_path / "table.urdf"
    path.write_text(
        ARM.replace('type="revolute"', 'type="fixed"').replace('xyz="0.1 0 0"', 'xyz="0 0 0"')
    )
    return lambda joint, **options: jp.Mechanism(path, {"pin": joint}, **options)


@pytest.mark.parametrize(
    ("coordinate", "size", "stiffness", "inertia"),
    [
        *(("x", 1e-6, 2e7, 2.0), ("z", 1e-6, 1e7, 2.0), ("roll", 1e-4, 4e3, 0.004)),
        *(("pitch", 1e-4, 4e3, 0.02), ("yaw", 1e-4, 3e3, 0.02)),
    ],
)
def test_a_body_on_a_mount_swings_at_the_root_of_stiffness_over_inertia(
    table, coordinate, size, stiffness, inertia
):
    robot = table(jp.CompliantMount(elasticity=HELD), gravity=(0, 0, 0))
    run = jp.Run(jp.Simulation(
        robot, None, drive="free", duration=2e-2, record_every=1, start="centred", step=1e-6,
    ))  # fmt: skip
    run.workspace.q[robot.coordinates.index(f"pin.{coordinate}")] = size
    result = run.finish()
    x = result["q"].sel(coordinate=f"pin.{coordinate}").values
    at = np.flatnonzero((x[:-1] > 0.0) != (x[1:] > 0.0))
    crossings = result.time[at] + np.diff(result.time)[at] * x[at] / (x[at] - x[at + 1])
    period = 2.0 * np.diff(crossings).mean()
    assert period == pytest.approx(2.0 * math.pi * math.sqrt(inertia / stiffness), rel=1e-3)
    assert result.audit.energy_residual < 1e-3 * 0.5 * stiffness * size**2


def test_a_body_on_a_mount_sags_leans_and_turns_by_load_over_stiffness(table):
    robot = table(jp.CompliantMount(elasticity=HELD))
    assert robot.joints == ()
    loads = {"push": jp.loads.Wrench("arm", force=(30.0, -20.0, 5.0), moment=(0.3, 0.2, -0.6))}
    result = jp.simulate(
        robot, None, drive="free", start="rest", duration=0.01, loads=loads, estimate=False
    )
    place = result["tool_position"].values
    assert np.ptp(place, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert place[-1] == pytest.approx([30 / 2e7, -20 / 2e7, (5 - 2 * 9.81) / 1e7], rel=1e-4)
    turn = 2.0 * result["tool_orientation"].values[-1, 1:]
    assert turn == pytest.approx([0.3 / 4e3, 0.2 / 4e3, -0.6 / 3e3], rel=1e-3)
    found = budget(robot, {}, force=(30.0, -20.0, 5.0), drive=Prescribed())
    assert found.rest_tool[0, :3] == pytest.approx(place[-1], abs=1e-9)
    assert found.worst[0] == 0.0
    with pytest.raises(JointplayError, match="moving joint"):
        robot.coordinate("pin")


def test_a_sliders_torsion_is_in_its_rest_and_in_its_budget(tmp_path):
    """A weight beside a slider along x turns it about its own axis."""
    path = tmp_path / "beside.urdf"
    path.write_text(SLIDE.replace('<origin xyz="0.1 0 0"/>', '<origin xyz="0 0.05 0"/>'))
    robot = jp.Mechanism(path, {"pin": jp.CompliantSlider(elasticity=GUIDE)})
    result = held(robot, start="rest")
    turn = -2.0 * 9.81 * 0.05 / 3e3
    assert 2.0 * result["tool_orientation"].values[-1, 1] == pytest.approx(turn, rel=1e-3)
    model = budget(robot, {}, kind="industrial", causes=["elasticity"]).model
    (k,) = [k for k, one in enumerate(model.contributions) if one.joint == "pin"]
    assert (model.jacobian[k, 0] @ model.contributions[k].shift[0])[3] == pytest.approx(
        turn, rel=1e-6
    )


@pytest.mark.parametrize(("kind", "free"), [(PIN, 5), (SLIDER, 2), (MOUNT, None)])
def test_a_wrench_is_the_gradient_of_its_energy_and_to_first_order_the_matrix(kind, free):
    held = [i for i in range(6) if i != free]
    random, sizes = np.random.default_rng(4), np.array([4e3, 4e3, 4e3, 60.0, 60.0, 60.0])
    whole = random.normal(size=(6, 6))
    first = (whole @ whole.T + np.eye(6)) * np.outer(sizes, sizes)
    if free is not None:
        first[free] = first[:, free] = 0.0
    joint = kind(elasticity=jp.Elasticity(matrix=first))

    def answer(twist):
        pose = np.concatenate([place + twist[:3], (_rotation(twist[3:]) @ begin).ravel()])
        return elastic.answers(joint.law, joint.resultant, pose[None])[0]

    place = np.array([1e-5, -2e-5, 0.3 if kind is SLIDER else 2e-5])
    begin = _rotation(
        np.array([0.3, -0.2, 0.5]) if kind is MOUNT else np.array([1e-3, -2e-3, 3e-3])
    )
    step = np.array([1e-8] * 3 + [1e-6] * 3)
    rates = np.array([
        (answer(h * unit)[6] - answer(-h * unit)[6]) / (2.0 * h)
        for h, unit in zip(step, np.eye(6), strict=True)
    ])  # fmt: skip
    assert answer(np.zeros(6))[:6] == pytest.approx(-rates, rel=1e-5, abs=1e-5)
    small = np.array([1e-7, 2e-7, -1e-7, 1e-6, -2e-6, 3e-6])
    place, begin = np.zeros(3), np.eye(3)
    assert answer(small)[held] == pytest.approx(-(first @ small)[held], rel=1e-5, abs=1e-4)
    stiffness = answer(np.zeros(6))[resultant.TANGENT : resultant.ANSWERS].reshape(6, 6)
    assert stiffness[np.ix_(held, held)] == pytest.approx(
        first[np.ix_(held, held)], rel=1e-5, abs=1e-2
    )


def test_a_robot_stands_on_a_soft_table_and_fixed_joints_alone_can_be_mounts():
    soft = jp.CompliantMount(elasticity=jp.Elasticity(radial=2e6, axial=4e6, tilt=2e5, torsion=2e5))
    robot = jp.Mechanism("ur5", {"world_joint": soft})
    ideal = jp.Mechanism("ur5")
    assert robot.joints == ideal.joints
    assert robot.ideal() == ideal
    pose = {"shoulder_lift_joint": -1.0, "elbow_joint": 1.5}
    motion = jp.Motion(list(pose), [0.0, 1.0], [list(pose.values())] * 2)
    result = jp.simulate(
        robot, motion, start="rest", drive="prescribed", duration=0.02, estimate=False
    )
    found = budget(robot, pose, drive=Prescribed()).rest_tool[0, :3]
    still = jp.simulate(ideal, motion, drive="prescribed", duration=1e-3, estimate=False)
    away = result["tool_position"].values[-1] - still["tool_position"].values[-1]
    assert away == pytest.approx(found, abs=1e-8)
    assert away[2] < -1e-5
    with pytest.raises(JointplayError, match="elbow_joint' is revolute, not fixed; fixed joints"):
        jp.Mechanism("ur5", {"elbow_joint": soft})
    with pytest.raises(JointplayError, match=r"link 'ee_link' .* no mass or inertia"):
        jp.simulate(jp.Mechanism("ur5", {"ee_fixed_joint": soft}), None, drive="free",
                    duration=1e-3)  # fmt: skip
