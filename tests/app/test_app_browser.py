"""``girdle app`` in a real browser, as a user operates it: upload, runs, broken files, cancel, the zip."""

import importlib.util
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from browsing import COARSE, DESK, PHONE, needs_browser
from command import shipped_lines, written
from laboratory import in_laboratory, simulated_trial, trc_lines, up_and_down
from playwright.sync_api import Page, expect

from scripts.picture_report import DRAWN, browser

has_nicegui = importlib.util.find_spec("nicegui") is not None  # only the server, a separate process, imports it
pytestmark = [needs_browser, pytest.mark.skipif(not has_nicegui, reason="nicegui, of the extra app, is not installed")]

ROOT = Path(__file__).parents[2]
PATIENCE_S = 120.0
"""Time after which the page counts as hanging: a diagnosis of two shoulders takes up to a minute on a busy machine."""

RECONNECT_S = 0.2

SOCKET = "/_nicegui_ws/socket.io/?EIO=4"
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}

START = (
    "from adapt.cli.local_page.server import free_port, serve; port = free_port(); print(port, flush=True); "
    f"serve(port, False, reconnect_s={RECONNECT_S})"
)


@pytest.fixture(scope="module")
def temporary(tmp_path_factory) -> Path:
    """Return the temporary folder of the page."""
    return tmp_path_factory.mktemp("temporary")


