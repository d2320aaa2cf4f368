"""A likelihood ratio in words.

Scales of words differ between sources, so the number comes first and the scale is named.
"""

import math

from mcstudy.posterior.ratio import Ratio

SCALE = "verbal scale of the ENFSI guideline for evaluative reporting, 2015 [recalled]"
_WORDS = (
    (2.0, "does not support one proposition over the other"),
    (10.0, "weak support"),
    (100.0, "moderate support"),
    (1000.0, "moderately strong support"),
    (10_000.0, "strong support"),
    (1_000_000.0, "very strong support"),
    (math.inf, "extremely strong support"),
)
"""Ratio below which each word applies."""


def in_words(ratio: Ratio) -> str:
    """Return the words of a ratio, for the proposition or for its negation.

    Parameters
    ----------
    ratio : Ratio
    """
    value = ratio.ratio.value if ratio.resolved else ratio.bound
    size = value if value >= 1.0 else 1.0 / value
    words = next(words for limit, words in _WORDS if size < limit)
    if size < _WORDS[0][0]:
        return words
    least = "" if ratio.resolved else "at least "
    return f"{least}{words} for {'the proposition' if value >= 1.0 else 'its negation'}"
