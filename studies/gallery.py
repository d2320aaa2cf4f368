"""Remake the README's pictures from the nominal case and the full study."""

import shutil
from pathlib import Path

from mcstudy.config import MonteCarloStudy, Reconstruction, load_study
from mcstudy.results import ResultsFolder
from studies.monte_carlo import run_monte_carlo
from studies.reconstruction import reconstruct, write_reconstruction

PICTURES = {
    "paper_case": ("kinematics.png", "head_acceleration.png", "crash.gif"),
    "paper_study": ("distributions.png", "throw_and_wad.png", "rank_correlation.png"),
}


def main() -> None:
    """Run the case and the study and copy the chosen pictures to ``results/gallery``."""
    gallery = Path("results/gallery")
    gallery.mkdir(parents=True, exist_ok=True)
    for name, pictures in PICTURES.items():
        path = Path("configs") / f"{name}.toml"
        text, study = path.read_text(encoding="utf-8"), load_study(path)
        folder = ResultsFolder(Path("results") / study.name)
        if isinstance(study, Reconstruction):
            write_reconstruction(study, text, *reconstruct(study), folder)
        elif isinstance(study, MonteCarloStudy):
            run_monte_carlo(study, text, folder)
        for picture in pictures:
            shutil.copyfile(folder.path / "figures" / picture, gallery / picture)


if __name__ == "__main__":
    main()
