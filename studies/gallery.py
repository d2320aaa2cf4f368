"""Remake the README's pictures from the nominal case and the full study."""

import shutil
from pathlib import Path

from studies.api import run_case, run_study

GALLERY = Path("results/gallery")


def main() -> None:
    """Run the case and the study and copy the chosen pictures to ``results/gallery``."""
    _, _, case = run_case("configs/paper_case.toml")
    study = run_study("configs/paper_study.toml", quiet=False)
    GALLERY.mkdir(parents=True, exist_ok=True)
    for folder, names in (
        (case, ("kinematics.png", "head_acceleration.png", "crash.gif")),
        (study, ("distributions.png", "throw_and_wad.png", "rank_correlation.png")),
    ):
        for name in names:
            shutil.copyfile(folder.path / "figures" / name, GALLERY / name)


if __name__ == "__main__":
    main()
