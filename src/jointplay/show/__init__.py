"""What people look at: figures, reports, playback in a browser, the live page.

`plots` draws results, budgets and studies, `reports` are pages about runs, `player` moves a robot
in the browser (meshcat), `live` answers sliders. Nothing here computes what another package could.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
