"""The C backend: C99 that stands alone, and the Python module's results to the last bit."""

import ctypes
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import call

import numpy as np
import pytest
from campaign import some

import eomgen
from eomgen.api.given import check, read
from eomgen.base.errors import RunError
from eomgen.codegen.backends import c
from eomgen.codegen.interface import interface_of
from eomgen.commands.main import main
from eomgen.native import compiler, library
from eomgen.native.module import compiled_module
from eomgen.pipeline import compile_program, python_module
from eomgen.run.columns import FUNCTIONS
from eomgen.run.module import load_module
from eomgen.scene.built_in import BUILT_IN, built_in_names
from eomgen.study.verification.states import random_state

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(CC is None, reason="there is no C compiler")
FEW = ("tumbling_body", "bouncing_two_body", "cart_pole")
LARGE = (
    "hanging_figure human_figure puma560 quadruped ragdoll stiff_beam walker_motors "
    "car_suspension peaucellier stewart_platform"
).split()
SOME = [name for name in built_in_names() if name not in LARGE[1:]][::2] + LARGE[:1]
NOT_IN_FLOAT = ("babyboot", "ragdoll")
"""Of the first a condition that holds with equality is missed by rounding; the second has weights
of 1e-200, which are 0 in float.
"""
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off")
OUTPUTS = (
    *("derivative", "jacobian", "mass_matrix", "velocity_force", "kinetic_energy", "body_poses"),
    *("joint_forces", "effect_powers", "gaps", "switching_functions", "input_jacobian"),
)


@cache
def pair(scene: str) -> tuple[Any, Any]:
    """A scene's compiled module, and its Python module. Of a large scene an ordinary run compiles
    the derivative alone.
    """
    if scene in some(LARGE, ()):
        system = compile_program(check(read(scene)), jacobian=False).system
        python = load_module(python_module(system), scene)
        outputs = {"derivative": system.program.outputs["derivative"]}
        program = replace(system.program, outputs=outputs)
        sources = c.library(program, interface_of(replace(system, program=program)), vectors=True)
    else:
        made = eomgen.generate(scene, backend="c")
        python, sources = load_module(made.reference, made.name), made.library
    return compiled_module(python, library.built(sources)), python


def of_columns(python: Any, name: str, *given: Any) -> Any:
    """What a Python module returns for columns, with the functions of those in C: of the derivative
    sine and cosine are our own.
    """
    with pytest.MonkeyPatch.context() as patch:
        for f in python._COLUMNS.keys() & FUNCTIONS.keys():
            if name == "derivative" or f not in ("sin", "cos"):
                patch.setitem(python._COLUMNS, f, FUNCTIONS[f])
        return getattr(python, name)(*given)


def result(call: Callable[[], Any]) -> Any:
    """What a call returns, or its error in words."""
    try:
        return call()
    except (ValueError, ArithmeticError) as error:
        return f"{type(error).__name__}: {error}"


def same(one: Any, other: Any) -> bool:
    """Whether two results are the same to the bit, nan and signs of zero too, or the same words."""
    if isinstance(one, str) or isinstance(other, str):
        return isinstance(one, str) and isinstance(other, str) and one == other
    a, b = np.asarray(one), np.asarray(other)
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


@pytest.mark.every(6)
@pytest.mark.parametrize("scene", some(SOME, built_in_names()))
def test_the_bits_are_those_of_the_python_module(scene: str) -> None:
    """Of every output that takes time and state alone; of single states and of columns."""
    compiled, python = pair(scene)
    rng = np.random.default_rng(7)
    y = np.array([random_state(python, rng) for _ in range(3)])
    u = rng.uniform(-2.0, 2.0, len(python.INPUTS))
    p = np.array([*python.PARAMETERS.values()]) * rng.uniform(0.99, 1.0)
    names = [n for n in OUTPUTS if getattr(compiled, n, None) is not getattr(python, n, None)]
    assert "derivative" in names and ("jacobian" in names or scene in some(LARGE, ()))
    for name in names:
        ours, theirs = getattr(compiled, name), getattr(python, name)
        for state in y:
            for given in ({}, {"u": u}, {"p": p, "u": u}):
                found = [result(partial(f, 0.7, state, **given)) for f in (ours, theirs)]
                assert same(*found), name
        together = ours(0.7, y.T)
        assert same(together, of_columns(python, name, 0.7, y.T)), name
        assert same(ours(0.7, np.tile(y.T, 7)), np.tile(together, 7)), name  # of whole registers


