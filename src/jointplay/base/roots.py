"""A root of a function of one number, as `scipy.optimize.brentq` finds it.

`scipy.optimize` takes half a second to import, which every run would spend on its contact law.
"""

import math
from collections.abc import Callable

MOST_STEPS = 100


def brentq(
    function: Callable[[float], float],
    low: float,
    high: float,
    xtol: float = 2e-12,
    rtol: float = 8.881784197001252e-16,
) -> float:
    """Where a function that changes its sign between `low` and `high` is zero.

    Secants, inverse parabolas and halving in the order in which scipy tries them: the numbers are
    the same.

    Raises:
        ValueError: the signs at both ends are the same.
        RuntimeError: not found in `MOST_STEPS` steps.
    """
    before, x = float(low), float(high)
    f_before, f = float(function(before)), float(function(x))
    if f_before == 0.0:
        return before
    if f == 0.0:
        return x
    if math.copysign(1.0, f_before) == math.copysign(1.0, f):
        raise ValueError("f(a) and f(b) must have different signs")
    other, f_other, step, last = 0.0, 0.0, 0.0, 0.0
    for _ in range(MOST_STEPS):
        if f_before != 0.0 and f != 0.0 and math.copysign(1.0, f_before) != math.copysign(1.0, f):
            other, f_other = before, f_before
            last = step = x - before
        if abs(f_other) < abs(f):
            before, x, other = x, other, x
            f_before, f, f_other = f, f_other, f
        near = (xtol + rtol * abs(x)) / 2.0
        half = (other - x) / 2.0
        if f == 0.0 or abs(half) < near:
            return x
        tried = math.inf
        if abs(last) > near and abs(f) < abs(f_before):
            if before == other:
                tried = -f * (x - before) / (f - f_before)
            else:
                a, b = (f_before - f) / (before - x), (f_other - f) / (other - x)
                below = b * a * (f_other - f_before)
                if below != 0.0:
                    tried = -f * (f_other * b - f_before * a) / below
        good = 2.0 * abs(tried) < min(abs(last), 3.0 * abs(half) - near)
        last, step = (step, tried) if good else (half, half)
        before, f_before = x, f
        x += step if abs(step) > near else math.copysign(near, half)
        f = float(function(x))
    raise RuntimeError(f"no root found in {MOST_STEPS} steps")
