"""Faults of relative size 1e-12 in generated modules: how many `verify` notices.

    python tests/campaigns/small_faults.py [--count N] [--seed N] [--size S] [--unchanged]

A fault multiplies one operation of the module's text, taken at random, by 1 + S: in the derivative,
the Jacobian, another output that `verify` checks, or the constants of these. What is missed is
shown with its line. `--unchanged` verifies the modules of all built-in scenes as they are instead,
and shows how near they come to the bound of each component.
"""

import argparse
import ast
import random
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from eomgen.dynamics.assembly import assembled
from eomgen.model.elaborate import elaborate, in_order
from eomgen.model.model import Model
from eomgen.run.module import load_module
from eomgen.scene.reader import built_in_names, read_scene
from eomgen.store import generated_code
from eomgen.study.verification import judging, laws
from eomgen.study.verification import verify as verifying
from eomgen.study.verification.roundings import Roundings
from eomgen.study.verification.truth import Truth
from eomgen.study.verification.virtual_work import FreeBodies

SCENES = (
    "two_body_forced", "cart_pole", "furuta_pendulum", "spinning_top", "car_suspension",
    "rattleback",
)  # fmt: skip
SIZE = 1e-12
PARTS = ("each component", "jacobian, each row")


@cache
def text_of(scene: str) -> tuple[Model, str]:
    """The model of a scene with all outputs that are verified, and its module's text."""
    model = assembled(elaborate(read_scene(scene)))
    outputs = (*verifying.OUTPUTS, *["constraint_forces"] * bool(model.constraints))
    model = replace(model, form="velocity", outputs=in_order(outputs))
    return model, generated_code(model).module


def operations(tree: ast.Module) -> Iterator[ast.expr]:
    """The operations of the module's kernels and their constants."""
    kernels = [f"_{name}" for name in (*verifying.OUTPUTS, "derivative", "jacobian", "fixed")]
    for function in tree.body:
        if isinstance(function, ast.FunctionDef) and function.name in kernels:
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
    rng, found = random.Random(given.seed), 0
    for k in range(given.count):
        scene = SCENES[k % len(SCENES)]
        text, words = faulty(text_of(scene)[1], rng, given.size)
        caught = noticed(scene, text)
        found += caught
        if not caught:
            print(f"{scene}: missed: {words}", flush=True)
        if k % 20 == 19:
            print(f"{found} of {k + 1} noticed", flush=True)
    print(f"{found} of {given.count} noticed")


if __name__ == "__main__":
    main()
