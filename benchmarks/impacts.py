"""Velocities after single impacts of real objects: rungs beside common laws of impact, and beside the best
impulse there is.

    python benchmarks/impacts.py FOLDER [--only ellipses squares] [--trials N] [--seed N]

FOLDER is that of benchmarks/real.py. Fazeli and others (CoRL and ISRR 2017) compare laws on the ellipses.
Each law, and each rung, is fitted to half of the impacts, and predicts the velocity after the others from the
one before. The error is |predicted - measured| / |measured|, of the velocity whose spin is multiplied by the
radius of gyration, so that its square is an energy over mass; and the same of the centre's velocity alone.
The best impulse is chosen for each impact with its outcome known, among those at the point of contact that
do not add energy: no law of a single point can be nearer. The last column compares impact by impact.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from real import COMPLIANT, GYRATION, RIGID, Real, ellipses, errors_of, fitted, impacts  # beside this file
from real_peers import GRAVITY
from scipy.optimize import minimize

import rungwise as rw
from rungwise.fitting.score import mean_of
from rungwise.kernel import Reals

SIDE, TABLE, PERIOD = 0.06, 0.0018, 0.004
"""Of the squares: side (m), height of the table (m), time between frames (s)."""
NEAR, CLEAR = 0.003, 0.02
"""Flights before and after an impact of a square meet within `NEAR` (m), while every other corner is at least
`CLEAR` (m) above the table: then only one corner took part."""
STILL = 1e-9
"""Speed (m/s) below which the point of contact does not slide."""


class Impact(NamedTuple):
    """One impact: velocities before and after, spins multiplied by the radius of gyration; unit mass."""

    before: Reals
    after: Reals
    normal: Reals
    tangent: Reals

    def speed(self, normal: float, tangent: float) -> Reals:
        """Velocity after these impulses."""
        return self.before + normal * self.normal + tangent * self.tangent


def squares(folder: Path, trials: int) -> Real:
    """The first impacts of the drops in which one corner alone hits."""
    kept = np.load(folder / "squares.npz")
    half = SIDE / 2.0
    corners = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    every = [_first(kept[name], corners) for name in kept.files]
    found = np.array([each for each in every if each is not None][:trials])
    return impacts("squares", corners, SIDE**2 / 6.0, found[:, :6], found[:, 6:])


def _heights(places: Reals, corners: Reals) -> Reals:
    """Heights (..., k) of the corners over the table."""
    s, c = np.sin(places[..., 2:3]), np.cos(places[..., 2:3])
    found: Reals = places[..., 1:2] + s * corners[:, 0] + c * corners[:, 1] - TABLE
    return found


def _first(frames: Reals, corners: Reals) -> Reals | None:
    """Place, velocity, velocity after (9,) of the first impact of a drop, by lines (in height parabolas)
    through up to eight frames of each flight; None where one is short, or several corners take part."""
    lowest = _heights(frames[:, :3], corners).min(axis=1)
    touch = 1 + np.flatnonzero((lowest[1:-1] < 0.004) & (lowest[1:-1] <= lowest[:-2]))
    i = int(touch[0]) if len(touch) else 0
    earlier = [j for j in range(max(0, i - 8), i - 1) if lowest[j] > 0.002]
    later: list[int] = []
    while i + 2 + len(later) < min(i + 10, len(frames)) and lowest[i + 2 + len(later)] >= 0.002:
        later.append(i + 2 + len(later))
    if len(earlier) < 4 or len(later) < 5:
        return None
    flights = [_flight(frames, np.array(own), i) for own in (earlier, later)]
    moments = np.linspace(-2.0, 2.0, 1601) * PERIOD
    inside = np.flatnonzero(_heights(_at(flights[0], moments), corners).min(axis=1) <= 0.0)
    if not len(inside):
        return None
    t = moments[inside[:1]]
    ends = [_at(own, t)[0] for own in flights]
    above = np.sort(_heights(ends[0], corners))
    if np.abs(ends[1] - ends[0])[:2].max() > NEAR or above[1] - above[0] < CLEAR:
        return None
    speeds = [own[:, 0] - (0.0, GRAVITY * t[0], 0.0) for own in flights]
    return np.concatenate([ends[0], *speeds])


def _flight(frames: Reals, rows: Any, origin: int) -> Reals:
    """Rates and values (3, 2) at the frame `origin`."""
    t = (rows - origin) * PERIOD
    falls = np.outer(t**2, (0.0, -0.5 * GRAVITY, 0.0))
    return np.polyfit(t, frames[rows, :3] - falls, 1).T


def _at(flight: Reals, t: Reals) -> Reals:
    """Places (n, 3) of a flight."""
    return flight[:, 1] + np.outer(t, flight[:, 0]) - np.outer(t**2, (0.0, 0.5 * GRAVITY, 0.0))


def impacts_of(motions: rw.Motions, corners: Reals, gyration: float) -> list[Impact]:
    """The impacts of trials that `real.impacts` has made."""
    found = []
    for trial in motions.trials:
        assert trial.v is not None
        s, c = math.sin(trial.q[0, 2]), math.cos(trial.q[0, 2])
        at = corners @ np.array([[c, s], [-s, c]])
        x, y = at[np.argmin(at[:, 1])]
        normal, tangent = np.array([0.0, 1.0, x / gyration]), np.array([1.0, 0.0, -y / gyration])
        found.append(Impact(*(v * (1.0, 1.0, gyration) for v in trial.v[[0, -1]]), normal, tangent))
    return found


def newton(impact: Impact, mu: float, e: float) -> Reals:
    """Newton's restitution; Coulomb's law between the impulses of the whole impact and the final sliding."""
    return impact.speed(*_coulomb(impact, impact.before, mu, -e * float(impact.normal @ impact.before)))


def poisson(impact: Impact, mu: float, e: float) -> Reals:
    """Poisson's restitution, Coulomb's law in compression and restitution each (Anitescu and Potra 1997)."""
    normal, tangent = _coulomb(impact, impact.before, mu, 0.0)
    halfway = impact.speed(normal, tangent)
    pressed = halfway + e * normal * impact.normal
    sticking = -float(impact.tangent @ pressed) / float(impact.tangent @ impact.tangent)
    most = mu * e * normal
    return pressed + min(max(sticking, -most), most) * impact.tangent


def _coulomb(impact: Impact, v: Reals, mu: float, leaving: float) -> tuple[float, float]:
    """Impulses that make the normal velocity `leaving`, in the cone, against the sliding that remains."""
    n, t = impact.normal, impact.tangent
    a = np.array([[n @ n, n @ t], [t @ n, t @ t]])
    wanted = np.array([leaving - n @ v, -t @ v])
    normal, tangent = np.linalg.solve(a, wanted)
    if abs(tangent) <= mu * normal:
        return float(normal), float(tangent)
    for sign in (1.0, -1.0):  # sliding goes along -sign
        normal = wanted[0] / (a[0, 0] + sign * mu * a[0, 1])
        tangent = sign * mu * normal
        if normal > 0.0 and sign * (t @ (v + normal * n + tangent * t)) <= 1e-12:
            return float(normal), float(tangent)
    return float(normal), float(tangent)


def routh(impact: Impact, mu: float, e: float) -> Reals:
    """Poisson's restitution, Coulomb's law at each moment of the impact (Routh; Wang and Mason 1992)."""
    v, pressed, _ = _compressed(impact, mu)
    rest = e * pressed
    while rest > 0.0:
        along, stops = _sliding(impact, v, mu)
        step = min(stops, rest)
        v, rest = v + step * along, rest - step
    return v


def stronge(impact: Impact, mu: float, e: float) -> Reals:
    """The same with Stronge's restitution: the normal force gives back e^2 of the work that it took."""
    v, _, taken = _compressed(impact, mu)
    rest = e**2 * taken
    while rest > 0.0:
        along, stops = _sliding(impact, v, mu)
        speed, gain = float(impact.normal @ v), float(impact.normal @ along)
        whole = (math.sqrt(speed**2 + 2.0 * gain * rest) - speed) / gain
        step = min(stops, whole)
        v, rest = v + step * along, 0.0 if step == whole else rest - step * (speed + 0.5 * step * gain)
    return v


