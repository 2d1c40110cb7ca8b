"""A scene that has been read: load, describe its parameters, bind them."""

from __future__ import annotations

import pickle
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import yaml
from pydantic import ValidationError

from rungwise.block import Block
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.mould import Mould
from rungwise.plain import cut
from rungwise.scene.bind.bind import bind
from rungwise.scene.contract import AnyScene
from rungwise.scene.drawings.drawing import with_outlines
from rungwise.scene.errors import SceneError, out_of_range
from rungwise.scene.fields.fields import SceneFile
from rungwise.scene.fields.lifts import with_lifts
from rungwise.scene.fields.shapes import MANY, ONE
from rungwise.scene.fields.task import numbers_of
from rungwise.scene.fields.values import shown
from rungwise.scene.language.expression import STACK, Programs
from rungwise.scene.template import faults
from rungwise.scene.template import records as rec
from rungwise.scene.template.build import build
from rungwise.scene.template.template import Followed, Numbers, Template
from rungwise.wording import choices

if TYPE_CHECKING:
    pass

MAX_FILE = 2_000_000
MOST_VALUES = 100_000
"""Values of a file where each alias is written out, at most."""
FARTHEST = 1e75
"""Farthest place in the plane, in the scene's unit: products of four places are finite."""
LIBRARY = files("rungwise.scene") / "library"


class InvalidScene(SceneError):
    """The scene is well written but impossible at these parameters."""


class Bound(Block):
    """A scene with every number known, ready for kernels.

    `records` are views of `buffer`. Expressions read `values`: parameters, t, q, v, gaps, normal forces,
    tolerance.
    """

    buffer: Reals
    records: rec.Records
    values: Reals

    @property
    def tolerance(self) -> float:
        return float(self.records.world[0]["tolerance"])

    @property
    def duration(self) -> float:
        return float(self.records.world[0]["duration"])

    @property
    def step(self) -> float:
        return float(self.records.world[0]["step"])


