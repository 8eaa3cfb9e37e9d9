"""Heat: growth by known formulas, through scenario, budget and run."""

import subprocess
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, tip
from warm import JOINTPLAY

import jointplay as jp
from jointplay.model.formats import read
from jointplay.model.heat import Heat, LinkHeat, warmed
from jointplay.physics.joints.materials import material, materials

STEEL = 11.7e-6

SCENARIO = """
[robot]
urdf = "jointplay:scara.urdf"
gravity = "balanced"
[joints.joint_b]
radial_clearance = "0.2 mm"
bearing_material = "phosphor-bronze"
[motion]
file = "jointplay:scara_motion.csv"
[integration]
duration = "20 ms"
"""


def tool_of(mechanism, at):
    """Where the tool is, with joints at these positions [m]."""
    q = mechanism.configuration(at)
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    return mechanism.data.oMf[mechanism.tool_frame].translation.copy()


def scenario(tmp_path, heat, text=SCENARIO):
    path = tmp_path / "warm.toml"
    path.write_text(f"{text}\n{heat}\n")
    return jp.Scenario.load(path)


def test_every_material_has_an_expansion_of_a_solid():
    for name in materials():
        assert 1e-6 < material(name).expansion < 1e-3
    assert material("aluminium").expansion > material("carbon-steel").expansion


def test_a_round_joint_grows_by_both_halves():
    joint = jp.RevoluteClearance(
        radial_clearance=0.1e-3, axial_clearance=0.3e-3, bearing_material=material("brass")
    )
    hot = joint.warmed(40.0, 25.0)
    bore, shaft = 1.0 + 19.9e-6 * 25.0, 1.0 + STEEL * 40.0
    assert hot.cr == pytest.approx(10e-3 * bore - 9.9e-3 * shaft, rel=1e-9)
    assert hot.ca == pytest.approx(0.5 * (40e-3 * bore - 39.4e-3 * shaft), rel=1e-9)
    assert joint.warmed(0.0, 0.0).cr == pytest.approx(joint.cr, rel=1e-12)


@pytest.mark.parametrize(
    "joint",
    [
        jp.RevoluteClearance(radial_clearance=1e-4),
        jp.RevoluteClearance.planar(radial_clearance=1e-4),
        jp.SphericalClearance(radial_clearance=1e-4),
        jp.CylindricalClearance(radial_clearance=1e-4),
    ],
    ids=lambda joint: joint.kind,
)
def test_what_is_warmer_as_a_whole_grows_in_proportion(joint):
    hot, grown = joint.warmed(50.0, 50.0), 1.0 + 50.0 * STEEL
    assert hot.cr == pytest.approx(joint.cr * grown, rel=1e-7)
    assert hot.rj == pytest.approx(joint.rj * grown, rel=1e-9)
    assert hot.ideal_freedoms == joint.ideal_freedoms


def test_a_slider_loses_play_where_it_is_warmer_than_its_guide():
    slider = jp.PrismaticClearance(clearance=50e-6, width=40e-3, height=20e-3)
    hot = slider.warmed(30.0, 0.0)
    assert hot.clearance == pytest.approx(50e-6 - 0.5 * 40e-3 * STEEL * 30.0, rel=1e-9)
    assert hot.cy == pytest.approx(50e-6 - 0.5 * 20e-3 * STEEL * 30.0, rel=1e-9)


def test_a_rolling_bearing_takes_the_difference_of_its_rings():
    bearing = jp.BallBearing(designation="6010/C3")
    assert bearing.warmed(30.0, 10.0) == replace(bearing, temperature_difference=20.0)


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        (jp.RevoluteClearance(radial_clearance=10e-6), "radial clearance.*seizes"),
        (
            jp.RevoluteClearance(radial_clearance=1e-4, journal_material=jp.Material(young=3e9)),
            "expansion of the material is not known",
        ),
    ],
)
def test_joints_that_cannot_become_so_warm_are_refused(joint, words):
    with pytest.raises(jp.JointplayError, match=words):
        joint.warmed(300.0, 0.0)


def test_the_tool_of_a_warm_arm_is_farther_out():
    description = read(jp.shipped("scara.urdf"))
    links = {name: LinkHeat(warmer=20.0) for name in description.links}
    hot, _, _, notes = warmed(description, {}, {}, Heat(links=links, material="aluminium"))
    cold, warm = jp.Mechanism(description), jp.Mechanism(hot)
    q = {"joint_a": 0.3, "joint_b": 0.9, "stroke": 0.0}
    places = [tool_of(one, q) for one in (cold, warm)]
    grown = 1.0 + 20.0 * 23.6e-6
    assert places[1] == pytest.approx(grown * places[0], rel=1e-12)
    assert "472 µm/m" in notes[0]
    bodies = [one.model.inertias.tolist() for one in (cold, warm)]
    for a, b in zip(*bodies, strict=True):
        assert b.mass == a.mass
        assert b.inertia == pytest.approx(a.inertia * grown**2, rel=1e-9, abs=1e-15)


