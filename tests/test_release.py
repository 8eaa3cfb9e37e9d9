"""What is said of the package in several places says the same."""

import re
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CONDA_NAMES = {"pin": "pinocchio", "matplotlib": "matplotlib-base", "meshcat": "meshcat-python"}


def test_citation_and_recipe_have_the_version_of_the_project():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
    assert citation["version"] == recipe["context"]["version"] == PROJECT["version"]


def test_the_conda_recipe_needs_what_the_project_needs():
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
    assert recipe["schema_version"] == 1
    wanted = {"python >=3.11"}
    for entry in PROJECT["dependencies"]:
        name, version = re.fullmatch(r"([\w-]+)(.*)", entry).groups()
        wanted.add(f"{CONDA_NAMES.get(name, name)} {version}".strip())
    assert {str(entry) for entry in recipe["requirements"]["run"]} == wanted


@pytest.mark.parametrize("path", sorted((ROOT / ".github").rglob("*.yml")), ids=lambda p: p.name)
def test_github_files_are_well_formed(path):
    assert yaml.safe_load(path.read_text())["name"]


def test_the_package_says_that_it_is_typed():
    assert (files("jointplay") / "py.typed").is_file()
