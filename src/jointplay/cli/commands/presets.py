"""`jointplay presets`: what is publicly known of robots' joints, with the origin of each number.

List presets: bearings, gears and servos of robots as far as they are publicly known, and classes
for robots of which nothing is. Each number says whether it was seen in a public source, estimated
from one, or assumed.

Use one with --preset: jointplay run so101 --preset

    [NAME]  one preset
"""

import argparse


def run(options: argparse.Namespace) -> int:
    from jointplay.scenario.presets import preset, presets

    names = presets() if options.name is None else [options.name]
    print("\n".join(str(preset(name)) for name in names))
    return 0
