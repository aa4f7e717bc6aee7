"""Sine and cosine of arrays by sums and products alone, with the same bits on every machine.

`templates/c/sine.c.jinja` has the same operations for lanes of vector registers. Their errors are
below 1 ulp.
"""

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NEAR = 32768.0
"""Up to here an angle is reduced in three parts, from there on by integers."""
PARTS = tuple(
    map(float.fromhex, ("0x1.921fb5444p+0", "0x1.68c234c4cp-39", "0x1.98a2e03707345p-77"))
)
"""pi/2 in parts, of which the first two have 38 and 37 bits: with a number of quarters their
products are exact (W. Cody, W. Waite, Software Manual for the Elementary Functions, 1980)."""
SHIFT = 1.5 * 2.0**52
"""A number of this size has whole numbers as its last bits."""
BITS, WORD = 21 * 64, 2**64 - 1


def sine(x: Any) -> FloatArray:
    """The sine of angles, rad, of any shape; nan where they are not finite."""
    return _of_quarter(x, 0)


def cosine(x: Any) -> FloatArray:
    """The cosine of angles, rad, of any shape; nan where they are not finite."""
    return _of_quarter(x, 1)


def _of_quarter(x: Any, more: int) -> FloatArray:
    """The sine of angles and `more` quarter turns."""
    x = np.asarray(x, dtype=np.float64)
    with np.errstate(under="ignore"):
        quarters, r, rest = _reduced(x.ravel())
        s, k = _polynomials(r, rest)
    quarters = quarters + more
    found = np.where(quarters & 1, k, s)
    return np.where(quarters & 2, -found, found).reshape(x.shape)


def _reduced(x: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Numbers of quarter turns (n,), modulo 4, of angles (n,), and what is left, at most pi/4, as
    the sum of two numbers.
    """
    large = ~(np.abs(x) <= NEAR)
    near = np.where(large, 0.0, x)
    shifted = near * float.fromhex("0x1.45f306dc9c883p-1") + SHIFT
    n = shifted - SHIFT
    a = near - n * PARTS[0]
    c = a - n * PARTS[1]
    w = n * PARTS[2] + (n * PARTS[1] + (c - a))
    r = c - w
    rest = (c - r) - w
    quarters = shifted.view(np.int64)
    for i in np.flatnonzero(large):
        quarters[i], r[i], rest[i] = _far(float(x[i]))
    return quarters, r, rest


def _polynomials(r: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The sine and the cosine of r + rest by the polynomials of fdlibm (Sun Microsystems, 1993)."""
    z = r * r
    zz, v, half = z * z, z * r, 0.5 * z
    one = 1.0 - half
    p = (z * zz) * (z * 1.58969099521155010221e-10 + -2.50507602534068634195e-08) + (
        z * (z * 2.75573137070700676789e-06 + -1.98412698298579493134e-04)
        + 8.33333333332248946124e-03
    )
    s = r - (v * 1.66666666666666324348e-01 + (z * (-v * p + 0.5 * rest) + -rest))
    q = (zz * zz) * (
        z * (z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09)
        + -2.75573143513906633035e-07
    ) + z * (
        z * (z * 2.48015872894767294178e-05 + -1.38888888888741095749e-03)
        + 4.16666666666666019037e-02
    )
    k = one + (((1.0 - one) - half) + (z * q + -(r * rest)))
    return s, k


@cache
def _two_over_pi() -> int:
    """2/pi: its first 1280 bits, after 64 zeros."""
    import mpmath

    with mpmath.workprec(1400):
        return int(mpmath.floor(2 / mpmath.pi * mpmath.mpf(2) ** (BITS - 64)))


def _bits(first: int) -> int:
    """64 bits of 2/pi from a bit on."""
    return (_two_over_pi() >> (BITS - 64 - first)) & WORD


def _far(x: float) -> tuple[int, float, float]:
    """The same for a number of at least 1 (M. Payne, R. Hanek, Radian reduction for trigonometric
    functions, SIGNUM 18, 1983), with 192 bits of 2/pi.
    """
    if not math.isfinite(x):
        return 0, math.nan, math.nan
    fraction, exponent = math.frexp(abs(x))
    m, first = int(math.ldexp(fraction, 53)), exponent - 53 + 62
    product = (_bits(first) << 128 | _bits(first + 64) << 64 | _bits(first + 128)) * m
    product &= 2**192 - 1
    quarters, rest = product >> 190, (product >> 62) & (2**128 - 1)
    above = rest >> 127
    if above:
        rest, quarters = (-rest) & (2**128 - 1), quarters + 1
    shift = 128 - rest.bit_length()
    angle = (rest << shift >> 64) * 0xC90FDAA22168C234  # pi/2 * 2^63
    sign = 1.0 if (x < 0) == bool(above) else -1.0
    high = sign * math.ldexp(float(angle >> 75), -52 - shift)
    low = sign * math.ldexp(float((angle >> 22) & (2**53 - 1)), -105 - shift)
    return -quarters if x < 0 else quarters, high, low
