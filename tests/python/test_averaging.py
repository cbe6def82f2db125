import numpy as np
import pytest

import cairn
import scene


def relative_rotations(num_wrong, seed=0):
    """Pairs and rotations of 30 images, some of them wrong, and the truth by id."""
    rng = np.random.default_rng(seed)
    truth = {10 + i: scene.random_rotation(rng) for i in range(30)}
    pairs = np.array([(i, j) for i in truth for j in truth if i < j and (j - i < 3 or rng.random() < 0.3)])
    rotations = np.array([truth[j] @ truth[i].T for i, j in pairs])
    wrong = rng.choice(len(pairs), num_wrong, replace=False)
    for k in wrong:
        rotations[k] = scene.random_rotation(rng)
    return pairs, rotations, truth, np.isin(np.arange(len(pairs)), wrong)


def test_average_rotations_finds_the_truth():
    pairs, rotations, truth, is_wrong = relative_rotations(num_wrong=30)
    report = cairn.average_rotations(pairs, rotations)
    assert report.status == "success" and len(report.components) == 1
    np.testing.assert_array_equal(report.image_ids, list(truth))
    gauge = report.rotations[0].T @ truth[10]
    errors = [scene.angle_deg(R @ gauge, truth[i]) for i, R in zip(report.image_ids, report.rotations)]
    assert max(errors) < 0.02
    np.testing.assert_array_equal(report.edge_rejected, is_wrong)
    assert report.num_rejected == 30 and report.edge_residuals_deg[~is_wrong].max() < 0.02
    assert report.median_residual_deg < 0.02


def test_progress_tells_the_beginning_and_the_end():
    pairs, rotations, _, _ = relative_rotations(num_wrong=0)
    told = []
    cairn.average_rotations(pairs, rotations, progress=lambda *stage: told.append(stage))
    assert told[-1] == ("average_rotations", 1, 1)


def test_average_rotations_takes_weights_and_options():
    pairs, rotations, _, is_wrong = relative_rotations(num_wrong=30)
    weights = np.where(is_wrong, 1, 1000)
    weighted = cairn.average_rotations(pairs, rotations, weights=weights, options={"weight_power": 1})
    assert weighted.num_rejected == 30
    strict = cairn.average_rotations(pairs, rotations, options={"max_error_deg": 179.9})
    assert strict.num_rejected < 30
    with pytest.raises(cairn.ConfigError, match=r"rotations: its shape is \(3, 3\), not \(\d+, 3, 3\)"):
        cairn.average_rotations(pairs, np.eye(3))
    with pytest.raises(cairn.ConfigError, match="pairs: -1 is not from 0 to 2147483646"):
        cairn.average_rotations([[-1, 2]], [np.eye(3)])
    for weight in (0, -1, np.nan, np.inf):
        with pytest.raises(cairn.ConfigError, match=r"weights\[1\]: is not positive and finite"):
            cairn.average_rotations(pairs, rotations, weights=[1, weight] + [1] * (len(pairs) - 2))
    with pytest.raises(cairn.ConfigError, match="pairs: these are not whole numbers"):
        cairn.average_rotations([[1.5, 2]], [np.eye(3)])


def test_average_rotations_leaves_misses_to_pairs_of_little_weight():
    turn = np.radians(3)  # by which the loop misses
    turned = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    report = cairn.average_rotations([(1, 2), (2, 3), (1, 3)], [np.eye(3), np.eye(3), turned],
                                     weights=[1, 1, 1000], options={"weight_power": 1})
    first, second, sure = report.edge_residuals_deg
    assert sure < 0.05 * first and first + second == pytest.approx(3, abs=0.05)


def aligned_errors(report, centers):
    """Distances of centers from the truth after the similarity that fits them best, in extents of the scene."""
    a = np.array([centers[i] for i in report.image_ids])
    b = report.centers - report.centers.mean(0)
    a = a - a.mean(0)
    u, s, vt = np.linalg.svd(a.T @ b)
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    scale = (s * np.diag(sign)).sum() / (b ** 2).sum()
    return np.linalg.norm(scale * b @ (u @ sign @ vt).T - a, axis=1) / np.abs(a).max()


def test_average_translations_finds_the_truth():
    rng = np.random.default_rng(2)
    centers = {i: rng.normal(size=3) for i in range(1, 21)}
    pairs = np.array([(i, j) for i in centers for j in centers if i < j and rng.random() < 0.6])
    directions = np.array([centers[j] - centers[i] for i, j in pairs])
    wrong = rng.choice(len(pairs), 8, replace=False)
    directions[wrong] = rng.normal(size=(8, 3))
    report = cairn.average_translations(pairs, directions)
    assert report.status == "success" and len(report.image_ids) == 20
    assert aligned_errors(report, centers).max() < 1e-3
    assert report.edge_is_filtered[wrong].sum() >= 4 and report.num_filtered == report.edge_is_filtered.sum()


