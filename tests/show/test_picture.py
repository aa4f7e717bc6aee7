"""What is drawn of a mechanism: invented shapes, elements of effects, formulas of parameters."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from effect_cases import CASES, Case
from scenes import refusal

import eomgen
from eomgen.language.formula import Constant
from eomgen.language.rewriting import plain_data
from eomgen.model.elaborate import elaborate, expanded
from eomgen.model.model import Model
from eomgen.scene.appearance import Appearance, appearance_of
from eomgen.scene.effects import Effect
from eomgen.scene.look import Box, Camera, Cylinder, Disc, Rod, Shape, Sphere, number, numbers
from eomgen.scene.reader import built_in_names, parse_scene
from eomgen.scene.reference import by_type
from eomgen.scene.schema import Simulation
from eomgen.show.drawing import Dot, Line, Point
from eomgen.show.marks import marks_of
from eomgen.show.observe import planes_of
from eomgen.show.of_run import world_points
from eomgen.show.outlines import extent_points
from eomgen.show.picture import Picture, picture_of, shapes_of
from eomgen.show.picture_data import geometry_values, picture_data
from eomgen.show.sketches import mechanism_sketch
from eomgen.show.solid import rotation
from eomgen.show.strokes import Sight, strokes
from eomgen.show.symbols import END, WIND

DOCS = Path(__file__).parent.parent.parent / "docs"
UNTUNED = sorted((Path(__file__).parent.parent / "untuned").glob("*.toml"))
FREE = """\
name = "lone"
dimensions = {n}
[parameters]
l = 0.5
[[bodies]]
name = "b"
mass = 3.0
inertia_com = {inertia}
{shapes}
[[joints]]
name = "free"
type = "free"
child = "b"
"""


def picture_in(text: str) -> tuple[Model, Picture]:
    """The model of a scene and its picture."""
    scene = parse_scene(text)
    model = elaborate(scene)
    return model, picture_of(model, appearance_of(expanded(scene)))


def lone(inertia: object, n: int = 3, shapes: str = "") -> tuple[Model, Picture]:
    """A free body of 3 kg."""
    return picture_in(FREE.format(n=n, inertia=inertia, shapes=shapes))


def ends(picture: Picture, body: int) -> Iterator[np.ndarray]:
    """The ends of a body's rods."""
    for shape in picture.bodies[body].shapes:
        if isinstance(shape, Rod):
            yield from (np.array(numbers(end)) for end in (shape.start, shape.end))


@pytest.mark.every(2)
@pytest.mark.parametrize("name", ["triple_pendulum", "finger", "robot_arm", "car", "puppet"])
def test_links_reach_their_joints_at_any_parameters(name: str) -> None:
    """The generated module says where bodies are; their rods meet there, whatever the lengths."""
    text = UNTUNED[0].with_name(f"{name}.toml").read_text("utf-8")
    scene = parse_scene(f'outputs = ["body_poses"]\nroute = "aba"\n{text}')
    model, module = elaborate(scene), eomgen.load(eomgen.generate(scene))
    picture = picture_of(model, Appearance())
    random = np.random.default_rng(5)
    for _ in range(5):
        lengths = {p.name: p.default for p in model.parameters if p.unit == "m" or p.name == "l"}
        values = {name: value * random.uniform(0.3, 3.0) for name, value in lengths.items()}
        drawn = picture.valued({**model.defaults, **values})
        poses = module.body_poses(0.0, random.uniform(-2, 2, len(module.STATES)), values)
        for joint in drawn.joints:
            pin = world_points(poses[np.newaxis], joint.child, np.array(numbers(joint.at_child)))
            for body in {joint.parent, joint.child} - {-1}:
                tips = [world_points(poses[np.newaxis], body, end) for end in ends(drawn, body)]
                assert min(np.linalg.norm(tip - pin) for tip in tips) < 1e-12


def gaps(picture: Picture, dimensions: int) -> dict[tuple[str, str], float]:
    """For each joint and body the distance of its point from the bounds of the body's shapes, m."""
    found = {}
    for joint in picture.joints:
        for body, at in ((joint.parent, joint.at_parent), (joint.child, joint.at_child)):
            if body >= 0:
                corners = extent_points(picture.bodies[body].shapes, dimensions)
                place = np.array(numbers(at))
                beyond = np.maximum(corners.min(axis=0) - place, place - corners.max(axis=0))
                far = float(np.linalg.norm(np.maximum(beyond, 0.0)))
                found[joint.name, picture.bodies[body].name] = far
    return found


