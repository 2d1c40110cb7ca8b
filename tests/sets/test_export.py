"""Meshes of sets whose form is known, and the files that other programs read."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import rungwise as rw
from rungwise.sets.cells.surface import Mesh, boundary

RADIUS = 0.73


def solid(goal: str, axes: int = 3, tol: float = 0.01, **more: str) -> rw.FeasibleSet:
    """The set of parameters x, y, z in -1..1 that satisfy a condition, each of them asked by a run; `more`
    fields of the scene."""
    names = ("x", "y", "z")[:axes]
    scene = rw.load(
        {
            "name": "solid",
            "parameters": {name: {"default": 0.1, "range": [-1.0, 1.0]} for name in names},
            "bodies": {
                "block": {
                    "role": "robot", "shape": {"kind": "point"},
                    "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
                    "coordinates": {"s": {"drive": {"kind": "speed", "speed": 1.0}}},
                }
            },
            "goal": goal,
            "duration": 0.1,
            "step": 0.1,
        }
        | more
    )  # fmt: skip
    return rw.feasible_set(scene, rw.KINEMATIC, names, tol=tol, threads=1, accuracy=0.1)


@pytest.fixture(scope="module")
def ball() -> rw.FeasibleSet:
    return solid(f"{RADIUS}**2 - x**2 - y**2 - z**2 >= 0")


def enclosed(mesh: Mesh) -> float:
    """Volume (or area) within a closed mesh, by the divergence theorem."""
    corners = mesh.vertices[mesh.pieces]
    return float(np.linalg.det(corners).sum()) / {2: 2.0, 3: 6.0}[mesh.vertices.shape[1]]


def directed_edges(mesh: Mesh) -> NDArray[np.int64]:
    return np.concatenate([mesh.pieces[:, [i, (i + 1) % 3]] for i in range(3)])


def euler(mesh: Mesh) -> int:
    edges = directed_edges(mesh)
    return len(np.unique(mesh.pieces)) - len(edges) // 2 + len(mesh.pieces)


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge is passed as often in one direction as in the other."""
    edges = directed_edges(mesh)
    there, back = (e[np.lexsort(e.T)] for e in (edges, edges[:, ::-1]))
    return np.array_equal(there, back)


@pytest.mark.long
def test_a_ball_is_closed_and_has_its_volume(ball: rw.FeasibleSet) -> None:
    mesh = boundary(ball)
    assert is_closed(mesh) and euler(mesh) == 2
    assert enclosed(mesh) == pytest.approx(4.0 / 3.0 * np.pi * RADIUS**3, rel=0.01)
    assert ball.volumes()["feasible"] == pytest.approx(np.pi / 6.0 * RADIUS**3, abs=0.005)
    away = np.abs(np.linalg.norm(mesh.vertices, axis=1) - RADIUS)
    assert away.max() <= 2.0 * ball.tol  # of the side, which is 2


def test_a_ring_has_a_hole() -> None:
    mesh = boundary(solid("0.3**2 - (sqrt(x**2 + y**2) - 0.6)**2 - z**2 >= 0"))
    assert is_closed(mesh) and euler(mesh) == 0
    assert enclosed(mesh) == pytest.approx(2.0 * np.pi**2 * 0.6 * 0.3**2, rel=0.02)


def test_corners_that_touch_are_kept_apart_from_both_sides() -> None:
    """Opposite octants: along the axes cells have the label at two corners across a face."""
    mesh = boundary(solid("x * y * z - 1e-3 >= 0", tol=0.03))
    edges = directed_edges(mesh)
    inner = (np.abs(mesh.vertices) < 1.0).all(axis=1)
    edges = edges[inner[edges].any(axis=1)]
    assert {tuple(e) for e in edges.tolist()} == {tuple(e[::-1]) for e in edges.tolist()}


def test_beside_a_corner_that_was_run_the_label_is_that_of_its_run() -> None:
    """Also where two boundaries meet, and no plane parts a cell."""
    found = solid("(x - 0.0113) * (y + 0.0171) >= 0", axes=2, tol=0.03)
    vertices, rng = found.tree.vertices, np.random.default_rng(3)
    places = vertices.places(vertices.keys) + rng.uniform(-1e-3, 1e-3, (len(vertices.keys), 2))
    inside = ((places > 0.0) & (places < 1 << found.tree.finest)).all(axis=1)
    labels = found.labels(found.box[:, 0] + places * found.unit)
    assert (labels[inside] == vertices.labels[inside]).all()


def test_a_disc_in_two_dimensions() -> None:
    mesh = boundary(solid(f"{RADIUS}**2 - x**2 - y**2 >= 0", axes=2))
    starts, ends = mesh.pieces.T
    assert sorted(starts.tolist()) == sorted(ends.tolist()) == list(range(len(mesh.vertices)))
    assert enclosed(mesh) == pytest.approx(np.pi * RADIUS**2, rel=0.01)


@pytest.mark.long
def test_coarsened_keeps_the_form(ball: rw.FeasibleSet) -> None:
    mesh = boundary(ball)
    coarse = mesh.coarsened(12, ball.box)
    assert 100 < len(coarse.pieces) < len(mesh.pieces) / 4
    assert enclosed(coarse) == pytest.approx(enclosed(mesh), rel=0.05)


