"""What the package imports is what pyproject.toml declares."""

import ast
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import jointplay

SOURCE = Path(jointplay.__file__).parent
PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
DISTRIBUTIONS = {
    "git": "gitpython",
    "mcap_ros2": "mcap-ros2-support",
    "mpl_toolkits": "matplotlib",
    "pinocchio": "pin",
    "pxr": "usd-core",
    "yaml": "pyyaml",
}
"""Names to install by, where they are not those to import by."""


def names(entries):
    return {re.match(r"[\w-]+", entry)[0].lower().replace("_", "-") for entry in entries}


DECLARED = names(PROJECT["dependencies"])
BROUGHT = DECLARED.union(*map(names, PROJECT["optional-dependencies"].values()))


def imports(path):
    """What a file imports from outside: at the top, which whoever imports the file needs, or not.

    What type checkers alone read does not count.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):  # parents come first
        for child in ast.iter_child_nodes(node):
            child.apart = getattr(node, "apart", False) or isinstance(node, ast.FunctionDef)
            child.typing = getattr(node, "typing", False) or (
                isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            )
        found = []
        if isinstance(node, ast.Import):
            found = [one.name for one in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found = [node.module]
        for name in found if not getattr(node, "typing", False) else ():
            top = name.partition(".")[0]
            if top not in sys.stdlib_module_names and top != "jointplay":
                yield DISTRIBUTIONS.get(top, top).lower().replace("_", "-"), node.apart


@cache
def found():
    return [
        (str(path.relative_to(SOURCE)), name, apart)
        for path in SOURCE.rglob("*.py")
        for name, apart in imports(path)
    ]


def test_what_is_imported_is_declared():
    assert {(file, name) for file, name, _ in found() if name not in BROUGHT} == set()


def test_what_an_extra_brings_is_imported_only_where_it_is_used():
    """Within functions, so that all else works without it."""
    at_the_top = {(file, name) for file, name, apart in found() if not apart}
    assert {(file, name) for file, name in at_the_top if name not in DECLARED} == set()


def test_what_every_installation_brings_is_imported():
    assert DECLARED - {name for _, name, _ in found()} == set()
