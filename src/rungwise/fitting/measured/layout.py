"""Motions laid out for a scene: whole states at frames, what is compared, and how exactly it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.fitting.measured.errors import MotionError
from rungwise.fitting.measured.motions import Motions, Trial
from rungwise.fitting.measured.smoothing import WINDOW, deviation, smooth
from rungwise.kernel import Ints, Reals
from rungwise.world.find import world_of

FINEST = 1e-7
"""Least deviation of a coordinate, as a part of its travel or of the size of objects: runs have no noise."""
AXES = ("turn_x", "turn_y", "turn_z")


class Compared(NamedTuple):
    """What of states (n_q,) is compared: plain columns, and quaternions (t, 4) by the vector of the turn
    between two (3,), about the body's own axes. names (e,): of the errors."""

    plain: Ints
    turns: Ints
    names: tuple[str, ...]

    def errors(self, q: Reals, aim: Reals) -> Reals:
        """Errors (..., e) of places (..., n_q)."""
        parts = [(q - aim)[..., self.plain]]
        parts += [turn_between(aim[..., four], q[..., four]) for four in self.turns]
        return np.concatenate(parts, axis=-1)


class Frames(NamedTuple):
    """One trial: times (k,), whole places q (k, n_q), with gaps nan, velocities v (k, n_v) at the frames
    `known` (k,), at which all is known; the deviation of rates over that of places `gain`."""

    times: Reals
    q: Reals
    v: Reals
    known: NDArray[np.bool_]
    trial: Trial


class Layout(NamedTuple):
    """Motions of a scene. sigma (e,): deviations of what is compared; start (n_q + n_v,): of the states from
    which runs begin, 0 where these are the scene's own."""

    compared: Compared
    trials: list[Frames]
    sigma: Reals
    start: Reals


def turn_between(a: Reals, b: Reals) -> Reals:
    """The rotation vector (..., 3) from the quaternion a to b (..., 4), in the frame of a."""
    w = (a * b).sum(axis=-1, keepdims=True)
    x = a[..., :1] * b[..., 1:] - b[..., :1] * a[..., 1:] - np.cross(a[..., 1:], b[..., 1:])
    x = np.where(w < 0.0, -x, x)
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(size, np.abs(w))
    return np.asarray(x * np.where(size > 1e-12, angle / np.maximum(size, 1e-12), 2.0))


def laid_out(scene: Any, motions: Motions) -> Layout:
    """The motions of a scene's coordinates. Raises MotionError where names are not the scene's."""
    world = world_of(scene)
    template, moved = scene.template, world.at().moved
    measured = np.array([template.coordinates.index(name) for name in motions.coordinates])
    led = set(world.prescribed)
    turns = np.array([four for four in moved.turns if set(four) <= set(measured)], np.int64).reshape(-1, 4)
    inside = {int(x) for x in moved.turns.reshape(-1)}
    partly = [four for four in moved.turns if 0 < len(set(four) & set(measured)) < 4]
    if partly:
        raise MotionError(f"coordinates: of {template.coordinates[partly[0][0]]} all four numbers are needed")
    plain = np.array(
        [c for c in sorted(measured) if c not in inside and template.coordinates[c] not in led], np.int64
    )
    if not len(plain) + len(turns):
        raise MotionError("coordinates: the scene gives the motion of all that was measured")
    names = [template.coordinates[c] for c in plain]
    for four in turns:
        body = template.coordinates[four[0]].rsplit(".", 1)[0]
        names += [f"{body}.{axis}" for axis in AXES]
    compared = Compared(plain, turns, tuple(names))
    return _with_deviations(scene, motions, compared, measured)


def _with_deviations(scene: Any, motions: Motions, compared: Compared, measured: Ints) -> Layout:
    """Frames of all trials, and deviations as given, or else as far as places scatter."""
    world = world_of(scene)
    q0, v0 = scene.start()
    rates = [world.velocities.index(name) for name in motions.rates if name in world.velocities]
    scatters, speeds, travel = [], [], []
    frames = list[Frames]()
    for trial in motions.trials:
        q = np.tile(q0, (len(trial.times), 1))
        q[:, measured] = trial.q
        for four in compared.turns:
            q[:, four] = _continuous(q[:, four])
        probes = np.arange(0, len(trial.times), WINDOW)
        scatters.append(deviation(smooth(trial.times, q, probes).scatter, len(q)))
        travel.append(np.nanmax(q, axis=0) - np.nanmin(q, axis=0))
        v = np.tile(v0, (len(trial.times), 1))
        if trial.v is not None:
            v[:, rates] = trial.v
            speeds.append(deviation(smooth(trial.times, v, probes).scatter, len(v)))
        known = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
        frames.append(Frames(trial.times, q, v, known, trial))
    moved = world.at().moved
    sizes = moved.size / np.where(moved.weights > 0.0, moved.weights, 1.0)
    places = np.maximum(np.median(scatters, axis=0), FINEST * np.maximum(np.max(travel, axis=0), sizes))
    own = np.median(speeds, axis=0) if speeds else np.full(len(v0), np.nan)
    return _layout(scene, motions, compared, frames, places, own, measured)


