"""How good a tetrahedral mesh is, and how true to its image, whoever made it.

Meshes are .vtu files with points in index space (voxel centres at whole numbers) and a cell array `label`; images are
arrays of labels [z, y, x] with the sides of a voxel (x, y, z). Lengths are in units of the smallest side.
"""

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

SMOOTHING = 1.5  # voxels: what is finer belongs to the voxels, not to the shape
FACETS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])  # outward


def read_mesh(path):
    """Points in index space, tetrahedra, labels."""
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData()).astype(float)
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
    return points, cells, vtk_to_numpy(grid.GetCellData().GetArray("label"))


def dihedral_angles(points, cells):
    """Smallest and largest dihedral angle of each cell, in degrees."""
    smallest = np.empty(len(cells))
    largest = np.empty(len(cells))
    for first in range(0, len(cells), 1 << 18):
        part = slice(first, first + (1 << 18))
        corner = points[cells[part]]
        normal = [
            np.cross(corner[:, b] - corner[:, a], corner[:, c] - corner[:, a]) for a, b, c in FACETS
        ]
        normal = [n / np.linalg.norm(n, axis=1)[:, None] for n in normal]
        cosine = np.stack(
            [-(normal[i] * normal[j]).sum(1) for i in range(4) for j in range(i)]
        )
        smallest[part] = np.degrees(np.arccos(np.clip(cosine.max(0), -1, 1)))
        largest[part] = np.degrees(np.arccos(np.clip(cosine.min(0), -1, 1)))
    return smallest, largest


def interface_facets(cells, labels):
    """Facets between two meshed labels: corners (from the side of the first, outward), first label, second label."""
    corner = cells[:, FACETS].reshape(-1, 3)
    cell = np.repeat(np.arange(len(cells)), 4)
    key = np.sort(corner, axis=1).astype(np.int64)
    order = np.lexsort(key.T)
    key, corner, cell = key[order], corner[order], cell[order]
    twin = np.flatnonzero((key[1:] == key[:-1]).all(axis=1))
    a, b = labels[cell[twin]], labels[cell[twin + 1]]
    inner = a != b
    twin, a, b = twin[inner], a[inner], b[inner]
    single = np.ones(len(key), bool)
    repeated = np.flatnonzero((key[1:] == key[:-1]).all(axis=1))
    single[repeated] = single[repeated + 1] = False
    outer = np.flatnonzero(single)
    return (
        np.concatenate([corner[twin], corner[outer]]),
        np.concatenate([a, labels[cell[outer]]]),
        np.concatenate([b, np.zeros(len(outer), labels.dtype)]),
    )


def off_the_box(centre, shape):
    """Facets that do not lie on the sides of the image, where a mesh is cut off rather than ending."""
    last = np.array(shape[::-1]) - 1
    return ((centre > 0.01) & (centre < last - 0.01)).all(axis=1)


def normal_errors(centre, normal, first, second, image, spacing):
    """Angle of each facet to the smooth shape, in degrees: the gradient of the difference of the two labels' indicators,
    smoothed by SMOOTHING voxels."""
    expected = np.zeros((len(centre), 3))
    for label in np.unique(np.concatenate([first, second])):
        mine = np.flatnonzero((first == label) | (second == label))
        low = np.maximum(np.floor(centre[mine].min(0)).astype(int) - 8, 0)
        high = np.minimum(np.ceil(centre[mine].max(0)).astype(int) + 9, image.shape[::-1])
        crop = image[low[2] : high[2], low[1] : high[1], low[0] : high[0]]
        smooth = gaussian_filter((crop == label).astype(np.float32), SMOOTHING, mode="nearest")
        place = (centre[mine] - low).T[::-1]
        sign = np.where(first[mine] == label, -1.0, 1.0)
        for axis in range(3):
            slope = np.gradient(smooth, axis=2 - axis) / spacing[axis]
            expected[mine, axis] += sign * map_coordinates(slope, place, order=1, mode="nearest")
    length = np.linalg.norm(expected, axis=1)
    cosine = (expected * normal).sum(1) / np.maximum(length, 1e-12)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))), length > 1e-6


