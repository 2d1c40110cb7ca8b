"""Which meshes are convex, and what they lack of their hulls: closed forms, and the same for moved ones."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from rungwise.scene.space.meshes.decompose import pieces
from rungwise.scene.space.meshes.solid import LEVEL, solid

from .solids import CONCAVE, Mesh, bowl, box, plate_with_hole, prism, ring, u_shape


def _ball(count: int = 300, seed: int = 0) -> Mesh:
    places = np.random.default_rng(seed).normal(size=(count, 3))
    places /= np.linalg.norm(places, axis=1)[:, None]
    hull = ConvexHull(places)
    outward = (np.linalg.det(places[hull.simplices]) > 0.0)[:, None]
    return Mesh(places, np.where(outward, hull.simplices, hull.simplices[:, ::-1]))


def _moved(mesh: Mesh, seed: int) -> Mesh:
    random = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    return mesh.moved(turn, 10.0 ** random.uniform(-3.0, 3.0), random.normal(size=3))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", CONCAVE)
def test_what_a_mesh_leaves_out_of_its_hull(name: str, seed: int) -> None:
    mesh, share = CONCAVE[name][0](), CONCAVE[name][1]
    found = solid(*(_moved(mesh, seed) if seed else mesh))
    assert not found.is_convex and not found.fault and not found.is_least
    assert found.share == pytest.approx(share, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mesh", [box(1.0, 2.0, 3.0), _ball(), _ball(20, 1)], ids=["box", "ball", "stone"])
def test_convex_meshes_stay_convex_wherever_they_lie(mesh: Mesh, seed: int) -> None:
    found = solid(*_moved(mesh, seed))
    assert found.is_convex and found.share == pytest.approx(0.0, abs=1e-9)


def test_a_dent_counts_from_its_depth_on_however_wide_it_is() -> None:
    """A bar of square section, which a wedge of the given depth is cut out of, or a narrow hole."""
    for width in (0.01, 0.9):
        for depth, is_convex in ((0.5 * LEVEL, True), (2.0 * LEVEL, False)):
            outline = [
                (-0.5, 0),
                (0.5, 0),
                (0.5, 1),
                (width / 2, 1),
                (0, 1 - depth),
                (-width / 2, 1),
                (-0.5, 1),
            ]
            assert solid(*prism(shapely.Polygon(outline), 1.0)).is_convex is is_convex
    narrow = solid(*plate_with_hole(1.0, 0.02, 1.0))
    assert not narrow.is_convex and narrow.share == pytest.approx(4e-4)


def test_rounding_of_a_scan_leaves_a_mesh_convex() -> None:
    ball, random = _ball(), np.random.default_rng(1)
    noise = 1.0 + 0.2 * LEVEL * random.normal(size=(300, 1)).clip(-2.0, 2.0)
    found = solid(ball.vertices * noise, ball.faces)
    assert found.is_convex and 0.0 < found.share < 0.02


@pytest.mark.parametrize("turned", ["one", "all", "every other"])
@pytest.mark.parametrize("mesh", [box(1.0, 1.0, 1.0), u_shape(), ring()], ids=["box", "U", "ring"])
def test_faces_that_are_turned_inward_change_nothing(mesh: Mesh, turned: str) -> None:
    faces = mesh.faces.copy()
    which = {"one": slice(0, 1), "all": slice(None), "every other": slice(None, None, 2)}[turned]
    faces[which] = faces[which][:, ::-1]
    wanted, found = solid(*mesh), solid(mesh.vertices, faces)
    assert found.is_convex == wanted.is_convex and found.share == pytest.approx(wanted.share)


def test_vertices_may_be_given_once_for_each_face() -> None:
    for mesh in (u_shape(), box(1.0, 1.0, 1.0)):
        loose = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
        assert solid(*loose).share == pytest.approx(solid(*mesh).share)


def test_an_open_surface_has_no_volume() -> None:
    """Unless what is open of a convex one is small."""
    mesh = u_shape()
    found = solid(mesh.vertices, mesh.faces[1:])
    assert not found.is_convex and "open at 3 edges" in found.fault
    cup = box(1.0, 1.0, 1.0)
    assert "open at 4 edges" in solid(cup.vertices, cup.faces[2:]).fault
    assert not solid(cup.vertices, cup.faces[2:]).is_convex
    ball = _ball()
    assert solid(ball.vertices, ball.faces[1:]).is_convex


def test_a_sheet_with_two_sides_encloses_nothing() -> None:
    ball = u_shape()
    twice = Mesh(ball.vertices, np.concatenate([ball.faces, ball.faces[:, ::-1]]))
    assert solid(*twice).fault


def test_parts_that_are_convex_are_pieces_as_they_are() -> None:
    """Boxes side by side, flush or apart, and crossing each other."""
    one = box(1.0, 1.0, 1.0)
    flush = one.beside(one.moved(np.eye(3), 1.0, np.array([1.0, 0.0, 0.0])))
    assert solid(*flush).is_convex
    apart = one.beside(one.moved(np.eye(3), 1.0, np.array([3.0, 0.0, 0.0])))
    found = solid(*apart)
    assert not found.is_convex and found.share == pytest.approx(0.5) and len(pieces(found, "it")) == 2
    crossing = solid(*box(6.0, 2.0, 1.0).beside(box(2.0, 6.0, 1.0)))
    assert crossing.is_least and len(pieces(crossing, "it")) == 2
    assert not crossing.is_convex and crossing.share == pytest.approx(1.0 - 24.0 / 28.0)


def test_what_is_within_a_convex_part_is_of_no_account() -> None:
    inner = u_shape().moved(np.eye(3), 0.1, np.array([0.0, 0.0, 0.3]))
    found = solid(*box(2.0, 2.0, 2.0).beside(inner))
    assert found.is_convex and len(found.parts) == 1


def test_a_void_makes_a_solid_hollow() -> None:
    inner = box(1.0, 1.0, 1.0).moved(np.eye(3), 1.0, np.array([0.0, 0.0, 0.5])).inside_out()
    for hollow in (box(2.0, 2.0, 2.0).beside(inner), box(2.0, 2.0, 2.0).beside(inner).inside_out()):
        found = solid(*hollow)
        assert not found.is_convex and found.share == pytest.approx(1.0 / 8.0) and len(found.parts) == 1


def test_a_bowl_is_not_convex() -> None:
    mesh = bowl()
    found = solid(*mesh)
    volume = np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6.0
    assert not found.is_convex and not found.fault
    assert found.share == pytest.approx(1.0 - volume / ConvexHull(mesh.vertices).volume)
