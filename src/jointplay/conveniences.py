"""What methods of lower layers do with upper ones, each imported when it is first called."""

from jointplay.core.imports import provide


@provide
def plots() -> object:
    """Of `Result.plot`."""
    from jointplay.plots import Plots

    return Plots


@provide
def dataframe() -> object:
    """Of `Result.to_dataframe`."""
    from jointplay.exports.table import dataframe

    return dataframe


@provide
def export() -> object:
    """Of `Result.export`."""
    from jointplay.exports import export

    return export


@provide
def notebook_page() -> object:
    """Of a result in a notebook."""
    from jointplay.exports.notebook import page

    return page


@provide
def simulation() -> object:
    """Of `Result.simulation`."""
    from jointplay.simulation import Simulation

    return Simulation


@provide
def errors_of_run() -> object:
    """Of `Simulation.run`."""
    from jointplay.analysis.certification import errors_if_possible

    return errors_if_possible
