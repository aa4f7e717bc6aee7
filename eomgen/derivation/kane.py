"""Kane's method for a small tree: its partial velocities, and the power of inertia in them."""

from collections.abc import Iterator

import sympy as sp

from eomgen.derivation.projected.derive import ProjectedEquations
from eomgen.derivation.projected.steps import read_step, still_symbols
from eomgen.derivation.reading import short_name
from eomgen.derivation.steps import Pairs, Step
from eomgen.derivation.symbols import Expr

PARTIAL = (
    "The motion of each body while one velocity is 1 and all others are 0, in its axes: ω and u "
    "with this velocity as index. Those that are not written are 0."
)
POWER = (
    "Z is the power of the forces of inertia in the partial velocities, for each velocity the sum "
    "of m a·u + (I α + ω × I ω)·ω over the bodies. Forces in the joints have no power there."
)


def kane_written(equations: ProjectedEquations) -> Iterator[Step]:
    """The steps before the equations of motion."""
    plane = equations.model.dimensions == 2
    s, model = equations.symbols, equations.model
    still = still_symbols(equations)
    words = [short_name(v.name) for v in s.v]
    partial: Pairs = []
    power = [equations.tree.armatures.get(j, sp.S.Zero) * a for j, a in enumerate(s.a)]
    for k, motion in enumerate(equations.motions):
        body, c, own = model.bodies[k], equations.constraints[k], equations.tree.bodies[k]
        omega, alpha, a = (
            x.xreplace(still) for x in (c.own.omega, c.own.alpha, c.own.acceleration)
        )
        turned = own.inertia * alpha + omega.cross(own.inertia * omega)
        for letter, motions, force, planar in (
            ("omega", motion.partial_omegas, turned, slice(2, 3)),
            ("u", motion.partial_velocities, own.mass * a, slice(0, 2)),
        ):
            for j, along in motions.items():
                power[j] += along.dot(force)
                shown = along[planar, :] if plane else along
                value: Expr = shown[0] if len(shown) == 1 else shown
                partial.append((sp.Symbol(f"{letter}_{body.name},{words[j]}"), value))
    lines = [(sp.Symbol(f"Z_{word}"), x) for word, x in zip(words, power, strict=True)]
    for title, about, pairs in (
        ("Partial velocities", PARTIAL, partial),
        ("The power of inertia", POWER, lines),
    ):
        yield read_step(equations, Step.of("balance", title, about, pairs), moving=True)
