"""Running a scene of any world on a rung, and reading runs that were saved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, overload

from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Schedule
from rungwise.simulation.options import count
from rungwise.simulation.saved import read
from rungwise.simulation.state import State
from rungwise.world.find import world_of
from rungwise.world.nearest import begun
from rungwise.world.stepped import Control, led_by

if TYPE_CHECKING:
    import rungwise


def simulation_of(scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str, **options: Any) -> Any:
    """A run of a scene that is taken in turns."""
    return begun(load(scene), model, **options)


def finished(
    simulation: Any,
    on_progress: Callable[[Any], None] | None = None,
    deadline: Deadline | None = None,
    led: Callable[[Any], None] | None = None,
) -> Any:
    """The result of a run that is taken in turns, after its last, or as far as it has come by the deadline;
    `on_progress` is called after each other turn. Where it is `led`, that takes it to its end."""
    if deadline is None:
        return _finished(simulation, on_progress)
    simulation.deadline = deadline
    try:
        if led is not None:
            led(simulation)
        return _finished(simulation, on_progress)
    except TimeOver as over:
        if not deadline.is_over:
            raise  # not by this limit
        simulation.reason = f"limit: {deadline.words}, {over} at t = {simulation.time:.6g}"
        return simulation.result()


def completed(simulation: Any, deadline: Deadline, on_progress: Callable[[Any], None] | None = None) -> Any:
    """The result of a run that is taken in turns, after its last. Raises TimeOver where the deadline comes
    first."""
    simulation.deadline = deadline
    return _finished(simulation, on_progress)


def _finished(simulation: Any, on_progress: Callable[[Any], None] | None) -> Any:
    while simulation.advance():
        if on_progress is not None:
            on_progress(simulation)
    return simulation.result()


def repeated(
    scene: AnyScene,
    model: Rung,
    options: dict[str, Any],
    of_sample: Callable[[Any, int], dict[str, Any]],
    sample: int,
    deadline: Deadline,
) -> Any:
    """The run of one sample of many, by its own options, or as far as it has come by the deadline."""
    given = options | of_sample(scene, sample)
    return finished(simulation_of(scene, model, **given), None, deadline)


class RunKeywords(TypedDict, total=False):
    """Keywords of `simulate`, for type checkers."""

    parameters: Mapping[str, float] | None
    step: float | None
    tol: float | None
    duration: float | None
    span: float | None
    theta: float
    motion: Mapping[str, float] | None
    state: State | None
    inputs: Schedule | None
    control: Control | None
    rate: float | None
    frames: int
    stride: int | None
    save_hard: str | Path | None
    limit: float | None
    on_progress: Callable[[Any], None] | None


@overload
def simulate(scene: rungwise.Scene, model: Rung | str, **options: Unpack[RunKeywords]) -> rungwise.Run: ...
@overload
def simulate(
    scene: rungwise.SpaceScene, model: Rung | str, **options: Unpack[RunKeywords]
) -> rungwise.SpaceRun: ...
@overload
def simulate(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str, **options: Unpack[RunKeywords]
) -> AnyRun: ...
@keywords
def simulate(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    *,
    parameters: Mapping[str, float] | None = None,
    step: float | None = None,
    tol: float | None = None,
    duration: float | None = None,
    span: float | None = None,
    theta: float = 1.0,
    motion: Mapping[str, float] | None = None,
    state: State | None = None,
    inputs: Schedule | None = None,
    control: Control | None = None,
    rate: float | None = None,
    frames: int = 2000,
    stride: int | None = None,
    save_hard: str | Path | None = None,
    limit: float | None = None,
    on_progress: Callable[[Any], None] | None = None,
) -> AnyRun:
    """Run `scene`, or a source that `load` takes, on `model` to its outcome. Returns a `Run`, or a `SpaceRun`
    for a scene in space. Raises SceneError or ModelError for wrong input.

    Args:
        parameters: values by name; the scene's defaults for all others.
        step: length of fixed steps; or tol: error allowed per step, which then chooses the lengths. If
            neither is given, steps have the scene's own length.
        duration: end of the run, in the scene's time; span: ten times the longest step allowed.
        theta: of the theta rule, 1/2 to 1, on the dynamic compliant rung.
        motion: preferred velocities by coordinate, if the model admits several motions.
        state: at which the run begins; inputs: a schedule of segments (see `Segment`).
        control: in place of a schedule, a function that is given an `Observation` and returns the inputs that
            the run holds next: values by name, an array (u,), or None, which leaves them; rate: how often it
            is asked in a unit of the scene's time. The run goes on to `duration`; its `inputs` say what it
            was told.
        frames: greatest number of states that are recorded; one is recorded every `stride` steps.
        save_hard: folder for the problems of hard steps.

    `RunOptions` describes each option in full.

    After `limit` seconds the run so far is returned, also from within a long step or the
    search for a proof. Its outcome is `running`, and its reason names the interrupted work. `on_progress` is
    called about ten times a second, after whole steps. Ctrl-C raises KeyboardInterrupt after the present step
    or proof.
    """
    deadline = Deadline(seconds(limit))
    simulation = simulation_of(
        scene, model, parameters=parameters, step=step, tol=tol, duration=duration, span=span,
        theta=theta, motion=motion, state=state, inputs=inputs, frames=count("frames", frames, 3),
        stride=stride, save_hard=save_hard,
    )  # fmt: skip
    led = led_by(simulation, control, rate, on_progress)
    run: AnyRun = finished(simulation, on_progress, deadline, led)
    return run


@keywords
def load_run(folder: str | Path) -> AnyRun:
    """The run that `Run.save`, or ``rungwise sim --out``, wrote into `folder`: a `Run`, or a `SpaceRun` of a
    scene in space. It has its trajectory, states and certificate, and other runs go on from its states.

    What belongs to the last step alone (`Run.problem`) is not kept. Raises FileNotFoundError where the folder
    holds no run, and StateError where another version saved it.
    """
    saved = read(folder)
    run: AnyRun = world_of(load(saved.scene_data)).saved(saved)
    return run
