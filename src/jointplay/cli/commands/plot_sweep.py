"""`jointplay plot-sweep STORE`: a measure over the dimensions of a sweep."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.cli.commands import add_option

WORDS = ("x", "y", "hue", "z")


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "plot-sweep",
        help="draw the results of a sweep",
        description="Draw a measure over a dimension of a sweep, as lines with 95 % confidence "
        "bands of the mean over repeats and samples; or over two, as a heat map.",
        epilog="Examples: jointplay plot-sweep S x=clearance y=peak_force hue=friction; "
        "jointplay plot-sweep S x=clearance y=friction z=tool_error_rms_total",
    )
    parser.add_argument("store", metavar="STORE", help="store of jointplay sweep")
    parser.add_argument(
        "words",
        nargs="+",
        metavar="WORD=NAME",
        help="x and y, and hue for lines, or z (the measure) for a heat map; DIMENSION=VALUE "
        "selects the cases nearest to a value",
    )
    add_option(parser, "--out FILE", "picture (default: beside STORE, as .png)")


def run(options: argparse.Namespace) -> int:
    """Draw, say where."""
    from jointplay.base import files

    given: dict[str, str] = {}
    for word in options.words:
        name, equals, value = word.partition("=")
        if not equals or not value or name in given:
            raise JointplayError(
                f"{word!r} must be one of {', '.join(f'{one}=NAME' for one in WORDS)} or "
                "DIMENSION=VALUE, each once"
            )
        given[name] = value
    for name in ("x", "y"):
        if name not in given:
            raise JointplayError(f"{name}=NAME is missing")
    roles = {name: given.pop(name) for name in WORDS if name in given}
    store = Path(options.store)
    default = f"{store.name.removesuffix('.zarr')}_{roles.get('z', roles['y'])}.png"
    out = files.check_picture(options.out or store.parent / default)
    from jointplay.show.plots.sweep import draw  # what comes now takes long to import
    from jointplay.study import open_sweep
    from jointplay.study.store import reading

    with reading(store):
        figure = draw(open_sweep(store), **roles, only=given)
    files.picture(out, figure)
    print(out)
    return 0
