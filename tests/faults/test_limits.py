"""What makes no sense, or would not end, is refused in one line that says so."""

import argparse
import dataclasses
import math
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warm
import xarray as xr
from conftest import body, joint

import jointplay as jp
from jointplay import JointplayError, cli
from jointplay.base import objects, schema
from jointplay.base.files import MOST_TEXT, csv_rows, names_for
from jointplay.base.units import convert
from jointplay.cli.options import listed
from jointplay.model import impact
from jointplay.model.loop import closing_rows, misfit
from jointplay.model.urdf import MOST_IN_SERIES, MOST_MOVING
from jointplay.model.vocabulary import as_option
from jointplay.paper import run_study, scara
from jointplay.show.player import movie
from jointplay.show.player.server import Server
from jointplay.simulation.analysis import uncertainty
from jointplay.study import axes, courses
from jointplay.study.nonlinear import lyapunov, observables, poincare

JOINTPLAY = str(Path(sys.executable).parent / "jointplay")

# URDFs

NOWHERE = {
    "joint 'pin'": [{"axis": one} for one in ("0 0 0", "0 0", "0 nan 1", "1 2 3 4", "x y z", "")],
    "joint 'pin': origin xyz": [{"at": "nan 0 0"}, {"at": "0 0"}],
    "link 'arm': origin xyz must be three finite numbers": [
        {"com": one} for one in ("nan 0 0", "0 0", "1e999 0 0", "a b c", "0 0 0 0")
    ],
    "": [{"name": one} for one in ("a&#10;b", "a" * 300, "", "a&#9;b")],
}


@pytest.mark.parametrize(
    ("words", "given"), [(w, one) for w, all_ in NOWHERE.items() for one in all_]
)
def test_what_points_nowhere_or_has_no_name_is_refused_in_a_line(words, given, urdf):
    arm = body("arm", **{key: given[key] for key in given if key == "com"})
    own = {"name": "pin"} | {key: given[key] for key in given if key != "com"}
    with pytest.raises(JointplayError, match=words) as caught:
        jp.Mechanism(urdf(arm, joint(own.pop("name"), "base", "arm", **own)))
    assert "\n" not in str(caught.value)


def test_a_name_given_twice_is_refused(urdf):
    with pytest.raises(JointplayError, match="two links of the URDF are called 'arm'"):
        jp.Mechanism(urdf(body("arm"), body("arm"), joint("pin", "base", "arm")))


def test_a_fixed_joint_may_have_any_axis(urdf):
    """Exporters write zeros there."""
    path = urdf(
        body("arm"), joint("pin", "base", "arm"),
        body("b"), joint("fix", "arm", "b", "fixed", "0 0 0"),
    )  # fmt: skip
    assert jp.Mechanism(path).joints == ("pin",)


def test_a_link_may_have_the_name_of_a_joint(urdf):
    path = urdf(body("pin"), joint("pin", "base", "pin"))
    play = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    for joints in ({}, {"pin": play}):
        robot = jp.Mechanism(path, joints)
        result = jp.simulate(robot, duration=1e-3, drive=jp.loads.Free(), joint_friction={})
        assert len(result.time) > 1


def test_a_chain_of_too_many_joints_is_refused_at_once(urdf):
    names = ["base", *(f"l{i}" for i in range(MOST_MOVING + 1))]
    links = [body(name) for name in names[1:]]
    pins = [joint(f"j{i}", names[i], names[i + 1]) for i in range(MOST_MOVING + 1)]
    with pytest.raises(JointplayError, match=f"at most {MOST_MOVING} are possible"):
        jp.Mechanism(urdf(*links, *pins))


