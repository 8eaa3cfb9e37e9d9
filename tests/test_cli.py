"""The command line through its real entry point."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jointplay import Result
from jointplay.commands.flags import FLAGS
from jointplay.contact import NORMAL_LAWS
from jointplay.kernel import Status
from jointplay.kernel.integrators import INTEGRATORS
from jointplay.mechanism.urdf import shipped
from jointplay.study import CONDITIONS, output_names

JOINTPLAY = str(Path(sys.executable).parent / "jointplay")
SHORT = ("--duration", "0.02", "--quiet", "--no-figures")


def jointplay(*arguments: object, timeout: float = 900.0) -> subprocess.CompletedProcess[str]:
    command = [JOINTPLAY, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


@pytest.mark.parametrize("command", [[], ["--help"], ["scara", "--help"], ["run", "--help"]])
def test_help_reads_well(command):
    done = jointplay(*command)
    assert done.returncode == 0
    assert done.stdout.startswith("usage: jointplay")
    assert not done.stderr


def test_version():
    assert re.fullmatch(r"jointplay \d+\.\d+\.\d+\n", jointplay("--version").stdout)


def test_help_of_run_says_what_the_scenario_tables_say():
    text = " ".join(jointplay("run", "--help").stdout.split())
    assert ", ".join(INTEGRATORS) in text
    assert next(iter(NORMAL_LAWS)) in text
    assert "C_r, radial, not diametral [m]" in text
    for flag in FLAGS:
        assert flag.name in text
        assert flag.keys[0].replace("-", "") in text.replace("- ", "").replace("-", "")


BAD_INPUT = {
    "missing URDF": (["--urdf", "nowhere.urdf"], "nowhere.urdf"),
    "unknown joint": (
        ["--joint", "elbow"],
        "--joint elbow: no joint 'elbow'; available: joint_a, joint_b",
    ),
    "not revolute": (
        ["--joint", "stroke", "--set", "joints.stroke.kind=revolute"],
        "'stroke' is prismatic",
    ),
    "negative clearance": (["--radial", "-1e-4"], "-0.0001 m"),
    "zero clearance": (["--axial", "0"], "got 0 m"),
    "not a number": (["--radial", "wide"], '--radial: "wide" is no length'),
    "non-finite": (["--radial", "nan"], "nan"),
    "journal too large": (["--journal-radius", "0.02"], "0.02 m does not fit"),
    "restitution": (["--restitution", "1.5"], "(0, 1], got 1.5"),
    "friction": (["--friction", "-0.1"], "-0.1"),
    "step too large": (["--step", "1e-3"], "0.001 s is too large for the contact stiffness"),
    "gravity": (["--gravity", "down"], '--gravity: no gravity "down"'),
    "motion": (["--motion", "none.csv"], "none.csv"),
    "unphysical link": (["--urdf", shipped("scara_as_printed.urdf")], "'arm1'"),
    "no joint chosen": (["--urdf", shipped("scara.urdf")], "joint_a, joint_b, joint_c"),
    "two robots": (["ur5", "--urdf", "scara.urdf"], "--urdf scara.urdf beside ur5"),
    "no robot": (["nothing_like_it"], "nothing_like_it"),
    "not a setting": (["--set", "step"], '--set "step": give KEY=VALUE'),
    "not a key": (["--set", "a..b=1"], '"a..b" is no key'),
    "unknown key": (
        ["--set", "integration.stepp=1"],
        '--set integration.stepp: unknown key "stepp"; did you mean "step"?',
    ),
    "setting of a case": (["--set", "cases.x.title=1"], "--set cases.x.title"),
    "joint of no joint": (["--ideal", "--radial", "1e-4"], "--radial is for a joint"),
    "case of a robot": (["--case", "one"], "--case needs a scenario"),
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


@pytest.mark.parametrize(("arguments", "named"), BAD_INPUT.values(), ids=BAD_INPUT.keys())
def test_bad_input_is_refused_in_one_line(arguments, named, tmp_path):
    done = jointplay("run", *arguments, "--out", tmp_path / "out", "--quiet")
    assert done.returncode == 2
    assert done.stderr.startswith("jointplay run: error: ")
    assert done.stderr.count("\n") == 1
    assert named in done.stderr
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


@pytest.mark.parametrize("command", ["run", "scara"])
def test_existing_results_are_not_overwritten(command, tmp_path):
    name = "result.nc" if command == "run" else "claims.md"
    (tmp_path / name).write_text("precious")
    done = jointplay(command, "--out", tmp_path)
    assert done.returncode == 2
    assert "already holds results" in done.stderr
    assert (tmp_path / name).read_text() == "precious"


def test_run_passes_its_options_on(tmp_path):
    done = jointplay(
        *("run", "--out", tmp_path, *SHORT, "--radial", "3e-4", "--axial", "1e-4"),
        *("--joint", "joint_a", "--restitution", "0.7", "--friction", "0.3", "--step", "5e-6"),
        *("--gravity", "0,0,-1.62", "--law", "hunt-crossley", "--exponents", "1.5", "1", "1"),
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
        *("--radial", "0.1 mm", "--set", "joints.wrist_1_joint.axial_clearance=0.3 mm", *SHORT),
        *("--set", "integration.duration=10 ms"),
    )
    assert done.returncode == 0, done.stderr
    assert "no motion given" in done.stderr
    for words in ("tool error peak", "peak force in elbow_joint", "contacts ", "cost "):
        assert words in done.stdout
    result = Result.load(tmp_path / "result.nc")
    joints = result.simulation.mechanism.clearance
    assert [joint.cr for joint in joints.values()] == [1e-4, 1e-4]
    assert joints["wrist_1_joint"].ca == 3e-4
    assert result.time[-1] == pytest.approx(0.01)
    assert "joints.wrist_1_joint.axial_clearance" in result.dataset.attrs["settings"]


def test_settings_count_more_than_a_scenario_and_its_cases(tmp_path):
    done = jointplay(
        *("run", "jointplay:scara.toml", "--case", "0.5 mm", "--out", tmp_path, *SHORT),
        *("--set", 'joints.joint_b.radial_clearance="0.3 mm"', "--restitution", "0.7"),
    )
    assert done.returncode == 0, done.stderr
    (path,) = tmp_path.glob("*.nc")
    joint = Result.load(path).simulation.mechanism.clearance["joint_b"]
    assert (joint.cr, joint.ca, joint.restitution) == (3e-4, 5e-4, 0.7)


def test_run_draws_its_figures(tmp_path):
    assert jointplay("run", "--duration", "0.02", "--out", tmp_path).returncode == 0
    written = {path.name for path in tmp_path.iterdir()}
    expected = {f"fig{n:02d}.{kind}" for n in range(9, 16) for kind in ("png", "pdf")}
    assert expected | {"result.nc"} <= written


def test_ideal_robot_has_no_contact(tmp_path):
    assert jointplay("run", "--ideal", "--out", tmp_path, *SHORT).returncode == 0
    assert Result.load(tmp_path / "result.nc").joints == []


def test_run_away_keeps_what_was_computed(tmp_path):
    done = jointplay("run", "--bandwidth", "1e6", "--out", tmp_path, *SHORT)
    assert done.returncode == 1
    assert "stopped at t = " in done.stdout
    assert "joint_b.yaw = " in done.stdout
    result = Result.load(tmp_path / "result.nc")
    assert result.status != Status.COMPLETED
    assert len(result.time) > 0


def test_ctrl_c_keeps_what_was_computed(tmp_path):
    command = [JOINTPLAY, "run", "--duration", "300", "--no-figures", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    seen = ""
    while not re.search(r" \d+\.\d*[1-9]\d*/300.* left", seen):
        more = process.stderr.read(1)
        assert more, f"it ended: {seen}"
        seen += more
    assert "x real time" in seen
    assert "left" in seen
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=900)
    assert process.returncode == 130
    assert "interrupted at t = " in output
    result = Result.load(tmp_path / "result.nc")
    assert result.status == Status.INTERRUPTED
    assert 0.0 < result.time[-1] < 300.0
    assert np.isfinite(result["q"].values).all()


def test_scara_study_end_to_end(tmp_path):
    out = tmp_path / "study"
    done = jointplay("scara", "--out", out, "--runs", "2", timeout=900.0)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in out.iterdir()} == set(output_names())
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
    # Between motion and bearing, the journal stays where a journal can be.
    for result, clearance in ((small, 0.2e-3), (large, 0.5e-3)):
        centre = result["journal_centre"].values[:, 0]
        assert np.hypot(centre[:, 0], centre[:, 1]).max() < clearance * 1.1
        assert np.abs(centre[:, 2]).max() < clearance * 1.1
