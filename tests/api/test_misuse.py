"""What people try that is almost right: it works, or they are told what to write instead."""

import json
import pickle
import shutil
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import eomgen
from eomgen.base.files import is_ours, write_whole
from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.run.trajectory import save_csv, save_npz
from eomgen.scene.appearance import appearance_of
from eomgen.scene.reader import parse_scene
from eomgen.show.picture import picture_of
from eomgen.show.strokes import Sight, strokes

ROD = """
name = "rod"
bodies = [{ name = "rod", mass = 1.0, inertia_com = 0.1 }]
joints = [{ name = "pivot", type = "revolute", parent = "world", child = "rod", r_child = [-0.5, 0] }]
effects = [{ type = "gravity", g = 9.81 }]
"""  # noqa: E501
BARS = """
name = "bars"
bodies = [
    { name = "crank", mass = 1.0, inertia_com = 0.1 },
    { name = "coupler", mass = 1.0, inertia_com = 0.1 },
    { name = "rocker", mass = 1.0, inertia_com = 0.1 },
]
joints = [
    { name = "a", type = "revolute", parent = "world", child = "crank", r_child = [-0.5, 0.0] },
    { name = "b", type = "revolute", parent = "crank", child = "coupler", r_child = [-0.5, 0.0], r_parent = [0.5, 0.0] },
    { name = "d", type = "revolute", parent = "coupler", child = "rocker", r_child = [0.5, 0.0], r_parent = [0.5, 0.0] },
    { name = "c", type = "revolute", parent = "world", child = "rocker", r_child = [-0.5, 0.0], r_parent = [1.0, 0.0], loop = true },
]
initial = { q = { a_angle = 0.5 } }
"""  # noqa: E501
"""A parallelogram whose loop is closed at the world."""


def said(text: str) -> str:
    """Why a scene is refused."""
    with pytest.raises(eomgen.EomgenError) as error:
        eomgen.check(text)
    return str(error.value)


@pytest.mark.skipif(shutil.which("node") is None, reason="needs Node.js")
def test_a_javascript_module_starts_alone(tmp_path: Path) -> None:
    """`initial_state()` needs neither time nor state."""
    text = ROD + "initial = { q = { pivot_angle = 1 } }\n"
    path = tmp_path / "rod.mjs"
    eomgen.generate(text, backend="javascript").save(path)
    code = f"import(`{path}`).then((m) => console.log(JSON.stringify(m.initial_state())))"
    done = subprocess.run(["node", "-e", code], check=True, capture_output=True, text=True)
    assert json.loads(done.stdout) == [1.0, 0.0]


