"""Environments that `gymnasium.make` knows by name."""

from __future__ import annotations

from typing import Any

import gymnasium

NAMESPACE = "rungwise"
MODELS = (
    "kinematic", "quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid", "dynamic-compliant",
)  # fmt: skip
SCENES: dict[str, dict[str, Any]] = {
    "four_finger": {},
    "grasp": {},
    "gripper": {"bounds": {"squeeze": (0.0, 20.0), "v": (1e-6, 0.2)}},
    "peg_in_hole": {},
    "push": {},
    "snap": {},
    "squeeze": {"bounds": {"close": (0.0, 0.04)}},
    "two_finger": {},
}
"""Shipped scenes with inputs, and bounds of inputs where the scene has no task that states them."""
ENTRY, VECTOR = "rungwise.gym.env:SceneEnv", "rungwise.gym.vector:SceneVectorEnv"


def register() -> None:
    """Register `rungwise/SCENE-MODEL-v0` for each shipped scene and rung, and `rungwise/Scene-v0`, which
    takes `scene` and `model`."""
    _register("Scene", {})
    for scene, options in SCENES.items():
        for model in MODELS:
            _register(f"{scene}-{model}", {"scene": scene, "model": model, **options})


def _register(name: str, options: dict[str, Any]) -> None:
    full = f"{NAMESPACE}/{name}-v0"
    if full not in gymnasium.registry:
        gymnasium.register(full, entry_point=ENTRY, vector_entry_point=VECTOR, kwargs=options)
