"""Sine, cosine, exponential, logarithm and hyperbolic tangent with the same bits on all systems.

Each system's C library rounds these its own way, from one release to the next, and numpy's differ
with the processor. So the plant has its own, made of operations that IEEE 754 defines to the last
bit. The results are within two and a half units in the last place of the exact ones, those of
`turned`, `exp` and `log` within one.

The series are Taylor's, with as many terms as the reduced argument needs.
"""

from __future__ import annotations

import math

import numpy as np

from hexatorque.plant.compiled import compiled

#: pi/2 in three parts. The first two have 33 bits: their products with up to 20 bits are exact.
HALF_PI_1 = float.fromhex("0x1.921fb544p+0")
HALF_PI_2 = float.fromhex("0x1.0b4611a6p-34")
HALF_PI_3 = float.fromhex("0x1.3198a2e037073p-69")
#: ln 2 in two parts. The first has 32 bits: its product with any exponent is exact.
LN_2_1 = float.fromhex("0x1.62e42feep-1")
LN_2_2 = float.fromhex("0x1.a39ef35793c76p-33")

SIN_1, SIN_2, SIN_3, SIN_4 = (1 / math.factorial(n) for n in (3, 5, 7, 9))
SIN_5, SIN_6, SIN_7, SIN_8 = (1 / math.factorial(n) for n in (11, 13, 15, 17))
COS_2, COS_3, COS_4, COS_5 = (1 / math.factorial(n) for n in (4, 6, 8, 10))
COS_6, COS_7, COS_8 = (1 / math.factorial(n) for n in (12, 14, 16))
EXP_3, EXP_4, EXP_5, EXP_6, EXP_7 = (1 / math.factorial(n) for n in (3, 4, 5, 6, 7))
EXP_8, EXP_9, EXP_10, EXP_11, EXP_12, EXP_13 = (1 / math.factorial(n) for n in range(8, 14))


@compiled
def turned(angle):
    """exp(j angle), complex; angle in rad, up to 1.6e6 with full precision."""
    k = np.floor(angle * (2.0 / np.pi) + 0.5)
    first = angle - k * HALF_PI_1
    second = k * HALF_PI_2
    near = first - second
    low = k * HALF_PI_3 - ((first - near) - second)
    x = near - low  # |x| <= pi/4, and the sine and cosine are those of x + tail
    tail = (near - x) - low
    z = x * x
    half = 0.5 * z
    w = z * z
    even = SIN_1 + w * (SIN_3 + w * (SIN_5 + w * SIN_7))
    odd = SIN_2 + w * (SIN_4 + w * (SIN_6 + w * SIN_8))
    s = x - (x * (z * even - w * odd) - tail * (1.0 - half))
    even = COS_2 + w * (COS_4 + w * (COS_6 + w * COS_8))
    odd = COS_3 + w * (COS_5 + w * COS_7)
    rest = w * (even - z * odd)
    most = 1.0 - half
    c = most + (((1.0 - most) - half) + (rest - x * tail))
    quarter = np.int64(k) & 3
    if quarter == 0:
        return complex(c, s)
    if quarter == 1:
        return complex(-s, c)
    if quarter == 2:
        return complex(-c, -s)
    return complex(s, -c)


@compiled
def cos(angle):
    return turned(angle).real


@compiled
def sin(angle):
    return turned(angle).imag


@compiled(inline="always")
def _expm1_of_part(x, tail):
    """exp(x + tail) - 1 for |x| <= ln(2)/2."""
    z = x * x
    odd = EXP_3 + z * (EXP_5 + z * (EXP_7 + z * (EXP_9 + z * (EXP_11 + z * EXP_13))))
    even = EXP_4 + z * (EXP_6 + z * (EXP_8 + z * (EXP_10 + z * EXP_12)))
    return x + (0.5 * z + (z * x * (odd + x * even) + (tail + x * tail)))


@compiled
def _power_of_2(k):
    """2^k, exactly; k from -1022 to 1023."""
    factor = 2.0 if k >= 0 else 0.5
    left = abs(k)
    product = 1.0
    while left > 0:
        if left & 1 == 1:
            product *= factor
        factor *= factor
        left >>= 1
    return product


@compiled
def expm1(x):
    """exp(x) - 1."""
    if x > 709.0:
        return np.inf
    if x < -708.0:
        return -1.0
    k = np.floor(x * (1.0 / LN_2_1) + 0.5)
    near = x - k * LN_2_1
    low = k * LN_2_2
    part = near - low
    less = _expm1_of_part(part, (near - part) - low)
    if k == 0.0:
        return less
    scale = _power_of_2(np.int64(k))
    return scale * (1.0 + less) if k > 60.0 else (scale - 1.0) + scale * less


@compiled
def exp(x):
    """exp(x); 0 below -708, where numbers lose their precision."""
    if x > 709.0:
        return np.inf
    if x < -708.0:
        return 0.0
    k = np.floor(x * (1.0 / LN_2_1) + 0.5)
    near = x - k * LN_2_1
    low = k * LN_2_2
    part = near - low
    return _power_of_2(np.int64(k)) * (1.0 + _expm1_of_part(part, (near - part) - low))


@compiled
def log(x):
    """The natural logarithm of a positive number."""
    k = 0.0
    while x > math.sqrt(2.0):
        x *= 0.5
        k += 1.0
    while x < math.sqrt(0.5):
        x *= 2.0
        k -= 1.0
    # log x = 2 artanh s. The size of s is below 0.1716.
    f = x - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    odd = 1 / 3 + w * (1 / 7 + w * (1 / 11 + w * (1 / 15 + w * (1 / 19))))
    even = 1 / 5 + w * (1 / 9 + w * (1 / 13 + w * (1 / 17 + w * (1 / 21))))
    rest = z * (odd + z * even)
    half = 0.5 * f * f
    # 2 s is f less half, and s half more: in this way the result is exact for small f.
    return k * LN_2_1 - ((half - (s * (half + 2.0 * rest) + k * LN_2_2)) - f)


@compiled
def tanh(x):
    """The hyperbolic tangent."""
    size = abs(x)
    if size > 20.0:
        return np.copysign(1.0, x)
    if size > 1.0:
        return np.copysign(1.0 - 2.0 / (expm1(2.0 * size) + 2.0), x)
    less = expm1(-2.0 * size)
    return np.copysign(-less / (2.0 + less), x)