def boundary_distances(centre, first, second, image, spacing):
    """Distance of each facet's centre to the voxel faces between the same two labels."""
    where, pair = [], []
    for axis in range(3):
        a = np.moveaxis(image, 2 - axis, 0)
        step = np.nonzero(a[1:] != a[:-1])
        low, high = a[:-1][step].astype(np.int64), a[1:][step].astype(np.int64)
        index = [None, None, None]
        rest = [d for d in (0, 1, 2) if d != 2 - axis]
        index[2 - axis] = step[0] + 0.5
        index[rest[0]], index[rest[1]] = step[1], step[2]
        where.append(np.stack([index[2], index[1], index[0], np.full(len(low), axis)], 1))
        pair.append(np.minimum(low, high) << 32 | np.maximum(low, high))
    where, pair = np.concatenate(where), np.concatenate(pair)
    order = np.argsort(pair, kind="stable")
    where, pair = where[order], pair[order]
    wanted = np.minimum(first, second).astype(np.int64) << 32 | np.maximum(first, second).astype(np.int64)
    distance = np.full(len(centre), np.nan)
    for key in np.unique(wanted):
        faces = where[np.searchsorted(pair, key) : np.searchsorted(pair, key, "right")]
        if len(faces) == 0:
            continue
        mine = np.flatnonzero(wanted == key)
        count = min(12, len(faces))
        near = cKDTree(faces[:, :3] * spacing).query(centre[mine] * spacing, count)[1].reshape(len(mine), -1)
        half = np.full((len(faces), 3), 0.5)
        half[np.arange(len(faces)), faces[:, 3].astype(int)] = 0
        beyond = np.maximum(np.abs(centre[mine][:, None] - faces[near, :3]) - half[near], 0) * spacing
        distance[mine] = np.sqrt((beyond**2).sum(2)).min(1)
    return distance


def dice_mean(points, cells, labels, image):
    """Mean over the labels but 0 of 2 |A n B| / (|A| + |B|); B: voxels whose centre lies in a cell of the label."""
    found = np.zeros(image.shape, image.dtype)
    corner = points[cells]
    low = np.ceil(corner.min(1) - 1e-9).astype(int)
    size = np.floor(corner.max(1) + 1e-9).astype(int) - low + 1
    inverse = np.linalg.inv((corner[:, 1:] - corner[:, :1]).transpose(0, 2, 1))
    for extent in np.unique(size, axis=0):
        if (extent <= 0).any():
            continue
        mine = np.flatnonzero((size == extent).all(1))
        for offset in np.ndindex(*extent):
            voxel = low[mine] + offset
            inside = ((voxel >= 0) & (voxel < image.shape[::-1])).all(1)
            weight = np.einsum("nij,nj->ni", inverse[mine], voxel - corner[mine, 0])
            inside &= (weight > -1e-9).all(1) & (weight.sum(1) < 1 + 1e-9)
            x, y, z = voxel[inside].T
            found[z, y, x] = labels[mine[inside]]
    values = [v for v in np.unique(image) if v != 0]
    size = 1 + int(max(image.max(), found.max()))
    both = np.bincount(image[image == found].ravel(), minlength=size)
    sizes = np.bincount(image.ravel(), minlength=size) + np.bincount(found.ravel(), minlength=size)
    return float(np.mean([2 * both[v] / sizes[v] for v in values]))


def measure(path, image, spacing, shape=None):
    """All figures of a mesh file as a dictionary. `shape(points)` gives the exact distance and normal where known."""
    points, cells, labels = read_mesh(path)
    spacing = np.asarray(spacing) / min(spacing)
    smallest, largest = dihedral_angles(points * spacing, cells)
    facets, first, second = interface_facets(cells, labels)
    centre = points[facets].mean(1)
    kept = off_the_box(centre, image.shape)
    facets, first, second, centre = facets[kept], first[kept], second[kept], centre[kept]
    corner = points[facets] * spacing
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(normal, axis=1) / 2
    normal /= np.maximum(2 * area, 1e-300)[:, None]
    if shape is None:
        error, known = normal_errors(centre, normal, first, second, image, spacing)
        distance = boundary_distances(centre, first, second, image, spacing)
    else:
        distance, expected = shape(centre)
        error = np.degrees(np.arccos(np.clip((normal * expected).sum(1), -1, 1)))
        known = np.ones(len(area), bool)
    near = ~np.isnan(distance)
    return {
        "cells": len(cells),
        "min_dihedral": float(smallest.min()),
        "max_dihedral": float(largest.max()),
        "below_20": int((smallest < 20).sum()),
        "dice_mean": dice_mean(points, cells, labels, image),
        "lost_labels": int(sum(v not in labels for v in np.unique(image) if v != 0)),
        "rms_distance": float(np.sqrt(np.average(distance[near] ** 2, weights=area[near]))),
        "normal_error": float(np.average(error[known], weights=area[known])),
    }
