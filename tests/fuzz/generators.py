"""Inputs that no one should give: robots, scenarios, options, results, stores, checkpoints, each
from a seed.

A case is what a command is called with, and whether it must be refused; or a check of its own, such
as those of `twins`. Whatever the input, a command either does its work or says in one line why it
cannot; it never shows a traceback, hangs, crashes, takes what makes no sense in silence, changes
what it reads, reads a file that it was not given, or leaves files after it has refused.
"""

import argparse
import contextlib
import hashlib
import io
import json
import os
import random
import re
import shutil
import sqlite3
import stat
import traceback
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import materials
import numpy as np
import twins

from jointplay import cli
from jointplay.base.errors import JointplayError
from jointplay.cli.commands.inputs import FLAGS, READERS
from jointplay.model.robots import shipped
from jointplay.simulation.result import netcdf
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.working_files import CHECKPOINT
from jointplay.study.database import FILE

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

SECRET = "canary 7f3a91c4"
"""What stands in a file that no case names as its input."""

CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\x80-\x9f\u202a-\u202e\u2066-\u2069]")
"""Characters that move the cursor, ring, or turn the direction of a terminal's text."""


class Terminal(io.StringIO):
    """What a command prints; where it says that it serves until Ctrl-C, this is pressed."""

    def write(self, text: str) -> int:
        """Keep the text."""
        kept = super().write(text)
        if "stop with Ctrl-C" in text:
            raise KeyboardInterrupt
        return kept


@dataclass
class Case:
    """A call of the command line, or a check."""

    seed: int
    kind: str
    arguments: list[str]
    bad: bool = False
    """Whether it must be refused."""
    changes: tuple[str, ...] = ()
    """Files and folders that it may change, relative to its folder."""
    check: Callable[[], str] | None = None
    """Instead of the call: what is wrong, "" if nothing; raises `JointplayError` if refused."""
    long_run: bool = False
    """Whether its records go to disk."""
    refused: bool = False
    """What became of it."""


def make(seed: int, folder: Path) -> Case:
    """The case of a seed; its files go into `folder`, which is empty."""
    rng = random.Random(seed)
    kind = ORDER[seed % len(ORDER)]
    (folder / "secret.txt").write_text(SECRET, encoding="utf-8")
    return KINDS[kind][1](seed, rng, folder)


def judge(case: Case, folder: Path) -> str:
    """Call the command: "" if it did what it should, else "traceback ..." or "silent ..."."""
    before = _files(folder)
    out, err = Terminal(), io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
            materials.small_memory() if case.long_run else contextlib.nullcontext(),
        ):
            if case.check is not None:
                return _checked(case)
            status = cli.main(case.arguments)
    except SystemExit as ended:
        status = ended.code
    except BaseException as error:
        places = traceback.extract_tb(error.__traceback__)
        own = [place for place in places if "jointplay" in place.filename] or places
        where = " > ".join(f"{Path(p.filename).name}:{p.lineno}" for p in (own[-1], places[-1]))
        return f"traceback {type(error).__name__} at {where}: {str(error)[:200]}"
    said = [line for line in err.getvalue().splitlines() if line.strip()]
    case.refused = status == 2
    printed = out.getvalue() + err.getvalue()
    after = _files(folder)
    found = CONTROL.search(printed)
    if found:
        around = printed[max(found.start() - 30, 0) : found.end() + 10]
        return f"silent: prints the control character {found.group()!r}: {around!r}"
    changed = [
        name
        for name in sorted(before)
        if after.get(name) != before[name] and not name.startswith(tuple(case.changes) or "\0")
    ]
    if changed:
        return f"silent: changes {changed[0]!r}"
    if SECRET in printed or any(
        _holds_secret(folder / name) for name in after if after[name] != before.get(name)
    ):
        return "silent: reads a file that it was not given"
    if status == 2:
        new = [
            name
            for name in sorted(after.keys() - before.keys())
            if not name.startswith(tuple(case.changes) or "\0")
        ]
        if new:
            return f"silent: refuses, and leaves {new[0]!r}: {said[:1]}"
        if out.getvalue():
            return f"silent: prints before it refuses: {out.getvalue()[:200]!r}"
        if sum("error: " in line for line in said) == 1 and "error: " in said[-1]:
            notes = said[:-1]
            if not notes or (case.kind == "commands" and len(notes) < 4):
                return ""  # what a run is like may be said before
    elif status == 0:
        return "silent: taken, although it must be refused" if case.bad else ""
    elif status == 1 and out.getvalue():
        return ""  # a run that stopped early, and said so
    elif status == 130 and case.kind == "commands" and "wear" in case.arguments:
        return ""  # the growth was not reached
    return f"silent: status {status}, {len(said)} lines: {said[:3]}"


def _checked(case: Case) -> str:
    assert case.check is not None
    try:
        wrong = case.check()
    except JointplayError as error:
        case.refused = True
        text = str(error)
        if "\n" in text:
            return f"silent: an error of several lines: {text!r}"
        return "silent: refused, although nothing is wrong: " + text if case.bad else ""
    return f"silent: {wrong}" if wrong else ""


def _files(folder: Path) -> dict[str, str]:
    """What is in the folder: hash of each file; of what is none, its kind."""
    found = {}
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place) / name
            mode = path.lstat().st_mode
            regular = stat.S_ISREG(mode)
            kept = (
                hashlib.sha1(path.read_bytes()).hexdigest() if regular else str(stat.S_IFMT(mode))
            )
            found[str(path.relative_to(folder))] = kept
    return found


