"""Compiling a stranger's MJCF with all its meshes, in a process where it can do no harm."""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import temporary
from jointplay.model.meshes import FOLDER
from jointplay.model.mjcf import compiled, convert_apart, load_mujoco, load_spec, report


def compile_file(path: Path) -> Any:
    """An MJCF as MuJoCo's `MjModel`, with names for all bodies and joints.

    A process with the limits of `model.mjcf` compiles it; this one reads only the compiled arrays.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot compile the file within the limits.
    """
    mujoco, name = load_mujoco(), "whole.mjb"
    return mujoco.MjModel.from_binary_path(name, {name: b64decode(convert_apart(__name__, path))})


def compile_text(text: str, meshes: Mapping[str, bytes] = MappingProxyType({})) -> Any:
    """`compile_file` for an MJCF's text; `meshes` are files for the folder `FOLDER` beside it."""
    with temporary("mjcf") as place:
        path = Path(place) / "robot.xml"
        path.write_text(text, encoding="utf-8")
        path.with_name(FOLDER).mkdir()
        for name, content in meshes.items():
            (path.parent / FOLDER / name).write_bytes(content)
        try:
            return compile_file(path)
        except JointplayError as error:
            fault = str(error).replace(repr(str(path)), "that is written")
            raise JointplayError(fault) from None


def serve(path: str) -> None:
    """Main function of the process: write the compiled model to standard output."""
    report(path, _compile)


def _compile(path: Path) -> str:
    """The compiled model in MuJoCo's binary format, as base64."""
    mujoco, model = load_mujoco(), compiled(load_spec(path), path)
    arrays = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, arrays)
    return b64encode(arrays.tobytes()).decode()
