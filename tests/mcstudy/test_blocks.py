"""Blocks of a design: whole or lost, output by output."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mcstudy_tools import Flags, quiet
from numpy.testing import assert_array_equal

from mcstudy.sensitivity.blocks import (
    MAX_DROPPED,
    MIN_BLOCKS,
    is_enough,
    outputs_alike,
    whole_blocks,
)


@quiet(50)
@given(st.data(), st.integers(1, 6), st.integers(1, 8), st.integers(1, 4))
def test_a_block_is_kept_for_an_output_if_its_runs_and_their_values_are_good(
    data: st.DataObject, n: int, block: int, m: int
) -> None:
    # A failed run may leave a value behind: it counts no more than the others of its block.
    complete = data.draw(hnp.arrays(bool, n * block))
    values = st.sampled_from([0.0, 1.0, 2.0, np.nan, np.inf, -np.inf])
    outputs = data.draw(hnp.arrays(float, (n * block, m), elements=values))
    cube, kept = whole_blocks(outputs, complete, block)
    assert (cube.shape, kept.shape) == ((n, block, m), (n, m))
    for k in range(n):
        rows = slice(k * block, (k + 1) * block)
        assert_array_equal(cube[k], outputs[rows])
        for j in range(m):
            assert kept[k, j] == (complete[rows].all() and np.isfinite(outputs[rows, j]).all())


@pytest.mark.parametrize(("kept", "of", "enough"), [
    (8, 8, True), (7, 7, False), (7, 8, False), (8, 10, True), (8, 11, False), (80, 100, True),
    (79, 100, False), (820, 1024, True), (819, 1024, False), (0, 0, False), (0, 100, False),
])  # fmt: skip
def test_eight_blocks_and_four_fifths_are_enough(kept: int, of: int, enough: bool) -> None:
    # The two assumptions of the module: at most a fifth dropped, at least eight left.
    assert (MAX_DROPPED, MIN_BLOCKS) == (0.2, 8)
    assert is_enough(np.arange(of) < kept) is enough
    assert is_enough(np.arange(of) >= of - kept) is enough


def test_exactly_a_fifth_may_be_dropped_whatever_the_rounding() -> None:
    for n in range(10, 5000, 5):
        assert is_enough(np.arange(n) < n // 5 * 4)
        assert not is_enough(np.arange(n) < n // 5 * 4 - 1)


@quiet(50)
@given(hnp.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 6)), elements=st.booleans()))
def test_every_output_comes_once_with_those_of_equal_blocks(kept: Flags) -> None:
    seen, patterns = [], set()
    for pattern, columns in outputs_alike(kept):
        assert columns.size > 0
        assert tuple(pattern) not in patterns
        patterns.add(tuple(pattern))
        seen += columns.tolist()
        assert_array_equal(kept[:, columns], np.tile(pattern[:, None], columns.size))
    assert sorted(seen) == list(range(kept.shape[1]))
