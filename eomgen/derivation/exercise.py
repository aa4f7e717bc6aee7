"""Exercises from a derivation: results with a blank in place of their right side."""

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from eomgen.base.displays import Displayed
from eomgen.base.errors import SceneError
from eomgen.derivation.definitions import written_out, written_size
from eomgen.derivation.exposition import exposition_of
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.mechanism import NamingMechanism, Notes
from eomgen.derivation.own_names import names_within
from eomgen.derivation.reading import read, read_all, reading_names
from eomgen.derivation.simplified import simplified, size
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr
from eomgen.derivation.telling import Exposition
from eomgen.derivation.ways import compared
from eomgen.language.formula import ZERO
from eomgen.language.rewriting import times
from eomgen.model.model import Model

MOST_QUESTIONS = 5
LONGEST = 60
"""The size of a result up to which it is asked for."""
MOST_WRITTEN = 250
"""Symbols and numbers of a result, before it is simplified, up to which it is tried."""
BLANK = sp.Symbol("…")
ASKED = (
    "Write each result as a formula of the symbols in the equations above it. M, V, G and F are "
    "those of M dv/dt + V + G = F, with the symmetric M of kinetic energy."
)
ARMS = "In this variant arms lie as follows, from a body's centre of mass, in its axes:"
NUMBERS = "With these numbers, in SI units and radians:"
FUNCTIONS = (sp.sin, sp.cos, sp.tan, sp.exp, sp.log, sp.Abs)


@dataclass(frozen=True)
class Question:
    """A result that is asked for: its symbol, and over names of the scene what it is. With values
    `at` which it is wanted, by name, a number is asked for.
    """

    left: Expr
    right: Expr
    at: Mapping[str, float]

    @property
    def value(self) -> Expr:
        """The answer."""
        if not self.at:
            return self.right
        number = self.right.subs({s: self.at[s.name] for s in self.right.free_symbols})
        return sp.Float(f"{float(number):.4g}")


@dataclass(frozen=True, repr=False)
class Exercise(Displayed):
    """Questions on a mechanism. `known` are the names that answers may use, `arms` those that are
    not as the scene has them.
    """

    shown = ("questions", "known")

    model: Model
    questions: tuple[Question, ...]
    known: tuple[str, ...]
    hints: tuple[Step, ...]
    exposition: Exposition
    arms: tuple[Equation, ...] = ()

    def steps(self, *, solved: bool) -> tuple[Step, ...]:
        """The sheet: what is given, and the questions with blanks or with their answers."""
        names = reading_names(self.model)
        given = [s for s in self.exposition.steps if s.kind in ("state", "bodies")]
        found = [*given]
        if self.arms:
            found.append(Step("joint", "Arms", ARMS, read_all(self.arms, names_within(self.model))))
        for title, words, numeric in (("Questions", ASKED, False), ("Numbers", NUMBERS, True)):
            asked = [q for q in self.questions if bool(q.at) == numeric]
            lines = [
                Equation(sp.Symbol(name), sp.Float(str(x)))
                for q in asked
                for name, x in q.at.items()
            ]
            lines += [Equation(q.left, q.value if solved else BLANK) for q in asked]
            if asked:
                said = tuple(Equation(read(x.left, names), read(x.right, names)) for x in lines)
                found.append(Step("equations", title, words, said))
        return tuple(found)


def exercise_of(model: Model, exposition: Exposition, seed: int = 0) -> Exercise:
    """An exercise; the seed chooses what is asked for, the numbers of the last question, and from 1
    on how the arms of a tree in the plane lie in their bodies.

    Raises `SceneError` where no equation is written out, or none is short enough.
    """
    if exposition.matrices is None:
        raise SceneError(
            f"exercise: the equations of {model.name} are an algorithm, with nothing to fill in"
        )
    chance = random.Random(seed)
    arms: tuple[Equation, ...] = ()
    if seed and model.dimensions == 2 and not model.constraints:
        model, arms = _with_turned_arms(model, chance)
    if arms:
        method = exposition.method
        exposition = compared(model) if method == "all" else exposition_of(model, method=method)
    found = exposition.matrices
    assert found is not None
    known = {c.name for c in (*model.coordinates, *model.velocities)} | {*model.defaults}
    known |= {i.name for i in model.inputs}
    asked = [q for q in _results(found) if {s.name for s in q.right.free_symbols} <= known]
    if not asked:
        raise SceneError(f"exercise: the equations of {model.name} are too long to ask for")
    chosen = sorted(chance.sample(range(len(asked)), min(MOST_QUESTIONS, len(asked))))
    questions = [asked[i] for i in chosen]
    questions += _numeric(model, [asked[i] for i in chosen], chance)
    hints = tuple(
        s for s in exposition.steps if s.kind in ("joint", "motion", "constraint", "balance")
    )
    return Exercise(model, tuple(questions), tuple(sorted(known)), hints, exposition, arms)


def _with_turned_arms(model: Model, chance: random.Random) -> tuple[Model, tuple[Equation, ...]]:
    """The model with the arms of bodies to their own joints turned by quarters, and these arms."""
    names, bodies, arms = NamingMechanism(model, Notes()), [], []
    for body in model.bodies:
        arm, turns = body.joint.r_child, chance.randrange(4)
        if body.joint.holds and turns and any(part != ZERO for part in arm):
            for _ in range(turns):
                arm = (ZERO if arm[1] == ZERO else times(-1.0, arm[1]), arm[0])
            body = replace(body, joint=body.joint.replaced(r_child=arm))
            left = sp.Symbol(f"r_{body.joint.name},child")
            arms.append(Equation(left, sp.Matrix([names.value(part) for part in arm])))
        bodies.append(body)
    return replace(model, bodies=tuple(bodies)), tuple(arms)


def _results(found: Matrices) -> Iterator[Question]:
    """Entries of M on and above its diagonal, of V, G and F, and accelerations, that are not 0."""
    several = len(found.a) > 1
    for letter in "MVGF":
        whole = getattr(found, letter)
        for i in range(whole.rows):
            for j in range(i, whole.cols) if letter == "M" else (0,):
                index = f"_{i + 1},{j + 1}" if letter == "M" else f"_{i + 1}"
                symbol = sp.Symbol(letter + (index if several else ""))
                yield from _asked(symbol, whole[i, j], found)
    for a in found.a:
        right = dict(found.definitions).get(a, a)
        if size(right) <= LONGEST:
            yield from _asked(a, right, found)


def _asked(left: Expr, short: Expr, found: Matrices) -> Iterator[Question]:
    if written_size(short, found.definitions) > MOST_WRITTEN:
        return
    right = simplified(written_out(short, found.definitions))
    plain = all(isinstance(f, FUNCTIONS) for f in right.atoms(sp.Function))
    if right.free_symbols and plain and size(right) <= LONGEST:
        yield Question(left, right, {})


def _numeric(model: Model, asked: list[Question], chance: random.Random) -> Iterator[Question]:
    """The longest of the results with numbers near the scene's and a random state."""
    question = max(asked, key=lambda q: size(q.right))
    at = {}
    for name in sorted(s.name for s in question.right.free_symbols):
        base = model.defaults.get(name)
        number = chance.uniform(0.2, 1.4) if base is None else base * chance.uniform(0.6, 1.8)
        at[name] = float(f"{number:.2g}")
    yield Question(question.left, question.right, at)
