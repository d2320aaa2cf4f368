"""The validation's part on measured head impacts of a child dummy, with and without the data."""

import math
from pathlib import Path

import numpy as np
import pytest
from headform_studies import Answer, mcstudy, told

from studies.validation import dummy_head
from studies.validation.check import Part

MEASURED = Path("../shared/measured")
NEEDED = pytest.mark.skipif(
    not (MEASURED / dummy_head.FILE).exists(), reason="the measured data are not here"
)


def impacts(samples: int = 301, tests: int = 3, sign: float = 1.0) -> list[str]:
    """Return the lines of a file of half-sine forces on a head of 2.6 kg, harder when faster."""
    lines = [",".join(dummy_head.COLUMNS)]
    for speed, peak in ((1.0, 800.0), (1.5, 1300.0), (3.1, 3600.0))[:tests]:
        for k in range(1, samples + 1):
            force = sign * peak * max(math.sin(math.pi * k / 160.0), 0.0) + 1.0 * sign
            acceleration = force / (2.6 * 9.80665)
            lines.append(f"{speed},{0.05 * k:.2f},{acceleration:.4f},{force:.3f}")
    return lines


def replaced(old: str, new: str, lines: list[str]) -> list[str]:
    text = "\n".join(lines)
    assert old in text
    return text.replace(old, new, 1).split("\n")


def with_column(line: str, column: int, value: str) -> str:
    cells = line.split(",")
    cells[column] = value
    return ",".join(cells)


GOOD = impacts()
BROKEN = {
    "empty": [""],
    "head only": GOOD[:1],
    "no force": [line.rpartition(",")[0] for line in GOOD],
    "a word": replaced("1.5,0.05", "fast,0.05", GOOD),
    "not a number": replaced("1.5,0.05", "1.5,nan", GOOD),
    "infinite": replaced("1.5,0.05", "1.5,inf", GOOD),
    "a gap": replaced("1.5,0.05", "1.5,", GOOD),
    "more columns": replaced("1.5,0.05", "1,1,1,1.5,0.05", GOOD),
    "two tests": impacts(tests=2),
    "one sample": GOOD[: 1 + 602 + 1],
    "no contact": [GOOD[0], *(line.rpartition(",")[0] + ",0.0" for line in GOOD[1:])],
    "force pulls": impacts(sign=-1.0),
    "no acceleration": [GOOD[0], *(with_column(line, 2, "0.0") for line in GOOD[1:])],
    "time runs back": [GOOD[0], *GOOD[:0:-1]],
    "time stands still": [GOOD[0], *(with_column(line, 1, "0.05") for line in GOOD[1:])],
}


def run(folder: Path) -> Answer:
    """Return what ``mcstudy validate --only dummy-head`` says."""
    paths = ("--measured", folder, "--out", folder / "out")
    return mcstudy("validate", "--only", "dummy-head", "--quiet", *paths)


@pytest.mark.parametrize("damage", [*BROKEN, "no text"])
def test_a_broken_file_is_a_user_error(tmp_path: Path, damage: str) -> None:
    content = "\n".join(BROKEN.get(damage, [])).encode() or bytes(range(256)) * 8
    (tmp_path / dummy_head.FILE).write_bytes(b"" if damage == "empty" else content)
    said = told(run(tmp_path))
    assert dummy_head.FILE in said
    assert ("cannot be read" in said) or damage != "no text"


@pytest.mark.parametrize("folder", ["", "nowhere"])
def test_without_the_file_nothing_is_run_and_nothing_fails(tmp_path: Path, folder: str) -> None:
    said = run(tmp_path / folder)
    assert (said.code, said.err) == (0, "")
    part = dummy_head.validate(1, tmp_path / folder)
    assert {c.verdict for c in part.checks} == {"not run"}
    assert dummy_head.FILE in part.paragraphs[0]


@pytest.fixture(scope="module")
def measured() -> Part:
    return dummy_head.validate(1, MEASURED)


@NEEDED
@pytest.mark.measured
def test_numbers_of_the_measured_impacts(measured: Part) -> None:
    # HIC15 of the fastest test on the samples: README of the measured data.
    ours = {c.key: c.ours for c in measured.checks}
    assert tuple(ours) == dummy_head.KEYS
    assert ours["dummy_hic"] == pytest.approx(549.9, abs=0.05)
    assert 2.5 <= ours["dummy_effective_mass"] <= 2.8
    verdicts = {c.key: c.verdict for c in measured.checks}
    assert verdicts["dummy_hic"] == verdicts["dummy_effective_mass"] == "inside"
    assert "not run" not in verdicts.values()
    for c in measured.checks:
        assert c.verdict == "inside" or c.reason


@NEEDED
@pytest.mark.measured
def test_effective_masses_of_the_single_tests(measured: Part) -> None:
    # Impulse of the force over that of the acceleration, between the first and the last sample
    # of a twentieth of the peak force.
    rows = np.loadtxt(MEASURED / dummy_head.FILE, delimiter=",", skiprows=1)
    masses = []
    for speed in (1.0, 1.5, 3.1):
        _, _, acceleration, force = rows[rows[:, 0] == speed].T
        held = np.flatnonzero(force >= 0.05 * force.max())
        contact = slice(held[0], held[-1] + 1)
        masses.append(
            np.trapezoid(force[contact]) / (9.80665 * np.trapezoid(acceleration[contact]))
        )
    assert all(2.5 <= mass <= 2.8 for mass in masses)
    ours = next(c.ours for c in measured.checks if c.key == "dummy_effective_mass")
    # A sample more or less at an end is 5 % of the peak in 160.
    assert ours == pytest.approx(np.mean(masses), rel=2e-3)


@NEEDED
@pytest.mark.measured
def test_every_test_is_drawn_beside_its_prediction(measured: Part) -> None:
    (figure,) = measured.figures.values()
    for axes in figure.axes:
        assert len(axes.lines) == 6
        assert "[" in axes.get_xlabel() and "[" in axes.get_ylabel()