def test_rays_fix_what_directions_leave_open():
    """On a line, directions between centers say nothing of distances; rays to points do."""
    rng = np.random.default_rng(3)
    centers = {i: np.array([x, 0.0, 0.0]) for i, x in enumerate([0, 1, 3, 4, 7, 8], 1)}
    pairs = np.array([(i, j) for i in centers for j in centers if i < j])
    directions = np.array([centers[j] - centers[i] for i, j in pairs])
    points = rng.uniform([-2, 3, -2], [10, 6, 2], (60, 3))
    rays = [(k, i, xyz - centers[i]) for k, xyz in enumerate(points) for i in centers]
    ray_points, ray_images, ray_directions = (np.array(column) for column in zip(*rays))
    report = cairn.average_translations(pairs, directions, ray_points=ray_points, ray_images=ray_images,
                                        ray_directions=ray_directions)
    assert report.status == "success"
    assert aligned_errors(report, centers).max() < 1e-3
    with pytest.raises(cairn.ConfigError, match="ray_points"):
        cairn.average_translations(pairs, directions, ray_points=ray_points)
    rays = {"ray_points": ray_points, "ray_images": ray_images}
    ray_directions[7] = 0
    with pytest.raises(cairn.ConfigError, match=r"ray_directions\[7\]: is zero or not finite"):
        cairn.average_translations(pairs, directions, **rays, ray_directions=ray_directions)
    ray_images[1] = ray_images[0]
    with pytest.raises(cairn.ConfigError, match="ray_points: image 1 sees point 0 twice"):
        cairn.average_translations(pairs, directions, **rays, ray_directions=ray_directions)
    with pytest.raises(cairn.ConfigError, match=r"directions\[0\]: is zero"):
        cairn.average_translations([[1, 2]], [[0, 0, 0]])


def focal_problem(scene_, guess):
    pairs = []
    K = scene_.camera.calibration_matrix()
    for i, j in scene_.pairs:
        pose = scene_.relative(i, j)
        t = pose.translation
        E = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]]) @ pose.rotation.matrix()
        F = np.linalg.inv(K).T @ E @ np.linalg.inv(K)
        matches, _ = scene_.matches(i, j)
        noise = np.random.default_rng(i).normal(0, 0.3, (len(matches), 4))
        pairs.append(cairn.FocalPair(1, 1, F, scene_.observe(i)[0][matches[:, 0]] + noise[:, :2],
                                     scene_.observe(j)[0][matches[:, 1]] + noise[:, 2:]))
    return [cairn.Camera.create(1, "PINHOLE", guess, scene.WIDTH, scene.HEIGHT)], pairs


def test_calibrate_focals_finds_the_truth():
    cameras, pairs = focal_problem(scene.Scene(num_images=6, wander=0.4), guess=1.4 * scene.FOCAL)
    report = cairn.calibrate_focals(cameras, pairs)
    focal = report.cameras[1]
    assert focal.status == "calibrated" and focal.focal_before_px == 1.4 * scene.FOCAL
    assert abs(focal.focal_px / scene.FOCAL - 1) < 0.02
    assert focal.num_agreeing >= 10 and report.num_pairs == 15
    for trusted in ({1}, [1]):
        assert 1 not in cairn.calibrate_focals(cameras, pairs, trusted=trusted).cameras
    with pytest.raises(cairn.ConfigError, match="trusted: there is no camera 99"):
        cairn.calibrate_focals(cameras, pairs, trusted=[99])
    with pytest.raises(cairn.ConfigError, match="cameras: two have the id 1"):
        cairn.calibrate_focals([*cameras, *cameras], pairs)
    panorama = cairn.Camera("EQUIRECTANGULAR", 640, 320, [640, 320], camera_id=1)
    with pytest.raises(cairn.ConfigError, match="pairs: camera 1 is EQUIRECTANGULAR"):
        cairn.calibrate_focals([panorama, *cameras[1:]], pairs)
    with pytest.raises(cairn.ConfigError, match="pairs: there is no camera 1"):
        cairn.calibrate_focals([], pairs)
    points = np.ones((3, 2))
    with pytest.raises(cairn.ConfigError, match="F: is not finite"):
        cairn.FocalPair(1, 1, np.full((3, 3), np.nan), points, points)
    with pytest.raises(cairn.ConfigError, match=r"points2\[0\]: is not finite"):
        cairn.FocalPair(1, 1, np.eye(3), points, points * np.inf)


def test_an_empty_list_is_no_pairs():
    assert cairn.average_rotations([], []).components == []
