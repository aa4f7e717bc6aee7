"""The pages for newcomers are run as they stand, each in a folder of its own."""

import contextlib
import io
import re
import shlex
import subprocess
import tomllib
import warnings
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pages
import pytest
from campaign import some
from entry_pages import ENTRIES, arm_with, scene_text

import eomgen
from eomgen.base.errors import SceneError
from eomgen.commands.main import main
from eomgen.language.base import Table
from eomgen.model.elaborate import elaborate
from eomgen.scene.appearance import appearance_of
from eomgen.scene.effects import Effect
from eomgen.scene.joints import Joint
from eomgen.scene.look import Shape
from eomgen.scene.reader import parse_scene
from eomgen.scene.reference import TABLES, by_type
from eomgen.scene.schema import Scene
from eomgen.show.figure import draw_motion as DRAWN

DOCS = Path(__file__).parent.parent.parent / "docs"
PAGES = [
    DOCS / "tutorial.md",
    DOCS / "pictures.md",
    *sorted((DOCS / "howto").glob("*.md")),
    *sorted((DOCS / "concepts").glob("*.md")),
    *sorted((DOCS / "course").glob("*.md")),
    DOCS / "architecture.md",
]
SHORT = [DOCS / "howto" / "lecture.md", DOCS / "howto" / "scene.md"]
"""Pages that have all there is in others: files, commands, what they print, and Python."""
FILE = re.compile(r"^(?:#|/\*|<!--) (append to )?(\S+\.\w+)\b.*\n")
"""The first line of a block that is a file, or the end of one."""
CONTINUED = "The blocks of Python continue each other"


def blocks(text: str) -> list[tuple[str, str]]:
    """The fenced blocks of a page in order: language and content."""
    return re.findall(r"^```(\w+)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.apart
@pytest.mark.usefixtures("blank_figures")
@pytest.mark.parametrize("page", some(SHORT, PAGES), ids=lambda page: page.stem)
def test_a_page_does_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every page in a full run, as in `.ci/run`. Files are written, commands run, and Python prints
    what it says; a block has the names of those before it where the page says so. Every line of a
    text block is printed by the commands before it, in order.
    """
    monkeypatch.chdir(tmp_path)
    printed, text = "", page.read_text("utf-8")
    names: dict[str, Any] = {}
    for language, content in blocks(text):
        if named := FILE.match(content):
            path, rest = tmp_path / named[2], content[named.end() :]
            before = path.read_text("utf-8") + "\n" if named[1] else ""
            path.write_text(before + rest, "utf-8")
        elif language == "sh":
            printed = "".join(command(line) for line in content.splitlines())
        elif language == "python":
            names = names if CONTINUED in text else {}
            assert python(content, names) == re.findall(r"# prints (.*)", content), content
        elif language == "text":
            at = 0
            for line in filter(str.strip, content.splitlines()):
                at = printed.find(line, at)
                assert at >= 0, f"{line!r} is not in:\n{printed}"
        elif language != "javascript":  # tests/exports/test_wasm.py runs it
            raise AssertionError(f"{page.name}: a block of {language} is not tested")


def command(line: str) -> str:
    """Run a command of a page; return what it prints."""
    words = shlex.split(line)
    if words[0] != "eomgen":
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        return done.stdout
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        assert main(words[1:]) == 0, line
    return output.getvalue()


def python(content: str, names: dict[str, Any]) -> list[str]:
    """Run an example, which adds to the names; return the lines that it prints. A process of its
    own would take a second to import what is loaded here.
    """
    output = io.StringIO()
    with (
        contextlib.redirect_stdout(output),
        warnings.catch_warnings(action="ignore"),
        patch("eomgen.show.figure.draw_motion", DRAWN),
    ):
        names["__name__"] = "__main__"
        exec(compile(content, "<example>", "exec"), names)
    return output.getvalue().splitlines()


@pytest.mark.parametrize("name", pages.PAGES)
def test_pages_made_from_the_program_are_fresh(name: str) -> None:
    """`python tools/pages.py` writes them."""
    assert (DOCS / name).read_text("utf-8") == pages.PAGES[name]()


@pytest.mark.every(6)
@pytest.mark.parametrize("name", ENTRIES)
def test_the_scene_of_an_entry_shows_it(name: str) -> None:
    """Each joint, effect and constraint has a page with its live scene, named as it is, in which
    something moves. The pages themselves are among those above.
    """
    scene = parse_scene(scene_text(name))
    tables = (*scene.joints, *scene.effects, *scene.constraints)
    assert scene.name == name and name in [table.type for table in tables]
    run = eomgen.simulate(scene, samples=20, rtol=1e-4)
    assert run.finished and np.ptp(run.y, axis=0).max() > 0.1
    assert f'src="live/{name}.html"' in (DOCS / "reference" / f"{name}.md").read_text("utf-8")


@pytest.mark.parametrize("name", pages.LESSONS)
def test_a_lesson_has_all_its_parts(name: str) -> None:
    """A diagram, a derivation, a live page of its scene, and three exercises, each with a solution
    that `test_a_page_does_what_it_says` runs.
    """
    text = (DOCS / "course" / f"{name}.md").read_text("utf-8")
    assert f"]({name}.svg)" in text and "eomgen.derive(" in text
    built_in = pages.BUILT_IN_LESSONS.get(name)
    own = "" if built_in else tomllib.loads(pages.lesson_scene(name))["name"]
    assert f'src="{f"../gallery/{built_in}" if built_in else f"live/{own}"}.html"' in text
    exercises = text.split("## Exercises\n")[1].split("<details><summary>Solution</summary>")
    assert len(exercises) == 4 and all("```python" in each for each in exercises[1:])


def test_pages_are_linked() -> None:
    """Nothing that a page points to inside the project is missing, and each page is on the site."""
    listed = {DOCS / "index.md"}
    for page in [*DOCS.glob("*.md"), *DOCS.glob("*/*.md")]:
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
            lines = [line for line in tree.splitlines() if line and not line.startswith(":")]
            listed |= {page.parent / f"{line}.md" for line in lines}
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
    assert {*DOCS.glob("*.md"), *DOCS.glob("*/*.md")} == listed


def tables() -> list[type[Table]]:
    """The tables of the reference but the whole scene."""
    groups = [*TABLES.values(), *(t for u in (Joint, Effect, Shape) for t in by_type(u).values())]
    return [table for table in groups if table is not Scene]


@pytest.mark.parametrize("table", tables(), ids=lambda table: table.__name__)
def test_each_example_of_the_reference_is_part_of_a_scene(table: type[Table]) -> None:
    """It is read as part of an arm with a hand, in the plane or in space, and elaborated."""
    found = []
    for dimensions in (2, 3):
        try:
            scene = Scene(**arm_with(table.example, dimensions))
            assert elaborate(scene) and appearance_of(scene)
        except SceneError as error:
            found.append(str(error))
    assert table.example and len(found) < 2, found
