"""Inputs that no one should give: URDFs, scenarios, motions, options and results, each from a seed.

A case is what a command is called with, and whether it must be refused. Whatever the input, a
command either does its work or says in one line why it cannot; it never shows a traceback, hangs,
crashes, or takes what makes no sense in silence.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import traceback
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from jointplay import cli
from jointplay.mechanism.urdf import shipped
from jointplay.result import netcdf
from jointplay.study import scara

NASTY = (
    "", " ", "nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "-1e308", "1e-308", "1e400", "--",
    "-", "..", "../../../etc/passwd", "/dev/null", "a" * 300, "9" * 400, "0x10", "1e5000000 m",
    "1 m m",
    "true", "None", "'", '"', "[[", "{}", "%s", "{0}", "<script>alert(1)</script>", "&amp;", "é",
    "\N{GREEK SMALL LETTER MU}", "\N{PILE OF POO}", "..:x", "os:system", "a\tb", "1,2", "1;2",
    "1_0", "0 0 0", "1 2", "10**10**10 m", "/10**9 m", "m", "12 parsec", "-5 mm", "1e300",
    "1e-300", "0.5",
    "joint_a", "joint_b", "world", "base", "universe", "custom", "hertz", "revolute", "prismatic",
    "\x7f", "\u202e", "((((((((((", "# no", "\\", "$HOME", "~",
)  # fmt: skip
"""What is put in the place of names, numbers and words."""

KINDS = ("urdf", "toml", "csv", "options", "result")


@dataclass
class Case:
    """A call of the command line."""

    seed: int
    kind: str
    arguments: list[str]
    bad: bool = False
    """Whether it must be refused."""
    note: str = ""
    outcome: str = field(default="", compare=False)


def make(seed: int, folder: Path) -> Case:
    """The case of a seed; its files go into `folder`, which is empty."""
    rng = random.Random(seed)
    kind = KINDS[seed % len(KINDS)]
    return {"urdf": _urdf, "toml": _toml, "csv": _csv, "options": _options, "result": _result}[
        kind
    ](seed, rng, folder)


def judge(case: Case) -> str:
    """Call the command: "" if it did what it should, else "traceback ..." or "silent ..."."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = cli.main(case.arguments)
    except SystemExit as ended:
        status = ended.code
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return f"traceback {type(error).__name__} at {where}: {str(error)[:200]}"
    said = [line for line in err.getvalue().splitlines() if line.strip()]
    if status == 0:
        return "silent: taken, although it must be refused" if case.bad else ""
    if status == 1 and out.getvalue():
        return ""  # a run that stopped early, and said so
    if status == 2 and len(said) == 1 and "error: " in said[0]:
        return ""
    return f"silent: status {status}, {len(said)} lines: {said[:3]}"


def mutated(text: str, rng: random.Random, times: int) -> str:
    """Text with pieces of it deleted, doubled, exchanged, or replaced by what is nasty."""
    for _ in range(times):
        way = rng.randrange(6)
        at, end = sorted(rng.randrange(len(text) + 1) for _ in range(2))
        end = min(end, at + 40)
        if way == 0:
            text = text[:at] + text[end:]
        elif way == 1:
            text = text[:end] + text[at:end] + text[end:]
        elif way == 2:
            text = text[:at] + rng.choice(NASTY) + text[end:]
        elif way == 3:
            text = text[:at] + chr(rng.choice((0, 1, 10, 34, 39, 60, 91, 123, 0xFFFE))) + text[at:]
        else:
            text = _value_replaced(text, rng)
        text = text or " "
    return text


def _value_replaced(text: str, rng: random.Random) -> str:
    """One quoted or numeric value replaced: the form stays, the meaning does not."""
    import re

    found = list(re.finditer(r'"([^"\n]*)"|(?<=[=\s\[,])-?\d[\d.e+-]*', text))
    if not found:
        return text
    one = rng.choice(found)
    new = rng.choice(NASTY)
    if one.group().startswith('"'):
        new = '"' + new.replace('"', "").replace("\\", "") + '"'
    return text[: one.start()] + new + text[one.end() :]


URDF_MUST = (
    ('<axis xyz="0 0 1"', '<axis xyz="0 0 0"'),
    ("<inertial><origin xyz=", '<inertial><origin xyz="nan 0 0" wrong='),
    ("<inertial><origin xyz=", '<inertial><origin xyz="0 0" wrong='),
    ("<link name=", "<link nome="),
    ('<axis xyz="0 0 1"', '<axis xyz="0 inf 1"'),
)
"""What makes any URDF impossible."""


