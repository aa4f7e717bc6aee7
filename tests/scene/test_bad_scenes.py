"""Each row a scene with one mistake, and the exact message a user gets for it."""

import math
import re
import time
from pathlib import Path

import pytest

from eomgen.commands.main import main
from eomgen.model.elaborate import elaborate
from eomgen.run.integrators import INTEGRATORS
from eomgen.scalars.exact import direction
from eomgen.scene.reader import parse_scene

GOOD = """\
name = "swing"
[parameters]
m = { value = 1.0, unit = "kg", about = "mass" }
[[bodies]]
name = "arm"
mass = "m"
inertia_com = 0.1
[[bodies]]
name = "hand"
mass = 0.5
inertia_com = 0.02
[[joints]]
name = "shoulder"
type = "revolute"
parent = "world"
child = "arm"
r_child = [-0.5, 0]
[[joints]]
name = "wrist"
type = "revolute"
parent = "arm"
child = "hand"
r_parent = [0.5, 0]
r_child = [-0.1, 0]
[[effects]]
type = "gravity"
g = 9.81
[initial]
q = [0.1, 0.2]
v = [0.0, 0.0]
[simulation]
t_end = 1.0
integrator = "RK45"
"""

BODY = '[[bodies]]\nname = "{}"\nmass = 1.0\ninertia_com = 1.0\n'
JOINT = '[[joints]]\nname = "{}"\ntype = "revolute"\nparent = "{}"\nchild = "{}"\n'
FORCE = '[[effects]]\ntype = "external_force"\nname = "push"\nbody = "arm"\n'
CHAIN = """\
[[chains]]
name = "links"
count = 3
mass = 0.1
inertia_com = 1e-4
start = [0.1, 0]
r_parent = [0.1, 0]
r_child = [0.1, 0]
"""
WRIST = 'name = "wrist"\ntype = "revolute"'
SLIDE = 'name = "wrist"\ntype = "prismatic"\n'
SHOULDER = """\
[[joints]]
name = "shoulder"
type = "revolute"
parent = "world"
child = "arm"
r_child = [-0.5, 0]
[[joints]]
"""
HELD_AWAY = '\nparent = "arm"\nchild = "hand"\nr_parent = [0.5, 0]\nr_child = [-0.1, 0]'
SINGULAR = (
    "body '{}': nothing resists '{}', neither its mass or inertia nor what it carries; "
    "give it some, or a joint that does not move so"
)

