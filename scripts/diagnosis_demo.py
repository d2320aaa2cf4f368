"""Demonstration: find a hidden effect, extend the model and repeat the injury study.

``make diagnose-demo`` runs this module.
"""

import argparse
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mcstudy.execution.progress import say
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import diagnosis as figures_of
from mcstudy.figures import risk, style
from mcstudy.files import read_study_text
from mcstudy.injury.cases import read_parquet
from mcstudy.report import Section, Table
from mcstudy.text import percent
from mcstudy.typed_json import from_plain
from studies.diagnosis import extension, words
from studies.diagnosis.report import summarise
from studies.diagnosis.study import diagnose
from studies.injury.analysis import CASES
from studies.injury.numbers import ScenarioOutcome
from studies.injury.schema import InjuryStudy
from studies.injury.study import Injury
from studies.kinds import parse_study
from studies.publishing import publish
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import Hidden

INJURY_STUDY = Path("configs/demo_injury.toml")
RESULTS = Path("results/diagnose_demo")
LOWEST, HIGHEST = 0.024, 0.034
"""m between which the hidden clearance is drawn."""
STIFFNESS = 2.5e5
"""N/m of what lies below the hood (assumed)."""
TITLES = {"base": "base model", "extended": "extended model"}


def run_demo(
    out: Path = RESULTS, *, study_file: Path = INJURY_STUDY, seed: int = 0, workers: int = -1
) -> dict[str, Any]:
    """Make tests with a hidden effect, find it, extend the model and run the injury study again.

    Parameters
    ----------
    out : path
        Folder, replaced.
    study_file : path
        Injury study.
    seed : int
        Seed of the hidden effect and of the tests.
    workers : int
        Processes, -1 for one per core.

    Returns
    -------
    dict
        The analysis, as in ``analysis.json``.
    """
    shutil.rmtree(out, ignore_errors=True)
    clearance = float(np.random.default_rng([seed, 5]).uniform(LOWEST, HIGHEST))
    hidden = {"clearance": clearance, "stiffness": STIFFNESS}
    data = out / "measured"
    make_tests(data, [Hidden("hood_bottoming", "catalogue", hidden)], seed)
    say(f"18 headform tests in {data}")
    answer = diagnose(data, ResultsFolder(out / "diagnosis"), workers=workers, quiet=False)
    text = read_study_text(study_file)
    texts = {"base": text, "extended": extension.extend(text, answer["parameters"])}
    injuries = {}
    for name, content in texts.items():
        study = parse_study(content, f"{study_file} ({name})")
        assert isinstance(study, InjuryStudy)
        say(f"injury study, {TITLES[name]}")
        found = Injury().run(study, content, ResultsFolder(out / f"injury_{name}"), workers=workers)
        injuries[name] = {
            "outcome": found.scenarios["reference"], "limit": study.limit.value
        }  # fmt: skip
    folder = ResultsFolder(out)
    with folder.open_for_writing():
        return publish(
            folder, "A hidden effect and its effect on the injury study",
            "18 headform tests; the injury study before and after",
            {"hidden": hidden, "answer": answer, "injuries": injuries},
            lambda held: _draw(held, out), _sections,
        )  # fmt: skip


def _draw(analysis: Mapping[str, Any], out: Path) -> dict[str, Any]:
    pictures = ResultsFolder(out / "diagnosis").read_json("analysis.json")
    label = style.label("head_acceleration", "g")
    figures = {
        "pulses": figures_of.draw_pulses(
            pictures["pictures"]["signals"]["head_acceleration"], label
        ),
        "evidence": figures_of.draw_evidence(analysis["answer"]["effects"]),
        "ais": risk.draw_ais(
            {TITLES[k]: v["outcome"]["ais"] for k, v in analysis["injuries"].items()}
        ),
    }
    values = {
        TITLES[name]: read_parquet(out / f"injury_{name}" / CASES)["hic15"].to_numpy(float)
        for name in TITLES
    }
    limit = analysis["injuries"]["base"]["limit"]
    figures["exceedance"] = risk.draw_exceedance(values, style.label("hic15"), limit)
    return figures


def _sections(analysis: Mapping[str, Any], figures: Mapping[str, Any]) -> list[Section]:
    hidden = analysis["hidden"]
    rows = []
    for name, found in analysis["injuries"].items():
        outcome = from_plain(ScenarioOutcome, found["outcome"])
        above, injured = outcome.above_limit, outcome.at_least["3"]
        rows.append([TITLES[name], percent(above), percent(injured)])
    return [
        Section(
            "Findings in the tests",
            summarise(analysis["answer"]),
            [],
            {"Three of the tests.": figures["pulses"], "Causes.": figures["evidence"]},
        ),
        Section(
            "Hidden effect",
            [
                f"A structure {1e3 * hidden['clearance']:.2f} mm below the hood, "
                f"{1e-3 * hidden['stiffness']:.0f} kN/m. The tests were made by a program "
                "independent of the diagnosis."
            ],
        ),
        Section(
            "Effect on the injury study",
            words.gain_words(analysis["answer"]["gain"]),
            [Table("The injury study with either model.",
                   ["model", "HIC15 above the limit", "AIS 3 or worse"], rows)],
            {"Injuries.": figures["ais"], "HIC15 over the study.": figures["exceedance"]},
        ),
    ]  # fmt: skip


def main() -> None:
    """Run the demonstration from the command line."""
    parser = argparse.ArgumentParser(description=run_demo.__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=-1)
    chosen = parser.parse_args()
    analysis = run_demo(chosen.out, seed=chosen.seed, workers=chosen.workers)
    print("\n".join(summarise(analysis["answer"])))
    print(f"report: {chosen.out / 'report.html'}")


if __name__ == "__main__":
    main()
