"""Runs that one holds: moments, states, checkpoints, judging."""

import dataclasses
import itertools
import json
import math
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
from conftest import body, checkpoint_arrays, joint, save_checkpoint

import jointplay as jp
from jointplay.base.pairs import name_and_number
from jointplay.physics.kernel import Status
from jointplay.scenario.reading import dotted, parse
from jointplay.simulation.analysis.vibration import rattle
from jointplay.simulation.working_files import CHECKPOINT
from jointplay.study.keys import path_of
from jointplay.study.measures import measure


@pytest.fixture
def arm(urdf):
    """A loaded joint, followed by an ideal one."""
    path = urdf(
        body("one", com="0.1 0 0"), joint("a", "base", "one", axis="0 1 0"),
        body("two", com="0.1 0 0"), joint("b", "one", "two", axis="0 1 0", at="0.2 0 0")
    )  # fmt: skip
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    return jp.Mechanism(path, {"a": bearing})


def moving(arm, duration=0.02, **options):
    motion = jp.Motion(["a", "b"], [0.0, 0.02], [[0.0, 0.0], [0.2, -0.3]])
    return jp.Simulation(arm, motion, duration=duration, **options)


METHODS = ({}, {"tolerance": 1e-3}, {"integrator": "rk4"}, {"integrator": "semi-implicit-euler"})


@pytest.mark.parametrize("options", METHODS)
def test_to_look_changes_nothing(arm, options):
    simulation = moving(arm, 0.005, start="centred", **options)
    plain = simulation.run()
    run = jp.Run(simulation)
    moments = list(run.steps(1e-3))
    assert (run.workspace.recorded("q") == plain["q"].values).all()
    assert (run.workspace.recorded("work")[:, 0] == plain["drive_work"].values).all()
    assert [round(1e3 * moment.time) for moment in moments] == [0, 1, 2, 3, 4, 5]


def test_moments_are_what_the_records_say(arm):
    simulation = moving(arm, 0.01, record_every=1)
    result = simulation.run()
    step = simulation.step
    for moment in simulation.steps(every=2e-3):
        at = round(moment.time / step)
        if at == len(result.time) - 1:
            continue
        assert moment.q == pytest.approx(result["q"].values[at], abs=1e-12)
        # The record was made with the inertia of the next macro step.
        assert moment.v == pytest.approx(result["v"].values[at], abs=1e-5)
        centre, _ = moment.journal("a")
        assert centre == pytest.approx(result["journal_centre"].values[at, 0], abs=1e-12)
        size = np.linalg.norm(result["joint_force"].values[at, 0])
        assert np.linalg.norm(moment.force("a")) == pytest.approx(size, rel=1e-3)
        forces = result["normal_force"].values[at, 0]
        assert list(moment.contacts("a").values()) == pytest.approx(
            list(forces), rel=1e-3, abs=1e-3
        )
    assert moment.position("b") == moment.q[list(moment.coordinates).index("b")]


def states_of(run):
    """All states recorded, and where the run stands."""
    w = run.workspace
    return [w.recorded(name).copy() for name in ("q", "v", "work")] + [w.q.copy(), w.v.copy()]


def same(run, other):
    return all(np.array_equal(*pair) for pair in zip(states_of(run), states_of(other), strict=True))


SPEEDS = {"b": (None, 3.0), "a.x": (5e-5, 0.02)}


def free(arm, **options):
    """Without drives."""
    return jp.Simulation(arm, drive={}, duration=0.005, start="centred", **options)


@pytest.mark.parametrize("options", METHODS)
def test_synchronize_begin_a_look_and_a_checkpoint_change_nothing(arm, tmp_path, options):
    """Before the first step, in whatever order; between steps, where it is done once."""
    simulation = free(arm, state=SPEEDS, **options)
    done = {"s": jp.Run.synchronize, "b": jp.Run.begin, "m": jp.Run.moment}

    def ended(way, steps=0):
        run = jp.Run(simulation)
        assert run.advance(steps)
        for one in way:
            if one == "r":
                run = jp.Simulation.resume(run.checkpoint(tmp_path / "kept"))
            else:
                done[one](run)
        if not steps:
            start = run.moment()
            assert (start.speed("b"), start.speed("a.x")) == (3.0, 0.02)
        run.run_to_end()
        return run

    plain = jp.Run(simulation)
    plain.run_to_end()
    for way in ("s", "bsb", "bb", "ms", "sb", "rs", "bsr", "sbrm"):
        assert same(ended(way), plain), way
    once = ended("s", 150)
    for way in ("ss", "sb", "sbb", "ssbsb", "smb", "bsb", "sr"):
        assert same(ended(way, 150), once), way
    assert once.workspace.q == pytest.approx(plain.workspace.q, abs=1e-4)
    assert once.result().audit.energy_residual < 1e-3


