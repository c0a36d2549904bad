"""Published coefficients, as printed, with the few corrections said beside them.

Sources: [Agarwal] the 2D table 3.1 and the 3D tables C.3 and C.4.
"""

from typing import Final

TABLE_3_1: Final = {
    "A00": 0.206,
    "A10": 0.169,
    "B11": 0.212,
    "B01": 0.358,
    "Bm11": 0.055,
    "C11": -0.124,
    "C01": 0.253,
    "Cm11": 0.007,
    "D10": 0.088,
}
"""Generic 2D-RFT response, [Agarwal] Table 3.1: Fourier coefficients of eqs. (3.3) and (3.4)."""

Term = tuple[tuple[int, int, int], tuple[float, float, float]]

TABLE_C3: Final[tuple[Term, ...]] = (
    ((0, 0, 0), (0.00212, -0.06796, -0.02634)),
    ((1, 0, 0), (-0.0232, -0.10941, -0.03436)),
    ((0, 1, 0), (-0.2089, 0.04725, 0.45256)),
    ((0, 0, 1), (-0.43083, -0.06914, 0.00835)),
    ((2, 0, 0), (-0.00259, -0.05835, 0.02553)),
    ((0, 2, 0), (0.48872, -0.6588, -1.3129)),
    ((0, 0, 2), (-0.00415, -0.11985, -0.05532)),
    ((1, 1, 0), (0.07204, -0.25739, 0.0679)),
    ((0, 1, 1), (-0.0275, -0.26834, -0.16404)),
    ((1, 0, 1), (-0.08772, 0.02692, 0.02287)),
    ((3, 0, 0), (0.01992, -0.00736, 0.02927)),
    ((0, 3, 0), (-0.45961, 0.63758, 0.95406)),
    ((0, 0, 3), (0.40799, 0.08997, -0.00131)),
    ((1, 2, 0), (-0.10107, 0.21069, -0.11028)),
    ((2, 1, 0), (-0.06576, 0.04748, 0.01487)),
    ((0, 1, 2), (0.05664, 0.20406, -0.0273)),
    ((0, 2, 1), (-0.09269, 0.18519, 0.10911)),
    ((2, 0, 1), (0.01892, 0.04934, -0.04097)),
    ((1, 0, 2), (0.01033, 0.13527, 0.07881)),
    ((1, 1, 1), (0.1512, -0.33207, -0.27519)),
)
"""[Agarwal] Table C.3: powers of (x1, x2, x3) and coefficients of (f1, f2, f3), third degree."""

TABLE_C4: Final[tuple[Term, ...]] = (
    ((0, 0, 0), (0.00412, -0.063, 0.00892)),
    ((1, 0, 0), (-0.02136, -0.00336, -0.03143)),
    ((0, 1, 0), (-0.21785, -1.3252, -0.54392)),
    ((0, 0, 1), (-0.54991, 0.00048, 0.01939)),
    ((2, 0, 0), (-0.03285, -0.11116, -0.11861)),
    ((0, 2, 0), (0.87718, 5.3679, 2.0315)),
    ((0, 0, 2), (-0.00286, 0.07983, -0.13326)),
    ((1, 1, 0), (-0.38369, 0.08966, 0.47638)),
    ((0, 1, 1), (0.48733, -0.11872, -0.35913)),
    ((1, 0, 1), (-0.16974, 0.09029, 0.13672)),
    ((3, 0, 0), (0.01923, -0.10024, 0.01495)),
    ((0, 3, 0), (-1.8211, -7.5364, -2.4412)),
    ((0, 0, 3), (0.7117, -0.03393, -0.01711)),
    ((1, 2, 0), (1.0358, -0.48634, -1.1426)),
    ((2, 1, 0), (-0.06899, 0.07279, 0.20511)),
    ((0, 1, 2), (0.01924, 0.15943, 0.01142)),
    ((0, 2, 1), (-1.5807, -0.45871, 0.52431)),
    ((2, 0, 1), (0.07461, 0.10419, -0.0387)),
    ((1, 0, 2), (0.04814, -0.0986, 0.10985)),
    ((1, 1, 1), (0.05565, -0.2127, -0.06686)),
    ((4, 0, 0), (0.02884, -0.02951, 0.11721)),
    ((0, 4, 0), (1.101, 3.353, 0.90658)),
    ((0, 0, 4), (0.03094, -0.45255, 0.03809)),
    ((3, 1, 0), (0.24807, 0.07722, -0.25744)),
    ((3, 0, 1), (0.05269, -0.07405, -0.26752)),
    ((1, 3, 0), (-0.72304, 0.32683, 0.67218)),
    ((0, 3, 1), (1.1517, 0.39561, -0.31197)),
    ((1, 0, 3), (0.20145, -0.13273, -0.11735)),
    ((0, 1, 3), (-0.09466, 0.15479, 0.06806)),
    ((2, 2, 0), (0.12995, 0.08606, -0.12606)),
    ((2, 0, 2), (-0.06983, 0.19846, 0.18106)),
    ((0, 2, 2), (0.09628, 0.29711, -0.02546)),
    ((2, 1, 1), (-0.57151, -0.07567, 0.54032)),
    ((1, 2, 1), (-0.2452, -0.05941, -0.06226)),
    ((1, 1, 2), (0.03159, 0.14051, -0.33556)),
)
"""[Agarwal] Table C.4, fourth degree.

Unlike [Agarwal], the last row is x1 x2 x3^2: the printed x1 x2 x3^3 is of fifth degree, and with it a plate pulled
up is pushed up.
"""


def columns(table: tuple[Term, ...]) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """The coefficients of f1, f2 and f3, each in the order of the table's rows; empty where it has none."""
    f1, f2, f3 = (tuple(coefficients[i] for _, coefficients in table) for i in range(3))
    return f1, f2, f3


def monomials(degree: int) -> tuple[tuple[int, int, int], ...]:
    """Powers of (x1, x2, x3) of a table of third or fourth degree, in the order of its rows."""
    return tuple(powers for powers, _ in {3: TABLE_C3, 4: TABLE_C4}[degree])


def _check(table: tuple[Term, ...], degree: int) -> None:
    monomials = {powers for powers, _ in table}
    complete = {
        (i, j, k)
        for i in range(degree + 1)
        for j in range(degree + 1)
        for k in range(degree + 1)
        if i + j + k <= degree
    }
    if len(table) != len(complete) or monomials != complete:
        raise ValueError(f"the table of degree {degree} must hold each of its {len(complete)} monomials once")


_check(TABLE_C3, 3)
_check(TABLE_C4, 4)
