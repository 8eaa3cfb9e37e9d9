"""The cylindrical joint: a rod that turns and slides in a bushing, a kind with its own touch."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint
from hypothesis import example, given
from hypothesis import strategies as st

import jointplay as jp
from jointplay.bridges.urdf import to_urdf
from jointplay.model.loop import Loop, misfit
from jointplay.physics.geometry import touch
from jointplay.physics.joints import Clearance, CylindricalClearance
from jointplay.scenario import Scenario

PLAY = 2e-4
ROD = CylindricalClearance(radial_clearance=PLAY)
FREE = {"drive": {}, "joint_friction": {}}

offset = st.floats(-4e-4, 4e-4)
lean = st.floats(-0.02, 0.02)
poses = st.tuples(offset, offset, st.floats(-0.1, 0.1), lean, lean, st.floats(-3.0, 3.0))
ends = st.sampled_from([0, 1])


def at(pose):
    x, y, z, roll, pitch, yaw = pose
    return np.array([x, y, z]), pin.exp3(np.array([roll, pitch, 0.0])) @ pin.utils.rotate("z", yaw)


def touched(k, centre, turn, clearance=ROD):
    d = np.array(clearance.dimensions)
    answer = touch(clearance.shape, d, 0, k, *centre, turn.ravel(), 0)
    return answer[0], np.array(answer[1:4]), np.array(answer[4:])


@example(pose=(-2e-311, -2e-311, 1.4e-48, 1.7e-155, -2e-311, -2e-311), k=1)
@given(pose=poses, k=ends)
def test_gap_is_that_of_the_edge_point_nearest_to_the_rod(pose, k):
    centre, turn = at(pose)
    azimuth = np.linspace(0.0, 2.0 * np.pi, 4001)
    height = np.full_like(azimuth, (1 - 2 * k) * ROD.bearing_length / 2)
    edge = np.column_stack([ROD.ri * np.cos(azimuth), ROD.ri * np.sin(azimuth), height]) - centre
    axis = turn[:, 2]
    nearest = np.linalg.norm(edge - np.outer(edge @ axis, axis), axis=1).min() - ROD.rj
    gap, place, normal = touched(k, centre, turn)
    assert gap == pytest.approx(nearest, abs=2e-9)
    assert gap <= nearest + 1e-15
    point = place + centre
    assert np.hypot(point[0], point[1]) == pytest.approx(ROD.ri, rel=1e-12)
    assert np.linalg.norm(normal) == pytest.approx(1.0, rel=1e-12)
    assert abs(normal @ axis) < 1e-12


@given(pose=poses, k=ends)
def test_normal_and_arm_are_the_gradient_of_the_gap(pose, k):
    """With them the force does exactly the work that the change of the gap implies."""
    centre, turn = at(pose)
    gap, place, normal = touched(k, centre, turn)
    if gap > 0.5 * PLAY:
        return  # a centred axis has no nearest point, and needs none
    gradient = np.concatenate([normal, np.cross(place, normal)])
    step = 1e-8
    for i, way in enumerate(np.eye(6) * step):
        there, back = (
            touched(k, centre + s * way[:3], pin.exp3(s * way[3:]) @ turn)[0] for s in (1, -1)
        )
        assert (there - back) / (2 * step) == pytest.approx(gradient[i], abs=2e-6)


@example(pose=(0.0, 0.0, 0.02, 1.3e-86, 0.0135, -1.16))
@given(pose=poses)
def test_ends_are_mirror_images_of_each_other(pose):
    centre, turn = at(pose)
    mirror = np.diag([1.0, 1.0, -1.0])
    one = touched(0, centre, turn)
    other = touched(1, mirror @ centre, mirror @ turn @ mirror)
    assert other[0] == pytest.approx(one[0], abs=1e-15)
    if one[0] > PLAY - 1e-12:
        return  # a centred axis has no nearest point
    crossing = centre + (ROD.bearing_length / 2 - centre[2]) / turn[2, 2] * turn[:, 2]
    if np.hypot(crossing[0], crossing[1]) < 1e-12:
        return  # a leaning axis that crosses the bearing's there has two, on either side
    assert np.allclose(mirror @ other[1], one[1], atol=1e-12)
    assert np.allclose(mirror @ other[2], one[2], atol=1e-12)


@given(pose=poses, k=ends, slide=st.floats(-0.1, 0.1), turned=st.floats(-3.0, 3.0))
def test_gap_knows_nothing_of_sliding_and_turning(pose, k, slide, turned):
    centre, turn = at(pose)
    gap, *_ = touched(k, centre, turn)
    moved = touched(k, centre + slide * turn[:, 2], turn @ pin.utils.rotate("z", turned))
    assert moved[0] == pytest.approx(gap, abs=1e-14)


@pytest.fixture
def floating(urdf):
    def make(clearance, gravity=(0, 0, -9.81), com="0 0 0.05"):
        path = urdf(body("arm", 2.0, com, 1e-2), joint("pin", "base", "arm", "floating"))
        return jp.Mechanism(path, {"pin": clearance}, gravity=gravity)

    return make


def test_rod_falls_freely_along_its_axis_and_so_does_the_ideal_one(floating):
    robot = floating(ROD)
    assert robot.ideal().coordinates == ("pin.z", "pin.yaw")
    for machine in (robot, robot.ideal()):
        result = jp.simulate(machine, duration=0.05, **FREE)
        fallen = result["q"].values[-1, machine.coordinates.index("pin.z")]
        assert fallen == pytest.approx(-0.5 * 9.81 * 0.05**2, rel=1e-9)


def test_rod_lies_on_both_edges_and_rubs_as_coulomb_says(floating):
    """It rests across gravity; pushed along its axis it stops after v^2 / (2 mu g)."""
    mu, speed = 0.1, 0.2
    clearance = CylindricalClearance(radial_clearance=PLAY, friction=jp.contact.Coulomb(mu))
    robot = floating(clearance, (-9.81, 0, 0), "0 0 0")
    result = jp.simulate(robot, duration=0.3, state={"pin.z": (0.0, speed)}, **FREE)
    z = result["q"].values[:, robot.coordinates.index("pin.z")]
    assert z[-1] == pytest.approx(speed**2 / (2 * mu * 9.81), rel=0.03)
    carried = result["joint_force"].values[len(z) // 2 :, 0].mean(axis=0)
    assert np.abs(carried).max() == pytest.approx(2.0 * 9.81, rel=0.05)


def test_bushing_that_is_too_short_is_refused():
    with pytest.raises(jp.JointplayError, match=r"2 mm is too short"):
        CylindricalClearance(radial_clearance=PLAY, bearing_length=2e-3)


def test_description_gives_the_same_joint():
    assert Clearance.from_description(ROD.describe()) == ROD
    assert ROD.scaled(0.5).cr == pytest.approx(0.5 * PLAY)


def test_play_lets_each_end_of_the_bushing_go_by_the_clearance():
    play = ROD.play()
    push = play.support(np.array([[3.0, 4.0, 0.0, 0.0, 0.0, 0.0]]))
    assert push.value[0] == pytest.approx(5.0 * PLAY)
    bend = play.support(np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]]))
    assert bend.value[0] == pytest.approx(2.0 * PLAY / ROD.bearing_length)


def test_urdf_has_slider_and_hinge_with_the_stroke_as_limit(floating, tmp_path):
    path = tmp_path / "played.urdf"
    path.write_text(to_urdf(floating(ROD)))
    model = pin.buildModelFromUrdf(str(path))
    slider = model.joints[model.getJointId("pin.z")]
    assert model.upperPositionLimit[slider.idx_q] == pytest.approx(2.0 * ROD.stroke)
    across = model.joints[model.getJointId("pin.x")]
    assert model.upperPositionLimit[across.idx_q] == pytest.approx(2.0 * PLAY)


def test_loop_closed_by_a_rod_leaves_it_to_slide(urdf):
    """A slider-crank whose slider is a rod in a bushing on the ground."""
    path = urdf(
        body("crank", 1.0, "0.02 0 0"),
        body("coupler", 0.5, "0.06 0 0"),
        body("rod", 0.5, "0 0 0"),
        joint("turn", "base", "crank"),
        joint("pin", "crank", "coupler", at="0.05 0 0"),
        joint("wrist", "coupler", "rod", at="0.12 0 0"),
    )
    along = (0.0, np.pi / 2, 0.0)
    loop = Loop("base", "rod", (0.2, 0.0, 0.0), along, (0.03, 0.0, 0.0), along)
    robot = jp.Mechanism(path, {"guide": ROD}, loops={"guide": loop}, gravity=(0, 0, 0))
    assert misfit(robot, np.zeros(3))["guide"].shape == (4,)
    motion = jp.Motion(["turn"], [0, 0.05], [[0.3], [0.8]], "constant-speed")
    with pytest.warns(RuntimeWarning, match="tool error is unknown: .* by an ideal slider"):
        result = jp.simulate(robot, motion, drive={"turn": jp.loads.Prescribed()}, estimate=True)
    assert "by an ideal slider" in result.certificate.note
    found = [figure.name for figure in result.certificate.headline]
    assert "peak joint force" in found
    assert "peak tool error" not in found
    assert np.isfinite(result.certificate["peak joint force"].error)
    slid = []
    for q in result["q"].values[[0, -1]]:
        pin.forwardKinematics(robot.model, robot.data, q)
        slid.append(robot.journal_pose("guide").translation[2])
    assert abs(slid[1] - slid[0]) > 5e-3
    assert result["gap"].min() > -0.1 * PLAY
    with pytest.raises(jp.JointplayError, match="cannot be closed by an ideal slider"):
        jp.Mechanism(
            path,
            {"guide": CylindricalClearance(radial_clearance=PLAY, ideal=True)},
            loops={"guide": loop},
        )


def test_scenario_chooses_the_kind_by_its_word(floating, tmp_path):
    urdf = floating(ROD).description.path
    path = tmp_path / "rod.toml"
    path.write_text(
        f'[robot]\nurdf = "{urdf}"\n\n[joints.pin]\nkind = "cylindrical"\n'
        'radial_clearance = "0.1 mm"\nbearing_length = "25 mm"\n'
    )
    found = Scenario.load(path).simulation().mechanism.clearance["pin"]
    assert found == CylindricalClearance(radial_clearance=1e-4, bearing_length=25e-3)
