"""Base parameters: the published set, and that they are all that inverse dynamics depends on."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fit_cases import SWING

import eomgen
from eomgen.api.identifying import told_by
from eomgen.commands.main import main
from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.regressor import inertial_parameters, regressor
from eomgen.fitting.base_parameters import base_parameters
from eomgen.scalars.floats import FloatScalars

D3, R3, D4, R4 = 0.4318, 0.15005, 0.0203, 0.4318
PUMA = ((0, 0, 0), (-90, 0, 0), (0, D3, R3), (-90, D4, R4), (90, 0, 0), (-90, 0, 0))
"""α (degrees), d and r of joints in modified Denavit-Hartenberg frames: Khalil and Kleinfinger."""
ENTRIES = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz", "mx", "my", "mz", "m")


def puma(tilt: float = 0.0) -> dict[str, Any]:
    """The arm as a scene: the axes of each body are the frame of its joint."""
    names = [f"link_{j}" for j in range(1, 7)]
    joints = []
    for j, (alpha, d, r) in enumerate(PUMA):
        a = math.radians(alpha)
        joints.append(
            {
                "name": f"joint_{j + 1}",
                "type": "revolute",
                "parent": names[j - 1] if j else "world",
                "child": names[j],
                "axis": [0, 0, 1],
                "orientation_deg": [alpha + (tilt if j == 0 else 0.0), 0, 0],
                "r_parent": [d, -round(math.sin(a)) * r, round(math.cos(a)) * r],
            }
        )
    body = {"mass": 1.0, "inertia_com": [0.1, 0.1, 0.1]}
    return {
        "name": "puma",
        "dimensions": 3,
        "bodies": [{"name": name, **body} for name in names],
        "joints": joints,
        "effects": [{"type": "gravity", "g": 9.81}],
    }


def published() -> dict[str, dict[str, float]]:
    """The grouping of Gautier and Khalil (1990), also in Khalil and Dombre, Modeling,
    Identification and Control of Robots (2002): from the last joint on Iyy, mz and m of link j are
    added to its Ixx and to those of link j - 1; link 1, which turns about the vertical, has Izz.
    """
    sums = {f"link_{j}.{e}": {f"link_{j}.{e}": 1.0} for j in range(1, 7) for e in ENTRIES}

    def add(to: str, factor: float, what: str) -> None:
        for name, x in sums[what].items():
            sums[to][name] = sums[to].get(name, 0.0) + factor * x

    for j in range(6, 1, -1):
        alpha, d, r = PUMA[j - 1]
        s, c = round(math.sin(math.radians(alpha))), round(math.cos(math.radians(alpha)))
        own, below = f"link_{j}.", f"link_{j - 1}."
        yy, mz, m = (own + e for e in ("Iyy", "mz", "m"))
        factors: dict[str, tuple[float, float, float]] = {
            "Ixx": (1.0, 2 * r, r * r),
            "Ixy": (0.0, d * s, d * r * s),
            "Ixz": (0.0, -d * c, -d * r * c),
            "Iyy": (c * c, 2 * r * c * c, d * d + r * r * c * c),
            "Iyz": (c * s, 2 * r * c * s, r * r * c * s),
            "Izz": (s * s, 2 * r * s * s, d * d + r * r * s * s),
            "mx": (0.0, 0.0, d),
            "my": (0.0, -s, -r * s),
            "mz": (0.0, c, r * c),
            "m": (0.0, 0.0, 1.0),
        }
        for entry, (of_yy, of_mz, of_m) in factors.items():
            add(below + entry, of_yy, yy)
            add(below + entry, of_mz, mz)
            add(below + entry, of_m, m)
        add(own + "Ixx", -1.0, yy)
    kept = [f"link_{j}.{e}" for j in range(2, 7) for e in ENTRIES if e not in ("Iyy", "mz", "m")]
    return {name: {k: x for k, x in sums[name].items() if x} for name in ("link_1.Izz", *kept)}


def test_those_of_the_puma_are_the_published_ones() -> None:
    """36 of 60, each with what is added to it: names, signs and numbers."""
    found = base_parameters(eomgen.check(puma()))
    ours = {
        str(name): {str(name): 1.0, **{str(other): x for other, x in group}}
        for name, group in found.groups.items()
    }
    known = published()
    assert found.exact and found.rank == 36 and len(found.every) == 60
    assert ours.keys() == known.keys()
    for name, group in known.items():
        assert ours[name] == pytest.approx(group, rel=1e-12), name


def test_the_built_in_puma_has_rotors_beside() -> None:
    """Those of joints 1 and 2 are not told apart from the links."""
    found = base_parameters(eomgen.check("puma560"))
    assert found.rank == 40
    alone = [str(name) for name in found.groups if name.what == "rotor"]
    assert alone == [f"joint_{j}.rotor" for j in (3, 4, 5, 6)]


@pytest.mark.parametrize(
    ("scene", "rank"),
    [("double_pendulum", 6), ("two_body", 7), ("cart_pole", 4), ("tumbling_body", 10)],
)
def test_nothing_else_changes_inverse_dynamics(scene: str, rank: int) -> None:
    """Their number is the numeric rank over other random states."""
    found = base_parameters(eomgen.check(scene))
    assert found.rank == rank
    matrix = numeric(scene)
    assert np.linalg.matrix_rank(matrix, tol=1e-9 * np.linalg.norm(matrix)) == rank


def test_turns_that_are_not_rational_have_60_digits() -> None:
    """A tilted base: gravity turns with joint 1, so link 1 has more. A right angle that is only
    near one, as files of robots have it, is one.
    """
    found = base_parameters(eomgen.check(puma(20.0)))
    assert not found.exact and found.rank == 38
    found = base_parameters(eomgen.check(puma(1e-13)))
    assert not found.exact and found.rank == 36


def test_sensors_tell_some_parameters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An angle tells ratios; with the tip's place the length, too. The command says what does not
    follow, and which states there are.
    """
    model = eomgen.check(SWING)
    by_angle, by_tip = (told_by(model, [n], 3.0) for n in ("theta", "point_positions.tip.x"))
    assert (by_angle.rank, by_tip.rank, len(by_tip.parameters)) == (2, 3, 4)
    assert by_tip.lines[0].startswith("m and b cannot be told apart")
    monkeypatch.chdir(tmp_path)
    Path("swing.toml").write_text(SWING)
    assert main(["check", "swing.toml", "--identifiable", "theta"]) == 0
    printed = capsys.readouterr().out
    assert "base        3 of 4 inertial parameters, known exactly" in printed
    assert "no effect   rod.m\n" in printed and "told        2 of 4 parameters by theta" in printed
    for wrong, words in (
        (["swing.toml", "--identifiable", "thet"], "no measured column 'thet' (did you mean"),
        (["four_bar", "--identifiable"], "base parameters are those of trees"),
        (["bouncing_two_body", "--identifiable", "x_A"], "rigid contacts strike"),
    ):
        assert main(["check", *wrong]) == 1
        assert words in capsys.readouterr().err


def numeric(scene: str) -> np.ndarray:
    """The regressor over random states, in doubles."""
    model, rng, rows = eomgen.check(scene), np.random.default_rng(3), []
    for _ in range(12):
        q = rng.normal(size=len(model.coordinates))
        for indices in map(list, model.quaternions):
            q[indices] /= np.linalg.norm(q[indices])
        v, vd = rng.normal(size=(2, len(model.velocities)))
        values = Values(model.defaults, {}, q.tolist(), v.tolist(), {}, 0.0)
        dynamics = Dynamics(model, values, FloatScalars(), "own")
        every = inertial_parameters(model, dynamics)
        rows.append(np.array(regressor(dynamics, vd.tolist(), every), dtype=float).T)
    return np.concatenate(rows)
