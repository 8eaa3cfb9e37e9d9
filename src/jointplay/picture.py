"""A picture of a mechanism: its meshes shaded, joints with clearance and loops marked.

Parallel projection, so that lengths in a view can be measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from scipy.ndimage import gaussian_filter, zoom

from jointplay.errors import JointplayError, MissingName
from jointplay.loops import assemble
from jointplay.mechanism import Mechanism
from jointplay.raster import compose, rasterise
from jointplay.visuals import Visuals, surface, tessellate, visuals

VIEWS = {
    "3d": (-55.0, 22.0),
    "front": (0.0, 0.0),
    "side": (-90.0, 0.0),
    "top": (-90.0, 90.0),
}
"""Azimuth and elevation of the viewer [deg]: front from +x, side from -y, top from +z."""

View = str | tuple[float, float]

_PLAY, _LOOP, _JOINT, _TOOL = "#d1352b", "#1f6fb4", "0.35", "0.2"
_AXES = {"x": "#c0392b", "y": "#2e8b57", "z": "#2c5fb3"}
_SAMPLES = 2
"""Samples per pixel, each way."""
_DOTS_PER_INCH = 160.0
_KEY_LIGHT = np.array([-0.45, 0.65, 0.62])
"""Towards the main light, in the viewer's axes: right, up, to the viewer."""
_BONE = (0.55, 0.62, 0.70)
_TONES = ((0.86, 0.87, 0.89), (0.66, 0.71, 0.78))
"""Of bodies without colour, by turns, so that one can be told from the next."""
_RING, _WORLD_AXES, _TOOL_AXES = 0.075, 0.16, 0.08
"""Radius and lengths of marks, relative to the mechanism's size."""
_LABELS = 0.44
"""Room for names right of the first view, relative to its width."""


@dataclass(frozen=True)
class _Scene:
    corners: np.ndarray
    """World coordinates, shape (n, 3, 3) [m]."""
    colours: np.ndarray
    """Shape (n, 3)."""
    notes: tuple[str, ...]
    """What could not be shown."""

    @property
    def size(self) -> float:
        """Largest extent [m]."""
        points = self.corners.reshape(-1, 3)
        return float(np.ptp(points, axis=0).max())

    @property
    def ground(self) -> float:
        """Height of the lowest point [m]."""
        return float(self.corners[..., 2].min())


@dataclass(frozen=True)
class _Mark:
    name: str
    centre: np.ndarray
    axis: np.ndarray
    colour: str


def picture(
    mechanism: Mechanism,
    q: np.ndarray | None = None,
    *,
    view: View | Sequence[View] = ("3d", "side", "top"),
    names: bool = False,
    search: Sequence[str | Path] = (),
    title: str = "",
    width: float = 9.0,
) -> Figure:
    """Draw a mechanism as it stands.

    Joints with clearance are marked by a ring about their axis, their name and the room that the
    journal has; loops, the world's and the tool's axes are marked too. Links whose meshes cannot be
    found, and mechanisms without any visuals, are drawn as a skeleton, and the picture says so.

    Args:
        mechanism: what to draw.
        q: configuration, shape (nq,); None takes zero, with loops closed.
        view: one of `VIEWS`, or azimuth and elevation [deg]; or several, the first one large.
        names: mark and name the joints without clearance, too.
        search: folders with meshes, see `visuals`.
        title: above the picture.
        width: of the figure [inch]; its height follows from what is in it.

    Returns:
        A figure of its own; save it with its `savefig`.

    Raises:
        JointplayError: q of the wrong shape; loops that cannot be closed.
        MissingName: no such view.
    """
    views = _checked(view)
    if q is None:
        q = assemble(mechanism, np.zeros(mechanism.model.nq), [])
    q = np.asarray(q, float)
    if q.shape != (mechanism.model.nq,):
        raise JointplayError(
            f"q must have the shape ({mechanism.model.nq},): {', '.join(mechanism.coordinates)}; "
            f"got {q.shape}"
        )
    pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
    scene = _scene(mechanism, visuals(mechanism, search))
    marks = _marks(mechanism, names)
    panels = [_Panel.of(scene, marks, angles) for angles in views]
    shapes = [panel.shape for panel in panels]
    shapes[0] *= 1.0 / (1.0 + _LABELS)
    # The first view and the column of others shall be equally high.
    left, right = 1.0, 0.0
    if len(views) > 1:
        left = float(np.clip(sum(shapes[1:]) / shapes[0], 1.0, 3.0))
        right = 1.0
    height = width * left / (left + right) * shapes[0]
    if right:
        height = max(height, width * right / (left + right) * sum(shapes[1:]))
    height = float(np.clip(height + 0.3 * len(views) + 0.4, 2.5, 1.3 * width))
    figure = Figure(figsize=(width, height), layout="constrained")
    rows = max(1, len(views) - 1)
    ratios = [left, right][: len(views)]
    grid = figure.add_gridspec(
        rows, len(ratios), width_ratios=ratios, height_ratios=shapes[1:] or None
    )
    for number, panel in enumerate(panels):
        place = grid[:, 0] if number == 0 else grid[number - 1, 1]
        inches = width * (left / (1.0 + _LABELS) if number == 0 else right) / (left + right)
        axes = figure.add_subplot(place)
        _draw(axes, mechanism, scene, marks, panel, inches * _DOTS_PER_INCH, labelled=number == 0)
    if title:
        figure.suptitle(title, fontsize=11)
    if scene.notes:
        figure.supxlabel("; ".join(scene.notes), fontsize=7.5, color="0.3")
    return figure