# What is replaced, by what (or None: appended), and the message without the file's name.
MISTAKES = [
    ("name = \"swing\"", "name = swing", "is not TOML: Invalid value (at line 1, column 8); "
     "a text stands in quotes"),
    ("[[bodies]]", "[bodies]", "is not TOML: Cannot overwrite a value (at line 8, column 9); "
     "a key stands once in a table; lists of tables have double brackets, [[effects]]"),
    ("mass = 0.5", "mas = 0.5", "bodies[1].mas: unknown key (did you mean 'mass'?)"),
    ("[initial]", "[inital]", "inital: unknown key (did you mean 'initial'?)"),
    ("mass = 0.5", "", "bodies[1].mass: missing; every such table needs it"),
    ("mass = 0.5", "mass = true", "bodies[1].mass: True is neither a number nor a formula; "
     "give one"),
    ("t_end = 1.0", 't_end = "1"', "simulation.t_end: '1' is not a number; give one"),
    ("mass = 0.5", "mass = nan", "bodies[1].mass: nan is not a finite number; give one that is"),
    ("t_end = 1.0", "t_end = inf", "simulation.t_end: inf is not a finite number; "
     "give one that is"),
    ("mass = 0.5", "mass = 0", "bodies[1].inertia_com: body 'hand' has inertia but no mass; "
     "give it a mass, or inertia_com = 0"),
    ("mass = 0.5", "mass = -2.5", "bodies[1].mass: -2.5 is negative; give a number >= 0 in kg"),
    ('mass = "m"', 'mass = "m - 3"', "bodies[0].mass: -2 is negative; give a number >= 0 in kg"),
    ("inertia_com = 0.02", "inertia_com = -0.02",
     "bodies[1].inertia_com: -0.02 is negative; give a number >= 0 in kg m^2"),
    ('mass = "m"', 'mass = "mm"', "bodies[0].mass: unknown parameter 'mm' (did you mean 'm'?)"),
    ('mass = "m"', 'mass = "__import__(\'os\')"',
     'bodies[0].mass: "__import__(\'os\')" has \'__import__\' at column 1; a name starts with a '
     "letter, does not end in _, and contains no __"),
    ('mass = "m"', 'mass = "m.real"',
     "bodies[0].mass: 'm.real' has '.real' at column 2, which is not allowed"),
    ('mass = "m"', 'mass = "m**999"',
     "bodies[0].mass: 'm**999' has a power at column 4 that is not a whole number 0 to 16; "
     "others are 1/x**n, sqrt(x), exp(p*log(x))"),
    ('mass = "m"', 'mass = "m/0"', "bodies[0].mass: its value is not a finite number; "
     "change its parameters"),
    ('parent = "arm"', 'parent = "arn"',
     "joints[1].parent: no body is named 'arn' (did you mean 'arm'?)"),
    ('child = "hand"', 'child = "foot"',
     "joints[1].child: no body is named 'foot'; known: arm, hand"),
    (None, JOINT.format("extra", "world", "hand"),
     "joints[2].child: 'hand' is the child of joints[1] too; "
     "in a tree each body has one joint to its parent; give one of the two loop = true"),
    ('parent = "world"', 'parent = "hand"',
     "joints[0].parent: 'hand' is itself a descendant of the child 'arm': "
     "the joints make a cycle; give one of them loop = true, and connect one of its bodies to "
     "the world"),
    (None, BODY.format("hat"),
     "bodies[2].name: 'hat' has no joint; give it one, of type 'free' if it moves freely"),
    ('name = "hand"', 'name = "arm"',
     "bodies[1].name: 'arm' is also the name of bodies[0]; give each its own"),
    ('name = "wrist"', 'name = "shoulder"',
     "joints[1].name: 'shoulder' is also the name of joints[0]; give each its own"),
    ('name = "hand"', 'name = "my hand"', "bodies[1].name: 'my hand' is not an identifier; "
     "use letters a-z, digits, _ and -, starting with a letter"),
    ('name = "hand"', 'name = "my__hand"',
     "bodies[1].name: 'my__hand' ends in _ or contains __; choose another name"),
    ('name = "hand"', 'name = "lambda"',
     "bodies[1].name: 'lambda' is a Python keyword; choose another name"),
    ('name = "hand"', 'name = "world"',
     "bodies[1].name: 'world' is the ground; choose another name"),
    ("r_child = [-0.5, 0]", 'r_child = [-0.5, 0]\ncoordinate = "m"',
     "joints[0]: 'm' would be the name of a coordinate and of a parameter (parameters.m); "
     "rename one of them"),
    ("q = [0.1, 0.2]", "q = [0.1]",
     "initial.q: has 1 numbers for 2 coordinates; give one each for " "shoulder_angle, wrist_angle",
     ),
    ("v = [0.0, 0.0]", "v = [0.0, 0.0, 0.0]",
     "initial.v: has 3 numbers for 2 coordinates; give one each for "
     "shoulder_angle_dot, wrist_angle_dot"),
    ("q = [0.1, 0.2]", "q = { wrist_angel = 0.1 }",
     "initial.q.wrist_angel: no coordinate has this name (did you mean 'wrist_angle'?)"),
    ('integrator = "RK45"', 'integrator = "RK54"',
     "simulation.integrator: unknown value 'RK54' (did you mean 'RK45'?)"),
    ('t_end = 1.0', 't_end = 1.0\ndt = 0.0',
     "simulation.dt: 0.0 is not positive; give a number > 0"),
    ('name = "wrist"\ntype = "revolute"', 'name = "wrist"\ntype = "revolut"',
     "joints[1].type: unknown value 'revolut' (did you mean 'revolute'?)"),
    ('name = "wrist"\ntype = "revolute"', 'name = "wrist"',
     "joints[1].type: missing; it says what kind this is"),
    (None, '[[effects]]\ntype = "motor"\nname = "tau"\njoint = "elbow"\ntorque = "input"\n',
     "effects[1].joint: no joint that moves is named 'elbow'; " "known: shoulder, wrist"),
    (None, '[[effects]]\ntype = "gravity"\nname = "g2"\ng = 1.0\n',
     "effects[1].type: a second 'gravity'; give only one"),
    (None, '[camera]\nfollow = "head"\n',
     "camera.follow: no body is named 'head' (did you mean 'hand'?)"),
    ("r_child = [-0.1, 0]", "r_child = [-0.1]", "joints[1].r_child: has 1 entry; "
     "give at least 2"),
    ("mass = 0.5", f"mass = {'9' * 400}",
     "bodies[1].mass: has hundreds of digits; give at most 1e+100, or choose other " "units"),
    ("mass = 0.5", f"mass = 0x{'f' * 100_000}",
     "bodies[1].mass: has hundreds of digits; give at most 1e+100, or choose other " "units"),
    ("mass = 0.5", f"mass = {'9' * 4301}",
     "has a whole number of thousands of digits; give at most 1e+100, or choose other units"),
    ("mass = 0.5", "mass = [[" + 10_001 * "1," + "]]",
     "bodies[1].mass[0]: has 10001 entries; give at most 10000"),
    ("mass = 0.5", "mass = 1e101", "bodies[1].mass: 1e+101 is larger than 1e+100; "
     "choose other units"),
    ("t_end = 1.0", "t_end = 1e308", "simulation.t_end: 1e+308 is larger than 1e+100; "
     "choose other units"),
    ("r_child = [-0.5, 0]", "r_child = [1e-200, 0]\n[[effects]]\ntype = 'motor'\nname = 'tau'\n"
     "joint = 'wrist'\ntorque = [1]",
     "effects[0].torque: [1] is neither a number nor a formula; give one"),
    ('name = "swing"', 'name = "swing"\ntitle = "a\\u001b[31mb"',
     "title: 'a\\x1b[31mb' has a character at 2 that cannot be printed; remove it"),
    ("q = [0.1, 0.2]", "q = { wrist_angle = 0.1, wrist_angle_deg = 3.0 }",
     "initial.q.wrist_angle_deg: wrist_angle is also given; give only one of them"),
    ('m = { value = 1.0, unit = "kg"', 'm = { value = 1.0, unti = "kg"',
     "parameters.m.unti: unknown key (did you mean 'unit'?)"),
    ("r_child = [-0.1, 0]", "r_child = 3", "joints[1].r_child: 3 is not a list; give one"),
    ("inertia_com = 0.02", "inertia_com = 0.02\nshapes = 3",
     "bodies[1].shapes: 3 is not a list; give one"),
    ("inertia_com = 0.02", "inertia_com = { xx = 1 }",
     "bodies[1].inertia_com: {'xx': 1} is neither a number nor a formula; give one"),
    ("inertia_com = 0.02", 'inertia_com = "0.02 kg m^2"',
     "bodies[1].inertia_com: '0.02 kg m^2' has '^' at column 10, which is not allowed; write ** "
     "for a power"),
    ("inertia_com = 0.02", 'inertia_com = "I"',
     "bodies[1].inertia_com: unknown parameter 'I'; give it a value in [parameters]"),
    ("inertia_com = 0.02", "inertia_com = [0.02]",
     "bodies[1].inertia_com: has 1 entry; give one number in the plane; in space [xx, yy, zz], "
     "or those and xy, xz, yz"),
    ("inertia_com = 0.02", "inertia_com = [0.02, 0.02, 0.02]",
     "bodies[1].inertia_com: body 'hand' has 3 entries; the plane takes one number"),
    ("r_child = [-0.1, 0]", "r_child = [-0.1, 0, 0]",
     "joints[1].r_child: has 3 components; the plane takes 2"),
    ("r_child = [-0.1, 0]", "r_child = []", "joints[1].r_child: has 0 entries; give at least 2"),
    ("r_child = [-0.1, 0]", "r_child = [[-0.1, 0]]",
     "joints[1].r_child: has lists in it; give everything in one list"),
    (None, '[[points]]\nname = "tip"\nbody = "hand"\nat = [1, 2, 3]\n',
     "points[0].at: has 3 components; the plane takes 2"),
    (None, FORCE + "force = [1, 2, 3]\n", "effects[1].force: has 3 components; the plane takes 2"),
    (WRIST, SLIDE + "axis = [1, 0, 0]", "joints[1].axis: has 3 components; the plane takes 2"),
    (WRIST, SLIDE + "axis = [0, 0.0]",
     "joints[1].axis: has no length; give a direction, for example [1.0, 0.0]"),
    (WRIST, SLIDE, "joints[1].axis: missing; every such table needs it"),
    *((WRIST, f'name = "wrist"\ntype = "{kind}"',
       f"joints[1].type: a '{kind}' joint exists only in space; give dimensions = 3")
      for kind in ("ball", "cylindrical", "universal")),
    (WRIST, WRIST + "\naxis = [0, 0, 1]",
     "joints[1].axis: in the plane a pin turns about z; leave it out"),
    (WRIST, WRIST + "\norientation_deg = [0, 0, 90]",
     "joints[1].orientation_deg: has 3 components; the plane takes one angle"),
    (WRIST, WRIST + '\norientation_deg = "90"',
     "joints[1].orientation_deg: '90' is not a number; give one"),
    ('name = "swing"', 'name = "swing"\ndimensions = 4',
     "dimensions: unknown value 4; known: 2, 3"),
    ('name = "swing"', 'name = "swing"\ndimensions = 3',
     "joints[0].r_child: has 2 components; space takes 3"),
    (WRIST, WRIST + "\nlimits = [1, -1]", "joints[1].limits: 1 is not below -1; give [low, high]"),
    (WRIST, WRIST + "\ngear_ratio = 50",
     "joints[1].gear_ratio: does nothing without a motor_inertia; give one"),
    (WRIST, WRIST + "\nmotor_inertia = 1e-5\ngear_ratio = 0",
     "joints[1].gear_ratio: is 0, so the rotor would not turn; give another"),
    (WRIST, WRIST + "\nmotor_inertia = -1e-5",
     "joints[1].motor_inertia: -1e-05 is negative; give a number >= 0 in kg m^2"),
    (WRIST, 'name = "wrist"\ntype = "weld"\nmotor_inertia = 1e-5',
     "joints[1].motor_inertia: unknown key; known here: name, parent, child, r_parent, r_child, "
     "orientation_deg, orientation, loop, type"),
    (WRIST, 'name = "wrist"\ntype = "planar"\ncoordinates = ["a", "b", "a"]\n',
     "joints[1]: 'a' would be the name of a coordinate and of another (joints[1]); rename one of "
     "them"),
    (None, FORCE + "force = 3\n", "effects[1].force: 3 is not a list; give one"),
    (None, FORCE + 'force = "inptu"\n',
     "effects[1].force: unknown value 'inptu' (did you mean 'input'?)"),
    (None, FORCE, "effects[1].force: missing; every such table needs it"),
    *((None, CHAIN.replace("count = 3", f"count = {count}"),
     f"chains[0].count: {message}") for count, message in (("0",
     "0 is too small; give at least 1"), ("-1", "-1 is too small; give at least 1"), ("1001",
     "1001 is too large; give at most 1000"), ("100000", "100000 is too large; give at most 1000"),
     ("1.5", "1.5 is not a whole number; give one"), ('"many"',
     "'many' is not a whole number; give one"),)),
    (None, CHAIN.replace("count = 3", "count = 999"),
     "chains: make 1001 bodies in all; at most 1000 are allowed"),
    (None, "".join(CHAIN.replace("count = 3", "count = 1000").replace("links",
     f"links{i}") for i in range(1000)),
     "chains: make 1000002 bodies in all; at most 1000 are allowed"),
    *((None, CHAIN.replace(f"{field} = [0.1, 0]", f"{field} = [0.1, 0, 0]"),
     f"chains[0].{field}: has 3 components; the plane takes 2") for field in ("start", "r_parent",
     "r_child")),
    (None, CHAIN + "axis = [0, 0, 1]\n",
     "chains[0].axis: in the plane a pin turns about z; leave it out"),
    (None, CHAIN.replace("mass = 0.1", "mass = -0.1"),
     "chains[0].mass: -0.1 is negative; give a number >= 0 in kg"),
    (None, CHAIN + 'parent = "arn"\n',
     "chains[0].parent: no body is named 'arn' (did you mean 'arm'?)"),
    (None, CHAIN.replace("links", "l" * 93),
     f"chains[0].name: makes the name '{'l' * 93}_joint_3', which is longer than 100 characters; "
     "choose a shorter name"),
    (None, CHAIN + CHAIN, "chains[1].name: 'links_1' is also the name of chains[0]; "
     "give each its own"),
    (None, BODY.format("links_2") + JOINT.format("extra", "world", "links_2") + CHAIN,
     "chains[0].name: 'links_2' is also the name of bodies[2]; give each its own"),
    (None, BODY.format("extra") + JOINT.format("links_joint_2", "world", "extra") + CHAIN,
     "chains[0].name: 'links_joint_2' is also the name of joints[2]; give each its own"),
    (None, '[[points]]\nname = "tip"\nbody = "amr"\n',
     "points[0].body: no body is named 'amr' (did you mean 'arm'?)"),
    (None, 2 * '[[points]]\nname = "tip"\nbody = "arm"\n',
     "points[1].name: 'tip' is also the name of points[0]; give each its own"),
    *(('name = "swing"', f'name = "swing"\noutputs = ["momentum", "{name}"]',
     f"outputs[1]: '{name}' needs {what}, and there are none") for name,
     what in (("point_positions", "points"), ("point_velocities", "points"), ("point_jacobians",
     "points"), ("input_jacobian", "inputs"))),
    ('name = "swing"', 'name = "swing"\noutputs = ["momentun"]',
     "outputs[0]: unknown value 'momentun' (did you mean 'momentum'?)"),
    ('name = "swing"', 'name = "swing"\noutputs = "momentum"',
     "outputs: 'momentum' is not a list; give one"),
    ('name = "swing"', 'name = "swing"\nroute = "abba"',
     "route: unknown value 'abba' (did you mean 'aba'?)"),
    *(('name = "swing"', f'name = "swing"\nroute = "{route}"\nform = "{form}"',
       f"route: '{route}' is for form = 'velocity'; the form '{form}' comes from the closed form")
      for route, form in (("aba", "momentum"), ("ldl", "redundant"), ("orthogonal", "momentum"))),
    (GOOD, 'name = "swing"\na = ' + 10**5 * "[" + 10**5 * "]", "is not TOML: nested too deep"),
    (GOOD, 'name = "swing"\na = ' + 5000 * "{ a = " + "1" + 5000 * "}",
     "is not TOML: nested too deep"),
    (GOOD, 'name = "swing"\n' + 10**5 * "a." + "a = 1", "a key has more than 20 parts"),
    (GOOD, 'name = "swing"\n[' + 10**5 * "'a b' . \"c\"." + "d]", "a key has more than 20 parts"),
    ("mass = 0.5", f"mass = {300 * '['}{300 * ']'}",
     f"bodies[1].mass: {40 * '['}…{19 * ']'} is neither a number nor a formula; give one"),
    ("mass = 0.5", f'mass = "{151 * "-"}m"', f"bodies[1].mass: '{39 * '-'}…{17 * '-'}m' "
     "is nested deeper than 150 at column 152"),
    *((GOOD, 'name = "swing"\n' + "".join(line.format(i) for i in range(50_000)),
     f"{key}: has 50000 entries; give at most 1000") for key, line in (("bodies",
     '[[bodies]]\nname = "b{}"\n'), ("parameters", "parameters.p{} = 1\n"))),
    (None, 125_000 * BODY.format("extra"), "is larger than 2000000 bytes"),
    (GOOD, 'name = "swing"\n', "bodies: missing; a scene needs at least one body, or a chain"),
    (GOOD, "", "name: missing; every such table needs it"),
    (GOOD, 'name = "swing"\nbodies = 3', "bodies: 3 is not a list; give one"),
    (GOOD, 'name = "swing"\nbodies = [3]', "bodies[0]: 3 is not a table; give one"),
    ("q = [0.1, 0.2]", "q = [[0.1], [0.2]]",
     "initial.q: has lists in it; give everything in one list"),
    ("mass = 0.5\ninertia_com = 0.02", "mass = 0\ninertia_com = 0", SINGULAR.format("hand",
     "wrist_angle_dot")),
    (f"mass = 0.5\ninertia_com = 0.02\n{SHOULDER}{WRIST}",
     f"mass = 0\ninertia_com = 0\n{SHOULDER}{SLIDE}axis = [1, 0]", SINGULAR.format("hand",
     "wrist_slide_dot")),
    (GOOD, 'name = "swing"\n' + CHAIN.replace("= 0.1\n", "= 0\n").replace("1e-4", "0"),
     SINGULAR.format("links_3", "links_joint_3_angle_dot")),
    ("inertia_com = 0.02\n" + SHOULDER + WRIST + HELD_AWAY,
     "inertia_com = 0\n" + SHOULDER + WRIST + HELD_AWAY.replace("-0.1", "0"),
     SINGULAR.format("hand", "wrist_angle_dot")),
]  # fmt: skip

