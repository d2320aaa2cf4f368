"""Before anything runs in parallel: compile once, so that no worker compiles what another does."""

import pytest


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels of every model in the process that starts the workers."""
    if getattr(session.config.option, "numprocesses", None):
        from models.registry import load_model, model_names

        for name in model_names():
            model = load_model(name)
            # A crash of minutes is for the slow tier.
            if model.cost < 10.0:
                model.run({})
