"""The parser of formulas. A text becomes an expression tree; nothing in it is executed.

Python's `ast` parses the text, and only the nodes, functions and names listed here are accepted.
The tree is evaluated over any scalars: floats, SymPy expressions, nodes of a program.
"""

import ast
import keyword
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from eomgen.base.errors import nearest
from eomgen.scalars.functions import FUNCTIONS
from eomgen.scalars.protocol import Scalars

LONGEST_TEXT = 500
DEEPEST = 150
LARGEST_POWER = 16
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
    """A text is not a formula; the message says what is wrong and at which column."""


@dataclass(frozen=True)
class Constant:
    """A number of the scene; -0.0 becomes 0.0."""

    value: float

    def __post_init__(self) -> None:
        # 0.0 == -0.0, so both would share a dictionary entry, but atan2 distinguishes them.
        object.__setattr__(self, "value", float(self.value) + 0.0)


@dataclass(frozen=True)
class Angle(Constant):
    """A number that the scene gives as an angle with its unit; the value is in rad."""


@dataclass(frozen=True)
class Name:
    """A name: a parameter, a coordinate, `t` or another name that the field allows."""

    name: str


@dataclass(frozen=True)
class Apply:
    """An operator (`+ - * / **`, `neg`) or function applied to formulas."""

    operation: str
    operands: tuple["Formula", ...]


Formula = Constant | Name | Apply
ZERO = Constant(0.0)


_TOKEN = re.compile(
    r"(?P<space>\ +)"
    r"|(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?![A-Za-z0-9_.])"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<sign>\*\*(?!\*)|[<>]=?(?![<>=])|/(?!/)|[-+*(),])"
)
"""The tokens of formulas."""
_WRONG = re.compile(r"[A-Za-z0-9_.]{1,20}|[-=!<>:/&|*%@^~]{1,3}|.", re.DOTALL)
"""Text that is not a token, for messages."""
_REMEDIES = {
    "and": "write min(a, b)",
    "or": "write max(a, b)",
    "not": "write 1 - a",
    "^": "write ** for a power",
    "==": "compare with <, <=, > or >=",
    "!=": "compare with <, <=, > or >=",
}
_EXAMPLE = "write for example '2*m_A' or 'l_A/2'"
_MEASURED = re.compile(r" *[-+]?[0-9.]+(?:[eE][+-]?[0-9]+)? +[A-Za-z]")
"""A number followed by a word, as in '2.5 kg'."""
_ALONE = "write the number alone, in SI units, or * to multiply"


def parse(text: str) -> Formula:
    """Read a formula: numbers, names, `FUNCTIONS`, `CONSTANTS`, `+ - * / **` (small whole powers),
    one comparison, `a if x < y else b`.

    Raises `FormulaError`, naming the column, for anything else.
    """
    if len(text) > LONGEST_TEXT:
        raise FormulaError(f"is longer than {LONGEST_TEXT} characters")
    if not text.isascii():
        column = next(i for i, c in enumerate(text) if not c.isascii()) + 1
        raise FormulaError(f"has a character at column {column} that is not plain ASCII")
    _check_tokens(text)
    plain = text.strip(" ")
    start = len(text) - len(text.lstrip(" ")) + 1
    if not plain:
        raise FormulaError(f"is not a formula; {_EXAMPLE}")
    try:
        tree = ast.parse(plain, mode="eval")
    except SyntaxError as error:
        column = start - 1 + (error.offset or len(plain) + 1)  # 0 stands for the end
        remedy = _ALONE if _MEASURED.match(text) else _EXAMPLE
        raise FormulaError(f"is not a formula at column {column}; {remedy}") from None
    except (RecursionError, MemoryError):
        raise FormulaError(f"is nested deeper than {DEEPEST}") from None
    return _formula(tree.body, 0, start)


def _check_tokens(text: str) -> None:
    """Raise `FormulaError` unless all tokens are those of formulas, before Python's parser runs."""
    at = depth = 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            _refuse(_WRONG.match(text, at)[0], at + 1)  # type: ignore[index]
        word = found[0]
        if found.lastgroup == "name":
            if keyword.iskeyword(word) and word not in ("if", "else"):
                _refuse(word, at + 1)
            if word.startswith("_") or word.endswith("_") or "__" in word:
                raise FormulaError(
                    f"has {word[:20]!r} at column {at + 1}; a name starts with a letter, "
                    "does not end in _, and contains no __"
                )
        depth += (word == "(") - (word == ")")
        if depth > DEEPEST:
            raise FormulaError(f"is nested deeper than {DEEPEST} at column {at + 1}")
        at = found.end()


def _refuse(word: str, column: int) -> NoReturn:
    remedy = _REMEDIES.get(word)
    if remedy is None and word[0].isdigit():
        remedy = "write numbers without a unit, as 1000.0 or 1e3, and * to multiply"
    tail = f"; {remedy}" if remedy else ""
    raise FormulaError(f"has {word!r} at column {column}, which is not allowed{tail}")


