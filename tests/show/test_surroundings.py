"""What stands still in the world in figures, and where they say that energy goes."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from effect_cases import CASES, Case
from matplotlib.collections import PolyCollection
from matplotlib.patches import Polygon as Patch
from matplotlib.path import Path as Outline
from scenes import lone
from test_show import panel, swinging
from test_show_space import sliding

from eomgen.commands.main import main
from eomgen.language.formula import Constant
from eomgen.language.rewriting import constant
from eomgen.model.elaborate import elaborate
from eomgen.scene.appearance import Appearance
from eomgen.scene.effects.elements import WORLD_INDEX, Round
from eomgen.scene.look import number, numbers
from eomgen.scene.reader import parse_scene
from eomgen.show.balance import keeps_energy, works_by_type
from eomgen.show.figure import draw_motion
from eomgen.show.motion import Plane
from eomgen.show.observe import planes_of
from eomgen.show.picture import Picture, picture_of
from eomgen.show.solid import solids
from eomgen.show.view import cast_of, eye_axes, floor_under, patches

SCENE = """\
name = "mechanism"
parameters = { depth = 0.5 }
[[bodies]]
name = "a"
mass = 1.0
inertia_com = 0.1
[[joints]]
name = "flight"
type = "free"
child = "a"
[[bodies]]
name = "b"
mass = 1.0
inertia_com = 0.1
[[joints]]
name = "hinge"
type = "revolute"
parent = "a"
child = "b"
"""
SOFT = 'law = "spring_damper"\nstiffness = 100.0\nradius = 0.1'
CONTACTS = (
    'name = "slope"\nbody = "a"\nnormal = [-3.0, 4.0]\noffset = "-2*depth"',
    'name = "again"\nbody = "b"\nnormal = [-6.0, 8.0]\noffset = "-2*depth"',
    'name = "floor"\nbody = "b"',
    'name = "moved"\nbody = "b"\nother = "a"\noffset = 7.0',
    'name = "ball"\nbody = "b"\nagainst = "ball"\nother_radius = "depth"\nother_at = [1.0, 2.0]',
    'name = "carried"\nbody = "b"\nagainst = "ball"\nother = "a"\nother_radius = 7.0',
    'name = "pair"\nbodies = ["a", "b"]\nagainst = "each_other"',
)
AVOID = """\
[[effects]]
type = "field"
name = "avoid"
kind = "avoid"
body = "a"
center = [3.0, "depth"]
steering = 1.0
radius = 0.2
reach = 0.4
"""
SLOPE, WALL = Plane((-0.6, 0.8), -0.9), Plane((1.0, 0.0), -0.4)


def fixed(*balls: tuple[tuple[float, ...], float, float | None]) -> Picture:
    """Balls of the world, and obstacles, which have a reach."""
    found = (
        Round(
            "obstacle" if reach else "ball",
            "",
            WORLD_INDEX,
            constant(*center),
            Constant(radius),
            reach and Constant(reach),
        )
        for center, radius, reach in balls
    )
    return Picture((), (), tuple(found), (), 1.0)


def circles(axes: Any) -> list[tuple[tuple[float, ...], float, Patch]]:
    """Fixed circles, by middle and radius."""
    found = [p for p in axes.get_children() if isinstance(p, Patch) and p.zorder == 1.2]
    ends = [(p.get_xy().min(axis=0), p.get_xy().max(axis=0)) for p in found]
    return [
        (tuple(((low + high) / 2).round(9)), round((high - low)[0] / 2, 9), p)
        for (low, high), p in zip(ends, found, strict=True)
    ]


def test_what_stands_still_in_a_model() -> None:
    """Planes and balls of the world, each once, at the values of parameters; none that move."""
    effects = "".join(f'[[effects]]\ntype = "contact"\n{SOFT}\n{each}\n' for each in CONTACTS)
    model = elaborate(parse_scene(SCENE + effects + AVOID, "scene"))
    model = model.with_parameters({"depth": 0.25})
    drawn = picture_of(model, Appearance()).valued(model.defaults)
    assert planes_of(drawn) == (Plane((-0.6, 0.8), -0.5), Plane((0.0, 1.0), 0.0))
    balls = [e for e in drawn.elements if isinstance(e, Round) and e.body == WORLD_INDEX]
    assert [(*numbers(e.at), number(e.radius), e.reach and number(e.reach)) for e in balls] == [
        (1.0, 2.0, 0.25, None),
        (3.0, 0.25, 0.2, 0.4),
    ]


def behind(points: np.ndarray, planes: tuple[Plane, ...]) -> np.ndarray:
    """Which of the points lie behind any of the planes."""
    return np.any([points @ p.normal < p.offset for p in planes], axis=0)


def covered(points: np.ndarray, outlines: list[np.ndarray]) -> np.ndarray:
    """Which of the points lie within any of the outlines."""
    return np.any([Outline(outline).contains_points(points) for outline in outlines], axis=0)


def test_planes_in_the_figure() -> None:
    """Grey is what lies behind them, in the whole view, which is that without them."""
    views, bare = [], draw_motion(swinging())
    made = draw_motion(swinging(planes=(SLOPE, WALL)))
    for figure in (bare, made):
        figure.draw_without_rendering()
        axes = panel(figure, "8 poses")
        views.append((axes.get_xlim(), axes.get_ylim()))
    np.testing.assert_allclose(views[0], views[1], rtol=1e-14)  # layouts round differently
    grounds = [p for p in axes.patches if isinstance(p, Patch) and p.zorder < 0.5]
    assert len(grounds) == 2 and len(axes.patches) == 2 + len(panel(bare, "8 poses").patches)
    points = np.stack(np.meshgrid(*(np.linspace(*ends, 40) for ends in views[1])), -1)
    points = points.reshape(-1, 2)
    expected = behind(points, (SLOPE, WALL))
    assert 0.1 < expected.mean() < 0.9
    np.testing.assert_array_equal(covered(points, [p.get_xy() for p in grounds]), expected)
    faces = [line.get_xydata() for line in axes.get_lines() if line.zorder == 1.5]
    for face, plane in zip(faces, (SLOPE, WALL), strict=True):
        np.testing.assert_allclose(face @ plane.normal, plane.offset, atol=1e-12)


def test_balls_in_the_figure() -> None:
    """Small ones are seen whole; of a hill larger than the picture the view takes no notice."""
    drawn = fixed(((0.2, -0.5), 0.3, None), ((1.0, 1.0), 0.2, 0.5), ((0.0, -50.0), 49.0, None))
    axes = panel(draw_motion(swinging(drawn=drawn)), "8 poses")
    assert {(at, radius) for at, radius, _ in circles(axes)} == {
        ((0.2, -0.5), 0.3),
        ((1.0, 1.0), 0.2),
        ((1.0, 1.0), 0.7),
        ((0.0, -50.0), 49.0),
    }
    assert [r for _, r, p in circles(axes) if p.get_linestyle() == ":"] == [0.7]
    assert {r for _, r, p in circles(axes) if p.get_facecolor()[3] > 0} == {0.3, 49.0}
    assert axes.dataLim.y1 == pytest.approx(1.2) and axes.dataLim.y0 > -1.5


GROUND, SLANT = Plane((0.0, 0.0, 1.0), 0.6), Plane((0.0, 0.6, 0.8), 1.0)
SURROUNDED: dict[str, Any] = {
    "planes": (SLANT, GROUND, Plane((0.0, 0.0, 1.0), -1.0), Plane((1.0, 0.0, 0.0), -9.0)),
    "drawn": fixed(((0.5, 0.2, 1.0), 0.3, None), ((0.0, 1.0, 1.0), 0.2, 0.1)),
}


def test_planes_in_space() -> None:
    """The floor is the highest level plane in reach; the others in reach are squares as wide."""
    motion = sliding(**SURROUNDED)
    floor = floor_under(motion, cast_of(solids(motion.shapes, 3.0, 2000)))
    assert floor.z == 0.6
    slant, lower = patches(motion, floor)
    np.testing.assert_allclose(slant @ SLANT.normal, 1.0)
    np.testing.assert_allclose(lower[:, 2], -1.0)
    width = max(np.ptp(floor.x), np.ptp(floor.y))
    for square in (slant, lower):
        sides = np.roll(square, -1, axis=0) - square
        np.testing.assert_allclose(sides @ sides.T, width**2 * cross_sum(4), atol=1e-12)
    axes = panel(draw_motion(motion), "8 poses")
    eye = eye_axes(-60.0, 20.0)
    drawn = [c for c in axes.collections if isinstance(c, PolyCollection) and c.zorder == 1.0]
    seen = [path.vertices[:4] for collection in drawn for path in collection.get_paths()]
    np.testing.assert_allclose(seen, (np.array([slant, lower]) @ eye.T)[..., :2])
    expected = [(0.3, (0.5, 0.2, 1.0)), (0.2, (0.0, 1.0, 1.0)), (0.3, (0.0, 1.0, 1.0))]
    for center, radius, _ in circles(axes):
        assert any(
            radius == pytest.approx(r) and np.allclose(center, (eye @ at)[:2]) for r, at in expected
        )
    assert len(circles(axes)) == 3
    assert floor_under(sliding(), cast_of(solids(motion.shapes, 3.0, 2000))).z == 0.0


def cross_sum(count: int) -> np.ndarray:
    """Products of a unit square's sides: 1 of each with itself, -1 with the one across."""
    return np.eye(count) - np.roll(np.eye(count), 2, axis=0)


