import os
import re
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from conftest import ARM_WITH_HAND, body, joint

from jointplay import (
    JointplayError,
    Mechanism,
    Motion,
    Result,
    RevoluteClearance,
    Simulation,
    simulate,
)
from jointplay.base.errors import MissingName
from jointplay.cli import main
from jointplay.model import robot_list, robots
from jointplay.model.survey import survey
from jointplay.simulation.analysis import inputs

STEP = 2e-6
"""The weight of an arm jams the journal of a shoulder; at 1e-5 s its friction feeds energy [s]."""

ARMS = {  # bearing radius and length [m]
    "ur5": (30e-3, 60e-3),
    "panda": (30e-3, 60e-3),
    "kinova": (15e-3, 40e-3),
    "z1": (15e-3, 40e-3),
    "xarm7": (25e-3, 50e-3),
    "so101": (5e-3, 20e-3),
}
JOINTS = {
    "ur5": [
        *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
        *(f"wrist_{k}_joint" for k in (1, 2, 3)),
    ],
    "panda": [f"panda_joint{k}" for k in range(1, 8)],
    "kinova": [f"j2s6s200_joint_{k}" for k in range(1, 7)],
    "z1": [*(f"joint{k}" for k in range(1, 7)), "jointGripper"],
    "xarm7": [f"joint{k}" for k in range(1, 8)],
    "so101": ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"],
}


@pytest.fixture(scope="module", autouse=True)
def _installed():
    try:
        robots.share()
    except JointplayError as error:
        pytest.skip(str(error))


def with_play(name, joint, **fields):
    radius, length = ARMS[name]
    bearing = {
        "bearing_radius": radius,
        "bearing_length": length,
        "radial_clearance": 5e-5,
        "axial_clearance": 5e-5,
    }
    found = survey(name)
    clearance = {joint: RevoluteClearance(**bearing | fields)}
    return Mechanism(found.path, clearance, allow_unphysical=found.unphysical)


def short_motion(mechanism, duration=0.02):
    """A start from a bent posture: 0.01 rad or 1 mm in each joint."""
    names = mechanism.joints
    slides = [mechanism.description.joints[n].kind == "prismatic" for n in names]
    start = np.where(np.arange(len(names)) % 2, 0.4, -0.7)
    start = np.where(slides, 0.01, start)
    end = start + np.where(slides, 1e-3, 0.01)
    return Motion(names, [0.0, duration], np.stack([start, end]))


@pytest.mark.parametrize("name", ARMS)
def test_revolute_joints_are_those_that_people_know(name):
    found = survey(name)
    turning = ("revolute", "continuous")
    assert [joint for joint, kind in found.moving.items() if kind in turning] == JOINTS[name]
    assert found.serial
    assert not found.massless
    assert not found.problem


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        pytest.param(name, joint, marks=() if joint == JOINTS[name][1] else pytest.mark.thorough)
        for name in ARMS
        for joint in JOINTS[name]
    ],
)
def test_play_in_any_revolute_joint(name, joint):
    mechanism = with_play(name, joint)
    motion = short_motion(mechanism)
    step = STEP
    try:
        result = simulate(mechanism, motion, step=step, start="centred", limits="ignore")
    except JointplayError as error:  # a light last link; the message says which step it needs
        step = float(re.search(r"take at most ([\d.e+-]+) s", str(error)).group(1))
        assert STEP / 3 < step < STEP
        result = simulate(mechanism, motion, step=step, start="centred", limits="ignore")
    assert result.status.name == "COMPLETED"
    audit = result.audit
    assert audit.impacts > 0
    assert abs(audit.energy_residual) < 0.005 * audit.energy_exchanged
    x, y, z = (result["journal_centre"].sel(joint=joint, axis=a).values for a in "xyz")
    farthest = max(np.hypot(x, y).max(), np.abs(z).max())
    assert 0.5 * 5e-5 < farthest < 2.0 * 5e-5  # it fell, and stayed in its bearing


@pytest.mark.parametrize("name", ["ur5", "xarm7"])
@pytest.mark.parametrize("seed", range(2))
def test_perturbed_journals_of_a_loaded_arm_begin_free(name, seed):
    """Loaded journals lean at rest: to shift one without straightening it would press a rim in."""
    mechanism = with_play(name, JOINTS[name][1])
    at_rest = Simulation(mechanism, short_motion(mechanism), duration=1e-4).run(check_step=False)
    lean = at_rest["q"].values[0, mechanism.virtual_link(JOINTS[name][1]) :][4:6]
    assert np.abs(lean).max() > 1e-4
    perturbed = Simulation(mechanism, short_motion(mechanism), duration=1e-4, seed=seed)
    assert perturbed.run(check_step=False)["gap"].values[0].min() > 1e-6


