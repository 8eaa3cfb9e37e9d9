"""How large modules and functions of the package are, and that no imports form a circle."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "src"
SOURCES = sorted((ROOT / "jointplay").rglob("*.py"))
LONGEST_MODULE = 400
LONGEST_FUNCTION = 79


def name_of(path, root):
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def functions(path):
    """Name and number of lines of each function of a file, its decorators left out."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node.end_lineno - node.lineno + 1


def imported(body, modules):
    """Modules among `modules` that run when these statements do."""
    for node in body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from imported(node.orelse, modules)
        elif isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for one in node.names:
                inner = f"{node.module}.{one.name}"
                yield inner if inner in modules else node.module
        elif isinstance(node, ast.If | ast.Try | ast.With):
            yield from imported(node.body, modules)


def circle(root, paths):
    """Modules that import each other, in order, or nothing."""
    modules = {name_of(path, root): path for path in paths}
    needs = {
        name: sorted(set(imported(ast.parse(path.read_text()).body, modules)) & set(modules))
        for name, path in modules.items()
    }
    done = set()

    def follow(name, way):
        if name in way:
            return [*way[way.index(name) :], name]
        if name in done:
            return []
        for inner in needs[name]:
            if inner != name and (found := follow(inner, [*way, name])):
                return found
        done.add(name)
        return []

    return next((found for name in modules if (found := follow(name, []))), [])


def test_no_module_is_longer_than_400_lines():
    lengths = {name_of(path, ROOT): len(path.read_text().splitlines()) for path in SOURCES}
    assert len(lengths) > 250
    assert {name: n for name, n in lengths.items() if n > LONGEST_MODULE} == {}


def test_no_function_has_80_lines():
    lengths = {
        f"{name_of(path, ROOT)}:{name}": n for path in SOURCES for name, n in functions(path)
    }
    assert len(lengths) > 2000
    assert {name: n for name, n in lengths.items() if n > LONGEST_FUNCTION} == {}


def test_no_modules_import_each_other_in_a_circle():
    assert circle(ROOT, SOURCES) == []


@pytest.mark.parametrize(
    ("one", "other", "found"),
    [
        ("import p.b", "x = 1", []),
        ("import p.b", "from p import a", ["p.a", "p.b", "p.a"]),
        ("from p.b import x", "try:\n    from p.a import y\nexcept ImportError: x = 1", True),
        ("import p.b", "def late():\n    from p import a", []),
        ("import p.b", "if TYPE_CHECKING:\n    from p import a", []),
    ],
)
def test_circles_are_found(tmp_path, one, other, found):
    folder = tmp_path / "p"
    folder.mkdir()
    paths = [folder / name for name in ("__init__.py", "a.py", "b.py")]
    for path, text in zip(paths, ("", one, other), strict=True):
        path.write_text(text)
    assert bool(circle(tmp_path, paths)) == bool(found)
    assert found is True or circle(tmp_path, paths) == found


def test_lengths_are_of_all_functions(tmp_path):
    path = tmp_path / "long.py"
    path.write_text(
        "class A:\n    def f(self):\n        def g():\n            x = 1\n            y = 2\n"
    )
    assert dict(functions(path)) == {"f": 4, "g": 3}


def kinds_told_apart(tree, classes, words):
    """Lines on which a class of joint is named in code, or something's kind compared with one."""
    for node in ast.walk(tree):
        named = isinstance(node, ast.Name) and node.id in classes
        taken = isinstance(node, ast.Attribute) and node.attr in classes
        compared = False
        if isinstance(node, ast.Compare) and ast.unparse(node.left).endswith(".kind"):
            constants = {n.value for n in ast.walk(node) if isinstance(n, ast.Constant)}
            compared = bool(constants & words)
        if named or taken or compared:
            yield node.lineno


def test_nobody_outside_joints_tells_kinds_of_joint_apart():
    """They ask what a kind can do; `jointplay urdf` takes one, and a URDF has its own."""
    from jointplay.joints import JOINT_KINDS

    classes = {kind.__name__ for kind in JOINT_KINDS.values()}
    asking = []
    for path in SOURCES:
        place = path.relative_to(ROOT / "jointplay").as_posix()
        if place.startswith("joints/") or place in ("commands/urdf.py", "mechanism/entry.py"):
            continue
        lines = kinds_told_apart(
            ast.parse(path.read_text(encoding="utf-8")), classes, set(JOINT_KINDS)
        )
        asking += [f"{place}:{line}" for line in lines]
    assert asking == []
    text = "isinstance(x, A)\njp.A()\nx.kind == 'a'\nx.kind in ('b', 'a')\nx.kind == 'b'\n"
    assert sorted(kinds_told_apart(ast.parse(text), {"A"}, {"a"})) == [1, 2, 3, 4]
