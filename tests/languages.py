"""Functions of the engine run in three languages, for tests: as they stand, in C, and in node.

Arguments are numbers, arrays, records and, for functions that the engine is given, a `Given`.
"""

import ctypes
import struct
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np
from live import run_in_node

from eomgen.engine.structures import filled, take
from eomgen.native.library import compiled_library
from eomgen.subset.languages import JAVASCRIPT, C
from eomgen.subset.printing import printed
from eomgen.subset.text import Text, own_name

BY_BITS = """
const view = new DataView(new ArrayBuffer(8));
const ofBits = (x) => (view.setFloat64(0, x), view.getBigUint64(0).toString(16));
const bits = (x) => (x === x ? ofBits(x) : "7ff8000000000000");
const number = (hex) => (view.setBigUint64(0, BigInt("0x" + hex)), view.getFloat64(0));
const decoded = (x) => {
  if (typeof x === "string") return number(x);
  if (typeof x === "number") return x;
  if (x === null) return system;
  if (x.floats) return Float64Array.from(x.floats, number);
  if (x.wholes) return Int32Array.from(x.wholes);
  return Object.fromEntries(Object.entries(x.record).map(([name, each]) => [name, decoded(each)]));
};
const bitsOf = (x) => {
  if (x === system) return [];
  if (typeof x === "number") return [bits(x)];
  if (x instanceof Float64Array || x instanceof Int32Array) return Array.from(x, bits);
  return Object.values(x).flatMap(bitsOf);
};
return given.map((args) => {
  const made = args.map(decoded);
  const result = CALLED(...made);
  return [...bitsOf(made), ...(result === undefined ? [] : [bits(Number(result))])];
});
"""


@dataclass
class Given:
    """A protocol's functions: an object in Python, and the same in C and JavaScript. Those in C
    that need the engine's structures follow it. Or C and JavaScript that have the engine's
    functions themselves, if they are `whole`.
    """

    python: Any
    c: str = "typedef struct { int none; } System;\n"
    javascript: str = "const system = {};\n"
    c_after: str = ""
    whole: bool = False


NONE = Given(None)


def results(
    text: Text,
    name: str,
    cases: Sequence[Sequence[Any]],
    known: Mapping[str, Any] | None = None,
    given: Given = NONE,
) -> list[list[list[str]]]:
    """For each case, what the function leaves of its arguments and returns, as bits: in Python as
    it stands, in C and in JavaScript. `Known` parameters are left away in the cases.
    """
    return [
        _in_python(text, name, cases, known or {}, given),
        _in_c(text, name, cases, known or {}, given),
        _in_node(text, name, cases, known or {}, given),
    ]


def _in_python(text: Text, name: str, cases: Any, known: Any, given: Given) -> list[list[str]]:
    function, found = text.modules[name][name], []
    for case in cases:
        made = deepcopy([given.python if x is given else x for x in case])
        left = iter(made)
        names = [a.arg for a in text.functions[name].args.args]
        with np.errstate(all="ignore"):
            result = function(*(known[n] if n in known else next(left) for n in names))
        made = [x for x, of in zip(made, case, strict=True) if of is not given]
        found.append(_numbers(made) + ([] if result is None else [_bits(result)]))
    return found


def _in_c(text: Text, name: str, cases: Any, known: Any, given: Given) -> list[list[str]]:
    own = own_name(name, known)
    source = given.c
    if not given.whole:
        source = "\n".join((C.prelude, given.c, printed(text, [(name, known)], C), given.c_after))
    head = f"{_result(text, name)} {own}("
    source = source.replace(f"static inline {head}", head)
    library = compiled_library(source, lambda: {"engine.c": source}, "engine.c")
    call, found = library[own], []
    call.restype = {"void": None, "double": ctypes.c_double}.get(
        _result(text, name), ctypes.c_int64
    )
    for case in cases:
        made = deepcopy([x for x in case if x is not given])
        records = {i: filled(x) for i, x in enumerate(made) if is_dataclass(x)}
        passed, left = [], iter(range(len(made)))
        for x in case:
            if x is given:
                passed.append(None)
                continue
            i = next(left)
            passed.append(ctypes.byref(records[i]) if i in records else _as_c(made[i]))
        result = call(*passed)
        for i, record in records.items():
            take(made[i], record)
        found.append(_numbers(made) + ([] if result is None else [_bits(result)]))
    return found


def _result(text: Text, name: str) -> str:
    returns = getattr(text.functions[name].returns, "id", "None")
    return {"float": "double", "int": "int64_t", "bool": "int64_t"}.get(returns, "void")


def _as_c(x: Any) -> Any:
    if isinstance(x, np.ndarray):
        return ctypes.c_void_p(x.ctypes.data)
    return ctypes.c_double(x) if isinstance(x, float) else ctypes.c_int64(x)


def _in_node(text: Text, name: str, cases: Any, known: Any, given: Given) -> list[list[str]]:
    own = own_name(name, known)
    source = given.javascript
    if not given.whole:
        source = "\n".join((JAVASCRIPT.prelude, source, printed(text, [(name, known)], JAVASCRIPT)))
    passed = [[None if x is given else _encoded(x) for x in case] for case in cases]
    found: list[list[str]] = run_in_node(source, BY_BITS.replace("CALLED", own), passed, scripts=())
    return [[each.rjust(16, "0") for each in case] for case in found]


def _encoded(x: Any) -> Any:
    if is_dataclass(x):
        return {"record": {f.name: _encoded(getattr(x, f.name)) for f in fields(x)}}
    if isinstance(x, np.ndarray):
        if x.dtype == np.float64:
            return {"floats": [_bits(each) for each in x.ravel()]}
        return {"wholes": x.ravel().tolist()}
    return _bits(x) if isinstance(x, float) else int(x)


def _numbers(values: Sequence[Any]) -> list[str]:
    found: list[str] = []
    for x in values:
        if is_dataclass(x):
            found += _numbers([getattr(x, f.name) for f in fields(x)])
        elif isinstance(x, np.ndarray):
            found += map(_bits, x.ravel().tolist())
        else:
            found.append(_bits(x))
    return found


def _bits(x: float) -> str:
    return "7ff8000000000000" if x != x else struct.pack(">d", float(x)).hex()
