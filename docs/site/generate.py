"""Pages of the reference that are written from the source: nothing is said twice."""

import inspect
import runpy
from pathlib import Path

import mkdocs_gen_files

import jointplay
from jointplay.cli import parsers
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS
from jointplay.show.reports.assumptions import page_section

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
    lines = ["# Command line", "", "Every command and option, as `--help all` prints them.", ""]
    for name, command in parsers().items():
        said = command.help_text(True).rstrip()
        lines += [f"## jointplay {name}", "", "```text", said, "```", ""]
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


def assumptions():
    head = "# What reports assume\n\nAs reports state it for each run to which it applies.\n\n"
    write("reference/assumptions.md", head + page_section())


def script(name):
    return runpy.run_path(str(Path(__file__).with_name(f"{name}.py")))


def pages():
    """Pages that scripts beside this one make."""
    for name in ("references", "keys", "variables"):
        write(f"reference/{name}.md", script(name)["page"]())


def law_cards():
    for name, content in script("law_cards")["Cards"]().files():
        with mkdocs_gen_files.open(f"law_cards/{name}", "wb") as file:
            file.write(content if isinstance(content, bytes) else content.encode())


def measured():
    """Pages whose tables come from what a benchmark wrote."""
    tables = script("tables")
    write("validation.md", tables["filled"]("validation.md", tables["validation"]()))
    write("robots.md", tables["filled"]("robots.md", tables["tried"]()))
    write("peers.md", tables["filled"]("peers.md", tables["peers"]()))
    write("reference/peers.md", tables["peers_numbers"]())


def first_line(thing):
    return (inspect.getdoc(thing) or "").split("\n")[0]


def api():
    """A page for each module that offers something, and one that lists them all."""
    modules = {}
    offered = [getattr(jointplay, name) for name in jointplay.__all__]
    for package in filter(inspect.ismodule, offered):
        offered += [getattr(package, name) for name in package.__all__]
    for thing in offered:
        module = getattr(thing, "__module__", "")
        if module.startswith("jointplay") and (inspect.isclass(thing) or inspect.isfunction(thing)):
            modules.setdefault(module, {})[thing.__name__] = thing
    lines = [
        "# Python",
        "",
        "What `import jointplay as jp` offers, with its packages, by module. Units are SI.",
        "",
    ]
    package = ""
    for module, things in sorted(modules.items()):
        _, inside, *_ = module.split(".")
        if inside != package:
            package = inside
            lines += [f"## {package}", ""]
            lines += ["| module | offers |", "| --- | --- |"]
        page = module.removeprefix("jointplay.")
        links = (
            f"[`{name}`](api/{page}.md#{module}.{name}): {first_line(thing)}".replace("|", "\\|")
            for name, thing in sorted(things.items())
        )
        lines.append(f"| [{page}](api/{page}.md) | {'<br>'.join(links)} |")
        text = [f"# {page}", "", first_line(inspect.getmodule(next(iter(things.values())))), ""]
        text += [f"::: {module}.{name}\n" for name in sorted(things)]
        text += ["[All modules](../python.md)", ""]
        write(f"reference/api/{page}.md", "\n".join(text))
    # A table ends where the next heading begins.
    write("reference/python.md", "\n".join(lines).replace("\n## ", "\n\n## "))


copies()
command_line()
law_tables()
assumptions()
pages()
law_cards()
measured()
api()
