"""Conversion of a set to named arrays, and back."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.sets.cells.labelled import LabelledBox
from rungwise.sets.cells.labels import Label
from rungwise.sets.cells.tree import Tree

if TYPE_CHECKING:
    import xarray


def dataset(found: LabelledBox) -> xarray.Dataset:
    """Vertices, leaves and crossings, in the units of the parameters."""
    import xarray as xr

    tree, low, unit = found.tree, found.box[:, 0], found.unit
    places = tree.vertices.places(tree.vertices.keys)
    levels = np.concatenate([np.full(len(cells), level) for level, cells in enumerate(tree.leaves)])
    edges = np.concatenate([keys for keys, _ in found.crossings.values()])
    fractions = np.concatenate([part for _, part in found.crossings.values()])
    edge_levels = np.concatenate([np.full(len(keys), level) for level, (keys, _) in found.crossings.items()])
    starts = tree.vertices.places(edges // tree.axes).astype(np.float64)
    starts[np.arange(len(edges)), edges % tree.axes] += fractions * 2.0 ** (tree.finest - edge_levels)
    return xr.Dataset(
        {
            "vertex": (("vertices", "axis"), low + places * unit),
            "label": (
                ("vertices",),
                tree.vertices.labels.astype(np.int8),
                {"labels": [str(x) for x in Label]},
            ),
            "margin": (("vertices",), tree.vertices.margins),
            "borrowed": (("vertices",), tree.vertices.borrowed.astype(np.int8)),
            "leaf": (("leaves", "axis"), np.concatenate(tree.leaves)),
            "level": (("leaves",), levels.astype(np.int8)),
            "crossing": (("crossings", "axis"), low + starts * unit),
            "edge": (("crossings",), edges),
            "edge_level": (("crossings",), edge_levels.astype(np.int8)),
            "fraction": (("crossings",), fractions),
            "box": (("axis", "end"), found.box),
        },
        coords={"axis": np.array(found.over, dtype=object)},
        attrs={
            "request": json.dumps(found.request),
            "scene_file": found.scene.stored,
            "evaluations": found.evaluations,
            "probes": found.probes,
            "hits": found.hits,
            "complete": int(found.complete),
        },
    )


def read(
    data: xarray.Dataset, axes: int, target: int, finest: int
) -> tuple[Tree, dict[int, tuple[Ints, Reals]]]:
    """The tree, and crossings by level, that `dataset` wrote."""
    tree = Tree.empty(axes, target, finest)
    box = data.box.values
    unit = (box[:, 1] - box[:, 0]) / (1 << tree.finest)
    keys = tree.vertices.key(np.rint((data.vertex.values - box[:, 0]) / unit).astype(np.int64))
    tree.vertices.keys, tree.vertices.labels = keys, data.label.values.astype(np.int64)
    tree.vertices.margins, tree.spent = data.margin.values, not data.attrs["complete"]
    tree.vertices.borrowed = data.borrowed.values.astype(bool)
    levels = data.level.values
    tree.leaves = [data.leaf.values[levels == level] for level in range(tree.finest + 1)]
    edge_levels = data.edge_level.values
    crossings = {
        int(level): (data.edge.values[edge_levels == level], data.fraction.values[edge_levels == level])
        for level in range(target, max(target, *edge_levels.tolist(), 0) + 1)
    }
    return tree, crossings
