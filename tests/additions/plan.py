"""A plan of one's own: each setting of some is changed alone, by a factor up and down."""

from dataclasses import replace


def one_at_a_time(base, factor, **settings):
    """Simulations by name; `settings` are fields of `base` with their values in the middle."""
    changed = {"base": base}
    for name, value in settings.items():
        changed[f"{name} up"] = replace(base, **{name: value * factor})
        changed[f"{name} down"] = replace(base, **{name: value / factor})
    return changed
