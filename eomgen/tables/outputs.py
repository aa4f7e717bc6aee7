"""The outputs that a generated module can have besides `derivative` and `jacobian`.

The table gives the schema the names, elaboration the conditions, recording the shapes and what
computes them, backends the docstrings. To add an output, add its entry here and the function of
`codegen` that the entry names.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

Size = str | int
"""The length of one axis of an array: a number, or its name."""
ANGULAR = ("mx", "my", "mz", "wx", "wy", "wz", "lx", "ly", "lz", "angle")
"""Names of angular parts."""
IN_PLANE = ("m", "mx", "my", "Izz")
IN_SPACE = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""The inertial parameters of a body."""


@dataclass(frozen=True)
class OutputSpec:
    """One output.

    shape     shape of the array, () for a number
    about     its docstring: what it is, with units and frames
    builder   "module:function" in `codegen`: what computes it; "" for a matrix of derivatives
    space     shape and docstring in space, if they differ from those in the plane
    needs     what a model must have for the output to exist; "" for nothing
    forms     whether all state forms have it, or the form [q, v] alone
    contacts  whether forces of held rigid contacts, which it leaves out, would change it
    by        the variables by which it is the Jacobian of `derivative`; "" if it is not one
    beside    the prefix of inputs that it takes beside the state, one for each velocity; "": none
    single    whether that is a single number instead
    units     the unit of its numbers, or those of linear and of angular components; () if they
              differ, or if it has none
    titles    what it is called in a figure, and its angular components; () for its name
    parts     the names along its last axis, by their number
    pure      those of its parts in space that have no unit
    group     the word for what is saved with it: energy, points or poses
    usual     whether "all" stands for it, too
    """

    shape: tuple[Size, ...]
    about: str
    builder: str = ""
    space: tuple[tuple[Size, ...], str] | None = None
    needs: str = ""
    forms: bool = True
    contacts: bool = False
    by: str = ""
    beside: str = ""
    single: bool = False
    units: tuple[str, ...] = ()
    titles: tuple[str, ...] = ()
    parts: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    pure: tuple[str, ...] = ()
    group: str = ""
    usual: bool = True

    def of(self, dimensions: int) -> tuple[tuple[Size, ...], str]:
        """Shape and docstring in the plane or in space."""
        if dimensions == 3 and self.space is not None:
            return self.space
        return self.shape, self.about

    def unit(self, part: str, dimensions: int) -> str:
        """The unit of the numbers with this last name, "" if there is none or it is not known."""
        return "" if dimensions == 3 and part in self.pure else _of_kind(self.units, part)

    def title(self, part: str) -> str:
        """What the numbers with this last name are in a figure; "" for the name of the output."""
        return _of_kind(self.titles, part)


def _of_kind(words: tuple[str, ...], part: str) -> str:
    """The last word for an angular part, the first for another one; "" if there is none."""
    return words[-1 if part in ANGULAR else 0] if words else ""


def _force(about: str, builder: str, beside: str = "", *, contacts: bool = False) -> OutputSpec:
    """An output of generalised forces or accelerations, one for each velocity."""
    return OutputSpec(("nv",), about, builder, forms=False, contacts=contacts, beside=beside)


FRAMES = {
    "": "at the point, in world axes",
    "_local": "at the point, in axes of the body",
    "_world": "of the body's point at the world's origin, in world axes",
}
"""In which frame motions of points of bodies are given, by the ends of names of outputs."""


def _unusual(
    shape: tuple[Size, ...],
    about: str,
    builder: str,
    space: tuple[Size, ...] | None = None,
    needs: str = "",
    beside: str = "",
    parts: Mapping[int, tuple[str, ...]] | None = None,
) -> OutputSpec:
    """An output of the form [q, v] alone, for which "all" does not stand."""
    return OutputSpec(
        shape,
        about,
        f"of_robots:{builder}",
        (space or shape, about),
        needs,
        forms=False,
        beside=beside,
        parts=parts or {},
        usual=False,
    )


