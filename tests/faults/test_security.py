"""Files of strangers: what a result, a page or a request can and cannot make this machine do."""

import http.client
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import threading
import time
from html.parser import HTMLParser
from pathlib import Path
from xml.sax.saxutils import escape

import h5py
import numpy as np
import pytest
from browsing import UNFOLD, until
from conftest import body, joint
from warm import JOINTPLAY, PYTHON

import jointplay as jp
from jointplay import JointplayError
from jointplay.base.modules import imported
from jointplay.model import viewer
from jointplay.model.visuals import find_mesh, mesh_folders
from jointplay.physics.contact import CustomNormalForce, NormalForceLaw
from jointplay.show import player, reports
from jointplay.show.player.server import Server
from jointplay.simulation.result import netcdf

QUOTE = {'"': "&quot;"}
EVIL = """</script></title><script>owned=1</script>'"><img src=x onerror="owned=1">"""


def hostile(text):
    """A name that would run as a script wherever it is not escaped."""
    return f"{text}{EVIL}"


def hostile_result(folder, contacts=True):
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
        radial_clearance=1e-4, axial_clearance=1e-4, bearing_material=jp.Material(name=EVIL)
    )
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="base"/>{text}</robot>')
    robot = jp.Mechanism(path, {names["pin"]: bearing})
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


def inert(page, scripts):
    """Whether a page has no elements but its own: its picture, no handler, no further script."""
    found = Elements(page).found
    assert not [tag for tag, _ in found if tag in ("iframe", "object", "embed", "base")]
    pictures = [attrs for tag, attrs in found if tag == "img"]
    assert all({"alt", "src"} <= set(attrs) <= {"alt", "src", "class"} for attrs in pictures)
    assert all(attrs["src"].startswith("data:image/") for attrs in pictures)  # runs no scripts
    assert len(pictures) <= 1
    assert not [a for _, attrs in found for a in attrs if a.startswith("on")]
    assert len([tag for tag, _ in found if tag == "script"]) == scripts
    assert "<script>owned" not in page


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A report and a playback of a hostile result, read from a file."""
    folder = tmp_path_factory.mktemp("pages")
    path = hostile_result(folder).save(folder / "evil.nc")
    reports.report({EVIL: jp.Result.load(path)}, folder / "report.html", pdf=False, impacts=1)
    played = hostile_result(folder, contacts=False).save(folder / "evil2.nc")
    player.save_html({EVIL: jp.Result.load(played)}, folder / "play.html")
    return [folder / "report.html", folder / "play.html"]


def test_names_of_a_result_are_text_in_every_page(pages):
    for page, scripts in zip(pages, (3, 4), strict=True):
        text = page.read_text(encoding="utf-8")
        inert(text, scripts)
        assert "owned=1" in text  # they are there, as text


def test_pages_run_only_scripts_whose_hash_they_name(pages):
    for page, run in zip(pages, (1, 2), strict=True):
        text = page.read_text(encoding="utf-8")
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
        scripts = re.search(r"script-src ([^;]*);", policy)[1]
        assert len(re.findall(r"'sha256-[\w+/=]{44}'", scripts)) == len(scripts.split()) == run
        assert "default-src 'none'" in policy


def test_no_script_of_a_result_runs_in_a_browser(pages, open_page):
    """Names are escaped, not merely blocked: of what is blocked the page would tell."""
    for page, ready in zip(
        pages, ("window.jointplayReport.whole", "document.body.className"), strict=True
    ):
        tab = open_page(page.as_uri())
        until(tab, ready)
        tab.evaluate(UNFOLD)
        for chart in tab.query_selector_all(".chart"):
            chart.scroll_into_view_if_needed()
        assert tab.evaluate("window.owned") is None


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
        "from jointplay.paper import scara\n"
        "made = scara(2e-4)\n"
        "joint = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4,\n"
        "    normal=jp.contact.CustomNormalForce(strange_laws.push, (1e8,)))\n"
        "robot = made.mechanism.with_clearance({'joint_b': joint})\n"
        "jp.simulate(robot, made.motion, duration=1e-3).save('r.nc')\n"
        "pathlib.Path('ran').unlink()\n"
    )
    subprocess.run([PYTHON, "-c", code], cwd=tmp_path, check=True)
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        ["play", "--html", "o.html"],
        pytest.param(["report", "-o", "o.html", "--no-pdf"], marks=pytest.mark.thorough),
    ],
)
def test_a_result_imports_nothing_that_was_not_named(command, lawful):
    call = [JOINTPLAY, command[0], "r.nc", *command[1:], "--quiet"]
    done = subprocess.run(call, cwd=lawful, capture_output=True, text=True, check=False)
    assert not (lawful / "ran").exists()
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr  # the stored run is enough
    (lawful / "o.html").unlink(missing_ok=True)
    (lawful / "o.pdf").unlink(missing_ok=True)
    call += ["--import", "strange_laws"]
    done = subprocess.run(call, cwd=lawful, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (lawful / "ran").exists()


@pytest.mark.thorough
def test_in_python_too_a_result_imports_nothing_unasked(lawful, monkeypatch):
    monkeypatch.chdir(lawful)
    monkeypatch.syspath_prepend(str(lawful))
    loaded = jp.Result.load("r.nc")
    law = loaded.simulation.mechanism.clearance["joint_b"].normal
    assert law.source == "def push(delta, ddelta, ddelta0, p):\n    return p[0] * delta\n"
    with pytest.raises(JointplayError, match=r"strange_laws:push.*import_module\('strange_laws'\)"):
        loaded.simulation.run()
    assert "strange_laws" not in sys.modules
    jp.import_module("strange_laws")
    assert jp.Result.load("r.nc").simulation.run()
    imported.pop("strange_laws")
    sys.modules.pop("strange_laws")


def mine(delta, ddelta, ddelta0, p):
    return p[0] * delta


def test_a_law_defined_in_this_process_needs_no_import():
    law = CustomNormalForce(mine, (1e8,))
    assert NormalForceLaw.from_description(law.describe()).function is mine


@pytest.mark.parametrize("path", ["..:x", "os", ":", "os:", ":x", "os:path.join:x", "a b:c", ""])
def test_a_law_of_no_name_is_refused(path):
    with pytest.raises(JointplayError, match="module:function"):
        NormalForceLaw.from_description({"law": "custom", "function": path})


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


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A result, and a file here that is none of its business."""
    from jointplay.paper import scara

    folder = tmp_path_factory.mktemp("plain")
    made = scara(2e-4)
    jp.simulate(made.mechanism, made.motion, duration=2e-3).save(folder / "r.nc")
    np.arange(4096.0).tofile(folder / "secret")
    return folder


