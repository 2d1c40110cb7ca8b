"""Environments that `gymnasium.make` knows by name."""

from __future__ import annotations

from typing import Any

import gymnasium

NAMESPACE = "rungwise"
MODELS = (
    "kinematic", "quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid", "dynamic-compliant",
)  # fmt: skip
SCENES: dict[str, dict[str, Any]] = {
    "arm_push": {
        "bounds": {"shoulder_to": (-1.2, 0.3), "elbow_to": (0.0, 2.0), "wrist_to": (-1.0, 1.0)},
        "ramp": True,
    },
    "arm_turn": {},
    "ball_turn": {},
    "block_turn": {},
    "book": {},
    "card": {},
    "corner_pivot": {},
    "corridor": {},
    "door": {},
    "floor_push": {},
    "four_finger": {},
    "grasp": {},
    "gripper": {"bounds": {"squeeze": (0.0, 20.0), "v": (1e-6, 0.2)}},
    "hand_turn": {},
    "micro_pick": {"bounds": {"v": (1e-9, 2e-4)}},
    "palm_lift": {},
    "peg_in_hole": {},
    "peg_arm": {},
    "planar_hand": {},
    "push": {},
    "shadow_hand": {},
    "snap": {},
    "squeeze": {"bounds": {"close": (0.0, 0.04)}},
    "three_finger_lift": {},
    "two_finger": {},
}
"""Shipped scenes with inputs and a goal, and bounds of inputs, and how they are followed, where the scene has
no task that states them."""
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
