"""The finite-element crash model: declared, refused, and in the slow tier run."""

from typing import Any

import numpy as np
import pytest

from models.effects.registry import effects_of
from models.protocol import Model
from models.registry import load_model

SHEET = ("sheet_thickness", "yield_stress", "rib_depth")


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("fem", {"element_size": 0.04})


def test_it_has_the_inputs_and_outputs_of_the_multibody_model_and_those_of_the_sheet(
    model: Model,
) -> None:
    multibody = load_model("multibody")
    own = {item.name: item for item in model.inputs}
    assert set(own) - {item.name for item in multibody.inputs} == set(SHEET)
    for item in multibody.inputs:
        assert (own[item.name].nominal, own[item.name].unit) == (item.nominal, item.unit)
    assert not any(item.ignored for item in model.inputs)
    names = [output.name for output in model.outputs]
    assert names[: len(multibody.outputs)] == [output.name for output in multibody.outputs]
    assert {"permanent_dent", "dent_behind_edge", "hood_energy_residual"} <= set(names)
    assert model.effects == effects_of("fem")
    assert "hood_bottoming" not in model.effects


@pytest.mark.parametrize(
    ("options", "effects", "message"),
    [
        ({"vehicle": "suv_high_front"}, {}, "has no finite elements"),
        ({"element_size": 0.5}, {}, "element_size must lie within"),
        ({"element_size": 0.04}, {"hood_yield": {}}, "hood_yield"),
    ],
)
def test_what_it_cannot_do_is_refused(
    options: dict[str, Any], effects: dict[str, dict[str, float]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        load_model("fem", options, effects)


def test_a_body_that_never_touches_the_car_costs_no_shells(model: Model) -> None:
    assert model.run({"lateral_offset": -1.9}).status == "no_contact"


@pytest.mark.slow
def test_the_nominal_crash_dents_the_hood_and_throws_the_child(model: Model) -> None:
    run = model.run({})
    assert run.status == "ok"
    found = run.outputs
    assert all(np.isfinite(value) for value in found.values())
    assert abs(found["energy_residual"]) < 0.01
    assert abs(found["hood_energy_residual"]) < 0.02
    assert 10.0 < found["throw_distance"] < 17.0
    assert 1.2 < found["wad"] < 1.4
    assert 0.0 <= found["permanent_dent"] <= found["hood_intrusion"] < 0.1
    assert run.scene is not None
    meshes = {mesh.name: mesh for mesh in run.scene.meshes}
    assert {"car", "hood", "head"} <= set(meshes)
    again = load_model("fem", {"element_size": 0.04}).run({})
    assert dict(again.outputs) == dict(found)
