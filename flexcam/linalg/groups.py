"""Which of many things hang together: connected components of a graph."""

from __future__ import annotations

import numpy as np

from flexcam.linalg.triplets import IntArray


def groups(size: int, rows: IntArray, cols: IntArray) -> IntArray:
    """Return what each of some things hangs together with.

    Every group is hooked to its least neighbour until none is left, which at least halves their number each time:
    Y. Shiloach and U. Vishkin, An O(log n) parallel connectivity algorithm, J. Algorithms 3 (1982). In numpy alone,
    so that a small run needs no scipy.
    """
    labels = np.arange(size)
    while (labels[rows] != labels[cols]).any():
        one, other = labels[rows], labels[cols]
        low = np.minimum(one, other)
        np.minimum.at(labels, one, low)
        np.minimum.at(labels, other, low)
        while (labels != labels[labels]).any():
            labels = labels[labels]
    return labels


def by_group(labels: IntArray) -> list[IntArray]:
    """Return the members of every group, in the order of their labels."""
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(labels) else []
