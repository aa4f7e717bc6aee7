"""How much of a derivation is shown, and by which method it is made."""

from typing import Literal, get_args

Detail = Literal["summary", "steps", "all"]
"""summary  the state, the equations and their solution
steps    all that leads to them
all      also what follows from them, as the forces in joints, and other ways to write them
"""
DETAILS: tuple[Detail, ...] = get_args(Detail)

Method = Literal["newton-euler", "lagrange", "kane"]
"""newton-euler  free bodies and their joints' forces, or the algorithm that goes over the bodies
lagrange      energies and their derivatives
kane          loads and inertia in the partial velocities
"""
METHODS: tuple[Method, ...] = get_args(Method)
NAMES: dict[Method, str] = {
    "newton-euler": "Newton and Euler",
    "lagrange": "Lagrange",
    "kane": "Kane",
}
All = Literal["all"]
"""All methods, side by side."""
