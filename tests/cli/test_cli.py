"""The command line through its real entry point."""

import os
import pickle
import re
import signal
import subprocess
import sys
import time
import warnings
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from conftest import body, joint
from warm import JOINTPLAY, PYTHON

from jointplay import JointplayError, Mechanism, Result, simulate
from jointplay.base import files, streams
from jointplay.base.errors import MissingName
from jointplay.cli import main, parsers
from jointplay.cli.commands import GROUPS, KINDS
from jointplay.model.gear import Gear
from jointplay.model.robots import shipped
from jointplay.paper import CONDITIONS, output_names
from jointplay.physics.kernel import Status
from jointplay.simulation.loads import Free
from jointplay.study.runs import Runs

START = str(Path(sys.executable).parent / "jointplay")
"""The command as a new process."""
SHORT = ("--duration", "0.02", "--quiet", "--no-figures")


def jointplay(*arguments: object, timeout: float = 900.0) -> subprocess.CompletedProcess[str]:
    command = [JOINTPLAY, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


@pytest.mark.parametrize("command", sorted(parsers()))
def test_help_says_per_cent_as_it_is_written(command, capsys):
    """argparse formats some of its texts and not others."""
    with pytest.raises(SystemExit, match="0"):
        main([*command.split(), "--help", "all"])
    said = capsys.readouterr()
    assert said.out.startswith(f"usage: jointplay {command}")
    assert "%%" not in said.out
    assert not said.err


@pytest.mark.parametrize("command", [*sorted(parsers()), *KINDS])
def test_help_fits_on_one_screen(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit, match="0"):
        main([*command.split(), "--help"])
    said = capsys.readouterr().out
    assert len(said.splitlines()) <= 40
    assert f"jointplay {command} --help all" in said


def test_help_has_what_is_needed_most_often_and_all_of_it_when_asked(capsys):
    found = []
    for more in ([], ["all"]):
        with pytest.raises(SystemExit, match="0"):
            main(["run", "--help", *more])
        found.append(capsys.readouterr().out)
    short, every = found
    assert "--joint" in short
    assert "--out DIR" in short
    assert "--macro-step" not in short
    assert "--macro-step" in every
    assert re.search(r"--axial-clearance LENGTH.*integration", every, re.S)
    with pytest.raises(SystemExit, match="2"):
        main(["run", "--help", "everything"])
    assert "takes nothing, or all, got 'everything'" in capsys.readouterr().err


def test_the_short_help_keeps_units_within_a_clause_and_begins_with_what_is_needed_most(
    capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit, match="0"):
        main(["run", "--help"])
    said = capsys.readouterr().out
    assert "or time [s],<joint> [deg],..." in said
    assert "joint with clearance, optionally its radial clearance, ISO 286 fit or rolling" in said
    assert re.search(r"radial clearance .*tool \[m\]$", said, re.M)
    assert re.search(r"simulated time \[s\]$", said, re.M)
    places = [said.index(f"  --{name} ") for name in ("out", "joint", "motion", "set", "beside")]
    assert places == sorted(places)


def test_help_speaks_of_options_and_not_of_python(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["run", "--help", "all"])
    said = " ".join(capsys.readouterr().out.split())
    assert not re.search(r"\bNone (takes|derives|of)|None:|BANDWIDTH|hertz stiff", said)
    assert "if not given, 100 rad/s" in said


def test_commands_are_shown_by_what_they_are_for_and_where_to_begin(capsys):
    names = [name for several in GROUPS.values() for name in several]
    assert len(names) <= 17
    assert main([]) == 0
    alone = capsys.readouterr().out
    assert len(alone.splitlines()) <= 25
    assert all(re.search(rf"\b{name}\b", alone) for name in [*GROUPS, *names])
    assert "jointplay run ar4 --gear joint_2" in alone
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    assert capsys.readouterr().out == alone
    assert main(["study"]) == 0
    kinds = capsys.readouterr().out
    assert all(kind in kinds for kind in KINDS["study"])


def test_an_unknown_kind_of_study_is_answered_with_the_kinds(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["study", "iso"])
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "iso9283" in said
    assert "dynamics" in said


def test_version():
    done = subprocess.run([START, "--version"], capture_output=True, text=True, check=False)
    assert re.fullmatch(r"jointplay \d+\.\d+\.\d+\n", done.stdout)


BAD_INPUT = {
    "missing URDF": (["nowhere.urdf"], "nowhere.urdf"),
    "unknown joint": (
        ["--joint", "elbow"],
        '--joint: no joint "elbow"; available: joint_a, joint_b, stroke, joint_c',
    ),
    "nearly a joint": (["--joint", "joint"], 'no joint "joint"; did you mean "joint_'),
    "not revolute": (
        ["--joint", "stroke", "--set", "joints.stroke.kind=revolute"],
        "'stroke' is prismatic",
    ),
    "negative clearance": (["--clearance", "-1e-4"], "-0.1 mm"),
    "not a number": (["--clearance", "wide"], '--clearance: "wide" is not a length'),
    "non-finite": (["--clearance", "nan"], "nan"),
    "journal too large": (["--journal-radius", "0.02"], "20 mm does not fit"),
    "restitution": (["--restitution", "1.5"], "[0, 1], got 1.5"),
    "friction": (["--friction", "-0.1"], "-0.1"),
    "step too large": (["--step", "1e-3"], "0.001 s is too large for the contact stiffness"),
    "gravity": (["--gravity", "down"], '--gravity: no gravity "down"'),
    "motion": (["--motion", "none.csv"], "none.csv"),
    "unphysical link": ([shipped("scara_as_printed.urdf")], "'arm1'"),
    "no joint chosen": ([shipped("scara.urdf")], "joint_a, joint_b, stroke, joint_c"),
    "no robot": (["nothing_like_it"], "nothing_like_it"),
    "not a setting": (["--set", "step"], '--set "step": give KEY=VALUE'),
    "not a key": (["--set", "a..b=1"], '"a..b" is not a key'),
    "unknown key": (
        ["--set", "integration.stepp=1"],
        '--set integration.stepp: unknown key "stepp"; did you mean "step"?',
    ),
    "setting of a case": (["--set", "cases.x.title=1"], "--set cases.x.title"),
    "joint of no joint": (["--ideal", "--clearance", "1e-4"], "--clearance is for a joint"),
    "case of a robot": (["--case", "one"], "--case needs a scenario"),
    "missing file": (["none.toml"], "none.toml"),
    "no such case": (["jointplay:scara.toml", "--case", "x"], "ideal, 0.2 mm, 0.5 mm"),
    "jobs": (["jointplay:scara.toml", "--jobs", "0"], "got 0"),
    "law": (["--law", "magnetic"], '--law: no normal-force law "magnetic"'),
    "law without its parameter": (["--law", "kelvin-voigt"], "the key damping is missing"),
    "parameter of another law": (["--damping", "3"], "of the law lankarani-nikravesh"),
    "law without its mass": (["--law", "anagnostopoulos"], "needs mass"),
    "mass of another law": (["--impact-mass", "3"], "of the law lankarani-nikravesh"),
    "tool": (["--tool", "hammer"], "suction_cup"),
    "joint friction": (["--joint-friction", "joint_a=1"], "'joint_a=1'"),
    "duration": (["--duration", "0"], "got 0 s"),
    "records": (["--record-every", "0"], "got 0"),
}


def refused(capsys, command, *arguments):
    """The line with which a command refuses."""
    try:
        status = main([command, *map(str, arguments)])
    except SystemExit as ended:  # of the parser, which reads units
        status = ended.code
    assert status == 2
    said = capsys.readouterr()
    assert said.out == ""
    kind = f" {arguments[0]}" if command in KINDS else ""
    assert said.err.startswith(f"jointplay {command}{kind}: error: ")
    assert said.err.count("\n") == 1
    return said.err


@pytest.mark.parametrize(("arguments", "named"), BAD_INPUT.values(), ids=BAD_INPUT.keys())
def test_bad_input_is_refused_in_one_line(arguments, named, tmp_path, capsys):
    assert named in refused(capsys, "run", *arguments, "--out", tmp_path / "out", "--quiet")
    assert not (tmp_path / "out").exists()


def test_unwritable_output_is_refused(tmp_path):
    occupied = tmp_path / "file"
    occupied.write_text("mine")
    for target in (occupied, occupied / "below"):
        done = jointplay("run", "--out", target, *SHORT)
        assert done.returncode == 2
        assert str(target) in done.stderr
        assert "Traceback" not in done.stderr
    assert occupied.read_text() == "mine"


def test_run_passes_its_options_on(tmp_path):
    done = jointplay(
        *("run", "--out", tmp_path, *SHORT, "--clearance", "3e-4", "--axial-clearance", "1e-4"),
        *("--joint", "joint_a", "--restitution", "0.7", "--friction", "0.3", "--step", "5e-6"),
        *("--gravity", "0,0,-1.62", "--law", "hunt-crossley"),
        *(f"--set=joints.joint_a.normal.{key}" for key in ("n=1.5", "p=1", "q=1")),
        *("--joint-friction", "joint_c=0.1,0.2", "--integrator", "rk4", "--seed", "7"),
    )
    assert done.returncode == 0, done.stderr
    simulation = Result.load(tmp_path / "result.nc").simulation
    joint = simulation.mechanism.clearance["joint_a"]
    assert (joint.cr, joint.ca, joint.restitution) == (3e-4, 1e-4, 0.7)
    assert joint.friction.mu_d == 0.3
    assert (joint.normal.n, joint.normal.p, joint.normal.q) == (1.5, 1.0, 1.0)
    assert simulation.mechanism.gravity == (0.0, 0.0, -1.62)
    assert simulation.joint_friction["joint_c"].viscous == 0.2
    assert (simulation.step, simulation.integrator, simulation.seed) == (5e-6, "rk4", 7)


def test_any_robot_by_name_moves_and_says_what_came_out(tmp_path):
    done = jointplay(
        *("run", "ur5", "--joint", "elbow_joint", "--joint", "wrist_1_joint", "--out", tmp_path),
        *("--clearance", "0.1 mm", "--set", "joints.wrist_1_joint.axial_clearance=0.3 mm"),
        *("--set", "integration.duration=10 ms", "--no-figures"),
    )
    assert done.returncode == 0, done.stderr
    assert "no motion given" in done.stderr
    play = "Play of 0.1 mm in elbow_joint and of 0.1 mm and 0.3 mm in wrist_1_joint"
    for words in (play, "peak force in elbow_joint", "rattle: ", "next: "):
        assert words in done.stdout
    result = Result.load(tmp_path / "result.nc")
    joints = result.simulation.mechanism.clearance
    assert [joint.cr for joint in joints.values()] == [1e-4, 1e-4]
    # Unless it is given, the axial clearance is the radial one; assumed values are reported.
    assert [joint.ca for joint in joints.values()] == [1e-4, 3e-4]
    assert (
        "elbow_joint: bearing radius 10 mm (assumed), radial clearance 0.1 mm, bearing length "
        "40 mm (assumed), axial clearance 0.1 mm (assumed), restitution 0.9 (assumed), friction "
        "ambrosio mu_d 0.1 (assumed)"
    ) in done.stderr
    assert "axial clearance 0.3 mm, restitution" in done.stderr
    assert "tool: tool0 (chosen: named like a tool, at the end of the chain" in done.stderr
    assert result.time[-1] == pytest.approx(0.01)
    assert "joints.wrist_1_joint.axial_clearance" in result.dataset.attrs["settings"]


ONE_JOINT = ["run", "ur5", "--joint", "elbow_joint", "--duration", "2 ms", "--no-error-estimate"]


@pytest.mark.parametrize(
    ("options", "drawn"),
    [
        ([], {"overview.png"}),
        pytest.param(
            ["--joint", "wrist_1_joint=6004 C3"], {"overview.png", "bearing_loads.png"},
            marks=pytest.mark.thorough,
        ),
    ],
)  # fmt: skip
def test_a_single_case_has_an_overview(options, drawn, tmp_path):
    assert main([*ONE_JOINT, *options, "--quiet", "--out", str(tmp_path / "a")]) == 0
    assert {path.name for path in (tmp_path / "a").glob("*.png")} == drawn


@pytest.mark.thorough
def test_a_single_case_has_all_figures_when_asked(tmp_path):
    assert main([*ONE_JOINT, "--quiet", "--figures", "--out", str(tmp_path / "a")]) == 0
    names = {path.name for path in (tmp_path / "a").glob("*.png")}
    assert len(names) == 7
    assert {"overview.png", "force_x.png", "force_z.png"} <= names  # along y no force acts


def test_figures_cannot_be_asked_for_and_not(tmp_path, capsys):
    both = (*ONE_JOINT, "--figures", "--no-figures", "--out", tmp_path / "both")
    assert "--no-figures: not allowed with argument --figures" in refused(capsys, *both)


@pytest.mark.parametrize("spread", ["-1", "much", "nan", "-5 %"])
def test_the_width_of_ranges_is_a_share(spread, capsys):
    line = ["simulator", "ur5", "--joint", "elbow_joint", "--out", "o", "--spread", spread]
    assert "--spread" in refused(capsys, "export", *line)


@pytest.mark.thorough
def test_a_robot_whose_play_is_in_gears_alone_has_an_overview_an_ideal_one_all_figures(tmp_path):
    short = ["--duration", "2 ms", "--no-error-estimate", "--quiet", "--out"]
    for name, options in (("gears", ["so101", "--preset"]), ("ideal", ["ur5", "--ideal"])):
        assert main(["run", *options, *short, str(tmp_path / name)]) == 0
    assert {path.name for path in (tmp_path / "gears").glob("*.png")} == {"overview.png"}
    names = {path.name for path in (tmp_path / "ideal").glob("*.png")}
    assert "overview.png" not in names
    assert {"tool_displacement.png", "tool_velocity.png"} <= names


def test_settings_count_more_than_a_scenario_and_its_cases(tmp_path):
    done = jointplay(
        *("run", "jointplay:scara.toml", "--case", "0.5 mm", "--out", tmp_path, *SHORT),
        *("--set", 'joints.joint_b.radial_clearance="0.3 mm"', "--restitution", "0.7"),
    )
    assert done.returncode == 0, done.stderr
    (path,) = tmp_path.glob("*.nc")
    joint = Result.load(path).simulation.mechanism.clearance["joint_b"]
    assert (joint.cr, joint.ca, joint.restitution) == (3e-4, 5e-4, 0.7)


def test_ideal_robot_has_no_contact(tmp_path):
    assert jointplay("run", "--ideal", "--out", tmp_path, *SHORT).returncode == 0
    assert Result.load(tmp_path / "result.nc").joints == []


def test_run_away_keeps_what_was_computed(tmp_path):
    done = jointplay("run", "--bandwidth", "1e6", "--out", tmp_path, *SHORT)
    assert done.returncode == 1
    assert "stopped at t = " in done.stdout
    assert re.search(r"joint_b\.\w+ = .*the fastest of \d+ coordinates", done.stdout)
    result = Result.load(tmp_path / "result.nc")
    assert result.status != Status.COMPLETED
    assert len(result.time) > 0


STUDY = """
import sys
from dataclasses import replace
from jointplay import cli
from jointplay.paper import cases
scara = cases.scara
cases.scara = lambda *a, **b: replace(scara(*a, **b), duration=float(sys.argv[1]))
sys.exit(cli.main(sys.argv[2:]))
"""


@pytest.mark.parametrize(
    "duration",
    [pytest.param(0.3, marks=pytest.mark.thorough), pytest.param(3.0, marks=pytest.mark.nightly)],
)
def test_scara_study_end_to_end(duration, tmp_path):
    out = tmp_path / "study"
    command = [PYTHON, "-c", STUDY, str(duration), "scara", "--out", str(out), "--runs", "2"]
    command.append("--pdf")
    done = subprocess.run(command, capture_output=True, text=True, timeout=900.0, check=False)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in out.iterdir()} == set(output_names(pdf=True))
    table = (out / "claims.md").read_text()
    for condition in map(str, CONDITIONS):
        assert table.count(f"| {condition} |") == 6
    assert "Incomplete" not in table
    runs = (out / "ensemble.csv").read_text().splitlines()
    assert len(runs) == 1 + len(CONDITIONS) * 2 * 2
    small, large = (Result.load(out / f"case{n}.nc") for n in ("1_0.2mm", "2_0.5mm"))
    # The paper's figures as measured on a sketch of this model: a few microns, a few kN.
    for result in (small, large):
        assert result.audit.relative_energy_residual < 0.01
        assert 5e-6 < result.audit.largest_penetration < 30e-6
    assert small["normal_force_peak"].max() < large["normal_force_peak"].max()
    # The journal stays within its bearing.
    for result, clearance in ((small, 0.2e-3), (large, 0.5e-3)):
        centre = result["journal_centre"].values[:, 0]
        assert np.hypot(centre[:, 0], centre[:, 1]).max() < clearance * 1.1
        assert np.abs(centre[:, 2]).max() < clearance * 1.1


