"""Questions that owners of arms ask in public: is each answered, and each robot's file read?

`threads/threads.toml` has thirty public threads: where it was asked, what is asked, a small input
with the numbers that were given, the commands that a reader of the README would type, and what an
answer must say: texts, and figures between two bounds that come from the thread, from closed forms
or from other programs (`because`). Robots are typed as they are, each with play in all its gears;
what is not answered in the first line is not answered. Intervals of lost motion
are those of `python benchmarks lost_motion`.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from common import Benchmark
from truth.lost_motion import held

from jointplay.base.files import temporary
from jointplay.base.progress import ProgressBar

HERE = Path(__file__).resolve().parent / "threads"
ROBOTS = (
    *("ar4", "so100", "so101", "kinova", "panda", "ur3", "ur5", "ur10", "xarm7", "z1"),
    *("a1", "b1", "go1", "go2", "solo12", "anymal_c", "g1_29dof_rev_1_0", "icub", "talos_reduced"),
    *("tiago", "baxter", "pr2", "romeo", "allegro_right_hand"),
)
ROBOT_ANSWER = r"(lets the tool|is up to) .* (mm|µm|deg|mrad)"
PATIENCE_S = 300.0
"""A command that takes longer has not answered [s of wall time]; the slowest takes a third."""


@dataclass(frozen=True)
class Thread:
    """A public thread: its question, the commands, and what their output must say."""

    source: str
    asks: str
    commands: list[str]
    says: list[str] = field(default_factory=list)
    figures: list[dict] = field(default_factory=list)
    because: str = ""
    quick: bool = False

    def missing(self, output: str) -> str:
        """What the answer lacks; nothing where the thread is answered."""
        for text in self.says:
            if not re.search(text, output):
                return f"does not say {text!r}"
        for figure in self.figures:
            match = re.search(figure["text"], output)
            low, high = figure["between"]
            if match is None:
                return f"has no figure {figure['text']!r}"
            if not low <= abs(float(match[1])) <= high:
                return f"{match[0]!r} is not between {low:g} and {high:g}"
        return ""


def typed(command: str, folder: Path) -> str:
    """What is printed when `command` is typed in `folder`; a failure is part of it."""
    program = [sys.executable, "-m", "jointplay"]
    try:
        ended = subprocess.run(
            command.replace("jointplay ", " ".join(program) + " ", 1),
            **{"shell": True, "cwd": folder, "timeout": PATIENCE_S, "text": True},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {PATIENCE_S:g} s"
    return ended.stdout


def answered(thread: Thread) -> tuple[str, str]:
    """What the answer to `thread` lacks, and all that was printed."""
    with temporary("arms") as folder:
        for path in HERE.iterdir():
            shutil.copy(path, folder)
        output = "\n".join(typed(command, Path(folder)) for command in thread.commands)
    return thread.missing(output), output


def main() -> None:
    benchmark = Benchmark(
        "arms", __doc__, runs=0, only=("", "threads whose source has this text"),
        axes=(300, "whose lost motion is measured"), seed=(1, "of them"),
    )  # fmt: skip
    args = benchmark.parse()
    threads = [
        Thread(**entry) for entry in tomllib.loads((HERE / "threads.toml").read_text())["thread"]
    ]
    if args.quick:
        threads = [thread for thread in threads if thread.quick]
    if args.only:
        threads = [thread for thread in threads if args.only in thread.source]
    rows, table = [], []
    for thread in ProgressBar(threads, "threads", unit="thread"):
        missing, output = answered(thread)
        rows.append({"source": thread.source, "answered": not missing, "output": output})
        table.append([thread.source, thread.asks, missing or "answered"])
    robots = ROBOTS[:1] if args.quick else ROBOTS
    for robot in ProgressBar(robots, "robots", unit="robot"):
        output = typed(f'jointplay budget {robot} --gear all="0.5 deg"', Path.cwd())
        first = output.strip().splitlines()[0] if output.strip() else ""
        read = bool(re.search(ROBOT_ANSWER, first))
        rows.append({"source": robot, "answered": read, "output": output})
        table.append([robot, "play of 0.5 deg in all gears", "answered" if read else first])
    benchmark.finish(["where", "asked", "answer"], table, rows)
    count = sum(row["answered"] for row in rows[: len(threads)])
    good = sum(row["answered"] for row in rows[len(threads) :])
    axes = 3 if args.quick else args.axes
    print(
        f"threads {count} of {len(threads)} answered, robots {good} of {len(robots)} at first "
        f"typing, lost motion {held(axes, args.seed):.1f} % of intervals hold"
    )


if __name__ == "__main__":
    main()
