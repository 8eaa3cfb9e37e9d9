"""Scripts as users write them: what they import is public, and what they assert holds."""

import re
import runpy
import sys
from pathlib import Path

import matplotlib as mpl
import pytest

HERE = Path(__file__).parent
NEEDS = {"mujoco_user": ["mujoco"], "ros_user": ["mcap", "mcap_ros2", "yaml"]}
SCRIPTS = [
    pytest.param(path, id=path.stem, marks=pytest.mark.needs(*NEEDS.get(path.stem, [])))
    for path in sorted(HERE.glob("*_user.py"))
]


@pytest.mark.parametrize("path", SCRIPTS)
def test_a_users_script_runs_on_public_names_alone(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"jointplay\.\w|\bjp\._|\bjp\.\w+\._", text.replace("jointplay:", ""))
    with mpl.rc_context({"backend": "agg"}):
        runpy.run_path(str(path), run_name="__main__")


@pytest.mark.thorough
@pytest.mark.needs("mypy")
def test_quantities_as_text_and_numbers_pass_a_strict_type_check(tmp_path):
    from subprocess import run

    said = run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path),
         "--follow-imports=silent", str(HERE / "typed_user.py")],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert said.returncode == 0, said.stdout + said.stderr
