"""Physics of joints: geometry, contact laws, kinds of joint, the compiled time loop.

`geometry` finds where bodies touch, `contact` has the laws of force (eqs 10 to 21 and others),
`joints` the kinds of joint with clearance, and `kernel` the compiled code that steps through time.
Nothing here knows of robots' descriptions, motions, results or studies: the kernel is given arrays.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
