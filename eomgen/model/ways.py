"""The ways between bodies in their tree: `scene.constraints.base.Ways`."""

from collections.abc import Sequence
from dataclasses import dataclass

from eomgen.base.errors import SceneError
from eomgen.language.formula import ZERO, Formula, Name
from eomgen.language.rewriting import difference, total
from eomgen.model.bodies import Body
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class TreeWays:
    """The ways in a tree of bodies, parents first."""

    bodies: Sequence[Body]
    dimensions: int

    def parent(self, body: str) -> str:
        """The body to which the joint of a body is attached."""
        parent = self.bodies[self._index(body)].parent if body != WORLD else -1
        return self.bodies[parent].name if parent >= 0 else WORLD

    def turn(self, body: str, other: str, location: str) -> Formula:
        """The sum of the angles of the joints on the way from one body to another, rad."""
        ways = [self._to_world(name) for name in (body, other)]
        angle: Formula = ZERO
        for k in ways[0]:
            if k not in ways[1]:
                angle = total(angle, self._angle(k, location))
        for k in ways[1]:
            if k not in ways[0]:
                angle = difference(angle, self._angle(k, location))
        return angle

    def _index(self, name: str) -> int:
        return next(k for k, body in enumerate(self.bodies) if body.name == name)

    def _to_world(self, name: str) -> list[int]:
        found, k = list[int](), -1 if name == WORLD else self._index(name)
        while k >= 0:
            found.append(k)
            k = self.bodies[k].parent
        return found

    def _angle(self, k: int, location: str) -> Formula:
        """The angle of a joint: of its only rotation."""
        body = self.bodies[k]
        kinds = [primitive.kind for primitive in body.joint.primitives(self.dimensions)]
        rotations = [i for i, kind in enumerate(kinds) if kind != "prismatic"]
        if not rotations:
            return ZERO
        if len(rotations) > 1 or kinds[rotations[0]] == "spherical":
            raise SceneError(
                f"{location}: joint '{body.joint.name}', {body.joint.type}, is between its bodies, "
                "and has no single angle; take bodies that turn about one axis"
            )
        return Name(body.positions[rotations[0]].name)
