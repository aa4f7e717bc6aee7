"""Fits: sensitivities, intervals, what data do not tell, what may be given as data."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fit_cases import CASES, SWING, Table

import eomgen
from eomgen.api.given import check
from eomgen.commands.main import main
from eomgen.fitting.motion import Motion, Rows, Samples

NAMES = ["m_A", "I_A", "x_A", "theta_dot"]


def rows_of(backend: str, move: int | None = None, by: float = 0.0) -> Rows:
    """A motion of two_body with a moved parameter or state."""
    model = check("two_body")
    motion = Motion(model, NAMES, (("kinetic_energy", 0),), (), rtol=1e-10, backend=backend)
    p = np.array([x.default for x in model.parameters])
    start = motion.start(p, {})
    start[3 * 8], start[4 * 8 + 6] = 1.0, 1.0
    if move in (0, 1):
        p[move] += by
    elif move is not None:
        start[(0, 6)[move - 2]] += by
    samples = Samples(np.linspace(0.0, 1.0, 21), np.zeros((1, 0)))
    return motion.rows(p, start, np.ones(len(start)), samples)


@pytest.mark.parametrize("move", range(4))
def test_sensitivities_are_derivatives_of_the_motion(move: int) -> None:
    """By differences of motions, of states and of an output; the same bits in C and in Python."""
    exact, other = rows_of("c"), rows_of("numpy")
    ahead, behind = rows_of("c", move, 1e-5), rows_of("c", move, -1e-5)
    for values, slopes in (("states", "slopes"), ("measured", "measured_slopes")):
        found = (getattr(ahead, values) - getattr(behind, values)) / 2e-5
        known = getattr(exact, slopes)[:, move]
        assert np.allclose(known, found, rtol=1e-6, atol=1e-6 * (1 + np.max(np.abs(known))))
        assert np.array_equal(getattr(exact, slopes), getattr(other, slopes))


@pytest.mark.parametrize("name", ["swing", "sled"])
def test_intervals_cover_the_truth(name: str) -> None:
    """As often as they say; `tests/campaigns/fits.py` has all ten experiments and more draws."""
    case, hits = CASES[name], []
    for seed in range(25):
        data, options = case.draw(seed)
        found = eomgen.fit(case.source, data, case.names, **options)
        hits += [low <= case.true(n) <= high for n, (low, high) in found.intervals.items()]
        assert found.rank == len(found.values)
    assert 0.88 <= np.mean(hits) <= 0.995


def test_a_prior_adds_what_it_knows() -> None:
    """Of b and m the motion tells b/m alone, so m and its deviation are those of the prior."""
    case = CASES["prior"]
    data, _ = case.draw(3)
    found = eomgen.fit(SWING, data[0], ["m", "b"], priors={"m": (0.6, 0.05)})
    alone = eomgen.fit(SWING, data[0], ["b"])
    assert found.values["m"] == pytest.approx(0.6)
    assert found.covariance[0, 0] == pytest.approx(0.05**2, rel=1e-6)
    assert found.values["b"] / 0.6 == pytest.approx(alone.values["b"] / 0.5, rel=1e-6)
    assert found.correlation[0, 1] > 0.99


def test_what_the_data_do_not_tell_is_said() -> None:
    """A combination, a value without effect, and a column that is nothing of the scene."""
    data, _ = CASES["swing"].draw(0)
    found = eomgen.fit(SWING, {**data[0], "battery": data[0]["t"]}, ["m", "b", "l"])
    assert found.rank == 2 and np.isinf(found.covariance[0, 0])
    assert not np.isfinite(found.intervals["b"]).any() and np.isfinite(found.intervals["l"]).all()
    apart, left = found.notes
    assert apart.startswith("m and b cannot be told apart") and "m by +1 %, b by +1 %" in apart
    assert left.endswith("battery") and found.left_out == ("battery",)
    still = {"t": np.linspace(0.0, 1.0, 20), "x_A": 0.6 * np.linspace(0.0, 1.0, 20)}
    state = {"theta_dot": 0.0, "phi_dot": 0.0, "theta_deg": 90.0, "phi": 0.0}
    found = eomgen.fit("two_body", still, ["x_A_dot", "g"], state=state)
    assert found.notes == ("g has no effect on what is measured",)
    assert found.values["x_A_dot"] == pytest.approx(0.6)


def test_data_may_be_files_tables_and_mappings(tmp_path: Path) -> None:
    """With the same bits; an angle in degrees, and samples that are missing."""
    data, options = CASES["cart_pole"].draw(1)
    names = CASES["cart_pole"].names
    path = tmp_path / "log.csv"
    every = {**data[0], "state": ["ok"] * len(data[0]["t"])}
    rows = zip(*every.values(), strict=True)
    lines = (",".join("" if x != x else str(x) for x in row) for row in rows)
    path.write_text("\n".join([",".join(every), *lines]))
    kinds: list[Any] = [data[0], [data[0]], Table(data[0]), path, str(path)]
    found = [eomgen.fit("cart_pole", kind, names, **options) for kind in kinds]
    assert len({repr(list(each.values.values())) for each in found}) == 1
    assert found[-1].left_out == ("state",)
    plain = {name: x for name, x in data[0].items() if name != "theta"}
    turned = {**plain, "theta_deg": np.degrees(data[0]["theta"])}
    in_degrees = eomgen.fit("cart_pole", turned, names, **options)
    assert in_degrees.values["m_pole"] == pytest.approx(found[0].values["m_pole"], rel=1e-6)
    of_x = eomgen.fit("cart_pole", plain, names, **options)
    wanted = eomgen.fit("cart_pole", data[0], names, measured=["x"], **options)
    assert of_x.values == wanted.values and wanted.left_out == ("theta",)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": ["bb"]}, "names: no parameter or state 'bb' (did you mean 'b'?)"),
        ({"names": []}, "names: there are none"),
        ({"names": ["b"], "data": {"theta": [1.0]}}, "data: has no column t"),
        ({"data": {"t": [0.0, 1.0], "theta": [1.0]}}, "data: theta has 1 values and t has 2"),
        ({"data": {"t": [0.0, 0.0], "theta": [1.0, 1.0]}}, "data: the times t must be"),
        ({"data": {"t": [0.0, 1.0], "x": [1.0, 1.0]}}, "data: none of its columns is a state"),
        ({"data": {"t": [0.0, 1.0], "theta": [np.nan] * 2}}, "data: theta has no finite value"),
        ({"data": 3.0}, "data: float is none"),
        ({"data": []}, "data: there is none"),
        ({"data": "nowhere.csv"}, "nowhere.csv: cannot be read"),
        ({"names": ["b", "l", "theta"], "data": {"t": [0, 1], "theta": [1, 1]}}, "data: 2 samples"),
        ({"bounds": {"b": (1, 0)}}, "bounds: b has none above 1"),
        ({"bounds": {"m": (0, 1)}}, "bounds: 'm' is not fitted"),
        ({"priors": {"b": 3.0}}, "priors: b: give mean and deviation"),
        ({"priors": {"b": (1.0, 0.0)}}, "priors: the deviation of b is not > 0"),
        ({"noise": {"theta": 0.0}}, "noise: theta: give a positive deviation"),
        ({"measured": ["thet"]}, "measured: no measured column 'thet' (did you mean 'theta'?)"),
        ({"source": "four_bar"}, "fit: takes trees of bodies"),
        ({"source": "bouncing_two_body", "names": ["m_A"]}, "fit: rigid contacts strike"),
    ],
)
def test_what_cannot_be_fitted_is_said(change: dict[str, Any], words: str) -> None:
    """In one line."""
    t = np.linspace(0.0, 1.0, 11)
    given = {"source": SWING, "data": {"t": t, "theta": t, "x_A": t}, "names": ["b"], **change}
    with pytest.raises(eomgen.RunError, match=r"^[^\n]*$") as raised:
        eomgen.fit(**given)
    assert str(raised.value).startswith(words)


def test_the_command_prints_values_and_what_is_not_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And takes bounds, priors and noise."""
    monkeypatch.chdir(tmp_path)
    Path("swing.toml").write_text(SWING)
    data, _ = CASES["swing"].draw(0)
    table = np.column_stack([data[0]["t"], data[0]["theta"]])
    np.savetxt("log.csv", table, delimiter=",", header="t,theta", comments="")
    options = "--bound l=0.1:2 --bound b=0: --prior m=0.5:0.01 --noise theta=0.01 --set b=0.02"
    assert main(f"fit swing.toml log.csv --names b,l,m,theta {options}".split()) == 0
    printed = capsys.readouterr().out
    assert "    l      0.600" in printed and "rank        4 of 4" in printed
    assert "swing: fitted to 60 samples" in printed and "noise       theta 0.01" in printed
    assert main(["fit", "swing.toml", "log.csv", "--names", "b", "--bound", "b=1"]) == 1
    assert capsys.readouterr().err == "eomgen: b=1: gives one number; write two, b=0.1:2\n"
