"""Figures: of one run (`result.plot`), and those that compare several cases."""

from jointplay.plots.accessor import Plots as Plots
from jointplay.plots.figures import FIGURES as FIGURES
from jointplay.plots.figures import NEEDS_CLEARANCE as NEEDS_CLEARANCE
from jointplay.plots.figures import Cases as Cases
from jointplay.plots.figures import file_names as file_names
from jointplay.plots.figures import is_paper as is_paper
from jointplay.plots.figures import is_paper_robot as is_paper_robot
from jointplay.plots.figures import joint_of as joint_of
from jointplay.plots.figures import reference as reference
from jointplay.plots.figures import save as save
from jointplay.plots.figures import save_pdf as save_pdf
from jointplay.plots.style import COLOURS as COLOURS
from jointplay.plots.style import STYLES as STYLES
