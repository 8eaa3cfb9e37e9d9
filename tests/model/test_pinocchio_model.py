"""Robots that are Pinocchio models already."""

import numpy as np
import pinocchio as pin
import pytest

import jointplay as jp
from jointplay.base.errors import JointplayError


def arm():
    """Two turning joints and a slide, oblique, with a frame beyond the last body."""
    model = pin.Model()
    model.name = "arm"
    rng, parent = np.random.default_rng(3), 0
    for name, joint in (
        ("shoulder", pin.JointModelRZ()),
        ("elbow", pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8]))),
        ("lift", pin.JointModelPX()),
    ):
        limits = np.array([5.0]), np.array([2.0]), np.array([-1.0]), np.array([1.5])
        parent = model.addJoint(parent, joint, pin.SE3.Random(), name, *limits)
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
        model.inertias[parent] = pin.Inertia(
            1.0 + rng.random(), 0.1 * rng.random(3), np.diag([0.02, 0.03, 0.04])
        )
    place = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.0, 0.1, 0.2]))
    model.addFrame(pin.Frame("tip", parent, 0, place, pin.FrameType.OP_FRAME))
    model.armature[:] = [0.1, 0.0, 0.2]
    return model


def test_a_model_keeps_its_placements_masses_gravity_and_armature():
    model = arm()
    model.gravity.linear = np.array([0.0, 1.0, -9.0])
    robot = jp.Mechanism(model, tool="tip")
    assert robot.joints == ("shoulder", "elbow", "lift")
    assert robot.gravity == (0.0, 1.0, -9.0)
    data, q = model.createData(), np.array([0.3, -0.4, 0.2])
    mass = pin.crba(model, data, q)
    assert robot.mass_matrix(q) == pytest.approx(np.triu(mass) + np.triu(mass, 1).T, abs=1e-12)
    weight = pin.computeGeneralizedGravity(model, data, q)
    assert robot.gravity_forces(q) == pytest.approx(weight, abs=1e-12)
    pin.framesForwardKinematics(model, data, q)
    pin.framesForwardKinematics(robot.model, robot.data, q)
    wanted = data.oMf[model.getFrameId("tip")].homogeneous
    assert robot.data.oMf[robot.tool_frame].homogeneous == pytest.approx(wanted, abs=1e-12)
    entry = robot.description.joints["elbow"]
    assert (entry.lower, entry.upper, entry.effort, entry.speed) == (-1.0, 1.5, 5.0, 2.0)


def test_a_model_with_a_floating_base_is_refused_by_name():
    with pytest.raises(JointplayError, match="'root_joint' of the Pinocchio model is a FreeFlyer"):
        jp.Mechanism(pin.buildSampleModelHumanoid())


def test_no_name_of_a_model_has_a_tab():
    loose = {"joint_b": jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)}
    robot = jp.Mechanism("jointplay:scara.urdf", loose, gears={"joint_a": jp.Gear(1e-3)})
    assert not any("\t" in name for name in robot.model.names)
