"""Image files for tests, good and bad, written by hand so that every byte can be wrong on purpose."""
import gzip
import struct
import zlib

import numpy as np

NRRD_TYPE = {"uint8": "uint8", "int16": "int16", "int32": "int32", "int64": "int64", "uint32": "uint32",
             "float32": "float", "float64": "double"}


def balls(extent=(14, 12, 10), labels=(1, 2)):
    """Two touching balls of different labels in a box of zeros (array indexed x, y, z)."""
    grid = np.meshgrid(*[np.arange(n) + 0.5 for n in extent], indexing="ij")
    image = np.zeros(extent, np.int32)
    for k, label in enumerate(labels):
        centre = [n * 0.5 for n in extent]
        centre[0] = extent[0] * (0.33 + 0.34 * k)
        r2 = sum((g - c) ** 2 for g, c in zip(grid, centre))
        image[(r2 < (0.3 * min(extent)) ** 2) & (image == 0)] = label
    return image


def moving_ball(side=24, moments=12, radius=9.3):
    """A ball of label 3 that swings along x, one volume a moment, and its centres."""
    grid = np.meshgrid(*[np.arange(side) + 0.5] * 3, indexing="ij")
    image = np.zeros((side, side, side, moments), np.uint8)
    centres = [side / 2 + (side / 2 - radius - 1) * np.sin(2 * np.pi * t / moments) for t in range(moments)]
    for t, x in enumerate(centres):
        r2 = (grid[0] - x) ** 2 + (grid[1] - side / 2) ** 2 + (grid[2] - side / 2) ** 2
        image[..., t][r2 < radius**2] = 3
    return image, centres


def write_nrrd(path, array, spacing=None, directions=None, origin=None, space="left-posterior-superior", truncate=0,
               header=""):
    """Raw NRRD; `truncate` bytes are cut off the end."""
    n = array.ndim
    lines = ["NRRD0004", f"type: {NRRD_TYPE[array.dtype.name]}", f"dimension: {n}",
             "sizes: " + " ".join(str(s) for s in array.shape), "encoding: raw", "endian: little"]
    if directions is None and spacing is not None and n == 3:
        directions = np.diag(spacing)
    if directions is not None:
        vector = lambda v: "(" + ",".join(repr(float(x)) for x in v) + ")"
        lines += [f"space: {space}", "space directions: " + " ".join(vector(d) for d in directions),
                  "space origin: " + vector(origin if origin is not None else [0] * len(directions))]
    elif spacing is not None:
        lines += ["spacings: " + " ".join(repr(float(s)) for s in spacing)]
    data = array.astype(array.dtype.newbyteorder("<")).tobytes(order="F")
    with open(path, "wb") as f:
        f.write(("\n".join(lines) + "\n" + header + "\n").encode() + data[:len(data) - truncate])
    return path


def write_nifti(path, array, affine=None, scale=(1.0, 0.0), pixdim=(1.0, 1.0, 1.0), dim=None, truncate=0, sform=None):
    """NIfTI-1 with an sform from `affine` (or none), any `dim` field, any scaling."""
    codes = {"uint8": (2, 8), "int16": (4, 16), "int32": (8, 32), "float32": (16, 32), "float64": (64, 64),
             "int64": (1024, 64), "uint32": (768, 32)}
    code, bits = codes[array.dtype.name]
    header = bytearray(348)
    struct.pack_into("<i", header, 0, 348)
    dim = list(dim or [array.ndim, *array.shape])
    struct.pack_into("<8h", header, 40, *(dim + [1] * (8 - len(dim))))
    struct.pack_into("<2h", header, 70, code, bits)
    struct.pack_into("<8f", header, 76, 1.0, *(list(pixdim) + [1.0] * (7 - len(pixdim))))
    struct.pack_into("<3f", header, 108, 352.0, *scale)
    header[123] = 2  # millimetres
    if affine is not None:
        struct.pack_into("<h", header, 254, 1)
        for row in range(3):
            struct.pack_into("<4f", header, 280 + 16 * row, *[float(x) for x in affine[row]])
    header[344:348] = b"n+1\0"
    data = bytes(header) + b"\0\0\0\0" + array.astype(array.dtype.newbyteorder("<")).tobytes(order="F")
    data = data[:len(data) - truncate]
    with (gzip.open(path, "wb") if str(path).endswith(".gz") else open(path, "wb")) as f:
        f.write(data)
    return path


def write_png(path, rows, colour_type=0, bits=8, palette=None):
    """PNG of raw rows of bytes: colour type 0 grey, 2 RGB, 3 palette."""
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    channels = 3 if colour_type == 2 else 1
    width = len(rows[0]) // channels // (bits // 8)
    data = b"".join(b"\0" + bytes(r) for r in rows)
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n")
        f.write(chunk(b"IHDR", struct.pack(">IIBBBBB", width, len(rows), bits, colour_type, 0, 0, 0)))
        if palette:
            f.write(chunk(b"PLTE", bytes(palette)))
        f.write(chunk(b"IDAT", zlib.compress(data)))
        f.write(chunk(b"IEND", b""))
    return path


def write_dicom(path, pixels, series="1.2.3", number=1, z=0.0):
    """One 16-bit slice (array indexed row, column) in explicit little endian."""
    def element(group, tag, vr, value):
        value = value.encode() if isinstance(value, str) else value
        if len(value) % 2:
            value += b"\0" if vr in ("UI", "OW") else b" "
        length = struct.pack("<HI", 0, len(value)) if vr in ("OB", "OW") else struct.pack("<H", len(value))
        return struct.pack("<HH", group, tag) + vr.encode() + length + value

    image_class, instance = "1.2.840.10008.5.1.4.1.1.2", f"{series}.{number}"
    meta = (element(2, 1, "OB", b"\0\1") + element(2, 2, "UI", image_class) + element(2, 3, "UI", instance) +
            element(2, 0x10, "UI", "1.2.840.10008.1.2.1") + element(2, 0x12, "UI", "1.2.3.4"))
    short = lambda v: struct.pack("<H", v)
    body = b"".join([
        element(8, 0x16, "UI", image_class), element(8, 0x18, "UI", instance), element(8, 0x60, "CS", "CT"),
        element(0x18, 0x50, "DS", "1"), element(0x20, 0xd, "UI", "1.2.9"), element(0x20, 0xe, "UI", series),
        element(0x20, 0x13, "IS", str(number)), element(0x20, 0x32, "DS", f"0\\0\\{z}"),
        element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0"), element(0x28, 2, "US", short(1)),
        element(0x28, 4, "CS", "MONOCHROME2"), element(0x28, 0x10, "US", short(pixels.shape[0])),
        element(0x28, 0x11, "US", short(pixels.shape[1])), element(0x28, 0x30, "DS", "1\\1"),
        element(0x28, 0x100, "US", short(16)), element(0x28, 0x101, "US", short(16)),
        element(0x28, 0x102, "US", short(15)), element(0x28, 0x103, "US", short(0)),
        element(0x7fe0, 0x10, "OW", pixels.astype("<u2").tobytes())])
    with open(path, "wb") as f:
        f.write(b"\0" * 128 + b"DICM" + element(2, 0, "UL", struct.pack("<I", len(meta))) + meta + body)
    return path