def _of_frames(name: str, about: str, builder: str, *axes: Size) -> dict[str, OutputSpec]:
    """An output of motions of points for each of `FRAMES`."""
    return {
        name + end: _unusual(
            ("points", 3, *axes),
            about.format(where),
            f"{builder}{end}",
            ("points", 6, *axes),
            "points",
        )
        for end, where in FRAMES.items()
    }


_OF_ROBOTS: Mapping[str, OutputSpec] = {
    **_of_frames(
        "frame_jacobians",
        "Jacobian J of each of `POINTS`: J v is velocity (m/s) and angular velocity, {}.",
        "frame_jacobians",
        "nv",
    ),
    **_of_frames(
        "frame_bias_accelerations",
        "J̇ v of each of `POINTS`, with J {}: acceleration (m/s^2) and angular acceleration.",
        "frame_bias_accelerations",
    ),
    "centre_of_mass_jacobian": _unusual(
        ("dimensions", "nv"),
        "Jacobian J of the centre of mass of all bodies, whose world velocity is J v.",
        "centre_of_mass_jacobian",
    ),
    "centroidal_momentum_matrix": _unusual(
        (3, "nv"),
        "A: A v is momentum and angular momentum about the centre of mass of all bodies, world.",
        "centroidal_momentum_matrix",
        (6, "nv"),
    ),
    "operational_mobilities": _unusual(
        ("points", 3, 3),
        "J M^-1 Jᵀ of each of `POINTS`, J of `frame_jacobians`: accelerations by unit wrenches.",
        "operational_mobilities",
        ("points", 6, 6),
        "points",
    ),
    "operational_inertias": _unusual(
        ("points", 3, 3),
        "(J M^-1 Jᵀ)^-1 of each of `POINTS`, J of `frame_jacobians`; it must have all its rank.",
        "operational_inertias",
        ("points", 6, 6),
        "points",
    ),
    "coriolis_matrix": _unusual(
        ("nv", "nv"),
        "C(q, v) with C v = V unless joints are driven, and C + Cᵀ the rate of M.",
        "coriolis_matrix",
    ),
    "regressor": _unusual(
        ("nv", "bodies", 4),
        "Y with M vd + V + G = Σ Y π without rotors: π mass, first moment, inertia of each body, "
        "about its joint's point, body axes.",
        "inertial_regressor",
        ("nv", "bodies", 10),
        beside="vd",
        parts={4: IN_PLANE, 10: IN_SPACE},
    ),
    "inverse_dynamics_derivatives": _unusual(
        (2, "nv", "nv"),
        "Derivatives of `inverse_dynamics` by small motions along each velocity, and by `v`.",
        "inverse_dynamics_derivatives",
        beside="vd",
    ),
    "inverse_mass_matrix": _unusual(
        ("nv", "nv"),
        "M^-1; of what moves where constraints hold: accelerations by unit forces.",
        "inverse_mass_matrix",
    ),
    "forward_dynamics_derivatives": _unusual(
        (2, "nv", "nv"),
        "Derivatives of `forward_dynamics` by small motions along each velocity, and by `v`.",
        "forward_dynamics_derivatives",
        beside="tau",
    ),
}

