"""The report of a diagnosis."""

from collections.abc import Mapping
from typing import Any

from mcstudy.figures import diagnosis as figures_of
from mcstudy.figures import style
from mcstudy.report import Section, Table
from mcstudy.text import number
from models.registry import load_model
from studies.diagnosis import words

SCORES = {
    "crps_hic15": "CRPS of HIC15",
    "rmse_hic15": "RMSE of HIC15",
    "crps_peak_head_acceleration": "CRPS of the peak",
    "rmse_head_acceleration": "RMSE of the pulse",
    "rmse_hood_force": "RMSE of the force",
}
SIGNAL_UNITS = {
    "head_acceleration": "g",
    "hood_force": "N",
    "hood_penetration": "m",
    "head_angular_velocity": "rad/s",
}


def subtitle_of(answer: Mapping[str, Any]) -> str:
    """Return the subtitle of a report."""
    data = answer["data"]
    return f"{data['tests']} tests against the {data['model']} model"


def draw(analysis: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a diagnosis by file name."""
    figures: dict[str, Any] = {}
    pictures = analysis["pictures"]
    for name, curves in pictures["signals"].items():
        label = style.label(name, SIGNAL_UNITS.get(name, "1"))
        figures[f"pulses_{name}"] = figures_of.draw_pulses(curves, label)
    labels = {name: style.words(name) for name in pictures["signals"]}
    regime = analysis["where"]["regime"]
    if labels:
        unit = "m/s" if regime == "impact_speed" else "1"
        figures["where"] = figures_of.draw_map(
            analysis["where"], labels, style.label(regime, unit) if regime else "tests"
        )
    if any(pictures["scalars"].values()):
        outputs = {item.name: item.unit for item in load_model(analysis["data"]["model"]).outputs}
        names = {name: style.label(name, outputs.get(name, "1")) for name in pictures["scalars"]}
        figures["scalars"] = figures_of.draw_scalars(pictures["scalars"], names)
    if analysis["effects"]:
        figures["evidence"] = figures_of.draw_evidence(analysis["effects"])
    known = _scores(analysis)
    if any(g["score"] in known for g in analysis["gain"]):
        figures["gain"] = figures_of.draw_gain(analysis["gain"], known)
    if analysis["conclusions"]:
        parts = analysis["conclusions"]
        figures["conclusions"] = figures_of.draw_conclusions(
            parts["base"], parts["extended"], style.label("hic15")
        )
    return figures


def _scores(analysis: Mapping[str, Any]) -> dict[str, str]:
    found = dict(SCORES)
    for name in analysis["pictures"]["scalars"]:
        found.setdefault(f"crps_{name}", f"CRPS of {style.words(name)}")
    return found


def sections_of(analysis: Mapping[str, Any], figures: Mapping[str, Any]) -> list[Section]:
    """Return the sections of the report."""
    sections = [Section("Findings", summarise(analysis), [])]
    captions = {
        f"Measured and simulated {style.words(name)}: each test as recorded, with 95 % bands of "
        "its uncertain inputs.": figures[f"pulses_{name}"]
        for name in analysis["pictures"]["signals"]
    }
    if "scalars" in figures:
        captions["Measured against simulated scalars."] = figures["scalars"]
    if "where" in figures:
        captions["Residuals of measured and simulated, with all uncertainties fitted."] = figures[
            "where"
        ]
    place = words.location(analysis["where"], SIGNAL_UNITS)
    sections.append(Section("Where", [place], [], captions))
    if analysis["effects"]:
        sections.append(_why(analysis, figures))
    if analysis["gain"]:
        sections.append(_gain(analysis, figures))
    sections.append(_visible(analysis))
    sections.append(Section("Method", _method(analysis), [_statistics(analysis)]))
    if analysis["data"].get("notes"):
        sections.append(Section("Notes on the data", analysis["data"]["notes"]))
    return sections


def summarise(analysis: Mapping[str, Any]) -> list[str]:
    """Return the answer in sentences."""
    lines = words.answer(analysis)
    lines += words.gain_words(analysis["gain"])
    lines += words.conclusion_words(analysis["conclusions"])
    if analysis["model"]["extended"]:
        lines.append(
            f"The extended model is in {analysis['model']['extended']}; 'mcstudy run' takes it."
        )
    for name, share in analysis["cut"].items():
        lines.append(
            f"{100.0 * share:.1f} % of the posterior of {style.words(name)} lies outside the range "
            "of the model and is cut off in the extended model."
        )
    if analysis["worth"]:
        lines.append(_best_extra(analysis))
    return lines


def _best_extra(analysis: Mapping[str, Any]) -> str:
    best = analysis["worth"][0]
    if analysis["ambiguous"] and best["separation"] is not None:
        return (
            f"Most informative measurement to add: {best['title']}; the named causes would "
            f"differ by {number(best['separation'], 2)} log units."
        )
    return (
        f"Most informative measurement to add: {best['title']}; it would make causes "
        f"{number(best['visibility'], 2)} times as detectable, on average over the catalogue."
    )


def _why(analysis: Mapping[str, Any], figures: Mapping[str, Any]) -> Section:
    rows = []
    for row in analysis["effects"]:
        values = ", ".join(
            f"{p['name'].replace('_', ' ')} {words.shown(p)}"
            for p in row["parameters"]
            if not p["fixed"]
        )
        rows.append(
            [row["name"].replace("_", " "), number(row["log_evidence"]), row["form"], values]
        )
    table = Table(
        "Causes by evidence; parameters of the best form with 95 % half-widths.",
        ["cause", "log evidence", "best form", "parameters"],
        rows,
    )
    lines = [
        "Every cause of the catalogue was scanned over its prior, in each of its forms; the "
        "competitive ones were fitted with all uncertain inputs. Log evidence is relative to the "
        "base model, in natural log units, averaged over the forms of a cause. Causes within 3 log "
        "units of the best are indistinguishable; below 3 log units no cause is named."
    ]
    behind = [
        n for n in analysis["titles"] if n not in {row["name"] for row in analysis["effects"]}
    ]
    if behind:
        names = ", ".join(name.replace("_", " ") for name in behind)
        lines.append(f"Much less likely, or without effect on the measurements: {names}.")
    left = analysis["remainder"]
    if left is not None:
        lines.append(
            f"The named causes explain {100.0 * left['share']:.0f} % of the misfit; the "
            f"remaining misfit has {words.probability(left['p_value'])}."
        )
    return Section(
        "Candidate causes", lines, [table], {"Evidence of each cause.": figures["evidence"]}
    )


def _gain(analysis: Mapping[str, Any], figures: Mapping[str, Any]) -> Section:
    rows = []
    for g in analysis["gain"]:
        d = g["difference"]
        rows.append(
            [g["score"].replace("_", " "), g["region"], number(g["base"]), number(g["extended"]),
             number(g["gaussian_process"]),
             f"{number(d['value'])} ({number(d['low'])} to {number(d['high'])})"]
        )  # fmt: skip
    table = Table(
        "Scores of held-out tests, with 95 % intervals of the gain.",
        ["score", "region", "base", "extended", "process", "better than base"],
        rows,
    )
    shown = {}
    if "gain" in figures:
        shown["Gain on held-out tests, with 95 % intervals."] = figures["gain"]
    if "conclusions" in figures:
        shown["Effect of the extension on the study's conclusions."] = figures["conclusions"]
    lines = [
        "Whole tests were held out, a sixth at a time (inside), and the fastest and the slowest "
        "fifth at once (above, below). The Gaussian process corrects the base model without naming "
        "a cause. Log score and coverage (share of tests within the 90 % intervals) are better "
        "when larger, all others when smaller; intervals are of a paired bootstrap over tests."
    ]
    return Section("Predictive gain of the extension", lines, [table], shown)


def _visible(analysis: Mapping[str, Any]) -> Section:
    rows = [
        [e["cause"].replace("_", " "), e["parameter"].replace("_", " "), words.visible_words(e)]
        for e in analysis["visible"]
    ]
    tables = [
        Table(
            "Minimum detectable effect of each cause with 80 % power.",
            ["cause", "parameter", "minimum detectable"],
            rows,
        )
    ]
    if analysis["worth"]:
        tables.append(
            Table(
                "Value of information of further measurements.",
                ["measurement", "separation [log units]", "detectability factor"],
                [[w["title"], number(w["separation"], 2), number(w["visibility"], 3)]
                 for w in analysis["worth"]],
            )
        )  # fmt: skip
    return Section("Minimum detectable effects", [], tables)


def _statistics(analysis: Mapping[str, Any]) -> Table:
    rows = [
        [name, number(entry["value"]), number(entry["p_value"], 2)]
        for name, entry in analysis["statistics"].items()
    ]
    return Table(
        "Four statistics of misfit.",
        ["kind of misfit", "statistic", "p-value"],
        rows,
    )


def _method(analysis: Mapping[str, Any]) -> list[str]:
    r = analysis["repeatability"]
    return [
        "The fit includes all uncertainties: shared unknowns, recorded inputs within their "
        "uncertainty, time origin and offset of each test, and the test-to-test repeatability of "
        f"the pulse ({100.0 * r['level']:.1f} % of its level, "
        f"{100.0 * r['shape']:.1f} % of its shape).",
        "Four statistics test for misfit; the smallest of their p-values is calibrated on data "
        "simulated with the model.",
        "With sign flips of whole tests instead of a covariance, the catalogue's p-value is "
        f"{number(analysis['flip_p_value'], 2)}; it cannot be small where few tests carry the "
        "misfit.",
    ]


def table_of(analysis: Mapping[str, Any]) -> list[Table]:
    """Return the tables that the command line prints after the sentences."""
    if not analysis["effects"]:
        return [_visible(analysis).tables[0]]
    return [
        Table(
            "Causes by evidence",
            ["cause", "log evidence", "form"],
            [[e["name"], number(e["log_evidence"]), e["form"]] for e in analysis["effects"][:6]],
        )
    ]
