"""Triangles of a surface that cut each other."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray

__all__ = ["crossing_pairs"]

_RAYS = 200_000
"""Edges that are traced at once, which bounds the memory."""
_PARALLEL = 1e-9
"""Sine of the angle between an edge and a plane below which the edge does not pass it [1]."""


def crossing_pairs(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Find pairs (k, 2) of triangles that cross without a common vertex, in rising order.

    Two triangles cross where an edge of one passes through the other: Open3D's ray tracer (Embree)
    finds the triangles along each edge, in single precision, and double precision confirms them.
    Triangles that overlap within one plane are not found.

    Args:
        vertices: (v, 3) [m].
        triangles: (t, 3).
    """
    import open3d as o3d

    middle, span = vertices.mean(axis=0), max(float(np.ptp(vertices, axis=0).max()), 1e-300)
    places = (vertices - middle) / span
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(places.astype(np.float32)),
        o3d.core.Tensor.from_numpy(triangles.astype(np.uint32)),
    )
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    new = np.concatenate([[True], (np.diff(sides[order], axis=0) != 0).any(axis=1)])
    ends, starts = sides[order[new]], np.append(np.flatnonzero(new), len(order))
    found = [np.empty((0, 2), np.int64)]
    for low in range(0, len(ends), _RAYS):
        one = ends[low : low + _RAYS]
        rays = np.concatenate([places[one[:, 0]], places[one[:, 1]] - places[one[:, 0]]], axis=1)
        hits = scene.list_intersections(o3d.core.Tensor.from_numpy(rays.astype(np.float32)))
        inside = hits["t_hit"].numpy() <= 1.0
        edge = hits["ray_ids"].numpy()[inside].astype(np.int64)
        other = hits["primitive_ids"].numpy()[inside].astype(np.int64)
        through = _passes(places, one[edge], triangles[other])
        found.append(np.column_stack([edge[through] + low, other[through]]))
    edge, other = np.concatenate(found).T
    counts = starts[edge + 1] - starts[edge]
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    owner, hit = order[np.repeat(starts[edge], counts) + within] // 3, np.repeat(other, counts)
    apart = (triangles[owner][:, :, None] != triangles[hit][:, None, :]).all(axis=(1, 2))
    pairs = np.sort(np.column_stack([owner, hit])[apart], axis=1)
    return np.unique(pairs, axis=0)


def _passes(places: FloatArray, ends: IntArray, corners: IntArray) -> BoolArray:
    """Mark edges (k, 2) that pass through triangles (k, 3) with which they share no vertex."""
    apart = (ends[:, :, None] != corners[:, None, :]).all(axis=(1, 2))
    p, q = places[ends[:, 0]], places[ends[:, 1]]
    a, b, c = (places[corners[:, i]] for i in range(3))

    def volume(one: FloatArray, other: FloatArray, third: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ki,ki->k", one - p, np.cross(other - p, third - p)))

    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    before, after = (np.einsum("ki,ki->k", end - a, normals) for end in (p, q))
    steep = np.abs(before - after) > _PARALLEL * np.linalg.norm(q - p, axis=1)
    turns = np.stack([volume(q, a, b), volume(q, b, c), volume(q, c, a)], axis=1)
    within = (turns >= 0).all(axis=1) | (turns <= 0).all(axis=1)
    return np.asarray(apart & steep & (before * after <= 0) & within)