NAME = "tool_position"


def resealed(plain, path, how):
    """The result after an edit by a stranger, who seals it as we do."""
    shutil.copy(plain / "r.nc", path)
    with h5py.File(path, "r+") as file:
        shape = file[NAME].shape
        if not how.startswith("more"):
            file.move(NAME, "kept")
        STRANGE[how][0](file, str(plain / "secret"), shape)
        if not how.startswith("more"):
            del file["kept"]
    path.write_bytes(netcdf.seal(path.read_bytes()))
    return path


def virtual(file, secret, shape):
    layout = h5py.VirtualLayout(shape, "f8")
    layout[:] = h5py.VirtualSource(secret, "x", shape)
    file.create_virtual_dataset(NAME, layout)


def filtered(file, secret, shape):
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk(shape)
    made.set_filter(32768, h5py.h5z.FLAG_OPTIONAL)
    made.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space = h5py.h5s.create_simple(shape)
    h5py.h5d.create(file.id, NAME.encode(), h5py.h5t.NATIVE_DOUBLE, space, made)


def external(file, secret, shape):
    kept = [(secret, 0, h5py.h5f.UNLIMITED)]
    file.create_dataset(NAME, shape, "f8", external=kept)


def refers(file, secret, shape):
    file.attrs["to"] = file[NAME].regionref[:1]


