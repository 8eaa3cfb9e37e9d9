"""Run the notebooks and keep their outputs in them: `python docs/notebooks/execute.py [NAME ...]`.

Those of `measured` run in their folder, if JOINTPLAY_MEASURED is a folder with clones of the public
data that they read (their first cells name them).
Pictures are kept with few colours, and nothing that differs from run to run but the physics' own.
"""

import base64
import io
import os
import sys
import tempfile
from pathlib import Path

import nbclient
import nbformat
from PIL import Image

FOLDER = Path(__file__).parent
COLOURS = 64
KEPT = ("image/png", "text/html", "text/plain")
"""Kinds of output that are kept; of several for one thing the first."""


def executed(path, folder, timeout=1800):
    """The notebook at `path`, run in `folder`, with its outputs as they come."""
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    resources = {"metadata": {"path": str(folder)}}
    nbclient.NotebookClient(notebook, timeout=timeout, resources=resources).execute()
    return notebook


def small(notebook):
    """The notebook with its outputs as they are kept."""
    for number, cell in enumerate(c for c in notebook.cells if c.cell_type == "code"):
        cell.execution_count = number + 1
        cell.metadata = {}
        outputs = []
        for output in cell.outputs:
            if output.output_type == "stream" and output.name == "stderr":
                continue  # progress, and notes on the first compilation
            if output.output_type == "stream" and outputs and outputs[-1].output_type == "stream":
                outputs[-1].text += output.text  # what progress had parted
                continue
            if "data" in output:
                kind = next((kind for kind in KEPT if kind in output.data), None)
                if kind is None:
                    continue
                output.data = {kind: output.data[kind]}
                output.metadata = {}
                if kind == "image/png":
                    output.data[kind] = fewer_colours(output.data[kind])
                if "execution_count" in output:
                    output.execution_count = number + 1
            outputs.append(output)
        cell.outputs = outputs
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return notebook


def fewer_colours(text):
    image = Image.open(io.BytesIO(base64.b64decode(text))).convert("RGB")
    made = io.BytesIO()
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(made, format="png", optimize=True)
    return base64.b64encode(made.getvalue()).decode("ascii")


def main(names):
    paths = sorted(FOLDER.glob("*.ipynb"))
    if "JOINTPLAY_MEASURED" in os.environ:
        paths += sorted((FOLDER / "measured").glob("*.ipynb"))
    for path in paths:
        if names and path.stem not in names:
            continue
        with tempfile.TemporaryDirectory() as folder:
            where = folder if path.parent == FOLDER else path.parent
            nbformat.write(small(executed(path, where)), path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
