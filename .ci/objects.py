"""Compile what most runs call, for every processor that a wheel has objects for.

    python .ci/objects.py

They are put into the package's folder, from where building a wheel takes them (and nothing takes
them into the repository). Five minutes.
"""

import contextlib
import os
import shutil
import tempfile
from pathlib import Path

from jointplay import cli
from jointplay.base import compiler, objects

ROOT = Path(__file__).parents[1]
SHORT = ["--duration", "0.002", "--no-figures"]
PLAY = ["--joint", "joint_b=0.1mm", *SHORT]
RUNS = [
    ["run", "scara", *PLAY],
    ["run", "scara", *PLAY, "--set", "integration.integrator=semi-implicit-euler"],
    ["run", "ur5", "--joint", "elbow_joint=6204", "--preset", *SHORT],
    ["run", "so101", "--preset", *SHORT],
    *(["run", str(ROOT / "urdf" / f"{name}.toml"), *SHORT]
      for name in ("scara_ab", "four_bar", "slider_crank", "delta", "three_rrr")),
    ["budget", "scara", "--joint", "joint_b=6204"],
    ["budget", "ur5", "--clearance", "0.05 mm"],
    ["budget", "so101", "--preset"],
    ["budget", "ur5", "--whole", "industrial"],
]  # fmt: skip
"""What they call is compiled: what first runs, studies and budgets call, but for rarer laws."""


def main() -> None:
    """Run all into a cache of its own, and keep what was compiled."""
    compiler.targets[:] = objects.RELEASED
    with tempfile.TemporaryDirectory() as made:
        os.environ["NUMBA_CACHE_DIR"] = str(Path(made) / "cache")
        for number, arguments in enumerate(RUNS):
            with contextlib.suppress(SystemExit):
                out = [] if arguments[0] == "budget" else ["--out", str(Path(made) / str(number))]
                cli.main([*arguments, *out])
        own = Path(objects.__file__).parents[1] / objects.FOLDER
        own.mkdir(exist_ok=True)
        for path in sorted((Path(made) / "cache").rglob("*.o")):
            shutil.copy(path, own)
            print(path.name)


if __name__ == "__main__":
    main()
