"""Robots in URDF: the motion of what they become, and what is said of the rest."""

import struct
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign import some
from robot_files import GOOD_URDF, joint, link, written

import eomgen
from eomgen.commands.main import main
from eomgen.scene.importers.rotations import angles_of, rotation, squared, to_axis

MIMIC = '<mimic joint="grip" multiplier="0.8" offset="0.05"/>'
DRAWN = """<link name="base"><visual>{}
  <geometry><mesh filename="{}" scale="0.1 0.1 0.1"/></geometry>
</visual></link>
"""
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<asset><unit meter="0.01"/></asset>
<library_geometries><geometry id="g"><mesh>
  <source id="n"><float_array>9 9 9</float_array></source>
  <source id="p"><float_array>{}</float_array></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene><node>
  <translate>100 0 0</translate><rotate>0 0 1 90</rotate>
  <node><instance_geometry url="#g"/></node>
</node></visual_scene></library_visual_scenes>
</COLLADA>
"""


def rates(tables: Any, **state: float) -> dict[str, float]:
    """The derivatives at a state whose other values are 0, or 1 for the first of a quaternion."""
    module = eomgen.load(eomgen.generate(tables, route="aba", outputs=[]))
    start = dict.fromkeys(module.STATES, 0.0)
    start |= {name: 1.0 for name in start if name.endswith("_qw")}
    found = module.derivative(0.0, np.array(list((start | state).values())))
    return dict(zip(module.STATES, found, strict=True))


@pytest.mark.every(2)
@pytest.mark.parametrize("floating", [False, True])
def test_accelerations_are_those_of_pinocchio(tmp_path: Path, floating: bool) -> None:
    """Places, velocities and accelerations in its order and frames: a branched robot of all joints,
    rotated origins, full inertias, a tool that is fixed, a gripper that mimics, a flag without mass
    that is held, damping and friction.
    """
    from robot_peers import Robot

    rubs = '<dynamics damping="0.3" friction="0.1"/>'
    path = written(
        tmp_path,
        *(link(name) for name in ("base", "arm", "hand", "finger", "thumb", "tool", "tail")),
        *(link("puck"), link("bird"), '<link name="frame"/>', '<link name="flag"/>'),
        joint("shoulder", "revolute", "base", "arm", "0 1 0"),
        joint("wrist", "continuous", "arm", "hand", "0.6 0 -0.8", rubs),
        joint("grip", "prismatic", "hand", "finger", "1 0 0", rubs),
        joint("thumb-grip", "prismatic", "hand", "thumb", "-1 0 0", MIMIC),
        joint("tooling", "fixed", "hand", "tool"),
        joint("tip", "fixed", "tool", "frame"),
        joint("wag", "revolute", "base", "tail", "1 2 3"),
        joint("plane", "planar", "tail", "puck"),
        joint("flight", "floating", "base", "bird"),
        joint("banner", "continuous", "hand", "flag"),
    )
    robot, rng = Robot(path, floating, "aba" * floating), np.random.default_rng(1)
    for _ in range(3):
        apart = robot.difference(rng)
        assert max(apart.accelerations, apart.frames, apart.states) < 1e-12, apart


def test_states_are_in_the_order_of_the_file(tmp_path: Path) -> None:
    """Joints depth first, those of one link as the file has them; bodies as a scene has them, but
    each after its parent.
    """
    path = written(
        tmp_path,
        *(link(name) for name in ("toe", "base", "leg", "foot", "arm", "hand")),
        joint("wrist", "revolute", "arm", "hand"),
        joint("shoulder", "revolute", "base", "arm"),
        joint("tip", "revolute", "foot", "toe"),
        joint("hip", "revolute", "base", "leg"),
        joint("ankle", "revolute", "leg", "foot"),
    )
    model = eomgen.check(path)
    assert [c.name for c in model.coordinates] == ["shoulder", "wrist", "hip", "ankle", "tip"]
    names = ("hand", "leg", "base", "arm", "toe", "foot")
    tables = eomgen.import_robot(path).tables
    named = {body["name"]: body for body in tables["bodies"]}
    model = eomgen.check({**tables, "bodies": [named[name] for name in names]})
    assert [body.name for body in model.bodies] == ["base", "arm", "hand", "leg", "foot", "toe"]


@pytest.mark.parametrize("axis", some(["1 -2 0.5"], ["0 0 1", "1 0 0", "1 -2 0.5"]))
def test_a_planar_joint_is_two_slides_and_a_hinge(tmp_path: Path, axis: str) -> None:
    """Perpendicular to its axis, and about it."""
    one = written(
        tmp_path,
        '<link name="base"/>',
        link("puck"),
        joint("plane", "planar", "base", "puck", axis),
    )
    x, y, _ = np.array(to_axis(tuple(map(float, axis.split())))).T
    rest = (
        '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>'
        '<axis xyz="{} {} {}"/></joint>'
    )
    three = written(
        tmp_path,
        '<link name="base"/><link name="a"/><link name="b"/>',
        link("puck"),
        joint("plane_x", "prismatic", "base", "a", "{} {} {}".format(*x)),
        rest.format("plane_y", "prismatic", "a", "b", *y),
        rest.format("plane_angle", "continuous", "b", "puck", *axis.split()),
        name="three",
    )
    state = {"plane_x": 0.3, "plane_angle": 0.7, "plane_y_dot": -0.4, "plane_angle_dot": 2.0}
    found, expected = (rates(eomgen.import_robot(path).tables, **state) for path in (one, three))
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_floating_joint_leaves_a_body_free(tmp_path: Path) -> None:
    """Its centre of mass falls, and its angular momentum stays (Euler's equation)."""
    robot = written(
        tmp_path, '<link name="base"/>', link("box"), joint("loose", "floating", "base", "box")
    )
    tables = eomgen.import_robot(robot).tables
    spin = np.array([1.0, -2.0, 0.5])
    found = rates(tables, **dict(zip(("loose_wx", "loose_wy", "loose_wz"), spin, strict=True)))
    (box,) = (body for body in tables["bodies"] if body["name"] == "box")
    xx, yy, zz, xy, xz, yz = box["inertia_com"]
    inertia, com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), np.array(box["com"])
    change = np.array([found[f"loose_w{axis}"] for axis in "xyz"])
    assert inertia @ change == pytest.approx(-np.cross(spin, inertia @ spin), abs=1e-12)
    at = np.array([found[f"box_point_{axis}_dot"] for axis in "xyz"])
    fall = at + np.cross(change, com) + np.cross(spin, np.cross(spin, com))
    down = np.array(rotation((0.4, np.pi / 2, -0.7))).T @ [0, 0, -9.81]
    assert fall == pytest.approx(down, abs=1e-11)


