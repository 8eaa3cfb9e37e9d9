"""Pages of the reference that are written from the source: nothing is said twice."""

import argparse
import inspect
import runpy
from pathlib import Path

import mkdocs_gen_files

import jointplay
from jointplay.cli import parser
from jointplay.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS
from jointplay.scenario.schema import schema

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


def scenario_keys():
    whole = schema()
    lines = [
        "# Keys of scenarios",
        "",
        "Every table that a scenario file can have, with its keys: written from the schema that "
        "checks the files. [Scenario files](../scenarios.md) explains how they fit together.",
        "",
        "## The file",
        "",
        *table(whole, whole["properties"]),
    ]
    for name, part in sorted(whole["$defs"].items()):
        if name == "Case" or not part.get("properties"):
            continue
        about = (part.get("description") or "").split("\n")[0]
        word = next(
            (part["properties"][key]["const"] for key in ("law", "kind")
             if "const" in part["properties"].get(key, {})), None
        )  # fmt: skip
        selected = f"Selected by `{word}`. " if word else ""
        lines += ["", f"## {name}", "", selected + escaped(about), ""]
        lines += table(whole, part["properties"])
    write("reference/scenario_keys.md", "\n".join(lines) + "\n")


def table(whole, properties):
    rows = ["| key | value | meaning |", "| --- | --- | --- |"]
    for key, part in properties.items():
        text = " ".join((part.get("description") or "").split()).replace("``", "`")
        rows.append(f"| `{key}` | {escaped(kinds(part))} | {escaped(text)} |")
    return rows


def kinds(part):
    """What a key can hold, in words; tables are linked."""
    if part.get("$ref", "").endswith("/Case"):
        return "the tables above"
    if "$ref" in part:
        name = part["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in part:
        return f"`{part['const']}`"
    if "enum" in part:
        return ", ".join(f"`{word}`" for word in part["enum"])
    for word in ("anyOf", "allOf"):
        if word in part:
            found = []
            for one in part[word]:
                found += [text for text in [kinds(one)] if text and text not in found]
            return " or ".join(found)
    kind = part.get("type")
    if kind == "array":
        return f"list of {kinds(part.get('items', {})) or 'values'}"
    if kind == "object":
        inner = part.get("additionalProperties")
        return f"tables by name: {kinds(inner)}" if isinstance(inner, dict) else "table"
    names = {
        "number": "number",
        "string": "text",
        "integer": "whole number",
        "boolean": "true, false",
    }
    if isinstance(kind, list):
        return "number, or text with its unit"
    return names.get(kind, "")


def escaped(text):
    return text.replace("|", "\\|")


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
scenario_keys()
law_tables()
references()
api()
