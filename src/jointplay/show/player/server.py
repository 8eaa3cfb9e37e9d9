"""A server that offers a page to browsers on this machine, and answers the page's questions."""

from __future__ import annotations

import errno
import ipaddress
import os
import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from jointplay.base.errors import JointplayError, require_whole

HOST = "127.0.0.1"
PORT = 7000  # meshcat's own default
_ATTEMPTS = 20  # ports that are tried, from the one asked for on
_TIMEOUT_S = 30.0  # for a browser to send its request
MOST_ASKED = 100_000  # largest question [bytes]

Post = Callable[[bytes], Iterator[bytes]]
"""Answers a question of the page: takes its body, and yields the parts of the answer as they are
computed. The iterator is closed when the page hangs up.

Raises:
    JointplayError: the question makes no sense; the page receives the message.
"""


class Server(ThreadingHTTPServer):
    """Serves one page from memory, and answers its questions.

    Args:
        page: HTML in UTF-8.
        host: address or name of the interface to listen on.
        port: port to listen on; if it is taken, one of the next, or any; 0 takes any.
        posts: functions that answer the page's questions, by name. If there are any, the address
            has a random token, without which nothing is answered; and no other site's page can ask.

    Raises:
        JointplayError: a host that is not of this machine, or a number that is not a port.
    """

    daemon_threads = True
    allow_reuse_address = os.name == "posix"  # on Windows it would share a port that is taken

    def __init__(
        self,
        page: bytes,
        host: str = HOST,
        port: int = PORT,
        posts: Mapping[str, Post] | None = None,
    ) -> None:
        port = require_whole("the port", port, 0, 65535)
        self.page, self.posts = page, dict(posts or {})
        self.root = f"/{secrets.token_urlsafe(24)}/" if posts else "/"
        try:
            addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError):
            raise JointplayError(
                f"no host {host!r}; 127.0.0.1 is reachable from this machine only"
            ) from None
        self.address_family = addresses[0][0]
        self._host = host
        candidates = [port, *range(port + 1, min(port + _ATTEMPTS, 65536)), 0] if port else [0]
        for candidate in candidates:
            try:
                super().__init__((host, candidate), _Handler)
                return
            except OSError as error:
                if error.errno not in (errno.EADDRINUSE, errno.EACCES) or candidate == 0:
                    raise JointplayError(
                        f"cannot listen on {host!r}, port {candidate}: {error.strerror or error}; "
                        "127.0.0.1 is reachable from this machine only"
                    ) from None

    @property
    def port(self) -> int:
        return int(self.server_address[1])

    @property
    def url(self) -> str:
        host = {"0.0.0.0": HOST, "::": "::1", "": HOST}.get(self._host, self._host)
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}{self.root}"

    def known(self, host: str) -> bool:
        """Whether a request's Host header names this machine.

        It guards against DNS rebinding: another site can let its own name lead to this address, but
        its requests then carry that name.
        """
        name = host.rpartition(":")[0] if not host.endswith("]") and ":" in host else host
        name = name.strip("[]").lower().rstrip(".")
        try:
            ipaddress.ip_address(name)
        except ValueError:
            names = {"localhost", self._host, socket.gethostname(), socket.getfqdn()}
            return name in {known.lower() for known in names if known}
        return True

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore browsers that hang up."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = _TIMEOUT_S
    disable_nagle_algorithm = True  # parts of an answer are small, and must not be delayed

    def do_GET(self) -> None:
        asked = self._asked()
        if asked is None:
            return
        if asked:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self._begin(HTTPStatus.OK, "text/html; charset=utf-8", len(self.server.page))
        if self.command == "GET":
            self.wfile.write(self.server.page)

    do_HEAD = do_GET

    def do_POST(self) -> None:
        """Answer a question of the page, part by part; an error is the last part."""
        self.close_connection = True
        asked = self._asked()
        if asked is None:
            return
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin", "")
        size = self.headers.get("Content-Length", "")
        refused = None
        if origin != f"http://{host}":
            refused = HTTPStatus.FORBIDDEN
        elif self.headers.get("Content-Type") != "application/json":
            refused = HTTPStatus.UNSUPPORTED_MEDIA_TYPE
        elif not (size.isascii() and size.isdigit()):
            refused = HTTPStatus.LENGTH_REQUIRED
        elif len(size) > 9 or int(size) > MOST_ASKED:
            refused = HTTPStatus.REQUEST_ENTITY_TOO_LARGE
        elif asked not in self.server.posts:
            refused = HTTPStatus.NOT_FOUND
        if refused is not None:
            self.send_error(refused)
            return
        body = self.rfile.read(int(size))
        try:
            parts = self.server.posts[asked](body)
        except JointplayError as error:
            self._begin(HTTPStatus.UNPROCESSABLE_ENTITY, "text/plain; charset=utf-8")
            self.wfile.write(str(error).encode())
            return
        with closing(parts):  # type: ignore[type-var]
            self._begin(HTTPStatus.OK, "application/octet-stream")
            for part in parts:
                self.wfile.write(part)

    def _asked(self) -> str | None:
        """The path below the page's address; None if the request is refused, which is answered."""
        if not self.server.known(self.headers.get("Host", "")):
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
            return None
        path, root = self.path.partition("?")[0], self.server.root
        if not secrets.compare_digest(path[: len(root)].encode(), root.encode()):
            self.send_error(HTTPStatus.NOT_FOUND)
            return None
        return path[len(root) :]

    def _begin(self, status: HTTPStatus, kind: str, size: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if size is not None:
            self.send_header("Content-Length", str(size))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("X-Frame-Options", "DENY")
        self.send_header("Referrer-Policy", "no-referrer")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        pass


def serve(
    make: Callable[[], bytes],
    doing: str,
    host: str = HOST,
    port: int = PORT,
    posts: Mapping[str, Post] | None = None,
    *,
    browser: bool = True,
    say: Callable[[str], None] = print,
) -> None:
    """Serve the page that `make` returns and open it in the browser, until Ctrl-C.

    The address is said (after `doing`, such as "playing") before the page is made, which may take
    long: a browser that asks meanwhile waits.

    Raises:
        JointplayError: as `Server`.
    """
    with Server(b"", host, port, posts) as server:
        if port and server.port != port:
            say(f"port {port} is in use; using {server.port}")
        if host not in ("localhost", "::1") and not host.startswith("127."):
            say(f"listening on {host}: other machines can see this page")
        say(f"{doing} at {server.url} in a moment (stop with Ctrl-C)")
        server.page = make()
        if browser and not open_browser(server.url):
            say("no browser could be opened; open this address yourself")
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            say("")


def open_browser(url: str) -> bool:
    """Open `url` in the user's browser; False if there is none, or no display."""
    windows = sys.platform in ("darwin", "win32")
    if not windows and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False  # a text browser would take over the terminal
    try:
        return webbrowser.open(url, new=2)
    except webbrowser.Error:
        return False


def check_host(host: str) -> None:
    """Refuse a host on which this machine cannot listen."""
    Server(b"", host, 0).server_close()
