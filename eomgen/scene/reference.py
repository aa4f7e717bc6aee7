"""The reference of the scene language: each table with its keys, made from the table classes."""

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic.fields import FieldInfo

from eomgen.base.errors import SceneError, nearest
from eomgen.language.base import Table, types_of
from eomgen.language.formula import CONSTANTS, ZERO, Constant, Formula
from eomgen.language.quantity import of_any_joint
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scene.effects.contact_shapes import ContactShape
from eomgen.scene.effects.through import RopePoint
from eomgen.scene.kinds import AnyConstraint, Effect, Joint
from eomgen.scene.look import Camera, Shape
from eomgen.scene.schema import (
    BodyTable,
    ChainTable,
    Initial,
    InputTable,
    ParameterTable,
    PointTable,
    Scene,
    Simulation,
)

HEAD = """\
# Scenes: their tables, joints, effects, constraints and shapes

`eomgen reference` prints this page. It lists each key with its unit and its default; a key that is
not marked as needed may be left out. A quantity is a number, which becomes a parameter of the
generated module, or a formula in quotes: `+ - * /`, `**` with a whole number, brackets,
comparisons, `a if x < y else b`, {functions}
and {constants}. Formulas may use parameters, and further names where a key lists them: *motion*
stands for the time `t` and all coordinates, velocities, inputs and states of effects.
"""

TABLES: Mapping[str, type[Table]] = {
    "the scene itself": Scene,
    "parameters": ParameterTable,
    "inputs": InputTable,
    "bodies": BodyTable,
    "chains": ChainTable,
    "points": PointTable,
    "initial": Initial,
    "shapes of contacts": ContactShape,
    "points of ropes": RopePoint,
    "simulation": Simulation,
    "camera": Camera,
}
"""Tables other than joints, effects and shapes."""


def reference(kind: str | None = None) -> str:
    """Markdown about all tables, or about the one whose `type` is `kind`.

    Raises `SceneError` if there is none.
    """
    if kind is not None:
        known = {name: t for title, group in _groups() if title != "Tables" for name, t in group}
        if kind not in known:
            hint = nearest(kind, known) or f"; known: {', '.join(known)}"
            raise SceneError(f"no joint, effect, constraint or shape is of type '{kind}'{hint}")
        return "\n".join(_section(kind, known[kind]))
    lines = [_head()]
    for title, tables in _groups():
        lines += [f"## {title}", ""]
        for name, table in tables:
            lines += _section(name, table, "### ")
    return "\n".join(lines).rstrip() + "\n"


def reference_pages() -> dict[str, str]:
    """The same, a page for each table, by the name of its file; `index.md` leads to them."""
    lines, pages = [_head()], {}
    for title, tables in _groups():
        lines += [f"## {title}", "", "| | |", "|---|---|"]
        for name, table in tables:
            file = f"{name.replace(' ', '_')}.md"
            assert file not in pages, file
            pages[file] = "\n".join(_section(name, table)).rstrip() + "\n"
            about = inspect.cleandoc(table.__doc__ or "").partition("\n\n")[0].replace("\n", " ")
            lines.append(f"| [{name}]({file}) | {about} |")
        lines.append("")
    return {"index.md": "\n".join(lines).rstrip() + "\n", **pages}


def _head() -> str:
    functions = ", ".join(f"`{name}`" for name in FUNCTIONS)
    constants = ", ".join(f"`{name}`" for name in CONSTANTS)
    return HEAD.format(functions=functions, constants=constants)


def _groups() -> list[tuple[str, list[tuple[str, type[Table]]]]]:
    """All tables by their names, in groups with titles."""
    return [
        ("Tables", [*TABLES.items()]),
        ("Joints", [*by_type(Joint).items()]),
        ("Effects", [*by_type(Effect).items()]),
        ("Constraints", [*by_type(AnyConstraint).items()]),
        ("Shapes", [*by_type(Shape).items()]),
    ]


def by_type(union: Any) -> dict[str, type[Table]]:
    """The tables of an annotated union, by their `type`, in alphabetical order."""
    return dict(sorted(types_of(union).items()))


def _section(name: str, table: type[Table], heading: str = "# ") -> Iterator[str]:
    yield f"{heading}{name}"
    yield ""
    yield inspect.cleandoc(table.__doc__ or "")
    yield ""
    yield "| key | unit | default | what it is |"
    yield "|---|---|---|---|"
    for key, field in table.model_fields.items():
        if key != "type":
            yield "| " + " | ".join(_row(key, field)) + " |"
    yield ""
    if table.example:
        yield f"```toml{table.example}```"
        yield ""


def _row(key: str, field: FieldInfo) -> tuple[str, str, str, str]:
    marks = field.json_schema_extra
    extra: Mapping[str, Any] = marks if isinstance(marks, Mapping) else {}
    description = "its name" if key == "name" else field.description or ""
    about = re.sub(r"(<\w+>\w*)", r"`\1`", description)
    words = _words(field.annotation)
    if words:
        about += (": " if about else "") + ", ".join(f"`{word}`" for word in words)
    bounds = {"positive": "> 0", "nonnegative": ">= 0"}
    if (bound := bounds.get(str(extra.get("bound")))) is not None:
        about += f", {bound}"
    if seen := extra.get("sees"):
        about += "; formula over " + ", ".join(
            "*motion*" if word == "motion" else f"`{word}`" for word in seen
        )
    unit = re.sub(r"\*\*", "^", str(extra.get("unit", "")))
    return f"`{field.alias or key}`", of_any_joint(unit), _default(field), of_any_joint(about)


def _words(annotation: Any) -> list[str]:
    """The words of all `Literal`s in the type of a field."""
    found: list[str] = []
    for part in get_args(annotation):
        found += [part] if isinstance(part, str) else _words(part)
    return found


def _default(field: FieldInfo) -> str:
    value = field.default
    if field.is_required():
        return "needed"
    if value is None or value in ((), {}, "") or isinstance(value, Table):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Constant):
        return "0" if value == ZERO else f"{value.value:g}"
    assert not isinstance(value, Formula)
    return f"`{_written(value)}`" if isinstance(value, tuple | str) else _written(value)


def _written(value: Any) -> str:
    """A value in the notation of a scene."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_written, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
