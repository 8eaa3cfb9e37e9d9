"""The process that expands a xacro for `model.xacro`: a sandbox that gets only what it asks for.

The library `xacro` evaluates expressions of the file as Python. Here they are a language of their
own: numbers, texts, lists and tables with their operators and methods, functions that the library
provides, and nothing that leads from these to Python's internals. Besides, the process can open
nothing, import nothing and see no environment: files come from the process that began it, which
gives the robot's own only.
"""

import ast
import io
import json
import math
import os
import string
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from types import SimpleNamespace
from typing import Any
from xml.dom import expatbuilder, minidom  # the former is imported at the first use otherwise

from jointplay.base import confined
from jointplay.base.units import NUMBER, not_lost

_REFUSED = (ast.Await, ast.Yield, ast.YieldFrom, ast.NamedExpr)
_AUDITED = {"compile", "exec", "builtins.id"}
"""Audit events (PEP 578) of evaluating and copying; all others are refused."""

_DATA = (bool, int, float, str, list, tuple, dict, set, frozenset)
"""Types whose methods an expression may call."""

_ATTRIBUTE = "<attribute>"  # no name that an expression could write


class Refused(Exception):
    """A file wants what no xacro may have, or what is not there; the message says what."""


class _Arguments(dict[str, str]):
    """Arguments by name, with those that were asked for, and the one that was missing."""

    def __init__(self, values: Mapping[str, str]) -> None:
        super().__init__(values)
        self.used: set[str] = set()
        self.missing = ""

    def __contains__(self, name: object) -> bool:
        self.used.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.used.add(name)
        return super().__getitem__(name)

    def __missing__(self, name: str) -> str:
        self.missing = name
        raise KeyError(name)


class _Parent:
    """The process that began this one, which answers requests; a line of JSON for each."""

    def __init__(self) -> None:
        self._in, self._out = sys.stdin.buffer, sys.stdout.buffer

    def tell(self, **message: Any) -> None:
        self._out.write(json.dumps(message).encode() + b"\n")
        self._out.flush()

    def ask(self, request: str = "begin", subject: str = "") -> Any:
        """The parent's answer to a request (`xacro._Files.give`).

        Raises:
            OSError: there is no such file, or it cannot be read.
            Refused: the file may not be read.
        """
        self.tell(ask=request, of=str(subject))
        answer = json.loads(self._in.readline())
        if "failed" in answer:
            raise OSError(*answer["failed"])
        if "refused" in answer:
            raise Refused(answer["refused"])
        return answer["gives"]


def serve(path: str) -> None:
    """Main function of the process: expand the file, and tell the parent the URDF or a fault."""
    parent = _Parent()
    # All that is needed is imported before the process is closed.
    import xacro
    from xacro import substitution_args  # with yaml, which is imported later otherwise

    assert expatbuilder
    assert substitution_args.yaml
    os.environ.clear()
    arguments = _Arguments(parent.ask())
    warnings = _confine(parent, xacro)
    with confined.closed(), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        sys.addaudithook(_audit)
        try:
            root = xacro.process_file(path, mappings=arguments).documentElement
            _require_links(root, path, parent)
            notes = [*warnings, *_passed_over(minidom.parseString(parent.ask("read", path)))]
            answer = {"text": root.toxml(), "said": list(dict.fromkeys(notes))}
        except Exception as error:  # noqa: BLE001 - expressions in files raise anything
            answer = {"fault": _fault(error, path, arguments, xacro)}
        parent.tell(**answer, asked=sorted(arguments.used))
        os._exit(0)


def _audit(event: str, _: Any) -> None:
    """Audit hook that refuses all but `_AUDITED` events."""
    if event not in _AUDITED:
        raise Refused(f"no xacro may do what Python calls {event}")


