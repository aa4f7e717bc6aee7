"""Does the main job run with the oldest versions that pyproject.toml allows, and on the newest
Python there is?

    python tests/campaigns/versions.py [oldest] [newest] [newer] [3.N ...]

The first two unless some are named. Each makes a virtual environment of its own, installs this
folder, and there generates, simulates and verifies a few scenes and runs a small part of the tests.
`oldest`: the lowest version of each dependency as pyproject.toml has it, on the lowest Python.
`newest`: what the package index has, on the highest Python found here, which it names. `newer`: the
same if that is higher than the Python that runs this, for after its own tests. `3.14`: the same on
that Python. Where Python or the index is missing it says NOT CHECKED and why, and counts as
no failure; all else that goes wrong does. docs/compatibility.md has what was found.
"""

import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
SCENES = ("pendulum", "two_body", "tumbling_body", "bouncing_two_body")
METHODS = ("LSODA", "Radau", "DOP853", "gauss_6")
SHOWN = ("numpy", "scipy", "sympy", "mpmath", "gmpy2", "pydantic", "matplotlib")
TESTS = ("formula", "trajectory", "small_faults")
RUNNERS = ("pytest", "pytest-xdist")
"""What these tests need of the packages for tests."""
ONE_AFTER_ANOTHER = """
import sys
from eomgen.commands.main import main
for line in sys.argv[1:]:
    assert main(line.split()) == 0, line
"""
_NAMED = re.compile(r"python3\.(\d+)")


def pythons() -> dict[tuple[int, int], Path]:
    """Each Python 3 that starts: on the path, or beside the one that runs this."""
    folders = [Path(folder) for folder in os.environ["PATH"].split(os.pathsep) if folder]
    folders += sorted(Path(sys.base_prefix).parent.glob("*/bin"))
    found = {sys.version_info[:2]: Path(sys.executable)}
    for path in (p for folder in folders for p in sorted(folder.glob("python3.*"))):
        name = _NAMED.fullmatch(path.name)
        if name is None or (3, int(name[1])) in found:
            continue
        code = "import sys, venv, ensurepip; sys.exit(sys.version_info.releaselevel != 'final')"
        if not subprocess.run([path, "-c", code], capture_output=True).returncode:
            found[3, int(name[1])] = path
    return found


def lowest(requirements: Sequence[str]) -> list[str]:
    """Each of some requirements NAME>=VERSION as NAME==VERSION."""
    for text in requirements:
        if not re.fullmatch(r"[\w-]+>=[\d.]+", text):
            raise SystemExit(f"pyproject.toml: '{text}' is not NAME>=VERSION")
    return [text.replace(">=", "==") for text in requirements]


def chosen(which: str) -> tuple[Path | None, str, list[str]]:
    """The Python of one of the checks, its version, and the packages with their versions."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    tests = [
        text for text in project["optional-dependencies"]["test"] if text.split(">=")[0] in RUNNERS
    ]
    there = pythons()
    if which != "oldest":
        version = max(there) if which.startswith("newe") else (3, int(which.removeprefix("3.")))
        return there.get(version), f"3.{version[1]}", [t.split(">=")[0] for t in tests]
    match = re.fullmatch(r">=3\.(\d+)", project["requires-python"])
    assert match is not None, project["requires-python"]
    packages = lowest([*project["dependencies"], *tests])
    return there.get((3, int(match[1]))), f"3.{match[1]}", packages


def check(which: str, work: Path) -> bool:
    """Whether the main job and the tests ran; true also where that could not be checked."""
    python, version, packages = chosen(which)
    if which == "newer" and version == f"3.{sys.version_info.minor}":
        print(f"== newer: Python {version}, which runs this, is the newest here")
        return True
    print(f"== {which}: Python {version} with {', '.join(packages)}", flush=True)
    if python is None:
        print(f"NOT CHECKED: there is no Python {version} here")
        return True
    own = work / "venv" / "bin"
    subprocess.run([python, "-m", "venv", own.parent], check=True)
    install = [own / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    install.append("--no-compile")  # of three thousand modules the few that are imported suffice
    index = subprocess.run([*install, "hatchling"], capture_output=True, text=True)
    if index.returncode:
        print(f"NOT CHECKED: no package index: {index.stderr.strip().splitlines()[-1]}")
        return True
    subprocess.run([*install, *packages, ROOT], check=True, stderr=subprocess.DEVNULL)
    code = "import sys, importlib.metadata as m; print(sys.version.split()[0], "
    code += f"*(name + ' ' + m.version(name) for name in {SHOWN}), sep=', ')"
    subprocess.run([own / "python", "-c", code], check=True)
    return all([main_job(own, work), small_tests(own, work)])


def main_job(own: Path, work: Path) -> bool:
    """Generate, simulate and verify scenes; the modules are those that are committed."""
    rest = [f"simulate {scene} -o out" for scene in SCENES[1:]]
    rest += [f"simulate pendulum --integrator {m} -o out_{m}" for m in METHODS]
    rest += [f"verify {scene} --states 2" for scene in SCENES[:2]]
    commands = [
        [own / "eomgen", "generate", *SCENES, "-o", "made"],
        [own / "eomgen", "simulate", SCENES[0], "-o", "out"],
        [own / "python", "-c", ONE_AFTER_ANOTHER, *rest],  # to start takes longer than most of them
    ]
    good = True
    for program, *command in commands:
        done = run([program, *command], work)
        said = command if program.stem == "eomgen" else [", ".join(rest)]
        print(f"{'ok' if done else 'FAILED'}  eomgen {' '.join(said)}", flush=True)
        good = good and done
    for scene in SCENES if good else ():
        name = f"{scene}.py"
        if (work / "made" / name).read_bytes() != (ROOT / "generated" / name).read_bytes():
            # SymPy writes what is equal in another form; what it computes is verified above.
            print(f"note  made/{name} differs from generated/{name}")
    return good


def small_tests(own: Path, work: Path) -> bool:
    """A part of the tests, on what was installed. What old packages say of new ones that they use,
    Matplotlib of pyparsing for example, is no fault of this program.
    """
    quiet = ["-n", "2", "-W", "ignore::DeprecationWarning"]
    files = [str(p) for name in TESTS for p in (ROOT / "tests").rglob(f"test_{name}.py")]
    done = run([own / "python", "-m", "pytest", "-p", "no:cacheprovider", *quiet, *files], work)
    print(f"{'ok' if done else 'FAILED'}  pytest {' '.join(TESTS)}", flush=True)
    return done


def run(command: Sequence[str | Path], work: Path) -> bool:
    """Whether a command ends well; if not, its output is shown."""
    env = {**os.environ, "EOMGEN_CACHE": str(work / "store")}
    env.pop("PYTHONPATH", None)
    done = subprocess.run(command, cwd=work, env=env, capture_output=True, text=True)
    if done.returncode:
        print((done.stdout + done.stderr)[-4000:])
    return done.returncode == 0


def main() -> int:
    """All that is asked for; 1 if any failed."""
    wanted = sys.argv[1:] or ["oldest", "newest"]
    if not all(re.fullmatch(r"oldest|newest|newer|3\.\d+", which) for which in wanted):
        print(__doc__)
        return 2
    good = True
    for which in wanted:
        with tempfile.TemporaryDirectory() as folder:
            good = check(which, Path(folder)) and good
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
