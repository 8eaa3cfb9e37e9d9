"""`result.plot`: every quantity of one run, each drawn into one pair of axes.

Figures of several cases are made of the same methods; see `jointplay.plots.figures`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jointplay import analysis
from jointplay.errors import JointplayError, MissingName
from jointplay.loads.terms import TERMS
from jointplay.plots.of_joints import JointPlots
from jointplay.plots.of_tool import ToolPlots
from jointplay.plots.panels import CONTACT_COLOURS, figure_of, legend
from jointplay.plots.style import COLOURS
from jointplay.result.result import AXES

ALWAYS = ("displacement", "velocity", "path", "coordinates", "forces", "energy", "spectrum")
"""Plots that have a meaning for every run."""
NEED_CLEARANCE = ("orbit", "contacts", "gaps", "modes", "tilt", "impacts")
"""Plots that have one only with clearance."""


class Plots(ToolPlots, JointPlots):
    """Draws one result. Each method returns the figure and takes these arguments.

    Args:
        ax: axes to draw into, which keep their own style; None makes a figure.
        style: ``screen`` or ``paper`` (serif, 88 mm wide) for a figure made here.

    Further keywords go to the drawn lines: ``color``, ``lw``, ``label``, ``alpha`` ...

    Raises:
        JointplayError: the plot has no meaning for this result; the message names those that have.
        MissingName: no such joint, axis or style.
    """

    def __repr__(self) -> str:
        """The plots that this result has."""
        return f"<plots of a result: {', '.join(self.available)}>"

    @property
    def available(self) -> tuple[str, ...]:
        """Names of the plots that have a meaning for this result."""
        names: tuple[str, ...] = ALWAYS
        if self.result.joints:
            names += NEED_CLEARANCE
            names += ("forms",) if bool((self.result["form"] >= 0).any()) else ()
        return names + (("deviation",) if analysis.has_play(self.result) else ())

    def coordinates(
        self,
        names: Sequence[str] | str | None = None,
        *,
        of: str = "q",
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Generalised coordinates, their rates or their drives' efforts over time.

        Args:
            names: of coordinates, all of them with the same unit; None takes those of the joints
                without clearance that turn, or if there are none those that slide.
            of: ``q`` [rad or m], ``v`` [rad/s or m/s] or ``drive`` [N m or N].
            ax: see the class.
            style: see the class.
            line: see the class.
        """
        units = {
            "q": {"rad": "rad", "m": "m"},
            "v": {"rad": "rad/s", "m": "m/s"},
            "drive": {"rad": "N m", "m": "N"},
        }
        words = {"q": "position", "v": "velocity", "drive": "drive"}
        if of not in units:
            raise MissingName("history of coordinates", of, tuple(units))
        every = [str(name) for name in self.result["coordinate"].values]
        unit = dict(zip(every, map(str, self.result["coordinate_unit"].values), strict=True))
        if names is None:
            plain = [name for name in every if "." not in name] or every
            turning = [name for name in plain if unit[name] == "rad"]
            names = turning or plain
        names = [names] if isinstance(names, str) else list(names)
        for name in names:
            if name not in unit:
                raise MissingName("coordinate", name, every)
        if len({unit[name] for name in names}) != 1:
            raise JointplayError(
                f"coordinates {', '.join(names)} have different units, or there are none; "
                "draw those in rad and those in m apart"
            )
        with self._axes(ax, style) as panel:
            for name, colour in zip(names, cycle(CONTACT_COLOURS), strict=False):
                values = self.result[of].sel(coordinate=name).values
                panel.plot(self.result.time, values, **({"color": colour, "label": name} | line))
            panel.set_xlabel("time [s]")
            panel.set_ylabel(f"{words[of]} [{units[of][unit[names[0]]]}]")
            legend(panel, 4)
        return figure_of(panel)

    def forces(
        self,
        axis: str | None = None,
        joint: str | None = None,
        *,
        ax: Axes | None = None,
        style: str = "screen",
        **line: Any,
    ) -> Figure:
        """Force on the journal over time, world axes [N] (Figures 13-15).

        With clearance the contact force, each record showing it at the instant since the last
        record at which its magnitude was largest; for an ideal run the constraint force.

        Args:
            axis: x, y, z, total, or None for x, y and z.
            joint: a clearance joint, or for an ideal run any moving joint; None takes the first.
            ax: see the class.
            style: see the class.
            line: see the class.
        """
        if self.result.joints:
            forces = self.result["joint_force_peak"].sel(joint=self._joint("forces", joint))
        else:
            moving = [str(name) for name in self.result["moving_joint"].values]
            if joint is not None and joint not in moving:
                raise MissingName("moving joint", joint, moving)
            forces = self.result["reaction_force"].sel(moving_joint=joint or moving[0])
        with self._axes(ax, style) as panel:
            self._components(panel, self.result.time, forces.values, axis, "force", "N", line)
            if axis in AXES:
                panel.set_ylabel(f"F{axis} [N]")
        return figure_of(panel)

    def energy(self, *, ax: Axes | None = None, style: str = "screen", **line: Any) -> Figure:
        """Terms of the energy balance over time, and its error [J]."""
        names = {
            "kinetic_energy": "kinetic",
            "potential_energy": "potential",
            **{term.variable: term.label for term in TERMS},
            "payload_energy": "brought in by payloads",
            "load_energy": "stored in loads",
            "load_work": "work of loads",
            "energy_residual": "error of the balance",
        }
        colours = [COLOURS[k] for k in (1, 5, 3, 0, 4, 2)]
        colours += ["0.5", "#0F7E86", "#7A5C2E", "#B0408A", "#5A7D2B", "black"]
        with self._axes(ax, style, 6.0, 3.8) as panel:
            for (name, text), colour in zip(names.items(), colours, strict=True):
                if name not in self.result.dataset:
                    continue
                values = self.result[name].values
                values = values if values.ndim == 1 else values.sum(axis=1)
                if name == "energy_residual" or np.any(values != values[0]):
                    panel.plot(
                        self.result.time, values, **({"color": colour, "label": text} | line)
                    )
            panel.set_xlabel("time [s]")
            panel.set_ylabel("energy [J]")
            legend(panel, 3)
        return figure_of(panel)