def _checked(view: View | Sequence[View]) -> list[tuple[float, float]]:
    single = isinstance(view, str) or (len(view) == 2 and not isinstance(view[0], str | Sequence))
    found = []
    for one in [view] if single else view:
        if isinstance(one, str):
            if one not in VIEWS:
                raise MissingName("view", one, VIEWS)
            found.append(VIEWS[one])
        else:
            azimuth, elevation = one  # type: ignore[misc]
            found.append((float(azimuth), float(elevation)))  # type: ignore[arg-type]
    if not found:
        raise JointplayError(f"no view given; take {', '.join(VIEWS)} or (azimuth, elevation)")
    return found


def _scene(mechanism: Mechanism, found: Visuals) -> _Scene:
    """All triangles in world axes, after forward kinematics."""
    corners, colours = [], []

    def put(shape: np.ndarray, place: pin.SE3, colour: np.ndarray) -> None:
        corners.append(shape @ place.rotation.T + place.translation)
        colours.append(np.broadcast_to(colour, (len(shape), 3)))

    bodies = dict.fromkeys(thing.parentJoint for thing in found.geometry.geometryObjects)
    tones = {body: _TONES[number % len(_TONES)] for number, body in enumerate(bodies)}
    for thing in found.geometry.geometryObjects:
        place = mechanism.data.oMi[thing.parentJoint] * thing.placement
        shape, given = surface(thing)
        given = np.where(np.isnan(given), (*tones[thing.parentJoint], 1.0), given)
        put(shape[given[:, 3] > 0.05], place, given[given[:, 3] > 0.05, :3])
    notes = []
    bare = {link for link, _ in found.missing}
    if found.missing:
        files = list(dict.fromkeys(Path(file).name for _, file in found.missing))
        listed = ", ".join(files[:3]) + (f" and {len(files) - 3} more" if len(files) > 3 else "")
        notes.append(f"meshes not found: {listed}; these links are drawn as a skeleton")
    elif not found.links:
        notes.append("the URDF has no visuals: drawn as a skeleton")
    if not found.links:
        bare = set(mechanism.description.links)
    for shape, place in _bones(mechanism, bare):
        put(shape, place, np.array(_BONE))
    return _Scene(np.concatenate(corners), np.concatenate(colours), tuple(notes))


def _bones(mechanism: Mechanism, bare: set[str]) -> list[tuple[np.ndarray, pin.SE3]]:
    """Capsules from each of the links in `bare` to its joints; a ball where it has none."""
    data, model = mechanism.data, mechanism.model
    place = {
        link: data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
        for link in mechanism.description.links
    }
    ends: dict[str, list[np.ndarray]] = {link: [] for link in place}
    for joint in mechanism.description.joints.values():
        ends[joint.parent].append(place[joint.child].translation)
    for loop in mechanism.loops.values():
        for link, there in ((loop.bearing_link, loop.bearing), (loop.journal_link, loop.journal)):
            ends[link].append((place[link] * there).translation)
    points = np.array([end for link in place for end in [place[link].translation, *ends[link]]])
    radius = 0.025 * max(float(np.ptp(points, axis=0).max()), 1e-3)
    found = []
    for link in bare:
        start = place[link].translation
        for end in [*ends[link], start]:
            length = float(np.linalg.norm(end - start))
            turn = np.eye(3)
            if length > 0.0:
                turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), end - start).matrix()
            middle = pin.SE3(turn, (start + end) / 2)
            found.append((tessellate(coal.Capsule(radius, length), 24), middle))
    return found