def test_what_is_fixed_to_a_link_is_as_warm_as_it_is(urdf):
    path = urdf(body("arm"), joint("j", "base", "arm"), tip("arm"))
    hot, *_ = warmed(read(path), {}, {}, Heat(links={"arm": LinkHeat(warmer=100.0)}))
    places = [tool_of(jp.Mechanism(one), {"j": 0.0}) for one in (path, hot)]
    assert places[1] == pytest.approx(places[0] * (1.0 + 100.0 * 23.6e-6), rel=1e-12)


def test_a_scenario_is_as_warm_as_its_curve_says(tmp_path):
    (tmp_path / "curve.csv").write_text(
        "time_s,arm2,joint_b.journal,joint_b.bearing\n0,0,0,0\n600,20,40,10\n1200,20,40,30\n"
    )
    found = {
        minutes: scenario(
            tmp_path, f'[heat]\ncurve = "curve.csv"\ntime = "{minutes} min"\n'
        ).simulation()
        for minutes in (0, 5, 15)
    }
    radial = {m: one.mechanism.clearance["joint_b"].cr for m, one in found.items()}
    bore, shaft = 10e-3 * 17.8e-6, 9.8e-3 * STEEL
    assert radial[0] == pytest.approx(0.2e-3, rel=1e-9)
    assert radial[5] == pytest.approx(0.2e-3 + 5.0 * bore - 20.0 * shaft, rel=1e-9)
    assert radial[15] == pytest.approx(0.2e-3 + 20.0 * bore - 40.0 * shaft, rel=1e-9)
    result = found[15].run()
    again = jp.Result.load(result.save(tmp_path / "r.nc")).simulation
    assert again.mechanism.clearance["joint_b"] == found[15].mechanism.clearance["joint_b"]
    assert np.array_equal(again.run()["q"].values, result["q"].values)


@pytest.mark.parametrize(
    ("heat", "words"),
    [
        ('[heat]\nmaterial = "wood"', "material 'wood'"),
        ('[heat.joints.elbow]\njournal = "10 K"', "joint with clearance 'elbow'"),
        ('[heat.links.forearm]\nwarmer = "10 K"', "link 'forearm'"),
        ('[heat]\ntime = "1 min"', "time needs curve"),
        ('[heat]\ncurve = "none.csv"\ntime = "1 min"', "none.csv"),
        ('[heat]\ncurve = "curve.csv"\ntime = "1 h"', "lasts from 0 s to 600 s, got 3600 s"),
        ('[heat]\ncurve = "wrong.csv"\ntime = "1 s"', "'hot' is not a number"),
        ('[heat]\ncurve = "head.csv"\ntime = "1 s"', "the header must be time_s"),
        ('[heat.joints.joint_b]\njournal = "10 kg"', "10 kg"),
    ],
)
def test_wrong_heat_is_named_with_its_line(heat, words, tmp_path):
    (tmp_path / "curve.csv").write_text("time_s,joint_b.journal\n0,0\n600,20\n")
    (tmp_path / "wrong.csv").write_text("time_s,joint_b.journal\n0,0\n600,hot\n")
    (tmp_path / "head.csv").write_text("minutes,joint_b.journal\n0,0\n600,20\n")
    (tmp_path / "warm.toml").write_text(f"{SCENARIO}\n{heat}\n")
    done = subprocess.run(
        [JOINTPLAY, "check", "warm.toml"], cwd=tmp_path, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 2
    assert words in done.stderr
    assert "line" in done.stderr


def test_a_sweep_goes_over_the_time_since_the_machine_was_switched_on(tmp_path):
    (tmp_path / "curve.csv").write_text("time_s,joint_b.journal\n0,0\n600,20\n")
    heat = '[heat]\ncurve = "curve.csv"\ntime = "0 s"\n'
    sweep = '[sweep.axes]\nminutes = { key = "heat.time", values = ["0 s", "5 min", "10 min"] }\n'
    text = SCENARIO.replace("balanced", "loaded")
    (tmp_path / "warm.toml").write_text(f"{text}\n{heat}\n{sweep}")
    found = jp.sweep(tmp_path / "warm.toml", tmp_path / "s", jobs=1).dataset()
    assert (found["state"] == 1).all()
    forces = found["peak_force"].values
    assert len(set(forces.ravel())) == 3  # smaller clearances, other motions
