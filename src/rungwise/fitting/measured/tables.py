"""Arguments of motions from tables, datasets and runs; and tables of them."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.fitting.measured.errors import MotionError
from rungwise.kernel import Reals
from rungwise.scene.fields.values import shown

if TYPE_CHECKING:
    import xarray

HEAD = re.compile(r"^\s*([^\[\]]+?)\s*(?:\[\s*([^\[\]]*?)\s*\])?\s*$")
"""A column: a name, and its unit in brackets."""
RATE = re.compile(r"^speed\((.+)\)$")


def read_csv(file: Path) -> dict[str, Any]:
    """Motions from a table with a head: `time`, and if there are several `trial`; coordinates
    (`part.x [mm]`), velocities (`speed(part.x)`), and columns without a dot, which are inputs where they
    change within a trial and else known parameters. An empty field is a gap. Raises MotionError."""
    names, units, rows = _table(file)
    if "time" not in names:
        raise MotionError(f"{file.name}: the head has no column `time`")
    trial = rows[:, names.index("trial")] if "trial" in names else np.zeros(len(rows))
    starts = np.flatnonzero(np.append(True, trial[1:] != trial[:-1]))
    parts = np.split(rows, starts[1:])

    def columns(which: Sequence[str]) -> list[Any]:
        at = [names.index(name) for name in which]
        return [part[:, at] for part in parts]

    coordinates = [name for name in names if "." in name and not RATE.match(name)]
    rates = [name for name in names if RATE.match(name)]
    others = [name for name in names if name not in (*coordinates, *rates, "time", "trial")]
    held = {name: all(np.ptp(part[:, names.index(name)]) == 0.0 for part in parts) for name in others}
    if not coordinates:
        raise MotionError(f"{file.name}: the head names no coordinate, such as part.x")
    told: dict[str, Any] = {"units": units}
    if rates:
        told |= {
            "velocities": columns(rates),
            "rates": [name[len("speed(") : -1] for name in rates],
        }
    told["parameters"] = {
        name: np.array([part[0, names.index(name)] for part in parts]) for name in others if held[name]
    }
    told["inputs"] = {
        name: [part[:, names.index(name)] for part in parts] for name in others if not held[name]
    }
    times = [part[:, names.index("time")] for part in parts]
    return told | {"coordinates": coordinates, "times": times, "places": columns(coordinates)}


def _table(file: Path) -> tuple[list[str], dict[str, str], Any]:
    """Names and units of columns, and numbers (r, c)."""
    try:
        with file.open(newline="", encoding="utf-8") as source:
            lines = [line for line in csv.reader(source) if line and not line[0].startswith("#")]
    except FileNotFoundError:
        raise MotionError(f"data: {str(file)[:200]!r} is no file") from None
    except (OSError, UnicodeDecodeError, csv.Error):
        raise MotionError(f"data: {str(file)[:200]!r} cannot be read as a table") from None
    if len(lines) < 2:
        raise MotionError(f"{file.name}: has no rows below its head")
    heads = [HEAD.match(text) for text in lines[0]]
    if not all(heads):
        raise MotionError(f"{file.name}: wrong head {shown(','.join(lines[0]))}")
    names = [head.group(1) for head in heads if head]
    units = {head.group(1): head.group(2) for head in heads if head and head.group(2)}
    rows = np.full((len(lines) - 1, len(names)), np.nan)
    for i, line in enumerate(lines[1:]):
        if len(line) != len(names):
            raise MotionError(f"{file.name}: row {i + 1} has {len(line)} fields, and the head {len(names)}")
        for j, text in enumerate(line):
            try:
                rows[i, j] = float(text) if text.strip() else np.nan
            except ValueError:
                raise MotionError(
                    f"{file.name}: {names[j]} in row {i + 1} is no number: {shown(text)}"
                ) from None
    return names, units, rows


def write_csv(file: Path, names: Sequence[str], trials: Sequence[Reals]) -> None:
    """Write the rows of trials as `read_csv` reads them, in m, rad and s; nan is an empty field."""
    with file.open("w", newline="", encoding="utf-8") as target:
        writer = csv.writer(target)
        writer.writerow(names)
        for rows in trials:
            for row in rows.tolist():
                writer.writerow([int(row[0]), *("" if x != x else repr(x) for x in row[1:])])


def read_datasets(data: xarray.Dataset | Sequence[xarray.Dataset]) -> dict[str, Any]:
    """Motions from datasets with `position` over `time` and `coordinate`, and `velocity`. Raises
    MotionError."""
    from xarray import Dataset

    every = [data] if isinstance(data, Dataset) else list(data)
    for i, each in enumerate(every):
        if "position" not in each or set(each["position"].dims) != {"time", "coordinate"}:
            raise MotionError(f"data.{i}: must have `position` over `time` and `coordinate`")
    told: dict[str, Any] = {}
    if all("velocity" in each for each in every):
        along = next(str(name) for name in every[0]["velocity"].dims if name != "time")
        told = {
            "velocities": [each["velocity"].transpose("time", along).values for each in every],
            "rates": [str(name) for name in every[0][along].values],
        }
    return told | {
        "coordinates": [str(name) for name in every[0]["coordinate"].values],
        "times": [each["time"].values for each in every],
        "places": [each["position"].transpose("time", "coordinate").values for each in every],
    }


def read_runs(runs: Any) -> dict[str, Any]:
    """Motions from the recorded frames of runs of one scene. Raises MotionError."""
    every = [runs] if hasattr(runs, "trajectory") else list(runs)
    if not every:
        raise MotionError("runs: there are none")
    return read_datasets([_steady(run.trajectory) for run in every])


def _steady(data: xarray.Dataset) -> xarray.Dataset:
    """Frames of a run without those at the same time as the frame before."""
    keep = np.append(True, np.diff(data["time"].values) > 0.0)
    return data.isel(time=keep)
