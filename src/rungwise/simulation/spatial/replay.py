"""Judges: the same inputs in another simulator, and where and why the motions part."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.outcome import Code
from rungwise.plain import cut
from rungwise.scene.fields.laws.contact import titles
from rungwise.scene.fields.values import shown
from rungwise.scene.space import SpaceBound
from rungwise.scene.space.mujoco_model import library
from rungwise.simulation.core.state import CLOCK
from rungwise.simulation.inputs import compile_segments
from rungwise.simulation.moving.memory import memory_parts
from rungwise.simulation.moving.values import asked_of, blank_values, place_values, slots_of
from rungwise.simulation.options import positive
from rungwise.simulation.spatial.frames import Frame
from rungwise.simulation.spatial.memory import activations
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.simulation.state import State
from rungwise.simulation.watched.inputs import begin_inputs, set_rest, set_speeds, show_inputs, switch_inputs
from rungwise.simulation.watched.values import allocate_watched
from rungwise.simulation.watched.verdicts import judge, next_end, note_all
from rungwise.wording import choices

if TYPE_CHECKING:
    import mujoco

JUDGES = ("mujoco",)
PARTS = 0.01
"""Motions part where a body's centre is farther apart than this part of the scene's extent, or its axes
turned by as many radians more."""
SLIPS = 1e-6
"""Speed over the fastest in the scene below which a contact sticks."""


class ReplayError(InputError):
    """A run cannot be replayed; the text is one line that says why."""


@dataclass(frozen=True, eq=False)
class Replay:
    """Comparison of a `run` with the same inputs in another simulator, `judge`, under its `settings`.

    times (f,); apart (f, b): distance of the centres of bodies, over the scene's extent, or the angle between
    their axes, whichever is more; parts: time at which the first body parts, nan if none does; body: its
    name; reasons: the differences there, a line each; outcome: of the other simulator: `goal` if its end
    meets the scene's goal, or if it does so while inputs go on that the run did not need any more; `timeout`
    if the scene has no goal; `running` if a limit in seconds ended it: `unfinished` then names the rest, and
    times are those of the frames that it reached. end: the other simulator's last state.
    """

    run: SpaceRun
    judge: str
    settings: str
    times: Reals
    apart: Reals
    parts: float
    body: str
    reasons: tuple[str, ...]
    outcome: str
    unfinished: str = ""
    end: State | None = field(default=None, repr=False)

    @property
    def ok(self) -> bool:
        """Whether the other simulator reaches the goal as well; without a goal, whether the motions do not
        part."""
        if self.unfinished:
            return False
        return self.outcome == "goal" if self.run.scene.file.goal else math.isnan(self.parts)

    def __repr__(self) -> str:
        return f"<Replay of {cut(self.run.scene.name)} in {self.judge}: {self.outcome}, {self._parting()}>"

    def _parting(self) -> str:
        most = float(self.apart.max(initial=0.0))
        if math.isnan(self.parts):
            return f"at most {most:.2g} apart"
        return f"{self.body} differs from t = {self.parts:.4g} on, by at most {most:.2g}"

    def __str__(self) -> str:
        head = f"{self.run.scene.name}: {self.run.model.name} compared with {self.judge} ({self.settings})"
        lines = [head, f"  outcome in {self.judge}: {self.outcome}", f"  {self._parting()}"]
        said = [*self.reasons, self.unfinished] if self.unfinished else self.reasons
        return "\n".join([*lines, *(f"  {line}" for line in said)])

    def summary(self) -> dict[str, Any]:
        """Plain values, as `rungwise replay --json` prints them."""
        return {
            "scene": self.run.scene.name,
            "model": self.run.model.name,
            "judge": self.judge,
            "settings": self.settings,
            "outcome": self.outcome,
            "parts": None if math.isnan(self.parts) else self.parts,
            "body": self.body,
            "apart": float(self.apart.max(initial=0.0)),
            "reasons": list(self.reasons),
            "unfinished": self.unfinished,
        }


@keywords
def replay(
    run: SpaceRun, *, in_: str = "mujoco", step: float | None = None, limit: float | None = None
) -> Replay:
    """Run another simulator (`in_`: "mujoco") from the start and with the inputs of a run, and compare the
    motions at the run's frames. Prescribed velocities of the scene are set before each step of the other
    simulator.

    `step` is the other simulator's (default: the model's own); friction is the scene's; solver, cone and
    integrator are the model's (but see `SpaceBound.step_in_mujoco`).
    After `limit` seconds the motions are compared as far as it has come; see `unfinished`. Raises
    ReplayError for a planar run and for one that never began, ModelError for a step that is not positive.
    """
    deadline = Deadline(seconds(limit))
    if in_ not in JUDGES:
        raise ReplayError(f"in: unknown {shown(in_)}{choices(in_, JUDGES)}")
    if not isinstance(run, SpaceRun):
        raise ReplayError("run: is not in space; only runs of scenes in space are replayed")
    if run.space is None:
        raise ReplayError(f"run: did not begin: {run.reason}")
    if len(run.frames) < 2:
        raise ReplayError(f"run: has no step to replay: {run.reason}")
    course = _Course(run, None if step is None else positive("step", step), deadline)
    states, outcome, unfinished = _followed(course, run.frames)
    times = np.array([frame.time for frame in run.frames[: len(states)]])
    extent = float(run.space.model.stat.extent)
    apart = np.array(
        [_apart(course, frame, state.q, extent) for frame, state in zip(run.frames, states, strict=False)]
    )
    late = np.flatnonzero((apart > PARTS).any(axis=1))
    parts, body, reasons = math.nan, "", list[str]()
    if len(late):
        k = int(late[0])
        number = int(np.argmax(apart[k]))
        parts, body = float(times[k]), run.scene.labels.bodies[number]
        reasons = _reasons(course, run.frames[max(k - 1, 0)], states[max(k - 1, 0)])
        lacking = titles(course.bound.named)
        reasons += [f"contacts here have {', '.join(lacking)}, which MuJoCo does not know"] if lacking else []
    return Replay(
        run, in_, course.settings, times, apart, parts, body, tuple(reasons), outcome, unfinished,
        course.end(),
    )  # fmt: skip


def _followed(course: _Course, frames: Sequence[Frame]) -> tuple[list[_Place], str, str]:
    """The judge's states at the first frames, or at all; its outcome; and what a limit left undone."""
    states = [course.start()]
    try:
        for frame in frames[1:]:
            states.append(course.at(frame.time))
        return states, course.outcome(), ""
    except TimeOver:
        left = f"the time was over when {course.run.scene.name} had reached t = {course.data.time:.4g}"
        return states, Code.RUNNING.name.lower(), f"{left} of {frames[-1].time:.4g} in {JUDGES[0]}"