PAIR = np.dtype([("a", "f8"), ("b", "i4")])
STRANGE = {
    "external": (external, f"'{NAME}' is stored in another file"),
    "virtual": (virtual, f"'{NAME}' is a virtual dataset"),
    "linked": (
        lambda f, secret, _: f.__setitem__(NAME, h5py.ExternalLink(secret, "/x")),
        f"'{NAME}' is an external link",
    ),
    "linked softly": (
        lambda f, *_: f.__setitem__(NAME, h5py.SoftLink("/time")), f"'{NAME}' is a soft link"
    ),
    "filtered": (
        filtered, f"'{NAME}' has the filter 32768; known are deflate, shuffle, fletcher32"
    ),
    "immense": (
        lambda f, *_: f.create_dataset(NAME, (10**12, 3), "f8", chunks=(10**6, 3)),
        f"'{NAME}' claims 2.4e[+]13 bytes, which the file does not hold",
    ),
    "more: a group": (lambda f, *_: f.create_group("more"), "'more' is not a dataset"),
    "more: a reference": (refers, "the attribute 'to' of '/' holds neither numbers nor text"),
    "more: bytes": (
        lambda f, *_: f[NAME].attrs.__setitem__("raw", np.void(b"1234")),
        f"the attribute 'raw' of '{NAME}' holds neither numbers nor text",
    ),
    "more: a type": (lambda f, *_: f.__setitem__("kind", PAIR), "'kind' is not a dataset"),
    "more: pairs": (
        lambda f, *_: f.__setitem__("pairs", np.zeros(3, PAIR)),
        "'pairs' holds neither numbers nor text",
    ),
}  # fmt: skip