def _holds_secret(path: Path) -> bool:
    return stat.S_ISREG(path.lstat().st_mode) and SECRET.encode() in path.read_bytes()


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
    call = ["export", "urdf", str(folder / "r.urdf"), "--joint", joint]
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
    return (Path(cli.__file__).parents[1] / "scenario" / "template.toml").read_text(
        encoding="utf-8"
    )


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
    "--joint", "--tool", "--gravity", "--allow-unphysical", "--fix", "--clearance",
    "--axial-clearance", "--bearing-radius", "--bearing-length", "--journal-radius",
    "--journal-length", "--young", "--poisson", "--stiffness", "--axial-stiffness",
    "--law", "--restitution", "--damping",
    "--impact-mass", "--friction", "--motion", "--interpolation", "--bandwidth",
    "--damping-ratio", "--joint-friction", "--seed", "--integrator", "--record-every",
)  # fmt: skip

OPTIONS_MUST = (
    ["--seed", "-1"], ["--step", "1e-300"], ["--record-every", "1" + "0" * 30], ["--tool=--"],
    ["--bandwidth", "1e300"], ["--clearance", "-1e-4"], ["--clearance", "nan"],
    ["--friction", "-1"], ["--restitution", "0"], ["--joint", "nobody"], ["--gravity", "nan,0,0"],
    ["--step", "0"],
    ["--duration", "1e300"], ["a" * 300], ["--motion", "a\tb"],
)  # fmt: skip


NONSENSE = ("nan", "inf", "-inf", "1e400", "", " ", "abc", "1 2")
"""What no option takes for a number."""

NUMBERS = {
    *[
        "X",
        "MU",
        "EDGE",
        "FORCE",
        "LENGTH",
        "MASS",
        "TIME",
        "ANGLE",
        "N",
        "T",
        "P",
        "VALUE",
        "FX,FY,FZ",
        "X,Y,Z",
    ]
}
"""How options call numbers that they read as text."""


def _is_number(action: argparse.Action) -> bool:
    texts = {flag.name for flag in FLAGS if flag.attribute in READERS}
    given = {action.metavar} if isinstance(action.metavar, str) else set(action.metavar or ())
    if set(action.option_strings) & {*texts, "--host"}:
        return False
    return action.type in (int, float) or bool(given & NUMBERS)


def _nonsense(seed: int, rng: random.Random, folder: Path) -> Case:
    """Any command with a number that is none, or a place where nothing can be written."""
    calls = _base_calls(folder)
    calls["scara"] = ["--out", str(folder / "out")]  # which is refused, or hangs
    asked: list[tuple[str, str, int, tuple[str, ...]]] = []
    for name, parser in cli.parsers().items():
        for one in parser._actions:
            option, values = (one.option_strings or [""])[-1], one.nargs
            if one.dest in ("out", "output", "picture", "html", "movie") and option:
                asked.append((name, option, 1, ("/dev/null", str(folder / "s.toml"), "")))
            elif option and values != 0 and _is_number(one):
                asked.append((name, option, values if isinstance(values, int) else 1, NONSENSE))
    name, option, number, values = rng.choice(asked)
    value = rng.choice(values)
    more = [option, value, *["1"] * (number - 1)] if number > 1 else [f"{option}={value}"]
    base, replaced = calls[name], [option, "-o" if option == "--out" else option]
    for at, word in enumerate(base):
        if word in replaced:
            base = base[:at] + base[at + 2 :]
            break
    return Case(seed, "options", [*name.split(), *base, *more], True)


def _options(seed: int, rng: random.Random, folder: Path) -> Case:
    if rng.random() < 0.5:
        return _nonsense(seed, rng, folder)
    call = ["run", "--duration", "1e-4", "--no-figures", "--quiet", "--out", str(folder / "out")]
    if rng.random() < 0.4:
        return Case(seed, "options", call + rng.choice(OPTIONS_MUST), True)
    for _ in range(rng.randint(1, 2)):
        value = rng.choice(NASTY)
        call.append(f"{rng.choice(VALUES)}={value}")
    return Case(seed, "options", call)


@cache
def short_run() -> Any:
    """A short run with clearance."""
    return netcdf.load(materials.place() / "result.nc")


def _sealed() -> bytes:
    return materials.content("result.nc")


def _shown(rng: random.Random, folder: Path) -> list[str]:
    """A command that reads the result r.nc."""
    file = str(folder / "r.nc")
    return rng.choice(
        (
            ["play", file, "--html", str(folder / "o.html"), "--quiet", "--no-ghost"],
            ["report", file, "-o", str(folder / "o.html"), "--impacts", "0", "--no-pdf", "--quiet"],
            ["export", "result", file, "--out", str(folder / "o.csv"), "--quiet"],
            [
                "export",
                "result",
                file,
                "--to",
                "trajectory",
                "--out",
                str(folder / "o.csv"),
                "--quiet",
            ],
        )
    )


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
    else:
        content = netcdf.pack(_edited(rng))
    (folder / "r.nc").write_bytes(content)
    return Case(seed, "result", _shown(rng, folder), bad)


def _edited(rng: random.Random) -> Any:
    """A run whose attributes or histories another has edited."""
    dataset = short_run().copy(deep=True)
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
    """Change one value somewhere in plain data; a single value has none inside and is left."""
    while isinstance(content, dict | list) and content:
        key = rng.choice(list(content) if isinstance(content, dict) else range(len(content)))
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


# ---- HDF5: what its files can hold besides what we write --------------------------------------


def _secret_h5(folder: Path) -> Path:
    """Another file with numbers that no result has been given."""
    path = folder / "secret.h5"
    with h5py.File(path, "w") as file:
        file["q"] = np.full((101, 9), 1234.5)
    return path


def _there(file: h5py.File, key: str) -> Any:
    """What a name leads to within the file, if to anything."""
    if not isinstance(file.get(key, getlink=True), h5py.HardLink):
        return None
    return file[key]


def _linked_out(file: h5py.File, name: str, rng: random.Random, folder: Path) -> bool:
    """A link into another file."""
    target = _secret_h5(folder)
    way = rng.choice((str(target), "secret.h5", "../" * 9 + str(target)[1:]))
    del file[name]
    file[name] = h5py.ExternalLink(way, "/q")
    return True


