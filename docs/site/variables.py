"""The reference of what results and sweeps hold, made from the source."""

import runpy
from pathlib import Path

import jinja2

from jointplay.base.schema import explanations, fields_of
from jointplay.physics.kernel import Status
from jointplay.simulation.result.audit import Audit
from jointplay.simulation.result.result import FORMAT
from jointplay.simulation.result.variables import HISTORIES
from jointplay.study.measures import shipped

units = runpy.run_path(str(Path(__file__).with_name("keys.py")))["units"]


def histories(owner):
    lines = ["| variable | dims | unit | meaning |", "| --- | --- | --- | --- |"]
    for name, one in HISTORIES.items():
        if one.of == owner:
            dims, text = ", ".join(("time", *one.dims)), one.text.format(tool="of the tool")
            lines.append(f"| `{name}` | {dims} | {one.unit} | {text} |")
    return lines


def audit():
    texts = explanations(Audit)
    lines = ["| field | meaning |", "| --- | --- |"]
    for name, field in fields_of(Audit).items():
        text = texts.get(name, "").replace("``", "`")
        text += units(field) if "[" not in text else ""
        lines.append(f"| `{name}` | {text} |")
    return lines


def measures():
    lines = ["| measure | unit | meaning |", "| --- | --- | --- |"]
    lines += [f"| `{name}` | {unit} | {text} |" for name, (unit, text) in shipped(()).items()]
    return lines


def page():
    """The page, as Markdown."""
    owners = sorted({one.of for one in HISTORIES.values()})
    text = Path(__file__).with_name("variables.md.jinja").read_text(encoding="utf-8")
    return jinja2.Template(text, keep_trailing_newline=True).render(
        histories={owner: "\n".join(histories(owner)) for owner in owners},
        audit="\n".join(audit()),
        measures="\n".join(measures()),
        format=FORMAT,
        statuses=", ".join(f"`{one.name.lower()}`" for one in Status),
    )
