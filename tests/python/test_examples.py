"""The examples as a user runs them, with the truth known."""
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest

import cairn
import scene

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "apps/python/examples"


def run(example, *arguments):
    result = subprocess.run([sys.executable, EXAMPLES / example, *map(str, arguments)], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize("columns", [2, 6])
def test_own_features(tmp_path, columns):
    truth = scene.Scene(num_images=6, num_points=300)
    arrays = {"size": [scene.WIDTH, scene.HEIGHT], "focal_px": scene.FOCAL}
    for i in truth.image_ids:
        pixels, shapes, _ = truth.observe(i)
        arrays[scene.name_of(i) + "/keypoints"] = np.column_stack([pixels, shapes.reshape(-1, 4)])[:, :columns]
    for i, j in truth.pairs:
        arrays[f"{scene.name_of(i)}|{scene.name_of(j)}/matches"] = truth.matches(i, j, num_wrong=60)[0]
    np.savez(tmp_path / "features.npz", **arrays)
    assert "num_images=6" in run("own_features.py", tmp_path / "features.npz", tmp_path / "output")
    evaluation = cairn.evaluate(tmp_path / "output/model/sparse/0", truth.truth())
    assert evaluation.num_registered == 6 and evaluation.auc[1] > 0.99


def global_errors(path, truth):
    """Degrees, after the first rotation is aligned."""
    result = np.load(path)
    rotations = dict(zip(result["ids"], result["rotations"]))
    gauge = rotations[0].T @ truth[0]
    return [scene.angle_deg(rotations[i] @ gauge, truth[i]) for i in range(len(truth))]


def test_average_rotations_of_a_g2o_file(tmp_path):
    rng = np.random.default_rng(4)
    truth = [scene.random_rotation(rng) for _ in range(20)]
    lines = ["VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1"]
    for i in range(20):
        for j in range(i + 1, min(20, i + 5)):
            quat = cairn.Rotation3d(truth[i] @ truth[j].T).quat
            lines.append(f"EDGE_SE3:QUAT {i} {j} 1 0 0 {' '.join(map(str, quat))} " + " ".join(["1"] * 21))
    (tmp_path / "graph.g2o").write_text("\n".join(lines))
    assert "success: 20 rotations" in run("average_rotations.py", tmp_path / "graph.g2o", tmp_path / "out.npz")
    assert max(global_errors(tmp_path / "out.npz", truth)) < 0.01


def test_average_rotations_of_a_1dsfm_file(tmp_path):
    rng = np.random.default_rng(5)
    truth = [scene.random_rotation(rng) for _ in range(20)]
    flip = np.diag([1.0, -1.0, -1.0])
    lines = []
    for i in range(20):
        for j in range(i + 1, min(20, i + 5)):
            R = flip @ truth[i] @ truth[j].T @ flip
            lines.append(f"{i} {j} " + " ".join(f"{x:.6f}" for x in R.ravel()) + " 1 0 0")
    (tmp_path / "EGs.txt").write_text("\n".join(lines))
    assert "0 of 70 edges rejected" in run("average_rotations.py", tmp_path / "EGs.txt", tmp_path / "out.npz")
    assert max(global_errors(tmp_path / "out.npz", truth)) < 0.01


def test_removed_edges(tmp_path):
    truth = scene.Scene(num_images=8, num_points=300)
    truth.write(tmp_path / "scene.db", num_wrong=50)
    cairn.build_view_graph(tmp_path / "scene.db")
    with cairn.Database(tmp_path / "scene.db") as database:  # a pair with the pose of another one
        database.write_two_view_geometry(2, 5, database.read_two_view_geometry(1, 8))
    output = run("removed_edges.py", tmp_path / "scene.db", tmp_path / "edges.png")
    assert "in_use: 27" in output and "triplet_inconsistent: 1" in output
    picture = (tmp_path / "edges.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and len(picture) > 10000


@pytest.mark.skipif("CAIRN_SCENE" not in os.environ, reason="no rendered scene")
def test_masks_and_depth(tmp_path):
    photos = pathlib.Path(os.environ["CAIRN_SCENE"])
    arrays = tmp_path / "arrays"
    arrays.mkdir()
    for file in (photos / "depth").glob("*.npy"):
        shutil.copy(file, arrays / (file.name.removesuffix(".npy") + ".depth.npy"))
    mask = np.ones((360, 480), np.uint8)
    mask[:, :100] = 0
    np.save(arrays / "image00000.jpg.mask.npy", mask)
    output = run("masks_and_depth.py", photos / "images", arrays, tmp_path / "output")
    assert "image00000.jpg: " in output and "10 with depth" in output
    assert "one_ac_depth" in cairn.ViewGraph.from_database(tmp_path / "output/scene.db").verifiers
    model = cairn.Reconstruction(tmp_path / "output/model/sparse/0")
    first = next(image for image in model.images.values() if image.name == "image00000.jpg")
    assert len(first.keypoints) > 100 and first.keypoints[:, 0].min() >= 100
    evaluation = cairn.evaluate(model, photos / "truth")
    assert evaluation.num_registered == 8 and evaluation.auc[1] > 0.8
