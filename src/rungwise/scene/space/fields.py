"""The fields of a scene in space: a model file, and what it lacks (pydantic models).

Every `Number` is a number or an expression of the scene's parameters; numbers marked *timed* may also use the
time ``t``. Units are the model's own: metres, kilograms, seconds and radians for most.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from rungwise.scene.fields.fields import Parameter, Units
from rungwise.scene.fields.laws.contact import Named
from rungwise.scene.fields.shapes import MANY, ONE
from rungwise.scene.fields.stated import check_inputs
from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.task import Task
from rungwise.scene.fields.values import Name, Number, Pattern, Text

Numbers = Annotated[
    Annotated[Number, Tag(ONE)] | Annotated[tuple[Number, ...], Tag(MANY)],
    Discriminator(lambda value: MANY if isinstance(value, list | tuple) else ONE),
]
ENTRIES = 200
"""Most entries on contacts."""
Settings = dict[Text, dict[Text, Numbers]]
"""Elements by name, with values of their fields."""


class Changes(Strict):
    """Fields of the model that numbers of the scene replace, in the names and units of the model file. Names
    of elements may use ``*``; what stands last holds."""

    geoms: Settings = {}
    bodies: Settings = {}
    joints: Settings = {}
    actuators: Settings = {}
    tendons: Settings = {}
    option: dict[Text, Numbers] = {}


Triple = tuple[Number, Number, Number]


class Part(Strict):
    """A further model in the first one's world, or on a `body` of it or of a part before: its file, found as
    the first one's, and where its own world is there, as ``origin`` says in URDF: `xyz` in metres, and `rpy`
    in radians, about the fixed axes x, y and z in this order."""

    file: Text
    body: Text | None = None
    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)


class Servo(Strict):
    """A servo for each joint that no actuator drives: `stiffness` (N m/rad, or N/m), `damping` (N m s/rad, or
    N s/m), and its greatest `force` (N m, or N)."""

    stiffness: Number
    damping: Number = 0.0
    force: Number | None = None


class Model(Strict):
    """An MJCF or URDF file, looked for beside the scene and among the models that ship; or in a package, as
    ``package:path`` or ``package://NAME/path``.

    `parts` are further models, whose names get the name of the part and ``_`` before them; `servos` are put
    on joints by patterns of names, the first that fits holds; `set` replaces numbers. `meshes` says by
    patterns of names of geoms, bodies or meshes, of which the first that fits holds, which of them stand for
    their convex ``hull`` on purpose, and how concave the pieces of others may be, over half of their longest
    side.
    """

    file: Text
    parts: dict[Name, Part] = {}
    servos: dict[Pattern, Servo] = {}
    meshes: dict[Pattern, Literal["hull"] | Annotated[float, Field(ge=0.01, le=1.0)]] = {}
    set: Changes = Changes()


class Touching(Strict):
    """How geoms touch. Names are those of geoms or of their bodies and may use ``*``; the first entry that
    names a pair holds. Stiffness and damping are those of compliant contact (N/m, N s/m), restitution of
    rigid contact; friction replaces the model's where it is given, and torsional and rolling friction (m),
    which otherwise change in the same proportion."""

    between: tuple[Pattern, Pattern] = ("*", "*")
    stiffness: Number | None = None
    damping: Number | None = None
    tangential_stiffness: Number | None = None
    tangential_damping: Number | None = None
    restitution: Number = 0.0
    friction: Number | None = None
    torsional_friction: Number | None = None
    rolling_friction: Number | None = None


class Contact(Named, Touching):
    """See `Touching`, and `Named` for laws that are off unless they are named."""


class Start(Strict):
    """Where the run begins: a keyframe of the model or its own pose, and places and velocities by label;
    `settle`: at the nearest places that are allowed, where bodies overlap there, equalities are open or
    joints beyond their ranges."""

    keyframe: Text | None = None
    settle: bool = False
    places: dict[Text, Number] = {}
    velocities: dict[Text, Number] = {}


class SpaceFile(Strict):
    """A scene in space as written.

    `controls` are what actuators are told (*timed*, in the units of the model file), `speeds` velocities that
    are prescribed (*timed*), by label; `inputs` are parameters that a schedule may change during a run.
    """

    name: Name
    about: Text = ""
    parameters: dict[Name, Parameter] = {}
    units: Units | None = None
    inputs: tuple[Name, ...] = ()
    model: Model
    contacts: Annotated[tuple[Contact, ...], Field(max_length=ENTRIES)] = ()
    controls: dict[Text, Number] = {}
    speeds: dict[Text, Number] = {}
    start: Start = Start()
    goal: Text | None = None
    unsafe: Text | None = None
    doomed: Text | None = None
    tolerance: Number = 1e-6
    duration: Number = 1.0
    step: Number | None = None
    task: Task | None = None

    @model_validator(mode="after")
    def _inputs_are_parameters(self) -> SpaceFile:
        check_inputs(self.inputs, self.parameters)
        return self
