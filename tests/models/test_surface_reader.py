"""Meshes of a user's own: formats, units, placing, and what is wrong said in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from builders import Array

from models.vehicle.profile import load_vehicle, vehicle_names, wrap_around_distance
from models.vehicle.surface.generator import generate_surface
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.reader import UNITS, read_surface
from models.vehicle.surface.wrap import section, wrap_line
from models.vehicle.tape import tape_over

NAME = "family_car_1990s"


def car() -> SurfaceMesh:
    return generate_surface(NAME)


def write(path: Path, nodes: Array, facets: Array) -> Path:
    trimesh.Trimesh(nodes, facets, process=False).export(path)
    return path


def write_keyword(path: Path, mesh: SurfaceMesh) -> Path:
    """Write an LS-DYNA keyword file with a part a region, and some quads."""
    lines = ["*KEYWORD", "*NODE"]
    lines += [
        f"{10 * k + 7:8d}{x:16.9g}{y:16.9g}{z:16.9g}" for k, (x, y, z) in enumerate(mesh.nodes)
    ]
    lines.append("*ELEMENT_SHELL")
    for k, (facet, part) in enumerate(zip(mesh.facets, mesh.region, strict=True)):
        a, b, c = 10 * facet + 7
        lines.append(f"{k + 1:8d}{part + 1:8d}{a:8d}{b:8d}{c:8d}{c:8d}")
    path.write_text("\n".join([*lines, "*END", ""]))
    return path


@pytest.mark.parametrize("ending", ["stl", "ply", "obj", "k"])
def test_a_car_of_every_format_is_the_car(ending: str, tmp_path: Path) -> None:
    mesh, path = car(), tmp_path / f"car.{ending}"
    shifted = replace(mesh, nodes=1000.0 * (mesh.nodes + np.array([3.0, 0.2, 0.0])))
    if ending == "k":
        write_keyword(path, shifted)
    else:
        write(path, shifted.nodes, shifted.facets)
    found = read_surface(path, "mm")
    assert found.mesh.is_closed
    assert found.mesh.volume == pytest.approx(mesh.volume, rel=1e-4)
    np.testing.assert_allclose(found.mesh.box, mesh.box + [[0.001, 0, 0]] * 2, atol=2e-3)
    assert len(found.mesh.facets) == pytest.approx(len(mesh.facets), rel=2e-3)
    if ending == "k":
        assert len(found.mesh.names) == len(mesh.names)
        assert found.mesh.names[0] == "part 1"


@pytest.mark.parametrize("unit", UNITS)
def test_another_unit_is_named(unit: str, tmp_path: Path) -> None:
    mesh = car()
    path = write(tmp_path / "car.stl", mesh.nodes / UNITS[unit], mesh.facets)
    assert read_surface(path, unit).mesh.volume == pytest.approx(mesh.volume, rel=1e-3)
    wrong = "mm" if unit == "m" else "m"
    with pytest.raises(ValueError, match=f"Give --unit {unit}$"):
        read_surface(path, wrong)


TURNS = {
    "upside down": ([1.0, -1.0, -1.0], "it stands upside down"),
    "backwards": ([-1.0, -1.0, 1.0], "it faces backwards"),
}


@pytest.mark.parametrize("turn", TURNS)
def test_a_car_that_stands_wrongly_is_refused(turn: str, tmp_path: Path) -> None:
    mesh = car()
    signs, said = TURNS[turn]
    nodes = mesh.nodes * signs
    nodes[:, 2] += 0.2 - nodes[:, 2].min()
    with pytest.raises(ValueError, match=said):
        read_surface(write(tmp_path / "car.ply", nodes, mesh.facets))
    swapped = mesh.nodes[:, [1, 0, 2]]
    with pytest.raises(ValueError, match="turn it so that x points forward and z up"):
        read_surface(write(tmp_path / "turned.ply", swapped, mesh.facets))


def test_a_car_that_floats_is_lifted(tmp_path: Path) -> None:
    mesh = car()
    path = write(tmp_path / "car.stl", mesh.nodes - [0.0, 0.0, 0.8], mesh.facets)
    with pytest.raises(ValueError, match=r"lift it by --lift \+0\.79"):
        read_surface(path)
    assert read_surface(path, lift=0.8).mesh.box[0, 2] == pytest.approx(mesh.box[0, 2], abs=1e-4)


def test_what_is_open_turned_or_without_area_is_said(tmp_path: Path) -> None:
    mesh = car()
    middle = mesh.corners.mean(axis=1)
    kept = mesh.facets[(middle[:, 0] > -2.5) & (middle[:, 2] > 0.25)]
    opened = read_surface(write(tmp_path / "open.ply", mesh.nodes, kept))
    assert any("the surface is open" in note for note in opened.notes)
    over = mesh.nodes * [1.0, -1.0, -1.0] + np.array([0.0, 0.0, 1.7])
    with pytest.raises(ValueError, match="open above; it stands upside down"):
        read_surface(write(tmp_path / "over.ply", over, kept))
    turned = read_surface(write(tmp_path / "turned.ply", mesh.nodes, mesh.facets[:, ::-1]))
    assert any("faced inwards" in note for note in turned.notes)
    assert turned.mesh.volume == pytest.approx(mesh.volume, rel=1e-4)
    flat = np.concatenate([mesh.facets, [[0, 0, 1]]])
    bad = read_surface(write(tmp_path / "flat.ply", mesh.nodes, flat))
    assert any("1 facets without an area" in note for note in bad.notes)
    flipped = mesh.facets.copy()
    flipped[100] = flipped[100, ::-1]
    with pytest.raises(ValueError, match="edges have facets that face opposite sides"):
        read_surface(write(tmp_path / "flipped.ply", mesh.nodes, flipped))


def test_files_that_are_no_meshes_are_refused_in_one_line(tmp_path: Path) -> None:
    contents = {
        "empty.stl": b"", "text.ply": b"ply\nhello\n", "text.obj": b"no mesh here\n",
        "shells.k": b"*KEYWORD\n*NODE\n*END\n", "car.step": b"ISO-10303-21;",
        "broken.stl": b"\x00" * 90, "line.obj": b"v 0 0 0\nv 1 0 0\nl 1 2\n",
    }  # fmt: skip
    for name, content in contents.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(ValueError, match=name) as error:
            read_surface(path)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="is no file"):
        read_surface(tmp_path / "none.stl")
    with pytest.raises(ValueError, match="unit must be one of"):
        read_surface(tmp_path / "empty.stl", "furlong")


def test_a_shell_with_a_node_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = write_keyword(tmp_path / "car.k", car())
    text = path.read_text().replace(
        "*ELEMENT_SHELL\n",
        f"*ELEMENT_SHELL\n{99999:8d}" + "".join(f"{v:8d}" for v in (1, 7, 17, 27, 123456)) + "\n",
    )
    path.write_text(text)
    with pytest.raises(ValueError, match="names node 123456"):
        read_surface(path)


def test_the_wrap_around_distance_of_the_middle_is_that_of_the_zones() -> None:
    mesh, vehicle = car(), load_vehicle(NAME)
    for name in ("hood", "windscreen"):
        row = vehicle.zone_index(name)
        zone = vehicle.zones[row]
        point = np.asarray(zone.origin + 0.5 * zone.length * zone.direction)
        distance = wrap_around_distance(NAME, row, point)
        found = wrap_line(mesh, distance, np.array([0.011]))[0]
        np.testing.assert_allclose(found[[0, 2]], point, atol=0.01)


@pytest.mark.parametrize("name", vehicle_names())
def test_a_wrap_around_line_runs_smoothly_across_the_car_and_is_alike_on_both_sides(
    name: str,
) -> None:
    # Stations that fall between the nodes in every way.
    stations = np.linspace(-0.62, 0.62, 63)
    mesh = generate_surface(name)
    for distance in (1.0, 1.3, 1.7):
        line = wrap_line(mesh, distance, stations)
        assert np.isfinite(line).all()
        assert np.abs(np.diff(line[:, 0])).max() < 0.02
        np.testing.assert_allclose(line[:, [0, 2]], line[::-1][:, [0, 2]], atol=0.002)


def test_a_tape_over_a_quarter_circle_has_its_length() -> None:
    # From the road straight up to the circle's foremost point, then along it.
    angle = np.linspace(0.0, 0.5 * np.pi, 400)
    arc = np.stack([0.5 * np.cos(angle) - 0.5, 0.6 + 0.5 * np.sin(angle)], axis=1)
    path = tape_over(arc)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert length == pytest.approx(0.6 + 0.25 * np.pi, rel=1e-4)
    box = trimesh.creation.box(extents=(1.0, 1.0, 1.0))
    mesh = SurfaceMesh(
        np.asarray(box.vertices, float), np.asarray(box.faces, np.int64),
        np.zeros(12, np.int64), ("box",),
    )  # fmt: skip
    points = section(mesh, 0.1).reshape(-1, 2)
    np.testing.assert_allclose(np.abs(points).max(axis=0), [0.5, 0.5])
    assert len(section(mesh, 2.0)) == 0
    assert np.isnan(wrap_line(mesh, 50.0, np.array([0.0, 2.0]))).all()
