"""Contacts of imported robots with the ground: shapes, laws, filters, and where robots come to
rest.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen
from eomgen.dynamics.start.diagnostics import initial_overlaps
from eomgen.model.elaborate import elaborate
from eomgen.scene.importers.contacts import RIM, cylinder, depth_below, hull_vertices
from eomgen.scene.importers.rotations import rotation
from eomgen.scene.reader import read_tables

URDF = """
<robot name="box">
  <link name="trunk">
    <inertial><mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
      <origin xyz="0.01 0 0.02"/></inertial>
    <collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>
  </link>
  <link name="leg">
    <inertial><mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><origin xyz="0 0 -0.2"/><geometry>{}</geometry></collision>
  </link>
  <joint name="hip" type="{}">
    <origin xyz="0.1 0 -0.05" rpy="0 0.3 0"/><parent link="trunk"/><child link="leg"/>
    <axis xyz="0 1 0"/><limit lower="0.4" upper="1.0"/>
  </joint>
</robot>
"""
MJCF = """
<mujoco model="feet">
  <default><geom contype="1" conaffinity="1"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1" friction="0.7" margin="0.002"/>
    <body name="trunk" pos="0 0 0.5">
      <freejoint/>
      <geom name="back" type="capsule" size="0.05" fromto="-0.2 0 0 0.2 0 0" friction="0.4"/>
      <body name="leg" pos="0.2 0 0"><geom type="sphere" size="0.06" pos="0 0 -0.1"/></body>
      <body name="other" pos="-0.2 0 0"><geom type="box" size="0.05 0.1 0.04" pos="0 0 -0.12"/>
      </body>
      <body name="ghost"><geom type="sphere" size="0.3" contype="2" conaffinity="4"/>
      </body>
      <body name="apart" pos="0 0 0.3"><joint axis="0 1 0" damping="1"/>
        <geom type="ellipsoid" size="0.5 0.1 0.5"/></body>
    </body>
  </worldbody>
  <contact><exclude body1="world" body2="apart"/></contact>
</mujoco>
"""


LINK = """<link name="{}"><inertial><mass value="0.5"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry>{}</geometry></collision></link>"""
JOINT = """<joint name="to_{}" type="{}"><origin xyz="{}"/><parent link="{}"/><child link="{}"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>"""
PILE = """
<mujoco model="pile">
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <geom name="wall" type="plane" size="5 5 1" euler="0 90 0" pos="-2 0 0"/>
    <geom name="rock" type="sphere" size="0.5"/>
    <body name="base"><geom name="post" type="capsule" size="0.4" fromto="0 0 -1 0 0 1"/>
      <body name="hung"><joint axis="0 1 0"/><geom name="bob" type="box" size="0.4 0.5 0.6"/></body>
    </body>
    <body name="trunk"><freejoint/><geom name="back" type="sphere" size="0.3" margin="0.01"/>
      <body name="rest"><geom name="tail" type="sphere" size="0.3"/>
        <body name="leg"><joint axis="1 0 0"/><geom name="thigh" type="sphere" size="0.3"/>
          <body name="foot"><joint axis="0 1 0"/>
            <geom name="sole" type="cylinder" size="0.2 0.3"/>
            <geom name="ghost" type="sphere" size="0.3" contype="2" conaffinity="4"/>
            <geom name="seen" type="sphere" size="0.3" contype="4" conaffinity="0"/></body>
        </body>
      </body>
    </body>
    <body name="other"><freejoint/><geom name="heavy" type="box" size="0.6 0.5 0.4"/></body>
  </worldbody>
  <contact><exclude body1="other" body2="leg"/>
    <pair geom1="back" geom2="thigh" friction="0.3 0.3 0.1 0.1 0.1" margin="0.02"/></contact>
