"""Study files of the kinds 'sobol' and 'morris': defaults, mistakes, dependence, digest."""

from pathlib import Path

import numpy as np
import pytest
from fake_simulator import FakeSimulator

from mcstudy.errors import UserError
from mcstudy.sampling.factors import DUMMY, factors_of
from mcstudy.studyfile.config import (
    FactorStudy,
    MorrisStudy,
    SobolStudy,
    check_independent,
    fixed_values,
    hash_of,
    load_study,
    map_inputs,
    numbers_digest,
    parse_study,
    report_outputs,
)
from models.registry import load_model

ROOT = Path(__file__).parents[2]
MODEL = FakeSimulator()
KINDS = ("sobol", "morris")

HEAD = """\
format = "mcstudy-study/1"
kind = "{kind}"
name = "small"
title = "A small study"
seed = 7

[model]
name = "toy"
options = {{ vehicle = "car" }}

[design]
n = 64

[groups]
child = ["age", "stature"]

[inputs.impact_speed]
distribution = "normal"
unit = "km/h"
mean = 42.0
sd = 2.0
low = 36.0
high = 48.0

[inputs.age]
distribution = "uniform"
unit = "year"
low = 6.0
high = 9.0

[inputs.stature]
distribution = "growth-chart"
unit = "cm"
age = "age"
at = [5.0, 10.0]
L = [1.0, 1.0]
M = [110.0, 138.0]
S = [0.04, 0.04]
low = 90.0
high = 180.0

[inputs.facing_angle]
distribution = "uniform"
unit = "deg"
low = 60.0
high = 120.0

[fixed]
body_mass = {{ value = 24000, unit = "g_mass" }}

[dependence]
correlations = [["age", "stature", 0.4]]

[report]
outputs = ["hic15", "wad"]
resamples = 200
"""
CHILD = 'child = ["age", "stature"]'
PAIR = '["age", "stature", 0.4]'


def text_of(kind: str, *edits: tuple[str, str]) -> str:
    """Return the small study of a kind with each old text replaced by a new one, once."""
    text = HEAD.format(kind=kind)
    for old, new in edits:
        assert old in text, f"{old!r} is not in the study"
        text = text.replace(old, new, 1)
    return text


def study_of(kind: str, *edits: tuple[str, str]) -> SobolStudy | MorrisStudy:
    study = parse_study(text_of(kind, *edits))
    assert isinstance(study, SobolStudy if kind == "sobol" else MorrisStudy)
    return study


def complaint(text: str) -> str:
    """Return what a study is refused with before it runs."""
    with pytest.raises(UserError) as caught:
        study = parse_study(text)
        assert isinstance(study, SobolStudy | MorrisStudy)
        report_outputs(study, MODEL)
        check_independent(study)
        map_inputs(study, MODEL, np.full((4, len(study.inputs)), 0.5))
    return str(caught.value)


# -- good files ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("paper_sobol", SobolStudy),
        ("paper_sobol_groups", SobolStudy),
        ("paper_morris", MorrisStudy),
    ],
)
def test_shipped_study_files_load_and_fit_their_model(name: str, kind: type[FactorStudy]) -> None:
    study = load_study(ROOT / "configs" / f"{name}.toml")
    assert isinstance(study, kind)
    assert isinstance(study, SobolStudy | MorrisStudy)
    assert study.name == name
    check_independent(study)
    model = load_model(study.model.name, study.model.options)
    fixed_values(study, model)
    report_outputs(study, model)
    d = len(study.inputs)
    for uniforms in (np.full((1, d), p) for p in (0.02, 0.5, 0.98)):
        assert list(map_inputs(study, model, uniforms)) == [item.name for item in model.inputs]


def test_a_sobol_study_has_the_documented_defaults() -> None:
    study = study_of("sobol", ("n = 64\n", ""), ("resamples = 200\n", ""), (CHILD + "\n", ""))
    assert isinstance(study, SobolStudy)
    design = study.design
    assert (design.n, design.start, design.tolerance, design.second_order) == (
        1024, 128, None, False,
    )  # fmt: skip
    assert (study.report.resamples, study.groups, study.max_failure_rate) == (1000, {}, 0.02)


def test_a_morris_study_has_the_documented_defaults() -> None:
    study = study_of("morris", ("[design]\nn = 64\n", ""), ("[report]\n", "[report]\n#"))
    assert isinstance(study, MorrisStudy)
    assert (study.design.n, study.design.levels) == (50, 4)
    assert study.report.outputs is None
    assert report_outputs(study, MODEL) == ["hic15", "wad"]


