"""The command line: exit codes, one-line errors, JSON, resume."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SMALL = (
    Path("configs/paper_study.toml")
    .read_text()
    .replace("n = 2000", "n = 12")
    .replace("replicate_size = 200 ", "replicate_size = 4 ")
    .replace("histories = 8", "histories = 0")
)


def mcstudy(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "studies.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_reconstruct_prints_the_tables(tmp_path: Path) -> None:
    result = mcstudy("reconstruct", "configs/paper_case.toml", "--out", tmp_path / "case")
    assert result.returncode == 0, result.stderr
    assert "MBS model" in result.stdout
    assert "this run" in result.stdout
    outputs = json.loads((tmp_path / "case" / "analysis.json").read_text())["outputs"]
    shown = json.loads(
        mcstudy("reconstruct", "configs/paper_case.toml", "--out", tmp_path / "c", "--json").stdout
    )
    assert shown == outputs | {"status": "ok"}


def test_run_status_report_and_resume(tmp_path: Path) -> None:
    study, out = tmp_path / "small.toml", tmp_path / "out"
    study.write_text(SMALL)
    first = mcstudy("run", study, "--out", out, "--workers", "2", "--json")
    assert first.returncode == 0, first.stderr
    analysis = json.loads(first.stdout)["analysis"]
    assert analysis["runs"] == 12
    status = json.loads(mcstudy("status", out, "--json").stdout)
    assert status["done"] == status["total"] == 12
    again = mcstudy("run", study, "--out", out, "--json")
    assert json.loads(again.stdout)["analysis"] == analysis
    rebuilt = mcstudy("report", out)
    assert rebuilt.returncode == 0
    assert "12 runs" in rebuilt.stdout


def test_modules_of_the_users_own_in_the_working_folder_are_not_imported(tmp_path: Path) -> None:
    # Workers look for modules in the folder that the study is run from.
    for name in ("signal", "random", "statistics"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('not this one')")
    (tmp_path / "small.toml").write_text(SMALL)
    done = subprocess.run(
        [Path(sys.executable).parent / "mcstudy", "run", "small.toml", "--out", "out", "--quiet",
         "--workers", "2"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_an_interrupt_is_told_and_the_same_command_resumes(tmp_path: Path) -> None:
    study, out = tmp_path / "small.toml", tmp_path / "out"
    study.write_text(SMALL.replace("n = 12", "n = 400"))
    command = [sys.executable, "-m", "studies.cli", "run", study, "--out", out, "--workers", "2"]
    # Started with the default handler: a shell's background jobs ignore the signal.
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    until = time.monotonic() + 120.0
    while not list(out.glob("parts/*.parquet")) and time.monotonic() < until:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "run the same command again to resume" in errors
    done = json.loads(mcstudy("status", out, "--json").stdout)["done"]
    assert 0 < done < 400
    study.write_text(SMALL.replace("n = 12", f"n = {4 * (done // 4 + 1)}"))
    assert mcstudy("run", study, "--out", out, "--quiet").returncode == 0
    assert json.loads(mcstudy("status", out, "--json").stdout)["done"] >= done


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("n = 12", "n = 0"), "design.n"),
        (('unit = "km/h"', 'unit = "kg"'), "inputs.impact_speed.unit: unit 'kg' measures mass"),
        (('name = "multibody"', 'name = "multibod"'), "model: unknown model 'multibod'"),
        (('vehicle = "family_car_1990s"', 'vehicle = "tank"'), "model: no vehicle 'tank'"),
        (("seed = 2004", "sede = 2004"), "sede: unknown key"),
        (('distribution = "normal"', 'distribution = "gauss"'), "inputs.impact_speed"),
        (("sd = 2.0", "sd = -2.0"), "inputs.impact_speed.sd"),
    ],
)
def test_bad_files_get_one_line_and_no_folder(
    tmp_path: Path, edit: tuple[str, str], message: str
) -> None:
    study, out = tmp_path / "bad.toml", tmp_path / "out"
    text = SMALL.replace(*edit, 1)
    assert text != SMALL
    study.write_text(text)
    result = mcstudy("run", study, "--out", out)
    assert result.returncode == 2
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not out.exists()


def test_a_missing_file_an_unknown_option_and_a_wrong_kind_are_user_errors(tmp_path: Path) -> None:
    assert mcstudy("run", tmp_path / "none.toml").returncode == 2
    assert mcstudy("run", "configs/paper_study.toml", "--wokers", "2").returncode == 2
    wrong = mcstudy("run", "configs/paper_case.toml")
    assert wrong.returncode == 2
    assert "mcstudy reconstruct" in wrong.stderr
    assert mcstudy("status", tmp_path).returncode == 2


def test_models_lists_inputs_with_units() -> None:
    assert "multibody" in mcstudy("models").stdout
    described = json.loads(mcstudy("models", "multibody", "--json").stdout)
    speed = next(item for item in described["inputs"] if item["name"] == "impact_speed")
    assert speed["unit"] == "m/s"
    assert mcstudy("models", "nope").returncode == 2