@pytest.mark.apart
@pytest.mark.parametrize("level", some(["-O2"], ["-O1", "-O2", "-O3"]))
def test_no_optimisation_changes_a_bit(
    level: str, monkeypatch: pytest.MonkeyPatch, optimised: None
) -> None:
    """Nothing is contracted and no order is changed."""
    monkeypatch.setattr(library, "LEVELS", (level, level))
    compiled = eomgen.load(eomgen.generate("double_pendulum", backend="c"))
    python = eomgen.load(eomgen.generate("double_pendulum"))
    for seed in range(200):
        y = random_state(python, np.random.default_rng(seed))
        assert same(compiled.derivative(0.0, y), python.derivative(0.0, y))
        assert same(compiled.jacobian(0.0, y), python.jacobian(0.0, y))


WRONG: list[dict[str, Any]] = [
    {"y": [0.0] * 8},
    {"y": np.zeros(7)},
    {"y": np.full(8, np.nan)},
    {"y": np.full(8, 1e200)},
    {"y": np.full(8, 1e19)},
    {"y": np.zeros(8, dtype=np.float32)},
    {"y": np.ma.masked_equal(np.arange(8.0), 3)},
    {"y": np.zeros((8, 0))},
    {"y": np.array([np.zeros(8), np.full(8, np.inf), np.ones(8), np.full(8, 1e200)]).T},
    {"y": np.ones(8)[::-1], "p": {"m_A": 2.0}},
    {"y": np.ones(8), "p": {"m_A": -1.0}},
    {"y": np.ones(8), "p": {"m_X": 1.0}},
    {"y": np.ones(8), "p": {"m_A": 1e80}},
    {"y": np.ones(8), "p": {"m_A": np.nan}},
    {"y": np.ones(8), "p": {"m_A": "1"}},
    {"y": np.ones(8), "p": [1, 1, 1, 1, 1, 1, 9]},
    {"y": np.ones(8), "p": np.ones(3)},
    {"y": np.ones(8), "p": "text"},
    {"y": np.ones(8), "u": {"push": 1.0}},
    {"y": np.ones(8), "u": np.zeros(0)},
    {"y": "text"},
    {"y": np.array(1.0)},
    {"y": np.zeros((8, 2, 2))},
]


@pytest.mark.parametrize("name", ["derivative", "jacobian", "kinetic_energy"])
def test_what_is_wrong_gets_the_same_answer(name: str) -> None:
    """A state without a result, columns among others, arguments of a wrong kind."""
    both = pair("two_body")
    for given in WRONG:
        y, rest = given["y"], {k: v for k, v in given.items() if k != "y"}
        found = [result(partial(getattr(module, name), 0.0, y, **rest)) for module in both]
        assert same(*found), (given, found)


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", ["two_body", "steering_particles", "chain_in_wind"])
def test_times_of_every_kind(scene: str) -> None:
    """Where nothing depends on time it may be anything; else it is a finite number, or an array of
    one for each column.
    """
    compiled, python = pair(scene)
    y = python.initial_state()
    columns = np.array([y, y]).T
    times = (0, 2, True, np.float64(0.5), np.float32(0.5), np.int64(3), 10**400, None, "x")
    for t in (*times, math.nan, math.inf, np.array(0.5), np.array([0.1, 0.2]), [0.1, 0.2]):
        for state in (y, columns):
            one = anything(lambda t=t, y=state: compiled.derivative(t, y))
            assert same(one, anything(lambda t=t, y=state: python.derivative(t, y))), t


def anything(call: Callable[[], Any]) -> Any:
    """What a call returns, or the type and words of any error."""
    try:
        return call()
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def test_inputs_of_columns_and_those_that_are_wrong() -> None:
    """One set for all columns, or one for each; none that are not finite."""
    compiled, python = pair("cart_pole")
    y = np.linspace(-4.0, 4.0, 200).reshape(4, 50)
    each = np.linspace(1.0, 3.0, 50)[None]
    for u in (np.array([2.0]), each, {"push": 4.0}, np.array([np.nan])):
        for state, theirs in (
            (y, partial(of_columns, python, "derivative")),
            (y[:, 0], python.derivative),
        ):
            one = result(lambda u=u, y=state: compiled.derivative(0.0, y, None, u))
            assert same(one, result(lambda u=u, y=state, f=theirs: f(0.0, y, None, u)))
    assert same(compiled.forward_dynamics(y[:2], y[2:]), python.forward_dynamics(y[:2], y[2:]))


