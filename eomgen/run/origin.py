"""What the motion of a run comes of: a scene, parameters and inputs."""

from collections.abc import Mapping
from dataclasses import dataclass

UNITS = "units of parameters"
START = "initial state"
"""The part of a scene that a motion under way no longer depends on, but sizes do."""


@dataclass(frozen=True)
class Origin:
    """What makes a motion, once it is under way, what it is.

    scene               digests of the parts of a scene, by what they are called; looks, names of
                        files and settings of the solver are none
    parameters, inputs  values, by name
    """

    scene: Mapping[str, str]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
