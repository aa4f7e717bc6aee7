"""The engine's text as it is read: functions, records and protocols, and the kinds they state."""

import ast
import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

NONE: Mapping[str, Any] = {}
"""The names of no module."""
ARRAYS = {"Vector": "float", "Matrix": "float", "Whole": "int"}


class NotInSubsetError(SyntaxError):
    """Text outside the subset; the message names its line."""

    def __init__(self, node: ast.AST, why: str) -> None:
        super().__init__(f"line {getattr(node, 'lineno', '?')}: {ast.unparse(node)}: {why}")


@dataclass(frozen=True)
class Kind:
    """`of` is "float", "int", "" for nothing, or the name of a record or a protocol; `sizes` are
    those of an array, as text.
    """

    of: str
    sizes: tuple[str, ...] = ()


@dataclass
class Text:
    """The engine's text: its functions, and its records and protocols, by name; and the names of
    each function's module.
    """

    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    classes: dict[str, ast.ClassDef] = field(default_factory=dict)
    modules: dict[str, Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, *modules: ModuleType) -> "Text":
        """The text of modules. Raises `NotInSubsetError` if two things have one name."""
        text = cls()
        for module in modules:
            text.add(inspect.getsource(module), vars(module))
        return text

    def add(self, source: str, module: Mapping[str, Any] = NONE) -> None:
        """Add what the source of a module defines. Raises `NotInSubsetError` if a name is there
        already.
        """
        for d in ast.parse(source).body:
            name = d.name if isinstance(d, ast.FunctionDef | ast.ClassDef) else ""
            if name in self.functions or name in self.classes:
                raise NotInSubsetError(d, "another module of the text has this name")
            if isinstance(d, ast.FunctionDef):
                self.functions[name], self.modules[name] = d, module
            elif isinstance(d, ast.ClassDef):
                self.classes[name] = d

    def fields(self, record: str) -> Mapping[str, Kind]:
        """The kinds of a record's fields; none if there is no record of that name."""
        return {
            d.target.id: kind_of(d.annotation)
            for d in self._body(record)
            if isinstance(d, ast.AnnAssign) and isinstance(d.target, ast.Name)
        }

    def given(self, protocol: str) -> Mapping[str, Kind]:
        """The kinds of what the functions of a protocol, and of those that it extends, return."""
        extended = self.classes[protocol].bases if protocol in self.classes else []
        found = [self.given(base.id) for base in extended if isinstance(base, ast.Name)]
        functions = (d for d in self._body(protocol) if isinstance(d, ast.FunctionDef))
        found.append({d.name: kind_of(d.returns) for d in functions})
        return {name: kind for each in found for name, kind in each.items()}

    def _body(self, name: str) -> list[ast.stmt]:
        return self.classes[name].body if name in self.classes else []


def own_name(name: str, known: Mapping[str, Any]) -> str:
    """That of a function which is printed for values of its `Known` parameters."""
    return "_".join([name, *(str(getattr(x, "name", x)) for x in known.values())])


def is_known(parameter: ast.arg) -> bool:
    """Whether a parameter has a value when the text is printed."""
    return isinstance(parameter.annotation, ast.Name) and parameter.annotation.id == "Known"


def kind_of(annotation: ast.expr | None) -> Kind:
    """The kind that an annotation names."""
    match annotation:
        case None | ast.Constant(None):
            return Kind("")
        case ast.Name("bool"):
            return Kind("int")
        case ast.Name(name):
            return Kind(name)
        case ast.Subscript(ast.Name("Annotated"), ast.Tuple([ast.Name(name), *sizes])):
            if name not in ARRAYS:  # a record with its size
                return Kind(name)
            return Kind(ARRAYS[name], tuple(ast.literal_eval(size) for size in sizes))
    raise NotInSubsetError(annotation, "not a kind of the subset")
