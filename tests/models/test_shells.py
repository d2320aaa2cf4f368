"""The shell element and its explicit step: frequencies, twisted beam, rotation, plasticity."""

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from builders import Array
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from models.compilation import kernel
from models.shells.explicit import advance, build_shells, internal_forces, stable_step
from models.shells.material import Materials, flow_stress, return_to_yield
from models.shells.state import Nodes, Shells

STEEL = {"young": 210e9, "poisson": 0.3, "density": 7850.0}
CURVE = Path(__file__).parent / "data" / "curved_plate_calculix.csv"


@kernel
def run_free(nodes, shells, materials, step, count, loaded, load, history, frame, local):
    """Step a mesh under nodal forces ``load`` (count, l, 3) that vary in time.

    ``history`` (count, 3) is filled: kinetic energy (J), work of the loads (J), z of the first
    loaded node (m).
    """
    work = 0.0
    for k in range(count):
        internal_forces(nodes, shells, materials, step, frame, local)
        for i in range(loaded.shape[0]):
            for j in range(3):
                nodes.force[loaded[i], j] += load[k, i, j]
                work += 0.5 * step * load[k, i, j] * nodes.velocity[loaded[i], j]
        history[k, 1] = work
        # Velocities lie half a step before the first forces.
        count_of = nodes.mass.shape[0]
        history[k, 0] = advance(nodes, 0, count_of, step, step if k > 0 else 0.5 * step)
        for i in range(loaded.shape[0]):
            for j in range(3):
                work += 0.5 * step * load[k, i, j] * nodes.velocity[loaded[i], j]
        history[k, 2] = nodes.position[loaded[0], 2] if loaded.shape[0] > 0 else math.nan


def sheet_metal(
    young: float = 210e9, poisson: float = 0.3, density: float = 7850.0,
    yield_stress: float = math.inf, slope: float = 0.0, rate: float = math.inf,
) -> Materials:  # fmt: skip
    values = (young, poisson, density, yield_stress, slope, 0.0, 1.0, rate, 5.0)
    return Materials(*(np.array([value]) for value in values))