@pytest.mark.every(3)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_energy_is_kept_where_effects_give_it_back(case: Case) -> None:
    """`test_bookkeeping` measures that these effects give back what they take, and that others have
    no potential energy; of those only what steers sideways, and an input of 0, do nothing.
    """
    model = elaborate(parse_scene(case.text(), "scene"))
    idle = "avoid" in case.name or '= "input"' in case.table
    assert keeps_energy(model, {}) == (case.conserves == {} or idle)
    if case.conserves is not None:
        assert keeps_energy(model.with_parameters(case.conserves), {})
    for lossy in case.conserves or ():
        others = {name: 0.0 for name in case.conserves or () if name != lossy}
        assert not keeps_energy(model.with_parameters(others), {})
    for given in model.inputs:
        assert not keeps_energy(model, {given.name: 0.1})


def test_energy_is_not_kept_by_equations_that_leave_something_out() -> None:
    text = SCENE.replace("[[bodies]]", 'leave_out = ["velocity_forces"]\n[[bodies]]', 1)
    assert keeps_energy(elaborate(parse_scene(SCENE, "scene")), {})
    assert not keeps_energy(elaborate(parse_scene(text, "scene")), {})


def test_figure_shows_what_works_leave_over() -> None:
    """Where energy is not kept: what the works leave of kinetic energy, or no panel."""
    motion = swinging()
    works = np.column_stack([motion.t, motion.kinetic_energy - 3.0 - motion.t - 1e-6 * motion.t**2])
    lossy = swinging(keeps_energy=False, works=works, effects=("air", "ground"))
    (curve,) = panel(draw_motion(lossy), "Energy unaccounted for").get_lines()[:1]
    # Kinetic energy reaches 3 J, potential energy spans 2 J, but for where the samples lie.
    np.testing.assert_allclose(
        curve.get_ydata()[1:], 1e-6 * motion.t[1:] ** 2 / 5, rtol=2e-5, atol=1e-15
    )
    plain = draw_motion(swinging(keeps_energy=False))
    titles = {axes.get_title(loc="left") for axes in plain.axes}
    assert not any("unaccounted" in title or "change of energy" in title for title in titles)
    kept = draw_motion(swinging(works=works, effects=("air", "ground")))
    assert panel(kept, "Relative change of energy")
    panel(kept, "Work of effects")