SPACE = """\
name = "robot"
dimensions = 3
[parameters]
m = 1.0
[[bodies]]
name = "arm"
mass = "m"
inertia_com = [0.1, 0.1, 0.05]
[[bodies]]
name = "hand"
mass = 0.5
inertia_com = [0.02, 0.03, 0.04, 0.001, 0, 0]
[[joints]]
name = "shoulder"
type = "revolute"
parent = "world"
child = "arm"
axis = [0, 1, 0]
r_child = [-0.5, 0, 0]
[[joints]]
name = "wrist"
type = "ball"
parent = "arm"
child = "hand"
r_parent = [0.5, 0, 0]
r_child = [-0.1, 0, 0]
[[effects]]
type = "gravity"
g = 9.81
[initial]
q = [0.1, 1.0, 0.0, 0.0, 0.0]
"""
INERTIA = "inertia_com = [0.02, 0.03, 0.04, 0.001, 0, 0]"
AXIS = "axis = [0, 1, 0]"
BALL = 'name = "wrist"\ntype = "ball"'
UNIVERSAL = 'name = "wrist"\ntype = "universal"\naxes = '
WHAT_INERTIA = "give one number in the plane; in space [xx, yy, zz], or those and xy, xz, yz"
LINKS = """\
name = "robot"
dimensions = 3
[[chains]]
name = "links"
count = 6
mass = 0.1
inertia_com = [1e-4, 1e-4, 1e-4]
r_parent = [0.1, 0, 0]
r_child = [0.1, 0, 0]
"""

