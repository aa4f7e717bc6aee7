"""What the motion of a run depends on: a scene, parameters and inputs."""

from collections.abc import Mapping
from dataclasses import dataclass

UNITS = "units of parameters"
START = "initial state"
"""The part of a scene that does not affect how a motion continues, but does affect sizes."""


@dataclass(frozen=True)
class Origin:
    """What a motion depends on.

    scene               digests of the parts of a scene, by their descriptions; appearance, file
                        names and integrator settings are not among them
    parameters, inputs  values, by name
    """

    scene: Mapping[str, str]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
