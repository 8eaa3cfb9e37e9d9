"""Plots of the joints with clearance of one run: orbit, gaps, contacts, modes, impacts."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from jointplay import analysis
from jointplay.errors import JointplayError
from jointplay.geometry import Form, Mode
from jointplay.plots.panels import (
    MARKERS,
    MODE_NAMES,
    Drawing,
    contact_line,
    figure_of,
    legend,
    narrow,
    timeline,
)
from jointplay.plots.style import COLOURS, MODE_COLOURS

_TICKS = 5
"""Intervals between the ticks of an orbit, at most."""


class JointPlots(Drawing):
    """Plots of joints with clearance."""

    def orbit(
        self,
        joint: str | None = None,
        *,
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Path of the journal's centre in its clearance circle, bearing frame [mm] (Fig. 12)."""
        name = self._joint("orbit", joint)
        with self._axes(ax, style, 4.8, 5.0) as panel:
            centre = 1e3 * self.result["journal_centre"].sel(joint=name).values
            outline = analysis.clearance_outline(self.result, name)
            if outline is not None:
                room = 1e3 * outline
                panel.plot(*room, color="black", lw=1.0)
                shape = "circle" if room.shape[1] > 5 else "rectangle"
                panel.set_title(f"{name}, clearance {shape}, ±{room[0].max():g} mm")
            look: dict[str, Any] = {"color": COLOURS[1], "lw": 0.5} | line
            panel.plot(centre[:, 0], centre[:, 1], **look)
            panel.set_aspect("equal")
            for axis in (panel.xaxis, panel.yaxis):  # small panels have room for few
                axis.set_major_locator(MaxNLocator(_TICKS, symmetric=True))
            panel.set_xlabel("x in the bearing frame [mm]")
            panel.set_ylabel("y in the bearing frame [mm]")
        return figure_of(panel)

    def contacts(
        self,
        joint: str | None = None,
        *,
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Largest normal force at each of the joint's contacts since the last record [N]."""
        name = self._joint("contacts", joint)
        return self._places("normal_force_peak", name, 1.0, "normal force [N]", ax, style, line)

    def gaps(
        self,
        joint: str | None = None,
        *,
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Smallest gap at each of the joint's contacts since the last record; < 0 sunk in [mm]."""
        name = self._joint("gaps", joint)
        figure = self._places("gap_min", name, 1e3, "gap [mm]", ax, style, line)
        (ax or figure.axes[0]).axhline(0.0, color="black", lw=0.6)
        return figure

    def _places(
        self,
        variable: str,
        joint: str,
        scale: float,
        label: str,
        ax: Axes | None,
        look: str,
        line: dict[str, Any],
    ) -> Figure:
        with self._axes(ax, look) as panel:
            for i, contact in enumerate(analysis.places(self.result, joint)):
                values = self.result[variable].sel(joint=joint, contact=contact).values
                drawn = {"label": contact.replace("_", " "), "lw": 0.7, **contact_line(i)}
                panel.plot(self.result.time, scale * values, **(drawn | line))
            panel.set_xlabel("time [s]")
            panel.set_ylabel(label)
            legend(panel, 4)
        return figure_of(panel)

    def modes(
        self, joint: str | None = None, *, ax: Axes | None = None, style: str = "screen", **bar: Any
    ) -> Figure:
        """Timeline of the joint's mode (Table 1), with the share of the time in each."""
        name = self._joint("modes", joint)
        with self._axes(ax, style, 6.0, 2.2) as panel:
            shares = analysis.shares(self.result, name)
            rows = [
                f"{text}\n{100 * share:.1f} %"
                for text, share in zip(MODE_NAMES, shares.values(), strict=True)
            ]
            values = self.result["mode"].sel(joint=name).values
            timeline(panel, self.result.time, values, list(Mode), rows, MODE_COLOURS, bar)
        return figure_of(panel)

    def forms(
        self, joint: str | None = None, *, ax: Axes | None = None, style: str = "screen", **bar: Any
    ) -> Figure:
        """Timeline of the contact forms that occurred (Figure 2), with the share of each."""
        name = self._joint("forms", joint)
        shares = analysis.shares(self.result, name, "form")
        if not shares:
            raise JointplayError(
                f"Figure 2 has no forms for a joint such as {name!r}; plot its modes or contacts"
            )
        seen = [form for form in Form if shares[form.name.lower()] > 0.0]
        with self._axes(ax, style, 6.0, 0.9 + 0.24 * len(seen)) as panel:
            rows = []
            for form in seen:
                words = form.name.lower().replace("_", " ")
                if form:
                    words = form.letter if narrow(panel) else f"{form.letter}: {words}"
                rows.append(f"{words}, {100 * shares[form.name.lower()]:.1f} %")
            values = self.result["form"].sel(joint=name).values
            timeline(panel, self.result.time, values, seen, rows, (COLOURS[1],) * 13, bar)
        return figure_of(panel)

    def tilt(
        self,
        joint: str | None = None,
        *,
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Angle between the axes of journal and bearing over time [mrad]."""
        name = self._joint("tilt", joint)
        with self._axes(ax, style) as panel:
            values = 1e3 * self.result["tilt"].sel(joint=name).values
            panel.plot(self.result.time, values, **({"color": COLOURS[1]} | line))
            panel.set_xlabel("time [s]")
            panel.set_ylabel("tilt [mrad]")
        return figure_of(panel)

    def impacts(
        self,
        joint: str | None = None,
        *,
        ax: Axes | None = None,
        style: str = "screen",
        **dots: Any,
    ) -> Figure:
        """Peak normal force [N] of every contact over its duration [ms], by place."""
        name = self._joint("impacts", joint)
        with self._axes(ax, style, 5.0, 3.6) as panel:
            places = [p for p in analysis.contacts(self.result) if p.joint == name]
            for i, place in enumerate(places):
                marker = MARKERS[i % len(MARKERS)]
                drawn = {**contact_line(i), "marker": marker, "ls": "none", "ms": 3.5, "mew": 0.0}
                drawn |= {"label": f"{place.contact.replace('_', ' ')}, {len(place.peak)}"}
                drawn |= {"alpha": 0.8}
                panel.plot(1e3 * place.duration, place.peak, **(drawn | dots))
            if any(len(place.peak) for place in places):
                panel.set_xscale("log")
                panel.set_yscale("log")
            panel.set_xlabel("duration of the contact [ms]")
            panel.set_ylabel("peak normal force [N]")
            legend(panel, 2)
        return figure_of(panel)
