"""The gallery: its first page and its pages, what an interrupt or an error leaves."""

import re
from pathlib import Path
from typing import Any

import pytest
from html_pages import Page

import eomgen
from eomgen.api import exhibiting
from eomgen.base.files import is_ours
from eomgen.commands.main import main

NASTY = "</style><script>alert(1)</script><img src=x onerror=alert(1)>"
SCENE = """
name = "{name}"
title = "{title}"
about = "{about}"
[[bodies]]
name = "bob"
mass = 1.0
inertia_com = {inertia}
[[joints]]
name = "pin"
type = "revolute"
parent = "world"
child = "bob"
r_child = {arm}
"""


def index_at(path: Path) -> Page:
    return Page(path.read_text("utf-8"))


def scene(
    name: str, title: str = "", about: str = "", arm: str = "[0, 1]", inertia: float = 0
) -> str:
    return SCENE.format(name=name, title=title, about=about, arm=arm, inertia=inertia)


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two scenes that can be shown, and between them one whose motion nothing resists."""
    monkeypatch.chdir(tmp_path)
    texts = [
        scene("first", "First", NASTY),
        scene("second", "Second", arm="[0, 0]"),
        scene("third", NASTY, "The last."),
    ]
    for name, text in zip("abc", texts, strict=True):
        (tmp_path / f"{name}.toml").write_text(text, "utf-8")
    return [f"{name}.toml" for name in "abc"]


def test_a_gallery_shows_its_scenes(tmp_path: Path, files: list[str]) -> None:
    """Each with a picture, its texts and a link; nothing else is loaded or run."""
    path = eomgen.gallery(tmp_path / "g", [files[0], files[2]], t_end=0.2, samples=11)
    index = index_at(path)
    assert index.of("a", "href") == ["first.html", "third.html"]
    for name in index.of("a", "href"):
        page = (path.parent / str(name)).read_bytes()
        assert is_ours(page) and b'"live": true' in page
    assert all(str(s).startswith("data:image/png;base64,iVBOR") for s in index.of("img", "src"))
    assert NASTY in index.text and "The last." in index.text and "First" in index.text
    assert {tag for tag, _ in index.tags}.isdisjoint({"script", "link", "iframe", "object"})
    assert len(index.of("img", "src")) == 2
    policy = next(a for _, a in index.tags if a.get("http-equiv") == "Content-Security-Policy")
    closed = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    assert policy["content"] == closed
    assert not re.search(r"https?:|url\(|@import", path.read_text("utf-8"))
    before = path.read_bytes()
    eomgen.gallery(tmp_path / "g", [files[0], files[2]], t_end=0.2, samples=11)
    assert path.read_bytes() == before  # the same scenes, the same bytes


def test_one_that_fails_leaves_the_others(
    tmp_path: Path, files: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["gallery", "-o", "g", "--t-end", "0.2", "--no-live", "--scene", *files]
    assert main(command) == 1
    said = capsys.readouterr()
    assert "nothing resists" in said.err and len(said.err.splitlines()) == 1
    assert said.out.splitlines()[0].startswith("1 of 3: wrote g/first.html, 0.")
    assert ", about " in said.out.splitlines()[0]
    assert sorted(p.name for p in Path("g").iterdir()) == ["first.html", "index.html", "third.html"]
    assert "replay" in index_at(Path("g/index.html")).text
    # What others wrote stays, and is found before anything is computed.
    Path("g/third.html").write_text("mine")
    assert main(command) == 1
    assert "was not written by eomgen" in capsys.readouterr().err
    assert Path("g/third.html").read_text() == "mine"


def test_an_interrupt_keeps_what_is_done(
    files: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = exhibiting.exhibited

    def stopping(scene: Any, *given: Any, **options: Any) -> Any:
        if scene.name == "third":
            raise KeyboardInterrupt
        return shown(scene, *given, **options)

    monkeypatch.setattr("eomgen.commands.exhibiting.exhibited", stopping)
    command = ["gallery", "-o", "g", "--t-end", "0.2", "--scene", files[0], files[2]]
    assert main(command) == 130
    said = capsys.readouterr().err
    assert said == "eomgen: gallery: interrupted; g/index.html shows the 1 of 2 that are done\n"
    assert index_at(Path("g/index.html")).of("a", "href") == ["first.html"]
    monkeypatch.setattr("eomgen.api.exhibiting.exhibited", stopping)
    with pytest.raises(KeyboardInterrupt):
        eomgen.gallery("h", [files[0], files[2]], t_end=0.2)
    assert index_at(Path("h/index.html")).of("a", "href") == ["first.html"]


def test_names_must_differ(files: list[str]) -> None:
    with pytest.raises(eomgen.RunError, match="two scenes are named 'first'"):
        eomgen.gallery("g", [files[0], files[0]])
    with pytest.raises(eomgen.RunError, match="named 'index'"):
        eomgen.gallery("g", [scene("index")])
    assert not Path("g").exists()


def test_every_built_in_scene_says_what_it_shows() -> None:
    for name in eomgen.built_in_names():
        about = eomgen.read(name).about
        assert about.endswith(".") and 20 < len(about) < 120, name


# ---- Cells of a notebook ----


def test_values_show_themselves_in_a_notebook(files: list[str]) -> None:
    """A scene and a model with tables and a sketch, a run with its figure, its page in a frame that
    shares nothing with the notebook, a derivation with MathML.
    """
    hostile = scene("hostile", NASTY, NASTY)
    run = eomgen.simulate(hostile, t_end=0.2, samples=11)
    for value in (eomgen.read(hostile), eomgen.check(hostile)):
        cell = Page(value._repr_html_())
        kinds = [tag for tag, _ in cell.tags]
        assert {"table", "svg"} <= set(kinds) and NASTY in cell.text and "pin_angle" in cell.text
        assert "script" not in kinds and "img" not in kinds
    cell = Page(run._repr_html_())
    (image,) = cell.of("img", "src")
    assert str(image).startswith("data:image/png;base64,iVBOR") and "steps" in cell.text
    page = Page(run.view(height=321)._repr_html_())
    ((tag, frame),) = page.tags
    assert tag == "iframe" and frame["sandbox"] == "allow-scripts allow-downloads"
    assert "height:321px" in str(frame["style"])
    inner = Page(str(frame["srcdoc"]))
    assert inner.tags[0][0] == "html" and "Content-Security-Policy" in str(inner.tags)
    derived = Page(eomgen.derive(hostile)._repr_html_())
    ((_, frame),) = derived.tags
    assert frame["sandbox"] == "" and "<math" in str(frame["srcdoc"])
