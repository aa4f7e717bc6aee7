"""The scene: all tables and keys of the language."""

import sys
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PrivateAttr,
    Strict,
    ValidationError,
)

from eomgen.base.displays import Displayed
from eomgen.language.base import (
    AngleOrNumber,
    ByName,
    Identifier,
    Number,
    Positive,
    Table,
    Text,
)
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Numbers, Quantity, Vector, quantity
from eomgen.scene.kinds import AnyConstraint, Effect, Joint
from eomgen.scene.look import Camera, Shape
from eomgen.scene.mistakes import mistakes
from eomgen.tables.integrators import INTEGRATORS
from eomgen.tables.outputs import OUTPUTS
from eomgen.tables.routes import ROUTES

MOST = 1000
"""Greatest number of bodies, joints, effects or parameters of a scene."""

if TYPE_CHECKING:
    Output = str
    Route = str
    Integrator = str
else:  # one of the names; `auto` is the route with the fewest operations that is accurate enough
    Output = Literal[tuple(OUTPUTS)]
    Route = Literal["auto", *ROUTES]
    Integrator = Literal[tuple(INTEGRATORS)]

SHOWN = ("kinetic_energy", "potential_energy", "body_poses")
"""The outputs that figures and pages need."""


def _no_module(name: str) -> str:
    if name in sys.stdlib_module_names or name == "numpy":
        raise ValueError("is a Python module that generated code would hide; choose another name")
    return name


ModuleName = Annotated[Identifier, AfterValidator(_no_module)]
"""The name of a scene and its module, which must not hide another module."""


Form = Literal["velocity", "momentum", "redundant"]
LoopsKept = Literal["auto", "closed", "projected"]
"""How the loops of a mechanism are closed."""
LeftOut = Literal["velocity_forces"]
"""Terms of the equations that a scene may leave out."""


UNIT = r"^[A-Za-z0-9 /^*.()-]*$"
"""What the unit of a parameter or an input may be written with."""


class ParameterTable(Table):
    """A parameter with its unit and meaning: `{ value = 1.0, unit = "kg", about = "…" }`."""

    example: ClassVar[str] = """
[parameters]
l = 0.8
m = { value = 2.0, unit = "kg", about = "mass of the arm" }
"""
    value: Number = Field(description="its value")
    unit: Annotated[str, Field(max_length=40, pattern=UNIT)] = Field(
        default="", description="its unit, which documentation shows"
    )
    about: Text = Field(default="", description="what it is, in one line")


Inertia = Quantity | Annotated[tuple[Quantity, ...], Field(min_length=3, max_length=6)]
"""A number in the plane, 3 or 6 entries of a symmetric matrix in space."""


def inertia(**options: Any) -> Any:
    """A field for the inertia of a body."""
    about = "moment of inertia about the centre of mass"
    return quantity("kg m^2", about, "nonnegative", union_mode="left_to_right", **options)


class InputTable(Table):
    """An input of the module for formulas of the scene: `{ name = "thrust", unit = "N" }`."""

    example: ClassVar[str] = """
inputs = [{ name = "thrust", unit = "N", about = "of the engine" }, "wind"]
"""

    name: Identifier
    unit: Annotated[str, Field(max_length=40, pattern=UNIT)] = Field(default="", description="unit")
    about: Text = Field(default="", description="one line of text")
    default: Number = Field(default=0.0, description="its value if none is given")


