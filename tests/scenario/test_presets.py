"""What is publicly known of robots' joints: every number with its origin, every preset usable."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jointplay as jp
from jointplay import cli
from jointplay.accuracy.causes import CAUSES
from jointplay.accuracy.error_budget import budget
from jointplay.base.errors import JointplayError, MissingName
from jointplay.scenario.presets import Preset, preset, preset_of, presets

ARMS = {"ur-like": "ur5", "panda-like": "panda", "printed-servo": "z1", "opentorque": "z1"}
"""Robots of presets that name none; for the others a chain of the joints that they name."""

LINK = """<link name="{name}_link"><inertial><origin xyz="0 0 0.06"/><mass value="0.3"/>
<inertia ixx="6e-4" iyy="6e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_link"/>
<origin xyz="0 0 0.12"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" effort="0" velocity="0"/></joint>"""


def arm_of(name, folder):
    """A robot for a preset: its own, one of `ARMS`, or a chain of the joints that it names."""
    one = preset(name)
    if one.named and one.robot is None:
        parents = ["base", *(f"{joint}_link" for joint in one.named)]
        axes = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0")
        links = (
            LINK.format(name=joint, parent=parent, axis=axis)
            for joint, parent, axis in zip(one.named, parents, axes, strict=False)
        )
        path = folder / "arm.urdf"
        path.write_text(f"<robot name='arm'><link name='base'/>{''.join(links)}</robot>")
        return str(path)
    return one.robot or ARMS.get(name, one.robots[0] if one.robots else "ur5")


@pytest.mark.parametrize("name", presets())
def test_nothing_is_lacking_and_every_number_says_where_it_comes_from(name):
    assert preset(name).lacks() == []


@pytest.mark.thorough
@pytest.mark.parametrize("name", presets())
def test_every_preset_makes_a_mechanism_with_a_whole_budget(name, tmp_path):
    one = preset(name)
    mechanism = one.mechanism(arm_of(name, tmp_path))
    assert mechanism.clearance or mechanism.gears
    found = budget(mechanism, {}, kind=one.errors, causes=CAUSES)
    assert found.worst[0] > 0.0
    if name in ("so101", "ur-like", "panda-like"):
        drawn = np.linalg.norm(found.sample(20_000), axis=1)
        assert drawn.max() <= 1.002 * found.worst[0]
        assert found.reached == pytest.approx(found.worst[0], rel=0.02)
        assert np.sqrt((drawn**2).mean()) == pytest.approx(found.rms[0], rel=0.02)


STAND = """<robot name="stand"><link name="base"/><link name="lever"><inertial>
<origin xyz="0.05 0 0"/><mass value="0.03"/>
<inertia ixx="1e-5" iyy="4e-5" izz="4e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="servo" type="revolute"><parent link="base"/><child link="lever"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="3" velocity="5"/></joint></robot>"""


@pytest.mark.parametrize("play", [0.0, math.radians(0.5)])
def test_the_servo_holds_its_lever_where_the_published_stand_found_it(tmp_path, play):
    """Counts of the encoder between the sides, after and under 0.147 N m: 7.0 and 14.8, +-2.1."""
    (tmp_path / "stand.urdf").write_text(STAND)
    one = preset("so101")
    gear = replace(one.mechanism().gears["elbow_flex"], play=play)
    servo = one.drives(one.mechanism().description)["elbow_flex"]
    mechanism = jp.Mechanism(tmp_path / "stand.urdf", gears={"servo": gear}, gravity=(0, 0, 0))
    course = {0.0: 0, 0.2: 0, 0.4: 1, 1.0: 1, 1.2: 0, 2.0: 0, 2.2: -1, 2.8: -1, 3.0: 0, 3.8: 0}
    course |= {4.0: 1, 4.6: 1}
    moments = [[0.0, 0.0, 0.147 * part] for part in course.values()]
    pull = jp.loads.WrenchOverTime("lever", times=list(course), moments=moments)
    result = jp.simulate(
        mechanism,
        motion=jp.Motion(["servo"], [0.0, 5.0], [[0.0], [0.0]]),
        drive={"servo": servo},
        loads={"pull": pull},
        duration=4.6,
        step=2e-5,
    ).completed()
    angle = result["q"].values[:, mechanism.motor("servo")] / (2.0 * math.pi / 4096)
    relaxed, pulled, back, again = np.interp([1.99, 2.79, 3.79, 4.59], result.time, angle)
    assert relaxed - back == pytest.approx(7.0, abs=2 * 2.1)
    assert again - pulled == pytest.approx(14.8, abs=2 * 2.1)
    assert relaxed - back > 3.0


