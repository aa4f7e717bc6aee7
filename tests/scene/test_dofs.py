"""Effects at joints with several degrees of freedom: balls, universal joints, several at once."""

import math

import numpy as np
import pytest
from engine import MP, Engine, along, apart, exact, plain, quick, slopes
from scenes import refusal

BODY = """
[[bodies]]
name = "{name}"
mass = 1.3
inertia_com = [0.05, 0.07, 0.06, 0.004, -0.003, 0.002]
[[joints]]
name = "{joint}"
type = "{type}"
parent = "{parent}"
child = "{name}"
r_parent = [0.1, 0.0, -0.2]
r_child = [0.05, -0.1, 0.3]
"""
TREE = 'name = "tree"\ndimensions = 3\noutputs = "all"\n' + "".join(
    BODY.format(name=name, joint=joint, type=kind, parent=parent)
    for name, joint, kind, parent in (
        ("a", "ball", "ball", "world"),
        ("b", "cross", "universal", "a"),
        ("c", "pin", "revolute", "b"),
    )
)
SPRING = '[[effects]]\ntype = "joint_spring"\nname = "s"\nstiffness = 7.0\ndamping = 0.4\n'


def tree(effects: str) -> Engine:
    """A ball, a universal joint and a pin one after the other, under some effects."""
    return plain(TREE + effects)


def torques(made: Engine, y: np.ndarray) -> np.ndarray:
    """What the effects put on the velocities."""
    return np.array(made.module.applied_force(0.0, y))


def state(q: list[float], v: list[float]) -> np.ndarray:
    """Ball's quaternion, then three angles; then velocities."""
    return np.array([*q, *v], dtype=float)


AXIS = np.array([2.0, -1.0, 2.0]) / 3
OMEGA = np.array([0.3, -0.7, 1.1])


@pytest.mark.every(4)
@pytest.mark.parametrize("angle", [0.0, 1e-12, 0.4, 2.9])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ball_is_pulled_back_about_the_axis_of_its_turn(angle: float, sign: float) -> None:
    """-k θ n - c ω, whichever of its two quaternions describes the rotation; energy ½ k θ²."""
    made = tree(SPRING + 'joint = "ball"\n')
    q = sign * np.array([math.cos(angle / 2), *(math.sin(angle / 2) * AXIS)])
    y = state([*q, 0.1, 0.2, 0.3], [*OMEGA, 0.5, 0.6, 0.7])
    expected = [*(-7.0 * angle * AXIS - 0.4 * OMEGA), 0.0, 0.0, 0.0]
    assert apart(torques(made, y), expected) < 1e-14
    assert abs(float(made.module.potential_energy(0.0, y)) - 3.5 * angle**2) < 1e-14


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.3])
def test_jacobian_of_a_ball_is_exact_also_where_it_rests(angle: float) -> None:
    """Against central differences in 60 digits; at rest the axis of its turn is none."""
    made = quick(TREE + SPRING + 'joint = "ball"\n')
    q = [math.cos(angle / 2), *(math.sin(angle / 2) * AXIS)]
    y = state([*q, 0.1, 0.2, 0.3], [*OMEGA, 0.5, 0.6, 0.7])
    # At rest |r| stands for a number too small for these steps: differences go beside it.
    jacobian = made.module.jacobian(0.0, y)
    for found, column in zip(jacobian.T, slopes(made, "jacobian", y).T, strict=True):
        assert apart(found, column) < 1e-12


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("several", "one_by_one"),
    [
        (SPRING + 'joints = "all"\n', ("ball", "cross", "pin")),
        (SPRING + 'joints = ["cross", "pin"]\n', ("cross", "pin")),
        (
            SPRING + 'joint = "cross"\n',
            ('cross"\ncoordinate = "cross_angle_1', 'cross"\ncoordinate = "cross_angle_2'),
        ),
    ],
)
def test_several_are_one_by_one(several: str, one_by_one: tuple[str, ...]) -> None:
    """All joints, some of them, both angles of one: the same as an effect each."""
    alone = "".join(
        SPRING.replace('"s"', f'"s{i}"') + f'joint = "{joint}"\n'
        for i, joint in enumerate(one_by_one)
    )
    made, apiece = tree(several), tree(alone)
    y = made.random_state(np.random.default_rng(3))
    assert apart(torques(made, y), torques(apiece, y)) < 1e-15
    assert np.count_nonzero(torques(made, y)) >= 2
    u = made.module.potential_energy(0.0, y), apiece.module.potential_energy(0.0, y)
    assert apart(*u) < 1e-14


