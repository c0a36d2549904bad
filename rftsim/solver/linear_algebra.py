"""Vectors of compiled code: loops beat a library's overhead at these sizes."""

from rftsim.machine.compiling import exact, fast


@exact
def copy(x, out):
    """Fill out with the numbers of x."""
    for i in range(out.size):
        out[i] = x[i]


@exact
def clear(x):
    """Fill a vector with zeros, in place."""
    for i in range(x.size):
        x[i] = 0.0


@fast
def dot(x, y):
    """The scalar product of two vectors x and y."""
    out = 0.0
    for i in range(x.size):
        out += x[i] * y[i]
    return out


@fast
def multiply(a, x, out):
    """Fill out with the product A x of a small matrix."""
    for i in range(a.shape[0]):
        total = 0.0
        for k in range(a.shape[1]):
            total += a[i, k] * x[k]
        out[i] = total


@exact
def copy_matrix(a, out):
    """Fill the matrix out with the numbers of a small one."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            out[i, k] = a[i, k]
