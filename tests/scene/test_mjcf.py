"""MJCF files as scenes: accelerations beside MuJoCo's, constraints, files, what is not read."""

import subprocess
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from mjcf_states import Comparison
from scenes import refusal

import eomgen
from eomgen.base.errors import SceneError
from eomgen.model.elaborate import elaborate
from eomgen.scene.importers import import_file
from eomgen.scene.importers.imported import Wishes
from eomgen.scene.importers.mjcf import compiled as compiling
from eomgen.scene.importers.rotations import rotation
from eomgen.scene.reader import parse_scene, read_tables

ROUNDING = 1e-11
EVERYTHING = """
<mujoco model="everything">
  <compiler angle="radian"/>
  <option gravity="0.5 -1 -9"/>
  <default><geom density="700"/></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="cart" pos="0 0 1" euler="0.1 0.2 0.3">
      <joint name="t" type="slide" axis="1 0.2 0" armature="0.3" damping="2" ref="0.2"/>
      <joint name="roll" axis="0 1 1" pos="0.1 0 0.2" ref="0.4" stiffness="3 1 2" springref="0.1"
        damping="0.5 0.1 0.2" frictionloss="0.3" limited="true" range="-1 1"/>
      <joint name="turn" type="ball" pos="0 0.1 0" armature="0.05" damping="0.2" stiffness="0.7"/>
      <geom type="box" size="0.1 0.2 0.3" pos="0.1 0.2 0" euler="0.3 0 0.1"/>
      <body name="fixed 1" pos="0.3 0 0" quat="1 2 0 0"><geom type="capsule" size="0.05 0.1"/>
        <body gravcomp="0.6" pos="0 0.2 0">
          <joint name="knee" axis="0 0 1" armature="0.01"/>
          <geom type="ellipsoid" size="0.1 0.05 0.2"/>
        </body>
      </body>
      <body name="leg" pos="0 -0.3 0" euler="0.3 0.4 0.5">
        <inertial mass="1.3" pos="0.1 0.2 0" fullinertia="0.03 0.04 0.05 0.001 0.002 -0.003"/>
        <joint name="hip" axis="1 2 0" pos="0 0.1 0" ref="0.7"/>
        <site name="foot" pos="0.1 0 -0.2"/>
      </body>
    </body>
    <body name="flier" pos="0 0 2">
      <freejoint/>
      <geom type="cylinder" size="0.1 0.2" pos="0.2 0.1 0"/>
      <site name="jet" pos="0.1 0.2 0.3" euler="0.4 0.5 0.6"/>
    </body>
    <body name="heavy" pos="1 0 2" quat="0 1 0 0">
      <joint type="free" name="loose" armature="0.4" damping="0.3"/>
      <geom type="sphere" size="0.2" pos="0.1 0 0"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="pull" stiffness="2" damping="0.3" springlength="0.1 0.2">
      <joint joint="knee" coef="1.5"/><joint joint="hip" coef="-0.5"/>
    </fixed>
    <spatial name="elastic" stiffness="5" damping="0.2" springlength="0.3">
      <site site="jet"/><site site="foot"/>
    </spatial>
  </tendon>
  <actuator>
    <motor name="thrust" site="jet" gear="1 2 3 0.1 0.2 0.3"/>
    <motor name="t" joint="t" gear="3" ctrlrange="-0.2 0.3" ctrllimited="true"/>
    <position joint="knee" kp="4" kv="0.2" forcerange="-1 1" forcelimited="true"/>
    <velocity joint="hip" kv="0.7" gear="-2"/>
    <general tendon="pull" gainprm="2" biasprm="0.1 -0.2 -0.3" biastype="affine" gear="1.5"/>
    <general name="lagged" joint="knee" dyntype="filter" dynprm="0.1" gainprm="3"
      biasprm="0 -2 -0.1" biastype="affine" ctrlrange="-0.1 0.1" ctrllimited="true"/>
    <intvelocity name="summed" joint="hip" kp="2" actrange="-9 9" gear="0.5"/>
    <motor name="geared" joint="roll" gear="2" armature="0.2" damping="0.1"/>
  </actuator>
  <sensor><jointpos joint="knee"/></sensor>
</mujoco>
"""

HERE = pytest.mark.usefixtures("mujoco_in_this_process")


def written(folder: Path, text: str, name: str = "robot.xml") -> Path:
    """A file."""
    path = folder / name
    path.write_text(text)
    return path