def test_friction_of_a_ball_is_against_its_turning() -> None:
    """-(b |ω| + C tanh(|ω|/s)) ω/|ω|; none at rest."""
    keys = 'joint = "ball"\nviscous = 0.3\ncoulomb = 2.0\nspeed = 0.5\n'
    made = tree('[[effects]]\ntype = "joint_friction"\nname = "f"\n' + keys)
    size = np.linalg.norm(OMEGA)
    expected = -(0.3 * size + 2.0 * math.tanh(size / 0.5)) * OMEGA / size
    q = [1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3]
    assert apart(torques(made, state(q, [*OMEGA, 1.0, 1.0, 1.0]))[:3], expected) < 1e-14
    assert not torques(made, state(q, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0])).any()


STOP = '[[effects]]\ntype = "joint_stop"\nname = "stop"\n'


def test_a_ball_is_stopped_beyond_its_turn() -> None:
    """Nothing within; k x + c dx/dt back about the axis of the turn beyond, never a pull."""
    made = tree(STOP + 'joint = "ball"\nhigh = 1.0\nstiffness = 50.0\ndamping = 2.0\n')
    for angle, rate, push in ((0.9, 3.0, 0.0), (1.2, 0.5, 11.0), (1.2, -6.0, 0.0)):
        q = [math.cos(angle / 2), *(math.sin(angle / 2) * AXIS), 0.0, 0.0, 0.0]
        across = np.array([1.0, 2.0, 0.0])  # turns about it neither bring near nor away
        y = state(q, [*(rate * AXIS + across), 0.0, 0.0, 0.0])
        assert apart(torques(made, y)[:3], -push * AXIS) < 1e-12


def test_a_rigid_stop_of_a_ball_is_a_contact() -> None:
    """Its gap is what is left of the turn; an impact turns back the rate of that alone."""
    made = tree(STOP + 'joint = "ball"\nhigh = 1.0\nrestitution = 0.5\n')
    angle = 1.0
    q = [math.cos(angle / 2), *(math.sin(angle / 2) * AXIS), 0.1, 0.2, 0.3]
    y = state(q, [*(2.0 * AXIS + np.array([1.0, 2.0, 0.0])), 0.4, 0.5, 0.6])
    assert made.module.CONTACTS == {"stop_high": "stop"}
    assert abs(made.module.gaps(0.0, y)[0]) < 1e-15
    assert abs(made.module.gap_rates(0.0, y)[0] + 2.0) < 1e-14
    after = made.module.impact(0.0, y, 0)
    assert abs(made.module.gap_rates(0.0, after)[0] - 1.0) < 1e-13
    # The impulse is a torque about n alone: M Δv has no part across it.
    impulse = made.module.mass_matrix(0.0, y) @ (after - y)[7:]
    assert apart(impulse[:3], (impulse[:3] @ AXIS) * AXIS) < 1e-13
    assert np.max(np.abs(impulse[3:])) < 1e-13


