"""Elementary functions of arrays, with the same bits on every machine.

The sines of NumPy are those of the processor or the C library, which differ in the last digit. Those here consist of
sums, products, quotients and square roots, which IEEE 754 rounds the same everywhere. The coefficients are those of
FDLIBM (Sun Microsystems, 1993) and of Taylor series; errors are below 1e-15 of the result.
"""

from collections.abc import Sequence
from math import factorial, pi

import numpy as np

from gamms.ir.graph import FloatArray

_HALF_PI = (1.57079632673412561417, 6.07710050650619224932e-11)  # the first 33 bits, whose multiples are exact
_LOG_2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
_TAN_PI_8 = 0.41421356237309503
_ROOT_HALF = 0.7071067811865476
_SINE = (
    *(-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04),
    *(2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10),
)
_COSINE = (
    *(4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05),
    *(-2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11),
)
_ARCTANGENT = (
    *(3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01),
    *(-1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02),
    *(6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02),
    *(-3.65315727442169155270e-02, 1.62858201153657823623e-02),
)
_LOGARITHM = (
    *(6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01),
    *(1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01),
)
_HYPERBOLIC_SINE = tuple(1.0 / factorial(power) for power in range(1, 25, 2))
_HYPERBOLIC_ARCTANGENT = tuple(1.0 / power for power in range(1, 21, 2))


def polynomial(coefficients: Sequence[float], x: FloatArray) -> FloatArray:
    """Return the sum of the coefficients times the powers of `x` from 0 on."""
    total = np.full_like(x, coefficients[-1])
    for one in coefficients[-2::-1]:
        total = total * x + one
    return total


def length(x: FloatArray | float, y: FloatArray) -> FloatArray:
    """Return the lengths of vectors."""
    return np.asarray(np.sqrt(x * x + y * y))


def sine_cosine(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the sines and cosines of angles of a few turns at most, radians."""
    quarters = np.rint(angle * (2.0 / pi))
    rest = angle - quarters * _HALF_PI[0] - quarters * _HALF_PI[1]
    square = rest * rest
    sine = rest + rest * square * polynomial(_SINE, square)
    cosine = 1.0 - (0.5 * square - square * square * polynomial(_COSINE, square))
    quadrant = quarters % 4.0
    is_across = quarters % 2.0 == 1.0
    upright = np.where(is_across, cosine, sine)
    level = np.where(is_across, sine, cosine)
    return np.where(quadrant >= 2.0, -upright, upright), np.where(np.abs(quadrant - 1.5) < 1.0, -level, level)


def polar_angle(y: FloatArray, x: FloatArray) -> FloatArray:
    """Return the angles of vectors from the x axis, as `numpy.arctan2`."""
    across = np.abs(x)
    up = np.abs(y)
    larger = np.maximum(across, up)
    slope = np.divide(np.minimum(across, up), larger, out=np.zeros_like(larger), where=larger != 0.0)
    is_wide = slope > _TAN_PI_8
    tangent = np.where(is_wide, (slope - 1.0) / (slope + 1.0), slope)
    square = tangent * tangent
    angle = tangent - tangent * square * polynomial(_ARCTANGENT, square)
    angle = np.where(is_wide, angle + pi / 4.0, angle)
    angle = np.where(up > across, pi / 2.0 - angle, angle)
    angle = np.where(x < 0.0, pi - angle, angle)
    return np.asarray(np.copysign(angle, y))


def hyperbolic_sine(x: FloatArray) -> FloatArray:
    """Return hyperbolic sines of numbers from -2 to 2."""
    return x * polynomial(_HYPERBOLIC_SINE, x * x)


def inverse_hyperbolic_sine(x: FloatArray) -> FloatArray:
    """Return the numbers with these hyperbolic sines."""
    size = np.abs(x)
    excess = size + size * size / (1.0 + np.sqrt(1.0 + size * size))
    whole = 1.0 + excess
    lost = np.divide(excess, whole - 1.0, out=np.ones_like(excess), where=whole != 1.0)  # by rounding
    logarithm = np.where(whole == 1.0, excess, _logarithm(whole) * lost)
    return np.asarray(np.copysign(logarithm, x))


def inverse_hyperbolic_tangent(x: FloatArray) -> FloatArray:
    """Return the numbers with these hyperbolic tangents, from -0.1 to 0.1."""
    return x * polynomial(_HYPERBOLIC_ARCTANGENT, x * x)


def _logarithm(x: FloatArray) -> FloatArray:
    mantissa, exponent = np.frexp(x)
    is_low = mantissa < _ROOT_HALF
    twos = exponent - np.where(is_low, 1.0, 0.0)
    above = np.where(is_low, 2.0 * mantissa, mantissa) - 1.0
    share = above / (2.0 + above)
    square = share * share
    half = 0.5 * above * above
    rest = share * (half + square * polynomial(_LOGARITHM, square)) + twos * _LOG_2[1]
    return np.asarray(twos * _LOG_2[0] - ((half - rest) - above))
