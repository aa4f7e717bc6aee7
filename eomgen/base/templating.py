"""Rendering of templates, with a check that template and context have the same names."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment

PACKAGE = Path(__file__).resolve().parent.parent


def templates_folder() -> Path:
    """The folder of all templates: inside the installed package, or beside it in a checkout."""
    inside = PACKAGE / "templates"
    return inside if inside.is_dir() else PACKAGE.parent / "templates"


@cache
def environment(folder: str, *, html: bool = False) -> "Environment":
    """The Jinja2 environment of the templates in `folder`; with `html` it escapes all values. They
    may include others as `FOLDER/NAME`.
    """
    # Imported here because some callers need the folder only and render nothing.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader([templates_folder() / folder, templates_folder()]),
        undefined=StrictUndefined,
        autoescape=html,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def render(folder: str, template: str, context: Mapping[str, object], *, html: bool = False) -> str:
    """Render `template` of `folder`.

    Raises `AssertionError`, for a fault of this program, unless `context` has exactly the names
    that the template and the files it includes read.
    """
    surroundings = environment(folder, html=html)
    wanted = _names_read(surroundings, template)
    missing, surplus = wanted - context.keys(), context.keys() - wanted
    if missing or surplus:
        raise AssertionError(
            f"template {folder}/{template} and its context differ: "
            f"missing {sorted(missing)}, surplus {sorted(surplus)}"
        )
    return surroundings.get_template(template).render(context)


@cache
def _names_read(surroundings: "Environment", template: str) -> frozenset[str]:
    """The names that `template` and the files it includes read from the context."""
    from jinja2 import meta

    assert surroundings.loader is not None
    source, _, _ = surroundings.loader.get_source(surroundings, template)
    tree = surroundings.parse(source)
    names = frozenset(meta.find_undeclared_variables(tree))
    for other in meta.find_referenced_templates(tree):
        assert other is not None, f"{template} includes a file whose name is not constant"
        names |= _names_read(surroundings, other)
    return names