MISTAKES_IN_SPACE = [
    (INERTIA, "inertia_com = 0.1", "bodies[1].inertia_com: body 'hand' has one number; "
     "space takes [xx, yy, zz], or 0 for a particle"),
    (INERTIA, "inertia_com = []", f"bodies[1].inertia_com: has 0 entries; {WHAT_INERTIA}"),
    *((INERTIA, f"inertia_com = {entries}", f"bodies[1].inertia_com: body 'hand' has {count} "
       "entries; give [xx, yy, zz], or those and xy, xz, yz")
      for count, entries in ((4, "[1, 1, 1, 0]"), (5, "[1, 1, 1, 0, 0]"))),
    (INERTIA, "inertia_com = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
     "bodies[1].inertia_com: has lists in it; give everything in one list"),
    (INERTIA, "inertia_com = [1, nan, 1]",
     "bodies[1].inertia_com[1]: nan is not a finite number; give one that is"),
    (INERTIA, 'inertia_com = [1, "mm", 1]',
     "bodies[1].inertia_com[1]: unknown parameter 'mm' (did you mean 'm'?)"),
    (INERTIA, "inertia_com = [1, -1, 1]",
     "bodies[1].inertia_com[1]: -1 is negative; give a number >= 0 in kg m^2"),
    (INERTIA, "inertia_com = [1, 1, 1, 2, 0, 0]",
     "bodies[1].inertia_com: body 'hand' has moments 1, 1, 1 and products 2, 0, 0; so one of its "
     "principal moments is negative, or larger than the other two together: make the products "
     "smaller, or change xx, yy or zz"),
    (INERTIA, 'inertia_com = [1, "m", "3*m"]',
     "bodies[1].inertia_com: body 'hand' has principal moments 1, 1, 3; no body has one larger "
     "than the other two together: change xx, yy or zz"),
    (INERTIA, "inertia_com = [2, 2, 1.5, -1.2, 0, 0]",
     "bodies[1].inertia_com: body 'hand' has moments 2, 2, 1.5 and products -1.2, 0, 0; so one "
     "of its principal moments is negative, or larger than the other two together: make the "
     "products smaller, or change xx, yy or zz"),
    (INERTIA, "", "bodies[1].inertia_com: missing; a body needs it unless it is on a joint of type "
     "'particle'"),
    (AXIS, "axis = [0, 0, 0]",
     "joints[0].axis: has no length; give a direction, for example [1.0, 0.0, 0.0]"),
    (AXIS, "axis = [0, 1]", "joints[0].axis: has 2 components; space takes 3"),
    (AXIS, 'axis = ["m", 0, 0]', "joints[0].axis[0]: 'm' is not a number; give one"),
    (BALL, UNIVERSAL + "[[1, 0, 0], [-2, 0, 1e-15]]",
     "joints[1].axes: are parallel; give two that cross, or a revolute joint"),
    (BALL, UNIVERSAL + "[[1, 0, 0], [0, 0, 0]]",
     "joints[1].axes[1]: has no length; give a direction, for example [1.0, 0.0, 0.0]"),
    (BALL, UNIVERSAL + "[[1, 0, 0]]", "joints[1].axes[1]: missing; the list is too short"),
    (BALL, UNIVERSAL + "[1, 0]",
     "joints[1].axes: has entries that are not lists; give a list of lists"),
    (BALL, UNIVERSAL + "[[1, 0, 0], [0, 1]]",
     "joints[1].axes[1]: has 2 components; space takes 3"),
    (BALL, BALL + "\norientation_deg = 90",
     "joints[1].orientation_deg: is one angle; space takes 3, about x, y and z"),
    ("r_parent = [0.5, 0, 0]", "r_parent = [0.5, 0]",
     "joints[1].r_parent: has 2 components; space takes 3"),
    (None, '[[points]]\nname = "tip"\nbody = "hand"\nat = [1, 2]\n',
     "points[0].at: has 2 components; space takes 3"),
    (None, FORCE + 'at = [1, 2]\nforce = "input"\n',
     "effects[1].at: has 2 components; space takes 3"),
    *((SPACE, LINKS.replace("r_child", f"{field} = [0.1, 0]\nr_child").replace(twice, ""),
       f"chains[0].{field}: has 2 components; space takes 3")
      for field, twice in (("start", "-"), ("r_parent", "r_parent = [0.1, 0, 0]\n"))),
    (SPACE, LINKS.replace("r_child = [0.1, 0, 0]", "r_child = [0.1, 0]"),
     "chains[0].r_child: has 2 components; space takes 3"),
    (SPACE, LINKS + "axis = [1, 0]\n", "chains[0].axis: has 2 components; space takes 3"),
    (None, '[[effects]]\ntype = "motor"\nname = "tau"\njoint = "wrist"\ntorque = "input"\n',
     "effects[1].joint: 'wrist' is a ball joint and has no angle"),
    (BALL, BALL + "\nmotor_inertia = -1e-5",
     "joints[1].motor_inertia: -1e-05 is negative; give a number >= 0 in kg m^2"),
    (BALL, BALL + '\ncoordinate = "a"',
     "joints[1].coordinate: unknown key; known here: name, parent, child, r_parent, r_child, "
     "orientation_deg, orientation, loop, motor_inertia, type"),
    (f'{BALL}\nparent = "arm"\nchild = "hand"\nr_parent = [0.5, 0, 0]\nr_child = [-0.1, 0, 0]',
     'name = "wrist"\ntype = "free"\nparent = "arm"\nchild = "hand"',
     "joints[1].parent: unknown value 'arm'; known: world"),
    ("[0.1, 1.0, 0.0, 0.0, 0.0]", "[0.1, 0, 0, 0, 0]",
     "initial.q: the quaternion that starts at wrist_qw has no length; give 1, 0, 0, 0 for "
     "no rotation"),
    ("[0.1, 1.0, 0.0, 0.0, 0.0]", "[0.1]",
     "initial.q: has 1 numbers for 5 coordinates; give one each for shoulder_angle, wrist_qw, "
     "wrist_qx, wrist_qy, wrist_qz"),
    ("[0.1, 1.0, 0.0, 0.0, 0.0]", "{ wrist_qx_deg = 30 }",
     "initial.q.wrist_qx_deg: no coordinate has this name (did you mean 'wrist_qx'?)"),
    (None, "v = { wrist_angle_dot = 1.0 }\n",
     "initial.v.wrist_angle_dot: no coordinate has this name (did you mean 'shoulder_angle_dot'?)"),
    (f"mass = 0.5\n{INERTIA}", "mass = 0\ninertia_com = 0", SINGULAR.format("hand", "wrist_wz")),
    (INERTIA, "inertia_com = 0", SINGULAR.format("hand", "wrist_wx")),
    (SPACE, SPACE.replace(INERTIA, "inertia_com = 0").replace("[-0.1, 0, 0]", "[0, 0, 0]"),
     SINGULAR.format("hand", "wrist_wz")),
    (INERTIA, "inertia_com = [0, 0.01, 0.01]", SINGULAR.format("hand", "wrist_wx")),
    (SPACE, 'route = "closed"\n' + LINKS.replace("count = 6", "count = 7"),
     "route: 'closed' needs the closed form, and it is for 6 bodies at most, or 12 in a tree of "
     "pins and free bodies in the plane; leave it out"),
    ("dimensions = 3", 'dimensions = 3\nform = "momentum"',
     "form: 'momentum' needs the closed form, and it is derived in the plane; leave it out"),
    ("dimensions = 3", "dimensions = 2", "joints[0].r_child: has 3 components; the plane takes 2"),
]  # fmt: skip


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A file for a scene."""
    return tmp_path / "swing.toml"


def test_the_scene_without_a_mistake_is_good(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table below would prove nothing if its base were refused."""
    scene.write_text(GOOD)
    assert main(["check", str(scene)]) == 0
    assert "2 degrees of freedom" in capsys.readouterr().out


