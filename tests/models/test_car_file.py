"""A car file: a user's mesh with the laws of a vehicle, and the models that run on it."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from models.registry import load_model
from models.vehicle.car import load_car
from models.vehicle.profile import hood_edge_distance
from models.vehicle.surface.field import distances
from models.vehicle.surface.field_build import build_field
from models.vehicle.surface.generator import generate_surface
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.wrap import leading_edge_distance, section

NAME = "family_car_1990s"
HEAD = f'format = "mcstudy-car/1"\nvehicle = "{NAME}"\nunit = "mm"\nzone = "hood"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the parts of an open car front in mm, a file a zone."""
    place = tmp_path_factory.mktemp("car")
    mesh = generate_surface(NAME)
    middle = mesh.corners.mean(axis=1)
    kept = (middle[:, 0] > -2.9) & (middle[:, 2] > 0.23)
    for k, name in enumerate(mesh.names):
        own = mesh.facets[kept & (mesh.region == k)]
        trimesh.Trimesh(1000.0 * mesh.nodes, own, process=False).export(place / f"{name}.stl")
    text = HEAD + 'mesh = "hood.stl"\n'
    for name in mesh.names:
        if name != "hood":
            zone = "grille" if name == "lamp" else name
            text += f'[[regions]]\nzone = "{zone}"\nfile = "{name}.stl"\n'
    (place / "car.toml").write_text(text)
    return place


def test_a_mesh_in_files_of_its_zones_is_the_car_that_it_was_made_of(folder: Path) -> None:
    car, made = load_car(str(folder / "car.toml")), load_car(NAME)
    assert car.digest and not made.digest
    assert not car.mesh.is_closed and any("is open" in note for note in car.notes)
    rng = np.random.default_rng(4)
    # Within 60 mm of the hood, the windscreen and the bumper, away from the open edges.
    on = made.mesh.corners.mean(axis=1)
    on = on[(on[:, 0] > -2.4) & (on[:, 2] > 0.35) & (np.abs(on[:, 1]) < 0.7)]
    points = rng.choice(on, 3000) + rng.uniform(-0.03, 0.03, (3000, 3))
    found, expected = distances(car.field(), points)[0], distances(made.field(), points)[0]
    assert np.quantile(np.abs(found - expected), 0.99) < 0.003
    for options in ({}, {"lateral_position": -0.6}, {"wrap_around_distance": 0.8}):
        own, other = (
            load_model("headform", {"surface": "facet", "vehicle": name}).run(options).outputs
            for name in (str(folder / "car.toml"), NAME)
        )
        assert own["hic15"] == pytest.approx(other["hic15"], rel=0.02)


def test_a_crash_with_a_users_mesh_is_that_with_the_car_it_was_made_of(folder: Path) -> None:
    own, made = (
        load_model("facet", {"vehicle": name}) for name in (str(folder / "car.toml"), NAME)
    )
    assert own.version != made.version
    first, second = own.run({}), made.run({})
    assert first.status == second.status == "ok"
    for name, share in {"hic15": 0.03, "wad": 0.01, "head_impact_speed": 0.02}.items():
        assert first.outputs[name] == pytest.approx(second.outputs[name], rel=share), name