def _formula(node: ast.expr, depth: int, start: int) -> Formula:
    """The formula of a syntax node; `start` is the column at which the parsed text starts."""
    at = f"at column {node.col_offset + start}"
    if depth > DEEPEST:
        raise FormulaError(f"is nested deeper than {DEEPEST} {at}")

    def operands_of(*parts: ast.expr) -> tuple[Formula, ...]:
        return tuple(_formula(part, depth + 1, start) for part in parts)

    match node:
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
            (inner,) = operands_of(operand)
            return Constant(-inner.value) if isinstance(inner, Constant) else Apply("neg", (inner,))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return operands_of(operand)[0]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            operands = operands_of(left, right)
            if isinstance(op, ast.Pow) and not _small_whole(operands[1]):
                raise FormulaError(
                    f"has a power at column {right.col_offset + start} that is not a whole number "
                    f"0 to {LARGEST_POWER}; others are 1/x**n, sqrt(x), exp(p*log(x))"
                )
            return Apply(_OPERATORS[type(op)], operands)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            operands = operands_of(*arguments)
            if len(arguments) != FUNCTIONS[name]:
                raise FormulaError(
                    f"gives {name} {at} {len(arguments)} arguments; it takes {FUNCTIONS[name]}"
                )
            return Apply(name, operands)
        case ast.Call(func=ast.Name(id=name)) if name not in FUNCTIONS:
            hint = nearest(name, FUNCTIONS) or f"; * multiplies, functions are {_FUNCTION_LIST}"
            raise FormulaError(f"calls {name!r} {at}, which is not a function{hint}")
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARISONS:
            return _compared(_COMPARISONS[type(op)], *operands_of(left, right))
        case ast.Compare():
            raise FormulaError(f"compares more than two {at}; write min(a < b, b < c)")
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return Apply("select", operands_of(test, body, orelse))
        case ast.Call(keywords=[first, *_]):
            at = f"at column {first.col_offset + start}"
    raise FormulaError(f"has something {at} that is not allowed")


_FUNCTION_LIST = ", ".join(FUNCTIONS)


def _compared(operation: str, left: Formula, right: Formula) -> Formula:
    """A formula that is 1 if the comparison holds, else 0."""
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


def meant(formula: Formula, known: Collection[str]) -> str:
    """A hint if a difference spells a known name with - for _; else "".

    Names are written with _ in formulas, where - subtracts.
    """
    if not isinstance(formula, Apply):
        return ""
    words = _difference(formula)
    for length in range(len(words), 1, -1):
        for start in range(len(words) - length + 1):
            if (name := "_".join(words[start : start + length])) in known:
                return f" (did you mean '{name}'? In formulas - subtracts)"
    return next(filter(None, (meant(part, known) for part in formula.operands)), "")


def _difference(formula: Formula) -> list[str]:
    """The names and whole numbers of a - b - c; a space stands for anything else."""
    match formula:
        case Name(name):
            return [name]
        case Constant(value) if value >= 0 and value.is_integer():
            return [str(int(value))]
        case Apply("-", (first, second)):
            return [*_difference(first), *_difference(second)]
    return [" "]


def names_in(formula: Formula) -> Iterator[str]:
    """The names in a formula, in order of appearance, with repetitions."""
    match formula:
        case Name(name):
            yield name
        case Apply(_, operands):
            for operand in operands:
                yield from names_in(operand)


def is_zero(formula: Formula) -> bool:
    """Whether a quantity is the bare number 0, which is not a parameter."""
    return isinstance(formula, Constant) and formula.value == 0.0


def calls_function(formula: Formula) -> bool:
    """Whether a formula contains a function."""
    match formula:
        case Apply(operation, operands):
            return operation in FUNCTIONS or any(calls_function(part) for part in operands)
    return False


def written(formula: Formula) -> str:
    """The text of a formula, with brackets around each operation."""
    match formula:
        case Constant(value):
            return repr(value) if math.copysign(1.0, value) > 0 else f"({value!r})"
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
    return _evaluated(formula, names, scalars, {})


def _evaluated(
    formula: Formula, names: Mapping[str, Any], scalars: Scalars, known: dict[int, Any]
) -> Any:
    """`evaluate` with a cache `known` of operations by their id: a subexpression that a formula
    shares between several places, such as a determinant, is evaluated once.
    """
    match formula:
        case Constant(value):
            return scalars.number(value)
        case Name(name):
            return names[name]
        case Apply(operation, operands):
            if (found := known.get(id(formula))) is None:
                values = [_evaluated(operand, names, scalars, known) for operand in operands]
                found = known[id(formula)] = _applied(operation, operands, values, scalars)
            return found


def _applied(
    operation: str, operands: tuple[Formula, ...], values: list[Any], scalars: Scalars
) -> Any:
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