@pytest.mark.parametrize("count", ["99999999999999999999", "0", "-1"])
def test_poses_without_end_are_refused(count, capsys):
    error = refused(
        capsys, "budget", "jointplay:scara.urdf", "--clearance", "1e-4", "--workspace", count
    )
    assert f"poses must be a whole number from 1 to 1000000, got {count}" in error


CYCLE = """
[robot]
urdf = "jointplay:scara.urdf"
[joints.joint_b]
radial_clearance = 1e-4
axial_clearance = 1e-4
[motion]
file = "jointplay:scara_motion.csv"
[integration]
duration = 2e-3
"""
NONSENSE = [
    (
        ["study", "iso9283", "--cycles", "3", "--jobs", "-1"],
        "jobs must be a whole number >= 1, got -1",
    ),
    (["study", "iso9283", "--cycles", "9" * 20], "at most 1000000 cycles"),
    (["study", "iso9283", "--cycles", "3", "--speed", "9" * 20], "is shorter than the step"),
    (
        ["study", "wear", "--joint", "joint_b", "--growth", "1e-6", "--jobs", "0"],
        "jobs must be a whole number >= 1, got 0",
    ),
    (
        ["study", "wear", "--joint", "joint_b", "--growth", "1e-6", "--runs", "9" * 20],
        "from 1 to 1000000",
    ),
    (
        ["study", "wear", "--joint", "joint_b", "--growth", "1e-6", "--blocks", "9" * 20],
        "from 1 to 1000000",
    ),
]


