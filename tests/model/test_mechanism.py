"""Models with virtual links against the ideal robot, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

from jointplay import JointplayError, Mechanism, RevoluteClearance, shipped
from jointplay.scenario.robot import robot_scenario
from jointplay.simulation.simulation import Simulation

PLAY = RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
AXES = ["1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0.6 0 0.8", "-0.48 0.64 0.6"]


def chain(urdf, axis, kind="revolute"):
    return urdf(
        *(body(f"l{i}", 1.0 + i, "0.1 0.02 -0.03", 0.01 * (i + 1)) for i in range(3)),
        joint("j0", "base", "l0", kind, axis, "0 0 0.1", "0.2 0.1 0.3"),
        joint("j1", "l0", "l1", kind, axis, "0.3 0.1 0", "0 0.4 -0.2"),
        joint("j2", "l1", "l2", kind, axis, "0.2 0 0.1", "1.0 0 0"),
    )


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("worn", ["j0", "j1", "j2"])
def test_centred_journals_move_like_the_ideal_robot(urdf, axis, worn):
    path = chain(urdf, axis)
    ideal, real = Mechanism(path), Mechanism(path, {worn: PLAY})
    positions = {"j0": 0.7, "j1": -1.1, "j2": 0.4}
    q_ideal, q_real = (m.configuration(positions) for m in (ideal, real))
    for mechanism, q in ((ideal, q_ideal), (real, q_real)):
        pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    for name in ("l0", "l1", "l2"):
        places = [m.data.oMf[m.model.getFrameId(name)].homogeneous for m in (ideal, real)]
        assert np.allclose(*places, atol=1e-14)
    columns = [real.coordinate(name) for name in ("j0", "j1", "j2")]
    full = pin.crba(real.model, real.data, q_real)
    full = np.triu(full) + np.triu(full, 1).T
    small = pin.crba(ideal.model, ideal.data, q_ideal)
    small = np.triu(small) + np.triu(small, 1).T
    assert np.allclose(full[np.ix_(columns, columns)], small, atol=1e-13)
    assert pin.computeTotalMass(real.model) == pytest.approx(6.0)
    centres = [pin.centerOfMass(m.model, m.data, q) for m, q in ((ideal, q_ideal), (real, q_real))]
    assert np.allclose(*centres, atol=1e-14)


def test_coordinates_are_named_and_found(urdf):
    mechanism = Mechanism(chain(urdf, "0 0 1"), {"j1": PLAY})
    link = tuple(f"j1.{c}" for c in ("x", "y", "z", "yaw", "pitch", "roll"))
    assert mechanism.coordinates == ("j0", *link, "j2")
    assert mechanism.joints == ("j0", "j1", "j2")
    assert mechanism.coordinate("j1") == 4
    assert mechanism.model.nv == 8


def test_continuous_joints_become_revolute_with_one_coordinate(urdf):
    path = chain(urdf, "0 1 0", kind="continuous")
    mechanism = Mechanism(path, {"j0": PLAY})
    assert mechanism.model.nq == mechanism.model.nv == 8
    assert mechanism.description.revolute == ["j0", "j1", "j2"]


def test_unknown_joint_answers_with_the_revolute_ones():
    with pytest.raises(JointplayError, match="joint_a, joint_b, joint_c"):
        Mechanism(shipped("scara.urdf"), {"elbow": PLAY})


def test_prismatic_joint_is_refused():
    with pytest.raises(JointplayError, match="'stroke' is prismatic, not revolute"):
        Mechanism(shipped("scara.urdf"), {"stroke": PLAY})


def test_floating_joint_is_refused(urdf):
    path = urdf(
        body("l"), body("l0"), joint("j", "base", "l"), joint("free", "l", "l0", "floating")
    )
    with pytest.raises(JointplayError, match="'free' is of the kind FreeFlyer"):
        Mechanism(path)


def test_impossible_inertia_is_refused_unless_named():
    path = shipped("scara_as_printed.urdf")
    with pytest.raises(JointplayError, match=r"'arm1'.*4\.937 > 0\.1689 \+ 3\.08"):
        Mechanism(path)
    assert Mechanism(path, allow_unphysical=["arm1"]).model.nv == 4
    assert Mechanism(path, allow_unphysical=["all"]).model.nv == 4
    with pytest.raises(JointplayError, match="no link 'arm9'"):
        Mechanism(path, allow_unphysical=["arm9"])


@pytest.mark.parametrize(
    ("element", "named"),
    [
        (body("l0", mass=-1.0), "mass -1 kg"),
        (body("l0", inertia=-0.1), "not positive definite"),
        (body("l0", inertia="nan"), "'nan'"),
        (body("l0").replace('<mass value="2.0"/>', ""), "mass value is missing in the URDF"),
    ],
)
def test_impossible_bodies_are_named(urdf, element, named):
    with pytest.raises(JointplayError, match="'l0'") as caught:
        Mechanism(urdf(element, joint("j", "base", "l0")))
    assert named in str(caught.value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("<robot", "not well-formed"),
        ("<html/>", "root <html>"),
        ('<robot name="r"/>', "no links"),
        ('<robot name="r"><link name="a"/><joint name="j" type="revolute"/></robot>', "parent of"),
    ],
)
def test_malformed_files_are_refused_in_one_line(tmp_path, text, named):
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(JointplayError, match=named) as caught:
        Mechanism(path)
    assert "\n" not in str(caught.value)


def test_missing_files_and_frames_are_named():
    with pytest.raises(JointplayError, match=r"none\.urdf"):
        Mechanism("none.urdf")
    with pytest.raises(JointplayError, match="suction_cup"):
        Mechanism(shipped("scara.urdf"), tool="hammer")
    with pytest.raises(JointplayError, match=r"scara_motion\.csv"):
        shipped("ur5.urdf")
    with pytest.raises(JointplayError, match="three components"):
        Mechanism(shipped("scara.urdf"), gravity=(0, 0))


def test_description_round_trip():
    mechanism = Mechanism(shipped("scara.urdf"), {"joint_b": PLAY}, gravity=(0, 0, -1.62))
    again = Mechanism.from_description(mechanism.describe())
    assert again.describe() == mechanism.describe()
    assert again.coordinates == mechanism.coordinates


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"clearance": ["joint_b"]}, "clearance must be a dictionary of joints by name"),
        ({"clearance": "joint_b"}, "clearance must be a dictionary"),
        ({"loops": ["x"]}, "loops must be a dictionary of loops by name"),
        ({"gears": "x"}, "gears must be a dictionary of gears by joint"),
        ({"gears": {"joint_b": 3}}, "joint 'joint_b' needs a Gear, got 3"),
        ({"flexible": ["x"]}, "flexible must be a dictionary"),
        ({"gravity": 9.81}, "gravity must have three components, got 9.81"),
        ({"allow_unphysical": "arm1"}, "must be a list of names of links, got 'arm1'"),
        ({"path": 3}, "needs the path of a URDF, a robot's name or a pinocchio.Model, got 3"),
    ],
)
def test_the_wrong_container_is_refused_in_words(given, said):
    with pytest.raises(JointplayError, match=said):
        Mechanism(**({"path": "jointplay:scara.urdf"} | given))


def test_one_name_is_no_list_of_names():
    with pytest.raises(JointplayError, match="joints must be a list of names, got 'elbow_joint'"):
        robot_scenario("ur5", "elbow_joint")
    with pytest.raises(JointplayError, match="state must be a dictionary of positions"):
        Simulation(Mechanism("jointplay:scara.urdf"), duration=1.0, state=[0.1])


@pytest.mark.parametrize(
    "ask",
    [
        lambda: Mechanism(shipped("scara.urdf"), {"jont_b": PLAY}),
        lambda: Mechanism(shipped("scara.urdf")).coordinate("jont_b"),
    ],
)
def test_a_wrong_joint_is_answered_by_the_nearest_of_those_that_move(ask):
    with pytest.raises(JointplayError, match=r'joint .jont_b.; did you mean "joint_b"\?') as caught:
        ask()
    assert "suction" not in str(caught.value)
