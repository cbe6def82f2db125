"""From features and matches of another program, or from photographs, to models: the truth is known."""
import os
import pathlib
import sqlite3

import numpy as np
import pytest

import cairn
import scene

TRUTH = scene.Scene()


def only_positions(path):
    """Gives keypoints two columns, as other programs write them."""
    database = sqlite3.connect(path)
    for image_id, data in database.execute("SELECT image_id, data FROM keypoints").fetchall():
        positions = np.frombuffer(data, np.float32).reshape(-1, 6)[:, :2].tobytes()
        database.execute("UPDATE keypoints SET cols = 2, data = ? WHERE image_id = ?", (positions, image_id))
    database.commit()
    assert {row[0] for row in database.execute("SELECT cols FROM keypoints")} == {2}
    database.close()


def check_models(result, least_points=400):
    assert result.succeeded and result.failure == "" and len(result.models) == 1
    model = result.models[0]
    evaluation = cairn.evaluate(model, TRUTH.truth())
    assert evaluation.num_registered == 8 and evaluation.auc[1] > 0.99
    assert model.num_points3D() >= least_points and model.compute_mean_reprojection_error() < 0.1


@pytest.mark.parametrize("depth,verifier", [(True, "triangles"), (False, "five_point")])
def test_keypoints_of_two_columns(tmp_path, depth, verifier):
    path = tmp_path / "scene.db"
    TRUTH.write(path, depth=depth)
    only_positions(path)
    report = cairn.build_view_graph(path)
    assert report.succeeded and report.num_verified == 28 and report.num_images == 8
    graph = cairn.ViewGraph.from_database(path)
    assert set(graph.verifiers) == {verifier} and graph.is_active.all()
    for (i, j), R, t in zip(graph.pairs, graph.rotations, graph.translations):
        assert scene.pose_error_deg(cairn.Rigid3d(R, t), TRUTH.relative(i, j)) < 0.05
    check_models(cairn.reconstruct(path))


def test_hard_pairs_of_two_columns_have_the_full_budget(tmp_path):
    """Four of five matches are wrong: a tenth of the five-point samples finds hardly any pair."""
    path = tmp_path / "scene.db"
    TRUTH.write(path, num_wrong=400)
    only_positions(path)
    assert cairn.build_view_graph(path).num_verified == 28
    few = tmp_path / "few.db"
    TRUTH.write(few, num_wrong=400)
    assert cairn.build_view_graph(few, options={"verification.max_iterations": 200}).num_verified < 20


def test_keypoints_with_frames_and_depth_are_decided_by_one_match(tmp_path):
    path = tmp_path / "scene.db"
    TRUTH.write(path, frames=True, depth=True)
    for options in ([1], 5, "x"):
        with pytest.raises(cairn.ConfigError, match="options: .* is not a dictionary"):
            cairn.build_view_graph(path, options=options)
    for name in ("database_path", "image_path", "depth_path"):
        with pytest.raises(cairn.ConfigError, match=f"{name}: is an argument, and no option"):
            cairn.build_view_graph(path, options={name: "other"})
    cairn.build_view_graph(path)
    assert set(cairn.ViewGraph.from_database(path).verifiers) == {"one_ac_depth"}
    check_models(cairn.reconstruct(path))


def test_runs_continue_and_give_the_same_for_any_number_of_threads(tmp_path):
    graphs = []
    for num_threads in (1, 4):
        path = tmp_path / f"{num_threads}.db"
        TRUTH.write(path)
        cairn.build_view_graph(path, num_threads=num_threads, options={"verification": {"min_num_inliers": 30}})
        again = cairn.build_view_graph(path)  # with the options of the first run, and nothing to do
        assert again.num_verified == 28
        graphs.append(cairn.ViewGraph.from_database(path))
    np.testing.assert_array_equal(graphs[0].rotations, graphs[1].rotations)
    np.testing.assert_array_equal(graphs[0].num_inliers, graphs[1].num_inliers)
    with pytest.raises(cairn.ConfigError, match="min_num_inliers"):
        cairn.build_view_graph(path, options={"verification.min_num_inliers": 40})


def test_the_seed_of_the_first_run_stays(tmp_path):
    path = tmp_path / "scene.db"
    TRUTH.write(path)
    assert cairn.build_view_graph(path, seed=5).num_verified == 28
    assert cairn.build_view_graph(path).to_dict()["seed"] == 5
    with pytest.raises(cairn.ConfigError, match="seed"):
        cairn.build_view_graph(path, seed=0)
    with pytest.raises(cairn.ConfigError, match="seed: "):
        cairn.build_view_graph(path, seed=-1)