OUTPUTS: Mapping[str, OutputSpec] = {
    "forward_dynamics": _force(
        "Accelerations (nv,) under generalised forces `tau` in addition to the effects.",
        "observed:forward_dynamics",
        "tau",
        contacts=True,
    ),
    "inverse_dynamics": _force(
        "Generalised forces (nv,) that, in addition to the effects, give accelerations `vd`.",
        "observed:inverse_dynamics",
        "vd",
        contacts=True,
    ),
    "mass_matrix": OutputSpec(
        ("nv", "nv"),
        "Mass matrix M(q), (nv, nv): symmetric, kinetic energy ½ vᵀ M v; handout (26) is not, see "
        "`derive`.",
        "observed:mass_matrix",
        forms=False,
    ),
    "velocity_force": _force("V(q, v) of M v̇ + V + G = F, (nv,).", "observed:velocity_force"),
    "gravity_force": _force("G(q) of M v̇ + V + G = F, (nv,).", "observed:gravity_force"),
    "bias_force": _force("h = V + G of M v̇ + h = F, (nv,).", "observed:bias_force"),
    "applied_force": _force(
        "F of M v̇ + V + G = F, (nv,): applied forces and torques.",
        "observed:applied_force",
        contacts=True,
    ),
    "kinetic_energy": OutputSpec(
        (), "Kinetic energy, J.", "observed:kinetic_energy", units=("J",), group="energy"
    ),
    "potential_energy": OutputSpec(
        (), "Potential energy, J.", "observed:potential_energy", units=("J",), group="energy"
    ),
    "kinetic_slopes": OutputSpec(
        ("nq",),
        "Derivatives of the kinetic energy by the coordinates, at fixed velocities, (nq,).",
        "observed:kinetic_slopes",
        needs="constraints",
    ),
    "effect_powers": OutputSpec(
        ("effects",),
        "Power of each of `EFFECT_NAMES` on the motion, W.",
        "observed:effect_powers",
        units=("W",),
        titles=("power",),
    ),
    "effect_forces": OutputSpec(
        ("effects", "nv"),
        "Generalised force of each of `EFFECT_NAMES`, (effects, nv): their sum is F - G.",
        "observed:effect_forces",
        forms=False,
    ),
    "coordinates": OutputSpec(
        ("nq",),
        "Coordinates of all joints, (nq,): those too that follow from others and are no states.",
        "observed:coordinates",
        needs="constraints",
        forms=False,
    ),
    "velocities": OutputSpec(
        ("nv",), "Their velocities, (nv,).", "observed:velocities", needs="constraints", forms=False
    ),
    "accelerations": OutputSpec(
        ("nv",),
        "Their accelerations, (nv,).",
        "observed:accelerations",
        needs="constraints",
        forms=False,
        contacts=True,
    ),
    "momentum": OutputSpec(
        (3,),
        "Linear momentum x, y (kg m/s), angular momentum about the world's origin (kg m^2/s).",
        "observed:momentum",
        ((6,), "Momentum x, y, z (kg m/s), angular momentum about the world's origin (kg m^2/s)."),
        units=("kg m/s", "kg m²/s"),
        titles=("momentum", "angular momentum"),
        parts={3: ("px", "py", "lz"), 6: ("px", "py", "pz", "lx", "ly", "lz")},
    ),
    "centre_of_mass": OutputSpec(
        ("dimensions",),
        "World position of the centre of mass of all bodies, m.",
        "observed:centre_of_mass",
        units=("m",),
    ),
    "joint_forces": OutputSpec(
        ("joints", 3),
        "Force (world x, y; N) and moment (N m) of each of `JOINTS` on its parent.",
        "observed:joint_forces",
        (
            ("joints", 6),
            "Force (N) and moment (N m) of each of `JOINTS` on its parent, world axes.",
        ),
        contacts=True,
        units=("N", "N m"),
        titles=("joint force", "joint moment"),
        parts={3: ("fx", "fy", "mz"), 6: ("fx", "fy", "fz", "mx", "my", "mz")},
    ),
    "constraint_forces": OutputSpec(
        ("constraints",),
        "Multiplier of each of `CONSTRAINTS`, N or N m: its force in the direction of the row.",
        "constraints:constraint_forces",
        needs="constraints",
        contacts=True,
    ),
    "driving_forces": OutputSpec(
        ("driven",),
        "Driving force or torque of each of `DRIVEN` on the child, N or N m.",
        "observed:driving_forces",
        needs="driven joints",
        contacts=True,
        titles=("driving force",),
    ),
    "body_poses": OutputSpec(
        ("bodies", 3),
        "World x, y (m) of each centre of mass and angle (rad), one row a body.",
        "observed:body_poses",
        (("bodies", 3, 4), "[world_R_body | centre of mass (m)] of each body, 3 x 4."),
        units=("m", "rad"),
        titles=("position", "angle"),
        parts={3: ("x", "y", "angle")},
        pure=("1", "2", "3"),
        group="poses",
    ),
    "body_velocities": OutputSpec(
        ("bodies", 3),
        "World velocity x, y (m/s) of each centre of mass, angular velocity (rad/s).",
        "observed:body_velocities",
        (
            ("bodies", 6),
            "Velocity of each centre of mass (m/s) and angular velocity (rad/s), world.",
        ),
        units=("m/s", "rad/s"),
        titles=("velocity", "angular velocity"),
        parts={3: ("vx", "vy", "wz"), 6: ("vx", "vy", "vz", "wx", "wy", "wz")},
    ),
    "point_positions": OutputSpec(
        ("points", "dimensions"),
        "World position of each of `POINTS`, m.",
        "observed:point_positions",
        needs="points",
        units=("m",),
        titles=("position",),
        group="points",
    ),
    "point_velocities": OutputSpec(
        ("points", "dimensions"),
        "World velocity of each of `POINTS`, m/s.",
        "observed:point_velocities",
        needs="points",
        units=("m/s",),
        titles=("velocity",),
        group="points",
    ),
    "point_jacobians": OutputSpec(
        ("points", "dimensions", "nv"),
        "Jacobian J of each of `POINTS`, whose world velocity is J v.",
        "observed:point_jacobians",
        needs="points",
        forms=False,
    ),
    "implicit_step": OutputSpec(
        ("ny",),
        "Change of the state (ny,) in a step of `h`, s, implicit in stiff loads: contacts, "
        "friction, stops, springs, dampers and gains.",
        "implicit_steps:implicit_step",
        forms=False,
        beside="h",
        single=True,
        usual=False,
    ),
    "input_jacobian": OutputSpec(
        ("ny", "inputs"),
        "Exact Jacobian of `derivative` with respect to the inputs.",
        needs="inputs",
        by="inputs",
    ),
    "parameter_jacobian": OutputSpec(
        ("ny", "parameters"),
        "Exact Jacobian of `derivative` with respect to the parameters.",
        needs="parameters",
        by="parameters",
    ),
    **_OF_ROBOTS,
}
"""All outputs, in the order in which a module has them."""