@pytest.mark.parametrize("kind", KINDS)
def test_values_are_drawn_for_the_uniforms_of_a_design(kind: str) -> None:
    study = study_of(kind)
    check_independent(study)
    uniforms = np.random.default_rng(1).random((50, 4))
    columns = map_inputs(study, MODEL, uniforms)
    assert list(columns) == [item.name for item in MODEL.inputs]
    # An input in no correlation is the quantile of its own uniform, in the model's unit.
    np.testing.assert_allclose(
        columns["facing_angle"], np.radians(60.0 + 60.0 * uniforms[:, 3]), rtol=1e-12
    )
    np.testing.assert_array_equal(columns["body_mass"], np.full(50, 24.0))
    # Changing the uniforms of the group changes the group's inputs and no others.
    other = uniforms.copy()
    other[:, 1:3] = np.random.default_rng(2).random((50, 2))
    moved = map_inputs(study, MODEL, other)
    changed = {name for name in columns if not np.array_equal(columns[name], moved[name])}
    assert changed == {"age", "stature"}


@pytest.mark.parametrize("kind", KINDS)
def test_factors_are_named_in_the_order_of_the_inputs(kind: str) -> None:
    study = study_of(kind)
    names = factors_of(list(study.inputs), study.groups)
    assert names == ("impact_speed", "child", "facing_angle", DUMMY)


# -- dependence ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_dependence_within_a_group_is_allowed(kind: str) -> None:
    check_independent(study_of(kind))
    wide = 'all = ["age", "stature", "impact_speed", "facing_angle"]'
    pairs = f'{PAIR}, ["impact_speed", "facing_angle", 0.2]'
    check_independent(study_of(kind, (CHILD, wide), (PAIR, pairs)))


