"""What tests of studies share; a test module may have its own instead."""

from collections.abc import Iterator

import pytest
from headform_studies import by_formula, without_figures


@pytest.fixture
def undrawn() -> Iterator[None]:
    """Leave the figures out."""
    with without_figures():
        yield


@pytest.fixture
def fast(undrawn: None) -> Iterator[None]:
    """Leave the figures out and run by formula."""
    with by_formula():
        yield
