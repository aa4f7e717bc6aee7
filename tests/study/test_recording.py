"""What results hold beside states, in tables that others read."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.commands.main import main
from eomgen.run.trajectory import load_npz, save_csv, table_of

SAVED = ("energy", "joint_forces", "point_positions", "works", "inputs", "momentum", "mass_matrix")


def test_results_hold_what_was_asked_for(tmp_path: Path) -> None:
    """Each row is what the module gives there; an archive gives all of it back."""
    run = eomgen.simulate(
        "cart_pole", t_end=0.5, samples=21, save=SAVED, inputs={"push": lambda t: 2 * t}
    )
    module = eomgen.load(run.module)
    assert run.saved["energy"].tolist() == run.energy.tolist()
    assert run.trajectory.works is not None
    assert np.allclose(run.saved["inputs"][:, 0], 2 * run.t)
    for name in ("joint_forces", "point_positions", "momentum", "mass_matrix"):
        for k in (0, 7, 20):
            u = {"push": 2 * float(run.t[k])}
            row = getattr(module, name)(float(run.t[k]), run.y[k], None, u)
            assert np.array_equal(run.saved[name][k], row), name
    table = table_of(run.trajectory)
    assert table["joint_forces_pin_mz"].tolist() == run.saved["joint_forces"][:, 1, 2].tolist()
    assert table["point_positions_tip_y"].tolist() == run.saved["point_positions"][:, 0, 1].tolist()
    assert (
        table["mass_matrix_theta_dot_x_dot"].tolist() == run.saved["mass_matrix"][:, 1, 0].tolist()
    )
    assert len(table) == len({*table}) and all(len(column) == 21 for column in table.values())
    *_, archive, _ = run.save(tmp_path)
    again = load_npz(archive)
    assert {*again.saved} == {*run.saved}
    for name, values in run.saved.items():
        assert again.saved[name].values.tobytes() == values.tobytes()
        assert again.saved[name].columns == run.trajectory.saved[name].columns


def test_pandas_numpy_and_parquet_read_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line of names, the same numbers in each; files of others stay."""
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    run = ["simulate", "pendulum", "--t-end", "0.2", "--no-pictures", "-o", str(tmp_path)]
    for _ in range(2):
        assert main([*run, "--save", "energy,joint_forces", "--parquet"]) == 0
    table = table_of(load_npz(tmp_path / "pendulum.npz"))
    by_pandas = pandas.read_csv(tmp_path / "pendulum.csv")
    by_parquet = pandas.read_parquet(tmp_path / "pendulum.parquet")
    by_numpy = np.genfromtxt(tmp_path / "pendulum.csv", delimiter=",", names=True)
    for read in (by_pandas, by_parquet):
        assert [*read.columns] == [*table]
        for name in table:  # pandas rounds the last bit of text
            assert np.allclose(read[name], table[name], rtol=1e-15, atol=0)
    assert [*by_numpy.dtype.names] == [*table]
    assert np.array_equal(by_numpy["energy"], table["energy"])
    (tmp_path / "pendulum.parquet").write_bytes(b"PAR1 mine")
    assert main([*run, "--parquet"]) == 1
    assert "pendulum.parquet: exists and was not written by eomgen" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr("eomgen.run.parquet.find_spec", lambda name: None)
    assert main([*run, "--parquet"]) == 1
    assert "--parquet: needs pyarrow; run: pip install 'eomgen[parquet]'" in capsys.readouterr().err


def test_repeated_times_at_impacts_are_marked(tmp_path: Path) -> None:
    """Rows with event 0 have times of their own; the others follow an impact at their time."""
    run = eomgen.simulate("bouncing_two_body", t_end=2.0, save=["joint_forces"])
    impacts = run.trajectory.counts["impacts"]
    struck = run.trajectory.struck
    assert impacts > 2 and np.count_nonzero(struck) == impacts
    assert np.all(np.diff(run.t[struck == 0]) > 0)
    after = np.flatnonzero(struck)
    assert np.array_equal(run.t[after], run.t[after - 1])
    assert np.all(struck[after] == struck[after - 1] + 1)
    assert [*table_of(run.trajectory)][:2] == ["t", "event"]
    save_csv(run.trajectory, tmp_path / "run.csv")
    table = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    assert np.array_equal(table["event"], struck)
    assert "event" not in table_of(eomgen.simulate("pendulum", t_end=0.1).trajectory)


def test_forces_under_a_held_contact_are_not_made_up() -> None:
    """A ball that lies on the floor: what its contact force would change is nan, and said."""
    ball: dict[str, Any] = {
        "name": "ball",
        "bodies": [{"name": "ball", "mass": 1.0, "inertia_com": 0.1}],
        "joints": [
            {"name": "lift", "type": "prismatic", "parent": "world", "child": "ball",
             "axis": [0, 1], "coordinate": "h"}
        ],
        "effects": [
            {"type": "gravity", "g": 9.81},
            {"type": "contact", "name": "floor", "law": "impact", "body": "ball",
             "restitution": 0.0},
        ],
        "initial": {"q": {"h": 0.1}},
    }  # fmt: skip
    run = eomgen.simulate(ball, t_end=1.0, save=["joint_forces", "energy"])
    lies = run.t > run.trajectory.held[next(iter(run.trajectory.held))]
    assert lies.any() and not lies.all()
    assert np.isnan(run.saved["joint_forces"][lies]).all()
    assert np.isfinite(run.saved["joint_forces"][run.t < 0.1]).all()
    assert np.isfinite(run.saved["energy"]).all()
    assert any("forces are nan where a rigid contact is held" in line for line in run.warnings)


def test_what_cannot_be_saved_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown name, and an output that the scene lacks."""
    for name, message in (
        ("energi", "--save: no 'energi' can be saved (did you mean 'energy'?)"),
        ("jacobian", "--save: no 'jacobian' can be saved"),
        ("points", "--save: 'point_positions' needs points, and there are none"),
    ):
        assert main(["simulate", "pendulum", "--save", name]) == 1
        assert message in capsys.readouterr().err
