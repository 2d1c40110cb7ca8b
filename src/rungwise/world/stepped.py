"""Runs of scenes of any world that a user's loop takes step by step, or a controller leads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar, overload

from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code, Outcome
from rungwise.plain import run_of
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.read import load
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Segment
from rungwise.simulation.live.observation import Observation
from rungwise.simulation.live.wanted import Wanted
from rungwise.simulation.options import ModelError, positive
from rungwise.simulation.state import State
from rungwise.world.nearest import begun

if TYPE_CHECKING:
    import rungwise

Control: TypeAlias = "Callable[[Observation], Wanted]"
"""From what is seen of a run to the inputs that it holds next, or to which it ramps if the function has an
attribute `ramp` that is true."""
Ended = TypeVar("Ended", bound=AnyRun, covariant=True)


class Simulation(Generic[Ended]):
    """A run that your own loop advances step by step: observe, set inputs, step. It works in the plane, in
    space and in other worlds. Raises SceneError or ModelError for wrong input.

    The inputs that the run received are its schedule: `simulate` with `inputs=run.inputs` and the same
    options makes the same run, bit for bit.

    Args:
        scene: a scene, or a source that `load` takes.
        model: a rung or its name; the geometric rung does not move.
        options: fields of `RunOptions`. A run that begins with a schedule (`inputs`, or the state of a run
            that had one) follows it and accepts no other inputs; `inputs=[]` drops the schedule. The run ends
            at `duration`, the scene's own if not given.
    """

    @overload
    def __init__(
        self: Simulation[rungwise.Run], scene: rungwise.Scene, model: Rung | str, **options: Any
    ) -> None: ...
    @overload
    def __init__(
        self: Simulation[rungwise.SpaceRun], scene: rungwise.SpaceScene, model: Rung | str, **options: Any
    ) -> None: ...
    @overload
    def __init__(
        self: Simulation[AnyRun],
        scene: AnyScene | str | Path | Mapping[str, Any],
        model: Rung | str,
        **options: Any,
    ) -> None: ...
    @keywords
    def __init__(
        self, scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str, **options: Any
    ) -> None:
        self._run: Any = begun(load(scene), model, **options)

    def __getstate__(self) -> object:
        """Raises TypeError: a run under way holds compiled code and a solver's memory."""
        raise TypeError("a Simulation cannot be pickled or copied; keep its `state`, or its `result()`")

    def __repr__(self) -> str:
        return run_of(self, f"{self.outcome} at t = {self.time:.6g}")

    @property
    def scene(self) -> Any:
        """The scene."""
        return self._run.scene

    @property
    def model(self) -> Rung:
        """The rung."""
        model: Rung = self._run.model
        return model

    @property
    def parameters(self) -> dict[str, float]:
        """The values of all parameters at the start."""
        return dict(self._run.parameters)

    @property
    def inputs(self) -> tuple[Segment, ...]:
        """The segments that the run follows, or has been told so far."""
        inputs: tuple[Segment, ...] = self._run.inputs
        return inputs

    @property
    def time(self) -> float:
        """Simulated time so far."""
        return float(self._run.time)

    @property
    def end(self) -> float:
        """Simulated time at which the run ends at the latest."""
        return float(self._run.end)

    @property
    def running(self) -> bool:
        """Whether the run goes on."""
        return bool(self._run.outcome == Code.RUNNING)

    @property
    def outcome(self) -> Outcome:
        """How the run ended; `running` while it goes on."""
        return OUTCOMES[self._run.outcome]

    @property
    def reason(self) -> str:
        """Why the run ended, in a line; empty while it goes on."""
        return str(self._run.reason)

    @property
    def state(self) -> State:
        """The state that the run has come to. Raises ValueError for a run that cannot begin."""
        state: State = self._run.state
        return state

    def observe(self) -> Observation:
        """What is seen of the run now. Raises ValueError for a run that cannot begin."""
        seen: Observation = self._run.observe()
        return seen

    @keywords
    def step(
        self, duration: float, inputs: Wanted = None, *, ramp: bool = False, limit: float | None = None
    ) -> Observation:
        """Hold inputs for a duration, and return an observation at its end.

        Args:
            duration: in the scene's time; steps end exactly at its end. A run that ends sooner, for example
                at its goal, stops there, and a run that has ended stays as it is.
            inputs: values by name, or an array (u,) of all; inputs not named stay as they are.
            ramp: whether inputs change linearly to these values over the duration.
            limit: seconds after which the run is interrupted; the next call continues from there.

        Raises ScheduleError for an input that is unknown, no finite number, out of range or of another shape,
        or where the run follows a schedule; ModelError for a duration that is not greater than 0.
        """
        self._run.hold(duration, inputs, ramp=ramp, limit=limit)
        return self.observe()

    @keywords
    def advance(self, *, limit: float | None = None) -> bool:
        """Take steps for about a tenth of a second with inputs as they are; returns whether the run goes on.
        A step that takes longer than `limit` seconds is given up, and is made anew by the next call."""
        goes_on: bool = self._run.advance(limit=limit)
        return goes_on

    def result(self) -> Ended:
        """The run as far as it has come."""
        run: Ended = self._run.result()
        return run


def led_by(
    simulation: Any,
    control: Control | None,
    rate: float | None,
    on_progress: Callable[[Any], None] | None,
) -> Callable[[Any], None] | None:
    """What lets a controller lead a run to its end, asking it `rate` times in a unit of the scene's time;
    None where there is none. Raises ModelError."""
    if control is None:
        if rate is not None:
            raise ModelError("rate: says how often control is asked, and there is none")
        return None
    if not callable(control):
        raise ModelError(f"control: must be a function of an observation, not {shown(control)}")
    if rate is None:
        raise ModelError(
            "rate: is required with control: how often it is asked in a unit of the scene's time"
        )
    if simulation.inputs:
        raise ModelError("inputs: the run follows a schedule, and control sets its inputs; give inputs=[]")
    ramp = bool(getattr(control, "ramp", False))
    return partial(lead, control, 1.0 / positive("rate", rate), ramp, on_progress)


def lead(
    control: Control, period: float, ramp: bool, on_progress: Callable[[Any], None] | None, simulation: Any
) -> None:
    """Ask a controller, and hold its inputs, or ramp to them, period by period. Raises TimeOver."""
    while simulation.outcome == Code.RUNNING:
        simulation.hold(period, control(simulation.observe()), ramp=ramp)
        if on_progress is not None:
            on_progress(simulation)
