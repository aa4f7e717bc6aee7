"""The step of exported JavaScript is that of the stepper, and of runs."""

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from crank_rocker import STOPPED, four_bar
from falling_block import BLOCK
from live import NODE

import eomgen
from eomgen.codegen import constraints

pytestmark = [pytest.mark.apart, pytest.mark.skipif(NODE is None, reason="needs node")]


def stepped(scene: str, method: str, y: list[float], count: int, folder: Path) -> list[float]:
    """The state after some steps of 1 ms, by node."""
    (module,) = eomgen.export(scene, "javascript", folder, integrator=method)
    script = folder / "run.mjs"
    script.write_text(
        f"""import {{ step }} from "./{module.name}";
let y = {y};
for (let i = 0; i < {count}; i += 1) y = step(i * 1e-3, 1e-3, y);
let why = "";
try {{ step(0, 1e-3, y.map(() => 1e300)); }} catch (error) {{ why = error.message; }}
console.log(JSON.stringify([y, why]));
"""
    )
    done = subprocess.run([str(NODE), str(script)], capture_output=True, text=True, check=True)
    found, why = json.loads(done.stdout)
    assert why.startswith("there is no step here") or scene == BLOCK  # which has room there
    return found  # type: ignore[no-any-return]


def test_a_step_is_that_of_the_stepper(tmp_path: Path) -> None:
    """The same bits, where the derivative has no sines."""
    step = eomgen.stepper("tumbling_body", dt=1e-3, backend="numpy")
    y = step.initial()
    found = stepped("tumbling_body", "rk4", y.tolist(), 5, tmp_path)
    for i in range(5):
        y = step(y, t=i * 1e-3)
    assert found == y.tolist()


@pytest.mark.parametrize(("scene", "count"), [(BLOCK, 700), (STOPPED, 1000)])
def test_rigid_contacts_strike_and_are_held(scene: str, count: int, tmp_path: Path) -> None:
    """With loops, too, to the motion of the stepper: sines differ."""
    step = eomgen.stepper(scene, dt=1e-3)
    y = step.initial()
    found = stepped(scene, "rk4", y.tolist(), count, tmp_path)
    for i in range(count):
        step(y, t=i * 1e-3, out=y)
    np.testing.assert_allclose(found, y, atol=1e-9)


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("method", "rows"),
    [("euler", True), ("gauss_6", False), ("gauss_6", True), ("leapfrog_4", True)],
)
def test_steps_keep_loops(
    method: str, rows: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside our own run of the same method, also without the Jacobian of constraints."""
    scene = four_bar()
    if not rows:
        monkeypatch.setattr(constraints, "LARGEST_JACOBIAN", 0)
        scene = scene.replace("four_bar", "without_rows")
    unstable: dict[str, Any] = {"unstable": True} if method == "euler" else {}
    run = eomgen.simulate(
        scene, t_end=0.02, samples=2, dt=1e-3, integrator=method, backend="numpy", **unstable
    )
    found = stepped(scene, method, run.y[0].tolist(), 20, tmp_path)
    np.testing.assert_allclose(found, run.y[-1], rtol=1e-12, atol=1e-12)