ROWS = [(GOOD, *row) for row in MISTAKES] + [(SPACE, *row) for row in MISTAKES_IN_SPACE]


@pytest.mark.parametrize(("good", "old", "new", "message"), ROWS, ids=[row[3] for row in ROWS])
def test_one_mistake_one_line(
    scene: Path,
    capsys: pytest.CaptureFixture[str],
    good: str,
    old: str | None,
    new: str,
    message: str,
) -> None:
    """Place, value and remedy on one line of standard error; exit code 1; nothing written.

    And soon: what is too large or nested without end is not worked through first.
    """
    assert old is None or old in good
    scene.write_text(good + new if old is None else good.replace(old, new, 1))
    output = scene.parent / "made"
    start = time.process_time()
    assert main(["generate", str(scene), "-o", str(output)]) == 1
    assert time.process_time() - start < 60.0
    out, err = capsys.readouterr()
    line = re.match(r"eomgen: swing\.toml:(\d+): ", err)
    without = re.sub(r"^(eomgen: swing\.toml):\d+: ", r"\1: ", err)
    assert without == f"eomgen: swing.toml: {message}\n"
    assert out == ""
    location = re.match(r"[a-z_]+(?:\[\d+\]|\.\w+)+: ", message)
    if location and "hundreds of digits" not in message:
        assert line  # of its key, or of the table where it is missing
        key = re.findall(r"[a-z]\w*", location[0])[-1]
        assert re.search(rf"\b{key}\b|\[\[", scene.read_text().split("\n")[int(line[1]) - 1])
    if message.startswith(("body '", "route: '", "form: '")):  # found in a scene that reads well
        assert not output.exists() or not list(output.iterdir())
    else:
        assert not output.exists()


