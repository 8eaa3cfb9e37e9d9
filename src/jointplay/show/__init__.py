"""Figures, reports, playback in a browser, and the live page.

`plots` draws results, budgets and studies; `reports` writes pages about runs; `player` moves a
robot in the browser (meshcat); `live` serves a page with sliders. What they show is computed by the
packages below.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