def _marks(mechanism: Mechanism, names: bool) -> list[_Mark]:
    found = []
    plain = [n for n in mechanism.joints if n not in mechanism.clearance] if names else []
    loops = [n for n in mechanism.loops if n not in mechanism.clearance]
    for name in [*mechanism.clearance, *loops, *plain]:
        index, bearing = mechanism.bearing_frame(name)
        place = mechanism.data.oMi[index] * bearing
        axis, colour, label = place.rotation[:, 2], _JOINT, name
        if name in mechanism.clearance:
            colour = _PLAY
            label = f"{name}: clearance {mechanism.clearance[name].radial_room * 1e3:.3g} mm"
        elif name in mechanism.loops:
            colour, label = _LOOP, f"{name} (loop)"
        if name in mechanism.clearance and name in mechanism.loops:
            label += " (loop)"
        if name in plain:
            joint = mechanism.model.joints[mechanism.model.getJointId(name)]
            motion = mechanism.data.oMi[joint.id].act(_axis_of(joint))
            axis = motion.angular if np.any(motion.angular) else motion.linear
        found.append(_Mark(label, place.translation, axis, colour))
    return found


def _axis_of(joint: Any) -> pin.Motion:
    data = joint.createData()
    joint.calc(data, np.zeros(joint.nq), np.zeros(joint.nv))
    return pin.Motion(np.asarray(data.S).reshape(6, -1)[:, 0])


@dataclass(frozen=True)
class _Camera:
    """Parallel projection: rows right, up and towards the viewer."""

    axes: np.ndarray

    @classmethod
    def at(cls, azimuth: float, elevation: float) -> _Camera:
        a, e = np.radians([azimuth, elevation])
        viewer = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(np.array([right, np.cross(viewer, right), viewer]))

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return points @ self.axes.T

    def world_axes(self) -> tuple[str, str] | None:
        """Names of the world's axes that point right and up, if they do."""
        found = [
            next((n for n, e in zip("xyz", np.eye(3), strict=True) if row @ e > 1.0 - 1e-9), None)
            for row in self.axes[:2]
        ]
        return (found[0], found[1]) if found[0] and found[1] else None


@dataclass(frozen=True)
class _Panel:
    """A view, and what it must have room for."""

    camera: _Camera
    low: np.ndarray
    """Lower left corner, in the camera's axes [m]."""
    high: np.ndarray
    oblique: bool
    """The ground is seen, neither edge-on nor squarely."""

    @property
    def shape(self) -> float:
        """Height over width."""
        width, height = self.high - self.low
        return float(height / width)

    @classmethod
    def of(cls, scene: _Scene, marks: Sequence[_Mark], angles: tuple[float, float]) -> _Panel:
        camera, size = _Camera.at(*angles), scene.size
        oblique = 1.0 < angles[1] < 89.0
        points = [camera(scene.corners).reshape(-1, 3)]
        points += [camera(_ring(mark, _RING * size)) for mark in marks]
        points.append(camera(_WORLD_AXES * size * np.vstack([np.zeros(3), np.eye(3)])))
        if oblique:
            points += [camera(line) for line in _grid(scene)]
        joined = np.concatenate(points)[:, :2]
        margin = 0.03 * size
        return cls(camera, joined.min(axis=0) - margin, joined.max(axis=0) + margin, oblique)


