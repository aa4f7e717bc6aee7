"""The front of docs/accuracy.md is no older than what it shows."""

import re
from dataclasses import replace
from pathlib import Path

import accuracy_page
import pytest
from accuracy_page import DOCS, END, FRONT, START, digest, digests

import eomgen
from eomgen.tables.integrators import INTEGRATORS

PAGE = (DOCS / "accuracy.md").read_text("utf-8")
ROWS = re.findall(r"\| \w+ \| \S+ \| \S+ ms \| (\d+) \| `eomgen simulate (\S+) (.*)` \|", PAGE)


@pytest.mark.parametrize("scene", FRONT)
def test_no_figure_is_older_than_what_it_shows(scene: str) -> None:
    """`python tools/accuracy_page.py SCENE` measures it anew."""
    assert digests(PAGE).get(scene) == digest(scene)
    assert (DOCS / f"accuracy_{scene}.png").exists() and f"accuracy_{scene}.png" in PAGE


def test_a_digest_feels_the_scene_and_the_methods(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A number of the scene, a method more, another method of the same name."""
    text = accuracy_page.file_of("pendulum").read_text("utf-8")
    (tmp_path / "pendulum.toml").write_text(text.replace("9.81", "9.80"), "utf-8")
    known, spec = digest("pendulum"), INTEGRATORS["rk4"]
    with monkeypatch.context() as other:
        other.setattr(accuracy_page, "DOCS", tmp_path)
        assert digest("pendulum") != known
    for changed in ({"rk5": spec}, {"rk4": replace(spec, method="explicit:OTHER")}):
        with monkeypatch.context() as other:
            other.setattr(accuracy_page, "INTEGRATORS", {**INTEGRATORS, **changed})
            assert digest("pendulum") != known


def test_the_front_has_all_scenes_and_errors() -> None:
    """Each scene at each error, with a command or with words that there is none."""
    front = PAGE.split(START)[1].split(END)[0]
    for scene in FRONT:
        assert front.count(f"\n| {scene} |") == 3


@pytest.mark.every(6)
@pytest.mark.parametrize(("derivatives", "scene", "options"), ROWS)
def test_commands_take_what_the_front_says(derivatives: str, scene: str, options: str) -> None:
    """A method that has changed makes another number of derivatives."""
    words = options.split()
    given = dict(zip((word[2:] for word in words[::2]), words[1::2], strict=True))
    numbers = {name: float(x) for name, x in given.items() if name != "integrator"}
    source = DOCS.parent / scene if "/" in scene else scene
    run = eomgen.simulate(source, integrator=given["integrator"], **numbers)  # type: ignore[arg-type]
    assert run.trajectory.counts["derivatives"] == int(derivatives)
