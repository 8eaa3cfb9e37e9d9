"""Options of `jointplay run` that are names for keys of a scenario.

Each is one setting, as if by ``--set KEY=VALUE``: the scenario's tables read its value, check it,
and say what it is. In a key, ``JOINT`` stands for each joint of ``--joint``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.errors import JointplayError

if TYPE_CHECKING:
    from jointplay.scenario.settings import Setting


@dataclass(frozen=True)
class Flag:
    """An option, and the keys that its value is for."""

    name: str
    keys: tuple[str, ...]
    group: str
    metavar: str | tuple[str, ...] = "X"
    read: Callable[[str], Any] | None = None
    """From the text of the command line to a value of the scenario; None reads numbers."""
    default: str = ""
    """What holds for a bare robot, in words."""

    @property
    def attribute(self) -> str:
        """Name of its value among the options."""
        return self.name.removeprefix("--").replace("-", "_")


def number(text: str) -> Any:
    """A number, or text with its unit, which the scenario reads."""
    try:
        return float(text)
    except ValueError:
        return text


def whole(text: str) -> Any:
    """A whole number, or what the scenario refuses."""
    try:
        return int(text)
    except ValueError:
        return text


def gravity(text: str) -> Any:
    """A word, or three components."""
    parts = text.split(",")
    return text if len(parts) == 1 else [number(part.strip()) for part in parts]


def beside(text: str) -> str:
    """A path as seen from here, where a scenario would take it for one as seen from its file."""
    return text if text.startswith("jointplay:") else str(Path(text).resolve())


_JOINT = "joints.JOINT."

FLAGS = (
    Flag("--tool", ("robot.tool",), "robot", "FRAME", str),
    Flag("--gravity", ("robot.gravity",), "robot", "G", gravity, "loaded"),
    Flag("--radial", (f"{_JOINT}radial_clearance",), "clearance joint", default="2e-4"),
    Flag("--axial", (f"{_JOINT}axial_clearance",), "clearance joint", default="2e-4"),
    Flag("--clearance", (f"{_JOINT}clearance",), "clearance joint", default="2e-4"),
    Flag("--bearing-radius", (f"{_JOINT}bearing_radius",), "clearance joint", default="0.01"),
    Flag("--bearing-length", (f"{_JOINT}bearing_length",), "clearance joint", default="0.04"),
    Flag("--journal-radius", (f"{_JOINT}journal_radius",), "clearance joint"),
    Flag("--journal-length", (f"{_JOINT}journal_length",), "clearance joint"),
    Flag(
        "--young",
        (f"{_JOINT}bearing_material.young", f"{_JOINT}journal_material.young"),
        "clearance joint",
        default="207e9",
    ),
    Flag(
        "--poisson",
        (f"{_JOINT}bearing_material.poisson", f"{_JOINT}journal_material.poisson"),
        "clearance joint",
        default="0.3",
    ),
    Flag("--stiffness", (f"{_JOINT}stiffness",), "clearance joint"),
    Flag("--axial-stiffness", (f"{_JOINT}axial_stiffness",), "clearance joint"),
    Flag("--law", (f"{_JOINT}normal.law",), "laws", "LAW", str, "lankarani-nikravesh"),
    Flag("--restitution", (f"{_JOINT}restitution",), "laws", default="0.9"),
    Flag("--damping", (f"{_JOINT}normal.damping",), "laws"),
    Flag("--impact-mass", (f"{_JOINT}normal.mass",), "laws"),
    Flag(
        "--exponents",
        (f"{_JOINT}normal.n", f"{_JOINT}normal.p", f"{_JOINT}normal.q"),
        "laws",
        ("N", "P", "Q"),
    ),
    Flag("--friction", (f"{_JOINT}friction.mu_d",), "laws", default="0.1"),
    Flag(
        "--friction-speeds",
        (f"{_JOINT}friction.v0", f"{_JOINT}friction.v1"),
        "laws",
        ("V0", "V1"),
        default="1e-4 1e-3",
    ),
    Flag("--motion", ("motion.file",), "motion and drive", "FILE", beside),
    Flag("--interpolation", ("motion.interpolation",), "motion and drive", "WORD", str),
    Flag("--bandwidth", ("drive.bandwidth",), "motion and drive", default="100"),
    Flag("--damping-ratio", ("drive.damping_ratio",), "motion and drive", default="1"),
    Flag("--seed", ("integration.seed",), "motion and drive", "N", whole),
    Flag("--start", ("integration.start",), "motion and drive", "WORD", str),
    Flag("--settle", ("integration.settle",), "motion and drive", "TIME"),
    Flag("--judge-from", ("integration.judge_from",), "motion and drive"),
    Flag("--step", ("integration.step",), "integration and output", default="1e-5"),
    Flag("--duration", ("integration.duration",), "integration and output"),
    Flag("--integrator", ("integration.integrator",), "integration and output", "WORD", str),
    Flag("--macro-step", ("integration.macro_step",), "integration and output"),
    Flag("--tolerance", ("integration.tolerance",), "integration and output"),
    Flag("--record-every", ("output.record_every",), "integration and output", "N", whole),
)

MOST_CHOICES = 9
"""Words that an option's help lists."""

