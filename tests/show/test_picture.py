"""Pictures of mechanisms: what was drawn, and where."""

import io

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.robots import robot_urdf
from jointplay.show.picture import picture

PLAY = {"radial_clearance": 2e-4, "axial_clearance": 1e-4}


def pixels(figure):
    file = io.BytesIO()
    figure.savefig(file, format="rgba", dpi=60)
    width, height = (round(60 * inch) for inch in figure.get_size_inches())
    return np.frombuffer(file.getvalue(), np.uint8).reshape(height, width, 4)[..., :3]


def texts(figure):
    return [text.get_text() for text in figure.axes[0].texts]


def test_scara_with_its_colours_and_its_play():
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": jp.RevoluteClearance(**PLAY)})
    figure = picture(robot, title="arm")
    assert any("joint_b" in text and "0.1 mm and 0.2 mm" in text for text in texts(figure))
    assert figure.axes[0].get_title() == "arm"
    assert figure.axes[0].get_xlabel() == "x [m]"
    image = pixels(figure).reshape(-1, 3).astype(int)
    blue = (image[:, 2] - image[:, 0] > 60).mean()
    orange = (image[:, 0] - image[:, 2] > 80).mean()
    assert blue > 0.005  # the two arms' colours in the URDF
    assert orange > 0.005
    moved = robot.configuration({"joint_a": 1.2})
    assert (pixels(picture(robot, moved)) != pixels(figure)).mean() > 0.02


def test_loops_are_drawn_closed():
    scenario = jp.Scenario.load("jointplay:four_bar.toml")
    run = scenario.ready_run("ideal")
    drawn = texts(picture(run.mechanism, run.workspace.q))
    assert any("rocker_end" in text and "closes a loop" in text for text in drawn)


def test_every_bearing_has_its_ring_at_its_place(urdf):
    path = urdf(
        body("a"), body("b"), joint("one", "base", "a"), joint("two", "a", "b", at="0.4 0 0.1")
    )
    robot = jp.Mechanism(
        path, {"one": jp.RevoluteClearance(**PLAY), "two": jp.RevoluteClearance(**PLAY)}
    )
    figure = picture(robot)
    rings = [np.mean(line.get_data_3d(), axis=1) for line in figure.axes[0].lines if
             len(line.get_data_3d()[0]) > 10]  # fmt: skip
    assert np.allclose(
        sorted(map(tuple, np.round(rings, 2))), [(0, 0, 0), (0.4, 0, 0.1)], atol=0.02
    )


def test_missing_meshes_are_named_and_stood_in_for(urdf):
    mesh = '<visual><geometry><mesh filename="package://gone/arm.stl"/></geometry></visual>'
    link = body("a").replace("</link>", f"{mesh}</link>")
    path = urdf(link, body("b"), joint("one", "base", "a"), joint("two", "a", "b", at="0.4 0 0"))
    figure = picture(jp.Mechanism(path))
    assert any("arm.stl" in text.get_text() for text in figure.texts)
    assert pixels(figure).std() > 5


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_meshes_of_arms_people_have(name):
    robot = jp.Mechanism(robot_urdf(name))
    figure = picture(robot)
    assert not figure.texts  # nothing missing
    faces = figure.axes[0].collections[0].get_facecolor()
    assert len(faces) > 10_000


def test_wrong_configuration_is_refused():
    robot = jp.Mechanism(jp.shipped("scara.urdf"))
    with pytest.raises(jp.JointplayError, match="joint_a"):
        picture(robot, np.zeros(3))
