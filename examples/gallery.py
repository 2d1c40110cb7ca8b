"""Moving pictures of the shipped scenes, and of models that disagree, from runs made on the spot.

    python examples/gallery.py                          all pictures, below docs/
    python examples/gallery.py --only push --out out    one of them, below out/
    python examples/gallery.py --plan --only card       plan anew what the pictures of PLANNED show

Each panel is one run on one rung. Panels of one scene show the same time; a run that has ended keeps its
last frame.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

import rungwise as rw
from rungwise.viewing.plane.clip import Clip, clip
from rungwise.viewing.plane.draw_frame import INK, ROLES, placed, pose_at, rounded
from rungwise.viewing.plane.extent import bounds

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

FRAMES, LAST, READ = 36, 1.6, 6.0
"""Frames of a picture, and how long the last one stays, in seconds; longer where six lines are to be read."""
SECONDS = 2.4
FINE = 3
"""Frames are drawn so many times larger, and made smaller: that smooths edges."""
WIDTH, HEIGHT = 260, 190
"""Of a panel, in pixels."""
LETTERS, LARGE = 14, 20
"""Heights of letters in pixels; the larger ones are still read where a phone halves the three columns."""
PLANS = Path(__file__).parents[1] / "docs" / "gallery"
GOOD, BAD, LINE = "#007f5f", "#c14e00", "#e6e8eb"

View = tuple[float, float, float, float]


@dataclass(frozen=True)
class Panel:
    """One run; when it is over `says` stands above it, or its outcome. `without`: fields of the scene that
    are left out."""

    scene: str
    model: str
    head: str
    says: str = ""
    bad: bool = False
    parameters: dict[str, float] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    without: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, str]:
        """What tells panels of a picture apart."""
        return self.scene, self.model


Panels = tuple[Panel, ...]


def ladder(scene: str, *models: str, inputs: Sequence[rw.Segment] = (), **parameters: float) -> Panels:
    """The same scene on several rungs."""
    options = {"inputs": inputs} if inputs else {}
    return tuple(Panel(scene, model, model, parameters=parameters, options=options) for model in models)


STILL, QUASI, FIRM, SOFT = "kinematic", "quasistatic-rigid", "dynamic-rigid", "dynamic-compliant"
STOP = {"inputs": [rw.Segment({"ux": 1.0}, 0.2), rw.Segment({"ux": 0.0}, 0.4)]}
FAST = {"v": 0.5, "near": 0.0, "post1_x": 9.0, "post2_x": 9.0}
FREE = ("doomed",)
HARD = {"v2": 0.55, "restitution": 1.0}
CLOSE = (rw.Segment({"x1": -0.02, "x2": 0.02}, 4.0, ramp=True),)
PLANNED = {"corner_pivot": 1, "book": 1, "card": 0, "corridor": 0, "planar_hand": 1}
"""Scenes that are shown as planned, and the seeds of their plans."""


def schedule(scene: str) -> list[rw.Segment]:
    """The plan of a scene, as it was kept."""
    kept = yaml.safe_load((PLANS / f"{scene}.yaml").read_text("utf-8"))
    return [rw.Segment(**segment) for segment in kept]


def keep(scene: str, seed: int) -> Path:
    """Plan a scene and keep the schedule."""
    found = rw.plan(scene, seed=seed)
    lines = [
        {"inputs": dict(part.inputs), "duration": part.duration, "ramp": part.ramp} for part in found.segments
    ]
    file = PLANS / f"{scene}.yaml"
    text = "".join(f"- {json.dumps(line).replace(chr(34), '')}\n" for line in lines)
    file.write_text(text, "utf-8")
    return file


DISAGREE = (
    (
        Panel("gripper", QUASI, "the rungs with friction", "lift the part"),
        Panel("gripper", STILL, "kinematic", "leaves the part behind", True, options={"duration": 0.6}),
    ),
    (
        Panel("push", QUASI, "quasistatic, rigid", "the box stops with the rod", False, FAST, STOP),
        Panel("push", FIRM, "dynamic, rigid", "the box coasts", True, FAST, STOP),
    ),
    (
        Panel("two_finger", QUASI, "quasistatic, rigid", "the fingers catch the part", False, HARD),
        Panel(
            "two_finger",
            FIRM,
            "dynamic, rigid",
            "an impact throws it off",
            True,
            HARD,
            {"duration": 3.0},
            FREE,
        ),
    ),
)
"""Three stories, one in each column: two rungs that disagree."""

GALLERY: dict[str, Panels] = {
    "gripper": ladder("gripper", STILL, SOFT),
    "push": ladder("push", STILL, QUASI),
    "pivot": ladder("pivot", QUASI, FIRM, turn=3.38),
    "two_finger": ladder("two_finger", QUASI, FIRM, **HARD),
    "two_finger_free": ladder("two_finger_free", QUASI, SOFT),
    "two_finger_servo": ladder("two_finger_servo", QUASI, SOFT, mu=1.2, v2=0.4),
    "four_finger": ladder("four_finger", QUASI, FIRM, v2=0.4, mu=0.2, x=0.1, y=0.12, angle=0.08),
    "squeeze": ladder("squeeze", STILL, QUASI, mu=0.3, angle=0.85),
    "peg_in_hole": ladder("peg_in_hole", STILL, QUASI, x=1e-3, angle=-0.017),
    "snap": ladder("snap", QUASI, SOFT),
    "micro_pick": ladder("micro_pick", STILL, QUASI),
    "part_feeder": ladder("part_feeder", FIRM, SOFT, arrival=-1.0),
    "grasp": ladder("grasp", QUASI, SOFT, inputs=CLOSE),
    **{name: ladder(name, QUASI, SOFT, inputs=schedule(name)) for name in PLANNED},
    "two_link": ladder("two_link", QUASI, FIRM),
    "blocks": ladder("blocks", FIRM, SOFT, slope=0.4, mu=0.3, mu_stack=0.1),
    "slide_roll": ladder("slide_roll", FIRM, SOFT),
}
"""Rungs of each shipped scene, side by side."""


def main(arguments: Sequence[str] | None = None, frames: int = FRAMES) -> int:
    """Draw the pictures that are asked for; returns the exit code."""
    parser = argparse.ArgumentParser(description="Moving pictures of the shipped scenes.")
    parser.add_argument("--only", choices=("disagree", *GALLERY), nargs="*", default=("disagree", *GALLERY))
    parser.add_argument("--out", type=Path, default=Path("docs"), help="folder of the pictures")
    parser.add_argument("--plan", action="store_true", help="plan schedules anew, and draw nothing")
    options = parser.parse_args(arguments)
    if options.plan:
        for name in (name for name in PLANNED if name in options.only):
            print(keep(name, PLANNED[name]))
        return 0
    for name in options.only:
        if name == "disagree":
            file, columns = options.out / f"{name}.gif", DISAGREE
        else:
            file, columns = options.out / "gallery" / f"{name}.gif", tuple((p,) for p in GALLERY[name])
        several = name == "disagree"
        film(columns, file, frames, *((READ, LARGE) if several else (LAST, LETTERS)))
        print(f"{file}: {file.stat().st_size / 1000:.0f} kB")
    return 0


def film(
    columns: Sequence[Panels], file: Path, frames: int, last: float = LAST, letters: int = LETTERS
) -> None:
    """Run the panels and write the picture. Panels of one scene show the same part of the world."""
    from PIL import Image

    clips = {panel.key: run(panel) for column in columns for panel in column}
    views = {
        scene: bounds([movers(clips[p.key]) for column in columns for p in column if p.scene == scene])
        for scene in {p.scene for column in columns for p in column}
    }
    ends = {
        scene: max(clips[p.key].time[-1] for column in columns for p in column if p.scene == scene)
        for scene in views
    }
    pages, high = [], HEIGHT + head(letters)
    for part in np.linspace(0.0, 1.0, frames):
        page = Image.new("RGB", (len(columns) * WIDTH, len(columns[0]) * high), "white")
        for across, column in enumerate(columns):
            for down, panel in enumerate(column):
                one = draw(panel, clips[panel.key], part * ends[panel.scene], views[panel.scene], letters)
                page.paste(one, (across * WIDTH, down * high))
        pages.append(page)
    colours = pages[-1].quantize(128)
    pages = [page.quantize(palette=colours, dither=Image.Dither.NONE) for page in pages]
    file.parent.mkdir(parents=True, exist_ok=True)
    pause = round(1000 * SECONDS / frames)
    durations = [pause] * (frames - 1) + [round(1000 * last)]
    pages[0].save(file, save_all=True, append_images=pages[1:], duration=durations, loop=0, optimize=True)


def run(panel: Panel) -> Clip:
    """The clip of a panel's run."""
    file = rw.load(panel.scene).file.model_dump(exclude=set(panel.without))
    scene = rw.load(file) if panel.without else panel.scene
    return clip(rw.simulate(scene, panel.model, parameters=panel.parameters, frames=2000, **panel.options))


