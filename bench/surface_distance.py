#!/usr/bin/env python3
"""How far interfaces are from those of another mesh: surface_distance.py REFERENCE.vtp MESH.vtp...

The files are written by `treemarch mesh IMAGE --surface -o FILE.vtp`. Points on the facets of a mesh are compared with
the nearest facet of the reference between the same two labels: RMS over the area of the distance (in the unit of the
files) and of the angle between the normals."""
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy


def read(path):
    """Points, and the facets by their number of corners with the labels on their sides."""
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutput()
    offsets = vtk_to_numpy(data.GetPolys().GetOffsetsArray())
    corners = vtk_to_numpy(data.GetPolys().GetConnectivityArray())
    sizes = np.diff(offsets)
    labels = [vtk_to_numpy(data.GetCellData().GetArray(name)).astype(np.int64) for name in ("label_first", "label_second")]
    pair = labels[0] << 32 | labels[1] & 0xffffffff
    facets = [(corners[offsets[:-1][sizes == n][:, None] + np.arange(n)], pair[sizes == n]) for n in (3, 4)]
    return vtk_to_numpy(data.GetPoints().GetData()).astype(float), facets


def triangles(path):
    points, ((three, pair3), (four, pair4)) = read(path)
    cells = np.concatenate([three, four[:, [0, 1, 2]], four[:, [0, 2, 3]]])
    return points, cells, np.concatenate([pair3, pair4, pair4])


def samples(points, facets):
    """Places on the facets, the parts of the area that they stand for, unit normals, and the pairs of labels."""
    place, normal, pairs = [], [], []
    p = points[facets[0][0]]
    for weights in ((4, 1, 1), (1, 4, 1), (1, 1, 4)):
        place.append(np.einsum("k,nkd->nd", np.array(weights) / 6, p))
        normal.append(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 6)
        pairs.append(facets[0][1])
    p = points[facets[1][0]]
    gauss = 0.5 - 0.5 / 3**0.5
    for u in (gauss, 1 - gauss):
        for v in (gauss, 1 - gauss):
            place.append(np.einsum("k,nkd->nd", np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v]), p))
            along = (1 - v) * (p[:, 1] - p[:, 0]) + v * (p[:, 2] - p[:, 3])
            across = (1 - u) * (p[:, 3] - p[:, 0]) + u * (p[:, 2] - p[:, 1])
            normal.append(np.cross(along, across) / 4)
            pairs.append(facets[1][1])
    normal = np.concatenate(normal)
    area = np.linalg.norm(normal, axis=1)
    return np.concatenate(place), area, normal / area[:, None], np.concatenate(pairs)


def locator(points, cells):
    data, array, places = vtk.vtkPolyData(), vtk.vtkCellArray(), vtk.vtkPoints()
    places.SetData(numpy_to_vtk(points, deep=1))
    data.SetPoints(places)
    array.SetData(numpy_to_vtkIdTypeArray(np.arange(0, 3 * len(cells) + 1, 3), deep=1),
                  numpy_to_vtkIdTypeArray(cells.ravel().astype(np.int64), deep=1))
    data.SetPolys(array)
    found = vtk.vtkStaticCellLocator()
    found.SetDataSet(data)
    found.BuildLocator()
    return found, data


def main():
    points, cells, pair = triangles(sys.argv[1])
    normals = np.cross(points[cells[:, 1]] - points[cells[:, 0]], points[cells[:, 2]] - points[cells[:, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for path in sys.argv[2:]:
        place, area, normal, pairs = samples(*read(path))
        distance, cosine = np.full(len(place), np.nan), np.zeros(len(place))
        at, cell, part, squared = [0, 0, 0], vtk.mutable(0), vtk.mutable(0), vtk.mutable(0.0)
        for p in np.intersect1d(pairs, pair):
            own = np.flatnonzero(pair == p)
            search, _keep = locator(points, cells[own])
            for i in np.flatnonzero(pairs == p):
                search.FindClosestPoint(place[i], at, cell, part, squared)
                distance[i] = squared.get()**0.5
                cosine[i] = abs(normals[own[cell.get()]] @ normal[i])
        known = ~np.isnan(distance)
        weight = area[known] / area[known].sum()
        angle = np.degrees(np.arccos(np.minimum(1, cosine[known])))
        print(f"{path}: distance RMS {np.sqrt(weight @ distance[known]**2):.4f}, mean {weight @ distance[known]:.4f}, "
              f"normals RMS {np.sqrt(weight @ angle**2):.1f} degrees, without counterpart "
              f"{area[~known].sum() / area.sum():.2%} of the area")


if __name__ == "__main__":
    main()