@pytest.mark.every(4)
@pytest.mark.parametrize("name", [name for name in built_in_names() if name != "puma560"])
def test_shapes_of_built_in_scenes_stay_at_their_joints(name: str) -> None:
    """Whatever the lengths. The PUMA's shapes are beside some of its joints from the beginning."""
    scene = eomgen.read(name)
    model = elaborate(scene)
    picture = picture_of(model, appearance_of(expanded(scene)))
    lengths = [p.name for p in model.parameters if p.unit == "m"]
    before = gaps(picture.valued(model.defaults), model.dimensions)
    random = np.random.default_rng(7)
    for _ in range(3):
        others = {key: model.defaults[key] * random.uniform(0.5, 2.0) for key in lengths}
        after = gaps(picture.valued({**model.defaults, **others}), model.dimensions)
        assert all(after[key] <= gap + 1e-9 for key, gap in before.items())


def moments_of(shape: Any) -> np.ndarray:
    """The inertia about its centre of a uniform shape of 3 kg, kg m²."""
    match shape:
        case Box():
            squares = np.array(numbers(shape.size)) ** 2
            own = np.diag(squares.sum() - squares) / 12
            turn = rotation(shape.orientation_deg)
            return np.asarray(3 * turn @ own @ turn.T)
        case Sphere():
            return np.asarray(3 * 0.4 * number(shape.radius) ** 2 * np.eye(3))
        case Cylinder():
            along = np.subtract(numbers(shape.end), numbers(shape.start))
            length, radius = float(np.linalg.norm(along)), number(shape.radius)
            n = np.outer(along, along) / length**2
            return np.asarray(
                3 * (radius**2 / 2 * n + (radius**2 / 4 + length**2 / 12) * (np.eye(3) - n))
            )
    raise AssertionError(shape)


@pytest.mark.parametrize(
    "inertia",
    [
        [1.0, 0.5, 0.8],
        [1.0, 0.5, 0.8, 0.2, -0.1, 0.05],
        [0.4, 0.4, 0.4],
        [0.9, 0.6, 0.6],
        [0.9, 0.9, 0.3],
        [0.6, 1.1, 0.6],
    ],
)
def test_a_solid_has_the_inertia_of_its_body(inertia: list[float]) -> None:
    """If it were filled evenly with the body's mass."""
    model, picture = lone(inertia)
    found = moments_of(picture.valued(model.defaults).bodies[0].shapes[0])
    xx, yy, zz, xy, xz, yz = [*inertia, 0.0, 0.0, 0.0][:6]
    np.testing.assert_allclose(found, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], atol=1e-12)


def test_planar_solids_have_the_moment_of_their_bodies() -> None:
    """A rectangle if it is free, a disc if it rotates about a pin."""
    picture = lone(0.7, 2)[1]
    (box,) = picture.bodies[0].shapes
    assert isinstance(box, Box)
    assert sum(3 * x**2 / 12 for x in numbers(box.size)) == pytest.approx(0.7)
    pinned = FREE.format(n=2, inertia=0.7, shapes="")
    pinned = pinned.replace('"free"\nchild', '"revolute"\nparent = "world"\nchild')
    disc = picture_in(pinned)[1].bodies[0].shapes[0]
    assert isinstance(disc, Disc) and 3 * number(disc.radius) ** 2 / 2 == pytest.approx(0.7)


@pytest.mark.parametrize("length", [1e-150, 1e100, 0.0])
def test_lengths_that_no_picture_has_are_left_out(length: float) -> None:
    """They may come from parameters of a run; everything else is drawn."""
    model = eomgen.check(UNTUNED[0].with_name("triple_pendulum.toml"))
    for shapes in shapes_of(model.with_parameters({"l": length}), Appearance()):
        tables = plain_data(shapes, number)
        sizes = [x for table in tables for x in table.values() if isinstance(x, float | list)]
        assert sizes and np.abs(np.hstack(sizes)).max() < 1e90


