"""The viewer's page: what it holds, and what a browser makes of it."""

import json
import re
from typing import Any

import numpy as np
import pytest
from crash_scene import scene_of
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from mcstudy.viewer import Curve, ViewedRun, pack_run, render_viewer
from mcstudy.viewer.library import three_js
from mcstudy.viewer.packing import Packer, pack_text

READY = "body[data-ready='1']"
NASTY = 'A </script><script>alert(1)</script> & "crash" @content@'


def runs_of(*labels: str) -> list[dict[str, Any]]:
    time = np.linspace(0.0, 0.5, 500)
    curve = Curve("head acceleration [g]", time, 100.0 * np.exp(-(((time - 0.1) / 0.02) ** 2)))
    return [
        pack_run(ViewedRun(label, scene_of(film=label == "two"), [curve], {}, 1.21))
        for label in labels
    ]


@pytest.fixture(scope="module")
def html() -> str:
    return render_viewer("A crash", runs_of("one", "two"))


def test_the_page_needs_no_network_and_holds_what_users_write_as_text() -> None:
    html = render_viewer(NASTY, runs_of(NASTY))
    assert "alert(1)</script>" not in html
    assert not re.search(r'(?:src|href)\s*=\s*"(?!#)', html)
    assert not re.search(r"https?://|@import|url\(", html)
    content = re.search(r'(?s)id="content">(.*?)</script>', html)
    assert content is not None
    assert json.loads(content[1])["runs"][0]["label"] == NASTY
    assert len(html) < 0.4e6
    assert "TrackballControls" in three_js()


# -- the browser reads what was packed -----------------------------------------------------------


def read(page: Any, packed: dict[str, Any]) -> dict[str, Any]:
    """Return a packed part as the page's program unpacks it, arrays as lists."""
    found: dict[str, Any] = page.evaluate(
        """async (part) => {
             const plain = (v) => Number.isNaN(v) ? "nan" : v;
             const listed = (key, value) =>
               ArrayBuffer.isView(value) ? Array.from(value, plain) : value;
             return JSON.parse(JSON.stringify(await window.mcstudy.unpack(part), listed));
           }""",
        packed,
    )
    return found


def numbers(values: list[Any]) -> np.ndarray:
    return np.array([np.nan if v == "nan" else v for v in values], dtype=float)


def test_poses_are_fine_during_the_impact_and_coarse_after(opened: Any, html: str) -> None:
    page = opened(html)
    page.wait_for_selector(READY)
    scene = scene_of()
    (packed,) = runs_of("one")
    found = read(page, packed)
    time = numbers(found["time"])
    assert np.diff(time[time < 0.24]).max() == pytest.approx(0.002, abs=1e-6)
    assert np.diff(time[time > 0.26]).min() == pytest.approx(0.01, abs=2e-3)
    assert time[-1] == pytest.approx(scene.time[-1])
    centre = numbers(found["centre"]).reshape(-1, 2, 3)
    np.testing.assert_allclose(centre[:, 0, 0], 10.0 * time, atol=6e-5)
    turned = numbers(found["orientation"]).reshape(-1, 2, 4)
    np.testing.assert_allclose(
        2.0 * np.arctan2(turned[:, 1, 3], turned[:, 1, 0]), 3.0 * time, atol=1e-4
    )
    assert found["half_width"] == pytest.approx(0.8)
    assert found["wad"] == 1.21


def test_forces_above_a_threshold_are_held_frame_by_frame(opened: Any, html: str) -> None:
    page = opened(html)
    page.wait_for_selector(READY)
    (packed,) = runs_of("one")
    found = read(page, packed)
    count = np.diff(numbers(found["forces"]["first"]))
    time = numbers(found["time"])
    np.testing.assert_array_equal(count == 1, (time > 0.039) & (time < 0.079))
    force = numbers(found["forces"]["force"]).reshape(-1, 3)
    np.testing.assert_allclose(force, [[0.0, 0.0, 3000.0]] * len(force))
    # The corner in the middle of a straight side is left out.
    tape = numbers(found["tape"]).reshape(-1, 3)
    np.testing.assert_allclose(tape[:, 2], [0.0, 0.7, 0.8], atol=1e-6)


