"""A user's own deck of shells: what is read, in which units, and what is refused."""

from pathlib import Path

import lsdyna_mesh_reader
import numpy as np
import pytest
import trimesh
from builders import Array
from hypothesis import given, settings
from hypothesis import strategies as st
from lsdyna_mesh_reader import examples

from models.registry import load_model
from models.vehicle.car import load_car
from models.vehicle.structure.deck import UNITS, read_deck
from models.vehicle.structure.hardening import fit_hardening
from models.vehicle.structure.keywords import read_blocks
from models.vehicle.surface.generator import generate_surface, loft_of

NAME = "family_car_1990s"
SHIFT = np.array([0.4, -0.2, 0.1])
"""m by which the user's axes lie off the car's."""
STEEL = (7850.0, 210e9, 0.3, 200e6, 900e6)
"""kg/m3, Pa, -, Pa and Pa: density, Young's modulus, Poisson's ratio, yield stress, slope."""


def hood_sheet() -> tuple[Array, Array]:
    """Return nodes (m) and cells of a coarse sheet on the hood, 18 along and 28 across."""
    loft = loft_of(NAME)
    along, across = np.linspace(0.75, 1.68, 19), np.linspace(-0.72, 0.72, 29)
    a, y = (g.ravel() for g in np.meshgrid(along, across, indexing="ij"))
    i, j = (g.ravel() for g in np.meshgrid(np.arange(18), np.arange(28), indexing="ij"))
    k = i * 29 + j
    return loft.points(a, y), np.stack([k, k + 1, k + 30, k + 29], axis=1)


def deck_text(units: str, sheet: tuple[Array, Array], *, comma: bool = False) -> str:
    """Return a keyword file of a sheet fixed along its border, in units of its own."""
    length, time, mass = UNITS[units]
    pressure, density = mass / length / time**2, mass / length**3
    nodes, cells = sheet
    nodes = (nodes + SHIFT * np.array([1.0, 1.0, 0.0])) / length
    rho, young, poisson, limit, slope = STEEL
    tangent = young * slope / (young + slope)
    card = (lambda *v: ",".join(str(x) for x in v)) if comma else (
        lambda *v: "".join(f"{x:>10.4g}" if isinstance(x, float) else f"{x:>10}" for x in v)
    )  # fmt: skip
    edge = np.unique([
        k for k in range(len(nodes)) if k % 29 in (0, 28) or k // 29 in (0, 18)
    ])  # fmt: skip
    lines = ["*KEYWORD", "*TITLE", "own hood", "$ a comment", "*CONTROL_TERMINATION", card(100.0)]
    lines += ["*NODE"]
    for k, (x, y, z) in enumerate(nodes):
        lines.append(f"{k + 11},{x:.9g},{y:.9g},{z:.9g}" if comma else
                     f"{k + 11:>8}{x:>16.9g}{y:>16.9g}{z:>16.9g}")  # fmt: skip
    lines += ["*ELEMENT_SHELL"]
    for k, cell in enumerate(cells + 11):
        row = (k + 1, 7, *cell.tolist())
        lines.append(card(*row) if comma else "".join(f"{v:>8}" for v in row))
    lines += ["*PART", "hood outer", card(7, 3, 5)]
    lines += ["*SECTION_SHELL_TITLE", "sheet", card(3, 16, 0.8333, 3), card(*[0.001 / length] * 4)]
    lines += ["*MAT_PIECEWISE_LINEAR_PLASTICITY",
              card(5, rho / density, young / pressure, poisson, limit / pressure,
                   tangent / pressure, 1e21),
              card(40.0 * time, 5.0)]  # fmt: skip
    lines += ["*SET_NODE_LIST", card(9)]
    held = (edge + 11).tolist()
    lines += [card(*held[k : k + 8]) for k in range(0, len(held), 8)]
    lines += ["*BOUNDARY_SPC_SET", card(9, 0, 1, 1, 1, 1, 1, 1), "*END", "not read"]
    return "\n".join(lines)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a user's mesh in mm and a deck in each unit system."""
    place = tmp_path_factory.mktemp("deck")
    mesh, sheet = generate_surface(NAME), hood_sheet()
    moved = 1000.0 * (mesh.nodes + SHIFT * np.array([1.0, 1.0, 0.0]))
    trimesh.Trimesh(moved, mesh.facets, process=False).export(place / "car.stl")
    for units in UNITS:
        (place / f"{units}.k").write_text(deck_text(units, sheet, comma=units == "mm-s-t"))
        (place / f"{units}.toml").write_text(
            f'format = "mcstudy-car/1"\nvehicle = "{NAME}"\nunit = "mm"\nzone = "hood"\n'
            f'mesh = "car.stl"\n'
            f'[shells]\ndeck = "{units}.k"\nunits = "{units}"\n'
        )
    return place


