"""What a scene can be asked and how it is run: the contract that each world implements in its own folder.

n_q coordinates, n_v velocities, c pairs of bodies that may touch, b bodies, u inputs, k parameters, m runs of
s segments. Lengths, times and forces are in the scene's units, angles in radians."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.language.terms import Dimension, Term
from rungwise.simulation.inputs import Segment
from rungwise.simulation.rows import States
from rungwise.simulation.state import State
from rungwise.world.parts import Exported, Sloped
from rungwise.world.rolled import Ended, Rolled

if TYPE_CHECKING:
    from rungwise.world.arguments import Asked
    from rungwise.world.carriers import Carrier, Driven, Surroundings
    from rungwise.world.ingredients import Parting, Variant
    from rungwise.world.matching import Matched

OBJECT, ROBOT, OBSTACLE = "object", "robot", "obstacle"
"""Roles of bodies."""
OUTLINES, SOLIDS, OTHER_SHAPES = "outlines", "solids", "other"
"""What bodies are: outlines in the plane, solids in space, or what only the scene's world knows."""
Told = Callable[[int], None]
"""Called with the number of runs done, about ten times a second; what it raises ends the runs."""


class Places(NamedTuple):
    """Where m runs have come to: q (m, n_q), v (m, n_v), time (m,), memories, rows (m, w) or (m,) arrays of
    several lengths. Where `goes_on` (m,) a run goes on from its memory, elsewhere it begins at rest."""

    q: Reals
    v: Reals
    time: Reals
    memory: NDArray[Any]
    goes_on: NDArray[np.bool_]

    @classmethod
    def by_hand(cls, q: Reals, v: Reals, time: Reals | None = None) -> Places:
        """Places that no run has led to."""
        m = len(q)
        return cls(q, v, np.zeros(m) if time is None else time, np.zeros((m, 0)), np.zeros(m, bool))

    def take(self, rows: Ints) -> Places:
        """Copies of these rows."""
        return Places(self.q[rows], self.v[rows], self.time[rows], self.memory[rows], self.goes_on[rows])


@dataclass(frozen=True, repr=False, eq=False)
class Ran(Ended):
    """How m runs ended, with worst scaled residuals and work of drives since they began (m,); where; why a
    run did not begin, by its number; and `at`, which gives the places of some rows at the end of a segment,
    where these were kept."""

    residual: Reals
    work: Reals
    places: Places
    faults: Mapping[int, str]
    at: Callable[[int, Ints], Places]


class Runs(Protocol):
    """Many runs of one scene on one rung, of at most `budget` steps, in threads;
    what comes of a run does not depend on how many these are."""

    budget: int
    threads: int
    parameters: dict[str, float]

    def run(
        self, points: Reals, places: Places | None = None, durations: Reals | None = None,
        levels: Reals | None = None, *, wrong: Ints | None = None, keeps: bool = False,
        chunk: int | None = None, deadline: Deadline = NEVER, on_progress: Told | None = None,
    ) -> Ran:  # fmt: skip
        """Run points (m, k) of the parameters, from places or the scene's start, through segments of these
        durations (m or 1, s) with inputs `levels` (m or 1, s, u), nan where one stays as it is; none is run
        that is `wrong` (m,). `keeps`: whether the ends of segments are kept; when the deadline has come, also
        within a step, runs that still go on are RUNNING, where they have come to."""

    def proved(self, points: Reals, found: Ran, deadline: Deadline) -> Ints:
        """Outcomes (m,) of runs from the scene's start as single runs, which may prove more, say them."""

    def begin(self, points: Reals, places: Places | None = None) -> Ran:
        """The same before their first steps: where they begin, with memories from which none goes on."""

    def placed(self, state: State, parameters: Mapping[str, float]) -> tuple[Places, Code]:
        """One place, at a state, as runs go on from it, and RUNNING or what ends them. Raises StateError."""

    def taken_over(self, place: Places, scene: Any, levels: Reals) -> Places:
        """A place to which a run of `scene` came on this rung, as these go on, after inputs `levels` (u,)."""

    def measured(self, q: Reals, v: Reals, levels: Reals) -> Places:
        """A place q (n_q,) with velocities v (n_v,) that was measured, as these go on from it, after inputs
        `levels` (u,): at rest in its contacts. Raises StateError where bodies overlap."""

    def numbers(self, places: Places) -> Reals:
        """The numbers (m, w) that conditions read, as runs left them (see `Question.read`)."""

    def forces(self, points: Reals, places: Places) -> Reals:
        """Normal forces (m, c) of the scene's pairs of bodies, in the last step."""

    def state(self, places: Places, row: int, inputs: tuple[Segment, ...] = ()) -> State:
        """One of the places as a state, of a run that followed these inputs."""


