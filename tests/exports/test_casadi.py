"""CasADi's functions of a scene: what the Python module computes, and the derivatives of it."""

import sys
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import eomgen
from eomgen.commands.main import main

pytestmark = pytest.mark.apart

CORNERS: dict[str, Any] = {
    "name": "corners",
    "bodies": [{"name": "block", "mass": 2.0, "inertia_com": 0.1}],
    "joints": [
        {
            "name": "rail",
            "type": "prismatic",
            "parent": "world",
            "child": "block",
            "axis": [1, 0],
            "coordinate": "x",
        }
    ],
    "effects": [
        {"type": "motor", "name": name, "joint": "rail", "torque": torque}
        for name, torque in {
            "one": "abs(x) - abs(x_dot) + min(x, 3*x) + max(x, 2*x_dot)",
            "other": "(x if x > x_dot else 5*x_dot) + step(x) + sqrt(2 + x) + atan2(x, 2)",
            "third": "asin(x/2) + tanh(x)*exp(x_dot) - log(2 + x)*acos(x/3) + tan(x) + atan(x_dot)",
        }.items()
    ],
}
LANDING: dict[str, Any] = {
    "name": "landing",
    "bodies": [{"name": "ball", "mass": 1.0, "inertia_com": 0.1}],
    "joints": [{"name": "flight", "type": "free", "child": "ball"}],
    "effects": [
        {"type": "gravity", "g": 9.81},
        {"type": "contact", "name": "floor", "law": "hunt_crossley", "body": "ball",
         "radius": 0.2, "stiffness": 1e3, "dissipation": 0.2, "friction": 0.4,
         "slip_speed": 0.05},
        {"type": "contact", "name": "wall", "law": "spring_damper", "body": "ball",
         "radius": 0.1, "stiffness": 1e3, "damping": 5.0, "normal": [1, 0]},
    ],
}  # fmt: skip


def close(found: Any, wanted: Any) -> bool:
    """Within 1e-12 of the largest entry, or of 1."""
    size = max(1.0, float(np.abs(wanted).max(initial=0.0)))
    return bool(np.abs(np.ravel(found) - np.ravel(wanted)).max(initial=0.0) <= 1e-12 * size)


def check_at(functions: Any, module: Any, y: Any, t: float = 0.3) -> None:
    """All functions at a state, and the Jacobian by CasADi."""
    rng = np.random.default_rng(7)
    u = rng.uniform(-2.0, 2.0, len(functions.u))
    p = np.array(functions.p) * rng.uniform(0.97, 1.03, len(functions.p))
    for name, function in functions.items():
        if function.n_in() > 4 or name == "initial_state" or not hasattr(module, name):
            continue
        found, wanted = function(t, y, p, u).full(), getattr(module, name)(t, y, p, u)
        assert found.size == np.size(wanted) and close(found, wanted), name
    slope = functions["derivative"].factory("slope", ["t", "y", "p", "u"], ["jac:derivative:y"])
    assert close(slope(t, y, p, u).full(), module.jacobian(t, y, p, u))


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "source",
    [
        *("cart_pole", "babyboot", "tumbling_body", "bouncing_two_body"),
        *("four_bar", CORNERS, LANDING),
    ],
    ids=lambda source: source if isinstance(source, str) else source["name"],
)
def test_functions_are_those_of_the_module(source: Any) -> None:
    """Values and Jacobians, with parameters of their own: in the plane and in space, with loops,
    with contacts in the air and on the ground, and on both sides of corners.
    """
    functions = eomgen.casadi_functions(source)
    module: Any = eomgen.load(eomgen.generate(source))
    assert (functions.states, functions.inputs) == (module.STATES, tuple(module.INPUTS))
    assert dict(zip(functions.parameters, functions.p, strict=True)) == module.PARAMETERS
    assert close(functions.y, module.initial_state())
    assert functions.units.items() <= module.UNITS.items()
    rng = np.random.default_rng(3)
    for _ in range(3):
        y = np.array(functions.y) + rng.uniform(-0.4, 0.4, len(functions.y))
        check_at(functions, module, y)


def test_a_corner_has_the_derivative_of_the_branch_taken() -> None:
    """As in the module, where a slope by limits would be neither."""
    functions, module = eomgen.casadi_functions(CORNERS), eomgen.load(eomgen.generate(CORNERS))
    check_at(functions, module, np.zeros(2))


def test_functions_of_further_values() -> None:
    """Forward dynamics is the inverse of inverse dynamics."""
    functions = eomgen.casadi_functions(
        "furuta_pendulum", outputs=["forward_dynamics", "inverse_dynamics", "body_poses"]
    )
    y = [0.3, 0.4, -0.2, 0.7]
    vd = functions["forward_dynamics"](0.0, y, functions.p, functions.u, [0.1, -0.3])
    assert functions["forward_dynamics"].name_in() == ["t", "y", "p", "u", "tau"]
    back = functions["inverse_dynamics"](t=0, y=y, p=functions.p, u=functions.u, vd=vd)
    assert close(back["inverse_dynamics"].full(), [0.1, -0.3])
    assert functions["body_poses"].size_out(0)[1] == 4  # rows: bodies and x, y, z


def test_the_exported_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is read without this program, computes the same, and is replaced; others' files are not.

    It says which outputs it cannot hold.
    """
    path = tmp_path / "cart.casadi"
    command = ["export", "cart_pole", "--casadi", "-o", str(path)]
    assert main(command) == main(command) == 0
    assert "left out: forward_dynamics, inverse_dynamics" in capsys.readouterr().err
    loaded = casadi.Function.load(str(path))
    functions = eomgen.casadi_functions("cart_pole")
    given = (0.0, functions.y, functions.p, [1.5])
    for name, value in zip(loaded.name_out(), loaded(*given), strict=True):
        assert close(value.full(), functions[name](*given).full()), name
    text = path.read_bytes()
    main(command)
    assert path.read_bytes() == text
    path.write_text("mine", "utf-8")
    assert main(command) == 1 and path.read_text("utf-8") == "mine"


@pytest.mark.parametrize("library", ["casadi", "control"])
def test_without_the_library(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line says what to install."""
    monkeypatch.setitem(sys.modules, library, None)
    call = eomgen.casadi_functions if library == "casadi" else eomgen.state_space
    with pytest.raises(eomgen.RunError, match=rf"pip install 'eomgen\[{library}\]'"):
        call("cart_pole")