@cache
def _scara_urdf() -> str:
    import re

    text = shipped("scara.urdf").read_text(encoding="utf-8")
    return re.sub(r"<inertial>\s*<origin", "<inertial><origin", text)


def _urdf(seed: int, rng: random.Random, folder: Path) -> Case:
    text, bad = _scara_urdf(), False
    if rng.random() < 0.3:
        old, new = rng.choice(URDF_MUST)
        bad = old in text
        text = text.replace(old, new, 1)
    else:
        text = mutated(text, rng, rng.randint(1, 3))
    (folder / "r.urdf").write_bytes(text.encode("utf-8", "surrogatepass"))
    joint = rng.choice(("joint_b", "joint_b", "joint_a", "stroke", "x"))
    call = ["urdf", "--urdf", str(folder / "r.urdf"), "--joint", joint]
    return Case(seed, "urdf", [*call, "--out", str(folder / "o.urdf")], bad or joint == "x")


TOML_MUST = (
    ('radial_clearance = "0.2 mm"', 'radial_clearance = "-0.2 mm"'),
    ('radial_clearance = "0.2 mm"', 'radial_clearance = "0.2 s"'),
    ('step = "10 us"', "step = 0"),
    ('step = "10 us"', 'step = "1e5000000 s"'),
    ('step = "10 us"', "step = 1e-300"),
    ("record_every = 10", "record_every = " + "1" * 400),
    ("record_every = 10", "record_every = 100000000000000000000"),
    ("# seed = 1 ", "seed = -1 "),
    ('bandwidth = "100 rad/s"', "bandwidth = 1e300"),
    ('normal = "lankarani-nikravesh"', 'normal = { law = "custom", function = "..:x" }'),
    ('normal = "lankarani-nikravesh"', 'normal = { law = "custom", function = "os:system" }'),
    ("[motion]", "a = " + "[" * 3000 + "]" * 3000 + "\n[motion]"),
    ("[motion]", ".".join(["a"] * 3000) + " = 1\n[motion]"),
    ('# duration = "0.8 s"', "duration = 1e12"),
    ('gravity = "balanced"', "gravity = [0, 0, nan]"),
)


def _template() -> str:
    return (Path(cli.__file__).parent / "scenario" / "template.toml").read_text(encoding="utf-8")


def _toml(seed: int, rng: random.Random, folder: Path) -> Case:
    text, bad = _template(), False
    if rng.random() < 0.3:
        old, new = rng.choice(TOML_MUST)
        assert old in text, old
        text, bad = text.replace(old, new, 1), True
    else:
        text = mutated(text, rng, rng.randint(1, 4))
    (folder / "s.toml").write_bytes(text.encode("utf-8", "surrogatepass"))
    return Case(seed, "toml", ["check", str(folder / "s.toml"), "--no-picture"], bad)


def _csv(seed: int, rng: random.Random, folder: Path) -> Case:
    text = "time_s,joint_a,joint_b\n0,0,0\n0.1,0.2,-0.3\n0.2,0,0.1\n"
    must = (
        text.replace("0.1,0.2", "0.1,nan"),
        text.replace("0.2,-0.3", '"0\n2",-0.3'),
        text.replace("0.1,", "-0.1,"),
        text.replace("joint_a,joint_b", "joint_a,joint_a"),
        text.replace("joint_a", "no_joint"),
        text.replace("time_s", "time"),
        text[:20],
    )
    bad = rng.random() < 0.4
    text = rng.choice(must) if bad else mutated(text, rng, rng.randint(1, 3))
    (folder / "m.csv").write_bytes(text.encode("utf-8", "surrogatepass"))
    scenario = '[robot]\nurdf = "jointplay:scara.urdf"\n[motion]\nfile = "m.csv"\n'
    (folder / "s.toml").write_text(scenario, encoding="utf-8")
    return Case(seed, "csv", ["check", str(folder / "s.toml"), "--no-picture"], bad)