def test_bodies_have_colours_of_their_own_and_welded_ones_share() -> None:
    """Unless the scene gives one; in a chain too."""
    picture = picture_of(eomgen.check("chain"), Appearance())
    assert len({body.color for body in picture.bodies}) == len(picture.bodies)
    given = lone(0.7, 2, 'shapes = [{ type = "disc", radius = 1, color = "#123456" }]')[1]
    assert given.bodies[0].color == "#123456"


SHAPED = 'shapes = [{ type = "box", size = ["2*l", "w"] }, { type = "disc", radius = "l" }]'


def test_formulas_in_shapes_follow_the_parameters() -> None:
    """In figures, and in the page's data through its geometry; definitions work too."""
    text = FREE.format(n=2, inertia=0.7, shapes=SHAPED) + '[definitions]\nw = "l**2"\n'
    picture = picture_in(text)[1]
    for length in (0.5, 1.5):
        shapes = picture.valued({"l": length}).bodies[0].shapes
        assert isinstance(shapes[0], Box) and numbers(shapes[0].size) == (2 * length, length**2)
        assert isinstance(shapes[1], Disc) and number(shapes[1].radius) == length
    data, geometry = picture_data(picture)
    box = data["bodies"][0]["shapes"][0]
    values = geometry_values(geometry, {"l": 1.5})
    assert [values[size["of"]] for size in box["size"]] == [3.0, 2.25]


def test_shapes_without_a_size_are_left_out() -> None:
    """Of a run with other parameters; a scene itself may have none."""
    shapes = 'shapes = [{ type = "disc", radius = "l - 0.2" }, { type = "disc", radius = "1/l" }]'
    picture = lone(0.7, 2, shapes)[1]
    counts = [len(picture.valued({"l": x}).bodies[0].shapes) for x in (0.5, 0.1, 0.2, 0.0)]
    assert counts == [2, 1, 1, 0]


def resolved(data: Any, values: list[float]) -> Any:
    """Data with the values of the geometry in place of references."""
    if isinstance(data, dict):
        if set(data) == {"of"}:
            return values[data["of"]]
        return {key: resolved(part, values) for key, part in data.items()}
    return [resolved(part, values) for part in data] if isinstance(data, list) else data


@pytest.mark.every(8)
@pytest.mark.parametrize("name", [*built_in_names(), *UNTUNED], ids=str)
def test_data_with_its_geometry_is_the_picture(name: str | Path) -> None:
    """At other values of the parameters than those of the scene, and it is plain JSON."""
    scene = eomgen.read(name)
    model = elaborate(scene)
    picture = picture_of(model, appearance_of(expanded(scene)))
    data, geometry = picture_data(picture)
    values = {p.name: 1.25 * p.default for p in model.parameters}
    found = resolved(json.loads(json.dumps(data)), geometry_values(geometry, values))
    assert found == picture_data(picture.valued(values))[0]


def test_every_effect_is_drawn() -> None:
    """Each type makes elements, with finite lines; the scene without it does not have them."""
    drawn = set()
    for case in CASES:
        kind = case.table.split('type = "')[1].split('"')[0]
        own = [e for e in with_case(case)[1].elements if getattr(e, "effect", "") == "marker"]
        drawn |= {kind} if own or kind == "gravity" else set()
        assert own or kind in ("drag", "gravity"), case
    types = {get_args(effect.model_fields["type"].annotation)[0] for effect in effects()}
    assert drawn == types


def effects() -> tuple[Any, ...]:
    """The classes of all effects."""
    union, _ = get_args(Effect)
    return get_args(union)


def with_case(case: Case) -> tuple[Model, Picture]:
    """The model of a case and its picture."""
    model, picture = picture_in(case.text())
    drawn = picture.valued(model.defaults)
    n = model.dimensions
    pose = np.eye(3, 4)[np.newaxis] if n == 3 else np.zeros((1, 3))
    pose = np.repeat(pose, len(model.bodies), axis=0)
    for stroke in strokes(Sight(drawn, pose, np.eye(3))):
        assert stroke.points.shape[1:] == (2,) and np.isfinite(stroke.points).all()
    return model, picture


