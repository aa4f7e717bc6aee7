"""Records of options, and functions that take one.

A record is a frozen dataclass. Each option is a field `name: type = option(default, "what it is")`
that holds all that is known of it. The signature and the docstring of the function that takes the
record come from there, and so do the command, its completion and the pages of reference.
"""

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import cache, wraps
from inspect import Parameter, Signature, cleandoc
from typing import Any, ParamSpec, TypeVar

from eomgen.base.errors import RunError

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
Called = Callable[[str], str]
"""The name of an option in messages: `t_end` is `--t-end` on the command line."""
WIDTH = 96


@dataclass(frozen=True)
class Option:
    """What is known of an option beside its name, its type and its default.

    about    what it is
    unit     of its number
    none     what None stands for
    help     what the command line says it is; "" for `about`
    flag     on the command line; "" for `--name`, None if it has none there
    value    what stands there for a value, NAME for example; "" for one by type and unit, or
             `choices`. FILE, DIR and the like are paths
    choices  the values that it may have; () for any
    check    raises `RunError` for a value that it may not have, None aside; called with the value
             and the name of the option
    read     its value of a text of the command line
    alone    its value if the flag has none; None if it needs one
    count    how many values it has there: "?", "+", or "many" if the flag may be repeated
    apart    options with the same word exclude one another
    """

    about: str = ""
    unit: str = ""
    none: str = ""
    help: str = ""
    flag: str | None = ""
    value: str = ""
    choices: Sequence[str] = ()
    check: Callable[[Any, str], None] | None = None
    read: Callable[[str], Any] | None = None
    alone: Any = None
    count: str = ""
    apart: str = ""

    @property
    def words(self) -> str:
        """What it is, with its unit, its values and what None stands for."""
        unit = f", {self.unit}" if self.unit else ""
        known = all(name in self.about for name in self.choices)
        one = "" if known else f"; one of {', '.join(self.choices)}"
        return f"{self.about}{unit}{one}{f'; None: {self.none}' if self.none else ''}"


def about(*words: Any, **more: Any) -> Mapping[str, Option]:
    """What is known of an option, as the metadata of a field without a default."""
    return {"option": Option(*words, **more)}


def option(default: Any, *words: str, **more: Any) -> Any:
    """A field with its default, and what is known of it: the arguments of `Option`."""
    return field(default=default, metadata=about(*words, **more))


def options_of(record: Any) -> "Mapping[Field[Any], Option]":
    """The options of a record, or of a kind of these, in their order."""
    return _of_kind(record if isinstance(record, type) else type(record))


@cache
def _of_kind(record: Any) -> "Mapping[Field[Any], Option]":
    return {each: each.metadata["option"] for each in fields(record) if each.metadata}


def flag_of(each: "Field[Any]") -> str:
    """The flag of an option on the command line; "" if it has none."""
    flag: str | None = each.metadata["option"].flag
    return f"--{each.name.replace('_', '-')}" if flag == "" else flag or ""


def check_options(options: Any, called: Called = str) -> None:
    """Raise `RunError` for a value that an option of a record may not have."""
    for each, known in options_of(options).items():
        value = getattr(options, each.name)
        if value is not None and known.choices and value not in known.choices:
            names = ", ".join(known.choices)
            raise RunError(f"{called(each.name)}: '{value}' is not one of {names}")
        if value is not None and known.check:
            known.check(value, called(each.name))


def taking(record: Callable[P, T]) -> Callable[[Callable[[T], R]], Callable[P, R]]:
    """A function of a record as a function of its fields, by name.

    Fields of a record that are no options may also be given by position. The list of the options
    follows the first paragraph of the docstring.
    """

    def of(function: Callable[[T], R]) -> Callable[P, R]:
        returned = Signature.from_callable(function).return_annotation
        signature = Signature(list(_parameters(record)), return_annotation=returned)

        @wraps(function)
        def taken(*args: P.args, **named: P.kwargs) -> R:
            try:
                options = record(*args, **named)
            except TypeError:
                signature.bind(*args, **named)  # says of which function an argument is missing
                raise
            check_options(options)
            return function(options)

        head, _, rest = cleandoc(function.__doc__ or "").partition("\n\n")
        taken.__doc__ = "\n\n".join(filter(None, (head, _listed(record), rest)))
        taken.__signature__ = signature  # type: ignore[attr-defined]
        return taken

    return of


def _parameters(record: Any) -> Iterator[Parameter]:
    """The parameters of a function of a record's fields."""
    for each in sorted(fields(record), key=lambda each: each.kw_only is True):
        kind = Parameter.KEYWORD_ONLY if each.kw_only else Parameter.POSITIONAL_OR_KEYWORD
        default = Parameter.empty if each.default is MISSING else each.default
        yield Parameter(each.name, kind, default=default, annotation=each.type)


def _listed(record: Any) -> str:
    """A line or more for each option: its name and what it is."""
    every = options_of(record)
    width = max(len(each.name) for each in every) + 2
    return "\n".join(
        line
        for each, known in every.items()
        for line in textwrap.wrap(
            known.words,
            WIDTH,
            initial_indent=each.name.ljust(width),
            subsequent_indent=" " * width,
            break_long_words=False,
            break_on_hyphens=False,
        )
    )
