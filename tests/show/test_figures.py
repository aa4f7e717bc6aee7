"""Figures and films of runs: what they show is what the run holds."""

import itertools
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from effect_cases import BASES
from matplotlib.text import Text
from PIL import Image
from test_show import swinging

import eomgen
from eomgen.base.errors import RunError
from eomgen.base.files import is_ours
from eomgen.commands.main import main
from eomgen.run.trajectory import load_npz, save_npz
from eomgen.scene.reader import built_in_names, read_scene, read_tables
from eomgen.scene.tables import tables_of
from eomgen.show.figure import draw_motion
from eomgen.show.film import film_times, frame_rate
from eomgen.show.style import write_figure
from eomgen.study.between import between, crossings
from eomgen.study.observed import observed
from eomgen.study.quantities import quantities
from eomgen.study.sections import section

OSCILLATOR = """
name = "oscillator"
outputs = ["joint_forces"]
parameters = { m = 2.0, k = 8.0, c = 0.8 }
bodies = [{ name = "block", mass = "m", inertia_com = 1.0 }]
effects = [
    { type = "joint_spring", name = "spring", joint = "rail", stiffness = "k", damping = "c" },
]
initial = { q = { x = 1.0 } }
simulation = { t_end = 12.0 }
[[joints]]
name = "rail"
type = "prismatic"
parent = "world"
child = "block"
axis = [1, 0]
coordinate = "x"
"""
RATE = 0.8 / (2 * 2.0)
OMEGA = np.sqrt(8.0 / 2.0 - RATE**2)
"""x = e^(-RATE t) (cos OMEGA t + RATE/OMEGA sin OMEGA t)"""


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> tuple[eomgen.Run, eomgen.Run]:
    """A run with a parameter, a state and an input of its own, and the same from its file."""
    run = eomgen.simulate(
        "cart_pole", t_end=1.0, samples=101, parameters={"l": 0.4}, inputs={"push": lambda t: t}
    )
    path = tmp_path_factory.mktemp("run") / "cart_pole.npz"
    save_npz(run.trajectory, path)
    return run, eomgen.load_run(path)


def curves(run: eomgen.Run, of: str) -> list[np.ndarray]:
    """The values of the curves of a figure, from top to bottom."""
    figure = run.plot(of)
    found = [line for axes in figure.axes for line in axes.get_lines()]
    for line in found:
        np.testing.assert_array_equal(line.get_xdata(), run.t)
    return [np.asarray(line.get_ydata()) for line in found]


def test_curves_are_the_run(cart: tuple[eomgen.Run, eomgen.Run]) -> None:
    """Of a run in memory and of one from its file; outputs are those of its module at its values,
    also where an input varies with time.
    """
    for run in cart:
        force, theta, kinetic, potential, total, push = curves(
            run, "joint_forces.pin.x, theta, energy, inputs"
        )
        p, u = {"l": 0.4}, run.t[None, :]
        module = eomgen.load(eomgen.generate("cart_pole", outputs="all"))
        np.testing.assert_array_equal(theta, run["theta"])
        np.testing.assert_array_equal(force, module.joint_forces(run.t, run.y.T, p, u)[1, 0])
        np.testing.assert_array_equal(kinetic, module.kinetic_energy(run.t, run.y.T, p, u))
        np.testing.assert_array_equal(total, kinetic + potential)
        np.testing.assert_array_equal(push, run.t)
        np.testing.assert_array_equal(total, run.energy)
    assert cart[1].model == cart[0].model and not cart[1].motion.keeps_energy


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ({"of": "thet"}, r"of: no state, effect or output 'thet' \(did you mean 'theta'\?\)"),
        ({"of": "joint_force"}, r"did you mean 'joint_forces'"),
        ({"of": "joint_forces.pim"}, r"has no component 'pim' \(did you mean 'pin'\?\)"),
        ({"of": "works"}, "simulate with --works"),
        ({"of": "theta.x"}, "a state has no components"),
        ({"of": "push.foo"}, "of an effect take push.force or push.power"),
        ({"of": "push.force.y"}, "push.force has no 'y'; known: x"),
        ({"phase": ["theta"]}, "give two names"),
        ({"phase": ["theta", "energy"]}, "each must be one quantity"),
        ({"poincare": ["theta"]}, "needs both"),
        ({"poincare": "theta", "at": "thta = 0"}, r"did you mean 'theta'"),
        ({"poincare": ["theta"], "at": "theta"}, "is no condition"),
        ({"poincare": ["theta"], "at": "x = 99"}, "is not passed rising in this run"),
        ({"poincare": ["theta"], "at": "__import__('os') = 0"}, "at column"),
        ({"strobe": [0.0, 7.0]}, "the run is from 0 s to 1 s"),
        ({"of": "theta", "strobe": 3}, "a figure shows one of them"),
        ({"size": "wide"}, "is no size of a figure"),
    ],
)
def test_one_clear_error(cart: tuple[eomgen.Run, eomgen.Run], of: dict, said: str) -> None:
    with pytest.raises(RunError, match=said) as caught:
        cart[1].plot(**of)
    assert len(caught.value.lines) == 1