class _Place(NamedTuple):
    """MuJoCo's q, v and controls at a frame."""

    q: Reals
    v: Reals
    control: Reals


@dataclass
class _Course:
    """MuJoCo under the run's inputs."""

    run: SpaceRun
    step: float | None
    deadline: Deadline
    data: Any = field(init=False)

    def __post_init__(self) -> None:
        scene, run = self.run.scene, self.run
        self.bound: SpaceBound = scene.bind(run.parameters)
        self.model = self.bound.model
        if self.step is not None:
            self.model.opt.timestep = self.step
        self.data = library().MjData(self.model)
        template = scene.template
        self.inputs, programs = compile_segments(scene, run.inputs), scene.programs
        self.conditions = (programs.code, programs.constants, programs.table)
        self.clock, levels = np.zeros(1, CLOCK), np.zeros(len(template.inputs))
        self.clock["time"], self.asked = run.frames[0].time, asked_of(
            template, (programs.code, self.inputs.code), self.bound.step
        )  # fmt: skip
        values, slots = blank_values(template, self.bound), slots_of(template)
        self.watched = allocate_watched(self.clock, values, levels, slots)
        begin_inputs(self.inputs, self.bound.numbers, self.watched)
        cone = "elliptic" if self.model.opt.cone else "pyramidal"
        self.settings = f"step {self.model.opt.timestep:g}, {cone} cones"

    def start(self) -> _Place:
        first = self.run.frames[0]
        self.data.qpos[:], self.data.qvel[:], self.data.time = first.q, first.v, first.time
        core = first.memory[memory_parts(self.run.scene, first.memory).core]
        self.data.act[:] = activations(core, self.model.na)
        return _Place(first.q, first.v, self.bound.control.copy())

    def end(self) -> State:
        """Where MuJoCo is now."""
        d = self.data
        return State(self.run.scene.template.coordinates, d.qpos.copy(), d.qvel.copy(), float(d.time))

    def at(self, time: float) -> _Place:
        """Go on to a time. Raises TimeOver."""
        d, m = self.data, self.model
        own = float(m.opt.timestep)
        while d.time < time - 1e-9 * own:
            self.deadline.look()
            h = min(own, time - d.time)
            set_speeds(self.inputs, self.bound.numbers, d.time + h, self.watched)
            set_rest(self.inputs, self.bound.numbers, d.time + h, self.watched)
            d.ctrl[:] = self.bound.control
            driven = ~np.isnan(self.bound.pace)
            d.qvel[driven] = self.bound.pace[driven]
            m.opt.timestep = h
            self.bound.step_in_mujoco(d)
            d.qvel[driven] = self.bound.pace[driven]
            self._see()
            note_all(self.conditions, self.inputs, 0.0, self.watched)
            next_end(self.conditions, self.inputs, float(d.time), self.watched)
            switch_inputs(self.inputs, self.bound.numbers, h, self.watched)
        m.opt.timestep = own
        return _Place(d.qpos.copy(), d.qvel.copy(), d.ctrl.copy())

    def _see(self) -> None:
        """Let conditions read MuJoCo's state; forces are not known there."""
        assert self.run.space is not None
        d, watched = self.data, self.watched
        self.clock["time"] = d.time
        inside, slots = self.run.space.mechanism, slots_of(self.run.scene.template)
        place_values(inside, self.asked, slots, d.time, d.qpos.copy(), d.qvel.copy(), watched.values)
        show_inputs(self.inputs, watched)

    def outcome(self) -> str:
        """What the scene's conditions say of MuJoCo's end; where the run came to the goal before its inputs
        were spent, MuJoCo may come there as long as they go on."""
        late = self.run.frames[0].time + sum(segment.duration for segment in self.run.inputs)
        while (verdict := self._verdict()) == Code.RUNNING and self.run.outcome.code == Code.GOAL:
            if self.data.time >= late:
                break
            self.at(self.data.time + float(self.model.opt.timestep))
        if verdict == Code.RUNNING:
            verdict = Code.MISSED if self.run.scene.file.goal else Code.TIMEOUT
        return verdict.name.lower()

    def _verdict(self) -> Code:
        self._see()
        return Code(judge(self.conditions, self.watched))


