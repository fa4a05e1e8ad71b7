"""Edges, bodies, winding and rims of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from palpate.foundation.arrays import BoolArray, IntArray

__all__ = ["SurfaceEdges"]


@dataclass(frozen=True, eq=False)
class SurfaceEdges:
    """Edges of triangles (t, 3)."""

    triangles: IntArray

    @cached_property
    def directed(self) -> IntArray:
        """Sides (3 t, 2) of the triangles; side 3 i + k of triangle i runs from its corner k."""
        return np.asarray(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))

    @cached_property
    def _grouped(self) -> tuple[IntArray, IntArray]:
        """Sides in the order of their edges (3 t,), and where each edge's sides begin (k + 1,)."""
        ends = np.sort(self.directed, axis=1)
        order = np.lexsort((ends[:, 1], ends[:, 0]))
        new = np.concatenate([[True], (np.diff(ends[order], axis=0) != 0).any(axis=1)])
        new = new[: len(order)]
        return order, np.append(np.flatnonzero(new), len(order))

    @cached_property
    def uses(self) -> IntArray:
        """Number of triangles at each edge (k,)."""
        return np.diff(self._grouped[1])

    @cached_property
    def uses_of_sides(self) -> IntArray:
        """Number of triangles at the edge of each side (3 t,)."""
        order, _ = self._grouped
        uses = np.empty(len(order), np.int64)
        uses[order] = np.repeat(self.uses, self.uses)
        return uses

    @property
    def lone(self) -> IntArray:
        """Sides (k, 2) at which no other triangle lies, in the direction of their triangle."""
        return np.asarray(self.directed[self.uses_of_sides == 1])

    @property
    def holes(self) -> int:
        """Number of connected groups of edges of one triangle only."""
        if not len(self.lone):
            return 0
        used, ends = np.unique(self.lone, return_inverse=True)
        one, other = ends.reshape(-1, 2).T
        graph = sp.coo_matrix((np.ones(len(one), bool), (one, other)), shape=(len(used),) * 2)
        return int(connected_components(graph, directed=False)[0])

    @cached_property
    def pairs(self) -> IntArray:
        """Sides (k, 2) that share an edge with exactly one other."""
        order, starts = self._grouped
        first = starts[:-1][self.uses == 2]
        return np.column_stack([order[first], order[first + 1]])

    @cached_property
    def bodies(self) -> IntArray:
        """Number of the body (t,) that each triangle belongs to: bodies share no edge."""
        order, starts = self._grouped
        count = len(self.triangles)
        same = np.ones(max(len(order) - 1, 0), bool)
        same[starts[1:-1] - 1] = False
        one, other = order[:-1][same] // 3, order[1:][same] // 3
        graph = sp.coo_matrix((np.ones(len(one), bool), (one, other)), shape=(count, count))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    @cached_property
    def winding(self) -> tuple[BoolArray, BoolArray]:
        """Triangles (t,) that are flipped against most of their body, and bodies whose triangles
        cannot be made consistent (b,): they have one side only.

        Each triangle is two nodes of a graph, as it is and turned over. Sides that run the same way
        join one triangle's front to the other's back.
        """
        count, bodies = len(self.triangles), self.bodies
        first, second = (self.pairs // 3).T
        same = self.directed[self.pairs[:, 0], 0] == self.directed[self.pairs[:, 1], 0]
        turned = same.astype(np.int64)
        rows = np.concatenate([first, first + count])
        columns = np.concatenate([second + count * turned, second + count * (1 - turned)])
        graph = sp.coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(2 * count,) * 2)
        side = connected_components(graph, directed=False)[1]
        front, back = side[:count], side[count:]
        # The two sides of a body, or of a part that hangs on it by edges of three triangles.
        flipped = front > back
        part = np.minimum(front, back)
        most = np.bincount(part, weights=flipped, minlength=2 * count) > (
            np.bincount(part, minlength=2 * count) / 2
        )
        single = np.zeros(bodies.max(initial=-1) + 1, bool)
        single[bodies[front == back]] = True
        return np.asarray(flipped ^ most[part]), single

    @cached_property
    def rims(self) -> list[IntArray]:
        """Closed chains of vertices (k,) around the holes, in the direction of their triangles."""
        following: dict[int, list[int]] = {}
        for start, end in self.lone:
            following.setdefault(int(start), []).append(int(end))
        found = []
        while following:
            chain = [next(iter(following))]
            place: dict[int, int] = {chain[0]: 0}
            while chain[-1] in following:
                ways = following[chain[-1]]
                step = ways.pop()
                if not ways:
                    del following[chain[-1]]
                if step in place:
                    loop = chain[place[step] :]
                    found.append(np.array(loop))
                    for vertex in loop[1:]:
                        del place[vertex]
                    chain = chain[: place[step] + 1]
                else:
                    place[step] = len(chain)
                    chain.append(step)
        return sorted((loop for loop in found if len(loop) > 2), key=len, reverse=True)
