"""What outputs along a run are computed from, after the run: its scene and its values."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from eomgen.run.problem import FloatArray


@dataclass(frozen=True)
class Setup:
    """The scene of a run and the values that replace the scene's own.

    scene       its tables as JSON, with the state form and the route of the run
    parameters  values of parameters, by name
    inputs      constant values of inputs, by name
    varying     all inputs at each row, (n, nu), if some are tables or functions of time; else None
    """

    scene: str
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    varying: FloatArray | None = field(default=None, compare=False)

    def tables(self) -> dict[str, object]:
        """The tables of the scene. Raises `ValueError` if its text is not JSON of a table."""
        found = json.loads(self.scene)
        if not isinstance(found, dict):
            raise ValueError("no table")
        return found