def _draw(
    axes: Any,
    mechanism: Mechanism,
    scene: _Scene,
    marks: Sequence[_Mark],
    panel: _Panel,
    pixels: float,
    labelled: bool,
) -> None:
    camera, low, high, size = panel.camera, panel.low, panel.high, scene.size
    shadow = scene.corners.copy()
    shadow[..., 2] = scene.ground
    density = _SAMPLES * pixels / float(high[0] - low[0])
    image, near = _render(
        camera(scene.corners),
        camera(shadow) if panel.oblique else None,
        scene.colours,
        low,
        high,
        density,
    )
    axes.imshow(
        image, extent=(low[0], high[0], low[1], high[1]), zorder=2, interpolation="antialiased"
    )
    if panel.oblique:
        lines = [camera(line)[:, :2] for line in _grid(scene)]
        axes.add_collection(LineCollection(lines, colors="0.86", linewidths=0.6, zorder=1))

    def hidden(points: np.ndarray) -> np.ndarray:
        column, row = ((points[:, 0] - low[0]) * density, (high[1] - points[:, 1]) * density)
        inside = near[
            np.clip(row.astype(int), 0, near.shape[0] - 1),
            np.clip(column.astype(int), 0, near.shape[1] - 1),
        ]
        return np.asarray(inside > points[:, 2] + 1e-3 * size)

    for mark in marks:
        radius = _RING * size * (0.6 if mark.colour == _JOINT else 1.0)
        _show(axes, camera(_ring(mark, radius)), mark.colour, hidden)
        line = camera(mark.centre + np.outer(np.linspace(-0.14, 0.14, 60) * size, mark.axis))
        axes.plot(*line[:, :2].T, color=mark.colour, lw=0.8, ls=(0, (9, 3, 2, 3)), zorder=6)
    tool = mechanism.data.oMf[mechanism.tool_frame]
    _triad(axes, camera, pin.SE3.Identity(), _WORLD_AXES * size, letters=True)
    _triad(axes, camera, tool, _TOOL_AXES * size, letters=False)
    width = high[0] - low[0]
    axes.set_xlim(low[0], high[0] + (_LABELS * width if labelled else 0.0))
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    if labelled:
        items = [(m.name, camera(m.centre), m.colour) for m in marks]
        items.append((f"tool: {mechanism.tool}", camera(tool.translation), _TOOL))
        _labels(axes, items, float(high[0]), (low, high))
    _scale(axes, camera, low, high)