def test_what_pinocchio_prints_does_not_reach_the_terminal(urdf, capfd):
    path = urdf(
        body("arm"), joint("pin", "base", "arm").replace("<limit", "<safety_controller/><limit")
    )
    with pytest.raises(JointplayError, match="Pinocchio cannot read") as caught:
        jp.Mechanism(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


# Numbers


@pytest.mark.parametrize(
    "value",
    ["1e5000000 m", "9" * 5000, 10**400, "1 /10**10**10 m", "2 10**10**10 m", "1 " + "(" * 50],
)
def test_sizes_beyond_all_numbers_are_refused_at_once(value):
    with pytest.raises(ValueError, match="expected a length"):
        convert(value, "m")


def test_a_number_without_a_unit_cannot_come_into_the_package():
    @dataclasses.dataclass
    class Novel:
        length: float

    with pytest.raises(TypeError, match=r"Novel.length is a number without a unit"):
        schema.check(Novel, {"length": 1.0})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = " + "[" * 20_000 + "]" * 20_000, "nested too deeply"),
        (".".join(["a"] * 20_000) + " = 1", "line 1: a key has at most 50 parts"),
        ("[" + ".".join(["a"] * 20_000) + "]", "line 1: a key has at most 50 parts"),
        ("a = " + "1" * 5000, "digits"),
        ("# " + "a" * 6_000_000, "at most 5 MB are read"),
    ],
)
def test_texts_that_would_keep_the_reader_busy_are_refused(text, words):
    with pytest.raises(JointplayError, match=words):
        jp.Scenario(text, "s.toml")


def test_a_long_list_over_many_lines_is_placed_quickly():
    times = "\n".join(f"  {i}.5," for i in range(20_000))
    text = f'[robot]\nurdf = "jointplay:scara.urdf"\n[motion]\ntimes = [\n{times}\n]\nwrong = 1\n'
    with pytest.raises(JointplayError, match="line 20006"):
        jp.Scenario(text, "s.toml")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": -1}, r"seed must be a whole number from 0 to 9\.22e\+18, got -1"),
        ({"step": 1e-60}, "at most 1e\\+12 are possible"),
        ({"record_every": 10**30}, "record_every must be a whole number from 1 to"),
        ({"duration": 1e6}, "GB of memory, of which there are"),
        ({"duration": 1e60}, "at most 1e\\+12 are possible"),
    ],
)
def test_runs_that_would_never_end_are_refused_before_anything_is_tabulated(changes, words):
    with pytest.raises(JointplayError, match=words):
        jp.Run(dataclasses.replace(scara(2e-4), **changes))


NO_NUMBERS = (True, np.True_, math.nan, math.inf, "one")


@pytest.mark.parametrize(
    "name",
    ["duration", "step", "macro_step", "tolerance", "record_every", "seed", "settle", "judge_from"],
)
def test_nothing_but_numbers_passes_for_a_number_of_a_simulation(name):
    for wrong in NO_NUMBERS:
        with pytest.raises(JointplayError, match=name.replace("_", "[_ ]")):
            jp.Run(dataclasses.replace(scara(2e-4), **{name: wrong}))
    for wrong in NO_NUMBERS[:-1]:
        with pytest.raises(JointplayError, match="joint_a"):
            jp.Run(dataclasses.replace(scara(2e-4), state={"joint_a": wrong}))


@pytest.mark.parametrize("wrong", NO_NUMBERS, ids=repr)
def test_nothing_but_numbers_passes_for_a_number_of_a_function(wrong):
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    motion = jp.Motion(["a"], [0.0, 1.0], [[0.0], [1.0]])
    error = xr.DataArray(np.zeros((3, 3)), {"time": [0.0, 1.0, 2.0]}, ("time", "axis"))
    law = bearing.normal
    numbers = law.parameters(bearing.contact_properties(0))
    calls = [
        lambda: jp.Motion(["a"], [0.0, wrong], [[0.0], [1.0]]),
        lambda: jp.Motion(["a"], [0.0, 1.0], [[0.0], [wrong]]),
        lambda: bearing.scaled(wrong),
        lambda: bearing.friction.scaled(wrong),
        lambda: jp.analysis.error_statistics(error, wrong),
        lambda: jp.analysis.error_at(error, wrong),
        lambda: jp.analysis.stops(motion, wrong),
        lambda: impact.impact_duration(law, numbers, 1.0, wrong),
        lambda: poincare.once_per_turn(np.zeros(9), wrong),
        lambda: poincare.once_per_turn(np.zeros(9), 3, wrong),
        lambda: poincare.repeats_after(np.zeros(9), wrong),
        lambda: poincare.recurrence(np.arange(9.0), wrong),
        lambda: poincare.determinism(np.eye(3), wrong),
        lambda: lyapunov.exponent(np.arange(9.0), wrong),
        lambda: lyapunov.exponent(np.arange(9.0), 1.0, wrong),
        lambda: lyapunov.growths(lambda x: x, np.zeros(1), wrong),
        lambda: uncertainty.interval_estimate(np.arange(9.0), confidence=wrong),
        lambda: axes.points("random", wrong, 2, 1),
        lambda: movie.Shot(begin=wrong),
        lambda: Server(b"", port=wrong),
        lambda: courses.traces([], jobs=wrong),
        lambda: jp.oil("ISO VG 32").viscosity(wrong),
    ]
    for number, call in enumerate(calls):
        with pytest.raises(JointplayError):
            pytest.fail(f"call {number} took {wrong!r} and gave {call()!r}")


