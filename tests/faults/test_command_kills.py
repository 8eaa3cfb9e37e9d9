"""Reports, estimates of wear, identifications and statements that are killed: no file is torn.

The moments are random; from where on a signal is one that the program answers, and until when, the
process says itself.
"""

import csv
import json
import os
import random
import re
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import body, joint, tip
from estimate.test_identify import MASS, REACH, seen
from sweep_scenario import SCENARIO
from test_kills import gone, needs_proc
from test_sweep_kills import descendants
from warm import JOINTPLAY, PATIENCE_S, PYTHON, Process, end, start

pytestmark = pytest.mark.thorough

TELLING = """
import os, sys
from contextlib import contextmanager
from jointplay import cli
from jointplay.base import signals
listening = signals.listening
@contextmanager
def telling():
    with listening():
        os.write(int(sys.argv[1]), b"b")
        yield
        os.write(int(sys.argv[1]), b"e")
signals.listening = telling
sys.exit(cli.main(sys.argv[2:]))
"""
"""A command line that says when it begins to listen to signals, and when it ceases to."""


@dataclass
class Command:
    """A command that writes files, and what they are when nothing is killed."""

    arguments: list[str]
    out: str
    """Option that names where it writes to."""
    folder: bool
    """Whether that is a folder."""
    names: list[str]
    seconds: float = 0.0

    def call(self, place: Path) -> list[str]:
        target = place if self.folder else place / self.names[0]
        return [*self.arguments, self.out, str(target)]


AXES = """
mu = { key = "joints.joint_b.friction.mu_d", distribution = "uniform", from = 0.0, to = 0.2 }
"""


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    """Each command with what it reads, and how long it takes."""
    place = tmp_path_factory.mktemp("read")
    text = SCENARIO.format(axes=AXES, options="samples = 4", duration="3 ms")
    (place / "study.toml").write_text(text)
    (place / "wear.toml").write_text(
        text[: text.index("[sweep]")]
        .replace("axial_clearance", 'wear_rate = "1e-5 mm^3/(N*m)"\naxial_clearance')
        .replace("3 ms", "50 ms")
    )
    (place / "arm.urdf").write_text(
        f'<robot name="r"><link name="base"/>{body("arm", mass=MASS, com=f"{REACH} 0 0")}'
        f"{joint('j', 'base', 'arm', axis='0 1 0')}{tip('arm')}</robot>"
    )
    (place / "seen.csv").write_text(seen().csv())
    for made in (
        ["study", "sweep", place / "study.toml", "--out", place / "store", "--quiet", "--jobs", 1],
        ["run", "--duration", "3e-3", "--no-figures", "--quiet", "--out", place / "run"],
    ):
        out, err, status = end(start(*made))
        assert status == 0, (out, err)
    found = {
        "report": Command(
            ["report", str(place / "run" / "result.nc"), "--quiet"],
            "--out", False, ["r.html", "r.pdf"],
        ),
        "wear": Command(
            ["study", "wear", str(place / "wear.toml"), "--joint=joint_b", "--growth=0.1 mm",
             "--quiet"],
            "--out", False, ["w.csv"],
        ),
        "identify": Command(
            ["identify", str(place / "arm.urdf"), str(place / "seen.csv"), "--clearance=0.05 mm",
             "--quiet"],
            "--out", True, ["identified.csv", "identified.json", "identified.png", "loops.png"],
        ),
        "uncertainty": Command(
            ["study", "uncertainty", str(place / "store"), "peak_force"], "--out", False, ["c.png"]
        ),
    }  # fmt: skip
    for name, command in found.items():
        whole = tmp_path_factory.mktemp(name)
        began = time.monotonic()
        out, err, status = end(start(*command.call(whole)))
        command.seconds = time.monotonic() - began
        assert status == 0, (out, err)
        assert check_whole(whole) == sorted(command.names)
    return found


ENDS = {".html": b"</html>", ".pdf": b"%%EOF", ".png": b"IEND\xaeB`\x82"}
"""What the last bytes of a file are."""


def check_whole(place):
    """Names of the files in a folder, each of which must be whole."""
    names = sorted(path.name for path in place.iterdir() if not path.name.startswith("."))
    for name in names:
        content = (place / name).read_bytes()
        if name.endswith(".json"):
            json.loads(content)
        elif name.endswith(".csv"):
            rows = list(csv.reader(content.decode().splitlines()))
            assert content.endswith(b"\n"), name
            assert {len(row) for row in rows} == {len(rows[0])}, name
        else:
            assert content.rstrip().endswith(ENDS[Path(name).suffix]), (name, content[-20:])
    return names


def told(command, place, number, wait):
    """Send a signal after a while from when the command listens; returns what came of it."""
    read, write = os.pipe()
    call = [PYTHON, "-c", TELLING, str(write), *command.call(place)]
    process = Process(
        call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, pass_fds=[write]
    )
    os.close(write)
    assert os.read(read, 1) == b"b"
    try:
        process.wait(timeout=wait)
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    pids = descendants(process.copy) if process.poll() is None else []
    out, err = process.communicate(timeout=PATIENCE_S)
    listened = os.read(read, 1) == b""  # to the end of the process, that is
    os.close(read)
    gone(pids)
    return out, err, process.returncode, listened


NAMES = ("report", "wear", "identify", "uncertainty")


def tell_at_random(name, command, place, number, rng):
    """Told to stop, a command ends with one line and 130, or was done; its files are whole."""
    place.mkdir()
    wait = rng.uniform(0.0, 1.1 * command.seconds)
    out, err, status, listened = told(command, place, number, wait)
    names = check_whole(place)
    assert set(names) <= set(command.names)
    assert not list(place.glob(".*"))
    if not listened:  # it was done before, or with what it was doing
        assert status in (0, 130, -number), (status, err)
        assert names == sorted(command.names) or status == 130
        return
    assert status == 130, (status, out, err)
    assert "Traceback" not in err
    said = [line for line in err.splitlines() if line.strip()]
    assert len(said) <= 1, err
    assert re.search("interrupted|gave up", err + out), (out, err)


def kill_at_random(command, folder, times, rng):
    """Kill a command at moments of its life: what has its final name is whole; nobody lives on."""
    for number in range(times):
        place = folder / f"k{number}"
        place.mkdir()
        call = [JOINTPLAY, *command.call(place)]
        process = Process(call, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            process.wait(timeout=rng.uniform(0.0, 1.1 * command.seconds))
        except subprocess.TimeoutExpired:
            pids = descendants(process.copy)
            process.kill()
            process.wait()
            gone(pids)
        assert set(check_whole(place)) <= set(command.names)
        rest = [path.name for path in place.glob(".*")]
        assert all(name.endswith(".part") for name in rest)


@needs_proc
@pytest.mark.parametrize("times", [1, pytest.param(25, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", NAMES)
def test_told_or_killed_a_command_leaves_whole_files_or_none(name, times, commands, tmp_path):
    rng = random.Random(name)
    for k in range(times):
        for number in (signal.SIGTERM, signal.SIGINT):
            tell_at_random(name, commands[name], tmp_path / f"t{k}{number}", number, rng)
    kill_at_random(commands[name], tmp_path, 2 * times, rng)
