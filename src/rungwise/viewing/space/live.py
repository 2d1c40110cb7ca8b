"""Films in space in a live page of viser, on this machine only. Needs the extra `watch`, when first used."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.skeleton import numbered
from rungwise.viewing.space.extent import box, largest_force
from rungwise.viewing.space.film import OPEN, Film, FilmError
from rungwise.viewing.space.run_page import curve_of, curves_of, same_bodies, title
from rungwise.viewing.space.shapes import triangles

if TYPE_CHECKING:
    import viser

LOOPBACK = ("127.0.0.1", "::1", "localhost")
PER_SECOND = 30.0
"""Frames a second: as many as look smooth."""
CURVES_PER_SECOND = 4.0
"""How often the mark on the curves moves while the film plays: curves are sent whole."""
ARROW = 0.38
"""Length of a usual force, as a part of half the diagonal of all that is seen."""
SPEEDS = ("0.02", "0.05", "0.1", "0.25", "0.5", "1", "2", "4")
"""Of the film, over real time."""
PREFIXES = {1e-9: "n", 1e-6: "µ", 1e-3: "m", 1.0: "", 1e3: "k"}
"""Of units: the curves' ticks have three digits after the point."""
LONGEST = 2.0
"""An arrow is no longer than so many usual ones."""
SAME = 0.004
"""A body is elsewhere from this part of half the diagonal on: less is a pixel or two."""
GHOST = 0.35
"""Opacity of all films but the first."""
MODES = np.array([(122, 130, 140), (0, 114, 178), (193, 78, 0)], np.uint8)
"""Colours of open, sticking and slipping contacts, as on the pages."""
MODELS = ((0, 114, 178), (213, 94, 0), (0, 127, 95), (176, 80, 140), (138, 109, 0), (51, 51, 51))
"""Okabe and Ito's colours, as on the pages."""

DARK = (
    """<img hidden src="data:," onerror="const to = new window.URL(location.href);"""
    """ if (matchMedia('(prefers-color-scheme: dark)').matches && !to.searchParams.has('darkMode'))"""
    """ { to.searchParams.set('darkMode', ''); location.replace(to); }">"""
)
"""An element that adds ``darkMode`` to the page's address where the browser prefers dark: viser's client
takes its colours from there, and its server, which shows one page to all browsers, is not told what they
prefer."""


def open_live(films: Sequence[Film], host: str = "127.0.0.1", port: int = 0) -> Live:
    """Show the films, of one scene on one rung each, in a live page; its address is the `url` of what is
    returned. Port 0 is any that is free.

    Raises FilmError where there is no film, they show different bodies, the host is not this machine, or
    viser is missing.
    """
    same_bodies(films)
    if host not in LOOPBACK:
        raise FilmError(f"host: must be one of {', '.join(LOOPBACK)}, not {host!r}")
    try:
        import viser
    except ImportError:
        raise FilmError("open_live: needs viser (pip install 'rungwise[watch]')") from None
    server = viser.ViserServer(host=host, port=port, label=title(films), verbose=False)
    return Live(server, films, host)


