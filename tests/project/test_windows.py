"""What Windows lacks is not needed: commands run where Python has none of it.

A stand-in for `msvcrt` locks as the real one does: only what is locked by another process fails.
"""

import os
import subprocess
import sys

import pytest

WITHOUT = """
import fcntl, importlib.abc, os, signal, sys, types
import asyncio, ctypes, multiprocessing.context, multiprocessing.popen_spawn_posix, shutil, socket
import subprocess, tempfile

MISSING = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog"}


class Windows(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in MISSING:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def locking(descriptor, mode, size):
    try:
        real(descriptor, exclusive)
    except BlockingIOError as error:
        raise PermissionError(13, "Permission denied") from error


real, exclusive = fcntl.flock, fcntl.LOCK_EX | fcntl.LOCK_NB
sys.modules["msvcrt"] = types.ModuleType("msvcrt")
sys.modules["msvcrt"].LK_NBLCK, sys.modules["msvcrt"].locking = 2, locking
for name in MISSING:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Windows())
for module, names in (
    (os, "sched_getaffinity sysconf mkfifo fchmod setsid killpg".split()),
    (signal, "SIGHUP SIGXCPU SIGALRM alarm setitimer pthread_sigmask".split()),
):
    for name in names:
        module.__dict__.pop(name, None)
"""


@pytest.fixture
def windows(tmp_path):
    """Run Python in a folder, without what Windows lacks; so do processes that it starts."""
    (tmp_path / "lacks").mkdir()
    (tmp_path / "lacks" / "sitecustomize.py").write_text(WITHOUT)
    path = os.pathsep.join((str(tmp_path / "lacks"), os.environ.get("PYTHONPATH", "")))

    def start(*arguments):
        return subprocess.Popen(
            [sys.executable, *arguments],
            env={**os.environ, "PYTHONPATH": path, "MPLBACKEND": "agg"},
            cwd=tmp_path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(*arguments):
        process = start(*arguments)
        out, err = process.communicate(timeout=600)
        assert process.returncode == 0, (arguments, out, err)
        return out

    run.start = start
    return run


COMMAND = ("-c", "import sys; from jointplay.cli import main; sys.exit(main())")
CLAIM = """
from pathlib import Path
from jointplay.base import files

files.claim(Path("mine"), [])
print("claimed", flush=True)
input()
"""


def test_nothing_of_unix_is_imported(windows):
    everything = "import jointplay as jp; [getattr(jp, name) for name in jp.__all__]"
    assert windows("-c", f"{everything}; import sys; print('fcntl' in sys.modules)") == "False\n"
    assert windows.start("-c", "import fcntl").wait() == 1


@pytest.mark.thorough
def test_commands_run(windows):
    assert "joint_b" in windows(*COMMAND, "budget", "jointplay:scara.toml", "--case", "0.2 mm")
    short = ("--duration", "0.01", "--no-figures")
    assert "result" in windows(*COMMAND, "run", *short, "--out", "result")
    windows(*COMMAND, "report", "result", "--no-pdf", "--out", "report.html")


def test_a_folder_in_use_is_refused(windows):
    first, second = windows.start("-c", CLAIM), windows.start("-c", CLAIM)
    said = {first.stdout.readline(), second.stdout.readline()}
    assert said == {"claimed\n", ""}
    ended = [process.communicate("\n", timeout=60)[1] for process in (first, second)]
    assert "another process is writing to 'mine'" in "".join(ended)
