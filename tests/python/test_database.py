import sqlite3
import threading
import time

import numpy as np
import pytest

import cairn
import scene


def make(path):
    database = cairn.Database(path)
    camera_id = database.write_camera(cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240]))
    return database, camera_id, [database.write_image(name, camera_id) for name in ("a.jpg", "b/c.jpg")]


def test_rows_are_read_as_they_were_written(tmp_path):
    rng = np.random.default_rng(0)
    database, camera_id, (first, second) = make(tmp_path / "scene.db")
    assert [c.camera_id for c in database.read_cameras()] == [camera_id] == [1]
    assert [(i.image_id, i.name, i.camera_id) for i in database.read_images()] == [(1, "a.jpg", 1), (2, "b/c.jpg", 1)]
    frames = rng.uniform(1, 100, (7, 6)).astype(np.float32)
    database.write_keypoints(first, frames)
    database.write_keypoints(second, frames[:, :2])
    np.testing.assert_array_equal(database.read_keypoints(first), frames)
    np.testing.assert_array_equal(database.read_keypoints(second)[:, 2:], np.tile([1, 0, 0, 1], (7, 1)))
    descriptors = rng.integers(0, 255, (7, 128), dtype=np.uint8)
    database.write_descriptors(first, descriptors)
    np.testing.assert_array_equal(database.read_descriptors(first), descriptors)
    depth = rng.uniform(1, 2, (7, 3)).astype(np.float32)
    depth[3] = np.nan
    database.write_depth_samples(first, depth)
    np.testing.assert_array_equal(database.read_depth_samples(first), depth)
    assert database.read_depth_samples(second) is None and database.read_descriptors(second) is None


def test_new_rows_replace_none_that_cannot_be_read(tmp_path):
    path = tmp_path / "scene.db"
    make(path)[0].close()
    rows = sqlite3.connect(path)
    rows.execute("INSERT INTO cameras VALUES (7, 99, 640, 480, x'00', 0)")  # a model of tomorrow
    rows.execute("INSERT INTO images(image_id, name, camera_id) VALUES (9, 'a' || char(10) || 'b.jpg', 7)")
    rows.commit()
    rows.close()
    database = cairn.Database(path)
    assert database.write_camera(cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240])) == 8
    assert database.write_image("c.jpg", 8) == 10
    database.write_camera(cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240], camera_id=2**32 - 2))
    with pytest.raises(cairn.IoError, match="cameras have ids below 4294967295"):
        database.write_camera(cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240]))


def test_names_that_are_no_utf8(tmp_path):
    folder = tmp_path / "K\udcf6ln"
    folder.mkdir()
    database = make(folder / "scene.db")[0]
    assert database.path == str(folder / "scene.db")
    with pytest.raises(cairn.IoError, match=r"K\ufffdln/absent.*: "):
        cairn.Reconstruction(folder / "absent")
    with pytest.raises(cairn.IoError, match=r"K\ufffdln/pairs.txt: "):
        cairn.build_view_graph(folder / "scene.db", options={"pairs_path": str(folder / "pairs.txt")})
    with pytest.raises(cairn.ConfigError, match=r"verifier: .*K\ufffdln"):
        cairn.build_view_graph(folder / "scene.db", options={"verifier": "K\udcf6ln"})


def test_pairs_have_the_order_in_which_images_are_named(tmp_path):
    database, _, (first, second) = make(":memory:")
    matches = np.array([[0, 5], [1, 6]])
    database.write_matches(second, first, matches)
    np.testing.assert_array_equal(database.read_matches(second, first), matches)
    np.testing.assert_array_equal(database.read_matches(first, second), matches[:, ::-1])
    np.testing.assert_array_equal(database.matched_pairs(), [[first, second]])
    truth = scene.Scene(num_images=2)
    right, _ = truth.matches(1, 2)
    x1, x2 = truth.observe(1)[0], truth.observe(2)[0]
    geometry = cairn.verify_pair(truth.camera, x1, truth.camera, x2, right).geometry
    database.write_two_view_geometry(second, first, geometry)
    back = database.read_two_view_geometry(first, second)
    np.testing.assert_allclose(back.cam2_from_cam1.matrix()[:, :3], geometry.cam2_from_cam1.inverse().matrix()[:, :3],
                               atol=1e-9)
    assert len(database.verified_pairs()) == 1
    with pytest.raises(cairn.ConfigError, match="image_id2"):
        database.write_matches(1, 1, matches)
    with pytest.raises(cairn.ConfigError, match=r"matches: its shape is \(2, 3\), not \(n, 2\)"):
        database.write_matches(1, 2, np.zeros((2, 3), int))