@dataclass(frozen=True, eq=False)
class Scene(AnyScene):
    """One manipulation task: the `file` as read, and the `template` that kernels bind."""

    file: SceneFile
    template: Template
    world: ClassVar[str] = "rungwise.world.planar"
    farthest: ClassVar[float] = FARTHEST

    def __repr__(self) -> str:
        bodies, parameters = cut(", ".join(self.file.bodies), 120), cut(", ".join(self.file.parameters), 120)
        return f"<Scene {cut(self.name)}: bodies {bodies}; parameters {parameters or 'none'}>"

    @property
    def whole(self) -> str:
        """All that the scene says as JSON, defaults as well."""
        return self.file.model_dump_json()

    @property
    def programs(self) -> Programs:
        """Programs of the scene's conditions (see `AnyScene`)."""
        return self.template.conditions

    @property
    def followed(self) -> Followed:
        """Programs of numbers that follow time and inputs (see `AnyScene`)."""
        template = self.template
        return Followed(
            template.timed_speeds(), template.timed_numbers(), template.reads_time, template.awaits_time
        )

    def changed(self, **fields: Any) -> Scene:
        """The scene with other fields of its file, such as its goal, and without those that are None. Raises
        SceneError."""
        file = self.file.model_copy(update=fields).model_dump(exclude_unset=True)
        return load({name: value for name, value in file.items() if fields.get(name, self) is not None})

    def start(self, parameters: Mapping[str, float] | None = None) -> tuple[Reals, Reals]:
        """q (n,) and v (n,) where the scene starts, at values of `parameters` by name; others keep their
        defaults."""
        records = self.bind(parameters).records
        q, v = records.coordinates["start"].copy(), records.coordinates["speed"].copy()
        for body in records.bodies[records.bodies["motion"] == rec.FREE]:
            first = int(body["coordinate"])
            q[first : first + 3] += [body["x"], body["y"], body["angle"]]
        return q, v

    def yaml(self) -> str:
        """The scene as a file: what was given, with drawings as outlines."""
        return as_yaml(self.file.model_dump(mode="json", exclude_unset=True))

    def task_numbers(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """The numbers of the task, by their paths, at the `given` parameters. Raises InvalidScene."""
        paths = [place.path for place in numbers_of(self.file.task)] if self.file.task is not None else []
        return dict(zip(paths, self.bind(given).records.task["value"].tolist(), strict=True))

    def bind(self, given: Mapping[str, float] | None = None) -> Bound:
        """All numbers at the `given` parameters. Raises InvalidScene, naming the field, when the scene is
        impossible."""
        return self.bind_values(self.parameters(given).values())

    def bind_values(self, told: Collection[float]) -> Bound:
        """The same at the values of all parameters, `told` in order and checked."""
        template = self.template
        numbers, bounds = _mould(template)
        bound = bounds.cast()
        buffer, records, values = bound.buffer, bound.records, bound.values
        values[: len(template.parameters)] = list(told)
        checks = template.checks
        fault, index = bind(numbers, checks.bounds, values, np.zeros(STACK), buffer, records)
        if fault == faults.OUT_OF_RANGE:
            raise InvalidScene(self._out_of_range(index, float(buffer[checks.bounds.slots[index]])))
        if fault != faults.BOUND:
            raise InvalidScene(f"{self._place(fault, index, records)}: {faults.FAULTS[fault]}")
        values[-1] = records.world[0]["tolerance"]
        return bound

    def _out_of_range(self, index: int, value: float) -> str:
        known, path = self.template.checks.bounds, self.template.checks.paths[index]
        return f"{path}: {out_of_range(value, known.low[index], known.high[index], int(known.kinds[index]))}"

    def _place(self, fault: int, index: int, records: rec.Records) -> str:
        template = self.template
        if fault == faults.OUT_OF_TRAVEL:
            body, coordinate = template.coordinates[index].split(".")
            return f"bodies.{body}.coordinates.{coordinate}"
        if fault in (faults.NOT_CONVEX, faults.NO_NORMAL):
            return f"bodies.{template.bodies[int(records.shapes[index]['body'])]}.shape"
        if fault == faults.NOT_POSITIVE or fault >= faults.REFUSED:
            return f"contacts between {' and '.join(template.contacts[index])}"
        if fault in (faults.NO_AREA, faults.NO_WEIGHT):
            return f"bodies.{template.bodies[int(records.supports[index]['body'])]}.support.pressure"
        if fault == faults.OVERHANGS:
            return f"bodies.{template.bodies[int(records.supports[index]['body'])]}.support.centre"
        if fault == faults.NO_JOINT_AXIS:
            return f"joints.{template.joints[index]}.axis"
        return f"bodies.{template.bodies[index]}"


@lru_cache(maxsize=64)
def _mould(template: Template) -> tuple[Numbers, Mould[Bound]]:
    """Programs of the numbers that parameters determine, and what is bound, with literal numbers alone."""
    buffer = template.buffer.copy()
    records, values = rec.views(buffer, template.counts), np.zeros(template.value_count)
    return template.fixed_numbers(), Mould(Bound(buffer=buffer, records=records, values=values))


@keywords
def load(source: Scene | str | Path | Mapping[str, Any]) -> Scene:
    """Read a planar scene (see `read.load`, which tells scenes in space). Raises SceneError: one line that
    names the field and its valid values."""
    return read(source, shipped())


def read(source: Scene | str | Path | Mapping[str, Any], known: Sequence[str]) -> Scene:
    """The planar scene of a source, which is told `known` names where it is none. Raises SceneError."""
    if isinstance(source, Scene):
        return source
    if not isinstance(source, str | Path | Mapping):
        raise SceneError(f"scene: must be a name, a path or a mapping, not {shown(source)}")
    data = dict(source) if isinstance(source, Mapping) else _read(source, known)
    folder = Path() if isinstance(source, Mapping) else Path(source).parent
    try:
        file = with_lifts(with_outlines(SceneFile.model_validate(data), folder))
    except ValidationError as error:
        raise SceneError(explain(error, data)) from None
    except RecursionError:
        raise SceneError("scene: nested too deeply") from None
    return Scene(file, build(file))


def shipped() -> tuple[str, ...]:
    """Names of the planar scenes that come with the package (in space: `shipped_in_space`)."""
    return tuple(sorted(p.name.removesuffix(".yaml") for p in LIBRARY.iterdir() if p.name.endswith(".yaml")))


def schema() -> dict[str, Any]:
    """JSON schema of scene files."""
    return SceneFile.model_json_schema()


WORDY = 60
"""Characters of a name that an error suggests, at most."""
WORDING = {
    "missing": "is required",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must be a name (a letter, then letters, digits and _)",
    "literal_error": "must be {expected}",
    "dict_type": "must be a mapping",
    "tuple_type": "must be a list",
    "too_short": "must have at least {min_length}, not {actual_length}",
    "too_long": "must have at most {max_length}",
    "greater_than": "must be greater than {gt:g}",
}
"""Type of a pydantic error -> the message for a scene's author."""

_COMPLETE = {
    "missing",
    "too_short",
    "too_long",
    "unknown_field",
    "kind",
    "mapping",
    "keyword",
    "range",
    "joint",
    "support",
    "law",
}
"""Errors whose text does not go on with the given value."""


def explain(error: ValidationError, data: object) -> str:
    """The first error as one line: field, fault, valid values; and how many more errors there are."""
    errors = error.errors(include_url=False)
    errors = [
        e for e in errors if e["type"] != "too_short"
    ] or errors  # a list with a wrong entry counts as too short
    first = errors[0]
    wording = WORDING.get(first["type"])
    message = first["msg"] if wording is None else wording.format_map(first.get("ctx", {}))
    if first["type"] not in _COMPLETE:
        message += f", not {shown(first['input'])}"
    if first["type"] == "string_pattern_mismatch":
        plain = re.sub(r"\W+", "_", str(first["input"]), flags=re.ASCII).strip("_")
        message += f"; {plain} would be one" if plain[:1].isalpha() and len(plain) < WORDY else ""
    path = _path(first["loc"], data)
    if first["type"] == "kind":
        path += ".kind"
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return f"{path}: {message}{more}"


def _path(loc: tuple[str | int, ...], data: object) -> str:
    """Place of an error as its author wrote it: without the tags that pydantic adds on entering a union."""
    parts: list[str] = []
    kind = None
    for part in loc:
        if part in (ONE, MANY, "[key]"):
            continue
        if part == kind:
            kind = None
            continue
        parts.append(part if isinstance(part, str) and re.fullmatch(r"[\w.*]{1,60}", part) else shown(part))
        data = _inside(data, part)
        kind = data.get("kind") if isinstance(data, Mapping) else None
    return ".".join(parts) or "scene"


def _inside(data: object, part: str | int) -> object:
    if isinstance(data, Mapping):
        return data.get(part)
    if isinstance(data, list | tuple) and isinstance(part, int) and part < len(data):
        return data[part]
    return None


def _read(source: str | Path, known: Sequence[str]) -> object:
    if str(source) in shipped():
        return _plain((LIBRARY / f"{source}.yaml").read_text("utf-8"))
    return read_yaml("scene", source, f" and no scene that ships{choices(str(source), known)}")


def as_yaml(data: Any) -> str:
    """Plain values as the text of a scene file."""
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=110, allow_unicode=True)