def test_a_run_too_large_for_the_memory_says_how_it_would_fit(monkeypatch):
    monkeypatch.setattr("jointplay.simulation.prepare.memory", lambda: 4e9)
    long = dataclasses.replace(scara(2e-4), duration=1000.0)
    with pytest.raises(JointplayError, match=r"record_every = \d+ would fit"):
        jp.Run(long)


def test_drives_of_no_machine_are_refused():
    with pytest.raises(JointplayError, match="bandwidth must be at most"):
        jp.loads.ComputedTorque(bandwidth=1e60)


@pytest.mark.parametrize("size", [1e300, 1e-300])
def test_numbers_whose_products_no_float_holds_are_refused(size):
    with pytest.raises(JointplayError, match=r"stiffness must be .*1e[+-]100, got "):
        jp.Gear(1e-3, 0.1, stiffness=size)


def test_the_study_does_not_grow_without_end(tmp_path):
    with pytest.raises(JointplayError, match="at most 1000 runs"):
        run_study(tmp_path / "o", runs=3_000_000)
    assert not (tmp_path / "o").exists()


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_waypoints_beyond_all_numbers_are_refused_without_a_warning():
    with pytest.raises(JointplayError, match="accelerations overflow"):
        jp.Motion(["a"], [0.0, 1e-200, 1.0], [[0.0], [1e200], [0.0]])


def test_files_of_cases_have_names_that_any_disk_takes():
    evil = ["../../evil", "/etc/evil", "..", ".", "", "a\\b", "C:evil", "a\nb"]
    names = names_for(["a" * 300, "a" * 300 + "b", "\0", "é" * 200, *evil], ".nc")
    assert len(set(names)) == 4 + len(evil)
    assert not any(set("/\\:\n") & set(name) or name.startswith(".") for name in names)
    assert all(len(name.encode()) < 120 and "\0" not in name for name in names)


# Loops


def four_bar(play, **changes):
    shipped = jp.shipped("four_bar.toml")
    made = jp.Scenario.load(shipped)
    pin = {"kind": "planar", "radial_clearance": play, "bearing_radius": 5e-3}
    return dataclasses.replace(
        made.simulation("0.05 mm", {"joints": {"coupler_pin": pin}}), **changes
    )


def closed(run):
    gaps = misfit(run.mechanism, run.workspace.q)
    return max(float(np.abs(gap).max()) for gap in gaps.values())


def test_a_loop_with_play_in_a_further_joint_is_assembled():
    run = jp.Run(four_bar(5e-5, duration=1e-3, start="centred"))
    assert closed(run) < 1e-9
    v = run.workspace.v
    assert v[run.mechanism.coordinate("crank_pin")] == pytest.approx(20.0 * np.pi)
    assert np.abs(closing_rows(run.mechanism, run.workspace.q) @ v).max() < 1e-9


FREE = {"motion": None, "drive": {}, "duration": 1e-3, "start": "centred"}


