#!/usr/bin/env python3
"""Global rotations from the relative ones of a file: usage average_rotations.py INPUT.g2o|EGs.txt ROTATIONS.npz

g2o: lines `EDGE_SE3:QUAT i j tx ty tz qx qy qz qw ...`, the pose of frame j in frame i. 1DSfM: lines `i j R(9) t(3)`,
R = R_i R_j^T in Bundler's camera frame (y up, z backward). What is written: `ids`, and `rotations` cam_from_world.
"""
import sys

import numpy as np

import cairn


def read_g2o(path):
    rows = [line.split() for line in open(path) if line.startswith("EDGE_SE3:QUAT")]
    # x_i = R x_j + t, so that cam_j_from_cam_i is the inverse.
    rotations = [cairn.Rotation3d.from_quat(np.array(row[6:10], float)).matrix().T for row in rows]
    return np.array([row[1:3] for row in rows], int), np.array(rotations)


def read_one_dsfm(path):
    rows = np.loadtxt(path, ndmin=2)
    flip = np.diag([1.0, -1.0, -1.0])
    matrices = rows[:, 2:11].reshape(-1, 3, 3).transpose(0, 2, 1)
    u, _, vt = np.linalg.svd(flip @ matrices @ flip)  # the nearest rotations: the file has few digits
    return rows[:, :2].astype(int), u @ vt


def main(path, output_path):
    pairs, rotations = read_g2o(path) if path.endswith(".g2o") else read_one_dsfm(path)
    report = cairn.average_rotations(pairs, rotations)
    print(f"{report.status}: {len(report.image_ids)} rotations, "
          f"median residual {report.median_residual_deg:.3f} degrees, "
          f"{report.num_rejected} of {len(pairs)} edges rejected")
    np.savez(output_path, ids=report.image_ids, rotations=report.rotations)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
