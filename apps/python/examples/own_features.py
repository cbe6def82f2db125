#!/usr/bin/env python3
"""Features and matches of any extractor and matcher to a model: usage own_features.py FEATURES.npz OUTPUT

The file has for each image `<name>/keypoints` (n, 2), or (n, 6) with affine shapes (x, y, a11, a12, a21, a22), pixels
with the center of the top-left one at (0.5, 0.5); for each pair `<name1>|<name2>/matches` (m, 2), indices of keypoints;
`size`, width and height; and `focal_px`.
"""
import pathlib
import sys

import numpy as np

import cairn


def write_database(features, path):
    names = [key.removesuffix("/keypoints") for key in features if key.endswith("/keypoints")]
    width, height = map(int, features["size"])
    camera = cairn.Camera.create(1, "SIMPLE_RADIAL", float(features["focal_px"]), width, height)
    camera.has_prior_focal_length = True  # False: a guess, which the matches correct
    with cairn.Database(path) as database, database.transaction():
        camera_id = database.write_camera(camera)
        ids = {name: database.write_image(name, camera_id) for name in sorted(names)}
        for name in names:
            database.write_keypoints(ids[name], features[name + "/keypoints"])
        for key in features:
            if key.endswith("/matches"):
                name1, name2 = key.removesuffix("/matches").split("|")
                database.write_matches(ids[name1], ids[name2], features[key])


def main(features_path, output):
    output = pathlib.Path(output)
    output.mkdir(parents=True, exist_ok=True)
    write_database(np.load(features_path), output / "scene.db")
    print(cairn.build_view_graph(output / "scene.db"))
    result = cairn.reconstruct(output / "scene.db", output_path=output / "model")
    if not result.succeeded:
        sys.exit(result.failure)
    for model in result.models:
        print(model, f"{model.compute_mean_reprojection_error():.2f} px")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
