"""WebAssembly steps as firmware does, to the same bits."""

import json
import re
import subprocess
from base64 import b64encode
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import chromium, missing
from firmware import Firmware
from live import NODE, run_in_node

import eomgen
from eomgen.api.given import model_of, read
from eomgen.base.errors import RunError, SceneError

pytestmark = pytest.mark.apart

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
def test_the_page_of_firmware_shows_how(tmp_path: Path) -> None:
    """Its block in JavaScript, with a `fetch` that reads the file."""
    page = Path(__file__).parents[2] / "docs/howto/firmware.md"
    (block,) = re.findall(r"```javascript\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    eomgen.export("cart_pole", "wasm", tmp_path / "cart_pole.wasm")
    read = (
        "import { readFileSync } from 'node:fs';\nconst fetch = (name) => readFileSync(name);\n"
        "WebAssembly.instantiateStreaming = (bytes) => WebAssembly.instantiate(bytes);\n"
    )
    (tmp_path / "page.mjs").write_text(f"{read}{block}console.log(JSON.stringify([...state]));")
    run = subprocess.run(
        [NODE or "node", "page.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    native = Firmware("cart_pole", "double", "", "-ffp-contract=off")
    start = np.array([0.0, 0.1, 0.0, 0.0])
    assert json.loads(run.stdout) == native.stepped(start, np.zeros(1), 0.01, 1).tolist()


@zig
@pytest.mark.skipif(bool(missing()), reason=missing())
def test_a_page_steps_as_firmware_does(tmp_path: Path) -> None:
    """In a browser: to the same bits, with an input that is set there, and it plays."""
    (path,) = eomgen.export("cart_pole", "wasm_page", tmp_path / "made.html")
    native = Firmware("cart_pole", "double", "", "-ffp-contract=off")
    with chromium() as browser:
        page, errors = browser.new_page(), []
        page.on("pageerror", lambda error: errors.append(error))
        page.goto(path.as_uri())
        (force,) = (i.name for i in model_of(read("cart_pole"), "cart_pole").inputs)
        page.fill(f"#inputs-{force}", "0.5")
        start, end = page.evaluate(
            "() => { const y = [...eomgen.y]; eomgen.step(200); return [y, [...eomgen.y]]; }"
        )
        page.click("#play")
        page.wait_for_function("eomgen.t > 2.1")
        assert page.inner_text("#play") == "Pause" and not errors
    dt = read("cart_pole").simulation.dt
    assert end == native.stepped(np.array(start), np.array([0.5]), dt, 200).tolist()


@zig
def test_other_functions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="wasm: the scene uses atan2"):
        eomgen.export("four_bar", "wasm", tmp_path / "made.wasm")


def test_without_a_compiler_it_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(RunError, match=r"pip install 'eomgen\[compiled\]'"):
        eomgen.export("pendulum", "wasm", tmp_path / "made.wasm")
