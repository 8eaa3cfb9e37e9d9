"""Results as recordings of rerun.io: the robot in motion, and every history beside it.

Entities: ``robot/<link>`` with its shapes, ``tool`` with its path, ``force/<joint>`` as arrows at
the joints, and ``histories/...`` with all numbers of `Result.to_dataframe`. The timeline is called
``time``. Pinocchio places the links, so the journal is seen where it is in its bearing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import trimesh

from jointplay.base.imports import extra
from jointplay.bridges.table import columns
from jointplay.model.scene import Scene
from jointplay.simulation.result.result import Result

ARROW = 0.15
"""Length of the arrow of the largest force, relative to the robot's size."""
_RED, _BLUE = (209, 53, 43), (0, 114, 178)


def rrd(result: Result, suffix: str, progress: bool) -> bytes:
    """The recording's content."""
    with extra("rerun", "rerun-sdk"):
        import rerun as rr
    escape = rr.escape_entity_path_part
    mechanism = result.simulation.mechanism
    recording: Any = rr.RecordingStream("jointplay")
    stream = recording.binary_stream()
    time = rr.TimeColumn("time", duration=result.time)
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    text = f"{result.message}\n\n{result.judgement}"
    recording.log("about", rr.TextDocument(text), static=True)
    scene = Scene(mechanism)
    _robot(rr, recording, scene)
    poses = scene.poses(result.q)
    for k, name in enumerate(scene.links):
        pose = poses[:, k]
        moved = rr.Transform3D.columns(translation=pose[:, :3], quaternion=pose[:, 3:])
        recording.send_columns(f"robot/{escape(name)}", [time], moved)
    path = result["tool_position"].values
    recording.log("tool/path", rr.LineStrips3D([path], colors=[_BLUE]), static=True)
    recording.send_columns("tool/position", [time], rr.Points3D.columns(positions=path))
    _forces(rr, recording, result, scene, poses, time)
    for name, (values, unit) in columns(result).items():
        if name == "time":
            continue
        variable, _, rest = name.partition(".")
        place = f"histories/{variable}" + (f"/{escape(rest)}" if rest else "")
        recording.log(place, rr.SeriesLines(names=[f"{name} [{unit}]"]), static=True)
        scalars = rr.Scalars.columns(scalars=values.astype(float))
        recording.send_columns(place, [time], scalars)
    recording.flush()
    content: bytes = stream.read() or b""
    return content


def _robot(rr: Any, recording: Any, scene: Scene) -> None:
    escape = rr.escape_entity_path_part
    for number, shape in enumerate(scene.look.shapes):
        for k, (part, colour) in enumerate(zip(shape.parts, shape.colours, strict=True)):
            mesh = trimesh.Trimesh(part.points, part.triangles)
            mesh.apply_transform(shape.placement)
            drawn = rr.Mesh3D(
                vertex_positions=mesh.vertices, triangle_indices=mesh.faces,
                vertex_normals=mesh.vertex_normals, albedo_factor=[int(255 * x) for x in colour],
            )  # fmt: skip
            recording.log(f"robot/{escape(shape.link)}/{number}_{k}", drawn, static=True)


def _forces(
    rr: Any, recording: Any, result: Result, scene: Scene, poses: np.ndarray, time: Any
) -> None:
    """Peak contact forces as arrows at their bearings, the largest of all as long as `ARROW`."""
    places = {joint.name: joint for joint in scene.joints if joint.play}
    longest = ARROW * scene.look.reach
    largest = float(np.linalg.norm(result["joint_force_peak"].values, axis=2).max(initial=0.0))
    for joint in result.joints:
        arrows = result["joint_force_peak"].sel(joint=joint).values * (longest / (largest or 1.0))
        at, link = places[joint].place.translation, places[joint].link
        origins = np.array([pin.XYZQUATToSE3(pose).act(at) for pose in poses[:, link]])
        place = f"force/{rr.escape_entity_path_part(joint)}"
        recording.log(place, rr.Arrows3D.from_fields(colors=[_RED]), static=True)
        vectors = rr.Arrows3D.columns(vectors=arrows, origins=origins)
        recording.send_columns(place, [time], vectors)