def test_a_jammed_shoulder_is_followed_by_usual_steps():
    mechanism = with_play("ur5", "shoulder_lift_joint")
    motion, peaks = short_motion(mechanism), []
    for options in ({"step": 1e-5}, {"step": 1e-6}, {"tolerance": 1e-3}):
        result = simulate(mechanism, motion, **options)
        assert not any("step" in warning for warning in result.audit.warnings)
        peaks.append(np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1).max())
    assert peaks[1:] == pytest.approx(peaks[:1] * 2, rel=5e-3)


def test_names():
    known = robots.robots()
    assert {"ur3", "ur5", "ur10", "panda", "kinova", "z1", "xarm7", "so100", "so101", "ar4"} <= set(
        known
    )
    assert len(known) == len({robots.robot_urdf(name) for name in known})
    assert robots.robot_urdf("UR5").name == "ur5_robot.urdf"
    assert robots.robot_urdf("anymal-kinova") == robots.robot_urdf("anymal_kinova")


def test_two_urdfs_of_the_same_name_go_by_their_folders():
    assert robots.robot_urdf("anymal_b").parts[-3] == "anymal_b_simple_description"
    assert robots.robot_urdf("anymal_c").parts[-3] == "anymal_c_simple_description"
    with pytest.raises(MissingName, match="available: anymal_b, anymal_c"):
        robots.robot_urdf("anymal")


def test_an_unknown_robot_is_answered_with_those_that_exist():
    with pytest.raises(MissingName, match=r"no robot 'r2d2'.*panda.*ur5") as error:
        robots.robot_urdf("r2d2")
    assert "\n" not in str(error.value)


def test_without_the_package_the_message_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    with pytest.raises(JointplayError, match=r"pip install '\.\[robots\]'"):
        robots.robot_urdf("ur5")


@pytest.mark.thorough
def test_every_robot_is_surveyed():
    found = {name: survey(name) for name in robots.robots()}
    for name, robot in found.items():
        root = ElementTree.parse(robot.path).getroot()
        joints = {j.get("name"): j.get("type") for j in root.findall("joint")}
        assert robot.moving == {n: kind for n, kind in joints.items() if kind != "fixed"}, name
        assert not robot.problem
    assert found["panda"].mimics == ("panda_finger_joint2",)
    assert not found["a1"].serial
    assert "LFinger21" in found["romeo"].massless
    assert "move links without mass" in found["romeo"].remarks[0]
    assert not found["anymal_b"].unphysical  # of a base that is held
    assert any(line.endswith(": base") for line in found["anymal_b"].doubts)
    assert not found["so101"].unphysical
    assert not found["quadrotor_base"].moving
    astray = found["alex_psyonic_hands"]
    assert any("Left_index_q2 mimics 'index_q1', which is no joint" in x for x in astray.remarks)


def test_all_impossible_inertias_are_named_at_once():
    found = survey("icub")
    first, *others = found.unphysical
    with pytest.raises(JointplayError) as error:
        Mechanism(found.path)
    assert len(others) > 5
    assert f"too: {', '.join(others)}; all: --allow-unphysical all)" in str(error.value)
    assert Mechanism(found.path, allow_unphysical=["all"]).model.nv
    with pytest.raises(JointplayError, match=f"link '{others[0]}'"):
        Mechanism(found.path, allow_unphysical=[first])


def test_command_lists_all_robots(capsys):
    assert main(["robots"]) == 0
    out = capsys.readouterr().out
    assert out.index("\nur5\n") < out.index("OTHERS") < out.index("\na1\n")
    for name in JOINTS["ur5"]:
        assert name in out
    assert max(map(len, out.splitlines())) <= 100


