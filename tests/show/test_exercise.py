"""Exercises: sheets with blanks and answers, and pages that check what is typed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from browser import chromium, missing
from campaign import some

import eomgen
from eomgen.commands.main import main
from eomgen.derivation.exercise import Exercise
from eomgen.scene.built_in import BUILT_IN
from eomgen.show.exercise import as_page

RIGHT = (
    "I_pole + m_pole*l^2",
    "m_pole*l**2 + I_pole",
    "I_pole + l m_pole l",
    "l^2*(m_pole + I_pole/l^2)",
    "I_pole*(sin(theta)^2 + cos(theta)^2) - -m_pole*(l*l)",
    "((I_pole + m_pole*l)^2 - I_pole^2 - (m_pole*l)^2)/(2*m_pole*l) + m_pole*l^2",
)
WRONG = ("I_pole - m_pole*l^2", "I_pole + m_pole*l", "I_pole + 1.000001*m_pole*l^2", "I_pole + "
         "m_pole*l^2 + 1e-6*theta", "0/0", "I_pole + m_cart*l^2")  # fmt: skip
NONSENSE = {
    "": "ends too early",
    "I_pole +": "ends too early",
    "mass*l": "no symbol",
    "(l": "missing",
    "l ; l": "not understood",
    "constructor(l)": "no symbol",
    "(" * 2000: "too many",
}


def test_sheets_of_one_seed_are_the_same_and_others_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Blanks on the one, answers on the other; numbers and questions go by the seed."""
    found = eomgen.derive("furuta_pendulum")
    sheets = [found.exercise(seed) for seed in (1, 1, 2)]
    first, again, other = ([(q.left, q.at) for q in sheet.questions] for sheet in sheets)
    assert first == again != other
    given, solved = (sheets[0].steps(solved=x) for x in (False, True))
    asked = [(a, b) for a, b in zip(given[-2].equations, solved[-2].equations, strict=True)]
    assert all(a.left == b.left and a.right.name == "…" != str(b.right) for a, b in asked)
    target = tmp_path / "sheet.tex"
    assert main(["derive", "cart_pole", "--exercise", "--solutions", "-o", str(target)]) == 0
    assert "m_{\\mathrm{pole}}" in target.read_text("utf-8")
    with pytest.raises(eomgen.SceneError, match="exercise: the equations of chain"):
        eomgen.derive("chain").exercise()
    with pytest.raises(eomgen.RunError, match=r"^seed: "):
        found.exercise(-1)
    capsys.readouterr()
    for option in ("--solutions", "--seed 3"):
        assert main(["derive", "cart_pole", *option.split()]) == 1
        said = f"eomgen: {option.split()[0]}: is for an exercise; give --exercise too\n"
        assert capsys.readouterr().err == said


def test_seeds_turn_arms() -> None:
    """The answers are those of a scene whose arm points the other way, and the sheet says so."""
    exercise = eomgen.derive("cart_pole", method="lagrange").exercise(4)
    assert "Energies" in [step.title for step in exercise.hints]
    text = (BUILT_IN / "cart_pole.toml").read_text()
    turned = eomgen.derive(text.replace('r_child = [0, "l"]', 'r_child = [0, "-l"]'))
    asked = {str(q.left): q.right for q in exercise.questions}
    assert asked["V_1"] == turned.V[0] and asked["G_2"] == turned.G[1]
    (arms,) = (step for step in exercise.steps(solved=False) if step.title == "Arms")
    assert [str(x) for x in arms.equations[0].right] == ["0", "-l"]
    assert not eomgen.derive("cart_pole").exercise(0).arms


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser for all pages."""
    with chromium() as opened:
        yield opened


def opened(browser: Any, exercise: Exercise, folder: Path) -> Any:
    """The page of an exercise."""
    path = folder / "exercise.html"
    path.write_text(as_page(exercise), "utf-8")
    page = browser.new_page()
    page.goto(path.as_uri())
    return page


def said_by(page: Any, i: int, answer: str) -> str:
    """What the page says of an answer to a question."""
    form = page.locator("form").nth(i)
    form.locator("input").fill(answer)
    form.locator("button").click()
    return str(form.locator("output").text_content())


@pytest.mark.apart
@pytest.mark.skipif(bool(missing()), reason=missing())
def test_answers_in_any_form(browser: Any, tmp_path: Path) -> None:
    """Equal formulas are right, near misses are not, and nonsense is told so; hints open one after
    another.
    """
    exercise = eomgen.derive("cart_pole").exercise(9)
    questions, page = exercise.questions, opened(browser, exercise, tmp_path)
    place = [str(q.left) for q in questions].index("M_2,2")

    def said(answer: str, i: int = place) -> str:
        return said_by(page, i, answer)

    assert [said(text) for text in RIGHT] == ["Right."] * len(RIGHT)
    assert [said(text) for text in WRONG] == ["Not the same."] * len(WRONG)
    for text, complaint in NONSENSE.items():
        assert complaint in said(text)
    assert [said(str(q.right), i) for i, q in enumerate(questions)] == ["Right."] * len(questions)
    last = len(questions) - 1
    assert said(str(questions[last].value)) != "Right."
    assert said(str(questions[last].value), last) == "Right."
    hints = page.locator("details.hint")
    assert [hints.nth(i).is_visible() for i in (0, 1)] == [True, False]
    page.locator("details.hint > summary").nth(0).click()
    assert [hints.nth(i).is_visible() for i in (0, 1, 2)] == [True, True, False]


def test_answers_do_not_stand_in_the_page() -> None:
    """Neither an answer nor a long part of one can be read in the page's source; F is asked for."""
    asked: set[str] = set()
    for scene in some(("cart_pole",), ("cart_pole", "four_bar", "two_body_forced")):
        exercises = [eomgen.derive(scene).exercise(seed) for seed in range(4)]
        asked |= {str(q.left)[0] for x in exercises for q in x.questions}
        for exercise in exercises[:2]:
            data = as_page(exercise).split('id="data">')[1].split("</script>")[0]
            for question in exercise.questions:
                parts = (question.right, *question.right.args)
                assert not any(str(x) in data for x in parts if x.args)
    assert asked >= {*"MVGF"}


@pytest.mark.apart
@pytest.mark.skipif(bool(missing()), reason=missing())
@pytest.mark.parametrize(
    "scene", ["cart_pole", "four_bar", "differential", "furuta_pendulum", "two_body_forced"]
)
def test_equivalent_forms_of_every_answer(scene: str, browser: Any, tmp_path: Path) -> None:
    """Five forms of each answer are right, four near misses are not, with loops, too."""
    exercise = eomgen.derive(scene).exercise(1)
    page = opened(browser, exercise, tmp_path)
    for i, question in enumerate(q for q in exercise.questions if not q.at):
        e, name = question.right, min(s.name for s in question.right.free_symbols)
        right = (
            str(e),
            str(sp.expand(e)),
            f"-(-({e}))",
            f"({e})*(sin({name})^2 + cos({name})^2)",
            f"1/(1/(2*({e})))/2",
        )
        assert [said_by(page, i, x) for x in right] == ["Right."] * len(right), question.left
        near = f"({e})*cos(1e-3*{name})"
        wrong = (f"-({e})", f"1.000001*({e})", f"({e}) + 1e-6*{name}", near)
        said = [said_by(page, i, x) for x in wrong]
        assert said == ["Not the same."] * len(wrong), question.left