def read_yaml(field: str, source: str | Path, missing: str = "") -> Any:
    """Content of a YAML file of plain values. Raises SceneError that begins with `field`; `missing` follows
    where there is no such file."""
    path, text = Path(source), f"{field}: {str(source)[:200]!r}"
    try:
        if str(source) and path.is_dir():
            raise SceneError(f"{text} is a folder, not a YAML file")
        if not path.is_file():
            raise SceneError(f"{text} is no file{missing}")
        if path.stat().st_size > MAX_FILE:
            raise SceneError(f"{text} is larger than {MAX_FILE} bytes")
        content = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{text} cannot be read as a text file") from None
    try:
        return _plain(content)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "not YAML"
        raise SceneError(f"{text}{where}: {problem}") from None
    except (RecursionError, ValueError, OverflowError):
        raise SceneError(f"{text} is not YAML of plain values") from None


def _plain(content: str) -> Any:
    """The plain values of a text, parsed once: that takes most of the time of loading a scene."""
    return pickle.loads(_parsed(content))


@lru_cache(maxsize=32)
def _parsed(content: str) -> bytes:
    """Pickled, so that each reader has values of its own."""
    return pickle.dumps(yaml.load(content, Loader=_Loader))


def _values_in(node: Any, known: dict[int, int]) -> int:
    """How many values a node has where each alias is written out. Raises ComposerError for too many, and for
    one that stands in what it repeats."""
    count = known.get(id(node))
    if count is None:
        known[id(node)] = 0
        parts = node.value if isinstance(node, yaml.CollectionNode) else ()
        inner = [each for part in parts for each in (part if isinstance(part, tuple) else (part,))]
        count = known[id(node)] = 1 + sum(_values_in(each, known) for each in inner)
    if not 0 < count <= MOST_VALUES:
        why = f"make more than {MOST_VALUES} values" if count else "stand in what they repeat"
        raise yaml.composer.ComposerError(
            None, None, f"aliases {why}; write out what they stand for", node.start_mark
        )
    return count


class _Loader(yaml.SafeLoader):
    """Safe YAML without tags and repeated keys, whose aliases do not grow without bound."""

    def get_single_node(self) -> Any:
        node = super().get_single_node()
        if self.anchors_used and node is not None:
            _values_in(node, {})
        return node

    anchors_used = False

    def compose_node(self, parent: Any, index: Any) -> Any:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call, unused-ignore]
        if self.check_event(yaml.AliasEvent):
            self.anchors_used = True
            return super().compose_node(parent, index)
        if event.tag is not None:
            raise yaml.composer.ComposerError(None, None, "tags are not allowed", event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"{shown(key.value)} is given twice", key.start_mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)
