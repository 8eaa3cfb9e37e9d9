"""Pictures and films of playback, made without a screen.

A headless Chromium shows the page, drawing by software, and every frame is a screenshot: a film is
what a viewer of the page would see. playwright steers the browser, imageio writes the file (its
ffmpeg comes with it). These packages are the extra ``jointplay[movie]``.
"""

from __future__ import annotations

import io
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, closest, require_whole
from jointplay.base.imports import how_to_install
from jointplay.base.schema import OptionalQuantity, Quantity, check_fields, choice, quantity

SUFFIXES = (".png", ".gif", ".mp4", ".webm", ".webp")
_CODECS = {".mp4": "libx264", ".webm": "libvpx-vp9", ".webp": "libwebp_anim"}

VIEWS = ("both", "robot", "closeup")  # "both": the robot beside the close-up

CHROMIUM = "JOINTPLAY_CHROMIUM"  # environment variable with the path of a browser
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")

_SPEEDS = tuple(float(f"{step}e{power}") for power in range(-5, 2) for step in (1, 2, 5))
_SHORTEST_S, _LONGEST_S = 4.0, 20.0  # length of a film whose speed is not given
_HOLD_S = 0.1  # time of viewing for which a force stays visible, as in the player
_MOST_FRAMES = 20_000
_DRAWING = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Chromium's options for drawing by software: a graphics card is neither needed nor used."""
_READY_MS = 300_000  # for the page to load


@dataclass(frozen=True)
class Shot:
    """What a picture or film shows; numbers out of range are refused."""

    speed: OptionalQuantity = quantity("", above=0.0, default=None)
    """Relative to real time; None chooses one with which the film lasts 4 to 20 s."""
    begin: OptionalQuantity = quantity("s", least=0.0, default=None)
    """Begin of a film [s], None: the start; instant of a picture [s], None: the hardest impact."""
    end: OptionalQuantity = quantity("s", least=0.0, default=None)
    """End of a film [s]; None: the end of the run."""
    frames_per_second: Quantity = quantity("", default=25.0)
    size: tuple[int, int] = (1280, 720)  # width and height [pixels], even
    view: str = choice("view", VIEWS, default="both")
    signal: str | None = None
    """Signal drawn over time below the picture, by its name in the player: ``tool error``,
    ``contact force, JOINT`` and so on; None draws nothing."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not 1.0 <= self.frames_per_second <= 120.0:
            got = f"{self.frames_per_second:g}"
            raise JointplayError(f"frames per second must lie between 1 and 120, got {got}")
        if not all(160 <= require_whole("size", n) <= 4096 and n % 2 == 0 for n in self.size):
            got = "x".join(map(str, self.size))
            raise JointplayError(f"size must be even numbers from 160 to 4096 pixels, got {got}")

    def times(self, begin: float, end: float) -> tuple[np.ndarray, float]:
        """Times of the frames [s], and the speed, for a run from `begin` to `end` [s]."""
        first = begin if self.begin is None else self.begin
        last = end if self.end is None else min(self.end, end)
        if not first < last:
            span = f"from {begin:g} to {end:g} s"
            raise JointplayError(f"no film from {first:g} s to {last:g} s: the run lasts {span}")
        speed = speed_for(last - first) if self.speed is None else self.speed
        frames = round((last - first) / speed * self.frames_per_second) + 1
        if frames > _MOST_FRAMES:
            raise JointplayError(
                f"a film of {frames} frames; at most {_MOST_FRAMES} are made: play it faster than "
                f"at {speed:g} of real time, or film less of it"
            )
        return np.minimum(first + np.arange(frames) * speed / self.frames_per_second, last), speed


def speed_for(duration: float) -> float:
    """Speed relative to real time at which `duration` [s] makes a film of 4 to 20 s."""
    if _SHORTEST_S <= duration <= _LONGEST_S:
        return 1.0
    if duration < _SHORTEST_S:
        slow = [speed for speed in _SPEEDS if duration / speed >= _SHORTEST_S]
        return max(slow, default=_SPEEDS[0])
    return min((s for s in _SPEEDS if duration / s <= _LONGEST_S), default=_SPEEDS[-1])


@dataclass(frozen=True)
class MovieFile:
    """A film or picture: file, frames, length [s], speed relative to real time, size [pixels]."""

    path: Path
    frames: int
    length: float
    speed: float | None
    size: tuple[int, int]

    def __str__(self) -> str:
        width, height = self.size
        what = "a picture"
        if self.speed is not None:
            what = f"{self.frames} frames, {self.length:.3g} s at {pace(self.speed)}"
        megabytes = self.path.stat().st_size / 1e6
        return f"{self.path}: {what}, {width} x {height}, {megabytes:.2g} MB"


def pace(speed: float) -> str:
    """A speed in words: ``1/100 of real time``."""
    if speed == 1.0:
        return "real time"
    return f"{speed:g} x real time" if speed > 1.0 else f"1/{1.0 / speed:g} of real time"


def check(path: str | Path) -> Path:
    """Refuse a film that cannot be made, before any work is done, and return its path.

    Raises:
        JointplayError: an unknown suffix, a file that exists, or a package that is not installed.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise JointplayError(f"a film is one of {', '.join(SUFFIXES)} files, got {str(path)!r}")
    files.check_new(path)
    encoders = () if path.suffix.lower() == ".png" else ("imageio", "imageio_ffmpeg")
    for name in ("playwright", *encoders):
        if find_spec(name) is None:
            how = how_to_install("movie")
            raise JointplayError(f"films need {name}, which is not installed: {how}")
    return path


