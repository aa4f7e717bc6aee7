"""How the command line looks: its parser, and help with defaults."""

import argparse
from collections.abc import Callable, Collection, Sequence
from dataclasses import Field
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from eomgen.base.errors import nearest
from eomgen.base.options import Option, check_options, flag_of, options_of
from eomgen.base.text import breaks_lines, one_line
from eomgen.base.version import __version__


def path(text: str) -> Path:
    """An argument that is a path; its name has no control characters."""
    if breaks_lines(text):
        raise argparse.ArgumentTypeError(f"{text} has a control character in its name")
    return Path(text)


T = TypeVar("T")
NUMBERS: dict[Any, type] = {float: float, float | None: float, int: int, int | None: int}
VALUES = {float: "X", int: "N"}
"""What stands for a number without a unit."""


def add_options(
    parser: argparse.ArgumentParser, record: Any, names: Collection[str] | None = None
) -> None:
    """Add the options of a record to a parser, or those of some names, unless it has them."""
    groups: dict[str, argparse._MutuallyExclusiveGroup] = {}
    there = {action.dest for action in parser._actions}
    every = options_of(record)
    for each in sorted(every, key=lambda each: each.name in ("output", "force")):
        known = every[each]
        if not (flags := flag_of(each).split()) or each.name in there:
            continue
        if names is not None and each.name not in names:
            continue
        place: Any = parser
        if known.apart:
            if known.apart not in groups:
                groups[known.apart] = parser.add_mutually_exclusive_group()
            place = groups[known.apart]
        if flags[0][0] == "-":
            place.add_argument(*flags, dest=each.name, **_reading(each, known))
        else:
            place.add_argument(each.name, **{**_reading(each, known), "metavar": flags[0]})


def _reading(each: "Field[Any]", known: Option) -> dict[str, Any]:
    """How the command line reads an option: the arguments of `add_argument`."""
    text = known.help or f"{known.about}{f' ({known.none})' if known.none else ''}"
    found: dict[str, Any] = {"help": text, "default": each.default}
    if each.type is bool:
        return {**found, "action": "store_true"}
    if each.type == bool | None:
        return {**found, "action": argparse.BooleanOptionalAction}
    if known.alone and not known.count:
        return {**found, "action": "store_const", "const": known.alone}
    kind: Any = each.type
    number = NUMBERS.get(kind)
    value = known.value or known.unit.upper() or VALUES.get(number or str, "NAME")
    if known.choices and not known.value:
        found["choices"] = known.choices
    else:
        found["metavar"] = value
    if value.startswith("NAME=") or known.count == "many":
        found |= {"action": "append", "default": []}
    elif known.count:
        found |= {"nargs": known.count, "const": known.alone}
    reads = path if value.startswith(("FILE", "DIR", "PATH")) else number
    return {**found, "type": known.read or reads}


def taken(record: Callable[..., T], given: argparse.Namespace, **own: Any) -> T:
    """The record of the options of a command, with some values of its `own`.

    Raises `RunError` for a value that an option may not have.
    """
    names = {each.name: flag_of(each) for each in options_of(record)}
    found = {name: getattr(given, name) for name in names if hasattr(given, name)}
    options = record(**{**found, **own})
    check_options(options, lambda name: (names[name].split() or [name])[-1])
    return options


class Version(argparse.Action):
    """Prints the version."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(f"eomgen {__version__}")
        parser.exit()


class Help(argparse.RawDescriptionHelpFormatter):
    """Help that states the default of each option that has one, unless its text does."""

    def _get_help_string(self, action: argparse.Action) -> str:
        text, default = action.help or "", action.default
        if default in (None, False, "", (), argparse.SUPPRESS) or default == []:
            return text
        return f"{text} (default: %(default)s)"


class Parser(argparse.ArgumentParser):
    """A parser whose error messages stay on one line, whatever the arguments contain."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"formatter_class": Help, **options})

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As that of argparse, with a hint at an option that is known and similar."""
        given, left = self.parse_known_args(args, namespace)
        if left:
            command = getattr(given, "parser_of_command", self)
            known = [text for action in command._actions for text in action.option_strings]
            hints = [nearest(word.partition("=")[0], known) for word in left if word[:1] == "-"]
            self.error(f"unrecognized arguments: {' '.join(left)}{''.join(hints)}")
        return given

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = list(map(str, action.choices))
            hint = nearest(str(value), names) or f"; known: {', '.join(names)}"
            raise argparse.ArgumentError(action, f"no '{value}'{hint}")

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))
