"""Progress: bars in a terminal, lines in a file, one bar for the whole."""

import fcntl
import io
import os
import pty
import re
import struct
import subprocess
import termios
from contextlib import suppress

import pytest
from warm import JOINTPLAY

from jointplay.base import progress
from jointplay.base.progress import ProgressBar


class Terminal(io.StringIO):
    def isatty(self):
        return True


def stopped(monkeypatch):
    """A clock that a test turns [s]."""
    now = [0.0]
    for clock in ("time.time", "tqdm.std.time"):
        monkeypatch.setattr(clock, lambda: now[0])
    return now


def test_what_is_left_is_told_without_the_start_that_compiles(monkeypatch):
    """A minute of compiling, then 1 s of work in each second: 90 s are left after 10."""
    monkeypatch.setenv("JOINTPLAY_PROGRESS_S", "0")
    now, file = stopped(monkeypatch), io.StringIO()
    monkeypatch.setattr("sys.stderr", file)
    bar = ProgressBar(total=100, unit="run")
    now[0] = 60.0
    for _ in range(10):
        now[0] += 1.0
        bar.update()
    first, *_, last = file.getvalue().splitlines()
    assert first.endswith("1/100 run")  # nothing to estimate from
    assert last.endswith("01:30 left")


def test_more_than_was_expected_is_shown_as_the_total(monkeypatch):
    monkeypatch.setenv("JOINTPLAY_PROGRESS_S", "0")
    now, file = stopped(monkeypatch), io.StringIO()
    monkeypatch.setattr("sys.stderr", file)
    with ProgressBar(total=2, unit="model") as bar:
        for _ in range(4):
            now[0] += 1.0
            bar.update()
    assert "4/4 model" in file.getvalue().splitlines()[-1]


def test_a_run_is_as_fast_as_it_is_once_it_moves(monkeypatch):
    """The start, which compiles and finds the rest, does not count."""
    monkeypatch.setenv("JOINTPLAY_PROGRESS_S", "0")
    now, file = stopped(monkeypatch), io.StringIO()
    monkeypatch.setattr("sys.stderr", file)
    bar = progress.Simulated(2.0)
    now[0] = 60.0
    for reached in (0.5, 1.0, 1.5):
        now[0] += 1.0
        bar.reach(reached)
    first, *others = file.getvalue().splitlines()
    assert "real time" not in first
    assert len(others) == 2
    assert all("0.50 x real time" in line for line in others)


def test_what_is_compiled_in_between_does_not_slow_a_run(monkeypatch):
    """What a finished run is made into is compiled after it, while the bar of all runs is up."""
    monkeypatch.setenv("JOINTPLAY_PROGRESS_S", "0")
    now, file = stopped(monkeypatch), io.StringIO()
    monkeypatch.setattr("sys.stderr", file)
    bar = progress.Simulated(2.0)
    for reached in (0.5, 1.0, 1.5):
        with progress.aside():
            now[0] += 40.0
            with progress.aside():
                now[0] += 20.0
        now[0] += 1.0
        bar.reach(reached)
    assert file.getvalue().splitlines()[-1].endswith("0.50 x real time, 00:01 left")


def test_into_a_file_go_whole_lines_and_seldom(monkeypatch):
    monkeypatch.delenv("JOINTPLAY_PROGRESS_S", raising=False)
    file = io.StringIO()
    monkeypatch.setattr("sys.stderr", file)
    list(ProgressBar(range(100), "wear"))
    assert file.getvalue() == ""  # it took no ten seconds
    monkeypatch.setenv("JOINTPLAY_PROGRESS_S", "0")
    list(ProgressBar(range(4), "wear", unit="run"))
    lines = file.getvalue().splitlines()
    assert len(lines) == len(set(lines)) == 4
    assert lines[1].startswith("wear  50%, 2/4 run")
    assert not {"|", "\r"} & set(file.getvalue())


def test_a_terminal_has_a_bar(monkeypatch):
    file = Terminal()
    monkeypatch.setattr("sys.stderr", file)
    with ProgressBar(total=2) as bar:
        bar.update(2)
    assert "100%|##" in file.getvalue()


def test_before_anything_is_done_no_time_left_is_told(monkeypatch):
    file = Terminal()
    monkeypatch.setattr("sys.stderr", file)
    with ProgressBar(total=2, unit="run") as bar:
        bar.refresh()
        assert "0/2 run" in file.getvalue()
        assert "?" not in file.getvalue()


def test_runs_within_a_whole_add_to_its_one_bar(monkeypatch):
    file = Terminal()
    monkeypatch.setattr("sys.stderr", file)
    with progress.overall(3.0, True):
        for label in ("first ", "second "):
            bar = progress.Simulated(1.0, True, label)
            bar.reach(0.25)
            bar.reach(1.0)
            bar.close()
        assert progress.current().n == pytest.approx(2.0)
        progress.current().update(2.0)  # more than was expected
        assert progress.current().total == pytest.approx(4.0)
    assert progress.current() is None
    assert "simulated in all runs, second" in file.getvalue()
    assert file.getvalue().count("\n") == 1  # one bar, which stays


def test_the_bar_of_the_whole_is_there_again_below_what_was_printed_last(monkeypatch):
    file = Terminal()
    monkeypatch.setattr("sys.stderr", file)
    with progress.overall(1.0, True):
        bar = progress.Simulated(1.0, True, "only")
        bar.reach(0.1)
        bar.reach(1.0)  # too soon after the first to be drawn
        bar.close()
        with progress.printing():
            file.write("answer")
    *_, last = file.getvalue().partition("answer")
    assert "100%|" in last
    assert "x real time" in last


def test_nothing_is_shown_unless_asked_for(monkeypatch):
    file = Terminal()
    monkeypatch.setattr("sys.stderr", file)
    with progress.overall(1.0, False), progress.printing():
        bar = progress.Simulated(1.0, False)
        bar.reach(1.0)
        bar.close()
    assert file.getvalue() == ""


@pytest.mark.parametrize("jobs", [pytest.param("1", marks=pytest.mark.thorough), "2"])
def test_a_run_of_several_cases_has_one_bar_and_answers_as_they_come(jobs, tmp_path):
    """In a terminal; into a pipe go the answers and no bar."""
    command = [JOINTPLAY, "run", "jointplay:scara.toml", "--no-figures", "--jobs", jobs]
    short = ["--set", "integration.duration=0.01"]
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 110, 0, 0))
    shown = bytearray()
    with subprocess.Popen(
        [*command, *short, "--out", tmp_path / "a"], stdout=theirs, stderr=theirs
    ) as process:
        os.close(theirs)
        with suppress(OSError):  # the end, on Linux
            while data := os.read(ours, 65536):
                shown += data
    os.close(ours)
    assert process.returncode == 0
    screen = shown.decode()
    bars = [line for line in re.split(r"[\r\n]", screen) if "%|" in line]
    totals = {re.search(r"/([\d.]+) s simulated in all runs", line)[1] for line in bars}
    assert len(totals) == 1  # one bar for all three cases and their further runs
    assert "x real time" in screen
    assert "3 of 3 cases done" in screen
    assert screen.rindex("%|") > screen.index("0.2 mm: Play of 0.2 mm")
    done = subprocess.run(
        [*command, *short, "--out", tmp_path / "b"],
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "%|" not in done.stderr
    assert "\r" not in done.stderr
