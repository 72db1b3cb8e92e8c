"""What the program promises about components, islands and holes, with the image's own components counted here."""
import json
import os
import unittest

import numpy as np

import files
from program import ProgramTest

LIMITS = 5


def blocks(extent, boxes):
    """Boxes of labels, later ones over earlier ones: (label, lower corner, upper corner)."""
    image = np.zeros(extent, np.uint8)
    for label, low, high in boxes:
        image[tuple(slice(a, b) for a, b in zip(low, high))] = label
    return image


class Strict(ProgramTest):
    def setUp(self):
        super().setUp()
        # 1,728 cubes of two voxels a side: far more than a few large cells can hold.
        cubes = (np.indices((24, 24, 24)) // 2).sum(0) % 2 + 1
        self.image = files.write_nrrd(self.path("cubes.nrrd"), cubes.astype(np.uint8), spacing=(1, 1, 1))
        self.out = self.path("m.vtu")

    def test_a_breach_is_an_error_and_leaves_nothing(self):
        for options in ((), ("--json",), ("--report", self.path("r.json"))):
            self.fail_with(LIMITS, "mesh", self.image, "-o", self.out, "--min-size", "8vox", "--strict", *options,
                           says="lost components")
        with open(self.out, "w") as file:
            file.write("kept")
        self.fail_with(LIMITS, "mesh", self.image, "-o", self.out, "--min-size", "8vox", "--strict", "--force")
        with open(self.out) as file:
            self.assertEqual(file.read(), "kept")

    def test_without_it_the_breach_is_reported(self):
        report = json.loads(self.succeed("mesh", self.image, "-o", self.out, "--min-size", "8vox", "--json"))
        self.assertNotEqual(report["topology"]["breach"], "")
        self.assertTrue(os.path.exists(self.out))
        check = self.run_program("check", self.out, "--image", self.image, "--strict")
        self.assertEqual(check.returncode, LIMITS)
        self.assertIn("lost components", check.stderr)
        self.assertEqual(len(check.stderr.splitlines()), 1)

    def test_small_cells_pass(self):
        report = json.loads(
            self.succeed("mesh", self.image, "-o", self.out, "--min-size", "1vox", "--strict", "--json"))
        self.assertEqual(report["topology"]["breach"], "")
        self.succeed("check", self.out, "--image", self.image, "--strict")


class MinComponent(ProgramTest):
    def test_counts_voxels(self):
        # Islands of 12 and 27 voxels beside a block, in cells that are larger.
        image = blocks((32, 24, 24), [(1, (2, 2, 2), (12, 22, 22)), (1, (20, 4, 4), (23, 6, 6)),
                                      (1, (20, 14, 14), (23, 17, 17))])
        path = files.write_nrrd(self.path("a.nrrd"), image, spacing=(1, 1, 1))
        for least, required in ((8, 3), (13, 2), (28, 1)):
            report = json.loads(self.succeed("mesh", path, "-o", self.path("m.vtu"), "--force", "--json", "--min-size",
                                             "6vox", "--min-component", least))
            self.assertEqual(report["topology"]["min_component"], least)
            self.assertEqual(report["topology"]["broken_components"], [])
            self.assertGreaterEqual(report["labels"][1]["components"], required)
            for lost in report["topology"]["broken_small_components"]:
                self.assertLess(lost["voxels"], least)

    def test_refuses_what_is_no_number_of_voxels(self):
        path = files.write_nrrd(self.path("a.nrrd"), files.balls(), spacing=(1, 1, 1))
        for bad in ("-1", "x", "1.5"):
            self.fail_with(2, "mesh", path, "-o", self.path("m.vtu"), "--min-component", bad)


class CleanUp(ProgramTest):
    """A block of label 1 with two holes and a bay, islands of label 1 and 2 in the background and in the block."""

    def setUp(self):
        super().setUp()
        self.voxels = blocks((28, 22, 22), [
            (1, (2, 2, 2), (20, 20, 20)),
            (0, (5, 5, 5), (7, 7, 7)),  # a hole of 8
            (0, (10, 10, 10), (13, 13, 13)),  # a hole of 27
            (0, (10, 2, 2), (12, 4, 4)),  # a bay, part of the background around
            (2, (15, 15, 15), (17, 17, 17)),  # an island of 8 in the block
            (2, (22, 2, 2), (26, 6, 6)),  # the largest of label 2
            (1, (24, 16, 16), (26, 18, 18)),  # an island of 8 in the background
        ])
        self.image = files.write_nrrd(self.path("a.nrrd"), self.voxels, spacing=(1, 1, 1))

    def mesh(self, *options):
        return json.loads(self.succeed("mesh", self.image, "-o", self.path("m.vtu"), "--force", "--json", "--min-size",
                                       "1vox", *options))

    def labels(self, report):
        return {l["label"]: (l["voxels"], l["image_components"]) for l in report["labels"]}

    def test_islands(self):
        before = self.labels(self.mesh())
        report = self.mesh("--remove-islands", "9")
        islands = {e["label"]: (e["components"], e["voxels"]) for e in report["clean_up"]["islands"]}
        self.assertEqual(islands, {1: (1, 8), 2: (1, 8)})
        after = self.labels(report)
        self.assertEqual(before[1], ((self.voxels == 1).sum(), 2))
        self.assertEqual(after[1], (before[1][0] - 8 + 8, 1), "one goes, what was label 2 in the block comes")
        self.assertEqual(after[2], (64, 1))
        self.assertEqual(self.labels(self.mesh("--remove-islands", "8"))[2], before[2], "8 voxels are not fewer than 8")
        self.assertEqual(self.labels(self.mesh("--remove-islands", "1000"))[2], (64, 1), "the largest of a label stays")

    def test_holes(self):
        for size, holes, voxels in ((8, 0, 0), (9, 1, 8), (28, 2, 35), (100000, 2, 35)):
            report = self.mesh("--fill-holes", size)
            filled = report["clean_up"]["holes"]
            self.assertEqual((filled["components"], filled["voxels"]), (holes, voxels), size)
            self.assertEqual(self.labels(report)[1][0], (self.voxels == 1).sum() + voxels)

    def test_both_and_what_is_refused(self):
        report = self.mesh("--remove-islands", "9", "--fill-holes", "28")
        self.assertEqual(self.labels(report)[1], ((self.voxels == 1).sum() + 35, 1))
        for bad in ("-1", "x"):
            self.fail_with(2, "mesh", self.image, "-o", self.path("n.vtu"), "--fill-holes", bad)
            self.fail_with(2, "mesh", self.image, "-o", self.path("n.vtu"), "--remove-islands", bad)


if __name__ == "__main__":
    unittest.main()
