"""Hostile and broken robot files: for each kind of file, whole ones that are changed.

To add a kind: its entry in `KINDS`, with a good file and the mistakes that can be made in it.
"""

import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mjcf_files import GOOD_MJCF, MJCF_MISTAKES

LINK = """<link name="{name}"><inertial>
  <origin xyz="{com}" rpy="0.3 -0.2 0.5"/><mass value="1.5"/>
  <inertia ixx="0.03" ixy="0.004" ixz="-0.002" iyy="0.04" iyz="0.003" izz="0.05"/>
</inertial></link>
"""
JOINT = """<joint name="{name}" type="{kind}">
  <origin xyz="0.1 -0.2 0.3" rpy="0.4 1.5707963267948966 -0.7"/>
  <parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>{more}
  <limit lower="-1" upper="1" effort="1" velocity="1"/>
</joint>
"""

GOOD_URDF = """\
<?xml version="1.0"?>
<robot name="arm">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0 0 0.2" rpy="0 0 0.3"/>
      <mass value="2"/>
      <inertia ixx="0.03" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.004"/>
    </inertial>
    <visual>
      <geometry><cylinder radius="0.04" length="0.4"/></geometry>
      <material name="blue"/>
    </visual>
  </link>
  <link name="lower">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.002"/>
    </inertial>
    <visual><geometry><mesh filename="package://arm/lower.stl" scale="1 1 1"/></geometry></visual>
  </link>
  <link name="tip"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.1" rpy="1.5707963267948966 0 0"/>
    <parent link="base"/>
    <child link="upper"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="10" velocity="3"/>
    <dynamics damping="0.1" friction="0.01"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="0 0 0.4" rpy="0 0.2 0"/>
    <parent link="upper"/>
    <child link="lower"/>
    <axis xyz="0 1 0"/>
    <mimic joint="shoulder" multiplier="-0.5" offset="0.1"/>
  </joint>
  <joint name="end" type="fixed">
    <origin xyz="0 0 0.3"/>
    <parent link="lower"/>
    <child link="tip"/>
  </joint>
</robot>
"""


def link(name: str, com: str = "0.02 0.05 0.1") -> str:
    """A link with an inertia in axes of its own."""
    return LINK.format(name=name, com=com)


def joint(
    name: str, kind: str, parent: str, child: str, axis: str = "0 0 1", more: str = ""
) -> str:
    """A joint whose axes are rotated in its parent's."""
    return JOINT.format(name=name, kind=kind, parent=parent, child=child, axis=axis, more=more)


def written(folder: Path, *parts: str, name: str = "robot") -> Path:
    """The file of a robot."""
    path = folder / f"{name}.urdf"
    path.write_text(f'<robot name="{name}">{"".join(parts)}</robot>', "utf-8")
    return path


@dataclass(frozen=True)
class Kind:
    """One kind of robot file.

    suffix    of its name
    root      name of the root element
    good      a whole file
    mistakes  part of a good file, what replaces it, and what the message then says; "" if the file
              is read nevertheless
    """

    suffix: str
    root: str
    good: str
    mistakes: tuple[tuple[str, str, str], ...]


