"""The process whose copies do what `warm.JOINTPLAY` and `warm.PYTHON` are asked."""

import atexit
import fcntl
import gc
import importlib
import io
import json
import os
import pkgutil
import runpy
import selectors
import signal
import socket
import sys
import tempfile
import threading
import traceback
import types
from contextlib import suppress
from pathlib import Path

ALSO = (
    *("h5netcdf", "h5py", "sqlite3", "dask.array", "distributed", "matplotlib.pyplot", "logging"),
    *("matplotlib.backends.backend_agg", "matplotlib.backends.backend_pdf", "fontTools.subset"),
    *("PIL.PngImagePlugin", "multiprocessing.connection", "concurrent.futures.process"),
)
"""What commands import later than with jointplay's modules."""


def warm() -> None:
    """Import all that commands need, and load the kernels."""
    import jointplay as jp
    from jointplay.base import compiler, streams

    streams.announced.add(compiler.COMPILES)
    for module in pkgutil.walk_packages(jp.__path__, "jointplay."):
        importlib.import_module(module.name)
    for name in ALSO:
        with suppress(ImportError):  # of an extra that is not installed
            importlib.import_module(name)
    from jointplay.base import units

    units.convert("1 mm*s/s", "m")
    clearance = {"joint_b": jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)}
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    jp.simulate(jp.Mechanism(jp.shipped("scara.urdf"), clearance), motion, duration=1e-3)
    gc.collect()
    gc.freeze()


class Server:
    """Copies itself for each command, and tells who asked how the copy ended."""

    def __init__(self, listener: socket.socket) -> None:
        self.listener = listener
        self.ended, write = os.pipe()
        os.set_blocking(write, False)
        signal.set_wakeup_fd(write)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        self.clients: dict[int, socket.socket] = {}

    def serve(self) -> dict:
        """Serve until the tests end; returns in each copy what it is asked."""
        with selectors.PollSelector() as ready:
            for place in (self.listener, self.ended, sys.stdin.fileno()):
                ready.register(place, selectors.EVENT_READ)
            while True:
                for key, _ in ready.select():
                    if key.fileobj is self.listener:
                        if asked := self.begin(ready):
                            return asked
                    elif key.fileobj == self.ended:
                        os.read(self.ended, 4096)
                        self.tell(ready)
                    elif key.data:  # the client was killed; its copy may have ended by itself
                        if key.data in self.clients:
                            ready.unregister(key.fileobj)
                            os.kill(key.data, signal.SIGKILL)
                    else:
                        for pid in self.clients:
                            os.kill(pid, signal.SIGKILL)
                        os._exit(0)

    def begin(self, ready: selectors.BaseSelector) -> dict | None:
        """Copy this process for who asks next."""
        client, _ = self.listener.accept()
        streams: list[int] = []
        try:
            _, streams, _, _ = socket.recv_fds(client, 1, 64)
            with client.makefile("r") as lines:
                asked = json.loads(lines.readline())
        except (OSError, ValueError):  # who asks was killed before it had said what
            for stream in streams:
                os.close(stream)
            client.close()
            return None
        if pid := os.fork():
            for stream in streams:
                os.close(stream)
            self.clients[pid] = client
            ready.register(client, selectors.EVENT_READ, pid)
            with suppress(OSError):  # it was killed: `serve` reads that, and ends its copy
                client.sendall(f"{pid}\n".encode())
            return None
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for place in (client, self.listener, *self.clients.values()):
            place.close()
        above = [fcntl.fcntl(stream, fcntl.F_DUPFD, 200) for stream in streams]
        os.closerange(3, 200)
        for number in {0, 1, 2} - set(asked["streams"]):
            os.close(number)
        for stream, number in zip(above, asked["streams"], strict=True):
            os.dup2(stream, number)
            os.close(stream)
        return asked

    def tell(self, ready: selectors.BaseSelector) -> None:
        """Tell those whose copies have ended."""
        while self.clients:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            client = self.clients.pop(pid)
            with suppress(KeyError):
                ready.unregister(client)
            with suppress(OSError):
                client.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())
            client.close()


def become(asked: dict) -> None:
    """Do what is asked with the streams, folder and environment of who asks."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        stream = None
        if number in asked["streams"]:
            at_once = mode == "w" and bool(asked["environment"].get("PYTHONUNBUFFERED"))
            binary = os.fdopen(number, f"{mode}b", 0 if at_once else -1, closefd=False)
            errors = "backslashreplace" if number == 2 else None
            stream = io.TextIOWrapper(
                binary, None, errors, line_buffering=number == 2, write_through=at_once
            )
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    os.chdir(asked["folder"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    tempfile.tempdir = None
    places = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[1:1] = [place for place in places if place and place not in sys.path]
    program, *arguments = asked["arguments"]
    if "jointplay.model.xacro_expansion" in arguments:  # whose memory is limited
        os.execv(sys.executable, [sys.executable, *arguments])
    sys.path[0] = str(Path(sys.executable).parent)
    if "REAL_PYTHON" not in os.environ:
        sys.executable = str(Path(sys.argv[2]) / "python")  # of which there are copies, too
    sys.modules["__main__"] = main = types.ModuleType("__main__")
    if Path(program).name == "jointplay":
        from jointplay.cli import main as command

        sys.argv = [program, *arguments]
        sys.exit(command())
    if arguments[0] == "-P":
        del arguments[0]
    if arguments[0] == "-m":
        sys.argv = arguments[1:]
        runpy.run_module(arguments[1], run_name="__main__", alter_sys=True)
    elif arguments[0] == "-c":
        sys.path[0], sys.argv = "", ["-c", *arguments[2:]]
        exec(compile(arguments[1], "<string>", "exec"), main.__dict__)
    else:
        sys.path[0], sys.argv = str(Path(arguments[0]).resolve().parent), arguments
        runpy.run_path(arguments[0], run_name="__main__")


def run(asked: dict) -> None:
    """Do it and end as an interpreter does, but for tidying hundreds of modules away."""
    status = 0
    try:
        become(asked)
    except SystemExit as said:
        status = said.code
        if not isinstance(status, int | None):
            print(status, file=sys.stderr)
            status = 1
    except BaseException:
        traceback.print_exc()
        status = 1
    threading._shutdown()
    atexit._run_exitfuncs()
    with suppress(OSError, ValueError, AttributeError):
        sys.stdout.flush()
    os._exit(status or 0)


if __name__ == "__main__":
    warm()
    run(Server(socket.socket(fileno=int(sys.argv[1]))).serve())