def test_features_that_cannot_be_are_refused():
    database, _, (first, _) = make(":memory:")
    database.write_keypoints(first, np.ones((7, 2)))
    unit = np.full((7, 128), 128 ** -0.5, np.float32)
    for descriptors, text in ((unit, r"descriptors: these are float32, not uint8; .*np.rint\(512 \* d\)"),
                              (np.ones((7, 64), np.uint8), r"its shape is \(7, 64\), not \(n, 128\)"),
                              (np.ones((6, 128), np.uint8), "descriptors: there are 6, not 7")):
        with pytest.raises(cairn.ConfigError, match=text):
            database.write_descriptors(first, descriptors)
    database.write_descriptors(first, np.rint(512 * unit).clip(0, 255).astype(np.uint8))
    assert (database.read_descriptors(first) == 45).all()
    with pytest.raises(cairn.ConfigError, match=r"keypoints\[2\]: is not finite"):
        database.write_keypoints(first, [[1, 2], [3, 4], [5, np.nan]])
    samples = np.ones((7, 3))
    for depth in (-1, np.inf):
        samples[4, 0] = depth
        with pytest.raises(cairn.ConfigError, match=r"samples\[4\]: is negative or not finite"):
            database.write_depth_samples(first, samples)
    samples[4, 0] = 0
    database.write_depth_samples(first, samples)
    assert np.isnan(database.read_depth_samples(first)[4]).all()
    with pytest.raises(cairn.ConfigError, match="samples: there are 6, not 7"):
        database.write_depth_samples(first, samples[1:])
    for write in (database.write_keypoints, database.write_depth_samples, database.write_descriptors):
        with pytest.raises(cairn.IoError, match="of image 99: there is no such image"):
            write(99, [])


def test_matches_are_of_keypoints_that_are_there():
    database, _, (first, second) = make(":memory:")
    database.write_keypoints(second, np.ones((7, 2)))
    database.write_matches(first, second, [[100, 6]])  # those of the first may come later
    with pytest.raises(cairn.ConfigError, match="matches: 7 is no index of the 7 keypoints of image 2"):
        database.write_matches(second, first, [[0, 3], [7, 0]])
    with pytest.raises(cairn.ConfigError, match="matches: there is no image 99"):
        database.write_matches(1, 99, [])
    with pytest.raises(cairn.ConfigError, match="geometry: there is no image 99"):
        database.write_two_view_geometry(99, 1, cairn.TwoViewGeometry())
    for call in (database.read_matches, database.read_two_view_geometry, lambda i, j: database.write_matches(i, j, [])):
        with pytest.raises(cairn.ConfigError, match="image_id1, image_id2: ids are below 2147483647"):
            call(1, 2 ** 31 + 5)
    np.testing.assert_array_equal(database.read_matches(first, second), [[100, 6]])
    database.write_matches(first, second, [])
    assert database.read_matches(first, second).shape == (0, 2)


def test_images_that_cannot_be_are_refused_in_plain_words():
    database, camera_id, _ = make(":memory:")
    for arguments, text in ((("a.jpg", camera_id), "image 3: image 1 has its name, 'a.jpg'"),
                            (("c.jpg", 77), "image 3: there is no camera 77"),
                            (("", camera_id), "image 3: the name is empty"),
                            (("n\0ul", camera_id), "image 3: the name has a line break or a zero byte"),
                            (("two\nlines", camera_id), "image 3: the name has a line break or a zero byte"),
                            (("c.jpg", camera_id, 2 ** 31), "image 2147483648: the id is out of range")):
        with pytest.raises(cairn.IoError, match=text):
            database.write_image(*arguments)
    database.write_image("d.jpg", camera_id, 1)
    assert [image.name for image in database.read_images()] == ["d.jpg", "b/c.jpg"]


def test_a_transaction_is_not_closed_away(tmp_path):
    with cairn.Database(tmp_path / "a.db") as database, database.transaction():
        database.write_camera(cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240]))
        with pytest.raises(cairn.ConfigError, match="transaction"):
            database.close()
    assert len(cairn.Database(tmp_path / "a.db").read_cameras()) == 1


def test_a_transaction_is_all_or_nothing(tmp_path):
    database, camera_id, _ = make(tmp_path / "scene.db")
    with database.transaction():
        database.write_image("c.jpg", camera_id)
    with pytest.raises(RuntimeError, match="stop"), database.transaction():
        database.write_image("d.jpg", camera_id)
        raise RuntimeError("stop")
    assert [image.name for image in database.read_images()] == ["a.jpg", "b/c.jpg", "c.jpg"]


