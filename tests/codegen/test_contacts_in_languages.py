"""An imported robot on the ground that touches itself: all languages give its accelerations."""

import json
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from importer import begun, instance, sizes
from live import NODE

import eomgen

pytestmark = pytest.mark.apart

STATES = 100
LINK = """<link name="{}"><inertial><mass value="{}"/>
<inertia ixx="0.02" iyy="0.03" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry>{}</geometry></collision></link>"""
JOINT = """<joint name="{1}_joint" type="revolute"><origin xyz="{2}" rpy="0.1 0 0.2"/>
<parent link="{0}"/><child link="{1}"/><axis xyz="0 1 0.2"/><limit lower="-1" upper="1"/></joint>"""
LINKS = {
    "trunk": (3.0, '<box size="0.4 0.3 0.1"/>'),
    "thigh": (1.0, '<capsule radius="0.06" length="0.3"/>'),
    "shin": (1.0, '<cylinder radius="0.05" length="0.2"/>'),
    "head": (1.0, '<sphere radius="0.1"/>'),
    "tail": (1.0, '<box size="0.1 0.1 0.2"/>'),
}
JOINTS = [
    *(("trunk", "thigh", "0.1 0 -0.2"), ("thigh", "shin", "0.1 0 -0.3")),
    *(("trunk", "head", "0.3 0 0.1"), ("head", "tail", "-0.1 0.1 0.2")),
]


def imported() -> dict[str, Any]:
    """The tables of a robot with contacts, its inputs 0."""
    links = "".join(LINK.format(name, *rest) for name, rest in LINKS.items())
    joints = "".join(JOINT.format(*joint) for joint in JOINTS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "crouching.urdf"
        path.write_text(f'<robot name="crouching">{links}{joints}</robot>')
        return dict(eomgen.import_robot(path, floating=True, self_contacts=True).tables)


@cache
def robot() -> tuple[dict[str, Any], Any, np.ndarray, np.ndarray]:
    """The scene, its Python module, and rows of states with their derivatives."""
    tables = imported()
    module = eomgen.load(eomgen.generate(tables))
    rng = np.random.default_rng(0)
    start = np.array(module.initial_state())
    states = start + 0.8 * rng.normal(size=(STATES, len(start)))
    return tables, module, states, np.array([module.derivative(0.0, y) for y in states])


def close(found: Any) -> bool:
    """Whether derivatives are those of Python, to rounding."""
    wanted = robot()[-1]
    error = np.abs(np.asarray(found) - wanted).max(axis=1) / np.abs(wanted).max(axis=1)
    return bool(error.max() < 1e-11)


def test_states_press_on_the_ground_and_on_other_links() -> None:
    """What is compared is not of a robot in the air: each contact acts in some states."""
    tables, _, states, derivatives = robot()
    for effect in (e["name"] for e in tables["effects"] if e["type"] == "contact"):
        others = [e for e in tables["effects"] if e.get("name") != effect]
        without = eomgen.load(eomgen.generate(tables | {"effects": others}))
        changed = [np.abs(without.derivative(0.0, y) - d).max() > 1.0
                   for y, d in zip(states, derivatives, strict=True)]  # fmt: skip
        assert sum(changed) > 10


@pytest.mark.parametrize("backend", ["c", "jax"])
def test_modules_agree(backend: str) -> None:
    """C and JAX."""
    if backend == "jax":
        pytest.importorskip("jax").config.update("jax_enable_x64", True)
    tables, _, states, _ = robot()
    module = eomgen.load(eomgen.generate(tables, backend=backend))
    assert close([module.derivative(0.0, y) for y in states])


@pytest.mark.skipif(NODE is None, reason="needs node")
def test_javascript_agrees(tmp_path: Path) -> None:
    """As exported."""
    tables, _, states, _ = robot()
    (path,) = eomgen.export(tables, "javascript", tmp_path)
    script = tmp_path / "run.mjs"
    script.write_text(
        f'import {{ derivative }} from "./{path.name}";\n'
        f"console.log(JSON.stringify({states.tolist()}.map((y) => [...derivative(0, y)])));\n"
    )
    done = subprocess.run([str(NODE), str(script)], capture_output=True, text=True, check=True)
    assert close(json.loads(done.stdout))


def test_a_unit_agrees(tmp_path: Path) -> None:
    """In model exchange."""
    fmpy = pytest.importorskip("fmpy")
    tables, _, states, _ = robot()
    path = eomgen.export(tables, "fmu", tmp_path / "unit.fmu")[0]
    found = []
    with instance(path, "ModelExchange") as (unit, _):
        begun(unit, 1.0)
        unit.enterContinuousTimeMode()
        size, _ = sizes(unit)
        buffer = (fmpy.fmi3.fmi3Float64 * size)()
        for y in states:
            unit.setTime(0.0)
            buffer[:] = y.tolist()
            unit.setContinuousStates(buffer, size)
            unit.getContinuousStateDerivatives(buffer, size)
            found.append(list(buffer))
    assert close(found)
