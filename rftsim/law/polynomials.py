"""Polynomials in x1, x2, x3 by Horner's scheme, coefficients in the order of the rows of the tables."""

from typing import Any

from rftsim.machine.kernel import kernel


@kernel
def cubic(c: Any, x1: Any, x2: Any, x3: Any) -> Any:
    """A cubic, coefficients in the order of the rows of [Agarwal] Table C.3."""
    return (
        c[0]
        + x1 * (c[1] + x1 * (c[4] + x1 * c[10] + x2 * c[14] + x3 * c[17]) + x2 * (c[7] + x2 * c[13] + x3 * c[19]))
        + x2 * (c[2] + x2 * (c[5] + x2 * c[11] + x3 * c[16]) + x3 * (c[8] + x3 * c[15]))
        + x3 * (c[3] + x1 * c[9] + x3 * (c[6] + x3 * c[12] + x1 * c[18]))
    )


@kernel
def quartic(c: Any, x1: Any, x2: Any, x3: Any) -> Any:
    """A quartic, in the order of [Agarwal] Table C.4: Table C.3's monomials first, then those of fourth degree."""
    y1, y2, y3 = x1 * x1, x2 * x2, x3 * x3
    return (
        cubic(c, x1, x2, x3)
        + y1 * (c[20] * y1 + c[29] * y2 + c[30] * y3 + c[32] * x2 * x3)
        + y2 * (c[21] * y2 + c[31] * y3 + c[33] * x1 * x3)
        + y3 * (c[22] * y3 + c[34] * x1 * x2)
        + x1 * (y1 * (c[23] * x2 + c[24] * x3) + c[25] * y2 * x2 + c[27] * y3 * x3)
        + x2 * x3 * (c[26] * y2 + c[28] * y3)
    )
