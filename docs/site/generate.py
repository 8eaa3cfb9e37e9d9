"""Pages of the reference that are written from the source: nothing is said twice."""

import argparse
import inspect
import runpy
from pathlib import Path

import mkdocs_gen_files

import jointplay
from jointplay.cli import parser
from jointplay.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS

ROOT = Path(__file__).parents[2]
COPIED = {
    "SECURITY.md": "reference/security.md",
    "CHANGELOG.md": "reference/changes.md",
    "benchmarks/README.md": "reference/benchmarks.md",
}


def write(path, text):
    with mkdocs_gen_files.open(path, "w") as file:
        file.write(text)


def copies():
    for source, target in COPIED.items():
        write(target, (ROOT / source).read_text(encoding="utf-8").replace("](../docs/", "](../")
              .replace("](docs/", "](../"))  # fmt: skip


def command_line():
    made = parser()
    lines = ["# Command line", "", "Every command and option, as `--help` prints them.", ""]
    (choices,) = [a for a in made._actions if isinstance(a, argparse._SubParsersAction)]
    for name, command in choices.choices.items():
        lines += [f"## jointplay {name}", "", "```text", command.format_help().rstrip(), "```", ""]
    write("reference/command_line.md", "\n".join(lines))


def law_tables():
    lines = [
        "# Laws by name",
        "",
        "Written from the laws themselves; [Laws](../laws.md) explains them.",
        "",
    ]
    for title, laws in (
        ("Normal force", NORMAL_LAWS), ("Friction", FRICTION_LAWS), ("Films", FILM_LAWS)
    ):  # fmt: skip
        lines += [f"## {title}", ""]
        for word, law in laws.items():
            lines += [f"### {word}", ""]
            if getattr(law, "formula", ""):
                lines += [f"$$\n{law.formula}\n$$", ""]
            lines += [f"`{law.__name__}`. Holds for {law.validity}.", "", f"{law.reference}.", ""]
    write("reference/law_tables.md", "\n".join(lines))


def references():
    script = runpy.run_path(str(Path(__file__).with_name("references.py")))
    write("reference/references.md", script["page"]())


def api():
    homes = {}
    offered = [getattr(jointplay, name) for name in jointplay.__all__]
    for package in filter(inspect.ismodule, offered):
        offered += [getattr(package, name) for name in package.__all__]
    for thing in offered:
        module = getattr(thing, "__module__", "")
        if module.startswith("jointplay") and (inspect.isclass(thing) or inspect.isfunction(thing)):
            homes.setdefault(module.split(".")[1], set()).add(f"{module}.{thing.__name__}")
    lines = [
        "# Python",
        "",
        "What `import jointplay as jp` offers, with the packages it shows, by what it is about. "
        "Units are SI.",
        "",
    ]
    for group, names in sorted(homes.items()):
        lines += [f"## {group.capitalize()}", ""]
        lines += [f"::: {name}\n" for name in sorted(names)]
    write("reference/api.md", "\n".join(lines))


copies()
command_line()
law_tables()
references()
api()