def test_a_section_is_the_known_map() -> None:
    """Of a damped oscillator: its turning points to the right are a half turn apart in the phase,
    and each is the one before times a constant factor. The error is that of cubic interpolation.
    """
    run = eomgen.simulate(OSCILLATOR, rtol=1e-12, samples=601)
    asked = observed(run.trajectory)
    states = between(asked)
    times = crossings(states, lambda t, y: y[:, 1], "falling")
    exact = 2 * np.pi / OMEGA * np.arange(1, len(times) + 1)
    np.testing.assert_allclose(times, exact, atol=1e-6)
    found = section(asked, states, ["x"], "x_dot = 0", "falling")
    x = found.quantities[0].values
    factor = np.exp(-RATE * 2 * np.pi / OMEGA)
    np.testing.assert_allclose(x[1:] / x[:-1], factor, rtol=1e-7)
    (dots, *_) = run.plot(poincare=["x"], at="x_dot = 0", direction="falling").axes[0].get_lines()
    np.testing.assert_array_equal(dots.get_xdata(), x[:-1])
    np.testing.assert_array_equal(dots.get_ydata(), x[1:])
    # The estimate is near the true error, and falls with the fourth power of the distance.
    middle = (run.t[1:] + run.t[:-1]) / 2
    wave = np.cos(OMEGA * middle) + RATE / OMEGA * np.sin(OMEGA * middle)
    true = np.abs(states(middle)[:, 0] - np.exp(-RATE * middle) * wave).max() / np.ptp(run["x"])
    assert true / 3 < states.error() < 10 * true
    few = eomgen.simulate(OSCILLATOR, rtol=1e-12, samples=301)
    assert 12 < between(observed(few.trajectory)).error() / states.error() < 20


def test_a_section_by_time_and_parameters() -> None:
    """Once in a period of time, between rows; and through a parameter's value."""
    run = observed(eomgen.simulate(OSCILLATOR, samples=101, parameters={"k": 18.0}).trajectory)
    found = section(run, between(run), ["t"], "sin(2*pi*t) = 0", "rising")
    np.testing.assert_allclose(found.t, np.arange(1, len(found.t) + 1), atol=1e-12)
    assert len(section(run, between(run), ["x"], "t = k/6").t) == 1


def test_scenes_come_back_from_their_tables() -> None:
    """Every built-in scene, through JSON, is the same scene."""
    for name in built_in_names():
        scene = read_scene(name)
        assert read_tables(json.loads(json.dumps(tables_of(scene)))) == scene, name


def test_older_files_are_read(cart: tuple[eomgen.Run, eomgen.Run], tmp_path: Path) -> None:
    """Those without a scene are trajectories still; what needs the scene says so."""
    path = tmp_path / "old.npz"
    save_npz(replace(cart[0].trajectory, setup=None), path)
    assert np.array_equal(load_npz(path).y, cart[0].y)
    with pytest.raises(RunError, match="does not hold its scene; simulate again"):
        eomgen.load_run(path)
    with pytest.raises(RunError, match=r"archive, .*none\.npz, which is not there"):
        eomgen.load_run(tmp_path / "none.csv")


