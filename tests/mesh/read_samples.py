"""Reads what write_samples wrote with the programs that users have: meshio, VTK and Gmsh. Usage: read_samples.py FOLDER"""
import pathlib
import subprocess
import sys

import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

HARD = [0, -1, 70000, 2**31 - 1, 5, -(2**31)]
TETS = {
    "tetra": [(0, 1, 2, 3)],
    "pyramid": [(0, 1, 2, 4), (0, 2, 3, 4)],
    "hexahedron": [(0, 1, 3, 4), (1, 2, 3, 6), (1, 6, 3, 4), (1, 6, 4, 5), (3, 4, 6, 7)],
}
VTK_TYPES = {3: "line", 5: "triangle", 9: "quad", 10: "tetra", 12: "hexahedron", 14: "pyramid"}
# name: cells, labels (of equal volume), volume in output coordinates, dimension, facets by type
BOX = (6 * 5 * 4 * 6, HARD, 6 * 5 * 4 * 0.75, 3)
SAMPLES = {
    "box": BOX,
    "left_handed": BOX,
    "plain": BOX[:2] + (6 * 5 * 4, 3),
    "named": BOX,
    "mixed": (6 + 3 + 1, [1, 2, 3], 2.0, 3),
    "flat": (6 * 5 * 2, HARD, 30.0, 2),
}
failures = []


def expect(condition, *what):
    if not condition:
        failures.append(" ".join(str(w) for w in what))


def volumes(points, kind, cells):
    if kind in ("triangle", "quad"):
        p = points[cells]
        area = lambda a, b, c: 0.5 * np.cross(p[:, b] - p[:, a], p[:, c] - p[:, a])[:, 2]
        return area(0, 1, 2) + (area(0, 2, 3) if kind == "quad" else 0)
    total = 0
    for t in TETS[kind]:
        p = points[cells[:, t]]
        total = total + np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 3] - p[:, 0]) / 6
    return total


def check_volume_mesh(where, sample, points, blocks):
    """blocks: (type, cells, labels)."""
    cells, labels, volume, dim = sample
    expect(points.dtype == np.float64, where, "points are", points.dtype)
    expect(sum(len(c) for _, c, _ in blocks) == cells, where, "cells", [(t, len(c)) for t, c, _ in blocks])
    by_label = {}
    for kind, c, l in blocks:
        v = volumes(np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]), kind, c)
        expect((v > 0).all(), where, "negative", kind)
        for x in np.unique(l):
            by_label[int(x)] = by_label.get(int(x), 0) + v[l == x].sum()
    expect(sorted(by_label) == sorted(labels), where, "labels", sorted(by_label))
    expect(abs(sum(by_label.values()) - volume) < 1e-9 * volume, where, "volume", sum(by_label.values()))
    if labels is HARD:
        expect(np.ptp(list(by_label.values())) < 1e-9 * volume, where, "volume by label", by_label)


def check_interfaces(where, sample, outside, pairs):
    """pairs: array of (first, second), one a facet."""
    _, labels, _, dim = sample
    found = {tuple(int(x) for x in p) for p in np.unique(pairs, axis=0)}
    if labels is HARD:
        want = {tuple(sorted(p)) for p in zip(HARD, HARD[1:])} | {(l, outside) for l in HARD}
        expect(found == want, where, "pairs", found)
    else:
        expect(found == {(1, 2), (2, 3), (1, outside), (2, outside), (3, outside)}, where, "pairs", found)


def of_meshio(path):
    mesh = meshio.read(path)
    data = mesh.cell_data

    def array(name):
        return [np.asarray(a).ravel() for a in data[name]]

    return mesh, [(b.type, np.asarray(b.data)) for b in mesh.cells], array


