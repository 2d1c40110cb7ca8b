"""Bodies on meshes that are not convex: they touch the mesh, not its hull; names, laws and inertia stay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space.meshes import decompose, pieces

from .conftest import Make
from .measure import FLOOR, run, world
from .rungs import DYNAMIC, MOVING, WITH_LOADS, named
from .solids import CONCAVE, Mesh, bowl, box, l_shape, plate_with_hole, ring, u_shape

needs_coacd = pytest.mark.skipif(not decompose.is_installed(), reason="needs the extra meshes (coacd)")


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which pieces are kept, in place of the user's; nothing is remembered from before."""
    folder = tmp_path / "kept"
    monkeypatch.setattr(decompose, "folder_of", lambda kind: folder / kind)
    pieces._pieces_of.cache_clear()
    return folder / "meshes"


def lying(more: str = "") -> str:
    """The mesh as a geom of its own."""
    return f'<geom name="block" type="mesh" mesh="block" {more}/>'


def asset(mesh: Mesh) -> str:
    return f"<asset>{mesh.written('block')}</asset>"


def boxes(*centres_and_sizes: tuple[float, ...]) -> Mesh:
    """Boxes at centres (3,), of edges (3,), as one mesh: parts that CoACD is not needed for."""
    found: Mesh | None = None
    for x, y, z, a, b, c in centres_and_sizes:
        own = box(a, b, c).moved(np.eye(3), 1.0, np.array([x, y, z - c / 2]))
        found = own if found is None else found.beside(own)
    assert found is not None
    return found


U_OF_BOXES = boxes(
    (0, 0, 0.01, 0.2, 0.1, 0.02), (-0.09, 0, 0.07, 0.02, 0.1, 0.1), (0.09, 0, 0.07, 0.02, 0.1, 0.1)
)
"""Two walls on a floor 0.02 thick: 2/3 of the hull are not in it."""


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_ball_falls_into_a_u_of_boxes(make: Make, rung: Rung) -> None:
    ball = '<body name="ball" pos="0 0 .2"><freejoint/><geom size=".03" mass=".05"/></body>'
    scene = make(world(FLOOR, lying(), ball, before=asset(U_OF_BOXES)))
    found = run(scene, rung, duration=0.5, step=2e-3)
    assert found.final["ball"]["z"] == pytest.approx(0.05, abs=2e-4)
    assert found.trajectory.pair.values.tolist() == ["geom2|block"]


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_ball_rests_in_a_u_and_not_on_its_hull(make: Make, rung: Rung) -> None:
    for z, rests in ((0.05, True), (0.15, False)):
        ball = f'<body name="ball" pos="0 0 {z}"><freejoint/><geom size=".03" mass=".05"/></body>'
        scene = make(world(FLOOR, lying(), ball, before=asset(U_OF_BOXES)))
        found = rw.simulate(scene, rung, duration=0.1, step=2e-3)
        falls = found.outcome.name == "unsupported" or found.final["ball"]["z"] < z - 0.04
        assert found.final["ball"]["z"] == pytest.approx(z, abs=2e-4) if rests else falls


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_peg_is_led_into_a_hole_between_boxes(make: Make, rung: Rung) -> None:
    hole = boxes(
        *((x, y, 0.5, 1.0 + abs(y), 1.0 + abs(x), 1.0) for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1)))
    )
    peg = '<body name="peg" pos="0 0 2"><joint name="j" type="slide" axis="0 0 1"/>'
    peg += '<geom type="box" size=".45 .45 .8"/></body>'
    scene = make(world(lying(), peg, before=asset(hole)), speeds={"peg.j": -1.0})
    found = run(scene, rung, duration=1.0, step=5e-3)
    assert found.final["peg"]["j"] == pytest.approx(-1.0)