def test_a_deck_is_the_same_front_in_any_units(folder: Path) -> None:
    found = [read_deck(folder / f"{units}.k", units) for units in UNITS]
    for deck in found:
        assert deck.names == ("hood outer",)
        assert deck.thickness[0] == pytest.approx(0.001)
        row = [
            getattr(deck.materials, name)[0]
            for name in ("density", "young", "poisson", "yield_stress", "slope", "rate", "exponent")
        ]
        assert row == pytest.approx([*STEEL, 40.0, 5.0], rel=2e-3)
        assert deck.held.sum() == 2 * 29 + 2 * 17
        np.testing.assert_allclose(deck.position, found[0].position, atol=1e-7)
        np.testing.assert_array_equal(deck.elements, found[0].elements)


def test_a_headform_hits_a_users_hood_and_dents_it(folder: Path) -> None:
    hits = []
    for units in UNITS:
        model = load_model("headform", {"surface": "fem", "vehicle": str(folder / f"{units}.toml")})
        run = model.run({"wrap_around_distance": 1.3, "lateral_position": 0.1})
        assert run.status in ("ok", "hourglass")
        hits.append(run.outputs)
    first = hits[0]
    assert abs(first["energy_residual"]) < 0.01
    assert 0.01 < first["hood_intrusion"] < 0.12
    for other in hits[1:]:
        for name in ("hic15", "hood_intrusion", "peak_force"):
            assert other[name] == pytest.approx(first[name], rel=0.02), name
    softer = load_model("headform", {"surface": "fem", "vehicle": str(folder / "m-s-kg.toml")})
    thin = softer.run({"wrap_around_distance": 1.3, "lateral_position": 0.1,
                       "sheet_thickness": 0.8})  # fmt: skip
    assert thin.outputs["hood_intrusion"] > first["hood_intrusion"]
    with pytest.raises(ValueError, match="no ribs"):
        softer.run({"rib_depth": 0.8})


def test_the_deck_lies_on_the_placed_car(folder: Path) -> None:
    car = load_car(str(folder / "mm-ms-kg.toml"))
    assert car.own_shells is not None
    panel = car.own_shells.panels[0]
    assert panel.outer.all()
    np.testing.assert_array_equal(np.unique(panel.zone), [car.vehicle.zone_index("hood")])
    sheet, _ = hood_sheet()
    np.testing.assert_allclose(panel.position, sheet, atol=2e-3)


@pytest.mark.parametrize("name", ["birdball", "bracket", "joint_screw", "simple_plate", "wheel"])
def test_nodes_of_foreign_files_are_read_as_another_reader_does(name: str) -> None:
    path = Path(getattr(examples, name))
    blocks = [block for block in read_blocks(path) if block.name == "NODE"]
    known = lsdyna_mesh_reader.Deck(str(path)).node_sections
    assert sum(len(b.cards) for b in blocks) == sum(len(section.nid) for section in known)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("*CONTROL_TERMINATION", "*INCLUDE", "line 5: \\*INCLUDE is not read"),
        ("*CONTROL_TERMINATION", "*CONTACT_AUTOMATIC_SINGLE_SURFACE", "CONTACT_AUTOMATIC"),
        ("*KEYWORD", "*KEYWORD LONG=Y", "long format"),
        ("*PIECEWISE", "", "is no keyword"),
        ("*MAT_PIECEWISE_LINEAR_PLASTICITY", "*MAT_JOHNSON_COOK", "MAT_JOHNSON_COOK is not read"),
        ("1e+21", "  0.3", "fails \\(FAIL 0.3\\)"),
        ("         3        16", "         3         4", "element formulation 4"),
        ("         7         3         5", "         7         4         5", "section 4"),
        ("         7         3         5", "         7         3         6", "material 6"),
        (
            "         7         3         5",
            "         8         3         5",
            "part 7, which is not",
        ),
        ("     0.001     0.001", "     0.001     0.002", "one thickness"),
        ("$ a comment", "$\n*PARAMETER", "PARAMETER is not read"),
        ("   2.1e+11", "   &young ", "parameters"),
        ("   2.1e+11", "       abc", "Young's modulus must be a number"),
        ("         9         0         1", "         8         0         1", "set 8"),
        ("\n      11 ", "\n      12 ", "defined twice"),
    ],
)
def test_what_is_not_read_is_refused_with_its_line(
    folder: Path, old: str, new: str, message: str
) -> None:
    text = (folder / "m-s-kg.k").read_text()
    if old == "*PIECEWISE":
        text = "first line\n" + text
        message = "line 1: a keyword file begins"
    else:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "broken.k").write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        read_deck(folder / "broken.k", "m-s-kg")
    assert "\n" not in str(error.value)


