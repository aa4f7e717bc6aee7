"""The Taylor series of a program's solutions, for places that have its functions."""

from dataclasses import replace

from eomgen.base.errors import RunError
from eomgen.codegen.interface import Function, Interface
from eomgen.program.program import Output, Program
from eomgen.program.taylor import NoSeriesError, Recurrences, recurrences
from eomgen.program.taylor_text import SeriesText, series_text
from eomgen.subset.languages import Language

FIXED = "fixed"
"""The function of what the recurrences need that depends on parameters and inputs alone."""


def recurrences_of(program: Program, interface: Interface) -> Recurrences:
    """The recurrences of a program. Raises `RunError` if its solutions have no Taylor series."""
    try:
        return recurrences(program, [state.name for state in interface.states])
    except NoSeriesError as function:
        raise RunError(
            f"integrator: Taylor series need smooth forces, but those of '{interface.name}' use "
            f"{function}; take --integrator DOP853"
        ) from None


def with_series(program: Program, interface: Interface) -> tuple[Program, Interface, SeriesText]:
    """The text of the recurrences of a program, and the program with the function `FIXED`. Raises
    `RunError` as `recurrences_of`.
    """
    system = recurrences_of(program, interface)
    text = series_text(system, [state.name for state in interface.states])
    fixed = Output((len(system.fixed),), tuple(system.fixed))
    about = "What the recurrences of Taylor series need of parameters and inputs."
    function = Function(FIXED, about, fixed.shape, (), False, False)
    return (
        replace(program, outputs={**program.outputs, FIXED: fixed}),
        replace(interface, functions=(*interface.functions, function)),
        text,
    )


def series_functions(text: SeriesText, language: Language) -> str:
    """The source of the recurrences, `first_coefficients` and `next_coefficients`."""
    # Imported here because the printer takes a while.
    from eomgen.subset.printing import printed
    from eomgen.subset.text import Text

    functions = Text()
    functions.add(text.source)
    return printed(functions, [(name, {}) for name in functions.functions], language)