def test_a_deforming_mesh_keeps_its_shapes_to_a_tenth_of_a_millimetre(
    opened: Any, html: str
) -> None:
    page = opened(html)
    page.wait_for_selector(READY)
    (packed,) = runs_of("two")
    (mesh,) = read(page, packed)["meshes"]
    assert mesh["moved"] == [2]
    change = numbers(mesh["change"]).reshape(5, 1, 3)
    np.testing.assert_allclose(change[:, 0, 2], -0.01 * np.arange(5), atol=5e-5)
    assert len(mesh["faces"]) == 6


def test_a_curve_keeps_every_sample_of_the_impact(opened: Any, html: str) -> None:
    page = opened(html)
    page.wait_for_selector(READY)
    time = np.arange(0.0, 1.0, 1e-4)
    values = np.sin(50.0 * time)
    values[100] = np.nan
    packed = pack_run(ViewedRun("one", scene_of(), [Curve("head acceleration [g]", time, values)]))
    (curve,) = read(page, packed)["curves"]
    kept, shown = numbers(curve["time"]), numbers(curve["values"])
    assert (kept <= 0.25).sum() == (time <= 0.25).sum()
    assert 300 < (kept > 0.25).sum() < 500
    np.testing.assert_allclose(shown, values[np.round(kept / 1e-4).astype(int)], atol=1e-4)


@given(
    table=arrays.arrays(
        np.float64, st.tuples(st.integers(1, 30), st.integers(1, 4)),
        elements=st.floats(-3.0, 3.0) | st.just(float("nan")),
    ),
    kind=st.sampled_from(["i2", "i4"]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_any_history_comes_back_to_half_a_step(blank: Any, table: np.ndarray, kind: str) -> None:
    packer = Packer()
    whole = {"a": packer.add(table, kind, 1e-4), "b": packer.add(table), "again": packer.add(table)}
    assert whole["b"]["at"] == whole["again"]["at"]
    found = read(blank, whole | {"data": packer.data()})
    np.testing.assert_allclose(numbers(found["a"]), table.ravel(), atol=0.51e-4)
    np.testing.assert_allclose(numbers(found["b"]), table.ravel(), rtol=1e-6, atol=1e-30)


@pytest.fixture(scope="module")
def blank(browser: Any, html: str) -> Any:
    page = browser.new_page()
    page.set_content(html)
    page.wait_for_selector(READY)
    yield page
    page.close()


def test_values_beyond_a_kind_are_refused() -> None:
    with pytest.raises(ValueError, match="have no i2 in steps"):
        Packer().add(np.array([40.0]), "i2", 1e-3)
    assert len(pack_text("a" * 9000)) < 100


# -- what people do ------------------------------------------------------------------------------


def test_it_plays_pauses_and_ends(opened: Any, html: str) -> None:
    page = opened(html)
    page.wait_for_selector(READY)
    page.select_option("#speed", "1")
    page.click("#play")
    assert page.inner_text("#play") == "Pause"
    page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    assert page.inner_text("#clock") == f"{1000.0 * scene_of().time[-1]:.0f} ms"
    assert int(page.evaluate("document.body.dataset.frames")) > 3


def test_time_moves_by_slider_curve_and_keys(opened: Any, html: str) -> None:
    page = opened(html)
    page.wait_for_selector(READY)
    page.fill("#time", "500")
    page.wait_for_function("document.getElementById('clock').textContent === '250 ms'")
    box = page.locator("#plot").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.wait_for_function("document.getElementById('clock').textContent !== '250 ms'")
    page.locator("#plot").focus()
    page.keyboard.press("Home")
    page.wait_for_function("document.getElementById('clock').textContent === '0 ms'")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.wait_for_function("document.getElementById('clock').textContent === '10 ms'")
    page.keyboard.press("End")
    page.wait_for_function("document.getElementById('clock').textContent === '598 ms'")
    page.keyboard.press(" ")
    assert page.inner_text("#play") == "Pause"


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_every_arrangement_is_drawn_and_fits(
    opened: Any, html: str, width: int, dark: bool
) -> None:
    page = opened(html, "t=0.05", width=width, dark=dark)
    page.wait_for_selector(READY)
    pictures = set()
    for choose in (
        lambda: None,
        lambda: page.select_option("#view", "side"),
        lambda: page.select_option("#arrangement", "beside"),
        lambda: page.uncheck("#forces"),
        lambda: page.uncheck("#tape"),
    ):
        choose()
        page.wait_for_timeout(150)
        pictures.add(page.locator("#scene").screenshot())
    assert len(pictures) == 5
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert "WAD 1.21 m" in page.inner_text("#legend")
