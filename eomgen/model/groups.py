"""Groups of coordinates that a closed polygon determines."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Group:
    """Coordinates that one constraint determines, by the coordinates of groups before and others.

    constraint   its name
    coordinates  their indices in q
    branch       1 or -1: on which side a polygon lies that closes on two sides; 0 if it cannot
    cuts         for each angle the frame whose angle it is measured from, -1 for the world, and in
                 which quarter turn from there it begins to count: the range is half a turn to both
                 sides. None for a length
    """

    constraint: str
    coordinates: tuple[int, ...]
    branch: int = 0
    cuts: tuple[tuple[int, int] | None, ...] = ()