def test_the_scene_written_is_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`import` writes TOML whose tables and module are those of the file itself; nothing is
    overwritten; each remark is printed once.
    """
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(GOOD_URDF, "utf-8")
    assert main(["import", "arm.urdf"]) == 0
    imported, text = eomgen.import_robot("arm.urdf"), Path("arm.toml").read_text("utf-8")
    notes = capsys.readouterr().err.splitlines()
    assert notes == [f"eomgen: note: arm.urdf: {remark}" for remark in imported.remarks]
    assert tomllib.loads(text) == imported.tables and text == imported.toml()
    assert eomgen.read("arm.urdf").remarks == imported.remarks
    assert set(imported.remarks) <= set(eomgen.check("arm.urdf").notices)
    sources = [eomgen.generate(name).source for name in ("arm.urdf", "arm.toml")]
    assert sources[0] == sources[1]
    assert main(["import", "arm.urdf"]) == main(["copy", "arm.urdf", "new"]) == 1
    Path("free.urdf").write_text(GOOD_URDF.replace('<link name="base"/>', link("base")), "utf-8")
    assert main(["import", "free.urdf", "--floating", "-o", "free.toml"]) == 0
    assert "base_qw" in [c.name for c in eomgen.check("free.toml").coordinates]
    assert main(["simulate", "arm.urdf", "--t-end", "0.1", "--no-pictures"]) == 0


def test_what_a_scene_lacks_is_listed(tmp_path: Path) -> None:
    """Each kind once, with names; names that are no identifiers are changed, and never more than a
    comment of what is written.
    """
    (tmp_path / "robot.urdf").write_text(
        GOOD_URDF.replace('name="tip"', 'name="tip&#10;1"')
        .replace('link="tip"', 'link="tip&#10;1"')
        .replace('lower="-1"', 'lower="1"')
        .replace("</robot>", '<gazebo/><gazebo/><transmission name="x"/></robot>'),
        "utf-8",
    )
    imported = eomgen.import_robot(tmp_path / "robot.urdf")
    assert tomllib.loads(imported.toml()) == imported.tables
    remarks = "\n".join(imported.remarks)
    for part in (
        "left out: 2 <gazebo>, 1 <transmission>",
        "bounds of efforts and velocities",
        "0 is beyond the limits of 'shoulder'",
        "smoothed within 0.01 rad/s",
        "renamed: 'tip\\n1' is tip_1",
        "left out: 1 mesh, 'package://arm/lower.stl' is not there; import with --allow DIR",
    ):
        assert part in remarks, remarks


def test_masses_that_are_odd_keep_the_motion(tmp_path: Path) -> None:
    """An inertia without mass counts with what carries it; what carries no mass is held; an inertia
    that is negative only by itself is taken.
    """
    ring = '<link name="ring"><inertial><mass value="0"/>{}</inertial></link>'.format(
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/>'
    )
    odd = '<link name="odd"><inertial><mass value="0.1"/>{}</inertial></link>'.format(
        '<inertia ixx="0.001" ixy="0.002" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>'
    )
    imported = eomgen.import_robot(
        written(
            tmp_path,
            *('<link name="base"/>', link("arm"), ring, odd, '<link name="flag"/>'),
            joint("turn", "continuous", "base", "arm"),
            *(joint("on", "fixed", "arm", "ring"), joint("beside", "fixed", "arm", "odd")),
            joint("wave", "continuous", "arm", "flag"),
        )
    )
    bodies = {body["name"]: body for body in imported.tables["bodies"]}
    parts = ('<link name="base"/>', link("arm"), joint("turn", "continuous", "base", "arm"))
    alone = eomgen.import_robot(written(tmp_path, *parts, name="alone"))
    own = np.array(alone.tables["bodies"][1]["inertia_com"])
    turned = np.array(rotation((0.4, np.pi / 2, -0.7)))
    more = turned @ np.diag([0.1, 0.2, 0.3]) @ turned.T
    added = np.array(bodies["arm"]["inertia_com"]) - own
    assert added == pytest.approx(more[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], abs=1e-15)
    assert bodies["ring"]["inertia_com"] == [0, 0, 0] and imported.tables["locked"] == {"wave": 0}
    assert bodies["odd"]["inertia_check"] == "off"
    said = "\n".join(imported.remarks)
    assert "of 'odd'" in said and "'ring'" in said and "held" in said and "'wave'" in said


def test_an_inertia_that_cannot_move_is_left_out(tmp_path: Path) -> None:
    """Of a link without mass that is fixed to the world; on a floating base it is refused."""
    ring = '<inertial><mass value="0"/><inertia ixx="1" iyy="2" izz="3"/></inertial>'
    joints = joint("turn", "continuous", "base", "arm"), joint("on", "fixed", "base", "plate")
    found = []
    for inertial in ("", ring):
        links = (f'<link name="{name}">{inertial}</link>' for name in ("base", "plate"))
        path = written(tmp_path, *links, link("arm"), *joints)
        found.append(eomgen.import_robot(path))
    plain, imported = found
    assert imported.tables == plain.tables
    assert "left out: inertias of links that cannot move: 'plate', 'base'" in imported.remarks
    with pytest.raises(eomgen.SceneError, match="'base': has an inertia but no mass; give it"):
        eomgen.import_robot(path, floating=True)


def test_limits_are_stops_on_wish(tmp_path: Path) -> None:
    """A falling arm passes its limit, and is stopped there on wish. A joint that mimics another has
    no stop, and follows in a line of joints to the end.
    """
    path = written(
        tmp_path,
        *('<link name="base"/>', *(link(name) for name in ("arm", "a", "b"))),
        joint("turn", "revolute", "base", "arm"),
        joint("first", "revolute", "arm", "a", more=MIMIC.replace("grip", "turn")),
        joint("second", "revolute", "a", "b", more=MIMIC.replace("grip", "first")),
    )
    ends = []
    for stops in (False, True):
        imported = eomgen.import_robot(path, stops=stops)
        made = [effect["name"] for effect in imported.tables["effects"] if "low" in effect]
        assert made == ["turn_stop"] * stops
        assert ("reported, not prevented" in "".join(imported.remarks)) != stops
        found = {c["name"]: c["equals"] for c in imported.tables["constraints"]}
        assert found["first_mimic"] == "0.8 * turn + 0.05"
        factor, _, rest = found["second_mimic"].partition(" * turn + ")
        assert (float(factor), float(rest)) == pytest.approx((0.64, 0.09))
        alone = {"constraints": [], "locked": {"first": 0.0, "second": 0.0}, "initial": {}}
        run = eomgen.simulate({**imported.tables, **alone}, t_end=1.5)
        ends.append(np.abs(run["turn"]).max())
    assert ends[0] > 1.2 and ends[1] == pytest.approx(1.0, abs=1e-6)


def mesh(folder: Path, kind: str) -> Path:
    """A triangle from (-1, 0, 2) to (3, 4, 2.5), in four ways."""
    corners = [(-1.0, 0.0, 2.0), (3.0, 0.0, 2.5), (0.0, 4.0, 2.0)]
    path = folder / f"part.{kind[:3]}"
    if kind == "stl":
        numbers = struct.pack("<12fH", 0, 0, 1, *(x for corner in corners for x in corner), 0)
        path.write_bytes(b"solid but not text".ljust(80) + struct.pack("<I", 1) + numbers)
    elif kind == "stl_text":
        lines = ["vertex {} {} {}".format(*corner) for corner in corners]
        path.write_text("\n".join(["solid a", "facet normal 0 0 1", *lines, "endsolid"]))
    elif kind == "dae":
        # In cm, and turned by its node: (x, y, z) is (y, -x, z) there, moved by 1 along x.
        numbers = " ".join(f"{100 * y} {-100 * (x - 1)} {100 * z}" for x, y, z in corners)
        path.write_text(COLLADA.format(numbers))
    else:
        path.write_text(
            "\n".join(["vn 9 9 9", *("v {} {} {}".format(*c) for c in corners), "f 1 2 3"])
        )
    return path


@pytest.mark.parametrize("kind", ["stl", "stl_text", "obj", "dae"])
def test_a_mesh_is_drawn_as_the_box_around_it(tmp_path: Path, kind: str) -> None:
    """Scaled, turned and moved with its visual element."""
    path = mesh(tmp_path, kind)
    name = f"package://any/{path.name}"
    visual = DRAWN.format('<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>', name)
    robot = written(tmp_path, visual, link("arm"), joint("turn", "continuous", "base", "arm"))
    (shape,) = eomgen.import_robot(robot).tables["bodies"][0]["shapes"]
    assert shape["size"] == pytest.approx([0.4, 0.4, 0.05])
    assert shape["center"] == pytest.approx([0.8, 0.1, 0.225])
    assert shape["orientation_deg"] == [0, 0, 90]


def test_only_files_of_allowed_folders_are_read(tmp_path: Path) -> None:
    """Neither a path nor a link leads out of the robot's folder; `--allow` names others."""
    inside, outside = tmp_path / "robot", tmp_path / "meshes"
    inside.mkdir()
    outside.mkdir()
    part = mesh(outside, "stl")
    (inside / "link.stl").symlink_to(part)
    for name in (
        "../meshes/part.stl",
        str(part),
        f"file://{part}",
        "link.stl",
        "package://part.stl",
    ):
        visual = DRAWN.format("", name)
        robot = written(inside, visual, link("arm"), joint("turn", "continuous", "base", "arm"))
        refused = eomgen.import_robot(robot)
        assert "shapes" not in refused.tables["bodies"][0]
        assert "left out: 1 mesh, " in "\n".join(refused.remarks)
        if not name.startswith("package"):
            allowed = eomgen.import_robot(robot, allow=[outside])
            assert "shapes" in allowed.tables["bodies"][0]


def test_a_root_named_world_is_the_world(tmp_path: Path) -> None:
    """With a floating base what is fixed to it moves freely."""
    robot = written(
        tmp_path,
        *('<link name="world"/>', link("trunk"), link("arm")),
        joint("stand", "fixed", "world", "trunk"),
        joint("turn", "continuous", "trunk", "arm"),
    )
    assert eomgen.check(robot).velocities[0].name == "turn_dot"
    free = eomgen.import_robot(robot, floating=True)
    assert len(eomgen.check(free.tables).velocities) == 7


def test_angles_of_a_rotation() -> None:
    """Also where the angle about y is a right angle. What is nearer than 1e-10 to one is one."""
    assert (squared(1.57079632679), squared(-3.14159265359)) == (np.pi / 2, -np.pi)
    assert squared(1.570796327) == 1.570796327
    for angles in ((0.1, -1.2, 2.5), (0.7, np.pi / 2, 0.0), (-3.0, -np.pi / 2, 1.0)):
        turned = rotation(angles)
        assert np.allclose(rotation(angles_of(turned)), turned, atol=1e-14)
