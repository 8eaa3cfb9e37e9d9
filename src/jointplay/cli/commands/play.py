"""`jointplay play`: play results in the browser, or write a page that does.

Show results in motion: robots side by side, their ideal counterparts as ghosts, paths of the tool,
contact forces, and a close-up of a joint with its play magnified. Play in real time, slower or
faster, scrub, jump from impact to impact.

The file of --html needs no server and no network: send it to anyone. Films need the extra
jointplay[movie] and Chromium, but neither a screen nor a graphics card.
"""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from jointplay.base import files, streams
from jointplay.base.errors import JointplayError, require_whole
from jointplay.cli.commands import given
from jointplay.cli.options import FLAG, REPEATED, Parser

FILM = {name: name for name in ("speed", "begin", "end", "size", "view", "signal")}
FILM["frames_per_second"] = "fps"
"""Options of a film by field of `Shot`."""


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"give WIDTHxHEIGHT, such as 1280x720, got {text!r}")
    return int(width), int(height)


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("result", metavar="RESULT", nargs="+", help="result files (.nc), or folders of them")
    add = parser.add_mutually_exclusive_group().add_argument
    add("--html", metavar="FILE", help="write one self-contained page instead of serving it")
    add("--movie", metavar="FILE", help="write a picture (.png) or a film (.gif, .mp4, .webm, "
        ".webp) instead of serving a page")
    add = parser.add_argument
    add("--joint", metavar="NAME", help="joint of the close-up (default: the first)")
    add("--magnify", metavar="X", type=float, help="magnification of displacements in the close-up "
        "(default: one that shows the gap)")
    add("--meshes", metavar="DIR", **REPEATED, help="folder of the URDF's meshes or packages; "
        "those of example-robot-data are found without it")
    add("--no-ghost", **FLAG, help="do not show the ideal counterparts")
    add("--host", metavar="HOST", default="127.0.0.1", help="interface to listen on; other "
        "machines cannot reach the default")
    parser.share("--port", "--no-browser")
    add = parser.add_argument_group("film (--movie)").add_argument
    add("--speed", metavar="X", type=float, help="relative to real time, such as 0.01 (default: "
        "one that makes a film of 4 to 20 s)")
    add("--begin", metavar="T", type=float, help="start time [s]; for a picture, its time "
        "(default: the start; the hardest impact)")
    add("--end", metavar="T", type=float, help="end time [s] (default: the end)")
    add("--fps", dest="frames_per_second", metavar="X", type=float, help="frames per second "
        "(default: 25)")
    add("--size", metavar="WxH", type=_size, help="pixels, even numbers (default: 1280x720)")
    add("--view", metavar="VIEW", help="both, robot or closeup (default: both)")
    add("--signal", metavar="NAME", help="drawn over time below the picture, such as 'tool error' "
        "or 'contact force, JOINT' (default: nothing)")
    parser.share("--quiet", "--import")
# fmt: on


def run(options: argparse.Namespace) -> int:
    require_whole("the port", options.port, 0, 65535)
    for path in map(Path, options.result):  # before anything is loaded that takes time
        if not files.is_folder(path):
            files.require_file(path, "result file")
    shot: Any = given(options, *FILM)
    if shot and options.movie is None:
        options_given = ", ".join(f"--{FILM[name]}" for name in shot)
        raise JointplayError(f"{options_given} needs --movie FILE")
    if options.html is not None:
        files.check_new(options.html)
    elif options.movie is not None:
        from jointplay.show.player import movie

        shot = movie.Shot(**shot)
        movie.check(options.movie)
    else:
        from jointplay.show.player.server import check_host

        check_host(options.host)
    from jointplay.show import player
    from jointplay.show.plots.names import load

    results = load(options.result)
    shown: dict[str, Any] = {
        "joint": options.joint,
        "magnification": options.magnify,
        "meshes": options.meshes,
        "ghosts": not options.no_ghost,
        "progress": not options.quiet,
    }
    if options.html is not None:
        path = player.save_html(results, options.html, _note, **shown)
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    elif options.movie is not None:
        print(player.save_movie(results, options.movie, shot, _note, **shown))
    else:
        shown |= {"host": options.host, "port": options.port, "browser": not options.no_browser}
        player.play(results, say=partial(print, flush=True), **shown)
    return 0


def _note(text: str) -> None:
    streams.note(text)
    streams.release()