@pytest.mark.parametrize("options", METHODS)
def test_a_changed_state_is_gone_on_from_or_refused(arm, options):
    simulation = free(arm, state=SPEEDS, **options)
    at = arm.coordinate("b")
    faster = {**SPEEDS, "b": (None, 7.0)}
    given = jp.Run(dataclasses.replace(simulation, state=faster))
    given.run_to_end()
    for looked in (False, True):  # at the start: no need to say anything
        run = jp.Run(simulation)
        if looked:
            run.moment()
        run.workspace.v[at] = 7.0
        run.run_to_end()
        assert same(run, given)
    run = jp.Run(simulation)
    run.advance(150)
    run.synchronize()
    run.workspace.v[at] = 7.0
    assert run.moment().speed("b") == 7.0
    assert run.advance(1)
    assert run.moment().speed("b") == pytest.approx(7.0, abs=0.1)
    for name in ("q", "v"):
        run = jp.Run(simulation)
        run.advance(150)
        getattr(run.workspace, name)[at] += 0.1
        for act in (run.begin, run.synchronize, run.moment, run.finish):
            with pytest.raises(jp.JointplayError, match=r"call synchronize\(\) before you change"):
                act()
        with pytest.raises(jp.JointplayError, match="while the method has parts of the state"):
            run.advance(1)


def test_a_loop_keeps_its_speeds():
    """A slider-crank with a free crank: without its speeds, peaks are thousands of times higher."""
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    simulation = scenario.simulation("0.2 mm", {"integration": {"duration": 2e-3}})
    simulation = dataclasses.replace(
        simulation, motion=None, drive={}, state={"crank_pin": (None, 30.0)}, start="centred"
    )
    plain, run = jp.Run(simulation), jp.Run(simulation)
    speeds = run.workspace.v.copy()
    run.synchronize()
    assert np.array_equal(run.workspace.v, speeds)
    for one in (plain, run):
        one.run_to_end()
    assert same(run, plain)


class Counting:
    """A controller that says how often it was asked."""

    def __init__(self):
        self.asked = 0

    def __call__(self, time, q, v):
        self.asked += 1
        return [1e-3 * self.asked]

    def memory(self):
        return self.asked

    def recall(self, state):
        self.asked = state


@pytest.mark.parametrize("options", [{}, {"integrator": "rk4"}])
def test_a_sampled_controller_is_asked_once_at_an_instant(arm, tmp_path, options):
    load = jp.loads.Controller(("b",), Counting, period=1e-3)
    simulation = free(arm, loads={"own": load}, **options)
    plain, run = jp.Run(simulation), jp.Run(simulation)
    run.begin()
    run.synchronize()
    run.begin()
    steps = round(2e-3 / simulation.step)
    for one in (plain, run):
        one.advance(steps)
    run.synchronize()
    run = jp.Simulation.resume(run.checkpoint(tmp_path / "kept"))
    run.begin()
    for one in (plain, run):
        one.run_to_end()
    memories = [one.memory()["watch"] for one in (plain, run)]
    assert memories[0] == memories[1]
    assert memories[0]["states"] == [5]


def test_wrong_names_in_a_moment_are_told_with_choices(arm):
    moment = next(moving(arm).steps())
    with pytest.raises(jp.JointplayError, match=r"a\.x"):
        moment.position("c")
    with pytest.raises(jp.JointplayError, match="joint with clearance 'b'"):
        moment.journal("b")