@pytest.mark.parametrize(
    ("rules", "zone"),
    [
        ('[[regions]]\nzone = "windscreen"\nbox = [[-1.0, -2, 0], [-0.5, 2, 3]]', "windscreen"),
        ('[[regions]]\nzone = "roof"\npart = "hood.stl"', "roof"),
        # The first rule that covers a facet gives its zone.
        ('[[regions]]\nzone = "roof"\npart = "hood.stl"\n'
         '[[regions]]\nzone = "windscreen"\nbox = [[-9, -9, 0], [0, 9, 9]]', "roof"),
    ],
)  # fmt: skip
def test_regions_are_given_by_part_or_box(
    folder: Path, tmp_path: Path, rules: str, zone: str
) -> None:
    whole = generate_surface(NAME)
    path = tmp_path / "hood.stl"
    trimesh.Trimesh(1000.0 * whole.nodes, whole.facets, process=False).export(path)
    own = tmp_path / "car.toml"
    own.write_text(HEAD + f'mesh = "{path}"\n' + rules)
    mesh = load_car(str(own)).mesh
    middle = mesh.corners.mean(axis=1)
    there = (middle[:, 0] > -1.0) & (middle[:, 0] < -0.5)
    expected = there if "box = [[-1.0" in rules else np.full(len(middle), fill_value=True)
    np.testing.assert_array_equal(mesh.region == mesh.names.index(zone), expected)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("mcstudy-car/1", "mcstudy-car/9"), 'format must be "mcstudy-car/1"'),
        (('zone = "hood"', 'zone = "boot"'), "zone: family_car_1990s has no zone 'boot'"),
        (('zone = "hood"', 'sone = "hood"'), "sone: unknown key"),
        (('unit = "mm"', 'unit = "m"'), "a car in mm"),
        (('unit = "mm"', 'unit = "yard"'), "unit must be one of"),
        ((NAME, "tank"), "no vehicle 'tank'"),
        (("hood.stl", "boot.stl"), "is no file"),
        (('file = "bumper.stl"', 'file = "nope.stl"'), "is no file"),
        (('file = "bumper.stl"', 'part = "nope"'), "has no part 'nope'"),
        (('file = "bumper.stl"', "box = [[9, 9, 9], [10, 10, 10]]"), "covers no facet"),
        (('file = "bumper.stl"', "box = [1, 2]"), "two corners"),
        (('file = "bumper.stl"', ""), "has zone and one of part, file and box"),
        (('file = "bumper.stl"', 'file = "bumper.stl"\npart = "a"'), "one of part, file and box"),
        (('mesh = "hood.stl"', "mesh = 3"), "mesh: must be a text"),
        (('mesh = "hood.stl"', 'mesh = "hood.stl"\nlift = "a"'), "lift: must be a height"),
        (("format", "[format"), "cannot be read"),
    ],
)
def test_a_wrong_car_file_is_told_in_one_line(
    folder: Path, edit: tuple[str, str], message: str
) -> None:
    text = (folder / "car.toml").read_text()
    assert edit[0] in text
    bad = folder / "bad.toml"
    bad.write_text(text.replace(*edit, 1))
    with pytest.raises(ValueError, match=r"^[^\n]*$") as told:
        load_model("facet", {"vehicle": str(bad)})
    assert message in str(told.value)
    with pytest.raises(ValueError, match="no vehicle"):
        load_model("multibody", {"vehicle": str(bad)})


def test_behind_an_open_sheet_is_inside() -> None:
    plate = trimesh.creation.box(extents=(1.0, 1.0, 0.4))
    for _ in range(3):
        plate = plate.subdivide()
    facets = np.asarray(plate.faces, dtype=np.int64)
    nodes = np.asarray(plate.vertices, dtype=float)
    top = nodes[facets].mean(axis=1)[:, 2] > -0.199
    regions = np.zeros(1, dtype=np.int64)
    open_, whole = (
        build_field(SurfaceMesh(nodes, kept, np.zeros(len(kept), np.int64), ("box",)), regions)
        for kept in (facets[top], facets)
    )
    rng = np.random.default_rng(2)
    points = rng.uniform([-0.55, -0.55, 0.03], [0.55, 0.55, 0.25], (5000, 3))
    np.testing.assert_allclose(distances(open_, points)[0], distances(whole, points)[0], atol=0.002)


def test_sheets_that_face_inwards_are_turned(tmp_path: Path) -> None:
    mesh = generate_surface(NAME)
    hood = mesh.facets[mesh.region == mesh.names.index("hood")][:, ::-1]
    rest = mesh.facets[mesh.region != mesh.names.index("hood")]
    for name, facets in (("hood", hood), ("rest", rest)):
        trimesh.Trimesh(mesh.nodes, facets, process=False).export(tmp_path / f"{name}.ply")
    # Sheets that share no nodes: the hood lies 1 mm above its place.
    lifted = mesh.nodes + np.array([0.0, 0.0, 0.001])
    trimesh.Trimesh(lifted, hood, process=False).export(tmp_path / "hood.ply")
    (tmp_path / "car.toml").write_text(
        HEAD.replace("mm", "m") + 'mesh = "rest.ply"\n[[regions]]\nzone = "hood"\nfile = "hood.ply"'
    )
    car = load_car(str(tmp_path / "car.toml"))
    assert any(f"{len(hood):,} facets of single sheets" in note for note in car.notes)
    above, below = (np.array([[-0.7, 0.0, z]]) for z in (0.88, 0.80))
    assert distances(car.field(), above)[0] > 0.0 > distances(car.field(), below)[0]


@pytest.mark.parametrize("name", ["family_car_1990s", "suv_high_front"])
def test_the_leading_edge_of_the_mesh_is_that_of_the_zones(name: str) -> None:
    lines = section(generate_surface(name), 0.011)
    assert leading_edge_distance(lines) == pytest.approx(hood_edge_distance(name), abs=0.012)
