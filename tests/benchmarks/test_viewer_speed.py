"""A report with 2,000 runs and three crashes in three dimensions: size, time to be ready, frames.

Its peer is the same browser with an empty page that does nothing but ask for frames.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcstudy.report import Section, render
from mcstudy.viewer import Column, Stored, render_explorer
from models.registry import load_model
from studies.viewing import pack_scene, view_runs

COUNT = """async (seconds) => {
  let frames = 0; const end = performance.now() + 1000 * seconds;
  while (performance.now() < end) { await new Promise(requestAnimationFrame); frames++; }
  return frames / seconds;
}"""


@pytest.fixture(scope="module")
def report() -> str:
    model = load_model("multibody")
    runs = {f"{speed} m/s": model.run({"impact_speed": speed}) for speed in (9.0, 11.0, 13.0)}
    rng = np.random.default_rng(1)
    columns = [Column(f"x{k}", f"input {k} [–]", rng.normal(size=2000)) for k in range(40)]
    stored = []
    for k, run in enumerate(runs.values()):
        packed = pack_scene(f"run {k}", run)
        assert packed is not None
        stored.append(Stored(k, "kept", packed))
    explorer = render_explorer(
        "Runs", np.arange(2000), ["ok"] * 2000, columns, ["x0", "x1", "x2", "x3"], stored=stored
    )
    pages = {"viewer": view_runs("Three crashes", runs), "explorer": explorer}
    return render("A study", "", [Section("Runs", pages=pages)])


def test_ready_and_frames(browser: Any, report: str, tmp_path: Path, benchmark: Any) -> None:
    file = tmp_path / "report.html"
    file.write_text(report, encoding="utf-8")
    page = browser.new_page(viewport={"width": 1280, "height": 900})

    def open_report() -> None:
        page.goto(file.as_uri())
        for k in range(2):
            frame = page.locator("iframe").nth(k).element_handle().content_frame()
            frame.wait_for_selector("body[data-ready='1']")

    benchmark.pedantic(open_report, rounds=3)
    frame = page.locator("iframe").first.element_handle().content_frame()
    frame.click("#play")
    playing = frame.evaluate(COUNT, 4.0)
    page.goto("about:blank")
    benchmark.extra_info.update(
        megabytes=round(len(report) / 1e6, 2), frames_a_second=round(playing, 1),
        frames_of_an_empty_page=round(page.evaluate(COUNT, 2.0), 1),
    )  # fmt: skip
    print(benchmark.extra_info)
