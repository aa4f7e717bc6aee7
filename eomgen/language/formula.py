"""The safe expression reader: a formula of a scene becomes a small tree, and nothing is executed.

Python's own parser splits the text; only the nodes, functions and names listed here pass. The tree
is evaluated over any scalars: floats, SymPy expressions, the nodes of a program.
"""

import ast
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

LONGEST_TEXT = 500
DEEPEST = 150
LARGEST_POWER = 16
FUNCTIONS = {
    **dict.fromkeys(("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "tanh"), 1),
    **dict.fromkeys(("sqrt", "abs", "step"), 1),
    **dict.fromkeys(("atan2", "min", "max"), 2),
    "select": 3,
}
"""Functions of a formula, with how many arguments each takes.

`step(x)` is 1 where x > 0 and else 0; `select(c, a, b)` is a where c > 0 and else b, which is also
what comparisons and `a if x < y else b` become.
"""
CONSTANTS = {"pi": math.pi}
_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}


_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


class FormulaError(ValueError):
    """A text that is no formula; says what is wrong and at which column."""


@dataclass(frozen=True)
class Constant:
    """A number as it stands in the scene."""

    value: float


@dataclass(frozen=True)
class Name:
    """A named parameter."""

    name: str


@dataclass(frozen=True)
class Apply:
    """An operator (`+ - * / **`, `neg`) or function applied to formulas."""

    operation: str
    operands: tuple["Formula", ...]


Formula = Constant | Name | Apply
ZERO = Constant(0.0)


class Scalars(Protocol):
    """What a formula needs of the scalars it is evaluated over, besides + - * / and unary minus."""

    def number(self, value: float) -> Any:
        """The scalar that stands for a float."""

    def call(self, function: str, *arguments: Any) -> Any:
        """One of `FUNCTIONS` of scalars."""


class Floats:
    """Plain floats as scalars."""

    def number(self, value: float) -> float:
        """Return the value itself."""
        return value

    def call(self, function: str, *arguments: float) -> float:
        """Return the function's value, by `math`."""
        return float(BY_MATH[function](*arguments))


BY_MATH: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    "abs": math.fabs,
    "step": lambda x: 1.0 if x > 0.0 else 0.0,
    "min": min,
    "max": max,
    "select": lambda c, a, b: a if c > 0.0 else b,
}


def parse(text: str) -> Formula:
    """Read a formula: numbers, names, `+ - * / **` (small whole powers), sin, cos, tan, sqrt, pi.

    Raises `FormulaError`, naming the column, for anything else.
    """
    if len(text) > LONGEST_TEXT:
        raise FormulaError(f"is longer than {LONGEST_TEXT} characters")
    if not text.isascii():
        column = next(i for i, c in enumerate(text) if not c.isascii()) + 1
        raise FormulaError(f"has a character at column {column} that is not plain ASCII")
    try:
        with warnings.catch_warnings():  # of Python about what is no Python of ours
            warnings.simplefilter("ignore")
            tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise FormulaError("is no formula; write for example '2*m_A' or 'l_A/2'") from None
    return _read(tree.body, 0)


def _read(node: ast.expr, depth: int) -> Formula:
    at = f"at column {node.col_offset + 1}"
    if depth > DEEPEST:
        raise FormulaError(f"is nested deeper than {DEEPEST}")
    match node:
        case ast.Constant(value=bool()):
            raise FormulaError(f"has a truth value {at} where a number is wanted")
        case ast.Constant(value=int() | float() as value):
            try:
                number = float(value)
            except OverflowError:
                number = math.inf
            if not math.isfinite(number):
                raise FormulaError(f"has a number {at} that is not finite")
            return Constant(number)
        case ast.Name(id=name):
            return Constant(CONSTANTS[name]) if name in CONSTANTS else Name(name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _read(operand, depth + 1)
            return Constant(-inner.value) if isinstance(inner, Constant) else Apply("neg", (inner,))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _read(operand, depth + 1)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            operands = (_read(left, depth + 1), _read(right, depth + 1))
            if isinstance(op, ast.Pow) and not _small_whole(operands[1]):
                raise FormulaError(
                    f"has a power {at} that is not a whole number 0 to {LARGEST_POWER}"
                )
            return Apply(_OPERATORS[type(op)], operands)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            if len(arguments) != FUNCTIONS[name]:
                wanted = FUNCTIONS[name]
                raise FormulaError(
                    f"gives {name} {at} {len(arguments)} arguments; it takes {wanted}"
                )
            return Apply(name, tuple(_read(argument, depth + 1) for argument in arguments))
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARISONS:
            return _compared(
                _COMPARISONS[type(op)], _read(left, depth + 1), _read(right, depth + 1)
            )
        case ast.IfExp(test=test, body=body, orelse=orelse):
            parts = (_read(part, depth + 1) for part in (test, body, orelse))
            return Apply("select", tuple(parts))
        case _:
            raise FormulaError(f"has something {at} that no formula may hold")


def _compared(operation: str, left: Formula, right: Formula) -> Formula:
    """1 where the comparison holds, else 0."""
    if operation in (">", "<="):
        left, right = right, left
    below = Apply("step", (Apply("-", (right, left)),))  # left < right
    return below if operation in ("<", ">") else Apply("-", (Constant(1.0), below))


def _small_whole(power: Formula) -> bool:
    return (
        isinstance(power, Constant)
        and power.value.is_integer()
        and 0 <= power.value <= LARGEST_POWER
    )


def names_in(formula: Formula) -> Iterator[str]:
    """The names a formula uses, in order of appearance, repeats included."""
    match formula:
        case Name(name):
            yield name
        case Apply(_, operands):
            for operand in operands:
                yield from names_in(operand)


def calls_function(formula: Formula) -> bool:
    """Whether a formula has a function in it."""
    match formula:
        case Apply(operation, operands):
            return operation in FUNCTIONS or any(calls_function(part) for part in operands)
    return False


def written(formula: Formula) -> str:
    """A formula as one may write it, every operation in brackets."""
    match formula:
        case Constant(value):
            return repr(value)
        case Name(name):
            return name
        case Apply("neg", (operand,)):
            return f"(-{written(operand)})"
        case Apply(operation, operands) if operation in FUNCTIONS:
            return f"{operation}({', '.join(written(operand) for operand in operands)})"
        case Apply(operation, (left, right)):
            return f"({written(left)} {operation} {written(right)})"
    raise AssertionError(formula)


def evaluate(formula: Formula, names: Mapping[str, Any], scalars: Scalars) -> Any:
    """The value of a formula over given scalars. Raises `KeyError` for a name not in `names`."""
    match formula:
        case Constant(value):
            return scalars.number(value)
        case Name(name):
            return names[name]
        case Apply(operation, operands):
            values = [evaluate(operand, names, scalars) for operand in operands]
            if operation == "**":
                power = operands[1]
                assert isinstance(power, Constant)
                result = scalars.number(1.0)
                for _ in range(int(power.value)):
                    result = result * values[0]
                return result
            if operation in _ARITHMETIC:
                return _ARITHMETIC[operation](*values)
            return scalars.call(operation, *values)


_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "neg": lambda a: -a,
}