@HERE
def test_accelerations_are_those_of_mujoco(tmp_path: Path) -> None:
    """All kinds of joints, references, springs, dampers, rotors, actuators; by three routes."""
    comparison = Comparison.of(written(tmp_path, EVERYTHING))
    assert comparison.driven
    rng = np.random.default_rng(3)
    for _ in range(4):
        data = comparison.in_mujoco(rng)
        expected = data.qacc
        assert comparison.frames_apart(data) < ROUNDING
        found, rates = comparison.activation_rates(data)
        assert len(rates) == 2
        assert np.abs(found / rates - 1).max() < ROUNDING
        for route in ("aba", "ldl", "orthogonal"):
            found = comparison.accelerations(data, route)
            assert np.abs(found / expected - 1).max() < ROUNDING


COUPLED = """
<mujoco model="coupled">
  <compiler angle="radian"/>
  <worldbody>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.2 0.1 0.05" pos="0.1 0.02 0.03"/>
      <body pos="0.2 0 0"><joint name="hip" axis="0 1 0" ref="0.2"/>
        <geom size="0.05" pos="0 0 -0.2"/>
        <body pos="0 0 -0.2"><joint name="knee" axis="0 1 0"/><geom size="0.05" pos="0 0 -0.2"/>
        </body>
      </body>
      <body pos="-0.2 0 0"><joint name="latch" axis="1 0 0"/><geom size="0.03" pos="0 0 0.1"/>
        <body pos="0 0 0.1"><joint name="tail" type="ball"/><geom size="0.03" pos="0 0 0.1"/></body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="knee" joint2="hip" polycoef="0.1 -0.5 0 0 0"/>
    <joint joint1="latch" polycoef="0.3 0 0 0 0"/></equality>
  <actuator><general name="lag" joint="hip" dyntype="filter" dynprm="0.1"/></actuator>
</mujoco>
"""


@HERE
def test_states_of_a_module_as_those_of_mujoco(tmp_path: Path) -> None:
    """What follows and what is held are there; accelerations are rates of velocities; columns."""
    robot = eomgen.import_robot(written(tmp_path, COUPLED))
    module = eomgen.load(eomgen.generate(robot.tables, route="aba"))
    to, rng = robot.mujoco(module), np.random.default_rng(0)
    assert "knee" in module.FOLLOWING and "latch" not in module.STATES
    q, v = rng.normal(size=(14, 3)), rng.normal(size=(12, 3))
    y = to.state(q, v, lag_activation=0.3)
    q[3:7] /= np.linalg.norm(q[3:7], axis=0)
    q[10:] /= np.linalg.norm(q[10:], axis=0)
    q[8], v[7], q[9], v[8] = 0.2 - 0.5 * q[7], -0.5 * v[6], 0.3, 0.0
    assert np.abs(to.position(y) - q).max() < 1e-15
    assert np.abs(to.velocity(y) - v).max() < 1e-15
    assert np.abs(to.state(q[:, 1], v[:, 1], lag_activation=0.3) - y[:, 1]).max() < 1e-15
    found, step = to.acceleration(0.0, y, {"lag": 0.2}), 1e-5
    moved = module.derivative(0.0, y, None, {"lag": 0.2}) * step
    rates = (to.velocity(y + moved) - to.velocity(y - moved)) / (2 * step)
    assert np.abs(found - rates).max() < 1e-7 * np.abs(found).max()


def test_what_a_conversion_refuses(tmp_path: Path) -> None:
    """In one line each."""
    robot = eomgen.import_robot(written(tmp_path, COUPLED))
    module = eomgen.load(eomgen.generate(robot.tables, route="aba"))
    with pytest.raises(eomgen.RunError, match="Pinocchio: the file is one of MuJoCo's"):
        robot.pinocchio(module)
    with pytest.raises(eomgen.RunError, match="has no 'trunk_x'; give a loaded module of this"):
        robot.mujoco(eomgen.load(eomgen.generate("pendulum")))
    to = robot.mujoco(module)
    with pytest.raises(eomgen.RunError, match=r"q: has the shape \(3,\); give \(14,\)"):
        to.state(np.zeros(3), np.zeros(12))
    with pytest.raises(eomgen.RunError, match="'hip' is no state beside coordinates and velo"):
        to.state(np.ones(14), np.zeros(12), hip=1.0)


