"""The notebooks run from top to bottom, and show what they promise: their outputs are in them."""

import os
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MEASURED = sorted((FOLDER / "measured").glob("*.ipynb"))
"""Those that read public data, which are no part of this repository."""
pytestmark = pytest.mark.needs("nbformat", "nbclient", "ipykernel")
MOST_BYTES = 400_000


def kinds(notebook):
    """What each cell of code gives, in order."""
    return [
        [next(iter(output.get("data", {"text": ""}))) for output in cell.outputs]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_gives_what_is_kept_in_it(path, tmp_path, monkeypatch):
    import nbformat

    monkeypatch.setattr(sys, "path", [str(FOLDER), *sys.path])
    import execute

    kept = nbformat.read(path, as_version=4)
    found = execute.small(execute.executed(path, tmp_path))
    outputs = [out for cell in found.cells for out in cell.get("outputs", [])]
    assert not [out for out in outputs if out.output_type == "error"]
    assert sum("image/png" in out.get("data", {}) for out in outputs) >= 2
    assert kinds(kept) == kinds(found)
    assert [cell.source for cell in kept.cells] == [cell.source for cell in found.cells]


@pytest.mark.parametrize("path", MEASURED, ids=lambda path: path.stem)
def test_notebook_of_public_data_runs_where_the_data_are(path, monkeypatch):
    if "JOINTPLAY_MEASURED" not in os.environ:
        pytest.skip("JOINTPLAY_MEASURED names no folder with clones of the data")
    import nbformat

    monkeypatch.setattr(sys, "path", [str(FOLDER), *sys.path])
    import execute

    kept = nbformat.read(path, as_version=4)
    assert kinds(kept) == kinds(execute.small(execute.executed(path, path.parent)))


@pytest.mark.parametrize("path", MEASURED, ids=lambda path: path.stem)
def test_notebook_of_public_data_has_its_outputs(path):
    import nbformat

    kept = nbformat.read(path, as_version=4)
    outputs = [out for cell in kept.cells for out in cell.get("outputs", [])]
    assert sum("image/png" in out.get("data", {}) for out in outputs) >= 2
    assert not [out for out in outputs if out.output_type == "error"]
    assert "git clone https://github.com/" in kept.cells[0].source


@pytest.mark.parametrize("path", [*NOTEBOOKS, *MEASURED], ids=lambda path: path.stem)
def test_outputs_are_small_and_name_no_machine(path):
    text = path.read_text(encoding="utf-8")
    assert len(text) < MOST_BYTES
    for trace in ("/tmp/", "/home/", "/root/", "Traceback"):
        assert trace not in text


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} >= {
        "first_run",
        "comparing_clearances",
        "own_mechanism",
        "decisions",
    }
    assert {path.stem for path in MEASURED} == {"tiago", "mukca", "servos"}
