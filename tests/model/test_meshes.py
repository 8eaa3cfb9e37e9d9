"""Surfaces of meshes: whole, joined, coloured, read once."""

import os

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from conftest import body, joint
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp
from jointplay import JointplayError
from jointplay.base import files
from jointplay.model import meshes
from jointplay.model.meshes import parts_of, surface
from jointplay.model.survey import survey
from jointplay.model.visuals import look, mesh_folders


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("JOINTPLAY_CACHE", str(tmp_path / "cache"))
    meshes._parts.cache_clear()
    yield
    meshes._parts.cache_clear()


def two_colours(path):
    """A Collada file of two boxes, red and blue, the second 1 m along x."""
    boxes = []
    for at, colour in ((0.0, [1.0, 0.0, 0.0, 1.0]), (1.0, [0.0, 0.0, 1.0, 1.0])):
        box = trimesh.creation.box((0.2, 0.2, 0.2))
        box.apply_translation((at, 0.0, 0.0))
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        box.visual = trimesh.visual.TextureVisuals(material=material)
        boxes.append(box)
    path.write_bytes(trimesh.exchange.dae.export_collada(boxes))
    return path


@given(st.integers(1, 40), st.integers(0, 9))
def test_surfaces_keep_their_triangles_and_name_points_in_order_of_use(m, seed):
    random = np.random.default_rng(seed)
    points = random.normal(size=(12, 3))
    triangles = np.array([random.choice(12, 3, replace=False) for _ in range(m)])
    part = surface(np.repeat(points, 2, axis=0), 2 * triangles + 1)  # every point twice
    assert np.allclose(part.corners(), points[triangles], atol=1e-4)
    used = part.triangles.reshape(-1)
    fresh = np.maximum.accumulate(np.concatenate([[-1], used[:-1]])) + 1
    assert (used <= fresh).all()
    assert len(part.points) == len(np.unique(used)) == len(np.unique(triangles))


def test_collada_has_all_its_parts_with_their_colours(tmp_path):
    parts = parts_of(two_colours(tmp_path / "two.dae"))
    assert len(parts) == 2
    middles = sorted(float(part.points[:, 0].mean()) for part in parts)
    assert middles == pytest.approx([0.0, 1.0], abs=1e-6)
    assert {part.colour[:3] for part in parts} == {(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)}


def test_a_mesh_is_read_once_and_again_when_it_changes(tmp_path, monkeypatch):
    path = tmp_path / "ball.stl"
    trimesh.creation.uv_sphere(0.1).export(path)
    read = []
    original = meshes._read
    monkeypatch.setattr(meshes, "_read", lambda path: read.append(path) or original(path))
    first = parts_of(path)
    meshes._parts.cache_clear()  # as in another process
    again = parts_of(path)
    assert len(read) == 1
    assert np.allclose(first[0].corners(), again[0].corners(), atol=1e-6)
    trimesh.creation.box((1, 1, 1)).export(path)
    assert len(parts_of(path)[0].triangles) == 12
    assert len(read) == 2


