"""The benchmark bicycle of Meijaard, Papadopoulos, Ruina and Schwab, Proc. R. Soc. A 463 (2007)
1955-1982: its linearised equations by the formulas of the paper's appendix A, its table 2, and the
linearisation of the built-in scene `bicycle` on the manifold of its constraints.
"""

from collections.abc import Callable, Sequence
from typing import Any

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.loops import constraints
from eomgen.dynamics.loops.clusters import jacobian_of
from eomgen.model.model import Model
from eomgen.model.named import Values
from eomgen.scalars.duals import Dual, Duals
from eomgen.scalars.extended import MP, Digits
from eomgen.scalars.protocol import Scalars

SPEEDS = tuple(range(11))
"""Of table 2, m/s."""
WEAVE = (  # real and imaginary part; at v = 0 two real ones
    (3.13164324790656, 5.53094371765393),
    (3.52696170990070, 0.80774027519930),
    (2.68234517512745, 1.68066296590675),
    (1.70675605663975, 2.31582447384325),
    (0.41325331521125, 3.07910818603206),
    (-0.77534188219585, 4.46486771378823),
    (-1.52644486584142, 5.87673060598709),
    (-2.13875644258362, 7.19525913329805),
    (-2.69348683581097, 8.46037971396931),
    (-3.21675402252485, 9.69377351531791),
    (-3.72016840437287, 10.90681139476287),
)
CAPSIZE = (
    -3.13164324790656, -3.13423125066578, -3.07158645641514, -2.63366137253667, -1.42944427361326,
    -0.32286642900409, -0.00406690076970, 0.10268170574766, 0.14327879765713, 0.15790184030917,
    0.16105338653172,
)  # fmt: skip
CASTER = (
    -5.53094371765393, -7.11008014637442, -8.67387984831735, -10.35101467245920, -12.15861426576447,
    -14.07838969279822, -16.08537123098026, -18.15788466125262, -20.27940894394569,
    -22.43788559040858, -24.62459635017404,
)  # fmt: skip


def _row(v: int) -> list[complex]:
    a, b = WEAVE[v]
    weave = [complex(a), complex(b)] if v == 0 else [complex(a, b), complex(a, -b)]
    return [*weave, complex(CAPSIZE[v]), complex(CASTER[v])]


TABLE = {v: _row(v) for v in SPEEDS}
"""Eigenvalues by speed, 1/s: weave, capsize and caster, with the 14 decimals of the paper."""


PRINTED = {  # M, C1, K0 and K2 of the paper's section 5, in SI units
    "M": (("80.81722", "2.31941332208709"), ("2.31941332208709", "0.29784188199686")),
    "C1": (("0", "33.86641391492494"), ("-0.85035641456978", "1.68540397397560")),
    "K0": (("-80.95", "-2.59951685249872"), ("-2.59951685249872", "-0.80329488458618")),
    "K2": (("0", "76.59734589573222"), ("0", "2.65431523794604")),
}


def matrices() -> dict[str, Any]:
    """M, C1, K0 and K2 of lean and steer, in 60 digits."""
    m = MP.mpf
    w, c, tilt = m("1.02"), m("0.08"), MP.pi / 10
    r_R, m_R, R_xx, R_yy = m("0.3"), m(2), m("0.0603"), m("0.12")
    x_B, z_B, m_B, B_xx, B_xz, B_zz = m("0.3"), m("-0.9"), m(85), m("9.2"), m("2.4"), m("2.8")
    x_H, z_H, m_H = m("0.9"), m("-0.7"), m(4)
    H_xx, H_xz, H_zz = m("0.05892"), m("-0.00756"), m("0.00708")
    r_F, m_F, F_xx, F_yy = m("0.35"), m(3), m("0.1405"), m("0.28")
    sin, cos = MP.sin(tilt), MP.cos(tilt)
    m_T, m_A = m_R + m_B + m_H + m_F, m_H + m_F
    x_T = (x_B * m_B + x_H * m_H + w * m_F) / m_T
    z_T = (-r_R * m_R + z_B * m_B + z_H * m_H - r_F * m_F) / m_T
    T_xx = R_xx + B_xx + H_xx + F_xx
    T_xx += m_R * r_R**2 + m_B * z_B**2 + m_H * z_H**2 + m_F * r_F**2
    T_xz = B_xz + H_xz - m_B * x_B * z_B - m_H * x_H * z_H + m_F * w * r_F
    T_zz = R_xx + B_zz + H_zz + F_xx + m_B * x_B**2 + m_H * x_H**2 + m_F * w**2
    x_A, z_A = (x_H * m_H + w * m_F) / m_A, (z_H * m_H - r_F * m_F) / m_A
    A_xx = H_xx + F_xx + m_H * (z_H - z_A) ** 2 + m_F * (r_F + z_A) ** 2
    A_xz = H_xz - m_H * (x_H - x_A) * (z_H - z_A) + m_F * (w - x_A) * (r_F + z_A)
    A_zz = H_zz + F_xx + m_H * (x_H - x_A) ** 2 + m_F * (w - x_A) ** 2
    u = (x_A - w - c) * cos - z_A * sin
    A_ll = m_A * u**2 + A_xx * sin**2 + 2 * A_xz * sin * cos + A_zz * cos**2
    A_lx = -m_A * u * z_A + A_xx * sin + A_xz * cos
    A_lz = m_A * u * x_A + A_xz * sin + A_zz * cos
    mu = c / w * cos
    S_F = F_yy / r_F
    S_T = R_yy / r_R + S_F
    S_A = m_A * u + mu * m_T * x_T
    M = [[T_xx, A_lx + mu * T_xz], [A_lx + mu * T_xz, A_ll + 2 * mu * A_lz + mu**2 * T_zz]]
    off = mu * S_T + S_F * cos
    C1 = [
        [m(0), off + T_xz / w * cos - mu * m_T * z_T],
        [-off, A_lz / w * cos + mu * (S_A + T_zz / w * cos)],
    ]
    K0 = [[m_T * z_T, -S_A], [-S_A, -S_A * sin]]
    K2 = [[m(0), (S_T - m_T * z_T) / w * cos], [m(0), (S_A + S_F * sin) / w * cos]]
    return dict(zip(PRINTED, map(MP.matrix, (M, C1, K0, K2)), strict=True))


