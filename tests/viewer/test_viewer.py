"""The viewer's page: what is packed, that text cannot leave it, and that a browser shows it."""

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from mcstudy.viewer import Column, Curve, ViewedRun, render_explorer, render_viewer
from mcstudy.viewer.content import pack_run
from mcstudy.viewer.library import three_js
from models.protocol import Mesh, Scene

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--window-size=1280,1000", "--virtual-time-budget=3000",
)  # fmt: skip


def scene_of(*, film: bool = False) -> Scene:
    """A ball that rolls, an ellipsoid that turns, a car that yaws, and a sheet that bends."""
    time = np.arange(0.0, 0.6, 0.002)
    f = time.size
    centre = np.zeros((f, 2, 3))
    centre[:, 0, 0] = 10.0 * time
    centre[:, 1] = [0.0, 0.5, 1.0]
    angle = 3.0 * time
    turned = np.stack([np.cos(angle / 2), np.zeros(f), np.zeros(f), np.sin(angle / 2)], axis=1)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (f, 1))
    meshes = []
    if film:
        flat = np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
        shapes = np.tile(flat, (5, 1, 1))
        shapes[:, 2, 2] -= 0.01 * np.arange(5)
        meshes = [Mesh("sheet", shapes, np.array([[0, 1, 2, 3]]), "car", np.linspace(0, 0.1, 5))]
    return Scene(
        time=time,
        names=("head", "hip"),
        semi_axes=np.array([[0.1, 0.1, 0.1], [0.1, 0.2, 0.15]]),
        centre=centre,
        orientation=np.stack([still, turned], axis=1),
        car=np.stack([10.0 * time, 0.0 * time, 0.1 * time], axis=1),
        outline=[np.array([[-1.0, 0.9], [0.0, 0.7], [0.1, 0.2]])],
        plan=np.array([[0.0, -0.8], [0.0, 0.8], [-3.0, 0.8]]),
        meshes=meshes,
    )


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_poses_are_packed_finely_during_the_impact_and_coarsely_after() -> None:
    scene = scene_of()
    packed = pack_run(ViewedRun("one", scene))
    time = floats(packed["time"])
    assert np.diff(time[time < 0.24]).max() == pytest.approx(0.002, abs=1e-6)
    assert np.diff(time[time > 0.26]).min() == pytest.approx(0.01, abs=2e-3)
    assert time[-1] == pytest.approx(scene.time[-1])
    centre = floats(packed["centre"]).reshape(-1, 2, 3)
    np.testing.assert_allclose(centre[:, 0, 0], 10.0 * time, atol=1e-5)
    assert packed["half_width"] == pytest.approx(0.8)


def test_a_deforming_mesh_keeps_its_shapes_to_a_tenth_of_a_millimetre() -> None:
    (mesh,) = pack_run(ViewedRun("one", scene_of(film=True)))["meshes"]
    moved = np.frombuffer(base64.b64decode(mesh["moved"]), "<u4")
    assert moved.tolist() == [2]
    change = np.frombuffer(base64.b64decode(mesh["change"]), "<i2").reshape(5, 1, 3)
    np.testing.assert_allclose(change[:, 0, 2] * mesh["step"], -0.01 * np.arange(5), atol=5e-5)
    faces = np.frombuffer(base64.b64decode(mesh["faces"]), "<u4")
    assert faces.size == 6


def test_a_curve_keeps_every_sample_of_the_impact() -> None:
    time = np.arange(0.0, 1.0, 1e-4)
    curve = Curve("head acceleration [g]", time, np.sin(50.0 * time))
    (packed,) = pack_run(ViewedRun("one", scene_of(), [curve]))["curves"]
    kept = floats(packed["time"])
    assert (kept <= 0.25).sum() == (time <= 0.25).sum()
    assert 300 < (kept > 0.25).sum() < 500


def page(title: str = "A crash") -> str:
    time = np.linspace(0.0, 0.5, 500)
    curve = Curve("head acceleration [g]", time, 100.0 * np.exp(-(((time - 0.1) / 0.02) ** 2)))
    runs = [ViewedRun(label, scene_of(film=label == "two"), [curve]) for label in ("one", "two")]
    return render_viewer(title, runs)


