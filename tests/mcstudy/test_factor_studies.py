"""Study files of the kinds 'sobol' and 'morris': defaults, mistakes, dependence, digest."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_simulator import STUDY, FakeSimulator, edited, edits_of
from numpy.testing import assert_allclose, assert_array_equal

from mcstudy.errors import UserError
from mcstudy.sampling.factors import DUMMY, factors_of
from mcstudy.studyfile.identity import hash_of, numbers_digest
from mcstudy.studyfile.study_inputs import check_independent, fixed_values, map_inputs
from mcstudy.studyfile.study_outputs import report_outputs
from models.registry import load_model
from studies.kinds import load_study, parse_study
from studies.morris.schema import MorrisStudy
from studies.sobol.schema import SobolStudy

CONFIGS = Path(__file__).parents[2] / "configs"
MODEL = FakeSimulator()
CHILD, PAIR = 'child = ["age", "stature"]', '["age", "stature", 0.4]'
OUTPUTS = 'outputs = ["hic15", "wad"]'

SMALL = edited(
    ("max_failure_rate = 0.1\n", ""),
    ('method = "latin-hypercube"\nn = 40\nreplicate_size = 20', f"n = 64\n\n[groups]\n{CHILD}"),
    ('[inputs.stature]\ndistribution = "triangular"\nunit = "cm"\nlow = 110.0\nmode = 122.0\n'
     "high = 135.0",
     '[inputs.age]\ndistribution = "uniform"\nunit = "year"\nlow = 6.0\nhigh = 9.0\n\n'
     '[inputs.stature]\ndistribution = "growth-chart"\nunit = "cm"\nage = "age"\n'
     "at = [5.0, 10.0]\nL = [1.0, 1.0]\nM = [110.0, 138.0]\nS = [0.04, 0.04]\nlow = 90.0\n"
     "high = 180.0"),
    ('["impact_speed", "stature", 0.4]', PAIR),
    ("histories = 2", "resamples = 200"),
    text=STUDY,
)  # fmt: skip
"""Its inputs: impact_speed, facing_angle, age, stature."""

each_kind = pytest.mark.parametrize("kind", ["sobol", "morris"])


def text_of(kind: str, *edits: tuple[str, str]) -> str:
    return edited(('kind = "monte-carlo"', f'kind = "{kind}"'), *edits, text=SMALL)


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
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize("name", ["paper_sobol", "paper_sobol_groups", "paper_morris"])
def test_shipped_study_files_load_and_fit_their_model(name: str) -> None:
    study = load_study(CONFIGS / f"{name}.toml")
    assert isinstance(study, SobolStudy if "sobol" in name else MorrisStudy)
    check_independent(study)
    model = load_model(study.model.name, study.model.options)
    fixed_values(study.fixed, model)
    report_outputs(study, model)
    for p in (0.02, 0.5, 0.98):
        columns = map_inputs(study, model, np.full((1, len(study.inputs)), p))
        assert list(columns) == [item.name for item in model.inputs]


def test_factor_studies_have_the_documented_defaults() -> None:
    study = study_of("sobol", ("n = 64\n", ""), ("resamples = 200\n", ""), (CHILD + "\n", ""))
    design = study.design
    found = (design.n, design.start, design.tolerance, design.second_order)
    assert found == (1024, 128, None, False)
    assert (study.report.resamples, study.groups, study.max_failure_rate) == (1000, {}, 0.02)
    study = study_of("morris", ("[design]\nn = 64\n", ""), ("[report]\n", "[report]\n#"))
    assert (study.design.n, study.design.levels) == (50, 4)
    assert study.report.outputs is None
    assert report_outputs(study, MODEL) == ["hic15", "wad"]


@each_kind
def test_values_are_drawn_for_the_uniforms_of_a_design(kind: str) -> None:
    study, rng = study_of(kind), np.random.default_rng(1)
    uniforms = rng.random((50, 4))
    columns = map_inputs(study, MODEL, uniforms)
    assert list(columns) == [item.name for item in MODEL.inputs]
    # An input in no correlation is the quantile of its own uniform, in the model's unit.
    expected = np.radians(60.0 + 60.0 * uniforms[:, list(study.inputs).index("facing_angle")])
    assert_allclose(columns["facing_angle"], expected, rtol=1e-12)
    assert_array_equal(columns["body_mass"], np.full(50, 24.0))
    # Changing the uniforms of the group changes the group's inputs and no others.
    names = factors_of(list(study.inputs), study.groups)
    assert sorted(names) == sorted(["impact_speed", "child", "facing_angle", DUMMY])
    group = np.isin(list(study.inputs), study.groups["child"])
    moved = map_inputs(study, MODEL, np.where(group, rng.random((50, 4)), uniforms))
    changed = {name for name in columns if not np.array_equal(columns[name], moved[name])}
    assert changed == {"age", "stature"}


@each_kind
def test_dependence_is_allowed_within_a_group_alone(kind: str) -> None:
    check_independent(study_of(kind))
    wide = 'all = ["age", "stature", "impact_speed", "facing_angle"]'
    pairs = f'{PAIR}, ["impact_speed", "facing_angle", 0.2]'
    check_independent(study_of(kind, (CHILD, wide), (PAIR, pairs)))
    for edits, names in (
        ([(CHILD, "")], ("age", "stature")),
        ([(CHILD, 'child = ["stature", "facing_angle"]'), (PAIR, "")], ("stature", "age")),
        ([(PAIR, '["impact_speed", "age", 0.4]')], ("impact_speed", "age")),
        ([(CHILD, 'child = ["age"]\nbody = ["stature"]'), (PAIR, "")], ("stature", "age")),
        ([(PAIR, '["impact_speed", "facing_angle", -0.1]')], ("impact_speed", "facing_angle")),
    ):
        message = complaint(text_of(kind, *edits))
        for part in ("dependence", *map(repr, names), kind, "one group", "monte-carlo"):
            assert part in message


# Old and new text, parts of the message. What all kinds share is in test_config.
BOTH: list[tuple[Any, ...]] = [
    ("n = 64", "n = 64\nsize = 3", "study: design.size: unknown key"),
    ("n = 64", 'n = 64\nmethod = "sobol"', "design.method: unknown key"),
    ("n = 64", "n = 64\nreplicate_size = 2", "design.replicate_size: unknown key"),
    ("resamples = 200", "histories = 3", "report.histories: unknown key"),
    ("resamples = 200", "resamples = 99", "report.resamples", "100", "given 99"),
    ("resamples = 200", "resamples = 100001", "report.resamples"),
    ("n = 64", 'n = "64"', "design.n", "integer"),
    ("n = 64", "n = 64.0", "design.n", "integer"),
    ("n = 64", "n = 1", "design.n", "greater than or equal to"),
    ("n = 64", "n = 1" + "0" * 30, "design.n"),
    (OUTPUTS, "outputs = []", "report.outputs"),
    ('["hic15", "wad"]', '["hic"]', "report.outputs", "no output 'hic'", "hic15"),
    (CHILD, f"{CHILD}\nempty = []", "groups.empty"),
    (CHILD, 'child = "age"', "groups.child", "list"),
    (CHILD, "child = [3]", "groups.child.0", "string"),
    (CHILD, 'child = ["age", "nobody"]', "groups.child", "'nobody' is not a sampled input"),
    (CHILD, 'child = ["body_mass"]', "groups.child", "'body_mass' is not a sampled input"),
    (CHILD, 'facing_angle = ["age"]', "groups.facing_angle", "an input has this name"),
    (CHILD, 'age = ["age", "stature"]', "groups.age", "an input has this name"),
    (CHILD, 'dummy = ["age", "stature"]', "groups.dummy"),
    # Factors are told apart by their names.
    ("[inputs.facing_angle]", "[inputs.dummy]", "dummy"),
    (CHILD, f'{CHILD}\ntall = ["facing_angle", "stature"]', "'stature'", "'child'", "'tall'"),
    (CHILD, 'child = ["age", "stature", "age"]', "'age'", "'child'"),
    (("[inputs.",) * 4, ("[input.",) * 4, "inputs"),
    (PAIR, '["impact_speed", "body_mass", 0.4]', "'body_mass' is not a sampled input"),
]  # fmt: skip
SOBOL: list[tuple[Any, ...]] = [
    ("n = 64", "n = 100", "design", "n (100) must be a power of two"),
    ("n = 64", "n = 128\nstart = 96", "design", "start (96) must be a power of two"),
    ("n = 64", "n = 32", "design.n", "64", "given 32"),
    ("n = 64", "start = 32", "design.start", "64"),
    ("n = 64", "n = 2097152", "design.n"),
    *(("n = 64", f"n = 64\ntolerance = {bad}", "design.tolerance")
      for bad in ("0.0", "-0.1", "nan", "inf")),
    ("n = 64", 'second_order = "yes"', "design.second_order"),
    ("n = 64", "second_order = 1", "design.second_order"),
    ("n = 64", "n = 64\nlevels = 4", "design.levels: unknown key"),
]  # fmt: skip
MORRIS: list[tuple[Any, ...]] = [
    ("n = 64", "levels = 5", "design", "levels (5) must be even"),
    ("n = 64", "levels = 2", "design.levels"),
    ("n = 64", "levels = 22", "design.levels", "20"),
    ("n = 64", "start = 64", "design.start: unknown key"),
    ("n = 64", "tolerance = 0.1", "design.tolerance: unknown key"),
    ("n = 64", "second_order = true", "design.second_order: unknown key"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "row"),
    [("sobol", row) for row in BOTH + SOBOL] + [("morris", row) for row in BOTH + MORRIS],
    ids=lambda value: value if isinstance(value, str) else value[-1][:40],
)
def test_bad_files_get_one_line_that_names_the_place(kind: str, row: tuple[Any, ...]) -> None:
    edits, parts = edits_of(row)
    message = complaint(text_of(kind, *edits))
    for part in parts:
        assert part in message
    if parts == ("groups.dummy",):
        assert "an input has this name" not in message


def differing(kind: str, *edits: tuple[str, str], than: tuple[str, str] | None = None) -> set[str]:
    """Return the topics of the digest that edits change."""
    one = numbers_digest(study_of(kind, *edits), MODEL)
    two = numbers_digest(study_of(kind, *([than] if than else [])), MODEL)
    found = {k for k in {*one, *two} if one.get(k) != two.get(k)}
    assert (hash_of(one) != hash_of(two)) == bool(found)
    return found


@each_kind
def test_what_does_not_change_the_numbers_does_not_change_the_digest(kind: str) -> None:
    for edit in (
        ("n = 64", "n = 128"), (OUTPUTS, 'outputs = ["wad"]'),
        ("resamples = 200", "resamples = 500"), ('"A small study"', '"Another title"'),
        ('name = "small"', 'name = "other"'), ("seed = 7", "seed = 7\nmax_failure_rate = 0.5"),
        ("seed = 7", "seed = 7   # a remark"), ("low = 60.0", "low = 60"),
        *([("n = 64", "n = 256\nstart = 64\ntolerance = 0.01")] if kind == "sobol" else []),
    ):  # fmt: skip
        assert differing(kind, edit) == set()
    # Factors stand where their first input stands, whatever the order of the groups.
    one, two = f'{CHILD}\ncar = ["impact_speed"]', f'car = ["impact_speed"]\n{CHILD}'
    assert differing(kind, (CHILD, one), than=(CHILD, two)) == set()


@each_kind
def test_what_changes_the_numbers_changes_the_digest_under_its_name(kind: str) -> None:
    own = ("second_order = true", "design.second_order") if kind == "sobol" else (
        "levels = 6", "design.levels")  # fmt: skip
    for old, new, topic in (
        ("seed = 7", "seed = 8", "seed"),
        ('vehicle = "car"', 'vehicle = "van"', "model"),
        (CHILD, 'child = ["age", "stature", "facing_angle"]', "groups"),
        ("0.4]", "0.5]", "dependence"),
        ("sd = 2.0", "sd = 2.1", "inputs.impact_speed"),
        ('unit = "deg"', 'unit = "rad"', "inputs.facing_angle"),
        ("value = 24000", "value = 25000", "fixed.body_mass"),
        ("n = 64", f"n = 64\n{own[0]}", own[1]),
    ):
        assert differing(kind, (old, new)) == {topic}


def test_kinds_differ_in_their_digest() -> None:
    one, two = (numbers_digest(study_of(kind), MODEL) for kind in ("sobol", "morris"))
    assert set(one) != set(two)
    assert hash_of(one) != hash_of(two)