def _stored_outside(file: h5py.File, name: str, rng: random.Random, folder: Path) -> bool:
    """Numbers in another file."""
    shape, way = (
        file[name].shape,
        rng.choice(("secret.txt", str(folder / "secret.txt"), "/dev/zero")),
    )
    del file[name]
    size = 8 * int(np.prod(shape, dtype=int))
    file.create_dataset(name, shape, "f8", external=[(way, 0, max(size, 8))])
    return True


def _virtual(file: h5py.File, name: str, rng: random.Random, folder: Path) -> bool:
    """Numbers gathered from another file."""
    target, shape = _secret_h5(folder), file[name].shape
    layout = h5py.VirtualLayout(shape or (1,), "f8")
    source = h5py.VirtualSource(rng.choice((str(target), "secret.h5")), "q", (101, 9))
    if shape == (101, 9):
        layout[...] = source
    else:
        layout[(slice(0, 1),) + (0,) * (len(layout.shape) - 1)] = source[0:1, 0]
    del file[name]
    file.create_virtual_dataset(name, layout)
    return True


def _linked_within(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """A soft link: to another variable, to itself, to nothing, to the root."""
    del file[name]
    file[name] = h5py.SoftLink(rng.choice(("/v", f"/{name}", "/none", "/", "..", "")) or "/x")


def _other_type(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """Values of a type that no history has."""
    shape = file[name].shape
    types: tuple[Any, ...] = (
        "c16", "S7", "f2", "f4", "g", ">f8", "i1", "u8", "?", "V5", h5py.string_dtype(),
        h5py.string_dtype("ascii", 3), h5py.vlen_dtype(np.dtype("i4")), h5py.ref_dtype,
        h5py.regionref_dtype, [("r", "f8"), ("i", "f8")], [("a", "S3"), ("b", "f4", (2,))],
        h5py.enum_dtype({"a": 0, "b": 1}), h5py.opaque_dtype(np.dtype("M8[s]")),
    )  # fmt: skip
    kind = rng.choice(types)
    del file[name]
    file.create_dataset(name, shape, kind)


def _other_shape(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """Sizes that do not fit each other, or any memory."""
    shape = file[name].shape
    shapes = ((), (0,), (1,), (*shape, 1), shape[::-1], (1, *shape), tuple(n + 1 for n in shape))
    huge = (10**6, *(10**4,) * max(len(shape) - 1, 0))
    new = rng.choice((*shapes, huge, (2**40,)))
    del file[name]
    big = int(np.prod(new, dtype=object)) > 10**6
    file.create_dataset(name, new, "f8", chunks=tuple(min(n, 64) for n in new) if big else None)


def _other_filter(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """Compressed by what is not here, or in ways of its own."""
    if file[name].size > 10**7:  # made so by another change
        return
    values = np.asarray(file[name])
    if values.dtype.kind not in "fi" or not values.size:
        return
    chunks = tuple(max(n, 1) for n in values.shape)
    del file[name]
    way = rng.randrange(4)
    if way == 0:
        file.create_dataset(name, data=values, chunks=chunks, compression="lzf", fletcher32=True)
    elif way == 1:
        integers = values.astype("i4")
        file.create_dataset(name, data=integers, chunks=chunks, scaleoffset=rng.choice((0, 3)))
    else:
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk(chunks)
        number = rng.choice((305, 32000, 32001, 32004, 32015, 32017, 60000))
        plist.set_filter(number, h5py.h5z.FLAG_OPTIONAL, (1, 2, 3))
        space = h5py.h5s.create_simple(values.shape)
        made = h5py.h5d.create(
            file.id, name.encode(), h5py.h5t.py_create(values.dtype), space, plist
        )
        made.write_direct_chunk((0,) * values.ndim, b"\0" * rng.choice((1, 100)))


def _other_attribute(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """Attributes of other types and sizes, of the file or of a variable."""
    owner = rng.choice((file, file[name]))
    known = list(owner.attrs) or ["x"]
    key = rng.choice((*known, "_FillValue", "scale_factor", "units", "coordinates", "\x1b[31m"))
    values: tuple[Any, ...] = (
        h5py.Empty("f8"), np.arange(5), b"\xff\xfe", "a\0b", "x" * 10**6, 1 + 2j, np.float64("nan"),
        np.array(["a", "b"], object), file.ref, -1, 0, 10**30, "days since 2000-01-01", "[[[",
        "\x1b]0;title\x07", np.zeros((3, 3)), np.datetime64("nat").astype("i8"),
    )  # fmt: skip
    with contextlib.suppress(TypeError, OSError, ValueError, OverflowError, RuntimeError, KeyError):
        owner.attrs[key] = rng.choice(values)


def _more_things(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """Groups, types and variables that no result has."""
    odd = rng.choice(("a/b/c", "\x1b[2J", "a.b", "é", "x" * 3000, " ", name + " ", "..", "time/x"))
    way = rng.randrange(4)
    with contextlib.suppress(ValueError, OSError, TypeError, RuntimeError, KeyError):
        if way == 0:
            file.create_group(odd)
        elif way == 1:
            file[odd] = np.dtype("f8")
        elif way == 2:
            file[odd] = np.arange(3.0)
        else:
            del file[name]
            file.create_group(name)


def _other_values(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """Times out of order, values that are no numbers."""
    name = rng.choice((name, "time", "time"))
    if not isinstance(_there(file, name), h5py.Dataset):
        return
    if file[name].dtype.kind != "f" or not file[name].shape or not file[name].size:
        return
    values = file[name][...]
    flat = values.reshape(-1)
    at = rng.randrange(len(flat))
    flat[at] = rng.choice((np.nan, np.inf, -np.inf, -1.0, 1e308, 0.0, flat[at - 1]))
    if rng.random() < 0.2:
        flat[:] = flat[::-1].copy()
    file[name][...] = values


def _without_scales(file: h5py.File, name: str, rng: random.Random, folder: Path) -> None:
    """The dimensions' scales gone, or variables gone that others point to."""
    if rng.random() < 0.5:
        scales = [key for key in file if getattr(_there(file, key), "is_scale", False)]
        del file[rng.choice(scales or [name])]
    else:
        for key in list(file[name].attrs):
            if rng.random() < 0.5:
                del file[name].attrs[key]


TAMPERING: tuple[Callable[[h5py.File, str, random.Random, Path], bool | None], ...] = (
    _linked_out, _stored_outside, _virtual, _linked_within, _other_type, _other_shape,
    _other_filter, _other_attribute, _more_things, _other_values, _without_scales,
)  # fmt: skip
"""Each returns whether the file must then be refused, because it asks for another."""


def _hdf5(seed: int, rng: random.Random, folder: Path) -> Case:
    path = folder / "r.nc"
    path.write_bytes(_sealed()[: -len(netcdf.SEAL) - 65])
    bad = False
    with h5py.File(path, "r+") as file:
        for _ in range(rng.choice((1, 1, 2))):
            names = [key for key in file if isinstance(_there(file, key), h5py.Dataset)]
            bad |= bool(rng.choice(TAMPERING)(file, rng.choice(names), rng, folder))
    # Without its checksum another process would have to look at it first: a second each.
    path.write_bytes(netcdf.seal(path.read_bytes()))
    return Case(seed, "hdf5", _shown(rng, folder), bad)


# ---- Stores of sweeps ---------------------------------------------------------------------------


def _store(seed: int, rng: random.Random, folder: Path) -> Case:
    store = folder / "store"
    shutil.copytree(materials.place() / "store", store)
    shutil.copy(materials.place() / "sweep.toml", folder)
    for _ in range(rng.choice((1, 1, 2))):
        rng.choice(STORE_WAYS)(store, rng)
    out = str(folder / "o.png")
    measure = rng.choice(
        ("tool_error_rms_total", "peak_force", "mu", "status", "error", "none", "")
    )
    calls = (
        ["study", "uncertainty", str(store), measure],
        ["study", "uncertainty", str(store), measure, "--out", out],
        ["plot", str(store), "x=cr", f"y={measure}", "--out", out],
        ["plot", str(store), "x=mu", f"y={measure}", "hue=cr", "--out", out],
        ["report", str(store), "-o", str(folder / "o.html"), "--no-pdf", "--quiet"],
    )
    call = rng.choice(calls)
    if rng.random() < 0.1:
        call = [
            "study",
            "sweep",
            str(folder / "sweep.toml"),
            "--out",
            str(store),
            "--quiet",
            "--jobs",
            "1",
        ]
        return Case(
            seed, "store", [*call, rng.choice(("--resume", "--extend"))], changes=("store",)
        )
    return Case(seed, "store", call)


def _changed(store: Path, *statements: tuple[str, tuple[Any, ...]]) -> None:
    """Change the store's file of cases by SQLite's means, as far as it can be."""
    with (
        contextlib.suppress(sqlite3.Error),
        contextlib.closing(sqlite3.connect(store / FILE)) as one,
    ):
        for statement, values in statements:
            one.execute(statement, values)
        one.commit()


def _said(store: Path) -> Any:
    """What the file says that it is of; None if that cannot be read."""
    with (
        contextlib.suppress(sqlite3.Error, ValueError, TypeError, RecursionError),
        contextlib.closing(sqlite3.connect(store / FILE)) as one,
    ):
        return json.loads(one.execute("SELECT content FROM about").fetchone()[0])
    return None


def _say(store: Path, text: str) -> None:
    """Have the file say that it is of something else, sealed as we seal it."""
    mark = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    with contextlib.suppress(UnicodeEncodeError):
        _changed(store, ("UPDATE about SET content = ?, checksum = ?", (text, mark)))


def _about_edited(store: Path, rng: random.Random) -> None:
    content = _said(store)
    if content is not None:
        for _ in range(rng.randint(1, 3)):
            _edit(content, rng)
        _say(store, json.dumps(content))


def _everywhere(content: Any, name: str, value: Any) -> None:
    """Give every key of that name a value, however deep."""
    if isinstance(content, dict):
        for key, inside in content.items():
            if key == name:
                content[key] = value
            else:
                _everywhere(inside, name, value)
    elif isinstance(content, list):
        for inside in content:
            _everywhere(inside, name, value)


ABOUT: tuple[tuple[str, Any], ...] = (
    ("sizes", {}), ("sizes", {"none": 3}), ("sizes", None), ("sizes", {"sample": 10**9, "cr": 2}),
    ("sizes", {"sample": 4, "cr": -2}), ("sizes", {"sample": 10**30}), ("sizes", {"cr": 2}),
    ("sizes", {"sample": 2, "cr": 2}), ("sampled", ["none"]), ("sampled", 7), ("sampled", []),
    ("sampling", "saltelli"), ("format", 1.0), ("format", None), ("case", None), ("store", ""),
    ("store", []), ("versions", None), ("versions", {"jointplay": 1}), ("identity", {}),
    ("inputs", None), ("scenario", "["), ("title", "\x1b[31m"), ("labels", {}), ("labels", []),
    ("values", []), ("values", ["a", "b"]), ("values", [None, 1]), ("values", [10**400, 1]),
    ("columns", []), ("columns", [["mu", "REAL", "", "", ""]]), ("columns", [[]]), ("columns", 3),
    ("columns", [["place", "REAL; DROP TABLE cases", "", "", ""]]),
)  # fmt: skip
"""What a store can say of itself."""


def _about_said(store: Path, rng: random.Random) -> None:
    content = _said(store)
    if content is not None:
        if rng.random() < 0.3 and isinstance(content, dict):
            columns = content.get("columns") or [[""] * 5]
            with contextlib.suppress(TypeError, IndexError, AttributeError):
                rng.choice(columns)[rng.randrange(5)] = rng.choice(
                    ("\x1b[31m", "mu", "TEXT", "REAL", None, 3, "<script>alert(1)</script>", "")
                )
        else:
            _everywhere(content, *rng.choice(ABOUT))
        _say(store, json.dumps(content))


def _about_garbled(store: Path, rng: random.Random) -> None:
    content = _said(store)
    if content is not None:
        _say(store, mutated(json.dumps(content), rng, rng.randint(1, 3)))


SCHEMAS = (
    "CREATE TABLE more (x)", "CREATE VIEW more AS SELECT * FROM cases", "DROP TABLE cases",
    "CREATE TRIGGER more AFTER INSERT ON cases BEGIN DELETE FROM cases; END", "DROP TABLE about",
    "CREATE INDEX more ON cases (place)", "CREATE VIRTUAL TABLE more USING fts5(x)",
    "ALTER TABLE cases ADD COLUMN more REAL DEFAULT 1.0", "ALTER TABLE cases RENAME TO others",
    "ALTER TABLE cases ADD COLUMN more AS (zeroblob(1000000000))", "PRAGMA user_version = 7",
    "PRAGMA journal_mode = WAL", "PRAGMA encoding = 'UTF-16'", "PRAGMA auto_vacuum = 1",
    "DELETE FROM cases", "DELETE FROM about", "INSERT INTO cases SELECT * FROM cases",
    "UPDATE cases SET place = 'x'", "UPDATE cases SET place = '99 99'",
    "UPDATE cases SET peak_force = x'00'", "UPDATE cases SET peak_force = 'much'",
    "UPDATE cases SET error = CAST(x'ff' AS TEXT)", "UPDATE cases SET result = 'x'",
)  # fmt: skip
"""What other hands can do to the file."""


def _schema_changed(store: Path, rng: random.Random) -> None:
    _changed(store, (rng.choice(SCHEMAS), ()))


def _rows_written(store: Path, rng: random.Random) -> None:
    """Rows with right checksums that no sweep has written."""
    from jointplay.study.database import Rows

    with (
        contextlib.suppress(JointplayError),  # it was damaged before
        contextlib.closing(Rows(store / FILE, write=True)) as rows,
    ):
        given: dict[str, Any] = {
            one.name: rng.choice((0.1, 1e300, float("inf"))) if one.kind == "REAL" else ""
            for one in rows.columns
        }
        given |= rng.choice((
            {}, {"status": "done"}, {"status": "\x1b[31m"}, {"status": "not run"},
            {"status": "failed", "error": "\x1b[31m"},
            {"status": "done", "result": "../../secret.txt"},
        ))  # fmt: skip
        for _ in range(rng.randint(1, 2)):
            place = rng.choice(
                ("0 0", "3 1", "99 99", "0", "-1 -1", "x", "", "0 0 0", "0  0", "٠ 0")
            )
            rows.add(place, given)


def _file_damaged(store: Path, rng: random.Random) -> None:
    path = store / FILE
    if not path.is_file():
        return
    data = bytearray(path.read_bytes())
    way = rng.randrange(5)
    if way < 2 and data:
        for _ in range(rng.choice((1, 1, 8))):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif way == 2:
        data = data[: rng.randrange(len(data) + 1)]
    elif way == 3:
        data += b"\0" * rng.choice((1, 10**4))
    elif data:  # a page of noise
        page = 4096 * rng.randrange(len(data) // 4096 + 1)
        data[page : page + 4096] = rng.randbytes(4096)
    path.write_bytes(bytes(data))


def _files_exchanged(store: Path, rng: random.Random) -> None:
    """The file gone, a folder in its place, or a link out of the store; others beside it."""
    path = store / (FILE + rng.choice(("", "", "-wal", "-shm", "-journal")))
    with contextlib.suppress(OSError):
        path.unlink()
    way = rng.randrange(4)
    with contextlib.suppress(FileExistsError):  # a folder, of an earlier change
        if way == 0:
            path.mkdir()
        elif way == 1:
            path.symlink_to(store.parent / "secret.txt")
        elif way == 2:
            path.write_bytes(rng.randbytes(rng.choice((1, 512, 5000))))


STORE_WAYS: tuple[Callable[[Path, random.Random], None], ...] = (
    _about_edited, _about_said, _about_said, _about_garbled, _schema_changed, _rows_written,
    _file_damaged, _file_damaged, _files_exchanged,
)  # fmt: skip


# ---- Checkpoints --------------------------------------------------------------------------------


def _checkpoint(seed: int, rng: random.Random, folder: Path) -> Case:
    """`run --resume` of what an interrupted run has left, changed since."""
    name = "s" if rng.random() < 0.75 else "long"
    shutil.copy(materials.place() / f"{name}.toml", folder)
    out = folder / "o"
    out.mkdir()
    path = out / f"{name}.checkpoint"
    data = materials.content(f"{name}.checkpoint")
    if name == "long":
        records = materials.content("long.records")
        if rng.random() < 0.2:
            records = records[: rng.randrange(len(records))]
        (out / "long.records").write_bytes(records)
    bad = False
    way = rng.randrange(12)
    if way == 0:
        data = bytearray(data)
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        data = bytes(data)
    elif way == 1:
        data, bad = data[: rng.randrange(len(data))], True
    elif way == 2 and name == "long":
        data, bad = materials.content("s.checkpoint"), True
    elif way == 3:
        data, bad = _odd_archive(data, rng), True
    elif way == 4:
        data = b"" if rng.random() < 0.3 else _sealed()
        bad = True
    else:
        data = _edited_checkpoint(data, rng)
    path.write_bytes(data)
    if way == 5 and rng.random() < 0.3:
        path.unlink()
        target = folder / "secret.txt"
        path.symlink_to(target) if rng.random() < 0.5 else path.mkdir()
        bad = True
    long_run = name == "long"
    if rng.random() < 0.5 and not long_run:
        check = partial(_gone_on_with, path, bad)
        return Case(seed, "checkpoint", ["Simulation.resume"], check=check, changes=("o",))
    call = ["run", str(folder / f"{name}.toml"), "--resume", "--no-figures", "--quiet"]
    call += ["--out", str(out), "--jobs", "1"]
    return Case(seed, "checkpoint", call, bad, ("o",), long_run=long_run)


def _gone_on_with(path: Path, bad: bool) -> str:
    """Without a scenario whose inputs the checkpoint's must be."""
    run = Simulation.resume(path)
    if bad:
        return "taken, although it must be refused"
    if run.total_steps > 10**6:
        return ""  # it may be so long
    result = run.finish(check_step=False)
    return "" if len(result.time) <= run.total_steps + 2 else f"{len(result.time)} records"


def _edited_checkpoint(data: bytes, rng: random.Random) -> bytes:
    """The arrays or the head changed, in an archive that is whole."""
    with np.load(io.BytesIO(data.removeprefix(CHECKPOINT))) as opened:
        arrays = {key: opened[key].copy() for key in opened.files}
    for _ in range(rng.choice((1, 1, 3))):
        name = rng.choice(list(arrays))
        way = rng.randrange(16)
        if way < 3:
            try:
                head = json.loads(arrays["head"].tobytes())
            except ValueError:  # changed already
                continue
            if not isinstance(head, dict):
                continue
            _edit(head.get(rng.choice(("simulation", "memory"))) if way else head, rng)
            arrays["head"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
        elif way == 3 and name != "head":
            del arrays[name]
        elif way == 4:
            kind = rng.choice(("f4", "c16", "S3", "?", "i4", "M8[s]", "V9"))
            with contextlib.suppress(ValueError, TypeError):
                arrays[name] = np.zeros(arrays[name].shape, kind)
        elif way == 5:
            arrays[name] = np.zeros(rng.choice(((), (0,), (1,), (7, 7), (1, 1, 1))))
        else:
            _numbers_changed(arrays[name], rng)
    out = io.BytesIO()
    np.savez(out, **arrays)
    return CHECKPOINT + out.getvalue()


def _numbers_changed(array: np.ndarray, rng: random.Random) -> None:
    """Some numbers of an array, or of a field of its records, set to what none is."""
    while array.dtype.names:
        array = array[rng.choice(array.dtype.names)]
    flat = array.reshape(-1) if array.flags.c_contiguous else array
    if not flat.size or flat.ndim != 1 or not flat.flags.writeable:
        return
    for _ in range(rng.choice((1, 3))):
        at = rng.randrange(len(flat))
        if flat.dtype.kind in "iu":
            limit = np.iinfo(flat.dtype)
            wild = (-1, 1, 2, 7, 1000, 10**6, 2**31, 2**40, limit.min, limit.max)
            flat[at] = rng.choice([number for number in wild if limit.min <= number <= limit.max])
        elif flat.dtype.kind == "f":
            flat[at] = rng.choice((np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, 1e-308, 1e6))


def _odd_archive(data: bytes, rng: random.Random) -> bytes:
    """An archive that is none of numpy's, or that runs code where pickles are read."""
    out = io.BytesIO()
    way = rng.randrange(5)
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            for name in old.namelist():
                content = old.read(name)
                if way == 0 and name == "q.npy":
                    packed = io.BytesIO()
                    np.save(packed, np.array([print], object), allow_pickle=True)
                    content = packed.getvalue()
                elif way == 1 and name == "q.npy":
                    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,)}"
                    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
                elif way == 2 and name == "head.npy":
                    packed = io.BytesIO()
                    np.save(packed, np.frombuffer(b"[" * 200_000, np.uint8))
                    content = packed.getvalue()
                elif way == 3 and name == "head.npy":
                    continue
                elif way == 4:
                    name = f"../{name}"
                new.writestr(name, content)
    return out.getvalue()


# ---- Meshes, depth, names, options of every command ---------------------------------------------

MESHES = (
    "/etc/passwd", "file:///etc/passwd", "../../../etc/passwd", "package://x/y.stl", "package://",
    "package://../../etc/passwd", "http://localhost:9/x.stl", "x.stl", "broken.stl", "empty.obj",
    "folder.stl", "pipe.stl", "/dev/zero", "/dev/stdin", "/dev/random", "link.stl", "secret.txt",
    "many.stl", "nan.obj", "loop.dae", "bomb.dae", "a" * 300 + ".stl", "", " ", "x.glb",
    "example-robot-data:ur5", "good.stl", "good.STL", "GOOD.stl", "m/../good.stl", "x.obj?y",
    "\N{PILE OF POO}.stl",
)  # fmt: skip
"""What URDFs call a mesh."""

TRIANGLE = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
    "endfacet\nendsolid a\n"
)


def _mesh_files(folder: Path, name: str, rng: random.Random) -> None:
    """The file that a mesh is called by, if it is one of ours."""
    contents: dict[str, bytes] = {
        "good.stl": TRIANGLE.encode(),
        "broken.stl": mutated(TRIANGLE, rng, 3).encode("utf-8", "ignore"),
        "empty.obj": b"", "nan.obj": b"v nan 0 0\nv 0 inf 0\nv 0 0 1e308\nf 1 2 3\nf 1 2 9\n",
        "many.stl": b"\0" * 80 + (2**32 - 1).to_bytes(4, "little") + b"\0" * 50,
        "loop.dae": b'<COLLADA version="1.4.1"><library_nodes><node id="a">'
        b'<instance_node url="#a"/></node></library_nodes></COLLADA>',
        "bomb.dae": b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
        + b"".join(b'<!ENTITY %c "&%c;&%c;&%c;&%c;">' % (b + 1, b, b, b, b) for b in range(97, 117))
        + b"]><COLLADA>&u;</COLLADA>",
    }  # fmt: skip
    path = folder / name.strip()
    with contextlib.suppress(OSError, ValueError):
        if name in contents:
            path.write_bytes(contents[name])
        elif name == "folder.stl":
            path.mkdir()
        elif name == "pipe.stl":
            os.mkfifo(path)
        elif name == "link.stl":
            path.symlink_to(rng.choice(("secret.txt", "link.stl", "/etc/passwd", "/dev/zero")))


def _meshes(seed: int, rng: random.Random, folder: Path) -> Case:
    name = rng.choice(MESHES)
    _mesh_files(folder, name, rng)
    size = rng.choice(("", "", ' scale="1e-3 1e-3 1e-3"', f' scale="{rng.choice(NASTY)[:50]}"'))
    text = twins.urdf(twins.machine(random.Random(seed)))
    mesh = f"<mesh filename={twins.quoteattr(name)}{size.replace('<', '').replace('&', '')}/>"
    where = rng.choice(("visual", "visual", "collision"))
    geometry = f"<{where}><geometry>{mesh}</geometry></{where}>"
    text = text.replace("<inertial>", geometry + "<inertial>", 1)
    (folder / "r.urdf").write_bytes(text.encode("utf-8", "surrogatepass"))
    scenario = '[robot]\nurdf = "r.urdf"\n[integration]\nduration = 1e-4\n'
    (folder / "s.toml").write_text(scenario, encoding="utf-8")
    out = folder / "o.png"
    calls = (
        ["check", str(folder / "s.toml"), "--picture", str(out)],
        ["export", "urdf", str(folder / "r.urdf"), "--joint", "joint0", "--out", f"{out}.urdf"],
        ["robots", str(folder / "r.urdf")],
    )
    return Case(seed, "meshes", rng.choice(calls))


def _depth(seed: int, rng: random.Random, folder: Path) -> Case:
    """Chains, stars, circles and twins of links, as many as one likes."""
    n = rng.choice((1, 2, 3, 50, 260, 900, 1500, 5200))
    way = rng.choice(("chain", "chain", "star", "circle", "own parent", "two parents", "nested"))
    moving = rng.choice((0, 1, 2, n))
    bad = way in ("circle", "own parent", "two parents") or n > 5000 or moving > 250
    parts = ['<link name="l0"/>']
    for k in range(1, n):
        parent = 0 if way == "star" else k - 1
        parts.append(
            f'<link name="l{k}"><inertial><mass value="1"/>'
            '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{k}" type="{"revolute" if k <= moving else "fixed"}">'
            f'<parent link="l{parent}"/><child link="l{k}"/><axis xyz="0 0 1"/>'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )
    extra = {
        "circle": (n - 1, 0), "own parent": (n - 1, n - 1), "two parents": (0, n - 1)
    }.get(way)  # fmt: skip
    if extra is not None:
        parent, child = extra
        parts.append(
            f'<joint name="more" type="fixed"><parent link="l{parent}"/>'
            f'<child link="l{child}"/></joint>'
        )
        bad = bad and (n > 1 or way != "two parents")
    text = "".join(parts)
    if way == "nested":
        depth = rng.choice((10, 1000, 100_000))
        text = "<a>" * depth + "</a>" * depth + text
    if rng.random() < 0.3:
        rng.shuffle(parts)
    (folder / "r.urdf").write_text(f'<robot name="r">{text}</robot>', encoding="utf-8")
    if rng.random() < 0.5:  # which says what prevents simulating it
        return Case(seed, "depth", ["robots", str(folder / "r.urdf")])
    call = ["export", "urdf", str(folder / "r.urdf"), "--joint", "j1"]
    return Case(
        seed, "depth", [*call, "--out", str(folder / "o.urdf")], bad or n == 1 or moving == 0
    )


def _names(seed: int, rng: random.Random, folder: Path) -> Case:
    """A robot with odd names in files and options of commands."""
    made = twins.machine(rng)
    odd = [rng.choice(twins.ODD) for _ in range(2)]
    made.joints[made.clearance] = odd[0]
    if rng.random() < 0.4:
        made.links[-1] = odd[1]
    path = twins.write(folder, twins.scenario(made), twins.urdf(made))
    if rng.random() < 0.2:
        path.write_text(path.read_text("utf-8").replace("r.urdf", odd[1][:5] + ".urdf"), "utf-8")
    joint, out = made.joints[made.clearance], folder / "out"
    robot = str(folder / "r.urdf")
    run = ["--duration", "1e-4", "--no-figures", "--quiet", "--out", str(out)]
    calls = (
        ["check", str(path), "--no-picture"],
        ["check", str(path), "--picture", str(folder / "o.png")],
        ["run", str(path), "--no-figures", "--quiet", "--out", str(out)],
        ["run", robot, "--joint", joint, *run],
        ["run", robot, "--joint", f"{joint}=0.1 mm", *run],
        ["run", robot, "--set", f'joints.{json.dumps(joint)}.radial_clearance="0.1 mm"', *run],
        ["run", robot, "--set", f"joints.{joint}.radial_clearance=1e-4", *run],
        ["export", "urdf", robot, "--joint", joint, "--out", str(folder / "o.urdf")],
        ["budget", robot, "--joint", f"{joint}=0.1 mm", "--out", str(out)],
        ["robots", robot],
        ["budget", robot, "--joint", f"{joint}=0.1 mm", "--pose", f"{joint}=0.1", "--tool", odd[1]],
    )
    call = [word.replace("\0", "") for word in rng.choice(calls)]
    return Case(seed, "names", call, changes=("out",))


def _base_calls(folder: Path) -> dict[str, list[str]]:
    """Of each command a call that works and is done soon."""
    here = materials.place()
    shutil.copy(here / "s.toml", folder)
    shutil.copy(here / "measured.csv", folder)
    shutil.copy(here / "poses.csv", folder)
    shutil.copy(here / "result.nc", folder / "other.nc")
    scenario, out = str(folder / "s.toml"), str(folder / "out")
    store, result = str(here / "store"), str(here / "result.nc")
    robot = ["jointplay:scara.urdf", "--clearance", "0.1 mm"]
    return {
        "scara": ["--out", out],  # with runs that are refused: the study takes minutes
        "run": [scenario, "--no-figures", "--quiet", "--out", out],
        "init": [str(folder / "new")],
        "check": [scenario, "--no-picture"],
        "live": [scenario, "--no-browser", "--port=0"],
        "compare": [result, str(folder / "other.nc"), "--quiet"],
        "play": [result, "--html", str(folder / "o.html"), "--quiet", "--no-ghost"],
        "report": [result, "-o", str(folder / "o.html"), "--impacts=0", "--no-pdf", "--quiet"],
        "export result": [result, "--out", str(folder / "o.csv"), "--quiet"],
        "robots": [str(shipped("scara.urdf"))],
        "export urdf": [str(shipped("scara.urdf")), "--joint", "joint_b", "--out", out],
        "study wear": [scenario, "--joint", "joint_b", "--growth", "1 um", "--blocks=1", "--quiet"],
        "study dynamics": [
            str(shipped("slider_crank.toml")),
            "turns",
            "--out",
            out,
            "--of",
            "none",
        ],
        "study hunting": ["so101", "--preset", "--of", "wrist_roll", "--jobs=1", "--quiet"],
        "compensate": [scenario, "--jobs=1", "--quiet", "--out", out],
        "budget": [*robot, "--out", out],
        "allocate": [*robot, "--target", "0.2 mm", "--quiet"],
        "export simulator": [
            *robot,
            "--joint",
            "joint_b",
            "--out",
            out,
            "--quiet",
            "--format",
            "json",
        ],
        "study iso9283": [scenario, "--cycles=3", "--jobs=1"],
        "identify": [robot[0], str(folder / "measured.csv"), *robot[1:], "--quiet", "--out", out],
        "calibrate": [robot[0], str(folder / "poses.csv"), "--term=offset", "--quiet"],
        "study sweep": [scenario, "--out", out, "--quiet", "--jobs=1"],
        "plot": [store, "x=cr", "y=peak_force", "--out", str(folder / "o.png")],
        "study uncertainty": [store, "peak_force"],
    }


LONG_WORK = tuple(
    ["--verify", "--runs", "--sobol", "--certify", "--check", "--movie", "--scheduler"]
)
"""Options that ask for minutes of work, or for other programs."""

SERVES = ("--help", "-h", "--html", "--jobs")
"""Options that a call of ours needs as it has them."""


def _commands(seed: int, rng: random.Random, folder: Path) -> Case:
    """Any command with any of its options, and values that they should not have."""
    calls = _base_calls(folder)
    name = rng.choice(list(calls))
    call = [*name.split(), *calls[name]]
    actions = [
        one
        for one in cli.parsers()[name]._actions
        if one.option_strings and not set(one.option_strings) & {*LONG_WORK, *SERVES}
    ]
    values = (
        *NASTY,
        "1",
        "2",
        "3",
        "0.1 mm",
        "joint_b",
        "joint_b=0.1 mm",
        "x=y",
        "joint_b.x=1",
        "1:2:3",
    )
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        if not actions or rng.random() < 0.1:
            at = rng.randrange(1, len(call) + 1)
            call[at:at] = [rng.choice(values)]
            continue
        one = rng.choice(actions)
        if one.nargs == 0:
            call.append(one.option_strings[-1])
        elif isinstance(one.nargs, int):
            call += [one.option_strings[-1], *(rng.choice(values) for _ in range(one.nargs))]
        else:
            choices = [str(word) for word in one.choices or ()]
            value = rng.choice(choices) if choices and rng.random() < 0.5 else rng.choice(values)
            if one.option_strings[-1] in ("--out", "--picture"):
                value = str(folder / value.replace("/", "_")[:100])
            call.append(f"{one.option_strings[-1]}={value}")
    call = [word.replace("\0", "") for word in call]
    if name == "scara":  # of an option that is there twice the last one counts
        call.append("--runs=-1")
    return Case(seed, "commands", call, name == "scara", ("out",))


# ---- Checks that compare runs -------------------------------------------------------------------


def _energy(seed: int, rng: random.Random, folder: Path) -> Case:
    return Case(seed, "energy", [], check=partial(twins.energy, rng, folder))


def _twins(seed: int, rng: random.Random, folder: Path) -> Case:
    way = rng.choice(twins.WAYS)
    return Case(seed, "twins", [way.__name__], check=partial(way, rng, folder))


KINDS: dict[str, tuple[int, Callable[[int, random.Random, Path], Case]]] = {
    "urdf": (4, _urdf),
    "toml": (4, _toml),
    "csv": (2, _csv),
    "options": (3, _options),
    "result": (3, _result),
    "hdf5": (3, _hdf5),
    "store": (3, _store),
    "checkpoint": (3, _checkpoint),
    "meshes": (2, _meshes),
    "depth": (1, _depth),
    "names": (3, _names),
    "commands": (4, _commands),
    "energy": (2, _energy),
    "twins": (3, _twins),
}
"""Cases out of forty of each kind, and what makes them."""


def _interleaved() -> list[str]:
    """The kinds in turn, each as often as its share says."""
    places = [
        ((k + 0.5) / share, number, kind)
        for number, (kind, (share, _)) in enumerate(KINDS.items())
        for k in range(share)
    ]
    return [kind for _, _, kind in sorted(places)]


ORDER = _interleaved()
"""Kind of the cases whose seeds leave each remainder."""
