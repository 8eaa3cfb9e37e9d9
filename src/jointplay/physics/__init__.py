"""What happens in a joint: geometry, laws of force, kinds of joint, the kernel.

`geometry` finds where bodies touch, `contact` has the laws of force (eqs 10 to 21 and others),
`joints` says what a joint with clearance is, kind by kind, and `kernel` is the compiled code that
steps through time. Nothing here knows of robots' descriptions, motions, results or studies: what
the kernel is given are arrays.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
