"""Programs as text, and as functions over any scalars."""

import json
from collections.abc import Callable
from typing import Any

import gmpy2
import numpy as np
import pytest
from campaign import some
from engine import engine
from gmpy2 import mpfr

from eomgen.model.elaborate import elaborate
from eomgen.program.kernel import kernel
from eomgen.program.program import Program, interpret
from eomgen.program.saving import ProgramError, restored, saved
from eomgen.program.tape import TIME
from eomgen.scalars.extended import BY_MPFR, Bits
from eomgen.scene.reader import built_in_names, read_scene
from eomgen.store import program_of

SCENES = some(("bouncing_two_body", "chain_in_wind"), built_in_names())


@pytest.mark.parametrize("scene", SCENES[:: some(2, 1)])
def test_a_program_comes_back_to_the_last_bit(scene: str) -> None:
    """Steps, outputs, names, checks; and the text again is the same text."""
    program = engine(scene).system.program
    text = saved(program)
    back = restored(text)
    assert (back.steps, dict(back.outputs), back.checks) == (
        program.steps,
        dict(program.outputs),
        program.checks,
    )
    assert {**back.names} == {**program.names}
    assert saved(back) == text
    assert str(back) == str(program)


@pytest.mark.parametrize("scene", SCENES)
def test_a_kernel_takes_the_steps_of_its_program(scene: str) -> None:
    """The same bits as interpreting the program, over numbers of 113 bits."""
    made = engine(scene)
    rng = np.random.default_rng(2)
    given = {TIME: 0.3, **made.module.PARAMETERS, **made.module.INPUTS}
    given |= dict(zip(made.module.STATES, made.random_state(rng), strict=True))
    found = kernel(made.system.program, "derivative")
    with gmpy2.context(precision=113):
        values = {name: mpfr(float(x)) for name, x in given.items()}
        functions = [BY_MPFR[name] for name in found.functions]
        known = found.known_values(values, Bits())
        rates = found.moving(known, [values[name] for name in found.inputs], functions)
        assert rates == interpret(made.system.program, "derivative", values, Bits())


def changed(change: Callable[[Any], object]) -> str:
    """The text of a program with something changed in it."""
    content = json.loads(saved(engine("pendulum").system.program))
    change(content)
    return json.dumps(content)


FAULTS: dict[str, Callable[[Any], object]] = {
    "its format is not": lambda c: c.update(format="eomgen program 2"),
    "is not a finite number": lambda c: c["steps"].append(["constant", 0, 1e999]),
    "is none of the": lambda c: c["steps"].append(["neg", 2, len(c["steps"])]),
    "takes 2 operands": lambda c: c["steps"].append(["add", 2, 0]),
    "there is no operation 'exec'": lambda c: c["steps"].append(["exec", 2, 0]),
    "is not a valid Stage": lambda c: c["steps"].append(["neg", 9, 0]),
    "is not a stage": lambda c: c["steps"].append(["neg", True, 0]),
    "steps before": lambda c: c["outputs"].update(derivative=[[1], [-1]]),
    "a shape is": lambda c: c["outputs"].update(derivative=[["n"], [0]]),
    "are not a table": lambda c: c.update(outputs=[]),
    "is not a text": lambda c: c["steps"].append(["input", 2, 5]),
    "neither true nor false": lambda c: c["checks"].append(["mass", 0, 1]),
    "no program: 'steps'": lambda c: c.pop("steps"),
}


@pytest.mark.parametrize("words", FAULTS)
def test_what_was_not_saved_is_refused(words: str) -> None:
    """In one line, whatever is wrong."""
    with pytest.raises(ProgramError, match=words) as caught:
        restored(changed(FAULTS[words]))
    assert "\n" not in str(caught.value)


def test_damage_is_refused_or_is_a_program() -> None:
    """A text with a character changed: refused, or a program that is written as that text."""
    text = saved(engine("pendulum").system.program)
    rng = np.random.default_rng(3)
    for _ in range(some(300, 3000)):
        i = int(rng.integers(len(text)))
        damaged = text[:i] + str(rng.choice(list('0123456789[]{},:"ab.-'))) + text[i + 1 :]
        try:
            found = restored(damaged)
        except ProgramError:
            continue
        assert isinstance(found, Program)
    for cut in range(0, len(text), 97):
        with pytest.raises(ProgramError):
            restored(text[:cut])


def test_the_store_keeps_the_program(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the code, and recorded anew where it is damaged or not there."""
    from eomgen import pipeline, store

    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    model = elaborate(read_scene("pendulum"))
    store.generated_code(model)
    entries = sorted((tmp_path / "store").iterdir())
    assert len(entries) == 2

    def never(*_: object, **__: object) -> None:
        raise AssertionError

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "compile_program", never)
        kept = program_of(model)
    for entry in entries:
        entry.write_bytes(entry.read_bytes()[:-5])
    assert saved(program_of(model)) == saved(kept)