def test_a_damaged_cache_is_no_cache(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((1, 1, 1)).export(path)
    parts_of(path)
    (kept,) = (files.cache_folder() / meshes.FOLDER).glob("*.npz")
    kept.write_bytes(b"nothing")
    meshes._parts.cache_clear()
    assert len(parts_of(path)[0].triangles) == 12


def test_without_a_place_for_the_cache_all_works(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("JOINTPLAY_CACHE", str(tmp_path / "file"))
    path = tmp_path / "box.stl"
    trimesh.creation.box((1, 1, 1)).export(path)
    assert len(parts_of(path)[0].triangles) == 12


@pytest.mark.parametrize(("name", "content"), [("a.stl", b""), ("a.dae", b"<x/>"), ("a.ply", b"")])
def test_what_is_no_mesh_is_refused_in_one_line(name, content, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(jp.JointplayError, match=name) as error:
        parts_of(tmp_path / name)
    assert "\n" not in str(error.value)


def boxes(points):
    return np.array([points.min(axis=0), points.max(axis=0)])


def points_of(form):
    """Points of a shape of coal's, whose convex hull has its extent."""
    if isinstance(form, coal.BVHModelBase):
        return np.array(form.vertices()).reshape(-1, 3)
    if isinstance(form, coal.Box):
        return trimesh.creation.box(2.0 * form.halfSide).vertices
    if isinstance(form, coal.Cylinder):
        return trimesh.creation.cylinder(form.radius, 2.0 * form.halfLength, sections=40).vertices
    return trimesh.creation.uv_sphere(form.radius, count=[24, 24]).vertices


@pytest.mark.parametrize(
    "name",
    [
        *("ur5", "talos_left_arm"),
        *(
            pytest.param(name, marks=pytest.mark.thorough)
            for name in ("panda", "kinova", "z1", "tiago")
        ),
    ],
)
def test_shapes_stand_where_pinocchio_sees_them(name):
    """Units, axes and all parts of meshes: the room each link takes is what coal's loader finds."""
    mechanism = survey(name).mechanism
    path = str(mechanism.description.path)
    source = pin.buildModelFromUrdf(path)
    folders = [str(folder) for folder in mesh_folders(mechanism)]
    theirs = pin.buildGeomFromUrdf(source, path, pin.GeometryType.VISUAL, package_dirs=folders)
    places = {}
    for shape in theirs.geometryObjects:
        frame = source.frames[shape.parentFrame]
        place = frame.placement.actInv(shape.placement)
        points = points_of(shape.geometry) @ place.rotation.T + place.translation
        places.setdefault(frame.name, []).append(points)
    ours = look(mechanism)
    assert not ours.missing
    for link, points in places.items():
        own = [
            part.points @ shape.placement[:3, :3].T + shape.placement[:3, 3]
            for shape in ours.shapes
            if shape.link == link and not shape.stands_in
            for part in shape.parts
        ]
        if not own:  # a ball without size
            assert np.ptp(np.concatenate(points)) < 1e-9
            continue
        # A millimetre: round shapes have other facets here.
        assert boxes(np.concatenate(own)) == pytest.approx(boxes(np.concatenate(points)), abs=2e-3)


def test_colours_of_the_urdf_count_more_than_those_of_files(urdf, tmp_path):
    two_colours(tmp_path / "two.dae")
    mesh = '<visual><geometry><mesh filename="two.dae"/></geometry>{}</visual>'
    green = '<material name="g"><color rgba="0 1 0 1"/></material>'
    links = [body(n).replace("</link>", f"{mesh.format(c)}</link>") for n, c in
             (("a", ""), ("b", green))]  # fmt: skip
    path = urdf(*links, joint("one", "base", "a"), joint("two", "a", "b"))
    seen = look(jp.Mechanism(path))
    colours = {shape.link: {c[:3] for c in shape.colours} for shape in seen.shapes}
    assert colours == {"a": {(1, 0, 0), (0, 0, 1)}, "b": {(0, 1, 0)}}


def test_pipes_devices_and_giants_are_refused_before_they_are_read(tmp_path):
    pipe, giant, device = (tmp_path / name for name in ("pipe.stl", "giant.stl", "device.stl"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    with giant.open("wb") as file:
        file.truncate(meshes.MOST_BYTES + 1)
    for path, reason in (
        (pipe, "not a regular file"),
        (device, "not a regular file"),
        (giant, "at most 200"),
    ):
        with pytest.raises(JointplayError, match=reason):
            meshes.parts_of(path)


def test_what_a_mesh_names_is_read_as_carefully(tmp_path):
    os.mkfifo(tmp_path / "pipe.mtl")
    (tmp_path / "zero.mtl").symlink_to("/dev/zero")
    for name in ("pipe", "zero"):
        path = tmp_path / f"{name}.obj"
        path.write_text(f"mtllib {name}.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        (part,) = meshes.parts_of(path)
        assert len(part.triangles) == 1


def test_a_mesh_that_cannot_be_read_is_said_and_the_others_are_shown(tmp_path):
    (tmp_path / "bad.stl").write_bytes(b"no mesh")
    with pytest.warns(RuntimeWarning, match=r"a mesh is not shown: .*bad\.stl"):
        assert meshes.readable(tmp_path / "bad.stl") is None
