"""A picture of a mechanism: shaded shapes, marks at joints with clearance and loops, labels.

Matplotlib draws whole triangles from far to near, without a depth buffer. So bodies are cut into
small triangles first; then come rings and axes of joints, the tool's cross, and the labels, each
placed where it covers least.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pinocchio as pin
import trimesh
from matplotlib.cm import ScalarMappable
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform

from jointplay.base.errors import JointplayError
from jointplay.base.tables import few
from jointplay.model.loop import assemble
from jointplay.model.mechanism import Mechanism
from jointplay.model.scene import Scene

_LIGHT_DIRECTION = np.array([0.35, -0.6, 0.72])
"""Towards the light, in world axes: from above the viewer's left shoulder, for either view below
(judged; any that is no axis shows the faces of a box in three shades)."""
_UNCOLOURED = "#c9d3df"  # bodies to which the given colours assign none
_PLAY, _LOOP, _TOOL = "#d1352b", "#1f6fb4", "#222222"
_TYPE_PT = 8.0  # size of labels [points]
_Label = tuple[np.ndarray, str]  # points of a mark (n, 3) [m] and its text
_HALO = [withStroke(linewidth=3.0, foreground="white")]  # lets marks stand out on any colour
_CELL_PX = 4  # cell of the grids that keep labels off bodies (judged: a third of a letter) [pixels]
_NEAR_PT, _FAR_PT = 10.0, 160.0  # distances of labels from their marks [points] (judged)
_CROWDED, _CROSSED, _MARKED = 1e3, 30.0, 20.0
"""Costs of a cell of label on a label, of a leader line across a label and of a label on a mark, in
points of distance from the mark; each point of a body costs one (judged by pictures)."""
_RING_RADIUS = 0.06  # of a joint's ring, relative to the mechanism's size (judged)
_LONGEST_SIDE = 0.03
"""Longest side of a triangle, relative to the mechanism's size: matplotlib sorts whole triangles by
depth, so that long ones cover what is in front of them (judged by pictures of shipped robots)."""
_MANY_TRIANGLES = 2000
"""Triangles of a body from which on it is not cut, as its sides are short, but thinned: details too
small to be seen are left out (judged)."""
_SMALLEST_DETAIL = 1.0 / 300.0
"""Smallest detail that is drawn, relative to the mechanism's size: some two pixels."""
_FARTHEST_M = 1e6  # from the origin; shapes that reach farther are mistakes of scale (judged)
_ZOOM = 1.1  # of the box of axes, less where it would not fit into the picture
_SHRINKINGS, _MARGIN = 5, 0.01  # most times that the box is shrunk, and how much more (judged)
_MOST_NUMBERS = 1.8
"""Numbers along the longest axis for each inch of the picture's shorter side, of which it takes
0.6; numbers of 7 pt are 0.3 in wide (judged by pictures of the shipped robots)."""
_FLAT_HEIGHT = 0.4
"""Height over largest extent below which a mechanism is flat, and seen from further above. The
shipped linkages have 0.09 to 0.18, a UR5 that lies stretched out 0.22, the others 0.5 and more."""


