#!/usr/bin/env python3
"""Writes a raw NRRD image with smooth regions of any size: make_phantom.py EXTENT LABELS FILE.

Labels are the cells of two families of wavy layers, so there are interfaces, junction curves and junction points, and
the share of voxels near them falls as the extent grows, as in a scan of higher resolution."""
import math
import sys

import numpy as np


def main():
    n, labels, path = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    levels = max(1, math.isqrt(labels))
    x = (np.arange(n) + 0.5) / n
    wave = [np.sin(2 * math.pi * (f * x + p)).astype(np.float32) for f, p in
            ((1.3, 0.1), (0.9, 0.35), (1.1, 0.7), (0.8, 0.2), (1.2, 0.55), (1.0, 0.9))]
    with open(path, "wb") as out:
        out.write(f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {n} {n} {n}\nencoding: raw\nspacings: 1 1 1\n\n".encode())
        first, second = (wave[0][None, :] + wave[1][:, None]), (wave[3][None, :] + wave[4][:, None])
        for z in range(n):
            i = ((first + wave[2][z] + 3) * (levels / 6.001)).astype(np.uint8)
            j = ((second + wave[5][z] + 3) * (levels / 6.001)).astype(np.uint8)
            out.write((i * levels + j).astype(np.uint8).tobytes())


if __name__ == "__main__":
    main()
