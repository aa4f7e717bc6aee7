"""A good MJCF file, and mistakes that can be made in it; see `robot_files`."""

GOOD_MJCF = """\
<?xml version="1.0"?>
<mujoco model="arm">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <default>
    <joint axis="0 1 0" damping="0.1" armature="0.01"/>
    <default class="thin"><geom size="0.02"/></default>
  </default>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" limited="true" range="-1 2"/>
      <geom type="capsule" size="0.04" fromto="0 0 0 0 0 0.4" rgba="0 0 1 1"/>
      <body name="lower" pos="0 0 0.4" euler="0 0.2 0">
        <joint name="elbow" stiffness="3" springref="0.1" ref="0.2"/>
        <joint name="twist" axis="0 0 1"/>
        <geom class="thin" type="sphere" pos="0 0 0.3"/>
        <site name="tip" pos="0 0 0.3"/>
      </body>
    </body>
    <body name="ball" pos="1 0 1">
      <freejoint name="flight"/>
      <inertial mass="2" pos="0.1 0 0" diaginertia="0.03 0.03 0.004"/>
    </body>
  </worldbody>
  <tendon><fixed name="cord"><joint joint="elbow" coef="2"/></fixed></tendon>
  <equality>
    <joint joint1="twist" joint2="elbow" polycoef="0 0.5 0 0 0"/>
  </equality>
  <actuator>
    <motor name="drive" joint="shoulder" gear="5"/>
    <position name="hold" tendon="cord" kp="3"/>
  </actuator>
</mujoco>
"""

