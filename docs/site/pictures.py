"""Makes the pictures with which guides begin, by the guides' own commands.

python docs/site/pictures.py [NAME ...]

Each is drawn in a folder of its own and kept small in docs/images/guides. Pictures of what moves
need a Chromium (see `jointplay play --help all`).
"""

import math
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from PIL import Image
from shown import ROOT, blocks, command, named

TARGET = ROOT / "docs" / "images" / "guides"
WIDTH_PX, COLOURS = 840, 256
"""Of the pictures: the width of the pages' text (42 rem), and what lines and letters need."""
STILL = "--size 840x480"


class Picture(NamedTuple):
    """How a picture is made."""

    page: str
    """The guide, in docs."""
    begin: tuple[str, ...]
    """How the commands begin that are typed on the page, in their order."""
    file: str
    """What they write; a result is drawn as `jointplay play` shows it."""
    options: str = ""
    """Added to the last command: where to write, if the page does not say."""
    joint: tuple[str, str] = ("", "")
    """A joint of the commands, and another one for which they show more."""


ARM = "jointplay run ur5 --joint elbow_joint"
UNLOADED = ("elbow_joint", "shoulder_pan_joint")
"""Gravity holds the elbow's teeth on one side; those of the base change sides."""
PICTURES = {
    "first_run": Picture("tutorials/first_run.md", (ARM,), "first/result.nc"),
    "own_robot": Picture("tutorials/own_robot.md", ("jointplay run my_robot",), "mine/result.nc"),
    "measure_arm": Picture(
        "tutorials/measure_arm.md",
        ("jointplay identify so101 --plan", "python fill.py", "jointplay identify so101 dial.csv"),
        "arm/loops.png",
    ),
    "own_arm": Picture(
        "tutorials/own_arm.md",
        ("python measure.py", "jointplay calibrate ur5 arm.csv"),
        "arm/calibration.png",
    ),
    "mujoco": Picture(
        "tutorials/mujoco.md",
        ("jointplay export simulator",),
        "elbow_model/reversals.png",
        joint=UNLOADED,
    ),
    "budget": Picture("budget.md", ("jointplay budget ur5",), "ur5/robot.png"),
    "allocate": Picture(
        "allocate.md",
        ("jointplay allocate ur5 --preset ur-like --whole",),
        "ur5/allocation.png",
        "--out ur5",
    ),
    "compensate": Picture(
        "compensate.md", ("jointplay compensate so101",), "corrected/error.png"
    ),
    "iso9283": Picture("iso9283.md", ("jointplay study iso9283",), "scara_iso/path.png"),
    "identify": Picture(
        "identify.md",
        ("python measured.py", "jointplay identify my_robot.urdf measured.csv"),
        "identified/identified.png",
    ),
    "wear": Picture("wear.md", ("jointplay study wear",), "life.csv"),
    "results": Picture("results.md", (ARM,), "ur5/overview.png"),
    "look": Picture("look.md", ("jointplay live ur5",), "live"),
    "simulator": Picture(
        "simulator.md",
        ("jointplay export simulator",),
        "elbow/reversals.png",
        joint=UNLOADED,
    ),
    "mechanisms": Picture(
        "mechanisms.md",
        ("jointplay init --linkage", "jointplay run crank.toml"),
        "crank/crank.nc",
    ),
    "scenarios": Picture(
        "scenarios.md", ("jointplay init my_study", "jointplay check"), "my_study.png"
    ),
    "sweeps": Picture(
        "sweeps.md",
        ("jointplay study sweep", "jointplay plot scara_sweep"),
        "peak_force.png",
        "--out peak_force.png",
    ),
}  # fmt: skip


def given(picture, folder):
    """Write what the page, or the tutorial with the robot of the guides, has one save."""
    for page in (ROOT / "docs/tutorials/own_robot.md", ROOT / "docs" / picture.page):
        for block in blocks(page, "python", "xml", "text"):
            if name := named(block, page.read_text(encoding="utf-8")):
                (folder / name).write_text(block.text, encoding="utf-8")


def typed(picture):
    """The commands, as they are typed."""
    page = ROOT / "docs" / picture.page
    *first, last = (
        begin if begin.startswith("python ") else command(page, begin) for begin in picture.begin
    )
    lines = [*first, f"{last} {picture.options}".strip()]
    return [line.replace(*picture.joint) if picture.joint[0] else line for line in lines]


def run(line, folder):
    subprocess.run(shlex.split(line), cwd=folder, check=True, stdout=subprocess.DEVNULL)


def seen(url, path):
    """Photograph what a page of `jointplay live` shows when its answer is exact."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 860})
        page.goto(url)
        page.get_by_text("exact answer", exact=True).wait_for(timeout=600_000)
        page.screenshot(path=path, full_page=True)
        browser.close()


CHROMIUM = os.environ.get("JOINTPLAY_CHROMIUM", "/usr/bin/chromium")


def live(line, folder, path):
    process = subprocess.Popen(
        [*shlex.split(line), "--no-browser"], cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        url = next(word for said in process.stdout for word in said.split() if "http://" in word)
        seen(url, path)
    finally:
        process.terminate()
        process.wait()


def worn(table):
    """Draw how deep the bore is worn after each block of cycles, at the end where it is deepest."""
    import pandas
    from matplotlib import pyplot

    bore = pandas.read_csv(table).query("part == 'bore' and block > 0")
    deepest = bore[bore.end == bore.loc[bore.depth_m.idxmax()].end]
    figure, axes = pyplot.subplots(figsize=(8.4, 3.6))
    for cycles, profile in sorted(deepest.groupby("cycles"), reverse=True):
        azimuth_deg, depth_um = profile.azimuth_rad.map(math.degrees), 1e6 * profile.depth_m
        axes.fill_between(azimuth_deg, depth_um, alpha=0.5, label=f"after {cycles:,.0f} cycles")
    axes.set(xlabel="azimuth around the bore [°]", ylabel="depth of wear [µm]", xlim=(0, 360))
    axes.invert_yaxis()
    axes.legend()
    figure.savefig(table.with_suffix(".png"), bbox_inches="tight")
    return table.with_suffix(".png")


def drawn(picture, folder):
    """The picture as the commands draw it."""
    given(picture, folder)
    *lines, last = typed(picture)
    for line in lines:
        run(line, folder)
    path = folder / picture.file
    if picture.file == "live":
        live(last, folder, path.with_suffix(".png"))
        return path.with_suffix(".png")
    run(last, folder)
    if path.suffix == ".csv":
        return worn(path)
    if path.suffix == ".nc":
        run(f"jointplay play {picture.file} --movie still.png {STILL}", folder)
        return folder / "still.png"
    return path


def keep(path, name):
    """Keep a picture small: figures with few colours, shaded stills as photographs."""
    picture = Image.open(path).convert("RGB")
    if picture.width > WIDTH_PX:
        size = (WIDTH_PX, round(picture.height * WIDTH_PX / picture.width))
        picture = picture.resize(size, Image.Resampling.LANCZOS)
    target = TARGET / f"{name}.png"
    if path.name == "still.png":
        target = target.with_suffix(".webp")
        picture.save(target, quality=85)
    else:
        picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=0).save(target, optimize=True)
    print(f"{target.relative_to(ROOT)}: {target.stat().st_size / 1e3:.0f} kB", flush=True)


def main(names):
    for name in names or PICTURES:
        with tempfile.TemporaryDirectory() as folder:
            keep(drawn(PICTURES[name], Path(folder)), name)


if __name__ == "__main__":
    main(sys.argv[1:])
