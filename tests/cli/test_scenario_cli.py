"""Commands on scenario files, through the real entry point."""

import re

import pytest
import trimesh
from warm import call

from jointplay import Result
from jointplay.cli import main
from jointplay.model.robots import shipped
from jointplay.show.plots.names import load_one, robot_of, title_of


@pytest.fixture
def short(tmp_path):
    """A scenario with three cases of 20 ms."""
    assert call("init", "study", cwd=tmp_path).returncode == 0
    path = tmp_path / "study.toml"
    text = path.read_text(encoding="utf-8").replace("# duration = ", 'duration = "20 ms" # ')
    path.write_text(text, encoding="utf-8")
    return path


def test_init_writes_what_check_and_run_take_and_never_overwrites(tmp_path):
    done = call("init", cwd=tmp_path)
    assert done.returncode == 0
    path = tmp_path / "scenario.toml"
    assert path.read_text(encoding="utf-8").startswith("#:schema")
    path.write_text("mine")
    refused = call("init", "scenario", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr == (
        "jointplay init: error: 'scenario.toml' already exists; choose another name\n"
    )
    assert path.read_text() == "mine"
    assert call("init", "no/where.toml", cwd=tmp_path).returncode == 2


def test_a_linkage_to_start_from_runs_as_it_stands(tmp_path):
    assert call("init", "crank", "--linkage", "slider-crank", cwd=tmp_path).returncode == 0
    text = (tmp_path / "crank.toml").read_text(encoding="utf-8")
    keys = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(keys) <= 16
    done = call("run", "crank.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "crank: Play of 0.1 mm in B puts the tool 'slider' up to 0.110 mm off" in done.stdout
    assert "warning" not in done.stdout
    result = load_one(tmp_path / "out")
    assert robot_of(result) == title_of({"crank": result}) == "Slider-crank"
    said = call("check", "crank.toml", "--no-picture", cwd=tmp_path).stdout
    for assumed in ("motors keep the given speeds", "B: play in the plane", "steps: by"):
        assert assumed in said
    wrong = call("init", "--linkage", "slider", cwd=tmp_path)
    assert wrong.returncode == 2
    assert "four-bar" in wrong.stderr


def test_what_the_template_shows_as_defaults_are_the_defaults(short):
    """Each line that is commented out is valid as it stands."""
    text = short.read_text(encoding="utf-8")
    for line in re.findall(r"^# (\w+ = (?:false|\"(?:revolute)\").*)$", text, re.M):
        text = text.replace(f"# {line}", line)
    assert "\nlock_tilt = false" in text
    assert '\nkind = "revolute"' in text
    text = re.sub(
        r"^# (\[gears|play|rotor|stiffness|\[joint_fr|coulomb|viscous|\[\[|mass|pick|release)",
        r"\1",
        text,
        flags=re.M,
    )
    short.write_text(text, encoding="utf-8")
    done = call("check", short, "--no-picture")
    assert done.returncode == 0, done.stderr
    assert "gear joint_a" in done.stdout
    assert "friction joint_a" in done.stdout
    assert "payload 1" in done.stdout


def test_check_says_what_it_understood(short):
    done = call("check", short, "--no-picture")
    assert done.returncode == 0, done.stderr
    for words in (
        "SCARA, clearance in joint B",
        "gravity          none",
        "computed-torque (bandwidth 100 rad/s",
        "20 ms in 2000 steps of 10 µs",
        "case ideal\n  joints           all ideal",
        "radial clearance 0.5 mm",
        "young 207 GPa",
    ):
        assert words in done.stdout
    assert not list(short.parent.glob("*.nc"))


def test_check_says_nothing_of_a_mechanism_that_it_cannot_draw(tmp_path):
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "far.stl")
    far = '<visual><geometry><mesh filename="far.stl" scale="1e20 1 1"/></geometry></visual>'
    robot = shipped("scara.urdf").read_text().replace("<visual>", f"{far}<visual>", 1)
    (tmp_path / "r.urdf").write_text(robot)
    (tmp_path / "s.toml").write_text('robot.urdf = "r.urdf"\nintegration.duration = 1e-4\n')
    done = call("check", "s.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "cannot be drawn" in done.stderr
    assert done.stdout == ""


def test_check_draws_the_mechanism_but_over_no_one_elses_picture(short):
    done = call("check", short)
    assert done.returncode == 0, done.stderr
    picture = short.with_suffix(".png")
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert "(replaced)" in call("check", short).stdout
    picture.write_bytes(b"mine")
    refused = call("check", short)
    assert refused.returncode == 2
    assert "already exists; choose another name (--picture" in refused.stderr
    assert picture.read_bytes() == b"mine"


def test_run_saves_every_case(short, tmp_path):
    out = tmp_path / "out"
    done = call("run", short, "--out", out, "--jobs", 2, "--quiet", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert {path.name for path in out.iterdir()} == {"ideal.nc", "0.2_mm.nc", "0.5_mm.nc"}
    result = Result.load(out / "0.5_mm.nc")
    assert result.simulation.mechanism.clearance["joint_b"].cr == 0.5e-3
    assert result.dataset.attrs["case"] == "0.5 mm"
    assert result.dataset.attrs["scenario"] == short.read_text(encoding="utf-8")
    assert not done.stderr
    again = call("run", short, "--out", out, "--quiet", "--no-figures")
    assert again.returncode == 2
    assert "already holds results" in again.stderr


@pytest.mark.thorough
def test_run_draws_figures_of_chosen_cases(short, tmp_path):
    out = tmp_path / "out"
    done = call("run", short, "--out", out, "--case", "0.2 mm", "--case", "ideal", "--pdf")
    assert done.returncode == 0, done.stderr
    names = {path.name for path in out.iterdir()}
    assert {"ideal.nc", "0.2_mm.nc", "fig12.png", "fig12.pdf"} <= names
    assert "0.5_mm.nc" not in names


def test_a_mistake_is_found_before_anything_runs(short):
    text = short.read_text(encoding="utf-8").replace('"0.5 mm", axial', '"0.5 mmm", axial')
    short.write_text(text, encoding="utf-8")
    out = short.parent / "o"
    for command in (["check", short], ["run", short, "--out", out]):
        done = call(*command)
        assert done.returncode == 2
        assert re.fullmatch(
            r'jointplay \w+: error: .*study.toml, line \d+, cases."0.5 mm".joints.joint_b.'
            r'radial_clearance: unknown unit "mmm" in "0.5 mmm"; expected a length.*\n',
            done.stderr,
        )
    assert not out.exists()


GEARED = """
[robot]
urdf = "scara.urdf"

[gears.joint_a]
kind = "strain-wave"
catalogue = "CSF-17-50"
rotor_inertia = "0.1 kg*m^2"
rated_torque = "16 N*m"
hysteresis = "0.5 arcmin"
stated_lost_motion = "1 arcmin"
error_amplitude = "25 arcsec"
efficiency = 0.75
damping = 5

[gears.joint_b]
kind = "train"
rotor_inertia = "0.03 kg*m^2"
stiffness = "2000 N*m/rad"
damping = 2

[[gears.joint_b.stages]]
ratio = 4
backlash = "0.5 deg"
efficiency = 0.95

[[gears.joint_b.stages]]
ratio = 5
backlash = "0.1 deg"

[motion]
times = [0, "50 ms"]
joints.joint_a = [0, "2 deg"]
joints.joint_b = [0, "2 deg"]

[drive]
kind = "computed-torque"
encoder = "motor"

[drives.joint_b]
kind = "servo"
catalogue = "STS3215"
voltage = "7.4 V"
p_gain = "60 V/rad"
dead_band = "0.1 deg"
period = "1 ms"
"""


@pytest.mark.thorough
def test_gears_of_every_kind_run_from_a_scenario(tmp_path):
    path = tmp_path / "geared.toml"
    (tmp_path / "scara.urdf").write_text(shipped("scara.urdf").read_text())
    path.write_text(GEARED)
    done = call("check", path)
    assert done.returncode == 0, done.stderr
    assert "from memory, to be checked: ratio, torque_1, torque_2" in done.stdout
    assert "stages ([ratio 4" in done.stdout
    assert "servo (catalogue STS3215, voltage 7.4 V" in done.stdout
    done = call("run", path, "--no-error-estimate", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "out").rglob("*.nc")
    result = Result.load(file)
    assert list(result["gear_torque"]["gear"].values) == ["joint_a", "joint_b"]
    assert result.audit.energy_residual < 1e-4 * result.audit.energy_exchanged
    for right, wrong in (("CSF-17-50", "CSF-17-5"), ("train", "trian")):
        path.write_text(GEARED.replace(f'"{right}"', f'"{wrong}"'))
        assert f'did you mean "{right}"' in call("check", path).stderr


SAMPLED = """
[robot]
urdf = "jointplay:slider_crank.urdf"
tool = "slider"
gravity = "balanced"
[loops.piston_pin]
bearing = { link = "rod", xyz = ["120 mm", 0, 0] }
journal = { link = "slider" }
[joints.piston_pin]
kind = "planar"
bearing_radius = "10 mm"
radial_clearance = "0.2 mm"
[drive]
kind = "prescribed"
[start]
guide = "170 mm"
[integration]
tolerance = 1e-3
duration = "0.03 s"
[cases.speeds]
motion.speeds.crank_pin = "62.83185 rad/s"
[cases.samples]
motion.file = "crank.csv"
[cases.noisy]
motion.file = "noisy.csv"
[cases.longer]
motion.file = "crank.csv"
integration.duration = "0.0301 s"
"""


def test_a_sampled_crank_presses_its_pin_as_one_that_turns(tmp_path):
    """Stops at the samples would press it with 51 kN, and a stop at the last one with 9 kN."""
    rows = [f"{k / 1000},{62.83185 * k / 1000}" for k in range(31)]
    (tmp_path / "crank.csv").write_text("\n".join(["time_s,crank_pin", *rows]) + "\n")
    noisy = [f"{k / 1000 + 2e-4 * (k % 3 == 1)},{62.83185 * k / 1000}" for k in range(31)]
    (tmp_path / "noisy.csv").write_text("\n".join(["time_s,crank_pin", *noisy]) + "\n")
    (tmp_path / "sampled.toml").write_text(SAMPLED)
    out = tmp_path / "out"
    options = ["--no-figures", "--no-error-estimate", "--jobs", "1", "--out", str(out)]
    done = call("run", str(tmp_path / "sampled.toml"), *options)
    assert done.returncode == 0, done.stderr
    assert "case samples: motion: 31 samples, spline (--interpolation selects)" in done.stderr
    assert "case longer: the motion stands still beyond its points" in done.stderr
    assert "case noisy: speeds jump from sample to sample, and the spline" in done.stderr
    assert "note: case samples" not in done.stderr
    speeds, samples = (
        float(Result.load(out / f"{case}.nc").forces.max()) for case in ("speeds", "samples")
    )
    assert samples == pytest.approx(speeds, rel=0.01)


def test_check_looks_at_the_values_of_a_sweep(tmp_path, capsys):
    file, motion = tmp_path / "sweep.toml", shipped("scara_motion.csv")
    text = shipped("scara_sweep.toml").read_text().replace('"scara.urdf"', '"jointplay:scara.urdf"')
    text = text.replace('"scara_motion.csv"', f'"{motion}"')
    file.write_text(text.replace('"0.3 mm"', '"true mm"'))
    assert main(["check", str(file), "--no-picture"]) == 2
    assert "axis 'clearance' cannot take \"true mm\"" in capsys.readouterr().err