def _apart(course: _Course, frame: Frame, q: Reals, extent: float) -> Reals:
    """How far bodies are apart (b,)."""
    mujoco, m = library(), course.model
    places, turns = [], []
    data = mujoco.MjData(m)
    for each in (frame.q, q):
        data.qpos[:] = each
        mujoco.mj_kinematics(m, data)
        places.append(data.xipos.copy())
        turns.append(data.xquat.copy())
    distance = np.linalg.norm(places[0] - places[1], axis=1) / extent
    angle = 2.0 * np.arccos(np.clip(np.abs((turns[0] * turns[1]).sum(axis=1)), 0.0, 1.0))
    return np.asarray(np.maximum(distance, angle))


def _reasons(course: _Course, frame: Frame, state: _Place) -> list[str]:
    """What differs in the contacts just before the motions part."""
    mujoco, m = library(), course.model
    data = mujoco.MjData(m)
    data.qpos[:], data.qvel[:], data.ctrl[:] = state
    mujoco.mj_forward(m, data)
    labels = course.run.scene.labels.geoms
    ours = _ours(frame, labels)
    theirs = _theirs(m, data, labels)
    fastest = max(float(np.abs(frame.v).max(initial=0.0)), float(np.abs(state.v).max(initial=0.0)), 1e-12)
    lines = []
    for pair in sorted({*ours, *theirs}):
        mine, other = ours.get(pair), theirs.get(pair)
        if mine is None or mine["force"] == 0.0:
            if other is not None and other["force"] > 0.0:
                lines.append(f"{pair}: touches only in MuJoCo, with {other['force']:.3g}")
        elif other is None or other["force"] == 0.0:
            lines.append(f"{pair}: touches only here, with {mine['force']:.3g}")
        else:
            lines += _between(pair, mine, other, fastest)
    if not lines:
        lines.append("the contacts are the same: inertia and earlier differences make the motions differ")
    return lines[:8]


def _between(pair: str, mine: Mapping[str, float], other: Mapping[str, float], fastest: float) -> list[str]:
    lines = []
    if mine["mode"] == 1 and other["slip"] > SLIPS * fastest:
        lines.append(
            f"{pair}: sticks here, and slides at {other['slip']:.3g} in MuJoCo, whose friction is soft"
        )
    if other["depth"] > 0.0:
        lines.append(
            f"{pair}: bodies overlap by {other['depth']:.3g} in MuJoCo, {max(-mine['gap'], 0.0):.3g} here"
        )
    return lines


def _ours(frame: Frame, labels: tuple[str, ...]) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    touch = frame.touch
    for c, (a, b) in enumerate(touch.geoms):
        own = found.setdefault(f"{labels[a]}|{labels[b]}", {"force": 0.0, "mode": 0.0, "gap": np.inf})
        own["force"] += float(touch.force[c] @ touch.normal[c])
        own["mode"] = max(own["mode"], float(touch.mode[c]))
        own["gap"] = min(own["gap"], float(touch.gap[c]))
    return found


def _theirs(m: mujoco.MjModel, d: mujoco.MjData, labels: tuple[str, ...]) -> dict[str, dict[str, float]]:
    mujoco = library()
    found: dict[str, dict[str, float]] = {}
    force, velocity = np.zeros(6), np.zeros((2, 6))
    for c in range(d.ncon):
        contact = d.contact[c]
        a, b = (int(g) for g in contact.geom)
        own = found.setdefault(f"{labels[a]}|{labels[b]}", {"force": 0.0, "slip": 0.0, "depth": 0.0})
        mujoco.mj_contactForce(m, d, c, force)
        for side, geom in enumerate((a, b)):
            body = int(m.geom_bodyid[geom])
            mujoco.mj_objectVelocity(m, d, mujoco.mjtObj.mjOBJ_BODY, body, velocity[side], 0)
            velocity[side, 3:] += np.cross(velocity[side, :3], contact.pos - d.xpos[body])
        between = velocity[1, 3:] - velocity[0, 3:]
        normal = contact.frame[:3]
        own["force"] += float(force[0])
        own["slip"] = max(own["slip"], float(np.linalg.norm(between - (between @ normal) * normal)))
        own["depth"] = max(own["depth"], -float(contact.dist))
    return found
