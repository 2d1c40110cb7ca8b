"""Blocks: arrays that kernels get by reference."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from rungwise.block import Block
from rungwise.kernel import Reals, kernel


class Inner(Block):
    x: Reals


class Outer(Inner):
    y: Reals
    inner: Inner


@kernel
def total(block: Outer) -> float:
    result = 0.0
    for i in range(block.x.shape[0]):
        result += block.x[i] + block.y[i] + block.inner.x[i]
    return result


def make() -> Outer:
    return Outer(x=np.ones(3), y=np.full(3, 2.0), inner=Inner(x=np.full(3, 3.0)))


def test_a_block_adds_fields_to_another_and_holds_blocks() -> None:
    block = make()
    assert total(block) == 18.0
    block.inner.x[0] = 4.0
    assert total(block) == 19.0


def test_a_copy_has_arrays_of_its_own() -> None:
    block = make()
    copied = pickle.loads(pickle.dumps(block))
    block.x[:], block.inner.x[:] = 100.0, 100.0
    assert total(copied) == 18.0


@pytest.mark.parametrize("fields", [{"x": np.ones(3)}, {"x": np.ones((3, 3))[:, 0], "y": np.ones(3)}])
def test_what_is_not_a_block_is_refused(fields: dict[str, np.ndarray]) -> None:
    with pytest.raises(TypeError):
        Outer(**fields, inner=Inner(x=np.ones(3)))