def _render(
    seen: np.ndarray,
    shadow: np.ndarray | None,
    colours: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    density: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Picture as RGBA, and how near what it shows is."""
    width, height = (int(n) // _SAMPLES * _SAMPLES for n in np.ceil((high - low) * density))

    def pixels(points: np.ndarray) -> np.ndarray:
        placed = points.copy()
        placed[..., 0] = (points[..., 0] - low[0]) * density
        placed[..., 1] = (high[1] - points[..., 1]) * density
        return np.ascontiguousarray(placed)

    near, shown = rasterise(pixels(seen), width, height)
    normals = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    normals *= np.where(normals[:, 2] < 0.0, -1.0, 1.0)[:, None]  # meshes are not always oriented
    light = _KEY_LIGHT / np.linalg.norm(_KEY_LIGHT)
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    key = np.clip(normals @ light, 0.0, None)
    fill = np.clip(normals @ [0.75, 0.1, 0.65], 0.0, None)
    shine = np.clip(normals @ half, 0.0, None) ** 40
    strength = 0.42 + 0.55 * key + 0.12 * fill
    lit = np.clip((0.09 + 0.91 * colours) * strength[:, None] + 0.10 * shine[:, None], 0.0, 1.0)
    image = compose(near, shown, lit, normals, 14.0 / density, _SAMPLES)
    if shadow is not None:
        # Blurred anyway: coarse pixels will do.
        coarse = 4 * _SAMPLES
        flat = pixels(shadow) / [coarse, coarse, 1.0]
        _, dark = rasterise(flat, -(-width // coarse), -(-height // coarse))
        soft = gaussian_filter((dark >= 0).astype(float), 0.006 * dark.shape[0])
        soft = zoom(soft, coarse // _SAMPLES, order=1, mode="nearest", grid_mode=True)
        opaque = 0.22 * soft[: image.shape[0], : image.shape[1]]
        alpha = image[..., 3] + opaque * (1.0 - image[..., 3])
        image[..., :3] *= (image[..., 3] / np.maximum(alpha, 1e-9))[..., None]
        image[..., 3] = alpha
    return image, near


def _ring(mark: _Mark, radius: float) -> np.ndarray:
    u = np.cross(mark.axis, np.eye(3)[np.argmin(np.abs(mark.axis))])
    u /= np.linalg.norm(u)
    phi = np.linspace(0.0, 2.0 * np.pi, 121)
    v = np.cross(mark.axis, u)
    return mark.centre + radius * (np.outer(np.cos(phi), u) + np.outer(np.sin(phi), v))


def _show(axes: Any, ring: np.ndarray, colour: str, hidden: Any) -> None:
    """Strong where it is in front, faint where a body hides it."""
    flat = ring[:, :2]
    pieces = np.stack([flat[:-1], flat[1:]], axis=1)
    behind = hidden(0.5 * (ring[1:] + ring[:-1]))
    for which, alpha, width in ((behind, 0.35, 1.2), (~behind, 1.0, 2.2)):
        axes.add_collection(
            LineCollection(
                pieces[which],
                colors=colour,
                alpha=alpha,
                linewidths=width,
                zorder=5,
                capstyle="round",
            )
        )


def _triad(axes: Any, camera: _Camera, place: pin.SE3, length: float, letters: bool) -> None:
    start = camera(place.translation)
    for column, (letter, colour) in enumerate(_AXES.items()):
        end = camera(place.translation + length * place.rotation[:, column])
        if np.hypot(*(end - start)[:2]) < 0.05 * length:
            continue
        axes.annotate(
            "",
            xy=end[:2],
            xytext=start[:2],
            zorder=7,
            arrowprops={
                "arrowstyle": "-|>,head_width=0.16,head_length=0.32",
                "color": colour,
                "lw": 1.4,
                "shrinkA": 0,
                "shrinkB": 0,
            },
        )
        if letters:
            beyond = start[:2] + 1.18 * (end - start)[:2]
            axes.text(
                *beyond,
                letter,
                color=colour,
                ha="center",
                va="center",
                fontsize=8,
                fontweight="bold",
                zorder=8,
                path_effects=[withStroke(linewidth=2, foreground="white")],
            )


def _grid(scene: _Scene) -> list[np.ndarray]:
    """Lines of squares on the ground below the mechanism, shape (2, 3) each."""
    cell = _round_length(0.25 * scene.size)
    points = scene.corners.reshape(-1, 3)[:, :2]
    low, high = np.floor(points.min(0) / cell) * cell, np.ceil(points.max(0) / cell) * cell
    lines = []
    for axis in (0, 1):
        for at in np.arange(low[axis], high[axis] + 0.5 * cell, cell):
            ends = np.full((2, 3), scene.ground)
            ends[:, axis] = at
            ends[:, 1 - axis] = low[1 - axis], high[1 - axis]
            lines.append(ends)
    return lines


def _labels(
    axes: Any, items: list[tuple[str, np.ndarray, str]], edge: float, box: tuple[Any, Any]
) -> None:
    """Names in a column right of the picture, in the order of height, led to what they name."""
    low, high = box
    items = sorted(items, key=lambda item: -item[1][1])
    gap = 0.07 * (high[1] - low[1])
    heights: list[float] = []
    for _, point, _ in items:
        wanted = float(point[1])
        heights.append(wanted if not heights else min(wanted, heights[-1] - gap))
    short = low[1] + 0.12 * (high[1] - low[1]) - heights[-1]
    if short > 0.0:  # the column reaches below the picture: shift it up, keeping its order
        for k in reversed(range(len(heights))):
            floor = low[1] + 0.12 * (high[1] - low[1]) + gap * (len(heights) - 1 - k)
            heights[k] = max(heights[k], floor)
    for (name, point, colour), height in zip(items, heights, strict=True):
        axes.annotate(
            name,
            xy=point[:2],
            xytext=(edge, height),
            color=colour,
            fontsize=8,
            va="center",
            zorder=9,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "lw": 0.6,
                "shrinkA": 2,
                "shrinkB": 0,
                "alpha": 0.8,
                "relpos": (0, 0.5),
            },
        )


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(n for n in (1.0, 2.0, 5.0) if n * power <= length * (1 + 1e-9)))


def _scale(axes: Any, camera: _Camera, low: np.ndarray, high: np.ndarray) -> None:
    """Axes in metres where the view is along one of the world's axes, a scale bar elsewhere."""
    along = camera.world_axes()
    if along is not None:
        axes.set_xlabel(f"{along[0]} [m]", fontsize=8)
        axes.set_ylabel(f"{along[1]} [m]", fontsize=8)
        axes.tick_params(labelsize=7, colors="0.3")
        axes.grid(True, color="0.92", linewidth=0.5, zorder=0)
        axes.set_axisbelow(True)
        for side in axes.spines.values():
            side.set_color("0.8")
        return
    axes.set_axis_off()
    length = _round_length(0.3 * float(high[0] - low[0]))
    right = axes.get_xlim()[1] - 0.03 * float(high[0] - low[0])
    height = low[1] + 0.03 * (high[1] - low[1])
    axes.plot(
        [right - length, right], [height] * 2, color="0.15", lw=2.5, solid_capstyle="butt", zorder=9
    )
    axes.text(
        right - length / 2,
        height,
        f"{length:g} m\n",
        ha="center",
        va="center",
        fontsize=8,
        zorder=9,
    )
