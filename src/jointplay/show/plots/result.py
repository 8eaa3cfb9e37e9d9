"""`result.plot`: each quantity of a run as a panel, drawn as a figure or into given axes.

A method of `Plots` describes its panel as data; the decorator `_drawn` makes it draw that panel,
and `Plots.panel` returns it undrawn, for charts of several results and for pages.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base.errors import JointplayError, MissingName, require_known
from jointplay.base.units import round_below
from jointplay.physics.geometry import Form, Mode
from jointplay.show.plots.chart import Axis, Curve, Panel, Rule, Spans, outline
from jointplay.show.plots.names import MODE_TERMS, MODES, form_name
from jointplay.show.plots.palette import (
    AXIS_COLOURS,
    BLUE,
    CONTACT_COLOURS,
    GREEN,
    MODE_COLOURS,
    ORANGE,
    look_of,
)
from jointplay.simulation import analysis
from jointplay.simulation.result.result import AXES, Result
from jointplay.simulation.result.variables import TERMS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TICKS = 5
"""Most intervals between ticks of an orbit's axes: so few fit beside two further orbits."""
_DRAWN_DEPTH = 0.15
"""Drawn depth, relative to the clearance, to which a rim's penetration is magnified (its 99 %
quantile)."""
_RIM_EDGE = 1.5  # radius at which deeper penetration is cut off, relative to the clearance
_RIM_COLOURS = (ORANGE, GREEN, MODE_COLOURS[2])  # by mode; points need more contrast than bars
_MARKERS = "o^sDvP*"

ALWAYS = ("displacement", "velocity", "path", "coordinates", "forces", "energy", "spectrum")
"""Plots that exist for every run."""
NEED_CLEARANCE = ("orbit", "contacts", "gaps", "modes", "tilt", "impacts")
"""Plots that exist for every run with clearance."""

_HISTORIES = {
    "q": ("position", {"rad": "rad", "m": "m"}),
    "v": ("velocity", {"rad": "rad/s", "m": "m/s"}),
    "drive": ("drive", {"rad": "N*m", "m": "N"}),
}
"""Histories of coordinates: their names, and units by the unit of the coordinate."""

_ENERGIES = {
    "kinetic_energy": "kinetic",
    "potential_energy": "potential",
    **{term.variable: term.label for term in TERMS},
    "payload_energy": "brought in by payloads",
    "load_energy": "stored in loads",
    "load_work": "work of loads",
    "energy_residual": "error of the balance",
}
TIME = Axis("time", "s")


def _drawn(width: float = 6.0, height: float = 3.2) -> Callable[..., Callable[..., Figure]]:
    """A decorator that lets a method which describes a panel draw it in a figure [inches].

    The drawing method also takes `ax`, `style` and matplotlib's options.
    """

    def decorate(describe: Callable[..., Panel]) -> Callable[..., Figure]:
        named = inspect.signature(describe).parameters

        @wraps(describe)
        def drawing(
            self: Plots, *args: Any, ax: Any = None, style: str = "screen", **options: Any
        ) -> Figure:
            from jointplay.show.plots import draw  # pages need no matplotlib
            from jointplay.show.plots import style as look

            own = {name: options.pop(name) for name in named if name in options}
            panel = describe(self, *args, **own)
            if ax is not None:
                draw.draw_panel(panel, ax, **options)
                look.literal(ax)
                return look.figure_of(ax)
            rows = panel.y.rows  # a timeline is as high as its rows' labels need
            high = 0.9 + 0.24 * "\n".join(rows).count("\n") + 0.24 if rows else height
            with look.style(style):
                figure = look.new_figure(width, high, style)
                draw.draw_panel(panel, figure.subplots(), **options)
            return figure

        return drawing

    return decorate