def film(
    content: bytes, contents: Mapping[str, Any], path: Path, shot: Shot, progress: bool = False
) -> MovieFile:
    """Film a page (HTML) with these contents; see `player.save_movie`."""
    from jointplay.base.progress import ProgressBar

    suffix = path.suffix.lower()
    begin = min(case["start"] for case in contents["cases"])
    end = max(case["end"] for case in contents["cases"])
    speed: float | None = None
    if suffix == ".png":
        hits = [  # impacts of the joint in the close-up
            (force, time)
            for case in contents["cases"]
            for joint in case["joints"]
            if joint["name"] == contents["joint"]
            for time, force in zip(joint["impacts"]["time"], joint["impacts"]["force"], strict=True)
        ]
        first = contents["cases"][0]
        hardest = max(hits)[1] if hits else 0.5 * (first["start"] + first["end"])
        moment = hardest if shot.begin is None else shot.begin
        if not begin <= moment <= end:
            span = f"from {begin:g} to {end:g} s"
            raise JointplayError(f"no moment {moment:g} s: the run lasts {span}")
        times = np.array([moment])
    else:
        times, speed = shot.times(begin, end)
    digits = 4 if speed is None else max(2, math.ceil(1 - math.log10(speed)))
    held = 0.0 if speed is None else _HOLD_S * speed
    how = "" if speed is None else f", {pace(speed)}"
    with ExitStack() as stack:
        folder = Path(stack.enter_context(files.temporary("film")))
        take = stack.enter_context(_browser(content, contents, shot, folder))
        bar = ProgressBar(
            times, unit="frames", disable=not progress or speed is None, desc="filming"
        )
        taken = (take(float(t), held, f"t = {t:.{digits}f} s{how}") for t in bar)
        film = next(taken) if speed is None else _encoded(taken, folder, suffix, shot)
    files.write(path, film)
    return MovieFile(path, len(times), len(times) / shot.frames_per_second, speed, shot.size)


