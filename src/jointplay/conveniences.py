"""What methods of lower layers do with upper ones, each imported when it is first called."""

from jointplay.base.conveniences import provide


@provide
def plots() -> object:
    """Of `Result.plot`."""
    from jointplay.show.plots import Plots

    return Plots


@provide
def dataframe() -> object:
    """Of `Result.to_dataframe`."""
    from jointplay.bridges.table import dataframe

    return dataframe


@provide
def export() -> object:
    """Of `Result.export`."""
    from jointplay.bridges import export

    return export


@provide
def notebook_page() -> object:
    """Of a result in a notebook."""
    from jointplay.bridges.notebook import page

    return page


@provide
def simulation() -> object:
    """Of `Result.simulation`."""
    from jointplay.simulation import Simulation

    return Simulation


@provide
def errors_of_run() -> object:
    """Of `Simulation.run`."""
    from jointplay.simulation.analysis.certification import errors_if_possible

    return errors_if_possible
