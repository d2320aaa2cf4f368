"""Remake the README's figures from the nominal case, the full studies and the validation."""

import shutil
import tempfile
from pathlib import Path

from mcstudy.execution.results import ResultsFolder
from models.protocol import Run
from studies.api import run_case, run_study
from studies.stiffness_fit.study import fit_stiffness_of
from studies.validation.report import validate
from studies.viewing import view_runs

GALLERY = Path("results/gallery")


INSTANT = 0.075
"""s, the head's impact in the nominal run."""


def draw_viewer(run: Run) -> None:
    """Write the picture of a run in the viewer, by Playwright and a Chromium of the system.

    Parameters
    ----------
    run : Run
    """
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as driver:
        page_file = Path(scratch) / "viewer.html"
        page_file.write_text(view_runs("The nominal run", {"multibody": run}), encoding="utf-8")
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--enable-unsafe-swiftshader"],
        )
        page = browser.new_page(viewport={"width": 1060, "height": 860})
        page.goto(f"{page_file.as_uri()}#t={INSTANT}&curve=head acceleration [g]")
        page.wait_for_selector("body[data-ready='1']")
        page.wait_for_timeout(1000)
        GALLERY.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=GALLERY / "viewer.png")
        browser.close()


def main() -> None:
    """Run the case and the study and copy the chosen figures to ``results/gallery``."""
    run, _, case = run_case("configs/paper_case.toml")
    draw_viewer(run)
    study = run_study("configs/paper_study.toml", quiet=False)
    drivers = run_study("configs/paper_sobol.toml", quiet=False)
    injuries = run_study("configs/paper_injury.toml", quiet=False)
    population = run_study("configs/population_injury.toml", quiet=False)
    methods = run_study("configs/model_comparison.toml", quiet=False)
    hood_map = run_study("configs/hood_map.toml", quiet=False)
    three = run_study("configs/three_methods.toml", quiet=False)
    chain = run_study("configs/method_chain.toml", quiet=False)
    speed = run_study("configs/paper_posterior.toml", quiet=False)
    hood = ResultsFolder("results/stiffness_hood_tests")
    fit_stiffness_of(Path("configs/hood_tests"), hood)
    validation = ResultsFolder("results/validation_throw")
    validate(validation, measured=Path("../shared/measured"), only=("throw",))
    GALLERY.mkdir(parents=True, exist_ok=True)
    for folder, names in (
        (case, ("kinematics.png", "head_acceleration.png", "crash.gif")),
        (study, ("distributions.png", "throw_and_wad.png", "rank_correlation.png")),
        (drivers, ("indices.png", "main_effects_hic15.png")),
        (injuries, ("ais.png", "risk_hic15.png", "speed.png")),
        (hood, ("force_penetration.png", "corridor.png")),
    ):
        for name in names:
            shutil.copyfile(folder.path / "figures" / name, GALLERY / name)
    shutil.copyfile(population.path / "figures" / "ais.png", GALLERY / "population_ais.png")
    shutil.copyfile(hood_map.path / "figures" / "map_hic15.png", GALLERY / "hood_map.png")
    shutil.copyfile(methods.path / "figures" / "variance.png", GALLERY / "method_variance.png")
    shutil.copyfile(three.path / "figures" / "kinematics.png", GALLERY / "three_methods.png")
    shutil.copyfile(chain.path / "figures" / "split_hic15.png", GALLERY / "method_chain.png")
    shutil.copyfile(speed.path / "figures" / "posterior.png", GALLERY / "posterior_speed.png")
    shutil.copyfile(validation.path / "figures" / "throw_1.png", GALLERY / "validation_throw.png")


if __name__ == "__main__":
    main()
