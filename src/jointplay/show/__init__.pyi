from . import live as live
from . import player as player
from . import plots as plots
from . import reports as reports
