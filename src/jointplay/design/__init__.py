"""What clearances cost and buy: budgets, allocation, reduced models, ISO 9283, wear."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
