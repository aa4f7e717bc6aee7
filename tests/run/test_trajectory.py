"""Trajectories: validation, and files that preserve every bit."""

import csv
import io
import os
import zipfile
from dataclasses import fields, replace

import numpy as np
import pytest

from eomgen.base.errors import RunError
from eomgen.run.archive import checked, packed, unpacked
from eomgen.run.origin import Origin
from eomgen.run.setup import Setup
from eomgen.run.trajectory import (
    COUNTS,
    Event,
    Outcome,
    Trajectory,
    load_npz,
    save_csv,
    save_npz,
)

# Numbers that a careless format loses: no short decimal, subnormal, huge, minus zero.
AWKWARD = np.array([[0.1 + 0.2, -0.0], [5e-324, 1.7976931348623157e308], [1 / 3, -2e-17]])
RUN = Trajectory(
    name="four bar",
    states=("crank", "Δ,rate"),
    t=np.array([0.0, 0.1, 0.1 + 2e-17 + 1 / 3]),
    y=AWKWARD,
    integrator="rk4",
    finished=False,
    message="stopped at t = 0.43, crank=0.3: the state overflows or is not a number",
    counts={"steps": 2, "derivatives": 8, "jacobians": 0, "impacts": 1, "capped": 0, "cut": 2},
    events=(
        Event(0.1, "floor_crank", "impact", 1 / 3),
        Event(0.4, "floor_crank", "rest", 5e-324),
    ),
)
FINISHED = replace(RUN, finished=True, message="", outcome=Outcome())
WORKED = replace(FINISHED, works=AWKWARD[:, ::-1], work_names=("gravity", "air"))
KEPT = replace(
    FINISHED,
    resume={"t": np.array(0.1), "y": AWKWARD[1], "held": np.empty(0)},
    origin=Origin({"body 'a'": "0f", "form": "1e"}, {"m": 0.1 + 0.2, "g": -0.0}, {"u": 5e-324}),
    setup=Setup('{"name": "½"}', {"m": 0.1 + 0.2}, {}, AWKWARD),
)


def bits(array):
    return array.dtype, array.shape, array.tobytes()


def same(one, other):
    for field in fields(Trajectory):
        mine, its = getattr(one, field.name), getattr(other, field.name)
        if isinstance(mine, np.ndarray):
            mine, its = bits(mine), bits(its)
        if isinstance(mine, dict) and field.name == "resume":
            mine, its = ({name: bits(array) for name, array in d.items()} for d in (mine, its))
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


@pytest.mark.parametrize("trajectory", [RUN, FINISHED, WORKED, KEPT])
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
            *("integrator", "finished", "message", "outcome"),
            *("counts", "events", "event_names", "digest"),
        ]
        assert str(members["eomgen"]) == "trajectory 5"


def error_of(action, *arguments):
    with pytest.raises(RunError) as caught:
        action(*arguments)
    return str(caught.value)


def test_npz_that_cannot_be_read(tmp_path):
    missing, foreign, older = (tmp_path / name for name in ("missing", "foreign", "older"))
    assert error_of(load_npz, missing) == f"{missing}: cannot be read: No such file or directory"
    foreign.write_bytes(b"PK\x03\x04 and so on")
    assert error_of(load_npz, foreign) == f"{foreign}: is not a trajectory written by eomgen"
    older.write_bytes(packed({"eomgen": np.array("trajectory 1")}))
    assert error_of(load_npz, older) == (
        f"{older}: is in format 'trajectory 1', but this eomgen reads 'trajectory 5'; "
        "simulate again"
    )


def test_damaged_npz_is_an_error_or_harmless(tmp_path):
    path = tmp_path / "run.npz"
    save_npz(RUN, path)
    whole = path.read_bytes()
    noise = np.random.default_rng(0)
    for cut in noise.integers(0, len(whole), 20):
        path.write_bytes(whole[:cut])
        assert error_of(load_npz, path).startswith(f"{path}: is ")
    for place, flip in zip(
        noise.integers(0, len(whole), 150), noise.integers(1, 256, 150), strict=True
    ):
        damaged = bytearray(whole)
        damaged[place] ^= flip
        path.write_bytes(damaged)
        try:
            assert same(load_npz(path), RUN)  # a date, say
        except RunError as error:
            assert "\n" not in str(error)


def test_every_flipped_bit_of_the_names_is_refused_or_harmless(tmp_path):
    """In what follows the content, which no checksum of zip covers: names, offsets, lengths."""
    path = tmp_path / "run.npz"
    save_npz(KEPT, path)
    whole = path.read_bytes()
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        begin = archive.start_dir
    refused = 0
    for bit in range(8 * begin, 8 * len(whole), 1 if os.environ.get("FULL") else 71):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            assert same(load_npz(path), KEPT)
        except RunError as error:
            refused += 1
            assert str(error) == f"{path}: is damaged; simulate again"
    assert refused > 50


def members_of(path):
    return checked(unpacked(path.read_bytes()))