def appendix(speed: float) -> Any:
    """The matrix (4, 4) of lean, steer and their rates, in 60 digits; steer is positive to the
    left, as in the scene.
    """
    m, g, v = MP.mpf, MP.mpf("9.81"), MP.mpf(speed)
    M, C1, K0, K2 = matrices().values()
    signs = MP.matrix([[1, -1], [-1, 1]])
    matrix = MP.matrix(4, 4)
    matrix[0, 2] = matrix[1, 3] = m(1)
    for part, first in ((g * K0 + v * v * K2, 0), (v * C1, 2)):
        block = -(M**-1) * part
        for i in range(2):
            for j in range(2):
                matrix[2 + i, first + j] = signs[i, j] * block[i, j]
    return matrix


def solved(matrix: Sequence[Sequence[Any]], right: Sequence[Any]) -> list[Any]:
    """x with A x = b, by elimination with row pivots."""
    work = [[*row, b] for row, b in zip(matrix, right, strict=True)]
    n = len(work)
    for k in range(n):
        best = max(range(k, n), key=lambda i: abs(work[i][k]))
        work[k], work[best] = work[best], work[k]
        for i in range(n):
            if i != k:
                factor = work[i][k] / work[k][k]
                work[i] = [a - factor * b for a, b in zip(work[i], work[k], strict=True)]
    return [row[n] / row[k] for k, row in enumerate(work)]


class Upright:
    """The bicycle that runs straight and upright, over any scalars made by `number`."""

    def __init__(
        self, model: Model, speed: Any, scalars: Scalars, number: Callable[[str], Any]
    ) -> None:
        self.model, self.duals, self.zero = model, Duals(scalars), number("0")
        p = {p.name: number(repr(p.default)) for p in model.parameters}
        if scalars.__class__ is Digits:
            p["tilt"] = MP.pi / 10
        self.parameters = {name: self.duals.still(x) for name, x in p.items()}
        names = [c.name for c in model.velocities]
        self.q = [p["r_R"] if c.name == "z" else self.zero for c in model.coordinates]
        rates = {
            "x_dot": speed,
            "rear_roll_dot": speed / p["r_R"],
            "front_roll_dot": speed / p["r_F"],
        }
        self.v = [rates.get(name, self.zero) for name in names]
        self.independent = [names.index(n) for n in ("lean_dot", "steer_dot", "rear_roll_dot")]
        self.still = [self.zero] * len(names)
        d = self.along(self.still, self.still)
        self.J = [[x.value for x in row] for row in jacobian_of(d)]
        self.dependent = [j for j in range(len(names)) if j not in self.independent]

    def along(self, dq: Sequence[Any], dv: Sequence[Any]) -> Dynamics:
        """The mechanism as dual numbers along a direction of the state."""
        q, v = (
            [Dual(x, dx) for x, dx in zip(*pair, strict=True)]
            for pair in ((self.q, dq), (self.v, dv))
        )
        time = self.duals.still(self.zero)
        return Dynamics(self.model, Values(self.parameters, {}, q, v, {}, time), self.duals)

    def filled(self, moved: int | None, rates: Sequence[Any]) -> list[Any]:
        """Velocities with J v = `rates` of which one independent one is 1, the others 0."""
        found = list(self.still)
        right = list(rates)
        if moved is not None:
            j = self.independent[moved]
            found[j] = self.zero + 1
            right = [b - row[j] for b, row in zip(right, self.J, strict=True)]
        square = [[row[j] for j in self.dependent] for row in self.J]
        for j, x in zip(self.dependent, solved(square, right), strict=True):
            found[j] = x
        return found

    def tangents(self) -> list[tuple[list[Any], list[Any]]]:
        """Directions (δq, δv) along the manifold in which lean, steer, or the rate of one is 1."""
        none = [self.zero] * len(self.J)
        found = []
        for k in range(2):
            dq = self.filled(k, none)
            changed = constraints.rates(self.along(dq, self.still))
            found.append((dq, self.filled(None, [-x.rate for x in changed])))
        return found + [(list(self.still), self.filled(k, none)) for k in range(2)]


def tangents(
    model: Model, speed: Any, scalars: Scalars, number: Callable[[str], Any]
) -> tuple[list[Any], list[list[Any]]]:
    """The upright state, and the tangents as directions of it."""
    bicycle = Upright(model, speed, scalars, number)
    return [*bicycle.q, *bicycle.v], [[*dq, *dv] for dq, dv in bicycle.tangents()]


def linearised(model: Model, speed: float) -> Any:
    """The matrix (4, 4) of lean, steer and their rates, in 60 digits, of the equations themselves:
    each column is the change of the accelerations along a tangent.
    """
    bicycle = Upright(model, MP.mpf(speed), Digits(), MP.mpf)
    matrix, (lean, steer) = MP.matrix(4, 4), bicycle.independent[:2]
    for k, (dq, dv) in enumerate(bicycle.tangents()):
        found = bicycle.along(dq, dv).forward("aba")(None)
        rows = (dv[lean], dv[steer], found[lean].rate, found[steer].rate)
        for i, x in enumerate(rows):
            matrix[i, k] = x
    return matrix