DEPENDENT: dict[str, tuple[list[tuple[str, str]], tuple[str, str]]] = {
    "no group": ([(CHILD, "")], ("age", "stature")),
    "a parent outside the group": (
        [(CHILD, 'child = ["stature", "facing_angle"]'), (PAIR, "")],
        ("stature", "age"),
    ),
    "a correlation across groups": (
        [(PAIR, '["impact_speed", "age", 0.4]')], ("impact_speed", "age"),
    ),
    "two groups": (
        [(CHILD, 'child = ["age"]\nbody = ["stature"]'), (PAIR, "")], ("stature", "age"),
    ),
    "single inputs": (
        [(PAIR, '["impact_speed", "facing_angle", -0.1]')], ("impact_speed", "facing_angle"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", DEPENDENT)
def test_dependence_between_factors_is_refused_with_a_cure(case: str, kind: str) -> None:
    edits, (first, second) = DEPENDENT[case]
    with pytest.raises(UserError) as caught:
        check_independent(study_of(kind, *edits))
    message = str(caught.value)
    for part in ("dependence", repr(first), repr(second), kind, "one group", "monte-carlo"):
        assert part in message
    assert len(message.splitlines()) == 1


# -- bad files -------------------------------------------------------------------------------

BOTH: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "unknown_key": ([("seed = 7", "sede = 7")], ["study: sede: unknown key"]),
    "unknown_design_key": ([("n = 64", "n = 64\nsize = 3")], ["study: design.size: unknown key"]),
    "method": ([("n = 64", 'n = 64\nmethod = "sobol"')], ["design.method: unknown key"]),
    "replicates": ([("n = 64", "n = 64\nreplicate_size = 2")],
                   ["design.replicate_size: unknown key"]),
    "histories": ([("resamples = 200", "histories = 3")], ["report.histories: unknown key"]),
    "few_resamples": ([("resamples = 200", "resamples = 99")],
                      ["report.resamples", "100", "given 99"]),
    "many_resamples": ([("resamples = 200", "resamples = 100001")], ["report.resamples"]),
    "n_text": ([("n = 64", 'n = "64"')], ["design.n", "integer"]),
    "n_fraction": ([("n = 64", "n = 64.0")], ["design.n", "integer"]),
    "n_one": ([("n = 64", "n = 1")], ["design.n", "greater than or equal to"]),
    "n_huge": ([("n = 64", "n = 1" + "0" * 30)], ["design.n"]),
    "no_outputs": ([('outputs = ["hic15", "wad"]', "outputs = []")], ["report.outputs"]),
    "unknown_output": ([('["hic15", "wad"]', '["hic"]')],
                       ["report.outputs", "no output 'hic'", "hic15"]),
    "group_of_none": ([(CHILD, f"{CHILD}\nempty = []")], ["groups.empty"]),
    "group_is_text": ([(CHILD, 'child = "age"')], ["groups.child", "list"]),
    "group_of_number": ([(CHILD, "child = [3]")], ["groups.child.0", "string"]),
    "group_of_unknown": ([(CHILD, 'child = ["age", "nobody"]')],
                         ["groups.child", "'nobody' is not a sampled input"]),
    "group_of_fixed": ([(CHILD, 'child = ["age", "stature", "body_mass"]')],
                       ["groups.child", "'body_mass' is not a sampled input"]),
    "group_named_as_input": ([(CHILD, 'facing_angle = ["age", "stature"]')],
                             ["groups.facing_angle", "an input has this name"]),
    "group_named_as_its_member": ([(CHILD, 'age = ["age", "stature"]')],
                                  ["groups.age", "an input has this name"]),
    "group_named_dummy": ([(CHILD, 'dummy = ["age", "stature"]')], ["groups.dummy"]),
    "in_two_groups": ([(CHILD, f'{CHILD}\ntall = ["facing_angle", "stature"]')],
                      ["'stature'", "'child'", "'tall'"]),
    "twice_in_a_group": ([(CHILD, 'child = ["age", "stature", "age"]')], ["'age'", "'child'"]),
    "no_inputs": ([("[inputs.", "[input.")] * 4, ["inputs"]),
    "mean_nan": ([("mean = 42.0", "mean = nan")], ["inputs.impact_speed.mean", "finite"]),
    "wrong_unit": ([('unit = "km/h"', 'unit = "kg"')], ["inputs.impact_speed.unit", "mass"]),
    "fixed_and_sampled": ([("body_mass = {", "age = { value = 8 }\nbody_mass = {")],
                          ["fixed.age", "inputs.age"]),
    "rate_above_one": ([("seed = 7", "seed = 7\nmax_failure_rate = 2")], ["max_failure_rate"]),
    "name_with_slash": ([('"small"', '"../small"')], ["name '../small'", "folder"]),
    "correlation_of_one": ([("0.4]", "1.0]")], ["dependence", "not within -1 and 1"]),
    "correlation_repeated": ([(PAIR, f'{PAIR}, ["stature", "age", 0.4]')],
                             ["dependence", "repeated"]),
}  # fmt: skip

SOBOL: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "n_no_power": ([("n = 64", "n = 100")], ["design", "n (100) must be a power of two"]),
    "start_no_power": ([("n = 64", "n = 128\nstart = 96")],
                       ["design", "start (96) must be a power of two"]),
    "n_small": ([("n = 64", "n = 32")], ["design.n", "64", "given 32"]),
    "start_small": ([("n = 64", "start = 32")], ["design.start", "64"]),
    "n_large": ([("n = 64", "n = 2097152")], ["design.n"]),
    "tolerance_zero": ([("n = 64", "n = 64\ntolerance = 0.0")], ["design.tolerance"]),
    "tolerance_negative": ([("n = 64", "n = 64\ntolerance = -0.1")], ["design.tolerance"]),
    "tolerance_nan": ([("n = 64", "n = 64\ntolerance = nan")], ["design.tolerance"]),
    "tolerance_inf": ([("n = 64", "n = 64\ntolerance = inf")], ["design.tolerance"]),
    "second_order_text": ([("n = 64", 'second_order = "yes"')], ["design.second_order"]),
    "second_order_number": ([("n = 64", "second_order = 1")], ["design.second_order"]),
    "levels": ([("n = 64", "n = 64\nlevels = 4")], ["design.levels: unknown key"]),
}  # fmt: skip

MORRIS: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "levels_odd": ([("n = 64", "levels = 5")], ["design", "levels (5) must be even"]),
    "levels_two": ([("n = 64", "levels = 2")], ["design.levels"]),
    "levels_none": ([("n = 64", "levels = 0")], ["design.levels"]),
    "levels_many": ([("n = 64", "levels = 22")], ["design.levels", "20"]),
    "start": ([("n = 64", "start = 64")], ["design.start: unknown key"]),
    "tolerance": ([("n = 64", "tolerance = 0.1")], ["design.tolerance: unknown key"]),
    "second_order": ([("n = 64", "second_order = true")], ["design.second_order: unknown key"]),
}  # fmt: skip

BAD = (
    [(kind, edits, parts) for kind in KINDS for edits, parts in BOTH.values()]
    + [("sobol", edits, parts) for edits, parts in SOBOL.values()]
    + [("morris", edits, parts) for edits, parts in MORRIS.values()]
)
BAD_NAMES = [f"{kind}-{name}" for kind in KINDS for name in BOTH] + [*SOBOL, *MORRIS]


