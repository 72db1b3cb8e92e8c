"""Bad input: one line, the right exit code, nothing written."""
import os
import pathlib
import unittest

import numpy as np

import files
from program import ProgramTest, in_memory

USAGE, INPUT, OUTPUT, LIMITS = 2, 3, 4, 5


class BadImages(ProgramTest):
    def refuse(self, path, *options, code=INPUT, says=""):
        self.fail_with(code, "mesh", path, "-o", self.path("out.vtu"), *options, says=says)
        self.fail_with(code, "info", path, *options, says=says)

    def test_missing(self):
        self.refuse(self.path("none.nii"), says="none.nii")
        self.refuse(self.path("none"))

    def test_empty(self):
        for name in ("a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.tif", "a.png", "a.dcm", "a"):
            open(self.path(name), "wb").close()
            self.refuse(self.path(name), says=name)

    def test_not_an_image(self):
        for name in ("a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.tif", "a.png", "a.dcm", "a.txt"):
            (self.dir / name).write_bytes(b"this is not an image, but longer than any magic number is" * 20)
            self.refuse(self.path(name), says=name)

    def test_truncated(self):
        image = files.balls()
        whole = {"a.nrrd": files.write_nrrd, "a.nii": files.write_nifti, "a.nii.gz": files.write_nifti}
        for name, write in whole.items():
            data = pathlib.Path(write(self.path(name), image)).read_bytes()
            for part in (60, len(data) // 2, len(data) - 20):
                (self.dir / name).write_bytes(data[:part])
                self.refuse(self.path(name), says=name)
        rows = [bytes(range(50)) for _ in range(50)]
        data = pathlib.Path(files.write_png(self.path("a.png"), rows)).read_bytes()
        for part in (20, len(data) // 2):
            (self.dir / "a.png").write_bytes(data[:part])
            self.refuse(self.path("a.png"))

    def test_impossible_dimensions(self):
        image = files.balls()
        for dim in ([3, 0, 5, 5], [3, -4, 5, 5], [9, 5, 5, 5], [3, 32767, 32767, 32767]):
            self.refuse(files.write_nifti(self.path("a.nii"), image, dim=dim))
        data = pathlib.Path(files.write_nrrd(self.path("a.nrrd"), image)).read_bytes()
        for sizes in (b"0 12 10", b"-14 12 10", b"14 12", b"99999999999 12 10", b"a b c"):
            (self.dir / "a.nrrd").write_bytes(data.replace(b"14 12 10", sizes))
            self.refuse(self.path("a.nrrd"))

    def test_values_that_are_no_labels(self):
        image = files.balls()
        self.refuse(files.write_nrrd(self.path("a.nrrd"), image.astype("float32") + np.float32(0.25)))
        for bad in (np.nan, np.inf, 2.0**31, -2.0**31 - 1, 1e30):
            values = image.astype("float64")
            values[3, 4, 5] = bad
            self.refuse(files.write_nrrd(self.path("a.nrrd"), values))
        values = image.astype("int64")
        values[3, 4, 5] = 2**31
        self.refuse(files.write_nrrd(self.path("a.nrrd"), values))
        self.refuse(files.write_nifti(self.path("a.nii"), image, scale=(0.5, 0.25)))

    def test_grey_images_ask_for_a_threshold(self):
        grey = (np.arange(14 * 12 * 10) % 997).reshape(14, 12, 10).astype("float32") * np.float32(0.37)
        self.refuse(files.write_nrrd(self.path("a.nrrd"), grey), says="--threshold")

    def test_colour_pictures(self):
        rows = [bytes(range(60)) for _ in range(20)]
        self.refuse(files.write_png(self.path("rgb.png"), rows, colour_type=2))
        palette = [value for k in range(64) for value in (k, 2 * k, 3 * k)]
        self.refuse(files.write_png(self.path("palette.png"), rows, colour_type=3, palette=palette))

    def dicom(self, folder, slices):
        (self.dir / folder).mkdir()
        for i, (series, z) in enumerate(slices):
            pixels = files.balls()[:, :, 5].T
            files.write_dicom(self.path(f"{folder}/{i}.dcm"), pixels, series=series, number=i + 1, z=z)
        return self.path(folder)

    def test_dicom_folders(self):
        self.refuse(self.dicom("two_series", [("1.2.3", z) for z in range(4)] + [("1.2.4", z) for z in range(4)]))
        self.refuse(self.dicom("missing_slice", [("1.2.3", z) for z in (0, 1, 2, 4, 5)]))
        self.refuse(self.dicom("uneven", [("1.2.3", z) for z in (0, 1, 2.3, 3, 4)]))
        (self.dir / "nothing").mkdir()
        self.refuse(self.path("nothing"))

    def test_geometry(self):
        image = files.balls()
        for spacing in ((0, 1, 1), (np.nan, 1, 1)):
            self.refuse(files.write_nrrd(self.path("a.nrrd"), image, spacing=spacing))
            self.refuse(files.write_nifti(self.path("a.nii"), image, pixdim=spacing))
        singular = [[1, 0, 0], [0, 1, 0], [1, 1, 0]]
        self.refuse(files.write_nrrd(self.path("a.nrrd"), image, directions=singular))
        affine = np.hstack([np.array(singular).T, np.zeros((3, 1))])
        self.refuse(files.write_nifti(self.path("a.nii"), image, affine=affine))
        affine[0, 0] = np.nan
        self.refuse(files.write_nifti(self.path("a.nii"), image, affine=affine))

    def test_volumes(self):
        image = np.stack([files.balls()] * 3, axis=-1)
        path = files.write_nifti(self.path("a.nii"), image)
        self.refuse(path, says="--volume")
        self.refuse(path, "--volume", 3, code=USAGE)
        self.refuse(path, "--volume", -1, code=USAGE)

    def test_space_time(self):
        image, _ = files.moving_ball()
        path = files.write_nifti(self.path("a.nii"), image)
        refuse = lambda *options, out="out.xdmf", says: self.fail_with(USAGE, "mesh", path, "-o", self.path(out), *options, says=says)
        refuse("--space-time", says="--method paper")
        paper = ("--space-time", "--method", "paper")
        refuse(*paper, out="out.vtu", says=".xdmf")
        refuse(*paper, "--picture", self.path("p.png"), says="--picture")
        refuse(*paper, "--interfaces", self.path("i.xdmf"), says="--interfaces")
        refuse(*paper, "--field", "solid-angle", says="--field")
        refuse(*paper, "--smooth", "2", says="--smooth")
        refuse(*paper, "--elements", "hybrid", says="--elements")
        refuse(*paper, "--volume", 1, says="--volume")
        refuse("--time-step", "1mm", "--volume", "1", says="--space-time")
        for step in ("0", "-1", "x"):
            refuse(*paper, "--time-step", step, says="--time-step")
        still = files.write_nifti(self.path("b.nii"), image[..., 0])
        self.fail_with(USAGE, "mesh", still, "-o", self.path("out.xdmf"), *paper, says="--space-time")

    def test_all_background(self):
        path = files.write_nrrd(self.path("a.nrrd"), np.zeros((9, 9, 9), "uint8"))
        self.fail_with(INPUT, "mesh", path, "-o", self.path("out.vtu"))
        self.fail_with(INPUT, "mesh", path, "-o", self.path("out.vtu"), "--background", "keep")


class BadOptions(ProgramTest):
    def setUp(self):
        super().setUp()
        self.image = files.write_nrrd(self.path("a.nrrd"), files.balls())

    def refuse(self, code, *options, says=""):
        self.fail_with(code, "mesh", self.image, "-o", self.path("out.vtu"), *options, says=says)

    def test_unknown_labels(self):
        for option in (["--size", "9=2mm"], ["--size", "liver=2mm"], ["--interface", "1:9=2mm"], ["--weight", "9=2"],
                       ["--keep", "9"], ["--drop", "9"], ["--merge", "9=1"], ["--keep", "7-9"]):
            self.refuse(USAGE, *option, says=option[0])

    def test_sizes(self):
        for size in ("0", "-1", "-2mm", "0vox", "nan", "inf", "x", "", "2parsec"):
            for option in (["--min-size", size], ["--max-size", size], ["--size", "1=" + size],
                           ["--interface", "0:1=" + size], ["--spacing", size], ["--tolerance", size],
                           ["--region", "box:0,0,0,9,9,9=" + size]):
                self.refuse(USAGE, *option)
        self.refuse(USAGE, "--min-size", "3mm", "--max-size", "2mm", says="--min-size")
        for other in (["--min-size", "1"], ["--tolerance", "1"], ["--method", "paper"]):
            self.refuse(USAGE, "--detail", "fine", *other, says="--detail")
        self.refuse(USAGE, "--region", "box:900,0,0,999,9,9=1", says="--region")
        far = files.write_nrrd(self.path("f.nrrd"), files.balls(), spacing=(1, 1, 1), origin=(9e3, 0, 0))
        self.refuse(USAGE, "--size-image", far, says="f.nrrd")
        self.refuse(INPUT, "--size-image", self.path("none.nrrd"), says="none.nrrd")

    def test_malformed(self):
        for option in (["--size", "1"], ["--size", "=2"], ["--interface", "1=2"], ["--weight", "1=0"],
                       ["--weight", "1=x"], ["--merge", "1"], ["--roi", "0:1"], ["--roi", "0:99,0:1,0:1"],
                       ["--method", "magic"], ["--field", "magic"], ["--background", "maybe"], ["--balance", "0"],
                       ["--balance", "x"], ["--snap", "0.5"], ["--snap", "-1"], ["--smooth", "-1"], ["--sigma", "0"], ["--sigma", "x"], ["--quality", "-1"], ["--quality", "80"],
                       ["--quality-floor", "25"], ["--border", "maybe"], ["--threads", "-1"], ["--region", "box:0,0,0,9,9=1"], ["--region", "cone:0,0,0,9=1"], ["--region", "box:0,0,0,9,9,x=1"],
                       ["--region", "sphere:0,0,0,0=1"], ["--region", "sphere:0,0,0,1"], ["--layers", "-1"], ["--layers", "x"], ["--grading", "0"],
                       ["--grading", "2"], ["--detail", "magic"],
                       ["--pattern", "1"], ["--pattern", "x"], ["--pattern", "2x2"], ["--space", "mars"],
                       ["--no-such-option"], ["surplus"], ["--config", self.path("none.toml")]):
            self.refuse(USAGE, *option)

    def test_what_a_method_does_not_take(self):
        for option in (["--pattern", "3"], ["--balance", "2"], ["--balance", "none"], ["--snap", "0.1"],
                       ["--smooth", "3"], ["--weight", "1=2"], ["--order", "smallest"], ["--order", "1"]):
            self.refuse(USAGE, "--method", "guaranteed", *option, says=option[0])
        for option in (["--snap", "0.1"], ["--order", "label"], ["--weight", "1=2"], ["--interface", "0:1=2"],
                       ["--elements", "hybrid"], ["--border", "closed"]):
            self.refuse(USAGE, "--method", "nielson-franke", *option, says=option[0])
        self.refuse(USAGE, "--method", "nielson-sung", says="two materials")
        for option in (["--field", "grey"], ["--border", "closed"], ["--order", "none"], ["--order", "1,1"]):
            self.refuse(USAGE, "--method", "paper", *option, says=option[0])

    def test_extras(self):
        for option in (["--partitions", "1"], ["--partitions", "-2"], ["--partitions", "100000000"],
                       ["--node-set", "a=ball:1"], ["--node-set", "a=nodes:99999999"], ["--node-set", "a=plane:0,0,1,-99"],
                       ["--node-set", "partition=nodes:1"], ["--facets", "magic"],
                       ["--method", "guaranteed", "--facets", "extended"]):
            self.refuse(USAGE, *option, says=option[-2])
        for option in (["--partitions", "2"], ["--node-set", "a=nodes:1"], ["--interfaces", self.path("i.vtu")]):
            self.refuse(USAGE, "--surface", *option, says=option[0])
        for name in ("m.stl", "m.vtp", "m.ply"):
            self.fail_with(USAGE, "mesh", self.image, "-o", self.path(name), says="--surface")
        self.fail_with(USAGE, "mesh", self.image, "-o", self.path("m.mesh"), "--partitions", 2, says="m.mesh")
        flat = files.write_nrrd(self.path("flat.nrrd"), files.balls()[:, :, 5].copy())
        for name in ("m.stl", "m.ply"):
            self.fail_with(USAGE, "mesh", flat, "-o", self.path(name), "--surface", says=".vtp")

    def test_grey(self):
        self.refuse(USAGE, "--grey", self.image, says="--threshold")
        self.refuse(USAGE, "--grey", self.image, "--threshold", 1, "--field", "dgf", says="--grey")
        self.refuse(USAGE, "--field", "grey", says="--grey")
        self.refuse(INPUT, "--grey", self.path("none.nrrd"), "--threshold", 1)
        other = files.write_nrrd(self.path("other.nrrd"), files.balls((9, 9, 9)).astype("float32"))
        self.refuse(INPUT, "--grey", other, "--threshold", 1)
        flat = files.write_nrrd(self.path("flat.nrrd"), files.balls()[:, :, 5])
        self.refuse(INPUT, "--grey", flat, "--threshold", 1)

    def test_no_command(self):
        self.fail_with(USAGE)
        self.fail_with(USAGE, "knead")
        self.fail_with(USAGE, "mesh")
        self.fail_with(USAGE, "mesh", self.image)

    def test_config_with_an_unknown_option(self):
        (self.dir / "c.toml").write_text("[mesh]\nno-such-option=1\n")
        self.refuse(USAGE, "--config", self.path("c.toml"))


class BadSlices(ProgramTest):
    def test_slice(self):
        image, _ = files.moving_ball(side=12, moments=3, radius=3)
        mesh = self.path("m.xdmf")
        self.succeed("mesh", files.write_nifti(self.path("a.nii"), image), "--space-time", "--method", "paper", "-o", mesh)
        for time in ("-3", "99"):
            self.fail_with(USAGE, "slice", mesh, "--time", time, "-o", self.path("s.vtu"), says="--time")
        self.fail_with(USAGE, "slice", mesh, "-o", self.path("s.vtu"), says="--time")
        self.fail_with(USAGE, "slice", mesh, "--time", "1", "-o", self.path("s.xyz"), says="s.xyz")
        self.fail_with(INPUT, "slice", self.path("none.xdmf"), "--time", "1", "-o", self.path("s.vtu"))
        self.fail_with(OUTPUT, "slice", mesh, "--time", "1", "-o", mesh, says="--force")


class BadOutput(ProgramTest):
    def setUp(self):
        super().setUp()
        self.image = files.write_nrrd(self.path("a.nrrd"), files.balls())

    def test_unknown_extension(self):
        for name in ("out", "out.xyz", "out.vtu.gz"):
            self.fail_with(USAGE, "mesh", self.image, "-o", self.path(name), says=name)
        self.fail_with(USAGE, "mesh", self.image, "-o", self.path("m.vtu"), "--interfaces", self.path("i.xyz"))
        self.fail_with(USAGE, "mesh", self.image, "-o", self.path("m.vtu"), "--picture", self.path("p.xyz"))

    def test_unwritable(self):
        for option in ("-o", "--interfaces", "--report", "--picture"):
            name = {"--report": "r.json", "--picture": "p.png"}.get(option, "m.vtu")
            rest = [] if option == "-o" else ["-o", self.path("m.vtu")]
            for folder in ("none/", "a.nrrd/"):
                self.fail_with(OUTPUT, "mesh", self.image, option, self.path(folder + name), *rest)
            (self.dir / name).write_text("old")
            self.fail_with(OUTPUT, "mesh", self.image, option, self.path(name), *rest, says="--force")
            self.assertEqual((self.dir / name).read_text(), "old")
            (self.dir / name).unlink()

    def test_one_name_for_two_files(self):
        self.fail_with(USAGE, "mesh", self.image, "-o", self.path("m.vtu"), "--interfaces", self.path("m.vtu"))

    def test_nowhere_for_what_exceeds_the_memory(self):
        image = files.write_nrrd(self.path("a.nrrd"), files.balls())
        mesh = ["mesh", image, "-o", self.path("m.vtu")]
        self.fail_with(USAGE, *mesh, "--scratch", str(self.dir), says="--max-memory")
        for little in ("0", "99MB", "much"):
            self.fail_with(USAGE, *mesh, "--max-memory", little, says="--max-memory")
        for nowhere in (self.path("none"), image, "/proc"):
            self.fail_with(OUTPUT, *mesh, "--max-memory", "1GB", "--scratch", nowhere, says=nowhere)
        if in_memory(os.getcwd()):
            return
        scratch = ["--max-memory", "100MB", "--scratch", os.getcwd()]
        # An estimate of 1e15 cells, for which no disk has room.
        self.fail_with(LIMITS, *mesh, *scratch, "--min-size", "0.00001", says="free in " + os.getcwd())
        # A disk that is full before the estimate tells that it will be.
        files.write_nrrd(image, np.random.default_rng(1).integers(0, 9, (100, 100, 100)).astype("uint8"))
        self.fail_with(LIMITS, *mesh, *scratch, says="--scratch", file_size_limit=80_000_000)

    def test_disk_full(self):
        for name in ("m.vtu", "m.msh", "m.mesh", "m.xdmf"):
            self.fail_with(OUTPUT, "mesh", self.image, "-o", self.path(name), file_size_limit=2000)


if __name__ == "__main__":
    unittest.main()