@pytest.mark.parametrize(("words", "said"), NONSENSE)
def test_numbers_that_make_no_sense_are_refused_before_anything_is_said(
    words, said, tmp_path, capsys
):
    (tmp_path / "s.toml").write_text(CYCLE)
    assert said in refused(capsys, *words[:2], tmp_path / "s.toml", *words[2:])


GEARED = ["jointplay:scara.urdf", "--clearance", "1e-4", "--joint", "joint_b"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["budget", *GEARED, "--friction", "abc"], "--friction"),
        (
            ["export", "simulator", *GEARED, "--rotor-inertia", "-1"],
            "no joint has one; add it with --gear",
        ),
        (["export", "simulator", *GEARED, "--spread", "inf"], "--spread: inf is not finite"),
        (["export", "simulator", *GEARED, "--period", "inf"], "--period"),
    ],
)
def test_a_refusal_leaves_no_folder(words, said, tmp_path, capsys):
    assert said in refused(capsys, *words, "--out", tmp_path / "a" / "b")
    assert not list(tmp_path.iterdir())


def test_options_without_a_value_are_refused(tmp_path, capsys):
    for command in (["budget", *GEARED, "--out", ""], ["play", "r.nc", "--html="]):
        with pytest.raises(SystemExit) as ended:
            main(command)
        assert ended.value.code == 2
        assert "the value is empty" in capsys.readouterr().err
    assert "the port must be a whole number" in refused(capsys, "play", "r.nc", "--port", "-1")


