"""Trajectories: what they refuse to be, and files that give back every bit."""

import os
from dataclasses import fields, replace

import numpy as np
import pytest

from eomgen.errors import RunError
from eomgen.run.trajectory import COUNTS, Event, Trajectory, load_npz, save_csv, save_npz

# Numbers that a careless format loses: no short decimal, subnormal, huge, minus zero.
AWKWARD = np.array([[0.1 + 0.2, -0.0], [5e-324, 1.7976931348623157e308], [1 / 3, -2e-17]])
RUN = Trajectory(
    name="four bar",
    states=("crank", "Δ,rate"),
    t=np.array([0.0, 0.1, 0.1 + 2e-17 + 1 / 3]),
    y=AWKWARD,
    integrator="rk4",
    finished=False,
    message="stopped at t = 0.43, crank=0.3: the state left the finite numbers",
    counts={"steps": 2, "derivatives": 8, "jacobians": 0, "impacts": 1, "capped": 0, "cut": 0},
    events=(
        Event(0.1, "floor_crank", "impact", 1 / 3),
        Event(0.4, "floor_crank", "rest", 5e-324),
    ),
)
FINISHED = replace(RUN, finished=True, message="")
WORKED = replace(FINISHED, works=AWKWARD[:, ::-1], work_names=("gravity", "air"))


def bits(array):
    return array.dtype, array.shape, array.tobytes()


def same(one, other):
    for field in fields(Trajectory):
        mine, its = getattr(one, field.name), getattr(other, field.name)
        if isinstance(mine, np.ndarray):
            mine, its = bits(mine), bits(its)
        if (type(mine), mine) != (type(its), its):
            return False
    return True


# --- the value ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": [0.0, 1.0]}, r"y has shape \(3, 2\), not \(2, 2\)"),
        ({"states": ("crank",)}, r"y has shape \(3, 2\), not \(3, 1\)"),
        ({"t": [], "y": np.empty((0, 2))}, r"t has shape \(0,\), not \(n,\) with n >= 1"),
        ({"t": [[0.0, 1.0, 2.0]]}, r"t has shape \(1, 3\)"),
        ({"y": np.where(AWKWARD < 0, np.nan, AWKWARD)}, "t or y is not finite"),
        ({"t": [0.0, 1.0, 0.5]}, "t decreases"),
        ({"counts": {"steps": 2}}, "counts are"),
        ({"works": AWKWARD}, r"works have shape \(3, 2\), not \(3, 0\)"),
    ],
)
def test_what_does_not_fit_together_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(RUN, **change)


def test_arrays_are_read_only_copies():
    t, y = np.array([0.0]), np.array([[1.0]])
    counts = dict.fromkeys(COUNTS, 0)
    trajectory = Trajectory("one", ("x",), t, y, "rk4", True, "", counts)
    y[0, 0] = counts["steps"] = 7
    assert trajectory.y[0, 0] == 1.0
    assert trajectory.counts["steps"] == 0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.y[0, 0] = 2.0


# --- .npz ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("trajectory", [RUN, FINISHED, WORKED])
def test_npz_gives_every_bit_back_and_the_same_bytes_again(trajectory, tmp_path):
    first, second = tmp_path / "run.npz", tmp_path / "deeper" / "again"
    save_npz(trajectory, first)
    loaded = load_npz(first)
    assert same(loaded, trajectory)
    save_npz(loaded, second)
    assert second.read_bytes() == first.read_bytes()
    save_npz(FINISHED, first)  # ours, so it may be replaced
    assert load_npz(first).finished


def test_npz_is_recognisable_and_needs_no_pickle(tmp_path):
    path = tmp_path / "run.npz"
    save_npz(RUN, path)
    assert b"eomgen" in path.read_bytes()[:100]
    with np.load(path, allow_pickle=False) as members:
        assert members.files == [
            *("eomgen", "t", "y", "states", "name"),
            *("integrator", "finished", "message", "counts", "events", "event_names"),
        ]
        assert str(members["eomgen"]) == "trajectory 2"


def error_of(action, *arguments):
    with pytest.raises(RunError) as caught:
        action(*arguments)
    return str(caught.value)