@HERE
def test_what_is_left_out_is_remarked(tmp_path: Path) -> None:
    """Each in a sentence; and the file of the scene gives the same scene."""
    imported = import_file(written(tmp_path, EVERYTHING))
    text = "\n".join(imported.remarks)
    for part in (
        "geoms of the world (1)",
        "sensors (1)",
        "contacts",
        "limits",
        "friction",
        "centre of mass",
    ):
        assert part in text, text
    assert "renamed: 'fixed 1' is fixed_1" in text
    assert parse_scene(imported.toml()) == read_tables(imported.tables)
    friction = next(e for e in imported.tables["effects"] if e["type"] == "joint_friction")
    assert friction["coulomb"] == 0.3
    model = elaborate(read_tables(imported.tables))
    start = dict(zip((c.name for c in model.coordinates), model.initial_q, strict=True))
    assert (start["t_joint"], start["roll"], start["heavy_1_z"]) == (0.2, 0.4, 2.0)


@HERE
def test_limits_are_stops_on_wish(tmp_path: Path) -> None:
    """Of hinges and slides that follow no others; a tendon may have the name of a joint."""
    text = EVERYTHING.replace('name="elastic"', 'name="roll"')
    imported = import_file(written(tmp_path, text), Wishes(stops=True))
    stops = [e for e in imported.tables["effects"] if e["type"] == "joint_stop"]
    assert [(stop["joint"], stop["low"], stop["high"]) for stop in stops] == [("roll", -1.0, 1.0)]
    assert not any("reported" in remark for remark in imported.remarks)
    elaborate(read_tables(imported.tables))


@HERE
def test_nothing_starts_inside_a_stop(tmp_path: Path) -> None:
    """A joint whose pose in the file is beyond its limits starts between them; without stops it
    starts where MuJoCo starts it.
    """
    path = written(tmp_path, EVERYTHING.replace('range="-1 1"', 'range="0.6 1"'))
    starts = [
        import_file(path, Wishes(stops=stops)).tables["initial"]["q"]["roll"]
        for stops in (False, True)
    ]
    assert starts == [0.4, 0.8]
    said = "the file's pose is beyond the limits of 'roll', which start between them"
    assert said in import_file(path, Wishes(stops=True)).remarks


CLOSED = """
<mujoco model="closed">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <default><joint axis="0 1 0" damping="0.1"/><geom type="capsule" size="0.04"/></default>
  <worldbody>
    <body name="a"><joint name="q1"/><geom fromto="0 0 0 0.3 0 0.4"/>
      <body name="b" pos="0.3 0 0.4"><joint name="q2"/><geom fromto="0 0 0 0.5 0 0"/>
        <body name="c" pos="0.5 0 0"><joint name="q3"/><geom fromto="0 0 0 0.2 0 -0.4"/></body>
      </body>
    </body>
    <body name="d" pos="0 1 0"><joint name="q4" axis="1 0 0"/><geom fromto="0 0 0 0 0 0.5"/>
      <body name="e" pos="0 0 0.5"><joint name="q5" type="ball" pos="0 0 0"/>
        <geom fromto="0 0 0 0.1 0.2 0.3"/></body>
    </body>
    <body name="f" pos="0.1 1.2 0.8"><joint name="q6" type="slide" axis="0 0 1"/>
      <joint name="q7" axis="0 0 1"/><geom type="box" size="0.1 0.2 0.3"/></body>
  </worldbody>
  <tendon>
    <fixed name="one"><joint joint="q6" coef="2"/></fixed>
    <fixed name="two"><joint joint="q4" coef="0.5"/><joint joint="q1" coef="-0.3"/></fixed>
  </tendon>
  <equality>
    <connect name="loop" body1="c" anchor="0.2 0 -0.4"/>
    <joint joint1="q7" joint2="q3" polycoef="0.1 0.5 0.2 -0.1 0"/>
    <tendon tendon1="one" tendon2="two" polycoef="0.02 0.7 0.1 0 0"/>
  </equality>
</mujoco>
"""


@HERE
def test_equality_constraints_are_exact(tmp_path: Path) -> None:
    """M v̇ - f of MuJoCo is a combination of the rows of its constraints, and these stay met."""
    comparison = Comparison.of(written(tmp_path, CLOSED), equalities=True)
    for route in ("aba", "independent", "embedded", "ldl"):
        found = comparison.constrained(route, np.random.default_rng(5))
        assert found.force > 0.1
        assert found.apart < 1e-10 * found.force
        assert found.residual < 1e-9
        assert found.growth < 100, found.growth