def test_any_coordinate_can_be_given_a_state(arm):
    state = {"a.x": (2e-5, 0.01), "a.z": -1e-5, "a.pitch": (1e-3, None), "b": (0.4, None)}
    still_b = dataclasses.replace(
        moving(arm),
        motion=jp.Motion(["a"], [0, 0.02], [[0], [0]]),
        drive={"a": jp.loads.Prescribed()},
    )
    run = jp.Run(dataclasses.replace(still_b, state=state))
    pairs = zip(run.workspace.q, run.workspace.v, strict=True)
    named = dict(zip(arm.coordinates, pairs, strict=True))
    assert named["a.x"] == (2e-5, 0.01)
    assert named["a.z"] == (-1e-5, 0.0)
    assert named["a.y"] == (0.0, 0.0)  # a journal with a place does not look for rest
    assert named["a.pitch"] == (1e-3, 0.0)
    assert named["b"] == (0.4, 0.0)


@pytest.mark.parametrize(
    ("state", "text"),
    [
        ({"c": 1.0}, r"no moving joint or coordinate 'c'.*a\.x"),
        ({"a.q": 1.0}, r"a\.x"),
        ({"a": 1.0}, "follows the motion"),
        ({"a.yaw": 1.0}, "follows the motion"),
        ({"a.x": (1.0, 2.0, 3.0)}, "pair of position and speed"),
        ({"a.x": float("nan")}, "start of joint 'a.x'"),
        ({"a.x": (0.0, float("inf"))}, "speed at the start of joint 'a.x'"),
    ],
)
def test_wrong_states_are_refused(arm, state, text):
    with pytest.raises(jp.JointplayError, match=text):
        jp.Run(moving(arm, state=state))


@pytest.mark.parametrize("options", [*METHODS, {"seed": 4}])
def test_a_checkpoint_is_continued_bit_for_bit(arm, tmp_path, options):
    payload = jp.Payload("two", 0.5, pick=2e-3, release=6e-3)
    bearing = jp.RevoluteClearance(
        radial_clearance=1e-4, axial_clearance=1e-4, friction=jp.contact.LuGre(), wear_rate=1e-13
    )
    mechanism = arm.with_clearance({"a": bearing})
    simulation = moving(mechanism, 8e-3, payloads=[payload], judge_from=3e-3, **options)
    whole = simulation.run()
    run = jp.Run(simulation)
    for moment in run.steps(1e-3):
        if moment.time >= 4e-3:
            break
    path = run.checkpoint(tmp_path / "run.npz")
    again = jp.Simulation.resume(path).finish()
    for name in whole.dataset.data_vars:
        assert np.array_equal(again[name].values, whole[name].values, equal_nan=True), name
    assert again.audit == whole.audit
    assert again.status == Status.COMPLETED


@pytest.mark.parametrize("options", METHODS)
def test_a_run_at_its_end_is_not_run_again(arm, tmp_path, options):
    run = jp.Run(moving(arm, 1e-3, start="centred", **options))
    result = run.finish(check_step=False)
    again = jp.Simulation.resume(run.checkpoint(tmp_path / "run.npz"))
    for go_on in (run.finish, run.run_to_end, again.finish):
        with pytest.raises(jp.JointplayError, match=r"ended at t = 0\.001 s.*run\.result\(\)"):
            go_on()
    with pytest.raises(jp.JointplayError, match="cannot be run again"):
        list(run.steps())
    for ended in (run, again):
        kept = ended.result()
        assert kept.status == Status.COMPLETED
        assert kept.message == result.message
        assert (kept.time == result.time).all()
        assert (np.diff(kept.time) > 0.0).all()


def test_a_loop_is_continued_bit_for_bit(tmp_path):
    simulation = jp.Scenario.load("jointplay:four_bar.toml").simulation("0.2 mm")
    simulation = dataclasses.replace(simulation, duration=4e-3)
    run = jp.Run(simulation)
    next(moment for moment in run.steps() if moment.time > 2e-3)
    again = jp.Simulation.resume(run.checkpoint(tmp_path / "run.npz")).finish()
    assert (again["q"].values == simulation.run()["q"].values).all()