@mpl.rc_context({"text.parse_math": False})  # names stand as they are, $ and all
def picture(
    mechanism: Mechanism,
    q: np.ndarray | None = None,
    *,
    title: str = "",
    view: tuple[float, float] | None = None,
    colours: Mapping[str, str] | None = None,
    scale: tuple[ScalarMappable, str] | None = None,
    labels: Mapping[str, str] | None = None,
    size_in: tuple[float, float] = (8.0, 5.5),
) -> Figure:
    """Draw a mechanism in a configuration, in parallel projection.

    Joints with clearance are marked by a ring about their axis, their name and their play; ideal
    loops likewise, in another colour. Simple shapes stand in for links without shapes and for
    missing meshes, which the picture names.

    Args:
        mechanism: what to draw.
        q: configuration, shape (nq,); None takes zero, with loops closed.
        title: above the picture.
        view: azimuth and elevation of the viewer [deg]; None looks from the side, and from further
            above where the mechanism is flat.
        colours: of bodies, by the name of the joint that carries them, as #rrggbb.
        scale: colour scale and its name, for a colour bar.
        labels: by joint, the text beside its mark instead of its play; joints without clearance are
            marked by a point.
        size_in: width and height [inches].

    Returns:
        A new figure; save it with its `savefig`.

    Raises:
        JointplayError: q of the wrong shape; loops that cannot be closed; a shape of a size that
            cannot be drawn.
    """
    if q is None:
        q = assemble(mechanism, np.zeros(mechanism.model.nq), [])
    q = np.asarray(q, float)
    if q.shape != (mechanism.model.nq,):
        raise JointplayError(
            f"q must have the shape ({mechanism.model.nq},): {', '.join(mechanism.coordinates)}; "
            f"got {q.shape}"
        )
    scene = Scene(mechanism)
    places = dict(zip(scene.links, map(pin.XYZQUATToSE3, scene.poses(q[None])[0]), strict=True))
    bodies, paints = _placed(scene, places, colours)
    points = np.concatenate(bodies).reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    if view is None:
        flat = high[2] - low[2] < _FLAT_HEIGHT * float((high - low).max())
        view = (-70.0, 55.0) if flat else (-60.0, 24.0)
    # Small triangles, whose depths matplotlib can sort.
    pieces, sides = zip(
        *(_coarse(_cut(body, _LONGEST_SIDE * size), _SMALLEST_DETAIL * size) for body in bodies),
        strict=True,
    )
    triangles, normals = np.concatenate(pieces), np.concatenate(sides)
    tones = [np.tile(tone, (len(piece), 1)) for tone, piece in zip(paints, pieces, strict=True)]

    figure = Figure(figsize=size_in, layout="constrained")
    axes: Any = figure.add_subplot(projection="3d", proj_type="ortho", computed_zorder=False)
    # Both sides of a triangle are shaded alike: mesh files differ in the winding of triangles.
    shade = 0.45 + 0.5 * np.abs(normals @ (_LIGHT_DIRECTION / np.linalg.norm(_LIGHT_DIRECTION)))
    faces = np.clip(np.concatenate(tones) * shade[:, None], 0.0, 1.0)
    look: dict[str, Any] = {"facecolors": faces, "edgecolors": faces, "linewidths": 0.2}
    axes.add_collection3d(Poly3DCollection(triangles, zorder=1, **look))
    # Marks: rings at joints with clearance and loops, points at others with labels, the tool.
    notes: list[_Label] = []
    for joint in scene.joints:
        if not joint.hinge:
            colour = (_PLAY if colours is None else _TOOL) if joint.play else _LOOP
            text = f"{joint.name}\n{joint.label}"
            if joint.play and labels is not None:
                text = labels.get(joint.name, joint.name)
            where = places[scene.links[joint.link]] * joint.place
            notes.append((_mark(axes, where, _RING_RADIUS * size, colour), text))
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    tool = mechanism.data.oMf[mechanism.tool_frame].translation
    marked = {joint.name for joint in scene.joints}
    for name, text in (labels or {}).items():
        if name not in marked:
            place = mechanism.data.oMi[mechanism.model.getJointId(name)].translation
            axes.plot(*place[:, None], "o", color=_TOOL, ms=5, zorder=5, path_effects=_HALO)
            notes.append((place[None], text))
    axes.plot(*tool[:, None], "+", color=_TOOL, ms=9, mew=1.5, zorder=5, path_effects=_HALO)
    notes.append((tool[None], mechanism.tool))
    # The box of axes, about as large as the picture allows from this view.
    room = 0.08 * float((high - low).max())
    low, high = low - room, high + room
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=_ZOOM)
    axes.view_init(azim=view[0], elev=view[1])
    corners = proj_transform(*np.array([*product(*zip(low, high, strict=True))]).T, axes.get_proj())
    reach = np.abs(axes.transLimits.transform(np.column_stack(corners[:2])) - 0.5).max() / 0.5
    zoom = _ZOOM / max(1.0, reach)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_zlabel("z [m]", labelpad=10.0)  # a short side's numbers stand farther out
    axes.tick_params(labelsize=7)
    shares = (high - low) / float((high - low).max())
    for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), shares, strict=True):
        # Few numbers along a short side, where they would cover each other.
        count = int(np.clip(_MOST_NUMBERS * min(size_in) * share, 1, 4))
        axis.set_major_locator(MaxNLocator(count, min_n_ticks=1))
        axis.pane.set_alpha(0.15)
    axes.set_title(title, fontsize=11)
    if scale is not None:
        figure.colorbar(scale[0], ax=axes, shrink=0.6, pad=0.1, label=scale[1])
    if missing := [Path(name).name for name in scene.look.missing]:
        text = f"not found, simple shapes instead: {few(missing, 3)}"
        figure.text(0.01, 0.01, text, fontsize=8)
    _make_room(axes, high - low, zoom)
    _write(axes, notes, triangles)
    return figure


