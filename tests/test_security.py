"""Files of strangers: what a result, a page or a request can and cannot make this machine do."""

import http.client
import json
import re
import shutil
import subprocess
import sys
import threading
from html.parser import HTMLParser
from pathlib import Path
from xml.sax.saxutils import escape

import pytest
from conftest import body, joint

import jointplay as jp
from jointplay import JointplayError, playback, report
from jointplay.contact import CustomNormalForce
from jointplay.contact.trust import trusting
from jointplay.mechanism.visuals import find_mesh, mesh_folders
from jointplay.playback.server import Server

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
COMMAND = Path(sys.executable).parent / "jointplay"

QUOTE = {'"': "&quot;"}
EVIL = """</script></title><script>owned=1</script>'"><img src=x onerror="owned=1">"""


def hostile(text):
    """A name that would run as a script wherever it is not escaped."""
    return f"{text}{EVIL}"


def hostile_result(urdf, contacts=True):
    """A run of which every name, and every text that a file can hold, is hostile."""
    names = {name: hostile(name) for name in ("arm", "pin", "hand", "wrist")}
    elements = [
        body("arm"),
        joint("pin", "base", "arm"),
        body("hand", com="0.1 0 0"),
        joint("wrist", "arm", "hand", at="0.2 0 0"),
    ]
    text = "".join(elements)
    for name, evil in names.items():
        text = text.replace(f'"{name}"', f'"{escape(evil, QUOTE)}"')
    bearing = jp.RevoluteClearance(
        radial_clearance=1e-4,
        axial_clearance=1e-4,
        bearing_material=jp.Material(name=EVIL),
    )
    robot = jp.Mechanism(urdf(text), {names["pin"]: bearing})
    result = jp.simulate(robot, duration=0.02, drive=jp.loads.Free(), joint_friction={})
    dataset = result.dataset
    if contacts:
        old = [str(name) for name in dataset["contact"].values]
        dataset = dataset.assign_coords(contact=[hostile(name) for name in old])
    audit = json.loads(dataset.attrs["audit"]) | {"law_warnings": [EVIL]}
    dataset.attrs |= {
        "message": EVIL,
        "audit": json.dumps(audit),
        "versions": json.dumps({EVIL: EVIL}),
        "scenario": EVIL,
        "title": EVIL,
        "case": EVIL,
        EVIL: EVIL,
    }
    for variable in dataset.variables.values():
        variable.attrs |= {"long_name": EVIL, "units": EVIL}
    return jp.Result(dataset)


class Elements(HTMLParser):
    """Elements and their attributes, as a browser would find them."""

    def __init__(self, page):
        super().__init__()
        self.found = []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


def inert(page):
    """Whether a page has no elements but its own: no picture, no handler, no further script."""
    found = Elements(page).found
    assert not [tag for tag, _ in found if tag in ("img", "iframe", "object", "embed", "base")]
    assert not [a for _, attrs in found for a in attrs if a.startswith("on")]
    assert len([tag for tag, _ in found if tag == "script"]) == 4
    assert "<script>owned" not in page


@pytest.fixture
def pages(urdf, tmp_path):
    """A report and a playback of a hostile result, read from a file."""
    path = hostile_result(urdf).save(tmp_path / "evil.nc")
    report.write(
        {EVIL: jp.Result.load(path)}, tmp_path / "report.html", title=EVIL, pdf=False, impacts=1
    )
    played = hostile_result(urdf, contacts=False).save(tmp_path / "evil2.nc")
    playback.save_html({EVIL: jp.Result.load(played)}, tmp_path / "play.html")
    return [tmp_path / "report.html", tmp_path / "play.html"]


def test_names_of_a_result_are_text_in_every_page(pages):
    for page in pages:
        text = page.read_text(encoding="utf-8")
        inert(text)
        assert "owned=1" in text  # they are there, as text