Q, V, F = np.array([0.1, -0.4]), np.array([0.7, 0.2]), np.array([1.5, -2.0])
Y, N = np.linspace(-0.2, 0.5, 8), np.array([1.0, 0.0, 2.5])
DYNAMICS = [
    call(Q, V),
    call(Q, V, F),
    call(Q, V, F, 0.3, {"g": 9.0}, u={"push": 2.0}),
    call(v=V, q=Q, tau=F),
    call(Q, v=V, vd=F),
    call(np.stack((Q, V), 1), np.stack((V, Q), 1), F),
    call(Q, V, [1, 2]),
    call(Q, V, np.array([1.0, np.nan])),
    call(Q, V[:1], F),
    call(Q, V, F, "x"),
    call(Q, V, F * 1e200),
    call(),
]
IMPACTS = [
    call(0.0, Y, 0),
    call(0.0, Y, 2, 0.5),
    call(0.0, Y, 1, p={"g": 1.0}, bounce=0.25),
    call(0.0, Y, True),
    call(0.0, Y, 3),
    call(0.0, Y, -1),
    call(0.0, Y, "a"),
    call(0.0, Y, 1, np.nan),
    call(0.0, Y[:3], 1),
    call(0.0, Y * 1e200, 1),
]
HELD = [
    call(0.0, Y, N),
    call(0.0, Y, forces=N, p={"g": 1.0}),
    call(0.5, Y, 2 * N),
    call(0.0, np.stack((Y, Y), 1), N),
    call(0.0, Y, N[:2]),
    call(0.0, Y, np.array([1.0, np.inf, 0.0])),
    call(0.0, Y, 1.0),
]


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("scene", "name", "calls"),
    [
        ("cart_pole", "forward_dynamics", DYNAMICS),
        ("cart_pole", "inverse_dynamics", DYNAMICS),
        ("bouncing_two_body", "impact", IMPACTS),
        ("bouncing_two_body", "held", HELD),
    ],
)
def test_functions_of_more_than_the_state(
    scene: str, name: str, calls: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their arguments by place and by name, right and wrong. At least three are computed in C."""
    compiled, python = pair(scene)
    ours, theirs = getattr(compiled, name), getattr(python, name)
    wanted = [anything(lambda c=c: theirs(*c.args, **c.kwargs)) for c in calls]
    for given, right in zip(calls, wanted, strict=True):
        assert same(anything(lambda c=given: ours(*c.args, **c.kwargs)), right), given
    assert {isinstance(right, str) for right in wanted} == {True, False}
    monkeypatch.setattr(python, f"_{name}", None)  # the Python module can compute it no more
    found = [anything(lambda c=c: ours(*c.args, **c.kwargs)) for c in calls]
    both = zip(found, wanted, strict=True)
    assert sum(same(one, right) for one, right in both if not isinstance(right, str)) >= 3


PROGRAM = """
#include <stdio.h>
#include "NAME.h"
int main(void) {
    NAME_real p[NPARAMETERS], k[NCONSTANTS + 1], y[NSTATES], u[NINPUTS + 1] = {0}, out[NSTATES];
    NAME_defaults(p);
    if (NAME_constants(p, k)) return 1;
    NAME_initial_state(0, y, k, u, y);
    NAME_derivative(0, y, k, u, out);
    for (int i = 0; i < NSTATES; i++) printf("%.17g\\n", (double)out[i]);
    p[0] = -1;
    printf("%s\\n", NAME_refusal(NAME_constants(p, k)));
    return 0;
}
"""


@pytest.mark.every(2)
@pytest.mark.parametrize("scene", some(FEW, built_in_names()))
@pytest.mark.parametrize("real", ["double", "float"])
def test_it_stands_alone(scene: str, real: str, tmp_path: Path) -> None:
    """Source, header and a program of ten lines: no warning, and the derivative at the start."""
    assert main(["generate", scene, "--backend", "c", "-o", str(tmp_path)]) == 0
    text = PROGRAM.replace("NAME", scene)
    for word in ("STATES", "INPUTS", "PARAMETERS", "CONSTANTS"):
        text = text.replace(f"N{word}", f"{scene.upper()}_{word}")
    (tmp_path / "main.c").write_text(text, "utf-8")
    flags = [*STRICT, "-Wdouble-promotion", "-DEOMGEN_FLOAT"] if real == "float" else [*STRICT]
    kernels = [str(CC), *flags, "-c", f"{scene}.c"]
    program = [str(CC), "-std=c99", *flags[-1:], "main.c", f"{scene}.o", "-o", "run", "-lm"]
    for command in (kernels, program):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    done = subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=False)
    if real == "float" and scene in NOT_IN_FLOAT:
        assert done.returncode == 1 or "nan" in done.stdout, "it works now: see docs/c.md"
        return
    assert done.returncode == 0
    *numbers, refusal = done.stdout.split("\n")[:-1]
    _, python = pair(scene)
    wanted = python.derivative(0.0, python.initial_state())
    found = np.array([float(x) for x in numbers])
    if real == "double":
        assert same(found, wanted)
    else:
        assert found == pytest.approx(wanted, rel=1e-4, abs=1e-4 * np.max(np.abs(wanted)))
    first = next(iter(python.PARAMETERS))
    outcome = result(lambda: python.derivative(0.0, python.initial_state(), {first: -1.0}))
    assert bool(refusal) == isinstance(outcome, str)


def test_the_header_is_checked_and_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file whose header is another is stale, and written again; a header of others is not."""
    generate = ["generate", "pendulum", "--backend", "c", "-o", str(tmp_path)]
    source, header = tmp_path / "pendulum.c", tmp_path / "pendulum.h"
    assert main(generate) == 0 and main([*generate, "--check"]) == 0
    right = header.read_text("utf-8")
    header.write_text(right + "int more;\n", "utf-8")
    assert main([*generate, "--check"]) == 1
    assert capsys.readouterr().out.endswith("pendulum.c, pendulum.h: stale\n")
    assert main(generate) == 0 and header.read_text("utf-8") == right
    source.unlink()
    header.write_text("mine", "utf-8")
    assert main(generate) == 1 and header.read_text("utf-8") == "mine" and not source.exists()
    assert "pendulum.h: exists and was not written by eomgen" in capsys.readouterr().err


def test_names_of_c_are_no_names_here(tmp_path: Path) -> None:
    """Parameters and bodies that go by its keywords, functions and macros."""
    words = "double M_PI NAN INFINITY linux y0 restrict fabs sin_cos R real HUGE_VAL unix k".split()
    text = (BUILT_IN / "pendulum.toml").read_text("utf-8").replace('"closed"', '"aba"')
    text += "[parameters]\n" + "".join(f"{word} = {1 + i}.0\n" for i, word in enumerate(words))
    text += "".join(
        f'[[effects]]\ntype = "external_torque"\nname = "e{i}"\nbody = "bob"\ntorque = "{word}"\n'
        for i, word in enumerate(words)
    )
    scene = tmp_path / "named.toml"
    scene.write_text(text, "utf-8")
    compiled, python = pair(scene)
    y = np.array([0.3, -0.2])
    assert same(compiled.derivative(0.0, y), python.derivative(0.0, y))


# The compiler.


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An empty store, and no compiler that was found before."""
    compiler._found.cache_clear()
    monkeypatch.setenv("EOMGEN_CACHE", str(tmp_path / "store"))
    monkeypatch.delenv("CC", raising=False)
    yield tmp_path
    compiler._found.cache_clear()


def script(path: Path, text: str) -> str:
    """An executable file of the shell."""
    path.write_text(f"#!/bin/sh\n{text}\n", "utf-8")
    path.chmod(0o700)
    return str(path)


def test_which_compiler_is_taken(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That in CC, with its arguments; else cc, gcc, clang on the path; zig; or one line."""
    monkeypatch.setenv("CC", f"{CC} -O0")
    assert compiler.find_compiler().command == (str(CC), "-O0")
    for chosen in ("/nowhere/cc", "false", "'"):
        monkeypatch.setenv("CC", chosen)
        with pytest.raises(
            RunError, match=r"^CC: '.*' does not run; name gcc or clang, or unset it$"
        ):
            compiler.find_compiler()
    monkeypatch.delenv("CC")
    folder = fresh / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        RunError, match=r"^no C compiler was found; .* pip install 'eomgen\[compiled"
    ):
        compiler.find_compiler()
    for name in ("clang", "gcc", "cc"):  # each comes before those before it
        compiler._found.cache_clear()
        made = script(folder / name, "echo a compiler")
        assert compiler.find_compiler().command == (made,)


