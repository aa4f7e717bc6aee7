"""Space in figures: true projections, hidden surfaces, scenes of many bodies."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Text
from pydantic import TypeAdapter
from scenes import refusal

from eomgen.scene.joints.base import Primitive
from eomgen.scene.look import BARE, Box, Camera, Cylinder, Ellipsoid, Rod, Shape, Sphere, check_look
from eomgen.show.figure import draw_motion
from eomgen.show.framing import View
from eomgen.show.motion import Motion, thinned
from eomgen.show.observe import joint_drift
from eomgen.show.raster import Frame, frame_around, render_solids
from eomgen.show.solid import Solids, mesh, rotation, solids
from eomgen.show.style import write_figure
from eomgen.show.view import Sight, cast_of, eye_axes, floor_under, look

HEIGHT = 1.5
SLIDER = Sphere(type="sphere", radius=0.3, color="#228833")
ARM = Rod(type="rod", start=(0.0, 0.0, 0.0), end=(0.0, 0.0, -1.0), width=0.1)


def about_y(angle: Any) -> Any:
    cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    rows = [[cos, zero, sin], [zero, zero + 1, zero], [-sin, zero, cos]]
    return np.moveaxis(np.array(rows), -1, 0)


def sliding(n: int = 31, **changes: Any) -> Motion:
    """A ball that slides along x with an arm that swings about y, made up."""
    t = np.linspace(0.0, 2.0, n)
    angle, x = np.sin(3 * t), 0.5 * np.cos(t)
    poses = np.zeros((n, 2, 3, 4))
    poses[:, 0, :, :3] = np.eye(3)
    poses[:, 1, :, :3] = about_y(angle)
    poses[:, :, 0, 3] = x[:, np.newaxis]
    poses[:, :, 2, 3] = HEIGHT
    motion = Motion(
        name="slider",
        title="Slider",
        t=t,
        y=np.column_stack([angle, x]),
        states=("angle", "x"),
        units=("rad", "m"),
        positions=(0, 1),
        bodies=("slider", "arm"),
        shapes=((SLIDER,), (ARM,)),
        joints=("pin",),
        poses=poses,
        kinetic_energy=1 + t,
        potential_energy=1 - t,
        joint_drift=np.zeros((n, 1)),
        framing=View(center=(0.0, 0.0, 1.0), height=3.0),
        integrator="made up",
        finished=True,
        message="",
        anchors=((1, 0.0, 0.0, 0.0),),
    )
    return replace(motion, **changes)


def chain(count: int = 100, n: int = 40) -> Motion:
    """Links in a row, each swung a little further; with all coordinates of free bodies."""
    t = np.linspace(0.0, 2.0, n)
    poses = np.zeros((n, count, 3, 4))
    angles = np.sin(t[:, np.newaxis] - np.arange(count) / 20)
    poses[..., :3] = about_y(angles.ravel()).reshape(n, count, 3, 3)
    poses[..., 3] = np.cumsum(-0.1 * poses[..., 2], axis=1)
    zero = np.zeros_like(angles)
    quaternions = np.stack([np.cos(angles / 2), zero, np.sin(angles / 2), zero], axis=-1)
    link = Rod(type="rod", start=(0.0, 0.0, 0.05), end=(0.0, 0.0, -0.05), width=0.03)
    names = ("x", "y", "z", "qw", "qx", "qy", "qz")
    return Motion(
        name="chain",
        title="",
        t=t,
        y=np.concatenate([poses[..., 3], quaternions], axis=-1).reshape(n, -1),
        states=tuple(f"link_{k}_{name}" for k in range(1, count + 1) for name in names),
        units=(*["m"] * 3, *[""] * 4) * count,
        positions=tuple(range(7 * count)),
        bodies=tuple(f"link_{k}" for k in range(1, count + 1)),
        shapes=((link,),) * count,
        joints=tuple(f"pin_{k}" for k in range(1, count + 1)),
        poses=poses,
        kinetic_energy=t,
        potential_energy=-t,
        joint_drift=1e-14 * (1 + np.outer(t, np.arange(count))),
        framing=View(height=12.0),
        integrator="made up",
        finished=True,
        message="",
        anchors=tuple((k, 0.0, 0.0, 0.05) for k in range(count)),
        quaternions=tuple((7 * k + 3, 7 * k + 4, 7 * k + 5, 7 * k + 6) for k in range(count)),
    )


# ---- The language of looks ----

SPHERE = {"type": "sphere", "radius": 1.0}
BOX = {"type": "box", "size": [1.0, 2.0]}
CUBOID = {"type": "box", "size": [1.0, 2.0, 3.0]}


@pytest.mark.parametrize(
    ("dimensions", "shape", "said"),
    [
        (2, BOX, None),
        (2, {**BOX, "center": [1.0, 2.0], "angle": 0.5}, None),
        (3, {**CUBOID, "center": [1.0, 2.0, 3.0], "orientation_deg": [0, 0, 90]}, None),
        (3, SPHERE, None),
        (3, {"type": "ellipsoid", "radii": [1.0, 2.0, 3.0]}, None),
        (2, SPHERE, "shapes[1].type: 'sphere' is a shape of space; use 'disc'"),
        (
            3,
            {"type": "disc", "radius": 1.0},
            "shapes[1].type: 'disc' is a shape of the plane; use 'sphere'",
        ),
        (3, BOX, "shapes[1].size: [1.0, 2.0] has 2 components; in space give 3"),
        (2, CUBOID, "shapes[1].size: [1.0, 2.0, 3.0] has 3 components; in the plane give 2"),
        (
            3,
            {**SPHERE, "center": [1.0, 2.0]},
            "shapes[1].center: [1.0, 2.0] has 2 components; in space give 3",
        ),
        (
            2,
            {"type": "rod", "start": [0.0, 0.0], "end": [1.0, 0.0, 0.0], "width": 0.1},
            "shapes[1].end: [1.0, 0.0, 0.0] has 3 components; in the plane give 2",
        ),
        (
            2,
            {"type": "polygon", "points": [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0, 0.0]]},
            "shapes[1].points[2]: [1.0, 0.0, 0.0] has 3 components; in the plane give 2",
        ),
        (
            3,
            {**CUBOID, "angle": 1.0},
            "shapes[1].angle: rotates a box in the plane; in space use 'orientation_deg'",
        ),
        (
            2,
            {**BOX, "orientation_deg": [0, 0, 90]},
            "shapes[1].orientation_deg: rotates a box in space; in the plane use 'angle'",
        ),
        (
            3,
            {"type": "cylinder", "start": [0.0] * 3, "end": [0.0] * 3, "radius": 1.0},
            "shapes[1].end: [0.0, 0.0, 0.0] is also the start; give it a length",
        ),
    ],
)
def test_shapes_fit_the_dimensions(
    dimensions: int, shape: dict[str, Any], said: str | None
) -> None:
    good = Box(type="box", size=(1.0,) * dimensions)
    shapes = (good, TypeAdapter(Shape).validate_python(shape))
    if said is None:
        check_look(shapes, None, dimensions, "bodies[0]")
        return
    found = refusal(lambda: check_look(shapes, None, dimensions, "bodies[0]"))
    assert found == f"bodies[0].{said}"


@pytest.mark.parametrize(
    ("dimensions", "camera", "said"),
    [
        (2, Camera(), None),
        (3, Camera(center=(1.0, 2.0, 3.0), azimuth_deg=10.0, elevation_deg=-90.0), None),
        (2, Camera(center=(1.0, 2.0, 3.0)), "center: [1.0, 2.0, 3.0] has 3 components; in the "
         "plane give 2"),
        (3, Camera(center=(1.0, 2.0)), "center: [1.0, 2.0] has 2 components; in space give 3"),
        (2, Camera(azimuth_deg=10.0), "azimuth_deg: 10: the camera cannot be rotated in the plane; "
         "leave it out, or set dimensions = 3"),
    ],
)  # fmt: skip
def test_cameras_fit_the_dimensions(dimensions: int, camera: Camera, said: str | None) -> None:
    if said is None:
        check_look((), camera, dimensions, "camera")
        return
    assert refusal(lambda: check_look((), camera, dimensions, "camera")) == f"camera.{said}"


# ---- Solids ----

SOLIDS = (
    (
        Box(type="box", size=(1, 2, 3), center=(1, 2, 3), orientation_deg=(10, 20, 30)),
        6.0,
        24,  # each of the twelve edges is a side of two faces
        1.0,
    ),
    (Sphere(type="sphere", radius=1.0, center=(5, 0, 0)), 4 / 3 * np.pi, 0, 2.0),
    (Ellipsoid(type="ellipsoid", radii=(1, 2, 0.5)), 4 / 3 * np.pi, 0, 1.0),
    (Cylinder(type="cylinder", start=(1, 2, 3), end=(1, 1, 1), radius=0.5), 1.756, 128, 1.0),
    (Rod(type="rod", start=(1, 2, 3), end=(1, 1, 1), width=1.0), 2.2798, 0, 1.0),
    (Rod(type="rod", start=(1, 2, 3), end=(1, 2, 3), width=1.0), np.pi / 6, 0, 1.0),
)


@pytest.mark.parametrize(("shape", "volume", "edges", "thickness"), SOLIDS)
def test_solids_are_closed_and_face_outwards(
    shape: Shape, volume: float, edges: int, thickness: float
) -> None:
    for grain in (0.01, 100.0):
        solid = mesh(shape, grain)
        a, b, c, d = np.moveaxis(solid.vertices[solid.faces], 1, 0)
        parts = np.einsum("fi,fi->f", a, np.cross(b, c) + np.cross(c, d)) / 6
        assert parts.sum() == pytest.approx(volume, rel=0.03 if grain < 1 else 0.3)
        assert solid.thickness == pytest.approx(thickness, rel=0.03 if grain < 1 else 0.3)
        np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=1), 1.0)
        # Whatever face lies beyond a side has this face beyond one of its own sides.
        for face, row in enumerate(solid.across):
            assert all(other in (-1, face) or face in solid.across[other] for other in row)
        if grain < 1 or edges in (0, 24):
            assert (solid.across == -1).sum() == edges


def test_orientation_turns_about_x_then_y_then_z() -> None:
    np.testing.assert_allclose(rotation((90, 0, 0)) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(rotation((90, 90, 0)) @ [0, 1, 0], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(rotation((0, 90, 90)) @ [0, 0, 1], [0, 1, 0], atol=1e-15)
    box = mesh(Box(type="box", size=(4, 2, 1), orientation_deg=(0, 0, 90)), 1.0)
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), [2, 4, 1], atol=1e-15)


def test_many_solids_are_coarser_and_alike_ones_shared() -> None:
    one = solids(((SLIDER,),), 3.0, 4000)
    many = solids(((SLIDER, ARM),) * 100, 3.0, 4000)
    assert len(many.meshes) == 2 and many.bodies[7] == ((0, SLIDER.color), (1, BARE))
    assert len(many.meshes[0].faces) < len(one.meshes[0].faces)
    assert len(cast_of(many).faces) == 100 * sum(len(m.faces) for m in many.meshes)
    assert solids(((), ()), 3.0, 4000) == Solids((), ((), ()))


# ---- Projection and hidden surfaces ----


def test_the_eye_stands_where_the_camera_says() -> None:
    for azimuth, elevation in ((0, 0), (-60, 20), (123, -45), (10, 90)):
        axes = eye_axes(azimuth, elevation)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        np.testing.assert_allclose(axes, eye_axes(azimuth + 360, elevation), atol=1e-14)
        assert axes[0, 2] == 0.0 and axes[1, 2] >= 0.0  # z is never aslant, nor upside down
    np.testing.assert_allclose(eye_axes(-90, 0), [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-15)
    np.testing.assert_allclose(eye_axes(-90, 90), np.eye(3), atol=1e-15)
    np.testing.assert_allclose(eye_axes(0, 0)[2], [1, 0, 0], atol=1e-15)


def picture(shapes: tuple[Shape, ...], azimuth: float, elevation: float) -> Any:
    """Red, green, blue and cover of some shapes of one body, and the frame they lie in."""
    cast = cast_of(Solids(tuple(mesh(s, 0.05) for s in shapes), (tuple(
        (k, s.color or BARE) for k, s in enumerate(shapes)),)))  # fmt: skip
    sight = look(cast, np.eye(3, 4)[np.newaxis], eye_axes(azimuth, elevation))
    frame = frame_around(sight.faces.reshape(-1, 3)[:, :2], 300)
    return rendered(sight, frame), frame


def rendered(sight: Sight, frame: Frame) -> Any:
    """Red, green, blue and cover of each pixel."""
    shown, colours = render_solids(sight, frame, np.zeros(3), 0.6)
    table = np.vstack([np.insert(colours, 3, 1.0, axis=1), np.zeros(4)])
    return table[shown]


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (-60, 20), (200, 89)])
def test_a_ball_is_a_circle_from_everywhere(azimuth: float, elevation: float) -> None:
    image, frame = picture(
        (Sphere(type="sphere", radius=1.0, center=(3, 2, 1)),), azimuth, elevation
    )
    covered = image[..., 3] > 0
    assert covered.sum() / frame.pixels_per_metre**2 == pytest.approx(np.pi, rel=0.03)
    rows, columns = np.nonzero(covered)
    x = frame.left + (columns + 0.5) / frame.pixels_per_metre
    y = frame.top - (rows + 0.5) / frame.pixels_per_metre
    right, up, _ = eye_axes(azimuth, elevation) @ [3.0, 2.0, 1.0]
    assert np.hypot(x - right, y - up).max() == pytest.approx(1.0, abs=0.02)


def test_what_is_nearer_hides_what_is_farther() -> None:
    """A rod through a plate is seen on the eye's side only, whatever the order of the shapes."""
    plate = Box(type="box", size=(2.0, 0.2, 2.0), color="#ff0000")
    rod = Rod(type="rod", start=(-0.5, -1.0, 0.0), end=(0.5, 1.0, 0.0), width=0.2, color="#0000ff")
    for shapes in ((plate, rod), (rod, plate)):
        image, frame = picture(shapes, -90.0, 0.0)  # along y: the rod's start is nearer

        def colour(x: float, image: Any = image, frame: Any = frame) -> str:
            row = int(frame.top * frame.pixels_per_metre)
            red, _, blue, cover = image[row, int((x - frame.left) * frame.pixels_per_metre)]
            return "clear" if cover == 0 else "red" if red > blue else "blue"

        assert [colour(x) for x in (-0.4, 0.4, 0.9)] == ["blue", "red", "red"]


