"""`jointplay init`: write a commented scenario file to start from.

Write a commented scenario file that runs as it stands: the SCARA arm, ideal and with two
clearances. Change what you need, check it with `jointplay check`, and run it with `jointplay run`.
"""

import argparse
from pathlib import Path

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.cli.options import Parser

TEMPLATE = Path(__file__).parents[2] / "scenario" / "template.toml"


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", nargs="?", default="scenario.toml", help="file name; .toml is "
        "added if missing")
# fmt: on


def run(options: argparse.Namespace) -> int:
    path = Path(options.name)
    if not path.name:
        raise JointplayError(f"{options.name!r} is not a valid file name")
    if path.suffix != ".toml":
        path = path.with_name(f"{path.name}.toml")
    files.write(path, TEMPLATE.read_bytes())
    print(f"wrote {path}; next: jointplay check {path}")
    return 0