def test_a_compiler_that_fails(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first error in one line; the next call, with a good one, goes on."""
    says = 'case "$1" in --version) echo mine;; *) echo "x.c:1: error: no room" >&2; exit 1;; esac'
    monkeypatch.setenv("CC", script(fresh / "bad", says))
    made = eomgen.generate("pendulum", backend="c")
    with pytest.raises(RunError, match=r"^/.*/bad: x\.c:1: error: no room$"):
        eomgen.load(made)
    monkeypatch.delenv("CC")
    assert eomgen.load(made).derivative(0.0, np.zeros(2)).shape == (2,)


def test_a_library_is_compiled_once(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is kept under its source, compiler and flags; one that was damaged is made again."""
    calls = fresh / "calls"
    monkeypatch.setenv("CC", script(fresh / "cc", f'echo "$@" >> {calls}\nexec {CC} "$@"'))

    def compiled() -> int:
        return sum("checked.c" in line for line in calls.read_text().splitlines())

    made = eomgen.generate("pendulum", backend="c")
    wanted = eomgen.load(made).derivative(0.0, np.ones(2))
    assert compiled() == 1
    eomgen.load(eomgen.generate("pendulum", backend="c"))
    assert compiled() == 1
    (entry,) = (fresh / "store" / "native").glob("*.entry")
    content = bytearray(entry.read_bytes())
    content[len(content) // 2] ^= 1
    entry.write_bytes(content)
    assert same(eomgen.load(made).derivative(0.0, np.ones(2)), wanted)
    assert compiled() == 2
    monkeypatch.setattr(library, "LEVELS", ("-O1", "-O1"))
    eomgen.load(made)
    assert compiled() == 3


@pytest.mark.parametrize("place", ["store", "temporary"])
def test_where_nothing_can_be_written(
    place: str, fresh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A store without room is done without; no place for files at all is one line."""
    made = eomgen.generate("pendulum", backend="c")
    if place == "store":
        monkeypatch.setenv("EOMGEN_CACHE", "/dev/null/store")
        assert eomgen.load(made).derivative(0.0, np.zeros(2)).shape == (2,)
        return
    monkeypatch.setattr(compiler.tempfile, "tempdir", "/nowhere")
    with pytest.raises(RunError, match=r"^the compiled module cannot be made: No such file"):
        eomgen.load(made)


@pytest.mark.apart
def test_several_at_once_and_one_killed(fresh: Path) -> None:
    """Processes that compile the same scene, one of them stopped midway, leave a sound store."""
    code = "import eomgen, numpy; made = eomgen.generate('pendulum', route='aba', backend='c'); "
    code += "m = eomgen.load(made); "
    code += "print(m.derivative(0.0, numpy.ones(2)).tobytes().hex())"
    command = [sys.executable, "-c", code]
    slow = script(fresh / "slow", f'case "$1" in --version) ;; *) sleep 60;; esac; exec {CC} "$@"')
    killed = subprocess.Popen(command, env={**os.environ, "CC": slow}, stdout=subprocess.DEVNULL)
    other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    made = eomgen.load(eomgen.generate("pendulum", route="aba", backend="c"))
    said = other.communicate()[0]
    killed.kill()
    killed.wait()
    python = eomgen.load(eomgen.generate("pendulum", route="aba"))
    again = eomgen.load(eomgen.generate("pendulum", route="aba", backend="c"))
    for module in (python, made, again):
        assert module.derivative(0.0, np.ones(2)).tobytes().hex() + "\n" == said


def test_a_library_says_what_it_holds() -> None:
    """Sizes, and outputs with their shapes, as the module has them."""
    made = eomgen.generate("cart_pole", backend="c")
    held = library.built(made.library)
    assert tuple((ctypes.c_long * 4).in_dll(held, "sizes"))[:3] == (4, 1, 5)
    compiled = eomgen.load(made)
    assert compiled.jacobian.__doc__ == "Exact Jacobian of `derivative` with respect to the state."
    assert compiled.STATES == pair("cart_pole")[1].STATES


def test_the_page_on_c_is_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its program is compiled by its command and prints what it says."""
    page = (Path(__file__).parent.parent.parent / "docs" / "c.md").read_text("utf-8")
    (text,) = re.findall(r"^```c\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    command, wanted = re.findall(r"^```sh\n(.*)\n# prints (.*)\n```", page, re.MULTILINE)[0]
    (tmp_path / "main.c").write_text(text, "utf-8")
    monkeypatch.chdir(tmp_path)
    assert main("generate two_body --backend c -o .".split()) == 0
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
    assert done.stdout == f"{wanted}\n"
    (text,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    capsys.readouterr()
    exec(compile(text, "docs/c.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == re.findall(r"# prints (.*)", text)
