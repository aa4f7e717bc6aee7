"""Functions for MATLAB, as Octave computes them, beside those of the Python modules.

    python -m pytest -n0 tests/campaigns/octave.py

It needs the program `octave-cli`.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).parent.parent / name) for name in ("", "exports")]
from test_matlab import SCENES, arguments, checked, files


def test_octave_computes_the_same(tmp_path: Path) -> None:
    """It reads the files and returns the same bits; it refuses a state of another length, and
    parameters that make no mechanism.
    """
    script, wanted = [], []
    for source in SCENES:
        found, module = files(source)
        given = "; ".join(
            f"{name} = [{' '.join(map(repr, values.tolist()))}]'"
            for name, values in zip("ypu", arguments(module), strict=True)
        )
        script += [f"{given};"]
        for name, text in found.items():
            (tmp_path / name).write_text(text, "utf-8")
            if output := checked(module, name):
                called = f"r = {name[:-2]}(0.3, y, p, u)"
                script += [f"{called}; printf('%.17g ', r'); disp('');"]
                wanted.append(getattr(module, output)(0.3, *arguments(module)))
    # At a corner the branch taken is that of the module, as its derivatives show.
    script += ["printf('%.17g ', corners_jacobian(0, [0; 0])'); disp('');"]
    wanted.append(module.jacobian(0.0, np.zeros(2)))
    script += [
        "try; cart_pole(0, 1); catch e; disp(e.message); end",
        "try; cart_pole(0, [0 0 0 0], [-1 1 1 1 1]); catch e; disp(e.message); end",
        "disp(size(cart_pole()));",
    ]
    (tmp_path / "all_of_them.m").write_text("\n".join(script), "utf-8")
    command = ["octave-cli", "--norc", "--path", str(tmp_path), str(tmp_path / "all_of_them.m")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    *lines, short, negative, start = done.stdout.splitlines()
    assert len(lines) == len(wanted) > 30, done.stderr
    for line, value in zip(lines, wanted, strict=True):
        assert np.array_equal([float(x) for x in line.split()], np.ravel(value))
    assert short == "cart_pole: y, p and u need 4, 5 and 1 numbers"
    assert negative == "cart_pole: mass of cart: change the parameters"
    assert start.split() == ["4", "1"]
