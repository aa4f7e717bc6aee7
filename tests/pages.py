"""Writes the pages that are made from the program itself: `python tests/pages.py`.

docs/commands.md from the command line's own help, docs/functions.md from the docstrings of the
public functions.
"""

import argparse
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import eomgen
from eomgen.cli import command_parsers

DOCS = Path(__file__).parent.parent / "docs"

COMMANDS = """\
# Commands

SCENE is a file or the name of a built-in scene (`eomgen list`). Exit codes: 0 done, 1 the scene or
the run is at fault, with one line on standard error that says what to do, 2 wrong usage, 130
interrupted. `eomgen COMMAND --help` prints the same text. A default is given in brackets.
"""

FUNCTIONS = """\
# Functions of the Python API

The text that `help` prints for each function, as in `help(eomgen.simulate)`. [api.md](api.md) has
examples.
"""


def commands_page() -> str:
    """The page of all commands with their options."""
    return "\n".join([COMMANDS, *(line for p in command_parsers() for line in _command(*p))])


def _command(name: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    yield from (f"## {name}", "", _sentence(parser.description or ""), "")
    if parser.epilog:
        yield from ("```console", parser.epilog.removeprefix("example: "), "```", "")
    rows = [_option(action) for action in parser._actions if action.dest != "help"]
    if rows:
        yield from ("| option | what it is |", "|---|---|", *rows, "")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _option(action: argparse.Action) -> str:
    value = action.metavar or ("|".join(map(str, action.choices)) if action.choices else "")
    if isinstance(value, tuple):
        value = " ".join(value)
    value = "" if action.nargs == 0 else value
    names = [f"{name} {value}".strip() for name in action.option_strings] or [value or action.dest]
    text = (action.help or "") % {**vars(action), "prog": "eomgen"}
    cells = ", ".join(f"`{name}`" for name in names), text
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def functions_page() -> str:
    """The page of all public functions."""
    lines = [FUNCTIONS]
    for name in eomgen.__all__:
        function = getattr(eomgen, name)
        if inspect.isfunction(function):
            text = inspect.cleandoc(function.__doc__ or "")
            lines += [f"## {name}", "", "```text", *_call(name, function), "", text, "```", ""]
    return "\n".join(lines)


def _call(name: str, function: Callable[..., Any]) -> Iterator[str]:
    """A call with all arguments and their defaults, an argument a line."""
    yield f"{name}("
    by_name = False
    for argument in inspect.signature(function).parameters.values():
        if argument.kind is argument.KEYWORD_ONLY and not by_name:
            by_name = True
            yield "    *,"
        yield f"    {argument.replace(annotation=argument.empty)},"
    yield ")"


PAGES = {"commands.md": commands_page, "functions.md": functions_page}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), "utf-8")