def _compressed(impact: Impact, mu: float) -> tuple[Reals, float, float]:
    """Velocity, normal impulse and work of the normal force when the approach has ended."""
    v, pressed, taken, closed = impact.before, 0.0, 0.0, False
    while not closed:
        along, stops = _sliding(impact, v, mu)
        speed, gain = float(impact.normal @ v), float(impact.normal @ along)
        closes = -speed / gain if gain > 0.0 else math.inf
        step, closed = min(stops, closes), closes <= stops
        v, pressed = v + step * along, pressed + step
        taken -= step * (speed + 0.5 * step * gain)
    return v, pressed, taken


def _sliding(impact: Impact, v: Reals, mu: float) -> tuple[Reals, float]:
    """Change of velocity for each unit of normal impulse, and the impulse after which sliding stops."""
    slip = float(impact.tangent @ v)
    holds = -float(impact.tangent @ impact.normal) / float(impact.tangent @ impact.tangent)
    slides = abs(slip) > STILL
    ratio = -math.copysign(mu, slip) if slides else min(max(holds, -mu), mu)
    along = impact.normal + ratio * impact.tangent
    change = float(impact.tangent @ along)
    return along, -slip / change if slides and slip * change < 0.0 else math.inf


LAWS: dict[str, Callable[[Impact, float, float], Reals]] = {
    "Routh": routh,
    "Stronge": stronge,
    "Poisson": poisson,
    "Newton": newton,
}


