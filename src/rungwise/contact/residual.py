"""Residual of a candidate solution, from the problem alone: no solver has a say in it.

Each equation is measured against the largest term of its kind, so that the residual is free of units:
balance against the forces in it, velocities against U, the largest velocity term of the contact rows (but no less than
the problem's quantum), forces
against L, the largest contact force. Signorini is the natural map min(u_n / U, lambda_n / L); friction is
lambda_t / L less its projection, after a step -u_t / U, on the disc of radius mu lambda_n / L (exact cone).
"""

from __future__ import annotations

import math

from rungwise.kernel import kernel

_FLOOR = 1e-6


@kernel
def residual(problem, n, contacts, limited, v, force, tau):  # type: ignore[no-untyped-def]
    """Largest scaled violation of the problem's rows in use by (v, force, tau); inf when something is not finite."""
    p, d = problem, problem.R.shape[1]
    worst = _balance(p, n, contacts * d, limited, v, force, tau)
    if contacts + limited == 0:
        return worst
    velocity, largest, stiffest = p.quantum[0], 0.0, 0.0
    for r in range(contacts * d):
        velocity = max(velocity, _magnitude(p.W, p.w, r, n, v))
        largest = max(largest, abs(force[r]))
    for r in range(contacts):
        for i in range(d):
            velocity = max(velocity, abs(_yielding(p, r, i, force)))
    for r in range(limited):
        velocity = max(velocity, _magnitude(p.S, p.w_s, r, n, v), abs(p.R_s[r] * tau[r]))
        largest = max(largest, abs(tau[r]))
    for i in range(n):
        stiffest = max(stiffest, p.H[i, i])
    if velocity == 0.0:
        velocity = 1.0
    largest = max(largest, _FLOOR * stiffest * velocity)
    for k in range(contacts):
        worst = max(worst, _contact(p, k, n, v, force, 1.0 / velocity, 1.0 / largest))
    for r in range(limited):
        s = p.R_s[r] * tau[r] + p.w_s[r]
        for i in range(n):
            s += p.S[r, i] * v[i]
        x, bound = tau[r] / largest, p.F[r] / largest
        worst = max(worst, abs(x - min(max(x - s / velocity, -bound), bound)))
    return worst if worst >= 0.0 else math.inf


@kernel
def _magnitude(rows, offset, r, n, v):  # type: ignore[no-untyped-def]
    total = abs(offset[r])
    for i in range(n):
        total = max(total, abs(rows[r, i] * v[i]))
    return total


@kernel
def _yielding(p, k, i, force):  # type: ignore[no-untyped-def]
    """(R lambda) of contact k in direction i."""
    d = p.R.shape[1]
    total = 0.0
    for j in range(d):
        total += p.R[k, i, j] * force[k * d + j]
    return total


@kernel
def _balance(p, n, rows, limited, v, force, tau):  # type: ignore[no-untyped-def]
    worst, scale = 0.0, 0.0
    for i in range(n):
        total = -p.c[i]
        scale = max(scale, abs(p.c[i]))
        for j in range(n):
            term = p.H[i, j] * v[j]
            total += term
            scale = max(scale, abs(term))
        for r in range(rows):
            term = p.W[r, i] * force[r]
            total -= term
            scale = max(scale, abs(term))
        for r in range(limited):
            term = p.S[r, i] * tau[r]
            total -= term
            scale = max(scale, abs(term))
        if not math.isfinite(total):
            return math.inf
        worst = max(worst, abs(total))
    return worst / scale if scale > 0.0 else 0.0


@kernel
def _contact(p, k, n, v, force, per_velocity, per_force):  # type: ignore[no-untyped-def]
    d = p.R.shape[1]
    first = k * d
    normal = force[first] * per_force
    worst, length = 0.0, 0.0
    for i in range(d):
        u = p.w[first + i] + _yielding(p, k, i, force)
        for j in range(n):
            u += p.W[first + i, j] * v[j]
        u *= per_velocity
        if i == 0:
            worst = abs(min(u, normal))
        else:
            length += (force[first + i] * per_force - u) ** 2
    length = math.sqrt(length)
    radius = p.mu[k] * max(normal, 0.0)
    shrink = 1.0 if length <= radius else radius / length
    total = 0.0
    for i in range(1, d):
        u = p.w[first + i] + _yielding(p, k, i, force)
        for j in range(n):
            u += p.W[first + i, j] * v[j]
        x = force[first + i] * per_force
        total += (x - shrink * (x - u * per_velocity)) ** 2
    return max(worst, math.sqrt(total))
