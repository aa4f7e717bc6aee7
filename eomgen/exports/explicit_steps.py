"""Steps of equal length in exported C, by the explicit methods of the engine."""

from typing import Any

from eomgen.codegen.backends import c
from eomgen.codegen.interface import Interface
from eomgen.engine.explicit import EULER, LEAPFROG_4, LEAPFROG_6, RUNGE_KUTTA_4
from eomgen.engine.printed import text
from eomgen.errors import RunError, nearest
from eomgen.model.model import Model
from eomgen.run.integrators.leapfrog import split_of
from eomgen.run.module import as_problem, load_module
from eomgen.store import generated_code
from eomgen.subset.braces import printed
from eomgen.subset.languages import Language
from eomgen.templating import render

_AT = "system, t, y, h, step"
_SPLIT = "&(Split){ (int64_t *)positions, (int64_t *)others, (%s *)rates }"
_LEAPFROG = f"leapfrog(system, {_SPLIT}, t, y, h, step)"
_STEPS: dict[str, tuple[Any, str]] = {
    "euler": (("runge_kutta", {"method": EULER}), f"runge_kutta_euler({_AT})"),
    "semi_implicit_euler": (
        ("semi_implicit_euler", {}),
        "semi_implicit_euler(system, positions, t, y, h, step)",
    ),
    "leapfrog": (("leapfrog", {}), _LEAPFROG),
    "leapfrog_4": (("composed", {"of": LEAPFROG_4}), f"composed_leapfrog_4({_AT})"),
    "leapfrog_6": (("composed", {"of": LEAPFROG_6}), f"composed_leapfrog_6({_AT})"),
    "rk4": (("runge_kutta", {"method": RUNGE_KUTTA_4}), f"runge_kutta_rk4({_AT})"),
}
EXPLICIT = tuple(_STEPS)
"""The methods."""


def context(
    name: str, model: Model, interface: Interface, language: Language, *more: str
) -> dict[str, Any]:
    """C of steps by a method, `explicit_step`, with `more` functions of the engine; the number of
    positions.

    Raises `RunError` if there is no such method, or if it cannot make steps of the model.
    """
    if name not in _STEPS:
        raise RunError(
            f"integrator: '{name}' makes no steps of exported code{nearest(name, EXPLICIT)}; "
            f"these do: {', '.join(EXPLICIT)}"
        )
    root, call = _STEPS[name]
    number, splits = language.number, name.startswith("leapfrog")
    composed = root[0] == "composed"
    states = list(enumerate(interface.states))
    roots = [root, *((other, {}) for other in (*more, *["leapfrog"] * composed))]
    positions = [i for i, state in states if state.position]
    values = {
        "steps": printed(text(), roots, language),
        "number": number,
        "call": call.replace("%s", number),
        "parts": _LEAPFROG.replace("%s", number) if composed else "",
        "positions": positions,
        "others": [i for i, state in states if not state.position] if splits else [],
        "rates": _rates(model, interface, language) if splits else [],
    }
    step = render(c.TEMPLATES, "explicit_step.c.jinja", values)
    return {"explicit_step": step, "positions": len(positions)}


def _rates(model: Model, interface: Interface, language: Language) -> list[str]:
    """The constant matrix by which velocities move positions."""
    if interface.projected or model.form != "velocity":
        raise RunError(
            "integrator: leapfrog of exported code needs velocities as states and no loops; "
            "take rk4"
        )
    problem = as_problem(load_module(generated_code(model).module))
    try:
        rates = split_of(problem).rates
    except RunError as error:
        raise RunError(f"{str(error).partition(';')[0]}; take rk4") from None
    return [language.literal.format(repr(x)) for x in rates.ravel().tolist()]