@pytest.mark.parametrize(("kind", "edits", "parts"), BAD, ids=BAD_NAMES)
def test_bad_files_get_one_line_that_names_the_place(
    kind: str, edits: list[tuple[str, str]], parts: list[str]
) -> None:
    message = complaint(text_of(kind, *edits))
    for part in parts:
        assert part in message
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_group_called_like_the_dummy_is_told_why(kind: str) -> None:
    message = complaint(text_of(kind, (CHILD, 'dummy = ["age", "stature"]')))
    assert "an input has this name" not in message


@pytest.mark.parametrize("kind", KINDS)
def test_an_input_called_like_the_dummy_is_refused(kind: str) -> None:
    # Factors are told apart by their names.
    with pytest.raises(UserError, match="dummy"):
        parse_study(text_of(kind, ("[inputs.facing_angle]", "[inputs.dummy]")))


@pytest.mark.parametrize("kind", KINDS)
def test_a_correlation_with_an_input_that_is_not_sampled_is_told_so(kind: str) -> None:
    message = complaint(text_of(kind, (PAIR, '["impact_speed", "body_mass", 0.4]')))
    assert "'body_mass' is not a sampled input" in message


# -- the same study --------------------------------------------------------------------------


def topics(kind: str, *edits: tuple[str, str]) -> dict[str, str]:
    return numbers_digest(study_of(kind, *edits), MODEL)


SAME: dict[str, tuple[str, str]] = {
    "n": ("n = 64", "n = 128"),
    "outputs": ('outputs = ["hic15", "wad"]', 'outputs = ["wad"]'),
    "resamples": ("resamples = 200", "resamples = 500"),
    "title": ('title = "A small study"', 'title = "Another title"'),
    "name": ('name = "small"', 'name = "other"'),
    "failures": ("seed = 7", "seed = 7\nmax_failure_rate = 0.5"),
    "remark": ("seed = 7", "seed = 7   # a remark"),
    "integer": ("low = 60.0", "low = 60"),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", SAME)
def test_what_does_not_change_the_numbers_does_not_change_the_digest(case: str, kind: str) -> None:
    changed, held = topics(kind, SAME[case]), topics(kind)
    assert changed == held
    assert hash_of(changed) == hash_of(held)


def test_how_far_a_sobol_design_goes_does_not_change_the_digest() -> None:
    further = ("n = 64", "n = 256\nstart = 64\ntolerance = 0.01")
    assert topics("sobol", further) == topics("sobol")


@pytest.mark.parametrize("kind", KINDS)
def test_the_order_of_groups_does_not_change_the_digest(kind: str) -> None:
    # Factors stand where their first input stands, whatever the order of the groups.
    one = (CHILD, f'{CHILD}\ncar = ["impact_speed"]')
    two = (CHILD, f'car = ["impact_speed"]\n{CHILD}')
    assert topics(kind, one) == topics(kind, two)


DIFFERENT: dict[str, tuple[tuple[str, str], str]] = {
    "seed": (("seed = 7", "seed = 8"), "seed"),
    "options": (('vehicle = "car"', 'vehicle = "van"'), "model"),
    "group": ((CHILD, 'child = ["age", "stature", "facing_angle"]'), "groups"),
    "dependence": (("0.4]", "0.5]"), "dependence"),
    "distribution": (("sd = 2.0", "sd = 2.1"), "inputs.impact_speed"),
    "unit": (('unit = "deg"', 'unit = "rad"'), "inputs.facing_angle"),
    "fixed": (("value = 24000", "value = 25000"), "fixed.body_mass"),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", DIFFERENT)
def test_what_changes_the_numbers_changes_the_digest_under_its_name(case: str, kind: str) -> None:
    edit, topic = DIFFERENT[case]
    changed, held = topics(kind, edit), topics(kind)
    assert {k for k in {*changed, *held} if changed.get(k) != held.get(k)} == {topic}
    assert hash_of(changed) != hash_of(held)


@pytest.mark.parametrize(
    ("kind", "edit", "topic"),
    [
        ("sobol", ("n = 64", "n = 64\nsecond_order = true"), "design.second_order"),
        ("morris", ("n = 64", "n = 64\nlevels = 6"), "design.levels"),
    ],
)
def test_what_changes_a_design_changes_the_digest(
    kind: str, edit: tuple[str, str], topic: str
) -> None:
    changed, held = topics(kind, edit), topics(kind)
    assert {k for k in {*changed, *held} if changed.get(k) != held.get(k)} == {topic}


def test_kinds_differ_in_their_digest() -> None:
    one, two = topics("sobol"), topics("morris")
    assert set(one) != set(two)
    assert hash_of(one) != hash_of(two)