class BodyTable(Table):
    """A rigid body.

    `inertia_com` is needed unless the body is on a joint of type `particle`; of a particle it is 0.
    In the plane the inertia is a number; in space [xx, yy, zz], or [xx, yy, zz, xy, xz, yz], the
    entries of the matrix about the centre of mass in body axes.

    Points of a body are given relative to its centre of mass, or, with `com`, in the body's own
    frame, in which the centre of mass is at `com`. Joints without `r_parent` or `r_child` are then
    at the origin of that frame. All other points that are not given are at the centre of mass. The
    coordinates of a free joint and the outputs of poses are those of the centre of mass, too.
    """

    example: ClassVar[str] = """
[[bodies]]
name = "arm"
mass = "m"
inertia_com = "m*l**2/12"
"""
    name: Identifier
    mass: Quantity = quantity("kg", "mass", "nonnegative")
    inertia_com: Inertia = inertia(default=ZERO, validate_default=False)
    com: Vector = quantity(
        "m", "centre of mass in the body's frame", default=(), validate_default=False
    )
    inertia_check: Literal["on", "off"] = Field(
        default="on",
        description="whether to refuse an inertia that no body can have, with a principal moment "
        "larger "
        "than the other two together by more than 0.1 %",
    )
    shapes: tuple[Shape, ...] = Field(default=(), description="shapes in pictures")


class ChainTable(Table):
    """A chain of equal links: bodies `<name>_1`, … at revolute joints `<name>_joint_1`, …

    `r_parent` is the pin on the previous link and `r_child` the pin on the link itself, each from
    the centre of mass of its link; `start` is the first pin on `parent`.
    """

    example: ClassVar[str] = """
[[chains]]
name = "link"
count = 20
mass = 0.05
inertia_com = 2e-5
r_parent = [0.05, 0]
r_child = [-0.05, 0]
"""
    name: Identifier
    count: Annotated[int, Strict(), Field(ge=1, le=MOST, description="number of links")]
    parent: Identifier = Field(default="world", description="parent of the first link")
    mass: Quantity = quantity("kg", "mass", "nonnegative")
    inertia_com: Inertia = inertia()
    start: Vector = quantity("m", "first pin on the parent", default=(), validate_default=False)
    r_parent: Vector = quantity("m", "pin on the previous link")
    r_child: Vector = quantity("m", "pin on the link itself")
    axis: Numbers | None = Field(
        default=None, description="direction of the pins, in space; z if absent"
    )
    shapes: tuple[Shape, ...] = Field(default=(), description="shapes of each link in pictures")


class PointTable(Table):
    """A named point of a body."""

    example: ClassVar[str] = """
[[points]]
name = "tip"
body = "hand"
at = [0.1, 0]
"""
    name: Identifier
    body: Identifier = Field(description="body it is fixed to")
    at: Vector = quantity("m", "point from the centre of mass", default=(), validate_default=False)


class Initial(Table):
    """The initial state: lists in the order of `eomgen check`, or tables by name.

    In a table, values that are not named are 0, and an angle may be given in degrees, as
    `<name>_deg = 90` or `<name> = "90 deg"`.
    """

    example: ClassVar[str] = """
[initial]
q = { shoulder_angle_deg = 30 }
v = { elbow_angle_dot = -2.0 }
"""
    q: tuple[Number, ...] | ByName = Field(
        default={}, union_mode="left_to_right", description="coordinates"
    )
    v: tuple[Number, ...] | ByName = Field(
        default={}, union_mode="left_to_right", description="velocities"
    )
    guess: ByName = Field(
        default={},
        description="with loops, where the search begins for coordinates that are not given: it "
        "chooses the branch",
    )


class Simulation(Table):
    """Settings of a run, which options of the command line override.

    Rigid contacts that close more slowly than `rest_speed`, m/s or rad/s, do not bounce; without
    it, contacts that would rise by less than 5e-8 of the mechanism's size do not. Without `atol`,
    the absolute tolerance of each state is 1e-12 of the state's size, or `rtol`/1000 of it if
    `rtol` is below 1e-9, but not less than the rounding error of the state. Sizes are estimated
    from the scene's lengths and initial motion.
    """

    example: ClassVar[str] = """
[simulation]
t_end = 5.0
integrator = "DOP853"
rtol = 1e-10
"""
    t_end: Positive = Field(default=10.0, description="end time, s")
    integrator: Integrator = Field(default="DOP853", description="method")
    dt: Positive = Field(default=0.001, description="step of a fixed-step method, s")
    rtol: Positive = Field(default=1e-9, description="relative tolerance of an adaptive method")
    atol: Positive | None = Field(
        default=None, description="absolute tolerance of an adaptive method"
    )
    rest_speed: Positive | None = Field(
        default=None, description="speed below which contacts do not bounce"
    )