def test_a_robot_that_cannot_move_is_refused(urdf, tmp_path, capsys):
    fixed = '<joint name="f" type="fixed"><parent link="base"/><child link="one"/></joint>'
    robot = urdf(body("one"), fixed)
    error = refused(capsys, "run", robot, "--ideal", "--out", tmp_path / "o", "--duration", "0.01")
    assert "2 links, fixed to each other, and no joint that moves" in error


@pytest.mark.thorough
def test_a_robot_of_a_package_is_drawn_here_under_its_own_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["check", "ur5", "--joint", "elbow_joint"]) == 0
    assert main(["check", "jointplay:four_bar.toml"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"ur5.png", "four_bar.png"}


def test_a_picture_of_no_kind_is_refused_before_anything_is_read(tmp_path, capsys):
    out = tmp_path / "x.foo"
    for command in (["study", "uncertainty", "none", "m"], ["plot", "none", "x=a", "y=b"]):
        assert "must end in .png, .pdf, .svg" in refused(capsys, *command, "--out", out)
    scenario = ("check", "jointplay:scara.toml", "--picture", out)
    assert "must end in .png, .pdf, .svg" in refused(capsys, *scenario)


@pytest.mark.parametrize(
    ("picture", "said"),
    [
        ('<box size="1"/>', "box size must be three finite numbers, got '1'"),
        ('<box size="1 nan 1"/>', "box size must be three finite numbers, got '1 nan 1'"),
        ("<box/>", "box size is missing in the URDF"),
        ('<sphere radius="-1"/>', "sphere radius must not be negative, got '-1'"),
        ('<cylinder radius="1" length="q"/>', "cylinder length must be a finite number, got 'q'"),
        ('<mesh filename="a" scale="1 2"/>', "mesh scale must be three finite numbers, got '1 2'"),
    ],
)
@pytest.mark.parametrize("tag", ["visual", "collision"])
def test_shapes_that_are_none_are_refused(picture, said, tag, urdf, tmp_path, capsys):
    shape = f"<{tag}><geometry>{picture}</geometry></{tag}></link>"
    robot = urdf(body("one").replace("</link>", shape), joint("a", "base", "one"))
    error = refused(capsys, "run", robot, "--joint", "a", "--out", tmp_path / "o")
    assert f"link 'one': {said}" in error


@pytest.mark.parametrize("colour", ["1 2", "", "nan 0 0 1", "1 2 3 4 5", "a b c d"])
def test_colours_that_are_none_are_refused(colour, urdf, tmp_path, capsys):
    material = f'<material name="m"><color rgba="{colour}"/></material>'
    shape = f'<visual><geometry><box size="1 1 1"/></geometry>{material}</visual></link>'
    own = urdf(body("one").replace("</link>", shape), joint("a", "base", "one"))
    error = refused(capsys, "run", own, "--joint", "a", "--out", tmp_path / "o")
    assert f"link 'one': color rgba must be four finite numbers, got {colour!r}" in error
    shared = urdf(body("one"), joint("a", "base", "one"), material)
    error = refused(capsys, "run", shared, "--joint", "a", "--out", tmp_path / "o")
    assert f"material 'm': color rgba must be four finite numbers, got {colour!r}" in error


@pytest.mark.parametrize("quoted", ['0.1,"0.2', '"0.1,0.2', '0.1,"0.2"x'])
def test_quotes_that_are_not_closed_are_refused_with_their_line(quoted, tmp_path, capsys):
    path = tmp_path / "m.csv"
    path.write_text(f"# a comment\ntime [s],tool x [m]\n0.0,0.1\n{quoted}\n0.2,0.3\n")
    robot, play = "jointplay:scara.urdf", ("--clearance", "1e-4")
    assert f"{path}, line 4: " in refused(capsys, "identify", robot, path, *play)
    path.write_text(f"# a comment\ntime_s,joint_a\n0.0,0.1\n{quoted}\n0.2,0.3\n")
    assert f"{path}, line 4: " in refused(capsys, "budget", robot, *play, "--motion", path)


def test_the_motor_of_a_gear_that_weighs_nothing_is_named(urdf):
    robot = urdf(body("one", com="0.1 0 0"), joint("a", "base", "one"))
    gear = Gear(play=1e-3, rotor_inertia=1e-30, stiffness=1e4)
    with pytest.raises(JointplayError, match="the gear of 'a' must have a larger rotor_inertia"):
        simulate(Mechanism(robot, {}, gears={"a": gear}), duration=1e-3, drive=Free())


def test_no_name_steers_the_terminal():
    for evil in ("\x1b[31mred", "\x9b31m", "a\rb", "a\x08b", "\u202egnp.exe"):
        done = subprocess.run(
            [JOINTPLAY, "check", f"{evil}.toml"], capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert done.stderr.rstrip("\n").isprintable(), done.stderr
    code = "from jointplay.cli import main, streams\nwith streams.forgiving(): print('\\x1b[2Jx')"
    done = subprocess.run([PYTHON, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout == "\\x1b[2Jx\n"


def test_errors_are_one_line_whatever_they_hold():
    table = np.arange(3000.0).reshape(50, 60)
    with np.printoptions(threshold=10**6):
        error = JointplayError(f"it must be small, got {table}; give less")
    assert "\n" not in str(error)
    assert len(str(error)) < 300
    assert str(error).endswith("+03]]; give less")
    name = "n" * 100_000
    error = MissingName("joint", name, ["one", "two"])
    assert len(str(error)) < 500
    assert str(error).endswith("available: one, two")
    assert str(JointplayError("a\x1b[0mb\tc\n d")) == "a\\x1b[0mb c d"
    again = pickle.loads(pickle.dumps(JointplayError(f"{table}", ("here",))))
    assert str(again) == str(JointplayError(str(again)))
    assert again.where == ("here",)


@pytest.mark.parametrize("quiet", [[], ["--quiet"]])
def test_nothing_stands_before_an_error(quiet, tmp_path):
    """Neither notes on the cycle nor warnings of Python and numpy."""
    code = """
import sys, warnings
import numpy as np
from jointplay import cli
from jointplay.study import iso9283
def check(*_):
    warnings.warn("mine", RuntimeWarning)
    np.array([1.0]) / np.array([0.0])
    raise cli.JointplayError("wrong")
iso9283.check = check
sys.exit(cli.main(sys.argv[1:]))
"""
    given = [
        "study",
        "iso9283",
        "jointplay:scara.toml",
        "--case",
        "ideal",
        "--duration",
        "0.01",
        *quiet,
    ]
    command = [PYTHON, "-c", code, *given]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "jointplay study iso9283: error: wrong\n"


def test_notes_are_said_once_all_goes_well(capsys):
    for quiet, said in ((False, "one\nnote: two\n"), (True, "")):
        with streams.noting(quiet):
            streams.note("one")
            for _ in range(2):
                warnings.warn("two", RuntimeWarning, stacklevel=1)
            assert capsys.readouterr().err == ""
            streams.release()
            assert capsys.readouterr().err == said
        assert capsys.readouterr().err == ""
    with pytest.raises(ZeroDivisionError), streams.noting(False):
        streams.note(1 / 0 if streams.note("three") is None else "four")
    assert capsys.readouterr().err == ""


def test_told_to_stop_while_a_finished_run_is_saved_it_is_saved_and_done(tmp_path):
    code = """
import os, signal, sys
from jointplay import Result, cli
save = Result.save
def told(self, *given):
    os.kill(os.getpid(), signal.SIGTERM)
    return save(self, *given)
Result.save = told
sys.exit(cli.main(sys.argv[1:]))
"""
    bare = [*SHORT, "--no-error-estimate"]
    command = [PYTHON, "-c", code, "run", *bare, "--out", str(tmp_path / "o")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "stop requested after the computation had ended: the result is saved" in done.stderr
    assert "interrupted" not in done.stderr + done.stdout
    assert Result.load(tmp_path / "o" / "result.nc").status == Status.COMPLETED
    # Of two cases the second has not begun: that is an interruption.
    two = ["jointplay:scara.toml", "--case", "ideal", "--case", "0.2 mm", "--jobs", "1"]
    command = [PYTHON, "-c", code, "run", *two, *SHORT, "--out", str(tmp_path / "p")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "interrupted; no result of: 0.2 mm" in done.stderr


def test_told_to_stop_it_names_what_is_left_out(tmp_path, monkeypatch, capsys):
    with monkeypatch.context() as patched:
        save = Result.save

        def told(self, *given):
            signal.raise_signal(signal.SIGTERM)
            return save(self, *given)

        patched.setattr(Result, "save", told)
        assert main(["run", *SHORT, "--ensemble", "2", "--out", str(tmp_path / "o")]) == 130
    left = "there is result.nc; without numerical errors: result; the ensemble was not run"
    assert f"interrupted; {left}; the same command with" in capsys.readouterr().err

    def told_later(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(files, "written", [])
    monkeypatch.setattr("jointplay.show.plots.reviews.review", told_later)
    command = ["run", *SHORT, "--no-error-estimate", "--ensemble", "2", "--converge"]
    assert main([*command, "--out", str(tmp_path / "p")]) == 130
    left = "the convergence study was not run; the ensemble was not run"
    assert f"interrupted; {left}; {tmp_path / 'p'} contains result.nc" in capsys.readouterr().err


@pytest.mark.parametrize("kind", [ValueError, RuntimeError])
def test_an_interrupt_that_a_library_reports_as_another_error_is_one(monkeypatch, capsys, kind):
    """Converters of matplotlib, written in C, turn the KeyboardInterrupt into a ValueError, and
    Python 3.11 into a RuntimeError while a class is made.
    """

    def stopped(options):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(1.0)
        except KeyboardInterrupt:
            raise kind("Invalid affine transformation matrix") from None

    monkeypatch.setattr("jointplay.cli.commands.robots.run", stopped)
    assert main(["robots"]) == 130
    err = capsys.readouterr().err
    assert "interrupted" in err
    assert "Traceback" not in err


@pytest.mark.parametrize("count", [0, 1])
def test_an_interrupted_study_says_which_runs_are_kept_or_leaves_nothing(
    count, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(files, "written", [])
    out = tmp_path / "deep" / "out"

    def stopped(options):
        with closing(Runs(files.claim(out, []) / "trials.runs", {})) as runs:
            for key in range(count):
                runs.keep(key, {"swing": np.zeros(2)})
            raise KeyboardInterrupt

    monkeypatch.setattr("jointplay.cli.commands.robots.run", stopped)
    assert main(["robots"]) == 130
    err = capsys.readouterr().err
    assert (f"{out} contains trials.runs" in err) == bool(count)
    assert ("nothing was written" in err) == (not count)
    assert (tmp_path / "deep").exists() == bool(count)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (
            "run ur5 --clearanse 1 --out o",
            'run: error: .*--clearanse 1; did you mean "--clearance"',
        ),
        ("run ur5 --dur 1 --out o", '--dur 1; did you mean "--duration"'),
        ("run ur5 --all --out o", r"unrecognized arguments: --all \(see jointplay run --help"),
        (
            "export urdf ar4 --gear j=1 --out o",
            r"export urdf: error: .*--gear j=1 \(see jointplay exp",
        ),
    ],
)
def test_an_unknown_option_is_answered_by_its_command_and_never_taken_for_another(
    capsys, typed, said
):
    with pytest.raises(SystemExit, match="2"):
        main(typed.split())
    assert re.search(said, capsys.readouterr().err)


def test_a_mistyped_command_is_answered_with_the_nearest(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["runn"])
    assert 'no command "runn"; did you mean "run"?' in capsys.readouterr().err
