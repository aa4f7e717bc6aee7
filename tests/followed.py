"""What a derivation states, followed in numbers, beside the numeric solver."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp
from equation_numbers import Numbers, array, define, follow, number

from eomgen.derivation.acting import used_bodies
from eomgen.derivation.articulated import recursive_steps
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import DerivedEffect, derived_effects
from eomgen.derivation.linkage import linkage_of
from eomgen.derivation.own_names import own_name
from eomgen.derivation.poses import poses
from eomgen.derivation.reading import reading_names
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import names_of_scene, of_scene
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.start.constraint_equations import ConstraintEquations, newton
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars


@dataclass(frozen=True)
class Instant:
    """A model at a random state: the numeric solver, and the values that a reader starts from."""

    solver: Dynamics
    known: Numbers


def instant(model: Model, seed: int = 0, shake: float = 0.3, *, closed: bool = False) -> Instant:
    """A state near the scene's own, random velocities, inputs, extra states; t = 0.4 s. One that is
    `closed` meets the constraints of a model whose constraints do not depend on time.
    """
    rng = np.random.default_rng([seed, 77])
    q = np.array(model.initial_q) + shake * rng.normal(size=len(model.initial_q))
    for four in model.quaternions:
        q[list(four)] /= np.linalg.norm(q[list(four)])
    v = rng.normal(size=len(model.velocities))
    inputs = {i.name: float(rng.normal()) for i in model.inputs}
    states = {x.name: float(rng.normal()) for x in model.extra}
    if closed:
        found = newton(ConstraintEquations.of(model), q, np.ones(len(v), dtype=bool))
        assert found is not None
        q = found
    values = Values(model.defaults, inputs, q.tolist(), v.tolist(), states, 0.4)
    solver = Dynamics(model, values, FloatScalars())
    if closed:
        v = np.array(solver.constrained("ldl").velocity())
        solver = Dynamics(model, replace(values, v=v.tolist()), FloatScalars())
    known: Numbers = {"t": 0.4, **model.defaults, **inputs, **states}
    known |= {c.name: float(x) for c, x in zip(model.coordinates, q, strict=True)}
    known |= {c.name: float(x) for c, x in zip(model.velocities, v, strict=True)}
    for c, motion in zip(model.prescribed, solver.given, strict=True):
        words = (c.position.name, c.velocity.name, c.velocity.acceleration)
        known |= dict(zip(words, motion, strict=True))
    known |= {of_scene(name).name: x for name, x in {**model.defaults, **inputs}.items()}
    return Instant(solver, known)


class LookedUp(dict[str, Any]):
    """Values by the names of a derivation that is only read: what is not known is looked up in its
    equations, the last that defines it first, and so on down to states, parameters and inputs.
    """

    def __init__(self, model: Model, steps: Sequence[Step], known: Numbers) -> None:
        names = reading_names(model)
        super().__init__({names.get(name, name): x for name, x in known.items()})
        self.model = model
        self.lines: dict[str, list[tuple[Equation, int]]] = {}
        for line in (line for step in steps for line in step.equations):
            for i, symbol in enumerate(_defined(line)):
                self.lines.setdefault(symbol.name, []).append((line, i))
        self._busy: set[int] = set()
        self._given = names_of_scene(model)
        self._frames = {frame.name: frame for frame in linkage_of(model).frames}

    def __missing__(self, name: str) -> Any:
        for line, i in reversed(self.lines.get(name, [])):
            if id(line) in self._busy:
                continue
            self._busy.add(id(line))
            try:
                self[name] = self._ordered(name, self._of_line(line, i))
            except KeyError:
                continue
            finally:
                self._busy.discard(id(line))
            return self[name]
        self[name] = self._ordered(name, self._by_words(name))
        return self[name]

    def _ordered(self, name: str, value: Any) -> Any:
        """Rows and columns in the order v_d, v_i, if that is the order of the equations."""
        matrix = name in ("M", "M_own")
        if not (matrix or name in ("h_0", "h_0,own")) or not {"v_d", "v_d,own"} & {*self.lines}:
            return value
        dependent = [j for _, j in self.model.pivots]
        order = [*dependent, *(j for j in range(len(value)) if j not in dependent)]
        return value[np.ix_(order, order)] if matrix else value[order]

    def _of_line(self, line: Equation, i: int) -> Any:
        if isinstance(line.left, sp.MatrixBase):
            right = line.right
            if isinstance(right, sp.MatrixBase):
                return number(list(right)[i], self)
            return float(array(right, self).ravel()[i])
        if line.right.is_Matrix:
            return array(line.right, self)
        return number(line.right, self)

    def own(self, name: str) -> Any:
        """A quantity of the derivation, which the scene may have taken the name of."""
        return self[own_name(name) if name in self._given else name]

    def _by_words(self, name: str) -> Any:
        """What the words between the equations say."""
        if own_name(name.partition(",own")[0].removesuffix("_own")) == name:
            name = name.partition(",own")[0].removesuffix("_own")
        letter, _, rest = name.partition("_")
        velocities = self.model.velocities
        free = [f for f in self._frames.values() if f.free]
        if letter in ("r^×", "c^×"):
            (x,), (y,), (z,) = self.own(f"{letter[0]}_{rest}")
            return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        if letter == "W" and "," in rest:
            body, _, place = rest.rpartition(",")
            return self.own(f"W_{body}")["xyz".index(place[0]), "xyz".index(place[1])]
        if name == "h_0" and free:
            return np.vstack([self.own(f"h_{frame.name}") for frame in free])
        if name == "M" and free:
            rows = [[self._block(a, b) for b in free] for a in free]
            return np.block(rows)
        if letter == "E" and rest in self._frames:
            own = [v.name for v in self._frames[rest].v]
            return np.array([[float(c.name == name) for c in velocities] for name in own])
        if letter == "J" and rest in ("d", "i"):
            dependent = [j for _, j in self.model.pivots]
            others = [j for j in range(len(velocities)) if j not in dependent]
            return self.own("J")[:, dependent if rest == "d" else others]
        if name == "J":
            words = [c.name.removesuffix("_dot") for c in velocities]
            return np.array(
                [[self._entry(f"J_{row},{word}") for word in words] for row, _ in self.model.rows]
            )
        raise KeyError(name)

    def _entry(self, name: str) -> float:
        return float(self[name]) if name in self.lines else 0.0

    def _block(self, a: Any, b: Any) -> Any:
        if f"M_{a.name},{b.name}" in self.lines:
            return self[f"M_{a.name},{b.name}"]
        if f"M_{b.name},{a.name}" in self.lines:
            return self[f"M_{b.name},{a.name}"].T
        return np.zeros((len(a.v), len(b.v)))


def _defined(line: Equation) -> Iterable[Any]:
    """The symbols that a line defines."""
    if isinstance(line.left, sp.MatrixBase):
        return [x for x in line.left if x.is_Symbol]
    return [line.left] if line.left.is_Symbol or isinstance(line.left, sp.MatrixSymbol) else []


def follow_effects(model: Model, effects: Sequence[DerivedEffect], known: Numbers) -> None:
    """Poses, and what each effect says."""
    needed = dict.fromkeys(body for t in effects for body in used_bodies(t))
    define(poses(linkage_of(model), needed)[0], known)
    for body in needed if model.dimensions == 3 else ():
        entries = [[known[f"W_{body},{i}{j}"] for j in "xyz"] for i in "xyz"]
        known[f"W_{body}"] = np.array(entries)
    for t in effects:
        define(t.definitions, known)
        define(t.rates, known)


def follow_recursion(model: Model, known: Numbers) -> tuple[list[float], list[float]]:
    """v̇ and F by the steps of the algorithm, in the order of v."""
    linkage = linkage_of(model)
    effects = derived_effects(model)
    follow_effects(model, effects, known)
    for step in recursive_steps(linkage, effects):
        follow(step.equations, known)
    rates: dict[str, float] = {}
    forces: dict[str, float] = {}
    for frame in (frame for frame in linkage.frames if frame.free):
        several = len(frame.a) > 1
        found: Any = known[dotted(f"omega_{frame.name}") if several else frame.a[0].name]
        rates |= zip((a.name for a in frame.a), found.ravel(), strict=True)
        forces |= zip((a.name for a in frame.a), known[f"F_{frame.name}"].ravel(), strict=True)
    names = [c.acceleration for c in model.velocities]
    return [rates[name] for name in names], [forces[name] for name in names]
