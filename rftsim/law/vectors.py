"""Vectors of three numbers, as tuples."""

from typing import Any

from rftsim.machine.kernel import exact_kernel, kernel


@kernel
def dot(a: Any, b: Any) -> Any:
    """The scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Any, b: Any) -> Any:
    """The vector product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@exact_kernel
def to_world(xmat: Any, x: Any, y: Any, z: Any) -> Any:
    """Rotate a vector from the body to the world frame; xmat is row-major, shape (9,)."""
    return (
        xmat[0] * x + xmat[1] * y + xmat[2] * z,
        xmat[3] * x + xmat[4] * y + xmat[5] * z,
        xmat[6] * x + xmat[7] * y + xmat[8] * z,
    )


@exact_kernel
def to_body(xmat: Any, x: Any, y: Any, z: Any) -> Any:
    """Rotate a vector from the world to the body frame; xmat is row-major, shape (9,)."""
    return (
        xmat[0] * x + xmat[3] * y + xmat[6] * z,
        xmat[1] * x + xmat[4] * y + xmat[7] * z,
        xmat[2] * x + xmat[5] * y + xmat[8] * z,
    )


@kernel
def larger(x: Any, y: Any) -> Any:
    """The larger of two numbers; x where x is no number. One instruction, which the built-in max is not."""
    return y if x < y else x


@kernel
def smaller(x: Any, y: Any) -> Any:
    """The smaller of two numbers; x where x is no number."""
    return y if x > y else x


@exact_kernel
def nine(matrix: Any) -> Any:
    """The nine numbers of a matrix, row by row, as a tuple."""
    return (
        matrix[0], matrix[1], matrix[2], matrix[3], matrix[4], matrix[5], matrix[6], matrix[7], matrix[8]
    )  # fmt: skip