def test_the_list_is_kept_until_a_robot_is_another(monkeypatch, tmp_path):
    cache, urdf = tmp_path / "cache", tmp_path / "robots" / "lamp_data" / "robots" / "lamp.urdf"
    monkeypatch.setenv("JOINTPLAY_CACHE", str(cache))
    monkeypatch.setattr(robots, "share", lambda: tmp_path)
    urdf.parent.mkdir(parents=True)
    urdf.write_text(ARM_WITH_HAND)
    loaded, own = [], robot_list._listed
    monkeypatch.setattr(robot_list, "_listed", lambda places: loaded.append(1) or own(places))

    def listed(times):
        loaded.clear()
        text = robot_list.listed(("lamp",))
        assert len(loaded) == times
        return text

    assert "lamp\n    2 revolute: j, k\n" in (first := listed(1))
    assert listed(0) == first
    kept = cache / "robots.txt"
    for damaged in (kept.read_bytes()[:-1], b"\xff", b""):
        kept.write_bytes(damaged)
        assert listed(1) == first
    urdf.write_text(ARM_WITH_HAND.replace('name="k"', 'name="x"'))  # of the same size
    os.utime(urdf, ns=(0, 0))  # another time even where the clock is coarse
    assert "2 revolute: j, x\n" in listed(1)
    listed(0)
    monkeypatch.setenv("JOINTPLAY_CACHE", str(urdf))  # no folder
    listed(1)


def test_command_lists_one_robot(capsys):
    assert main(["robots", "so101"]) == 0
    out = capsys.readouterr().out
    for name in JOINTS["so101"]:
        assert re.search(rf"^ +{name} +revolute\b", out, re.MULTILINE)
    assert main(["robots", "icub"]) == 0
    assert "option: --allow-unphysical all\n" in capsys.readouterr().out
    assert main(["robots", "r2d2"]) == 2


@pytest.mark.thorough
def test_a_humanoid_whose_head_has_no_mass_runs_with_its_neck_held(tmp_path, capsys):
    assert main(["robots", "icub"]) == 0
    told = re.findall("option: (--.*) (.*)", capsys.readouterr().out)
    assert told == [("--allow-unphysical", "all"), ("--fix", "neck_yaw,neck_roll")]
    line = ["run", "icub", "--joint", "l_hip_pitch", "--duration", "1 ms", "--no-figures"]
    assert main([*line, "--allow-unphysical", "all", "--out", str(tmp_path / "a")]) == 2
    assert "or hold their joints (--fix neck_yaw,neck_roll)" in capsys.readouterr().err
    options = [word for option in told for word in option]
    assert main([*line, *options, "--out", str(tmp_path / "b")]) == 0
    stored = inputs(Result.load(tmp_path / "b" / "result.nc"))["mechanism"]
    assert stored["fix"] == ["neck_yaw", "neck_roll"]
    assert stored["allow_unphysical"] == ["all"]
    held = re.findall('<joint name="(neck_.*?)" type="fixed"', stored["urdf_text"])
    assert sorted(held) == ["neck_roll", "neck_yaw"]
    budget = ["budget", "icub", "--tool", "head", "--clearance", "0.1 mm", *options]
    assert main(budget) == 0
    assert "neck_pitch" in (out := capsys.readouterr().out)
    assert "neck_yaw" not in out


def test_command_lists_any_urdf(urdf, capsys):
    slide = joint("slide", "arm", "tip", "prismatic")
    for key, value in (("lower", "-9"), ("upper", "9"), ("effort", "1e3"), ("velocity", "1e3")):
        slide = slide.replace(f'{key}="{value}"', f'{key}="0"')
    mimic = '<mimic joint="turn" multiplier="0.5" offset="-0.1"/></joint>'
    gear = (
        '<transmission name="t"><joint name="turn"/><actuator name="m">'
        "<mechanicalReduction>50</mechanicalReduction></actuator></transmission>"
    )
    path = urdf(
        body("arm"),
        '<link name="tip"/>',
        joint("turn", "base", "arm"),
        slide.replace("</joint>", mimic),
        gear,
    )
    assert main(["robots", str(path)]) == 0
    out = capsys.readouterr().out
    row = r"turn +revolute +base +arm +-9 to 9 rad +1000 rad/s +1000 N m +geared 50 : 1\n"
    assert re.search(row, out)
    assert re.search(r"slide +prismatic +arm +tip +follows 0\.5 turn - 0\.1\n", out)
    assert "frames: base, arm, tip" in out
    assert "tool, if none is named: tip" in out
    assert "links without mass: tip" in out
    assert "slide move links without mass" in out


def test_a_urdf_that_cannot_be_read_is_refused(tmp_path, capsys):
    path = tmp_path / "robot.urdf"
    assert main(["robots", str(path)]) == 2
    path.write_text("<robot>")
    assert main(["robots", str(path)]) == 2
    assert "not well-formed" in capsys.readouterr().err


