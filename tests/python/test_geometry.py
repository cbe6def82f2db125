import numpy as np
import pytest

import cairn
import scene


def test_rigid3d_is_the_motion_that_its_matrix_says():
    rng = np.random.default_rng(1)
    R, S = scene.random_rotation(rng), scene.random_rotation(rng)
    a, b = cairn.Rigid3d(R, [1, 2, 3]), cairn.Rigid3d(cairn.Rotation3d(S), [-1, 0, 2])
    points = rng.normal(size=(5, 3))
    np.testing.assert_allclose(a.matrix(), np.column_stack([R, [1, 2, 3]]), atol=1e-12)
    np.testing.assert_allclose(a * points, points @ R.T + [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(a * points[0], R @ points[0] + [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose((a * b) * points, a * (b * points), atol=1e-12)
    np.testing.assert_allclose(a.inverse() * (a * points), points, atol=1e-12)
    np.testing.assert_allclose(a.center(), -R.T @ [1, 2, 3], atol=1e-12)
    a.translation = [0, 0, 1]
    np.testing.assert_array_equal(a.translation, [0, 0, 1])
    assert "translation=[0, 0, 1]" in repr(a)
    with pytest.raises(cairn.ConfigError, match="finite"):
        a.translation = [0, np.nan, 1]
    with pytest.raises(cairn.ConfigError, match="finite"):
        cairn.Rigid3d(np.eye(3), [np.inf, 0, 0])
    for scale in (1e200, 1e-200):
        np.testing.assert_allclose(cairn.Rotation3d.from_quat([0, 0, scale, scale]).quat,
                                   np.sqrt([0, 0, 0.5, 0.5]))


def test_quaternions_are_xyzw():
    half = np.radians(30) / 2
    rotation = cairn.Rotation3d.from_quat([0, 0, np.sin(half), np.cos(half)])
    expected = [[np.cos(2 * half), -0.5], [0.5, np.cos(2 * half)]]
    np.testing.assert_allclose(rotation.matrix()[:2, :2], expected, atol=1e-12)
    np.testing.assert_allclose(rotation.quat, [0, 0, np.sin(half), np.cos(half)])
    np.testing.assert_allclose(cairn.Rotation3d.from_quat([1e308] * 4).quat, [0.5] * 4)
    assert np.isclose((rotation * rotation).angle_to(rotation.inverse()), np.radians(90))


def test_camera_projects_as_the_model_says():
    camera = cairn.Camera("SIMPLE_RADIAL", 640, 480, [500, 320, 240, 0.1], camera_id=3)
    points = np.random.default_rng(0).uniform([-0.4, -0.3, 1], [0.4, 0.3, 1.5], (50, 3))
    uv = points[:, :2] / points[:, 2:]
    expected = 500 * uv * (1 + 0.1 * (uv ** 2).sum(1, keepdims=True)) + [320, 240]
    pixels = camera.img_from_cam(points)
    np.testing.assert_allclose(pixels, expected, atol=1e-9)
    np.testing.assert_allclose(camera.cam_from_img(pixels), uv, atol=1e-9)
    rays = camera.ray_from_img(pixels)
    np.testing.assert_allclose(rays, points / np.linalg.norm(points, axis=1, keepdims=True), atol=1e-9)
    assert np.isnan(camera.img_from_cam([[0, 0, -1]])).all()
    assert camera.model == "SIMPLE_RADIAL" and camera.focal_length == 500
    camera.focal_length = 600
    np.testing.assert_array_equal(camera.params, [600, 320, 240, 0.1])
    with pytest.raises(ValueError):  # of a copy: params have to be assigned as a whole
        camera.params[0] = 700
    np.testing.assert_array_equal(camera.calibration_matrix(), [[600, 0, 320], [0, 600, 240], [0, 0, 1]])
    np.testing.assert_array_equal(cairn.Camera.create(1, "PINHOLE", 700, 100, 50).params, [700, 700, 50, 25])


def test_a_camera_is_never_changed_to_one_that_cannot_be():
    camera = cairn.Camera("SIMPLE_RADIAL", 640, 480, [500, 320, 240, 0.1])
    for name, values in {"width": [-5, 0], "height": [0], "focal_length": [-5, 0, np.nan], "params": [[500]]}.items():
        for value in values:
            with pytest.raises(cairn.ConfigError, match="camera: "):
                setattr(camera, name, value)
    assert (camera.width, camera.height, camera.focal_length) == (640, 480, 500)
    camera.width, camera.height = 320, 240
    assert (camera.width, camera.height) == (320, 240)
    with pytest.raises(cairn.ConfigError, match="focal_length: an EQUIRECTANGULAR camera has none"):
        cairn.Camera("EQUIRECTANGULAR", 640, 320, [640, 320]).focal_length = 77


def test_wrong_values_are_named():
    with pytest.raises(cairn.ConfigError, match="model: 'PINHOL'.*PINHOLE"):
        cairn.Camera("PINHOL", 640, 480, [500])
    with pytest.raises(cairn.ConfigError, match="camera: "):
        cairn.Camera("PINHOLE", 640, 480, [500])
    with pytest.raises(ValueError, match="matrix: not a rotation"):
        cairn.Rotation3d(np.ones((3, 3)))
    with pytest.raises(cairn.ConfigError, match=r"points: its shape is \(4, 2\), not \(n, 3\)"):
        cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240]).img_from_cam(np.ones((4, 2)))
