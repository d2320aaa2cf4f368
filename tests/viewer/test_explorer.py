"""The explorer's page in a browser: choices by mouse, status, picked runs, stored runs."""

import json
import re
from typing import Any

import numpy as np
import pytest
from crash_scene import scene_of

from mcstudy.viewer import Column, Stored, ViewedRun, pack_run, render_explorer

READY = "body[data-ready='1']"
RUNS = 2000
RNG = np.random.default_rng(2)
SPEED = np.random.default_rng(1).uniform(5.0, 20.0, RUNS)
STATUS = np.where(RNG.random(RUNS) < 0.1, "no_head_contact", "ok")
HIC = np.where(STATUS == "ok", SPEED**2.5 * RNG.uniform(0.5, 1.5, RUNS), np.nan)


def explorer(*, stored: tuple[int, ...] = ()) -> str:
    columns = [
        Column("impact_speed", "impact speed [m/s]", SPEED),
        Column("hic15", "HIC15 [–]", HIC),
        Column("constant", "constant [–]", np.full(RUNS, 2.0)),
    ]
    return render_explorer(
        "Runs </script><b>", np.arange(RUNS), STATUS.tolist(), columns, ["hic15", "impact_speed"],
        stored=[
            Stored(k, f"reason {k}", pack_run(ViewedRun(f"run {k}", scene_of()))) for k in stored
        ],
    )  # fmt: skip


def matrix_of(page: Any) -> tuple[dict[str, float], float]:
    """Return the scatter matrix's place in the window and the side of one of its two rows."""
    matrix = page.locator("#matrix")
    matrix.scroll_into_view_if_needed()
    box = matrix.bounding_box()
    return box, (min(box["width"], box["height"]) - 54) / 2


def chosen(page: Any) -> int:
    return int(page.evaluate("document.body.dataset.chosen"))


def test_the_page_holds_the_runs_and_no_markup_of_users() -> None:
    html = explorer()
    assert "Runs </script>" not in html
    assert not re.search(r"https?://|@import|url\(", html)
    content = re.search(r'(?s)id="content">(.*?)</script>', html)
    assert content is not None
    held = json.loads(content[1])
    assert [c["name"] for c in held["table"]["columns"]] == ["hic15", "impact_speed", "constant"]
    assert [c["shown"] for c in held["table"]["columns"]] == [True, True, False]
    assert sum(state["count"] for state in held["statuses"]) == RUNS


def test_the_address_chooses_the_runs_between_two_values_and_picks_one(opened: Any) -> None:
    page = opened(explorer(), "impact_speed=10:12&run=17")
    page.wait_for_selector(READY)
    inside = int(((SPEED >= 10.0) & (SPEED <= 12.0)).sum())
    assert chosen(page) == inside
    assert page.inner_text("#count") == f"{inside:,} of {RUNS:,} runs"
    assert page.evaluate("document.body.dataset.picked") == "17"
    assert "mcstudy view FOLDER --run 17" in page.inner_text("#view")
    # What browsers hold is single precision.
    assert f"{SPEED[17]:.3g}" in page.inner_text("#picked")


def test_values_of_many_runs_are_held_to_sixteen_bits(opened: Any) -> None:
    rng = np.random.default_rng(3)
    speed, huge = rng.uniform(5.0, 20.0, 6000), np.full(6000, 1e35)
    speed[7] = np.nan
    columns = [Column("speed", "speed [m/s]", speed), Column("huge", "huge [–]", huge)]
    html = render_explorer("Many", np.arange(6000), ["ok"] * 6000, columns, ["speed"])
    page = opened(html, "speed=10:12&run=17")
    page.wait_for_selector(READY)
    # Values at the ends may fall to either side.
    assert chosen(page) == pytest.approx(((speed >= 10.0) & (speed <= 12.0)).sum(), abs=3)
    assert f"{speed[17]:.3g}" in page.inner_text("#picked")


def test_dragging_along_an_axis_chooses_and_a_double_click_takes_it_back(opened: Any) -> None:
    page = opened(explorer())
    page.wait_for_selector(READY)
    box = page.locator("#parallel").bounding_box()
    # The last axis is the speed; the upper half of it is dragged over.
    x = box["x"] + box["width"] - 62
    middle = box["y"] + 46 + (box["height"] - 46 - 26) / 2
    page.mouse.move(x, middle)
    page.mouse.down()
    page.mouse.move(x + 3, box["y"] + 60)
    page.mouse.move(x, box["y"] + 20)
    page.mouse.up()
    half = SPEED.min() + 0.5 * (SPEED.max() - SPEED.min())
    assert chosen(page) == pytest.approx((half <= SPEED).sum(), abs=0.01 * RUNS)
    page.mouse.dblclick(x, middle)
    assert chosen(page) == RUNS


def test_a_rectangle_in_a_plot_chooses_by_both_columns_and_status_filters(opened: Any) -> None:
    page = opened(explorer())
    page.wait_for_selector(READY)
    box, size = matrix_of(page)
    # The plot of speed (up) against HIC15 (right), its left half.
    left, top = box["x"] + 54, box["y"] + size
    page.mouse.move(left + 1, top + 1)
    page.mouse.down()
    page.mouse.move(left + 0.3 * size, top + 0.5 * size)
    page.mouse.move(left + 0.5 * (size - 6), top + size - 7)
    page.mouse.up()
    low, high = np.nanmin(HIC), np.nanmax(HIC)
    assert chosen(page) == pytest.approx((low + 0.5 * (high - low) >= HIC).sum(), abs=0.01 * RUNS)
    page.click("#reset")
    page.get_by_label("ok (", exact=False).uncheck()
    assert chosen(page) == (STATUS != "ok").sum()


def test_a_click_picks_the_nearest_run(opened: Any) -> None:
    page = opened(explorer())
    page.wait_for_selector(READY)
    box, size = matrix_of(page)
    top_run = int(np.nanargmax(HIC))
    low, high = np.nanmin(HIC), np.nanmax(HIC)
    x = box["x"] + 54 + (size - 6) * (HIC[top_run] - low) / (high - low)
    share = (SPEED[top_run] - SPEED.min()) / (SPEED.max() - SPEED.min())
    page.mouse.click(x - 1, box["y"] + size + (size - 6) * (1.0 - share))
    assert page.evaluate("document.body.dataset.picked") == str(top_run)


def test_runs_that_the_page_holds_are_shown_and_compared(opened: Any) -> None:
    page = opened(explorer(stored=(5, 9)))
    page.wait_for_selector(READY)
    frame = page.frame_locator("#view iframe")
    frame.locator(READY).wait_for()
    assert "run 5" in frame.locator("#legend").inner_text()
    page.click("#compare")
    page.select_option("#stored", "9")
    frame.get_by_text("run 9").wait_for()
    assert {"run 5: reason 5", "run 9: reason 9"} <= set(
        page.locator("#stored").inner_text().split("\n")
    )
    assert frame.locator("#legend span").count() == 2


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_it_fits_every_width(opened: Any, width: int, dark: bool) -> None:
    page = opened(explorer(stored=(5,)), width=width, dark=dark)
    page.wait_for_selector(READY)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_every_control_is_reached_by_the_keyboard(opened: Any) -> None:
    page = opened(explorer(stored=(5,)))
    page.wait_for_selector(READY)
    reached = set()
    for _ in range(14):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.name"))
    assert {"hic15", "impact_speed", "stored", "run", "reset", "parallel", "compare"} <= reached
