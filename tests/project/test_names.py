"""What `import jointplay as jp` shows."""

import importlib
import pkgutil
import subprocess
import sys
import tomllib
import types
from pathlib import Path

import pytest

import jointplay as jp
from jointplay import cli

ROOT = Path(__file__).parents[2]


def test_all_names_that_are_shown_are_there():
    assert sorted(dir(jp)) == sorted(jp.__all__)
    for name in jp.__all__:
        shown = getattr(jp, name)
        assert shown is not None
        if isinstance(shown, types.ModuleType):
            assert shown.__all__, "the pages of the API list them"


def test_the_version_is_that_of_the_release():
    assert (
        jp.__version__ == tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    )


def test_nothing_else_is_shown_after_use():
    program = "import jointplay as jp; jp.Status, jp.contact.Hertz; print(*dir(jp))"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert {name for name in said.stdout.split() if name[0] != "_"} == set(jp.__all__)


def packages():
    found = [jp]
    for one in pkgutil.walk_packages(jp.__path__, "jointplay."):
        if one.ispkg:
            found.append(importlib.import_module(one.name))
    return found


@pytest.mark.parametrize("package", packages(), ids=lambda package: package.__name__)
def test_no_name_is_a_module_and_something_else(package):
    modules = {one.name for one in pkgutil.iter_modules(package.__path__)}
    offered = {*getattr(package, "__all__", ()), *vars(package)}
    for name in modules & offered:
        assert isinstance(getattr(package, name), types.ModuleType), name


ELSEWHERE = {
    "run": "simulate",
    "export urdf": "to_urdf",
    "export result": "export",
    "export simulator": "reduce",
    "check": "Scenario",
    "scara": "paper",
    "study dynamics": "nonlinear",
    "init": "shipped",
    "plot": "open_sweep",
}
"""What does in Python what a command does, where it has another name: a study of several steps, a
template, a figure."""


def test_every_command_has_a_function_of_its_name_in_one_place():
    commands = cli.parsers()
    for command in commands:
        name = ELSEWHERE.get(command, command.rpartition(" ")[2])
        several = ("paper", "nonlinear", "live")
        assert name in several or callable(getattr(jp, name)), command
    assert set(ELSEWHERE) <= set(commands)