NOTICES = [
    (GOOD, WRIST, SLIDE + "axis = [3, -4]",
     "joints[1].axis: has length 5; taken as a direction of length 1"),
    (SPACE, AXIS, "axis = [0, 2, 0]",
     "joints[0].axis: has length 2; taken as a direction of length 1"),
    (SPACE, AXIS, "axis = [1e-200, 1e-200, 0]",
     "joints[0].axis: has length 1.41421e-200; taken as a direction of length 1"),
    (SPACE, "[0.1, 1.0, 0.0, 0.0, 0.0]", "[0.1, 0.0, 2.0, 0.0, 0.0]",
     "initial.q: the quaternion that starts at wrist_qw has length 2; scaled to 1"),
    (SPACE, "[0.1, 1.0, 0.0, 0.0, 0.0]", "{ wrist_qx = 0.5 }",
     "initial.q: the quaternion that starts at wrist_qw has length 0.5; scaled to 1"),
    (SPACE, SPACE, LINKS + "axis = [1, 1, 0]",
     "chains[0].axis: has length 1.41421; taken as a direction of length 1"),
]  # fmt: skip


@pytest.mark.parametrize(("good", "old", "new", "notice"), NOTICES, ids=[n[3] for n in NOTICES])
def test_what_is_put_right_is_said(
    scene: Path, capsys: pytest.CaptureFixture[str], good: str, old: str, new: str, notice: str
) -> None:
    """An axis or a quaternion not of length 1 counts as if it were, with one line to say so."""
    assert old in good
    text = good.replace(old, new, 1)
    model = elaborate(parse_scene(text))
    assert model.notices == (notice,)
    for body in model.bodies:
        if (axis := getattr(body.joint, "axis", None)) is not None:
            assert math.hypot(*map(float, direction(axis))) == pytest.approx(1.0, rel=1e-15)
    for indices in model.quaternions:
        parts = [model.initial_q[i] for i in indices]
        assert math.hypot(*parts) == pytest.approx(1.0, rel=1e-15)
    scene.write_text(text)
    assert main(["check", str(scene)]) == 0
    said = re.sub(r"swing\.toml:\d+: ", "swing.toml: ", capsys.readouterr().err)
    assert said == f"eomgen: note: swing.toml: {notice}\n"


