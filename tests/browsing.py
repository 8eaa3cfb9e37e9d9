"""Pages in a real browser."""

import shutil
import time
from contextlib import ExitStack, contextmanager
from io import BytesIO

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
GL = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
PATIENCE_S = 300.0
"""A deadline for what never comes, not a measure of speed."""
DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
UNFOLD = "() => document.querySelectorAll('details').forEach(one => { one.open = true; })"


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium is installed")
    from playwright import sync_api

    with sync_api.sync_playwright() as tools:
        chromium = tools.chromium.launch(executable_path=CHROMIUM, args=list(GL))
        yield chromium
        chromium.close()


@contextmanager
def opened(browser, address, size=(1280, 800), **options):
    """A page; whatever goes wrong in it, and whatever it asks of others, fails the test."""
    view = dict(zip(("width", "height"), size, strict=True))
    context = browser.new_context(viewport=view, **options)
    tab = context.new_page()
    tab.set_default_timeout(1e3 * PATIENCE_S)
    tab.troubles, requests = [], set()

    def told(message):
        if message.type in ("error", "warning") and "GPU stall" not in message.text:
            tab.troubles.append(message.text)

    tab.on("console", told)
    tab.on("pageerror", lambda error: tab.troubles.append(f"{error} {error.stack}"))
    tab.on("request", lambda request: requests.add(request.url.split("#")[0]))
    tab.goto(address)
    until(tab, "() => !document.querySelector('#player') || document.querySelector('body.ready')")
    yield tab
    assert tab.troubles == []
    own = address.partition("#")[0]
    assert all(url.startswith((own, "data:", "blob:")) for url in requests)
    context.close()


@pytest.fixture
def open_page(browser):
    with ExitStack() as pages:
        yield lambda *given, **options: pages.enter_context(opened(browser, *given, **options))


def until(tab, script):
    """Wait; playwright's own waiting would evaluate text, which the pages forbid."""
    end = time.monotonic() + PATIENCE_S
    while not tab.evaluate(script):
        assert time.monotonic() < end, script
        tab.wait_for_timeout(50)


def picture(tab):
    """The page once a frame has been drawn, and two pictures of it are the same."""
    from matplotlib.image import imread

    tab.evaluate(DRAWN)
    before, shot = b"", tab.screenshot()
    end = time.monotonic() + PATIENCE_S
    while shot != before:
        assert time.monotonic() < end
        tab.wait_for_timeout(50)
        before, shot = shot, tab.screenshot()
    return imread(BytesIO(shot))[..., :3]
