"""The order of points in which some, one behind another, always lie close together."""

import numpy as np
from numpy.typing import NDArray


def clustered(points: NDArray[np.float64], size: int) -> NDArray[np.intp]:
    """Places of points, (n, 3), in an order where each `size` of them lie close together, shape (n,)."""
    parts: list[NDArray[np.intp]] = [np.arange(len(points))]
    order = []
    while parts:
        part = parts.pop()
        if len(part) <= size:
            order.append(part)
            continue
        axis = int(np.argmax(np.ptp(points[part], axis=0)))
        part = part[np.argsort(points[part, axis], kind="stable")]
        middle = size * ((len(part) // 2 + size - 1) // size)
        parts += [part[middle:], part[:middle]]
    return np.concatenate(order)
