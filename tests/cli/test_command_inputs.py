"""Every command takes a scenario or a robot, with the same options."""

import numpy as np
import pytest

from jointplay.accuracy.error_budget import budget
from jointplay.base.errors import JointplayError
from jointplay.base.schema import fields_at
from jointplay.cli import main, parser, parsers
from jointplay.cli.commands.inputs import FLAGS, explanation, posed_machine, scenario_of
from jointplay.scenario.declarations import Model
from jointplay.simulation.loads import ComputedTorque

SCARA = "jointplay:scara.toml"
CALLS = {
    "run": ["--out", "o"],
    "check": ["--no-picture"],
    "live": ["--no-browser"],
    "study iso9283": [],
    "study wear": ["--joint", "joint_b", "--growth", "1 um"],
    "study dynamics": ["turns", "--out", "o"],
    "study hunting": [],
    "compensate": [],
    "budget": [],
    "allocate": ["--target", "1 mm"],
    "export simulator": ["--joint", "joint_b", "--out", "o"],
    "identify": ["--plan"],
    "calibrate": ["poses.csv"],
    "export urdf": ["--out", "o.urdf"],
}
"""Commands that take a scenario or a robot, and the further arguments that each needs."""


def read(*words):
    return scenario_of(parser().parse_args([*words]), moves=words[0] != "budget")


def test_each_command_that_looks_at_a_robot_takes_a_scenario_or_a_robot():
    of_inputs = {
        name for name, one in parsers().items() if any(a.dest == "place" for a in one._actions)
    }
    assert of_inputs == set(CALLS)