def movers(shown: Clip) -> Clip:
    """The clip without what stands still."""
    return replace(shown, outlines=tuple(o for o in shown.outlines if shown.moving[o.body]))


def head(letters: int) -> int:
    """Height of the two lines above a panel, in pixels."""
    return round(2.86 * letters)


def draw(panel: Panel, shown: Clip, time: float, view: View, letters: int = LETTERS) -> Image:
    """A panel at one time."""
    from PIL import Image, ImageDraw, ImageFont

    above, font = head(letters), ImageFont.load_default(letters)
    page = Image.new("RGB", (WIDTH, HEIGHT + above), "white")
    page.paste(world(shown, time, view), (0, above))
    pen = ImageDraw.Draw(page)
    pen.text((10, 5), panel.head, INK, font)
    if time >= shown.time[-1] * (1.0 - 1e-9):
        good = not panel.bad if panel.says else shown.outcome == "goal"
        pen.text((10, 8 + letters), panel.says or shown.outcome, GOOD if good else BAD, font)
    pen.line((WIDTH - 1, 0, WIDTH - 1, HEIGHT + above), LINE)
    pen.line((0, HEIGHT + above - 1, WIDTH, HEIGHT + above - 1), LINE)
    return page


def world(shown: Clip, time: float, view: View) -> Image:
    """The bodies at one time, robots in front."""
    from PIL import Image, ImageDraw

    size = WIDTH * FINE, HEIGHT * FINE
    page = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(page)
    x0, y0, x1, y1 = view
    scale = 0.94 * min(size[0] / (x1 - x0), size[1] / (y1 - y0))
    middle = np.array([x0 + x1, y0 + y1]) / 2.0

    def seen(points: np.ndarray) -> list[tuple[float, float]]:
        flat = (points - middle) * scale * [1.0, -1.0] + np.array(size) / 2.0
        return [(float(x), float(y)) for x, y in flat]

    pose = pose_at(shown, time)
    order = sorted(range(len(shown.outlines)), key=lambda i: shown.roles[shown.outlines[i].body] == "robot")
    for index in order:
        body(pen, shown, index, pose, seen)
    return page.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def body(pen: ImageDraw, shown: Clip, index: int, pose: np.ndarray, seen: Any) -> None:
    """One shape."""
    outline = shown.outlines[index]
    at, colour = pose[outline.body], ROLES[shown.roles[outline.body]]
    if outline.halfplane:
        (point,), (normal,) = placed(outline.vertices, at), placed(outline.normals, np.array([0, 0, at[2]]))
        along, far = np.array([-normal[1], normal[0]]), 1e3
        band = [
            point - far * along,
            point + far * along,
            point + far * (along - normal),
            point - far * (along + normal),
        ]
        pen.polygon(seen(np.array(band)), colour, INK, 2 * FINE)
    elif len(outline.vertices) == 1 and outline.radius == 0.0:
        ((x, y),) = seen(placed(outline.vertices, at))
        pen.circle((x, y), 4 * FINE, INK)
    else:
        corners = seen(placed(rounded(outline), at))
        pen.polygon(corners, colour)
        pen.line([*corners, *corners[:2]], INK, 2 * FINE, joint="curve")
        if len(outline.vertices) == 1:
            spoke = outline.vertices + np.array([[0.0, 0.0], [outline.radius, 0.0]])
            centre, rim = seen(placed(spoke, at))
            pen.line([centre, rim], INK, FINE)


if __name__ == "__main__":
    sys.exit(main())