def test_a_panel_that_nothing_holds_is_refused(folder: Path) -> None:
    text = (folder / "m-s-kg.k").read_text().replace("*BOUNDARY_SPC_SET", "*DATABASE_NOTHING")
    (folder / "loose.k").write_text(text)
    table = (folder / "m-s-kg.toml").read_text().replace("m-s-kg.k", "loose.k")
    (folder / "loose.toml").write_text(table)
    with pytest.raises(ValueError, match="'hood outer' is held by nothing"):
        load_car(str(folder / "loose.toml"))


def test_what_the_front_does_without_can_be_named(folder: Path) -> None:
    text = (folder / "m-s-kg.k").read_text().replace("1e+21", "  0.3")
    text = text.replace("*CONTROL_TERMINATION", "*CONTACT_AUTOMATIC_SINGLE_SURFACE")
    (folder / "named.k").write_text(text)
    deck = read_deck(folder / "named.k", "m-s-kg", ["FAIL", "CONTACT_"])
    assert any("CONTACT_AUTOMATIC_SINGLE_SURFACE left out" in note for note in deck.notes)
    assert any("failure at 0.3 is left out" in note for note in deck.notes)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('deck = "m-s-kg.k"\nunits = "inch"', "units must be one of"),
        ('deck = "m-s-kg.k"\nunits = "mm-ms-kg"', "no shell lies within"),
        ('deck = "m-s-kg.k"', "shells.units: must be a text"),
        ('deck = "none.k"\nunits = "m-s-kg"', "cannot be read"),
        ('deck = "m-s-kg.k"\nunits = "m-s-kg"\ndepth = 1', "shells: is a table with"),
        ('deck = "m-s-kg.k"\nunits = "m-s-kg"\nignore = "FAIL"', "list of keywords"),
    ],
)
def test_a_table_of_shells_that_does_not_fit_is_refused(
    folder: Path, table: str, message: str
) -> None:
    text = (folder / "m-s-kg.toml").read_text()
    (folder / "other.toml").write_text(text[: text.index("[shells]")] + "[shells]\n" + table)
    with pytest.raises(ValueError, match=message):
        load_car(str(folder / "other.toml"))


def test_a_car_file_without_shells_has_no_finite_elements(folder: Path) -> None:
    text = (folder / "m-s-kg.toml").read_text()
    (folder / "plain.toml").write_text(text[: text.index("[shells]")])
    for name, options in (("fem", {}), ("headform", {"surface": "fem"})):
        with pytest.raises(ValueError, match="has no finite elements"):
            load_model(name, {"vehicle": str(folder / "plain.toml"), **options})


@settings(max_examples=60, deadline=None)
@given(
    limit=st.floats(1e8, 6e8), slope=st.floats(0.0, 2e9), more=st.floats(0.0, 3e8),
    scale=st.floats(0.005, 0.3), points=st.integers(6, 40),
)  # fmt: skip
def test_hardening_of_its_own_form_is_found_again(
    limit: float, slope: float, more: float, scale: float, points: int
) -> None:
    p = np.linspace(0.0, 0.5, 60 + points)
    stress = limit + slope * p + more * (1.0 - np.exp(-p / scale))
    (y, h, q, s), error = fit_hardening(np.column_stack([p, stress]))
    assert error < 0.02
    found = y + h * p + q * (1.0 - np.exp(-p / s))
    np.testing.assert_allclose(found, stress, rtol=0.02)


def test_hardening_of_other_forms_is_met_or_refused() -> None:
    p = np.linspace(0.0, 0.5, 40)
    # Swift's law of a deep-drawing steel, and a plateau before hardening.
    swift = 550e6 * (0.008 + p) ** 0.22
    assert fit_hardening(np.column_stack([p, swift]))[1] < 0.05
    plateau = np.where(p < 0.1, 200e6, 200e6 + 3e9 * (p - 0.1))
    with pytest.raises(ValueError, match="only"):
        fit_hardening(np.column_stack([p, plateau]))
    with pytest.raises(ValueError, match="falls"):
        fit_hardening(np.column_stack([p, swift[::-1]]))
    with pytest.raises(ValueError, match="begin at plastic strain 0"):
        fit_hardening(np.column_stack([p + 0.01, swift]))