class Moved(NamedTuple):
    """Weights (n_q,) of coordinates in distances between states: 1 for places of objects, how far they reach
    for angles, 0 for robots; size: how far the largest object reaches; turns (r, 4): columns of
    quaternions; rates (n_v,): weights of velocities in speeds, in the same manner."""

    weights: Reals
    size: float
    turns: Ints
    rates: Reals


class Load(NamedTuple):
    """What acts on an object besides contacts, within its motions: the size of gravity and given forces, the
    obstacles that it may touch and be pressed on, and the greatest friction force of its support."""

    force: float
    obstacles: tuple[str, ...]
    friction: float


class Instance(Protocol):
    """A scene at one set of parameters: where it starts, q (n_q,) and v (n_v,); how far coordinates may
    travel (2, n_q), infinite where nothing bounds them; its duration, step and tolerance; how far the
    smallest thing that may touch reaches, 1 where nothing has a size; and what is moved in it."""

    @property
    def q(self) -> Reals: ...
    @property
    def v(self) -> Reals: ...
    @property
    def travel(self) -> Reals: ...
    @property
    def duration(self) -> float: ...
    @property
    def step(self) -> float: ...
    @property
    def tolerance(self) -> float: ...
    @property
    def smallest(self) -> float: ...
    @property
    def moved(self) -> Moved: ...

    @property
    def stops(self) -> Reals | None:
        """The friction force per mass of objects on supports (k,), where all objects lie on such."""

    def driven(self, name: str, path: str) -> Driven:
        """How inputs place a robot that the task leads. Raises TaskError, at the path, where they do not."""

    @property
    def loads(self) -> Mapping[str, Load]:
        """What acts on objects besides contacts."""


class Tool(Protocol):
    """A body that joints lead, and the objects that it may push at.

    carrier: the robot; targets: numbers of the objects' bodies; changes (k,): of the joints, among those of
    `Configurations`; moves (b,): bodies that they move. A target is told by its place in `targets`.
    """

    carrier: Carrier
    targets: tuple[int, ...]
    changes: Ints
    moves: NDArray[np.bool_]

    def middle(self, q: Reals) -> Reals:
        """The middle (3,) of what of the body touches, at places (n_q,)."""

    def centre(self, q: Reals, target: int) -> Reals:
        """The centre of mass (3,) of an object."""

    def reach(self, target: int) -> float:
        """How far an object reaches from there."""

    def led(self, q: Reals, aim: Reals) -> Reals:
        """Places (n_q,) with the middle of the body at a point (3,), as near as joints bring it."""

    def beside(self, q: Reals, target: int, point: Reals, away: Reals) -> Reals | None:
        """Places at its clearance from an object, near a line through a point along `away` (3,), or None."""

    def drawn(self, q: Reals, number: int) -> Reals:
        """Places with the joints as they are, or, for other numbers, drawn in their ranges."""