class Live:
    """A live page that plays films. As a context it closes itself at the end."""

    def __init__(self, server: viser.ViserServer, films: Sequence[Film], host: str) -> None:
        self.server, self.films = server, tuple(films)
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"
        low, high = box(films)
        self._radius = float(np.linalg.norm(high - low)) / 2.0 or 1.0
        self._per_force = ARROW * self._radius / largest_force(films)
        self.end = max(float(film.time[-1]) for film in films)
        self._ended = threading.Event()
        self._look_at((low + high) / 2.0)
        self.nodes = [self._add_film(k) for k in range(len(films))]
        self._controls()
        self._charts = [self._add_chart(kind) for kind in ("gaps", "pushes")]
        self.show(0.0)
        self._thread = threading.Thread(target=self._play, daemon=True)
        self._thread.start()

    def __enter__(self) -> Live:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the page."""
        self._ended.set()
        self._thread.join()
        self.server.stop()

    def wait(self) -> None:
        """Keep the page until it is closed."""
        self._ended.wait()

    def show(self, moment: float) -> None:
        """All films at a moment of time."""
        with self.server.atomic():
            first = self.films[0], _nearest(self.films[0], moment)
            for number, (film, nodes) in enumerate(zip(self.films, self.nodes, strict=True)):
                k = _nearest(film, moment)
                for body, node in nodes.items():
                    hidden = number > 0 and self._shown[0].value and self._same(first, (film, k), body)
                    node.visible = self._shown[number].value and not hidden
                    node.position, node.wxyz = film.places[k, body], film.turns[k, body]
            self._forces(moment)

    def _same(self, one: tuple[Film, int], other: tuple[Film, int], body: int) -> bool:
        """Whether a body is in the same place in both: two of it, one in the other, would flicker."""
        (a, k), (b, m) = one, other
        apart = float(np.linalg.norm(a.places[k, body] - b.places[m, body]))
        turned = 1.0 - abs(float(a.turns[k, body] @ b.turns[m, body]))
        return apart < SAME * self._radius and turned < SAME**2

    def _look_at(self, middle: NDArray[np.float64]) -> None:
        scene = self.server.scene
        scene.set_up_direction("+z")
        camera = self.server.initial_camera
        camera.look_at = tuple(middle)
        camera.position = tuple(middle + self._radius * np.array([1.0, -1.4, 0.8]))

    def _add_film(self, number: int) -> dict[int, Any]:
        """A frame for each body, below which its solids are; planes become grids."""
        film, scene = self.films[number], self.server.scene
        nodes: dict[int, Any] = {}
        for k, solid in enumerate(film.solids):
            name = f"/films/{number}/{solid.body}"
            if solid.body not in nodes:
                nodes[solid.body] = scene.add_frame(name, show_axes=False)
            pose: dict[str, Any] = {"wxyz": tuple(solid.turn), "position": tuple(solid.place)}
            if solid.kind == "plane":
                if number == 0:
                    width, height = (2.0 * s or 20.0 * self._radius for s in solid.size[:2])
                    cell = self._radius / 4.0
                    scene.add_grid(
                        f"{name}/{k}",
                        width=width,
                        height=height,
                        cell_size=cell,
                        section_size=4.0 * cell,
                        **pose,
                    )
                continue
            vertices, faces = triangles(solid)
            colour = tuple(solid.colour[:3]) if number == 0 else MODELS[number % len(MODELS)]
            opacity = float(solid.colour[3]) * (1.0 if number == 0 else GHOST)
            scene.add_mesh_simple(
                f"{name}/{k}",
                vertices,
                faces,
                color=colour,
                opacity=opacity if opacity < 1.0 else None,
                flat_shading=solid.kind == "box",
                **pose,
            )
        return nodes

    def _controls(self) -> None:
        gui = self.server.gui
        gui.add_html(DARK)
        labels = numbered([film.model for film in self.films])
        self._playing = gui.add_checkbox("play", False)
        step = self.end / 1000.0 or 1.0
        self._time: Any = gui.add_slider(
            "time", min=0.0, max=max(self.end, step), step=step, initial_value=0.0
        )
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        self._arrows = gui.add_checkbox("forces", True)
        self._shown = [gui.add_checkbox(label, True) for label in labels]
        for film, label in zip(self.films, labels, strict=True):
            told = ": ".join(part for part in (film.outcome, film.reason) if part)
            gui.add_markdown(" · ".join(part for part in (f"**{label}** {told}", *film.notes) if part))
        controls: list[Any] = [self._time, self._arrows, *self._shown]
        for control in controls:
            control.on_update(lambda _: self._moved())

    def _moved(self) -> None:
        self.show(self._time.value)
        if not self._playing.value:
            self._mark()

    def _forces(self, moment: float) -> None:
        """Contact points and forces of the first film that is shown."""
        film = next((film for film, on in zip(self.films, self._shown, strict=True) if on.value), None)
        if film is None or not self._arrows.value:
            points, force, mode = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64)
        else:
            rows = film.touches.frame == _nearest(film, moment)
            points, force = film.touches.point[rows], film.touches.force[rows]
            mode = film.touches.mode[rows]
        size = np.linalg.norm(force, axis=1, keepdims=True)
        long = np.minimum(size * self._per_force, LONGEST * ARROW * self._radius)
        ends = points + force / np.where(size > 0.0, size, 1.0) * long
        closed, wide = mode != OPEN, 0.012 * self._radius
        scene = self.server.scene
        scene.add_point_cloud("/contacts", points, MODES[mode], point_size=2.0 * wide, point_shape="circle")
        scene.add_arrows(
            "/forces",
            np.stack([points, ends], axis=1)[closed],
            MODES[mode[closed]],
            shaft_radius=0.5 * wide,
            head_radius=1.4 * wide,
            head_length=4.0 * wide,
        )

    def _add_chart(self, kind: str) -> tuple[Any, NDArray[np.float64]] | None:
        """Curves of the first film, and a mark at the moment that is shown."""
        film = self.films[0]
        pairs = curves_of(self.films)
        if getattr(film, kind) is None or not pairs:
            return None
        what, unit = {"gaps": ("least gap", "length"), "pushes": ("normal force", "force")}[kind]
        curves = np.array([curve_of(film, kind, pair) for pair in pairs])
        prefix, size = _prefix(float(np.nanmax(np.abs(curves), initial=0.0)))
        curves = curves / size
        data = (film.time, *curves, np.full(len(film.time), np.nan))
        low, high = min(0.0, float(np.nanmin(curves))), max(0.0, float(np.nanmax(curves)))
        margin = 0.06 * (high - low) or 1.0
        colours = [f"rgb{MODELS[k % len(MODELS)]}" for k in range(len(pairs))]
        series: list[Any] = [{"label": "time"}]
        series += [
            {"label": " | ".join(pair), "stroke": colour, "width": 1.5}
            for pair, colour in zip(pairs, colours, strict=True)
        ]
        series.append({"label": "now", "stroke": "red", "points": {"show": True, "size": 9}})
        chart = self.server.gui.add_uplot(
            data,
            tuple(series),
            title=f"{what} [{prefix}{film.units.get(unit, '')}]",
            scales={"x": {"time": False}, "y": {"range": (low - margin, high + margin)}},
            aspect=1.6,
        )
        return chart, curves

    def _mark(self) -> None:
        k = _nearest(self.films[0], self._time.value)
        for found in self._charts:
            if found is not None:
                chart, curves = found
                mark = np.full(curves.shape[1], np.nan)
                mark[k] = np.max(curves[:, k], initial=0.0, where=~np.isnan(curves[:, k]))
                chart.data = (*chart.data[:-1], mark)

    def _play(self) -> None:
        last = marked = time.monotonic()
        while not self._ended.wait(1.0 / PER_SECOND):
            now = time.monotonic()
            passed, last = now - last, now
            if not self._playing.value:
                continue
            moment = self._time.value + float(self._speed.value) * passed
            self._time.value = 0.0 if moment > self.end else moment
            if now - marked > 1.0 / CURVES_PER_SECOND:
                marked = now
                self._mark()


def _prefix(most: float) -> tuple[str, float]:
    """The prefix of a unit in which the largest value is 1 to 1000, where there is one, and its size."""
    size = max((size for size in PREFIXES if size <= most), default=1.0)
    return PREFIXES[size], size


def _nearest(film: Film, moment: float) -> int:
    """Number of the frame that is nearest in time."""
    return int(np.abs(film.time - moment).argmin())