_LINEAR = ("linear-spring", "kelvin-voigt", "anagnostopoulos")
"""Laws whose stiffness is in N/m, and therefore their own."""


def settings(options: Any, joints: Sequence[str]) -> list[Setting]:
    """What the options say, as settings for all `joints`.

    Raises:
        JointplayError: one for a joint, and no joint; or friction of a joint that reads wrong.
    """
    from jointplay.scenario.settings import Setting

    entries = []
    for flag in FLAGS:
        given = getattr(options, flag.attribute)
        if given is None:
            continue
        read = flag.read or number
        values = [read(one) for one in (given if isinstance(given, list) else [given])]
        for index, key in enumerate(flag.keys):
            value = values[index if len(values) > 1 else 0]
            entries += [Setting(k, value, flag.name) for k in _keys(flag, key, joints, options)]
    if "drive.bandwidth" in {".".join(s.key) for s in entries} or options.damping_ratio is not None:
        entries.insert(0, Setting(("drive", "kind"), "computed-torque", "--bandwidth"))
    if options.allow_unphysical:
        entries.append(
            Setting(
                ("robot", "allow_unphysical"), list(options.allow_unphysical), "--allow-unphysical"
            )
        )
    return [*entries, *_friction(options.joint_friction)]


def _keys(flag: Flag, key: str, joints: Sequence[str], options: Any) -> list[tuple[str, ...]]:
    parts = tuple(key.split("."))
    if "JOINT" not in parts:
        return [parts]
    if flag.name == "--stiffness" and options.law in _LINEAR:
        parts = ("joints", "JOINT", "normal", "stiffness")
    if not joints:
        raise JointplayError(f"{flag.name} is for a joint with clearance; name it: --joint NAME")
    return [tuple(joint if part == "JOINT" else part for part in parts) for joint in joints]


def _friction(entries: Sequence[str]) -> list[Setting]:
    from jointplay.scenario.settings import Setting

    coefficients = []
    for entry in entries:
        name, _, values = entry.partition("=")
        parts = [number(value.strip()) for value in values.split(",")]
        if not name or len(parts) != 2:
            raise JointplayError(f"--joint-friction must read JOINT=COULOMB,VISCOUS, got {entry!r}")
        for key, value in zip(("coulomb", "viscous"), parts, strict=True):
            coefficients.append(Setting(("joint_friction", name, key), value, "--joint-friction"))
    return coefficients


@cache
def _schema() -> dict[str, Any]:
    from jointplay.scenario.schema import schema

    return schema()


def explanation(flag: Flag) -> str:
    """What the scenario's tables say of an option's key, with unit, choices and default."""
    parts = flag.keys[0].split(".")
    text = " ".join((_described(_schema(), _schema(), parts) or "").split())
    choices = _choices(_schema(), _schema(), parts)
    text = text.replace("``", "").replace("`", "").rstrip(".")
    if choices and len(choices) < MOST_CHOICES:
        text = f"{text}: {', '.join(choices)}" if text else ", ".join(choices)
    elif choices:
        text = f"{text or 'one'} of {len(choices)}, see docs/laws.md: {', '.join(choices[:3])} ..."
    default = f" (default {flag.default})" if flag.default else ""
    return f"{text}{default}: {flag.keys[0]}".removeprefix(": ").replace("%", "%%")


def _choices(whole_schema: dict[str, Any], part: Any, path: Sequence[str]) -> list[str]:
    """Words that the key at `path` can be, in all tables that have it."""
    if "$ref" in part:
        return _choices(whole_schema, whole_schema["$defs"][part["$ref"].rpartition("/")[2]], path)
    if not path:
        words = [part["const"]] if "const" in part else part.get("enum", [])
        choices = [word for word in words if isinstance(word, str)]
    else:
        choices = []
        inner = part.get("properties", {}).get(path[0])
        if inner is None and isinstance(part.get("additionalProperties"), dict):
            inner = part["additionalProperties"]
        if inner is not None:
            choices = _choices(whole_schema, inner, path[1:])
    for choice in (*part.get("anyOf", ()), *part.get("oneOf", ())):
        choices += [word for word in _choices(whole_schema, choice, path) if word not in choices]
    return choices


def _described(whole_schema: dict[str, Any], part: Any, path: Sequence[str]) -> str | None:
    """Description of the key at `path` within `part` of a JSON schema; None if it has none."""
    while "$ref" in part:
        part = whole_schema["$defs"][part["$ref"].rpartition("/")[2]] | {
            key: value for key, value in part.items() if key != "$ref"
        }
    if not path:
        return str(part.get("description", "")) or None
    inner = part.get("properties", {}).get(path[0])
    if inner is None and isinstance(part.get("additionalProperties"), dict):
        inner = part["additionalProperties"]
    if inner is not None:
        return _described(whole_schema, inner, path[1:])
    for choice in (*part.get("anyOf", ()), *part.get("oneOf", ()), *part.get("allOf", ())):
        text = _described(whole_schema, choice, path)
        if text is not None:
            return text
    return None
