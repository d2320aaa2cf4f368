"""Who may import whom: studies -> mcstudy and models; never the other way."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PHYSICS = {"models", "studies"}


def modules(package: str) -> list[Path]:
    found = sorted((ROOT / package).rglob("*.py"))
    assert found
    return found


def imported_packages(path: Path) -> set[str]:
    """Return the top-level packages of all imports of a file, those in functions included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            # A relative import stays within its package.
            found.add(path.relative_to(ROOT).parts[0] if node.level else str(node.module))
    return {name.split(".")[0] for name in found}


def loaded(statement: str) -> set[str]:
    """Return the top-level modules that a fresh interpreter holds after a statement."""
    code = f"import sys\n{statement}\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_the_contracts_of_the_project_hold() -> None:
    command = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([command, "--no-cache"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


@pytest.mark.parametrize("path", modules("mcstudy"), ids=lambda p: str(p.relative_to(ROOT)))
def test_methods_import_neither_models_nor_studies(path: Path) -> None:
    assert not imported_packages(path) & PHYSICS


@pytest.mark.parametrize("path", modules("models"), ids=lambda p: str(p.relative_to(ROOT)))
def test_models_import_neither_methods_nor_studies(path: Path) -> None:
    assert not imported_packages(path) & {"mcstudy", "studies"}


def test_what_the_workers_run_imports_no_tables_and_no_figures() -> None:
    names = loaded("import studies.worker")
    assert "numpy" in names
    assert not names & {"pandas", "pyarrow", "seaborn", "matplotlib", "mcstudy"}


def test_the_command_line_starts_without_physics_or_figures() -> None:
    names = loaded("import studies.cli")
    assert not names & {"numba", "pandas", "pyarrow", "seaborn", "matplotlib", "models"}


def test_methods_load_without_physics_or_figures() -> None:
    methods = (
        "studyfile.study_inputs", "sampling.designs", "studyfile.distributions", "execution.runner",
        "execution.results", "statistics", "text", "units",
    )  # fmt: skip
    names = loaded("import " + ", ".join(f"mcstudy.{name}" for name in methods))
    assert not names & {"numba", "seaborn", "matplotlib", *PHYSICS}
