#!/usr/bin/env python3
"""A photograph's own mask and depth from arrays: usage masks_and_depth.py IMAGES ARRAYS OUTPUT

ARRAYS has for an image `<name>.depth.npy`, z-depth as a network or a sensor gives it, of any size and unit, and
`<name>.mask.npy`, of the photograph's size, 0 where nothing is to be found (the background of a turntable, a
watermark). Either may be absent. Features are computed as always, those under the mask are dropped, and depth is
sampled at the others.
"""
import pathlib
import sys

import numpy as np

import cairn


def drop_masked(database, image_id, mask):
    """Keypoints of an image whose pixel has 0 in the mask, with their descriptors."""
    keypoints, descriptors = database.read_keypoints(image_id), database.read_descriptors(image_id)
    column, row = keypoints[:, :2].astype(int).T  # the pixel (0, 0) is from 0 to 1
    height, width = mask.shape
    is_kept = mask[row.clip(0, height - 1), column.clip(0, width - 1)] > 0
    database.write_keypoints(image_id, keypoints[is_kept])
    database.write_descriptors(image_id, descriptors[is_kept])
    return np.count_nonzero(~is_kept)


def main(image_path, arrays, output):
    arrays, output = pathlib.Path(arrays), pathlib.Path(output)
    output.mkdir(parents=True, exist_ok=True)
    database_path = output / "scene.db"
    cairn.build_view_graph(database_path, image_path, options={"stop_after": "features"})
    with cairn.Database(database_path) as database, database.transaction():
        cameras = {camera.camera_id: camera for camera in database.read_cameras()}
        for image in database.read_images():
            camera = cameras[image.camera_id]
            mask_path, depth_path = (arrays / f"{image.name}.{kind}.npy" for kind in ("mask", "depth"))
            if mask_path.exists():
                num_dropped = drop_masked(database, image.image_id, np.load(mask_path))
                print(f"{image.name}: {num_dropped} keypoints under the mask")
            if depth_path.exists():
                keypoints = database.read_keypoints(image.image_id)
                samples = cairn.sample_depth(np.load(depth_path), camera.width, camera.height, keypoints)
                database.write_depth_samples(image.image_id, samples)
    print(cairn.build_view_graph(database_path))
    result = cairn.reconstruct(database_path, image_path, output / "model")
    if not result.succeeded:
        sys.exit(result.failure)
    print(result.models[0])


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
