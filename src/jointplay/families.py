"""Families of classes of which a word in a file chooses one: laws, joints, drives, loads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any

from jointplay.errors import JointplayError


@dataclass(frozen=True)
class Preset:
    """A kind with some of its fields set."""

    kind: type
    title: str
    given: Mapping[str, Any]


@dataclass(frozen=True)
class Family:
    """Classes of which a word chooses one."""

    key: str
    """Key that has the word: ``law``, ``kind``."""
    noun: str
    """What one is called: ``friction law``."""
    members: MutableMapping[str, Any]
    """Classes and presets by word; `add` writes into it."""
    default: str | None = None
    """Word that is taken where there is none."""
    bare: bool = True
    """Whether the bare word stands for a table with nothing else in it."""


_families: dict[type, Family] = {}
_names: dict[type, tuple[Callable[[str], Any], Sequence[str]]] = {}


def register(base: type, family: Family) -> None:
    """Let `base` be read as one of a family."""
    _families[base] = family


def add(base: type, kind: type) -> None:
    """Let files name a class of one's own, by the word that it has: one of a family's, from now on.

    Args:
        base: `Load`, `Drive`, `Clearance`, `NormalForceLaw`, `FrictionLaw` or `FilmLaw`.
        kind: its subclass.

    Raises:
        JointplayError: no such family, or the word is taken.
    """
    family = _families.get(base)
    if family is None or not issubclass(kind, base) or base.selector is None:  # type: ignore[attr-defined]
        raise JointplayError(f"{kind.__name__} cannot be added to {base.__name__}")
    word = getattr(kind, base.selector[1])  # type: ignore[attr-defined]
    if family.members.get(word, kind) is not kind:
        raise JointplayError(f"there is a {family.noun} {word!r} already")
    family.members[word] = kind


def register_names(kind: type, find: Callable[[str], Any], names: Sequence[str]) -> None:
    """Let a `kind` be given by name; `find` gives that of one of `names`."""
    _names[kind] = find, names


def family_of(kind: Any) -> Family | None:
    """The family whose base `kind` is, if it is one."""
    return _families.get(kind)


def names_of(kind: Any) -> Sequence[str]:
    """Names by which a `kind` can be given."""
    return _names[kind][1] if kind in _names else ()


def named(kind: type, name: str) -> Any:
    """The `kind` of this name, one of `names_of`."""
    return _names[kind][0](name)
