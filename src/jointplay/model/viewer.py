"""meshcat's server, run so that a stranger's page cannot use it and that it ends with its parent.

As meshcat starts it, it listens on all interfaces, takes websockets without asking where they come
from, and outlives a parent that was killed. Here it listens on the loopback interface, answers to
names of this machine only, takes websockets from its own page only, and ends with its parent. What
is shown is sent over a socket in a folder that no other user can enter.

This module is both sides: `visualizer` starts the process, which runs `main`.
"""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError

HOST = "127.0.0.1"

_NAMES = (HOST, "localhost", "[::1]")
"""Names of this machine only, under which no page of a stranger is served."""

_LONGEST_ADDRESS = 100
"""Most bytes of a socket's path: 104 are possible on macOS, 108 on Linux."""

_WATCH_S = 0.5
"""Interval at which the server checks that its parent still runs [s]."""


def visualizer() -> Any:
    """A `meshcat.Visualizer` with a server of its own, a process that ends with this one.

    Raises:
        JointplayError: the server does not start.
    """
    import meshcat

    folder = Path(tempfile.mkdtemp(prefix="jointplay-"))  # for this user alone
    if len(os.fsencode(folder / "scene")) > _LONGEST_ADDRESS:
        folder.rmdir()
        folder = Path(tempfile.mkdtemp(prefix="jointplay-", dir="/tmp"))
    address = f"ipc://{folder / 'scene'}"
    command = [sys.executable, "-P", "-u", "-m", __name__, address, str(os.getpid())]
    paths = os.pathsep.join(path for path in sys.path if path)  # whatever this process can import
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=output,
            env={**os.environ, "PYTHONPATH": paths},
            start_new_session=True,  # Ctrl-C in a notebook's cell is not for it
        )
        assert process.stdout is not None
        ready = process.stdout.readline()
        if not ready:
            process.kill()
            process.wait()
            output.seek(0)
            reason = output.read().decode("utf-8", "replace").strip().rpartition("\n")[2]
            shutil.rmtree(folder, ignore_errors=True)
            raise JointplayError(f"the visualizer's server did not start: {reason or 'it ended'}")
    atexit.register(_end, process, folder, os.getpid())
    shown = meshcat.Visualizer(zmq_url=address)
    shown.window.server_proc = process  # where meshcat itself keeps it
    return shown


def _end(process: subprocess.Popen[bytes], folder: Path, parent: int) -> None:
    if os.getpid() != parent:  # a fork of the process that began the server
        return
    process.kill()
    process.wait()
    shutil.rmtree(folder, ignore_errors=True)


def main(address: str, parent: int) -> None:
    """Serve what is sent to `address` until the process `parent` ends."""
    from meshcat.servers import zmqserver

    def refusal(handler: Any) -> int | None:
        """Status with which a request to another host's name is refused, or None.

        A page whose own name was made to lead here (DNS rebinding) asks for that name.
        """
        host = handler.request.headers.get("Host", "").lower()
        name = host if host.endswith("]") else host.rpartition(":")[0] or host
        return None if name in _NAMES else 421

    class Files(zmqserver.StaticFileHandlerNoCache):  # type: ignore[misc]
        def prepare(self) -> None:
            if status := refusal(self):
                self.send_error(status)

    class Socket(zmqserver.WebSocketHandler):  # type: ignore[misc]
        def prepare(self) -> None:
            # Every browser names the origin of a websocket. What names none is no page of ours, and
            # nothing else has business here, so it is refused, too; tornado would let it in.
            host = self.request.headers.get("Host", "").lower()
            same_origin = self.request.headers.get("Origin", "").lower() == f"http://{host}"
            if status := refusal(self) or (None if same_origin else 403):
                self.send_error(status)

    class Bridge(zmqserver.ZMQWebSocketBridge):  # type: ignore[misc]
        def make_app(self) -> Any:
            root = {"path": zmqserver.VIEWER_ROOT, "default_filename": zmqserver.VIEWER_HTML}
            application = type(super().make_app())(
                [(r"/static/(.*)", Files, root), (r"/", Socket, {"bridge": self})]
            )
            application.listen = partial(application.listen, address=HOST)
            return application

    bridge = Bridge(zmq_url=address, host=HOST)

    def watch() -> None:
        if os.getppid() != parent:  # it has ended: the system has given this process another
            bridge.ioloop.stop()
        bridge.ioloop.call_later(_WATCH_S, watch)

    # A signal on the parent's death would come with the end of the thread that began us, and a pipe
    # stays open in processes that the parent has forked.
    watch()
    sys.stdout.write(f"{bridge.web_url}\n")
    sys.stdout.flush()
    try:
        bridge.run()
    finally:
        shutil.rmtree(Path(address.removeprefix("ipc://")).parent, ignore_errors=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
