"""A tree whose joints are stated as constraints, with the definitions made so far."""

from dataclasses import dataclass, field

import sympy as sp

from eomgen.derivation.definitions import Ledger
from eomgen.derivation.linkage import Frame, Linkage, linkage_of
from eomgen.derivation.projected.constraints import Constraint, state_joints
from eomgen.derivation.rotations import about
from eomgen.derivation.symbols import Expr, Symbols, make_symbols
from eomgen.model.model import Model


@dataclass(frozen=True)
class Tree:
    """A linkage over symbols with its joints as constraints, and rotations from a body's axes to
    the world's, or to those of an ancestor.
    """

    linkage: Linkage
    symbols: Symbols
    ledger: Ledger
    constraints: tuple[Constraint, ...]
    _rotations: dict[tuple[int, int], Expr] = field(default_factory=dict)

    @classmethod
    def of(cls, model: Model, inline: int, longest: int) -> "Tree":
        """The joints of a model stated; `inline` and `longest` are those of a `Ledger`."""
        symbols = make_symbols(model)
        ledger = Ledger(symbols.fixed, inline, longest)
        linkage = linkage_of(model, symbols)
        return cls(linkage, symbols, ledger, state_joints(linkage, symbols, ledger))

    @property
    def model(self) -> Model:
        """The model."""
        return self.linkage.model

    @property
    def bodies(self) -> tuple[Frame, ...]:
        """The frames of the bodies, with their inertia."""
        return self.linkage.bodies

    @property
    def armatures(self) -> dict[int, Expr]:
        """The inertia of motors' rotors, by index in v."""
        frames = (frame for frame in self.linkage.frames if frame.armature != 0)
        return {self.symbols.v.index(v): frame.armature for frame in frames for v in frame.v}

    @property
    def translational(self) -> dict[int, int]:
        """The translational velocities of floating trees, with the world axis of each."""
        return {
            first + i: i
            for body, first in zip(self.model.bodies, self.model.first_velocity, strict=True)
            if not body.joint.holds
            for i in range(self.model.dimensions)
        }

    def rotation(self, body: int, base: int = -1) -> Expr:
        """Axes of `body` in those of `base`, -1 the world."""
        if body == base:
            return sp.eye(3)
        if (body, base) not in self._rotations:
            self._rotations[body, base] = self._rotation(body, base)
        return self._rotations[body, base]

    def axis_angle(self, body: int, base: int = -1) -> tuple[Expr, Expr] | None:
        """Coordinate axis and angle between two bodies, if all joints between rotate about one
        axis.
        """
        axis, angle = sp.zeros(3, 1), sp.Integer(0)
        while body != base:
            axis_angle = self.constraints[body].axis_angle
            if axis_angle is None or (any(axis) and any(axis_angle[0]) and axis_angle[0] != axis):
                return None
            axis, angle = (axis_angle[0] if any(axis_angle[0]) else axis), axis_angle[1] + angle
            body = self.model.bodies[body].parent
        return axis, angle

    def _rotation(self, body: int, base: int) -> Expr:
        axis_angle = self.axis_angle(body, base)
        if axis_angle is not None:
            return about(*axis_angle) if any(axis_angle[0]) else sp.eye(3)
        c, parent = self.constraints[body], self.model.bodies[body].parent
        whole = self.rotation(parent, base) * (c.axes * c.rotation)
        if parent == base and c.axes == sp.eye(3):
            return whole
        name = self.model.bodies[body].name
        where = f"{name}__{self.model.bodies[base].name}" if base >= 0 else name
        return sp.Matrix(
            3,
            3,
            lambda i, j: self.ledger.named(
                f"W__{where}__{'xyz'[i]}{'xyz'[j]}", self.ledger.short(whole[i, j])
            ),
        )
