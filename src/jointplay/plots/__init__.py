"""Figures: of one run (`result.plot`), and those that compare several cases."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.plots.accessor import Plots as Plots
    from jointplay.plots.figures import FIGURES as FIGURES
    from jointplay.plots.figures import NEEDS_CLEARANCE as NEEDS_CLEARANCE
    from jointplay.plots.figures import is_paper as is_paper
    from jointplay.plots.figures import joint_of as joint_of
    from jointplay.plots.figures import save as save
    from jointplay.plots.figures import save_pdf as save_pdf
    from jointplay.plots.names import file_names as file_names
    from jointplay.plots.names import is_paper_robot as is_paper_robot
    from jointplay.plots.palette import COLOURS as COLOURS
    from jointplay.plots.palette import Cases as Cases
    from jointplay.plots.palette import reference as reference
    from jointplay.plots.style import STYLES as STYLES

__getattr__ = offering(
    __name__,
    {
        "Plots": "accessor",
        "FIGURES": "figures",
        "NEEDS_CLEARANCE": "figures",
        "is_paper": "figures",
        "joint_of": "figures",
        "save": "figures",
        "save_pdf": "figures",
        "file_names": "names",
        "is_paper_robot": "names",
        "COLOURS": "palette",
        "Cases": "palette",
        "reference": "palette",
        "STYLES": "style",
    },
)
