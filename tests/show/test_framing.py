"""The camera: the whole motion lies within the picture, or the camera follows what moves away."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import eomgen
from eomgen.base.errors import SceneError
from eomgen.model.elaborate import elaborate, expanded
from eomgen.scene.appearance import Appearance, appearance_of
from eomgen.scene.look import Camera, Sphere
from eomgen.scene.reader import built_in_names
from eomgen.show.framing import ASPECT, View, bounds_of, framed
from eomgen.show.of_run import fixed_points, leading_bodies, spread
from eomgen.show.outlines import extent_points
from eomgen.show.picture import Picture, picture_of
from eomgen.show.view import eye_axes

GENERATED = Path(__file__).parent.parent.parent / "generated"
POSED = sorted(p.stem for p in GENERATED.glob("*.py") if "def body_poses" in p.read_text("utf-8"))
"""Built-in scenes with committed modules that give poses."""
UNTUNED = Path(__file__).parent.parent / "untuned"
FILLED = 1 / 3
"""Part of the picture's height or width that bodies fill in the course of a motion."""


class Scene:
    """A scene with its picture, and the view of poses of its bodies."""

    def __init__(self, name: str | Path, camera: Camera | None = None) -> None:
        scene = eomgen.read(name)
        self.model = elaborate(scene)
        self.appearance = appearance_of(expanded(scene))
        if camera is not None:
            self.appearance = Appearance(camera, self.appearance.shapes)

    def view(self, poses: np.ndarray) -> tuple[View, Picture, np.ndarray]:
        """The view of poses, the picture with numbers, and the eye's axes."""
        camera, model = self.appearance.camera, self.model
        drawn = picture_of(model, self.appearance, spread(poses)).valued(model.defaults)
        flat = model.dimensions == 2
        eye = np.eye(3) if flat else eye_axes(camera.azimuth_deg, camera.elevation_deg)
        shapes, names = [b.shapes for b in drawn.bodies], [b.name for b in drawn.bodies]
        leading, fixed = leading_bodies(model), fixed_points(drawn)
        return framed(camera, names, leading, shapes, poses, eye, fixed), drawn, eye

    def check(self, poses: np.ndarray) -> View:
        """Assert that bodies are within the view at ten times, and fill enough of it."""
        view, drawn, eye = self.view(poses)
        rows = np.linspace(0, len(poses) - 1, 10).round().astype(int).tolist()
        bounds = bounds_of([body.shapes for body in drawn.bodies], poses, eye, rows)
        middle = np.array(view.center, dtype=float)
        middle = middle if poses.ndim == 3 else (eye @ middle)[:2]
        if view.follow is not None:
            followed = [body.name for body in drawn.bodies].index(view.follow)
            middle = middle + bounds.centres[:, followed]
        height = max(view.height, view.width / ASPECT)
        half = np.array([ASPECT * height, height]) / 2
        low, high = bounds.low - middle, bounds.high - middle
        assert (low >= -half).all() and (high <= half).all()
        assert ((high.max(axis=0) - low.min(axis=0)) / (2 * half)).max() >= FILLED
        if view.mode == "follow":  # then they are as large at each time
            assert ((high - low) / (2 * half)).max(axis=1).min() >= FILLED
        return view


def motion(name: str) -> np.ndarray:
    """Poses of a built-in scene in its first 1.5 s, from its committed module, without impacts."""
    module = eomgen.load(GENERATED / f"{name}.py")
    run = solve_ivp(module.derivative, (0.0, 1.5), module.initial_state(), "LSODA", rtol=1e-4)
    return np.moveaxis(np.asarray(module.body_poses(run.t, run.y)), -1, 0)


@pytest.mark.every(2)
@pytest.mark.parametrize("name", POSED)
def test_bodies_are_in_the_picture_and_fill_it(name: str) -> None:
    """Scenes whose modules are committed."""
    Scene(name).check(motion(name))


@pytest.mark.full
@pytest.mark.parametrize("name", built_in_names())
def test_bodies_are_in_the_picture_in_whole_runs(name: str) -> None:
    """Every built-in scene, none of which says where its camera is."""
    scene, run = Scene(name), eomgen.simulate(name)
    assert scene.check(run.motion.poses) == run.motion.camera


def test_no_built_in_scene_needs_a_place_for_its_camera() -> None:
    """At most a direction in space."""
    for name in built_in_names():
        given = eomgen.read(name).camera.model_fields_set
        assert given <= {"azimuth_deg", "elevation_deg"}, name


