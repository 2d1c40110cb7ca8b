"""Hook of the build: puts compiled kernels into the wheel, if RUNGWISE_KERNELS names their folder."""

from __future__ import annotations

import os
import sysconfig
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Kernels(BuildHookInterface[Any]):
    """A wheel with kernels is for one platform; it serves each version of Python, for kernels know none."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        folder = os.environ.get("RUNGWISE_KERNELS")
        if folder and version != "editable":
            build_data["force_include"][folder] = "rungwise/kernels"
            build_data["tag"] = f"py3-none-{_platform()}"


def _platform() -> str:
    """The platform in the words of wheels: on Linux the oldest for which numba itself has wheels."""
    name = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    return name.replace("linux", "manylinux_2_17", 1) if name.startswith("linux") else name