def test_files_of_others_are_refused(cart: tuple[eomgen.Run, eomgen.Run], tmp_path: Path) -> None:
    """Whatever does not fit to the scene in a file, in one line."""
    trajectory = cart[0].trajectory
    setup = trajectory.setup
    assert setup is not None
    deep = "[" * 100_000
    for changed, said in (
        (replace(setup, scene=deep), "is damaged"),
        (replace(setup, scene="3"), "is damaged"),
        (replace(setup, scene='{"name": "x", "bodies": 3}'), "bodies"),
        (replace(setup, parameters={"l": 0.4, "other": 1.0}), "not of its scene"),
        (replace(setup, parameters={"l": float("nan")}), "not of its scene"),
        (replace(setup, varying=np.zeros((3, 1))), "not of its scene"),
        (replace(setup, scene=pendulum()), "not of its scene"),
    ):
        path = tmp_path / "other.npz"
        save_npz(replace(trajectory, setup=changed), path)
        with pytest.raises(eomgen.EomgenError, match=said):
            eomgen.load_run(path)


def pendulum() -> str:
    """The text of another scene, as a file holds it."""
    return json.dumps(tables_of(read_scene("pendulum")))


def test_forces_under_held_contacts_are_left_out() -> None:
    """Their contact force is not known; before the first contact that is held they are there."""
    run = eomgen.simulate("bouncing_two_body", samples=301)
    (force,) = curves(run, "joint_forces.hinge.fx")
    first = next(e.t for e in run.trajectory.events if e.kind == "rest")
    assert np.isnan(force[run.t >= first]).any() and np.isfinite(force[run.t < first]).all()


def test_pdf_is_whole_and_reproducible(cart: tuple[eomgen.Run, eomgen.Run], tmp_path: Path) -> None:
    """The same bytes for the same run; each object is where the table says; the size in mm."""
    path, made = tmp_path / "a.pdf", []
    for _ in range(2):
        write_figure(cart[1].plot("theta,energy", size="120x80"), path, paper=True)
        made.append(path.read_bytes())
    assert made[0] == made[1] and is_ours(made[0]) and b"CreationDate" not in made[0]
    start = int(re.search(rb"startxref\s+(\d+)", made[0])[1])
    table = re.findall(rb"^(\d{10}) 00000 n", made[0][start:], re.MULTILINE)
    assert len(table) > 5
    for number, offset in enumerate(map(int, table), 1):
        assert made[0][offset:].startswith(b"%d 0 obj" % number)
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", made[0])
    np.testing.assert_allclose([float(x) for x in box.groups()], np.array([120, 80]) * 72 / 25.4)


ACTED = """
[[effects]]
type = "spring"
name = "coil"
body_1 = "a"
body_2 = "c"
at_1 = {at}
stiffness = 30.0
damping = 1.0
[[effects]]
type = "drag"
name = "air"
bodies = ["b", "c"]
linear = 0.3
turning_linear = 0.2
[[effects]]
type = "joint_spring"
name = "hold"
joint = "hinge"
stiffness = 5.0
[[effects]]
type = "motor"
name = "push"
joint = "rail"
torque = "2*sin(t)"
[initial]
v = {{ q_dot = 1.0 }}
"""


@pytest.mark.parametrize(("base", "at"), [("plane", [0.2, 0.4]), ("space", [0.2, 0.4, -0.3])])
def test_forces_of_effects_do_their_work(base: str, at: list[float]) -> None:
    """Those on bodies, at the velocities of these, and those on coordinates have the power that
    the module gives; that on one coordinate is its law.
    """
    scene = BASES[base].format(outputs="") + ACTED.format(at=at)
    run = eomgen.simulate(scene, t_end=1.0, samples=21, rtol=1e-6)
    seen = observed(run.trajectory, ("body_velocities", "effect_powers"))
    t, y = run.t, run.y
    velocities = seen.output("body_velocities", t, y)
    bodies = [body.name for body in run.model.bodies]
    names = ("vx", "vy", "wz") if base == "plane" else ("vx", "vy", "vz", "wx", "wy", "wz")
    for k, effect in enumerate(run.model.effects):
        power = np.zeros(len(t))
        for quantity in quantities([f"{effect.name}.force"], seen, t, y):
            first, _, part = quantity.label.partition(".")
            if part:
                kind = part.replace("f", "v").replace("m", "w")
                rate = velocities[:, bodies.index(first), names.index(kind)]
            else:
                rate = y[:, run.states.index(f"{first}_dot")]
            power += quantity.values * rate
        np.testing.assert_allclose(power, seen.output("effect_powers", t, y)[:, k], atol=1e-12)
        *_, last = quantities([effect.name], seen, t, y)
        np.testing.assert_allclose(last.values, power, atol=1e-12)
    (torque,) = curves(run, "hold.force.q")
    np.testing.assert_allclose(torque, -5.0 * y[:, run.states.index("q")], rtol=1e-12)


