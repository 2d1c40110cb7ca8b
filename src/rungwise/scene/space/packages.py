"""Files that a model names by the package that brings them, ``package://NAME/path``: where they lie.

They are looked for beside the model and in the folders above it, in the folders of ROS_PACKAGE_PATH and of
AMENT_PREFIX_PATH, and in installed packages of Python.
Files of meshes and textures are named by their whole paths where a model is written anywhere else.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown

if TYPE_CHECKING:
    import mujoco

NAMED = re.compile(
    r"""(?P<quote>["'])(?:package|model):/{2,3}(?P<package>[^/"']+)/(?P<inner>[^"']+)(?P=quote)"""
)
OF_URDF = re.compile(r"""(?P<tag>\bfilename\s*=\s*)(?P<quote>["'])(?P<name>[^"':]+)(?P=quote)""")
OF_MJCF = re.compile(
    r"""(?P<tag>\b(?:mesh|texture|asset)dir\s*=\s*|<(?:include|model)\b[^<>]*?\bfile\s*=\s*)"""
    r"""(?P<quote>["'])(?P<name>[^"':]+)(?P=quote)"""
)
"""Where a URDF, and a model of MuJoCo's, names files and folders beside itself."""


def with_places(text: str, path: Path) -> str | None:
    """The text of a model at `path` with the places of its files in place of packages; None where it names no
    package. Raises SceneError for a file that is nowhere."""
    if not NAMED.search(text):
        return None

    def placed(found: re.Match[str]) -> str:
        package, inner, quote = found["package"], found["inner"], found["quote"]
        own = in_package(f"{package}/{inner}", f"package://{package}/{inner}", path, f"model: {path.name!r}")
        return f"{quote}{own}{quote}"

    def beside(found: re.Match[str]) -> str:
        own = path.parent.resolve() / found["name"]
        return f"{found['tag']}{found['quote']}{own}{found['quote']}" if own.exists() else found[0]

    files = OF_URDF if path.suffix.lower() == ".urdf" else OF_MJCF
    return NAMED.sub(placed, files.sub(beside, text))


def in_package(inner: str, name: str, path: Path, field: str) -> Path:
    """Where the file PACKAGE/path is that the file at `path` names. Raises SceneError, at the `field`, where
    it is nowhere."""
    package, _, rest = inner.partition("/")
    for folder in _folders(package, path):
        if (folder / rest).exists():
            return folder / rest
    raise SceneError(
        f"{field}: {shown(name)} is no file beside it or above it, in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, or"
        f" in an installed package {package}"
    )


def _folders(package: str, path: Path) -> Iterator[Path]:
    """Folders that may be the package's, the nearest first."""
    for above in path.resolve().parents:
        if above.name == package:
            yield above
        yield above / package
    for name, inner in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for each in filter(None, os.environ.get(name, "").split(os.pathsep)):
            folder = Path(each) / inner
            if folder.name == package:
                yield folder
            yield folder / package
    for each in sys.path:
        yield Path(each) / "cmeel.prefix" / "share" / package
    spec = find_spec(package) if package.isidentifier() else None
    for each in (spec.submodule_search_locations or ()) if spec else ():
        yield Path(each)


def with_files(spec: mujoco.MjSpec, folder: Path) -> None:
    """Name the files of a specification that was read in `folder` by their whole paths."""
    meshes, textures = folder / spec.meshdir, folder / spec.texturedir
    for each in (*spec.meshes, *spec.hfields, *spec.skins):
        each.file = _whole(each.file, meshes, folder)
    for each in spec.textures:
        each.file = _whole(each.file, textures, folder)
        for side, name in enumerate(each.cubefiles):
            each.cubefiles[side] = _whole(name, textures, folder)
    spec.meshdir = spec.texturedir = ""
    spec.strippath = False


def _whole(name: str, *folders: Path) -> str:
    """Where a file lies; in URDF its own folders may be left out."""
    candidates = [folder / inner for inner in (name, Path(name).name) for folder in folders] if name else []
    return next((str(path.resolve()) for path in candidates if path.is_file()), name)