def test_the_other_side_is_the_same_surface_turned_over(ball: rw.FeasibleSet) -> None:
    assert enclosed(boundary(ball, rw.Label.INFEASIBLE)) == pytest.approx(-enclosed(boundary(ball)), rel=1e-3)


def test_files(ball: rw.FeasibleSet, tmp_path: Path) -> None:
    mesh = boundary(ball)
    lines = ball.to_mesh(tmp_path / "ball.obj").read_text().splitlines()
    vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
    pieces = np.array([line.split()[1:] for line in lines if line.startswith("f ")], int) - 1
    assert np.array_equal(vertices, mesh.vertices) and np.array_equal(pieces, mesh.pieces)
    content = ball.to_mesh(tmp_path / "ball.stl").read_bytes()
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
    triangles = np.frombuffer(content, kind, offset=84)
    assert int.from_bytes(content[80:84], "little") == len(triangles) == len(pieces)
    outward = np.einsum("ti,ti->t", triangles["normal"], triangles["corners"].mean(axis=1))
    assert (outward > 0.99 * RADIUS).all()
    assert np.allclose(np.linalg.norm(triangles["normal"], axis=1), 1.0, atol=1e-5)
    flat = solid("x + y >= 0.3", axes=2, tol=0.05)
    text = flat.to_mesh(tmp_path / "line.obj").read_text()
    ends = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("v ")], float)
    assert text.count("\nl ") > 3 and np.allclose(ends[:, :2].sum(axis=1), 0.3, atol=0.1)
    with pytest.raises(rw.SetError, match="triangles only"):
        flat.to_mesh(tmp_path / "line.stl")
    with pytest.raises(rw.SetError, match="must end in"):
        ball.to_mesh(tmp_path / "ball.ply")
    with pytest.raises(rw.SetError, match="2 or 3 parameters, not 1"):
        solid("x >= 0.3", axes=1).to_mesh(tmp_path / "x.obj")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["ball.obj", "ball.stl", "line.obj"]


def test_a_table_has_every_run_and_every_boundary_point(tmp_path: Path) -> None:
    found = solid("x + y >= 0.3", axes=2, tol=0.05)
    with found.to_csv(tmp_path / "set.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    runs = [row for row in rows if row["kind"] == "run"]
    edge = [row for row in rows if row["kind"] == "boundary"]
    assert len(runs) == len(found.tree.vertices.keys) and len(edge) == len(found.data.crossing)
    for row in runs:
        inside = float(row["x"]) + float(row["y"]) >= 0.3
        assert row["label"] == ("feasible" if inside else "infeasible")
        assert (float(row["margin"]) > 0.0) == inside or float(row["margin"]) == 0.0
    for row in edge:
        assert (row["label"], row["beyond"]) == ("infeasible", "feasible")
        assert float(row["x"]) + float(row["y"]) == pytest.approx(0.3, abs=0.1)


def test_a_set_without_boundary_is_an_empty_mesh(tmp_path: Path) -> None:
    found = solid("x + y + z >= 5", tol=0.1)
    assert len(boundary(found).pieces) == 0
    assert found.to_mesh(tmp_path / "none.stl").stat().st_size == 84


def test_a_saved_set_holds_its_scene(tmp_path: Path) -> None:
    found = solid("x + y >= 0.3", axes=2, tol=0.05)
    found.save(tmp_path)
    again = rw.load_set(tmp_path)
    assert again.scene.file == found.scene.file and again.data.identical(found.data)
    assert again.replay({"x": 0.2, "y": 0.2}).outcome.name == "goal"


@pytest.mark.parametrize(("x", "y"), [(0.137, 0.211), (-0.31, 0.52), (0.655, -0.42)])
def test_where_three_labels_meet_points_have_the_label_of_the_nearest_corner(x: float, y: float) -> None:
    """No plane parts three: unsafe for greater y, below there the goal for greater x, and else nothing."""
    found = solid(f"x >= {x}", 2, 0.02, unsafe=f"y >= {y}")
    meeting = (np.array([[x, y]]) - found.box[:, 0]) / found.unit
    levels, index = found.tree.locate(meeting)
    assert levels[0] == found.tree.finest
    origin, size = found.tree.leaves[levels[0]][index[0]], found.tree.size(levels[0])
    for near in (0.1, 0.4):
        places = origin + size * (near + (1.0 - 2.0 * near) * found.tree.corners)
        labels = found.classify(found.box[:, 0] + places * found.unit)
        assert labels.tolist() == ["infeasible", "unsafe", "feasible", "unsafe"]
    points = found.random(20_000, 3)
    truth = np.where(points[:, 1] >= y, "unsafe", np.where(points[:, 0] >= x, "feasible", "infeasible"))
    across, up = np.abs(points - (x, y)).T
    away = np.where(points[:, 1] >= y, up, np.minimum(up, across))
    assert away[found.classify(points) != truth].max() <= found.tol * 2.0  # of the side, which is 2
