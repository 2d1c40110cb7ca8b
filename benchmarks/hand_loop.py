"""The reference of the benchmark: the two-finger scene as one would write it for this scene alone.

It knows what rungwise has to find out: one unknown, two contacts, fingers that stay on their own face,
prescribed speeds, and a sliding contact whose friction does not change the motion (mu < 1). A step clips the
part's speed to what either finger allows. With `inertia` 1 it is the rigid dynamic model with plastic impact,
with 0 the rigid quasistatic one. It records nothing, checks no residual and balances no energy.
"""

from __future__ import annotations

import math

import numba

GOAL, DOOMED, TIMEOUT = 1, 3, 7


def hand_loop(
    v1: float, v2: float, mu: float, inertia: float, step: float, duration: float
) -> tuple[int, int, float, float, float]:
    """Run to the outcome; returns (outcome, steps, time, x3, impulse of finger 1 along its normal).

    Lengths: half-base and height 1, fingers at -0.5 and 0.5, travel 2, mass 1.
    """
    half_base, height, offset, travel, mass, tolerance = 1.0, 1.0, 0.5, 2.0, 1.0, 1e-6
    slope = math.hypot(half_base, height)
    bound = offset * (1.0 - 1e-4)
    x1, x2, x3, v, time, steps, impulse = 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0
    while time < duration:
        h = min(step, duration - time)
        gap1 = ((travel - x1) * half_base - (half_base - offset - x3) * height) / slope
        gap2 = ((travel - x2) * half_base - (half_base - offset + x3) * height) / slope
        u1 = v1 if x1 < travel else 0.0
        u2 = v2 if x2 < travel else 0.0
        closing = slope * (gap1 + gap2) / half_base
        if h * (u1 + u2) > closing:
            h = closing / (u1 + u2)
        start = inertia * v
        least = (half_base * u1 - slope * gap1 / h) / height if h > 0.0 else v
        most = -(half_base * u2 - slope * gap2 / h) / height if h > 0.0 else v
        v = min(max(start, least), most)
        push = mass * (v - start) * slope / (height - mu * half_base)
        impulse += push if push > 0.0 else 0.0
        x1, x2, x3 = min(x1 + h * u1, travel), min(x2 + h * u2, travel), x3 + h * v
        time += h
        steps += 1
        gap1 = ((travel - x1) * half_base - (half_base - offset - x3) * height) / slope
        gap2 = ((travel - x2) * half_base - (half_base - offset + x3) * height) / slope
        if gap1 <= tolerance and gap2 <= tolerance and abs(x3) <= bound:
            return GOAL, steps, time, x3, impulse
        if abs(x3) > bound:
            return DOOMED, steps, time, x3, impulse
    return TIMEOUT, steps, time, x3, impulse


compiled = numba.njit(error_model="numpy")(hand_loop)
