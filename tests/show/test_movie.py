"""Pictures and films: what was written, judged by reading it back."""

import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from warm import JOINTPLAY

import jointplay as jp
from jointplay.paper import scara
from jointplay.show import player
from jointplay.show.player import movie, save_movie
from jointplay.show.player.movie import SUFFIXES, Shot, pace, speed_for

pytestmark = pytest.mark.thorough

SMALL = {"size": (320, 240), "frames_per_second": 10.0}


@pytest.fixture(scope="module")
def run():
    made = scara(0.2e-3)
    return jp.simulate(made.mechanism, made.motion, duration=0.3)


@pytest.fixture(scope="module")
def filmable():
    """Whether a film can be made here."""
    from playwright.sync_api import Error, sync_playwright

    with sync_playwright() as tools:
        try:
            movie.launched(tools, Error).close()
        except jp.JointplayError as error:
            pytest.skip(str(error))


def frames_of(path):
    import imageio.v3 as imageio

    if path.suffix == ".png":
        return imageio.imread(path)
    if path.suffix == ".webp":
        return np.asarray(list(imageio.imiter(path, plugin="pillow")))
    return imageio.imread(path, index=None)


@given(st.floats(1e-4, 1e3))
def test_films_have_an_ordinary_length(duration):
    length = duration / speed_for(duration)
    assert length >= 4.0 * (1 - 1e-9) or duration < 4e-5
    assert length <= 20.0 * (1 + 1e-9) or duration > 1000.0


def test_speeds_are_said_in_words():
    assert pace(1.0) == "real time"
    assert pace(0.01) == "1/100 of real time"
    assert pace(2.0) == "2 x real time"


def test_frames_lie_at_equal_times_from_begin_to_end():
    times, speed = Shot(speed=0.1, begin=0.1, end=0.2, frames_per_second=20.0).times(0.0, 1.0)
    assert speed == 0.1
    assert times[0] == 0.1
    assert times[-1] == pytest.approx(0.2)
    assert np.diff(times) == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"size": (321, 240)}, "321x240"),
        ({"frames_per_second": 0.1}, "0.1"),
        ({"speed": 0.0}, "greater than zero"),
        ({"begin": -1.0}, "-1"),
        ({"view": "side"}, "both, robot, closeup"),
        ({"begin": 2.0}, "from 2 s to 1 s"),
        ({"speed": 1e-5}, "frames; at most"),
    ],
)
def test_shots_that_make_no_sense_are_refused(fields, words):
    with pytest.raises(jp.JointplayError, match=words):
        Shot(**fields).times(0.0, 1.0)


def test_what_is_missing_is_said_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setattr(movie, "find_spec", lambda name: None)
    with pytest.raises(jp.JointplayError, match=r"pip install '\.\[movie\]'"):
        movie.check(tmp_path / "a.mp4")


def test_a_machine_without_a_browser_is_told_how_to_get_one(monkeypatch, tmp_path):
    class Tools:
        class chromium:
            executable_path = str(tmp_path / "none")

    monkeypatch.delenv(movie.CHROMIUM, raising=False)
    monkeypatch.setattr(movie.shutil, "which", lambda name: None)
    with pytest.raises(jp.JointplayError, match="playwright install chromium"):
        movie.launched(Tools, OSError)
    monkeypatch.setenv(movie.CHROMIUM, str(tmp_path / "gone"))
    with pytest.raises(jp.JointplayError, match="names no file"):
        movie.launched(Tools, OSError)


def test_a_picture_shows_the_hardest_impact(run, filmable, tmp_path):
    image, other = (
        frames_of(save_movie({"a": run}, tmp_path / f"{begin}.png", shot, ghosts=False).path)
        for begin in (None, 0.0)
        for shot in [Shot(size=(640, 400), begin=begin)]
    )
    assert image.shape[:2] == (400, 640)
    assert image[..., :3].std() > 10
    assert (other != image).mean() > 0.005


@pytest.mark.parametrize("suffix", [kind for kind in SUFFIXES if kind != ".png"])
def test_films_move_and_last_as_they_say(suffix, run, filmable, tmp_path):
    shot = Shot(speed=0.3, **SMALL)
    made = save_movie({"0.2 mm": run}, tmp_path / f"a{suffix}", shot, ghosts=False)
    assert made.frames == 11
    images = frames_of(made.path)
    assert images.shape[:3] == (11, 240, 320)
    assert np.abs(np.diff(images[..., :3].astype(int), axis=0)).max(axis=(1, 2, 3)).min() > 20
    assert images[..., :3].std() > 10
    if suffix in (".mp4", ".webm"):
        import imageio.v3 as imageio

        about = imageio.immeta(made.path, plugin="FFMPEG")
        assert about["duration"] == pytest.approx(1.1, abs=0.11)
        assert about["fps"] == pytest.approx(10.0)


def test_a_signal_is_drawn_below_the_picture_with_its_value(run, filmable, tmp_path):
    share = {}
    for signal in (None, "tool error"):
        shot = Shot(signal=signal, size=(640, 400))
        image = frames_of(save_movie({"a": run}, tmp_path / f"{signal}.png", shot).path)[..., :3]
        assert image[:250].std() > 10  # the robot is there
        line = np.abs(image[-60:].astype(int) - (0, 114, 178)).sum(axis=-1) < 120
        share[signal] = line.any(axis=0).mean()  # in the first case's colour, from side to side
    assert share["tool error"] > 0.7
    assert share[None] <= 0.5


def test_an_unknown_signal_is_refused_with_those_there_are(run, filmable, tmp_path):
    with pytest.raises(
        jp.JointplayError, match=r"'tool eror'.*'contact force, joint_b'.*'tool error'"
    ):
        save_movie({"a": run}, tmp_path / "a.png", Shot(signal="tool eror", size=(320, 240)))
    assert not (tmp_path / "a.png").exists()


def test_views_differ(run, filmable, tmp_path):
    content, scene = player.page({"0.2 mm": run}, ghosts=False)
    images = []
    for view in ("robot", "closeup"):
        path = tmp_path / f"{view}.png"
        movie.film(content, scene.contents, path, Shot(size=(320, 240), view=view))
        images.append(frames_of(path)[..., :3])
    assert (images[0] != images[1]).mean() > 0.2


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--movie", "a.avi"], "one of .png, .gif, .mp4, .webm, .webp"),
        (["--movie", "there.mp4"], "exists"),
        (["--movie", "a.mp4", "--size", "big"], "WIDTHxHEIGHT"),
        (["--movie", "a.mp4", "--html", "a.html"], "not allowed with argument"),
        (["--fps", "10"], "--fps needs --movie"),
    ],
)
def test_wrong_options_are_named(arguments, text, tmp_path):
    (tmp_path / "a.nc").write_bytes(b"")
    (tmp_path / "there.mp4").write_bytes(b"")
    done = subprocess.run(
        [JOINTPLAY, "play", "a.nc", *arguments], cwd=tmp_path, capture_output=True, text=True,
        timeout=900,
    )  # fmt: skip
    assert done.returncode == 2
    assert text in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