def test_the_crank_alone_is_enough_to_start_a_loop_with_play_in_two_joints():
    run = jp.Run(four_bar(5e-5, **FREE, state={"crank_pin": (0.7, 5.0)}))
    assert closed(run) < 1e-9
    assert run.workspace.q[run.mechanism.coordinate("crank_pin")] == 0.7
    assert np.abs(closing_rows(run.mechanism, run.workspace.q) @ run.workspace.v).max() < 1e-9


def test_positions_given_to_four_digits_are_corrected_to_what_closes_the_loop():
    exact = jp.Run(four_bar(5e-5, **FREE, state={"crank_pin": 0.7}))
    mechanism = exact.mechanism
    given = {
        name: round(float(exact.workspace.q[mechanism.coordinate(name)]), 4)
        for name in ("crank_pin", "coupler_pin", "rocker_pin")
    }
    run = jp.Run(four_bar(5e-5, **FREE, state=given))
    for name, value in given.items():
        assert run.workspace.q[mechanism.coordinate(name)] == pytest.approx(value, abs=1e-4)
    assert closed(run) < 5e-5


def test_positions_that_do_not_go_together_are_blamed_not_the_lengths():
    start = {"crank_pin": 0.3, "coupler_pin": 2.0, "rocker_pin": 1.0}
    with pytest.raises(JointplayError, match="given for crank_pin, coupler_pin, rocker_pin contra"):
        jp.Run(four_bar(5e-5, **FREE, state=start))


def test_a_journal_may_fly_at_the_start():
    """Speeds of all three joints are given: the bearing holds its journal by contact only."""
    shipped = jp.Scenario.load(jp.shipped("four_bar.toml")).simulation("0.05 mm")
    speeds = {"crank_pin": 1.0, "coupler_pin": 0.0, "rocker_pin": 0.0}
    state = {name: (None, speed) for name, speed in speeds.items()}
    run = jp.Run(dataclasses.replace(shipped, **FREE, state=state))
    for name, speed in speeds.items():
        assert run.workspace.v[run.mechanism.coordinate(name)] == speed
    assert np.abs(closing_rows(run.mechanism, run.workspace.q) @ run.workspace.v).max() > 0.01


def test_a_loop_without_clearance_is_not_torn_apart():
    ideal = jp.Scenario.load(jp.shipped("four_bar.toml")).simulation("ideal")
    state = {"crank_pin": (None, 1.0), "coupler_pin": (None, 0.0), "rocker_pin": (None, 0.0)}
    with pytest.raises(JointplayError, match="given for crank_pin, coupler_pin, rocker_pin contra"):
        jp.Run(dataclasses.replace(ideal, **FREE, state=state))


# The surroundings

RUN = ["run", "--duration", "1e-3", "--no-figures", "--quiet", "--out"]


def shell(command, folder, **variables):
    return subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, cwd=folder, check=False,
        env={**os.environ, **variables},
    )  # fmt: skip


@pytest.mark.thorough
def test_a_terminal_that_knows_ascii_only_is_no_obstacle(tmp_path):
    done = shell(f"{JOINTPLAY} check jointplay:scara.toml --no-picture", tmp_path,
                 PYTHONIOENCODING="ascii", PYTHONUTF8="0")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.isascii()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_an_output_that_takes_nothing_is_an_error_of_one_line(tmp_path):
    done = shell(f"{warm.JOINTPLAY} {' '.join(RUN)} o > /dev/full", tmp_path)
    assert done.returncode == 1
    assert done.stderr == "jointplay: error: cannot print: No space left on device\n"
    assert (tmp_path / "o" / "result.nc").is_file()


