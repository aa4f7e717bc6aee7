"""The formula reader under attack: what it refuses and where, and that nothing else comes of it."""

import math
import random
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pytest
from campaign import some
from engine import plain, quick, text_of
from scenes import refusal

from eomgen.codegen.backends.javascript import DIALECT
from eomgen.language import formula as reader
from eomgen.language.formula import (
    Apply,
    Constant,
    Formula,
    FormulaError,
    Name,
    evaluate,
    names_in,
    parse,
    written,
)
from eomgen.scalars.floats import FloatScalars
from eomgen.scalars.functions import BY_MATH, FUNCTIONS
from eomgen.scene.reader import parse_scene

NO = "has {!r} at column {}, which is not allowed"
NUMBERS = "; write numbers without a unit, as 1000.0 or 1e3, and * to multiply"
NAMES = "; a name starts with a letter, does not end in _, and contains no __"
POWER = (
    "has a power at column {} that is not a whole number 0 to 16; "
    "others are 1/x**n, sqrt(x), exp(p*log(x))"
)
REFUSED = [
    # No way to anything of Python.
    *(
        (text, NO.format(word, column))
        for text, word, column in (
            ("m.real", ".real", 2), ("x[0]", "[", 2), ("[x for x in y]", "[", 1), ("{1}", "{", 1),
            ("lambda: 1", "lambda", 1), ("(x:=1)", ":=", 3), ("'a'", "'", 1), ('b"a"', '"', 2),
            ("f'{x}'", "'", 2), ("x # y", "#", 3), ("x;y", ";", 2), ("x\n+1", "\n", 2),
            ("\tx", "\t", 1), ("x\0", "\0", 2), ("x\\\n+1", "\\", 2), ("sin(x=1)", "=", 6),
            ("await x", "await", 1), ("x in y", "in", 3), ("x is y", "is", 3),
            ("yield", "yield", 1), ("True", "True", 1), ("1 - None", "None", 5), ("...", "...", 1),
            ("x!", "!", 2), ("x // 2", "//", 3), ("x % 2", "%", 3), ("x @ y", "@", 3),
            ("x << y", "<<", 3), ("~x", "~", 1), ("$x", "$", 1), ("  x.y", ".y", 4),
            ("a + `b`", "`", 5), ("x?", "?", 2),
        )
    ),
    *(
        (text, NO.format(word, column) + remedy)
        for text, word, column, remedy in (
            ("a and b", "and", 3, "; write min(a, b)"),
            ("a or b", "or", 3, "; write max(a, b)"),
            ("not a", "not", 1, "; write 1 - a"),
            ("x ^ 2", "^", 3, "; write ** for a power"),
            ("x == y", "==", 3, "; compare with <, <=, > or >="),
            ("x != y", "!=", 3, "; compare with <, <=, > or >="),
            ("1_000", "1_000", 1, NUMBERS), ("0x10", "0x10", 1, NUMBERS), ("1j", "1j", 1, NUMBERS),
            ("a + 2m", "2m", 5, NUMBERS), ("1.5.2", "1.5.2", 1, NUMBERS),
            ("1if x<0 else 2", "1if", 1, NUMBERS), ("1e", "1e", 1, NUMBERS),
        )
    ),
    *(
        (text, f"has {word!r} at column {column}" + NAMES)
        for text, word, column in (
            ("__import__(x)", "__import__", 1), ("_x", "_x", 1), ("x + x__y", "x__y", 5),
            (" x_", "x_", 2), ("_", "_", 1),
        )
    ),
    # Calls.
    ("sine(x)", "calls 'sine' at column 1, which is not a function (did you mean 'sin'?)"),
    ("1 + Sqrt(x)", "calls 'Sqrt' at column 5, which is not a function (did you mean 'sqrt'?)"),
    (
        "eval(x)",
        "calls 'eval' at column 1, which is not a function; * multiplies, functions are "
        + ", ".join(FUNCTIONS),
    ),
    ("2(x)", "has something at column 1 that is not allowed"),
    ("sin(x)(y)", "has something at column 1 that is not allowed"),
    ("1 + max(*x, y)", "has something at column 9 that is not allowed"),
    ("max(x, **y)", "has something at column 8 that is not allowed"),
    ("sin()", "gives sin at column 1 0 arguments; it takes 1"),
    ("x*atan2(y)", "gives atan2 at column 3 1 arguments; it takes 2"),
    ("x, y", "has something at column 1 that is not allowed"),
    ("3*()", "has something at column 3 that is not allowed"),
    # Comparisons and powers.
    ("2*(a < b < c)", "compares more than two at column 4; write min(a < b, b < c)"),
    *(
        (text, POWER.format(column))
        for text, column in (
            ("x**-1", 4), ("  x**0.5", 6), ("x**17", 4), ("2**3**2", 4), ("x**y", 4), ("x**pi", 4),
        )
    ),
    # Numbers and characters that are none.
    ("2*1e999", "has a number at column 3 that is not finite"),
    ("9" * 400, "has a number at column 1 that is not finite"),
    *(
        (text, f"has a character at column {column} that is not plain ASCII")
        for text, column in (
            ("\u0430 + 1", 1), ("2*\uff11", 3), ("x \u2212 1", 3), ("x\u200b", 2), ("\u03c0", 1),
            ("x\u00b2", 2), ("x\u00a0+1", 2),
        )
    ),
    # No formula, or too much of one.
    *(
        (text, f"is not a formula{where}; write for example '2*m_A' or 'l_A/2'")
        for text, where in (
            ("", ""), ("  ", ""), ("m*", " at column 3"), ("  (m", " at column 3"),
            ("m + / 2", " at column 5"), ("x y", " at column 3"), ("x))", " at column 2"),
        )
    ),
    ("(" * 160 + "x" + ")" * 160, "is nested deeper than 150 at column 151"),
    ("-" * 400 + "x", "is nested deeper than 150 at column 152"),
    ("x" * 501, "is longer than 500 characters"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_is_refused_and_where(text: str, message: str) -> None:
    """One line, with the column; control characters are shown, not printed."""
    with pytest.raises(FormulaError) as error:
        parse(text)
    assert str(error.value) == message
    assert str(error.value).isprintable()


def random_formulas(rng: random.Random, depth: int) -> Iterator[str]:
    """Texts of the formulas' own grammar."""
    while True:
        yield _grown(rng, depth)


def _grown(rng: random.Random, depth: int) -> str:
    if depth == 0:
        return rng.choice(["x", "y1", "a_b", "pi", "0", "2", ".5", "3.", "1e-3", "7.25E+2", "-1.5"])
    part = [_grown(rng, rng.randrange(depth)) for _ in range(4)]
    space = " " * rng.randrange(2)
    kind = rng.randrange(7)
    if kind == 0:
        return f"{space}({part[0]}{space}){space}**{space}{rng.randrange(17)}"
    if kind == 1:
        return f"-{space}({part[0]})"
    if kind == 2:
        name = rng.choice(list(FUNCTIONS))
        return f"{name}({','.join(part[: FUNCTIONS[name]])})"
    if kind == 3:
        return f"({part[0]} {rng.choice(['<', '<=', '>', '>='])} {part[1]})"
    if kind == 4:
        return f"({part[0]} if {part[1]} < {part[2]} else {part[3]})"
    return f"({part[0]}{space}{rng.choice('+-*/')} {part[1]})"


def as_python(formula: Formula, names: dict[str, float]) -> float | str:
    """The value, or the kind of error that there is none."""
    try:
        return float(evaluate(formula, names, FloatScalars()))
    except (ArithmeticError, ValueError) as error:
        return type(error).__name__


def test_every_formula_is_read_and_written_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Texts of the grammar are read, mean what Python means by them, and survive being written."""
    monkeypatch.setattr(reader, "LONGEST_TEXT", 100_000)
    rng = random.Random(4)
    grown = random_formulas(rng, 5)
    values = 0
    for _ in range(3000):
        text = next(grown)
        formula = parse(text)
        names = {name: rng.uniform(-2, 2) for name in ("x", "y1", "a_b")}
        assert set(names_in(formula)) <= set(names)
        found = as_python(formula, names)
        again = as_python(parse(written(formula)), names)
        assert again == found or (again != again and found != found), text
        # Python itself is the judge here, of texts that this test made up.
        by_hand = {**BY_MATH, **names, "pi": math.pi}
        try:
            wanted: float | str = float(eval(text.strip(), {"__builtins__": {}}, by_hand))
        except (ArithmeticError, ValueError) as error:
            wanted = type(error).__name__
        if isinstance(found, float) and isinstance(wanted, float) and math.isfinite(wanted):
            assert found == pytest.approx(wanted, rel=1e-9, abs=1e-12), text
            values += 1
    assert values > 1500


def test_any_text_is_a_formula_or_refused() -> None:
    """Random characters, random words of Python, texts of the grammar with one wrong character."""
    rng = random.Random(5)
    words = (
        "x y sin max ( ) ( ) , + - * / ** < > = == . if else and not in lambda for [ ] { } : 1 "
        "2.5 1e3 _ __x__ ' \" # ; \\ \n import True None await % ^ ~ @ ! $ ? | & 0x1 1_0 1j"
    )
    grown = random_formulas(rng, 4)
    accepted = 0
    start = time.process_time()
    for trial in range(6000):
        kind = trial % 3
        if kind == 0:
            text = "".join(chr(rng.randrange(128)) for _ in range(rng.randrange(30)))
        elif kind == 1:
            text = " ".join(rng.choice(words.split(" ")) for _ in range(rng.randrange(12)))
        else:
            text = next(grown)[:400]
            at = rng.randrange(len(text))
            text = text[:at] + chr(rng.randrange(32, 127)) + text[at + rng.randrange(2) :]
        try:
            formula = parse(text)
        except FormulaError as error:
            assert str(error).isprintable(), text
        else:
            assert isinstance(formula, Constant | Name | Apply)
            for name in names_in(formula):
                assert name.isidentifier() and "__" not in name and name[0] != "_", text
            accepted += 1
    assert accepted > 300, accepted
    assert time.process_time() - start < 60.0


def test_reading_never_warns() -> None:
    """Python warns of a number that a keyword follows at once, `1if x < 2 else 0`, of `0777` and of
    other texts that are no formulas; none of these reaches its parser.
    """
    rng = random.Random(7)
    words = (
        *("x", "e", "j", "if", "else", "and", "or", "in", "is", "not", "max", "(", ")", ",", " "),
        *("+", "-", "*", "/", "**", "<", ">=", "0", "1", "77", "2.", ".5", "1e3", "1e", "0x", "1_"),
    )
    read = refused = 0
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        for text in (
            "1if x < 2 else 0",
            "1.if x < 2 else 0",
            "0777",
            "1(2)",
            "x if 1<x else 1or 2",
        ):
            with suppress(FormulaError):
                parse(text)
        for _ in range(some(20_000, 1_000_000)):
            text = "".join(rng.choices(words, k=rng.randrange(1, 9)))
            try:
                parse(text)
                read += 1
            except FormulaError:
                refused += 1
    assert not warned, warned[0].message
    assert min(read, refused) > 500


SCENE = """\
name = "bead"
initial = {{ q = [0.4] }}
bodies = [{{ name = "bead", mass = 1, inertia_com = 0 }}]
joints = [
    {{ name = "wire", type = "prismatic", parent = "world", child = "bead", axis = [1, 0], \
coordinate = "x" }},
]
effects = [{{ type = "motor", name = "push", joint = "wire", torque = "{}" }}]
[parameters]
a = 2.0
"""
LONGEST = [
    "*".join(["x**16"] * 80), "(" * 60 + "x" + ")**16" * 60, "sin(" * 95 + "x" + ")" * 95,
    "+".join("x" * 150), "+".join(f"{i}*x" for i in range(90)), "1/(2+" * 70 + "x" + ")" * 70,
    "max(x," * 60 + "a" + ")" * 60, "-(1-" * 70 + "x" + ")" * 70,
    "(x if x<a else " * 30 + "x" + ")" * 30,
    "(x**16+1)*" * 45 + "x",
]  # fmt: skip


@pytest.mark.every(3)
@pytest.mark.parametrize("formula", LONGEST)
def test_the_longest_formulas_stay_small(formula: str) -> None:
    """500 characters make some hundred operations, which Python's parser takes, in no time."""
    start = time.process_time()
    module = quick(SCENE.format(formula)).module
    assert time.process_time() - start < 60.0
    assert module.COST["derivative"]["total"] <= 16 * len(formula)
    y = np.array([0.4, 0.0])
    wanted = evaluate(parse(formula), {"x": 0.4, "a": 2.0}, FloatScalars())
    assert module.derivative(0.0, y)[1] == pytest.approx(wanted, rel=1e-12)
    assert np.isfinite(module.jacobian(0.0, y)).all()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_parameters_alone(name: str) -> None:
    """Each is there where it is called once for all states, and only there."""
    call = f"{name}({', '.join(['a/4', 'a/5', 'a'][: FUNCTIONS[name]])})"
    module = plain(SCENE.format(f"x*{call}")).module
    value = BY_MATH[name](*[0.5, 0.4, 2.0][: FUNCTIONS[name]])
    wanted = pytest.approx(0.4 * value, rel=1e-14)
    assert module.derivative(0.0, np.array([0.4, 0.0]))[1] == wanted
    assert module.derivative(0.0, np.full((2, 3), 0.4))[1] == pytest.approx([wanted.expected] * 3)
    assert name in DIALECT.functions  # of pages, which place bodies by such formulas


@pytest.mark.parametrize(
    ("torque", "message"),
    [
        ("x*log(0 - 1)",
         "its part 'log((0.0 - 1.0))' is not a finite number; change it or its parameters"),
        ("x + exp(1000)",
         "its part 'exp(1000.0)' is not a finite number; change it or its parameters"),
        ("x/(a - 2)*(1/(a - 2))",
         "its part '(1.0 / (a - 2.0))' is not a finite number; change it or its parameters"),
        ("x*((1e99)**16)",
         "its part '(1e+99 ** 16.0)' is not a finite number; change it or its parameters"),
        ("x*(1e308*10 - 1e308*10)",
         "its part '((1e+308 * 10.0) - (1e+308 * 10.0))' is not a finite "
         "number; change it or its parameters"),
        ("x + sine", "unknown parameter 'sine' (did you mean 'sin'?)"),
        ("x + sin", "unknown parameter 'sin'; the function is written sin(x)"),
        ("max*2", "unknown parameter 'max'; the function is written max(x, y)"),
        ("wire_dot + x_dott", "unknown parameter 'wire_dot' (did you mean 'x_dot'?)"),
        ("open", "unknown parameter 'open'; give it a value in [parameters]"),
        ("np + x", "unknown parameter 'np'; give it a value in [parameters]"),
        ("derivative", "unknown parameter 'derivative'; give it a value in [parameters]"),
    ],
)  # fmt: skip
def test_what_has_no_meaning(torque: str, message: str) -> None:
    """A part that can have no value, whatever the motion; a name that nothing has."""
    scene = parse_scene(SCENE.format(torque))
    assert refusal(lambda: text_of(scene)) == f"effects[0].torque: {message}"


def test_a_parameter_may_have_a_function_s_name() -> None:
    """`step` of the scene and `step(x)` are two things."""
    text = SCENE.replace("a = 2.0", "step = 3.0\nmax = 5.0").format(
        "step*x + step(x) + max(max, 1)"
    )
    assert plain(text).module.derivative(0.0, np.array([0.4, 0.0]))[1] == pytest.approx(7.2)


def test_numbers_too_large_fold_to_no_name() -> None:
    """What overflows is an error of the run, never a word in the code that nothing defines."""
    source = text_of(parse_scene(SCENE.format("x*1e200*1e200")))
    kernels = source[source.index("def _fixed(") : source.index("def _numbers(")]
    assert "inf" not in kernels and "nan" not in kernels
