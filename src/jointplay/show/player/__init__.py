"""Playback of results: robots in motion, the play in their joints, in a browser.

The page that a server offers and the page in a file are the same, bytes for bytes: meshcat's viewer
with a player of its own, and everything it plays. So the server's memory is that of one page.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_a
from jointplay.show.player.server import HOST, PORT, Server, check_host, open_browser

if TYPE_CHECKING:
    from jointplay.show.player.movie import MovieFile, Shot
    from jointplay.show.player.scene import Packed
    from jointplay.simulation.result.result import Result

MOST_BYTES = 15_000_000
"""Size that a page does not exceed, meshes permitting."""


def _silent(text: str) -> None:
    """Say nothing."""


def load(paths: Sequence[str | Path], trust: Collection[str] = ()) -> dict[str, Result]:
    """Results by label: cases of a scenario as it names them, where that tells them apart.

    Else the files' names, with as many of their folders as tell them apart.

    Laws of the user's own are taken from the modules of `trust` only; see `Result.load`.

    Raises:
        JointplayError: no such file, the same file twice, damaged, or not a result.
    """
    resolved = [Path(path).resolve() for path in paths]
    for path, again in zip(paths, resolved, strict=True):
        if resolved.count(again) > 1:
            raise JointplayError(f"result {str(path)!r} is given twice")
    labels: list[str] = []
    for depth in range(1, max((len(file.parts) for file in resolved), default=0) + 1):
        labels = ["/".join((*file.parent.parts[1:], file.stem)[-depth:]) for file in resolved]
        if len(set(labels)) == len(labels):
            break
    from jointplay.show.plots.names import case_names
    from jointplay.simulation.result.result import Result

    results = [Result.load(path, trust) for path in paths]
    return dict(zip(case_names(results) or labels, results, strict=True))


def page(
    cases: Mapping[str, Result], title: str | None = None, **options: Any
) -> tuple[bytes, Packed]:
    """The page that plays `cases`, and the scene in it.

    Moments between impacts are left out until the page has no more than `MOST_BYTES`.

    Raises:
        JointplayError: see `scene.build`.
    """
    from jointplay.show.player.pages import render
    from jointplay.show.player.scene import BUDGET, build
    from jointplay.show.plots.names import title_of

    budget = options.pop("budget", BUDGET)
    title = title if title is not None else title_of(cases)
    while True:
        scene = build(cases, budget=budget, **options)
        content = render(scene, title)
        if len(content) <= MOST_BYTES or budget < 2000:
            return content, scene
        options["progress"] = False
        budget = int(0.8 * budget * min(MOST_BYTES / len(content), 1.0))


def save_html(
    cases: Mapping[str, Result],
    path: str | Path,
    say: Callable[[str], None] = _silent,
    **options: Any,
) -> Path:
    """Write one self-contained page that plays `cases`; it needs no server and no network.

    `say` receives a line for each thing that the user should know; `options` are those of `page`.

    Raises:
        JointplayError: the file exists or cannot be written; see also `scene.build`.
    """
    files.check_new(path)
    content, scene = page(cases, **options)
    _tell(scene, say)
    return files.write(path, content)


def save_movie(
    cases: Mapping[str, Result],
    path: str | Path,
    shot: Shot | None = None,
    say: Callable[[str], None] = _silent,
    **options: Any,
) -> MovieFile:
    """Make a picture (.png) or a film (.gif, .mp4, .webm, .webp) of results.

    `say` and `options` are as for `save_html`.

    Raises:
        JointplayError: see `movie.check`, `movie.Shot` and `page`; there is no Chromium.
    """
    from jointplay.show.player import movie

    path = movie.check(path)
    content, scene = page(cases, **options)
    _tell(scene, say)
    progress = options.get("progress", False)
    return movie.film(content, scene.contents, path, shot or movie.Shot(), progress)


def play(
    cases: Mapping[str, Result],
    *,
    host: str = HOST,
    port: int = PORT,
    browser: bool = True,
    say: Callable[[str], None] = print,
    **options: Any,
) -> None:
    """Serve the page that plays `cases` and open it in the browser; returns after Ctrl-C.

    Args:
        cases: results by label.
        host: interface to listen on; by default other machines cannot connect.
        port: where; if it is taken, another.
        browser: whether to open one.
        say: receives one line for each thing the user should know.
        options: see `page`.

    Raises:
        JointplayError: see `Server` and `scene.build`.
    """
    require_a("cases", cases, "Mapping")
    check_host(host)  # a wrong host shows before the work
    content, scene = page(cases, **options)
    del cases
    _tell(scene, say)
    with Server(content, host, port) as server:
        if port and server.port != port:
            say(f"port {port} is in use; using {server.port}")
        if host not in ("localhost", "::1") and not host.startswith("127."):
            say(f"listening on {host}: other machines can see this page")
        say(f"playing at {server.url} (stop with Ctrl-C)")
        if browser and not open_browser(server.url):
            say("no browser could be opened; open this address yourself")
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            say("")


def _tell(scene: Packed, say: Callable[[str], None]) -> None:
    for note in scene.notes:
        say(f"note: {note}")