@dataclass(frozen=True)
class Word:
    """What is named along a run beside states and outputs: the time, what the run keeps, or several
    outputs at once.

    unit, title  as those of an output
    outputs      those that it needs
    parts        the names of its own parts, if outputs do not give them
    """

    unit: str = ""
    title: str = ""
    outputs: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()


def _of_group(word: str) -> tuple[str, ...]:
    return tuple(name for name, spec in OUTPUTS.items() if spec.group == word)


WORDS: Mapping[str, Word] = {
    "t": Word("s"),
    "energy": Word("J", "energy", _of_group("energy"), ("kinetic", "potential", "total")),
    "points": Word(outputs=_of_group("points")),
    "poses": Word(outputs=_of_group("poses")),
    "works": Word("J", "work"),
    "inputs": Word("", "input"),
}
"""All words; `works` are integrated with the run, and inputs have units of their own."""
GROUPS = {name: word.outputs for name, word in WORDS.items() if name != "t"}
"""The words for what is saved, with the outputs that they need."""

JACOBIAN = OutputSpec(
    ("ny", "ny"), "Exact Jacobian of `derivative` with respect to the state.", by="state"
)
"""The Jacobian, which every module has."""
DERIVATIVES = ("jacobian", *(name for name, spec in OUTPUTS.items() if spec.by))
"""Names of the matrices of derivatives."""
DYNAMICS = tuple(name for name, spec in OUTPUTS.items() if spec.beside and not spec.single)
"""Outputs that take more than a time, a state, parameters and inputs."""
SAVED = tuple(name for name, spec in OUTPUTS.items() if not spec.beside and name not in DERIVATIVES)
"""The outputs that a state determines, and that are no derivatives."""


def shape_of(name: str, dimensions: int, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """The shape of an output in the plane or in space; `sizes` are the lengths by name."""
    shape, _ = OUTPUTS[name].of(dimensions)
    return tuple(sizes[size] if isinstance(size, str) else size for size in shape)