@needs_coacd
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("scale", [0.02, 1.0])
def test_a_ball_falls_into_a_u_of_one_piece(make: Make, rung: Rung, scale: float) -> None:
    """However large it is, turned about the vertical; in lengths and times of its size."""
    turn = Rotation.from_euler("z", 0.7)
    mesh = u_shape().moved(turn.as_matrix(), scale, np.zeros(3))
    x, y, z = scale * turn.apply([0.0, -0.5, 3.5])
    ball = f'<body name="ball" pos="{x} {y} {z}"><freejoint/><geom size="{0.4 * scale}" mass="1"/></body>'
    scene = make(world(FLOOR, lying(), ball, before=asset(mesh)))
    found = run(scene, rung, duration=1.2 * np.sqrt(scale), step=4e-3 * np.sqrt(scale))
    assert found.final["ball"]["z"] == pytest.approx(0.9 * scale, abs=0.01 * scale)


@needs_coacd
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_peg_falls_into_its_hole(make: Make, rung: Rung) -> None:
    """With a clearance of 0.2 beside a side of 4, and stays on the plate beside the hole."""
    block = plate_with_hole(10.0, 4.2, 5.0)
    pegs = "".join(
        f'<body name="{name}" pos="{x} 0 8.5"><freejoint/><geom type="box" size="2 2 3" mass="1"/></body>'
        for name, x in (("in", 0.0), ("on", 20.0))
    )
    plate = '<geom type="box" size="5 5 2.5" pos="20 0 2.5"/>'
    floor = '<geom name="floor" type="plane" size="50 50 1"/>'
    scene = make(world(floor, lying(), plate, pegs, before=asset(block)))
    found = run(scene, rung, duration=1.8, step=5e-3)
    assert found.final["in"]["z"] == pytest.approx(3.0, abs=0.02)
    assert found.final["on"]["z"] == pytest.approx(8.0, abs=0.02)


@needs_coacd
@pytest.mark.parametrize("name", [*CONCAVE, pytest.param("bowl", marks=pytest.mark.long)])
def test_pieces_fill_the_mesh_and_little_more(name: str) -> None:
    """Exactly where faces are flat and edges straight."""
    from scipy.spatial import ConvexHull

    from rungwise.scene.space.meshes.solid import solid

    mesh = bowl() if name == "bowl" else CONCAVE[name][0]()
    turned = mesh.moved(Rotation.random(random_state=3).as_matrix(), 0.1, np.array([0.3, 0.0, 1.0]))
    own = solid(*turned)
    found = sum(ConvexHull(each).volume for each in decompose.pieces(own, name))
    filled = sum(part.volume for part in own.parts)
    assert filled * (1.0 - 1e-3) <= found <= filled * (1.1 if name == "bowl" else 1.005)


def test_a_drop_into_the_corner_of_an_l_is_seen_by_mujoco_too(make: Make) -> None:
    """The pieces stand in the model that a replay takes."""
    ball = '<body name="ball" pos="0 0 .2"><freejoint/><geom size=".03" mass=".05"/></body>'
    scene = make(world(FLOOR, lying(), ball, before=asset(U_OF_BOXES)))
    bound = scene.bind()
    data = mujoco.MjData(bound.model)
    for _ in range(500):
        mujoco.mj_step(bound.model, data)
    assert data.body("ball").xpos[2] == pytest.approx(0.05, abs=2e-3)


def test_inertia_friction_and_looks_stay(make: Make) -> None:
    more = 'friction=".3 .02 .001" condim="6" density="700" rgba="1 0 0 1" pos=".1 .2 .3" euler="10 20 30"'
    body = f'<body name="b" pos="1 2 3" euler="40 0 10"><freejoint/>{lying(more=more)}</body>'
    model = world(FLOOR, body, before=asset(U_OF_BOXES))
    pieced, hulls = make(model).bind().model, make(model, model={"meshes": {"block": "hull"}}).bind().model
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "qpos0"):
        np.testing.assert_array_equal(getattr(pieced, name), getattr(hulls, name))
    assert hulls.ngeom == 2 and pieced.ngeom == 5
    assert pieced.geom_contype.tolist() == [1, 0, 1, 1, 1]
    for name in ("geom_condim", "geom_friction", "geom_rgba"):
        np.testing.assert_array_equal(getattr(pieced, name)[2:], getattr(hulls, name)[[1, 1, 1]])
    corners = _corners(pieced, range(2, 5))
    np.testing.assert_allclose(corners.min(axis=0), _corners(hulls, [1]).min(axis=0), atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), _corners(hulls, [1]).max(axis=0), atol=1e-6)


