"""Plots of the tool of one run: path, speed, deviation, vibration."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jointplay import analysis
from jointplay.errors import JointplayError, MissingName
from jointplay.plots.panels import COMPONENTS, Drawing, figure_of, legend
from jointplay.plots.style import AXIS_COLOURS, COLOURS
from jointplay.result.result import AXES, Result


class ToolPlots(Drawing):
    """Plots of the tool."""

    def displacement(
        self, axis: str | None = None, *, ax: Axes | None = None, style: str = "screen", **line: Any
    ) -> Figure:
        """Tool position over time along world `axis` x, y, z (None: all) [m] (Figure 9)."""
        return self._tool("tool_position", "displacement", "m", axis, ax, style, line)

    def velocity(
        self, axis: str | None = None, *, ax: Axes | None = None, style: str = "screen", **line: Any
    ) -> Figure:
        """Tool velocity over time along world `axis` x, y, z, total (None: all) [m/s] (Fig. 10)."""
        return self._tool("tool_velocity", "velocity", "m/s", axis, ax, style, line)

    def _tool(
        self,
        variable: str,
        symbol: str,
        unit: str,
        axis: str | None,
        ax: Axes | None,
        look: str,
        line: dict[str, Any],
    ) -> Figure:
        with self._axes(ax, look) as panel:
            values = self.result[variable].values
            self._components(panel, self.result.time, values, axis, symbol, unit, line)
        return figure_of(panel)

    def deviation(
        self,
        axis: str | None = None,
        ideal: Result | None = None,
        *,
        of: str = "tool_position",
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Tool's difference from the ideal robot over time [mm, mm/s, mrad, mrad/s].

        Args:
            axis: x, y, z, total, or None for x, y and z.
            ideal: the ideal robot's run; None simulates it (`analysis.twin`).
            of: one of `analysis.tool_error.TOOL_MOTIONS`.
            ax: see the class.
            style: see the class.
            line: see the class.
        """
        if not analysis.has_play(self.result):
            raise JointplayError(
                "plot 'deviation' needs clearance or a gear with play, and this run has neither; "
                f"it can plot {', '.join(self.available)}"
            )
        reference = analysis.twin(self.result) if ideal is None else ideal
        error = analysis.deviation(self.result, reference, of)
        unit = f"m{error.attrs['units']}"
        with self._axes(ax, style) as panel:
            time, values = error["time"].values, 1e3 * error.values
            self._components(panel, time, values, axis, "deviation", unit, line)
        return figure_of(panel)

    def path(
        self, plane: str = "xy", *, ax: Axes | None = None, style: str = "screen", **line: Any
    ) -> Figure:
        """Tool path in the world plane `plane`, two of x, y, z [m] (Figure 11)."""
        if len(plane) != 2 or plane[0] == plane[1] or not set(plane) <= set(AXES):
            raise MissingName("plane", plane, ("xy", "xz", "yz"))
        with self._axes(ax, style, 4.6, 4.4) as panel:
            across, up = (self.result["tool_position"].sel(axis=a).values for a in plane)
            panel.plot(across, up, **({"color": COLOURS[1]} | line))
            panel.set_xlabel(f"{plane[0]} [m]")
            panel.set_ylabel(f"{plane[1]} [m]")
            panel.set_aspect("equal", adjustable="datalim")
        return figure_of(panel)

    def spectrum(
        self,
        axis: str | None = None,
        ideal: Result | None = None,
        *,
        of: str = "acceleration",
        start: float | None = None,
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Power spectral density of the tool's vibration; see `analysis.spectrum`.

        Args:
            axis: x, y, z, total, or None for x, y and z.
            ideal: ideal run whose motion is subtracted; needed for ``deviation``.
            of: ``acceleration`` or ``deviation``.
            start: records before this are left out [s]; None: before the run is judged.
            ax: see the class.
            style: see the class.
            line: see the class.
        """
        if axis is not None and axis not in COMPONENTS:
            raise MissingName("axis", axis, COMPONENTS)
        density = analysis.spectrum(self.result, ideal, of, start)
        frequency = density["frequency"].values[1:]
        with self._axes(ax, style) as panel:
            for name in AXES if axis is None else (axis,):
                values = density.sel(axis=name).values[1:]
                if not values.any():  # the tool does not move this way
                    continue
                drawn = {"color": AXIS_COLOURS[name], **({"label": name} if axis is None else {})}
                panel.loglog(frequency, values, **(drawn | line))
            unit = r"(m/s$^2$)$^2$/Hz" if of == "acceleration" else r"m$^2$/Hz"
            panel.set_xlabel("frequency [Hz]")
            panel.set_ylabel(f"PSD of {of}{f' {axis}' if axis else ''} [{unit}]")
            if axis is None:
                legend(panel, 3)
        return figure_of(panel)
