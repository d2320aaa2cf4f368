"""Reports in a browser: pages inside them, width, contrast."""

from typing import Any

import pytest
from crash_scene import scene_of

from mcstudy.report import Section, Table, render
from mcstudy.viewer import Curve, ViewedRun, pack_run, render_viewer

READY = "body[data-ready='1']"
AA = 4.5
"""Least contrast of text in WCAG 2.2, success criterion 1.4.3."""
CONTRAST = """() => {
  // Relative luminance and contrast ratio of WCAG 2.2.
  const parts = (text) => text.match(/[0-9.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = (node) => {
    for (; node; node = node.parentElement) {
      const found = parts(getComputedStyle(node).backgroundColor);
      if (found.length < 4 || found[3] > 0) return found;
    }
    return [255, 255, 255];
  };
  let least = 99, where = "";
  for (const node of document.querySelectorAll("body *")) {
    const own = [...node.childNodes].some((c) => c.nodeType === 3 && c.textContent.trim());
    if (!own || !node.getClientRects().length) continue;
    const a = light(parts(getComputedStyle(node).color)), b = light(ground(node));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < least) { least = ratio; where = node.outerHTML.slice(0, 80); }
  }
  return [least, where];
}"""


@pytest.fixture(scope="module")
def report() -> str:
    time = scene_of().time
    run = pack_run(ViewedRun("a run", scene_of(), [Curve("force [N]", time, time)]))
    table = Table(
        "A table", ["output", "value"], [["HIC15", "1,384"], ["a long name of an output", "2"]]
    )
    viewer = {'The "run" <in> three dimensions': render_viewer("A run", [run])}
    return render("A study", "of one run", [Section("First", ("Text.",), [table], pages=viewer)])


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_a_page_inside_a_report_runs_and_all_text_is_readable(
    opened: Any, report: str, width: int, dark: bool
) -> None:
    page = opened(report, width=width, dark=dark)
    frame = page.frame_locator("iframe")
    frame.locator(READY).wait_for()
    frame.locator("#play").click()
    frame.get_by_text("Pause").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    least, where = page.evaluate(CONTRAST)
    assert least >= AA, where
    least, where = page.frames[1].evaluate(CONTRAST)
    assert least >= AA, where


def test_the_page_of_a_report_reaches_nothing_outside_it(opened: Any, report: str) -> None:
    page = opened(report)
    frame = page.frame_locator("iframe")
    frame.locator(READY).wait_for()
    assert page.frames[1].evaluate("window.origin") == "null"
