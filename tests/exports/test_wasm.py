"""WebAssembly steps as firmware does, to the same bits."""

from base64 import b64encode
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from firmware import Firmware
from live import run_in_node

import eomgen
from eomgen.errors import RunError, SceneError

STEPS = """
const module = new WebAssembly.Module(Buffer.from(given.module, "base64"));
const of = new WebAssembly.Instance(module).exports, call = (name) => of[`${given.name}_${name}`];
let free = (of.__heap_base.value + 7) & ~7;
const room = (n) => { const at = free; free += 8 * n; return at; };
of.memory.grow(1);
const [p, k, y, u] = [1000, 1000, given.y.length, given.u.length + 1].map(room);
const numbers = (at, n) => new Float64Array(of.memory.buffer, at, n);
numbers(y, given.y.length).set(given.y), numbers(u, given.u.length).set(given.u);
call("defaults")(p);
if (call("constants")(p, k) !== 0) throw new Error("refused");
for (let i = 0; i < given.count; i++) call("step")(i * given.dt, given.dt, y, k, u);
return { y: [...numbers(y, given.y.length)], imports: WebAssembly.Module.imports(module).length };
"""
zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="there is no compiler for it")


@zig
@pytest.mark.parametrize(("scene", "method"), [("cart_pole", ""), ("tumbling_body", "")])
def test_steps_have_the_bits_of_firmware(scene: str, method: str, tmp_path: Path) -> None:
    (path,) = eomgen.export(scene, "wasm", tmp_path / "made.wasm", integrator=method)
    native = Firmware(scene, "double", method, "-ffp-contract=off")
    y = np.linspace(0.3, 0.9, native.states)
    u = np.array([0.5] * (scene == "cart_pole"))
    given: dict[str, Any] = {
        "module": b64encode(Path(path).read_bytes()).decode(),
        "name": native.name,
        "y": y.tolist(),
        "u": u.tolist(),
        "dt": 0.01,
        "count": 200,
    }
    found = run_in_node("", STEPS, given, scripts=())
    assert found["imports"] == 0
    assert found["y"] == native.stepped(y, u, 0.01, 200).tolist()


@zig
def test_other_functions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="wasm: the scene uses atan2"):
        eomgen.export("four_bar", "wasm", tmp_path / "made.wasm")


def test_without_a_compiler_it_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(RunError, match=r"pip install 'eomgen\[compiled\]'"):
        eomgen.export("pendulum", "wasm", tmp_path / "made.wasm")