@pytest.fixture(scope="module")
def address(temporary) -> Iterator[str]:
    """Start the server and yield its address; at the end it must exit by itself on request and leave no files."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}  # nicegui reads it
    environment = {**inherited, "PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    with subprocess.Popen(
        [sys.executable, "-c", START], env=environment, cwd=temporary, stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdout is not None
        port = int(server.stdout.readline())
        wait_for_server(port, server)
        yield f"http://127.0.0.1:{port}"
        server.send_signal(signal.SIGTERM)
        server.wait(PATIENCE_S)
    assert list(temporary.iterdir()) == []


def wait_for_server(port: int, server: subprocess.Popen) -> None:
    """Wait until the server accepts connections."""
    for _ in range(int(PATIENCE_S * 10)):
        assert server.poll() is None, "the server has ended"
        with suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port), PATIENCE_S):
            return
        time.sleep(0.1)
    raise AssertionError(f"no server after {PATIENCE_S} s")


@pytest.fixture(scope="module")
def window(address) -> Iterator[Page]:
    """Open a page with reduced motion: an animated bar, drawn in software, costs as much time as the run itself."""
    with browser() as one:
        page = one.new_page(reduced_motion="reduce")
        page.add_init_script(COARSE)
        page.set_default_timeout(PATIENCE_S * 1000)
        expect.set_options(timeout=PATIENCE_S * 1000)
        yield page
    expect.set_options(timeout=5_000)


@pytest.fixture
def page(window, address) -> Page:
    """Load the page anew in a desktop window."""
    window.set_viewport_size(DESK)
    window.goto(address)
    window.locator("input[type=file]").wait_for(state="attached")
    return window


def sessions(temporary: Path) -> list[Path]:
    return sorted(temporary.glob("girdle-app-*/session-*"))


def give(page: Page, *files: Path) -> None:
    page.set_input_files("input[type=file]", list(files))


def test_from_files_to_a_report_and_a_zip(page, tmp_path):
    """A motion file and a trial whose AC has another name, which the user assigns on the page."""
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    trial = simulated_trial(up_and_down())
    lab = in_laboratory(trial.thorax_mm, np.eye(3), np.zeros(3))
    renamed = {"shoulder" if name == "AC" else name: xyz for name, xyz in lab.items() if name != "AA"}
    give(page, written(tmp_path, shipped_lines(1)), written(tmp_path, trc_lines(renamed), "P07_abduction.trc"))
    expect(page.get_by_text("P07_abduction.trc: there is no marker 'AC' for landmark AC")).to_be_visible()
    expect(page.get_by_text("14 postures of 1 subject", exact=True).first).to_be_visible()

    page.get_by_label("AC", exact=True).click()
    page.get_by_role("option", name="shoulder").click()
    expect(page.get_by_role("button", name="Adapt", exact=True)).to_be_disabled()
    page.get_by_role("button", name="Read again").click()
    expect(page.get_by_text("20 postures of 2 subjects", exact=True)).to_be_visible()
    expect(page.get_by_role("row", name="P07")).to_contain_text("20 to 120")
    expect(page.get_by_text("The axial rotation of the clavicle is an estimate")).to_be_visible()

    own_bones = page.get_by_role("checkbox", name="own bones")
    own_bones.click()
    expect(own_bones).to_be_checked()
    page.get_by_role("button", name="Adapt", exact=True).click()
    report = page.frame_locator("iframe.report")
    report.locator(DRAWN).wait_for()
    assert "2 subjects" in report.locator("main").inner_text()
    with page.expect_download() as download:
        page.get_by_role("button", name="Everything as a zip").click()
    with ZipFile(download.value.path()) as archive:
        names = archive.namelist()
        assert {"files.csv", "map.toml", "uploads/001.csv", "adapt/report.html", "adapt/models/R2_P07.toml"} <= {*names}
        header, *rows = archive.read("adapt/parameters.csv").decode().splitlines()
        assert "clavicle_length" in header
        assert any("P07" in row for row in rows)
    page.set_viewport_size(PHONE)
    width, inner = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert width <= inner
    assert [url for url in asked if not re.match(r"(https?://127\.0\.0\.1|data:|blob:)", url)] == []


def test_shoulders_are_diagnosed_and_a_broken_file_beside_them_is_removed(page, tmp_path):
    """Two simulated subjects, each in a file of its own."""
    header, *lines = shipped_lines(2)
    each = [lines[:14], lines[14:]]
    shoulders = [written(tmp_path, [header, *some], f"{k}.csv") for k, some in enumerate(each)]
    give(page, *shoulders, written(tmp_path, ["a,b", "1,2"], "broken.csv"))
    expect(page.get_by_text("broken.csv, line 1: the header has neither angles nor positions")).to_be_visible()
    remove = page.get_by_role("button", name="remove broken.csv")
    remove.click()
    expect(remove).to_be_hidden()  # the page then reads the files again and ignores clicks meanwhile
    expect(page.get_by_text(re.compile(f"postures of {len(shoulders)} subjects$"))).to_be_visible()
    page.get_by_role("button", name="Adapt and diagnose").click()
    report = page.frame_locator("iframe.report")
    verdict = report.get_by_role("heading", level=1)
    expect(verdict).to_contain_text(f"the gap of {len(shoulders)} shoulders on held-out motions")
    expect(verdict).not_to_contain_text("skin_artefact")
    expect(report.get_by_role("heading", name="What cannot be told apart")).to_be_visible()


def test_broken_files_are_named_and_the_page_lives_on(page, tmp_path):
    (tmp_path / "cut.c3d").write_bytes(b"\x02\x50" + b"\xff" * 3000)
    give(page, tmp_path / "cut.c3d", written(tmp_path, ["a,b", "1,2"]))
    expect(page.get_by_text("cut.c3d: the file ends before its data")).to_be_visible()
    expect(page.get_by_text("motion.csv, line 1: the header has neither angles nor positions")).to_be_visible()
    expect(page.get_by_role("button", name="Adapt", exact=True)).to_be_disabled()
    page.get_by_role("button", name="remove motion.csv").click()
    expect(page.locator(".file")).to_have_count(1)
    give(page, written(tmp_path, shipped_lines(1), "good.csv"))
    expect(page.get_by_role("button", name="Adapt", exact=True)).to_be_enabled()


def test_a_run_is_cancelled_and_a_closed_page_leaves_nothing(page, temporary, tmp_path):
    (folder,) = wait_for(page, lambda: sessions(temporary), 1)
    give(page, written(tmp_path, shipped_lines(2)))
    expect(page.get_by_text("28 postures of 2 subjects", exact=True).last).to_be_visible()
    page.get_by_role("button", name="Adapt and diagnose").click()
    expect(page.get_by_role("status").filter(has_text="Adaptation")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("Cancelled. Nothing was kept of this run.")).to_be_visible()
    expect(page.get_by_role("button", name="Adapt", exact=True)).to_be_enabled()
    assert not list(folder.glob("adapt*"))
    page.goto("about:blank")
    wait_for(page, lambda: sessions(temporary), 0)


def wait_for(page: Page, look, count: int) -> list:
    """Wait until ``look`` finds this many items, and return them."""
    for _ in range(int(PATIENCE_S * 10)):
        if len(found := look()) == count:
            return found
        page.wait_for_timeout(100)
    raise AssertionError(f"{len(look())} instead of {count} after {PATIENCE_S} s")


@pytest.mark.parametrize(
    ("path", "headers", "length", "status"),
    [
        ("/", {"Host": "elsewhere.example"}, None, 400),
        ("/", {"Content-Length": "999999999"}, 1, 413),
        ("/session/nobody/adapt", {}, None, 404),
        ("/", {"Origin": "http://elsewhere.example"}, None, 403),
        ("/", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe"}, None, 403),
        (f"{SOCKET}&transport=polling", {"Origin": "http://127.0.0.1:1"}, None, 403),
        (f"{SOCKET}&transport=polling", {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "no-cors"}, None, 403),
        (f"{SOCKET}&transport=websocket", {"Origin": "null", **UPGRADE}, None, 403),
        ("/_nicegui/client/x/upload/1", {"Origin": "http://elsewhere.example"}, 1, 403),
    ],
)
def test_what_the_server_refuses(page, address, path, headers, length, status):
    body = b"x" * length if length else None
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(urllib.request.Request(address + path, body, headers), timeout=PATIENCE_S)
    assert refused.value.code == status
    refused.value.close()


def test_no_other_page_frames_this_one_and_a_request_alone_makes_no_session(page, address, temporary):
    before = wait_for(page, lambda: sessions(temporary), 1)
    for _ in range(3):
        with urllib.request.urlopen(address, timeout=PATIENCE_S) as answer:
            assert answer.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
            assert b"girdle" in answer.read()
    assert sessions(temporary) == before