def test_npz_that_cannot_be_read(tmp_path):
    missing, foreign, older = (tmp_path / name for name in ("missing", "foreign", "older"))
    assert error_of(load_npz, missing) == f"{missing}: cannot be read: No such file or directory"
    foreign.write_bytes(b"PK\x03\x04 and so on")
    assert error_of(load_npz, foreign) == f"{foreign}: is no trajectory written by eomgen"
    with older.open("wb") as file:
        np.savez(file, eomgen=np.array("trajectory 1"))
    assert error_of(load_npz, older) == (
        f"{older}: is in format 'trajectory 1', but this eomgen reads 'trajectory 2'; "
        "simulate again"
    )


def test_damaged_npz_is_an_error_or_harmless(tmp_path):
    path = tmp_path / "run.npz"
    save_npz(RUN, path)
    whole = path.read_bytes()
    noise = np.random.default_rng(0)
    for cut in noise.integers(0, len(whole), 50):
        path.write_bytes(whole[:cut])
        assert error_of(load_npz, path).startswith(f"{path}: is ")
    for place, flip in zip(
        noise.integers(0, len(whole), 400), noise.integers(1, 256, 400), strict=True
    ):
        damaged = bytearray(whole)
        damaged[place] ^= flip
        path.write_bytes(damaged)
        try:
            assert same(load_npz(path), RUN)  # a date, say
        except RunError as error:
            assert "\n" not in str(error)


class Trap:
    """Makes a folder when it is unpickled."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (self.folder,)


def test_code_in_npz_is_not_run(tmp_path):
    path, sprung = tmp_path / "run.npz", tmp_path / "sprung"
    with path.open("wb") as file:
        trap = np.array([Trap(str(sprung))], dtype=object)
        np.savez(file, eomgen=np.array("trajectory 2"), name=trap)
    assert error_of(load_npz, path).endswith("; simulate again")
    assert not sprung.exists()


# --- .csv ---------------------------------------------------------------------------------------


def test_csv_reads_back_exactly(tmp_path):
    path = tmp_path / "run.csv"
    save_csv(FINISHED, path)
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[0] == "# eomgen trajectory of four bar, integrator rk4"
    assert lines[1] == 't,crank,"Δ,rate"'
    assert lines[2] == "0.0,0.30000000000000004,-0.0"
    table = np.loadtxt(path, delimiter=",", skiprows=2)
    assert bits(np.ascontiguousarray(table[:, 0])) == bits(RUN.t)
    assert bits(np.ascontiguousarray(table[:, 1:])) == bits(RUN.y)


def test_csv_holds_works_that_were_asked_for(tmp_path):
    path = tmp_path / "run.csv"
    save_csv(WORKED, path)
    assert path.read_text(encoding="utf-8").split("\n")[1] == (
        't,crank,"Δ,rate",work_gravity,work_air'
    )
    table = np.loadtxt(path, delimiter=",", skiprows=2)
    assert bits(np.ascontiguousarray(table[:, 3:])) == bits(WORKED.works)


def test_csv_says_on_one_line_that_it_is_unfinished(tmp_path):
    path = tmp_path / "run.csv"
    save_csv(replace(RUN, name="four\nbar"), path)
    assert path.read_text(encoding="utf-8").split("\n")[0] == (
        "# eomgen trajectory of four bar, integrator rk4, unfinished: "
        "stopped at t = 0.43, crank=0.3: the state left the finite numbers"
    )
    assert np.loadtxt(path, delimiter=",", skiprows=2).shape == (3, 3)


# --- files that are not ours --------------------------------------------------------------------


@pytest.mark.parametrize("save", [save_npz, save_csv])
def test_a_foreign_file_is_not_overwritten(save, tmp_path):
    path = tmp_path / "thesis"
    path.write_bytes(b"years of work")
    assert "was not written by eomgen" in error_of(save, RUN, path)
    assert path.read_bytes() == b"years of work"
    save(RUN, path, force=True)
    save(RUN, path)
    assert list(tmp_path.iterdir()) == [path]
