"""The scene: every table and key of the language, as data."""

from typing import Annotated, Literal, get_args

from pydantic import Field

from eomgen.effects import Effect
from eomgen.joints import Joint
from eomgen.language.base import Identifier, Number, Positive, Table, Text
from eomgen.language.quantity import Quantity, quantity
from eomgen.scene.look import Camera, Shape

MOST = 1000
"""Most bodies, joints, effects or parameters a scene may list."""

Output = Literal[
    "forward_dynamics",
    "inverse_dynamics",
    "mass_matrix",
    "velocity_force",
    "gravity_force",
    "applied_force",
    "kinetic_energy",
    "potential_energy",
    "momentum",
    "joint_forces",
    "body_poses",
]
OUTPUTS: tuple[Output, ...] = get_args(Output)
"""What a generated module can compute beside `derivative` and `jacobian`."""

SHOWN = ("kinetic_energy", "potential_energy", "body_poses")
"""The outputs that figures and pages are drawn from; generated always."""

Integrator = Literal[
    "euler",
    "semi_implicit_euler",
    "rk4",
    "implicit_midpoint",
    "RK45",
    "DOP853",
    "Radau",
    "BDF",
    "LSODA",
]
Form = Literal["velocity", "momentum", "redundant"]


class ParameterTable(Table):
    """A parameter with its unit and meaning: `{ value = 1.0, unit = "kg", about = "…" }`."""

    value: Number
    unit: Annotated[str, Field(max_length=40, pattern=r"^[A-Za-z0-9 /^*.()-]*$")] = ""
    about: Text = ""


class BodyTable(Table):
    """A rigid body; a point mass has `inertia_com = 0`."""

    name: Identifier
    mass: Quantity = quantity("kg", "mass", "positive")
    inertia_com: Quantity = quantity(
        "kg m^2", "moment of inertia about the centre of mass", "nonnegative"
    )
    shapes: tuple[Shape, ...] = ()


class Initial(Table):
    """State at the start: lists in the order that `eomgen check` shows, or tables by name.

    In a table what is not named is 0, and an angle may be given in degrees as `<name>_deg`.
    """

    q: tuple[Number, ...] | dict[str, Number] = Field(default={}, union_mode="left_to_right")
    v: tuple[Number, ...] | dict[str, Number] = Field(default={}, union_mode="left_to_right")


class Simulation(Table):
    """How to run it unless the command line says otherwise."""

    t_end: Positive = 10.0
    integrator: Integrator = "DOP853"
    dt: Positive = 0.001
    rtol: Positive = 1e-9
    atol: Positive = 1e-12


class Scene(Table):
    """A whole scene."""

    name: Identifier
    title: Text = ""
    outputs: Literal["all"] | tuple[Output, ...] = Field(default=(), union_mode="left_to_right")
    form: Form = "velocity"
    parameters: Annotated[dict[Identifier, Number | ParameterTable], Field(max_length=MOST)] = (
        Field(default={})
    )
    bodies: Annotated[tuple[BodyTable, ...], Field(min_length=1, max_length=MOST)]
    joints: Annotated[tuple[Joint, ...], Field(min_length=1, max_length=MOST)]
    effects: Annotated[tuple[Effect, ...], Field(max_length=MOST)] = ()
    initial: Initial = Initial()
    simulation: Simulation = Simulation()
    camera: Camera = Camera()