@HERE
def test_welds_are_poses(tmp_path: Path) -> None:
    """A weld with a pose of its own, and one of sites, close loops that are met as in MuJoCo."""
    text = CLOSED.replace(
        '<connect name="loop" body1="c" anchor="0.2 0 -0.4"/>',
        '<weld body1="a" body2="f" anchor="0.1 0.2 0.3" relpose="0.4 -0.1 0.2 1 2 3 4"/>'
        '<weld site1="s" site2="r"/><connect site1="s" site2="r"/>',
    ).replace('<geom type="box"', '<site name="s" pos="1 2 3" euler="1 2 3"/><geom type="box"')
    text = text.replace(
        '<geom fromto="0 0 0 0.1',
        '<site name="r" pos="0 0 1" euler="3 1 2"/><geom fromto="0 0 0 0.1',
    )
    imported = import_file(written(tmp_path, text))
    loops = [joint for joint in imported.tables["joints"] if joint.get("loop")]
    assert [joint["type"] for joint in loops] == ["weld", "weld", "ball"]
    mj = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data, rng = mujoco.MjData(mj), np.random.default_rng(1)
    data.qpos[:] = mj.qpos0 + rng.normal(size=mj.nq)
    mujoco.mj_forward(mj, data)
    bodies = [[data.body(joint[side]) for side in ("parent", "child")] for joint in loops]
    at = [
        body.xpos + body.xmat.reshape(3, 3) @ loops[0][f"r_{side}"]
        for side, body in zip(("parent", "child"), bodies[0], strict=True)
    ]
    assert np.abs(data.efc_pos[:3] - (at[0] - at[1])).max() < 1e-12
    # Where the sites coincide, the child's axes are E in the parent's.
    parent, child = (body.xmat.reshape(3, 3) for body in bodies[1])
    s, r = (data.site(name).xmat.reshape(3, 3) for name in "sr")
    held = parent.T @ s @ (child.T @ r).T
    turned = rotation(loops[1]["orientation"])
    assert np.abs(held - turned).max() < 1e-12


BODY = '<worldbody><body name="b"><joint name="j"/><geom size="0.1"/>{}</body></worldbody>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<include file="../other.xml"/>', "robot.xml:1: '../other.xml' is outside"),
        ('<include file="/etc/passwd"/>', "'/etc/passwd' is outside of the file's folder"),
        ('<include file="gone.xml"/>', "no file 'gone.xml' to include"),
        ('<include file="robot.xml"/>', "does a file include itself?"),
        ('<asset><mesh file="../m.stl"/></asset>', "'../m.stl' is outside"),
        ('<asset><mesh file="..\\m.stl"/></asset>', "is outside of the file's folder"),
        ('<compiler meshdir="../"/><asset><mesh file="m.stl"/></asset>', "'../' is outside"),
        ('<asset><hfield name="h" file="link" size="1 1 1 1"/></asset>', "'link' is outside"),
        ('<asset><texture name="x" type="cube" fileright="../p.png"/></asset>', "is outside"),
        ('<asset><model name="m" file="../m.xml"/></asset>', "'../m.xml' is outside"),
        ("<nonsense/>", "MuJoCo: XML Error: Schema violation"),
    ],
)
def test_files_stay_in_their_folder(tmp_path: Path, text: str, message: str) -> None:
    """Before MuJoCo sees them; one line each."""
    folder = tmp_path / "robots"
    folder.mkdir()
    for name in ("other.xml", "m.xml"):
        written(tmp_path, f"<mujoco>{BODY.format('')}</mujoco>", name)
    (folder / "link").symlink_to(tmp_path / "other.xml")
    path = written(folder, f"<mujoco>{text}{BODY.format('')}</mujoco>")
    assert message in refusal(lambda: import_file(path))


def test_a_compiler_that_ends_is_one_line(tmp_path: Path, monkeypatch: Any) -> None:
    """Killed, too slow, absent, or with numbers that are not finite."""
    path = written(tmp_path, f"<mujoco>{BODY.format('')}</mujoco>")

    def ended(*args: Any, **options: Any) -> Any:
        return subprocess.CompletedProcess(args, -6, b"", b"first\nfree(): invalid pointer\n")

    def slow(*args: Any, **options: Any) -> Any:
        raise subprocess.TimeoutExpired("mujoco", 1.0)

    for run, message in ((ended, "(code -6): free(): invalid"), (slow, "does not compile it")):
        monkeypatch.setattr(compiling.subprocess, "run", run)
        with pytest.raises(SceneError, match=message.replace("(", r"\(").replace(")", r"\)")):
            import_file(path)
    monkeypatch.undo()
    monkeypatch.setattr(compiling, "find_spec", lambda name: None)
    with pytest.raises(SceneError, match="needs MuJoCo 4; install it with: pip install 'eomgen"):
        import_file(path)
    monkeypatch.undo()
    path.write_text(f"<mujoco>{BODY.format('')}</mujoco>".replace('"0.1"', '"0.1" pos="nan 0 0"'))
    with pytest.raises(SceneError, match="is not finite"):
        import_file(path)
