"""Study files: what is accepted, what is refused with one line, what counts as the same study."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_simulator import STUDY, FakeSimulator, edited, edits_of
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, quiet
from numpy.testing import assert_array_equal

from mcstudy.errors import UserError
from mcstudy.studyfile.identity import hash_of, numbers_digest
from mcstudy.studyfile.study_inputs import fixed_values
from mcstudy.studyfile.study_outputs import check_outputs
from models.registry import load_model
from studies.kinds import load_study, parse_study
from studies.monte_carlo.design import sample_inputs
from studies.monte_carlo.schema import MonteCarloStudy
from studies.reconstruction.schema import Reconstruction

CONFIGS = Path(__file__).parents[2] / "configs"
MODEL = FakeSimulator()


def monte_carlo(text: str) -> MonteCarloStudy:
    study = parse_study(text)
    assert isinstance(study, MonteCarloStudy)
    return study


def use(text: str) -> dict[str, Array]:
    """Do with a text what a run does before it starts."""
    study = monte_carlo(text)
    check_outputs(study.report.outputs, MODEL, "report.outputs")
    return sample_inputs(study, MODEL)


def complaint(text: str) -> str:
    with pytest.raises(UserError) as caught:
        use(text)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_the_shipped_case_fits_its_model() -> None:
    study = load_study(CONFIGS / "paper_case.toml")
    assert isinstance(study, Reconstruction)
    model = load_model(study.model.name, study.model.options)
    fixed = fixed_values(study.fixed, model)
    assert fixed["impact_speed"] == pytest.approx(100.0 / 9.0)
    assert fixed["dive_angle"] == pytest.approx(math.radians(2.0))
    for table in study.tables:
        check_outputs(list(table.units), model, table.title)


def test_the_shipped_study_fits_its_model() -> None:
    study = load_study(CONFIGS / "paper_study.toml")
    assert isinstance(study, MonteCarloStudy)
    model = load_model(study.model.name, study.model.options)
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
    # Both replicates of twenty have a sample in each twentieth of the range.
    places = (columns["facing_angle"] - math.pi / 3.0) / (math.pi / 60.0)
    strata = np.floor(places).astype(int).reshape(2, 20)
    assert_array_equal(np.sort(strata, axis=1), [range(20), range(20)])
    assert np.all((columns["stature"] > 1.10) & (columns["stature"] < 1.35))
    assert_array_equal(columns["body_mass"], np.full(40, 24.0))
    assert_array_equal(columns["age"], np.full(40, 7.5))
    larger = use(edited(("n = 40", "n = 100")))
    for name, values in columns.items():
        assert_array_equal(larger[name][:40], values)


def test_a_minimal_study_has_the_documented_defaults() -> None:
    study = monte_carlo(
        'format = "mcstudy-study/1"\nkind = "monte-carlo"\nname = "a"\ntitle = "A"\n'
        'model = { name = "toy" }\n'
        'inputs.stature = { distribution = "uniform", low = 1.0, high = 1.2, unit = "m" }\n'
    )
    design = study.design
    assert (design.method, design.n, design.size) == ("latin-hypercube", 2000, 200)
    assert (study.seed, study.max_failure_rate, study.fixed) == (0, 0.02, {})
    assert sample_inputs(study, MODEL)["stature"].shape == (2000,)


def test_a_name_is_that_of_a_folder() -> None:
    for name in ("a", "paper_study", "A-1.b_2", "x" * 80):
        assert monte_carlo(edited(('"small"', json.dumps(name)))).name == name
    for name in ("../small", r"a\b", "..", "a..b", ".small", "", "x" * 81, "a\nb", "a b"):
        message = complaint(edited(('"small"', json.dumps(name))))
        assert "name" in message and "folder" in message


DESIGN = 'method = "latin-hypercube"\nn = 40\nreplicate_size = 20'
NORMAL = 'distribution = "normal"\nunit = "km/h"\nmean = 42.0\nsd = 2.0'
SPEED = f"{NORMAL}\nlow = 36.0\nhigh = 48.0"
LOGNORMAL = 'distribution = "lognormal"\nunit = "km/h"\nmedian = {}\nsigma = {}'
STATURE = 'distribution = "triangular"\nunit = "cm"\nlow = 110.0\nmode = 122.0\nhigh = 135.0'
BODY_MASS = 'body_mass = { value = 24000, unit = "g_mass" }'
PAIR = '["impact_speed", "stature", 0.4]'
OUTPUTS = 'outputs = ["hic15", "wad"]'
REFERENCE = 'references = [{{ output = "wad", value = 1.0, label = "a", {} }}]'
PLACE = "inputs.impact_speed"

# Old and new text, parts of the message.
BAD: list[tuple[Any, ...]] = [
    # unknown keys
    ("seed = 7", "sede = 7", "sede: unknown key"),
    ("[fixed]", "[fixd]", "fixd", "unknown key"),
    ("n = 40", "n = 40\nsize = 3", "design.size: unknown key"),
    ("mean = 42.0", "mu = 1\nmean = 42.0", PLACE, "mu: unknown key"),
    ("value = 24000", "value = 24000, sd = 1", "fixed.body_mass.sd: unknown key"),
    ("histories = 2", "histories = 2\nfoo = 1", "report.foo: unknown key"),
    ("histories = 2", REFERENCE.format('colour = "red"'),
     "report.references.0.colour: unknown key"),
    # missing
    ('[model]\nname = "toy"\noptions = { vehicle = "car" }', "", "model: missing"),
    ('name = "toy"\n', "", "model.name: missing"),
    ('title = "A small study"', "", "title: missing"),
    ('kind = "monte-carlo"', "", "kind"),
    ('format = "mcstudy-study/1"', "", "format: missing"),
    ("mean = 42.0\n", "", PLACE, "mean: missing"),
    ('distribution = "normal"\n', "", PLACE, "distribution"),
    ("value = 24000, ", "", "fixed.body_mass.value: missing"),
    # wrong words
    ("study/1", "study/9", "format", "mcstudy-study/1", "mcstudy-study/9"),
    ('kind = "monte-carlo"', 'kind = "monte-carlos"', "kind", "monte-carlos", "reconstruction"),
    ("latin-hypercube", "halton", "design.method", "halton", "sobol"),
    ('"normal"', '"gauss"', PLACE, "gauss", "lognormal"),
    ("histories = 2", REFERENCE.format('kind = "seen"'), "report.references.0.kind", "seen"),
    # wrong numbers
    ("low = 60.0", "low = 120.0", "inputs.facing_angle", "low (120) must be below high (120)"),
    ("low = 36.0", "low = 50.0", PLACE, "low (50) must be below high (48)"),
    ("mode = 122.0", "mode = 140.0", "inputs.stature", "must rise"),
    ("sd = 2.0", "sd = 0.0", f"{PLACE}.sd", "greater than 0"),
    ("low = 36.0\nhigh = 48.0", "low = 90.0", PLACE, "no probability is left above low (90)"),
    ("low = 36.0\nhigh = 48.0", "high = -90.0", PLACE, "no probability is left below high (-90)"),
    ("mean = 42.0", "mean = nan", f"{PLACE}.mean", "finite"),
    ("mean = 42.0", "mean = inf", f"{PLACE}.mean", "finite"),
    ("sd = 2.0", "sd = nan", f"{PLACE}.sd"),
    ("sd = 2.0", "sd = inf", f"{PLACE}.sd"),
    (NORMAL, LOGNORMAL.format("inf", 0.1), f"{PLACE}.median"),
    (NORMAL, LOGNORMAL.format(42.0, "inf"), f"{PLACE}.sigma"),
    ("low = 36.0", "low = -inf", f"{PLACE}.low", "finite"),
    ("value = 24000", "value = nan", "fixed.body_mass.value", "finite"),
    ("0.4]", "nan]", "dependence.correlations.0.2", "finite"),
    ("max_failure_rate = 0.1", "max_failure_rate = nan", "max_failure_rate"),
    ("max_failure_rate = 0.1", "max_failure_rate = 2", "max_failure_rate", "1"),
    ("mean = 42.0", "mean = 1" + "0" * 400, f"{PLACE}.mean"),
    ("n = 40", "n = 0", "design.n", "greater than 0"),
    ("n = 40", "n = 40.5", "design.n", "integer"),
    ("n = 40", "n = 50", "design", "n (50) must be a multiple of replicate_size (20)"),
    ("n = 40", "n = 5", "design", "e.g. 20"),
    ("n = 40", "n = " + "1" * 400, "design"),
    ("n = 40", "n = 1" + "0" * 30, "design"),
    ("replicate_size = 20", "replicate_size = 0", "design.replicate_size"),
    (DESIGN, 'method = "sobol"\nn = 60\nreplicate_size = 20', "replicate_size (20)",
     "power of two"),
    (DESIGN, 'method = "monte-carlo"\nn = 60\nreplicate_size = 20',
     "design", "replicate_size does not apply to monte-carlo"),
    ("seed = 7", "seed = -1", "seed"),
    ("seed = 7", 'seed = "seven"', "seed", "integer"),
    ("seed = 7", "seed = 1979-05-27", "seed", "integer"),
    ("seed = 7", "seed = true", "seed"),
    ("sd = 2.0", 'sd = "2"', f"{PLACE}.sd"),
    ("low = 60.0", "low = true", "inputs.facing_angle.low"),
    ("histories = 2", "histories = -1", "report.histories"),
    (("[inputs.facing_angle]", "low = 60.0"), ("[inputs.normal]", "low = nan"),
     "inputs.normal.low"),
    # wrong shapes
    (("seed = 7", f"[fixed]\n{BODY_MASS}"), ("seed = 7\nfixed = 3", ""), "fixed", "dictionary"),
    (f"[inputs.impact_speed]\n{SPEED}", "[inputs]\nimpact_speed = 3", PLACE),
    ('vehicle = "car"', "vehicle = true", "model.options.vehicle", "text, a number or a list"),
    (OUTPUTS, "outputs = []", "report.outputs"),
    (PAIR, '["impact_speed", "stature"]', "dependence.correlations.0"),
    # not TOML
    ("[design]", "[design", "not valid TOML", "line"),
    ("seed = 7", "seed = 7\nseed = 8", "not valid TOML", "line"),
    ("seed = 7", "seed = " + "[" * 5000 + "]" * 5000, "not valid TOML"),
    ("seed = 7", "seed = " + "1" * 5000, "not valid TOML"),
    # keys with line breaks
    ("seed = 7", '"a\\nb" = 7', "unknown key"),
    ("[inputs.facing_angle]", '[inputs."a\\nb"]', "no input"),
    ("body_mass = {", '"a\\nb" = {', "no input"),
    # what does not fit the model
    ("[inputs.facing_angle]", "[inputs.facing]",
     "inputs.facing", "no input 'facing'", "facing_angle"),
    ("body_mass = {", "mass = {", "fixed.mass", "no input 'mass'"),
    ('["hic15", "wad"]', '["hic"]', "report.outputs", "no output 'hic'", "hic15"),
    ("body_mass = {", "stature = { value = 1.2 }\nbody_mass = {",
     "fixed.stature", "inputs.stature"),
    ('unit = "km/h"', 'unit = "kg"', f"{PLACE}.unit", "'kg' measures mass"),
    ('unit = "km/h"', 'unit = "knots"', f"{PLACE}.unit", "unknown unit 'knots'", "km/h"),
    ('unit = "cm"\n', "", "inputs.stature.unit", "length"),
    ('unit = "g_mass"', 'unit = "g"', "fixed.body_mass", "acceleration", "mass"),
    ("value = 24000", "value = 240000", "fixed.body_mass", "240 kg", "9 to 150 kg"),
    ("mode = 122.0\nhigh = 135.0", "mode = 122.0\nhigh = 500.0",
     "inputs.stature", "0.8 to 2.1 m", "truncate"),
    ("sd = 2.0\nlow = 36.0\nhigh = 48.0", "sd = 200.0", PLACE, "0.5 to 40 m/s", "truncate"),
    ('"stature", 0.4', '"body_mass", 0.4', "dependence", "'body_mass' is not a sampled input"),
    ('"stature", 0.4', '"impact_speed", 0.4', "dependence", "of one input"),
    (PAIR, f'{PAIR}, ["stature", "impact_speed", 0.4]', "dependence", "repeated"),
    ("0.4]", "1.0]", "dependence", "not within -1 and 1"),
    (PAIR, '["impact_speed", "stature", 0.9], ["stature", "facing_angle", 0.9], '
           '["impact_speed", "facing_angle", -0.9]', "dependence", "contradict"),
    (STATURE, 'distribution = "growth-chart"\nunit = "cm"\nage = "age"\nat = [1.0, 2.0]\n'
              "L = [1.0, 1.0]\nM = [120.0, 121.0]\nS = [0.04, 0.04]",
     "inputs.stature depends on age"),
]  # fmt: skip


@pytest.mark.parametrize("row", BAD, ids=lambda row: str(row[-1])[:40])
def test_bad_files_get_one_line_that_names_the_place(row: tuple[Any, ...]) -> None:
    edits, parts = edits_of(row)
    message = complaint(edited(*edits))
    for part in parts:
        assert part in message


def test_files_that_cannot_be_read_are_named_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(bytes(range(256)))
    (tmp_path / "broken.toml").write_text("seed = ")
    (tmp_path / "wrong.toml").write_text(edited(("seed = 7", "sede = 7")))
    (tmp_path / "empty.toml").write_text("")
    for path in (tmp_path / "missing.toml", tmp_path, *tmp_path.iterdir()):
        with pytest.raises(UserError) as caught:
            load_study(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert len(str(caught.value).splitlines()) == 1
    # Windows ends its lines otherwise.
    (tmp_path / "small.toml").write_bytes(STUDY.replace("\n", "\r\n").encode())
    assert load_study(tmp_path / "small.toml") == parse_study(STUDY)


@quiet(200)
@given(content=st.one_of(st.binary(), st.text().map(str.encode)))
def test_any_file_is_a_study_or_a_user_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "any.toml"
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


@st.composite
def mutilated(draw: st.DrawFn) -> str:
    """Return the small study with a few values, keys and lines gone wrong."""
    lines = STUDY.splitlines()
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


@quiet(150)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@given(mutilated())
def test_a_mutilated_study_runs_or_is_a_user_error(text: str) -> None:
    try:
        study = parse_study(text)
        if not isinstance(study, MonteCarloStudy) or study.design.n > 10_000:
            return
        columns = sample_inputs(study, MODEL)
    except UserError:
        return
    assert all(np.isfinite(values).all() for values in columns.values())


def topics(*edits: tuple[str, str], model: FakeSimulator = MODEL) -> dict[str, str]:
    return numbers_digest(monte_carlo(edited(*edits)), model)


@pytest.mark.parametrize("edit", [
    ("n = 40", "n = 400"), ("histories = 2", "histories = 0"), (OUTPUTS, 'outputs = ["wad"]'),
    ("histories = 2", REFERENCE.format('kind = "observed"')),
    ('title = "A small study"', 'title = "Another title"'), ('name = "small"', 'name = "other"'),
    ("max_failure_rate = 0.1", "max_failure_rate = 0.5"), ("low = 60.0", "low = 60"),
    ("seed = 7", "seed = 7   # a remark"),
])  # fmt: skip
def test_what_does_not_change_the_numbers_does_not_change_the_digest(edit: tuple[str, str]) -> None:
    assert topics(edit) == topics()
    assert hash_of(topics(edit)) == hash_of(topics())


@pytest.mark.parametrize(("old", "new", "differing"), [
    ("seed = 7", "seed = 8", {"seed"}),
    ('vehicle = "car"', 'vehicle = "van"', {"model"}),
    ('name = "toy"', 'name = "other"', {"model"}),
    (DESIGN, 'method = "monte-carlo"\nn = 40', {"design.method", "design.replicate_size"}),
    ("replicate_size = 20", "replicate_size = 10", {"design.replicate_size"}),
    ("0.4]", "0.5]", {"dependence"}),
    ("sd = 2.0", "sd = 2.1", {"inputs.impact_speed"}),
    ('unit = "deg"', 'unit = "rad"', {"inputs.facing_angle"}),
    ("value = 24000", "value = 25000", {"fixed.body_mass"}),
    ("[fixed]", "[fixed]\nage = { value = 8, unit = 'year' }", {"fixed.age"}),
])  # fmt: skip
def test_what_changes_the_numbers_changes_the_digest_under_its_name(
    old: str, new: str, differing: set[str]
) -> None:
    changed, held = topics((old, new)), topics()
    assert {k for k in {*changed, *held} if changed.get(k) != held.get(k)} == differing
    assert hash_of(changed) != hash_of(held)


def test_the_models_version_and_the_order_and_number_of_inputs_change_the_digest() -> None:
    assert topics(model=replace(MODEL, version="2"))["model"] != topics()["model"]
    block = f"[inputs.impact_speed]\n{SPEED}\n\n"
    swapped = ((block, ""), ("[fixed]", f"{block}[fixed]"))
    assert topics(*swapped)["inputs"] != topics()["inputs"]
    assert not np.array_equal(use(edited(*swapped))["impact_speed"], use(STUDY)["impact_speed"])
    added = "[inputs.age]\ndistribution='uniform'\nunit='year'\nlow=7\nhigh=8\n[fixed]"
    assert set(topics(("[fixed]", added))) - set(topics()) == {"inputs.age"}
