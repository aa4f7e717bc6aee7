"""Faults of relative size 1e-12 in generated modules: how many `verify` notices.

    python tests/campaigns/small_faults.py [--count N] [--seed N] [--size S] [--unchanged]

A fault multiplies one operation of the module's text, taken at random, by 1 + S: in the derivative,
the Jacobian, another output that `verify` checks, or the constants of these. What is missed is
shown with its line.

A fault that nothing can feel is drawn again, and counted: at the states that `verify` takes with
two seeds, the text is run in 60 digits with and without the fault, and no entry of any output
changes by more than its spread in random arithmetic and half an ulp. Most of these are in terms
that cancel or are multiplied by 0.

`--unchanged` verifies the modules of all built-in scenes as they are instead, and shows how near
they come to the bound of each component.
"""

import argparse
import ast
import random
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from inspect import signature
from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.dynamics.start.assembly import assembled
from eomgen.model.elaborate import elaborate, in_order
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.run.problem import FloatArray
from eomgen.scalars.extended import BY_MPFR
from eomgen.scene.reader import built_in_names, read_scene
from eomgen.store import generated_code, interfaced_program_of
from eomgen.study.precision.extended import doubles, extended, extended_digits
from eomgen.study.verification import judging, laws
from eomgen.study.verification import verify as verifying
from eomgen.study.verification.free_bodies import FreeBodies
from eomgen.study.verification.hard_states import constrained_states, hard_states
from eomgen.study.verification.roundings import NOTHING, ULP, Roundings, spread
from eomgen.study.verification.truth import Truth
from eomgen.study.whole import names_of

SCENES = (
    "two_body_forced", "cart_pole", "furuta_pendulum", "spinning_top", "car_suspension",
    "rattleback",
)  # fmt: skip
SIZE = 1e-12
KERNELS = (*verifying.OUTPUTS, "derivative", "jacobian", "constraint_forces")
RUN_STATES = 20
"""States of a scene's own run at which a fault may be felt."""
PARTS = ("each component", "jacobian, each row", "jacobian, each entry")


@cache
def text_of(scene: str) -> tuple[Model, str]:
    """The model of a scene with all outputs that are verified, and its module's text."""
    model = assembled(elaborate(read_scene(scene)))
    outputs = (*verifying.OUTPUTS, *["constraint_forces"] * bool(model.constraints))
    model = replace(model, form="velocity", outputs=in_order(outputs))
    return model, generated_code(model).module


def operations(tree: ast.Module) -> Iterator[ast.expr]:
    """The operations of the module's kernels and their constants."""
    names = [f"_{name}" for name in (*KERNELS, "fixed")]
    for function in tree.body:
        if isinstance(function, ast.FunctionDef) and function.name in names:
            for node in ast.walk(function):
                if isinstance(node, ast.BinOp | ast.Call) and _is_number(node):
                    yield node


def _is_number(node: ast.expr) -> bool:
    """Whether an operation is arithmetic: no text, and no call of what is not mathematics."""
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id in ("sin", "cos", "tan", "sqrt")
    parts = ast.walk(node)
    return not any(isinstance(x, ast.Constant) and isinstance(x.value, str) for x in parts)


def faulty(text: str, rng: random.Random, size: float) -> tuple[str, str]:
    """A module with a fault at random, and what was changed."""
    tree = ast.parse(text)
    node = rng.choice(list(operations(tree)))
    words = f"line {node.lineno}: {ast.unparse(node)}"
    wrong = ast.BinOp(node, ast.Mult(), ast.Constant(1.0 + size))
    for parent in ast.walk(tree):
        for name, value in ast.iter_fields(parent):
            if value is node:
                setattr(parent, name, wrong)
                return ast.unparse(ast.fix_missing_locations(tree)), words
            if isinstance(value, list) and any(x is node for x in value):
                value[next(i for i, x in enumerate(value) if x is node)] = wrong
                return ast.unparse(ast.fix_missing_locations(tree)), words
    raise AssertionError("an operation without a parent")


def noticed(scene: str, text: str) -> bool:
    """Whether `verify` finds a bound missed. Other routes are not compiled: they are not judged."""
    model, _ = text_of(scene)
    module: Any = load_module(text, scene)
    return bool(verifying.verify(model, read_scene(scene).simulation, module=module).missed)


# What a fault changes.


def kernels(text: str, scene: str) -> dict[str, Callable[..., Any]]:
    """The functions (t, y, u, extra) of a module's text in 60 digits, at the default parameters.
    To be called within `extended_digits()`.
    """
    module: Any = load_module(text, scene)
    vars(module).update({f: by for f, by in BY_MPFR.items() if hasattr(module, f)})
    fixed = module._fixed(*map(mpfr, module.PARAMETERS.values()))
    found = {}
    for name in KERNELS:
        kernel = getattr(module, f"_{name}", None)
        if kernel is not None:
            found[name] = partial(_called, kernel, fixed[name])
    return found


def _called(kernel: Any, k: Any, t: Any, y: Any, u: Any, extra: Any) -> Any:
    """An output in 60 digits, flat; nan where it fails."""
    more = {**BY_MPFR, "t": t}
    more = {name: more[name] for name in signature(kernel).parameters if name in more}
    try:
        return extended(kernel(y, k, u, extra, **more))
    except (ArithmeticError, ValueError):
        return extended(np.nan)