def _all(value: Any) -> Any:
    """Read ["all"] as "all"."""
    return "all" if value == ["all"] else value


class Scene(Displayed, Table):
    """A whole scene."""

    shown: ClassVar[tuple[str, ...]] = (
        "title",
        "dimensions",
        "parameters",
        "inputs",
        "bodies",
        "joints",
        "chains",
        "points",
        "effects",
        "constraints",
        "remarks",
    )

    name: ModuleName
    title: Text = Field(default="", description="one line of text")
    about: Text = Field(default="", description="a sentence on what it shows, for the gallery")
    outputs: Annotated[Literal["all"] | tuple[Output, ...], BeforeValidator(_all)] = Field(
        default=(),
        union_mode="left_to_right",
        description="functions of the module beside derivative and jacobian",
    )
    form: Form = Field(default="velocity", description="state form")
    parameters: Annotated[
        dict[Identifier, AngleOrNumber | ParameterTable], Field(max_length=MOST)
    ] = Field(
        default={},
        description="named numbers, angles as '90 deg', or tables of value, unit and about",
    )
    inputs: Annotated[tuple[Identifier | InputTable, ...], Field(max_length=MOST)] = Field(
        default=(),
        description="inputs that formulas use: names, or tables of name, unit, about and default",
    )
    definitions: Annotated[dict[Identifier, Quantity], Field(max_length=MOST)] = Field(
        default={}, description="names for formulas of parameters, the motion and one another"
    )
    dimensions: Literal[2, 3] = Field(default=2, description="2 in the plane, 3 in space")
    route: Route = Field(default="auto", description="route to the equations")
    loops: LoopsKept = Field(
        default="auto",
        description="closed: dependent coordinates follow in closed form and are no states; "
        "projected: all coordinates are states; auto: closed where that is possible",
    )
    bodies: Annotated[tuple[BodyTable, ...], Field(max_length=MOST)] = Field(
        default=(), description="bodies"
    )
    joints: Annotated[tuple[Joint, ...], Field(max_length=MOST)] = Field(
        default=(), description="joints, one for each body"
    )
    chains: Annotated[tuple[ChainTable, ...], Field(max_length=MOST)] = Field(
        default=(), description="chains of equal links"
    )
    points: Annotated[tuple[PointTable, ...], Field(max_length=MOST)] = Field(
        default=(), description="named points of bodies"
    )
    effects: Annotated[tuple[Effect, ...], Field(max_length=MOST)] = Field(
        default=(), description="effects: forces, contacts, controllers, drives"
    )
    constraints: Annotated[tuple[AnyConstraint, ...], Field(max_length=MOST)] = Field(
        default=(), description="constraints: rods, couplings, equations, rolling"
    )
    locked: Annotated[ByName, Field(max_length=MOST)] = Field(
        default={},
        description="coordinates held constant, by name (<name>_deg or '90 deg' for an angle)",
    )
    leave_out: Annotated[tuple[LeftOut, ...], Field(max_length=1)] = Field(
        default=(),
        description="terms to leave out: velocity_forces, for slow motion",
    )
    initial: Initial = Field(default=Initial(), description="initial state")
    simulation: Simulation = Field(default=Simulation(), description="settings of a run")
    camera: Camera = Field(default=Camera(), description="camera of pictures")

    _remarks: tuple[str, ...] = PrivateAttr(default=())

    @property
    def remarks(self) -> tuple[str, ...]:
        """What an imported file says and this scene lacks, one sentence each."""
        return self._remarks

    def with_remarks(self, remarks: tuple[str, ...]) -> Self:
        """A copy with these remarks."""
        copy = self.replaced()
        copy._remarks = remarks
        return copy

    def __init__(self, **tables: Any) -> None:
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise mistakes(error, "scene") from None

    # Pydantic then does not call this method in `model_validate`, whose errors it returns itself.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]