</mujoco>
"""


def contacts_of(found: Any) -> list[dict[str, Any]]:
    """The contacts among the effects of an imported robot."""
    return [effect for effect in found.tables["effects"] if effect["type"] == "contact"]


def written(folder: Path, name: str, text: str) -> Path:
    """A robot file."""
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("joint", ["revolute", "prismatic"])
@pytest.mark.parametrize(
    "shape",
    [
        '<sphere radius="0.05"/>',
        '<box size="0.1 0.2 0.3"/>',
        '<cylinder radius="0.1" length="0.2"/>',
    ],
)
def test_a_urdf_starts_where_it_touches_the_ground(tmp_path: Path, joint: str, shape: str) -> None:
    """The lowest point is at z = 0 if it moves freely: 1 µm lower it overlaps by that, and the
    scene's shapes are where the importer thinks.
    """
    path = written(tmp_path, "box.urdf", URDF.format(shape, joint))
    found = eomgen.import_robot(path, floating=True, contacts=True)
    (effect,) = contacts_of(found)
    assert {shape["body"] for shape in effect["shapes"].values()} == {"trunk", "leg"}
    tables = dict(found.tables)
    start = dict(tables["initial"]["q"])
    for lower in (0.0, 1e-6):
        tables["initial"] = {"q": start | {"trunk_z": start["trunk_z"] - lower}}
        overlaps = initial_overlaps(elaborate(read_tables(tables)))
        assert sum(overlap.depth for overlap in overlaps) == pytest.approx(lower, abs=1e-12)
    fixed = eomgen.import_robot(path, contacts=True)
    assert {s["body"] for e in contacts_of(fixed) for s in e["shapes"].values()} == {"leg"}
    assert any("shapes of links that cannot move (1)" in remark for remark in fixed.remarks)
    assert any("--contacts" in remark for remark in eomgen.import_robot(path).remarks)


def test_geoms_touch_the_planes_that_mujoco_lets_them_touch(tmp_path: Path) -> None:
    """And as MuJoCo mixes them: friction is the greater, margins add to radii."""
    pytest.importorskip("mujoco")
    found = eomgen.import_robot(written(tmp_path, "feet.xml", MJCF), contacts=True)
    made = {effect["name"]: effect for effect in contacts_of(found)}
    assert list(made) == ["floor_trunk", "floor_leg", "floor_other"]
    assert [effect["friction"] for effect in made.values()] == [0.7, 1.0, 1.0]
    assert made["floor_leg"]["shapes"]["leg_1"]["radius"] == 0.062
    assert made["floor_other"]["shapes"]["other_1"]["half_sizes"] == [0.05, 0.1, 0.04]
    assert any("1 capsule, 1 sphere, 1 box" in remark for remark in found.remarks)


def test_a_robot_comes_to_rest_where_it_does_in_mujoco(tmp_path: Path) -> None:
    """Within a tenth of a millimetre, and no energy is gained on the way."""
    mujoco = pytest.importorskip("mujoco")
    head, tail = MJCF.index('<body name="ghost">'), MJCF.index("</worldbody>")
    text = MJCF[:head] + "</body>" + MJCF[tail:].replace("apart", "trunk")
    path = written(tmp_path, "feet.xml", text.replace('pos="0 0 0.5"', 'pos="0 0 0.17"'))
    found = eomgen.import_robot(path, contacts=True)
    run = eomgen.simulate(dict(found.tables), t_end=0.7, rtol=1e-5, atol=1e-7)
    energy = np.asarray(run.energy)
    assert np.diff(energy).max() < 1e-6 * np.ptp(energy)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    while data.time < 0.7:
        mujoco.mj_step(model, data)
    ours = found.mujoco(eomgen.load(run.module)).position(run.y[-1])
    assert abs(ours[2] - data.qpos[2]) < 1e-4
    assert np.abs(ours[3:7] - data.qpos[3:7]).max() < 2e-3


def test_geoms_touch_each_other_where_mujoco_lets_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Obstacles of the world, too: all geoms overlap, and those that touch are MuJoCo's contacts.
    Of too many the nearest are taken, and that is said.
    """
    mujoco = pytest.importorskip("mujoco")
    path = written(tmp_path, "pile.xml", PILE)
    found = eomgen.import_robot(path, self_contacts=True)
    made = contacts_of(found)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, names = mujoco.MjData(model), [model.geom(g).name for g in range(model.ngeom)]
    ours = {
        frozenset(names[int(name.rpartition("_")[2]) - 1] for name in pair)
        for effect in made
        for pair in effect.get("pairs", ())
    }
    mujoco.mj_forward(model, data)
    both = [frozenset(model.geom(g).name for g in (c.geom1, c.geom2)) for c in data.contact]
    assert ours == {pair for pair in both if not pair & {"floor", "wall"}}
    given = next(e for e in made if len(e.get("pairs", ())) == 1 and e["friction"] == 0.3)
    assert {s["radius"] for s in given["shapes"].values()} == {0.3, 0.31}
    assert next(e for e in made if e["name"].startswith("wall"))["normal"] == (1.0, 0.0, 0.0)
    read_tables(dict(found.tables))
    monkeypatch.setattr("eomgen.scene.importers.pairs.MOST_PAIRS", 2)
    few = eomgen.import_robot(path, self_contacts=True)
    assert sum(len(effect.get("pairs", ())) for effect in contacts_of(few)) == 2
    assert any(f"nearest at the start ({len(ours) - 2})" in remark for remark in few.remarks)


