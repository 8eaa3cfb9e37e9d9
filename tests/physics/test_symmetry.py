"""What cannot matter does not matter: mirrors, the orientation of the world, who is called A."""

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp

PLAY = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
START = np.array([5e-5, -8e-5, 3e-5, 0.0, 2e-3, -3e-3])
SWING = np.array([0.5, -0.8])


def swing(urdf, sign=(1.0, 1.0), start=START, rpy="0 0 0", gravity=(0, 0, 0), duration=0.06):
    path = urdf(
        body("one", 3.0, "0.15 0 0"),
        body("two", 2.0, "0.1 0 0"),
        joint("a", "base", "one", rpy=rpy),
        joint("b", "one", "two", at="0.3 0 0"),
    )
    robot = jp.Mechanism(path, {"b": PLAY}, gravity=gravity)
    motion = jp.Motion(["a", "b"], [0.0, 0.1], [[0.0, 0.0], sign * SWING])
    run = jp.Run(jp.Simulation(robot, motion, duration=duration, start="centred"))
    run.workspace.q[1:] = start
    return run.finish()


MIRRORS = {  # signs of a, x, y, z, yaw, pitch, roll and of gravity; contacts that change places
    "xz": ([-1, 1, -1, 1, -1, 1, -1], (1, -1, 1), [0, 1, 2, 3]),
    "xy": ([1, 1, 1, -1, 1, -1, -1], (1, 1, -1), [1, 0, 3, 2]),
}


@pytest.mark.parametrize("gravity", [(0, 0, 0), (2.0, 5.0, -9.81)])
@pytest.mark.parametrize(("signs", "flip", "places"), MIRRORS.values(), ids=MIRRORS)
def test_mirrored_scene_gives_the_mirrored_motion(urdf, signs, flip, places, gravity):
    signs, flip = np.array(signs, float), np.array(flip, float)
    original = swing(urdf, gravity=gravity)
    mirrored = swing(urdf, signs[[0, 4]], signs[1:] * START, gravity=tuple(flip * gravity))
    assert original.audit.impacts == mirrored.audit.impacts > 10
    assert np.allclose(original["q"], signs * mirrored["q"], rtol=0, atol=1e-12)
    force, image = (result["normal_force_peak"].values[:, 0] for result in (original, mirrored))
    assert np.allclose(force, image[:, places], rtol=1e-9, atol=1e-9)
    force, image = (result["joint_force_peak"].values[:, 0] for result in (original, mirrored))
    assert np.allclose(force, flip * image, rtol=1e-9, atol=1e-6)


def test_orientation_of_the_world_does_not_matter(urdf):
    """The robot mounted aslant, gravity turned with it: the same motion in its own axes."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", [0.4, -1.1, 2.0]).as_matrix()
    gravity = np.array([2.0, 5.0, -9.81])
    upright = swing(urdf, gravity=gravity, duration=0.03)
    aslant = swing(urdf, rpy="0.4 -1.1 2.0", gravity=tuple(turn @ gravity), duration=0.03)
    assert upright.audit.impacts > 5
    assert np.allclose(upright["q"], aslant["q"], rtol=0, atol=1e-9)
    for name in ("joint_force_peak", "tool_position", "tool_velocity"):
        own = upright[name].values.reshape(len(upright.time), 3)
        world = aslant[name].values.reshape(len(upright.time), 3)
        assert np.allclose(own @ turn.T, world, rtol=1e-5, atol=1e-5 * np.abs(own).max())