@pytest.mark.thorough
@pytest.mark.parametrize("command", ["budget", "allocate --target 1mm"])
def test_files_are_written_though_the_reader_of_the_answer_goes_away(
    command, tmp_path, monkeypatch, capfd
):
    read, write = os.pipe()
    os.close(read)  # as `head` does once it has its lines
    name, *options = command.split()
    with os.fdopen(write, "w", buffering=1) as out:
        monkeypatch.setattr(sys, "stdout", out)
        folder = tmp_path / name
        arguments = [name, "ur5", *options, "--clearance", "0.1 mm", "--out"]
        assert cli.main([*arguments, str(folder)]) == 0
    assert len([*folder.iterdir()]) > 1
    assert "rror" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "closed",
    [
        *(
            pytest.param(text, marks=pytest.mark.thorough)
            for text in ("2>&-", ">&-", "2>/dev/full")
        ),
        "2>&- >&- <&-",
    ],
)
def test_runs_do_without_anyone_to_tell(closed, tmp_path):
    if "full" in closed and not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    run = " ".join(RUN).replace("--quiet ", "")
    done = shell(f"{warm.JOINTPLAY} {run} o {closed}", tmp_path)
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert jp.Result.load(tmp_path / "o" / "result.nc").message.startswith("completed")


@pytest.mark.parametrize("closed", ["2>&-", "2>&- >&- <&-"])
def test_processes_that_are_begun_without_anyone_to_tell_have_somewhere_to_write(closed, tmp_path):
    code = """
import subprocess, sys
from jointplay.base import streams
with streams.forgiving():
    child = [sys.executable, "-c", "import os; [os.fstat(number) for number in range(3)]"]
    sys.exit(subprocess.run(child).returncode)
"""
    (tmp_path / "begins.py").write_text(code)
    assert shell(f"{sys.executable} begins.py {closed}", tmp_path).returncode == 0


@pytest.mark.thorough  # it compiles the kernels anew
def test_a_damaged_cache_is_thrown_away(tmp_path):
    code = "from jointplay.base import objects\nobjects.FOLDER = 'not that of the package'\n"
    code += "from jointplay.model.impact import contact_duration\n"
    code += "from jointplay.simulation import Run\nfrom jointplay.paper import scara\n"
    call = [sys.executable, "-c", code + "print(Run(scara(2e-4)).total_steps)\n"]
    cache = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run(call, capture_output=True, env=cache, check=True)
    found = [*tmp_path.rglob("*.o")]
    assert found
    for number, file in enumerate(found):
        file.write_bytes((b"", b"{}\nno object", os.urandom(300))[number % 3])
    done = subprocess.run(call, capture_output=True, text=True, env=cache, check=False)
    assert done.stdout == "300000\n", done.stderr


def test_a_package_that_cannot_be_written_to_runs_with_a_hint(monkeypatch, tmp_path):
    nowhere = tmp_path / "a file"
    nowhere.write_text("")
    monkeypatch.setattr(objects, "_PACKAGE", nowhere)
    monkeypatch.setenv("XDG_CACHE_HOME", str(nowhere))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    with pytest.warns(RuntimeWarning, match="name a folder in NUMBA_CACHE_DIR"):
        made = objects.folder.__wrapped__()
    assert made.is_dir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert objects.folder.__wrapped__().is_relative_to(tmp_path / "cache")


def test_a_thousand_seconds_are_tabulated_no_further_than_the_motion_goes():
    long = dataclasses.replace(scara(2e-4), duration=1000.0, record_every=10**6)
    assert len(jp.Run(long).workspace.reference) == 30_002
    free = dataclasses.replace(long, motion=None, drive=jp.loads.Torque((0.0, 0.5), (1.0, 2.0)))
    assert len(jp.Run(free).workspace.reference) == 5_002
    loose = dataclasses.replace(long, motion=None, drive=jp.loads.Free())
    assert len(jp.Run(loose).workspace.reference) == 2


def test_after_the_end_of_its_motion_a_prescribed_joint_stands_still(urdf):
    robot = jp.Mechanism(
        urdf(body("arm", com="0.1 0 0"), joint("pin", "base", "arm", axis="0 1 0"))
    )
    motion = jp.Motion(["pin"], [0.0, 0.10005], [[0.0], [1.0]])
    result = jp.simulate(robot, motion, drive=jp.loads.Prescribed(), duration=0.3)
    after = result.time > 0.1003
    assert np.abs(result["q"].values[after, 0] - 1.0).max() < 1e-8
    weight = 2.0 * 9.81 * 0.1 * np.cos(1.0)
    assert np.abs(np.abs(result["drive"].values[after, 0]) - weight).max() < 1e-6 * weight