def test_how_a_robot_is_stepped_is_chosen_and_said():
    from jointplay.cli import parser
    from jointplay.cli.commands.inputs import scenario_of

    line = ["run", "so101", "--out", "o", "--joint", "elbow_flex",
            "--allow-unphysical", "gripper_frame_link"]  # fmt: skip

    def chosen(*options):
        scenario = scenario_of(parser().parse_args([*line, *options]))
        said = [text for text in scenario.assumptions if text.startswith("step")]
        scenario.ready_run()
        return scenario.simulation(), said

    simulation, said = chosen()
    assert simulation.tolerance == 1e-3
    assert said == ["steps: by their own error, tolerance 0.001 (--step makes them equal)"]
    simulation, said = chosen("--integrator", "rk4")
    assert simulation.tolerance is None
    assert "step: 2e-06 s (chosen: an impact in elbow_flex lasts" in said[0]
    assert simulation.record_every == 50  # records 0.1 ms apart, as ever
    for options, field, value in (
        (("--step", "1e-6"), "step", 1e-6),
        (("--tolerance", "1e-4"), "tolerance", 1e-4),
    ):
        simulation, said = chosen(*options)
        assert not said
        assert getattr(simulation, field) == value


def test_a_robot_in_one_variant_is_found_by_its_name_and_others_are_proposed():
    assert robots.robot_urdf("hyq") == robots.robot_urdf("hyq_no_sensors")
    with pytest.raises(JointplayError, match=r"'so_102'; .*available: so10.*and others"):
        robots.robot_urdf("so_102")
    with pytest.raises(JointplayError, match=r"no robot 'talos'; .*available: talos_full"):
        robots.robot_urdf("talos")  # of several none is guessed


def test_a_motion_that_nobody_gave_keeps_from_the_limits():
    from jointplay.model.formats import read
    from jointplay.scenario.robot import robot_scenario

    scenario = robot_scenario("panda", ["panda_joint4"])
    entries = read(robots.robot_urdf("panda")).joints
    ways = scenario.data("result")["motion"]["joints"]
    assert entries["panda_joint4"].upper < 0.0  # begins elsewhere than at zero
    for name, way in ways.items():
        room = 0.009 * (entries[name].upper - entries[name].lower)
        assert entries[name].lower + room < min(way)
        assert max(way) < entries[name].upper - room


@pytest.mark.parametrize("name", ["tiago", "pr2", "baxter"])
def test_a_motion_that_nobody_gave_keeps_from_limits_of_speed_and_of_followers(name):
    from jointplay.scenario.reading import Setting
    from jointplay.scenario.robot import robot_scenario

    allowed = Setting(("robot", "allow_unphysical"), list(survey(name).unphysical), "test")
    simulation = robot_scenario(name, settings=[allowed], ideal=True).simulation()
    motion, entries = simulation.motion, simulation.mechanism.description.joints
    places, speeds, _ = motion(np.linspace(0.0, motion.duration, 2001))
    assert np.abs(speeds).max() > 0.1
    for moved, place, speed in zip(motion.joints, places.T, speeds.T, strict=True):
        entry = entries[moved]
        if entry.speed is not None:
            assert np.abs(speed).max() <= entry.speed, moved
        if entry.lower is not None:
            assert entry.lower <= place.min() <= place.max() <= entry.upper, moved


def installed():
    try:
        return robots.robots()
    except JointplayError:
        return ()


def command(line, capsys):
    status = main(line)
    said = capsys.readouterr()
    assert "Warning" not in said.err
    assert "Traceback" not in said.err
    return status, said.out, said.err


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name,
            marks={"allegro_left_hand": (), "tiago": pytest.mark.thorough}.get(
                name, pytest.mark.nightly
            ),
        )
        for name in installed()
    ],
)
def test_every_robot_is_run_and_budgeted_or_says_what_is_missing(name, tmp_path, capsys):
    found = survey(name)
    entries = found.mechanism.description.joints
    allowed = ["--allow-unphysical=all"] if found.unphysical else []
    budget = ["budget", name, "--clearance", "0.1 mm", *allowed]
    if not found.moving:
        for line in (budget, ["run", name, "--out", str(tmp_path / "out")]):
            status, _, error = command(line, capsys)
            assert status == 2
            assert "no joint that moves, so there is nothing to simulate" in error
        return
    status, out, error = command(budget, capsys)
    assert status == 0, error
    assert "worst case" in out
    frame = found.mechanism.model.frames[found.mechanism.tool_frame]
    chain = [
        found.mechanism.model.names[i] for i in found.mechanism.model.supports[frame.parentJoint]
    ]
    able = [joint for joint in chain if joint in entries and entries[joint].turns]
    first = next((j for j in [*able, *found.moving] if entries[j].child not in found.bare), None)
    line = ["run", name, f"--joint={first}", "--duration", "10 ms", *allowed]
    status, _, error = command([*line, "--no-figures", "--out", str(tmp_path / "out")], capsys)
    assert "beyond its limit" not in error
    if status:
        assert "no mass or inertia to speak of" in error
        assert found.massless or f"when {first!r} has clearance" in error
        assert all(entries[joint].child in error for joint in found.massless)
    else:
        assert (tmp_path / "out" / "result.nc").is_file()
        assert ("is held fast" in error) == bool(found.mechanism.held)


