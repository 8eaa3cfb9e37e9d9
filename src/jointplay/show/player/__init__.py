"""Playback of results: robots in motion, the play in their joints, in a browser.

The page that a server offers and the page in a file are the same, bytes for bytes: meshcat's viewer
with a player of its own, and everything it plays. So the server's memory is that of one page.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import require_a
from jointplay.base.schema import known_keywords, require_keywords
from jointplay.show.player.server import HOST, PORT, serve

if TYPE_CHECKING:
    from jointplay.show.player.movie import MovieFile, Shot
    from jointplay.show.player.playback import Packed
    from jointplay.simulation.result.result import Result

MOST_BYTES = 15_000_000  # size that a page does not exceed, meshes permitting


Say = Callable[[str], None]  # receives a line for each thing that the user should know


def page(
    cases: Mapping[str, Result],
    title: str | None = None,
    say: Say = lambda _: None,
    **options: Any,
) -> tuple[bytes, Packed]:
    """The page that plays `cases`, and the scene in it; options and errors as of `playback.build`.

    Moments between impacts are left out until the page has no more than `MOST_BYTES`.
    """
    from jointplay.show.player.pages import render
    from jointplay.show.player.playback import BUDGET, build
    from jointplay.show.plots.names import title_of

    budget = options.pop("budget", BUDGET)
    title = title if title is not None else title_of(cases)
    while True:
        scene = build(cases, budget=budget, **options)
        content = render(scene, title)
        if len(content) <= MOST_BYTES or budget < 2000:
            break
        options["progress"] = False
        budget = int(0.8 * budget * min(MOST_BYTES / len(content), 1.0))
    for note in scene.notes:
        say(f"note: {note}")
    return content, scene


def save_html(
    cases: Mapping[str, Result],
    path: str | Path,
    say: Say = lambda _: None,
    **options: Any,
) -> Path:
    """Write one self-contained page that plays `cases`; it needs no server and no network.

    `options` and errors are those of `page`. An existing file is refused.
    """
    files.check_new(path)
    return files.write(path, page(cases, say=say, **options)[0])


def save_movie(
    cases: Mapping[str, Result],
    path: str | Path,
    shot: Shot | None = None,
    say: Say = lambda _: None,
    **options: Any,
) -> MovieFile:
    """Make a picture (.png) or a film (.gif, .mp4, .webm, .webp) of results.

    `say` and `options` are as for `save_html`; without Chromium, or what films need, it is refused.
    """
    from jointplay.show.player import movie

    path = movie.check(path)
    content, scene = page(cases, say=say, **options)
    progress = options.get("progress", False)
    return movie.film(content, scene.contents, path, shot or movie.Shot(), progress)


@known_keywords
def play(
    cases: Mapping[str, Result],
    *,
    host: str = HOST,
    port: int = PORT,
    browser: bool = True,
    say: Say = print,
    **options: Any,
) -> None:
    """Serve the page that plays `cases` and open it in the browser; returns after Ctrl-C.

    Args:
        cases: results by label.
        host: interface to listen on; by default other machines cannot connect.
        port: where; if it is taken, another.
        browser: whether to open one.
        say: receives what the user should know.
        options: see `page`.

    Raises:
        JointplayError: see `Server` and `playback.build`.
    """
    from jointplay.show.player.playback import build

    require_a("cases", cases, "Mapping")
    require_keywords(build, options, "play")  # before the browser opens
    make = partial(page, cases, say=say, **options)
    serve(lambda: make()[0], "playing", host, port, browser=browser, say=say)