URDF_MISTAKES = (
    ('<mass value="2"/>', "<mass/>", "<mass> has no value; give it"),
    ('<mass value="2"/>', "", "link 'upper': has no <mass>; give one"),
    ('<mass value="2"/>', '<mass value="-2"/>', "its mass -2 is negative"),
    ('<mass value="2"/>', '<mass value="nan"/>', "'nan' is not a finite number"),
    ('<mass value="2"/>', '<mass value="1e200"/>', "is larger than 1e+100; use SI units"),
    ('<mass value="2"/>', '<mass value="2,0"/>', "'2,0' is not a number"),
    ('<mass value="2"/>', '<mass value="\u0662"/>', "is not a number"),
    ('<mass value="2"/>', '<mass value="${mass}"/>', "is to be expanded by xacro"),
    ('<mass value="2"/>', '<mass value="0"/>', "has an inertia but no mass"),
    ('<mass value="2"/>', '<mass value="2" value="3"/>', "is not XML: duplicate attribute"),
    ('<mass value="2"/>', f'<mass value="{"9" * 5000}"/>', "is not a finite number"),
    ('ixx="0.03"', "", "<inertia> has no ixx; give it"),
    ('ixx="0.03" ixy="0.001"', 'ixx="0.03" ixy="0.05"', "principal moment of -0.02"),
    ('xyz="0 0 0.2"', 'xyz="0 0"', "<origin> xyz: has 2 numbers; give 3"),
    ('xyz="0 0 0.2"', f'xyz="{"0 " * 9999}"', "has more than 4 numbers; give 3"),
    ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', "<axis> xyz has no length"),
    ('<axis xyz="0 1 0"/>', '<axis xyz="0 1e-200 0"/>', ""),
    ('<axis xyz="0 1 0"/>', "", ""),
    ('damping="0.1"', 'damping="-0.1"', "damping -0.1 is negative"),
    ('lower="-1" upper="2"', 'lower="2" upper="-1"', ""),
    ('radius="0.04"', 'radius="-1"', "radius -1 is not positive"),
    ('length="0.4"', "", "<cylinder> has no length; give it"),
    ('rgba="0 0 1 1"', 'rgba="nan 1e999 -3"', ""),
    ('link name="upper"', "link", "<link> has no name; give it"),
    ('link name="upper"', 'link name="lower"', "link 'lower' is given twice, also in line 5"),
    ('link name="upper"', 'link name="upper arm 1!"', "no child link is named 'upper'"),
    ('joint name="elbow"', 'joint name="shoulder"', "joint 'shoulder' is given twice"),
    ('joint name="elbow"', "joint", "<joint> has no name; give it"),
    ('joint name="elbow"', 'joint name="class"', ""),
    ('joint name="elbow"', 'joint name="\u03b8 \u202e-1"', ""),
    ('joint name="elbow"', 'joint name="shoulder_dot"', ""),
    ('type="continuous"', "", "<joint> has no type; give it"),
    ('type="continuous"', 'type="hinge"', "unknown type 'hinge' (did you mean 'revolute'?)"),
    ('type="continuous"', 'type="fixed"', ""),
    ('type="continuous"', 'type="floating"', ""),
    ('type="revolute"', 'type="fixed"', "nothing can move"),
    ('<parent link="upper"/>', "", "joint 'elbow': has no <parent>"),
    ('<parent link="upper"/>', '<parent link="uper"/>', "(did you mean 'upper'?)"),
    ('<parent link="upper"/>', '<parent link="lower"/>', "joints form a circle"),
    ('<parent link="upper"/>', '<parent link="tip"/>', "joints form a circle"),
    ('<parent link="base"/>', '<parent link="tip"/>', "joints form a circle"),
    ('<child link="lower"/>', '<child link="upper"/>', "'upper' is carried by joint 'shoulder'"),
    ('<child link="lower"/>', '<child link="base"/>',
     "link 'base' is not connected to the root 'lower'"),
    ('<link name="tip"/>', '<link name="tip"/><link name="loose"/>', "2 links without a parent"),
    ('mimic joint="shoulder"', 'mimic joint="knee"', "mimics 'knee', which is no joint"),
    ('mimic joint="shoulder"', "mimic", "<mimic> has no joint; give it"),
    ('mimic joint="shoulder"', 'mimic joint="end"', ""),
    ('multiplier="-0.5"', 'multiplier="0"', ""),
    ("<robot ", "<robot_ ", "is not XML: mismatched tag"),
    ('name="arm"', 'name="&#10;eomgen: forged"', ""),
    ("package://arm/lower.stl", "file:///etc/passwd", ""),
    ("package://arm/lower.stl", "../../../../etc/passwd", ""),
    ("package://arm/lower.stl", "package://../../etc/passwd", ""),
    ("package://arm/lower.stl", "http://127.0.0.1:9/lower.stl", ""),
    ("package://arm/lower.stl", "//[", ""),
    ("package://arm/lower.stl", "a" * 5000, ""),
    ("package://arm/lower.stl", "", "<mesh> has no filename; give it"),
    ("<link name=", '<xacro:macro name="x"/><link name=', "is not XML: unbound prefix"),
    ('<link name="base"/>',
     '<link name="base"/><xacro:if xmlns:xacro="http://wiki.ros.org/xacro"/>',
     "has xacro macros; expand them first"),
)  # fmt: skip

KINDS: Mapping[str, Kind] = {
    "urdf": Kind(".urdf", "robot", GOOD_URDF, URDF_MISTAKES),
    "mjcf": Kind(".mjcf", "mujoco", GOOD_MJCF, MJCF_MISTAKES),
}


def mistaken(kind: Kind) -> Iterator[tuple[bytes, str]]:
    """Files with one mistake each, and what the message says."""
    for part, instead, message in kind.mistakes:
        assert part in kind.good, part
        yield kind.good.replace(part, instead, 1).encode(), message