def test_a_log_is_a_table_of_inputs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A DataFrame, or its file, gives inputs, whatever other columns it has; a name that is almost
    that of an input is none of those.
    """
    motor = '{ type = "motor", name = "push", joint = "pivot", torque = "input" }'
    text = ROD.replace("9.81 }", f"9.81 }}, {motor}")
    t = np.linspace(0.0, 1.0, 11)
    log = pd.DataFrame({"t": t, "note": "x", "push": np.sin(t), "room": np.nan})
    path = tmp_path / "log.csv"
    log.to_csv(path, index=False)
    ends = [eomgen.simulate(text, t_end=0.1, inputs=given).y[-1] for given in (log, path)]
    plain = eomgen.simulate(text, t_end=0.1, inputs={"push": lambda t: float(np.sin(t))}).y[-1]
    np.testing.assert_array_equal(*ends)
    np.testing.assert_allclose(ends[0], plain, atol=1e-4)
    scene = tmp_path / "rod.toml"
    scene.write_text(text)
    assert main(["accuracy", str(scene), "--input", str(path), "--arithmetic", "--states", "1",
                 "-o", str(tmp_path)]) == 0  # fmt: skip
    for wrong, why in [
        (log.rename(columns={"push": "pusch"}), r"no input 'pusch' \(did you mean 'push'\?\)"),
        (log.drop(columns=["push"]), "none of its columns is an input; known: push"),
        (log.drop(columns=["t"]), "needs a first line with t"),
        (log.assign(push="a"), "column push does not hold finite numbers only"),
        (5, "int is none; give values by name, a DataFrame"),
    ]:
        with pytest.raises(eomgen.RunError, match=why):
            eomgen.simulate(text, inputs=wrong)


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({"t_end": "5"}, "t_end: '5' is not a number; give one"),
        ({"dt": [0.1], "integrator": "rk4"}, "dt: [0.1] is not a number; give one"),
        ({"samples": "11"}, "samples: '11' is not a whole number; give one"),
        ({"rtol": True}, "rtol: True is not a number; give one"),
        ({"parameters": 3}, "parameters: int is no mapping; give values by name"),
        ({"state": "theta"}, "state: str is no mapping; give values by name"),
    ],
)
def test_arguments_of_another_type_are_named(asked: dict[str, Any], why: str) -> None:
    with pytest.raises(eomgen.RunError) as error:
        eomgen.simulate(ROD, **asked)
    assert str(error.value) == why
    with pytest.raises(eomgen.RunError, match="t_end: 'x' is not a number"):
        eomgen.ensemble(ROD, {"gravity_g": [1.0]}, t_end="x")  # type: ignore[arg-type]


def test_what_is_known_of_a_loop() -> None:
    """Its states and freedoms, in `check` and on its card."""
    model = eomgen.check(BARS)
    assert model.states[:4] == ("a_angle", "b_angle", "d_angle", "a_angle_dot")
    assert eomgen.check(ROD).states == ("pivot_angle", "pivot_angle_dot")
    card = model._repr_html_()
    assert card and "1 degree of freedom, 3 coordinates with 2 constraints" in card


def test_frozen_is_frozen() -> None:
    """No value of a scene or a model changes, and they are still copied and sent elsewhere."""
    scene = eomgen.read(ROD + "parameters = { m = 1.0 }\ninitial = { q = { pivot_angle = 1 } }\n")
    for change in (
        lambda: scene.parameters.update(m=2.0),
        lambda: scene.parameters.__setitem__("m", 2.0),
        lambda: scene.initial.q.pop("pivot_angle"),  # type: ignore[union-attr, arg-type]
        lambda: scene.replaced(parameters={"m": 1.0}).parameters.clear(),
        lambda: eomgen.check(scene).defaults.__setitem__("m", 2.0),  # type: ignore[attr-defined]
    ):
        with pytest.raises(TypeError, match="frozen"):
            change()
    assert pickle.loads(pickle.dumps(scene)) == scene


def test_degrees_are_not_taken_for_radians_twice() -> None:
    """The remark that an angle may be in degrees is for numbers without a unit."""
    for start, remarks in (("pivot_angle_deg = 2000", 0), ('pivot_angle = "2000 deg"', 0),
                           ("pivot_angle = 2000", 1)):  # fmt: skip
        model = eomgen.check(f"{ROD}initial = {{ q = {{ {start} }} }}\n")
        assert len(model.notices) == remarks, start


def test_the_errors_of_numpy_are_settings_of_ours() -> None:
    """Neither NumPy's settings of a caller nor a loop closed at the world bring warnings."""
    with np.errstate(all="raise"), warnings.catch_warnings():
        warnings.simplefilter("error")
        run = eomgen.simulate(BARS, t_end=0.01, backend="numpy")
    assert run.finished and run.motion.picture


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (ROD.replace('"revolute"', '"free"').replace('parent = "world", ', "loop = true, "),
         "joints[0].loop: a free joint holds nothing, so it closes no loop; leave the joint out"),
        (BARS.replace("a_angle = 0.5", "a_angle = 0.0"),
         "constraint c_x follows from the others, as at a dead point or a change point; take "
         "another start, or lengths that do not line up"),
        (ROD.replace("]\neffects", ', { name = "r", type = "revolute", parent = "world", child = '
         '"rod", loop = true, r_parent = [0.7, 0], r_child = [0.5, 0] }]\neffects'),
         "r_x stays open by 0.3 m; 2 constraints on 1 velocities leave nothing that could move: "
         "leave one out"),
        (ROD.replace("revolute", "hinge"), "unknown value 'hinge' (did you mean 'revolute'?)"),
        (ROD.replace("revolute", "pin"), "unknown value 'pin' (did you mean 'revolute'?)"),
        (ROD.replace('"world"', '"ground"'), "named 'ground' (did you mean 'world'?)"),
        (ROD.replace("revolute", "gear"), "; that is a table [[constraints]] with type = 'gear'"),
        (ROD.replace('"gravity"', '"rope"'),
         "; that is a table [[constraints]] with type = 'rope', or a tether"),
        (ROD.replace("effects", "constraints").replace('"gravity"', '"string"'),
         "[[effects]] with type = 'tether', or a rope if it is always taut"),
    ],
)  # fmt: skip
def test_words(text: str, why: str) -> None:
    """A refusal says what is wrong here, and other people's words are understood."""
    if "follows from" in why:
        with pytest.raises(eomgen.RunError) as error:
            eomgen.simulate(text)
        assert why in str(error.value)
    else:
        assert why in said(text)