@pytest.mark.parametrize("edit", STRANGE)
@pytest.mark.parametrize("read", [jp.Result.load, jp.Result.open], ids=["load", "open"])
def test_what_a_sealed_file_takes_from_elsewhere_is_refused_by_name(edit, read, plain, tmp_path):
    path = resealed(plain, tmp_path / "r.nc", edit)
    with pytest.raises(JointplayError, match=STRANGE[edit][1]) as error:
        read(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("edit", ["external", "virtual", "linked"])
def test_a_pipe_as_target_makes_no_one_wait(edit, plain, tmp_path):
    """Whoever opens it for reading waits for a writer."""
    (tmp_path / "place").mkdir()
    shutil.copy(plain / "r.nc", tmp_path / "place" / "r.nc")
    os.mkfifo(tmp_path / "place" / "secret")
    path = resealed(tmp_path / "place", tmp_path / "r.nc", edit)
    with pytest.raises(JointplayError, match=STRANGE[edit][1]):
        jp.Result.load(path)


@pytest.mark.parametrize("read", [jp.Result.load, jp.Result.open, jp.Simulation.resume])
def test_what_is_no_file_is_refused_by_its_kind_before_it_is_opened(read, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    kinds = {
        tmp_path / "pipe": "it is a pipe",
        tmp_path: "it is a folder",
        Path("/dev/zero"): "it is a device",
        tmp_path / "dangling": "no (result file|checkpoint) '.*dangling'$",
    }
    for path, words in kinds.items():
        with pytest.raises(JointplayError, match=words):
            read(path)


def test_no_markup_is_made_of_text_that_was_put_together():
    """`Html` and `Markup` escape nothing; what is given to them must be constant."""
    for path in (Path(jp.__file__).parent).rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\b(Html|Markup)\(\s*f[\"']", text), path
        assert not re.search(r"\|\s*safe\b", text), path
    for path in (Path(jp.__file__).parent).rglob("*.html"):
        assert not re.search(r"\|\s*safe\b", path.read_text(encoding="utf-8")), path


SHOWING = """
import time
import jointplay as jp
from jointplay.model.robots import shipped
if __name__ == "__main__":
    viewer = jp.Mechanism(shipped("scara.urdf")).visualizer().viewer
    print(viewer.window.server_proc.pid, viewer.url(), viewer.window.zmq_url, flush=True)
    time.sleep(1e6)
"""


@pytest.fixture
def visualizer(tmp_path):
    """A process that shows a mechanism; its server's process, port and folder."""
    script = tmp_path / "show.py"
    script.write_text(SHOWING)
    shown = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    for line in shown.stdout:
        if line[0].isdigit():
            break
    server, url, scene = line.split()
    yield shown, int(server), int(url.rpartition(":")[2].partition("/")[0]), Path(scene[6:]).parent
    shown.kill()
    shown.wait()
    shown.stdout.close()


def listening(process):
    """Addresses and ports at which a process listens, as Linux writes them."""
    folder = Path(f"/proc/{process}/fd")
    inodes = {os.readlink(one).removeprefix("socket:[").rstrip("]") for one in folder.iterdir()}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{process}/net/{table}").read_text().splitlines()[1:]:
            parts = line.split()
            if parts[3] == "0A" and parts[9] in inodes:
                found.add(parts[1])
    return found


def answer(port, path="/", **headers):
    """Status of what a server answers to a request with these headers and no others."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    status = connection.getresponse().status
    connection.close()
    return status


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec_WebSocket_Version": "13",
    "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


def test_the_visualizer_is_for_its_own_page_on_this_machine(visualizer):
    _, server, port, folder = visualizer
    if Path("/proc/net/tcp").exists():
        assert listening(server) == {f"0100007F:{port:04X}"}  # 127.0.0.1, and nothing else
    assert folder.stat().st_mode & 0o077 == 0
    own, evil = f"127.0.0.1:{port}", f"evil.example:{port}"
    assert answer(port, "/static/", Host=own) == 200
    assert answer(port, "/static/", Host=f"localhost:{port}") == 200
    assert answer(port, "/static/", Host=evil) == 421
    assert answer(port, "/static/") in (400, 421)
    assert answer(port, Host=own, Origin=f"http://{own}", **UPGRADE) == 101
    assert answer(port, Host=own, **UPGRADE) == 403
    for origin in (f"http://{evil}", "http://127.0.0.1:1", f"https://{own}", "null", ""):
        assert answer(port, Host=own, Origin=origin, **UPGRADE) == 403, origin
    # A stranger's name that leads here: origin and host agree.
    assert answer(port, Host=evil, Origin=f"http://{evil}", **UPGRADE) == 421


@pytest.mark.thorough
def test_the_visualizer_ends_with_a_parent_that_is_killed(visualizer):
    shown, server, _, folder = visualizer
    shown.kill()
    shown.wait()
    deadline = time.monotonic() + 300.0  # for broken code, not for slow machines
    while folder.exists() or alive(server):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def alive(process):
    """Whether a process runs; what nobody has waited for yet does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat")
    return not (state.exists() and state.read_text().rpartition(")")[2].split()[0] == "Z")


def test_the_visualizer_says_why_it_does_not_start(monkeypatch, tmp_path):
    pytest.importorskip("meshcat")  # here it is whole
    (tmp_path / "tornado.py").write_text("raise ImportError('no tornado here')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(JointplayError, match="server did not start: ImportError: no tornado here"):
        viewer.visualizer()


OWN = """
import {helper}

def force(delta, ddelta, ddelta0, p):
    return {helper}.STIFFNESS * delta * p[0]


def peak(result):
    return {helper}.STIFFNESS
"""

OWN_SCENARIO = """
[robot]
urdf = "jointplay:scara.urdf"
gravity = "loaded"
[motion]
file = "jointplay:scara_motion.csv"
[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"
normal = { law = "custom", function = "namesake:force", parameters = [1.0] }
[integration]
duration = "1 ms"
[sweep]
measures = ["namesake:peak"]
tool_error = false
[sweep.axes]
seed = { key = "integration.seed", values = [1, 2] }
"""


def test_a_module_of_the_same_name_or_written_anew_is_read_anew(tmp_path):
    """With its helpers; runs and measures of other processes have it, too."""
    path, made = tmp_path / "s.toml", []
    path.write_text(OWN_SCENARIO)
    for number, stiffness in enumerate((1e6, 1e8)):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "namesake.py").write_text(OWN.format(helper="its_helper"))
        for factor in (2.0, 1.0):
            (folder / "its_helper.py").write_text(f"STIFFNESS = {factor} * {stiffness}\n")
            jp.import_module(folder / "namesake.py")
            made.append(jp.Scenario.load(path).simulation())
            law = made[-1].mechanism.clearance["joint_b"].normal
            assert law.function(1.0, 0.0, 0.0, (1.0,)) == factor * stiffness
            assert pickle.loads(pickle.dumps(law)) == law
        found = jp.sweep(path, tmp_path / f"s{number}", jobs=2).dataset()
        assert found["peak"].values.tolist() == [stiffness] * 2
    with pytest.raises(JointplayError, match="cannot be sent to another process"):
        pickle.dumps(made[0].mechanism.clearance["joint_b"].normal)
