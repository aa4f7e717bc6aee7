"""The README's blocks are run as they stand."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import eomgen

ROOT = Path(__file__).parent.parent.parent
README = (ROOT / "README.md").read_text("utf-8")
API = (ROOT / "docs" / "api.md").read_text("utf-8")
SWEEPS = (ROOT / "docs" / "sweeps.md").read_text("utf-8")


def blocks(language: str, text: str = README) -> list[str]:
    """The fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.full
@pytest.mark.parametrize("text", [README, API + SWEEPS], ids=["README", "docs"])
def test_python_examples_run_and_print_what_they_say(text: str) -> None:
    """The Python blocks run from the checkout, one after another; a `# prints` comment holds what
    each prints, as `.ci/run` has them. One process runs them all: to load what they
    import takes longer than most of them.
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


def test_links_and_pictures_are_there() -> None:
    """Nothing the README points to inside the project is missing."""
    for name in eomgen.__all__:
        if callable(getattr(eomgen, name)) and name.islower():
            assert name == "built_in_names" or f"| `{name}(" in API, name
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