def test_a_page_draws_the_lines_of_figures() -> None:
    """Each symbol once, and all that a figure shows but wind, which moves on a page."""
    for case in CASES:
        model, picture = with_case(case)
        data, _ = picture_data(picture.valued(model.defaults))
        on_page = [line for mark in data["marks"] for line in data["symbols"][mark["symbol"]]]
        shown = [
            {**asdict(line), "points": [[*map(float, point)] for point in line.points]}
            for mark in marks_of(picture.valued(model.defaults))
            if mark.symbol not in (END, WIND)
            for line in mark.symbol
        ]
        assert on_page == shown and len(data["symbols"]) <= len(data["marks"])


CART = """
name = "cart"
bodies = [
    { name = "cart", mass = 9.0, inertia_com = 1.0 },
    { name = "wheel", mass = 1.0, inertia_com = 0.001 },
    { name = "load", mass = 1.0, inertia_com = 0.1 },
]
joints = [
    { name = "flight", type = "free", child = "cart" },
    { name = "axle", type = "revolute", parent = "cart", child = "wheel", r_parent = [1, -1] },
    { name = "rail", type = "prismatic", parent = "cart", child = "load", axis = [1, 0] },
]
initial = { q = { cart_x = 0.0 }, guess = { cart_y = 2.0 } }
[[effects]]
type = "spring"
name = "coil"
body_1 = "cart"
body_2 = "load"
at_2 = [5, 0]
stiffness = 1
[[constraints]]
type = "rolling"
name = "tyre"
body = "wheel"
radius = 0.4
normal = [3, 4]
other_at = [1, 1]
"""


def test_wheels_stand_on_the_ground_and_bodies_reach_what_holds_them() -> None:
    """A wheel has the radius with which it rolls, whatever its inertia, and the plane on which it
    rolls is drawn; a slider leads to its spring; of what gravitation attracts the heavier is
    larger.
    """
    model, picture = picture_in(CART)
    drawn = picture.valued(model.defaults)
    (disc,) = (shape for shape in drawn.bodies[1].shapes if isinstance(shape, Disc))
    assert number(disc.radius) == 0.4
    (plane,) = planes_of(drawn)
    np.testing.assert_allclose([*plane.normal, plane.offset], [0.6, 0.8, 1.4])
    assert any(np.allclose(tip, [5.0, 0.0]) for tip in ends(drawn, 2))
    model, picture = picture_in(PAIR)
    drawn = picture.valued(model.defaults)
    small, large = (number(body.shapes[0].radius) for body in drawn.bodies)
    assert large > 2 * small


PAIR = """
name = "pair"
bodies = [{ name = "moon", mass = 1.0 }, { name = "planet", mass = 100.0 }]
joints = [
    { name = "a", type = "particle", parent = "world", child = "moon" },
    { name = "b", type = "particle", parent = "world", child = "planet" },
]
effects = [{ type = "pairwise", name = "pull", gravitation = 1.0 }]
initial = { q = { moon_x = 1.0 } }
"""


def test_springs_end_where_they_are_held() -> None:
    """The lines of a coil and of a slack rope begin and end at the spring's points."""
    for name, held in (("mass_on_spring", 0.3), ("swing", 0.9)):
        model = eomgen.check(UNTUNED[0].with_name(f"{name}.toml"))
        drawn = picture_of(model, Appearance()).valued(model.defaults)
        pose = np.array([[0.0, held, 0.0]])
        if model.dimensions == 3:
            pose = np.eye(3, 4)[np.newaxis] + np.array([0, 0, 0, held])
        sight = Sight(drawn, pose, np.eye(3))
        for link in (e for e in drawn.elements if e.kind in ("spring_damper", "rope")):
            lines = [s.points for s in strokes(sight) if s.line.fill is None]
            tips = np.array([[line[0], line[-1]] for line in lines])
            wanted = np.array([sight.at(link.start), sight.at(link.end)])
            assert (np.abs(tips - wanted).max(axis=(1, 2)) < 1e-12).any() or link.kind != "rope"
            for end in wanted:
                assert (np.abs(tips - end).max(axis=2) < 1e-12).any()


