"""Sentences of a diagnosis."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mcstudy.diagnosis.screening import FLIP_LEVEL
from mcstudy.diagnosis.templates import ALL_TESTS
from mcstudy.figures.style import words
from mcstudy.statistics import Estimate
from mcstudy.text import capital, interval, number, percent, quantity, unit
from mcstudy.typed_json import from_plain

SHOWN_UNITS = {"m": ("mm", 1e3), "rad": ("deg", 57.29577951308232), "m/N": ("mm/kN", 1e6),
               "N/m": ("kN/m", 1e-3), "N": ("kN", 1e-3)}  # fmt: skip
"""Display units of parameters, and their factors."""
SMALL = 100.0
"""N below which a force is shown in N."""

SENTENCES = {
    "hood_bottoming": "The hood hits a structure {clearance} below it.",
    "hood_yield": "The hood yields beyond {force}.",
    "rate_dependent_hood": "The hood is stiffer when struck faster.",
    "hood_inertia": "The hood's own mass, {mass}, is set in motion.",
    "unloading_slope": "The hood's unloading slope is {factor} times the assumed one.",
    "skin_compliance": "The headform's skin has a compliance of {compliance}.",
    "guide_friction": "The guide of the drop rig rubs with {force}.",
    "hood_force_scale": "The forces are {factor} times those of the hood's curve.",
    "sensor_gain": "The accelerometer reads {factor} times the true acceleration.",
    "sensor_offset": "The accelerometer has a zero offset of {offset}.",
    "sensor_saturation": "The accelerometer saturates at {limit}.",
    "sensor_filter": "The signal went through channel frequency class {channel_class}, not the one "
    "stated.",
    "time_scale": "The recorder's clock shows {factor} times the true time.",
    "speed_bias": "The true impact speed is {factor} times the recorded one.",
    "mass_error": "The true mass is {factor} times the recorded one.",
    "wet_road": "Beyond {place} the road is slippery: {factor} of the friction before it.",
    "late_braking": "The car brakes {delay} after first contact.",
    "road_slope": "The road falls by {angle} along the travel.",
    "muscle_tone": "The muscles were tensed: {factor} times the resistance of neck and joints.",
    "friction_level": "The friction of the road is {factor} times the assumed one.",
    "shoulder_compliance": "The shoulder girdle is {factor} times as compliant.",
    "braced_posture": "The person was braced, {share} of the way.",
    "brake_dive": "The nose dives {angle} more than assumed.",
    "restitution": "The road returns {factor} times the assumed energy.",
}


def _shown_unit(name: str, value: float) -> tuple[str, float]:
    """Return the display unit of a value, and its factor."""
    if (name == "m" and abs(value) >= 1.0) or (name == "N" and abs(value) < SMALL):
        return name, 1.0
    return SHOWN_UNITS.get(name, (name, 1.0))


def shown(row: Mapping[str, Any]) -> str:
    """Return a parameter with its interval, in its display unit."""
    name, factor = _shown_unit(row.get("unit", "1"), float(row["value"]))
    value, low, high = (factor * float(row[key]) for key in ("value", "low", "high"))
    half = 0.5 * (high - low)
    return f"{_with_error(value, half) if half > 0.0 else number(value)} {unit(name)}".strip()


def _with_error(value: float, half: float) -> str:
    """Return a value and its half-width, both to the second digit of the latter."""
    digits = 1 - math.floor(math.log10(half))
    if digits <= 0:
        return f"{number(value)} ± {number(half, 2)}"
    return f"{value:,.{digits}f} ± {half:.{digits}f}"


def sentence(cause: str, parameters: Sequence[Mapping[str, Any]], title: str) -> str:
    """Return the sentence of a named cause with its fitted parameters.

    Parameters
    ----------
    cause : str
        Name of the cause.
    parameters : sequence of mapping
        Fitted parameters, as in ``diagnosis.json``.
    title : str
        Title of the cause, used where it has no sentence.
    """
    pattern = SENTENCES.get(cause)
    if pattern is None:
        return f"{capital(title)}."
    return pattern.format(**{row["name"]: shown(row) for row in parameters})


def probability(p: float) -> str:
    """Return a p-value."""
    return "p < 0.001" if p < 0.0015 else f"p = {number(p, 2)}"


def answer(found: Mapping[str, Any]) -> list[str]:
    """Return the answer in a few sentences."""
    p = probability(found["p_value"])
    tests = found["data"]["tests"]
    if found["adequate"]:
        lines = [
            f"The model explains the {tests} tests within their uncertainty ({p}). The minimum "
            "detectable effects follow."
        ]
        if found["flip_p_value"] <= FLIP_LEVEL:
            lines.append(
                "Residuals have the same sign in more tests than by chance "
                f"({probability(found['flip_p_value'])}), but no cause of the catalogue gains from "
                "it: what is common lies within the uncertainty of each test."
            )
        return lines
    lines = [f"The model does not explain the {tests} tests ({p})."]
    titles = found["titles"]
    if found["cause"] == "unexplained":
        lines.append(f"No cause of the catalogue explains it: {found['why']}.")
        if found["drift"]["log_evidence"] > 3.0:
            lines.append(f"Check for a drift: {_drift(found['drift']['name'])}.")
        return lines + _bound_words(found)
    parameters = found["parameters"]
    lines += [sentence(cause, rows, titles[cause]) for cause, rows in parameters.items()]
    lines += [trend_words(row) for row in found["trends"].values()]
    if found["ambiguous"]:
        others = [titles[name] for name in found["ambiguous"] if name != found["cause"]]
        lines.append(
            f"But the data cannot distinguish this from: {'; '.join(others)}. To separate them: "
            f"{found['separated_by'][found['cause']]}."
        )
    if found["second_ambiguous"]:
        names = [titles[n] for n in found["second_ambiguous"] if n != found["second_cause"]]
        lines.append(f"The second cause is indistinguishable from: {'; '.join(names)}.")
    if found["flagged"]:
        lines.append("A misfit remains that these causes do not explain.")
    return lines + _bound_words(found)


def _bound_words(found: Mapping[str, Any]) -> list[str]:
    """Return a sentence on a repeatability at its upper bound, if it is there."""
    if not found["scatter"]["at_bound"]:
        return []
    return [
        "The repeatability from test to test reached its upper bound of 20 %: tests of one set-up "
        "do not repeat, or the model is wrong in a way that differs from test to test."
    ]


def trend_words(row: Mapping[str, Any]) -> str:
    """Return a sentence on a parameter that changes along a covariate."""
    name, factor = _shown_unit(row["unit"], max(abs(row["first"]), abs(row["last"])))
    first, last = (number(factor * row[key]) for key in ("first", "last"))
    along = "the order of the tests" if row["covariate"] == "order" else words(row["covariate"])
    return (
        f"It is not the same in all tests: {words(row['parameter'])} goes from {first} to {last} "
        f"{unit(name)}".strip()
        + f" along {along}."
    )


def _drift(name: str) -> str:
    nuisance, _, covariate = name.partition(" with ")
    kind, _, channel = nuisance.partition(":")
    what = {"pulse": "the pulse", "offset": f"the offset of {words(channel)}",
            "time_origin": "the time origin", "scatter": words(channel)}  # fmt: skip
    if covariate == ALL_TESTS:
        return f"{what.get(kind, words(nuisance))} is off by the same in all tests"
    along = "the order of the tests" if covariate == "order" else words(covariate)
    return f"{what.get(kind, words(nuisance))} changes with {along}"


def location(where: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Return a sentence on the location of the misfit."""
    region = where["largest"]
    more = "above" if region["z"] > 0.0 else "below"
    when = ""
    if region["end"] > region["begin"] and region["channel"] in units:
        when = f" from {1e3 * region['begin']:.1f} to {1e3 * region['end']:.1f} ms of the pulse"
    tests = ""
    if where["regime"]:
        low, high = region["low"], region["high"]
        tests = f", tests with {words(where['regime'])} {number(low)} to {number(high)}"
        tests += " m/s" if where["regime"] == "impact_speed" else ""
    return (
        f"Measured and simulated differ most in {words(region['channel'])}{when}{tests}: measured "
        f"lies {100.0 * abs(region['size']):.1f} % of the peak {more} simulated "
        f"({abs(region['z']):.1f} standard errors)."
    )


