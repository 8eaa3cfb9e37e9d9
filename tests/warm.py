"""The command line without its start: `JOINTPLAY` and `PYTHON` stand for `jointplay` and `python`.

They hand arguments, folder, environment and streams to a process that has imported jointplay and
its kernels already (else a second and more for each command), are told signals for the copy of it
that does the work, and end as that ends. What is about a start, limits of the system, or processes
that are killed takes the real ones.
"""

import functools
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

PATIENCE_S = 900.0
"""A deadline for broken code, not a measure of its speed."""
CLIENT = """#!{python} -IS
import json, os, signal, socket, sys
streams = [int(n) for n in os.listdir("/dev/fd")]
streams = [n for n in streams if os.path.exists(f"/dev/fd/{{n}}")]
server = socket.socket(socket.AF_UNIX)
server.connect({address!r})
socket.send_fds(server, [b"x"], streams)
asked = {{"arguments": sys.argv, "folder": os.getcwd(), "environment": dict(os.environ)}}
lines = server.makefile("rw")
lines.write(json.dumps(asked | {{"streams": streams}}) + "\\n")
lines.flush()
for stream in streams:
    if stream > 2:
        os.close(stream)  # the copy alone has them, so that they end with it
copy = int(lines.readline())
with open({place!r} + f"/{{os.getpid()}}", "w") as file:
    file.write(f"{{copy}}\\n")
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, lambda number, _: os.kill(copy, number))
status = int(lines.readline())
if status < 0:
    if -status != signal.SIGKILL:
        signal.signal(-status, signal.SIG_DFL)
    os.kill(os.getpid(), -status)
os._exit(status)
"""


@functools.cache
def begin() -> tuple[subprocess.Popen, tempfile.TemporaryDirectory]:
    """Start the process that is copied, and make what stands for the commands."""
    made = tempfile.TemporaryDirectory(prefix="warm")
    place = Path(made.name)
    address = str(place / "socket")
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(address)
    listener.listen(64)
    program = CLIENT.format(python=sys.executable, address=address, place=made.name)
    for name in ("jointplay", "python"):
        (place / name).write_text(program)
        (place / name).chmod(0o755)
    server = subprocess.Popen(
        [sys.executable, Path(__file__).with_name("warm_server.py"), str(listener.fileno()), place],
        stdin=subprocess.PIPE,  # is closed when these tests end, however they do
        pass_fds=[listener.fileno()],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        start_new_session=True,
    )
    listener.close()
    return server, made


def folder() -> Path:
    """Where what stands for the commands lies."""
    return Path(begin()[1].name)


def close() -> None:
    """End the process that is copied, if there is one."""
    if begin.cache_info().currsize:
        server, made = begin()
        server.stdin.close()
        server.wait()
        made.cleanup()
        begin.cache_clear()


class Process(subprocess.Popen):
    """One of the two commands; signals go to the copy at once."""

    @functools.cached_property
    def copy(self) -> int:
        """The number of the process that does the work."""
        place = folder() / str(self.pid)
        while not (place.exists() and place.read_text().endswith("\n")):
            assert self.poll() is None
            time.sleep(0.001)
        return int(place.read_text())

    def send_signal(self, sig: int) -> None:
        """Send it to the copy, by whose end this process ends."""
        with suppress(ProcessLookupError):
            if self.poll() is None:
                os.kill(self.copy, sig)


def call(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    """What becomes of a command of `jointplay`."""
    command = [folder() / "jointplay", *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE_S, check=False, **options
    )


def start(*arguments: object, **options: object) -> Process:
    """A command of `jointplay`, begun at once."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | options
    return Process([folder() / "jointplay", *map(str, arguments)], **options)


def until(process: subprocess.Popen[str], words: str = r" \d+\.\d*[1-9]\d*/\d+.*left") -> None:
    """Wait until the process says these words, by default that it steps."""
    seen = ""
    while not re.search(words, seen):
        read = process.stderr.read(1)
        assert read, seen
        seen += read


def end(process: subprocess.Popen[str]) -> tuple[str, str, int]:
    """Standard output, standard error, and exit status."""
    out, err = process.communicate(timeout=PATIENCE_S)
    return out, err, process.returncode


class System:
    """`sys` for modules that start processes of their own."""

    @property
    def executable(self) -> str:
        return str(folder() / "python")

    def __getattr__(self, name: str):
        return getattr(sys, name)


def __getattr__(name: str) -> str:
    if name not in ("JOINTPLAY", "PYTHON"):
        raise AttributeError(name)
    return str(folder() / name.lower())
