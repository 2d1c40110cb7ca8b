from .env import SceneEnv, make
from .registration import register
from .settings import GymError, Transition
from .vector import SceneVectorEnv

__all__ = ["GymError", "SceneEnv", "SceneVectorEnv", "Transition", "make", "register"]