def test_damaged_and_foreign_checkpoints_are_refused(arm, tmp_path):
    run = jp.Run(moving(arm))
    path = run.checkpoint(tmp_path / "run.npz")
    with pytest.raises(jp.JointplayError, match="no checkpoint"):
        jp.Simulation.resume(tmp_path / "none")
    damaged = tmp_path / "damaged"
    damaged.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(jp.JointplayError, match="damaged"):
        jp.Simulation.resume(damaged)
    arrays = checkpoint_arrays(path)
    head = json.loads(arrays["head"].tobytes())
    head["versions"]["numba"] = "0.1"
    other = save_checkpoint(tmp_path / "other.npz", arrays, head)
    content = other.read_bytes()
    other.write_bytes(content.removeprefix(CHECKPOINT))
    with pytest.raises(jp.JointplayError, match="it does not begin with 'jointplay checkpoint"):
        jp.Simulation.resume(other)
    other.write_bytes(content)
    with pytest.raises(jp.JointplayError, match=r"another version \(numba 0\.1"):
        jp.Simulation.resume(other)


def turning(urdf, **options):
    path = urdf(body("disc", com="0.02 0 0"), joint("pin", "base", "disc"))
    bearing = jp.RevoluteClearance.planar(radial_clearance=1e-4)
    robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0.0, -9.81, 0.0))
    motion = jp.Motion(["pin"], [0.0, 0.1], [[0.0], [60.0 * 0.1]], "constant-speed")
    return jp.Simulation(robot, motion, drive=jp.loads.Prescribed(), **options)


def test_turns_settle_when_the_joint_has_turned_so_often(urdf):
    simulation = turning(urdf, settle="0.5 turns")
    assert simulation.judged_from == pytest.approx(np.pi / 60.0)
    result = simulation.run()
    assert result.judge_from == pytest.approx(np.pi / 60.0)
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
    assert result.audit.peak_force == force[result.time >= result.judge_from].max()
    assert result.audit.peak_force_before == force[result.time < result.judge_from].max()
    assert f"from {result.judge_from:g} s on" in str(result.audit)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"settle": "5 turns"}, "no joint of the motion makes so many turns"),
        ({"settle": "soon"}, "as in '2 turns'"),
        ({"settle": 0.2}, "the run ends at 0.1 s"),
        ({"judge_from": -1.0}, "judge_from"),
        ({"judge_from": 0.01, "settle": 0.02}, "give only one of them"),
        ({"start": "there"}, "no start 'there'"),
    ],
)
def test_wrong_judging_is_refused(urdf, options, text):
    with pytest.raises(jp.JointplayError, match=text):
        jp.Run(turning(urdf, **options))


def test_what_is_judged_counts_from_there(urdf):
    whole = turning(urdf, start="centred", judge_from=0.0).run()
    late = turning(urdf, start="centred", judge_from=0.05).run()
    assert (whole["q"].values == late["q"].values).all()
    assert late.audit.judged_impacts < whole.audit.judged_impacts == whole.audit.impacts
    assert 0.0 < late.audit.judged_impulse < whole.audit.judged_impulse
    assert late.audit.peak_force < late.audit.peak_force_before


def falling(urdf, restitution, **options):
    """A pendulum that a drive holds level, released in the middle of its bearing."""
    path = urdf(body("arm", 2.0, "0.001 0 0"), joint("pin", "base", "arm"))
    bearing = jp.RevoluteClearance.planar(radial_clearance=1e-4, restitution=restitution)
    robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0.0, -9.81, 0.0))
    motion = jp.Motion(["pin"], [0.0, 1.0], [[0.0], [0.0]])
    return jp.Simulation(robot, motion, start="centred", **options)


@pytest.mark.parametrize(
    "options", [{}, {"integrator": "semi-implicit-euler"}, {"integrator": "rk4"}]
)
def test_what_touches_when_a_run_begins_strikes_nothing(urdf, tmp_path, options):
    """Nor when the run is resumed: sentence, certificate and studies have one count."""
    lies = dataclasses.replace(falling(urdf, 0.5, duration=0.01, **options), start="rest")
    run = jp.Run(lies)
    run.advance(10)
    checkpoint = run.checkpoint(tmp_path / "half.ckpt")
    for result in (lies.run(estimate=False), jp.Simulation.resume(checkpoint).finish()):
        assert result.audit.impacts > 0
        assert result.audit.judged_impacts == rattle(result).impacts == 0
        assert measure(result, None, result.joints)["impacts"] == 0.0