def check_with_meshio(folder, name, sample, extension):
    path = folder / (name + extension)
    mesh, cells, array = of_meshio(path)
    labels = array("medit:ref" if extension == ".mesh" else "label" if "label" in mesh.cell_data else "gmsh:physical")
    check_volume_mesh(f"meshio {path.name}", sample, np.asarray(mesh.points), [c + (l,) for c, l in zip(cells, labels)])
    if extension == ".vtu":
        expect(len(mesh.field_data["affine"].ravel()) == 16, path.name, "no affine")
        if name == "named":
            text = bytes(mesh.field_data["label_names"].astype(np.uint8)).decode().split("\n")
            expect(text == ["", "with _quotes_ & <signs>", "grey matter", "déjà", "five", "last", ""], path.name, "names", text)
            expect(list(mesh.field_data["label_values"]) == HARD, path.name, "values of names")
            expect(bytes(mesh.field_data["space"].astype(np.uint8)) == b"LPS", path.name, "space")
    if extension == ".msh" and name == "named":
        expect("grey matter" in mesh.field_data, path.name, "names", list(mesh.field_data))
        expect(int(mesh.field_data["grey matter"][0]) == 70000, path.name, "tag of a name")
        tags = np.concatenate(array("gmsh:physical"))
        for label in (5, 70000, 2**31 - 1):
            expect((tags[np.concatenate(labels) == label] == label).all(), path.name, "physical group of", label)

    path = folder / (name + "_interfaces" + extension)
    mesh, cells, array = of_meshio(path)
    outside = -2 if sample[1] is HARD else -1
    if extension == ".mesh":
        rows = [r.split(":") for r in path.read_text().splitlines() if r.startswith("# reference ")]
        table = {int(a.split()[-1]): [int(x) for x in b.split()] for a, b in rows}
        pairs = np.array([table[int(r)] for a in array("medit:ref") for r in a])
    else:
        pairs = np.column_stack([np.concatenate(array(n)) for n in ("label_first", "label_second")])
    check_interfaces(f"meshio {path.name}", sample, outside, pairs)
    expect(len(np.unique(np.concatenate([c.ravel() for _, c in cells]))) == len(mesh.points), path.name, "unused points")


def check_with_vtk(folder, name, sample):
    def read(path):
        reader = vtk.vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
        reader.Update()
        expect(reader.GetErrorCode() == 0, "VTK reports an error in", path.name)
        return reader.GetOutput()

    grid = read(folder / (name + ".vtu"))
    types = vtk_to_numpy(grid.GetCellTypesArray())
    offsets = vtk_to_numpy(grid.GetCells().GetOffsetsArray())
    connectivity = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    labels = vtk_to_numpy(grid.GetCellData().GetArray("label"))
    blocks = []
    for t in np.unique(types):
        which = np.flatnonzero(types == t)
        n = offsets[which[0] + 1] - offsets[which[0]]
        blocks.append((VTK_TYPES[t], connectivity[offsets[which][:, None] + np.arange(n)], labels[which]))
    check_volume_mesh(f"VTK {name}", sample, vtk_to_numpy(grid.GetPoints().GetData()), blocks)
    expect(grid.GetFieldData().GetArray("affine") is not None, name, "VTK finds no affine")

    grid = read(folder / (name + "_interfaces.vtu"))
    outside = int(grid.GetFieldData().GetArray("outside_label").GetTuple1(0))
    pairs = np.column_stack([vtk_to_numpy(grid.GetCellData().GetArray(n)) for n in ("label_first", "label_second")])
    check_interfaces(f"VTK {name}_interfaces", sample, outside, pairs)


def check_with_gmsh(path):
    done = subprocess.run(["gmsh", "-check", str(path)], capture_output=True, text=True)
    text = done.stdout + done.stderr
    expect(done.returncode == 0 and "Done checking" in text, path.name, "gmsh:", text[-500:])
    expect("Error" not in text and "Warning" not in text, path.name, "gmsh:", text[-1500:])
    expect(" 0 elements" not in text, path.name, "gmsh reads no elements:", text[-500:])


def main():
    folder = pathlib.Path(sys.argv[1])
    for name, sample in SAMPLES.items():
        for extension in (".vtu", ".msh", ".mesh"):
            check_with_meshio(folder, name, sample, extension)
        check_with_vtk(folder, name, sample)
        for suffix in ("", "_interfaces"):
            check_with_gmsh(folder / (name + suffix + ".msh"))
            if name != "mixed":  # Gmsh's reader of this format knows no pyramids
                check_with_gmsh(folder / (name + suffix + ".mesh"))
    for f in failures:
        print("FAILED:", f)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