def _make_room(axes: Any, sides: np.ndarray, zoom: float) -> None:
    """Shrink the box of axes until their names, which the layout leaves out, are in the figure.

    The names keep their distances from the box, so that it may take several times.
    """
    figure, names = axes.figure, [axis.label for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # it would move the axes into the room that is made
    for _ in range(_SHRINKINGS):
        boxes = [text.get_window_extent() for text in names]
        middle = np.mean(axes.bbox.get_points(), axis=0)
        low = (middle - np.min([box.min for box in boxes], axis=0)) / middle
        high = (np.max([box.max for box in boxes], axis=0) - middle) / (figure.bbox.size - middle)
        over = max(*low, *high)
        if over <= 1.0:
            return
        zoom /= over + _MARGIN
        axes.set_box_aspect(sides, zoom=zoom)
        figure.draw_without_rendering()


def _placed(
    scene: Scene, places: Mapping[str, pin.SE3], colours: Mapping[str, str] | None
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Triangles of every part in world axes (n, 3, 3) [m], and its colour (rgb)."""
    mechanism, bodies, paints = scene.mechanism, [], []
    for shape in scene.look.shapes:
        place = places[shape.link].homogeneous @ shape.placement
        frame = mechanism.model.getFrameId(shape.link, pin.FrameType.BODY)
        carrier = mechanism.owner(mechanism.model.frames[frame].parentJoint)
        for part, colour in zip(shape.parts, shape.colours, strict=True):
            bodies.append(part.corners() @ place[:3, :3].T + place[:3, 3])
            if not (np.abs(bodies[-1]) < _FARTHEST_M).all():
                raise JointplayError(
                    f"link {shape.link!r} has a shape that reaches beyond {_FARTHEST_M:g} m, and "
                    "cannot be drawn; see its scale"
                )
            shown = colour[:3]
            if colours is not None:
                shown = to_rgb(colours.get(carrier or "", _UNCOLOURED))
            paints.append(np.array(shown))
    return bodies, paints


def _coarse(triangles: np.ndarray, grid: float) -> tuple[np.ndarray, np.ndarray]:
    """A surface without details smaller than `grid`, which are not seen but take long to draw.

    Corners move to the points of a grid; triangles that degenerate or coincide there are left out.

    Returns:
        Triangles (n, 3, 3) [m], and the normal that each had before (n, 3).
    """
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    whole = np.round(triangles / grid)
    apart = (whole != np.roll(whole, 1, axis=1)).any(axis=2).all(axis=1)
    if len(triangles) < _MANY_TRIANGLES or not apart.any():
        return triangles, normals
    corners = np.ascontiguousarray(whole[apart]).view([("x", "f8"), ("y", "f8"), ("z", "f8")])
    _, first = np.unique(np.sort(corners[..., 0], axis=1), axis=0, return_index=True)
    return grid * whole[apart][first], normals[apart][first]


def _cut(triangles: np.ndarray, longest: float) -> np.ndarray:
    """The surface cut into triangles whose sides are no longer than `longest`."""
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    if not 0 < len(triangles) < _MANY_TRIANGLES or mesh.edges_unique_length.max() <= longest:
        return triangles
    points, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, longest, 12)
    return np.asarray(points)[faces]


def _mark(axes: Any, place: pin.SE3, radius: float, colour: str) -> np.ndarray:
    """Draw a ring about a joint's axis, and the axis; return points of both (n, 3) [m]."""
    phi = np.linspace(0.0, 2.0 * np.pi, 61)
    ring = np.column_stack([radius * np.cos(phi), radius * np.sin(phi), 0.0 * phi])
    axle = np.linspace(-1.5 * radius, 1.5 * radius, 31)[:, None] * [0.0, 0.0, 1.0]
    ring, axle = (line @ place.rotation.T + place.translation for line in (ring, axle))
    axes.plot(*ring.T, color=colour, lw=1.8, zorder=4, path_effects=_HALO)
    axes.plot(*axle[[0, -1]].T, color=colour, lw=1.0, ls="-.", zorder=4)
    return np.concatenate([ring, axle])


def _write(axes: Any, notes: Sequence[_Label], triangles: np.ndarray) -> None:
    """Write labels beside bodies, marks and each other, with a leader line from each to its mark.

    A greedy search on a grid of cells: the labels take their places one after the other, from the
    top down, each at the cheapest of the candidates about its mark: 24 directions, at distances
    from `_NEAR_PT` on in steps of 10 points.
    """
    figure = axes.figure
    figure.draw_without_rendering()  # lays the figure out, so that positions are final
    point = figure.dpi / 72.0

    def seen(points: np.ndarray) -> np.ndarray:
        """Projection of points (n, 3) [m] into the picture (n, 2) [pixels]."""
        flat = proj_transform(*points.T, axes.get_proj())[:2]
        pixels: np.ndarray = axes.transData.transform(np.column_stack(flat))
        return pixels

    # Two grids: cost of covering bodies and marks, and cells that texts and leader lines occupy.
    corners = np.concatenate([triangles.reshape(-1, 3), triangles.mean(axis=1)])
    across, up = (np.arange(0.0, size + _CELL_PX, _CELL_PX) for size in figure.bbox.size)
    at_x, at_y = seen(corners).T
    bodies = np.histogram2d(at_x, at_y, (across, up))[0]
    lettering = np.zeros_like(bodies)
    last = np.array(bodies.shape) - 1

    def cells(low: np.ndarray, high: np.ndarray) -> tuple[slice, slice]:
        """Cells of a box of the picture [pixels]."""
        start, stop = (np.maximum(corner // _CELL_PX, 0).astype(int) for corner in (low, high))
        return slice(start[0], stop[0] + 1), slice(start[1], stop[1] + 1)

    def at(points: np.ndarray) -> tuple[np.ndarray, ...]:
        """Cells of points (n, 2) [pixels]; a point outside the picture gets the nearest cell."""
        return tuple(np.clip(points // _CELL_PX, 0, last).astype(int).T)

    def along(start: np.ndarray, end: np.ndarray, count: int) -> tuple[np.ndarray, ...]:
        """Cells of `count` points on a line [pixels]."""
        return at(start + np.linspace(0.0, 1.0, count)[:, None] * (end - start))

    axles = (axes.xaxis, axes.yaxis, axes.zaxis)
    for axis in axles:
        start, end = axis.line.get_transform().transform(axis.line.get_xydata())
        bodies[along(start, end, 200)] += _MARKED
    numbers = [tick.label1 for axis in axles for tick in axis.get_major_ticks()]
    for text in (axes.title, *(axis.label for axis in axles), *numbers):
        box = text.get_window_extent()
        lettering[cells(box.min, box.max)] = 1.0
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    candidates = [(far, to) for far in np.arange(_NEAR_PT, _FAR_PT, 10.0) for to in directions]
    marks = [(seen(points), text) for points, text in notes]
    for outline, _ in marks:
        bodies[at(outline)] += _MARKED
    for outline, text in sorted(marks, key=lambda mark: -mark[0][:, 1].mean()):
        centre = outline.mean(axis=0)
        look: dict[str, Any] = {"fontsize": _TYPE_PT, "va": "center", "ha": "center", "zorder": 6.0}
        look |= {"path_effects": _HALO, "color": _TOOL}
        probe = axes.annotate(text, (0.0, 0.0), **look)
        half = 0.5 * np.array(probe.get_window_extent().size) + point
        probe.remove()
        best = np.inf, centre, centre, centre
        for far, to in candidates:
            middle = centre + far * point * to + half * np.clip(1.5 * to, -1.0, 1.0)
            low, high = middle - half, middle + half
            if (low < 0.0).any() or (high > figure.bbox.size).any():
                continue
            # The leader line joins the label's box and the nearest point of the mark.
            mark = outline[np.linalg.norm(outline - np.clip(outline, low, high), axis=1).argmin()]
            near, box = np.clip(mark, low, high), cells(low, high)
            crossed = lettering[along(near, mark, 20)].sum()
            cost = far + _CROWDED * lettering[box].sum() + bodies[box].sum() + _CROSSED * crossed
            if cost < best[0]:
                best = cost, middle, near, mark
        _, middle, near, mark = best
        lettering[cells(middle - half, middle + half)] = lettering[along(near, mark, 40)] = 1.0
        look |= {"xytext": (middle - mark) / point, "textcoords": "offset points"}
        lead = {"arrowstyle": "-", "color": _TOOL, "lw": 0.8, "shrinkA": 0.0, "shrinkB": 0.0}
        lead |= {"relpos": tuple(0.5 + 0.5 * (near - middle) / half), "path_effects": _HALO}
        tip = axes.transData.inverted().transform(mark)
        axes.annotate(text, tip, arrowprops=lead, in_layout=False, **look)