@pytest.mark.parametrize(
    "change",
    [
        {"y": np.array([["a", "b"]] * 3)},
        {"y": AWKWARD + 1j},
        {"y": np.zeros((3, 2), dtype=np.float32)},
        {"t": np.zeros((3, 1))},
        {"counts": np.zeros((6, 2), dtype=np.int64)},
        {"states": np.array([1.0, 2.0])},
        {"name": np.array(["a", "b"])},
        {"finished": np.array("yes")},
        {"scene": np.array(["part"])},
        {"parameters": np.zeros(7)},
        {"resume_t": np.array(0.5 + 1j)},
        {"resume_t": np.array("soon")},
        {"more": np.zeros(2)},
        {"t": None},
        {"event_names": None},
        {"inputs_names": None},
        {"setup_scene": np.zeros(3)},
        {"setup_scene": np.array([255], dtype=np.uint8)},
        {"setup_varying": np.zeros(3)},
        {"work_names": np.array(["gravity"])},
    ],
    ids=str,
)
def test_what_no_run_writes_is_refused_though_its_digest_is_right(change, tmp_path):
    path = tmp_path / "run.npz"
    save_npz(KEPT, path)
    changed = {k: v for k, v in (members_of(path) | change).items() if v is not None}
    path.write_bytes(packed(changed))
    assert error_of(load_npz, path) == f"{path}: is damaged; simulate again"


def test_an_archive_that_would_grow_is_refused(tmp_path):
    """Compressed members, and a header that claims a terabyte."""
    path = tmp_path / "run.npz"
    with path.open("wb") as file:
        np.savez_compressed(file, eomgen=np.array("trajectory 4"), t=np.zeros(10**6))
    assert error_of(load_npz, path) == f"{path}: is damaged; simulate again"
    save_npz(KEPT, path)
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in members_of_kept().items():
            stream = io.BytesIO()
            np.lib.format.write_array(stream, array)
            content = stream.getvalue()
            if name == "t":
                content = content.replace(b"(3,), }", b"(999999999999,), }")
            archive.writestr(f"{name}.npy", content)
    assert error_of(load_npz, path) == f"{path}: is damaged; simulate again"


def members_of_kept():
    return {"eomgen": np.array("trajectory 4"), "t": KEPT.t, "y": KEPT.y}


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
        np.savez(file, eomgen=np.array("trajectory 4"), name=trap)
    assert error_of(load_npz, path).endswith("; simulate again")
    assert not sprung.exists()


# --- .csv ---------------------------------------------------------------------------------------


def test_csv_reads_back_exactly(tmp_path):
    path = tmp_path / "run.csv"
    save_csv(FINISHED, path)
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[0] == 't,crank,"Δ,rate"'
    assert lines[1] == "0.0,0.30000000000000004,-0.0"
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert bits(np.ascontiguousarray(table[:, 0])) == bits(RUN.t)
    assert bits(np.ascontiguousarray(table[:, 1:])) == bits(RUN.y)


def test_csv_holds_works_that_were_asked_for(tmp_path):
    path = tmp_path / "run.csv"
    save_csv(WORKED, path)
    assert path.read_text(encoding="utf-8").split("\n")[0] == (
        't,crank,"Δ,rate",work_gravity,work_air'
    )
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert bits(np.ascontiguousarray(table[:, 3:])) == bits(WORKED.works)


def test_csv_is_what_others_read(tmp_path):
    """A line of column names, then lines with exactly one number for each."""
    path = tmp_path / "run.csv"
    save_csv(replace(RUN, states=("crank", "rate")), path)
    assert not RUN.finished
    table = np.genfromtxt(path, delimiter=",", names=True)
    assert table.dtype.names == ("t", "crank", "rate")
    assert bits(table["t"]) == bits(RUN.t) and bits(table["rate"]) == bits(RUN.y[:, 1])
    # So does pandas.read_csv, which is no dependency: by the first line, and by commas.
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["crank"]) for row in rows] == RUN.y[:, 0].tolist()


def test_a_table_is_ours_by_the_archive_beside_it(tmp_path):
    """If the archive has the same columns, but not without an archive, or with other columns."""
    path = tmp_path / "run.csv"
    path.write_text("t,crank\n0,1\n")
    assert "was not written by eomgen" in error_of(save_csv, RUN, path)
    save_npz(RUN, tmp_path / "run.npz")
    assert "was not written by eomgen" in error_of(save_csv, RUN, path)
    assert path.read_text() == "t,crank\n0,1\n"
    path.unlink()
    for _ in range(2):
        save_csv(RUN, path)
    save_csv(WORKED, path)  # which has more columns


# --- files that are not ours --------------------------------------------------------------------


@pytest.mark.parametrize("save", [save_npz, save_csv])
def test_a_foreign_file_is_not_overwritten(save, tmp_path):
    path = tmp_path / "thesis.x"
    path.write_bytes(b"years of work")
    assert "was not written by eomgen" in error_of(save, RUN, path)
    assert path.read_bytes() == b"years of work"
    save(RUN, path, force=True)
    if save is save_npz:
        save(RUN, path)
    assert list(tmp_path.iterdir()) == [path]