class Configurations(Protocol):
    """Where bodies may be placed: places (n_q,) of all bodies, and changes (n_v,) of them.

    names: of bodies; size: how far the largest object reaches; thin: width of the thinnest shape; rounding:
    overlap that counts as none; unit (n_v,): changes as long as the size, or of one radian; objects (n_v,):
    which changes move objects; bodies: columns of places of each body; pairs (c, 2): bodies that may touch;
    numbers (p,): columns of places that are plain numbers; of these turning (p,): which are angles, low, high
    (p,): their travel, units (p,), of_numbers (p,): their changes; turns (r, 4): columns of quaternions;
    bound: what else bounds places, in words, empty where nothing does.
    """

    names: tuple[str, ...]
    size: float
    thin: float
    rounding: float
    unit: Reals
    objects: NDArray[np.bool_]
    bodies: list[list[int]]
    pairs: Ints
    numbers: Ints
    turning: NDArray[np.bool_]
    low: Reals
    high: Reals
    units: Reals
    of_numbers: Ints
    turns: Ints
    bound: str

    def tool(self, carrier: Carrier) -> Tool:
        """What leads a robot by its joints. Raises TaskError where it touches no object, or has none."""

    def look(self, rows: Reals) -> tuple[Reals, Reals]:
        """Gaps (m, c) at places (m, n_q), and what `moved` needs of these (m, ...)."""

    def moved(self, marks: Reals) -> Reals:
        """How far each body moves at most from each place to the next (m - 1, b)."""

    def changed(self, rows: Reals, change: Reals) -> Reals:
        """Places (..., n_q) after changes (..., n_v)."""

    def between(self, a: Reals, b: Reals, at: Reals) -> Reals:
        """Places (m, n_q) at parts `at` (m,) of the straight way from a to b (n_q,)."""

    def lengths(self, way: Reals) -> Reals:
        """How long each leg (k - 1,) of a way (k, n_q) is, in units."""


class Place(Protocol):
    """A scene at one set of parameters, to be asked what holds at states."""

    scene: Any

    def dimensions(self) -> tuple[tuple[Dimension, ...], tuple[Dimension, ...]]:
        """Dimensions of the coordinates and of their velocities."""

    def scale(self, dimension: Dimension | None) -> float:
        """The size of the scene in this dimension; 1 where there is none."""

    def values(self, states: States, terms: list[Term], deadline: Deadline = NEVER) -> Reals:
        """Values of terms (m, k). Raises StateError, and TimeOver."""

    def geometry(self, states: States, deadline: Deadline = NEVER) -> tuple[Reals, NDArray[np.bool_], Reals]:
        """Gaps (m, c), collisions (m,), poses (m, b, 3), in space (m, b, 7). Raises StateError, TimeOver."""

    def overlap(self, state: State) -> str:
        """Which bodies overlap most at a state; empty where none do."""

    def closed(self, q: Reals, v: Reals, freedom: Reals) -> tuple[Reals, Reals]:
        """Places (m, n_q) and velocities (m, n_v) at which joints hold, nearest to these by the deviations
        `freedom` (n_q + n_v,) of each."""


class Marks(Protocol):
    """Places by which motions are compared: from states q (..., n_q) to places (..., p, d)."""

    @property
    def names(self) -> tuple[str, ...]: ...

    def __call__(self, q: Reals) -> Reals: ...