def test_a_closed_or_broken_database_says_so(tmp_path):
    with cairn.Database(tmp_path / "scene.db") as database:
        make(tmp_path / "scene.db")
        transaction = database.transaction()
        transaction.__enter__()
    with pytest.raises(cairn.ConfigError, match="database: is closed"):
        database.read_images()
    with pytest.raises(cairn.ConfigError, match="path: is empty"):
        cairn.Database("")
    (tmp_path / "text.db").write_text("no database " * 100)
    with pytest.raises(cairn.IoError, match="text.db: "):
        cairn.Database(tmp_path / "text.db")
    with pytest.raises(OSError, match="none.db"):
        cairn.Database(tmp_path / "none.db", read_only=True)
    with pytest.raises(cairn.IoError):
        cairn.Database(tmp_path / "scene.db", read_only=True).write_image("x.jpg", 1)


def test_a_path_that_cannot_be_is_an_error_of_input():
    path = 300 * "a" + ".db"
    for call in (cairn.Database, cairn.reconstruct, cairn.build_view_graph):
        with pytest.raises(cairn.IoError, match="File name too long"):
            call(path)


def test_colmap_tables_have_colmap_rows(tmp_path):
    database, _, (first, _) = make(tmp_path / "scene.db")
    database.write_keypoints(first, np.ones((3, 2)))
    database.close()
    rows, columns = sqlite3.connect(tmp_path / "scene.db").execute("SELECT rows, cols FROM keypoints").fetchone()
    assert (rows, columns) == (3, 6)


def test_sample_depth_reads_a_plane():
    """Depth 2 + x / 1000 over an image of 400 x 300, of which the map has every fourth pixel."""
    x = (np.arange(100) + 0.5) * 4
    depth = np.tile(2 + x / 1000, (75, 1))
    depth[:, :20] = np.nan
    samples = cairn.sample_depth(depth, 400, 300, [[200, 150], [300, 100], [5, 5]],
                                 options={"value_window": 0.01, "gradient_window": 0.02})
    np.testing.assert_allclose(samples[:2], [[2.2, 1e-3, 0], [2.3, 1e-3, 0]], atol=1e-4)
    assert np.isnan(samples[2]).all()
    inverse = cairn.sample_depth(1 / depth, 400, 300, [[200, 150]], options={"kind": "inverse", "value_window": 0.01})
    np.testing.assert_allclose(inverse[0, 0], 2.2, rtol=1e-3)
    for depth_map, size, text in ((depth.T, (400, 300), "depth_map: a map of 75 x 100 .* it is transposed"),
                                  (np.zeros((0, 0)), (400, 300), "depth_map: is empty"),
                                  ([], (400, 300), "depth_map: is empty"),
                                  (depth, (0, 300), "width, height: must be positive")):
        with pytest.raises(cairn.ConfigError, match=text):
            cairn.sample_depth(depth_map, *size, [[200, 150]])


def raised_in_thread(call):
    """What a call of another thread raises."""
    raised = []

    def run():
        try:
            call()
        except Exception as error:
            raised.append(error)
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return raised


def test_a_database_belongs_to_its_thread():
    """Writes of another would end with this one's transaction, and closing pulls it from under it."""
    database, camera, _ = make(":memory:")
    transaction = database.transaction()
    for call in (lambda: database.write_image("other.jpg", camera), database.read_images, database.close,
                 lambda: database.__exit__(None, None, None), transaction.__enter__,
                 lambda: transaction.__exit__(None, None, None)):
        raised = raised_in_thread(call)
        assert len(raised) == 1 and "another thread" in str(raised[0])
    assert len(database.read_images()) == 2


def test_who_waits_for_a_lock_lets_the_others_go_on(tmp_path):
    path = tmp_path / "scene.db"
    with cairn.Database(path) as database:
        camera = database.write_camera(cairn.Camera.create(1, "PINHOLE", 500, 640, 480))
    is_writing = threading.Event()

    def hold():
        with cairn.Database(path) as first, first.transaction():
            first.write_image("first.jpg", camera)
            is_writing.set()
            time.sleep(0.3)
    holder = threading.Thread(target=hold)
    holder.start()
    is_writing.wait()
    start = time.monotonic()
    with cairn.Database(path) as second:
        second.write_image("second.jpg", camera)
        assert len(second.read_images()) == 2
    holder.join()
    assert time.monotonic() - start < 5
