"""A scene that has been read: load, describe its parameters, bind them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import ValidationError

from rungwise.scene import bind as binding
from rungwise.scene import records as rec
from rungwise.scene.expression import STACK
from rungwise.scene.fields import SceneFile
from rungwise.scene.template import SceneError, Template, build

MAX_FILE = 2_000_000
LIBRARY = files("rungwise.scene") / "library"


class InvalidScene(SceneError):
    """The scene is well written but impossible at these parameters."""


@dataclass(frozen=True)
class Bound:
    """A scene with every number known, ready for kernels.

    `values` is what expressions read: parameters, t, q, v, gaps, normal forces, tolerance.
    """

    buffer: NDArray[np.float64]
    records: rec.Records
    values: NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """One manipulation task: the file as read, and the template that kernels bind."""

    file: SceneFile
    template: Template

    @property
    def name(self) -> str:
        return self.file.name

    def parameters(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameters, defaults replaced by those `given`.

        Raises SceneError for an unknown name, a value that is no finite number, or one out of range.
        """
        known = self.file.parameters
        values = {name: parameter.default for name, parameter in known.items()}
        for name, value in (given or {}).items():
            if name not in known:
                raise SceneError(f"parameters: unknown {name[:60]!r}; valid: {', '.join(known) or 'none'}")
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise SceneError(f"parameters.{name}: must be a number, not {str(value)[:40]!r}")
            limits = known[name].range
            if not math.isfinite(value):
                raise SceneError(f"parameters.{name}: must be finite")
            if limits is not None and not limits[0] <= value <= limits[1]:
                raise SceneError(f"parameters.{name}: {value:g} is outside {limits[0]:g} to {limits[1]:g}")
            values[name] = float(value)
        return values

    def bind(self, given: Mapping[str, float] | None = None) -> Bound:
        """All numbers at these parameters. Raises InvalidScene, naming the field, when that is impossible."""
        template = self.template
        buffer = template.buffer.copy()
        records = rec.views(buffer, template.counts)
        values = np.zeros(template.value_count)
        values[: len(template.parameters)] = list(self.parameters(given).values())
        programs = template.numbers
        checks = template.checks
        fault, index = binding.bind(
            programs.code, programs.constants, programs.table, template.targets,
            checks.slots, checks.low, checks.high, checks.kinds, values, np.zeros(STACK), buffer,
            records.bodies, records.coordinates, records.shapes, records.vertices,
        )  # fmt: skip
        if fault == binding.OUT_OF_RANGE:
            raise InvalidScene(self._out_of_range(index, float(buffer[checks.slots[index]])))
        if fault != binding.BOUND:
            raise InvalidScene(f"{self._place(fault, index, records)}: {binding.FAULTS[fault]}")
        values[-1] = records.world[0]["tolerance"]
        return Bound(buffer, records, values)

    def _out_of_range(self, index: int, value: float) -> str:
        checks = self.template.checks
        low, high, path = checks.low[index], checks.high[index], checks.paths[index]
        if not math.isfinite(value) and not checks.kinds[index] & 2:
            return f"{path}: must be finite, not {value:g}"
        sign = ">" if checks.kinds[index] & 1 else ">="
        bounds = f"{sign} {low:g}" + (f" and <= {high:g}" if math.isfinite(high) else "")
        return f"{path}: {value:g} must be {bounds}"

    def _place(self, fault: int, index: int, records: rec.Records) -> str:
        template = self.template
        if fault == binding.OUT_OF_TRAVEL:
            body, coordinate = template.coordinates[index].split(".")
            return f"bodies.{body}.coordinates.{coordinate}"
        if fault in (binding.NOT_CONVEX, binding.NO_NORMAL):
            return f"bodies.{template.bodies[int(records.shapes[index]['body'])]}.shape"
        return f"bodies.{template.bodies[index]}"


def load(source: str | Path | Mapping[str, Any]) -> Scene:
    """Read a scene: the name of one that ships, the path of a YAML file, or its content as a mapping.

    Raises SceneError: one line that names the field and what is valid.
    """
    data = source if isinstance(source, Mapping) else _read(source)
    if not isinstance(data, Mapping):
        raise SceneError("scene: must be a mapping of fields such as name, bodies, contacts, goal")
    try:
        file = SceneFile.model_validate(data)
    except ValidationError as error:
        raise SceneError(explain(error)) from None
    except RecursionError:
        raise SceneError("scene: nested too deeply") from None
    return Scene(file, build(file))


def shipped() -> tuple[str, ...]:
    """Names of the scenes that come with the package."""
    return tuple(sorted(p.name.removesuffix(".yaml") for p in LIBRARY.iterdir() if p.name.endswith(".yaml")))


def schema() -> dict[str, Any]:
    """JSON schema of scene files."""
    return SceneFile.model_json_schema()


def explain(error: ValidationError) -> str:
    """The first error as one line: field, what is wrong, what is valid; and how many more there are."""
    errors = error.errors(include_url=False, include_context=True)
    first = errors[0]
    path = ".".join(str(part) for part in first["loc"] if not str(part).startswith("function-")) or "scene"
    message = first["msg"].replace("Input should be", "must be").replace("\n", " ")
    if first["type"] in ("union_tag_invalid", "union_tag_not_found"):
        tags = first.get("ctx", {}).get("expected_tags") or "one of its kinds"
        message = f"needs a field kind; valid: {tags}"
        path += ".kind"
    elif first["type"] == "missing":
        message = "is required"
    elif isinstance(first["input"], str | int | float | bool):
        message += f", not {json.dumps(first['input'], ensure_ascii=False)[:60]}"
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return f"{path}: {message}{more}"


def _read(source: str | Path) -> object:
    text = str(source)
    if text in shipped():
        content = (LIBRARY / f"{text}.yaml").read_text("utf-8")
    else:
        path = Path(source)
        try:
            if not path.is_file():
                raise SceneError(f"scene: {text[:200]!r} is no file and no scene that ships; valid: {', '.join(shipped())}")
            if path.stat().st_size > MAX_FILE:
                raise SceneError(f"scene: {text[:200]!r} is larger than {MAX_FILE} bytes")
            content = path.read_text("utf-8")
        except (OSError, UnicodeDecodeError, ValueError) as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"scene: {text[:200]!r} cannot be read as a text file") from None
    try:
        return yaml.load(content, Loader=_Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or "not YAML"
        raise SceneError(f"scene: {text[:200]!r}{where}: {problem}") from None
    except (RecursionError, ValueError, OverflowError):
        raise SceneError(f"scene: {text[:200]!r} is not a YAML mapping of plain values") from None


class _Loader(yaml.SafeLoader):
    """Safe YAML without aliases (which can grow without bound) and without repeated keys."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.composer.ComposerError(None, None, "aliases are not allowed", event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen = set()
        for key, _ in node.value:
            if key.value in seen and isinstance(key.value, str):
                raise yaml.constructor.ConstructorError(None, None, f"{key.value!r} is given twice", key.start_mark)
            if isinstance(key.value, str):
                seen.add(key.value)
        return super().construct_mapping(node, deep)
