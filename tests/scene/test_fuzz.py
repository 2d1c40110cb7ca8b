"""Whatever a scene is made into, loading it gives a scene or one line of SceneError."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rungwise.scene import SceneError, load, shipped
from rungwise.scene.scene import LIBRARY

TEXTS = {name: (LIBRARY / f"{name}.yaml").read_bytes() for name in shipped()}
SCENES = {name: yaml.safe_load(text) for name, text in TEXTS.items()}
COMMON = settings(
    deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

plain = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.binary(max_size=4),
    st.sampled_from(
        ["v1", "-v1", "1/0", "0/0", "t", "zzz", "part.x3", "inf", "point", "free", "robot", "*", 10**400]
    ),
)
values = st.recursive(
    plain,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.text(max_size=5) | st.integers() | st.sampled_from(["kind", "x"]), inner, max_size=3
        )
    ),
    max_leaves=5,
)


def places(part: Any) -> list[tuple[Any, Any]]:
    """(container, key) of everything inside."""
    keys = list(part) if isinstance(part, dict) else range(len(part)) if isinstance(part, list) else []
    return [place for key in keys for place in [(part, key), *places(part[key])]]


def mutate(scene: Any, data: st.DataObject) -> None:
    """One change: a value replaced, removed, added, or exchanged with another of the scene."""
    container, key = data.draw(st.sampled_from(places(scene)))
    match data.draw(st.sampled_from(["replace", "remove", "add", "swap"])):
        case "replace":
            container[key] = data.draw(values)
        case "remove":
            del container[key]
        case "add" if isinstance(container, dict):
            container[data.draw(st.text(max_size=5) | st.sampled_from(["kind", "drive", "shape"]))] = (
                data.draw(values)
            )
        case "add":
            container.append(data.draw(values))
        case _:
            other, place = data.draw(st.sampled_from(places(scene)))
            container[key] = copy.deepcopy(other[place])


def is_bound_or_refused(source: Any) -> None:
    try:
        load(source).bind()
    except SceneError as error:
        assert str(error).isprintable()
        assert 0 < len(str(error)) < 1000


@pytest.mark.few(1)
@pytest.mark.parametrize("name", SCENES)
@settings(COMMON, max_examples=30)
@given(data=st.data())
def test_changed_scenes(name: str, data: st.DataObject) -> None:
    scene = copy.deepcopy(SCENES[name])
    for _ in range(data.draw(st.integers(1, 3))):
        if scene:
            mutate(scene, data)
    is_bound_or_refused(scene)


@settings(COMMON, max_examples=75)
@given(values)
def test_anything(value: Any) -> None:
    is_bound_or_refused(value if not isinstance(value, str) else {value: value})


@pytest.mark.few(1)
@pytest.mark.parametrize("name", TEXTS)
@settings(COMMON, max_examples=30)
@given(data=st.data())
def test_changed_text(name: str, data: st.DataObject, tmp_path: Path) -> None:
    text = bytearray(TEXTS[name])
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = start + data.draw(st.integers(0, 12))
        snippet = st.binary(max_size=6) | st.sampled_from(
            [
                b"!!",
                b"&a ",
                b"*a",
                b"<<: ",
                b"? ",
                b": ",
                b"- ",
                b"{",
                b"}",
                b"[",
                b"]",
                b"#",
                b"'",
                b'"',
                b"\n",
                b"\t",
                b"|",
                b">",
                b"%",
                b"@",
                b"`",
                b"---\n",
                b"...\n",
                b"null",
                b"yes",
                b"1e9",
                b"\xff",
                b"\xc3\xa9",
                b"\0",
            ]
        )
        text[start:stop] = data.draw(snippet)
    path = tmp_path / "scene.yaml"
    path.write_bytes(text)
    is_bound_or_refused(path)


@settings(COMMON, max_examples=75)
@given(
    st.binary(max_size=40)
    | st.text(alphabet="ab01:-?{}[],&*!|>%'\"#~<=. \n\t\\", max_size=40).map(str.encode)
)
def test_any_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "scene.yaml"
    path.write_bytes(content)
    is_bound_or_refused(path)
