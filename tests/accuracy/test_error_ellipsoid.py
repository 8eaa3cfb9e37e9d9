"""The static error set as an ellipsoid: what it encloses, and how the player draws it."""

import zlib

import numpy as np
import pytest
from conftest import body, joint, tip
from packed import unpack

import jointplay as jp
from jointplay.accuracy.ellipsoids import ellipsoids
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.error_model import play_model
from jointplay.show import player

PLAY = 1e-4
TIP = tip("one")


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A heavy arm that stands out from a vertical axis, half a metre long."""
    path = tmp_path_factory.mktemp("ellipsoid") / "arm.urdf"
    links = body("one", mass=3.0, com="0.3 0 0", inertia=0.05) + joint("a", "base", "one") + TIP
    path.write_text(f'<robot name="r"><link name="base"/>{links}</robot>')
    return path


@pytest.fixture(scope="module")
def run(arm):
    """A run in which the arm dwells, and has come to rest."""
    bearing = jp.RevoluteClearance(radial_clearance=PLAY, axial_clearance=PLAY)
    motion = jp.Motion(["a"], [0.0, 0.05, 0.1], [[0.0], [0.05], [0.05]])
    return jp.simulate(jp.Mechanism(arm, {"a": bearing}, tool="tool"), motion, duration=0.2)


def test_a_pins_ellipsoid_is_its_disc(arm):
    mechanism = jp.Mechanism(arm, {"a": jp.RevoluteClearance.planar(radial_clearance=PLAY)})
    found = ellipsoids(play_model(mechanism, {"a": 0.7}))
    sizes = np.linalg.eigvalsh(found.root[0])
    assert sizes[1:] == pytest.approx([PLAY, PLAY], rel=2e-3)
    assert sizes[0] < 2e-3 * PLAY
    assert found.rms[0] == pytest.approx(PLAY, rel=1e-6)


def test_no_place_that_the_tool_can_take_is_outside(arm):
    bearing = jp.RevoluteClearance(radial_clearance=PLAY, axial_clearance=2e-4)
    mechanism = jp.Mechanism(arm, {"a": bearing})
    plays = play_model(mechanism, {"a": 0.7})
    found = ellipsoids(plays)
    d = np.random.default_rng(0).normal(size=(1, 500, 3))
    d /= np.linalg.norm(d, axis=2, keepdims=True)
    reach = plays.along(d).value.sum(axis=0)[0]
    own = np.linalg.norm(d[0] @ found.root[0], axis=1)
    assert (reach <= own * 1.02).all()
    assert (own / reach).min() < 1.05  # and it touches the set
    assert found.worst[0] == pytest.approx(budget(mechanism, {"a": 0.7}).worst[0], rel=0.03)


def test_the_page_holds_the_set_along_the_run_and_the_tool_rests_in_it(run):
    _, scene = player.page({"arm": run})
    case = scene.contents["cases"][0]
    block = zlib.decompress(scene.block)
    time = unpack(block, case["error"]["time"])[:, 0]
    rows = unpack(block, case["error"]["set"])
    assert time[[0, -1]] == pytest.approx([0.0, 0.2], abs=1e-6)
    xx, xy, xz, yy, yz, zz = rows[-1, :6]
    root = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    away = unpack(block, case["tool"])[-1] - unpack(block, case["ghost"]["tool"])[-1]
    # Contacts deflect a little under the weight.
    assert np.linalg.norm(np.linalg.solve(root, away)) < 1.1
    assert away[2] < -0.5 * rows[-1, 6]
    assert rows[-1, 7] <= rows[-1, 6]


def test_without_a_twin_there_is_no_ellipsoid(run):
    _, scene = player.page({"arm": run}, ghosts=False)
    assert scene.contents["cases"][0]["error"] is None


def test_the_player_draws_it_about_the_ideal_tool_and_says_what_it_is(open_page, run, tmp_path):
    path = player.save_html({"arm": run}, tmp_path / "arm.html")
    tab = open_page(path.as_uri())
    tab.evaluate("() => { window.jointplay.setDeviation(20); window.jointplay.seek(0.2); }")
    drawn, row, centre = tab.evaluate(
        """() => {
            const c = window.jointplay.cases[0], rows = c.idealTool.values;
            return [c.error.node.matrix.elements, c.errorAt(0.2), [...rows.slice(-3)]];
        }"""
    )
    matrix = np.array(drawn).reshape(4, 4).T
    assert matrix[:3, 3] == pytest.approx(centre, abs=1e-6)
    assert matrix[[0, 1, 2], [0, 1, 2]] == pytest.approx(20.0 * np.array(row)[[0, 3, 5]])
    text = tab.inner_text("#error-is")
    assert f"worst case {1e3 * row[6]:.3g} mm" in text
    assert "drawn × 20" in text
    shown = "window.jointplay.cases[0].error.node.visible"
    assert tab.evaluate(shown)
    tab.uncheck("#error")
    assert not tab.evaluate(shown)
