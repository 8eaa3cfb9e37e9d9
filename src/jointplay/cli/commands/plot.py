"""`jointplay plot`: draw the results of a sweep.

Draw a measure over a dimension of a sweep, as lines with 95 % confidence bands of the mean over
repeats and samples; or over two, as a heat map.

Examples: jointplay plot S x=clearance y=peak_force hue=friction; jointplay plot S
x=clearance y=friction z=tool_error_rms_total
"""

import argparse
from pathlib import Path

from jointplay.base.errors import JointplayError
from jointplay.base.pairs import pairs
from jointplay.cli.options import Parser

WORDS = ("x", "y", "hue", "z")


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("store", metavar="STORE", help="folder of jointplay study sweep")
    add("words", metavar="WORDS", nargs="+", help="x=NAME and y=NAME, and hue=NAME for lines, or "
        "z=NAME (the measure) for a heat map; DIMENSION=VALUE selects the cases nearest to a value")
    add("--out", metavar="FILE", help="picture (default: beside STORE, as .png)")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.base import files

    forms = ", ".join(f"{role}=NAME" for role in WORDS)
    chosen = pairs(options.words, f"WORDS {forms} or DIMENSION=VALUE")
    for name in ("x", "y"):
        if name not in chosen:
            raise JointplayError(f"{name}=NAME is missing")
    roles = {name: chosen.pop(name) for name in WORDS if name in chosen}
    store = Path(options.store)
    default = f"{store.name}_{roles.get('z', roles['y'])}.png"
    out = files.check_picture(options.out or store.parent / default)
    from jointplay.show.plots.draw import draw  # what comes now takes long to import
    from jointplay.show.plots.sweep import chart
    from jointplay.study import open_sweep

    files.picture(out, draw(chart(open_sweep(store).dataset(), **roles, only=chosen)))
    print(out)
    return 0
