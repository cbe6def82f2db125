import copy
import gc

import numpy as np
import pytest

import cairn
import scene


def test_attributes_are_those_of_pycolmap():
    truth = scene.Scene(num_images=4, num_points=50)
    model = truth.truth()
    assert list(model.images) == [1, 2, 3, 4] and 2 in model.images and 9 not in model.images
    assert (model.num_images(), model.num_points3D(), len(model.cameras)) == (4, 50, 1)
    image = model.images[2]
    assert (image.name, image.camera_id, image.image_id) == ("photo02.jpg", 1, 2)
    assert repr(image) == "Image(image_id=2, name='photo02.jpg', num_keypoints=50)"
    np.testing.assert_allclose(image.projection_center(), truth.centers[2])
    np.testing.assert_allclose(image.cam_from_world.rotation.matrix(), truth.rotations[2])
    assert all(p.has_point3D() for p in image.points2D) and len(image.points2D) == 50
    point = model.points3D[image.points2D[7].point3D_id]
    element = next(e for e in point.track.elements if e.image_id == 2)
    assert element.point2D_idx == 7 and point.track.length() == 4
    pixel = model.cameras[1].img_from_cam([image.cam_from_world * point.xyz])[0]
    np.testing.assert_allclose(pixel, image.points2D[7].xy)
    np.testing.assert_allclose(model.point_positions(), truth.points)
    assert (model.point_colors() == [10, 20, 30]).all()
    assert dict(model.cameras.items())[1].model == "PINHOLE"
    assert model.images.get(2).name == "photo02.jpg" and model.points3D.get(999) is None
    assert model.cameras.get("no id", 7) == 7
    for integer in (np.uint32, np.int32, np.int64):
        assert integer(2) in model.images and model.images.get(integer(2)).name == "photo02.jpg"
        assert integer(999) not in model.images
    class Anywhere:  # os.PathLike, and no text
        def __fspath__(self):
            return "no model"

    with pytest.raises(cairn.IoError, match="no model: "):
        cairn.evaluate(Anywhere(), model)
    assert -1 not in model.images and 2**70 not in model.images and 2.0 not in model.cameras


def test_values_are_changed_in_place_and_stay_alive():
    model = scene.Scene(num_images=4, num_points=50).truth()
    model.points3D[1].xyz = [1, 2, 3]
    np.testing.assert_array_equal(model.points3D[1].xyz, [1, 2, 3])
    model.images[1].cam_from_world.translation = [4, 5, 6]
    np.testing.assert_array_equal(model.images[1].cam_from_world.translation, [4, 5, 6])
    keypoints = model.images[1].keypoints
    keypoints[0] = [7, 8]
    np.testing.assert_array_equal(model.images[1].points2D[0].xy, [7, 8])
    point, images = model.points3D[2], model.images
    del model
    gc.collect()
    assert keypoints[0, 0] == 7 and point.xyz.shape == (3,) and len(images) == 4
    assert [image.name for image in images.values()][3] == "photo04.jpg"


def test_what_no_program_would_read_is_not_written(tmp_path):
    model = scene.Scene(num_images=4, num_points=50).truth()
    keypoints = model.images[1].keypoints
    keypoints[0] = np.nan
    with pytest.raises(cairn.IoError, match="a keypoint of photo01.jpg is not finite"):
        model.write(tmp_path / "model")
    keypoints[0] = 0
    with pytest.raises(cairn.ConfigError, match=r"points2D\[1\]: is not finite"):
        cairn.Image("photo05.jpg", camera_id=1, points2D=[[1, 2], [3, np.inf]])
    model.add_image(cairn.Image("photo02.jpg", camera_id=1))
    with pytest.raises(cairn.IoError, match="have one name, photo02.jpg"):
        model.write(tmp_path / "model")
    assert not (tmp_path / "model").exists()
    model.add_image(cairn.Image("photo06.jpg", camera_id=1, image_id=2**32 - 2))
    with pytest.raises(cairn.ConfigError, match="image_id: the largest one is taken"):
        model.add_image(cairn.Image("photo07.jpg", camera_id=1))


def test_names_that_are_no_text_are_as_python_has_them(tmp_path):
    name = b"K\xf6ln.jpg".decode("utf-8", "surrogateescape")  # Latin-1, as os.listdir gives it
    model = cairn.Reconstruction()
    model.add_camera(cairn.Camera.create(1, "SIMPLE_RADIAL", 500, 640, 480))
    model.add_image(cairn.Image(name, camera_id=1))
    model.write(tmp_path)
    assert b"K\xf6ln.jpg\0" in (tmp_path / "images.bin").read_bytes()
    assert cairn.Reconstruction(tmp_path).images[1].name == name
    with cairn.Database(tmp_path / "scene.db") as database:
        database.write_camera(model.cameras[1])
        database.write_image(name, 1)
        assert [image.name for image in database.read_images()] == [name]


def test_copies_are_apart():
    model = scene.Scene(num_images=4, num_points=50).truth()
    for other in (copy.copy(model), copy.deepcopy(model)):
        other.points3D[1].xyz = [1, 2, 3]
        other.images[1].keypoints[0] = [7, 8]
        assert other.num_points3D() == 50 and not np.allclose(model.points3D[1].xyz, [1, 2, 3])
        assert not np.allclose(model.images[1].keypoints[0], [7, 8])