def _confine(parent: _Parent, xacro: Any) -> list[str]:
    """Make the library evaluate by `_evaluate`, and take all that it reads from the parent.

    Returns:
        The library's warnings, a list that fills while it works.
    """
    warnings: list[str] = []

    def warn(*parts: Any, **_: Any) -> None:
        text = " ".join(map(str, parts))
        if "deprecated" not in text:  # the URDF is the same
            warnings.append(text)

    substitution = xacro.substitution_args

    def environment(name: str) -> str:
        raise Refused(
            f"a xacro sees no environment, so {name!r} is not known: write $(arg {name}) and give "
            f"--xacro {name}:=VALUE, or $(optenv {name} DEFAULT)"
        )

    def find(name: str) -> str:
        return str(parent.ask("find", name))

    def extension(text: str, context: Mapping[str, Any]) -> str:
        names = _Substitution(substitution, context.get("arg", {}))
        return str(_evaluate(text, names, xacro))

    # Files, patterns and expressions of the library itself; then what $(find), $(env) and $(eval)
    # call; then its namespace `python`.
    xacro.warning = warn
    xacro.open = lambda name: io.StringIO(parent.ask("read", name))
    xacro.glob = SimpleNamespace(glob=lambda pattern: parent.ask("match", pattern))
    xacro.safe_eval = lambda text, names, _=None: _evaluate(text, names, xacro)
    substitution._eval = extension
    functions: dict[str, Callable[..., Any]] = {"_eval_find": find, "_eval_env": environment}
    for name, function in functions.items():
        setattr(substitution, name, function)
        substitution._eval_dict[name.removeprefix("_eval_")] = function
    python = xacro._global_symbols["python"]
    dict.pop(python, "vars", None)
    dict.__setitem__(python, "type", _type)
    return warnings


class _Substitution(dict[str, Any]):
    """Names in ``$(eval ...)``: the library's functions, and arguments by their names."""

    def __init__(self, substitution: Any, arguments: Mapping[str, str]) -> None:
        known = substitution._eval_dict
        super().__init__((name, value) for name, value in known.items() if "__" not in name)
        self._value = lambda name: substitution.convert_value(arguments[name], "auto")
        self["arg"] = self._value

    def __missing__(self, name: str) -> Any:
        return self._value(name)


def _type(value: Any) -> type:
    """``type`` for data only: the type of anything else would lead to Python's internals."""
    if type(value) not in _DATA:
        raise Refused(f"python.type: of {type(value).__name__}")
    return type(value)


class _Checked(ast.NodeTransformer):
    """Refuses names that lead to Python's internals; `_attribute` looks up what has a dot."""

    def generic_visit(self, node: ast.AST) -> ast.AST:
        if isinstance(node, _REFUSED):
            raise Refused(f"no xacro may have {type(node).__name__}")
        for field, value in ast.iter_fields(node):
            named = isinstance(value, str) and not isinstance(node, ast.Constant)
            if named and field != "type_comment" and "__" in value:
                raise Refused(f"invalid name {value!r}")
        super().generic_visit(node)
        if not isinstance(node, ast.Attribute):
            return node
        called = ast.Name(_ATTRIBUTE, ast.Load())
        call = ast.Call(called, [node.value, ast.Constant(node.attr)], [])
        return ast.copy_location(call, node)


def _evaluate(text: str, names: dict[str, Any], xacro: Any) -> Any:
    """The value of an expression, after `_Checked`, without Python's built-in names."""
    try:
        tree = _Checked().visit(ast.parse(text.strip(), "<expression>", "eval"))
        code = compile(ast.fix_missing_locations(tree), "<expression>", "eval")
    except (RecursionError, MemoryError):
        raise Refused("an expression is nested too deeply") from None
    except ValueError as error:  # a null byte
        raise Refused(str(error)) from None
    dict.__setitem__(names, "__builtins__", {})
    dict.__setitem__(names, _ATTRIBUTE, partial(_attribute, xacro))
    return eval(code, names)


def _attribute(xacro: Any, value: Any, name: str) -> Any:
    """``value.name`` in an expression: an entry of a table or namespace, or a method of data."""
    kind = type(value)
    if kind is xacro.NameSpace:
        try:
            return value[name]
        except KeyError:
            raise NameError(f"name '{name}' is not defined") from None
    plain = {xacro.YamlDictWrapper: dict, xacro.YamlListWrapper: list}.get(kind, kind)
    if plain in _DATA and not name.startswith("_") and hasattr(plain, name):
        if kind is str and name == "format":
            return lambda *args, **named: _Formatter().vformat(value, args, named)
        if kind is str and name == "format_map":
            return lambda named: _Formatter().vformat(value, (), named)
        return getattr(value, name)
    if kind is xacro.YamlDictWrapper:
        return value[name]
    raise Refused(f"{kind.__name__} has no .{name} in a xacro")