def test_a_motion_that_takes_long_to_tabulate_has_a_bar(urdf, monkeypatch, capsys):
    monkeypatch.setattr("jointplay.simulation.motion.ideal._PATIENCE_S", 0.0)
    simulation = dataclasses.replace(scara(2e-4), duration=0.01)
    jp.Run(simulation, progress=True)
    assert "tabulating the motion" in capsys.readouterr().err
    jp.Run(simulation)
    assert capsys.readouterr().err == ""


SERIES = """
import sys
import jointplay as jp
from jointplay.model.tool import choose_tool
robot = jp.Mechanism(sys.argv[1])
print(choose_tool(robot.description)[0], robot.model.nv)
"""


@pytest.mark.parametrize(("more", "code"), [(0, 0), (1, 1), (3000, 1)])
def test_links_in_series_are_read_up_to_a_limit_that_is_said(urdf, more, code):
    number = MOST_IN_SERIES - 1 + more
    chain = [body("l1"), joint("j1", "base", "l1")]
    for k in range(2, number + 1):
        chain += [body(f"l{k}"), joint(f"j{k}", f"l{k - 1}", f"l{k}", "fixed")]
    call = [warm.PYTHON, "-c", SERIES, str(urdf(*chain))]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr[-500:]
    if code:
        assert f"more than {MOST_IN_SERIES} links in series, up to 'l1000'" in done.stderr
    else:
        assert done.stdout.split()[1] == "1"


# Files of strangers


def _devices(folder):
    os.mkfifo(folder / "pipe")
    with (folder / "giant").open("wb") as file:
        file.truncate(10 * MOST_TEXT)
    return [folder / "pipe", folder / "giant", Path("/dev/zero"), folder]


READERS = {
    "urdf": jp.Mechanism,
    "scenario": jp.Scenario.load,
    "motion": jp.Motion.from_csv,
    "measurement": lambda path: csv_rows(path, "measurement"),
}


@pytest.mark.parametrize("reader", READERS.values(), ids=READERS)
def test_what_is_no_plain_file_or_a_giant_is_not_opened(reader, tmp_path):
    """A pipe that nobody writes to would be waited for, a device read for ever."""
    for path in _devices(tmp_path):
        with pytest.raises(JointplayError, match=f"{path.name}.*(regular|at most 256|folder|dir)"):
            reader(path)


# Options


def test_a_link_whose_name_has_a_comma_is_named_in_quotes(urdf):
    assert listed('a, "b,c" ,"d ""e"""') == ["a", "b,c", 'd "e"']
    names = ["b,c", 'd "e"', "f g"]
    assert listed(shlex.split(as_option(names))[0]) == names
    with pytest.raises(argparse.ArgumentTypeError, match="x,"):
        listed('x,"b')
    links = [body(n).replace('izz="0.01"', 'izz="9.0"') for n in ("b,c", "d")]
    path = urdf(
        links[0].replace(",", "&#44;"), joint("pin", "base", "b,c"),
        links[1], joint("pin2", "b,c", "d"),
    )  # fmt: skip
    with pytest.raises(JointplayError, match="--allow-unphysical '\"b,c\"'") as caught:
        jp.Mechanism(path)
    assert "too: d; all: --allow-unphysical all" in str(caught.value)
    assert jp.Mechanism(path, allow_unphysical=listed('"b,c",d')).joints == ("pin", "pin2")


def test_what_could_be_of_the_tool_or_of_a_joint_of_that_name_is_refused(urdf):
    robot = jp.Mechanism(urdf(body("arm"), joint("tool", "base", "arm")))
    result = jp.simulate(robot, duration=1e-3, drive=jp.loads.Free(), joint_friction={})
    assert observables.unit("tool.position", result.simulation.mechanism) == "rad"
    assert observables.unit("tool.x", result.simulation.mechanism) == "m"
    for name in ("tool.speed", "tool.acceleration"):
        with pytest.raises(JointplayError, match=f"'{name}' is a quantity of the tool and of"):
            observables.observe(result, name)