def test_what_equals_the_total_is_seen_and_no_panel_is_empty() -> None:
    """A wheel has kinetic energy alone, which lies on the total; its joint has no gap."""
    wheel = OSCILLATOR.replace('"k", damping = "c"', "0, damping = 0").replace(
        "initial = { q = { x = 1.0 } }", "initial = { v = { x_dot = 1.0 } }"
    )
    run = eomgen.simulate(wheel, t_end=1.0, samples=11)
    for figure in (run.plot("energy"), run.figure()):
        for axes in figure.axes:
            assert axes.get_lines() or axes.patches, axes.get_title(loc="left")
        (axes,) = (a for a in figure.axes if len(a.get_lines()) == 3 and a.get_legend())
        kinetic, _, total = axes.get_lines()
        np.testing.assert_array_equal(kinetic.get_ydata(), total.get_ydata())
        assert total.zorder < kinetic.zorder and total.get_lw() > kinetic.get_lw()


def test_letters_of_a_paper_can_be_read(cart: tuple[eomgen.Run, eomgen.Run]) -> None:
    """None is smaller than 7 points, in the size in which it is printed; nothing sticks out."""
    for size in ("single", "double"):
        figure = cart[1].plot("theta,energy,joint_forces", size=size)
        shown = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text()]
        assert min(text.get_fontsize() for text in shown) >= 7
        assert figure.get_figwidth() == pytest.approx({"single": 85, "double": 174}[size] / 25.4)
        whole, inside = figure.get_tightbbox(), figure.bbox_inches
        assert whole.x0 > -0.01 and whole.x1 < inside.x1 + 0.01 and whole.y1 < inside.y1 + 0.01


def test_rounding_is_drawn_as_nothing(cart: tuple[eomgen.Run, eomgen.Run]) -> None:
    """The moment in a hinge is 1e-15 N m: its axis is that of the forces' levers."""
    axes = cart[1].plot("joint_forces.pin.mz").axes[0]
    assert np.abs(axes.get_lines()[0].get_ydata()).max() < 1e-12
    assert axes.get_ylim()[1] > 1e-3


@pytest.mark.every(2)
@pytest.mark.parametrize("count", [14, 40])
def test_names_of_many_coordinates(count: int) -> None:
    """Every row of a map is named, and no name covers another; the panels fill the figure."""
    names = tuple(f"joint_{k}_left_angle" for k in range(count))
    base = swinging()
    values = np.sin(np.outer(base.t, np.arange(1, count + 1)))
    motion = replace(
        base, y=values, states=names, units=("rad",) * count, positions=tuple(range(count))
    )
    figure = draw_motion(motion)
    figure.draw_without_rendering()
    (axes,) = (axes for axes in figure.axes if axes.get_title(loc="left") == "Angles")
    labels = [label for label in axes.get_yticklabels() if label.get_text()]
    assert [label.get_text() for label in labels] == [f"joint {k}" for k in range(count)]
    boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: box.y0)
    assert all(below.y1 <= above.y0 + 2 for below, above in itertools.pairwise(boxes))
    used = sum(a.get_position().width * a.get_position().height for a in figure.axes[:5])
    assert used > 0.45


