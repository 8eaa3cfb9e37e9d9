"""`jointplay init`: write a commented scenario file to start from.

Write a commented scenario file that runs as it stands: the SCARA arm, ideal and with two
clearances. Change what you need, check it with `jointplay check`, and run it with `jointplay run`.

    [NAME]  file name; .toml is added if missing (default scenario.toml)
"""

import argparse
from pathlib import Path

from jointplay.base import files
from jointplay.base.errors import JointplayError

TEMPLATE = Path(__file__).parents[2] / "scenario" / "template.toml"


def run(options: argparse.Namespace) -> int:
    path = Path(options.name)
    if not path.name:
        raise JointplayError(f"{options.name!r} is not a valid file name")
    if path.suffix != ".toml":
        path = path.with_name(f"{path.name}.toml")
    files.write(path, TEMPLATE.read_bytes())
    print(f"wrote {path}; next: jointplay check {path}")
    return 0
