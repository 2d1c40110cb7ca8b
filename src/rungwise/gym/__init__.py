"""Scenes as Gymnasium environments, on any rung: `rungwise.gym.make`, `SceneEnv`, `SceneVectorEnv`.

import gymnasium
import rungwise.gym  # registers rungwise/SCENE-MODEL-v0
env = gymnasium.make("rungwise/push-dynamic-rigid-v0")
"""

from importlib.util import find_spec

import lazy_loader

if find_spec("gymnasium") is None:
    raise ImportError("rungwise.gym: needs gymnasium (pip install 'rungwise[gym]')")

from rungwise.gym.registration import register

# A name is imported when it is first used: which names there are, and from where, stands in __init__.pyi.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
register()