def test_a_gif(cart: tuple[eomgen.Run, eomgen.Run], tmp_path: Path) -> None:
    """As many frames as asked for, of the size asked for, at the speed asked for; ours."""
    path = cart[1].film(tmp_path / "a.gif", fps=10, speed=0.5, start=0.2, end=0.6, size="160x90")
    with Image.open(path) as film:
        assert (film.n_frames, film.size) == (9, (160, 90))  # 0.8 s at 10 fps, and the first
        assert film.info["duration"] == 100 and film.info["loop"] == 0
        film.seek(8)
        last = np.asarray(film.convert("RGB"), dtype=int)
        film.seek(0)
        assert np.abs(np.asarray(film.convert("RGB"), dtype=int) - last).max() > 50
        assert (last[-1, 0] == 255).all()
    first = path.read_bytes()
    cart[1].film(path, fps=10, speed=0.5, start=0.2, end=0.6, size="160x90")
    assert path.read_bytes() == first
    with pytest.raises(RunError, match=r"give times within the run, 0 s to 1 s"):
        cart[1].film(path, end=2.0)
    with pytest.raises(RunError, match=r"as \.gif or \.mp4; '\.avi' is neither"):
        cart[1].film(tmp_path / "a.avi")
    # 30 frames of a second are no whole hundredths: the film keeps its speed by others.
    assert frame_rate(Path("a.gif"), 30.0) == pytest.approx(100 / 3)
    np.testing.assert_allclose(film_times(0.2, 0.6, 20.0, 0.5), 0.2 + 0.025 * np.arange(17))


def test_a_stop_leaves_no_film(cart: tuple[eomgen.Run, eomgen.Run], tmp_path: Path) -> None:
    """Nor half of one."""

    def stop(share: float) -> None:
        if share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cart[1].film(tmp_path / "a.gif", size="80x40", end=0.3, progress=stop)
    assert not list(tmp_path.iterdir())


FFMPEG = """#!/bin/sh
for last; do :; done
case "$*" in *"-s 80x40 -r 25"*) wc -c > "$last"; echo "comment=eomgen film" >> "$last";; esac
"""
"""What stands for ffmpeg: it counts the bytes that it is given."""


def test_an_mp4(
    cart: tuple[eomgen.Run, eomgen.Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By ffmpeg, which is given every pixel of every frame; without it one line says so."""
    path = tmp_path / "a.mp4"
    real = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name: None if name == "ffmpeg" else real(name))
    with pytest.raises(RunError, match=r"needs the program ffmpeg.*or write .*a\.gif"):
        cart[1].film(path)
    program = tmp_path / "ffmpeg"
    program.write_text(FFMPEG)
    program.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda name: str(program))
    for _ in range(2):  # the second time over the first, which is known by its end
        cart[1].film(path, size="81x41", end=0.2)
        assert int(path.read_text().split()[0]) == 6 * 80 * 40 * 3
    program.write_text("#!/bin/sh\necho no such codec >&2\nexit 1\n")
    with pytest.raises(RunError, match="ffmpeg failed: no such codec"):
        cart[1].film(tmp_path / "b.mp4", size="80x40", end=0.2)
    assert not (tmp_path / "b.mp4").exists()


def test_the_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a file of a run, and of a scene; options that do not fit are refused."""
    monkeypatch.chdir(tmp_path)
    assert main("simulate pendulum --t-end 0.5 --no-pictures".split()) == 0
    before = dict(matplotlib.rcParams)
    assert main("plot out/pendulum.csv --phase theta,theta_dot --size single".split()) == 0
    assert main("plot pendulum --t-end 3 --poincare theta_dot --at theta=4 -o p.svg".split()) == 0
    assert main("film out/pendulum.npz --size 60x60 --fps 10 -o out/f.gif".split()) == 0
    assert dict(matplotlib.rcParams) == before
    printed = capsys.readouterr().out
    assert "a figure of 85 x 64 mm" in printed and "6 frames of 60 x 60 pixels" in printed
    assert "crossing" in printed and "its error is about" in printed
    assert Path("out/pendulum_plot.png").exists() and Path("p.svg").exists()
    for line, said in (
        ("plot out/pendulum.npz --t-end 3", "are for a scene"),
        ("plot out/pendulum.npz --times 1", "are for --strobe"),
        (
            "plot out/pendulum.npz --of energi",
            "--of: no state, effect or output 'energi' (did",
        ),
        ("plot out/pendulum.npz --strobe --count 0", "--strobe: give 1 to 50 poses"),
        ("plot out/none.npz", "out/none.npz: cannot be read"),
        ("plot pendulum -o a.jpg", "a figure is written as .png, .svg or .pdf"),
        ("film pendulum --size big", "--size: 'big' is no size of a film"),
    ):
        assert main(line.split()) == 1
        assert said in capsys.readouterr().err