def test_a_robot_of_which_nothing_is_known_says_so_and_offers_classes():
    assert preset_of("so101").name == "so101"
    assert preset_of("/home/me/PAROL6.urdf").name == "parol6"
    with pytest.raises(JointplayError, match=r"nothing is publicly known.*--preset ur-like"):
        preset_of("ur5")
    with pytest.raises(JointplayError, match=r"nothing is publicly known.*--preset"):
        preset_of("kinova")
    with pytest.raises(MissingName, match="so101"):
        preset("so100")
    with pytest.raises(MissingName, match=r"openarm: Damiao's manuals .* no backlash"):
        preset("openarm")
    with pytest.raises(JointplayError, match=r"too little is publicly known .*Dummy.*strain-wave"):
        preset_of("Dummy.urdf")
    with pytest.raises(JointplayError, match="none of them"):
        preset("so101").mechanism("ur5")
    with pytest.raises(JointplayError, match="give a robot"):
        preset("ur-like").mechanism()


@pytest.mark.thorough
@pytest.mark.parametrize("name", presets())
def test_every_preset_runs_with_its_drives(name, tmp_path, capsys):
    """Drives tuned to the rigid arm, their encoders on the link, made elastic gears diverge."""
    run = ["run", arm_of(name, tmp_path), "--preset", name, "--duration", "0.4", "--no-figures",
           "--no-error-estimate", "--out", str(tmp_path / "o")]  # fmt: skip
    assert cli.main(run) == 0, capsys.readouterr().err
    result = jp.Result.load(tmp_path / "o" / "result.nc")
    assert result.time[-1] == pytest.approx(0.4)
    assert result.tool_error.distance.max() < 0.1
    if result.joints:
        assert np.abs(result["joint_force"]).max() < 1000.0


