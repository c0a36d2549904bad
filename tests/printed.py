"""Tables C.3 and C.4 as the thesis prints them, one row a line, and their polynomials summed term by term."""

import numpy as np

TABLE_C3 = """
1           0.00212  -0.06796  -0.02634
x1         -0.02320  -0.10941  -0.03436
x2         -0.20890   0.04725   0.45256
x3         -0.43083  -0.06914   0.00835
x1^2       -0.00259  -0.05835   0.02553
x2^2        0.48872  -0.65880  -1.31290
x3^2       -0.00415  -0.11985  -0.05532
x1 x2       0.07204  -0.25739   0.06790
x2 x3      -0.02750  -0.26834  -0.16404
x3 x1      -0.08772   0.02692   0.02287
x1^3        0.01992  -0.00736   0.02927
x2^3       -0.45961   0.63758   0.95406
x3^3        0.40799   0.08997  -0.00131
x1 x2^2    -0.10107   0.21069  -0.11028
x2 x1^2    -0.06576   0.04748   0.01487
x2 x3^2     0.05664   0.20406  -0.02730
x3 x2^2    -0.09269   0.18519   0.10911
x3 x1^2     0.01892   0.04934  -0.04097
x1 x3^2     0.01033   0.13527   0.07881
x1 x2 x3    0.15120  -0.33207  -0.27519
"""
"""Third degree."""

TABLE_C4 = """
1             0.00412  -0.06300   0.00892
x1           -0.02136  -0.00336  -0.03143
x2           -0.21785  -1.32520  -0.54392
x3           -0.54991   0.00048   0.01939
x1^2         -0.03285  -0.11116  -0.11861
x2^2          0.87718   5.36790   2.03150
x3^2         -0.00286   0.07983  -0.13326
x1 x2        -0.38369   0.08966   0.47638
x2 x3         0.48733  -0.11872  -0.35913
x3 x1        -0.16974   0.09029   0.13672
x1^3          0.01923  -0.10024   0.01495
x2^3         -1.82110  -7.53640  -2.44120
x3^3          0.71170  -0.03393  -0.01711
x1 x2^2       1.03580  -0.48634  -1.14260
x2 x1^2      -0.06899   0.07279   0.20511
x2 x3^2       0.01924   0.15943   0.01142
x3 x2^2      -1.58070  -0.45871   0.52431
x3 x1^2       0.07461   0.10419  -0.03870
x1 x3^2       0.04814  -0.09860   0.10985
x1 x2 x3      0.05565  -0.21270  -0.06686
x1^4          0.02884  -0.02951   0.11721
x2^4          1.10100   3.35300   0.90658
x3^4          0.03094  -0.45255   0.03809
x1^3 x2       0.24807   0.07722  -0.25744
x1^3 x3       0.05269  -0.07405  -0.26752
x2^3 x1      -0.72304   0.32683   0.67218
x2^3 x3       1.15170   0.39561  -0.31197
x3^3 x1       0.20145  -0.13273  -0.11735
x3^3 x2      -0.09466   0.15479   0.06806
x1^2 x2^2     0.12995   0.08606  -0.12606
x1^2 x3^2    -0.06983   0.19846   0.18106
x2^2 x3^2     0.09628   0.29711  -0.02546
x1^2 x2 x3   -0.57151  -0.07567   0.54032
x1 x2^2 x3   -0.24520  -0.05941  -0.06226
x1 x2 x3^3    0.03159   0.14051  -0.33556
"""
"""Fourth degree; its last row is misprinted."""

MISPRINTED, CORRECT = "x1 x2 x3^3", "x1 x2 x3^2"
"""The monomial of Table C.4's last row: as printed, and as a table of fourth degree must have it."""


def rows(table):
    """Powers of (x1, x2, x3), (nterm, 3), and coefficients of (f1, f2, f3), (nterm, 3)."""
    powers, coefficients = [], []
    for line in table.strip().splitlines():
        *term, c1, c2, c3 = line.split()
        exponent = dict.fromkeys(("x1", "x2", "x3"), 0)
        for factor in term:
            if factor != "1":
                name, _, power = factor.partition("^")
                exponent[name] += int(power or 1)
        powers.append(list(exponent.values()))
        coefficients.append([float(c) for c in (c1, c2, c3)])
    return np.array(powers), np.array(coefficients)


def polynomials(table, x1, x2, x3):
    """f1, f2, f3 = sum_k c_i^k T_k(x1, x2, x3) of Tables C.3 and C.4."""
    powers, coefficients = rows(table)
    terms = [x1**i * x2**j * x3**k for i, j, k in powers]
    return [sum(c * term for c, term in zip(column, terms, strict=True)) for column in coefficients.T]
