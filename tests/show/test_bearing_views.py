"""Rolling bearings in results: life over a motion, figures, playback, commands."""

import itertools
import math
import zlib
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from browsing import picture
from conftest import body, joint
from packed import unpack

import jointplay as jp
from jointplay import analysis
from jointplay.base.errors import JointplayError, MissingName
from jointplay.show import player
from jointplay.simulation.analysis.headline import headline

BALLS = jp.BallBearing(designation="6010/C3")
PAIR = jp.BallBearing(designation="7206 B DB", preload=200.0)
ROLLERS = jp.CrossedRollerBearing(designation="RB5013 C0")
TURN, DURATION = 2.0 * math.pi * 2.0, 0.1


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """A chain of four links, for joints with a bearing of each kind and a journal."""
    path = tmp_path_factory.mktemp("robot") / "chain.urdf"
    parts = ['<link name="base"/>', body("a", 5.0, "0.1 0 0"), body("b", com="0.1 0 0")]
    parts += [body("c", com="0.1 0 0"), body("d", com="0.1 0 0"), '<link name="tip"/>']
    parts += [joint("balls", "base", "a"), joint("pair", "a", "b", at="0.3 0 0")]
    parts += [joint("rollers", "b", "c", at="0.2 0 0"), joint("plain", "c", "d", at="0.2 0 0")]
    parts += [joint("end", "d", "tip", "fixed", at="0.2 0 0")]
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    return path


@pytest.fixture(scope="module")
def mixed(robot):
    """A run of the chain with a bearing of each kind and a journal."""
    journal = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    joints = {"balls": BALLS, "pair": PAIR, "rollers": ROLLERS, "plain": journal}
    return run(robot, joints)


def run(robot, joints, duration=DURATION):
    mechanism = jp.Mechanism(robot, joints, tool="tip", gravity=(0.0, -9.81, 0.0))
    names = mechanism.joints
    way = np.zeros((2, len(names)))
    way[1, 0] = TURN * duration
    motion = jp.Motion(names, [0.0, duration], way)
    return jp.simulate(mechanism, motion, duration=duration, limits="ignore")


# Loads and life.


def test_loads_of_elements_are_those_that_were_recorded(mixed):
    for name in ("balls", "pair", "rollers"):
        loads = analysis.element_loads(mixed, name)
        assert loads.dims == ("time", "element")
        counted = (loads > 0.0).sum("element").values
        assert (counted == mixed["loaded_elements"].sel(joint=name).values).mean() > 0.99
        contact = "rollers" if name == "rollers" else "balls"
        recorded = mixed["normal_force"].sel(joint=name, contact=contact).values
        assert loads.max("element").values[1:] == pytest.approx(recorded[1:], rel=0.02, abs=1.0)


def test_many_places_are_loaded_as_one_by_one():
    random = np.random.default_rng(3)
    for bearing in (BALLS, PAIR, ROLLERS):
        places, cages = 2e-5 * random.normal(size=(5, 6)), random.uniform(0.0, 6.0, 5)
        one = [bearing.load(place, cage) for place, cage in zip(places, cages, strict=True)]
        axes = np.array([pin.exp3(place[3:])[:, 2] for place in places])
        loads, angles = bearing.element_loads(places[:, :3], axes, cages)
        assert loads == pytest.approx(np.array([state.loads for state in one]))
        assert angles == pytest.approx(np.array([state.contact_angles for state in one]))
        lives = [bearing.life(state.loads) for state in one]
        assert bearing.damage_of_turn(loads) == pytest.approx(1.0 / np.array(lives))


def test_life_over_a_motion_is_that_of_its_loads(mixed):
    life = analysis.bearing_life(mixed, "balls", start=0.0)
    assert life.turned == pytest.approx(TURN * DURATION / (2.0 * math.pi), rel=0.01)
    assert life.swing == pytest.approx(TURN * DURATION, rel=0.02)
    assert not life.oscillates
    lives = [BALLS.life(loads) for loads in analysis.element_loads(mixed, "balls").values[::20]]
    assert min(lives) <= life.revolutions <= max(lives)
    assert life.hours == pytest.approx(life.revolutions / life.turned * DURATION / 3600.0)
    assert life.friction_work == pytest.approx(life.mean_torque * TURN * DURATION, rel=0.02)
    assert life.most_loaded <= life.elements == 14
    assert "life L10" in str(life)