class _Formatter(string.Formatter):
    """Formatter that fills in values, but no attributes of them."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        if "." in field_name:
            raise Refused(f"invalid field {{{field_name}}}")
        return super().get_field(field_name, args, kwargs)


def _require_links(root: Any, path: str, parent: _Parent) -> None:
    """Refuse a robot without links, as of a file that only defines macros."""
    if root.tagName != "robot" or root.getElementsByTagName("link"):
        return
    elements = minidom.parseString(parent.ask("read", path)).getElementsByTagName("xacro:macro")
    macros = ", ".join(macro.getAttribute("name") for macro in elements)
    hint = f": it only defines {macros}; give the file that uses it" if macros else ""
    raise Refused(f"makes no link{hint}")


def _passed_over(document: Any) -> Iterator[str]:
    """Notes on what the library takes otherwise than the file has it, without a warning."""
    for element in document.getElementsByTagName("*"):
        tag = element.tagName
        for name, value in element.attributes.items():
            if _misread(value):
                yield f"<{tag}>: {name}={value!r} is no number as other programs read them"
        if element.prefix != "xacro":
            continue
        label = f"<{tag}> {element.getAttribute('name')!r}"
        block = element.localName == "property" and not element.hasAttribute("value")
        inside = () if block or element.localName in _PASSED_ON else element.childNodes
        for node in inside:
            if node.nodeType == node.TEXT_NODE and (text := node.data.strip()):
                yield f"{label} has the text {text[:30]!r}"
            if node.nodeType == node.ELEMENT_NODE and element.localName in _DEFINE:
                yield f"{label} has <{node.tagName}> in it"
        for sibling in element.parentNode.childNodes if element.localName in _DEFINE else ():
            same = sibling.nodeName == element.tagName and sibling is not element
            if same and sibling.getAttribute("name") == element.getAttribute("name"):
                say = _DEFINE[element.localName]
                values = [e.getAttribute(say) if say else e.toxml() for e in (element, sibling)]
                if values[0] != values[1] and not sibling.hasAttribute("remove"):
                    yield f"{label} stands there twice"


_DEFINE = {"property": "value", "arg": "default", "macro": ""}
"""Elements that define a name, and the attribute with its value; empty: their content is it."""
_PASSED_ON = ("macro", "if", "unless", "element")
"""Elements whose text goes into the URDF."""


def _misread(text: str) -> bool:
    """Whether Python reads a text as a number, but other programs read another one, or none."""
    try:
        float(text)
    except ValueError:
        return False
    text = text.strip()
    if not NUMBER.fullmatch(text):
        return not text.strip("+-").isalpha()  # nan, inf
    try:
        return math.isinf(not_lost(text))
    except ValueError:
        return True


def _fault(error: Exception, path: str, arguments: _Arguments, xacro: Any) -> str:
    """Message on an error, with the included file and the macro in which it came up."""
    cause: Any = error
    while isinstance(wrapped := getattr(cause, "exc", None), Exception):
        cause = wrapped
    name = arguments.missing
    if name and cause.args == (name,):
        text = f"argument {name!r} has no value: give it by --xacro {name}:=VALUE"
        text += f", or robot.xacro.{name} in a scenario"
    elif isinstance(cause, OSError):
        text = f"cannot read {str(cause.filename)!r}: {cause.strerror}"
        values = [f"{key}={value}" for key, value in arguments.items()]
        text += f"; arguments are {', '.join(values)}"[:200] if values else ""
    elif isinstance(cause, RecursionError):
        text = "macros call each other without end"
    elif isinstance(cause, MemoryError):
        text = "it takes more memory than a robot may"
    elif isinstance(cause, xacro.XacroException):
        text = str(error) or repr(error)
    else:
        text = f"{str(cause) or repr(cause)} {getattr(error, 'suffix', None) or ''}".rstrip()
    file = str((xacro.filestack or [path])[-1] or path)
    macros = [macro.body.getAttribute("name") for macro in xacro.macrostack or ()]
    places = [f"file {file!r}"] if file != path else []
    places += [f"macro {macros[-1]!r}"] if macros else []
    where = f" ({', '.join(places)})" if places else ""
    return f"{where}: {text}"
