from .figures import save as save
from .names import file_names as file_names
from .names import is_paper_robot as is_paper_robot
from .result import Plots as Plots