def test_life_is_that_of_lasting_loads_in_closed_form(monkeypatch, mixed):
    """With half of the travel at one load and half at another, the harmonic mean of their lives."""
    time = mixed.time
    loads = np.zeros((len(time), 14))
    loads[:, :3] = np.where(np.arange(len(time)) < len(time) // 2, 1000.0, 300.0)[:, None]
    monkeypatch.setattr(
        "jointplay.simulation.analysis.bearings.element_loads",
        lambda result, joint: type("", (), {"values": loads}),
    )
    steady = mixed.dataset.copy()
    cage = np.linspace(0.0, 1.0, len(time))[:, None] * np.ones(len(mixed.joints))
    steady["cage_angle"] = (("time", "joint"), cage)
    life = analysis.bearing_life(jp.Result(steady), "balls", start=0.0)
    heavy, light = BALLS.life(loads[0]), BALLS.life(loads[-1])
    assert life.revolutions == pytest.approx(2.0 / (1.0 / heavy + 1.0 / light), rel=2e-3)


def test_what_does_not_turn_lives_without_end(mixed):
    still = mixed.dataset.copy()
    still["cage_angle"] = 0.0 * still["cage_angle"]
    life = analysis.bearing_life(jp.Result(still), "balls", start=0.0)
    assert life.revolutions == life.hours == math.inf
    assert life.damage == life.turned == life.mean_torque == 0.0
    assert "unlimited" in str(life)


def test_life_is_refused_where_there_is_no_bearing(mixed):
    with pytest.raises(JointplayError, match="no rolling bearing; those that have one: balls"):
        analysis.bearing_life(mixed, "plain")
    with pytest.raises(MissingName, match="clearance joint"):
        analysis.bearing_life(mixed, "bals")
    with pytest.raises(JointplayError, match="fewer than two records"):
        analysis.bearing_life(mixed, "balls", start=1e3)


def test_the_summary_says_life_of_bearings_alone(mixed):
    text = "\n".join(headline(mixed, None))
    assert "balls: largest element load" in text or "balls from" in text
    assert text.count("life L10") == 3
    assert text.count("it swings by") == 2  # those that are held


# Playback.


def test_the_page_has_what_elements_do(mixed):
    _, scene = player.page({"a": mixed}, ghosts=False)
    block = zlib.decompress(scene.block)
    entry = scene.contents["cases"][0]
    found = {one["name"]: one for one in entry["joints"]}
    assert found["plain"]["elements"] is None
    for name, bearing in (("balls", BALLS), ("pair", PAIR), ("rollers", ROLLERS)):
        elements = found[name]["elements"]
        assert elements["rollers"] == (name == "rollers")
        loads = unpack(block, elements["loads"])
        assert loads.shape[1] == len(bearing.row_places) * bearing.count
        expected = analysis.element_loads(mixed, name).values
        moments = np.searchsorted(mixed.time, unpack(block, entry["time"])[:, 0] - 1e-7)
        assert loads == pytest.approx(expected[moments], abs=1.1 * elements["loads"]["quantum"])
        assert 10.0 <= found[name]["magnification"] <= 1e4
    # The arrow pushes the inner ring inwards, where the most loaded element touches it.
    force = unpack(block, found["balls"]["normal"])
    place = unpack(block, found["balls"]["place"])
    pushed = np.linalg.norm(force, axis=1) > 0.0
    assert (np.sum(force[pushed, :2] * place[pushed, :2], axis=1) < 0.0).all()
    race = 0.5 * (BALLS.d_pitch - BALLS.d_element)
    assert np.hypot(*place[pushed, :2].T) == pytest.approx(np.full(pushed.sum(), race), rel=0.02)


def test_rolling_bearings_have_close_ups(open_page, mixed, tmp_path):
    path = player.save_html({"a": mixed}, tmp_path / "a.html", ghosts=False)
    tab = open_page(path.as_uri())
    shots = []
    for name in ("balls", "pair", "rollers", "plain"):
        tab.evaluate(f"window.jointplay.setJoint({name!r}); window.jointplay.setLayout('closeup')")
        tab.evaluate("window.jointplay.seek(0.05)")
        shots.append(picture(tab))
        words = tab.inner_text(".closeup")
        assert ("loaded" in words) == (name != "plain"), words
        assert ("roller load" in words) == (name == "rollers")
    for one, two in itertools.pairwise(shots):
        assert np.abs(one - two).mean() > 1e-3
    tab.evaluate("window.jointplay.setJoint('balls'); window.jointplay.seek(0.09)")
    assert np.abs(picture(tab) - shots[0]).mean() > 1e-4
    assert "or balls or rollers under load" in tab.inner_text("#modes")


# Figures and reports.


def test_orbits_are_in_micrometres_within_the_play_in_operation(mixed):
    for name, room in (("balls", BALLS.radial_travel), ("rollers", ROLLERS.radial_travel)):
        outline = analysis.clearance_outline(mixed, name)
        assert np.hypot(*outline) == pytest.approx(np.full(361, room))
        panel = mixed.plot.orbit(name).axes[0]
        assert panel.get_xlabel() == "x in the outer ring's frame [µm]"
        assert f"±{1e6 * room:.3g} µm" in panel.get_title()
    assert analysis.clearance_outline(mixed, "pair") is None
    assert "no play" in mixed.plot.orbit("pair").axes[0].get_title()
    assert "bearing frame [mm]" in mixed.plot.orbit("plain").axes[0].get_xlabel()


def test_plots_of_bearings_have_their_words(mixed):
    loaded = mixed["loaded_elements"].sel(joint="balls").values
    assert mixed.plot.loaded().axes[0].get_lines()[0].get_ydata() == pytest.approx(loaded)
    for name, plot, words in (
        ("pair", "contacts", "largest element load [N]"),
        ("plain", "contacts", "normal force [N]"),
        ("rollers", "gaps", "least gap of elements [µm]"),
    ):
        assert getattr(mixed.plot, plot)(name).axes[0].get_ylabel() == words
    ticks = mixed.plot.modes("balls").axes[0].get_yticklabels()
    assert ["elements" in label.get_text() for label in ticks] == [False, True]
    with pytest.raises(JointplayError, match="joint 'plain' has none"):
        mixed.plot.loaded("plain")


def test_figures_of_bearings_are_drawn_where_there_are_any(mixed, robot):
    from jointplay.show.plots.figures import _charts

    assert "bearing_loads" in dict(_charts({"a": mixed}))
    assert "bearing_loads" not in dict(_charts({"a": run(robot, {}, 0.01)}))


def test_reports_say_loads_and_lives_of_bearings(mixed, tmp_path):
    from jointplay.show.reports import report

    path = tmp_path / "a.html"
    report({"a": mixed}, path, impacts=0, pdf=False)
    text = path.read_text()
    assert "Rolling bearings" in text
    assert "life L10" in text
    assert "6010/C3" in text
    assert "radial clearance 13.5 µm: middle of C3" in text
    assert "<h2>Bearings</h2>" in text
    assert "false brinelling" in text  # the pair does not turn
    assert "largest element load [N]" in text


# Commands that know nothing of elements, and those that refuse them.


EVERY = {"balls": BALLS, "pair": PAIR, "rollers": ROLLERS}


@pytest.mark.parametrize("name", EVERY)
def test_reduced_bearings_have_their_own_friction_and_stiffness(robot, name):
    from jointplay.accuracy.error_model import play_model
    from jointplay.bridges.reduction import reduce

    bearing = EVERY[name]
    mechanism = jp.Mechanism(robot, {"balls": bearing}, tool="tip", gravity=(0, 0, -9.81))
    model = reduce(mechanism, "balls", period=0.2)
    load = play_model(mechanism, {}).load[0, 0]
    rest = bearing.deflection(load[:3], [*load[3:5], 0.0])
    loads = bearing.load(rest).loads.sum()
    expected = bearing.drag + bearing.friction_lever * loads
    assert model.friction == pytest.approx(expected, rel=0.15)
    assert (model.tilt == 0.0) == (name == "pair")
    lean = math.hypot(*rest[3:5])
    assert model.tilt + math.hypot(*load[3:5]) / model.tilt_stiffness == pytest.approx(
        lean, rel=0.2
    )


def test_bearings_do_not_wear(robot):
    from jointplay.study.wear import wear

    mechanism = jp.Mechanism(robot, {"balls": BALLS}, tool="tip")
    simulation = jp.Simulation(mechanism, duration=0.01, limits="ignore")
    with pytest.raises(JointplayError, match="rating life L10"):
        wear(simulation, "balls", 1e-6)


def test_a_scenario_says_what_is_estimated(robot):
    from jointplay.scenario.summary import facts
    from jointplay.simulation.run import Run

    mechanism = jp.Mechanism(robot, {"balls": BALLS}, tool="tip")
    simulation = jp.Simulation(mechanism, drive=jp.loads.Free(), duration=0.01, limits="ignore")
    text = facts(Run(simulation))["joint balls"]
    assert "free ±13.5 µm across, ±96.2 µm along, ±2.94 mrad tilt" in text
    assert "estimated: pitch diameter 65 mm" in text
    assert "shaft interference" not in text  # none
    tight = replace(BALLS, shaft_interference=1e-5, housing_interference=5e-6)
    fitted = replace(simulation, mechanism=jp.Mechanism(robot, {"balls": tight}, tool="tip"))
    text = facts(Run(fitted))["joint balls"]  # as check and reports have it
    assert "shaft interference 0.01 mm, housing interference 5 µm" in text
    assert "play none (preloaded)" in repr(jp.Mechanism(robot, {"pair": PAIR}, tool="tip"))


def test_a_life_of_more_than_a_century_is_no_number(mixed):
    life = analysis.bearing_life(mixed, "balls")
    assert "8e+12" not in str(replace(life, revolutions=1e15, hours=8e12))
    assert "2e+03 h" in str(replace(life, revolutions=1e7, hours=2e3))
