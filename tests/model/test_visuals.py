"""A mechanism's shapes and visualizer, for those who work with Pinocchio."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.robots import robot_urdf
from jointplay.model.visuals import look
from jointplay.paper import scara
from jointplay.show.plots.figures import _skeleton

SHAPE = """<{tag}><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/>
  <geometry><{form}/></geometry></{tag}>"""


def link(name):
    """A body with a box to be seen and a ball to be hit."""
    shapes = SHAPE.format(tag="visual", form='box size="0.1 0.2 0.3"')
    shapes += SHAPE.format(tag="collision", form='sphere radius="0.2"')
    return body(name).replace("</link>", f"{shapes}</link>")


@pytest.fixture
def robot(urdf):
    return urdf(
        link("l0"),
        link("l1"),
        joint("j0", "base", "l0", axis="0 1 0", at="0 0 0.1", rpy="0.2 0.1 0.3"),
        joint("j1", "l0", "l1", axis="0.6 0 0.8", at="0.3 0.1 0", rpy="0 0.4 -0.2"),
    )


@pytest.mark.parametrize("play", [{}, {"j1": jp.RevoluteClearance.planar(radial_clearance=2e-4)}])
def test_shapes_stand_where_pinocchio_puts_those_of_the_urdf(robot, play):
    mechanism = jp.Mechanism(robot, play)
    source = pin.buildModelFromUrdf(str(robot))
    for ours, kind in (
        (mechanism.visual_model, pin.GeometryType.VISUAL),
        (mechanism.collision_model, pin.GeometryType.COLLISION),
    ):
        theirs = pin.buildGeomFromUrdf(source, str(robot), kind)
        places = []
        for model, shapes in ((mechanism.model, ours), (source, theirs)):
            data, found = model.createData(), pin.GeometryData(shapes)
            q = pin.neutral(model)
            q[0] = 0.7
            if model is mechanism.model:
                q = mechanism.configuration({"j0": 0.7, "j1": -0.4})
            else:
                q[1] = -0.4
            pin.updateGeometryPlacements(model, data, shapes, found, q)
            places.append([place.homogeneous for place in found.oMg])
        kept = [i for i, shape in enumerate(ours.geometryObjects) if "stand_in" not in shape.name]
        assert len(kept) == len(places[1]) == 2
        assert np.abs(np.array(places[0])[kept] - places[1]).max() < 1e-12


def test_the_visualizer_plays_the_coordinates_of_a_result():
    result = dataclasses.replace(scara(2e-4, seed=3), duration=0.02).run()
    mechanism = result.simulation.mechanism
    viz = mechanism.visualizer()
    shown = []
    viz.play(result.q[::50], None, lambda i: shown.append(viz.data.oMi[-1].copy()))
    model, data = mechanism.model, mechanism.model.createData()
    assert len(shown) == len(result.q[::50]) > 3
    for place, q in zip(shown, result.q[::50], strict=True):
        pin.forwardKinematics(model, data, q)
        assert place.isApprox(data.oMi[-1], 1e-12)
    assert result.v.shape == (len(result.time), model.nv)
    assert "iframe" in viz.viewer.jupyter_cell().data
    page = viz.viewer.static_html()
    assert len(page) > 1e5


def test_loops_are_shown_closed():
    mechanism = jp.Scenario.load("jointplay:four_bar.toml").simulation("ideal").mechanism
    viz = mechanism.visualizer()
    for name in mechanism.loops:
        (i, bearing), (j, journal) = mechanism.frames(name)
        gap = (viz.data.oMi[i] * bearing).actInv(viz.data.oMi[j] * journal).translation
        assert np.abs(gap).max() < 1e-6


def test_collision_meshes_that_are_missing_are_left_out(urdf):
    shape = SHAPE.format(tag="collision", form='mesh filename="package://none/none.stl"')
    path = urdf(body("l0").replace("</link>", f"{shape}</link>"), joint("j0", "base", "l0"))
    assert jp.Mechanism(path).collision_model.ngeoms == 0


def test_collada_meshes_are_shown_whole():
    mechanism = jp.Mechanism(robot_urdf("ur5"))
    given = [shape.meshPath for shape in mechanism.visual_model.geometryObjects]
    assert all(path.endswith(".dae") for path in given)
    viz = mechanism.visualizer()
    # What has no file any more goes to the browser triangle by triangle, all that coal has read.
    assert {shape.meshPath for shape in viz.visual_model.geometryObjects} == {""}
    assert sum(shape.geometry.num_tris for shape in viz.visual_model.geometryObjects) > 10_000
    assert [shape.meshPath for shape in mechanism.visual_model.geometryObjects] == given


def test_rods_reach_from_their_joint_to_the_ends_of_loops_on_them(urdf):
    """A four-bar whose rocker is closed to the ground: the rocker whole, nothing of the base."""
    robot = urdf(
        *(body(name) for name in ("crank", "rod", "rocker")),
        joint("j1", "base", "crank", at="0.1 0.1 0"),
        joint("j2", "crank", "rod", at="0.1 0 0"),
        joint("j3", "rod", "rocker", at="0.3 0 0"),
    )
    end = jp.Loop("rocker", "base", bearing_xyz=(0.0, -0.2, 0.0), journal_xyz=(0.5, -0.1, 0.0))
    mechanism = jp.Mechanism(robot, loops={"ground": end})
    middles = [
        shape.frame[:3, 3].tolist()
        for shape in look(mechanism).shapes
        if shape.link == "rocker" and shape.form[1][1] > 0.0
    ]
    assert middles == [[0.0, -0.1, 0.0]]
    lines = _skeleton(mechanism, mechanism.configuration({}))
    drawn = [line.round(9).tolist() for line in lines]
    assert [[0.5, 0.1, 0.0], [0.5, -0.1, 0.0]] in drawn
    assert not any(line[0] == [0.0, 0.0, 0.0] for line in drawn)
