"""How soon the live page answers, from the move of a slider to the drawing in a browser.

Opens `jointplay live` for the SCARA and for the UR5 (clearance in its elbow; with --all in all six
joints, too), moves sliders in turn, and measures in the page from the input event until the answer
has been painted: the first budget, the first part of the motion, and its first cycle. Beside it the
processor time that the answering process took, which a busy machine does not lengthen. Chromium
draws here without a graphics card: each robot is measured without its 3D picture (curves and
numbers alone), and once more with it, drawn by the processor that computes the answers. Curves and
numbers come before the picture: how much later that is finished is measured, too.

Usage: python benchmarks live [--moves 30] [--all] [--quick]
"""

import shutil
import signal
import statistics
import subprocess
import sys

from common import command, require

from jointplay.base.progress import ProgressBar

UR5 = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
ROBOTS = {"SCARA": (), "UR5": ("ur5", "--joint", "elbow_joint")}
ALL = {"UR5, all joints": ("ur5", *(w for name in UR5 for w in ("--joint", f"{name}_joint")))}
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
VIEWS = {"without 3D picture": ("--disable-3d-apis",), "with it, drawn in software": SOFTWARE}
MOVE = """([k]) => {
    const live = window.jointplay, all = Object.values(live.inputs), {slider} = all[k % all.length];
    slider.value = String((Number(slider.value) + 37) % 240 + 30);
    slider.dispatchEvent(new Event("input"));
    slider.dispatchEvent(new Event("change"));
}"""
WATCH = """() => {
    const live = window.jointplay, {viewer} = live.view, gl = viewer.renderer.getContext();
    const shown = live.showPicture, render = viewer.render;
    let awaited = false;
    live.showPicture = (...tracks) => { awaited = true; shown.apply(live, tracks); };
    viewer.render = () => {
        render.call(viewer);
        if (!awaited) return;
        awaited = false;
        const {timing} = live, fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        gl.flush();
        const look = () => {
            const over = gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
            if (!over) setTimeout(look, 5);
            else if (!("picture" in timing)) timing.picture = performance.now() - timing.asked;
        };
        look();
    };
}"""
"""Has the page note when the first picture of an answer is finished."""

_INSTEAD = {"motion": "cycle"}
"""What shows a whole cycle at once shows no part of it before."""


def measure(browser, arguments, moves):
    """Of each move: milliseconds until budget and cycle are drawn, and their processor times."""
    command = [sys.executable, "-c", "from jointplay.cli import main; raise SystemExit(main())"]
    command += ["live", *arguments, "--no-browser", "--port", "0"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(server.stdout.readline().split()[2])
        wait(page)
        drawn = page.evaluate("() => Boolean(window.jointplay.view)")
        if drawn:
            page.evaluate(WATCH)
        rows = []
        for k in ProgressBar(range(moves)):
            page.wait_for_timeout(600)  # the last picture is drawn, in software
            page.evaluate(MOVE, [k])
            rows.append(wait(page, drawn))
        page.close()
        return rows
    finally:
        server.send_signal(signal.SIGINT)
        server.wait()


def wait(page, drawn=False):
    """The times of the newest question, once its exact answer is shown, and what is `drawn`."""
    while True:
        timing = page.evaluate("() => window.jointplay?.timing")
        if timing and timing.get("ended") and (not drawn or "picture" in timing):
            if "fine" not in timing:
                text = page.evaluate("() => window.jointplay.root.innerText")
                raise SystemExit(f"a question was not answered: {text}")
            return timing
        page.wait_for_timeout(10)


def medians(rows):
    """The middle of each time; where no part of the motion came first, the cycle's is taken."""
    return {
        key: statistics.median(row.get(key, row[_INSTEAD.get(key, key)]) for row in rows)
        for key in ("budget", "budgetCpu", "motion", "motionCpu", "cycle", "cycleCpu", "fine")
    } | {
        "picture": statistics.median(row["picture"] for row in rows)
        if "picture" in rows[0]
        else None
    }


def main():
    own = {"moves": (30, "of sliders"), "all": (False, "further robots")}
    options = command(__doc__, "the SCARA alone, one move", **own).parse_args()
    require(options.quick, playwright="pip install 'jointplay[movie]'")
    browser_path = shutil.which("chromium")
    if browser_path is None:
        text = "chromium is not installed"
        if not options.quick:
            raise SystemExit(text)
        print(f"skipped: {text}")
        return
    from playwright.sync_api import sync_playwright

    robots = ROBOTS | (ALL if options.all else {})
    if options.quick:
        robots, options.moves = {"SCARA": ROBOTS["SCARA"]}, 1
    found = {}
    with sync_playwright() as tools:
        for view, flags in VIEWS.items():
            flags = ["--no-sandbox", *flags]
            browser = tools.chromium.launch(executable_path=browser_path, args=flags)
            for name, arguments in robots.items():
                rows = measure(browser, arguments, options.moves)
                found[name, view] = middle = medians(rows)
                picture = middle["picture"]
                seen = "" if picture is None else f"its picture {picture:.0f} ms, "
                print(
                    f"{name}, {view}: budget {middle['budget']:.0f} ms drawn "
                    f"({middle['budgetCpu']:.0f} ms of processor), "
                    f"motion {middle['motion']:.0f} ms ({middle['motionCpu']:.0f} ms), {seen}"
                    f"cycle {middle['cycle']:.0f} ms drawn ({middle['cycleCpu']:.0f} ms), "
                    f"exact run {middle['fine']:.0f} ms; medians of {len(rows)} moves"
                )
            browser.close()
    for view in VIEWS:
        budget, motion = (
            max(one[key] for (_, seen), one in found.items() if seen == view)
            for key in ("budget", "motion")
        )
        print(f"live {view}: budget {budget:.0f} ms, motion {motion:.0f} ms")
