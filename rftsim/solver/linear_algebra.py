"""Small dense linear algebra for compiled code: loops beat LAPACK's overhead at these sizes and need no library."""

from rftsim.machine.compiling import exact, fast


@exact
def copy(x, out):
    """Fill out with the numbers of x."""
    for i in range(out.size):
        out[i] = x[i]


@fast
def dot(x, y):
    """The scalar product of two vectors x and y."""
    out = 0.0
    for i in range(x.size):
        out += x[i] * y[i]
    return out


@fast
def multiply(a, x, out):
    """Fill out with the product A x."""
    for i in range(a.shape[0]):
        total = 0.0
        for k in range(a.shape[1]):
            total += a[i, k] * x[k]
        out[i] = total


@fast
def add_transposed(a, x, share, out):
    """Add a share of the product A' x to out."""
    for i in range(a.shape[0]):
        y = share * x[i]
        if y != 0.0:
            for k in range(a.shape[1]):
                out[k] += a[i, k] * y


@exact
def add_outer(a, left, right, share):
    """Add a share of the outer product of two vectors to a matrix."""
    for i in range(left.size):
        y = share * left[i]
        if y != 0.0:
            for k in range(right.size):
                a[i, k] += y * right[k]


@fast
def factor(a, order):
    """LU factors of a square matrix, in place, by partial pivoting; `order` is filled with that of its rows."""
    n = a.shape[0]
    for k in range(n):
        order[k] = k
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            order[k], order[pivot] = order[pivot], order[k]
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        if a[k, k] == 0.0:
            a[k, k] = 1e-300
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            share = a[i, k] * inverse
            a[i, k] = share
            if share != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= share * a[k, j]


@fast
def substitute(lu, order, b, out):
    """Fill out with the solution of A x = b from the factors of A; b and out differ."""
    n = lu.shape[0]
    for i in range(n):
        total = b[order[i]]
        for j in range(i):
            total -= lu[i, j] * out[j]
        out[i] = total
    for i in range(n - 1, -1, -1):
        total = out[i]
        for j in range(i + 1, n):
            total -= lu[i, j] * out[j]
        out[i] = total / lu[i, i]


@exact
def copy_matrix(a, out):
    """Fill the matrix out with the numbers of A."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            out[i, k] = a[i, k]


@exact
def factor_of(a, lu, order):
    """Fill lu and order with the factors of A, which stays."""
    copy_matrix(a, lu)
    factor(lu, order)