@pytest.mark.parametrize("restitution", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("duration", [0.15, 0.3])
def test_a_run_is_judged_when_its_contacts_have_settled(urdf, restitution, duration):
    """As a ball's bounces are over, whatever the run's length: then all stands."""
    result = falling(urdf, restitution, duration=duration).run(estimate=False)
    e = jp.contact.LankaraniNikravesh().effective_restitution(restitution)
    fall = math.sqrt(2e-4 / 9.81)
    over = fall * (1.0 + e) / (1.0 - e)
    assert over < result.judge_from < over * (1.0 + 1e-3 / fall) + 1e-3
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
    late = result.time >= result.judge_from
    assert force[late] == pytest.approx(2.0 * 9.81, rel=0.05)
    assert result.audit.peak_force_before == force[~late].max() > 100.0
    assert result.audit.judged_impacts < 0.1 * result.audit.impacts
    assert "judged from the start" not in result.summary()


def test_contacts_that_have_not_settled_are_judged_from_the_start_which_is_said(urdf):
    for restitution, duration in ((0.9, 0.07), (1.0, 0.1)):
        result = falling(urdf, restitution, duration=duration).run(estimate=False)
        assert result.judge_from == 0.0
        assert "judged from the start, with the fall of the journals" in result.summary()


def test_when_contacts_have_settled_hangs_on_nobody_who_looks_or_goes_on(urdf, tmp_path):
    simulation = falling(urdf, 0.6, duration=0.05)
    result = simulation.run(estimate=False)
    run = jp.Run(simulation)
    for moment in run.steps():
        if moment.time > 0.01:
            break
    again = jp.Simulation.resume(run.checkpoint(tmp_path / "kept"))
    for one in (run, again):
        assert one.finish().audit == result.audit
    assert 0.01 < result.judge_from < 0.05


def test_teeth_that_a_seed_moves_settle_too(arm):
    gear = jp.Gear(play=2e-3, rotor_inertia=0.05, stiffness=1e4, damping=3.0)
    robot = jp.Mechanism(arm.description.path, gears={"a": gear})
    result = moving(robot, 0.4, seed=1).run(estimate=False)
    assert 0.0 < result.judge_from < 0.2
    assert moving(robot, 0.4).judged_from == 0.0


def test_a_start_is_over_after_a_turn_if_another_follows(urdf):
    period = np.pi / 30.0  # see `turning`
    for duration in (2.1 * period, 10.0 * period):
        one = turning(urdf, start="centred", settle=None, duration=duration)
        assert period <= one.judged_from <= period + 1.01 * one.step
    one = turning(urdf, start="centred", settle=None, duration=1.9 * period)
    assert one.judged_from is None


def test_the_twin_takes_of_a_state_what_it_has(arm):
    gear = jp.Gear(play=2e-3, rotor_inertia=1e-3, stiffness=1e4)
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    robot = jp.Mechanism(arm.description.path, {"a": bearing}, gears={"b": gear})
    state = {"b": (0.3, 0.1), "b.motor": 0.3005, "a.yaw": (0.2, None), "a.x": 1e-5}
    simulation = jp.Simulation(robot, duration=1e-3, drive={}, state=state)
    result = simulation.run()
    ideal = jp.analysis.twin(result)
    assert ideal.simulation.state == {"b": (0.3, 0.1), "a": (0.2, None)}
    assert ideal["q"].values[0] == pytest.approx([0.2, 0.3])
    error = jp.analysis.deviation(result)
    assert np.abs(error.values[0]).max() < 1e-3


@pytest.mark.parametrize("name", ["a$b$", "a=b", "a.x", 'a"b', "tool"])
def test_names_of_joints_are_never_parsed(urdf, name):
    text = quoteattr(name)
    path = urdf(
        body("one", com="0.1 0 0"), joint("NAME", "base", "one", axis="0 1 0"),
        body("two", com="0.1 0 0"), joint("b", "one", "two", axis="0 1 0", at="0.2 0 0")
    )  # fmt: skip
    path.write_text(path.read_text().replace('"NAME"', text))
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    robot = jp.Mechanism(path, {name: bearing})
    assert robot.joints == (name, "b")
    motion = jp.Motion([name, "b"], [0.0, 0.02], [[0.0, 0.0], [0.2, -0.3]])
    state = {f"{name}.x": 1e-5}
    result = jp.Simulation(robot, motion, duration=1e-3, state=state).run()
    assert result["q"].sel(coordinate=f"{name}.x").values[0] == 1e-5
    assert jp.analysis.deviation(result).size
    key = ("joints", name, "radial_clearance")
    assert path_of(dotted(key)) == key
    assert parse(f"{dotted(key)}=3").key == key
    assert name_and_number(f"{name}=0.1 mm", [name]) == (name, "0.1 mm")
    assert name_and_number(name, [name]) == (name, None)


def test_a_joint_called_like_a_coordinate_of_another_is_refused(urdf):
    path = urdf(body("one"), joint("a", "base", "one"), body("two"), joint("a.x", "one", "two"))
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    with pytest.raises(jp.JointplayError, match=r"'a\.x' has the same name as the coordinate 'x'"):
        jp.Mechanism(path, {"a": bearing})


WILD = (-1, 1000, 2**40, -(2**63))
"""Sizes and places that compiled code would follow to anywhere."""


def changed_checkpoints(path, folder):
    """The checkpoint with each of its whole numbers in turn changed to something wild: two things
    for one number, the two others for the next.
    """
    arrays, pairs = checkpoint_arrays(path), itertools.cycle((WILD[::2], WILD[1::2]))
    for name, array in arrays.items():
        for field in array.dtype.names or ("",):
            numbers = array[field] if field else array
            if numbers.dtype.kind != "i" or not numbers.size:
                continue
            for wild in next(pairs):
                changed = {key: value.copy() for key, value in arrays.items()}
                (changed[name][field] if field else changed[name])[...] = wild
                yield save_checkpoint(folder / "other.npz", changed)


@pytest.mark.thorough
def test_no_number_of_a_checkpoint_leads_compiled_code_astray(arm, tmp_path):
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4, wear_rate=1e-13)
    simulation = moving(arm.with_clearance({"a": bearing}), 2e-3)
    expected = simulation.run()["q"].values
    run = jp.Run(simulation)
    next(moment for moment in run.steps() if moment.step >= 60)
    taken = refused = 0
    for path in changed_checkpoints(run.checkpoint(tmp_path / "run.npz"), tmp_path):
        try:
            again = jp.Simulation.resume(path)
        except jp.JointplayError:
            refused += 1
            continue
        for name in ("nv", "nj", "width", "record_every", "longest", "rows"):
            assert again.workspace.run[name][0] == run.workspace.run[name][0], name
        taken += 1
        if again.workspace.run["solves"][0] == run.workspace.run["solves"][0]:
            assert len(again.finish()["q"].values) <= len(expected) + 1
    assert taken > 30
    assert refused > 30


