"""Triangles to pixels, nearest first: pictures in space that need no graphics card."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals, kernel


@kernel
def paint(corners: Reals, colours: Reals, pixels: Reals, depth: Reals) -> None:
    """Draw triangles into a picture.

    `corners` (f, 3, 3) are columns, rows and nearness, `colours` (f, 4) red, green, blue and opacity;
    `pixels` (h, w, 4) and `depth` (h, w), the nearness of what is drawn there (-inf: nothing), are changed.
    What can be seen through must come last: it hides nothing that is drawn after it.
    """
    high, wide = depth.shape
    for f in range(len(corners)):
        ax, ay, az = corners[f, 0, 0], corners[f, 0, 1], corners[f, 0, 2]
        bx, by, bz = corners[f, 1, 0], corners[f, 1, 1], corners[f, 1, 2]
        cx, cy, cz = corners[f, 2, 0], corners[f, 2, 1], corners[f, 2, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        left, right = max(0, int(np.ceil(min(ax, bx, cx)))), min(wide - 1, int(np.floor(max(ax, bx, cx))))
        top, foot = max(0, int(np.ceil(min(ay, by, cy)))), min(high - 1, int(np.floor(max(ay, by, cy))))
        for y in range(top, foot + 1):
            for x in range(left, right + 1):
                u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                if u < 0.0 or v < 0.0 or u + v > 1.0:
                    continue
                near = u * az + v * bz + (1.0 - u - v) * cz
                if near <= depth[y, x]:
                    continue
                opacity = colours[f, 3]
                if opacity >= 1.0:
                    depth[y, x] = near
                for k in range(3):
                    pixels[y, x, k] = opacity * colours[f, k] + (1.0 - opacity) * pixels[y, x, k]
                pixels[y, x, 3] = opacity + (1.0 - opacity) * pixels[y, x, 3]