def test_the_page_needs_no_network_and_holds_what_users_write_as_text() -> None:
    nasty = 'A </script><script>alert(1)</script> & "crash"'
    html = page(nasty)
    rest = html.replace(three_js().replace("</script", "<\\/script"), "")
    assert "alert(1)</script>" not in rest
    assert not re.search(r'(?:src|href)\s*=\s*"(?!#)', rest)
    assert not re.search(r"https?://|@import|url\(", rest)
    content = re.search(r'(?s)id="content">(.*?)</script>', rest)
    assert content is not None
    assert json.loads(content[1])["title"] == nasty
    assert len(html) < 1.2e6


def opened(html: str, place: str, tmp_path: Path) -> str:
    """Return what a browser made of a page on the disk."""
    (tmp_path / "page.html").write_text(html, encoding="utf-8")
    address = (tmp_path / "page.html").as_uri() + "#" + place
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={tmp_path / 'user'}", "--dump-dom", address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "<body" in done.stdout, done.stderr[-2000:]
    return done.stdout


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt install chromium")
@pytest.mark.parametrize("place", ["t=0.1", "t=0.3&arrangement=beside&view=side", "play=1"])
def test_a_browser_shows_it_from_the_disk_without_an_error(place: str, tmp_path: Path) -> None:
    dom = opened(page(), place, tmp_path)
    body = re.search(r"<body[^>]*>", dom)
    assert body is not None
    assert 'data-ready="1"' in body[0]
    assert "data-error" not in body[0]
    assert '<canvas data-engine="three.js' in dom
    clock = re.search(r'<output id="clock"[^>]*>([^<]*)</output>', dom)
    assert clock is not None
    if place.startswith("t="):
        assert clock[1] == f"{1000.0 * float(place[2:5]):.0f} ms"
    else:
        frames = re.search(r'data-frames="(\d+)"', body[0])
        assert frames is not None and int(frames[1]) > 1
        assert clock[1] != "0 ms"
    assert re.search(r'<p id="problem"[^>]*hidden', dom)


RUNS = 2000
SPEED = np.random.default_rng(1).uniform(5.0, 20.0, RUNS)


def explorer(*, address: str = "") -> str:
    rng = np.random.default_rng(2)
    hic = SPEED**2.5 * rng.uniform(0.5, 1.5, RUNS)
    status = np.where(rng.random(RUNS) < 0.1, "no_head_contact", "ok")
    hic[status != "ok"] = np.nan
    columns = [
        Column("impact_speed", "impact speed [m/s]", SPEED),
        Column("hic15", "HIC15 [–]", hic),
        Column("constant", "constant [–]", np.full(RUNS, 2.0)),
    ]
    return render_explorer(
        "Runs </script><b>", np.arange(RUNS), status.tolist(), columns,
        ["hic15", "impact_speed"], address=address,
    )  # fmt: skip


def test_the_explorer_holds_the_runs_and_no_markup_of_users() -> None:
    html = explorer()
    assert "Runs </script>" not in html
    assert not re.search(r"https?://|@import|url\(", html)
    content = re.search(r'(?s)id="content">(.*?)</script>', html)
    assert content is not None
    held = json.loads(content[1])
    assert [column["name"] for column in held["columns"]] == ["hic15", "impact_speed", "constant"]
    assert [column["shown"] for column in held["columns"]] == [True, True, False]
    np.testing.assert_allclose(floats(held["columns"][1]["values"]), SPEED, rtol=1e-6)
    assert sum(state["count"] for state in held["statuses"]) == RUNS


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt install chromium")
def test_a_browser_chooses_the_runs_between_two_values_and_picks_one(tmp_path: Path) -> None:
    dom = opened(explorer(), "impact_speed=10:12&run=17", tmp_path)
    body = re.search(r"<body[^>]*>", dom)
    assert body is not None
    assert 'data-ready="1"' in body[0]
    assert "data-error" not in body[0]
    inside = int(((SPEED >= 10.0) & (SPEED <= 12.0)).sum())
    assert f'data-chosen="{inside}"' in body[0]
    assert 'data-picked="17"' in body[0]
    assert "mcstudy view FOLDER --run 17" in dom
    assert f"{inside:,} of {RUNS:,} runs" in dom