def _layout(
    scene: Any, motions: Motions, compared: Compared, frames: list[Frames], places: Reals, own: Reals,
    measured: Ints,
) -> Layout:  # fmt: skip
    """Deviations of what is compared and of starts, by what is given and what was estimated."""
    names, velocities = scene.template.coordinates, world_of(scene).velocities
    given, rate_of = motions.deviations, _rate_gain(frames)
    own_q = np.array([given.get(name, each) for name, each in zip(names, places, strict=True)])
    turned = [2.0 * float(np.median(places[four])) for four in compared.turns]
    turned = [given.get(names[four[0]], x) for four, x in zip(compared.turns, turned, strict=True)]
    sigma = np.concatenate([own_q[compared.plain], np.repeat(turned, 3)])
    start_q = np.where(np.isin(np.arange(len(names)), measured), own_q, 0.0)
    start_v = np.zeros(len(velocities))
    for k, name in enumerate(velocities):
        if not np.isnan(own[k]) and f"{name}" in motions.rates:
            start_v[k] = given.get(f"speed({name})", max(own[k], FINEST))
        elif name in names and names.index(name) in measured:
            start_v[k] = rate_of * own_q[names.index(name)]
    for four, x in zip(compared.turns, turned, strict=True):
        start_q[four] = 0.5 * x
        body = names[four[0]].rsplit(".", 1)[0]
        for k, name in enumerate(velocities):
            if name.startswith(f"{body}.r") and start_v[k] == 0.0:
                start_v[k] = rate_of * x
    return Layout(compared, frames, sigma, np.concatenate([start_q, start_v]))


def _rate_gain(frames: Sequence[Frames]) -> float:
    """Deviation of a rate over that of a frame, by local regression."""
    first = frames[0]
    found = smooth(first.times, first.times[:, None], np.arange(0, len(first.times), WINDOW))
    return float(np.nanmedian(found.gain))


def rates_at(layout: Layout, scene: Any, frames: Frames, rows: Ints) -> tuple[Reals, Reals]:
    """Velocities (r, n_v) at frames (r,), and their deviations: those measured, or by local regression."""
    names, velocities = scene.template.coordinates, world_of(scene).velocities
    deviations = np.tile(layout.start[len(names) :], (len(rows), 1))
    if frames.trial.v is not None:
        return np.asarray(frames.v[rows]), deviations
    found = smooth(frames.times, frames.q, rows)
    v = frames.v[rows].copy()
    moving = np.isfinite(layout.start[len(names) :]) & (layout.start[len(names) :] > 0.0)
    for k, name in enumerate(velocities):
        if moving[k] and name in names:
            column = names.index(name)
            v[:, k] = found.rates[:, column]
            deviations[:, k] = found.gain[:, column] * np.maximum(found.own[:, column], layout.start[column])
    for four in layout.compared.turns:
        body = names[four[0]].rsplit(".", 1)[0]
        columns = [velocities.index(f"{body}.{axis}") for axis in ("rx", "ry", "rz")]
        v[:, columns] = 2.0 * _body_rate(frames.q[rows][:, four], found.rates[:, four])
        scatter = np.maximum(found.own[:, four], layout.start[four])
        deviations[:, columns] = 2.0 * (found.gain[:, four] * scatter).max(axis=1, keepdims=True)
    return v, deviations


def _body_rate(q: Reals, rate: Reals) -> Reals:
    """The vector part of conj(q) q', half of the angular velocity in the body's frame."""
    return np.asarray(q[:, :1] * rate[:, 1:] - rate[:, :1] * q[:, 1:] - np.cross(q[:, 1:], rate[:, 1:]))


def _continuous(q: Reals) -> Reals:
    """Quaternions (k, 4) with the signs that change least from frame to frame."""
    found = q.copy()
    for i in range(1, len(found)):
        if np.nansum(found[i] * found[i - 1]) < 0.0:
            found[i] = -found[i]
    return found