def _corners(model: Any, geoms: Any) -> Any:
    """Vertices of meshes in the world."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for g in geoms:
        mesh = model.geom_dataid[g]
        own = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        found.append(own @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])
    return np.concatenate(found)


def test_names_are_those_of_the_geom(make: Make) -> None:
    """In labels, laws, results, descriptions and what is refused; unnamed ones keep their numbers."""
    plain = '<geom type="mesh" mesh="block"/><geom size=".01" pos="0 0 .3"/>'
    ball = '<body name="ball" pos="0 0 .051"><freejoint/><geom size=".03" mass=".05"/></body>'
    model = world(FLOOR, plain, ball, before=asset(U_OF_BOXES))
    scene = make(model, contacts=[{"between": ["geom1", "*"], "friction": 0.25, "restitution": 0.5}])
    assert scene.labels.geoms == ("floor", "geom1", "geom2", "geom1", "geom1", "geom1", "geom3")
    bound = scene.bind()
    assert set(bound.law[[1, 3, 4, 5], 6]) == {1} and bound.law[0, 6] == 0
    found = run(scene, rw.DYNAMIC_RIGID, duration=0.1, step=2e-3)
    assert found.trajectory.pair.values.tolist() == ["geom3|geom1"]
    with pytest.raises(rw.SceneError, match="matches no geom"):
        make(model, contacts=[{"between": ["geom4", "*"]}])
    inside = make(model.replace("0 0 .051", "0 0 .04"))
    assert "geom1" in rw.simulate(inside, rw.DYNAMIC_RIGID, duration=0.1).reason


def test_pairs_that_are_named_are_those_of_the_pieces(make: Make) -> None:
    ball = '<body name="ball" pos="0 0 .2"><freejoint/><geom name="ball" size=".03" mass=".05" contype="0"'
    ball += ' conaffinity="0"/></body>'
    pair = '<contact><pair geom1="ball" geom2="block" condim="1" friction="1 1 .1 .1 .1"/></contact>'
    none = lying(more='contype="0" conaffinity="0"')
    scene = make(world(none, ball, before=asset(U_OF_BOXES), after=pair))
    bound = scene.bind()
    assert bound.model.npair == 3 and (bound.model.pair_dim == 1).all()
    found = run(scene, rw.DYNAMIC_RIGID, duration=0.5, step=2e-3)
    assert found.final["ball"]["z"] == pytest.approx(0.05, abs=2e-4)


def test_what_only_shows_is_left_alone(make: Make) -> None:
    more = 'contype="0" conaffinity="0"'
    scene = make(world(FLOOR, lying(more=more), before=asset(U_OF_BOXES)))
    assert scene.bind().model.ngeom == 2 and scene.bind().notes == ("model: nothing can move in it",)


def test_hulls_on_purpose(make: Make) -> None:
    """By a pattern of the geom, its body or its mesh in the scene, or by what the file says of the mesh."""
    ball = '<body name="ball" pos="0 0 .2"><freejoint/><geom size=".03" mass=".05"/></body>'
    mesh = u_shape()  # of one piece
    model = world(FLOOR, lying(), ball.replace("0 0 .2", "0 0 4"), before=asset(mesh))
    declared = model.replace('<mesh name="block"', '<mesh name="block" inertia="convex"')
    for scene in (
        make(model, model={"meshes": {"bl*": "hull"}}),
        make(model, model={"meshes": {"world": "hull"}}),
        make(declared),
    ):
        assert scene.bind().model.ngeom == 3 and not scene.bind().notes
    with pytest.raises(rw.SceneError, match=r"^model\.meshes\.block"):
        make(model, model={"meshes": {"block": "hulls"}})


REFUSED = {
    "missing": (
        l_shape(),
        r"block: 29 % of its hull is not in its mesh; CoACD is not installed \(pip install",
    ),
    "open": (
        Mesh(l_shape().vertices, l_shape().faces[:-1]),
        "block: its surface is open at 3 edges; to take",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_decomposed_is_refused_in_one_line(
    make: Make, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    monkeypatch.setattr(decompose, "is_installed", lambda: False)
    monkeypatch.setattr(pieces, "is_installed", lambda: False)
    mesh, line = REFUSED[case]
    ball = '<body name="ball" pos="0 0 4"><freejoint/><geom size=".03" mass=".05"/></body>'
    with pytest.raises(rw.SceneError, match=line) as told:
        make(world(lying(), ball, before=asset(mesh)))
    text = str(told.value)
    assert "\n" not in text and 'meshes: {"block": hull}' in text and 'inertia="convex"' in text
    make(world(lying(), ball, before=asset(mesh)), model={"meshes": {"block": "hull"}})


@needs_coacd
def test_pieces_are_kept_and_damaged_files_are_made_anew(
    make: Make, kept: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    ball = '<body name="ball" pos="0 0 4"><freejoint/><geom size=".03" mass=".05"/></body>'
    model = world(lying(), ball, before=asset(l_shape()))
    wanted = make(model).bind().model
    assert "decomposing the mesh of block (1 of 1)" in capfd.readouterr().err
    (file,) = kept.iterdir()
    whole = file.read_bytes()
    asked = list[int]()
    original = decompose._decomposed

    def counted(*given: Any) -> Any:
        asked.append(1)
        return original(*given)

    monkeypatch.setattr(decompose, "_decomposed", counted)
    for content, times in ((whole, 0), (whole[:-40], 1), (b"", 2), (_of_objects(), 3), (whole, 3)):
        file.write_bytes(content)
        pieces._pieces_of.cache_clear()
        found = make(model).bind().model
        assert len(asked) == times
        np.testing.assert_array_equal(found.mesh_vert, wanted.mesh_vert)
        assert file.read_bytes() == whole and len(list(kept.iterdir())) == 1
    make(model, model={"meshes": {"block": 0.2}})
    assert len(list(kept.iterdir())) == 2  # a file for each accuracy


def _of_objects() -> bytes:
    """A file of numpy's that runs code when it is read."""
    import io

    content = io.BytesIO()
    np.savez(content, piece0=np.array([{"a": 1}], object))
    return content.getvalue()


@needs_coacd
def test_what_ends_the_process_of_coacd_is_refused(
    make: Make, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    dies = tmp_path / "dies.py"
    dies.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(decompose, "CHILD", dies)
    ball = '<body name="ball" pos="0 0 4"><freejoint/><geom size=".03" mass=".05"/></body>'
    with pytest.raises(rw.SceneError, match="CoACD found no pieces"):
        make(world(lying(), ball, before=asset(ring())))


def test_a_model_with_pieces_is_written_and_read_again(make: Make, tmp_path: Path) -> None:
    ball = '<body name="ball" pos="0 0 .2"><freejoint/><geom name="ball" size=".03" mass=".05"/></body>'
    scene = make(world(FLOOR, lying(), ball, before=asset(U_OF_BOXES)))
    path = tmp_path / "again.xml"
    path.write_text(rw.mjcf(scene))
    again = rw.load(str(path))
    assert again.labels.geoms == scene.labels.geoms
    assert again.bind().model.ngeom == scene.bind().model.ngeom