@pytest.mark.parametrize("good", [GOOD, SPACE])
def test_what_is_right_is_not_touched(good: str) -> None:
    """No notice, and no number of a scene changed, where axes and quaternions are of length 1."""
    model = elaborate(parse_scene(good.replace(AXIS, "axis = [0.6, 0.0, -0.8]")))
    assert model.notices == ()
    axis = getattr(model.bodies[0].joint, "axis", None)
    assert axis in (None, (0.6, 0.0, -0.8))
    assert len(model.initial_q) == (2 if good is GOOD else 5)


def test_a_quaternion_that_is_not_given() -> None:
    """It is no turn, and needs no notice."""
    model = elaborate(parse_scene(SPACE.replace("q = [0.1, 1.0, 0.0, 0.0, 0.0]", "")))
    assert model.initial_q == (0.0, 1.0, 0.0, 0.0, 0.0)
    assert model.notices == ()


def test_a_file_that_is_not_there(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A path that leads nowhere, a folder, a file that is no text."""
    assert main(["check", "two_boddy"]) == 1
    assert capsys.readouterr().err == (
        "eomgen: two_boddy: no such file or built-in scene (did you mean 'two_body'?)\n"
    )
    assert main(["check", str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {tmp_path}: is a folder; give a scene file in it\n"
    )
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff")
    for mistake in ("picture", "pictures.toml"):
        assert main(["check", str(tmp_path / mistake)]) == 1
        assert "picture.toml'?)" in capsys.readouterr().err
    assert main(["check", str(tmp_path / "picture.toml")]) == 1
    assert capsys.readouterr().err == "eomgen: picture.toml: is not UTF-8 text (byte 0)\n"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--integrator", "rk5"],
         f"integrator: unknown name 'rk5' (did you mean 'rk4'?); known: {', '.join(INTEGRATORS)}"),
        (["--integrator", "rk4", "--dt", "0"], "dt: 0 is not a positive step; give e.g. --dt 0.001",
         ),
        (["--integrator", "rk4", "--dt", "-0.1"],
         "dt: -0.1 is not a positive step; give e.g. --dt 0.001"),
        (["--set", "n=1"], "--set: no parameter 'n'; known: m, arm_inertia_com, "),
        (["--set", "m=one"], "--set m=one: gives no finite number; write --set m=1.5"),
        (["--set", "m"], "--set m: gives no finite number; write --set m=1.5"),
        (["--set", "m=-1"], "mass of arm is not positive: change the parameters"),
        (["--samples", "100000000000"], "samples: 100000000000 is too many; give at most 1000000"),
        (["--input", "tau=1"], "--input: no input 'tau'; known: none"),
    ],
)  # fmt: skip
def test_a_wrong_option(
    scene: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    """The command line's own mistakes read like the scene's, and leave nothing behind."""
    scene.write_text(GOOD)
    output = scene.parent / "out"
    assert main(["simulate", str(scene), "-o", str(output), *options]) == 1
    err = capsys.readouterr().err.rstrip("\n")
    assert err.startswith(f"eomgen: {message}"), err
    assert "\n" not in err
    assert not output.exists() or not list(output.iterdir())


def test_an_unwritable_output(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that cannot be, and files that others wrote: refused before any work, untouched."""
    scene.write_text(GOOD)
    blocked = scene / "out"
    assert main(["simulate", str(scene), "-o", str(blocked)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {blocked}: the folder cannot be created: Not a directory\n"
    )
    theirs = scene.parent / "swing.csv"
    theirs.write_text("t,x\n0,1\n")
    assert main(["simulate", str(scene), "-o", str(scene.parent)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {theirs}: exists and was not written by eomgen; "
        "move it away, choose another name, or give --force\n"
    )
    assert theirs.read_text() == "t,x\n0,1\n"
    assert sorted(p.name for p in scene.parent.iterdir()) == ["swing.csv", "swing.toml"]


def test_a_point_mass_too_near_its_pin(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mechanism whose mass matrix vanishes in double precision is refused, not written."""
    text = GOOD.replace("inertia_com = 0.02", "inertia_com = 0").replace("[-0.1, 0]", "[1e-200, 0]")
    scene.write_text(text)
    output = scene.parent / "made"
    assert main(["generate", str(scene), "-o", str(output)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: swing.toml: {SINGULAR.format('hand', 'wrist_angle_dot')}\n"
    )
    assert not list(output.iterdir())


def test_a_refusal_stops_no_other_scene(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each refusal is reported, the other modules are written, and the exit code is 1."""
    scene.write_text(GOOD)
    bad = scene.parent / "bad.toml"
    bad.write_text(GOOD.replace("mass = 0.5", "mass = -1"))
    made = scene.parent / "made"
    command = ["generate", str(bad), "no_such", str(scene), "pendulum", "-o", str(made)]
    for option, state in (["--check"], "missing"), ([], "written"), (["--check"], "fresh"):
        assert main([*command, *option]) == 1
        out, err = capsys.readouterr()
        refusals = err.splitlines()
        assert refusals[0].startswith("eomgen: bad.toml:10: bodies[1].mass: ")
        assert refusals[1].startswith("eomgen: no_such: no such file")
        assert len(refusals) == 2 + (state == "missing")
        assert [line.partition(",")[0] for line in out.splitlines()] == [
            f"{made}/swing.py: {state}",
            f"{made}/pendulum.py: {state}",
        ]
    blocked = scene / "out"
    assert main(["generate", str(scene), "pendulum", "-o", str(blocked)]) == 1
    assert capsys.readouterr().err == (
        f"eomgen: {blocked}: the folder cannot be created: Not a directory\n"
    )


def test_all_unknown_keys_are_reported(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of one table and of another, each with its hint; of thousands the first, and soon."""
    text = GOOD.replace("mass = 0.5", "mass = 0.5\nmas = 1\ncolour = 2\ninertia = 3")
    scene.write_text(text.replace('type = "gravity"', 'type = "gravity"\ngg = 1'))
    assert main(["check", str(scene)]) == 1
    assert capsys.readouterr().err.splitlines() == [
        "eomgen: swing.toml:11: bodies[1].mas: unknown key (did you mean 'mass'?)",
        "eomgen: swing.toml:12: bodies[1].colour: unknown key; known here: name, mass, "
        "inertia_com, com, inertia_check, shapes",
        "eomgen: swing.toml:13: bodies[1].inertia: unknown key (did you mean 'inertia_com'?)",
        "eomgen: swing.toml:30: effects[0].gg: unknown key (did you mean 'g'?)",
    ]
    many = "".join(f"key_{k} = {k}\n" for k in range(5000))
    scene.write_text(GOOD.replace("mass = 0.5\n", f"mass = 0.5\n{many}"))
    began = time.process_time()
    assert main(["check", str(scene)]) == 1
    assert time.process_time() - began < 5.0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 11 and lines[-1] == "eomgen: swing.toml: and 4990 more"