def test_pages_run_only_scripts_whose_hash_they_name(pages):
    for page in pages:
        text = page.read_text(encoding="utf-8")
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
        scripts = re.search(r"script-src ([^;]*);", policy)[1]
        assert re.fullmatch(r"('sha256-[\w+/=]{44}' ?){2}", scripts)
        assert "default-src 'none'" in policy


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_no_script_of_a_result_runs_in_a_browser(pages):
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync.sync_playwright() as tools:
        flags = ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-gl=angle"]
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=flags)
        for page, ready in zip(
            pages, ("window.jointplayReport.ready", "document.body.className"), strict=True
        ):
            said = []
            tab = browser.new_page()
            tab.on("console", lambda message, said=said: said.append(message.text))
            tab.goto(page.as_uri())
            while not tab.evaluate(ready):
                tab.wait_for_timeout(50)
            for chart in tab.query_selector_all(".chart"):
                chart.scroll_into_view_if_needed()
            assert tab.evaluate("window.owned") is None
            # Escaped, not merely blocked.
            assert not [text for text in said if "Content Security Policy" in text]
        browser.close()


LAW = """
from pathlib import Path
Path("ran").touch()
def push(delta, ddelta, ddelta0, p):
    return p[0] * delta
"""


@pytest.fixture
def lawful(tmp_path):
    """A result whose law is in a module that tells when it is imported, beside the file."""
    (tmp_path / "strange_laws.py").write_text(LAW)
    code = (
        "import jointplay as jp, strange_laws, pathlib\n"
        "from jointplay.study import scara\n"
        "made = scara(2e-4)\n"
        "joint = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4,\n"
        "    normal=jp.contact.CustomNormalForce(strange_laws.push, (1e8,)))\n"
        "robot = made.mechanism.with_clearance({'joint_b': joint})\n"
        "jp.simulate(robot, made.motion, duration=1e-3).save('r.nc')\n"
        "pathlib.Path('ran').unlink()\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    return tmp_path


@pytest.mark.parametrize("command", [["play", "--html", "o.html"], ["report", "-o", "o.html"]])
def test_a_result_imports_nothing_that_was_not_named(command, lawful):
    call = [str(COMMAND), command[0], "r.nc", *command[1:], "--quiet"]
    done = subprocess.run(call, cwd=lawful, capture_output=True, text=True, check=False)
    assert not (lawful / "ran").exists()
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr  # the stored run is enough
    (lawful / "o.html").unlink(missing_ok=True)
    (lawful / "o.pdf").unlink(missing_ok=True)
    call += ["--trust", "strange_laws"]
    done = subprocess.run(call, cwd=lawful, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (lawful / "ran").exists()


def test_in_python_too_a_result_imports_nothing_unasked(lawful, monkeypatch):
    monkeypatch.chdir(lawful)
    monkeypatch.syspath_prepend(str(lawful))
    loaded = jp.Result.load("r.nc")
    law = loaded.simulation.mechanism.clearance["joint_b"].normal
    assert law.source == "def push(delta, ddelta, ddelta0, p):\n    return p[0] * delta\n"
    with pytest.raises(JointplayError, match=r"strange_laws:push.*trust=\['strange_laws'\]"):
        loaded.simulation.run()
    assert "strange_laws" not in sys.modules
    assert jp.Result.load("r.nc", trust=["strange_laws"]).simulation.step == 1e-5
    sys.modules.pop("strange_laws")


SCRIPT = """
import jointplay as jp
from jointplay.study import scara

def push(delta, ddelta, ddelta0, stiffness):
    return stiffness * delta

made = scara(2e-4)
joint = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4,
    normal=jp.contact.CustomNormalForce(push, {"stiffness": 1e8}))
robot = made.mechanism.with_clearance({"joint_b": joint})
result = jp.simulate(robot, made.motion, duration=1e-3)
result.save("r.nc")
assert (result.simulation.run()["q"].values == result["q"].values).all()
"""


def test_a_law_typed_in_a_script_is_saved_shown_and_not_run(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    subprocess.run([sys.executable, "script.py"], cwd=tmp_path, check=True)
    loaded = jp.Result.load(tmp_path / "r.nc")
    law = loaded.simulation.mechanism.clearance["joint_b"].normal
    assert law.source in SCRIPT
    assert repr(law) == "CustomNormalForce(push, (100000000.0,))"
    with pytest.raises(JointplayError, match=r"__main__:push.*define it here and make a law"):
        loaded.simulation.run()
    for command in ("play", "--html"), ("report", "-o"):
        call = [str(COMMAND), command[0], "r.nc", command[1], "o.html", "--quiet"]
        subprocess.run(call, cwd=tmp_path, check=True)
        page = (tmp_path / "o.html").read_text(encoding="utf-8")
        assert ("return stiffness * delta" in page) == (command[0] == "report")
        (tmp_path / "o.html").unlink()


def mine(delta, ddelta, ddelta0, p):
    return p[0] * delta


def test_a_law_defined_in_this_process_needs_no_trust():
    law = CustomNormalForce(mine, (1e8,))
    from jointplay.contact import normal_law

    assert normal_law(law.describe()).function is mine


@pytest.mark.parametrize("path", ["..:x", "os", ":", "os:", ":x", "os:path.join:x", "a b:c", ""])
def test_a_law_of_no_name_is_refused(path):
    from jointplay.contact import normal_law

    with trusting(["os"]), pytest.raises(JointplayError, match="module:function"):
        normal_law({"law": "custom", "function": path})


def test_a_scenario_takes_laws_beside_it_and_others_by_trust(tmp_path, monkeypatch):
    text = (Path(jp.__file__).parent / "scenario" / "template.toml").read_text(encoding="utf-8")
    law = 'normal = { law = "custom", function = "own_laws:push", parameters = [1e8] }'
    text = text.replace('normal = "lankarani-nikravesh"', law)
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "s.toml").write_text(text, encoding="utf-8")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "own_laws.py").write_text(LAW)
    monkeypatch.chdir(tmp_path / "b")
    scenario = tmp_path / "a" / "s.toml"
    with pytest.raises(JointplayError, match="trust its module: --trust own_laws"):
        jp.Scenario.load(scenario).simulation("0.2 mm")
    assert jp.Scenario.load(scenario, trust=["own_laws"]).simulation("0.2 mm")
    sys.modules.pop("own_laws")


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:{port}", 200),
        ("localhost:{port}", 200),
        ("[::1]:{port}", 200),
        ("LOCALHOST", 200),
        ("evil.example:{port}", 421),
        ("127.0.0.1.evil.example", 421),
        ("", 421),
    ],
)
def test_the_server_answers_only_to_its_own_names(host, status):
    with Server(b"page", port=0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        call = http.client.HTTPConnection("127.0.0.1", server.port)
        call.putrequest("GET", "/", skip_host=True)
        call.putheader("Host", host.format(port=server.port))
        call.endheaders()
        assert call.getresponse().status == status
        server.shutdown()


def test_a_result_chooses_no_mesh_outside_the_folders_named(tmp_path, urdf, monkeypatch):
    secret = tmp_path / "secret.stl"
    secret.write_bytes(b"solid\nendsolid\n")
    named = tmp_path / "named"
    named.mkdir()
    (named / "arm.stl").write_bytes(b"solid\nendsolid\n")
    (named / "link.stl").symlink_to(secret)
    monkeypatch.chdir(tmp_path)
    robot = jp.Mechanism(urdf(body("arm"), joint("pin", "base", "arm")))
    described = robot.describe() | {"urdf": str(tmp_path / "r.urdf")}
    stored = jp.Mechanism.from_description(described)
    folders = mesh_folders(stored, [named])
    assert tmp_path not in folders
    assert find_mesh("arm.stl", folders, anywhere=False) == named / "arm.stl"
    for name in (str(secret), f"file://{secret}", "../secret.stl", "package://../secret.stl",
                 "link.stl", "secret.stl", "a\0b.stl", "x" * 5000):  # fmt: skip
        assert find_mesh(name, folders, anywhere=False) is None, name
    # A URDF that the user names may take what it likes.
    assert find_mesh("secret.stl", mesh_folders(robot)) == secret


def test_no_markup_is_made_of_text_that_was_put_together():
    """`Html` and `Markup` escape nothing; what is given to them must be constant."""
    for path in (Path(jp.__file__).parent).rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\b(Html|Markup)\(\s*f[\"']", text), path
        assert not re.search(r"\|\s*safe\b", text), path
    for path in (Path(jp.__file__).parent).rglob("*.html"):
        assert not re.search(r"\|\s*safe\b", path.read_text(encoding="utf-8")), path