@pytest.mark.parametrize("name", ["time", "path_start", "path_span"])
@pytest.mark.parametrize("value", [np.nan, -1.0, 1e9])
def test_a_checkpoint_whose_time_is_not_that_of_its_step_is_refused(name, value, arm, tmp_path):
    run = jp.Run(moving(arm))
    next(moment for moment in run.steps() if moment.step >= 20)
    arrays = checkpoint_arrays(run.checkpoint(tmp_path / "run.npz"))
    arrays["run"][name] = value
    save_checkpoint(tmp_path / "other.npz", arrays)
    with pytest.raises(jp.JointplayError, match=f"'{name}' is not that of its step"):
        jp.Simulation.resume(tmp_path / "other.npz")


def test_a_run_ends_when_a_journal_has_left_its_open_bearing(urdf):
    bush = jp.RevoluteClearance(bearing_length=20e-3, radial_clearance=1e-4, open_ends=True)
    robot = jp.Mechanism(urdf(body("arm"), joint("pin", "base", "arm")), {"pin": bush})
    free = {"drive": jp.loads.Free(), "duration": 0.05, "start": "centred"}
    with pytest.warns(RuntimeWarning, match="the journal of 'pin' left its bearing"):
        result = jp.Simulation(robot, state={"pin.z": (0.018, 0.5)}, **free).run()
    assert result.status == jp.Status.BROKE_OUT
    assert 20e-3 <= np.abs(result["journal_centre"].values[-1, 0, 2]) < 20.6e-3
    with pytest.raises(jp.JointplayError, match="'pin' begins outside its bearing"):
        jp.Run(jp.Simulation(robot, state={"pin.z": 0.02}, **free))
