"""The split of a difference between models, against closed forms and against all orders by hand."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcstudy.attribution import find_steps, split_difference

NAMES = "abcd"


def subsets(names: str) -> list[frozenset[str]]:
    return [frozenset(c) for k in range(len(names) + 1) for c in itertools.combinations(names, k)]


def shares_of(changes: list[frozenset[str]], values: dict[frozenset[str], float]) -> dict:
    table = np.array([[values[held]] * 3 for held in changes])
    labels = ["".join(sorted(held)) or "none" for held in changes]
    split = split_difference(table, labels, find_steps(changes), 1)
    return {name: entry.value for name, entry in split.shares.items()}


def test_two_things_that_interact_share_the_interaction() -> None:
    """1 and 2 alone, 7 together: the interaction of 4 goes to both alike."""
    values = {frozenset(): 10.0, frozenset("a"): 11.0, frozenset("b"): 12.0, frozenset("ab"): 17.0}
    assert shares_of(list(values), values) == pytest.approx({"a": 3.0, "b": 4.0})


def test_a_thing_that_needs_another_comes_after_it() -> None:
    """Load needs facets, so the only orders are f l c, f c l and c f l."""
    held = ["", "f", "c", "fl", "fc", "fcl"]
    values = dict(zip(map(frozenset, held), (0.0, 1.0, 5.0, 3.0, 7.0, 12.0), strict=True))
    found = shares_of(list(values), values)
    assert found["f"] == pytest.approx((1.0 + 1.0 + 2.0) / 3.0)
    assert found["l"] == pytest.approx((2.0 + 5.0 + 5.0) / 3.0)
    assert found["c"] == pytest.approx((9.0 + 6.0 + 5.0) / 3.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.sets(st.sampled_from(subsets(NAMES)), max_size=14))
def test_shares_are_means_over_the_orders_that_the_models_allow(
    seed: int, some: set[frozenset[str]]
) -> None:
    changes = list({*some, frozenset(), frozenset(NAMES)})
    orders = []
    for order in itertools.permutations(NAMES):
        way = [frozenset(order[:k]) for k in range(len(NAMES) + 1)]
        if all(held in changes for held in way):
            orders.append(way)
    used = {held for way in orders for held in way}
    if used != set(changes):
        with pytest.raises(ValueError, match="no way of single changes"):
            find_steps(changes)
        return
    values = dict(zip(changes, np.random.default_rng(seed).normal(size=len(changes)), strict=True))
    by_hand = {
        name: np.mean([
            next(values[b] - values[a] for a, b in itertools.pairwise(way) if b - a == {name})
            for way in orders
        ])
        for name in NAMES
    }  # fmt: skip
    found = shares_of(changes, values)
    assert found == pytest.approx(by_hand)
    assert sum(found.values()) == pytest.approx(values[frozenset(NAMES)] - values[frozenset()])
    weights = find_steps(changes)
    for name in NAMES:
        assert sum(step.weight for step in weights if step.change == name) == pytest.approx(1.0)


def test_a_dear_model_with_fewer_draws_is_compared_on_those() -> None:
    rng = np.random.default_rng(3)
    base = rng.normal(50.0, 20.0, 400)
    values = np.stack([base, base + 3.0, base + 3.0 + rng.normal(4.0, 1.0, 400)])
    values[2, 60:] = np.nan
    changes = [frozenset(), frozenset("a"), frozenset("ab")]
    split = split_difference(values, ["x", "y", "z"], find_steps(changes), 5)
    assert [step.pairs for step in split.steps] == [400, 60]
    assert split.shares["a"].high - split.shares["a"].low < 1e-9
    assert split.shares["b"].value == pytest.approx(4.0, abs=0.5)
    # The scatter of the draws themselves is in none of the steps.
    assert split.shares["b"].high - split.shares["b"].low < 0.8
    assert split.base.value == pytest.approx(base.mean())


def test_intervals_cover_the_true_share() -> None:
    inside = 0
    changes = [frozenset(), frozenset("a"), frozenset("b"), frozenset("ab")]
    steps = find_steps(changes)
    for seed in range(200):
        rng = np.random.default_rng(seed)
        base = rng.normal(0.0, 5.0, 80)
        a, b, both = (rng.normal(mean, 1.0, 80) for mean in (1.0, 2.0, 4.0))
        values = np.stack([base, base + a, base + b, base + a + b + both])
        share = split_difference(values, list("wxyz"), steps, seed).shares["a"]
        inside += share.low <= 3.0 <= share.high
    assert 0.9 <= inside / 200 <= 0.985


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["", "a", "a"], "the same changes"),
        (["a", "ab"], "without changes"),
        (["", "a", "b"], "no model has all the changes: a, b"),
        (["", "a", "b", "ab", "abcd"], "lies on no way of single changes"),
    ],
)
def test_models_without_a_way_between_them_are_refused(changes: list[str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        find_steps([frozenset(held) for held in changes])


def test_neighbours_without_common_runs_are_refused() -> None:
    values = np.array([[1.0, 2.0, np.nan], [np.nan, 1.0, 2.0]])
    with pytest.raises(ValueError, match="fewer than two runs in common"):
        split_difference(values, ["x", "y"], find_steps([frozenset(), frozenset("a")]), 0)
