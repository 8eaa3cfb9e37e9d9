"""The result of a run: time histories, the run's audit, and all inputs to run it again."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Collection
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import files
from jointplay.base.conveniences import provided
from jointplay.base.errors import JointplayError, require_a, require_whole
from jointplay.base.origins import Value, from_text, value_table
from jointplay.base.schema import known_keywords
from jointplay.physics.contact.functions import showing
from jointplay.physics.kernel import Status
from jointplay.simulation.result import netcdf
from jointplay.simulation.result.audit import Audit

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from jointplay.base.tables import Table
    from jointplay.show.plots import Plots
    from jointplay.simulation.analysis.parts import ToolError
    from jointplay.simulation.analysis.vibration import Rattle
    from jointplay.simulation.result.certificate import Certificate
    from jointplay.simulation.simulation import Simulation

FORMAT = 6
"""Version of the file format."""

AXES = ("x", "y", "z")
"""Components of vectors, in their order."""

COMPARED = (
    *("tool_error", "tool_error_vector", "tool_turn"),
    *("ideal_tool_position", "ideal_tool_velocity"),
    *("ideal_tool_orientation", "ideal_tool_angular_velocity"),
)
"""Histories of the ideal mechanism's tool, and of the tool's error against it."""


@known_keywords
class Result:
    """Time histories of a run, and how far they can be trusted.

    Args:
        dataset: histories and attributes of a run.

    Attributes:
        dataset: `xarray.Dataset` with named dimensions and units; docs/results.md explains them.
        audit: figures by which the run judges its own quality.
        status: how the run ended.
        message: how it ended, in a line.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        require_a("dataset", dataset, "Dataset")
        self.dataset = dataset
        self.audit = Audit.from_description(json.loads(dataset.attrs["audit"]))
        self.status = Status[dataset.attrs["status"].upper()]
        self.message: str = dataset.attrs["message"]

    def __getitem__(self, name: str) -> xr.DataArray:
        """A history by its name; those of the tool error are computed if they are not there yet."""
        if name in COMPARED and name not in self.dataset:
            provided("find_tool_error")(self)
        return self.dataset[name]

    def __repr__(self) -> str:
        return f"<jointplay Result: {provided('in_a_line')(self)}>"

    def __str__(self) -> str:
        sizes = ", ".join(f"{name}: {size}" for name, size in self.dataset.sizes.items())
        return f"<jointplay Result: {self.message}>\n  {sizes}\n{self.judgement}"

    @property
    def judge_from(self) -> float:
        """Time from which measures, figures and reports judge this run by default [s].

        It is 0 for a run that was interrupted before, of which all is judged.
        """
        start = self.audit.judged_from
        return start if len(self.time) and self.time[-1] > start else 0.0

    @property
    def judgement(self) -> str:
        """The audit and the certificate, in lines."""
        certificate = self.certificate
        return self.audit.text(certificate) + (f"\n{certificate}" if certificate else "")

    @property
    def certificate(self) -> Certificate | None:
        """Headline figures with their numerical errors; None if these were not estimated."""
        text = self.dataset.attrs.get("certificate")
        if text is None:
            return None
        from jointplay.simulation.result.certificate import Certificate

        return Certificate.from_description(json.loads(text))

    @certificate.setter
    def certificate(self, certificate: Certificate) -> None:
        self.dataset.attrs["certificate"] = json.dumps(certificate.describe())

    def amend(self, **figures: Any) -> None:
        """Replace figures of the audit."""
        self.audit = dataclasses.replace(self.audit, **figures)
        self.dataset.attrs["audit"] = json.dumps(self.audit.describe())

    def completed(self, run: str = "the run") -> Result:
        """Return the result of a run that ran to its end.

        Raises:
            KeyboardInterrupt: it was interrupted.
            JointplayError: it stopped early; the message has the reason, and calls it `run`.
        """
        if self.status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        if self.status != Status.COMPLETED:
            raise JointplayError(f"{run} failed: {self.message.partition(' State: ')[0]}")
        return self

    @property
    def time(self) -> np.ndarray:
        """Times of the records [s]."""
        return self.dataset["time"].values

    @property
    def joints(self) -> list[str]:
        """Names of the clearance joints; empty for an ideal robot."""
        return (
            [str(name) for name in self.dataset["joint"].values] if "joint" in self.dataset else []
        )

    @property
    def values(self) -> list[Value]:
        """The values on which its figures depend, each with its origin."""
        return from_text(self.dataset.attrs["values"])

    @property
    def assumed(self) -> Table:
        """Table of the values that were assumed, each with its rule."""
        return value_table([value for value in self.values if value.assumed])

    @property
    def beside(self) -> dict[str, Any] | None:
        """The motion as it was meant, as plain data, where another was run to bring the tool there;
        None: the motion that was run."""
        text = self.dataset.attrs.get("beside")
        return None if text is None else json.loads(text)  # type: ignore[no-any-return]

    def summary(self) -> str:
        """The outcome in the lines that `jointplay run` prints: tool error, forces, rattle."""
        return provided("summary")(self)  # type: ignore[no-any-return]

    @cached_property
    def tool_error(self) -> ToolError:
        """Distance of the tool from the ideal robot's, which is simulated for it [m, rad]."""
        return provided("tool_error")(self)  # type: ignore[no-any-return]

    @property
    def forces(self) -> xr.DataArray:
        """Largest force since the last record in joints with clearance, (time, joint) [N]."""
        vectors = self["joint_force_peak"]
        sizes = vectors.reduce(np.linalg.norm, "axis").rename("forces")
        sizes.attrs = {"units": "N", "long_name": "largest joint force"}
        return sizes

    @property
    def rattle(self) -> Rattle:
        """Impacts a second, their energy, and the tool's vibration in bands of frequency."""
        return provided("rattle")(self)  # type: ignore[no-any-return]

    @property
    def plot(self) -> Plots:
        """Figures of this result: `result.plot.orbit()`, `.forces()`, `.deviation()` ..."""
        plots: Plots = provided("plots")(self)
        return plots

    @property
    def q(self) -> np.ndarray:
        """Coordinates (n, nq) [rad or m], in the order of the mechanism's model."""
        return self.dataset["q"].values

    @property
    def v(self) -> np.ndarray:
        """Velocities (n, nv) [rad/s or m/s], in the order of the mechanism's model."""
        return self.dataset["v"].values

    def to_dataframe(self, every: int = 1) -> pd.DataFrame:
        """Histories as a pandas table, one row a record, one column a number.

        The index is the `time` [s]. Columns are called ``tool_position.x``, ``q.joint_b.yaw``;
        ``attrs["units"]`` has their units. `every`: take only each n-th record and the last; peaks
        cover the records between.
        """
        frame: pd.DataFrame = provided("dataframe")(self, every)
        return frame

    def export(self, path: str | Path, to: str | None = None, **options: Any) -> Path:
        """Write a file for other programs: table, trajectory, ROS 2 bag.

        Args:
            path: the file.
            to: ``csv``, ``parquet``, ``trajectory`` or ``mcap``; None: by the file's ending.
            options, errors: see `jointplay.bridges.export`.
        """
        written: Path = provided("export")(self, path, to, **options)
        return written

    def _repr_html_(self) -> str:
        page: str = provided("notebook_page")(self)
        return page

    @cached_property
    def simulation(self) -> Simulation:
        """The simulation that made this result, built from the inputs in it.

        `result.simulation.run()` gives the same result, bit for bit on the same machine. A
        simulation with a law of the user's own that is not at hand (see `load`) can be read, and
        refuses to run: code that a file brings is never run.

        Raises:
            JointplayError: its inputs do not make a simulation.
        """
        kind: type[Simulation] = provided("simulation")
        with showing():
            try:
                return kind.from_description(json.loads(self.dataset.attrs["simulation"]))
            except JointplayError:
                raise
            except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
                reason = " ".join(str(error).split()) or type(error).__name__
                raise JointplayError(
                    f"the inputs in the result do not define a simulation: {reason}"
                ) from None

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write a NetCDF file with all parameters and versions inside, whole or not at all.

        If it cannot be written, the result is still here: save it to another place.

        Raises:
            JointplayError: the file exists (and `overwrite` is false) or cannot be written.
        """
        path = Path(path)
        if not overwrite and path.exists():
            raise files.exists(path)
        return files.write(path, netcdf.pack(self.dataset), overwrite=overwrite)

    @classmethod
    def load(
        cls,
        path: str | Path,
        every: int = 1,
        most: int | None = None,
        only: Collection[str] | None = None,
    ) -> Result:
        """Read a file that `save` or a long run wrote.

        A file runs no code. If it names a law of the user's own, `simulation` finds it only among
        those defined in this process or in modules that were imported by `import_module`.

        Args:
            path: the file.
            every: read only each n-th record and the last, as if the run had recorded so seldom:
                peaks cover the records between. A file of any size then fits into memory.
            most: largest number of records, about, in place of `every`.
            only: histories that are wanted, if not all records are; None: all.

        Raises:
            JointplayError: no such file, damaged, or not a jointplay result.
        """
        if require_whole("every", every, 1) == 1 and most is None:
            return cls.read(path, netcdf.load)
        from jointplay.simulation.result.thinning import thin

        with cls.read(path, partial(netcdf.open_lazily, indexed=False)).dataset as dataset:
            if most is not None:
                every = max(-(-dataset.sizes["time"] // most), 1)
            thinned = thin(dataset, every, only)
        simulation = json.loads(thinned.attrs["simulation"])
        simulation["record_every"] *= every
        thinned.attrs["simulation"] = json.dumps(simulation)
        return cls(thinned)

    def thinned(self, every: int) -> Result:
        """Each n-th record and the last one; peaks cover the records between (`thinning.thin`)."""
        if require_whole("every", every, 1) == 1 or self.dataset.sizes["time"] < 2:
            return self
        from jointplay.simulation.result.thinning import thin

        return Result(thin(self.dataset, every))

    @classmethod
    def open(cls, path: str | Path) -> Result:
        """Open a file that `save` or a long run wrote, and read its histories only when needed.

        All but the times stays on disk; a part such as ``result["q"].isel(time=slice(0, 1000))`` is
        read when its values are. Nothing is kept: whatever goes over all histories reads them
        again, and needs memory for them.

        Raises:
            JointplayError: no such file, damaged, without checksum, or not a jointplay result.
        """
        return cls.read(path, netcdf.open_lazily)

    @classmethod
    def read(cls, path: str | Path, reader: Callable[[Path], xr.Dataset]) -> Result:
        """Read a file by `reader`, and check its format and content."""
        require_a("path", path, "str", "Path")
        from jointplay.simulation.result.stored import check

        path = Path(path)
        files.require_file(path, "result file")
        dataset = reader(path)
        version = dataset.attrs.get("jointplay_format")
        if version is None:
            raise JointplayError(f"{str(path)!r} is not a jointplay result")
        if not isinstance(version, int | np.integer):
            raise JointplayError(f"{str(path)!r} is damaged: its format is not a whole number")
        if version != FORMAT:
            raise JointplayError(
                f"{str(path)!r} is a result of format {version}; this version reads only "
                f"format {FORMAT}: run it again"
            )
        check(dataset, path)
        return cls(dataset)
