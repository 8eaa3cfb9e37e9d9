"""`jointplay play`: results in motion, in the browser or as a file."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from jointplay.commands import add_quiet, add_trust
from jointplay.core import streams


def add(commands: Any) -> None:
    """Add the command to the subparsers `commands`."""
    parser = commands.add_parser(
        "play",
        help="play results in the browser, or write a page that does",
        description="Show results in motion: robots side by side, their ideal twins as ghosts, "
        "paths of the tool, contact forces, and a close-up of a joint with its play magnified. "
        "Play in real time, slower or faster, scrub, jump from impact to impact.",
        epilog="The file of --html needs no server and no network: send it to anyone. Films need "
        "the extra jointplay[movie] and a Chromium; no screen, no graphics card.",
    )
    parser.add_argument("results", nargs="+", metavar="RESULT", help="files that runs wrote (.nc)")
    parser.add_argument("--html", metavar="FILE", help="write one self-contained page and stop")
    parser.add_argument(
        "--movie",
        metavar="FILE",
        help="write a picture (.png) or a film (.gif, .mp4, .webm) and stop",
    )
    parser.add_argument("--joint", metavar="NAME", help="joint of the close-up (default: first)")
    parser.add_argument(
        "--magnify",
        type=float,
        metavar="X",
        help="factor of displacements in the close-up (default: so that the gap is seen)",
    )
    parser.add_argument(
        "--meshes",
        action="append",
        default=[],
        metavar="DIR",
        help="where a URDF's meshes are, its packages below it (repeatable; example-robot-data's "
        "are found without)",
    )
    parser.add_argument("--no-ghost", action="store_true", help="no ideal twins")
    parser.add_argument("--host", default="127.0.0.1", help="(default 127.0.0.1: no other machine)")
    parser.add_argument("--port", type=int, default=7000, metavar="N", help="(default 7000)")
    parser.add_argument("--no-browser", action="store_true", help="only serve")
    film = parser.add_argument_group("film (--movie)")
    film.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help="relative to real time, such as 0.01 (default: one that makes a film of 4 to 20 s)",
    )
    film.add_argument(
        "--begin",
        type=float,
        metavar="T",
        help="from when on [s]; of a picture the moment (default: the start; the hardest impact)",
    )
    film.add_argument("--end", type=float, metavar="T", help="until when [s] (default: the end)")
    film.add_argument("--fps", type=float, metavar="N", help="frames per second (default 25)")
    film.add_argument("--size", metavar="WxH", help="pixels, even numbers (default 1280x720)")
    film.add_argument("--view", metavar="VIEW", help="both, robot or closeup (default both)")
    add_quiet(parser)
    add_trust(parser)


def run(options: argparse.Namespace) -> int:
    """Play what the options name; returns the exit status."""
    try:
        return _play(options)
    except KeyboardInterrupt:  # while preparing; what is served ends with 0
        print(file=sys.stderr)
        return 130


def _play(options: argparse.Namespace) -> int:
    from pathlib import Path

    from jointplay.core.errors import JointplayError, require_whole
    from jointplay.core.files import check_new, is_file

    require_whole("the port", options.port, 0, 65535)
    for name in options.results:  # before anything is loaded that takes time
        if not is_file(Path(name)):
            raise JointplayError(f"no result file {name!r}")
    if options.html is not None and options.movie is not None:
        raise JointplayError("give one of --html and --movie")
    shot = _shot(options)
    if options.html is not None:
        check_new(Path(options.html))
    elif options.movie is not None:
        from jointplay.player import movie

        movie.check(options.movie)
    else:
        from jointplay.player.server import Server

        Server(b"", options.host, 0).server_close()
    return _made(options, shot)


def _made(options: argparse.Namespace, shot: Any) -> int:
    """Make the page; serve, write or film it."""
    from pathlib import Path

    from jointplay import player
    from jointplay.player.pages import write

    content, scene = player.page(
        player.load(options.results, options.trust),
        joint=options.joint,
        magnification=options.magnify,
        meshes=options.meshes,
        ghosts=not options.no_ghost,
        progress=not options.quiet,
    )
    if options.html is None and options.movie is None:
        player.serve(content, scene.notes, options.host, options.port, not options.no_browser, _say)
        return 0
    for note in scene.notes:
        streams.note(f"note: {note}")
    streams.release()
    if options.movie is not None:
        from jointplay.player import movie

        path = Path(options.movie)
        _say(str(movie.film(content, scene.contents, path, shot, not options.quiet)))
        return 0
    path = write(content, options.html)
    _say(f"{path}: {len(content) / 1e6:.1f} MB")
    return 0


def _shot(options: argparse.Namespace) -> Any:
    """What the film shows; None if none is wanted.

    Raises:
        JointplayError: options of films without one, or numbers that make no sense.
    """
    from jointplay.core.errors import JointplayError

    given = {
        field: getattr(options, name)
        for field, name in (
            *(("speed", "speed"), ("begin", "begin"), ("end", "end"), ("size", "size")),
            *(("frames_per_second", "fps"), ("view", "view")),
        )
        if getattr(options, name) is not None
    }
    if options.movie is None:
        if given:
            names = ", ".join(f"--{'fps' if name[:3] == 'fra' else name}" for name in given)
            raise JointplayError(f"{names} needs --movie FILE")
        return None
    from jointplay.player.movie import Shot

    if "size" in given:
        width, cross, height = given["size"].lower().partition("x")
        if not (cross and width.isdigit() and height.isdigit()):
            raise JointplayError(f"--size {given['size']}: give WIDTHxHEIGHT, such as 1280x720")
        given["size"] = (int(width), int(height))
    return Shot(**given)


def _say(text: str, where: Any = None) -> None:
    print(text, file=where, flush=True)
