PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install docs study diagnose-demo case test test-slow check benchmark gallery calibrate headform-chain lock clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 24

$(INSTALLED): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "mcstudy needs Python 3.11 or newer: make PYTHON=python3.12 ...")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --only-binary :all: -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

install: $(INSTALLED)  ## install everything, locked, into .venv

study: install  ## run the main job: the nominal case and the Monte Carlo study of it
	$(BIN)/mcstudy reconstruct configs/paper_case.toml
	$(BIN)/mcstudy run configs/paper_study.toml

diagnose-demo: install  ## hide an effect in tests, find it, extend the model, run the injury study again
	$(BIN)/python -m scripts.diagnosis_demo

case: install  ## run the nominal case only
	$(BIN)/mcstudy reconstruct configs/paper_case.toml

test: install  ## run the tests, on all cores
	$(BIN)/python -m pytest -n auto --dist loadfile

test-slow: install  ## run the slow tier of the tests
	$(BIN)/python -m pytest -n auto --dist loadfile -m slow

check: install  ## ruff, mypy and the import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: install  ## run all commands of the manual and build it, with its figures
	$(BIN)/python -m scripts.manual

benchmark: install  ## time a step and a crash, ours and MuJoCo's, in one run
	$(BIN)/python -m pytest tests/benchmarks --benchmark-enable --benchmark-only -s

gallery: install  ## remake the pictures of the README from the real study
	$(BIN)/python -m scripts.gallery

calibrate: install  ## calibrate to the case's tables again and print the values
	$(BIN)/python -m scripts.paper_calibration

headform-chain: install  ## the headform test on finite elements, its fitted curve in the other models
	$(BIN)/python -m scripts.headform_chain

lock: install  ## lock the newest versions that pyproject.toml allows
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip compile --universal --python-version 3.11 --extra dev --extra docs --extra cluster --no-annotate --no-header --quiet --upgrade pyproject.toml --output-file requirements.lock

clean:  ## remove .venv, caches and results (not the gallery)
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info build
	find results -mindepth 1 -maxdepth 1 ! -name README.md ! -name gallery -exec rm -rf {} +