@pytest.mark.parametrize("command", CALLS)
def test_a_wrong_key_is_answered_alike_by_each_command(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    play = ["--set", "joints.joint_b.radial_clearance=0.1 mm"]
    for place in (SCARA, "jointplay:scara.urdf"):
        assert (
            main([*command.split(), place, *CALLS[command], *play, "--set", "integration.stp=1"])
            == 2
        )
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert '--set integration.stp: unknown key "stp"; did you mean "step"?' in said
    assert main([*command.split(), "scaara", *CALLS[command]]) == 2
    assert "is neither a file nor a robot" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("flag", FLAGS, ids=lambda flag: flag.name)
def test_an_option_is_what_the_scenario_says_of_its_key(flag):
    for key in flag.keys:
        assert [*fields_at(Model, key)], key
    text, _ = explanation(flag)
    field, said = next(fields_at(Model, flag.keys[0]))
    assert text.endswith(".".join(flag.keys[0]))
    said = " ".join(said.replace("`", "").split()).rstrip(".")
    assert said[1:] in text
    assert said[:1].lower() == text[:1].lower() or not said
    for unit in field.units:
        assert unit.replace("*", " ") in text


def test_a_pose_is_given_alike_wherever_one_is_looked_at(tmp_path, capsys):
    geared = ["ar4", "--gear", "joint_2=1 deg"]
    for command in (
        ["export", "simulator", *geared, "--out", str(tmp_path / "o")],
        ["identify", *geared, "--plan", "dial"],
        ["study", "hunting", "so101", "--preset", "--of", "elbow_flex"],
    ):
        joint = "elbow_flex" if "hunting" in command else "joint_2"
        twice = ["--pose", f"{joint}=0.1 rad"] * 2
        assert main([*command, *twice]) == 2
        assert "give --pose once, got 2" in capsys.readouterr().err
        assert main([*command, "--pose", f"{joint}=0.1 m"]) == 2
        assert f"--pose {joint}: " in capsys.readouterr().err


def test_a_clearance_has_the_name_that_the_kind_of_joint_has_for_it():
    words = ["--joint", "joint_b", "--joint", "stroke=0.3 mm", "--clearance", "0.1 mm"]
    for command in (["run", "jointplay:scara.urdf", "--out", "o"], ["budget", SCARA]):
        more = ["--case", "0.2 mm"] if command[-1] == SCARA else []
        scenario = read(*command, *words, "--bearing-radius", "12 mm", *more)
        joints = scenario.mechanism(*more[1:]).clearance
        assert joints["joint_b"].radial_clearance == 1e-4
        assert joints["joint_b"].bearing_radius == 12e-3
        assert joints["stroke"].clearance == 3e-4


def test_options_are_for_all_joints_of_a_file_where_none_is_named():
    joints = read("run", "jointplay:scara_ab.toml", "--out", "o", "--restitution", "0.6")
    for case in joints.cases:
        for joint in joints.mechanism(case).clearance.values():
            assert joint.restitution == 0.6


def test_of_a_gear_its_play_suffices_everywhere_and_what_is_given_counts():
    words = ["jointplay:scara.urdf", "--gear", "joint_a=1 mrad"]
    moved = read("run", *words, "--joint", "joint_b", "--out", "o").mechanism()
    stands = read("budget", *words).mechanism()
    assert moved.gears == stands.gears
    assert stands.gears["joint_a"].play == 1e-3
    assert stands.rules["joint_a", "stiffness"].value == stands.gears["joint_a"].stiffness
    own = ["--gear-stiffness", "2e4", "--rotor-inertia", "0.5 kg*m^2"]
    gear = read("run", *words, *own, "--out", "o").mechanism().gears["joint_a"]
    assert (gear.stiffness, gear.rotor_inertia) == (2e4, 0.5)


def test_a_drive_is_told_by_one_key_and_refuses_what_it_does_not_have():
    gear = ["jointplay:ar4.urdf", "--gear", "joint_2=1 deg"]
    for said in (["--encoder", "link"], ["--set", "drive.encoder=link"]):
        drive = read("run", *gear, "--out", "o", *said).simulation().drive
        assert drive == ComputedTorque(encoder="link")
    with pytest.raises(JointplayError, match=r"--bandwidth has no meaning .* prescribed"):
        read("run", *gear, "--out", "o", "--set", "drive=prescribed", "--bandwidth", "50")


def test_a_file_counts_more_than_a_preset_and_options_more_than_both():
    plain = read("budget", SCARA, "--case", "0.2 mm").mechanism("0.2 mm").clearance["joint_b"]
    preset = ["budget", SCARA, "--case", "0.2 mm", "--preset", "ur-like"]
    found = read(*preset).mechanism("0.2 mm")
    assert found.clearance["joint_b"] == plain
    assert "joint_a" in {*found.clearance, *found.gears}
    changed = read(*preset, "--joint", "joint_b=0.4 mm").mechanism("0.2 mm")
    assert changed.clearance["joint_b"].radial_clearance == 4e-4


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (["study", "wear"], 'joints.NAME.wear_rate="1e-5 mm^3/(N*m)"'),
        (["study", "wear"], '--set joints.NAME.radial_clearance="0.05 mm"'),
        (["export", "simulator"], "--tilt let the axes tilt"),
        (["budget"], "radial clearance of the joints of --joint, or of all that move the tool"),
    ],
)
def test_the_short_help_says_what_is_needed(command, says, capsys):
    with pytest.raises(SystemExit):
        main([*command, "--help"])
    assert says in " ".join(capsys.readouterr().out.split())


def test_wear_of_a_robot_needs_no_more_than_its_help_says(capsys):
    given = ["radial_clearance=0.05 mm", "wear_rate=1e-5 mm^3/(N*m)"]
    keys = [word for one in given for word in ("--set", f"joints.elbow_joint.{one}")]
    wear = ["study", "wear", "ur5", "--joint", "elbow_joint", "--growth", "2 um", "--blocks", "1"]
    assert main([*wear, *keys]) == 0
    assert "the clearance of 'elbow_joint' has grown" in capsys.readouterr().out


