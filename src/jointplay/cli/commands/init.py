"""`jointplay init`: write a commented scenario file to start from.

Write a commented scenario file that runs as it stands: the SCARA arm, ideal and with two
clearances, or a linkage. Change what you need, check it with `jointplay check`, and run it with
`jointplay run`.

Example: jointplay init --linkage slider-crank crank.toml
"""

import argparse
from pathlib import Path

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.cli.options import Parser

SCENARIO = Path(__file__).parents[2] / "scenario"
LINKAGES = {path.stem: path for path in sorted((SCENARIO / "linkages").glob("*.toml"))}


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", nargs="?", default="scenario.toml", help="file name; .toml is "
        "added if missing")
    add("--linkage", choices=tuple(LINKAGES), help="one of these linkages, drawn by its points and "
        "links, instead of the arm")
# fmt: on


def run(options: argparse.Namespace) -> int:
    path = Path(options.name)
    if not path.name:
        raise JointplayError(f"{options.name!r} is not a valid file name")
    if path.suffix != ".toml":
        path = path.with_name(f"{path.name}.toml")
    template = LINKAGES.get(options.linkage, SCENARIO / "template.toml")
    files.write(path, template.read_bytes())
    print(f"wrote {path}; next: jointplay check {path}")
    return 0
