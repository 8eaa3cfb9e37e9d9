"""What `import jointplay as jp` shows, and what it still finds under older names."""

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import tomllib
import types
import warnings
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

import jointplay as jp
from jointplay import moved

ROOT = Path(__file__).parents[1]
ABOUT_OLD_NAMES = ("src/jointplay/moved.py", "docs/mechanisms.md")


def test_about_25_names_are_shown_and_all_are_there():
    assert set(dir(jp)) - set(jp.__all__) <= {name for name in vars(jp) if name.startswith("__")}
    assert 20 <= len(jp.__all__) <= 28
    for name in jp.__all__:
        assert getattr(jp, name) is not None


def test_the_version_is_that_of_the_release():
    assert (
        jp.__version__ == tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    )


def test_nothing_else_is_shown_after_use():
    program = "import jointplay as jp; jp.Status, jp.contact.Hertz; print(*dir(jp))"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert {name for name in said.stdout.split() if name[0] != "_"} == set(jp.__all__)


@pytest.mark.parametrize("old", sorted(moved.NAMES))
def test_an_older_name_is_found_and_the_new_one_said(old):
    home, _, name = moved.NAMES[old].rpartition(".")
    new = re.escape(f"jointplay.{old} is {moved.NAMES[old]} now")
    with pytest.warns(DeprecationWarning, match=new) as told:
        thing = getattr(jp, old)
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert thing is getattr(importlib.import_module(home), name)
    assert old not in dir(jp)


def test_older_kinds_of_joint_are_found_in_their_package():
    from jointplay import joints

    with pytest.warns(DeprecationWarning, match="is jointplay.RevoluteClearance now"):
        assert joints.ClearanceJoint is jp.RevoluteClearance


@pytest.mark.parametrize("module", [jp, jp.joints, jp.analysis, jp.motion])
def test_a_name_that_never_was_is_an_attribute_error(module):
    with pytest.raises(AttributeError, match=f"{module.__name__}.*no attribute 'nothing'"):
        _ = module.nothing


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


OLD = "|".join(moved.NAMES)


def uses(path):
    """Older names that a file uses, each with its place."""
    text = path.read_text(encoding="utf-8")
    patterns = [
        rf"\b(?:jp|jointplay)\.({OLD})\b",
        rf"from jointplay import (?:\([^)]*|[^\n(]*)\b({OLD})\b",
        rf"from jointplay\.joints import (?:\([^)]*|[^\n(]*)\b({'|'.join(moved.KINDS)})\b",
        rf"`({'|'.join(moved.KINDS)})\b",
        rf"(?:from|import) ({'|'.join(map(re.escape, moved.MOVED))})\b",
    ]
    return [
        f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, one.start()) + 1}: {one[1]}"
        for pattern in patterns
        for one in re.finditer(pattern, text)
    ]


def own_files():
    places = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    for folder in ("src", "tests", "docs", "benchmarks", "urdf"):
        for ending in ("py", "md", "ipynb", "toml"):
            places += (ROOT / folder).rglob(f"*.{ending}")
    left = {*map(ROOT.joinpath, ABOUT_OLD_NAMES), Path(__file__)}
    return [path for path in places if path not in left]


def test_nothing_of_ours_uses_an_older_name():
    assert [use for path in own_files() for use in uses(path)] == []


def test_the_search_for_older_names_finds_them(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    program = tmp_path / "program.py"
    program.write_text(
        "import jointplay as jp\nfrom jointplay import (\n    Mechanism,\n    Hertz,\n)\n"
        "from jointplay.certify import certify\njp.ClearanceJoint.planar()\n"
    )
    ast.parse(program.read_text())
    assert sorted(uses(program)) == [
        "program.py:2: Hertz",
        "program.py:6: jointplay.certify",
        "program.py:7: ClearanceJoint",
    ]


def test_simulate_has_the_fields_of_a_simulation():
    given = inspect.signature(jp.simulate).parameters
    own = {"progress": "bool", "certify": "bool"}
    assert set(given) == {field.name for field in fields(jp.Simulation)} | set(own)
    for field in fields(jp.Simulation):
        parameter = given[field.name]
        hint = str(parameter.annotation).removesuffix(" | None")
        assert hint == str(field.type).removesuffix(" | None"), field.name
        if field.default_factory is not MISSING:
            made = field.default_factory()
            assert parameter.default == made or (parameter.default is None and made == {})
        elif field.default is not MISSING:
            assert parameter.default == field.default, field.name
    assert all(str(given[name].annotation) == hint for name, hint in own.items())
