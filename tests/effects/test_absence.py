"""Absence is free: a scene without an effect knows nothing of it, and an effect brings no more
than it needs.
"""

import ast
import symtable
import typing
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pytest
from bookkeeping import ENERGIES, compiled_light, light
from campaign import FULL
from effect_cases import BASES, CASES, TRIED, Case
from engine import Engine, text_of

from eomgen.codegen.backends.python import OWN
from eomgen.model.elaborate import elaborate
from eomgen.scene.effects import Effect
from eomgen.scene.reader import parse_scene
from eomgen.study.cost.variants import removed, without_effects

GENERATED = Path(__file__).parent.parent.parent / "generated"


@cache
def without(base: str) -> Engine:
    """A scene that never had an effect, from a text of its own."""
    return compiled_light(parse_scene(BASES[base].format(outputs="")))


@pytest.mark.every(8)
@pytest.mark.parametrize("case", TRIED, ids=lambda case: case.name)
def test_absence_is_free(case: Case) -> None:
    """With the effect the module is another, full of what it brings; without it, all that a module
    is made from is that of a scene that never had it; so is what `eomgen effects` compares with.
    """
    scene, made, bare = parse_scene(case.text()), light(case.text()), without(case.base)
    never = removed(scene, scene.effects).replaced(outputs=ENERGIES)
    assert elaborate(never) == bare.model
    if FULL:  # the bytes follow from that
        assert compiled_light(removed(scene, scene.effects)).source == bare.source
    (variant,) = without_effects(scene)
    assert variant.model == replace(bare.model, outputs=("body_poses",))
    kind = scene.effects[0].type
    assert "marker" in made.source and "marker" not in bare.source
    assert f"Effects: {kind}." in made.source and kind not in bare.source
    check_tidy(made.source)
    check_added(made.module, bare.module)


@pytest.mark.every(2)
@pytest.mark.parametrize("base", ["plane", "space"])
def test_absence_of_many(base: str) -> None:
    """The same, byte for byte, of whole modules, Jacobian and all, and of many effects at once."""
    tables = [case.table for case in CASES if case.base == base][:: 3 if base == "plane" else 16]
    named = [t.replace("marker", f"marker{i}") for i, t in enumerate(tables) if "driven" not in t]
    bare = BASES[base].format(outputs='outputs = ["potential_energy"]')
    scene = parse_scene(bare + "".join(f"[[effects]]\n{table}\n" for table in named))
    assert len(scene.effects) > 3
    check_tidy(text_of(scene))
    assert text_of(removed(scene, scene.effects)) == text_of(parse_scene(bare))
    first, *others = scene.effects
    alone = text_of(removed(scene, others))
    assert alone == text_of(parse_scene(f"{bare}[[effects]]\n{named[0]}"))
    assert removed(scene, others).effects == (first,)


def check_added(more: Any, less: Any) -> None:
    """What one module has more than another is named after the effect, but for operations."""
    for table in ("PARAMETERS", "INPUTS", "STATES", "UNITS"):
        there, before = getattr(more, table), getattr(less, table)
        kept = [name for name in there if name in before]
        driven = [name for name in before if name not in there]  # is no state any more
        assert all(name.startswith(("q", "s")) for name in driven)
        assert "driven" in more.EFFECTS or not driven
        assert kept == [name for name in before if name in there]
        assert all(name.startswith("marker") for name in there if name not in before)
    assert less.EFFECTS == less.EFFECT_NAMES == ()
    assert more.EFFECT_NAMES == ("marker",)


def check_tidy(source: str) -> None:
    """Everything that a module imports, defines and computes is used."""
    tree, table = ast.parse(source), symtable.symtable(source, "module", "exec")
    used = names_used(table)
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            unused = {alias.name for alias in node.names} - used
            assert not unused, unused
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_COLUMNS":
            unused = {key.value for key in node.value.keys} - used
            assert not unused, unused
    scopes = {scope.get_name(): scope for scope in table.get_children()}
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            if node.name.startswith("_"):
                assert node.name in used, node.name
                check_kernel(node, scopes[node.name])
            assert node.name not in OWN or node.name in used, node.name


def names_used(scope: symtable.SymbolTable) -> set[str]:
    """The names that are read in a scope or within it."""
    used = {symbol.get_name() for symbol in scope.get_symbols() if symbol.is_referenced()}
    return used.union(*map(names_used, scope.get_children()))


def check_kernel(function: ast.FunctionDef, scope: symtable.SymbolTable) -> None:
    """Every value of a function is used in it."""
    made = {symbol.get_name() for symbol in scope.get_symbols() if symbol.is_assigned()}
    used = names_used(scope)
    assert made <= used | {"_"}, (function.name, made - used)


SMALL = sorted(p.stem for p in GENERATED.glob("*.py") if p.stat().st_size < 200_000)


@pytest.mark.parametrize("name", SMALL)
def test_nothing_unused_in_generated_modules(name: str) -> None:
    """Not in the committed ones either; larger ones are more of the same."""
    assert len(SMALL) > 10
    check_tidy((GENERATED / f"{name}.py").read_text("utf-8"))


def test_the_check_finds_what_is_unused() -> None:
    """An import, a helper, a value more: each is found."""
    source = text_of(parse_scene(CASES[0].text()))
    check_tidy(source)
    for old, new in (
        ("import cos", "import atan, cos"),
        ("@lru_cache", "def step(x):\n    return x\n\n\n@lru_cache"),
        ("_COLUMNS = {", '_COLUMNS = {\n    "tan": np.tan,'),
        ("    return (\n", "    unused = 1.0\n    return (\n"),
    ):
        assert old in source
        with pytest.raises(AssertionError):
            check_tidy(source.replace(old, new))


# Nothing is missing here.


def literals(annotation: Any) -> list[str]:
    """The words that a field may be."""
    if typing.get_origin(annotation) is typing.Literal:
        return list(get_args(annotation))
    return [word for part in get_args(annotation) for word in literals(part)]


@pytest.mark.parametrize("effect", get_args(get_args(Effect)[0]), ids=lambda e: e.__name__)
def test_every_effect_has_its_cases(effect: Any) -> None:
    """In the plane and in space, with every key that it has, and every word that one may be."""
    (kind,) = get_args(effect.model_fields["type"].annotation)
    cases = {
        base: [
            parse_scene(case.text()).effects[0]
            for case in CASES
            if case.base == base and f'type = "{kind}"' in case.table
        ]
        for base in ("plane", "space")
    }
    for base, tables in cases.items():
        assert tables, f"{kind} has no case in {base}: add one to tests/effect_cases.py"
    tables = [*cases["plane"], *cases["space"]]
    for field, info in effect.model_fields.items():
        given = [getattr(table, field) for table in tables if field in table.model_fields_set]
        assert given, f"{kind}.{field} has no case: add one to tests/effect_cases.py"
        for word in literals(info.annotation):
            assert word in given, f"{kind}.{field} = {word!r} has no case"
