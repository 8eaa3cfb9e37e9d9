"""That no imports form a circle, and that kinds of joint are told apart only where they are."""

import ast
import collections
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2] / "src"
SOURCES = sorted((ROOT / "jointplay").rglob("*.py"))


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def name_of(path, root):
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def imported(body, modules):
    """Modules among `modules` that run when these statements do, or later when a function does."""
    for node in body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from imported(node.orelse, modules)
        elif isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for one in node.names:
                inner = f"{node.module}.{one.name}"
                yield inner if inner in modules else modules[node.module].get(one.name, node.module)
        else:
            yield from imported(ast.iter_child_nodes(node), modules)


def homes(path, root):
    """Where a package's names are, by its stub: they are loaded when first used."""
    stub = path.with_suffix(".pyi")
    if not stub.exists():
        return {}
    package = name_of(path, root)
    found = {}
    for node in ast.parse(stub.read_text()).body:
        if isinstance(node, ast.ImportFrom):
            where = f"{package}.{node.module}" if node.module else package
            found |= {one.asname or one.name: where for one in node.names}
    return found


def circle(root, paths):
    """Modules that import each other, in order, or nothing."""
    files = {name_of(path, root): path for path in paths}
    modules = collections.defaultdict(dict, {n: homes(path, root) for n, path in files.items()})
    needs = {
        name: sorted(set(imported(parsed(path).body, modules)) & set(files))
        for name, path in files.items()
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

    return next((found for name in files if (found := follow(name, []))), [])


def test_no_modules_import_each_other_in_a_circle_not_even_late():
    assert circle(ROOT, SOURCES) == []


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
    """They ask what a kind can do; `jointplay export urdf` takes one, and a URDF has its own."""
    from jointplay.physics.joints import JOINT_KINDS

    classes = {kind.__name__ for kind in JOINT_KINDS.values()}
    asking = []
    for path in SOURCES:
        place = path.relative_to(ROOT / "jointplay").as_posix()
        if place.startswith("physics/joints/") or place in (
            "cli/commands/export/urdf.py",
            "model/urdf.py",
        ):
            continue
        lines = kinds_told_apart(parsed(path), classes, set(JOINT_KINDS))
        asking += [f"{place}:{line}" for line in lines]
    assert asking == []
    text = "isinstance(x, A)\njp.A()\nx.kind == 'a'\nx.kind in ('b', 'a')\nx.kind == 'b'\n"
    assert sorted(kinds_told_apart(ast.parse(text), {"A"}, {"a"})) == [1, 2, 3, 4]
