"""Study files: what is accepted, what is refused with one line, what counts as the same study."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_simulator import STUDY, FakeSimulator, edited
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcstudy.errors import UserError
from mcstudy.studyfile.config import (
    MonteCarloStudy,
    Reconstruction,
    Study,
    check_outputs,
    fixed_values,
    hash_of,
    load_study,
    numbers_digest,
    parse_study,
    sample_inputs,
)
from models.registry import load_model

ROOT = Path(__file__).parents[2]
MODEL = FakeSimulator()
QUIET = settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=250,
    suppress_health_check=[HealthCheck.too_slow],
)


def monte_carlo(text: str) -> MonteCarloStudy:
    study = parse_study(text)
    assert isinstance(study, MonteCarloStudy)
    return study


def use(text: str) -> dict[str, np.ndarray]:
    """Do with a text what a run does before it starts."""
    study = monte_carlo(text)
    check_outputs(study.report.outputs, MODEL, "report.outputs")
    return sample_inputs(study, MODEL)


def complaint(text: str) -> str:
    with pytest.raises(UserError) as caught:
        use(text)
    return str(caught.value)


# -- good files ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "kind"), [("paper_study", MonteCarloStudy), ("paper_case", Reconstruction)]
)
def test_shipped_study_files_load_and_fit_their_model(name: str, kind: type[Study]) -> None:
    study = load_study(ROOT / "configs" / f"{name}.toml")
    assert isinstance(study, kind)
    assert study.name == name
    model = load_model(study.model.name, study.model.options)
    fixed = fixed_values(study, model)
    if isinstance(study, Reconstruction):
        assert fixed["impact_speed"] == pytest.approx(100.0 / 9.0)
        assert fixed["dive_angle"] == pytest.approx(math.radians(2.0))
        for table in study.tables:
            check_outputs(list(table.units), model, table.title)
        return
    columns = sample_inputs(study, model)
    assert list(columns) == [item.name for item in model.inputs]
    for item in model.inputs:
        assert columns[item.name].shape == (2000,)
        assert np.all((columns[item.name] >= item.low) & (columns[item.name] <= item.high))
    check_outputs(study.report.outputs, model, "report.outputs")


def test_columns_are_in_the_models_units_and_order() -> None:
    columns = use(STUDY)
    assert list(columns) == [item.name for item in MODEL.inputs]
    assert all(values.shape == (40,) for values in columns.values())
    assert np.all((columns["impact_speed"] > 10.0) & (columns["impact_speed"] < 48.0 / 3.6))
    angle = columns["facing_angle"]
    assert np.all((angle > math.pi / 3.0) & (angle < 2.0 * math.pi / 3.0))
    # Both replicates of twenty have a sample in each twentieth of the range.
    strata = np.floor((angle - math.pi / 3.0) / (math.pi / 60.0)).astype(int).reshape(2, 20)
    np.testing.assert_array_equal(np.sort(strata, axis=1), [range(20), range(20)])
    assert np.all((columns["stature"] > 1.10) & (columns["stature"] < 1.35))
    np.testing.assert_array_equal(columns["body_mass"], np.full(40, 24.0))
    np.testing.assert_array_equal(columns["age"], np.full(40, 7.5))


def test_a_minimal_study_has_the_documented_defaults() -> None:
    study = monte_carlo(
        'format = "mcstudy-study/1"\nkind = "monte-carlo"\nname = "a"\ntitle = "A"\n'
        'model = { name = "toy" }\n'
        'inputs.stature = { distribution = "uniform", low = 1.0, high = 1.2, unit = "m" }\n'
    )
    assert (study.design.method, study.design.n, study.design.size) == (
        "latin-hypercube",
        2000,
        200,
    )
    assert (study.seed, study.max_failure_rate, study.fixed) == (0, 0.02, {})
    assert sample_inputs(study, MODEL)["stature"].shape == (2000,)


def test_files_with_windows_line_ends_are_read(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_bytes(STUDY.replace("\n", "\r\n").encode())
    assert load_study(path) == parse_study(STUDY)


def test_a_larger_study_begins_with_the_smaller_one() -> None:
    small, large = use(STUDY), use(edited(("n = 40", "n = 100")))
    for name, values in small.items():
        np.testing.assert_array_equal(large[name][:40], values)


@pytest.mark.parametrize("name", ["a", "paper_study", "A-1.b_2", "x" * 80])
def test_names_that_are_folders_are_accepted(name: str) -> None:
    assert monte_carlo(edited(('"small"', json.dumps(name)))).name == name


# -- bad files -------------------------------------------------------------------------------

DESIGN = 'method = "latin-hypercube"\nn = 40\nreplicate_size = 20'
SPEED = 'distribution = "normal"\nunit = "km/h"\nmean = 42.0\nsd = 2.0\nlow = 36.0\nhigh = 48.0'
BODY_MASS = 'body_mass = { value = 24000, unit = "g_mass" }'
PAIR = '["impact_speed", "stature", 0.4]'

# name: edits of the small study, parts of the message.
BAD: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    # unknown keys
    "unknown_key": ([("seed = 7", "sede = 7")], ["sede: unknown key"]),
    "unknown_table": ([("[fixed]", "[fixd]")], ["fixd", "unknown key"]),
    "unknown_design_key": ([("n = 40", "n = 40\nsize = 3")], ["design.size: unknown key"]),
    "unknown_input_key": ([("mean = 42.0", "mu = 1\nmean = 42.0")],
                          ["inputs.impact_speed", "mu: unknown key"]),
    "unknown_fixed_key": ([("value = 24000", "value = 24000, sd = 1")],
                          ["fixed.body_mass.sd: unknown key"]),
    "unknown_report_key": ([("histories = 2", "histories = 2\nfoo = 1")],
                           ["report.foo: unknown key"]),
    "unknown_reference_key": ([("histories = 2", 'references = [{ output = "wad", value = 1.0, '
                                                 'label = "a", colour = "red" }]')],
                              ["report.references.0.colour: unknown key"]),
    # missing
    "no_model": ([('[model]\nname = "toy"\noptions = { vehicle = "car" }', "")],
                 ["model: missing"]),
    "no_model_name": ([('name = "toy"\n', "")], ["model.name: missing"]),
    "no_title": ([('title = "A small study"', "")], ["title: missing"]),
    "no_kind": ([('kind = "monte-carlo"', "")], ["kind"]),
    "no_format": ([('format = "mcstudy-study/1"', "")], ["format: missing"]),
    "no_mean": ([("mean = 42.0\n", "")], ["inputs.impact_speed", "mean: missing"]),
    "no_distribution": ([('distribution = "normal"\n', "")],
                        ["inputs.impact_speed", "distribution"]),
    "no_value": ([("value = 24000, ", "")], ["fixed.body_mass.value: missing"]),
    # wrong words
    "wrong_format": ([("study/1", "study/9")], ["format", "mcstudy-study/1", "mcstudy-study/9"]),
    "wrong_kind": ([('kind = "monte-carlo"', 'kind = "monte-carlos"')],
                   ["kind", "monte-carlos", "reconstruction"]),
    "wrong_method": ([("latin-hypercube", "halton")], ["design.method", "halton", "sobol"]),
    "wrong_distribution": ([('"normal"', '"gauss"')],
                           ["inputs.impact_speed", "gauss", "lognormal"]),
    "wrong_reference_kind": ([("histories = 2", 'references = [{ output = "wad", value = 1.0, '
                                                'label = "a", kind = "seen" }]')],
                             ["report.references.0.kind", "seen"]),
    "name_with_slash": ([('"small"', '"../small"')], ["name '../small'", "folder"]),
    "name_with_backslash": ([('"small"', r'"a\\b"')], ["name", "folder"]),
    "name_of_parent": ([('"small"', '".."')], ["name '..'", "folder"]),
    "name_with_dots_inside": ([('"small"', '"a..b"')], ["name 'a..b'", "folder"]),
    "name_hidden": ([('"small"', '".small"')], ["name '.small'", "folder"]),
    "name_empty": ([('"small"', '""')], ["name ''", "folder"]),
    "name_too_long": ([('"small"', '"' + "x" * 81 + '"')], ["name", "folder"]),
    "name_with_line_break": ([('"small"', r'"a\nb"')], ["name", "folder"]),
    "name_with_space": ([('"small"', '"a b"')], ["name 'a b'", "folder"]),
    # wrong numbers
    "low_is_high": ([("low = 60.0", "low = 120.0")],
                    ["inputs.facing_angle", "low (120) must be below high (120)"]),
    "low_above_high": ([("low = 36.0", "low = 50.0")],
                       ["inputs.impact_speed", "low (50) must be below high (48)"]),
    "mode_outside": ([("mode = 122.0", "mode = 140.0")], ["inputs.stature", "must rise"]),
    "sd_zero": ([("sd = 2.0", "sd = 0.0")], ["inputs.impact_speed.sd", "greater than 0"]),
    "sd_negative": ([("sd = 2.0", "sd = -2.0")], ["inputs.impact_speed.sd", "greater than 0"]),
    "nothing_left": ([("low = 36.0\nhigh = 48.0", "low = 90.0")],
                     ["inputs.impact_speed", "no probability is left above low (90)"]),
    "nothing_left_below": ([("low = 36.0\nhigh = 48.0", "high = -90.0")],
                           ["inputs.impact_speed", "no probability is left below high (-90)"]),
    "mean_nan": ([("mean = 42.0", "mean = nan")], ["inputs.impact_speed.mean", "finite"]),
    "mean_inf": ([("mean = 42.0", "mean = inf")], ["inputs.impact_speed.mean", "finite"]),
    "sd_nan": ([("sd = 2.0", "sd = nan")], ["inputs.impact_speed.sd"]),
    "low_minus_inf": ([("low = 36.0", "low = -inf")], ["inputs.impact_speed.low", "finite"]),
    "value_nan": ([("value = 24000", "value = nan")], ["fixed.body_mass.value", "finite"]),
    "correlation_nan": ([("0.4]", "nan]")], ["dependence.correlations.0.2", "finite"]),
    "rate_nan": ([("max_failure_rate = 0.1", "max_failure_rate = nan")], ["max_failure_rate"]),
    "rate_above_one": ([("max_failure_rate = 0.1", "max_failure_rate = 2")],
                       ["max_failure_rate", "1"]),
    "mean_huge_integer": ([("mean = 42.0", "mean = 1" + "0" * 400)],
                          ["inputs.impact_speed.mean"]),
    "n_zero": ([("n = 40", "n = 0")], ["design.n", "greater than 0"]),
    "n_negative": ([("n = 40", "n = -40")], ["design.n", "greater than 0"]),
    "n_fraction": ([("n = 40", "n = 40.5")], ["design.n", "integer"]),
    "n_no_multiple": ([("n = 40", "n = 50")],
                      ["design", "n (50) must be a multiple of replicate_size (20)"]),
    "n_below_replicate": ([("n = 40", "n = 5")], ["design", "e.g. 20"]),
    "replicate_zero": ([("replicate_size = 20", "replicate_size = 0")],
                       ["design.replicate_size"]),
    "sobol_replicate": ([(DESIGN, 'method = "sobol"\nn = 60\nreplicate_size = 20')],
                        ["design", "replicate_size (20)", "power of two"]),
    "monte_carlo_replicate": ([(DESIGN, 'method = "monte-carlo"\nn = 60\nreplicate_size = 20')],
                              ["design", "replicate_size does not apply to monte-carlo"]),
    "seed_negative": ([("seed = 7", "seed = -1")], ["seed"]),
    "seed_text": ([("seed = 7", 'seed = "seven"')], ["seed", "integer"]),
    "seed_date": ([("seed = 7", "seed = 1979-05-27")], ["seed", "integer"]),
    "histories_negative": ([("histories = 2", "histories = -1")], ["report.histories"]),
    # wrong shapes
    "inputs_is_a_number": ([("seed = 7", "seed = 7\nfixed = 3"), (f"[fixed]\n{BODY_MASS}", "")],
                           ["fixed", "dictionary"]),
    "input_is_a_number": ([(f"[inputs.impact_speed]\n{SPEED}", "[inputs]\nimpact_speed = 3")],
                          ["inputs.impact_speed"]),
    "option_is_a_switch": ([('vehicle = "car"', "vehicle = true")],
                           ["model.options.vehicle", "text, a number or a list"]),
    "no_outputs": ([('outputs = ["hic15", "wad"]', "outputs = []")], ["report.outputs"]),
    "pair_too_short": ([(PAIR, '["impact_speed", "stature"]')], ["dependence.correlations.0"]),
    # not TOML
    "unclosed": ([("[design]", "[design")], ["not valid TOML", "line"]),
    "twice": ([("seed = 7", "seed = 7\nseed = 8")], ["not valid TOML", "line"]),
    "deeply_nested": ([("seed = 7", "seed = " + "[" * 5000 + "]" * 5000)], ["not valid TOML"]),
    # what does not fit the model
    "unknown_input": ([("[inputs.facing_angle]", "[inputs.facing]")],
                      ["inputs.facing", "no input 'facing'", "facing_angle"]),
    "unknown_fixed": ([("body_mass = {", "mass = {")], ["fixed.mass", "no input 'mass'"]),
    "unknown_output": ([('["hic15", "wad"]', '["hic"]')],
                       ["report.outputs", "no output 'hic'", "hic15"]),
    "fixed_and_sampled": ([("body_mass = {", "stature = { value = 1.2 }\nbody_mass = {")],
                          ["fixed.stature", "inputs.stature"]),
    "wrong_unit": ([('unit = "km/h"', 'unit = "kg"')],
                   ["inputs.impact_speed.unit", "'kg' measures mass"]),
    "unknown_unit": ([('unit = "km/h"', 'unit = "knots"')],
                     ["inputs.impact_speed.unit", "unknown unit 'knots'", "km/h"]),
    "forgotten_unit": ([('unit = "cm"\n', "")], ["inputs.stature.unit", "length"]),
    "wrong_fixed_unit": ([('unit = "g_mass"', 'unit = "g"')],
                         ["fixed.body_mass", "acceleration", "mass"]),
    "fixed_outside_range": ([("value = 24000", "value = 240000")],
                            ["fixed.body_mass", "240 kg", "9 to 150 kg"]),
    "samples_outside_range": ([("mode = 122.0\nhigh = 135.0", "mode = 122.0\nhigh = 500.0")],
                              ["inputs.stature", "0.8 to 2.1 m", "truncate"]),
    "samples_not_truncated": ([("sd = 2.0\nlow = 36.0\nhigh = 48.0", "sd = 200.0")],
                              ["inputs.impact_speed", "0.5 to 40 m/s", "truncate"]),
    "correlation_of_unsampled": ([('"stature", 0.4', '"body_mass", 0.4')],
                                 ["dependence", "'body_mass' is not a sampled input"]),
    "correlation_of_unknown": ([('"stature", 0.4', '"nobody", 0.4')],
                               ["dependence", "'nobody' is not a sampled input"]),
    "correlation_of_itself": ([('"stature", 0.4', '"impact_speed", 0.4')],
                              ["dependence", "of one input"]),
    "correlation_repeated": ([(PAIR, f'{PAIR}, ["stature", "impact_speed", 0.4]')],
                             ["dependence", "repeated"]),
    "correlation_of_one": ([("0.4]", "1.0]")], ["dependence", "not within -1 and 1"]),
    "correlations_contradict": (
        [(PAIR, '["impact_speed", "stature", 0.9], ["stature", "facing_angle", 0.9], '
                '["impact_speed", "facing_angle", -0.9]')],
        ["dependence", "contradict"]),
    "age_not_sampled": (
        [('distribution = "triangular"\nunit = "cm"\nlow = 110.0\nmode = 122.0\nhigh = 135.0',
          'distribution = "growth-chart"\nunit = "cm"\nage = "age"\nat = [1.0, 2.0]\n'
          'L = [1.0, 1.0]\nM = [120.0, 121.0]\nS = [0.04, 0.04]')],
        ["inputs.stature depends on age"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_files_get_one_line_that_names_the_place(name: str) -> None:
    edits, parts = BAD[name]
    message = complaint(edited(*edits))
    for part in parts:
        assert part in message
    assert len(message.splitlines()) == 1


def test_an_integer_of_thousands_of_digits_gets_one_line() -> None:
    assert "not valid TOML" in complaint(edited(("seed = 7", "seed = " + "1" * 5000)))


def test_a_huge_n_that_is_no_multiple_gets_one_line() -> None:
    assert "design" in complaint(edited(("n = 40", "n = " + "1" * 400)))


def test_an_n_that_nobody_can_run_is_refused() -> None:
    with pytest.raises(UserError):
        parse_study(edited(("n = 40", "n = 1" + "0" * 30)))


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (("sd = 2.0", "sd = inf"), "inputs.impact_speed.sd"),
        (
            ('distribution = "normal"\nunit = "km/h"\nmean = 42.0\nsd = 2.0',
             'distribution = "lognormal"\nunit = "km/h"\nmedian = inf\nsigma = 0.1'),
            "inputs.impact_speed.median",
        ),
        (
            ('distribution = "normal"\nunit = "km/h"\nmean = 42.0\nsd = 2.0',
             'distribution = "lognormal"\nunit = "km/h"\nmedian = 42.0\nsigma = inf'),
            "inputs.impact_speed.sigma",
        ),
    ],
)  # fmt: skip
def test_infinite_spreads_and_medians_are_refused_where_they_stand(
    edit: tuple[str, str], place: str
) -> None:
    with pytest.raises(UserError, match=place):
        parse_study(edited(edit))


@pytest.mark.parametrize(
    "edit",
    [("seed = 7", "seed = true"), ("sd = 2.0", 'sd = "2"'),      ("low = 60.0", "low = true")],
)  # fmt: skip
def test_numbers_must_be_numbers(edit: tuple[str, str]) -> None:
    with pytest.raises(UserError):
        parse_study(edited(edit))


@pytest.mark.parametrize(
    "edit",
    [("seed = 7", '"a\\nb" = 7'), ("[inputs.facing_angle]", '[inputs."a\\nb"]'),
     ("body_mass = {", '"a\\nb" = {')],
)  # fmt: skip
def test_keys_with_line_breaks_get_one_line_too(edit: tuple[str, str]) -> None:
    assert len(complaint(edited(edit)).splitlines()) == 1


def test_an_input_called_like_a_distribution_is_named() -> None:
    text = edited(("[inputs.facing_angle]", "[inputs.normal]"), ("low = 60.0", "low = nan"))
    assert "inputs.normal.low" in complaint(text)


# -- files -----------------------------------------------------------------------------------


def test_files_that_cannot_be_read_are_named_in_one_line(tmp_path: Path) -> None:
    binary = tmp_path / "binary.toml"
    binary.write_bytes(bytes(range(256)))
    broken = tmp_path / "broken.toml"
    broken.write_text("seed = ")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(edited(("seed = 7", "sede = 7")))
    empty = tmp_path / "empty.toml"
    empty.write_text("")
    for path in (tmp_path / "missing.toml", tmp_path, binary, broken, wrong, empty):
        with pytest.raises(UserError) as caught:
            load_study(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert len(str(caught.value).splitlines()) == 1


@QUIET
@given(st.text())
def test_any_text_is_a_study_or_a_user_error(text: str) -> None:
    with pytest.raises(UserError):
        parse_study(text)


@QUIET
@given(st.binary())
def test_any_file_is_a_study_or_a_user_error(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_bytes(content)
    with pytest.raises(UserError):
        load_study(path)


LITERALS = st.one_of(
    st.sampled_from(
        ["nan", "inf", "-inf", "0", "-1", "1", "0.5", "1e308", "-1e308", "5e-324", "1" + "0" * 300,
         "true", "[]", "[[]]", "{}", "{ value = 1 }", "{ value = nan, unit = 3 }", '""', '"x"',
         '"km/h"', '"monte-carlo"', '"sobol"', '"normal"', '"lognormal"', '"growth-chart"',
         '"stature"', '"age"', '["stature"]', "1979-05-27", "07:32:00", "'''a'''", "-0.0"]
    ),
    st.integers(-3, 200).map(str),
    st.floats().map(repr),
    st.text("abc.\"", max_size=6).map(repr),
)  # fmt: skip
LINES = STUDY.splitlines()


@st.composite
def mutilated(draw: st.DrawFn) -> str:
    """Return the small study with a few values, keys and lines gone wrong."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 3))):
        k = draw(st.integers(0, len(lines) - 1))
        action = draw(st.sampled_from(["value"] * 6 + ["key", "drop", "move", "text"]))
        key, equals, value = lines[k].partition("=")
        if action == "drop":
            del lines[k]
        elif action == "move":
            lines.insert(draw(st.integers(0, len(lines) - 1)), lines.pop(k))
        elif action == "text":
            lines[k] += draw(st.text("abc.\\\"'[]{}=#,\n 01e-", max_size=12))
        elif equals and action == "value":
            lines[k] = f"{key}= {draw(LITERALS)}"
        elif equals:
            lines[k] = f"{draw(st.sampled_from(['low', 'mean', 'n', 'unit', 'x.y']))} ={value}"
    return "\n".join(lines)