def test_reconstruct_writes_what_the_program_writes(tmp_path):
    path, output = tmp_path / "scene.db", tmp_path / "model"
    TRUTH.write(path)
    cairn.build_view_graph(path)
    stages = []
    result = cairn.reconstruct(path, output_path=output, seed=4, num_threads=1, refine_intrinsics=True, progress=lambda *stage: stages.append(stage),
                               options={"reconstruct.min_image_points": 10})
    check_models(result)
    assert cairn.evaluate(output / "sparse/0", result.models[0]).auc[1] > 0.9999
    page = (output / "report.html").read_text()
    assert page.startswith("<!doctype html>") and "photo03.jpg" in page and "sparse/0" in page
    assert f'database_path = "{path}"' in (output / "effective.toml").read_text()
    assert {"report.json", "view_graph.json", "confidence.csv"} <= {file.name for file in output.iterdir()}
    lines = (output / "effective.toml").read_text().splitlines()
    assert {"min_image_points = 10", "seed = 4", "num_threads = 1", "refine_intrinsics = true"} <= set(lines)
    assert len({name for name, done, total in stages}) > 2 and all(0 <= done for _, done, _ in stages)
    assert result.image_names[3] == "photo03.jpg" and len(result.view_graph) == 28
    assert {stage["name"] for stage in result.to_dict()["stages"]} >= {"view_graph", "rotation_averaging"}
    cairn.reconstruct(path, output_path=output, report=False)
    assert not (output / "report.html").exists()
    failed = cairn.reconstruct(path, output_path=tmp_path / "failed", options={"view_graph.min_num_inliers": 100000})
    assert not failed.succeeded and "view_graph.min_num_inliers" in (tmp_path / "failed/report.html").read_text()
    (output / "sparse/0/images.bin").write_bytes(b"mine")
    with pytest.raises(cairn.ConfigError, match="images.bin"):
        cairn.reconstruct(path, output_path=output)


def test_warnings_are_texts(tmp_path):
    path, gps = tmp_path / "scene.db", tmp_path / "gps.txt"
    TRUTH.write(path)
    report = cairn.build_view_graph(path)
    assert report.warnings == [] and report.to_dict()["warnings"] == []
    gps.write_text("photo01.jpg 47 8 500\n")
    result = cairn.reconstruct(path, options={"use_gps": True, "gps_path": str(gps)})
    assert result.succeeded and len(result.warnings) == 1 and "not in meters" in result.warnings[0]


def test_pairs_that_are_left_out_are_counted(tmp_path):
    """Keypoints that were replaced by fewer, and a photograph without any."""
    path = tmp_path / "scene.db"
    TRUTH.write(path)
    with cairn.Database(path) as database:
        database.write_keypoints(2, database.read_keypoints(2)[:300])
        extra = database.write_image("extra.jpg", 1)
        database.write_matches(1, extra, np.tile(np.arange(50)[:, None], 2))
    warning, = cairn.build_view_graph(path).warnings
    assert warning.startswith("7 pairs are left out; for example, matches of photo01.jpg and photo02.jpg refer to keypoints")
    assert "extra.jpg" not in warning
    assert all("not verified yet" not in text for text in cairn.reconstruct(path).warnings)


def test_descriptors_of_another_width_are_named(tmp_path):
    path = tmp_path / "scene.db"
    with cairn.Database(path) as database, database.transaction():
        camera_id = database.write_camera(TRUTH.camera)
        for i in (1, 2, 3):
            database.write_image(scene.name_of(i), camera_id, i)
            database.write_keypoints(i, TRUTH.observe(i)[0])
            database.write_descriptors(i, np.random.default_rng(i).integers(0, 99, (500, 128), dtype=np.uint8))
    database = sqlite3.connect(path)
    database.execute("UPDATE descriptors SET cols = 64, rows = 1000 WHERE image_id = 2")
    database.commit()
    database.close()
    with cairn.Database(path) as database:
        with pytest.raises(cairn.IoError, match="descriptors of image 2: 64 columns instead of 128"):
            database.read_descriptors(2)
    report = cairn.build_view_graph(path)
    assert report.num_pairs == 1 and "descriptors of image 2: 64 columns instead of 128" in report.warnings[0]


def test_expected_failures_are_told_in_the_result(tmp_path):
    path = tmp_path / "scene.db"
    TRUTH.write(path)
    result = cairn.reconstruct(path)
    assert not result.succeeded and result.failure and result.models == []
    with pytest.raises(OSError, match="none.db"):
        cairn.reconstruct(tmp_path / "none.db")
    with pytest.raises(cairn.ConfigError, match="unknown key 'track.min_length'; did you mean 'tracks.min_length'"):
        cairn.reconstruct(path, options={"track.min_length": 3})
    with pytest.raises(cairn.ConfigError, match="tracks.min_length"):
        cairn.reconstruct(path, options={"tracks.min_length": -3})


def test_options_are_those_of_the_programs():
    options = cairn.default_options("build_view_graph")
    assert options["matching.max_ratio"] == 0.8 and options["verifier"] == "cascade" and options["pairs"] == "auto"
    assert cairn.option_help("reconstruct").keys() == cairn.default_options("reconstruct").keys()
    assert "ratio" in cairn.option_help("build_view_graph")["matching.max_ratio"]
    with pytest.raises(cairn.ConfigError, match="function: 'verify'"):
        cairn.default_options("verify")


@pytest.mark.skipif("CAIRN_SCENE" not in os.environ, reason="no rendered scene")
def test_photographs_to_models(tmp_path):
    """The scene that the integration tests render, with depth maps."""
    photos = pathlib.Path(os.environ["CAIRN_SCENE"])
    path = tmp_path / "scene.db"
    report = cairn.build_view_graph(path, photos / "images", photos / "depth",
                                    options={"features.max_num_features": 800, "pairs": "exhaustive"})
    assert report.succeeded and report.num_verified == report.verified_by["cascade"] and "10 with depth" in str(report)
    assert "one_ac_depth" in cairn.ViewGraph.from_database(path).verifiers
    result = cairn.reconstruct(path, photos / "images")
    evaluation = cairn.evaluate(result.models[0], photos / "truth")
    assert evaluation.num_registered == 8 and evaluation.auc[10] > 0.9  # tiny photographs
    assert result.models[0].point_colors().std() > 5
