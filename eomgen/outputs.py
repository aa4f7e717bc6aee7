"""What a generated module can compute beside `derivative` and `jacobian`: one table.

The schema takes the names from it, the check of a scene what an output is about, the stages that
record equations its shape, and backends what to say of it. To add an output, add its entry here and
what computes it in `codegen.from_recursion`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

Size = str | int
"""One length of an array: a number, or the name of one."""


@dataclass(frozen=True)
class OutputSpec:
    """One output.

    shape     of the array, () for a number; in the plane, and in space where that is another
    about     its docstring: what it is, units and frames; likewise
    needs     what a scene must have for there to be anything to compute; "" for nothing
    forms     whether all state forms have it, or the form [q, v] alone
    contacts  whether rigid contacts that are held would add to it
    by        what it is the derivative of `derivative` by; "" if it is none
    """

    shape: tuple[Size, ...]
    about: str
    space: tuple[tuple[Size, ...], str] | None = None
    needs: str = ""
    forms: bool = True
    contacts: bool = False
    by: str = ""

    def of(self, dimensions: int) -> tuple[tuple[Size, ...], str]:
        """Shape and docstring, in the plane or in space."""
        if dimensions == 3 and self.space is not None:
            return self.space
        return self.shape, self.about


def _force(about: str, *, contacts: bool = False) -> OutputSpec:
    """Generalised forces or accelerations, one a velocity."""
    return OutputSpec(("nv",), about, forms=False, contacts=contacts)


OUTPUTS: Mapping[str, OutputSpec] = {
    "forward_dynamics": _force(
        "Accelerations (nv,) under generalised forces `tau` beside the effects.", contacts=True
    ),
    "inverse_dynamics": _force(
        "Generalised forces (nv,) that give accelerations `vd` beside the effects.", contacts=True
    ),
    "mass_matrix": OutputSpec(
        ("nv", "nv"),
        "Mass matrix M(q), (nv, nv): symmetric, kinetic energy ½ vᵀ M v.",
        forms=False,
    ),
    "velocity_force": _force("V(q, v) of M v̇ + V + G = F, (nv,)."),
    "gravity_force": _force("G(q) of M v̇ + V + G = F, (nv,)."),
    "bias_force": _force("h = V + G of M v̇ + h = F, (nv,)."),
    "applied_force": _force(
        "F of M v̇ + V + G = F, (nv,): applied forces and torques.", contacts=True
    ),
    "kinetic_energy": OutputSpec((), "Kinetic energy, J."),
    "potential_energy": OutputSpec((), "Potential energy, J."),
    "effect_powers": OutputSpec(("effects",), "What each of `EFFECT_NAMES` does to the motion, W."),
    "momentum": OutputSpec(
        (3,),
        "Linear momentum x, y (kg m/s), angular about the world's origin (kg m^2/s).",
        ((6,), "Momentum x, y, z (kg m/s), angular about the world's origin (kg m^2/s)."),
    ),
    "centre_of_mass": OutputSpec(
        ("dimensions",), "World place of the centre of mass of all bodies, m."
    ),
    "joint_forces": OutputSpec(
        ("joints", 3),
        "What each of `JOINTS` puts on its parent: world x, y (N), moment (N m).",
        (
            ("joints", 6),
            "Force (N) and moment (N m) of each of `JOINTS` on its parent, world axes.",
        ),
        contacts=True,
    ),
    "driving_forces": OutputSpec(
        ("driven",),
        "What each of `DRIVEN` takes, N m or N, on the child and back on the parent.",
        needs="driven joints",
        contacts=True,
    ),
    "body_poses": OutputSpec(
        ("bodies", 3),
        "World x, y (m) of each centre of mass and angle (rad), a row a body.",
        (("bodies", 3, 4), "[world_R_body | centre of mass (m)] of each body, 3 x 4."),
    ),
    "body_velocities": OutputSpec(
        ("bodies", 3),
        "World velocity x, y (m/s) of each centre of mass and rate of turn (rad/s).",
        (
            ("bodies", 6),
            "Velocity of each centre of mass (m/s) and angular velocity (rad/s), world.",
        ),
    ),
    "point_positions": OutputSpec(
        ("points", "dimensions"), "World place of each of `POINTS`, m.", needs="points"
    ),
    "point_velocities": OutputSpec(
        ("points", "dimensions"), "World velocity of each of `POINTS`, m/s.", needs="points"
    ),
    "point_jacobians": OutputSpec(
        ("points", "dimensions", "nv"),
        "J of each of `POINTS`: its world velocity is J v.",
        needs="points",
        forms=False,
    ),
    "input_jacobian": OutputSpec(
        ("ny", "inputs"),
        "Exact Jacobian of `derivative` by the inputs.",
        needs="inputs",
        by="inputs",
    ),
    "parameter_jacobian": OutputSpec(
        ("ny", "parameters"),
        "Exact Jacobian of `derivative` by the parameters.",
        needs="parameters",
        by="parameters",
    ),
}
"""In the order in which they stand in a module."""

JACOBIAN = OutputSpec(("ny", "ny"), "Exact Jacobian of `derivative` by the state.", by="state")
"""What every module has, as it has `derivative`."""
DERIVATIVES = ("jacobian", *(name for name, spec in OUTPUTS.items() if spec.by))
"""Names of the matrices of derivatives."""


def shape_of(name: str, dimensions: int, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """The shape of an output, in the plane or in space; `sizes` are those it names."""
    shape, _ = OUTPUTS[name].of(dimensions)
    return tuple(sizes[size] if isinstance(size, str) else size for size in shape)