def flight(scene: Scene, distance: float) -> np.ndarray:
    """Poses of all bodies of a planar scene that move away together while they turn."""
    t = np.linspace(0.0, 1.0, 50)
    poses = np.zeros((50, len(scene.model.bodies), 3))
    poses[:, :, 0] = distance * t[:, np.newaxis]
    poses[:, :, 2] = 3 * t[:, np.newaxis]
    return poses


def test_a_camera_follows_what_goes_far_and_nothing_that_is_held() -> None:
    """A ball that flies away; not a planet, around whose sun the picture stays."""
    ball = Scene(UNTUNED / "projectile.toml")
    assert ball.check(flight(ball, 30.0)).follow == "ball"
    assert ball.check(flight(ball, 0.05)).mode == "fit"
    planet = Scene(UNTUNED / "planet.toml")
    assert planet.check(flight(planet, 30.0)).mode == "fit"
    pendulum = Scene(UNTUNED / "triple_pendulum.toml")
    assert pendulum.check(flight(pendulum, 30.0)).mode == "fit"


def test_the_whole_path_of_what_moves_by_itself_is_in_the_picture() -> None:
    """Stones without a size, one or two; a long flight of a ball is followed, as above."""
    for bodies in (1, 2):
        stones = "".join(
            f"""
[[bodies]]
name = "stone_{k}"
mass = 1.0
[[joints]]
name = "flight_{k}"
type = "particle"
parent = "world"
child = "stone_{k}"
[[effects]]
type = "external_force"
name = "push_{k}"
body = "stone_{k}"
force = [{k}, 1]
"""
            for k in range(bodies)
        )
        run = eomgen.simulate(f'name = "stones"{stones}', samples=21)
        assert run.motion.framing.view.mode == "fit"


def test_a_scene_may_say_what_its_camera_does() -> None:
    """Each mode and each key."""
    path = UNTUNED / "projectile.toml"
    for camera, mode in (
        (Camera(mode="fit"), "fit"),
        (Camera(mode="follow"), "follow"),
        (Camera(follow="ball"), "follow"),
        (Camera(mode="fixed"), "fixed"),
    ):
        scene = Scene(path, camera)
        assert scene.check(flight(scene, 2.0 if mode != "follow" else 30.0)).mode == mode
    scene = Scene(path, Camera(center=(1.0, 2.0), height=5.0))
    view = scene.view(flight(scene, 30.0))[0]
    assert (view.mode, view.center, view.height) == ("fixed", (1.0, 2.0), 5.0)
    scene = Scene(path, Camera(follow="ball", height=5.0, background="#102030"))
    view = scene.view(flight(scene, 30.0))[0]
    assert (view.mode, view.height, view.themed) == ("follow", 5.0, False)
    assert view.center == (0.0, 0.0)
    # The picture around a given centre is as large as the motion needs.
    scene = Scene(path, Camera(center=(3.0, 1.0)))
    assert scene.check(flight(scene, 8.0)).center == (3.0, 1.0)


def test_what_never_was_finite_has_a_view() -> None:
    """A run that was stopped at once."""
    scene = Scene(UNTUNED / "projectile.toml")
    poses = flight(scene, 1.0)
    poses[7:] = np.nan
    assert scene.view(poses)[0].height < 2.0
    assert scene.view(poses * np.nan)[0] == View(height=View.height)


def test_very_many_shapes() -> None:
    """A body of 150 balls takes little memory, and its bounds are those of their
    points; more than pictures draw are refused.
    """
    r, eye = np.random.default_rng(3), eye_axes(-60.0, 20.0)
    at = r.normal(size=(150, 3))
    balls = [Sphere(type="sphere", radius=0.1, center=tuple(place)) for place in at.tolist()]
    turns, _ = np.linalg.qr(r.normal(size=(60, 3, 3)))
    poses = np.concatenate([turns, r.normal(size=(60, 3, 1))], axis=2)[:, np.newaxis]
    tracemalloc.start()
    found = bounds_of([balls], poses, eye)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6
    k = 7
    seen = (extent_points(balls, 3) @ turns[k].T + poses[k, 0, :, 3]) @ eye.T
    assert np.allclose(found.low[k], seen.min(axis=0)[:2], rtol=0, atol=1e-12)
    assert np.allclose(found.high[k], seen.max(axis=0)[:2], rtol=0, atol=1e-12)
    scene = eomgen.read("tumbling_body")
    nut = scene.bodies[0]
    many = scene.replaced(bodies=(nut.replaced(shapes=tuple(balls) * 14),))
    with pytest.raises(SceneError, match="shapes: the bodies have 2100 in all; pictures draw 2000"):
        appearance_of(many)
