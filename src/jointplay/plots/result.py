"""`result.plot`: every quantity of one run, each drawn into one pair of axes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from jointplay import analysis
from jointplay.core.errors import JointplayError, MissingName
from jointplay.core.units import round_below
from jointplay.geometry import Form, Mode
from jointplay.plots.names import MODE_TERMS, MODES
from jointplay.plots.palette import AXIS_COLOURS, MODE_COLOURS
from jointplay.plots.style import (
    COLOURS,
    COMPONENTS,
    CONTACT_COLOURS,
    MARKERS,
    contact_line,
    figure_of,
    legend,
    listed,
    literal,
    logarithmic,
    narrow,
    new_figure,
    style,
    timeline,
)
from jointplay.result.result import AXES, Result
from jointplay.result.variables import TERMS

_TICKS = 5
"""Intervals between the ticks of an orbit, at most."""

_DRAWN_DEPTH = 0.15
"""Depth of penetration of a rim as drawn, relative to the clearance: 99 % are less deep."""
_RIM_EDGE = 1.5
"""Where deeper ones are drawn, relative to the clearance."""

_RIM_COLOURS = ("#E69F00", "#009E73", MODE_COLOURS[2])
"""Of the modes; points need more contrast than bars."""

ALWAYS = ("displacement", "velocity", "path", "coordinates", "forces", "energy", "spectrum")
"""Plots that have a meaning for every run."""
NEED_CLEARANCE = ("orbit", "contacts", "gaps", "modes", "tilt", "impacts")
"""Plots that have one only with clearance."""

_UNITS = {
    "q": {"rad": "rad", "m": "m"},
    "v": {"rad": "rad/s", "m": "m/s"},
    "drive": {"rad": "N m", "m": "N"},
}
_WORDS = {"q": "position", "v": "velocity", "drive": "drive"}
"""Units, by the coordinate's own, and names of the histories of coordinates."""

_ENERGIES = {
    "kinetic_energy": "kinetic",
    "potential_energy": "potential",
    **{term.variable: term.label for term in TERMS},
    "payload_energy": "brought in by payloads",
    "load_energy": "stored in loads",
    "load_work": "work of loads",
    "energy_residual": "error of the balance",
}
_ENERGY_COLOURS = [*(COLOURS[k] for k in (1, 5, 3, 0, 4, 2)), "0.5", "#0F7E86", "#7A5C2E"]
_ENERGY_COLOURS += ["#B0408A", "#5A7D2B", "black"]


