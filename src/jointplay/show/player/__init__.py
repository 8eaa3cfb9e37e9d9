"""Playback of results in a browser: robots in motion, and the play in their joints.

A page holds meshcat's viewer, a player, and everything that is played. The server offers the same
bytes that a file would have, so that its memory is that of one page.
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

MOST_BYTES = 15_000_000  # largest size of a page, unless its meshes alone are larger

Say = Callable[[str], None]  # receives notes for the user, a line each


def page(
    cases: Mapping[str, Result], title: str | None = None, say: Say = lambda _: None, **options: Any
) -> tuple[bytes, Packed]:
    """The page that plays `cases`, and its scene; options and errors are those of `playback.build`.

    Moments between impacts are left out until the page is no larger than `MOST_BYTES`.
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
    cases: Mapping[str, Result], path: str | Path, say: Say = lambda _: None, **options: Any
) -> Path:
    """Write a self-contained page that plays `cases`, without a server or a network.

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

    `say` and `options` are as for `save_html`. It is refused if Chromium or the packages that films
    need are missing.
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
    """Serve the page that plays `cases` and open it in the browser, until Ctrl-C.

    Args:
        cases: results by label.
        host: interface to listen on; by default other machines cannot connect.
        port: port to listen on; if it is taken, another is used.
        browser: open a browser.
        say: receives notes for the user.
        options: those of `page`.

    Raises:
        JointplayError: as `Server` and `playback.build`.
    """
    from jointplay.show.player.playback import build

    require_a("cases", cases, "Mapping")
    require_keywords(build, options, "play")  # before the browser opens
    make = partial(page, cases, say=say, **options)
    serve(lambda: make()[0], "playing", host, port, browser=browser, say=say)
