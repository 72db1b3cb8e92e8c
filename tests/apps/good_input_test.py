"""What the program makes of good input, looked at by programs that are not ours (VTK, meshio)."""
import json
import os
import pathlib
import re
import signal
import subprocess
import time
import unittest

import h5py
import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import files
from program import PROGRAM, ProgramTest, in_memory


def read_vtu(path):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    labels = vtk_to_numpy(grid.GetCellData().GetArray("label"))
    points = vtk_to_numpy(grid.GetPoints().GetData())
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(len(labels), -1)
    return points, cells, labels


def volumes(points, cells):
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    if cells.shape[1] == 3:
        edges = edges[:, :, :2]
        return np.linalg.det(edges) / 2
    return np.linalg.det(edges) / 6


class Meshes(ProgramTest):
    def setUp(self):
        super().setUp()
        self.labels = files.balls()
        self.image = files.write_nrrd(self.path("a.nrrd"), self.labels, spacing=(1, 1, 1))

    def mesh(self, *options, image=None, name="m.vtu"):
        self.succeed("mesh", image or self.image, "-o", self.path(name), "--force", *options)
        return read_vtu(self.path(name)) if name.endswith(".vtu") else None

    def test_fills_the_box(self):
        for method in ("paper", "guaranteed"):
            points, cells, labels = self.mesh("--background", "keep", "--method", method)
            self.assertTrue((volumes(points, cells) > 0).all())
            self.assertAlmostEqual(volumes(points, cells).sum(), self.labels.size, places=6)
            np.testing.assert_allclose(points.min(0), [-0.5] * 3, atol=1e-12)
            np.testing.assert_allclose(points.max(0), np.array(self.labels.shape) - 0.5, atol=1e-12)
            self.assertEqual(set(labels), {0, 1, 2})

    def test_background_is_left_out(self):
        points, cells, labels = self.mesh()
        self.assertEqual(set(labels), {1, 2})
        self.assertEqual(set(cells.ravel()), set(range(len(points))), "all points are used")
        for label in (1, 2):
            voxels = (self.labels == label).sum()
            self.assertLess(abs(volumes(points, cells)[labels == label].sum() / voxels - 1), 0.25)

    def test_flat_images(self):
        flat = self.labels[:, :, 5].copy()
        rows = [bytes(r) for r in flat.T.astype("uint8")]
        image = files.write_png(self.path("a.png"), rows)
        points, cells, labels = self.mesh("--background", "keep", "--spacing", "0.5", "--any-labels", image=image)
        self.assertEqual(cells.shape[1], 3)
        self.assertTrue((volumes(points, cells) > 0).all())
        self.assertAlmostEqual(volumes(points, cells).sum(), flat.size / 4, places=6)
        self.assertEqual(set(labels), {0, 1, 2})

    def test_extreme_labels(self):
        values = np.array([-1, 70000, 2**31 - 1], np.int32)[self.labels]
        image = files.write_nrrd(self.path("b.nrrd"), values)
        for name in ("m.vtu", "m.msh", "m.mesh"):
            self.succeed("mesh", image, "-o", self.path(name), "--any-labels")
        self.assertEqual(set(read_vtu(self.path("m.vtu"))[2]), {-1, 70000, 2**31 - 1})

    def test_affine_maps_the_points(self):
        rotation = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
        shear = np.array([[1, 0.6, 0], [0, 0.8, 0.28], [0, 0, 0.96]])  # columns of unit length: the same voxels
        mirror = np.diag([-1.0, 1, 1])
        index, cells, labels = self.mesh("--space", "index", "--background", "keep")
        for matrix in (rotation, shear, mirror):
            matrix = matrix @ np.diag([2.0, 2, 2])
            image = files.write_nrrd(self.path("b.nrrd"), self.labels, directions=matrix.T, origin=(5, 6, 7))
            points, mapped_cells, mapped_labels = self.mesh("--background", "keep", image=image, name="b.vtu")
            np.testing.assert_allclose(points, index @ matrix.T + [5, 6, 7], atol=1e-9)
            np.testing.assert_array_equal(labels, mapped_labels)
            np.testing.assert_array_equal(np.sort(cells, 1), np.sort(mapped_cells, 1))
            self.assertTrue((volumes(points, mapped_cells) > 0).all())

    def test_every_format_holds_the_same_mesh(self):
        points, cells, labels = self.mesh()
        for name in ("m.msh", "m.mesh", "m.xdmf"):
            self.mesh(name=name)
            other = meshio.read(self.path(name))
            data = {k: v for k, v in other.cell_data.items() if k in ("gmsh:physical", "medit:ref", "label")}
            data = {k: v for k, v in data.items() if k != "label" or len(data) == 1}
            [refs] = data.values()
            found = [(b.data, r) for b, r in zip(other.cells, refs) if b.type == "tetra"]
            self.assertEqual(sum(len(d) for d, _ in found), len(cells))
            self.assertEqual(set(np.concatenate([r for _, r in found])), set(labels))
            for label in set(labels):
                own = volumes(points, cells)[labels == label].sum()
                its = sum(volumes(other.points, d[r == label]).sum() for d, r in found)
                self.assertAlmostEqual(own, its, places=6)

    def test_interfaces_name_both_sides(self):
        self.mesh("--background", "keep", "--interfaces", self.path("i.vtu"))
        reader = vtk.vtkXMLUnstructuredGridReader()
        reader.SetFileName(self.path("i.vtu"))
        reader.Update()
        data = reader.GetOutput().GetCellData()
        first, second = (vtk_to_numpy(data.GetArray(n)) for n in ("label_first", "label_second"))
        pairs = set(zip(first, second))
        self.assertTrue({(0, 1), (0, 2), (1, 2)} <= pairs, pairs)
        self.assertTrue((first != second).all())

    def test_space_time(self):
        radius, step = 9.3, 0.05
        image, centres = files.moving_ball(radius=radius)
        affine = np.array([[-1, 0, 0, 5], [0, 1, 0, -3], [0, 0, 1, 2], [0, 0, 0, 1.0]])  # left-handed
        path = files.write_nifti(self.path("a.nii"), image, affine, pixdim=(1, 1, 1, step))
        mesh = self.path("m.xdmf")
        report = json.loads(self.succeed("mesh", path, "--space-time", "--method", "paper", "-o", mesh, "--json"))
        self.assertEqual(report["dimension"], 4)
        with h5py.File(self.path("m.h5")) as arrays:
            points, cells, labels = (arrays[name][:] for name in ("points", "cells", "label"))
        self.assertEqual(set(labels), {3})
        edges = points[cells[:, 1:]] - points[cells[:, :1]]
        self.assertTrue((np.linalg.det(edges) > 0).all())
        [whole] = [l["volume"] for l in report["labels"] if l["label"] == 3]
        # A step of time counts as one voxel, which measures 1 mm.
        self.assertAlmostEqual(np.linalg.det(edges).sum() / 24 / np.float32(step) / whole, 1)
        check = json.loads(self.succeed("check", mesh, "--image", path, "--space-time", "--json"))
        self.assertTrue(check["valid"])
        self.assertGreater(check["dice_mean"], 0.99)
        ball = 4 / 3 * np.pi * radius**3
        for moment in (0, 1, 2.3, 6, 8.5, 11):
            self.succeed("slice", mesh, "--time", moment * step, "-o", self.path("s.vtu"), "--force")
            self.assertTrue(json.loads(self.succeed("check", self.path("s.vtu"), "--json"))["valid"])
            at, tetrahedra, label = read_vtu(self.path("s.vtu"))
            self.assertEqual(set(label), {3})
            self.assertTrue((volumes(at, tetrahedra) > 0).all())
            self.assertLess(abs(volumes(at, tetrahedra).sum() / ball - 1), 0.03, moment)
            if moment == int(moment):
                weight = volumes(at, tetrahedra) / volumes(at, tetrahedra).sum()
                x = (weight * at[tetrahedra].mean(1)[:, 0]).sum()
                self.assertAlmostEqual(x, 5 - (centres[moment] - 0.5), delta=0.1)

    def test_flat_images_that_move(self):
        image, centres = files.moving_ball(moments=24)
        path = files.write_nrrd(self.path("a.nrrd"), image[:, :, 12], spacing=(0.5, 0.5, 0.5))  # time is the last axis
        for method in ("paper", "guaranteed"):
            mesh = self.path(method + ".xdmf")
            self.succeed("mesh", path, "--method", method, "-o", mesh)
            self.succeed("slice", mesh, "--time", 3, "-o", self.path("s.vtu"), "--force")
            points, cells, labels = read_vtu(self.path("s.vtu"))
            self.assertEqual((cells.shape[1], set(labels)), (3, {3}))
            area = volumes(points, cells)
            self.assertTrue((area > 0).all())
            self.assertLess(abs(area.sum() / (np.pi * 4.65**2) - 1), 0.05)
            x = (area * points[cells].mean(1)[:, 0]).sum() / area.sum()
            self.assertAlmostEqual(x, 0.5 * centres[6] - 0.25, delta=0.1)

    def test_surface(self):
        for method in ("paper", "guaranteed"):
            self.mesh("--method", method, "--interfaces", self.path("i.vtp"))
            for name in ("s.vtp", "s.stl", "s.ply", "s.vtu"):
                self.succeed("mesh", self.image, "-o", self.path(name), "--surface", "--force", "--method", method)
            polygons = vtk.vtkXMLPolyDataReader()
            polygons.SetFileName(self.path("s.vtp"))
            polygons.Update()
            expected = polygons.GetOutput()
            self.assertEqual((self.dir / "i.vtp").read_bytes(), (self.dir / "s.vtp").read_bytes())
            pairs = set(zip(*(vtk_to_numpy(expected.GetCellData().GetArray(n)) for n in ("label_first", "label_second"))))
            self.assertIn((1, 2), pairs)
            for name, reader in (("s.stl", vtk.vtkSTLReader()), ("s.ply", vtk.vtkPLYReader())):
                reader.SetFileName(self.path(name))
                reader.Update()
                self.assertEqual(reader.GetOutput().GetNumberOfCells(), expected.GetNumberOfCells())
                np.testing.assert_allclose(reader.GetOutput().GetBounds(), expected.GetBounds(), atol=1e-5)
            # The boundary of label 1 is closed and oriented: its normals point out of it.
            ply = (self.dir / "s.ply").read_bytes()
            n, faces = expected.GetNumberOfPoints(), expected.GetNumberOfCells()
            body = ply.index(b"end_header\n") + len(b"end_header\n")
            points = np.frombuffer(ply, "<f8", 3 * n, body).reshape(-1, 3)
            face = np.frombuffer(ply, [("size", "u1"), ("v", "<u4", 3), ("first", "<i4"), ("second", "<i4")], faces,
                                 body + points.nbytes)
            self.assertEqual(body + points.nbytes + face.nbytes, len(ply))
            self.assertEqual(set(zip(face["first"], face["second"])), pairs)
            first, second, corners = face["first"], face["second"], points[face["v"]]
            signed = np.einsum("ij,ij->i", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) / 6
            [volume] = [volumes(p, c)[l == 1].sum() for p, c, l in [self.mesh("--method", method)]]
            self.assertAlmostEqual(signed[first == 1].sum() - signed[second == 1].sum(), volume, places=6)
            solids = {line for line in (self.dir / "s.stl").read_text().splitlines() if line.startswith("solid")}
            self.assertEqual(len(solids), len(pairs))

    def test_flat_surface(self):
        image = files.write_nrrd(self.path("flat.nrrd"), self.labels[:, :, 5].copy())
        self.succeed("mesh", image, "-o", self.path("s.vtp"), "--surface")
        polygons = vtk.vtkXMLPolyDataReader()
        polygons.SetFileName(self.path("s.vtp"))
        polygons.Update()
        self.assertGreater(polygons.GetOutput().GetNumberOfLines(), 20)

    def test_partitions_and_node_sets(self):
        options = ("--partitions", 4, "--node-set", "low=plane:0,0,1,-0.5", "--node-set", "few=nodes:0,5-7",
                   "--background", "keep")
        report = json.loads(self.succeed("mesh", self.image, "-o", self.path("p.vtu"), "--json", *options))
        grid = meshio.read(self.path("p.vtu"))
        np.testing.assert_array_equal(grid.point_data["low"], np.abs(grid.points[:, 2] + 0.5) < 1e-6)
        self.assertEqual(set(np.flatnonzero(grid.point_data["few"])), {0, 5, 6, 7})
        self.assertEqual(report["node_sets"], {"low": int(grid.point_data["low"].sum()), "few": 4})
        part, cells = grid.cell_data["partition"][0], grid.cells[0].data
        sizes = np.bincount(part, minlength=4)
        self.assertEqual((sizes.min(), sizes.max()), (report["partition"]["smallest"], report["partition"]["largest"]))
        self.assertLess(sizes.max(), 1.1 * len(part) / 4)
        owner = np.full(len(grid.points), 99)
        np.minimum.at(owner, cells.ravel(), np.repeat(part, cells.shape[1]))
        np.testing.assert_array_equal(grid.point_data["partition"], owner)
        for name in ("p.msh", "p.xdmf"):
            self.succeed("mesh", self.image, "-o", self.path(name), *options)
            other = meshio.read(self.path(name))
            self.assertEqual(other.point_data["low"].sum(), grid.point_data["low"].sum())
            found = np.bincount(np.concatenate(other.cell_data["partition"]).astype(int).ravel(), minlength=4)
            np.testing.assert_array_equal(found, sizes)

    def test_selection(self):
        self.assertEqual(set(self.mesh("--keep", "2")[2]), {2})
        self.assertEqual(set(self.mesh("--drop", "2")[2]), {1})
        self.assertEqual(set(self.mesh("--merge", "1-2=7")[2]), {7})
        points, _, _ = self.mesh("--roi", "2:9,3:9,4:8", "--background", "keep")
        np.testing.assert_allclose(points.min(0), [1.5, 2.5, 3.5], atol=1e-12)
        np.testing.assert_allclose(points.max(0), [8.5, 8.5, 7.5], atol=1e-12)

    def test_threshold(self):
        grey = np.random.default_rng(1).normal(size=(13, 14, 15)).astype("float32")
        grey[2:10, 2:10, 2:10] += 20
        image = files.write_nrrd(self.path("g.nrrd"), grey)
        points, cells, _ = self.mesh("--threshold", "10", image=image)
        self.assertLess(abs(volumes(points, cells).sum() / 512 - 1), 0.25)

    def test_grey_values_place_the_surface(self):
        grid = np.meshgrid(*[np.arange(n) + 0.5 for n in (20, 22, 24)], indexing="ij")
        distance = np.sqrt(sum((g - n / 2) ** 2 for g, n in zip(grid, (20, 22, 24))))
        grey = files.write_nrrd(self.path("g.nrrd"), (100 - 10 * distance).astype("float32"))
        labels = files.write_nrrd(self.path("l.nrrd"), (distance < 6.7).astype("uint8") * 7)
        exact = 4 / 3 * np.pi * 6.7**3
        for options in ([grey, "--threshold", 33], [labels, "--grey", grey, "--threshold", 33],
                        [grey, "--threshold", 33, "--method", "paper"]):
            points, cells, _ = self.mesh(*options[1:], "--min-size", "1vox", image=options[0])
            self.assertLess(abs(volumes(points, cells).sum() / exact - 1), 0.02)
        points, _, _ = self.mesh("--threshold", 33, "--roi", "0:10,0:22,0:24", image=grey)
        self.assertAlmostEqual(points[:, 0].max(), 9.5)

    def test_references(self):
        for method in ("nielson-franke", "bonnell", "hege"):
            self.assertEqual(set(self.mesh("--method", method)[2]), {1, 2})
        self.assertEqual(set(self.mesh("--method", "nielson-sung", "--keep", "2")[2]), {2})

    def test_order_of_the_paper(self):
        cells = {}
        for order in ("largest", "smallest", "label", "image", "2", "0,1-2", "2,1,0"):
            cells[order] = self.mesh("--method", "paper", "--order", order)[1].tobytes()
        self.assertEqual(cells["label"], cells["0,1-2"])
        self.assertNotEqual(cells["label"], cells["2,1,0"])

    def test_a_closed_border_is_round(self):
        half = self.labels[:, :, 5:]
        image = files.write_nrrd(self.path("h.nrrd"), half)
        flat = self.mesh("--min-size", "1vox", image=image)[0]
        closed = self.mesh("--min-size", "1vox", "--border", "closed", image=image)[0]
        on_side = lambda points: (np.abs(points[:, 2] + 0.5) < 1e-9).sum()
        self.assertGreater(on_side(flat), 20)
        self.assertLess(on_side(closed), on_side(flat) / 2)

    def test_sizes_matter(self):
        for method in ("paper", "guaranteed"):
            cells = lambda *options: len(self.mesh("--method", method, "--background", "keep", *options)[1])
            coarse = cells("--min-size", "1vox")
            self.assertLess(coarse, cells("--min-size", "1vox", "--max-size", "1vox"))
            self.assertLess(cells("--min-size", "2vox"), coarse)
            self.assertGreater(cells("--min-size", "1vox", "--size", "0=1"), coarse)

    def test_sizes_follow_the_image_and_the_place(self):
        cells = lambda *options: len(self.mesh(*options)[1])
        loose = cells("--tolerance", "2vox", "--min-size", "1vox")
        self.assertLess(loose, cells("--tolerance", "0.1vox", "--min-size", "1vox"))
        self.assertLess(cells("--min-size", "0.5vox"), cells("--min-size", "0.5vox", "--grading", "0.3"))
        self.assertLessEqual(cells("--detail", "coarse"), cells("--detail", "fine"))
        # the same region in three ways: half of the image, in its world of one voxel a millimetre
        x, y, z = self.labels.shape
        half = f"{x / 2 - 0.6},{y},{z}"
        boxed = cells("--min-size", "2vox", "--region", f"box:-1,-1,-1,{half}=1vox")
        self.assertGreater(boxed, cells("--min-size", "2vox"))
        self.assertEqual(boxed, cells("--min-size", "2vox", "--region", f"box:{half},-1,-1,-1=1"))
        sizes = np.zeros((x, y, z), np.uint8)
        sizes[: x // 2] = 1
        image = files.write_nrrd(self.path("s.nrrd"), sizes)
        self.assertEqual(boxed, cells("--min-size", "2vox", "--size-image", image))
        self.assertGreater(cells("--min-size", "2vox", "--region", f"sphere:{x / 2},{y / 2},{z / 2},3=0.5"),
                           cells("--min-size", "2vox"))

    def test_threads_do_not_matter(self):
        self.mesh("--threads", 1)
        one = (self.dir / "m.vtu").read_bytes()
        for threads in (2, 7):
            self.mesh("--threads", threads)
            self.assertEqual((self.dir / "m.vtu").read_bytes(), one)

    def test_config_repeats_a_run(self):
        options = ["--method", "paper", "--min-size", "2vox", "--size", "1=3mm", "--size", "2=2mm", "--background", "keep", "--balance",
                   "none", "--field", "linear", "--keep", "1,2", "--smooth", "1"]
        self.mesh(*options)
        first = (self.dir / "m.vtu").read_bytes()
        config = self.succeed("mesh", self.image, "-o", self.path("n.vtu"), *options, "--dump-config")
        self.assertFalse((self.dir / "n.vtu").exists())
        (self.dir / "c.toml").write_text(config)
        self.mesh("--config", self.path("c.toml"))
        self.assertEqual((self.dir / "m.vtu").read_bytes(), first)
        self.mesh("--config", self.path("c.toml"), "--background", "drop")
        self.assertNotEqual((self.dir / "m.vtu").read_bytes(), first, "the command line wins")


@unittest.skipIf(in_memory(os.getcwd()), "no disk to put memory on")
class LittleMemory(ProgramTest):
    def test_what_exceeds_the_limit_is_kept_on_a_disk(self):
        grid = np.indices((150, 150, 150))
        labels = (sum((grid[d] - 60.0 - 20 * d) ** 2 for d in range(3)) < 50 ** 2).astype("uint8")
        labels[grid[0] + grid[1] > 190] += 2
        image = files.write_nrrd(self.path("a.nrrd"), labels)
        options = ["mesh", image, "-o", self.path("m.vtu"), "--force", "--min-size", "1vox", "--json", "--quiet"]
        whole = json.loads(self.succeed(*options))
        expected = (self.dir / "m.vtu").read_bytes()
        before = self.files()
        little = json.loads(self.succeed(*options, "--max-memory", "100MB", "--scratch", os.getcwd()))
        self.assertEqual((self.dir / "m.vtu").read_bytes(), expected)
        self.assertEqual(self.files(), before)
        self.assertEqual(whole["scratch_bytes"], 0)
        self.assertGreater(little["scratch_bytes"], 50e6)
        self.assertGreater(whole["peak_memory_bytes"] - little["peak_memory_bytes"], 50e6)
        self.assertIn("cells need about", little["warnings"][0])


class Reports(ProgramTest):
    def setUp(self):
        super().setUp()
        self.labels = files.balls()
        self.image = files.write_nrrd(self.path("a.nrrd"), self.labels)

    def test_report(self):
        out = self.succeed("mesh", self.image, "-o", self.path("m.vtu"), "--report", self.path("r.json"), "--json",
                           "--min-size", "1vox")
        report = json.loads(out)
        self.assertEqual(report, json.loads((self.dir / "r.json").read_text()))
        points, cells, labels = read_vtu(self.path("m.vtu"))
        self.assertEqual(report["cells"], {"tetrahedron": len(cells)})
        self.assertEqual(report["points"], len(points))
        self.assertGreater(report["seconds"]["mesh"], 0)
        self.assertGreater(report["peak_memory_bytes"], 1e6)
        self.assertGreater(report["quality"]["min_dihedral"], 0)
        self.assertLess(report["quality"]["max_dihedral"], 180)
        self.assertEqual(report["lost_labels"], [])
        self.assertEqual(report["options"]["min-size"], "1vox")
        self.assertEqual(report["options"]["background"], "drop")
        self.assertEqual(report["options"]["method"], "guaranteed")
        self.assertGreaterEqual(report["quality"]["min_dihedral"], report["guarantee"]["quality_floor"])
        self.assertIn("stopped", report["guarantee"]["improve"])
        self.assertTrue(report["version"])
        by_label = {l["label"]: l for l in report["labels"]}
        self.assertEqual(set(by_label), {0, 1, 2})
        for label in (1, 2):
            self.assertEqual(by_label[label]["voxels"], (self.labels == label).sum())
            self.assertEqual(by_label[label]["cells"], (labels == label).sum())
            self.assertAlmostEqual(by_label[label]["volume"], volumes(points, cells)[labels == label].sum(), places=6)
            self.assertGreater(by_label[label]["dice"], 0.8)

    def test_quiet(self):
        self.assertEqual(self.succeed("mesh", self.image, "-o", self.path("m.vtu"), "--quiet"), "")

    def test_info(self):
        info = json.loads(self.succeed("info", self.image, "--json"))
        self.assertEqual(info["extent"], list(self.labels.shape))
        self.assertEqual({l["label"]: l["voxels"] for l in info["labels"]},
                         {v: int((self.labels == v).sum()) for v in (0, 1, 2)})
        self.assertEqual([l["components"] for l in info["labels"]], [1, 1, 1])
        self.assertGreater(info["estimated_cells"], 0)
        self.assertIn("3 labels", self.succeed("info", self.image))

    def test_check(self):
        self.succeed("mesh", self.image, "-o", self.path("m.vtu"), "--report", self.path("r.json"))
        made = json.loads((self.dir / "r.json").read_text())
        for name in ("m.vtu", "m.msh", "m.mesh"):
            self.succeed("mesh", self.image, "-o", self.path(name), "--force")
            found = json.loads(self.succeed("check", self.path(name), "--image", self.image, "--json"))
            self.assertEqual(found["cells"], made["cells"])
            self.assertAlmostEqual(found["quality"]["min_dihedral"], made["quality"]["min_dihedral"], places=6)
            self.assertAlmostEqual(found["dice_mean"], made["dice_mean"], places=6)
            self.assertTrue(found["valid"])

    def test_help(self):
        for command in ([], ["mesh"], ["info"], ["check"]):
            self.assertIn("--help", self.succeed(*command, "--help"))
        self.assertRegex(self.succeed("--version"), r"^\d+\.\d+\.\d+")


class Interrupts(ProgramTest):
    def wait_until_handled(self, process):
        """Until the program has its handler of interrupts: how long that takes is up to the machine."""
        status = pathlib.Path(f"/proc/{process.pid}/status")
        for _ in range(6000):
            caught = re.search(r"SigCgt:\s*(\w+)", status.read_text())
            if caught and int(caught[1], 16) >> (signal.SIGINT - 1) & 1:
                return
            time.sleep(0.01)
        self.fail("the program does not handle interrupts")

    def test_interrupt_leaves_nothing(self):
        noise = np.random.default_rng(1).integers(0, 5, (120, 120, 120)).astype("uint8")
        image = files.write_nrrd(self.path("a.nrrd"), noise)
        before = self.files()
        for delay in (0.2, 0.7):
            running = subprocess.Popen([PROGRAM, "mesh", image, "-o", self.path("m.vtu")], stderr=subprocess.PIPE,
                                       stdout=subprocess.PIPE, text=True)
            self.wait_until_handled(running)
            time.sleep(delay)
            running.send_signal(signal.SIGINT)
            _, errors = running.communicate(timeout=60)
            self.assertEqual(running.returncode, 130, errors)
            self.assertEqual(self.files(), before)


if __name__ == "__main__":
    unittest.main()
