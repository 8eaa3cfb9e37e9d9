"""Error budgets of mechanisms with closed loops: formulas, and loops closed with displaced pins."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint
from hypothesis import given, settings
from hypothesis import strategies as st

from jointplay import (
    Gear,
    JointplayError,
    Loop,
    Mechanism,
    Motion,
    RevoluteClearance,
    Scenario,
    simulate,
)
from jointplay.accuracy import loop_play, poses
from jointplay.accuracy.allocation import allocate
from jointplay.accuracy.causes import CAUSES
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.error_model import play_model
from jointplay.accuracy.robot_errors import RobotErrors
from jointplay.cli import main
from jointplay.model.closed_loops import ClosedLoops, is_closed
from jointplay.model.loop import assemble
from jointplay.model.robots import shipped
from jointplay.physics.joints.play import BallPlay, BlockPlay, JournalPlay
from jointplay.simulation.loads import Prescribed

CRANK, ROD = 0.05, 0.12
PLAY = 1e-4
START = {"guide": 0.17}


def pin_joint(play=PLAY, **options):
    return RevoluteClearance.planar(radial_clearance=play, **options)


def bearing(**changes):
    return RevoluteClearance(**{"radial_clearance": PLAY, "axial_clearance": PLAY} | changes)


def slider_crank(joints, **options):
    loops = Scenario.load("jointplay:slider_crank.toml").simulation("ideal").mechanism.loops
    options = {"tool": "slider", "gravity": (0.0, 0.0, 0.0)} | options
    return Mechanism(shipped("slider_crank.urdf"), joints, loops=loops, **options)


@pytest.fixture(scope="module")
def four_bar_path(tmp_path_factory):
    """The four-bar with a tool half way along its coupler and beside it."""
    text = shipped("four_bar.urdf").read_text()
    tool = (
        '<link name="tip"/><joint name="at" type="fixed"><parent link="coupler"/>'
        '<child link="tip"/><origin xyz="0.075 0.04 0"/></joint></robot>'
    )
    path = tmp_path_factory.mktemp("loops") / "four_bar.urdf"
    path.write_text(text.replace("</robot>", tool))
    return path


def four_bar(path, joints):
    loops = Scenario.load("jointplay:four_bar.toml").simulation("ideal").mechanism.loops
    return Mechanism(path, joints, loops=loops, tool="tip")


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.0, -0.8, 3.0])
def test_every_pin_lengthens_the_rod_by_its_clearance(angle):
    mechanism = slider_crank(dict.fromkeys(("piston_pin", "rod_pin", "crank_pin"), pin_joint()))
    q = poses.at_pose(mechanism, {"crank_pin": angle}, near=START)
    found = budget(mechanism, q)
    rod = math.asin(CRANK / ROD * math.sin(angle))
    assert found.worst_parts[0] == pytest.approx(np.full(3, PLAY / math.cos(rod)), rel=1e-6)
    assert "loops closed exactly" in found.validity
    assert found.axis_worst[0, 0, 1:3] == pytest.approx([0.0, 0.0], abs=1e-15)
    place = CRANK * math.cos(angle) + ROD * math.cos(rod)
    assert found.positions[0] == pytest.approx([place, 0.0, 0.0], abs=1e-9)


def test_the_load_on_the_slider_says_where_it_rests():
    mechanism = slider_crank({"piston_pin": pin_joint(stiffness=1e14)})  # gives way by 0.01 %
    q = poses.at_pose(mechanism, {"crank_pin": 1.0}, near=START)
    rod = math.asin(CRANK / ROD * math.sin(1.0))
    for push in (50.0, -50.0):
        found = budget(mechanism, q, force=(push, 0.0, 0.0), drive=Prescribed())
        away = math.copysign(PLAY / math.cos(rod), push)
        assert found.rest[0, 0, 0] == pytest.approx(away, rel=1e-3)


def test_a_gear_turns_the_crank_and_the_slider_follows():
    mechanism = slider_crank({}, gears={"crank_pin": Gear(2e-3, 0.1, 1e4)})
    q = poses.at_pose(mechanism, {"crank_pin": 1.0}, near=START)
    rod = math.asin(CRANK / ROD * math.sin(1.0))
    slope = CRANK * (math.sin(1.0) + math.cos(1.0) * math.tan(rod))
    assert budget(mechanism, q).worst[0] == pytest.approx(1e-3 * slope, rel=1e-6)


@pytest.mark.parametrize("angle", [0.4, 2.2, 4.0])
def test_the_four_bars_bound_is_what_displaced_pins_reach(four_bar_path, angle):
    mechanism = four_bar(four_bar_path, {"rocker_end": pin_joint()})
    (q,) = poses.at_pose(mechanism, {"crank_pin": angle})
    found = budget(mechanism, q)
    held = [mechanism.coordinate("crank_pin")]
    reached = []
    for phi in np.linspace(0.0, 2.0 * np.pi, 33):
        aside = PLAY * np.array([math.cos(phi), math.sin(phi), 0.0])
        moved = assemble(mechanism, q, held, {"rocker_end": aside})
        pin.framesForwardKinematics(mechanism.model, mechanism.data, moved)
        place = mechanism.data.oMf[mechanism.tool_frame].translation
        reached.append(np.linalg.norm(place - found.positions[0]))
    assert max(reached) == pytest.approx(found.worst[0], rel=0.01)
    assert found.second_order[0] < 0.01 * found.worst[0]


@pytest.fixture
def door(urdf):
    """A door on two hinges, one above the other; its tool half a metre from their axis."""
    height = 0.3
    path = urdf(
        body("door", com="0.25 0 0.15"),
        joint("lower", "base", "door"),
        '<link name="handle"/><joint name="tip" type="fixed"><parent link="door"/>'
        '<child link="handle"/><origin xyz="0.5 0 0.15"/></joint>',
    )
    upper = Loop("base", "door", (0.0, 0.0, height), journal_xyz=(0.0, 0.0, height))

    def make(joints):
        return Mechanism(path, joints, loops={"upper": upper}, tool="handle")

    return make, height


def test_a_door_leans_as_far_as_its_two_hinges_allow_each_other(door):
    make, height = door
    hinge = bearing(lock_axial=True, stiffness=1e14)
    found = budget(make({"lower": hinge, "upper": hinge}), {}, second_order=False)
    # Both lean by the same angle, and their centres are displaced by height/2 times it.
    lean = 2.0 * PLAY / (height + hinge.lj)
    assert found.axis_worst[0, :, 4].sum() == pytest.approx(lean, rel=2e-4)
    assert found.axis_worst[0, :, 2].sum() == pytest.approx(0.5 * lean, rel=2e-4)
    assert found.axis_worst[0, :, 0].sum() == pytest.approx(PLAY, rel=2e-4)
    assert found.rest_tool[0, 2] == pytest.approx(-0.5 * lean, rel=2e-3)
    # Against a hinge without play, the other cannot move.
    assert budget(make({"lower": hinge}), {}).worst[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.thorough
def test_two_hinges_of_a_door_bear_in_the_budget_what_a_run_finds_at_rest(door):
    make, height = door
    hinges = {"lower": bearing(), "upper": bearing(open_ends=True)}
    mechanism = make(hinges)
    found = budget(mechanism, {"lower": 0.5})
    assert "no force acts on" not in str(found.table())
    still = Motion(["lower"], [0.0, 1.0], np.full((2, 1), 0.5))
    result = simulate(mechanism, still, duration=2e-3, start="rest", estimate=False)
    ran = {name: result["joint_force"].values[-1, i] for i, name in enumerate(result.joints)}
    for j, name in enumerate(found.joints):
        size = np.linalg.norm(found.rest_positions.at(0).loads[j, :3])
        assert size == pytest.approx(np.linalg.norm(ran[name]), rel=0.02)
        # Both bear load: the leaf's weight pulls at the upper hinge and pushes at the lower.
        assert size > 0.5 * 9.81 * 0.25 / height
        assert f"{name} {size:.4g} N" in str(found.table())
    assert np.isnan(found.rest).all()  # none moves the tool alone


def test_one_leaning_pin_in_a_plane_loop_is_held_upright(four_bar_path):
    flat = budget(four_bar(four_bar_path, {"rocker_end": pin_joint()}), {"crank_pin": 0.7})
    found = budget(
        four_bar(four_bar_path, {"rocker_end": bearing()}), {"crank_pin": 0.7}, second_order=False
    )
    assert found.worst[0] == pytest.approx(flat.worst[0], rel=1e-3)
    assert found.axis_worst[0, 0, 2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.thorough
def test_pins_that_lean_together_lift_the_coupler_as_far_as_the_loop_reaches(four_bar_path):
    names = ("rocker_end", "rocker_pin", "crank_pin", "coupler_pin")
    mechanism = four_bar(four_bar_path, {name: bearing() for name in names})
    found = budget(mechanism, {"crank_pin": 0.7})
    random = np.random.default_rng(2)
    d = random.normal(size=(1, 30, 3))
    d /= np.linalg.norm(d, axis=2, keepdims=True)
    states = found.model.along(d)
    bound = states.value.sum(axis=0)
    reached = np.einsum("jnmk,nmk->nm", states.error[..., :3], d)
    assert (reached <= bound * (1.0 + 1e-9)).all()
    assert (reached >= bound * (1.0 - 1e-3)).all()
    ties = found.model.tie
    assert np.abs(np.einsum("jnri,jnmi->nmr", ties, states.point)).max() < 1e-10
    # Without ties the plays could reach farther.
    apart = replace(found.model, tie=ties[:, :, :0]).along(d).value.sum(axis=0)
    assert (bound <= apart * (1.0 + 1e-9)).all()
    assert bound.sum() < 0.9 * apart.sum()


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10_000))
def test_without_ties_the_cones_of_a_play_reach_as_far_as_its_support(seed):
    random = np.random.default_rng(seed)
    plays = [
        JournalPlay(1e-4, 2e-4, 0.04, 0.01),
        JournalPlay(1e-4, 1e-6, 0.04, 0.01),
        JournalPlay(1e-4, 0.0, 0.04, 0.0),
        JournalPlay(1e-4, 1e-4, math.inf, 0.0),
        BallPlay(2e-4),
        BlockPlay((1e-4, 2e-4), (0.02, 0.01, 0.05), (True, True, True)),
        BlockPlay((1e-4, 0.0), (0.02, 0.01, 0.05), (False, True, False)),
    ]
    for play in plays:
        load = random.normal(size=(3, 6)) * [1, 1, 1, 0.02, 0.02, 0.02]
        _, (point,) = loop_play.farthest([play], load[None], np.zeros((1, 3, 1, 6)))
        reached = np.einsum("ni,ni->n", load, point)
        assert reached == pytest.approx(play.support(load).value, rel=2e-3, abs=1e-8)


def test_the_first_joints_that_determine_the_others_stand():
    mechanism = slider_crank({"piston_pin": pin_joint()})
    (q,) = poses.at_pose(mechanism, {"crank_pin": 1.0}, near=START)
    assert ClosedLoops(mechanism, q).driven == ("crank_pin",)
    moved = budget(mechanism, q, driven=["guide"])
    assert moved.worst[0] == pytest.approx(0.0, abs=1e-12)  # the tool itself stands


def test_poses_are_closed_on_the_branch_they_begin_on():
    scenario = Scenario.load("jointplay:slider_crank.toml")
    simulation = scenario.simulation("0.2 mm")
    assert simulation.motion is not None
    mechanism = simulation.mechanism
    q = poses.along_motion(mechanism, simulation.motion, 40, poses.start_of(simulation))
    angle = q[:, mechanism.coordinate("crank_pin")]
    rod = np.arcsin(CRANK / ROD * np.sin(angle))
    wanted = CRANK * np.cos(angle) + ROD * np.cos(rod)
    assert q[:, mechanism.coordinate("guide")] == pytest.approx(wanted, abs=1e-8)
    spread = poses.over_workspace(mechanism, 16, near=START)
    assert (spread[:, mechanism.coordinate("guide")] > 0.05).all()
    assert all(is_closed(mechanism, row) for row in spread)


def test_a_position_where_the_loop_is_nearly_stretched_is_refused_with_the_pose():
    mechanism = slider_crank({"piston_pin": pin_joint()}, tool="crank")
    tip = slider_crank({"piston_pin": pin_joint()}, tool="rod")
    assert budget(mechanism, {"guide": 0.15, "crank_pin": 0.6}, driven=["guide"]).worst_turn > 0.0
    with pytest.raises(JointplayError, match=r"near a singular position at guide 169\.99 mm"):
        budget(tip, {"guide": 0.16999, "crank_pin": 0.02}, driven=["guide"])
    (q,) = poses.at_pose(tip, {"crank_pin": 0.0}, ["crank_pin"], START)
    with pytest.raises(JointplayError, match=r"do not determine the tool 'rod' at guide 170 mm"):
        budget(tip, q, driven=["guide"])
    with pytest.raises(JointplayError, match=r"cannot be closed with guide 200 mm"):
        budget(tip, {"guide": 0.2}, driven=["guide"])
    with pytest.raises(JointplayError, match=r"joints \(none\) do not determine the tool") as error:
        budget(tip, {"crank_pin": 0.7, **START}, driven=[])
    assert "nothing determines 'crank_pin', 'rod_pin', 'guide'" in str(error.value)


def test_joints_of_a_loop_that_no_drive_determines_are_named():
    from jointplay.simulation.motion.ideal import driven_map

    mechanism = slider_crank({}, tool="rod")
    (q,) = poses.at_pose(mechanism, {"crank_pin": 0.7}, ["crank_pin"], START)
    with pytest.raises(JointplayError, match=r"driven joints \(none\) do not determine these") as e:
        driven_map(mechanism, q, [])
    for name in mechanism.joints:
        assert repr(name) in str(e.value)
    assert "drive one of them, too" in str(e.value)
    ratios = driven_map(mechanism, q, [mechanism.coordinate("crank_pin")])
    assert ratios[mechanism.coordinate("crank_pin")] == pytest.approx([1.0])


def test_the_allocated_pins_keep_the_target_and_use_it_up():
    names = ("piston_pin", "rod_pin", "crank_pin")
    mechanism = slider_crank({name: pin_joint() for name in names})
    q = poses.at_pose(mechanism, {"crank_pin": 1.0}, near=START)
    found = allocate(mechanism, q, 1e-4)
    rod = math.asin(CRANK / ROD * math.sin(1.0))
    assert found.clearance == pytest.approx(np.full(3, 1e-4 / 3.0 * math.cos(rod)), rel=2e-3)


@pytest.mark.thorough
def test_what_holds_each_other_is_allocated_within_the_target(door):
    make, _ = door
    hinge = bearing(lock_axial=True)
    found = allocate(make({"lower": hinge, "upper": hinge}), {}, 5e-5)
    assert 0.99 * 5e-5 < found.error <= 5e-5
    with pytest.raises(JointplayError, match="constrain each other"):
        allocate(make({"lower": hinge, "upper": hinge}), {}, 5e-5, quantile=0.99)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["delta", "three_rrr"])
def test_all_causes_of_closed_loops_against_loops_closed_afresh(name):
    simulation = Scenario.load(f"jointplay:{name}.toml").simulation("ideal")
    mechanism = simulation.mechanism
    q = poses.at_pose(mechanism, {}, near=poses.start_of(simulation))
    causes = [one for one in CAUSES if name == "delta" or one != "elasticity"]
    found = budget(mechanism, q, causes=causes, kind="calibrated-industrial")
    assert found.reached == pytest.approx(found.worst[0], rel=2e-3)
    distance = np.linalg.norm(found.sample(100), axis=1)
    assert distance.max() <= 1.02 * found.worst[0]
    assert np.sqrt((distance**2).mean()) == pytest.approx(found.rms[0], rel=0.2)


def test_causes_move_the_slider_as_links_of_other_lengths_and_another_angle_do():
    mechanism, angle, small = slider_crank({}), 1.0, 1e-4
    q = poses.at_pose(mechanism, {"crank_pin": angle}, near=START)

    def off(crank=0.0, rod=0.0, turned=0.0):
        def place(r, length, at):
            return r * math.cos(at) + math.sqrt(length**2 - (r * math.sin(at)) ** 2)

        return abs(place(CRANK + crank, ROD + rod, angle + turned) - place(CRANK, ROD, angle))

    exact = dict.fromkeys(("encoder", "zero_offset", "axis_offset", "axis_tilt", "expansion"), 0.0)

    def worst(cause, **given):
        errors = RobotErrors(**{**exact, **given})
        return budget(mechanism, q, causes=[cause], errors=errors).worst_parts[0].sum()

    assert worst("encoder", zero_offset=small) == pytest.approx(off(turned=small), rel=1e-3)
    grown = off(crank=small * CRANK) + off(rod=small * ROD)
    heat = worst("heat", expansion=small, heating=1.0)  # the slider is a link, too
    assert heat == pytest.approx(grown, rel=1e-3)


def test_geometry_of_a_loop_counts_as_far_as_it_closes(door):
    """As neither hinge can tilt, both can only be offset together."""
    make, _ = door
    errors = RobotErrors(axis_offset=1e-4, axis_tilt=0.0)
    found = budget(make({}), {}, causes=["geometry"], errors=errors)
    assert found.worst[0] == pytest.approx(math.sqrt(3.0) * 1e-4, rel=1e-3)
    assert found.rms[0] == pytest.approx(1e-4 / math.sqrt(2.0), rel=1e-6)
    drawn = found.sample(2000)
    assert np.sqrt((drawn**2).sum(axis=1).mean()) == pytest.approx(found.rms[0], rel=0.05)


def test_deflections_that_a_loop_holds_are_refused():
    mechanism = slider_crank({}, gravity=(0.0, 0.0, -9.81))
    q = poses.at_pose(mechanism, {"crank_pin": 1.0}, near=START)
    with pytest.raises(JointplayError, match="statically indeterminate"):
        budget(mechanism, q, kind="industrial", causes=["elasticity"])


@pytest.mark.thorough
@pytest.mark.parametrize("tied", [False, True])
def test_causes_of_a_loop_are_allocated_within_the_target(door, tied):
    mechanism, q, causes = door[0]({}), np.zeros((1, 1)), ["geometry"]
    if not tied:
        simulation = Scenario.load("jointplay:delta.toml").simulation("ideal")
        mechanism, causes = simulation.mechanism, ["encoder", "geometry"]
        q = poses.at_pose(mechanism, {}, near=poses.start_of(simulation))
    whole = {"causes": causes, "kind": "industrial"}
    target = 0.5 * budget(mechanism, q, **whole).worst[0]
    found = allocate(mechanism, q, target, **whole)
    kept = budget(mechanism, q, **whole, remaining=found.parts)
    assert 0.99 * target < kept.worst[0] <= target * (1.0 + 1e-6)
    if tied:
        with pytest.raises(JointplayError, match="variances do not add"):
            allocate(mechanism, q, target, **whole, statistical=True)


def test_others_than_budgets_say_that_they_take_no_loops():
    with pytest.raises(
        JointplayError, match="'piston_pin': this works only for robots without closed"
    ):
        play_model(slider_crank({"piston_pin": pin_joint()}), START)


def test_the_commands_take_a_scenario_with_a_loop(capsys):
    order = ["jointplay:slider_crank.toml", "--case", "0.2 mm"]
    assert main(["budget", *order]) == 0
    text = capsys.readouterr().out
    assert "loops: driven crank_pin; following rod_pin, guide" in text
    row = next(line for line in text.splitlines() if line.startswith("all"))
    # The rod leans most where the crank is upright.
    most = 0.2 / math.cos(math.asin(CRANK / ROD))
    assert float(row.split()[1]) == pytest.approx(most, rel=2e-3)
    assert main(["allocate", *order, "--target", "0.1 mm"]) == 0
    assert "static worst case: 0.10000 mm" in capsys.readouterr().out
    pose = ["--clearance", "0.1 mm", "--pose", "crank_pin=40 deg"]
    assert main(["budget", *order, *pose]) == 0
    assert "guide" in capsys.readouterr().out


def test_the_table_says_that_in_loops_the_whole_play_is_taken():
    joints = dict.fromkeys(("crank_pin", "piston_pin"), bearing())
    mechanism = slider_crank(joints, gravity=(0.0, 0.0, -9.81))
    found = budget(mechanism, poses.at_pose(mechanism, {"crank_pin": 1.0}, near=START))
    text = str(found.table())
    assert "how far friction can hold all joints is not known" in text
    assert "their entire play is assumed" in text
    assert "friction decides" not in text
    assert "friction shifts" not in text
    ends = found.rest_interval[0, :3]
    whole = found.axis_worst[0].sum(axis=0)[:3] + found.second_order[0]
    np.testing.assert_allclose(np.abs(ends).max(axis=1), whole, rtol=0.05, atol=1e-9)