MJCF_MISTAKES = (
    ('mass="2"', "", "required attribute missing: 'mass'"),
    ('mass="2"', 'mass="-2"', "mass and inertia of moving bodies must be larger tha"),
    ('mass="2"', 'mass="nan"', "mass and inertia of moving bodies must be larger tha"),
    ('mass="2"', 'mass="1e999"', "number is too large in attribute 'mass'"),
    ('mass="2"', 'mass="0"', "mass and inertia of moving bodies must be larger tha"),
    ('mass="2"', "mass=\"__import__('os')\"", "bad format in attribute 'mass'"),
    ('diaginertia="0.03 0.03 0.004"', "", "mass and inertia of moving bodies must be larger tha"),
    ('diaginertia="0.03 0.03 0.004"', 'diaginertia="0.03 0.03 0.4"',
     "inertia must satisfy A + B >= C"),
    ('diaginertia="0.03 0.03 0.004"', 'diaginertia="0.03 -0.03 0.03"',
     "mass and inertia of moving bodies must be larger tha"),
    ('diaginertia="0.03 0.03 0.004"', 'fullinertia="1 1 1 2 2 2"',
     "error 'inertia must have positive eigenvalues' in fu"),
    ('pos="0 0 1"', 'pos="0 0"', "attribute 'pos' does not have enough data"),
    ('pos="0 0 1"', 'pos="0 0 1e308"', "body_pos of the compiled model has a number that is "),
    ('pos="0 0 1"', f'pos="{"0 " * 9999}"', "attribute 'pos' has too much data"),
    ('euler="0 0.2 0"', 'quat="0 0 0 0"', "zero quaternion is not allowed"),
    ('euler="0 0.2 0"', 'euler="0 0.2 0" quat="1 0 0 0"',
     "multiple orientation specifiers are not allowed"),
    ('axis="0 0 1"', 'axis="0 0 0"', "axis too small in joint"),
    ('axis="0 0 1"', 'axis="0 1 0"', ""),
    ('axis="0 0 1"', 'type="ball"', "only HINGE and SLIDE joint allowed in constraint"),
    ('axis="0 0 1"', 'type="free"', "more than 6 dofs in body 'lower'"),
    ('axis="0 0 1"', 'type="hing"', "invalid keyword: 'hing'"),
    ('damping="0.1"', 'damping="-1"', ""),
    ('armature="0.01"', 'armature="-0.1"', "joints[0].motor_inertia: -0.1 is negative"),
    ('armature="0.01"', 'frictionloss="0.2"', ""),
    ('stiffness="3"', 'stiffness="-3"', ""),
    ('springref="0.1"', 'springref="inf"', "qpos_spring of the compiled model has a number that "),
    ('range="-1 2"', 'range="2 -1"', "range[0] should be smaller than range[1] in joint"),
    ('range="-1 2"', "", "range[0] should be smaller than range[1] in joint"),
    ('type="capsule"', 'type="mesh" mesh="arm"', "mesh 'arm' not found in geom 0"),
    ('type="capsule" size="0.04"', 'type="capsule" size="-0.04"',
     "size 0 must be positive in geom"),
    ('rgba="0 0 1 1"', 'rgba="red"', "bad format in attribute 'rgba'"),
    ('rgba="0 0 1 1"', 'rgba="nan 9 -3 1"', "geom_rgba of the compiled model has a number that is"),
    ('class="thin" type', 'class="thick" type', "unknown default class name 'thick'"),
    ('joint="shoulder" gear', 'joint="sholder" gear',
     "unknown transmission target 'sholder' for actuator id = 0"),
    ('gear="5"', 'gear="nan"', "actuator_gear of the compiled model has a number tha"),
    ('kp="3"', 'kp="3" dampratio="1"', ""),
    ('coef="2"', 'coef="1e400"', "number is too large in attribute 'coef'"),
    ('joint2="elbow"', 'joint2="twist"', "element 'twist' is repeated in equality constraint 0"),
    ('joint2="elbow"', "", ""),
    ('polycoef="0 0.5 0 0 0"', 'polycoef="0 1e300 0 0 0"',
     "eq_data of the compiled model has a number that is n"),
    ("<joint joint1=", "<connect body1='ball' anchor='0 0 0'/><joint joint1=", ""),
    ("<joint joint1=", "<connect body1='ball' body2='ball' anchor='0 0 0'/><joint joint1=",
     "element 'ball' is repeated in equality constraint 0"),
    ('name="elbow"', 'name="shoulder"', "repeated name 'shoulder' in joint"),
    ('name="upper"', 'name="lower"', "repeated name 'lower' in body"),
    ('name="twist"', 'name="t"', "unknown element 'twist' in equality constraint"),
    ('name="upper"', 'name="upper arm 1!"', ""),
    ('name="upper"', f'name="{"u" * 9999}"', ""),
    ('name="upper"', 'name="θ \u202e-1"', ""),
    ('name="drive"', 'name="shoulder_dot"', ""),
    ('model="arm"', 'model="&#10;eomgen: forged"', ""),
    ("<mujoco ", "<mujoco_ ", "is not XML: mismatched tag"),
    ("<compiler ", '<size memory="900G"/><compiler ', "engine error: Could not allocate memory"),
    ("<compiler ", '<include file="../other.xml"/><compiler ', "is outside of the file's folder"),
    ("<compiler ", '<include file="robot.mjcf"/><compiler ', "does a file include itself?"),
    ("<compiler ", '<compiler meshdir="/etc"/><compiler ', "'/etc' is outside"),
    ("<compiler ", '<asset><mesh file="/etc/passwd"/></asset><compiler ', "is outside"),
    ("<compiler ", '<asset><mesh file="http://127.0.0.1:9/a.stl"/></asset><compiler ',
     "Error opening file 'http:/127.0.0.1:9/a.stl'"),
    ("<compiler ", '<asset><mesh file="robot.mjcf" name="m"/></asset><compiler ',
     "no decoder found for mesh file"),
    ("<compiler ", f'<asset><mesh file="{"a" * 5000}.stl"/></asset><compiler ',
     "cannot be read: File name too long"),
    ("<compiler ", '<asset><mesh file="&#0;"/></asset><compiler ', "is not XML"),
    ("<compiler ",
     '<asset><hfield name="h" nrow="99999" ncol="9999" size="1 1 1 1"/></asset><compiler ',
     "has more than 100000000 points"),
    ("</worldbody>", '<body><composite type="cable" count="999999 1 1"/></body></worldbody>',
     "the file has more than 100000 elements with all copies"),
    ("</worldbody>", '<replicate count="100000" sep="-"><geom size="1"/></replicate></worldbody>',
     "the file has more than 100000 elements with all copies"),
    ("</worldbody>", f"{'<body>' * 200}{'</body>' * 200}</worldbody>", "more than 100 deep"),
)  # fmt: skip
