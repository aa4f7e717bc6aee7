"""The equations of motion of a mechanism with their derivation, as `derive` returns them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from eomgen.api.options import check_seed
from eomgen.base.displays import Displayed
from eomgen.base.errors import SceneError
from eomgen.model.model import Model
from eomgen.program.tape import TIME

if TYPE_CHECKING:
    from eomgen.derivation.exercise import Exercise
    from eomgen.derivation.matrices import Matrices
    from eomgen.derivation.steps import Step
    from eomgen.derivation.symbols import Expr
    from eomgen.derivation.telling import Exposition

NUMBERS = (
    "m = eomgen.load(eomgen.generate(scene, outputs=['mass_matrix', 'velocity_force', "
    "'gravity_force', 'applied_force'])); y = m.initial_state(); m.mass_matrix(0.0, y), "
    "m.velocity_force(0.0, y), m.gravity_force(0.0, y), m.applied_force(0.0, y)"
)
"""How to compute M, V, G and F of a `scene` where they are not written out."""


@dataclass(frozen=True, repr=False)
class Derivation(Displayed):
    """Equations of motion M v̇ + V + G = F as SymPy expressions, and the steps of their derivation.

    `matrices` has the equations and the symbols of coordinates `q`, velocities `v` and
    accelerations `a`; with constraints in closed form those of the freedoms, as in the state of its
    module. A mechanism whose steps are those of an algorithm has none; the functions
    `mass_matrix`, `velocity_force`, `gravity_force`, `applied_force` of its module give numbers.
    """

    shown = ("title", "steps")

    model: Model
    exposition: "Exposition"

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.model.name

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self.model.title

    @property
    def matrices(self) -> "Matrices":
        """The equations as matrices. Raises `SceneError` if they are not written out."""
        if self.exposition.matrices is None:
            raise SceneError(
                f"derive: M, V, G and F of {self.name} are not written out as expressions, but "
                f"as an algorithm; a module computes their numbers: `{NUMBERS}`"
            )
        return self.exposition.matrices

    @property
    def M(self) -> "Expr":
        """Mass matrix, (nv, nv), symmetric."""
        return self.matrices.M.as_immutable()

    @property
    def V(self) -> "Expr":
        """Velocity-dependent forces (Coriolis and centrifugal), (nv, 1), on the left side."""
        return self.matrices.V.as_immutable()

    @property
    def G(self) -> "Expr":
        """Gravity forces, (nv, 1), on the left side."""
        return self.matrices.G.as_immutable()

    @property
    def F(self) -> "Expr":
        """All other generalised forces, (nv, 1), on the right side.

        Forces of effects that depend on the motion are symbols in it; `written_out` puts their
        expressions in place.
        """
        return self.matrices.F.as_immutable()

    @property
    def vd(self) -> "Expr":
        """The accelerations v̇ = M⁻¹ (F - V - G), (nv, 1), written out as `solution` is."""
        import sympy as sp

        return sp.ImmutableMatrix(list(self.solution.values()))

    @property
    def symbols(self) -> "dict[str, Expr]":
        """The symbols of the equations by name: coordinates, velocities, accelerations, states of
        controllers, inputs, parameters and the time t, as far as they occur.
        """
        found = self.matrices
        values = [found.M, found.V, found.G, found.F, *(value for _, value in found.definitions)]
        free = {s.name: s for value in values for s in value.free_symbols}
        free |= {s.name: s for s in (*found.q, *found.v, *found.a)}
        return {name: free[name] for name in self.meanings if name in free}

    @property
    def meanings(self) -> dict[str, str]:
        """What each symbol is, with its unit, by name."""
        model = self.model
        known: list[Any] = [*model.coordinates, *model.velocities, *model.extra]
        known += [*model.inputs, *model.parameters]
        meanings = {x.name: ", ".join(filter(None, (x.about, x.unit))) for x in known}
        rates = {c.acceleration: f"time derivative of {c.name}" for c in model.velocities}
        return {**meanings, **rates, TIME: "time, s"}

    def written_out(self, expression: "Expr") -> "Expr":
        """An expression over q, v, t, inputs and parameters alone: all other symbols, as those of
        forces or of what constraints determine, are replaced by what they stand for.
        """
        from eomgen.derivation.definitions import written_out

        return written_out(expression, self.matrices.definitions)

    @property
    def solution(self) -> "dict[Expr, Expr]":
        """Each acceleration as an expression in q, v, parameters and inputs."""
        return {a: self.written_out(a) for a in self.matrices.a}

    @property
    def steps(self) -> "tuple[Step, ...]":
        """The steps of the derivation, with number, title, explanation and equations."""
        return self.exposition.steps

    def text(self, *, encoding: str = "utf-8") -> str:
        """All steps as plain text, in ASCII if the encoding lacks Greek letters."""
        from eomgen.show.derivation import as_text

        return as_text(self.model, self.steps, self.exposition.effects, encoding=encoding)

    def latex(self) -> str:
        """All steps as one LaTeX document."""
        from eomgen.show.derivation import as_latex

        return as_latex(self.model, self.steps, self.exposition.effects)

    def html(self) -> str:
        """All steps as one HTML page."""
        from eomgen.show.derivation import as_html

        return as_html(self.model, self.steps, self.exposition.effects)

    def exercise(self, seed: int = 0) -> "Exercise":
        """Questions on results of the derivation; the seed, from 0 on, chooses them and their
        numbers. Raises `SceneError` if the equations are too long to be asked for.
        """
        from eomgen.derivation.exercise import exercise_of

        check_seed(seed, "seed")
        return exercise_of(self.model, self.exposition, seed)

    def _repr_html_(self) -> str:
        from eomgen.show.notebook import framed

        return framed(self.html(), f"Derivation of {self.name}", height=480)

    def _repr_latex_(self) -> str:
        import sympy as sp

        if self.exposition.matrices is None:
            steps = f"M v̇ + V + G = F in {len(self.steps)} steps"
            return f"$\\text{{{steps}}}$"
        found = self.matrices
        left = sp.latex(found.M) + sp.latex(sp.Matrix(found.a))
        rest = " + ".join(sp.latex(m) for m in (found.V, found.G))
        return f"$\\displaystyle {left} + {rest} = {sp.latex(found.F)}$"
