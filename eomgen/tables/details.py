"""How much of a derivation is shown."""

from typing import Literal, get_args

Detail = Literal["summary", "steps", "all"]
"""summary  the state, the equations and their solution
steps    all that leads to them
all      also what follows from them, as the forces in joints, and other ways to write them
"""
DETAILS: tuple[Detail, ...] = get_args(Detail)
