"""Analysis of results: tool error and its causes, contacts, spectra, rattle, bearing life."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