@pytest.mark.parametrize(
    ("lift", "z"),
    [
        pytest.param(0.0, 0.0, id="stands above z = 0"),
        pytest.param(-1.0, -0.5, id="hangs below: 1.5 - 1 - 0.3 - 1 m, but in the picture"),
        pytest.param(-0.8, -0.35, id="hangs below"),
        pytest.param(50.0, 50.45, id="far up"),
    ],
)
def test_the_floor_is_under_the_motion(lift: float, z: float) -> None:
    motion = sliding()
    poses = motion.poses.copy()
    poses[..., 2, 3] += lift
    motion = replace(motion, poses=poses)
    if lift > 1:
        motion = replace(motion, framing=View(center=(0.0, 0.0, 51.0), height=3.0))
    floor = floor_under(motion, cast_of(solids(motion.shapes, 3.0, 1000)))
    assert floor.z == pytest.approx(z, abs=1e-3)
    lines = floor.lines()
    np.testing.assert_array_equal(lines[..., 2], floor.z)
    assert floor.through_origin().sum() == 2
    low, high = lines.reshape(-1, 3).min(axis=0), lines.reshape(-1, 3).max(axis=0)
    assert low[0] <= -0.5 and high[0] >= 0.8
    assert high[1] - low[1] > 0.5 * (high[0] - low[0])