def test_the_command_line_lists_and_uses_them(tmp_path, capsys):
    assert cli.main(["robots", "--presets"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in presets())
    assert "seen" in shown
    assert "assumed" in shown
    assert cli.main(["robots", "--presets", "so100"]) == 2
    assert "so101" in capsys.readouterr().err
    assert cli.main(["budget", "so101", "--preset"]) == 0
    assert "shoulder_lift (gear)" in capsys.readouterr().out
    assert cli.main(["budget", "ur5", "--preset"]) == 2
    assert "--preset ur-like" in capsys.readouterr().err
    run = ["run", "so101", "--preset", "--duration", "0.02", "--no-figures",
           "--no-error-estimate", "--out", str(tmp_path)]  # fmt: skip
    assert cli.main(run) == 0
    said = capsys.readouterr()
    assert "preset so101" in said.out + said.err
    result = jp.Result.load(tmp_path / "result.nc")
    assert set(result.simulation.mechanism.gears) == set(preset("so101").every["joints"])


def test_a_servo_arm_rests_in_its_budget_as_far_off_as_its_run_begins(capsys, tmp_path):
    """Servos sag, and encoders on the motors' side do not see how far the gears give way."""
    assert cli.main(["budget", "so101", "--preset"]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("all ")]
    at_rest = float(row.split()[4])
    call = ["run", "so101", "--preset", "--duration", "1 ms", "--no-error-estimate", "--no-figures"]
    assert cli.main([*call, "--quiet", "--out", str(tmp_path / "o")]) == 0
    begins = jp.Result.load(tmp_path / "o" / "result.nc")["tool_position"].values[0]
    commanded = jp.budget(preset("so101").mechanism(), {}).positions[0]
    assert at_rest == pytest.approx(1e3 * np.linalg.norm(begins - commanded), rel=1e-3)
    assert at_rest > 30.0


OWN = """[preset]
description = "my arm"
[joint.elbow_joint.bearing]
radial_clearance = "30 um"
[joint.wrist_1_joint.gear]
play = "2 arcmin"
"""


def test_a_file_of_ones_own_is_a_preset(tmp_path, capsys):
    path = tmp_path / "my_arm.toml"
    path.write_text(OWN)
    mechanism = preset(path).mechanism("ur5")
    assert mechanism.clearance["elbow_joint"].radial_clearance == pytest.approx(30e-6)
    assert mechanism.gears["wrist_1_joint"].play == pytest.approx(math.radians(2 / 60))
    assert cli.main(["budget", "ur5", "--preset", str(path)]) == 0
    assert "wrist_1_joint (gear)" in capsys.readouterr().out
    run = ["run", "ur5", "--preset", str(path), "--duration", "0.01", "--out", str(tmp_path / "o")]
    assert cli.main(run) == 0  # what its gear lacks follows by rules


ORIGIN = """[[origin]]
key = 'wrist_1_joint.gear.play'
value = '2 arcmin'
origin = 'seen'
source = 'a page'
interval = [1, 2]
"""

WHOLE = """[preset]
description = "my arm"
known = "its catalogue"
errors = "printed"
[joint.elbow.gear]
play = "2 arcmin"
stiffness = 5e3
rotor_inertia = 0.1
[[origin]]
key = "gear.play"
value = "2 arcmin"
origin = "seen"
source = "its data sheet"
[[origin]]
key = "elbow.gear"
value = "see the file"
origin = "assumed"
source = "what is usual"
"""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("", ""), []),
        (('"elbow.gear"', '"elbow.gear.stiffness"'), ["elbow.gear.rotor_inertia has no .*key = "]),
        (('"elbow.gear"', '"elbw.gear"'), ["stiffness has", "inertia has", 'the key "elbw.gear"']),
        (('"its data sheet"', '" "'), ["gear.play: source is empty"]),
        (('errors = "printed"', ""), ["errors is missing, one of .*printed"]),
        (('known = "its catalogue"', ""), ["known is missing"]),
    ],
)
def test_what_a_contribution_lacks_is_said(tmp_path, capsys, change, said):
    path = tmp_path / "mine.toml"
    path.write_text(WHOLE.replace(*change))
    lacks = preset(path).lacks()
    assert len(lacks) == len(said), lacks
    for line, words in zip(lacks, said, strict=True):
        assert re.search(words, line), line
    assert cli.main(["robots", str(path), "--presets"]) == 0
    assert capsys.readouterr().out.count("! lacks:") == len(said)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("elbow_joint.bearing", "elbow_jnt.bearing"), r"no joint 'elbow_jnt'; did you mean"),
        (("bearing]", "bearng]"), r'line 3, joint.elbow_joint.bearng: unknown key.*mean "bearing"'),
        (("[preset]", "[presett]"), r'line 1, presett: unknown key "presett"; did you mean'),
        (("description", "descriptn"), r"line 2, preset.descriptn: unknown key.*mean .description"),
        (("30 um", "30 umm"), r'line 4, .*unknown unit "umm"'),
        (("radial_clearance", "radial"), r'line 4, .*unknown key "radial"'),
        (("[preset]", "[preset"), "line 1, .*Expected"),
        ((OWN, ""), "no preset: tables such as"),
        ((OWN, "joint = 5"), "expected a (list|table)"),
        ((OWN, "joint = [5]"), r"line 1, joint\[1\]: 5 is not a table"),
        ((OWN, "every = 5"), "every: 5 is not a table"),
        ((OWN, "[every.gear]\nplay = 1e-3"), "every: the key joints is missing"),
        ((OWN, "every = {joints = ['elbow_joint', 'elbw_joint'], gear = {play = 1e-3}}"),
         "no joint 'elbw_joint'; did you mean"),
        ((OWN, "every = {joints = 'elbow_joint'}"), "every.joints: expected a list"),
        ((OWN, OWN + "[every]\njoints = ['elbow_joint']"), "either"),
        ((OWN, "joint.elbow_joint = 1"), "1 is not a table"),
        ((OWN, "joint.elbow_joint.gear.kind = 'bcklash'"),
         'no .*"bcklash"; did you mean "backlash"'),
        ((OWN, "joint.elbow_joint.gear = 'backlash'"), '"backlash" is not a table'),
        ((OWN, "joint.elbow_joint.drive = 7"), "7 is not a table"),
        (('"my arm"', "5"), "preset.description: expected text in quotes, got 5"),
        (('"my arm"', '"my arm"\nrobots = "ur5"'), "preset.robots: expected a list"),
        (('"my arm"', '"my arm"\nrobot = 5'), "preset.robot: expected text"),
        (('"my arm"', '"my arm"\nerrors = "print"'), 'no class of errors "print"; did you mean'),
        (("[joint.e", "origin = [5]\n[joint.e"), "origin"),
        (("[preset]", "origin = 5\n[preset]"), "origin: expected a list"),
        ((OWN, OWN + "[[origin]]\nkey = 'gear.play'"), "line 7, origin.1.: the keys value"),
        *(
            ((OWN, OWN + ORIGIN.replace(*change)), said)
            for change, said in [
                (("'seen'", "'sen'"), 'line 10, .*no origin "sen"; did you mean "seen"'),
                (("'seen'", "3"), "origin.1..origin: no origin 3"),
                (("[1, 2]", "[2, 1]"), "line 12, .*a lower and an upper end, got .2.0, 1.0."),
                (("[1, 2]", "[2]"), "a lower and an upper end"),
                (("[1, 2]", "['a', 2]"), "interval"),
                (("[1, 2]", "2"), "expected a list"),
            ]
        ),
    ],
)  # fmt: skip
def test_a_file_that_is_no_preset_says_why(tmp_path, change, said):
    path = tmp_path / "my_arm.toml"
    path.write_text(OWN.replace(*change))
    with pytest.raises(JointplayError, match=said) as caught:
        preset(path).mechanism("ur5")
    assert "\n" not in str(caught.value)