@contextmanager
def _browser(
    content: bytes, contents: Mapping[str, Any], shot: Shot, folder: Path
) -> Iterator[Any]:
    """A function of time, span of forces and caption that returns a frame of the page as PNG."""
    from playwright.sync_api import Error, sync_playwright

    page_file = folder / "page.html"
    page_file.write_bytes(content)
    width, height = shot.size
    with sync_playwright() as tools:
        browser = launched(tools, Error)
        try:
            room = browser.new_context(viewport={"width": width, "height": height}, offline=True)
            tab = room.new_page()
            tab.goto(page_file.as_uri())
            tab.wait_for_selector("body.ready", timeout=_READY_MS)
            signals = tab.evaluate(
                "(what) => window.jointplay.bare(...what)",
                [shot.view, contents["joint"], shot.signal],
            )
            if shot.signal is not None and shot.signal not in signals:
                names, near = "; ".join(map(repr, signals)), closest(shot.signal, signals)
                raise JointplayError(f"no signal {shot.signal!r} to draw; {near}available: {names}")

            def take(time: float, span: float, caption: str) -> bytes:
                code = "([t, span, text]) => window.jointplay.frame(t, span, text)"
                tab.evaluate(code, [time, span, caption])
                taken: bytes = tab.screenshot()
                return taken

            yield take
        except Error as error:
            reason = str(error).strip().splitlines()[0]
            raise JointplayError(f"the browser that records the film failed: {reason}") from None
        finally:
            browser.close()


def launched(tools: Any, failure: type[Exception]) -> Any:
    """A headless browser: the one that `CHROMIUM` names, playwright's own, or this machine's.

    It runs in its sandbox where the system allows that, and else without: the page's policy lets no
    script run but the player's.
    """
    bundled = Path(tools.chromium.executable_path)
    wanted = os.environ.get(CHROMIUM)
    browser = wanted or next((shutil.which(n) for n in _BROWSERS if shutil.which(n)), None)
    if wanted is None and bundled.is_file():
        browser = str(bundled)
    if browser is None or (wanted is not None and not files.is_file(Path(wanted))):
        raise JointplayError(
            f"{CHROMIUM} names no file: {wanted!r}"
            if wanted
            else "films need Chromium, which was not found; install it with: playwright install "
            f"chromium, or set {CHROMIUM} to its path"
        )
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    problem = ""
    for sandbox in (True, False):
        if sandbox and root:  # Chromium refuses to run its sandbox as root
            continue
        try:
            return tools.chromium.launch(
                executable_path=browser, args=list(_DRAWING), chromium_sandbox=sandbox
            )
        except failure as error:
            problem = next((line for line in str(error).splitlines() if line.strip()), "")
    raise JointplayError(f"the browser {browser} does not start: {problem}")


def _encoded(frames: Iterator[bytes], folder: Path, suffix: str, shot: Shot) -> bytes:
    """A film of frames (PNG) as the bytes of a file with this suffix."""
    import imageio.v2 as imageio

    target = folder / f"film{suffix}"
    pictures = (imageio.imread(io.BytesIO(frame))[..., :3] for frame in frames)
    if suffix == ".gif":
        writer: Any
        duration = 1000.0 / shot.frames_per_second
        with imageio.get_writer(target, duration=duration, loop=0) as writer:
            for picture in pictures:
                writer.append_data(picture)
    else:
        import imageio_ffmpeg

        output = {
            ".webm": ["-row-mt", "1"],
            ".webp": ["-quality", "60", "-compression_level", "5", "-loop", "0"],
        }
        # A pixel format and even sizes that every player accepts.
        encoder = imageio_ffmpeg.write_frames(
            str(target),
            shot.size,
            fps=shot.frames_per_second,
            codec=_CODECS[suffix],
            quality=None if suffix == ".webp" else 8,
            macro_block_size=2,
            pix_fmt_out="yuv420p",
            output_params=output.get(suffix, []),
        )
        with closing(encoder):
            encoder.send(None)
            for picture in pictures:
                encoder.send(np.ascontiguousarray(picture))
    return target.read_bytes()
