"""Limits and fits compared with two packages on PyPI, pressfit and isofits, at every size.

`pip install pressfit isofits`; what is not installed is left out. isofits 1.0 installs modules of
such names as `data`, so its tables are read from its file, without importing it. Six of its limits
contradict its own others, and this benchmark says so of each: deviation and tolerance of E7 above
315 mm, K6 of 6 to 10 mm and f6 above 120 mm do not have the sum that it has.
"""

import re
import runpy
from importlib import metadata

from common import command

from jointplay.base.tables import Table
from jointplay.physics.joints.fits import limits, tables

KNOWN = {
    ("isofits", "E7", 355): "E 125 and IT7 57 make 182, not 185",
    ("isofits", "E7", 400): "E 125 and IT7 57 make 182, not 185",
    ("isofits", "K6", 10): "its IT6 is 9 (its H6), 2 - 9 = -7, not -6",
    ("isofits", "f6", 140): "f 43 and IT6 25 make -68 (its f5 -61, f7 -83), not -48",
    ("isofits", "f6", 160): "f 43 and IT6 25 make -68 (its f5 -61, f7 -83), not -48",
    ("isofits", "f6", 180): "f 43 and IT6 25 make -68 (its f5 -61, f7 -83), not -48",
}
"""Where they differ, and why this package's is right."""


def of_isofits():
    """Size [mm], letter, grade, lower and upper deviation [µm] of all in its tables."""
    data = runpy.run_path(str(metadata.distribution("isofits").locate_file("data.py")))
    for table in (data["hole_data"], data["shaft_data"]):
        for name in table.keys() - {"over", "inc."}:
            letter, grade = re.fullmatch(r"([A-Za-z]+)(\d+)", name).groups()
            for size, text in zip(table["inc."], table[name], strict=True):
                upper, lower = map(float, text.split())
                yield int(size), letter, int(grade), lower, upper


def of_pressfit():
    """The same at the ends of all steps of sizes, of each hole and shaft that it has."""
    import pressfit
    from pressfit.tables import GRADES, SHAFT_LETTERS

    for size in tables()["sizes"]["fine_steps"]:
        for letter in SHAFT_LETTERS:
            for grade in GRADES:
                fit = pressfit.fit(f"{size} H{grade}/{letter}{grade}")
                yield size, "H", grade, fit.hole_ei_um, fit.hole_es_um
                yield size, letter, grade, fit.shaft_ei_um, fit.shaft_es_um


def main():
    command(__doc__, quick="the same: nothing takes long").parse_args()
    rows, failed = [], 0
    for name, source in (("isofits", of_isofits), ("pressfit", of_pressfit)):
        try:
            metadata.version(name)
        except metadata.PackageNotFoundError:
            print(f"{name} is not installed: pip install {name}")
            continue
        seen = {(one[1:3], one[0]): one for one in source()}
        for size, letter, grade, lower, upper in seen.values():
            ours = limits(size, letter, grade)
            if ours == (lower, upper):
                continue
            why = KNOWN.get((name, f"{letter}{grade}", size), "")
            failed += not why
            both = f"{lower:g} to {upper:g}", f"{ours.lower:g} to {ours.upper:g}"
            rows.append((name, f"{letter}{grade}", f"up to {size} mm", *both, why or "unexplained"))
        rows.append((name, f"{len(seen)} limits", "", "", "", ""))
    if rows:
        head = ("package", "class", "size", "theirs [µm]", "here [µm]", "why")
        print(Table.of_texts([head, *rows]))
    return 1 if failed else 0
