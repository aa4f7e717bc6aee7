"""The package: what is in it, that its files agree, and that a user's script does what it says.

`python tools/release.py build` installs the wheel into an empty environment and checks types there.
"""

import ast
import importlib.util
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import eomgen

ROOT = Path(__file__).parent.parent.parent
SCRIPT = ROOT / "tests" / "typed" / "script.py"
MAKERS = {f"templates/page/vendor/three/{name}" for name in ("build.mjs", "entry.js")}
"""What makes a vendored file; of no use where the package is installed."""


def tracked(*folders: str) -> set[str]:
    """The files of some folders that git tracks, or would if they were added."""
    listed = ["git", "ls-files", "-co", "--exclude-standard", *folders]
    done = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True)
    return {name for name in done.stdout.splitlines() if (ROOT / name).is_file()}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the sdist and the wheel."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    yield folder


@pytest.mark.apart
def test_the_wheel_holds_the_package_and_nothing_else(built: Path) -> None:
    """Every tracked file of package and templates, each licence, and the metadata."""
    (path,) = built.glob("*.whl")
    with zipfile.ZipFile(path) as wheel:
        names = set(wheel.namelist())
    ours = tracked("eomgen") | {
        f"eomgen/{name}" for name in tracked("templates") if name not in MAKERS
    }
    info = f"eomgen-{eomgen.__version__}.dist-info/"
    about = {name for name in names if name.startswith(info)}
    licences = {"LICENSE", *(name for name in tracked("templates") if name.endswith("/LICENSE"))}
    assert names - about == ours
    assert "eomgen/py.typed" in ours
    assert {name.removeprefix(info) for name in about} == {
        *("METADATA", "RECORD", "WHEEL", "entry_points.txt"),
        *(f"licenses/{name}" for name in licences),
    }


def test_the_sdist_builds_from_what_is_tracked(built: Path) -> None:
    """Package, templates and the few files about them."""
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as sdist:
        names = {name.partition("/")[2] for name in sdist.getnames()}
    about = {"CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "pyproject.toml"}
    # hatchling adds the two others to each sdist.
    assert names == tracked("eomgen", "templates") | about | {"PKG-INFO", ".gitignore"}


def release_tool() -> ModuleType:
    """`tools/release.py`."""
    spec = importlib.util.spec_from_file_location("release", ROOT / "tools" / "release.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_files_about_the_package_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """Version, addresses, licence and dependencies; a file that states another version is found."""
    tool = release_tool()
    assert tool.version() == eomgen.__version__
    assert list(tool.disagreements()) == []
    real = tool.text
    monkeypatch.setattr(tool, "text", lambda name: real(name).replace("0.2.0", "0.1.9", 1))
    monkeypatch.setattr(tool, "version", lambda: "0.2.0")
    assert [line.partition(":")[0] for line in tool.disagreements()] == [
        *("CHANGELOG.md", "CITATION.cff", "recipe/recipe.yaml")
    ]


def test_the_typed_script_has_every_public_call() -> None:
    """No public function is left out."""
    asked = {
        node.attr
        for node in ast.walk(ast.parse(SCRIPT.read_text("utf-8")))
        if isinstance(node, ast.Attribute)
    }
    assert set(eomgen.__all__) - asked == {"EomgenError"}


@pytest.mark.full
def test_the_typed_script_runs() -> None:
    """What it annotates is what it gets, as far as it uses it."""
    subprocess.run([sys.executable, SCRIPT], cwd=ROOT, check=True, capture_output=True)


@pytest.mark.apart
def test_generating_and_simulating_need_no_drawing() -> None:
    """Without Matplotlib and Pillow, from an empty store; SciPy, which takes longer to load than a
    scene takes to generate, is for runs alone.
    """
    code = """
import sys, tempfile, os
with tempfile.TemporaryDirectory() as folder:
    os.environ["EOMGEN_CACHE"] = folder
    for name in ("matplotlib", "PIL", "pandas", "xarray", "gymnasium", "casadi", "control", "jax"):
        sys.modules[name] = None
    import eomgen
    eomgen.generate("pendulum").save(folder + "/pendulum.py")
    assert "scipy" not in sys.modules
    print(eomgen.simulate("pendulum", t_end=0.1).finished)
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "True\n"