def test_links_touch_each_other_unless_they_are_joined_or_overlap(tmp_path: Path) -> None:
    """Cylinders as the capsules within them."""
    text = URDF.format('<cylinder radius="0.1" length="0.5"/>', "revolute")
    links, joints = "", ""
    for name, parent, kind, at, shape in (
        ("foot", "leg", "fixed", "0 0 0", '<sphere radius="0.1"/>'),
        ("toe", "foot", "revolute", "2 0 0", '<sphere radius="0.1"/>'),
        ("far", "trunk", "revolute", "-1 0 0", '<box size="0.2 0.2 0.4"/>'),
        ("near", "trunk", "revolute", "1.2 0 -1.7", '<capsule radius="0.1" length="0.2"/>'),
    ):
        links += LINK.format(name, shape)
        joints += JOINT.format(name, kind, at, parent, name)
    path = written(tmp_path, "box.urdf", text.replace("</robot>", f"{links}{joints}</robot>"))
    found = eomgen.import_robot(path, floating=True, self_contacts=True)
    own = next(effect for effect in contacts_of(found) if effect["name"] == "self")
    pairs = {frozenset(name.rpartition("_")[0] for name in pair) for pair in own["pairs"]}
    moving = [("leg", "far"), ("leg", "near"), ("foot", "far"), ("foot", "near")]
    assert pairs == {*map(frozenset, [*moving, ("toe", "trunk"), ("toe", "far"), ("far", "near")])}
    shape = own["shapes"]["leg_2"]
    assert shape["radius"] == 0.1
    assert np.allclose([shape["at"], shape["end"]], [[0, 0, -0.35], [0, 0, -0.05]])
    assert any("pairs that touch at the start (1)" in remark for remark in found.remarks)


def test_the_rims_of_a_cylinder_are_where_they_are() -> None:
    """Lying and standing exactly, else within the thickness of the discs."""
    rng = np.random.default_rng(0)
    for angle in (0.0, math.pi / 2, *rng.uniform(0.0, math.pi, 20)):
        turn = np.array(rotation((angle, 0.0, 0.0)))
        tables = cylinder((0.1, 0.0, -0.3), (0.1, 0.0, 0.3), 0.2)
        depth = max(depth_below(table, turn, np.zeros(3)) for table in tables)
        true = 0.3 * abs(math.cos(angle)) + 0.2 * abs(math.sin(angle))
        assert abs(depth - true) <= (1e-12 if angle in (0.0, math.pi / 2) else RIM * 0.2)


def test_few_vertices_stand_for_a_hull() -> None:
    """All of a box; of a ball as many as are allowed, and what is left out is said."""
    rng = np.random.default_rng(0)
    box = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=float)
    inside = rng.uniform(0, 1, (50, 3))
    vertices, off = hull_vertices(np.concatenate([inside, box]))
    assert {*map(tuple, vertices)} == {*map(tuple, box)} and off < 1e-12
    ball = rng.normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    vertices, off = hull_vertices(ball)
    ways = rng.normal(size=(500, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    beyond = (ways @ ball.T).max(axis=1) - (ways @ vertices.T).max(axis=1)
    assert len(vertices) == 16 and 0.3 * off < beyond.max() < 1.5 * off < 0.6
    flat, off = hull_vertices(box[box[:, 2] == 0])
    assert len(flat) == 4 and off < 1e-12