class Plots:
    """Draws one result. Each method returns the figure and also takes these keywords.

    Args:
        ax: axes to draw into, which keep their own style; None makes a figure.
        style: ``screen`` or ``paper`` (serif, 88 mm wide) for a figure made here.

    Further keywords go to the drawn lines: ``color``, ``lw``, ``label``, ``alpha`` ...

    Raises:
        JointplayError: the plot has no meaning for this result; the message names those that have.
        MissingName: no such joint, axis or style.
    """

    def __init__(self, result: Result) -> None:
        """Draw `result`."""
        self.result = result

    def __repr__(self) -> str:
        """The plots that this result has."""
        return f"<plots of a result: {', '.join(self.available)}>"

    @property
    def available(self) -> tuple[str, ...]:
        """Names of the plots that have a meaning for this result."""
        names: tuple[str, ...] = ALWAYS
        if self.result.joints:
            names += NEED_CLEARANCE
            if any(analysis.has_rims(self.result, joint) for joint in self.result.joints):
                names += ("rims",)
            if any(analysis.rolls(self.result, joint) for joint in self.result.joints):
                names += ("loaded",)
            names += ("forms",) if bool((self.result["form"] >= 0).any()) else ()
        return names + (("deviation",) if analysis.has_play(self.result) else ())

    def orbit(self, joint: str | None = None, **line: Any) -> Figure:
        """Path of the journal's centre in its clearance circle, bearing frame [mm] (Fig. 12).

        Of a rolling bearing the inner ring's centre in the outer ring's frame [µm].
        """
        name = self._joint("orbit", joint)
        ring = analysis.rolls(self.result, name)
        scale, unit = (1e6, "µm") if ring else (1e3, "mm")
        with self._axes(line, 4.8, 5.0) as panel:
            centre = scale * self.result["journal_centre"].sel(joint=name).values
            outline = analysis.clearance_outline(self.result, name)
            if outline is not None:
                room = scale * outline
                panel.plot(*room, color="black", lw=1.0)
                shape = "circle" if room.shape[1] > 5 else "rectangle"
                size = f"{room[0].max():.3g}" if ring else f"{room[0].max():g}"
                panel.set_title(f"{name}, clearance {shape}, ±{size} {unit}")
            elif ring:
                panel.set_title(f"{name}, no play across")
                reach = 1.2 * max(float(np.abs(centre[:, :2]).max()), 1e-3)
                panel.set(xlim=(-reach, reach), ylim=(-reach, reach))
            look: dict[str, Any] = {"color": COLOURS[1], "lw": 0.5} | line
            first = int(np.searchsorted(self.result.time, self.result.judge_from))
            if first:  # what is not judged
                fall = look | {"color": "0.8", "label": "_"}
                panel.plot(centre[: first + 1, 0], centre[: first + 1, 1], **fall)
            panel.plot(centre[first:, 0], centre[first:, 1], **look)
            panel.set_aspect("equal")
            for axis in (panel.xaxis, panel.yaxis):  # small panels have room for few
                axis.set_major_locator(MaxNLocator(_TICKS, symmetric=True))
            frame = "outer ring's" if ring else "bearing"
            panel.set(xlabel=f"x in the {frame} frame [{unit}]")
            panel.set(ylabel=f"y in the {frame} frame [{unit}]")
        return figure_of(panel)

    def rims(self, joint: str | None = None, **points: Any) -> Figure:
        """Centre of the rim that is nearer to the bore, by the joint's mode (Fig. 12) [mm].

        It is drawn as far inside the clearance circle as its gap to the bore is wide, and
        penetration as far outside, magnified. Records that are not judged are left out.

        Raises:
            JointplayError: the journal is no cylinder.
        """
        name = self._joint("rims", joint)
        if not analysis.has_rims(self.result, name):
            raise JointplayError(
                f"plot 'rims' is of cylindrical journals, and that of joint {name!r} is none; "
                "plot its orbit"
            )
        judged = self.result.time >= self.result.judge_from
        gaps = self.result["gap"].sel(joint=name).values[judged, :2]
        nearer, each = gaps.argmin(axis=1), np.arange(len(gaps))
        gap = gaps[each, nearer]
        across = analysis.rim_centres(self.result, name)[:, judged, :2][nearer, each]
        mode = self.result["mode"].sel(joint=name).values[judged]
        outline = analysis.clearance_outline(self.result, name)
        assert outline is not None  # a cylinder's is a circle
        clearance = float(outline.max())
        deep = np.quantile(-gap[gap < 0.0], 0.99) if (gap < 0.0).any() else clearance
        factor = max(1.0, round_below(_DRAWN_DEPTH * clearance / deep))
        reach = clearance - np.where(gap < 0.0, factor * gap, gap)
        reach = np.minimum(reach, _RIM_EDGE * clearance)
        far = np.linalg.norm(across, axis=1)
        reach = np.divide(reach, far, out=np.ones_like(far), where=far > 0.0)
        drawn = 1e3 * across * reach[:, None]
        with self._axes(points, 4.8, 5.2) as panel:
            panel.plot(*(1e3 * outline), color="black", lw=1.0)
            look: dict[str, Any] = {"marker": ".", "ms": 2.0, "ls": "", "mew": 0.0}
            for one in reversed(Mode):
                look |= {"color": _RIM_COLOURS[one], "label": f"{MODE_TERMS[one]} ({MODES[one]})"}
                panel.plot(*drawn[mode == one].T, **look, rasterized=True, **points)
            panel.set_aspect("equal")
            panel.set_title(f"{name}, nearer rim, penetration × {factor:g}")
            edge = 1e3 * 1.05 * _RIM_EDGE * clearance
            panel.set(xlim=(-edge, edge), ylim=(-edge, edge))
            for axis in (panel.xaxis, panel.yaxis):
                axis.set_major_locator(MaxNLocator(_TICKS, symmetric=True))
            panel.set(xlabel="x in the bearing frame [mm]", ylabel="y in the bearing frame [mm]")
        return figure_of(panel)

    def contacts(self, joint: str | None = None, **line: Any) -> Figure:
        """Largest normal force at each of the joint's contacts since the last record [N].

        Of a rolling bearing the load of the most loaded element.
        """
        name = self._joint("contacts", joint)
        force = "largest element load" if analysis.rolls(self.result, name) else "normal force"
        return self._of_contacts("normal_force_peak", name, 1.0, f"{force} [N]", line)

    def loaded(self, joint: str | None = None, **line: Any) -> Figure:
        """How many balls or rollers of a rolling bearing bear load, over time.

        Args:
            joint: one with a rolling bearing; None takes the first that has one.
        """
        name = joint or next(
            (name for name in self.result.joints if analysis.rolls(self.result, name)), None
        )
        name = self._joint("loaded", name)
        if not analysis.rolls(self.result, name):
            raise JointplayError(
                f"plot 'loaded' is of rolling bearings, and joint {name!r} has none"
            )
        with self._axes(line) as panel:
            values = self.result["loaded_elements"].sel(joint=name).values
            look = {"color": COLOURS[1], "drawstyle": "steps-mid"} | line
            panel.plot(self.result.time, values, **look)
            panel.set_ylim(bottom=0)
            panel.yaxis.set_major_locator(MaxNLocator(integer=True))
            panel.set(xlabel="time [s]", ylabel="loaded elements")
        return figure_of(panel)

    def gaps(self, joint: str | None = None, **line: Any) -> Figure:
        """Smallest gap at each of the joint's contacts since the last record; < 0 sunk in [mm]."""
        name = self._joint("gaps", joint)
        panel = line.get("ax")
        ring = analysis.rolls(self.result, name)
        scale, label = (1e6, "least gap of elements [µm]") if ring else (1e3, "gap [mm]")
        figure = self._of_contacts("gap_min", name, scale, label, line)
        (panel or figure.axes[0]).axhline(0.0, color="black", lw=0.6)
        return figure

    def modes(self, joint: str | None = None, **bar: Any) -> Figure:
        """Timeline of the joint's mode (Table 1), with the share of the time in each."""
        name = self._joint("modes", joint)
        with self._axes(bar, 6.0, 2.2) as panel:
            shares = analysis.shares(self.result, name)
            rows = [
                f"{text}\n{100 * share:.1f} %"
                for text, share in zip(MODES, shares.values(), strict=True)
            ]
            modes, colours = list(Mode), list(MODE_COLOURS)
            if analysis.rolls(self.result, name):
                modes, colours = [modes[0], modes[2]], [MODE_COLOURS[0], MODE_COLOURS[2]]
                rows = [
                    f"{text}\n{100 * list(shares.values())[int(mode)]:.1f} %"
                    for text, mode in zip(
                        ("no element\nloaded", "elements\nloaded"), modes, strict=True
                    )
                ]
            values = self.result["mode"].sel(joint=name).values
            timeline(panel, self.result.time, values, modes, rows, colours, bar)
        return figure_of(panel)

    def forms(self, joint: str | None = None, **bar: Any) -> Figure:
        """Timeline of the contact forms that occurred (Figure 2), with the share of each."""
        name = self._joint("forms", joint)
        shares = analysis.shares(self.result, name, "form")
        if not shares:
            raise JointplayError(
                f"Figure 2 has no forms for a joint such as {name!r}; plot its modes or contacts"
            )
        occurred = [form for form in Form if shares[form.name.lower()] > 0.0]
        with self._axes(bar, 6.0, 0.9 + 0.24 * len(occurred)) as panel:
            rows = []
            for form in occurred:
                words = form.name.lower().replace("_", " ")
                if form:
                    words = form.letter if narrow(panel) else f"{form.letter}: {words}"
                rows.append(f"{words}, {100 * shares[form.name.lower()]:.1f} %")
            values = self.result["form"].sel(joint=name).values
            timeline(panel, self.result.time, values, occurred, rows, (COLOURS[1],) * 13, bar)
        return figure_of(panel)

    def tilt(self, joint: str | None = None, **line: Any) -> Figure:
        """Angle between the axes of journal and bearing, or of both rings, over time [mrad]."""
        name = self._joint("tilt", joint)
        with self._axes(line) as panel:
            values = 1e3 * self.result["tilt"].sel(joint=name).values
            panel.plot(self.result.time, values, **({"color": COLOURS[1]} | line))
            panel.set(xlabel="time [s]", ylabel="tilt [mrad]")
        return figure_of(panel)

    def impacts(self, joint: str | None = None, **dots: Any) -> Figure:
        """Peak normal force [N] of every contact over its duration [ms], by place."""
        name = self._joint("impacts", joint)
        with self._axes(dots, 5.0, 3.6) as panel:
            places = [p for p in analysis.contacts(self.result) if p.joint == name]
            for i, place in enumerate(places):
                look = {
                    **contact_line(i),
                    "marker": MARKERS[i % len(MARKERS)],
                    "label": f"{place.contact.replace('_', ' ')}, {len(place.peak)}",
                    **{"ls": "none", "ms": 3.5, "mew": 0.0, "alpha": 0.8},
                }
                panel.plot(1e3 * place.duration, place.peak, **(look | dots))
            if any(len(place.peak) for place in places):
                logarithmic(panel, "xy")
            ring = analysis.rolls(self.result, name)
            panel.set_xlabel(f"duration of the {'load' if ring else 'contact'} [ms]")
            panel.set_ylabel(f"{'peak element load' if ring else 'peak normal force'} [N]")
            legend(panel, 2)
        return figure_of(panel)

    def displacement(self, axis: str | None = None, **line: Any) -> Figure:
        """Tool position over time along world `axis` x, y, z (None: all) [m] (Figure 9)."""
        values = self.result["tool_position"].values
        return self._components(values, axis, "displacement", "m", line)

    def velocity(self, axis: str | None = None, **line: Any) -> Figure:
        """Tool velocity over time along world `axis` x, y, z, total (None: all) [m/s] (Fig. 10)."""
        values = self.result["tool_velocity"].values
        return self._components(values, axis, "velocity", "m/s", line)

    def deviation(
        self,
        axis: str | None = None,
        ideal: Result | None = None,
        *,
        of: str = "tool_position",
        **line: Any,
    ) -> Figure:
        """Tool's difference from the ideal robot over time [mm, mm/s, mrad, mrad/s].

        Args:
            axis: x, y, z, total, or None for x, y and z.
            ideal: the ideal robot's run; None simulates it (`analysis.twin`).
            of: one of `analysis.tool_error.TOOL_MOTIONS`.
        """
        if not analysis.has_play(self.result):
            raise JointplayError(
                "plot 'deviation' needs clearance or a gear with play, and this run has neither; "
                f"it can plot {', '.join(self.available)}"
            )
        reference = analysis.twin(self.result) if ideal is None else ideal
        error = analysis.deviation(self.result, reference, of)
        unit, time = f"m{error.attrs['units']}", error["time"].values
        return self._components(1e3 * error.values, axis, "deviation", unit, line, time)

    def path(self, plane: str = "xy", **line: Any) -> Figure:
        """Tool path in the world plane `plane`, two of x, y, z [m] (Figure 11)."""
        if len(plane) != 2 or plane[0] == plane[1] or not set(plane) <= set(AXES):
            raise MissingName("plane", plane, ("xy", "xz", "yz"))
        with self._axes(line, 4.6, 4.4) as panel:
            across, up = (self.result["tool_position"].sel(axis=a).values for a in plane)
            panel.plot(across, up, **({"color": COLOURS[1]} | line))
            panel.set(xlabel=f"{plane[0]} [m]", ylabel=f"{plane[1]} [m]")
            panel.set_aspect("equal", adjustable="datalim")
        return figure_of(panel)

    def spectrum(
        self,
        axis: str | None = None,
        ideal: Result | None = None,
        *,
        of: str = "acceleration",
        start: float | None = None,
        **line: Any,
    ) -> Figure:
        """Power spectral density of the tool's vibration; see `analysis.spectrum`.

        Args:
            axis: x, y, z, total, or None for x, y and z.
            ideal: ideal run whose motion is subtracted; needed for ``deviation``.
            of: ``acceleration`` or ``deviation``.
            start: records before this are left out [s]; None: before the run is judged.
        """
        names = _axes_of(axis)
        density = analysis.spectrum(self.result, ideal, of, start)
        frequency = density["frequency"].values[1:]
        with self._axes(line) as panel:
            for name in names:
                values = density.sel(axis=name).values[1:]
                if values.any():  # else the tool does not move this way
                    panel.plot(frequency, values, **(_axis_line(name, axis) | line))
            logarithmic(panel, "xy")
            unit = "(m/s²)²/Hz" if of == "acceleration" else "m²/Hz"
            label = f"PSD of {of}{f' {axis}' if axis else ''} [{unit}]"
            panel.set(xlabel="frequency [Hz]", ylabel=label)
            if axis is None:
                legend(panel, 3)
        return figure_of(panel)

    def coordinates(
        self, names: Sequence[str] | str | None = None, *, of: str = "q", **line: Any
    ) -> Figure:
        """Generalised coordinates, their rates or their drives' efforts over time.

        Args:
            names: of coordinates, all of them with the same unit; None takes those of the joints
                without clearance that turn, or if there are none those that slide.
            of: ``q`` [rad or m], ``v`` [rad/s or m/s] or ``drive`` [N m or N].
        """
        if of not in _UNITS:
            raise MissingName("history of coordinates", of, tuple(_UNITS))
        every = [str(name) for name in self.result["coordinate"].values]
        unit = dict(zip(every, map(str, self.result["coordinate_unit"].values), strict=True))
        if names is None:
            plain = [name for name in every if "." not in name] or every
            names = [name for name in plain if unit[name] == "rad"] or plain
        names = [names] if isinstance(names, str) else list(names)
        for name in names:
            if name not in unit:
                raise MissingName("coordinate", name, every)
        if len({unit[name] for name in names}) != 1:
            raise JointplayError(
                f"coordinates {', '.join(names)} have different units, or there are none; draw "
                "those in rad and those in m separately"
            )
        with self._axes(line) as panel:
            for name, colour in zip(names, cycle(CONTACT_COLOURS), strict=False):
                look = {"color": colour, "label": listed(name)}
                values = self.result[of].sel(coordinate=name).values
                panel.plot(self.result.time, values, **(look | line))
            panel.set(xlabel="time [s]", ylabel=f"{_WORDS[of]} [{_UNITS[of][unit[names[0]]]}]")
            legend(panel, 4)
        return figure_of(panel)

    def forces(self, axis: str | None = None, joint: str | None = None, **line: Any) -> Figure:
        """Force on the journal over time, world axes [N] (Figures 13-15).

        With clearance the contact force, each record showing it at the instant since the last
        record at which its magnitude was largest; for an ideal run the constraint force.

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
        panel = line.get("ax")
        figure = self._components(forces.values, axis, "force", "N", line)
        if axis in AXES:
            (panel or figure.axes[0]).set_ylabel(f"F{axis} [N]")
        return figure

    def energy(self, **line: Any) -> Figure:
        """Terms of the energy balance over time, and its error [J]."""
        with self._axes(line, 6.0, 3.8) as panel:
            for (name, text), colour in zip(_ENERGIES.items(), _ENERGY_COLOURS, strict=True):
                if name not in self.result.dataset:
                    continue
                values = self.result[name].values
                values = values if values.ndim == 1 else values.sum(axis=1)
                if name == "energy_residual" or np.any(values != values[0]):
                    look = {"color": colour, "label": text}
                    panel.plot(self.result.time, values, **(look | line))
            panel.set(xlabel="time [s]", ylabel="energy [J]")
            legend(panel, 3)
        return figure_of(panel)

    @contextmanager
    def _axes(
        self, options: dict[str, Any], width: float = 6.0, height: float = 3.2
    ) -> Iterator[Axes]:
        """The axes to draw into: the keywords `ax` and `style` are taken out of the options."""
        ax, look = options.pop("ax", None), options.pop("style", "screen")
        if ax is not None:
            yield ax
            literal(ax)
            return
        with style(look):
            yield new_figure(width, height, look).subplots()

    def _joint(self, plot: str, joint: str | None) -> str:
        """A joint with clearance, by default the first."""
        joints = self.result.joints
        if not joints:
            raise JointplayError(
                f"plot {plot!r} needs a clearance joint, and this run has none; it can plot "
                f"{', '.join(self.available)}"
            )
        if joint is None:
            return joints[0]
        if joint not in joints:
            raise MissingName("clearance joint", joint, joints)
        return joint

    def _components(
        self,
        vectors: np.ndarray,
        axis: str | None,
        symbol: str,
        unit: str,
        line: dict[str, Any],
        time: np.ndarray | None = None,
    ) -> Figure:
        """One component of vectors (n, 3) over time, or all three in the colours of the axes."""
        time = self.result.time if time is None else time
        with self._axes(line) as panel:
            for name in _axes_of(axis):
                total = name == "total"
                values = np.linalg.norm(vectors, axis=1) if total else vectors[:, AXES.index(name)]
                panel.plot(time, values, **(_axis_line(name, axis) | line))
            if axis is None:
                legend(panel, 3)
            part = {None: "", "total": ", total"}.get(axis, f" {axis}")
            panel.set(xlabel="time [s]", ylabel=f"{symbol}{part} [{unit}]")
        return figure_of(panel)

    def _of_contacts(
        self, variable: str, joint: str, scale: float, label: str, line: dict[str, Any]
    ) -> Figure:
        """A history of each contact of a joint."""
        with self._axes(line) as panel:
            for i, contact in enumerate(analysis.places(self.result, joint)):
                values = self.result[variable].sel(joint=joint, contact=contact).values
                look = {"label": contact.replace("_", " "), "lw": 0.7, **contact_line(i)}
                panel.plot(self.result.time, scale * values, **(look | line))
            panel.set(xlabel="time [s]", ylabel=label)
            if not analysis.rolls(self.result, joint):  # all elements are one place
                legend(panel, 4)
        return figure_of(panel)


def _axes_of(axis: str | None) -> tuple[str, ...]:
    """Components that are drawn."""
    if axis is not None and axis not in COMPONENTS:
        raise MissingName("axis", axis, COMPONENTS)
    return AXES if axis is None else (axis,)


def _axis_line(name: str, asked: str | None) -> dict[str, Any]:
    """Colour of a component, and its label among several."""
    return {"color": AXIS_COLOURS[name], **({"label": name} if asked is None else {})}
