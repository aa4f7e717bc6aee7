"""Make a release, up to the upload.

    python tools/release.py check         whether versions, changelog, addresses and licences agree
    python tools/release.py build [DIR]   build sdist and wheel in DIR (dist) and try them
    python tools/release.py               check, `.ci/run`, build, tag; and print how to upload

`pip install -e '.[dev,release]'` brings the tools. `build` makes the wheel from the sdist, has both
checked by twine, check-wheel-contents and validate-pyproject, installs the wheel into an empty
environment, and there runs the main job of the README and checks the types of a user's script.
"""

import hashlib
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent
SCRIPT = ROOT / "tests" / "typed" / "script.py"
RELEASED = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", re.MULTILINE)


def text(name: str) -> str:
    """The text of a file of the project."""
    return (ROOT / name).read_text("utf-8")


def version() -> str:
    """The version, from the one place that states it."""
    return re.findall(r'^__version__ = "(.*)"$', text("eomgen/base/version.py"), re.MULTILINE)[0]


def disagreements() -> Iterator[str]:
    """A line for each thing that does not agree with pyproject.toml or the version."""
    project = tomllib.loads(text("pyproject.toml"))["project"]
    now = version()
    released = RELEASED.search(text("CHANGELOG.md"))
    if released is None or released[1] != now:
        found = "no version" if released is None else released[1]
        yield f"CHANGELOG.md: its first heading with a date has {found}, eomgen has {now}"
    recipe, citation = text("recipe/recipe.yaml"), text("CITATION.cff")
    for name, pattern, content in (
        ("CITATION.cff", r"^version: (.*)$", citation),
        ("recipe/recipe.yaml", r'^  version: "(.*)"$', recipe),
    ):
        found = re.findall(pattern, content, re.MULTILINE)
        if found != [now]:
            yield f"{name}: version {', '.join(found)}, eomgen has {now}"
    urls = project["urls"]
    for name, line in (
        ("CITATION.cff", f'url: "{urls["Homepage"]}"'),
        ("CITATION.cff", f'repository-code: "{urls["Source"]}"'),
        ("recipe/recipe.yaml", f"homepage: {urls['Homepage']}"),
        ("recipe/recipe.yaml", f"repository: {urls['Source']}"),
        ("recipe/recipe.yaml", f"documentation: {urls['Documentation']}"),
        ("recipe/schemastore.json", f'"url": "{urls["Documentation"]}/scene.schema.json"'),
        ("recipe/recipe.yaml", f"license: {project['license']}"),
    ):
        if line not in text(name):
            yield f"{name}: has no line '{line}', as pyproject.toml asks for"
    packages = {"matplotlib": "matplotlib-base"}
    for wanted in project["dependencies"]:
        package, least = wanted.split(">=")
        if f"- {packages.get(package, package)} >={least}\n" not in recipe:
            yield f"recipe/recipe.yaml: lacks '{wanted}', which pyproject.toml asks for"
    for folder in sorted(path.parent for path in ROOT.glob("templates/*/vendor/*/README.md")):
        if not (folder / "LICENSE").is_file():
            yield f"{folder.relative_to(ROOT)}: has no LICENSE"


def run(*command: str | Path, cwd: Path = ROOT) -> None:
    """Run a command, printed; `SystemExit` if it fails. No setting of Python's reaches it."""
    print("$", *command, flush=True)
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    if subprocess.run([str(word) for word in command], cwd=cwd, env=env).returncode:
        raise SystemExit(f"failed: {' '.join(map(str, command))}")


def tool(name: str) -> Path:
    """A program of the environment that runs this."""
    return Path(sys.executable).parent / name


def build(folder: Path) -> tuple[Path, Path]:
    """Build, check and try; the sdist and the wheel."""
    made = f"eomgen-{version()}"
    sdist, wheel = folder / f"{made}.tar.gz", folder / f"{made}-py3-none-any.whl"
    for path in (sdist, wheel):
        path.unlink(missing_ok=True)
    run(tool("validate-pyproject"), ROOT / "pyproject.toml")
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT)
    run(sys.executable, "-m", "twine", "check", "--strict", sdist, wheel)
    run(tool("check-wheel-contents"), "--config", ROOT / "pyproject.toml", wheel)
    check_recipe(sdist)
    with tempfile.TemporaryDirectory() as name:
        try_wheel(wheel, Path(name))
    return sdist, wheel


def check_recipe(sdist: Path) -> None:
    """Have rattler-build read and render the recipe, and see that its licence files are there."""
    from rattler_build import Stage0Recipe, VariantConfig

    recipe = Stage0Recipe.from_file(str(ROOT / "recipe" / "recipe.yaml"))
    (rendered,) = recipe.render(VariantConfig())
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    for path in recipe.to_dict()["about"]["license_file"]:
        if path not in names:
            raise SystemExit(f"recipe/recipe.yaml: {path} is not in {sdist.name}")
    print(f"recipe: {rendered}; sha256: {hashlib.sha256(sdist.read_bytes()).hexdigest()}")


def try_wheel(wheel: Path, work: Path) -> None:
    """Install the wheel into an empty environment; the main job, and the types of a script."""
    run(sys.executable, "-m", "venv", work / "venv")
    programs = work / "venv" / Path(sys.executable).parent.name
    python = programs / "python"
    run(python, "-m", "pip", "install", "-q", "--disable-pip-version-check", wheel)
    run(python, "-m", "pip", "check")
    run(programs / "eomgen", "simulate", "two_body", cwd=work)
    script = work / SCRIPT.name
    script.write_text(SCRIPT.read_text("utf-8"), "utf-8")
    run(tool("mypy"), "--strict", "--python-executable", python, script, cwd=work)
    run(tool("pyright"), "--pythonpath", python, script, cwd=work)


def release() -> None:
    """All of it, up to the upload."""
    tag = f"v{version()}"
    state = ["git", "status", "--porcelain"]
    if subprocess.run(state, cwd=ROOT, capture_output=True, check=True).stdout:
        raise SystemExit("there are changes that are not committed")
    known = subprocess.run(["git", "tag", "-l", tag], cwd=ROOT, capture_output=True, check=True)
    if known.stdout:
        raise SystemExit(f"there is a tag {tag} already")
    run("bash", ROOT / ".ci" / "run")
    made = build(ROOT / "dist")
    run("git", "tag", "-a", tag, "-m", f"eomgen {version()}")
    print("Nothing was uploaded. To publish:")
    print(f"  git push origin {tag}")
    print("  python -m twine upload", *(path.relative_to(ROOT) for path in made))


def main(words: Sequence[str]) -> int:
    """Check what agrees; then what is asked for."""
    if words and (words[0] not in ("check", "build") or len(words) > 2):
        print(__doc__)
        return 2
    lines = list(disagreements())
    for line in lines:
        print(line)
    if lines or words == ["check"]:
        return 1 if lines else 0
    if words:
        build(Path(words[1] if len(words) > 1 else ROOT / "dist").absolute())
    else:
        release()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