class Plots:
    """Plots of one result. Each method returns its figure, and also takes these keywords.

    Args:
        ax: axes to draw into, which keep their own style; None makes a figure.
        style: ``screen`` or ``paper`` (serif, 88 mm wide) for a figure made here.

    Further keywords go to the drawn lines: ``color``, ``lw``, ``label``, ``alpha`` ...

    Raises:
        JointplayError: the result has no such plot; the message names those that it has.
        MissingName: no such joint, axis or style.
    """

    def __init__(self, result: Result) -> None:
        self.result = result

    def __repr__(self) -> str:
        return f"<plots of a result: {', '.join(self.available)}>"

    @property
    def available(self) -> tuple[str, ...]:
        """Names of the plots that this result has."""
        result, joints = self.result, self.result.joints
        further = {
            "rims": any(analysis.has_rims(result, joint) for joint in joints),
            "loaded": any(analysis.rolls(result, joint) for joint in joints),
            "forms": bool(joints) and bool((result["form"] >= 0).any()),
            "deviation": analysis.has_play(result),
        }
        names = ALWAYS + (NEED_CLEARANCE if joints else ())
        return (*names, *(name for name, there in further.items() if there))

    def panel(self, name: str, *args: Any, **options: Any) -> Panel:
        """A plot's panel as data, for charts of several results and for pages."""
        described: Panel = getattr(Plots, name).__wrapped__(self, *args, **options)
        return described

    @_drawn(4.8, 5.0)
    def orbit(self, joint: str | None = None) -> Panel:
        """Orbit of the journal's centre in its clearance circle, bearing frame [mm] (Fig. 12).

        For a rolling bearing, the inner ring's centre in the outer ring's frame [µm].
        """
        name = self._joint("orbit", joint)
        ring = analysis.rolls(self.result, name)
        x, y = self._plane(ring)
        centre = self.result["journal_centre"].sel(joint=name).values
        room = analysis.clearance_outline(self.result, name)
        marks, title = [], f"{name}, no play across" if ring else ""
        if room is not None:
            factor, unit = x.shown
            marks.append(outline(*room))
            shape = "circle" if room.shape[1] > 5 else "rectangle"
            size = f"{factor * room[0].max():{'.3g' if ring else 'g'}}"
            title = f"{name}, clearance {shape}, ±{size} {unit}"
        time = self.result.time
        first = int(np.searchsorted(time, self.result.judge_from))

        def path(part: slice, **look: Any) -> Curve:
            across, up = centre[part, :2].T
            return Curve(across, up, at=time[part], width=0.5, **look)

        if first:  # the time that is not judged, in grey
            marks.append(path(slice(first + 1), colour="#cccccc", frame=True))
        return Panel(x, y, [*marks, path(slice(first, None))], title, equal="box")

    @staticmethod
    def _plane(ring: bool, **limits: Any) -> tuple[Axis, Axis]:
        """Axes across a bearing; for the rings of a rolling bearing in a smaller unit."""
        frame, size = ("outer ring's", "fine") if ring else ("bearing", "")
        x, y = (
            Axis(f"{axis} in the {frame} frame", "m", size, ticks=_TICKS, **limits) for axis in "xy"
        )
        return x, y

    @_drawn(4.8, 5.2)
    def rims(self, joint: str | None = None) -> Panel:
        """Centre of the rim that is nearer to the bore, by the joint's mode (Fig. 12) [mm].

        It is drawn as far inside the clearance circle as its gap to the bore is wide, and
        penetration as far outside, magnified. Records that are not judged are left out.

        Raises:
            JointplayError: the journal is not a cylinder.
        """
        name = self._joint("rims", joint)
        if not analysis.has_rims(self.result, name):
            raise JointplayError(
                f"plot 'rims' is of cylindrical journals, and that of joint {name!r} is none; "
                "plot its orbit"
            )
        judged = self.result.time >= self.result.judge_from
        gaps = self.result["gap"].sel(joint=name).values[judged, :2]
        nearer, record = gaps.argmin(axis=1), np.arange(len(gaps))
        gap = gaps[record, nearer]
        across = analysis.rim_centres(self.result, name)[:, judged, :2][nearer, record]
        mode = self.result["mode"].sel(joint=name).values[judged]
        room = analysis.clearance_outline(self.result, name)
        assert room is not None  # a cylinder's is a circle
        clearance = float(room.max())
        # The radius drawn is the clearance less the gap, of which the negative part is magnified so
        # that all but 1 % of penetration stays within `_DRAWN_DEPTH`.
        deep = np.quantile(-gap[gap < 0.0], 0.99) if (gap < 0.0).any() else clearance
        factor = max(1.0, round_below(_DRAWN_DEPTH * clearance / deep))
        radius = clearance - np.where(gap < 0.0, factor * gap, gap)
        radius = np.minimum(radius, _RIM_EDGE * clearance)
        far = np.linalg.norm(across, axis=1)
        drawn = across * np.divide(radius, far, out=np.ones_like(far), where=far > 0.0)[:, None]
        marks = [outline(*room)]
        for kind in reversed(Mode):
            label = f"{MODE_TERMS[kind]} ({MODES[kind]})"
            x, y = drawn[mode == kind].T
            marks.append(Curve(x, y, label, _RIM_COLOURS[kind], line="", marker="o", size=1.0))
        edge = 1.05 * _RIM_EDGE * clearance
        title = f"{name}, nearer rim, penetration × {factor:g}"
        return Panel(*self._plane(False, low=-edge, high=edge), marks, title, equal="box")

    @_drawn()
    def contacts(self, joint: str | None = None) -> Panel:
        """Largest normal force at each of the joint's contacts since the last record [N].

        For a rolling bearing, the load of the most loaded element.
        """
        name = self._joint("contacts", joint)
        ring = analysis.rolls(self.result, name)
        axis = Axis("largest element load" if ring else "normal force", "N")
        return self._of_contacts("normal_force_peak", name, axis)

    @_drawn()
    def loaded(self, joint: str | None = None) -> Panel:
        """Number of balls or rollers that bear load, over time; by default of the first bearing."""
        rolling = (name for name in self.result.joints if analysis.rolls(self.result, name))
        name = self._joint("loaded", joint or next(rolling, None))
        if not analysis.rolls(self.result, name):
            raise JointplayError(
                f"plot 'loaded' is of rolling bearings, and joint {name!r} has none"
            )
        values = self.result["loaded_elements"].sel(joint=name).values
        marks = [Curve(self.result.time, values, steps=True)]
        return Panel(TIME, Axis("loaded elements", low=0.0, whole=True), marks)

    @_drawn()
    def gaps(self, joint: str | None = None) -> Panel:
        """Smallest gap at each of the joint's contacts since the last record; < 0: overlap [mm]."""
        name = self._joint("gaps", joint)
        axis = Axis("gap", "m")
        if analysis.rolls(self.result, name):
            axis = Axis("least gap of elements", "m", "fine")
        return self._of_contacts("gap_min", name, axis).with_marks(Rule(0.0))

    @_drawn()
    def modes(self, joint: str | None = None) -> Panel:
        """Timeline of the joint's contact mode (Table 1), with the share of time in each."""
        name = self._joint("modes", joint)
        shares = list(analysis.time_fractions(self.result, name).values())
        modes, texts = list(Mode), list(MODES)
        if analysis.rolls(self.result, name):
            modes, texts = [modes[0], modes[2]], ["no element\nloaded", "elements\nloaded"]
        rows = [
            f"{text}\n{100 * shares[int(mode)]:.1f} %"
            for text, mode in zip(texts, modes, strict=True)
        ]
        return self._timeline("mode", name, modes, rows, [MODE_COLOURS[mode] for mode in modes])

    @_drawn()
    def forms(self, joint: str | None = None) -> Panel:
        """Timeline of the contact forms that occurred (Figure 2), with their shares of the time."""
        name = self._joint("forms", joint)
        shares = analysis.time_fractions(self.result, name, "form")
        if not shares:
            raise JointplayError(
                f"Figure 2 has no forms for a joint such as {name!r}; plot its modes or contacts"
            )
        occurred = [form for form in Form if shares[form.name.lower()] > 0.0]
        rows = [f"{form_name(f)}, {100 * shares[f.name.lower()]:.1f} %" for f in occurred]
        return self._timeline("form", name, occurred, rows, [BLUE] * len(rows))

    def _timeline(
        self, variable: str, joint: str, members: Sequence[int], rows: list[str], colours: list[str]
    ) -> Panel:
        """A row for each member, filled while the variable equals it."""
        time, values = self.result.time, self.result[variable].sel(joint=joint).values
        marks = [
            Spans(*spans(time, values == int(member)), row, rows[row].partition("\n")[0], colour)
            for row, (member, colour) in enumerate(zip(members, colours, strict=True))
        ]
        x = Axis("time", "s", low=float(time[0]), high=float(time[-1]))
        return Panel(x, Axis(rows=rows), marks)

    @_drawn()
    def tilt(self, joint: str | None = None) -> Panel:
        """Angle between the axes of journal and bearing, or of both rings, over time [mrad]."""
        values = self.result["tilt"].sel(joint=self._joint("tilt", joint)).values
        return Panel(TIME, Axis("tilt", "rad"), [Curve(self.result.time, values)])

    @_drawn(5.0, 3.6)
    def impacts(self, joint: str | None = None, start: float | None = None) -> Panel:
        """Peak normal force [N] of every contact over its duration [ms], by place.

        Contacts before `start` [s] are left out.
        """
        name = self._joint("impacts", joint)
        dot: dict[str, Any] = {"line": "", "size": 3.5, "opacity": 0.8}
        places = [place for place in analysis.contacts(self.result, start) if place.joint == name]
        marks = []
        for i, place in enumerate(places):
            label = f"{place.contact.replace('_', ' ')}, {len(place.peak)}"
            look = dot | {"colour": look_of(i)["colour"], "marker": _MARKERS[i % len(_MARKERS)]}
            marks.append(Curve(place.duration, place.peak, label, **look))
        ring = analysis.rolls(self.result, name)
        log = any(len(mark.x) for mark in marks)
        x = Axis(f"duration of the {'load' if ring else 'contact'}", "s", "fine", log=log)
        y = Axis("peak element load" if ring else "peak normal force", "N", log=log)
        return Panel(x, y, marks, columns=2)

    @_drawn()
    def displacement(self, axis: str | None = None) -> Panel:
        """Tool position over time along world `axis` x, y, z (None: all) [m] (Figure 9)."""
        values = self.result["tool_position"].values
        return self._components(values, axis, Axis("displacement", "m", "large"))

    @_drawn()
    def velocity(self, axis: str | None = None) -> Panel:
        """Tool velocity over time along world `axis` x, y, z, total (None: all) [m/s] (Fig. 10)."""
        return self._components(self.result["tool_velocity"].values, axis, Axis("velocity", "m/s"))

    @_drawn()
    def deviation(self, axis: str | None = None, *, of: str = "tool_position") -> Panel:
        """The tool's difference from the ideal robot over time [mm, mm/s, mrad, mrad/s].

        Args:
            axis: x, y, z, total, or None for x, y and z.
            of: one of `analysis.tool_error.TOOL_MOTIONS`.
        """
        if not analysis.has_play(self.result):
            raise JointplayError(
                "plot 'deviation' needs clearance or a gear with play, and this run has neither; "
                f"it can plot {', '.join(self.available)}"
            )
        error = analysis.deviation(self.result, of)
        unit = str(error.attrs["units"])
        shown = Axis("deviation", unit, "fine" if unit.endswith("/s") else "")
        return self._components(error.values, axis, shown, error["time"].values)

    @_drawn(4.6, 4.4)
    def path(self, plane: str = "xy") -> Panel:
        """Tool path in the world plane `plane`, two of x, y, z [m] (Figure 11)."""
        if len(plane) != 2 or plane[0] == plane[1] or not set(plane) <= set(AXES):
            raise MissingName("plane", plane, ("xy", "xz", "yz"))
        across, up = (self.result["tool_position"].sel(axis=a).values for a in plane)
        x, y = (Axis(axis, "m", "large") for axis in plane)
        return Panel(x, y, [Curve(across, up, at=self.result.time)], equal="data")

    @_drawn()
    def spectrum(
        self, axis: str | None = None, *, of: str = "acceleration", start: float | None = None
    ) -> Panel:
        """Power spectral density of the tool's vibration; see `analysis.spectrum`.

        Args:
            axis: x, y, z, total, or None for x, y and z.
            of: ``acceleration``, ``acceleration_error`` or ``deviation``.
            start: records before this are left out [s]; None: before the run is judged.
        """
        density = analysis.spectrum(self.result, of, start)
        frequency = density["frequency"].values[1:]
        marks = [
            Curve(frequency, values, **look)
            for name, look in _axes_of(axis).items()
            if (values := density.sel(axis=name).values[1:]).any()  # else it does not move this way
        ]
        about = of.replace("_", " ")
        y = Axis(f"PSD of {about}{f' {axis}' if axis else ''}", density.attrs["units"], log=True)
        return Panel(Axis("frequency", "Hz", log=True), y, marks, columns=0 if axis else 3)

    @_drawn()
    def coordinates(self, names: Sequence[str] | str | None = None, *, of: str = "q") -> Panel:
        """Generalised coordinates, their rates or their drives' efforts over time.

        Args:
            names: of coordinates, all of them with the same unit; None takes those of the joints
                without clearance that turn, or if there are none those that slide.
            of: ``q`` [rad or m], ``v`` [rad/s or m/s] or ``drive`` [N m or N].
        """
        require_known("history of coordinates", of, _HISTORIES)
        names_, units_ = (self.result[v].values for v in ("coordinate", "coordinate_unit"))
        unit = {str(name): str(of) for name, of in zip(names_, units_, strict=True)}
        if names is None:  # coordinates of a joint with clearance have a dot in their names
            ideal = [name for name in unit if "." not in name] or list(unit)
            names = [name for name in ideal if unit[name] == "rad"] or ideal
        names = [names] if isinstance(names, str) else list(names)
        for name in names:
            require_known("coordinate", name, unit)
        if len({unit[name] for name in names}) != 1:
            raise JointplayError(
                f"coordinates {', '.join(names)} have different units, or there are none; draw "
                "those in rad and those in m separately"
            )
        marks = [
            Curve(self.result.time, self.result[of].sel(coordinate=name).values, name, colour)
            for name, colour in zip(names, cycle(CONTACT_COLOURS), strict=False)
        ]
        word, units = _HISTORIES[of]
        return Panel(TIME, Axis(word, units[unit[names[0]]], "large"), marks, columns=4)

    @_drawn()
    def forces(self, axis: str | None = None, joint: str | None = None) -> Panel:
        """Force on the journal over time, world axes [N] (Figures 13-15).

        With clearance it is the contact force: each record holds it at the instant since the last
        record at which its magnitude was largest. In an ideal run it is the constraint force.

        Args:
            axis: x, y, z, total, or None for x, y and z.
            joint: a clearance joint, or for an ideal run any moving joint; None takes the first.
        """
        if self.result.joints:
            forces = self.result["joint_force_peak"].sel(joint=self._joint("forces", joint))
        else:
            moving = [str(name) for name in self.result["moving_joint"].values]
            if joint is not None and joint not in moving:
                raise MissingName("moving joint", joint, moving)
            forces = self.result["reaction_force"].sel(moving_joint=joint or moving[0])
        panel = self._components(forces.values, axis, Axis("force", "N"))
        return replace(panel, y=Axis(f"F{axis}", "N")) if axis in AXES else panel

    @_drawn(6.0, 3.8)
    def energy(self) -> Panel:
        """Terms of the energy balance over time, and its error [J]."""
        marks = []
        for i, (name, text) in enumerate(_ENERGIES.items()):
            if name not in self.result.dataset:
                continue
            values = self.result[name].values
            values = values if values.ndim == 1 else values.sum(axis=1)
            if name == "energy_residual" or np.any(values != values[0]):
                marks.append(Curve(self.result.time, values, text, **look_of(i)))
        return Panel(TIME, Axis("energy", "J"), marks, columns=3)

    def _joint(self, plot: str, joint: str | None) -> str:
        """The joint with clearance of this name, by default the first; `plot` is for messages."""
        joints = self.result.joints
        if not joints:
            raise JointplayError(
                f"plot {plot!r} needs a clearance joint, and this run has none; it can plot "
                f"{', '.join(self.available)}"
            )
        if joint is None:
            return joints[0]
        require_known("clearance joint", joint, joints)
        return joint

    def _components(
        self, vectors: np.ndarray, axis: str | None, shown: Axis, time: np.ndarray | None = None
    ) -> Panel:
        """One component of vectors (n, 3), or their norm, over time; for None, all components."""
        time = self.result.time if time is None else time
        marks = []
        for name, look in _axes_of(axis).items():
            total = name == "total"
            values = np.linalg.norm(vectors, axis=1) if total else vectors[:, AXES.index(name)]
            marks.append(Curve(time, values, **look))
        part = {None: "", "total": ", total"}.get(axis, f" {axis}")
        y = replace(shown, name=f"{shown.name}{part}")
        return Panel(TIME, y, marks, columns=0 if axis else 3)

    def _of_contacts(self, variable: str, joint: str, axis: Axis) -> Panel:
        """A history of each contact of a joint."""
        marks = []
        for i, contact in enumerate(analysis.places(self.result, joint)):
            values = self.result[variable].sel(joint=joint, contact=contact).values
            name = contact.replace("_", " ")
            marks.append(Curve(self.result.time, values, name, width=0.7, **look_of(i)))
        # All elements of a rolling bearing are one place.
        return Panel(TIME, axis, marks, columns=0 if analysis.rolls(self.result, joint) else 4)


def spans(time: np.ndarray, holds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Begin and end of each stretch of records in which `holds` is true, of the times (n,).

    A stretch ends at the first record after it.
    """
    edges = np.diff(np.concatenate([[False], holds, [False]]).astype(int))
    following = np.append(time, time[-1])
    return time[np.flatnonzero(edges == 1)], following[np.flatnonzero(edges == -1)]


def _axes_of(axis: str | None) -> dict[str, dict[str, Any]]:
    """By component to draw, its colour, and its name if there are several."""
    if axis is not None and axis not in AXIS_COLOURS:
        raise MissingName("axis", axis, AXIS_COLOURS)
    names = AXES if axis is None else (axis,)
    return {name: {"colour": AXIS_COLOURS[name], "name": "" if axis else name} for name in names}
