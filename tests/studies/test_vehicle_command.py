"""The command that shows what is understood of a car's mesh."""

import json
from pathlib import Path

import pytest
import trimesh
from headform_studies import mcstudy, told


@pytest.fixture
def bus(tmp_path: Path) -> Path:
    """Return a box of the size of a small bus in mm, 0.3 m above the road."""
    box = trimesh.creation.box(extents=(4500.0, 1800.0, 1600.0))
    box.apply_translation((0.0, 0.0, 300.0 + 800.0))
    path = tmp_path / "bus.stl"
    box.export(path)
    return path


def test_a_mesh_is_shown_with_its_regions_and_a_picture(bus: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    said = mcstudy("vehicle", bus, "--unit", "mm", "--out", out, "--json")
    assert (said.code, said.err) == (0, "")
    found = json.loads(said.out)
    assert found["closed"] is True
    assert (found["facets"], found["nodes"], found["open_edges"]) == (12, 8, 0)
    assert found["box"][0] == pytest.approx([-4.5, -0.9, 0.3])
    assert found["box"][1] == pytest.approx([0.0, 0.9, 1.9])
    (area,) = found["regions"].values()
    assert area == pytest.approx(2.0 * (4.5 * 1.8 + 4.5 * 1.6 + 1.8 * 1.6))
    assert Path(found["picture"]).read_bytes().startswith(b"\x89PNG")
    shown = mcstudy("vehicle", bus, "--unit", "mm", "--out", out)
    assert "foremost point and middle" in shown.out and "surface.png" in shown.out
    assert mcstudy("vehicle", bus, "--unit", "mm", "--out", out, "--quiet").out == ""


def test_a_wrong_unit_is_one_line(bus: Path, tmp_path: Path) -> None:
    line = told(mcstudy("vehicle", bus, "--out", tmp_path / "out"))
    assert "Give --unit mm" in line
    assert not (tmp_path / "out").exists()
