"""Pages of the reference that are written from the source: nothing is said twice."""

import html
import importlib
import inspect
import re
import runpy
import sys
from pathlib import Path

import mkdocs_gen_files

import jointplay
from jointplay.base.tables import Table
from jointplay.cli import parser, parsers
from jointplay.cli.commands import GROUPS
from jointplay.cli.options import full_help
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS
from jointplay.show.reports.assumptions import all_assumptions

sys.path.insert(0, str(Path(__file__).parent))
from shown import PAGES, ROOT, answers

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
        text = (ROOT / source).read_text(encoding="utf-8")
        text = text.replace("](../docs/", "](../").replace("](docs/", "](../")
        for other, page in COPIED.items():  # they lie in one folder
            text = text.replace(f"]({other})", f"]({Path(page).name})")
        write(target, text)


def command_line():
    """A page for each command, and one that lists them by what they are for."""
    every = parsers()
    lines = ["# Command line", "", *INTRODUCTION]
    for title, names in GROUPS.items():
        lines += [f"## {title.capitalize()}", "", "| command | what it answers |", "| --- | --- |"]
        for name in (kind for name in names for kind in every if kind.split()[0] == name):
            page = f"commands/{name.replace(' ', '_')}.md"
            lines.append(f"| [`jointplay {name}`]({page}) | {answer(name)} |")
            write(f"reference/{page}", command_page(name, every[name]))
        lines.append("")
    whole = [action for action in parser()._actions if action.dest in ("version", "completion")]
    lines += ["## Options of jointplay itself", "", *options(parser(), whole), ""]
    write("reference/command_line.md", "\n".join(lines))


INTRODUCTION = (
    "`jointplay COMMAND --help` shows the most common options on one screen, `--help all` all that "
    'these pages show. Values are in SI units, or carry a unit, as in `"0.1 mm"`.',
    "",
)


def answer(name):
    """What a command answers, as the help says."""
    path = ".".join(["jointplay.cli.commands", *name.split()])
    title = inspect.getdoc(importlib.import_module(path)).split("\n\n")[0]
    text = " ".join(title.split()).partition(": ")[2]
    return text[0].upper() + text[1:]


def example(name, epilog):
    """A command with the first line that it prints: as the pages show it, else as the help does."""
    places = sorted(PAGES, key=lambda page: (page.stem != name.split()[-1], page != PAGES[0]))
    seen = [
        (" ".join(line.split()), printed)
        for page in places
        for line, printed in answers(page)
        if line.startswith(f"jointplay {name} ")
    ]
    seen += [(line, "") for line in _EXAMPLE.findall(epilog)]
    if not seen:
        return []
    line, printed = next((one for one in seen if one[1]), seen[0])
    return ["```console", f"$ {line}", *filter(None, [printed]), "```", ""]


_EXAMPLE = re.compile(r"Examples?: ([^;]+)")
_PAGE = re.compile(r"docs/(\w+)\.md")
_KEY = re.compile(r": ([a-z_]+\.[\w.]+)(?=$| \(repeatable\))")
"""The key of a scenario that an option stands for, at the end of its help."""


def options(command, actions):
    """Arguments or options with what is said of them, as a list of definitions."""
    called = command._get_formatter()._format_action_invocation
    lines = ['<dl class="options">']
    for action in actions:
        said = html.escape(full_help(action).replace("%%", "%").strip(), quote=False)
        said = _KEY.sub(r' (<a href="../keys.html"><code>\1</code></a>)', said)
        said = _PAGE.sub(r'<a href="../../\1.html">\1</a>', said)
        mark = f' id="{action.option_strings[-1]}"' if action.option_strings else ""
        head = html.escape(called(action), quote=False)
        lines.append(f"<dt{mark}><code>{head}</code></dt><dd>{said}</dd>")
    return [*lines, "</dl>"]


TITLES = {"positional arguments": "Arguments"}
"""Of groups that argparse makes itself."""


def command_page(name, command):
    """The page of a command: what it answers, how it is typed, an example, all of its options."""
    command.help_text(True)  # fills in what takes long
    epilog = command.epilog or ""
    lines = [f"# jointplay {name}", "", f"**{answer(name)}**", ""]
    lines += ["```text", command.usage, "```", "", command.description, "", *example(name, epilog)]
    for group in command._action_groups:
        shown = [action for action in group._group_actions if action.dest != "help"]
        if shown:
            title = TITLES.get(group.title, group.title[0].upper() + group.title[1:])
            lines += [f"## {title}", "", *options(command, shown), ""]
    lines += [epilog[: epilog.find("Example")] if "Example" in epilog else epilog, ""]
    text = _PAGE.sub(r"[\1](../../\1.md)", "\n".join(lines))
    return f"{text}\n[All commands](../command_line.md)\n"


def law_tables():
    lines = [
        "# Laws by name",
        "",
        "This page is generated from the source; [Laws](../laws.md) explains the laws.",
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
    head = "# What reports assume\n\nReports list these for each run to which they apply.\n\n"
    table = Table.of_texts([("runs with", "assumed"), *all_assumptions()])
    write("reference/assumptions.md", f"{head}{table.markdown()}\n")


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
        "All that `import jointplay as jp` and its packages offer, by module. Units are SI.",
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