@QUIET
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(mutilated())
def test_a_mutilated_study_runs_or_is_a_user_error(text: str) -> None:
    try:
        study = parse_study(text)
    except UserError:
        return
    if isinstance(study, MonteCarloStudy) and study.design.n <= 10_000:
        try:
            columns = sample_inputs(study, MODEL)
        except UserError:
            return
        assert all(np.isfinite(values).all() for values in columns.values())


# -- the same study --------------------------------------------------------------------------


def topics(text: str, model: FakeSimulator = MODEL) -> dict[str, str]:
    return numbers_digest(monte_carlo(text), model)


@pytest.mark.parametrize(
    "edit",
    [
        ("n = 40", "n = 400"),
        ("histories = 2", "histories = 0"),
        ('outputs = ["hic15", "wad"]', 'outputs = ["wad"]'),
        ("histories = 2", 'references = [{ output = "wad", value = 1.35, label = "accident" }]'),
        ('title = "A small study"', 'title = "Another title"'),
        ('name = "small"', 'name = "other"'),
        ("max_failure_rate = 0.1", "max_failure_rate = 0.5"),
        ("low = 60.0", "low = 60"),
        ("seed = 7", "seed = 7   # a remark"),
    ],
)
def test_what_does_not_change_the_numbers_does_not_change_the_digest(edit: tuple[str, str]) -> None:
    assert topics(edited(edit)) == topics(STUDY)
    assert hash_of(topics(edited(edit))) == hash_of(topics(STUDY))