def test_each_shape_and_mode_has_a_picture() -> None:
    """In docs/pictures.md; and so has each kind of element that has lines."""
    page = (DOCS / "pictures.md").read_text("utf-8")
    every = (path.stem for path in (DOCS / "pictures").glob("*.png"))
    shown = {name for name in every if not name.startswith("tutorial")}  # they are in its page
    assert all(f"(pictures/{name}.png)" in page for name in shown)
    modes = get_args(get_args(Camera.model_fields["mode"].annotation)[0])
    assert {*by_type(Shape), *modes} <= shown
    kinds = {e.kind for case in CASES for e in with_case(case)[1].elements}
    assert kinds - {"plane", "torque", "gravity"} <= shown


WRONG = [
    ('{ type = "disc", radius = "r" }', "bodies[0].shapes[0].radius: unknown parameter 'r'"),
    ('{ type = "disc", radius = "l - 1" }', "bodies[0].shapes[0].radius: -0.5 is not positive"),
    ('{ type = "disc", radius = "b_angle" }', "bodies[0].shapes[0].radius: unknown parameter"),
    ('{ type = "disc", radius = "l +" }', "bodies[0].shapes[0].radius: 'l +' is not a formula"),
    ('{ type = "box", size = ["l", 0.0] }', "bodies[0].shapes[0].size[1]: 0 is not positive"),
    ('{ type = "box", size = ["1/(l - 0.5)", 1] }', "bodies[0].shapes[0].size[0]: its value is "),
    (
        '{ type = "disc", radius = 1, color = "red" }',
        "bodies[0].shapes[0].color: 'red' is not a colour",
    ),
]
CAMERAS = [
    ('mode = "fit"\nheight = 3.0', "camera.height: mode 'fit' finds"),
    ('mode = "fixed"\nfollow = "b"', "camera.follow: a fixed camera follows nothing"),
    ('mode = "near"', "camera.mode: unknown value 'near'; known: fit, follow, fixed"),
    ("height = -1.0", "camera.height: -1"),
]


@pytest.mark.parametrize(("shape", "said"), WRONG)
def test_wrong_shapes_are_refused_in_one_line(shape: str, said: str) -> None:
    assert said in refusal(lambda: lone(0.7, 2, f"shapes = [{shape}]"))


@pytest.mark.parametrize(("camera", "said"), CAMERAS)
def test_wrong_cameras_are_refused_in_one_line(camera: str, said: str) -> None:
    text = FREE.format(n=2, inertia=0.7, shapes="") + f"[camera]\n{camera}\n"
    assert said in refusal(lambda: picture_in(text))


def test_a_model_knows_nothing_of_pictures_nor_of_integrators() -> None:
    """Scenes that differ in no more than these make one model."""
    scene = parse_scene(FREE.format(n=2, inertia=0.7, shapes=SHAPED.replace('"w"', "1")))
    bare = tuple(body.replaced(shapes=()) for body in scene.bodies)
    other = scene.replaced(
        bodies=bare, camera=Camera(height=7.0), simulation=Simulation(t_end=3.0, integrator="rk4")
    )
    assert appearance_of(other) != appearance_of(scene)
    assert elaborate(other) == elaborate(scene)
    assert all(isinstance(part, Constant) for part in scene.bodies[0].shapes[0].size[1:])  # type: ignore[union-attr]


def test_a_sketch_closes_loops_and_holds_nothing_that_flies() -> None:
    """In a four-bar linkage two bars meet in each of the moving pins, and the others stand on the
    ground; a ball that flies has no joint, as a pendulum has.
    """
    bars, pins = _bars_and_pins(eomgen.check("four_bar"))
    assert sorted(sum(pin in bar for bar in bars) for pin in pins) == [1, 1, 2, 2]
    ball = FREE.replace('"free"', '"planar"').format(n=2, inertia=1, shapes="")
    ball = ball.replace("child", 'parent = "world"\nchild')
    assert not _bars_and_pins(elaborate(parse_scene(ball)))[1]
    assert len(_bars_and_pins(eomgen.check("pendulum"))[1]) == 1


def _bars_and_pins(model: Model) -> tuple[list[tuple[Point, ...]], set[Point]]:
    items = mechanism_sketch(model, ()).items
    bars = [item.points for item in items if isinstance(item, Line) and item.style == "body"]
    pins = {item.centre for item in items if isinstance(item, Dot) and item.style == "arm"}
    return bars, pins