@pytest.mark.parametrize("more", [[], ["--integrator", "rk4"]])
def test_links_without_mass_are_named_before_a_step_is_chosen(more, tmp_path, capsys):
    line = ["run", "romeo", "--joint", "LShoulderPitch", "--out", str(tmp_path / "o"), *more]
    status, _, error = command(line, capsys)
    assert status == 2
    assert "LFinger21Link" in error
    assert "give each an <inertial>" in error
    assert "--fix" in error
    assert error.count("\n") == 1


def test_nearly_massless_links_are_named_before_a_step_is_chosen(urdf, tmp_path, capsys):
    path = urdf(
        body("arm"), body("tip", mass=1e-11, inertia=1e-11), joint("a", "base", "arm"),
        joint("j", "arm", "tip"),
    )  # fmt: skip
    line = ["run", str(path), "--joint", "j", "--integrator", "rk4", "--out", str(tmp_path / "o")]
    status, _, error = command(line, capsys)
    assert status == 2
    assert "'tip'" in error
    assert "<inertial>" in error
    assert "record_every" not in error


def test_that_a_base_is_held_is_said_of_what_is_no_arm(tmp_path, capsys):
    said = "the base 'base_link' is held fast, as if bolted to the ground"
    assert Mechanism("solo12").held == said
    assert "'base_link' is held fast" in str(Mechanism("solo12"))
    assert not Mechanism("ur5").held
    assert not Mechanism("scara").held
    assert said in command(["budget", "solo12", "--clearance", "0.1 mm"], capsys)[1]
    assert said in command(["robots", "solo12"], capsys)[1]
    (tmp_path / "s.toml").write_text(
        '[robot]\nurdf = "example-robot-data:solo12"\n[motion]\ntimes = [0, 1]\n'
        "[motion.joints]\nFL_HAA = [0, 0]\n"
    )
    assert said in command(["check", str(tmp_path / "s.toml"), "--no-picture"], capsys)[1]


def test_a_robot_without_play_is_told_how_to_give_it_some(capsys):
    status, _, error = command(["study", "wear", "ur5", "--joint=a", "--growth=1um"], capsys)
    assert status == 2
    assert "give --set 'joints.NAME.radial_clearance=\"0.1 mm\"'" in error
    assert "elbow_joint" in error
    assert error.count("\n") == 1


def test_wear_says_what_cannot_be_in_one_line_before_it_begins(tmp_path, capsys):
    (tmp_path / "s.toml").write_text(
        '[robot]\nurdf = "example-robot-data:solo12"\n[joints.FL_KFE]\nwear_rate = 1e-15\n'
        'radial_clearance = "0.1 mm"\naxial_clearance = "0.1 mm"\n'
        "[motion]\ntimes = [0, 0.1]\n[motion.joints]\nFL_KFE = [0, 0.1]\n"
    )
    line = ["study", "wear", str(tmp_path / "s.toml"), "--joint", "FL_KFE", "--growth", "1 um"]
    status, _, error = command(line, capsys)
    assert status == 2
    assert "is too large for the contact stiffness at 'FL_KFE'" in error
    assert error.count("\n") == 1


def test_who_names_no_play_is_told_how(capsys):
    status, _, error = command(["budget", "panda"], capsys)
    assert status == 2
    assert '--clearance "0.1 mm" (all joints that move the tool), --joint NAME="0.1 mm"' in error


def test_a_robot_of_ones_own_package_is_told_to_be_of_it():
    assert robots.with_package("SO101") == "jointplay:so101.urdf"
    assert robots.with_package("ur5") == "example-robot-data:ur5"