# ---- Figure ----


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies of few faces and pixels, which are quick to draw."""
    monkeypatch.setattr("eomgen.show.space.BUDGET", 400)
    monkeypatch.setattr("eomgen.show.space.PIXELS", 350)


def panel(figure: Any, title: str) -> Any:
    return next(axes for axes in figure.axes if title in axes.get_title(loc="left"))


def test_figure_in_space() -> None:
    motion = sliding()
    figure = draw_motion(motion)
    axes = panel(figure, "8 poses")
    (image,) = axes.get_images()
    left, right, low, high = image.get_extent()
    eye = eye_axes(-60.0, 20.0)
    # Ball and arm at their farthest lie in the image; the ball's way is a line in the picture.
    start = eye @ motion.places[0, 0]
    assert left < start[0] - 0.3 and right > start[0] + 0.3 and low < start[1] < high
    way = axes.get_lines()[0].get_xydata()
    np.testing.assert_allclose(way, (motion.places[:, 0] @ eye.T)[:, :2], atol=1e-12)
    mark = axes.get_lines()[-1].get_xydata()  # the pin at the last instant
    np.testing.assert_allclose(mark, [(eye @ motion.places[-1, 1])[:2]], atol=1e-12)
    assert axes.get_aspect() == 1.0
    assert "Grid 0.2 m, at z = 0" in axes.get_xlabel()


def test_orientations_have_a_panel_of_their_own() -> None:
    motion = chain(2)
    figure = draw_motion(motion)
    lines = panel(figure, "unit quaternions").get_lines()
    assert [line.get_linestyle() for line in lines] == ["-"] * 4 + ["--"] * 4
    assert lines[0].get_color() == lines[4].get_color() != lines[1].get_color()
    np.testing.assert_array_equal(lines[5].get_ydata(), motion.y[:, 11])
    assert len(panel(figure, "Lengths").get_lines()) == 6


@pytest.mark.usefixtures("coarse")
def test_a_hundred_bodies_make_a_figure(tmp_path: Path) -> None:
    motion = chain()
    figure = draw_motion(motion)
    lengths = panel(figure, "Lengths")
    (image,) = lengths.get_images()
    shown = np.asarray(image.get_array())
    assert shown.shape[0] == 300 and not lengths.get_lines()
    # All x come first, then all y, then all z.
    np.testing.assert_allclose(shown[:100, 0], motion.places[0, :, 0])
    np.testing.assert_allclose(shown[200:, -1], motion.places[-1, :, 2])
    names = [text.get_text() for text in lengths.get_yticklabels()]
    assert (names[0], names[-1]) == ("link 1 x", "link 100 z")
    gaps = panel(figure, "Gap in the joints")
    assert [text.get_text() for text in gaps.get_legend().texts] == ["largest of 100", "median"]
    np.testing.assert_array_equal(gaps.get_lines()[0].get_ydata(), motion.joint_drift.max(axis=1))
    mechanism = panel(figure, "8 poses")
    assert len(mechanism.get_lines()) == 12  # ways of some, and no joints marked


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"shapes": ((), ()), "anchors": ()}, id="nothing to draw"),
        pytest.param(
            {"shapes": ((Sphere(type="sphere", radius=1e-100),), ())}, id="smaller than rounding"
        ),
        pytest.param({"n": 1, "joint_drift": np.zeros((1, 1))}, id="one sample"),
        pytest.param({"joints": (), "joint_drift": np.zeros((31, 0))}, id="no joint holds a point"),
        pytest.param(
            {"camera": View(elevation_deg=-30.0, follow="arm", background="#102030")},
            id="from below, on dark paper",
        ),
    ],
)
@pytest.mark.usefixtures("coarse")
@pytest.mark.every(4)
def test_odd_motions_in_space_are_drawn(tmp_path: Path, changes: dict[str, Any]) -> None:
    motion = sliding(**changes)
    figure = draw_motion(motion)
    write_figure(figure, tmp_path / "a.svg")  # every warning is an error here
    ElementTree.parse(tmp_path / "a.svg")
    texts = [text.get_text() for text in figure.findobj(Text)]
    assert ("no joints that hold a point" in texts) == (not motion.joints)


def test_motions_are_thinned_and_checked() -> None:
    motion = sliding(31)
    poses = motion.poses.copy()
    poses[3, 1, 2, 1] = np.nan
    motion = replace(motion, poses=poses)
    assert len(thinned(motion).t) == 30 and thinned(motion, 10).poses.shape == (10, 2, 3, 4)
    with pytest.raises(AssertionError):
        sliding(anchors=((1, 0.0, 0.0),))


# ---- Gaps ----


KINDS: dict[str, tuple[Any, ...]] = {
    "free": ("prismatic", "prismatic", "prismatic", "spherical"),
    "ball": ("spherical",),
    "planar": ("prismatic", "prismatic", "revolute"),
    "prismatic": ("prismatic",),
    "revolute": ("revolute",),
    "weld": (),
}


def joint(kind: str, parent: str, r_parent: Any = (), r_child: Any = ()) -> Any:
    primitives = tuple(Primitive(primitive) for primitive in KINDS[kind])
    held = SimpleNamespace(
        name=kind, parent=parent, child=f"{kind}_body", primitives=lambda _: primitives
    )
    if kind != "free":
        held.r_parent, held.r_child = r_parent, r_child
    return SimpleNamespace(name=f"{kind}_body", joint=held)


def test_gaps_of_joints_that_hold_a_point() -> None:
    bodies = (
        joint("free", "world"),
        joint("ball", "free_body", (1.0, 0.0, 0.0), (0.0, 2.0, 0.0)),
        joint("prismatic", "ball_body"),
        joint("weld", "world", (0.0, 0.0, 1.0)),
    )
    model: Any = SimpleNamespace(bodies=bodies, loops=(), value=float, dimensions=3)
    poses = np.zeros((5, 4, 3, 4))
    poses[..., :3] = rotation((0, 0, 90))  # x of each body is the world's y
    poses[:, 1, :, 3] = [2.0, 1.0, 0.0]  # its point at y = 2 of its own: where the ball is
    poses[2, 1, :, 3] += [0.3, 0.0, 0.4]
    poses[:, 2, 0, 3] = 7.0
    drift = joint_drift(model, poses)
    assert drift.shape == (5, 2)  # ball and weld
    np.testing.assert_allclose(drift[:, 0], [0, 0, 0.5, 0, 0], atol=1e-15)
    np.testing.assert_allclose(drift[:, 1], 1.0)

    planar: Any = SimpleNamespace(
        bodies=(joint("revolute", "world", (1.0, 2.0), (0.0, 1.0)), joint("planar", "world")),
        loops=(),
        value=float,
        dimensions=2,
    )
    flat = np.zeros((3, 2, 3))
    flat[:, 0] = [2.0, 2.0, np.pi / 2]
    np.testing.assert_allclose(joint_drift(planar, flat), np.zeros((3, 1)), atol=1e-15)
