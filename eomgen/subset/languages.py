"""The languages in which the engine's text is printed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

OF_NUMBERS = ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh", "atan2")
RESERVED = frozenset(
    "auto boolean byte case catch char const debugger default delete do double enum eval export "
    "extends extern final function goto implements inline instanceof interface let long new null "
    "package private protected public register restrict short signed sizeof static struct super "
    "switch this throw throws typedef typeof undefined union unsigned var void volatile".split()
)
"""Words of C and JavaScript that are names in Python."""
BRACES = {
    "and": "&&", "or": "||", "not": "!",
    "choice": "{} ? {} : {}",
    "if": "if ({}) {{",
    "while": "while ({}) {{",
    "else": "} else {",
    "range": "for ({i} = {start}; {i} < {end}; {i}++) {{",
    "back": "for ({i} = {start}; {i} > {end}; {i}--) {{",
    "done": "}",
    "end": ";",
}  # fmt: skip
"""Words of statements, and of operators that Python calls otherwise."""


@dataclass(frozen=True)
class Language:
    """What differs between languages.

    function      how a function begins, by its result, name and arguments
    number, whole types of numbers
    names         how functions of numbers, infinity and what is not a number are called
    array         how a local array is declared, by type, name and size, and the function
    arrays        the types of arrays of numbers, and of whole ones
    part          how a part of an array is passed on, by its name and the place where it begins
    field         how a record's field is read
    prelude       what the printed functions need
    random        what those need beside that call `uniform`
    literal       how a number is written
    typed         whether arguments and results have types, and records structures
    listed        how four entries of an array of numbers that follow one another are given, from
                  the place of the first; one by one if it is empty
    words         those of statements
    """

    function: str
    field: str
    prelude: str
    names: Mapping[str, str]
    words: Mapping[str, str]
    number: str = ""
    whole: str = ""
    arrays: tuple[str, str] = ("", "")
    array: str = ""
    part: str = ""
    literal: str = "{}"
    random: str = ""
    typed: bool = False
    listed: str = ""


C = Language(
    function="static inline {result} {name}({arguments}) {{",
    number="double",
    whole="int64_t",
    names={"abs": "fabs", "nan": "NAN", "inf": "INFINITY"},
    array="{type} {name}[ROOM({size})];",
    arrays=("double", "int64_t"),
    part="{array} + {place}",
    field="->",
    prelude="""#include <math.h>
#include <stdint.h>

/* Room for n numbers; an array of none is not allowed. */
#define ROOM(n) ((n) > 0 ? (n) : 1)

static inline double next_after(double t) {
    return nextafter(t, INFINITY);
}
""",
    random="""static inline double uniform(double seed, double stream, double number, double draw) {
    const double given[4] = {seed, stream, number, draw};
    uint64_t state = 0;
    for (int i = 0; i < 4; i++) {
        state = (state ^ (uint64_t)given[i]) + UINT64_C(0x9E3779B97F4A7C15);
        state = (state ^ (state >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
        state = (state ^ (state >> 27)) * UINT64_C(0x94D049BB133111EB);
        state ^= state >> 31;
    }
    return (double)(state >> 11) * 0x1p-53;
}
""",
    words=BRACES,
    typed=True,
)
REALS = replace(
    C,
    number="real",
    arrays=("real", "int64_t"),
    names={**C.names, "abs": "abs_", "sqrt": "sqrt_"},
    literal="R({})",
)
"""C with numbers of a type `real`, for which R(x) writes constants, and `abs_` and `sqrt_`."""
VECTORS = replace(C, number="V", arrays=("V", "int64_t"), literal="N({})")
"""C with a type V of vectors in place of numbers: text without decisions makes several at once."""
JAVASCRIPT = Language(
    function="function {name}({arguments}) {{",
    number="let",
    whole="let",
    names={
        **{name: f"Math.{name}" for name in ("abs", *OF_NUMBERS)},
        "nan": "NaN", "inf": "Infinity",
        "isfinite": "Number.isFinite", "next_after": "nextAfter",
    },
    array="const {name} = {function}.{name}_ = roomFor({function}.{name}_, {type}Array, {size});",
    arrays=("Float64", "Int32"),
    part="{array}.subarray({place})",
    field=".",
    prelude="""const nextAfter = (() => {
    const number = new Float64Array(1), bits = new BigInt64Array(number.buffer);
    return (t) => {
        if (t === 0) return Number.MIN_VALUE;
        number[0] = t;
        bits[0] += t > 0 ? 1n : -1n;
        return number[0];
    };
})();
// The room of a function's last call, if that had as many numbers.
const roomFor = (room, Numbers, n) => (room?.length === n ? room : new Numbers(n));
""",
    random="""const uniform = (...given) => {
    let state = 0n;
    const wrapped = (x) => BigInt.asUintN(64, x);
    for (const number of given) {
        state = wrapped((state ^ BigInt(number)) + 0x9E3779B97F4A7C15n);
        state = wrapped((state ^ (state >> 30n)) * 0xBF58476D1CE4E5B9n);
        state = wrapped((state ^ (state >> 27n)) * 0x94D049BB133111EBn);
        state ^= state >> 31n;
    }
    return Number(state >> 11n) * 2 ** -53;
};
""",
    words=BRACES,
)  # fmt: skip