def gain_words(gains: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return sentences on the gain of the extension on held-out tests."""
    lines = []
    scores = dict.fromkeys(g["score"] for g in gains if g["score"].startswith("crps_"))
    for score in scores:
        name = words(score.removeprefix("crps_"))
        for entry in gains:
            if entry["score"] != score or not entry["base"]:
                continue
            d = {key: 100.0 * value for key, value in entry["relative"].items()}
            better = d["value"] >= 0.0
            low, high = sorted((abs(d["low"]), abs(d["high"])))
            if d["low"] < 0.0 < d["high"]:
                spread = f"{d['low']:.0f} to {d['high']:.0f} %: consistent with zero"
            else:
                spread = f"{low:.0f} to {high:.0f} %"
            lines.append(
                f"{capital(entry['region'])} the tested speeds, predictions of {name} are "
                f"{abs(d['value']):.0f} % {'better' if better else 'worse'} (CRPS, {spread})."
            )
    return lines


def conclusion_words(found: Mapping[str, Any] | None) -> list[str]:
    """Return sentences on the effect of the extension on the study's conclusions."""
    if found is None:
        return []
    base, extended = found["base"], found["extended"]
    limit = f"{base['limit']:g}"

    def first(part: Mapping[str, Any]) -> str:
        return words(max(part["drivers"], key=lambda n: part["drivers"][n]["value"]))

    def known(key: str) -> tuple[Estimate, Estimate]:
        return from_plain(Estimate, base[key]), from_plain(Estimate, extended[key])

    exceedance, median = map(percent, known("exceedance")), map(interval, known("median"))
    return [
        "P(HIC15 > {}): {} with the base model, {} with the extended model; ".format(
            limit, *exceedance
        )
        + "median HIC15 {} and {}.".format(*median),
        f"Most influential input on HIC15: {first(base)} before, {first(extended)} after.",
    ]


def visible_words(entry: Mapping[str, Any]) -> str:
    """Return the minimum detectable effect of a cause."""
    value, none = entry["value"], entry["none"]
    if value is None:
        return "no size within the prior"
    name, factor = _shown_unit(entry["unit"], float(value))
    if none == 1.0 and entry["unit"] == "1":
        return f"{100.0 * abs(value - 1.0):.2g} %"
    return quantity(factor * value, name)
