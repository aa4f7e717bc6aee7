"""How long it takes to get a chain's equations of motion as code: eomgen against SymPy's Kane.

    pytest tests/benchmarks/bench_generation.py
    FULL=1 pytest tests/benchmarks/bench_generation.py      (chains of up to 200 links; minutes)

Planar chains of equal rods on the world, under gravity. Kane's method solves for the accelerations
symbolically and finds common subexpressions (in SymPy's quickest way, order="none"), which is what
its users do for code without a matrix inverse; its generalised coordinates are joint angles, as
eomgen's are, or absolute angles, with which it is faster.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import sympy as sp
from pytest_benchmark.fixture import BenchmarkFixture
from sympy.physics.mechanics import (
    KanesMethod,
    Point,
    ReferenceFrame,
    RigidBody,
    dynamicsymbols,
    inertia,
)

FULL = "FULL" in os.environ
LINKS = (10, 20, 50, 100, 200) if FULL else (10, 100)
KANE_JOINT = (5, 10) if FULL else (5,)
KANE_ABSOLUTE = (10, 30, 50) if FULL else (10,)

SCENE = """
name = "chain"
effects = [{{ type = "gravity", g = 9.81 }}]

[[chains]]
name = "link"
count = {links}
mass = 1.0
inertia_com = 0.1
r_parent = [0.5, 0]
r_child = [-0.5, 0]
"""


@pytest.mark.parametrize("links", LINKS)
def test_eomgen(benchmark: BenchmarkFixture, tmp_path: Path, links: int) -> None:
    """`eomgen generate`, a whole process with an empty store."""
    scene = tmp_path / "chain.toml"
    scene.write_text(SCENE.format(links=links))
    benchmark.group = "generation"
    environment = {**os.environ, "EOMGEN_CACHE": str(tmp_path / "store")}
    command = [sys.executable, "-m", "eomgen", "generate", str(scene), "-o", str(tmp_path / "out")]

    def run() -> None:
        (tmp_path / "out" / "chain.py").unlink(missing_ok=True)
        for kept in (tmp_path / "store").glob("*"):
            kept.unlink()
        subprocess.run(command, env=environment, check=True, capture_output=True)

    benchmark.pedantic(run, rounds=3)
    module = (tmp_path / "out" / "chain.py").read_text()
    assert f'"link_joint_{links}_angle",' in module
    benchmark.extra_info["kilobytes"] = len(module) // 1000


@pytest.mark.parametrize("links", KANE_JOINT)
def test_kane_joint_angles(benchmark: BenchmarkFixture, links: int) -> None:
    """SymPy, each angle from the link before."""
    benchmark.group = "generation"
    benchmark.pedantic(lambda: kane(links, absolute=False), rounds=1)


@pytest.mark.parametrize("links", KANE_ABSOLUTE)
def test_kane_absolute_angles(benchmark: BenchmarkFixture, links: int) -> None:
    """SymPy, each angle from the x axis."""
    benchmark.group = "generation"
    benchmark.pedantic(lambda: kane(links, absolute=True), rounds=1)


def kane(links: int, *, absolute: bool) -> tuple[list[tuple[sp.Expr, sp.Expr]], list[sp.Expr]]:
    """Common subexpressions and accelerations of the chain."""
    q = dynamicsymbols(f"q:{links}")
    u = dynamicsymbols(f"u:{links}")
    g = sp.Symbol("g")
    world = ReferenceFrame("N")
    pin = Point("O")
    pin.set_vel(world, 0)
    bodies: list[RigidBody] = []
    forces = []
    base, rate = world, sp.Integer(0)
    for k in range(links):
        m, moment, length = sp.symbols(f"m{k} I{k} l{k}")
        frame = (world if absolute else base).orientnew(f"B{k}", "Axis", (q[k], world.z))
        rate = u[k] if absolute else rate + u[k]
        frame.set_ang_vel(world, rate * world.z)
        centre = pin.locatenew(f"C{k}", length / 2 * frame.x)
        centre.v2pt_theory(pin, world, frame)
        body = RigidBody(f"R{k}", centre, frame, m, (inertia(frame, 0, 0, moment), centre))
        bodies.append(body)
        forces.append((centre, -m * g * world.y))
        pin = pin.locatenew(f"P{k}", length * frame.x)
        pin.v2pt_theory(centre, world, frame)
        base = frame
    rates = [a.diff() - b for a, b in zip(q, u, strict=True)]
    method = KanesMethod(world, q_ind=q, u_ind=u, kd_eqs=rates)
    method.kanes_equations(bodies, forces)
    accelerations = method.mass_matrix.LUsolve(method.forcing)
    found = sp.cse(accelerations, order="none")
    return found[0], list(found[1][0])