def test_what_has_no_id_gets_the_next():
    model = cairn.Reconstruction()
    camera = cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240])
    assert [model.add_camera(camera) for _ in range(2)] == [1, 2]
    assert model.add_image(cairn.Image("a.jpg", camera_id=2, image_id=7)) == 7
    assert model.add_image(cairn.Image("b.jpg", camera_id=2)) == 8
    assert list(model.cameras) == [1, 2] and model.cameras[2].camera_id == 2 and model.images[8].image_id == 8


@pytest.mark.parametrize("write", ["write", "write_text"])
def test_models_are_read_as_they_were_written(tmp_path, write):
    model = scene.Scene(num_images=4, num_points=50).truth()
    getattr(model, write)(tmp_path / "model")
    read = cairn.Reconstruction(tmp_path / "model")
    np.testing.assert_array_equal(read.point_positions(), model.point_positions())
    np.testing.assert_array_equal(read.images[3].keypoints, model.images[3].keypoints)
    np.testing.assert_array_equal(read.images[3].point3D_ids, model.images[3].point3D_ids)
    poses = [m.images[3].cam_from_world.matrix() for m in (read, model)]
    np.testing.assert_allclose(*poses, atol=1e-14)
    assert read.compute_mean_reprojection_error() < 1e-3
    getattr(read, write)(tmp_path / "again")
    for file in (tmp_path / "model").iterdir():
        assert file.read_bytes() == (tmp_path / "again" / file.name).read_bytes()
    model.export_PLY(str(tmp_path / "model.ply"))
    assert (tmp_path / "model.ply").read_bytes().startswith(b"ply")


def test_a_bundler_model_gets_its_sizes(tmp_path):
    """Its file has none, without which no program takes the model."""
    (tmp_path / "bundle.out").write_text("# Bundle file v0.3\n1 0\n500 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n")
    (tmp_path / "list.txt").write_text("a.jpg\n")
    model = cairn.Reconstruction(tmp_path / "bundle.out")
    camera = next(iter(model.cameras.values()))
    assert (camera.width, camera.height) == (0, 0)
    camera.width = 640
    camera.height = 480
    model.write(tmp_path / "model")
    with pytest.raises(cairn.ConfigError, match="camera: "):
        camera.width = 0


def test_evaluate_measures_known_errors(tmp_path):
    truth_scene = scene.Scene(num_images=5, num_points=50)
    truth, model = truth_scene.truth(), truth_scene.truth()
    half = np.radians(2) / 2
    pose = model.images[3].cam_from_world
    turn = cairn.Rotation3d.from_quat([0, 0, np.sin(half), np.cos(half)])
    model.images[3].cam_from_world = cairn.Rigid3d((turn * pose.rotation), turn.matrix() @ pose.translation)
    truth.write(tmp_path / "truth")
    evaluation = cairn.evaluate(model, tmp_path / "truth")
    # Of ten pairs four have an error of two degrees, the others none.
    assert np.isclose(evaluation.auc[1], 0.6, atol=1e-6) and np.isclose(evaluation.auc[10], 0.93, atol=1e-6)
    assert evaluation.relative_rotation_median_deg < 1e-6
    by_name = {image["name"]: image for image in evaluation.to_dict()["images"]}
    assert np.isclose(by_name["photo03.jpg"]["orientation_deg"], 2, atol=1e-3)
    assert "5" in str(evaluation) and evaluation.num_reference == 5
    with pytest.raises(cairn.ConfigError, match="reference: neither"):
        cairn.evaluate(model, 7)


def test_wrong_values_are_named(tmp_path):
    model = scene.Scene(num_images=3, num_points=20).truth()
    with pytest.raises(KeyError):
        model.images[77]
    with pytest.raises(cairn.ConfigError, match="camera_id: 1 is there already"):
        model.add_camera(model.cameras[1])
    with pytest.raises(cairn.ConfigError, match="camera_id: there is no camera 5"):
        model.add_image(cairn.Image("a.jpg", camera_id=5, image_id=9))
    with pytest.raises(cairn.ConfigError, match="track: keypoint 3 of image 2 is absent or shows a point"):
        model.add_point3D([0, 0, 0], [(2, 3)])
    with pytest.raises(cairn.ConfigError, match=r"track: \(1, 2, 3\) is no pair"):
        model.add_point3D([0, 0, 0], [(1, 2, 3)])
    with pytest.raises(cairn.ConfigError, match="priors: "):
        cairn.adjust_bundle(model, priors={1: 5})
    with pytest.raises(cairn.ConfigError, match="xyz: is not finite"):
        model.add_point3D([0, np.nan, 0], [])
    with pytest.raises(cairn.ConfigError, match="xyz: is not finite"):
        model.points3D[1].xyz = [0, np.inf, 0]
    model.points3D[1].xyz = [0, 0, 0]
    assert model.points3D[1].error == -1
    with pytest.raises(ValueError, match="read-only"):
        model.images[1].point3D_ids[:] = 3
    with pytest.raises(OSError, match=f"{tmp_path}/none"):
        cairn.Reconstruction(tmp_path / "none")
