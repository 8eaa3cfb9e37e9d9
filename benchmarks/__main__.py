"""Every benchmark by its name: ``python benchmarks`` lists them.

python benchmarks clearance --loaded      one, with its options (--help lists them)
python benchmarks cost --quick            a folder, one after the other: last lines, and times
"""

import ast
import importlib
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
FOLDERS = {
    "paper": "the paper's comparisons of clearance",
    "cost": "what steps, runs, studies and pages cost",
    "truth": "results compared with theory, converged runs, other engines and measurements",
    "robustness": "invalid inputs, interruptions, and mistakes that tests must find",
    "pictures": "pages and pictures of the documentation",
}


def scripts() -> dict[str, Path]:
    """Every benchmark's file by its name, folder by folder."""
    files = [path for folder in FOLDERS for path in sorted((HERE / folder).glob("*.py"))]
    return {path.stem: path for path in files if "\ndef main(" in path.read_text(encoding="utf-8")}


def listing() -> str:
    """All benchmarks with the first line of each."""
    known = scripts()
    lines = [__doc__.strip()]
    for folder, purpose in FOLDERS.items():
        lines += ["", f"{folder}: {purpose}"]
        for name, path in known.items():
            if path.parent.name == folder:
                text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
                lines.append(f"  {name:22}{text.splitlines()[0]}")
    return "\n".join(lines)


def several(names: list[str], options: list[str]) -> int:
    """Start each in a process of its own, say how it ended, and return how many failed."""
    failed = 0
    for name in names:
        began = time.perf_counter()
        done = subprocess.run(
            [sys.executable, HERE, name, *options], stdout=subprocess.PIPE, text=True
        )
        last = done.stdout.strip().splitlines()[-1:] or ["(nothing printed)"]
        failed += done.returncode != 0
        verdict = f"failed, status {done.returncode}: " if done.returncode else ""
        print(f"{name} ({time.perf_counter() - began:.0f} s): {verdict}{last[0]}", flush=True)
    return failed


def main() -> int:
    known = scripts()
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        print(listing())
        return 0
    first, *options = sys.argv[1:]
    if first in FOLDERS:
        names = [name for name, path in known.items() if path.parent.name == first]
        return 1 if several(names, options) else 0
    if first not in known:
        choices = ", ".join([*FOLDERS, *known])
        print(f"benchmarks: no {first!r}; there are {choices}", file=sys.stderr)
        return 2
    sys.argv = [f"benchmarks {first}", *options]
    sys.path.insert(0, str(HERE))  # where `python -m benchmarks` does not look
    status = importlib.import_module(f"{known[first].parent.name}.{first}").main()
    return status if isinstance(status, int) else 0


if __name__ == "__main__":
    sys.exit(main())
