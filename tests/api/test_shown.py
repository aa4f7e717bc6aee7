"""What functions return shows itself in a few lines, and does not change."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from notebook import cells

import eomgen
from eomgen.base.displays import MOST

SHORT = {"t_end": 0.2, "samples": 11}
MADE: dict[str, Callable[[], Any]] = {
    "read": lambda: eomgen.read("human_figure"),
    "check": lambda: eomgen.check("ragdoll"),
    "derive": lambda: eomgen.derive("cart_pole"),
    "exercise": lambda: eomgen.derive("cart_pole").exercise(),
    "generate": lambda: eomgen.generate("pendulum"),
    "simulate": lambda: eomgen.simulate("bouncing_two_body", **SHORT),
    "trajectory": lambda: eomgen.simulate("pendulum", **SHORT).trajectory,
    "view": lambda: eomgen.simulate("pendulum", **SHORT).view(),
    "grid": lambda: eomgen.grid({"theta": [0.1] * 500}),
    "ensemble": lambda: eomgen.ensemble("pendulum", eomgen.grid({"theta": [0.1] * 50}), **SHORT),
    "linearise": lambda: eomgen.linearise("cart_pole"),
    "stepper": lambda: eomgen.stepper("cart_pole", dt=0.01),
    "effects": lambda: eomgen.effects("pendulum", motion=None),
    "verify": lambda: eomgen.verify("pendulum", states=1),
    "arithmetic": lambda: eomgen.arithmetic("pendulum", states=2),
}


@pytest.mark.parametrize("name", MADE)
def test_results_show_themselves_and_are_frozen(name: str) -> None:
    """Whole numbers of lines, no more than a screen, which begin with the kind of value."""
    value = MADE[name]()
    text = repr(value)
    assert text.startswith(type(value).__name__) and len(text) <= MOST
    lines = text.splitlines()
    assert len(lines) <= 40 and all(len(line) <= 120 for line in lines)
    assert "object at 0x" not in text and (len(lines) > 1 or name == "view")
    if is_dataclass(value):
        _check_frozen(value)


def _check_frozen(value: Any) -> None:
    for field in fields(value):
        part = getattr(value, field.name)
        with pytest.raises(AttributeError):
            setattr(value, field.name, part)
        if isinstance(part, np.ndarray):
            assert not part.flags.writeable, field.name
        elif isinstance(part, dict):
            with pytest.raises(TypeError):
                part["new"] = 1


def test_matrices_and_arrays_of_others_stay_their_own() -> None:
    """Matrices of a derivation cannot be changed; an array that a user gave still can."""
    derived = eomgen.derive("pendulum")
    with pytest.raises(TypeError):
        derived.M[0, 0] = 1  # type: ignore[index]
    mine = np.array([0.1, 0.2])
    assert eomgen.grid({"theta": mine}).values.shape == (2, 1)
    mine[0] = 0.3


def test_the_tour_of_a_notebook() -> None:
    """Every cell shows something of its own: tables, equations, a figure, a page, numbers."""
    shown = cells()
    marks = ("Pole on a driven cart", "<svg", "<iframe", "<pre>", "<img", "<iframe", "A ", "ended")
    for cell, mark in zip(shown, marks, strict=True):
        assert mark in cell
