"""Blocks: arrays that kernels get by reference."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from rungwise.block import Block
from rungwise.kernel import Reals, kernel
from rungwise.mould import Mould


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


def test_a_cast_holds_what_its_block_held_and_shares_no_memory_with_it() -> None:
    block = make()
    mould = Mould(block)
    block.x[:] = 100.0
    one, other = mould.cast(), mould.cast()
    one.inner.x[0] = 4.0
    assert (total(one), total(other), total(block)) == (19.0, 18.0, 315.0)
    assert total(Mould(one).cast()) == 19.0


def test_arrays_that_share_memory_do_so_in_a_cast() -> None:
    memory = np.arange(12.0)
    block = Outer(x=memory, y=memory[3:6], inner=Inner(x=memory[4:].reshape(2, 4)))
    cast = Mould(block).cast()
    cast.x[5] = -1.0
    assert cast.y.tolist() == [3.0, 4.0, -1.0] and cast.inner.x[0, 1] == -1.0
    assert memory[5] == 5.0


def test_arrays_that_cannot_be_written_belong_to_all_casts() -> None:
    fixed = np.ones(3)
    fixed.flags.writeable = False
    cast = Mould(Outer(x=np.zeros(3), y=fixed, inner=Inner(x=np.zeros(0)))).cast()
    assert cast.y is fixed and total(Outer(x=cast.x, y=cast.y, inner=Inner(x=np.zeros(3)))) == 3.0


def test_zeros_are_not_kept_and_come_last() -> None:
    mould = Mould(Outer(x=np.zeros(100_000), y=np.ones(3), inner=Inner(x=np.zeros(100_000))))
    assert len(pickle.dumps(mould._head)) < 10_000
    cast = mould.cast()
    assert not cast.x.any() and cast.y.tolist() == [1.0] * 3 and not cast.inner.x.any()


def test_a_cast_outlives_its_block_and_has_no_other_fields() -> None:
    inner = Mould(make()).cast().inner
    assert inner.x.tolist() == [3.0] * 3 and pickle.loads(pickle.dumps(inner)).x.tolist() == [3.0] * 3
    with pytest.raises(AttributeError, match="Inner has no field z"):
        _ = inner.z  # type: ignore[attr-defined]
