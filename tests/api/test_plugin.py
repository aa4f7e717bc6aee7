"""Another package adds an effect, a joint, a constraint, a backend and an integrator.

`tests/plugin` is such a package. It is installed into a folder, and used from another process.
"""

import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest
from campaign import FULL

ROOT = Path(__file__).parent.parent.parent
PLUGIN = ROOT / "tests" / "plugin"
BOAT = (PLUGIN / "boat.toml").read_text("utf-8")
USE = f"""
import numpy as np
import eomgen
from eomgen.model.elaborate import elaborate
from eomgen.scene.json_schema import json_schema
from eomgen.scene.reference import reference
from eomgen.show.effect_elements import elements_of

boat = {BOAT!r}
run = eomgen.simulate(boat, t_end=1.0)
assert np.abs(run.energy - run.energy[0]).max() < 1e-6
assert 0.1 < -run["sea_up"].min() < 0.5
assert "water" in eomgen.derive(boat).text()
assert [e.effect for e in elements_of(elaborate(eomgen.read(boat)), 1.0)] == ["gravity", "water"]
gate = boat.replace("telescope", "revolute")
assert "water" in eomgen.derive(gate).text()
ends = [eomgen.simulate(gate, t_end=0.3, route=route).y[-1] for route in ("closed", "aba")]
assert np.abs(ends[0] - ends[1]).max() < 1e-8
finest = eomgen.simulate(boat, t_end=0.2, integrator="DOP853", rtol=1e-12, atol=1e-14)["sea_up"][-1]
rough = [
    eomgen.simulate(boat, t_end=0.2, integrator="heun", dt=0.2 / steps)["sea_up"][-1] - finest
    for steps in (200, 400)
]
assert 3.8 < rough[0] / rough[1] < 4.2, rough
rail = "constraints = [{{ type = 'level', name = 'rail', body = 'hull', height = 0 }}]"
tram = boat.replace("telescope", "planar").replace("effects = [", rail + "\\neffects = [")
kept = eomgen.simulate(tram, t_end=1.0)
assert np.abs(kept["sea_y"]).max() < 1e-12
assert eomgen.generate(boat, backend="listing").source.splitlines()[1] == "sea_up m"
assert "force for each metre of depth" in reference("buoyancy")
for word in ("buoyancy", "telescope", "level", "heun"):
    assert f'"{{word}}"' in json_schema(), word
try:
    eomgen.read(boat.replace("buoyancy", "bouyancy"))
except eomgen.SceneError as error:
    assert "did you mean 'buoyancy'?" in error.lines[0], error
else:
    raise AssertionError
"""


def python(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run Python with packages of a folder and those of this process."""
    paths = [str(folder), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-W", "error", *words]
    return subprocess.run(command, env=env, capture_output=True, text=True)


def installed(folder: Path, name: str, points: Mapping[str, Mapping[str, str]]) -> None:
    """What an installation writes about a package and its entry points."""
    about = folder / f"{name}-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    lines = [f"[{k}]\n" + "".join(f"{n} = {v}\n" for n, v in p.items()) for k, p in points.items()]
    (about / "entry_points.txt").write_text("\n".join(lines))


@pytest.mark.apart
def test_what_a_package_adds_is_used_as_ours(tmp_path: Path) -> None:
    """In runs, derivations, generated code, reference, schema and messages. In a full run pip
    installs it; else what pip writes is written here.
    """
    if FULL:
        install = "-m pip install -q --no-deps --no-build-isolation --target".split()
        command = [sys.executable, *install, tmp_path, PLUGIN]
        subprocess.run(command, check=True, capture_output=True)
    else:
        project = tomllib.loads((PLUGIN / "pyproject.toml").read_text("utf-8"))["project"]
        shutil.copytree(PLUGIN / "eomgen_example", tmp_path / "eomgen_example")
        installed(tmp_path, project["name"], project["entry-points"])
    done = python("-c", USE, folder=tmp_path)
    assert not done.returncode, done.stderr


@pytest.mark.apart
@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("group", "point", "said"),
    [
        ("effects", "gravity = json:loads", "this name is taken; uninstall the package"),
        ("effects", "wind = no_such_module:Wind", "cannot be loaded: ModuleNotFoundError"),
        ("effects", "wind = json:loads", "is not a class derived from EffectTable with type"),
        ("integrators", "rk4 = json:loads", "this name is taken"),
    ],
)
def test_a_package_that_does_not_fit_is_a_line(
    group: str, point: str, said: str, tmp_path: Path
) -> None:
    """It names the package, or what it adds."""
    name, _, value = point.partition(" = ")
    installed(tmp_path, "misfit", {f"eomgen.{group}": {name: value}})
    done = python("-m", "eomgen", "check", "pendulum", folder=tmp_path)
    assert done.returncode == 1
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