def best(impact: Impact) -> Reals:
    """The velocity nearest to the measured one by any impulse at the contact that adds no energy."""
    span = np.linalg.qr(np.column_stack([impact.normal, impact.tangent]))[0]
    kept = impact.before - span @ (span.T @ impact.before)
    wanted, limit = span.T @ impact.after, np.linalg.norm(span.T @ impact.before)
    found: Reals = kept + span @ (wanted * min(1.0, limit / np.linalg.norm(wanted)))
    return found


def relative(impact: Impact, predicted: Reals) -> tuple[float, float]:
    """Errors with spin, and of the centre alone."""
    off, after = predicted - impact.after, impact.after
    norm = np.linalg.norm
    return float(norm(off) / norm(after)), float(norm(off[:2]) / norm(after[:2]))


def law_fitted(law: Callable[[Impact, float, float], Reals], train: list[Impact]) -> dict[str, float]:
    """Friction and restitution with the smallest mean error on impacts."""

    def loss(point: Any) -> float:
        mu, e = np.clip(point, 0.0, 1.0)
        off = float(np.abs(point - (mu, e)).sum())
        return float(np.mean([relative(each, law(each, mu, e))[0] for each in train])) + off

    starts = [(mu, e) for mu in (0.1, 0.3) for e in (0.4, 0.6)]
    found = min((minimize(loss, start, method="Nelder-Mead") for start in starts), key=lambda x: x.fun)
    return {"mu": float(np.clip(found.x[0], 0, 1)), "e": float(np.clip(found.x[1], 0, 1))}


def gyration_of(every: list[Impact], gyration: float) -> tuple[float, float]:
    """Radius of gyration by regression of the impulses' moment on the change of spin, and the other way."""
    spin, moment = [], []
    for impact in every:
        dv = impact.after - impact.before
        spin.append(dv[2] / gyration)
        moment.append((impact.normal[2] * dv[1] + impact.tangent[2] * dv[0]) * gyration)
    w, m = np.array(spin), np.array(moment)
    return math.sqrt(m @ w / (w @ w)), math.sqrt(m @ m / (m @ w))


def table(real: Real, gyration: float, seed: int) -> None:
    """Lines of a page, one as soon as it is known."""
    shape = real.scene.file.bodies["part"].shape
    corners = np.array(shape.vertices, float)
    train, test = real.motions.split(0.5, seed=seed)
    seen, held = (impacts_of(each, corners, gyration) for each in (train, test))
    low, high = gyration_of(seen + held, gyration)
    print(f"{real.name}: {len(seen)} impacts fitted, {len(held)} held out; ", end="")
    print(f"radius of gyration {1e3 * low:.1f} to {1e3 * high:.1f} mm by the impulses")
    print("| set | law | parameters | error with spin | error of the centre | with spin, minus Routh |")
    print("|" + "---|" * 6, flush=True)
    every: dict[str, Reals] = {}
    for name, law in LAWS.items():
        values = law_fitted(law, seen)
        every[name] = np.array([relative(each, law(each, values["mu"], values["e"])) for each in held])
        _print(real.name, name, values, every[name], every.get("Routh"))
    every["best"] = np.array([relative(each, best(each)) for each in held])
    _print(real.name, "the best impulse", {}, every["best"], every["Routh"])
    after = np.array([each.after for each in held])
    for name in (RIGID, COMPLIANT):
        values = fitted(real, name, train, seed).values
        place, turn = errors_of(real, name, values, test, real.span)
        whole = np.hypot(place, gyration * turn) / np.linalg.norm(after, axis=1)
        centre = place / np.linalg.norm(after[:, :2], axis=1)
        _print(real.name, name, values, np.column_stack([whole, centre]), every["Routh"])


def _print(data: str, law: str, values: dict[str, float], errors: Reals, routh: Reals | None) -> None:
    told = [f"{m.value:.3f} ({m.lower:.3f} to {m.upper:.3f})" for m in map(mean_of, errors.T)]
    if routh is None or routh is errors:
        told.append("")
    else:
        off = mean_of(errors[:, 0] - routh[:, 0])
        told.append(f"{off.value:+.3f} ({off.lower:+.3f} to {off.upper:+.3f})")
    named = ", ".join(f"{name} {x:.3g}" for name, x in values.items())
    print(f"| {data} | {law} | {named} | " + " | ".join(told) + " |", flush=True)


SETS = {"ellipses": (ellipses, GYRATION), "squares": (squares, SIDE / math.sqrt(6.0))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name in given.only:
        read, gyration = SETS[name]
        table(read(given.folder, given.trials), gyration, given.seed)


if __name__ == "__main__":
    main()
