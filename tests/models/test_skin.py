"""The skin of a body: joints without notches, and meshes of a user's own for its segments."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from builders import Array

from models.pedestrian.anthropometry import SEGMENTS, Body, build_body
from models.pedestrian.body_mesh import load_body_meshes
from models.pedestrian.skin import build_skin, joint_caps, segment_mesh
from models.registry import load_model

PERSON = (7.5, 1.25, 25.0, 3.26)
HEAD_LINES = """\
format = "mcstudy-body/1"
unit = "mm"
age = 7.5
stature = 1.25
body_mass = 25.0
head_mass = 3.26
[segments]
"""


def points_of(body: Body, name: str, *, capped: bool) -> Array:
    """Return the skin's points of a segment of the standing body, m."""
    skin = build_skin(body.semi_axes, [3] * 15, caps=joint_caps(body) if capped else None)
    row = SEGMENTS.index(name)
    first = skin.first_point[skin.first_cluster[row]], skin.first_point[skin.first_cluster[row + 1]]
    return skin.point[slice(*first)] + body.ellipsoid[row]


@pytest.mark.parametrize(
    ("inner", "outer"),
    [("thigh_left", "shank_left"), ("upper_arm_right", "forearm_right")],
)
def test_a_limb_is_as_thick_at_its_joint_as_beside_it(inner: str, outer: str) -> None:
    body = build_body(*PERSON)
    joint = body.joint[SEGMENTS.index(outer)]
    thinnest = body.semi_axes[[SEGMENTS.index(name) for name in (inner, outer)]].min()

    def breadth(*, capped: bool) -> float:
        """Return the radius of the limb in the 20 mm about the joint, seen from the side."""
        both = np.concatenate([points_of(body, name, capped=capped) for name in (inner, outer)])
        near = both[np.abs(both[:, 2] - joint[2]) < 0.01]
        return float(np.abs(near[:, 0] - joint[0]).max())

    assert breadth(capped=True) > 0.95 * thinnest
    assert breadth(capped=False) < 0.75 * thinnest


def test_a_cap_lies_outside_its_ellipsoid_and_within_the_reach() -> None:
    body = build_body(*PERSON)
    caps = joint_caps(body)
    assert {SEGMENTS[row].removesuffix("_left").removesuffix("_right") for row in caps} == {
        "upper_arm", "forearm", "shank", "foot",
    }  # fmt: skip
    bare, skin = (build_skin(body.semi_axes, [2] * 15, caps=c) for c in (None, caps))
    np.testing.assert_array_equal(bare.grain, skin.grain)
    for row in range(15):
        first = [skin.first_point[skin.first_cluster[row + k]] for k in (0, 1)]
        own = skin.point[first[0] : first[1]]
        assert np.linalg.norm(own, axis=1).max() <= skin.reach[row] + 1e-12
        assert (np.square(own / body.semi_axes[row]).sum(axis=1) > 1.0 - 1e-9).all()
        more = len(own) - 162
        assert more > 0 if row in caps else more == 0


def write(folder: Path, names: tuple[str, ...], person: tuple[float, ...] = PERSON) -> Path:
    """Write the ellipsoids of some segments as a user's meshes in mm, and their body file."""
    body, lines = build_body(*person), HEAD_LINES
    for name in names:
        row = SEGMENTS.index(name)
        nodes, facets = segment_mesh(body, row, 3)
        placed = 1000.0 * (nodes + body.ellipsoid[row])
        trimesh.Trimesh(placed, facets, process=False).export(folder / f"{name}.ply")
        lines += f'{name} = "{name}.ply"\n'
    path = folder / "body.toml"
    path.write_text(lines)
    return path


def test_meshes_of_the_ellipsoids_are_the_ellipsoids(tmp_path: Path) -> None:
    path = write(tmp_path, ("head", "chest", "thigh_left"))
    own, plain = load_model("facet", {"body": str(path)}), load_model("facet")
    assert own.version.startswith(plain.version + "+")
    first, second = own.run({}), plain.run({})
    assert first.status == "ok"
    for name, share in {"hic15": 0.05, "wad": 0.01, "head_impact_speed": 0.02}.items():
        assert first.outputs[name] == pytest.approx(second.outputs[name], rel=share), name
    scene = first.scene
    assert scene is not None
    assert {"car", *SEGMENTS} == {mesh.name for mesh in scene.meshes}
    head = next(mesh for mesh in scene.meshes if mesh.name == "head")
    assert len(head.nodes) >= 642


def test_meshes_are_scaled_to_the_body_of_the_run(tmp_path: Path) -> None:
    meshes = load_body_meshes(str(write(tmp_path, ("head", "shank_left"))))
    other = build_body(30.0, 1.78, 78.0, 4.5)
    for row, shape in meshes.shapes_of(other).items():
        place = np.square(shape.nodes / other.semi_axes[row]).sum(axis=1)
        # Points that were set between nodes lie on chords.
        assert place.max() == pytest.approx(1.0, abs=1e-3)
        assert place.min() > 0.97


def test_a_larger_head_is_struck_earlier(tmp_path: Path) -> None:
    path = write(tmp_path, ("head",))
    body = build_body(*PERSON)
    row = SEGMENTS.index("head")
    nodes, facets = segment_mesh(body, row, 3)
    helmet = 1000.0 * (1.3 * nodes + body.ellipsoid[row])
    trimesh.Trimesh(helmet, facets, process=False).export(tmp_path / "head.ply")
    time, plain = (
        load_model("facet", options).run({}).outputs["head_impact_time"]
        for options in ({"body": str(path)}, {})
    )
    assert time < plain - 0.001


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("mcstudy-body/1", "mcstudy-body/2"), "format must be"),
        (('unit = "mm"', 'unit = "m"'), "check unit, axes and person"),
        (('unit = "mm"', 'unit = "ell"'), "unit must be one of"),
        (("age = 7.5", 'age = "old"'), "must be numbers"),
        (("body_mass = 25.0", "body_mass = 2.0"), "no such person"),
        (("age = 7.5", "age = 7.5\nhair = 1"), "hair: unknown key"),
        (("head = ", "tail = "), "segments.tail: must be the file of one of hip"),
        (("head.ply", "tail.ply"), "is no file"),
        (('head = "head.ply"', ""), "must name the file"),
        (("head = ", "foot_left = "), "foot left of a standing person"),
        (("format", "[format"), "cannot be read"),
    ],
)
def test_a_wrong_body_file_is_told_in_one_line(
    tmp_path: Path, edit: tuple[str, str], message: str
) -> None:
    path = write(tmp_path, ("head",))
    text = path.read_text()
    assert edit[0] in text
    path.write_text(text.replace(*edit, 1))
    with pytest.raises(ValueError, match=r"^[^\n]*$") as told:
        load_model("facet", {"body": str(path)})
    assert message in str(told.value)


def test_an_open_mesh_is_no_segment(tmp_path: Path) -> None:
    path = write(tmp_path, ("head",))
    shape = trimesh.load(tmp_path / "head.ply")
    assert isinstance(shape, trimesh.Trimesh)
    trimesh.Trimesh(shape.vertices, shape.faces[5:], process=False).export(tmp_path / "head.ply")
    with pytest.raises(ValueError, match="has 15 open edges; a segment is closed"):
        load_model("facet", {"body": str(path)})
    with pytest.raises(ValueError, match="its meshes are facets"):
        load_model("facet", {"body": "x.toml", "child": "ellipsoids", "load": "deepest"})
