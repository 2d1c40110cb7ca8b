"""Motions that the scene's own parameters explain are not outside, and those of another scene are."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rungwise as rw

from .drops import CASES, SCENE, drops


def longer(scene: dict[str, Any]) -> None:
    scene["bodies"]["square"]["shape"] = {"kind": "box", "width": 0.05, "height": 0.07}


def heavier_rim(scene: dict[str, Any]) -> None:
    scene["bodies"]["square"]["inertia"] = 1.3 * 0.06**2 / 6.0


def tilted(scene: dict[str, Any]) -> None:
    scene["parameters"]["tilt"]["default"] = np.deg2rad(2.0)


def pulled(scene: dict[str, Any]) -> None:
    scene["gravity"] = [1.0, -9.81]


def bevelled(scene: dict[str, Any]) -> None:
    h, cut = 0.03, 0.022
    corners = [[-h, -h], [h, -h], [h, cut], [cut, h], [-h, h]]
    scene["bodies"]["square"]["shape"] = {"kind": "polygon", "vertices": corners}


def walled(scene: dict[str, Any]) -> None:
    wall = {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [-1, 0]}, "pose": {"x": 0.05}}
    scene["bodies"]["wall"] = wall
    scene["contacts"].append({"between": ["square", "wall"], "friction": 0.3, "restitution": 0.3})


WRONG: dict[str, tuple[Callable[[dict[str, Any]], None], float | None]] = {
    "shape": (longer, None), "tilt": (tilted, None), "inertia": (heavier_rim, np.inf),
    "inertia in spans": (heavier_rim, None), "pull": (pulled, None), "bevel": (bevelled, None),
    "wall": (walled, None),
}  # fmt: skip
"""What differs from the scene that is fitted, and the span in which that shows."""


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_motions_of_the_scene_itself_are_explained(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mu, e = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.1, 0.7))
    found = rw.fit(SCENE, "dynamic-rigid", drops(8, 25, seed=seed, mu=mu, e=e), ("mu", "e"), threads=1)
    assert not found.outside and found.verdict.startswith("explained")


@pytest.mark.long
@pytest.mark.parametrize("span", [np.inf, None])
@pytest.mark.parametrize("seed", range(20))
def test_motions_without_velocities_are_explained(seed: int, span: float | None) -> None:
    rng = np.random.default_rng(seed)
    mu, e = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.1, 0.7))
    motions = drops(8, 25, seed=seed, mu=mu, e=e, rates=False)
    found = rw.fit(SCENE, "dynamic-rigid", motions, ("mu", "e"), span=span, threads=1)
    assert not found.outside


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 7, 56, 72, 83, 86])
def test_motions_whose_contacts_yield_for_some_frames_are_explained(seed: int) -> None:
    """Spans that begin within an impact lose how far contacts have yielded: no evidence against a rung."""
    case, rng = CASES["compliant impacts"], np.random.default_rng(seed)
    true = {name: float(rng.uniform(*ends)) for name, ends in case.drawn.items()}
    found = rw.fit(
        case.scene, case.model, case.make(case, true, 20, rng), case.over, seed=seed, threads=1
    )  # fmt: skip
    assert not found.outside


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", WRONG)
def test_motions_of_another_scene_are_outside(kind: str, seed: int) -> None:
    change, span = WRONG[kind]
    scene = copy.deepcopy(SCENE)
    change(scene)
    motions = drops(8, 25, seed=seed, scene=scene)
    found = rw.fit(SCENE, "dynamic-rigid", motions, ("mu", "e"), span=span, threads=1)
    assert found.outside and "no parameters of mu, e explain" in found.verdict


@pytest.mark.long
def test_the_farthest_error_is_named() -> None:
    scene = copy.deepcopy(SCENE)
    pulled(scene)
    found = rw.fit(SCENE, "dynamic-rigid", drops(8, 25, scene=scene), ("mu", "e"), threads=1)
    assert found.unlike is not None and "square.x" in found.unlike.what
    assert found.unlike.what in found.verdict and found.summary()["unlike"]["distance"] > 10.0
