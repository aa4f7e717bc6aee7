"""States of a robot in the program that reads its file too: the order and the frames of numbers.

A scene has its coordinates in the order of the file, and so has MuJoCo. Pinocchio takes the joints
of a URDF depth first, those of one link by name. Free bodies are at their centres of mass in a
scene, and at their origins in both programs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from eomgen.scene.importers.vectors import ORIGIN, Vector

Frame = Literal[
    "same",
    "quaternion",
    "origin in the world",
    "origin in the body",
    "cosine and sine",
    "plane in the body",
]
"""What another program's numbers of a joint are:

same                 those of the scene
quaternion           those of the scene, with a quaternion last
origin in the world  place and velocity of a body's origin in the world's axes; quaternion and
                     angular velocity as in the scene
origin in the body   place of a body's origin in its parent's axes, quaternion x, y, z, w;
                     velocities of the origin and of rotation in the body's axes
cosine and sine      in place of an angle
plane in the body    x, y, cosine and sine of the angle; velocities in the turned axes
"""


def suffixed(prefix: str, text: str) -> tuple[str, ...]:
    """The names `<prefix>_<part>` for the words of a text."""
    return tuple(f"{prefix}_{part}" for part in text.split())


@dataclass(frozen=True)
class JointStates:
    """The numbers of a joint in a scene, and how another program has them.

    positions   names of its coordinates in the scene
    velocities  names of its velocities there
    frame       what the other program's numbers are
    body        the body of a free joint whose coordinates in the scene are those of its centre of
                mass, else ""
    com         this centre in the body's axes, m
    """

    positions: tuple[str, ...]
    velocities: tuple[str, ...]
    frame: Frame = "same"
    body: str = ""
    com: Vector = ORIGIN

    @staticmethod
    def single(name: str, frame: Frame = "same") -> "JointStates":
        """Those of a joint with one coordinate, of that name."""
        return JointStates((name,), (f"{name}_dot",), frame)

    @staticmethod
    def free(
        point: str, turn: str, frame: Frame, body: str = "", com: Vector = ORIGIN
    ) -> "JointStates":
        """Those of a joint that moves freely, by the beginnings of the names of its translation
        and of its rotation.
        """
        places, speeds = suffixed(point, "x y z"), suffixed(point, "x_dot y_dot z_dot")
        turns, spins = suffixed(turn, "qw qx qy qz"), suffixed(turn, "wx wy wz")
        return JointStates((*places, *turns), (*speeds, *spins), frame, body, com)

    @property
    def nq(self) -> int:
        """The number of coordinates in the other program."""
        return len(self.positions) + (self.frame in ("cosine and sine", "plane in the body"))


@dataclass(frozen=True)
class Convention:
    """The numbers of a robot in another program.

    program     its name
    joints      all joints that move, in its order
    positions   names of the scene's coordinates in their order, but for those that are held
    velocities  the same of its velocities
    held        values of coordinates that are held, rad or m
    obstacle    why the other program's robot moves otherwise; "" if it does not
    """

    program: str
    joints: tuple[JointStates, ...]
    positions: tuple[str, ...]
    velocities: tuple[str, ...]
    held: Mapping[str, float]
    obstacle: str = ""


def convention(
    program: str,
    joints: Sequence[JointStates],
    held: Mapping[str, float],
    order: Sequence[JointStates] | None = None,
    obstacle: str = "",
) -> Convention:
    """The convention of joints in the scene's order and, if that differs, in the program's."""
    moving = [joint for joint in joints if not held.keys() & {*joint.positions}]
    return Convention(
        program,
        tuple(joints if order is None else order),
        tuple(name for joint in moving for name in joint.positions),
        tuple(name for joint in moving for name in joint.velocities),
        dict(held),
        obstacle,
    )