def broken(kind: Kind) -> Iterator[tuple[bytes, str]]:
    """Files that are no XML, or none that is read."""
    head, good, root = '<?xml version="1.0"?>', kind.good, kind.root
    body = good[good.index(f"<{root}") :]
    lines = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 30))
    refused = "has a document type declaration"
    for subset in (
        f'<!DOCTYPE {root} [<!ENTITY e0 "ha">{lines}]>',
        f'<!DOCTYPE {root} [<!ENTITY e0 "{"ha" * 100_000}">]>',
        f'<!DOCTYPE {root} [<!ENTITY e0 SYSTEM "file:///etc/passwd">]>',
        f'<!DOCTYPE {root} [<!ENTITY % e0 SYSTEM "http://127.0.0.1:9/x.dtd"> %e0;]>',
        f'<!DOCTYPE {root} SYSTEM "http://127.0.0.1:9/robot.dtd">',
        f"<!DOCTYPE {root}>",
    ):
        yield f"{head}{subset}{body}".encode(), refused
    yield body.replace("name=", 'name="&e0;" name2=', 1).encode(), "is not XML: undefined entity"
    yield b"", "is not XML: no element found"
    yield b" \n", "is not XML: no element found"
    yield b"\x00\x01\x02" * 100, "is not XML"
    yield random.Random(1).randbytes(4000), "is not XML"
    yield b"\x89PNG\r\n\x1a\n" + bytes(100), "is not XML"
    yield b"PK\x03\x04" + bytes(100), "is not XML"
    yield b'name = "arm"\n', "is not XML"
    yield body.encode("utf-16")[:-1], "is not XML"
    yield f'<?xml version="1.0" encoding="nonsense"?>{body}'.encode(), "is not XML"
    yield f'<?xml version="1.0" encoding="utf-7"?>{body}'.encode(), "is not XML"
    yield body.encode().replace(b"name=", b"name=\xff\xfe", 1), "is not XML"
    yield f"<{root}/>".encode(), "has no"
    yield f"<{root}></{root}><{root}/>".encode(), "is not XML: junk after document element"
    yield b"<sdf><model/></sdf>", "the root element is <sdf>; known: "
    yield b"<html><body/></html>", "the root element is <html>; known: "
    yield (f"<{root}>" + "<a>" * 100_000).encode(), "has elements more than 100 deep"
    yield (f"<{root}>" + "<a/>" * 200_000).encode(), "has more than 100000 elements"
    yield (good + " " * 2_000_001).encode(), "is larger than 2000000 bytes"
    for part in (1, 2, 3, 4, 5, 6, 7, 8, 9):
        yield body[: len(body) * part // 10].encode(), "is not XML"


def mutant(kind: Kind, number: int) -> bytes:
    """A good file with seeded changes of its elements, attributes, values or bytes."""
    r = random.Random(f"{kind.root} {number}")
    text = kind.good
    for _ in range(r.choice((1, 1, 1, 2, 4))):
        text = r.choice((_value, _value, _value, _attribute, _element, _line, _swap))(text, r)
    data = bytearray(text.encode("utf-8", "replace"))
    for _ in range(r.choice((0, 0, 0, 0, 1, 3))):
        data[r.randrange(len(data))] = r.randrange(256)
    return bytes(data)


ODD = (
    *("", " ", "0", "-1", "1e308", "-1e-320", "1e999", "nan", "-inf", "1 2", "0 0 0", "1 1 1"),
    *("world", "base", "elbow", "shoulder", "lower", "fixed", "floating", "planar", "prismatic"),
    *("\u202egnp", "k" * 3000, "1/0", "__class__", "&lt;x&gt;", "&#9;", "3.14159", "t", "pi"),
)


def _value(text: str, r: random.Random) -> str:
    """Another value of an attribute."""
    found = r.choice(list(re.finditer(r'(?<==")[^"]*(?=")', text)))
    return text[: found.start()] + r.choice(ODD) + text[found.end() :]


def _attribute(text: str, r: random.Random) -> str:
    """Without an attribute, or with it under another name."""
    found = r.choice(list(re.finditer(r' (\w+)="[^"]*"', text)))
    instead = r.choice(("", found[0].replace(found[1], f"{found[1]}x", 1)))
    return text[: found.start()] + instead + text[found.end() :]


def _element(text: str, r: random.Random) -> str:
    """An element twice, or gone."""
    found = r.choice(list(re.finditer(r"<(\w+)[^<>]*/>", text)))
    return text[: found.start()] + r.choice(("", 2 * found[0])) + text[found.end() :]


def _line(text: str, r: random.Random) -> str:
    """A line twice, or gone."""
    lines = text.splitlines(keepends=True)
    k = r.randrange(1, len(lines))
    return "".join(lines[:k] + r.choice(([], [lines[k]] * 2)) + lines[k + 1 :])


def _swap(text: str, r: random.Random) -> str:
    """Two values of attributes exchanged."""
    values = list(re.finditer(r'(?<==")[^"]*(?=")', text))
    a, b = sorted(r.sample(values, 2), key=lambda found: found.start())
    return text[: a.start()] + b[0] + text[a.end() : b.start()] + a[0] + text[b.end() :]