def test_rows_that_are_left_out_are_told_in_a_sentence() -> None:
    again = BARS.replace("\n]\ninitial", '\n    { name = "e", type = "revolute", parent = "world", '
                         'child = "rocker", r_child = [-0.5, 0.0], r_parent = [1.0, 0.0], '
                         "loop = true },\n]\ninitial")  # fmt: skip
    assert (
        eomgen.check(again)
        .notices[-1]
        .startswith("constraints: e_x, e_y follow from the others and are left out")
    )


@pytest.mark.parametrize(
    ("words", "code", "why"),
    [
        (["simulat", "rod"], 2, "no 'simulat' (did you mean 'simulate'?)"),
        (["simulate", "pendulum", "--t_end", "3"], 2, "(did you mean '--t-end'?)"),
        (["generate"], 2, "no scene; name one"),
        (["new", ""], 1, "is no name of a file"),
        (["copy", "pendulum", ".."], 1, "is no name of a file"),
        ([], 0, "linearise"),
        (["reference", "pin"], 1, "(did you mean 'revolute'?)"),
    ],
)
def test_commands(
    words: list[str], code: int, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mistyped command or option gets a hint; none at all gets the help."""
    try:
        found = main(words)
    except SystemExit as stop:
        found = int(stop.code or 0)
    text = capsys.readouterr()
    assert found == code and why in text.out + text.err


def test_tables_of_others_are_kept(tmp_path: Path) -> None:
    """A table that begins like one of ours, even with all its names, was written by someone else;
    our own are replaced.
    """
    runs = eomgen.ensemble(ROD, {"gravity_g": [1.0, 2.0]}, t_end=0.01, backend="numpy")
    from eomgen.api.saving import save_statistics, save_sweep

    table, other = tmp_path / "sweep.csv", tmp_path / "statistics.csv"
    for _ in range(2):
        save_sweep(runs, "pivot_angle", table, tmp_path / "sweep.png")
        save_statistics(runs, other)
    for path in (table, other):
        assert next(iter(pd.read_csv(path).columns)) in ("member", "name")
        for theirs in (path.read_text().replace('"', "", 2), '"' + path.read_text()[1:] + '"'):
            path.write_text("x," + theirs if theirs.startswith('"') else theirs)
            with pytest.raises(eomgen.RunError, match="was not written by eomgen"):
                write_whole(path, "")
    for head in (
        "method,kind,order,dt_s,rtol,atol,status,error,error_is,",
        "state_kind,t,condition",
    ):
        assert not is_ours(head.encode())
    run = eomgen.simulate(ROD, t_end=0.01, backend="numpy").trajectory
    table = tmp_path / "rod.csv"
    save_npz(run, table.with_suffix(".npz"))
    for _ in range(2):
        save_csv(run, table)
    table.write_text(table.read_text().splitlines()[0] + "\n0,1,2\n")
    with pytest.raises(eomgen.RunError, match="was not written by eomgen"):
        save_csv(run, table)


def test_pages_hold_the_licences_of_what_is_in_them() -> None:
    """The permission notice of three.js and of uPlot, both MIT."""
    page = eomgen.simulate(ROD, t_end=0.01, backend="numpy").page(live=False)
    from eomgen.show.page import render_page

    text = render_page(eomgen.simulate(ROD, t_end=0.01, backend="numpy").motion, page)
    assert text.count("Permission is hereby granted, free of charge") == 2
    assert text.count("The above copyright notice and this permission notice shall be") == 2


def test_pictures_of_bobs_sliders_and_colours() -> None:
    """A bob hangs on a rod, a motor of a slider pushes along it, and a coloured spot does not
    colour the body.
    """
    shapes = 'shapes = [{ type = "disc", radius = 0.05 }, { type = "disc", radius = 0.01, color = "#ffffff" }]'  # noqa: E501
    scene = parse_scene(ROD.replace("inertia_com = 0.1", f"inertia_com = 0.1, {shapes}"))
    (body,) = picture_of(elaborate(scene), appearance_of(scene)).bodies
    assert [shape.type for shape in body.shapes] == ["rod", "disc", "disc"]
    assert body.shapes[1].color == body.color != "#ffffff" == body.shapes[2].color
    sliding = ROD.replace('"revolute"', '"prismatic", axis = [0, 1]').replace(
        '"gravity", g = 9.81', '"pd", name = "drive", joint = "pivot", target = 1, stiffness = 1'
    )
    model = elaborate(parse_scene(sliding))
    picture = picture_of(model, appearance_of(parse_scene(sliding))).valued(model.defaults)
    sight = Sight(picture, np.zeros((1, 3)), np.eye(3))
    lines = [stroke.points for stroke in strokes(sight) if stroke.layer == "front"]
    arrow = next(points for points in lines if len(points) == 2)
    assert arrow[0, 0] == arrow[1, 0] and arrow[1, 1] > arrow[0, 1]
