"""The README's blocks are run as they stand."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import eomgen
from eomgen.cli import main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
API = (ROOT / "docs" / "api.md").read_text("utf-8")
SWEEPS = (ROOT / "docs" / "sweeps.md").read_text("utf-8")


def blocks(language: str, text: str = README) -> list[str]:
    """The fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("text", [README, API + SWEEPS], ids=["README", "docs"])
def test_python_examples_run_and_print_what_they_say(text: str) -> None:
    """The Python blocks run from the checkout, one after another; a `# prints` comment holds what
    each prints. One process runs them all: to load what they import takes longer than most of them.
    """
    examples = blocks("python", text)
    assert examples
    apart = "\nprint('----')\n"
    once = "import eomgen.study.timing as timing\ntiming.TIMING = 0.0  # no example says a time\n"
    run = subprocess.run(
        [sys.executable, "-c", once + apart.join(examples)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    printed = run.stdout.removesuffix("\n").split("\n----\n")
    assert [part.splitlines() for part in printed] == [
        re.findall(r"# prints (.*)", source) for source in examples
    ]


@pytest.mark.usefixtures("blank_figures")
def test_scene_examples_are_scenes(tmp_path: Path) -> None:
    """Each TOML block is a whole scene that is generated and simulated."""
    examples = blocks("toml")
    assert examples
    for i, text in enumerate(examples):
        scene = tmp_path / f"example_{i}.toml"
        scene.write_text(text, "utf-8")
        assert main(["simulate", str(scene), "--t-end", "0.1", "-o", str(tmp_path / "out")]) == 0


def test_commands_exist(capsys: pytest.CaptureFixture[str]) -> None:
    """Every `eomgen …` line of the console blocks parses, and `--help` names every command."""
    lines = [line for block in blocks("console") for line in block.splitlines()]
    calls = [line.split("#")[0] for line in lines if line.startswith("eomgen ")]
    assert calls
    with pytest.raises(SystemExit):
        main(["--help"])
    known = capsys.readouterr().out
    for call in calls:
        words = shlex.split(call)[1:]
        assert re.search(rf"^    {words[0]}\b", known, re.MULTILINE), call
        with pytest.raises(SystemExit) as stop:
            main([*words, "--help"])
        assert stop.value.code == 0, call
        options = capsys.readouterr().out
        for word in words:
            assert not word.startswith("-") or word in options, call


@pytest.mark.usefixtures("blank_figures")
def test_a_run_goes_on_as_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The line of `--from`, after the first command has run."""
    monkeypatch.chdir(tmp_path)
    (line,) = re.findall(r"^eomgen (simulate .*--from [^#]*)#", README, re.MULTILINE)
    assert main(["simulate", "two_body"]) == 0
    assert main(shlex.split(line)) == 0


def test_links_and_pictures_are_there() -> None:
    """Nothing the README points to inside the project is missing."""
    for name in eomgen.__all__:
        if callable(getattr(eomgen, name)) and name.islower():
            assert name == "built_in_names" or f"| `{name}(" in API
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target


def test_two_commands_stand_first() -> None:
    """The first two shell blocks are the main job and the tests, each one line with its set-up."""
    job, tests = (block.strip() for block in blocks("sh")[:2])
    for command in (job, tests):
        assert "\n" not in command
        assert command.startswith("python3 -m venv .venv && .venv/bin/pip install ")
    assert "eomgen simulate two_body" in job
    assert tests.endswith("pytest")