def test_a_misspelt_servo_does_not_vanish(tmp_path, capsys):
    path = tmp_path / "e2.toml"
    text = (Path(jp.__file__).parent / "scenario" / "data" / "so101.toml").read_text()
    path.write_text(text.replace("[every.drive]", "[every.drvie]"))
    assert cli.main(["budget", "so101", "--preset", str(path)]) == 2
    assert 'unknown key "drvie"; did you mean "drive"' in capsys.readouterr().err


def test_a_bare_word_stands_for_a_table_as_in_scenarios(tmp_path):
    path = tmp_path / "my_arm.toml"
    path.write_text(OWN + "[joint.wrist_2_joint]\ndrive = 'prescribed'")
    one = preset(path)
    assert (
        one.drives(one.mechanism("ur5").description)["wrist_2_joint"].describe()["kind"]
        == "prescribed"
    )


@pytest.mark.parametrize("name", [[], None, 5, {}])
def test_a_name_of_another_kind_is_refused(name):
    with pytest.raises(JointplayError, match="must be text"):
        preset(name)
    with pytest.raises(JointplayError, match="must be text"):
        preset_of(name)


def test_a_mechanism_as_a_preset_is_the_same_again(tmp_path):
    for name, robot in (
        ("so101", "so101"),
        ("ar4", "ar4"),
        ("ur-like", "ur5"),
        ("x-scara", "scara"),
    ):
        one = preset(name)
        mechanism = one.mechanism(robot)
        drives = one.tables(mechanism.description).get("drives", {})
        text = Preset.of_mechanism(mechanism, "mine", one.origins, {"drive": drives}, robot).text
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        again = preset(path)
        assert again.mechanism() == mechanism
        assert again.drives(mechanism.description) == one.drives(mechanism.description)
        assert again.origins == one.origins