@pytest.mark.parametrize(
    ("edit", "topic"),
    [
        (("seed = 7", "seed = 8"), "seed"),
        (('vehicle = "car"', 'vehicle = "van"'), "model"),
        (('name = "toy"', 'name = "other"'), "model"),
        (('"latin-hypercube"', '"monte-carlo"\n#'), "design.method"),
        (("replicate_size = 20", "replicate_size = 10"), "design.replicate_size"),
        (("0.4]", "0.5]"), "dependence"),
        (("sd = 2.0", "sd = 2.1"), "inputs.impact_speed"),
        (('unit = "deg"', 'unit = "rad"'), "inputs.facing_angle"),
        (("value = 24000", "value = 25000"), "fixed.body_mass"),
        (("[fixed]", "[fixed]\nage = { value = 8, unit = 'year' }"), "fixed.age"),
    ],
)
def test_what_changes_the_numbers_changes_the_digest_under_its_name(
    edit: tuple[str, str], topic: str
) -> None:
    if edit[0] == '"latin-hypercube"':
        edit = (DESIGN, 'method = "monte-carlo"\nn = 40')
    changed, held = topics(edited(edit)), topics(STUDY)
    differing = {k for k in {*changed, *held} if changed.get(k) != held.get(k)}
    assert topic in differing
    assert differing <= {topic, "design.replicate_size"}
    assert hash_of(changed) != hash_of(held)


def test_the_models_version_and_the_order_of_inputs_change_the_digest() -> None:
    assert topics(STUDY, replace(MODEL, version="2"))["model"] != topics(STUDY)["model"]
    swapped = edited(
        (f"[inputs.impact_speed]\n{SPEED}\n\n", ""),
        ("[fixed]", f"[inputs.impact_speed]\n{SPEED}\n\n[fixed]"),
    )
    assert topics(swapped)["inputs"] != topics(STUDY)["inputs"]
    assert not np.array_equal(use(swapped)["impact_speed"], use(STUDY)["impact_speed"])


def test_an_added_input_changes_the_digest() -> None:
    added = edited(
        ("[fixed]", "[inputs.age]\ndistribution='uniform'\nunit='year'\nlow=7\nhigh=8\n[fixed]")
    )
    assert set(topics(added)) - set(topics(STUDY)) == {"inputs.age"}