class World(Exported, Sloped, Protocol):
    """A scene and its questions. shapes: what its bodies are (see `OUTLINES`); comparison_steps and
    replanning_steps: most steps of one run of a comparison, and of planning one move anew."""

    shapes: str
    comparison_steps: int
    replanning_steps: int

    @property
    def scene(self) -> Any: ...

    def simulation(self, model: Rung | str, **options: Any) -> Any:
        """A run that is taken in turns; options are fields of `RunOptions`."""

    def saved(self, saved: Any) -> Any:
        """The run that a folder holds (see `simulation.saved.Saved`). Raises StateError."""

    def runs(
        self, model: Rung, over: Sequence[str], parameters: Mapping[str, float] | None, *,
        until: Sequence[str | None] = (), ramps: Sequence[bool] = (), budget: int | None = None,
        patience: int | None = None, threads: int | None = None, **options: Any,
    ) -> Runs:  # fmt: skip
        """Many runs over parameters, with segments that conditions `until` end sooner and that ramp where
        `ramps` says so; `options` of their steps are fields of `RunOptions`. With a patience they end where
        they take so many times as long as a search waits."""

    def rollout(
        self, model: Rung, wanted: Asked, options: dict[str, Any], *, keep: bool, budget: int | None,
        threads: int | None, chunk: int | None, deadline: Deadline, on_progress: Told | None,
    ) -> Rolled:  # fmt: skip
        """The runs that a rollout asks for (see `rungwise.rollout`)."""

    def place(self, parameters: Mapping[str, float] | None) -> Place:
        """The scene at these parameters, to be asked."""

    def at(self, parameters: Mapping[str, float] | None = None) -> Instance:
        """The scene at these parameters. Raises InvalidScene where it is impossible."""

    def configurations(
        self, parameters: Mapping[str, float], size: float, without: str = ""
    ) -> Configurations:
        """Where bodies may be placed, the body `without` left out; size: reach of the largest object."""

    def surroundings(self, parameters: Mapping[str, float]) -> Surroundings | None:
        """What touches what at these parameters; None where that is not known of scenes of this world."""

    def variant(self, parameters: dict[str, float], model: Rung, tol: float) -> Variant:
        """The scene on a rung, taken apart into ingredients."""

    def evidence(self, parting: Parting, causes: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Numbers for each cause why the motions of two variants part."""

    def end(self, run: Any) -> dict[str, Any]:
        """How a run ended: outcome, time, and the certificate that proves a jam or a missing support."""

    def matched(self, parameters: dict[str, float], duration: float, deadline: Deadline = NEVER) -> Matched:
        """The scene with parameters that mean the same on all rungs. Raises TimeOver."""

    def marks(self, parameters: Mapping[str, float]) -> Marks:
        """What motions are compared by."""

    def measures(
        self, parameters: dict[str, float], duration: float, deadline: Deadline = NEVER
    ) -> tuple[float, Reals]:
        """The scene's extent, and levers (p,) of its marks: of objects 1, and for angles how far they reach;
        0 for robots, unless there are no objects. Raises SceneError where no run can begin, and TimeOver."""

    def describe(self, parameters: Mapping[str, float]) -> dict[str, Any]:
        """Contents of the scene at these parameters, as plain values."""

    def described(self, report: Mapping[str, Any]) -> str:
        """The same as text."""

    def roles(self, parameters: Mapping[str, float] | None = None) -> dict[str, str]:
        """What each body is to a planner: object, robot or obstacle."""

    @property
    def velocities(self) -> tuple[str, ...]:
        """Names of the velocities."""

    @property
    def prescribed(self) -> tuple[str, ...]:
        """Names of the velocities that the scene gives at all times."""

    @property
    def undriven(self) -> tuple[str, ...]:
        """Coordinates that nothing drives, where it is known that others cannot follow them."""

    @property
    def at_liberty(self) -> tuple[str, ...]:
        """The coordinates of `undriven` whose body no driven joint holds."""

    @property
    def is_forced(self) -> bool:
        """Whether servos or forces drive something."""

    @property
    def follows_time(self) -> bool:
        """Whether something depends on the time t."""

    @property
    def whole_states(self) -> bool:
        """Whether a set of states spans all that moves, or a part of it beside which nothing else moves."""

    @property
    def many_motions(self) -> bool:
        """Whether other motions than the slowest can be preferred."""

    @property
    def on_clusters(self) -> bool:
        """Whether runs may go to the workers of a cluster, which read the scene from its text."""

    @property
    def leading(self) -> tuple[str, ...]:
        """Parameters that drives which lead something read, in the order of the file."""