def grid(nx: int, ny: int, x: float, y: float) -> tuple[Array, Array]:
    """Return nodes and elements of a flat rectangle."""
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(0, x, nx + 1), np.linspace(0, y, ny + 1),
                                           indexing="ij"))  # fmt: skip
    i, j = (g.ravel() for g in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    a = i * (ny + 1) + j
    return np.stack([u, v, 0 * u], axis=1), np.stack([a, a + ny + 1, a + ny + 2, a + 1], axis=1)


def mesh(
    position: Array, node: Array, thickness: float, metal: Materials, points: int = 3
) -> tuple[Nodes, Shells]:
    count = len(node)
    return build_shells(
        position, node, np.full(count, thickness), np.zeros(count, dtype=np.int64), metal, points
    )


def forces(nodes: Nodes, shells: Shells, metal: Materials, step: float = 1.0) -> None:
    internal_forces(nodes, shells, metal, step, np.zeros((3, 3)), np.zeros(9))


def stiffness(position: Array, node: Array, thickness: float, metal: Materials) -> Array:
    """Return the stiffness matrix, node by node and displacements before rotations.

    All elements are taken apart, so that one call gives a column of each.
    """
    apart, own = position[node].reshape(-1, 3), np.arange(node.size).reshape(-1, 4)
    size, tiny = 6 * len(position), 1e-7
    whole = np.zeros((size, size))
    rows = (6 * node[:, :, None] + np.arange(6)).reshape(len(node), 24)
    for column in range(24):
        corner, way = divmod(column, 6)
        both = []
        for sign in (1.0, -1.0):
            nodes, shells = mesh(apart, own, thickness, metal)
            target = nodes.position if way < 3 else nodes.spin
            target[own[:, corner], way % 3] += sign * tiny
            forces(nodes, shells, metal)
            both.append(np.concatenate([nodes.force, nodes.moment], axis=1).reshape(-1, 24))
        found = -(both[0] - both[1]) / (2.0 * tiny)
        np.add.at(whole, (rows, rows[:, [column]]), found)
    return whole


def test_one_element_has_six_rigid_motions_and_a_symmetric_stiffness() -> None:
    warped = np.array([[0, 0, 0.0], [1.1, 0.1, 0.05], [1.0, 0.9, -0.04], [-0.1, 1.0, 0.06]])
    found = stiffness(warped, np.array([[0, 1, 2, 3]]), 0.05, sheet_metal())
    assert np.abs(found - found.T).max() < 1e-6 * np.abs(found).max()
    values = np.linalg.eigvalsh(0.5 * (found + found.T))
    assert np.abs(values[:6]).max() < 1e-9 * values[-1]
    assert values[6] > 1e-6 * values[-1]
    # A triangle, its last node twice.
    triangle = stiffness(warped[:3], np.array([[0, 1, 2, 2]]), 0.05, sheet_metal())
    values = np.linalg.eigvalsh(0.5 * (triangle + triangle.T))
    assert np.abs(values[:6]).max() < 1e-9 * values[-1]


@pytest.mark.parametrize(("cells", "within"), [(8, 0.015), (16, 0.01)])
def test_a_square_cantilever_plate_has_leissas_first_frequency(cells: int, within: float) -> None:
    # A. Leissa, J. Sound Vib. 31, 257, 1973: 3.4917 for a Poisson's ratio of 0.3.
    metal, thickness = sheet_metal(), 0.01
    position, node = grid(cells, cells, 1.0, 1.0)
    nodes, _ = mesh(position, node, thickness, metal)
    whole = stiffness(position, node, thickness, metal)
    weight = np.repeat(np.stack([nodes.mass, nodes.inertia], axis=1), 3, axis=1).ravel()
    free = np.repeat(position[:, 0] > 1e-9, 6)
    kept = 0.5 * (whole + whole.T)[np.ix_(free, free)]
    square = eigh(kept, np.diag(weight[free]), eigvals_only=True, subset_by_index=[0, 0])[0]
    flexural = 210e9 * thickness**3 / 12.0 / (1.0 - 0.09)
    expected = 3.4917 * math.sqrt(flexural / (7850.0 * thickness))
    assert math.sqrt(square) == pytest.approx(expected, rel=within)


@pytest.mark.parametrize("cells", [(12, 2), (24, 4)])
def test_a_twisted_beam_bends_as_published(cells: tuple[int, int]) -> None:
    # R. MacNeal and R. Harder, Finite Elem. Anal. Des. 1, 3, 1985: warped elements.
    metal = sheet_metal(29e6, 0.22, 1.0)
    flat, node = grid(*cells, 12.0, 1.1)
    angle, away = 0.5 * math.pi * flat[:, 0] / 12.0, flat[:, 1] - 0.55
    position = np.stack([flat[:, 0], away * np.cos(angle), away * np.sin(angle)], axis=1)
    whole = stiffness(position, node, 0.32, metal)
    free = np.repeat(position[:, 0] > 1e-9, 6)
    tip = np.flatnonzero(position[:, 0] > 12.0 - 1e-9)
    share = np.ones(len(tip))
    share[[0, -1]] = 0.5
    for way, expected in ((2, 5.424e-3), (1, 1.754e-3)):
        load = np.zeros((len(position), 6))
        load[tip, way] = share / share.sum()
        moved = np.zeros(whole.shape[0])
        moved[free] = np.linalg.solve(whole[np.ix_(free, free)], load.ravel()[free])
        found = moved.reshape(-1, 6)[tip[len(tip) // 2], way]
        assert found == pytest.approx(expected, rel=0.05)


def test_a_stressed_plate_keeps_stress_and_energy_while_it_turns() -> None:
    rng = np.random.default_rng(3)
    metal = sheet_metal()
    position, node = grid(3, 2, 0.3, 0.2)
    position[:, 2] = 0.01 * np.sin(20.0 * position[:, 0])
    nodes, shells = mesh(position, node, 0.001, metal)
    nodes.position[:] += 1e-5 * rng.standard_normal(nodes.position.shape)
    nodes.spin[:] = 1e-3 * rng.standard_normal(nodes.spin.shape)
    forces(nodes, shells, metal)
    nodes.spin[:] = 0.0
    forces(nodes, shells, metal)
    before = (shells.stress.copy(), shells.bow.copy(), shells.shear.copy(), shells.energy.copy())
    loads, places = nodes.force.copy(), nodes.position.copy()
    axis = np.array([1.0, -2.0, 0.5]) / math.sqrt(5.25)
    count, whole = 2000, 1.3 * math.pi
    cross = np.cross(np.eye(3), axis)

    def turn(angle: float) -> Array:
        return np.asarray(
            np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
        )

    for k in range(1, count + 1):
        nodes.position[:] = places @ turn(whole * k / count).T
        nodes.spin[:] = whole / count * axis
        forces(nodes, shells, metal)
    for old, new in zip(before, (shells.stress, shells.bow, shells.shear, shells.energy),
                        strict=True):  # fmt: skip
        np.testing.assert_allclose(new, old, atol=1e-9 * np.abs(old).max())
    np.testing.assert_allclose(nodes.force, loads @ turn(whole).T, atol=1e-9 * np.abs(loads).max())


def test_a_free_plate_keeps_its_energy_and_its_momentum() -> None:
    metal = sheet_metal()
    position, node = grid(8, 8, 0.4, 0.4)
    nodes, shells = mesh(position, node, 0.001, metal)
    nodes.velocity[:, 2] = 3.0 * np.sin(9.0 * position[:, 0]) * np.cos(7.0 * position[:, 1])
    step = stable_step(shells, metal)
    count = 4000
    history = np.zeros((count, 3))
    momentum = nodes.mass @ nodes.velocity
    start = 0.5 * float(nodes.mass @ np.square(nodes.velocity).sum(axis=1))
    run_free(nodes, shells, metal, step, count, np.zeros(1, np.int64), np.zeros((count, 1, 3)),
             history, np.zeros((3, 3)), np.zeros(9))  # fmt: skip
    np.testing.assert_allclose(nodes.mass @ nodes.velocity, momentum, atol=1e-9 * start)
    assert history[-1, 0] < 0.9 * start
    assert history[-1, 0] + shells.energy.sum() == pytest.approx(start, rel=1e-4)


def disc(cells: int, radius: float) -> tuple[Array, Array, Array]:
    """Return nodes, elements and edge of a disc whose mesh is a square's, rounded outwards."""
    square, node = grid(cells, cells, 2.0, 2.0)
    place = square[:, :2] - 1.0
    ring = np.abs(place).max(axis=1)
    away = np.maximum(np.linalg.norm(place, axis=1), 1e-12)
    scale = (1.0 - ring) * 0.8 + ring * ring / away
    flat = np.zeros((len(place), 3))
    flat[:, :2] = radius * place * scale[:, None]
    return flat, node, ring > 1.0 - 1e-9


@pytest.mark.parametrize("impulse", [10.0, 20.0, 30.0])
def test_a_clamped_disc_under_an_impulse_keeps_nurick_and_martins_dent(impulse: float) -> None:
    # G. Nurick and J. Martin, Int. J. Impact Eng. 8, 171, 1989: dent over thickness.
    radius, thickness, limit, density = 0.05, 0.0016, 250e6, 7850.0
    metal = sheet_metal(207e9, 0.3, density, limit, 0.0, 40.0)
    position, node, edge = disc(16, radius)
    nodes, shells = mesh(position, node, thickness, metal, 5)
    nodes.held[edge] = True
    nodes.velocity[~edge, 2] = impulse * thickness / radius * math.sqrt(limit / density)
    step = stable_step(shells, metal)
    count = int(300e-6 / step)
    history = np.zeros((count, 3))
    middle = np.array([int(np.argmin(np.linalg.norm(position, axis=1)))])
    run_free(nodes, shells, metal, step, count, middle, np.zeros((count, 1, 3)), history,
             np.zeros((3, 3)), np.zeros(9))  # fmt: skip
    dent = history[int(np.argmax(history[:, 2])) :, 2].mean() / thickness
    assert dent == pytest.approx(0.425 * impulse + 0.277, rel=0.05)


def curved_plate(cells: int) -> tuple[Array, Array, Array, Array]:
    """Return nodes, elements, edge and loaded nodes (the middle first) of a doubly curved plate."""
    position, node = grid(cells, cells, 0.6, 0.6)
    position[:, :2] -= 0.3
    position[:, 2] = -np.square(position[:, :2]).sum(axis=1) / 6.0
    edge = np.abs(position[:, :2]).max(axis=1) > 0.3 - 1e-9
    away = np.linalg.norm(position[:, :2], axis=1)
    loaded = np.flatnonzero(away <= 0.031)
    return position, node, edge, loaded[np.argsort(away[loaded], kind="stable")]


def snap(cells: int, duration: float) -> tuple[Array, Array]:
    """Return time (s) and path (m) of the middle of the plate under 4 kN, half a sine of 10 ms."""
    position, node, edge, loaded = curved_plate(cells)
    metal = sheet_metal(yield_stress=200e6)
    nodes, shells = mesh(position, node, 0.0008, metal, 5)
    nodes.held[edge] = True
    step = stable_step(shells, metal)
    time = step * np.arange(int(duration / step))
    load = np.zeros((len(time), len(loaded), 3))
    load[:, :, 2] = -4000.0 / len(loaded) * np.sin(math.pi * time / 0.01)[:, None]
    history = np.zeros((len(time), 3))
    run_free(nodes, shells, metal, step, len(time), loaded, load, history, np.zeros((3, 3)),
             np.zeros(9))  # fmt: skip
    assert history[-1, 0] + shells.energy.sum() == pytest.approx(history[-1, 1], rel=0.002)
    return time, history[:, 2] - history[0, 2]


def test_a_plastic_curved_plate_sinks_as_in_calculix() -> None:
    time, path = snap(20, 0.0075)
    known = np.loadtxt(CURVE, delimiter=",", comments="#")
    assert path.min() == pytest.approx(known[:, 1].min(), rel=0.03)
    found = np.interp(known[:, 0], time, path)
    rise = known[:, 0] > 0.002
    assert np.abs(found - known[:, 1])[rise].max() < 0.06 * np.abs(known[:, 1]).max()


def input_deck(cells: int) -> str:
    """Return the same plate for CalculiX."""
    position, node, edge, loaded = curved_plate(cells)
    lines = ["*NODE"]
    lines += [f"{k + 1},{x:.9g},{y:.9g},{z:.9g}" for k, (x, y, z) in enumerate(position.tolist())]
    lines += ["*ELEMENT,TYPE=S4,ELSET=SHEET"]
    lines += [f"{k + 1},{','.join(str(n + 1) for n in row)}" for k, row in enumerate(node.tolist())]
    lines += ["*NSET,NSET=EDGE", *(f"{n + 1}," for n in np.flatnonzero(edge))]
    lines += ["*NSET,NSET=MIDDLE", f"{loaded[0] + 1},", "*MATERIAL,NAME=STEEL", "*ELASTIC"]
    lines += ["210e9,0.3", "*DENSITY", "7850.", "*PLASTIC", "200e6,0."]
    lines += ["*SHELL SECTION,ELSET=SHEET,MATERIAL=STEEL", "0.0008", "*BOUNDARY", "EDGE,1,6"]
    lines += ["*AMPLITUDE,NAME=PULSE"]
    lines += [f"{t:.6g},{math.sin(100.0 * math.pi * t):.9g}" for t in np.linspace(0, 0.01, 201)]
    lines += ["*STEP,NLGEOM,INC=100000", "*DYNAMIC,DIRECT", "2e-5,0.0075"]
    lines += ["*CLOAD,AMPLITUDE=PULSE"]
    lines += [f"{n + 1},3,{-4000.0 / len(loaded):.9g}" for n in loaded]
    return "\n".join([*lines, "*NODE PRINT,NSET=MIDDLE,FREQUENCY=5", "U", "*END STEP", ""])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_calculix_itself_sinks_the_plate_alike(tmp_path: Path) -> None:
    (tmp_path / "plate.inp").write_text(input_deck(20))
    subprocess.run(["ccx", "plate"], cwd=tmp_path, check=True, capture_output=True)
    rows = [line.split() for line in (tmp_path / "plate.dat").read_text().splitlines()]
    found = [float(row[3]) for row in rows if len(row) == 4 and row[0].isdigit()]
    assert snap(20, 0.0075)[1].min() == pytest.approx(min(found), rel=0.03)


@kernel
def _returned(metal, total, difference, shear, strain, step, out):
    g, out[0] = return_to_yield(metal, 0, total, difference, shear, strain, step)
    out[1] = flow_stress(metal, 0, out[0], (out[0] - strain) / step)
    a = 1.0 + g * metal.young[0] / (3.0 * (1.0 - metal.poisson[0]))
    b = 1.0 + g * metal.young[0] / (1.0 + metal.poisson[0])
    out[2], out[3], out[4] = total / a, difference / b, shear / b


@settings(deadline=None)
@given(
    st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(1.01, 50.0),
    st.floats(0.0, 0.5), st.floats(1e-7, 1e-4), st.booleans(),
)  # fmt: skip
def test_a_trial_stress_returns_to_the_yield_surface(
    total: float, difference: float, shear: float, size: float, strain: float, step: float,
    fast: bool,
) -> None:  # fmt: skip
    metal = sheet_metal(yield_stress=200e6, slope=900e6, rate=40.0 if fast else math.inf)
    length = math.sqrt(0.25 * total**2 + 0.75 * difference**2 + 3.0 * shear**2)
    # A small overstress gives a strain that is lost in rounding.
    if length < 1e-3 or (fast and size < 2.0):
        return
    scale = size * (200e6 + 900e6 * strain) / length
    out = np.zeros(5)
    _returned(metal, scale * total, scale * difference, scale * shear, strain, step, out)
    mises = math.sqrt(0.25 * out[2] ** 2 + 0.75 * out[3] ** 2 + 3.0 * out[4] ** 2)
    # The strain of a step is the small difference of two strains here.
    assert mises == pytest.approx(out[1], rel=1e-5)
    assert out[0] > strain


def test_a_strip_in_tension_follows_its_curve_and_thins() -> None:
    metal = sheet_metal(yield_stress=200e6, slope=900e6)
    position, node = grid(4, 1, 0.04, 0.01)
    nodes, shells = mesh(position, node, 0.001, metal)
    strain, count = 0.1, 4000
    for k in range(1, count + 1):
        # True strain, sides free to draw in: solved for by plane stress at rest of the sides.
        stretch = math.exp(strain * k / count)
        draw = math.exp(-0.5 * strain * k / count)
        nodes.position[:, 0] = stretch * position[:, 0]
        nodes.position[:, 1] = draw * position[:, 1]
        forces(nodes, shells, metal)
    stress = float(shells.stress[:, :, 0].mean())
    across = float(shells.stress[:, :, 1].mean())
    plastic = float(shells.plastic.mean())
    assert stress - 0.5 * across == pytest.approx(200e6 + 900e6 * plastic, rel=0.01)
    assert plastic == pytest.approx(strain - stress / 210e9, rel=0.01)
    # Plastic strain keeps the volume.
    assert shells.thickness.mean() == pytest.approx(0.001 * math.exp(-0.5 * strain), rel=0.002)