VALUES = (
    "--joint", "--tool", "--gravity", "--allow-unphysical", "--radial", "--axial",
    "--bearing-radius", "--bearing-length", "--journal-radius", "--journal-length", "--young",
    "--poisson", "--stiffness", "--axial-stiffness", "--law", "--restitution", "--damping",
    "--impact-mass", "--friction", "--motion", "--interpolation", "--bandwidth",
    "--damping-ratio", "--joint-friction", "--seed", "--integrator", "--record-every", "--urdf",
)  # fmt: skip

OPTIONS_MUST = (
    ["--seed", "-1"], ["--step", "1e-300"], ["--record-every", "1" + "0" * 30], ["--tool=--"],
    ["--bandwidth", "1e300"], ["--radial", "-1e-4"], ["--radial", "nan"], ["--friction", "-1"],
    ["--restitution", "0"], ["--joint", "nobody"], ["--gravity", "nan,0,0"], ["--step", "0"],
    ["--duration", "1e300"], ["--urdf", "a" * 300], ["--motion", "a\tb"],
)  # fmt: skip


def _options(seed: int, rng: random.Random, folder: Path) -> Case:
    call = ["run", "--duration", "1e-4", "--no-figures", "--quiet", "--out", str(folder / "out")]
    if rng.random() < 0.4:
        return Case(seed, "options", call + rng.choice(OPTIONS_MUST), True)
    for _ in range(rng.randint(1, 2)):
        value = rng.choice(NASTY)
        call.append(f"{rng.choice(VALUES)}={value}")
    return Case(seed, "options", call)


@cache
def _run() -> Any:
    """A short run with clearance."""
    import dataclasses

    return dataclasses.replace(scara(2e-4, seed=1), duration=1e-3).run()


@cache
def _sealed() -> bytes:
    return netcdf.pack(_run().dataset)


def _result(seed: int, rng: random.Random, folder: Path) -> Case:
    way = rng.randrange(4)
    bad = way < 2
    if way == 0:  # bits that fell over
        data = bytearray(_sealed())
        for _ in range(rng.choice((1, 1, 3, 30))):
            data[rng.randrange(len(data) - 90)] ^= 1 << rng.randrange(8)
        content = bytes(data)
        bad = content != _sealed()
    elif way == 1:
        content = _sealed()[: rng.randrange(len(_sealed()) - 90)]
        # Without its checksum another process would have to look at it first: a second each.
        content = content[:-80] + netcdf.SEAL + b"0" * 64 + b"\n"
    else:
        content = netcdf.pack(_edited(rng))
    (folder / "r.nc").write_bytes(content)
    file, html = str(folder / "r.nc"), str(folder / "o.html")
    show = ["play", file, "--html", html, "--quiet", "--no-ghost"]
    if rng.random() < 0.5:
        show = ["report", file, "-o", html, "--impacts", "0", "--no-pdf", "--quiet"]
    return Case(seed, "result", show, bad)


def _edited(rng: random.Random) -> Any:
    """A run whose attributes or histories another has edited."""
    dataset = _run().dataset.copy(deep=True)
    way = rng.randrange(4)
    if way == 0:
        name = rng.choice(list(dataset.attrs))
        dataset.attrs[name] = rng.choice((*NASTY[1:], 0, 1.5, "[" * 3000, "{}", "[]", "null"))
    elif way == 1:
        name = rng.choice(("simulation", "audit"))
        content = json.loads(dataset.attrs[name])
        _edit(content, rng)
        dataset.attrs[name] = json.dumps(content)
    elif way == 2:
        name = rng.choice(list(dataset.variables))
        dataset = dataset.drop_vars(name)
    else:
        name = rng.choice(("joint", "contact", "coordinate", "axis"))
        old = [str(value) for value in dataset[name].values]
        old[rng.randrange(len(old))] = rng.choice(NASTY).replace("\0", "")
        dataset = dataset.assign_coords({name: old})
    return dataset


def _edit(content: Any, rng: random.Random) -> None:
    """Change one value somewhere in plain data."""
    while True:
        keys = list(content) if isinstance(content, dict) else list(range(len(content)))
        if not keys:
            return
        key = rng.choice(keys)
        inside = content[key]
        if isinstance(inside, dict | list) and inside and rng.random() < 0.8:
            content = inside
            continue
        if isinstance(content, dict) and rng.random() < 0.2:
            del content[key]
        else:
            new = (*NASTY, 0, -1, 1.5, 10**30, 1e300, 1e-300, None, True, [], {}, [[]], [None])
            content[key] = rng.choice(new)
        return