@cache
def expected(scene: str) -> list[tuple[str, list[Any], Any, FloatArray]]:
    """At the states of two seeds: the name of an output, what it takes, its value in 60 digits, and
    the change that can be felt of each entry.
    """
    model, text = text_of(scene)
    module: Any = load_module(text, scene)
    wanted, roundings = read_scene(scene).simulation, Roundings([interfaced_program_of(model)])
    nv, found = len(model.velocities), []
    right = kernels(text, scene)
    vd = np.random.default_rng(1).uniform(0.5, 0.9, nv)
    count = verifying.STATES if nv <= verifying.LARGE else verifying.FEW_STATES
    states = verifying._states(
        verifying.sampled(model, wanted, module, RUN_STATES, lambda part: None), module, model
    )
    for seed in (0, 1):
        if model.constraints:
            states += constrained_states(model, module, count, seed, wanted.t_end)
        else:
            states += hard_states(module, nv, count, seed, wanted.t_end)
    for state in states:
        y = dict(zip(names_of(model), state.y.tolist(), strict=True))
        u = [state.u.get(name, 0.0) for name in module.INPUTS]
        for name, kernel in right.items():
            extra = vd if name == "inverse_dynamics" else ()
            numbers = [y[n] for n in module.STATES], u, extra
            given = [mpfr(state.t), *(list(map(mpfr, x)) for x in numbers)]
            true = kernel(*given)
            runs = roundings.runs(name, state.t, y, state.u, *([extra] if len(extra) else []))
            felt = np.maximum(np.ravel(spread(runs)), ULP / 2 * abs(doubles(true)))
            found.append((name, given, true, felt))
    return found


def felt(scene: str, text: str) -> bool:
    """Whether a fault changes some entry of an output by more than rounding makes of it."""
    with extended_digits():
        right, wrong = expected(scene), kernels(text, scene)
        return any(
            np.any(abs(doubles(wrong[name](*given) - true)) > np.maximum(least, NOTHING))
            for name, given, true, least in right
        )


# The campaign.


def remembered() -> None:
    """Let `verify` compute what does not depend on the module once for each state."""
    kept: dict[Any, Any] = {}

    def once(function: Any, name: Any) -> Any:
        def found(*given: Any) -> Any:
            key = name(*given)
            if key not in kept:
                kept[key] = function(*given)
            return kept[key]

        return found

    def bodies(model: Model, t: Any, y: Any, u: Any, p: Any = None) -> Any:
        numbers = (t, *y, *sorted((u or {}).items()), *sorted((p or {}).items()))
        return (model.name, *map(str, numbers))

    free = once(FreeBodies, bodies)
    judging.FreeBodies = laws.FreeBodies = free  # type: ignore[attr-defined]
    Truth.extended = once(  # type: ignore[method-assign]
        Truth.extended, lambda self, t, y, u, p: ("truth", *bodies(self.model, t, y, u, p))
    )
    judging._conditions = once(  # type: ignore[assignment]
        judging._conditions, lambda free: ("conditions", id(free))
    )
    verifying.Truth = once(Truth, lambda model: model.name)  # type: ignore[misc]
    Roundings.runs = once(  # type: ignore[method-assign]
        Roundings.runs,
        lambda self, name, t, y, u, *extra: (
            self._programs[0][1].name, name, t, *y.values(), *u.items(), *np.ravel(extra).tolist()
        ),
    )  # fmt: skip


def unchanged() -> int:
    """The number of built-in scenes that miss a bound."""
    alarms = 0
    for name in built_in_names():
        scene = read_scene(name)
        found = verifying.verify(assembled(elaborate(scene)), scene.simulation)
        parts = [f"{c.what} {c.value:.2f} ({c.at})" for c in found.checks if c.what in PARTS]
        missed = [check.what for check in found.missed]
        alarms += bool(missed)
        print(f"{name}: {'; '.join(parts)}{' MISSED ' if missed else ''}{missed or ''}", flush=True)
    return alarms


def main() -> None:
    """Make faults, verify each module, and count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=float, default=SIZE)
    parser.add_argument("--unchanged", action="store_true")
    given = parser.parse_args()
    verifying.compiled = lambda *_, **__: ({}, {})  # type: ignore[assignment]
    if given.unchanged:
        sys.exit(unchanged() > 0)
    remembered()
    rng, found, again = random.Random(given.seed), 0, 0
    for k in range(given.count):
        scene = SCENES[k % len(SCENES)]
        text, words = faulty(text_of(scene)[1], rng, given.size)
        while not felt(scene, text):
            again += 1
            print(f"{scene}: drawn again: {words}", flush=True)
            text, words = faulty(text_of(scene)[1], rng, given.size)
        caught = noticed(scene, text)
        found += caught
        if not caught:
            print(f"{scene}: missed: {words}", flush=True)
        if k % 20 == 19:
            print(f"{found} of {k + 1} noticed", flush=True)
    print(f"{found} of {given.count} noticed; {again} that nothing can feel drawn again")


if __name__ == "__main__":
    main()