def test_motors_and_servos_choose_a_coordinate() -> None:
    """Of a universal joint: the torque acts on that angle alone, in the units of an angle."""
    motor = '[[effects]]\ntype = "motor"\nname = "m"\njoint = "cross"\ntorque = 3.0\n'
    made = tree(motor + 'coordinate = "cross_angle_2"\n')
    y = made.random_state(np.random.default_rng(4))
    assert apart(torques(made, y), [0, 0, 0, 0, 3.0, 0]) < 1e-15
    servo = '[[effects]]\ntype = "pd"\nname = "s"\njoint = "cross"\ncoordinate = "cross_angle_2"\n'
    made = tree(servo + "target = 0.2\nstiffness = 5.0\ndamping = 0.7\n")
    expected = 5.0 * (0.2 - y[5]) - 0.7 * y[7 + 4]
    assert apart(torques(made, y), [0, 0, 0, 0, expected, 0]) < 1e-14
    assert made.module.UNITS["s_stiffness"] == "N m/rad"


def test_powers_add_up() -> None:
    """dE/dt is the sum of the effects' powers, in 60 digits."""
    effects = SPRING + 'joints = "all"\n' + STOP
    effects += 'joints = "all"\nhigh = 0.2\nstiffness = 50.0\ndamping = 2.0\n'
    effects += '[[effects]]\ntype = "joint_friction"\nname = "f"\njoints = "all"\n'
    made = tree(effects + "viscous = 0.3\ncoulomb = 2.0\nspeed = 0.5\n")
    for seed in range(3):
        y = exact(made.random_state(np.random.default_rng(seed)))
        rates = made.exactly("derivative", y)
        kinetic = along(lambda x: made.exactly("kinetic_energy", x), y, rates)
        stored = along(lambda x: made.exactly("potential_energy", x), y, rates)
        powers = made.exactly("effect_powers", y)
        assert apart(kinetic, powers.sum(), MP.mpf(1)) < 1e-13
        assert apart(kinetic + stored, kinetic) > 1e-3


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (SPRING, "effects[0].joint: is missing; give one of joint, joints"),
        (SPRING + 'joint = "pin"\njoints = "all"\n',
         "effects[0].joint: is given in addition to 'joints'; give one of joint, joints"),
        (SPRING + 'joints = ["pin", "crass"]\n',
         "effects[0].joints[1]: no joint that moves is named 'crass' (did you mean 'cross'?)"),
        (SPRING + 'joints = ["pin", "pin"]\n',
         "effects[0].joints[1]: 'pin' is listed twice; leave one out"),
        (SPRING + 'joints = "all"\ncoordinate = "pin_angle"\n',
         "effects[0].coordinate: belongs to one joint; name that joint as joint"),
        (SPRING + 'joint = "ball"\nrest = 0.3\n',
         "effects[0].rest: at a ball joint ('ball') it is 0; leave it out"),
        (SPRING + 'joint = "cross"\ncoordinate = "cross_angle_3"\n',
         "effects[0].coordinate: 'cross' has no angle or slide 'cross_angle_3' "
         "(did you mean 'cross_angle_2'?)"),
        (STOP + 'joint = "ball"\nlow = -1\nhigh = 1\nstiffness = 1\n',
         "effects[0].low: the angle of a ball joint ('ball') is never below 0; give high"),
        (STOP + 'joints = "all"\nhigh = 1\nrestitution = 1\n',
         "effects[0].joints: a rigid stop acts on one joint; name it as joint"),
        (STOP + 'joint = "cross"\nhigh = 1\nrestitution = 1\n',
         "effects[0].coordinate: missing; a rigid stop acts on one coordinate, and 'cross' has "
         "cross_angle_1, cross_angle_2"),
        ('[[effects]]\ntype = "motor"\nname = "m"\njoint = "ball"\ntorque = 1\n',
         "effects[0].joint: 'ball' is a ball joint and has no angle"),
        ('[[effects]]\ntype = "motor"\nname = "m"\njoint = "cross"\ntorque = 1\n',
         "effects[0].coordinate: missing; 'cross' has cross_angle_1, cross_angle_2: give one"),
    ],
)  # fmt: skip
def test_bad_input_gets_one_clear_line(effect: str, message: str) -> None:
    """Place, value, remedy."""
    assert refusal(TREE + effect) == message
