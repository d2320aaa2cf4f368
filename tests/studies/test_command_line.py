"""The command line as a process of its own, and what it says of wrong commands."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

from headform_studies import mcstudy, study_text, told, without_figures

CRASHES = (
    Path("configs/paper_study.toml")
    .read_text()
    .replace("n = 2000", "n = 400")
    .replace("replicate_size = 200 ", "replicate_size = 4 ")
    .replace("histories = 8", "histories = 0")
)


def test_modules_of_the_users_own_in_the_working_folder_are_not_imported(tmp_path: Path) -> None:
    # Workers look for modules in the folder that the study is run from.
    for name in ("signal", "random", "statistics"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('not this one')")
    (tmp_path / "small.toml").write_text(study_text("morris", "n = 10", outputs=("hic15",)))
    done = subprocess.run(
        [Path(sys.executable).parent / "mcstudy", "run", "small.toml", "--out", "out", "--quiet",
         "--workers", "2"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_an_interrupt_is_told_and_the_same_command_resumes(tmp_path: Path) -> None:
    study, out = tmp_path / "small.toml", tmp_path / "out"
    study.write_text(CRASHES)
    command = [sys.executable, "-m", "studies.cli", "run", study, "--out", out, "--workers", "2"]
    # Started with the default handler: a shell's background jobs ignore the signal.
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    until = time.monotonic() + 300.0
    while not list(out.glob("parts/*.parquet")) and time.monotonic() < until:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "run the same command again to resume" in errors
    done = json.loads(mcstudy("status", out, "--json").out)["done"]
    assert 0 < done < 400
    study.write_text(CRASHES.replace("n = 400", f"n = {4 * (done // 4 + 1)}"))
    with without_figures():
        answer = mcstudy("run", study, "--out", out, "--workers", "1", "--quiet")
    assert (answer.code, answer.out, answer.err) == (0, "", "")
    assert json.loads(mcstudy("status", out, "--json").out)["done"] >= done


def test_wrong_commands_are_told_in_one_line(tmp_path: Path) -> None:
    study = Path("configs/paper_study.toml")
    tank = tmp_path / "tank.toml"
    tank.write_text(CRASHES.replace('vehicle = "family_car_1990s"', 'vehicle = "tank"'))
    for command, message in {
        ("run", tmp_path / "none.toml"): "none.toml",
        ("run", tank, "--out", tmp_path / "out"): "model: no vehicle 'tank'",
        ("run", study, "--wokers", "2"): "--wokers",
        ("run", study, "--workers", "0"): "--workers must be 1 or more",
        ("run", "configs/paper_case.toml"): "mcstudy reconstruct",
        ("reconstruct", study, "--out", tmp_path / "out"): "mcstudy run",
        ("status", tmp_path): str(tmp_path),
        ("report", tmp_path): str(tmp_path),
        ("models", "nope"): "nope",
    }.items():
        assert message in told(mcstudy(*command))
    assert [path.name for path in tmp_path.iterdir()] == ["tank.toml"]


def test_models_lists_inputs_with_units_and_what_a_model_ignores() -> None:
    assert "multibody" in mcstudy("models").out.splitlines()
    for name, marked in (("planar", 2), ("multibody", 0)):
        rows = json.loads(mcstudy("models", name, "--json").out)["inputs"]
        assert next(row for row in rows if row["name"] == "impact_speed")["unit"] == "m/s"
        assert sum(bool(row.get("ignored")) for row in rows) == marked
    assert "impact_speed" in mcstudy("models", "planar").out