MANY = lone("revolute", body="a", on="pin", name="many", r_child=[0.5, 0])
AIRS = [f'drag"\nname = "air_{k}"\nbody = "a"\nlinear = 0.{k}' for k in (1, 2)]
KINDS = ['gravity"\ng = 9.81', *AIRS]
PUSHES = [f'motor"\nname = "push_{k}"\njoint = "pin"\ntorque = {k}' for k in (1, 2, 3, 4)]


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.usefixtures("blank_figures")
def test_many_works_are_summed_by_type(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], count: int
) -> None:
    """Up to six effects one by one, more by type: in what is said and in what is drawn; the files
    keep each.
    """
    effects = [f'[[effects]]\ntype = "{kind}\n' for kind in [*KINDS, *PUSHES[:count]]]
    scene = tmp_path / "many.toml"
    scene.write_text(MANY + "".join(effects), "utf-8")
    assert main(["simulate", str(scene), "--works", "--t-end", "1", "-o", str(tmp_path)]) == 0
    said = re.search(r"    work: (.*?)\n    kinetic", capsys.readouterr().out, re.DOTALL)
    assert said is not None
    head, *rows = (tmp_path / "many.csv").read_text("utf-8").splitlines()
    last = dict(zip(head.split(","), map(float, rows[-1].split(",")), strict=True))
    works = {name[5:]: last[name] for name in last if name.startswith("work_")}
    assert len(works) == 3 + count
    if count == 4:
        gravity, *others = works.values()
        works = {"gravity": gravity, "drag (2)": sum(others[:2]), "motor (4)": sum(others[2:])}
    reported = dict(re.findall(r"(\w+(?: \(\d\))?) (\S+) J", said[1]))
    assert list(reported) == list(works)
    np.testing.assert_allclose([*map(float, reported.values())], [*works.values()], rtol=1e-5)


def test_works_keep_their_names_while_they_are_few() -> None:
    effects = [f'[[effects]]\ntype = "{kind}\n' for kind in [*KINDS, *PUSHES]]
    model = elaborate(parse_scene(MANY + "".join(effects), "scene"))
    names = tuple(effect.name for effect in model.effects)
    works = np.arange(14.0).reshape(2, 7)
    assert works_by_type(model, names[:6], works[:, :6])[0] == names[:6]
    called, sums = works_by_type(model, names, works)
    assert called == ("gravity", "drag (2)", "motor (4)")
    np.testing.assert_array_equal(sums, [[0, 3, 18], [7, 17, 46]])