def test_what_a_measurement_may_hold_is_not_its_unit(capsys):
    with pytest.raises(SystemExit):
        main(["identify", "--help"])
    assert "measurement [s]" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "at_rest"),
    [
        ([], 3.56),
        (["--encoder", "link"], 0.0),
        (["--set", "drive.encoder=link", "--set", "drive.kind=computed-torque"], 0.0),
        (
            [
                "--set",
                "drives.joint_2.kind=computed-torque",
                "--set",
                "drives.joint_2.encoder=link",
            ],
            0.0,
        ),
        (["--set", "drives.joint_2.kind=prescribed"], 3.56),
    ],
)
def test_what_holds_a_robot_at_rest_is_what_the_options_say(options, at_rest):
    """This holds without a motion, too."""
    given = ["budget", "ar4", "--gear", "joint_2=1 deg", *options]
    posed = posed_machine(parser().parse_args(given))
    found = budget(posed.mechanism, posed.poses.q, **posed.poses.holding)
    assert 1e3 * found.rest_error[0] == pytest.approx(at_rest, abs=0.01)


def test_a_file_without_a_motion_says_what_holds_it(tmp_path):
    path = tmp_path / "arm.toml"
    text = '[robot]\nurdf = "jointplay:ar4.urdf"\n[gears.joint_2]\nplay = "1 deg"\n'
    for side, at_rest in (("motor", 3.56), ("link", 0.0)):
        path.write_text(f'{text}[drive]\nkind = "computed-torque"\nencoder = "{side}"\n')
        posed = posed_machine(parser().parse_args(["budget", str(path)]))
        found = budget(posed.mechanism, posed.poses.q, **posed.poses.holding)
        assert 1e3 * found.rest_error[0] == pytest.approx(at_rest, abs=0.01)


def test_a_payload_weighs_at_rest_as_a_force_does_and_drives_do_not_know_it(capsys):
    def at_rest(*options):
        words = ["budget", "ur5", "--clearance", "0.1 mm", *options]
        posed = posed_machine(parser().parse_args(words))
        force = (0.0, 0.0, -5.0 * 9.81) if not posed.poses.machine.payloads else (0.0, 0.0, 0.0)
        found = budget(posed.mechanism, posed.poses.q, force=force, **posed.poses.holding)
        return found.rest_positions.at(0)

    held = at_rest("--payload", "5 kg", "--set", "drive.kind=prescribed")
    pushed = at_rest("--set", "drive.kind=prescribed")
    assert held.error == pytest.approx(pushed.error, rel=1e-3, abs=1e-6)
    assert not held.sag.any()
    sagged = at_rest("--payload", "5 kg")
    assert 1e3 * np.linalg.norm(sagged.sag[:3]) == pytest.approx(1.75, rel=0.01)
    assert sagged.error[:3] - sagged.sag[:3] == pytest.approx(held.error[:3], abs=2e-5)


def test_what_others_call_play_is_asked_for_by_its_key(capsys):
    words = ["--gear", "joint_a=1 mrad", "--set", "gears.joint_a.backlash=1 deg"]
    assert main(["check", "jointplay:scara.urdf", "--no-picture", *words]) == 2
    assert 'unknown key "backlash" of the kind backlash; did you mean "play"?' in (
        capsys.readouterr().err
    )


WITHOUT_PLAY = ["run --out o", "study iso9283", "budget", "identify --plan"]
WITHOUT_PLAY += ["export simulator --all --out o"]


@pytest.mark.parametrize("line", WITHOUT_PLAY)
def test_a_robot_without_play_is_told_of_its_preset_by_each_command(
    line, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    words = line.split()
    kind = [words.pop(0)] + ([words.pop(0)] if words and words[0].isidentifier() else [])
    assert main([*kind, "so101", *words]) == 2
    assert "give --preset (what is publicly known of so101)" in capsys.readouterr().err
    assert main([*kind, "ur5", *words]) == 2
    said = capsys.readouterr().err
    assert "nothing has play: give --clearance" in said  # of which no preset is known


def test_without_clearance_no_journal_of_a_preset_or_of_a_key_has_any():
    words = ["--preset", "ur-like", "--set", "joints.elbow_joint.radial_clearance=0.05 mm"]
    loose = read("run", "ur5", *words, "--out", "o").mechanism()
    ideal = read("run", "ur5", *words, "--ideal", "--out", "o").mechanism()
    assert {"elbow_joint", "wrist_1_joint"} <= set(loose.clearance)
    assert all(joint.ideal for joint in ideal.clearance.values())
    assert all(gear.play == 0.0 for gear in ideal.gears.values())
