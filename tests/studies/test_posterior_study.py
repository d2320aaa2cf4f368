"""Evidence on a bank: the study and the command agree, other questions cost no run, refusals."""

import json
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from headform_studies import (
    EVIDENCE,
    by_formula,
    mcstudy,
    recorded_parts,
    run_text,
    study_text,
    told,
)

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from studies.inference.evidence import posterior_draws, to_inference_data
from studies.kinds import load_study

DESIGN = 'method = "sobol"\nn = 2048\nreplicate_size = 1024'
FILE = f'format = "mcstudy-evidence/1"\ntitle = "Other evidence"\n{EVIDENCE}'


@pytest.fixture(scope="module")
def bank(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """A posterior study of a headform: HIC15 is 6 v^2.5 m^-0.75 k^0.75, the force 316 v m^0.5."""
    folder = ResultsFolder(tmp_path_factory.mktemp("bank") / "out")
    with by_formula():
        run_text(study_text("posterior", DESIGN, outputs=("hic15",)), folder)
    return folder


def infer(bank: ResultsFolder, tmp_path: Path, text: str) -> dict:
    """Return the analysis of an evidence file by the command line."""
    (tmp_path / "e.toml").write_text(text)
    answer = mcstudy(
        "infer", bank.path, "--evidence", tmp_path / "e.toml", "--out", tmp_path / "r", "--json"
    )
    assert (answer.code, answer.err) == (0, "")
    return dict(json.loads(answer.out)["analysis"])


def test_the_command_gives_what_the_study_gave_and_runs_nothing(
    bank: ResultsFolder, tmp_path: Path
) -> None:
    with recorded_parts() as ids:
        found = infer(bank, tmp_path, FILE)
    assert ids == []
    study = bank.read_json("analysis.json")
    for key in ("after", "before", "ratios", "calibration", "items", "refused"):
        assert found[key] == study[key], key
    assert found["refused"] == ""
    assert (tmp_path / "r" / "report.html").exists()
    assert (tmp_path / "r" / "evidence.toml").read_text() == FILE


def test_the_posterior_of_two_power_laws_is_that_of_the_logarithms(bank: ResultsFolder) -> None:
    """Log speed, mass and scale are normal, and so are log HIC15 and log force: linear algebra."""
    spreads = np.array([0.12, 0.2, 0.3])
    laws = np.array([[2.5, -0.75, 0.75], [1.0, 0.5, 0.5]])
    median = np.array([np.log(30.0 / 3.6), np.log(2.5), 0.0])
    simulated = np.array([np.log(6.0), np.log(316.0)]) + laws @ median
    prior = np.diag(spreads**2)
    noise = np.diag(np.array([0.1, 0.1]) ** 2)
    gain = prior @ laws.T @ np.linalg.inv(laws @ prior @ laws.T + noise)
    off = np.log([600.0, 4000.0]) - simulated
    mean = (median + gain @ off)[0]
    sd = np.sqrt((prior - gain @ laws @ prior)[0, 0])
    after = bank.read_json("analysis.json")["after"]
    # The noise is 10 % of the measured value, not of the simulated one: close, not equal.
    assert np.log(after["median"] / 3.6) == pytest.approx(mean, abs=0.02)
    low, high = np.log(np.array(after["intervals"]["0.9"]) / 3.6)
    assert (high - low) / (2.0 * 1.645) == pytest.approx(sd, rel=0.12)


def test_a_narrower_prior_and_another_question(bank: ResultsFolder, tmp_path: Path) -> None:
    text = FILE + (
        '[priors.impact_speed]\ndistribution = "uniform"\nunit = "km/h"\nlow = 28.0\nhigh = 34.0\n'
        '[propositions."light head"]\nof = "headform_mass"\nbelow = 2.3\nunit = "kg"\n'
    )
    found = infer(bank, tmp_path, text)
    low, high = found["before"]["intervals"]["0.95"]
    assert 28.0 <= low <= 28.5
    assert 33.5 <= high <= 34.0
    assert [row["label"] for row in found["ratios"]] == ["above 30 km/h", "light head"]
    assert found["after"]["intervals"]["0.95"][1] <= 34.3


def test_what_is_asked_for_beside_the_speed(bank: ResultsFolder, tmp_path: Path) -> None:
    text = (
        'format = "mcstudy-evidence/1"\ntitle = "More"\nalso = ["headform_mass"]\n'
        + EVIDENCE
        + "[discrepancy.hic15]\nrelative = 0.1\n"
        '[measurements.headform_mass]\nsd = 0.01\nunit = "kg"\n'
        "[measurements.hood_force_scale]\nsd = 0.01\n"
        "[injury]\nrecorded = 3\nage = 8.0\n"
    )
    found = infer(bank, tmp_path, text)
    assert found["plain"]["intervals"]["0.9"] != found["after"]["intervals"]["0.9"]
    assert [row["name"] for row in found["others"]] == ["headform_mass"]
    width = np.ptp(found["after"]["intervals"]["0.9"])
    assert all(row["width"] < width for row in found["further"])
    assert found["injury"]["recorded"] == 3
    risks = found["injury"]["exceeding"]["prasad_mertz"]
    assert 1.0 > risks["1"] > risks["3"] > risks["6"] > 0.0


def test_impossible_evidence_is_refused_with_what_is_to_blame(
    bank: ResultsFolder, tmp_path: Path
) -> None:
    found = infer(bank, tmp_path, FILE.replace("value = 4000.0", "value = 40000.0"))
    assert found["ratios"] == []
    assert "impossible" in found["refused"]
    assert found["refused"].endswith("to blame is peak force")
    html = (tmp_path / "r" / "report.html").read_text()
    assert html.index("NO LIKELIHOOD RATIO IS GIVEN") < html.index("Propositions</h2>")


def test_a_small_bank_gives_no_ratio(tmp_path: Path) -> None:
    with by_formula():
        analysis = run_text(study_text("posterior"), ResultsFolder(tmp_path / "small"))
    assert "effective runs" in analysis["refused"] or "calibration" in analysis["refused"]


def test_a_monte_carlo_folder_is_a_bank_too(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "mc")
    with by_formula():
        run_text(study_text("monte-carlo", "n = 400\nreplicate_size = 100"), folder)
    assert infer(folder, tmp_path, FILE)["runs"] == 400
    answer = mcstudy("contours", folder.path, "--output", "hic15", "--by", "headform_mass",
                     "--groups", "2", "--out", tmp_path / "c")  # fmt: skip
    assert (answer.code, answer.err) == (0, "")
    assert "impact speed" in answer.line
    families = ResultsFolder(tmp_path / "c").read_json("analysis.json")["families"]
    # A heavier head has a lower HIC15 at every speed, and HIC15 rises with it.
    light, heavy = families
    assert all(a > b for a, b in zip(light["middle"][5:], heavy["middle"][5:], strict=True))
    assert light["middle"][-1] > 2.0 * light["middle"][0]
    said = told(mcstudy("contours", folder.path, "--by", "colour", "--out", tmp_path / "c"))
    assert "no such input or output" in said


def test_draws_for_python(bank: ResultsFolder, tmp_path: Path,
                          monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    (tmp_path / "e.toml").write_text(FILE)
    draws = posterior_draws(bank, tmp_path / "e.toml", n=2000)
    after = bank.read_json("analysis.json")["after"]
    assert 3.6 * draws["impact_speed"].median() == pytest.approx(after["median"], rel=0.01)
    assert {"headform_mass", "hic15"} <= set(draws.columns)
    csv = tmp_path / "draws.csv"
    mcstudy("infer", bank.path, "--evidence", tmp_path / "e.toml", "--out", tmp_path / "r",
            "--draws", csv, "--quiet")  # fmt: skip
    assert csv.read_text().count("\n") == 4001
    fake = types.ModuleType("arviz")
    fake.__dict__["from_dict"] = lambda table: table
    monkeypatch.setitem(sys.modules, "arviz", fake)
    assert to_inference_data(draws)["impact_speed"].shape == (1, 2000)
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(UserError, match="pip install arviz"):
        to_inference_data(draws)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("[evidence.hic15]", "[evidence.hic51]"), "evidence.hic51: model 'headform' has no input"),
        (("sd = 60.0", ""), "evidence.hic15: sd: a value needs its standard uncertainty"),
        (("value = 600.0\nsd = 60.0", "at_least = 600.0\nat_most = 500.0"), "be below at_most"),
        (("value = 600.0", "value = 600.0\nhappened = true"), "give one of value"),
        (('unit = "N"', 'unit = "kg"'), "evidence.peak_force.unit"),
        (("above = 30.0", ""), "give above, below or both"),
        (('of = "impact_speed"', 'of = "speed"'), "propositions.above 30 km/h.of: model"),
        (("above = 30.0", "above = 3000.0"), "propositions.above 30 km/h: false in every run"),
        (("title", 'target = "friction_body_car"\ntitle'), "is not sampled by the study"),
        (("title", 'also = ["colour"]\ntitle'), "has no input or output 'colour'"),
        (("mcstudy-evidence/1", "mcstudy-evidence/2"), "format"),
        (("[evidence.hic15]", "[discrepancy.clip_3ms]\nsd = 1.0\n[evidence.hic15]"),
         "discrepancy.clip_3ms: there is no evidence on clip_3ms"),
        (("[evidence.hic15]", '[priors.impact_speed]\ndistribution = "uniform"\nunit = "km/h"\n'
          "low = 10.0\nhigh = 200.0\n[evidence.hic15]"), "priors.impact_speed: "),
    ],
)  # fmt: skip
def test_wrong_evidence_is_told_in_one_line(
    bank: ResultsFolder, tmp_path: Path, edit: tuple[str, str], message: str
) -> None:
    text = FILE.replace(*edit, 1)
    assert text != FILE
    (tmp_path / "e.toml").write_text(text)
    said = told(mcstudy("infer", bank.path, "--evidence", tmp_path / "e.toml", "--out",
                        tmp_path / "r"))  # fmt: skip
    assert message in said
    assert not (tmp_path / "r").exists()


def test_the_folder_of_another_kind_is_no_bank(tmp_path: Path) -> None:
    with by_formula():
        run_text(study_text("morris"), ResultsFolder(tmp_path / "m"))
    (tmp_path / "e.toml").write_text(FILE)
    said = told(mcstudy("infer", tmp_path / "m", "--evidence", tmp_path / "e.toml"))
    assert "Morris" in said or "kind morris" in said
    assert "has no evidence" in told(
        mcstudy("infer", tmp_path / "m", "--evidence", "configs/paper_study.toml")
    )


def test_the_files_of_the_project_are_valid() -> None:
    for name in ("paper_posterior", "hidden_speed_posterior"):
        assert load_study(Path(f"configs/{name}.toml")).kind == "posterior"
