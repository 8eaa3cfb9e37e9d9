"""`jointplay play`: results in motion, in the browser or as a file."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from jointplay.commands import add_quiet, add_trust


def add(commands: Any) -> None:
    """Add the command to the subparsers `commands`."""
    parser = commands.add_parser(
        "play",
        help="play results in the browser, or write a page that does",
        description="Show results in motion: robots side by side, their ideal twins as ghosts, "
        "paths of the tool, contact forces, and a close-up of a joint with its play magnified. "
        "Play in real time, slower or faster, scrub, jump from impact to impact.",
        epilog="The file of --html needs no server and no network: send it to anyone.",
    )
    parser.add_argument("results", nargs="+", metavar="RESULT", help="files that runs wrote (.nc)")
    parser.add_argument("--html", metavar="FILE", help="write one self-contained page and stop")
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
    add_quiet(parser)
    add_trust(parser)
    parser.set_defaults(handler=run)


def run(options: argparse.Namespace) -> int:
    """Play what the options name; returns the exit status."""
    try:
        return _play(options)
    except KeyboardInterrupt:  # while preparing; what is served ends with 0
        print(file=sys.stderr)
        return 130


def _play(options: argparse.Namespace) -> int:
    from pathlib import Path

    from jointplay import playback

    if options.html is not None:
        playback.check_new(Path(options.html))
    else:
        playback.Server(b"", options.host, 0).server_close()
    content, scene = playback.page(
        playback.load(options.results, options.trust),
        joint=options.joint,
        magnification=options.magnify,
        meshes=options.meshes,
        ghosts=not options.no_ghost,
        progress=not options.quiet,
    )
    if options.html is None:
        playback.serve(
            content, scene.notes, options.host, options.port, not options.no_browser, _say
        )
        return 0
    for note in scene.notes:
        _say(f"note: {note}", sys.stderr)
    path = playback.write(content, options.html)
    _say(f"{path}: {len(content) / 1e6:.1f} MB")
    return 0


def _say(text: str, where: Any = None) -> None:
    print(text, file=where, flush=True)
