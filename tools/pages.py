"""Writes the pages that are made from the program itself: `python tools/pages.py`.

docs/commands.md from the command line's own help, docs/functions.md from the docstrings of the
public functions and classes, docs/reference and eomgen/entries.pyi from the tables of scenes (see
`entry_pages.py`), the diagrams of docs/course from their scenes.
"""

import argparse
import inspect
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import MethodType
from typing import Any

from entry_pages import ENTRIES, entry_page

import eomgen
from eomgen.commands.main import parsers
from eomgen.scene.entries import stub
from eomgen.scene.reference import reference_pages
from eomgen.show.drawing import svg
from eomgen.show.sketches import mechanism_sketch

DOCS = Path(__file__).parent.parent / "docs"
BUILT_IN_LESSONS = {
    "two-bodies": "two_body",
    "many-joints": "double_pendulum",
    "loops": "four_bar",
    "space": "spinning_top",
}
LESSONS = ("particle", "body", "joint", *BUILT_IN_LESSONS, "contact")
"""The lessons of the course, and those whose mechanism is a built-in scene."""

COMMANDS = """\
# Commands

SCENE is a file or the name of a built-in scene (`eomgen list`). Exit codes: 0 done, 1 the scene or
the run is at fault, with one line on standard error that says what to do, 2 wrong usage, 130
interrupted. `eomgen COMMAND --help` prints the same text. A default is given in brackets.
"""

FUNCTIONS = """\
# Functions of the Python API

The text that `help` prints, as in `help(eomgen.simulate)`. [api.md](api.md) has examples.
"""


def commands_page() -> str:
    """The page of all commands with their options."""
    return "\n".join([COMMANDS, *(line for p in parsers()[1].items() for line in _command(*p))])


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
    """The page of all public functions and classes."""
    lines = [FUNCTIONS]
    things = [(name, getattr(eomgen, name)) for name in eomgen.__all__]
    lines += ["## Functions", ""]
    for name, function in things:
        if inspect.isfunction(function):
            lines += _entry("function", f"eomgen.{name}", function, function.__doc__)
    lines += ["## Results", "", "Their attributes and methods; all can be pickled.", ""]
    for name, each in things:
        if inspect.isclass(each) and each.__module__ != "eomgen.scene.schema":
            lines += _entry("class", f"eomgen.{name}", None, each.__doc__)
            own = (c for c in reversed(each.__mro__) if c.__module__.startswith("eomgen."))
            parts: dict[str, Any] = {}
            for owner in own:
                parts |= vars(owner)
            for part, value in parts.items():
                if part.startswith("_") and part != "__call__":
                    continue
                if isinstance(value, property):
                    lines += _entry("attribute", f"eomgen.{name}.{part}", None, value.__doc__)
                elif inspect.isfunction(value):
                    lines += _entry(
                        "method", f"eomgen.{name}.{part}", MethodType(value, each), value.__doc__
                    )
    return "\n".join(lines)


def _entry(
    kind: str, name: str, function: Callable[..., Any] | None, text: str | None
) -> list[str]:
    """A directive of the site, which indexes the name; elsewhere it reads as a block of text."""
    call = "" if function is None else _call(function)
    about = inspect.cleandoc(text or "")
    return [f"````{{py:{kind}}} {name}{call}", "```text", about, "```", "````", ""]


def _call(function: Callable[..., Any]) -> str:
    """All arguments with their defaults."""
    signature = inspect.signature(function)
    bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
    return str(signature.replace(parameters=bare, return_annotation=signature.empty))


def _of_reference(name: str) -> str:
    entry = name.removesuffix(".md")
    return entry_page(entry) if entry in ENTRIES else reference_pages()[name]


def reference_index() -> str:
    """The page that leads to the tables, with what the site needs to find them."""
    pages = reference_pages()
    listed = [name.removesuffix(".md") for name in pages if name != "index.md"]
    fence = ["```{toctree}", ":hidden:", "", *listed, "```", ""]
    return pages["index.md"] + "\n" + "\n".join(fence)


def lesson_scene(name: str) -> str:
    """The scene of a lesson of the course: the text of its first file, or a built-in name."""
    page = (DOCS / "course" / f"{name}.md").read_text("utf-8")
    if name in BUILT_IN_LESSONS:
        return BUILT_IN_LESSONS[name]
    return _first_scene(page)


def lesson_sketch(name: str) -> str:
    """The diagram of a lesson: its mechanism at the start."""
    return _sketch(lesson_scene(name))


def crane_sketch() -> str:
    """The diagram of the tutorial's first scene."""
    return _sketch(_first_scene((DOCS / "tutorial.md").read_text("utf-8")))


def _first_scene(page: str) -> str:
    return page.split("```toml\n", 1)[1].split("```", 1)[0]


def _sketch(scene: str) -> str:
    drawn = svg(mechanism_sketch(eomgen.check(scene), ()))
    drawn = drawn.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    return drawn.replace("var(--paper)", "#fff") + "\n"


PAGES: dict[str, Callable[[], str]] = {
    "commands.md": commands_page,
    "functions.md": functions_page,
    **{f"reference/{name}": partial(_of_reference, name) for name in reference_pages()},
    "reference/index.md": reference_index,
    "../eomgen/entries.pyi": stub,
    "pictures/crane.svg": crane_sketch,
    **{f"course/{name}.svg": partial(lesson_sketch, name) for name in LESSONS},
}

if __name__ == "__main__":
    (DOCS / "reference").mkdir(exist_ok=True)
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), "utf-8")
