import numpy as np
import pytest

import cairn
import scene


def perturbed(truth_scene, seed=0):
    """The truth with errors of about a degree and 2 % in all poses and points."""
    rng = np.random.default_rng(seed)
    model = truth_scene.truth()
    for image in model.images.values():
        turn = cairn.Rotation3d.from_quat([*rng.normal(0, 0.005, 3), 1])
        pose = image.cam_from_world
        image.cam_from_world = cairn.Rigid3d(turn * pose.rotation, pose.translation + rng.normal(0, 0.02, 3))
    for point in model.points3D.values():
        point.xyz = point.xyz + rng.normal(0, 0.02, 3)
    return model


def test_adjust_bundle_finds_the_truth():
    truth_scene = scene.Scene(num_images=6, num_points=300)
    model = perturbed(truth_scene)
    assert model.compute_mean_reprojection_error() > 2
    report = cairn.adjust_bundle(model, options={"function_tolerance": 1e-10})
    assert report.status == "converged" and report.num_images == 6 and report.num_observations == 1800
    assert model.compute_mean_reprojection_error() < 1e-3 and report.final_rmse < 1e-3 < report.initial_rmse
    assert model.points3D[1].error < 1e-2
    evaluation = cairn.evaluate(model, truth_scene.truth())
    assert evaluation.auc[1] > 0.999 and evaluation.num_registered == 6


def test_only_what_is_named_is_adjusted():
    truth_scene = scene.Scene(num_images=6, num_points=300)
    model = perturbed(truth_scene)
    before = {i: image.cam_from_world.matrix() for i, image in model.images.items()}
    cairn.adjust_bundle(model, fixed_images=[2])
    np.testing.assert_array_equal(model.images[2].cam_from_world.matrix(), before[2])
    assert not np.allclose(model.images[3].cam_from_world.matrix(), before[3])
    model = truth_scene.truth()
    model.cameras[1].focal_length = 1050
    cairn.adjust_bundle(model, points=False, rotations=False, positions=False, focal_lengths=True)
    assert abs(model.cameras[1].focal_length - scene.FOCAL) < 0.5
    model.cameras[1].focal_length = 1050
    cairn.adjust_bundle(model, rotations=False, positions=False, focal_lengths=True, fixed_cameras={1})
    assert model.cameras[1].focal_length == 1050


def test_priors_let_principal_points_be_adjusted():
    truth_scene = scene.Scene(num_images=6, num_points=300)
    model = truth_scene.truth()
    params = [scene.FOCAL, scene.FOCAL, scene.WIDTH / 2 + 20, scene.HEIGHT / 2]
    model.cameras[1].params = params
    prior = cairn.IntrinsicsPrior(params, focal_sigma=0.1, principal_point_sigma_px=30)
    scope = {"rotations": False, "positions": False, "points": False}
    cairn.adjust_bundle(model, **scope, principal_points=True)
    assert model.cameras[1].principal_point[0] == params[2]
    cairn.adjust_bundle(model, **scope, principal_points=True, priors={1: prior})
    assert abs(model.cameras[1].principal_point[0] - scene.WIDTH / 2) < 0.5


def test_confidence_follows_the_number_of_points():
    few, many = (cairn.estimate_pose_confidence(scene.Scene(6, n).truth())[3] for n in (50, 500))
    assert (few.num_points, many.num_points) == (50, 500)
    assert 2 < few.rotation_sigma_deg / many.rotation_sigma_deg < 5
    assert 2 < few.position_sigma / many.position_sigma < 5


def test_an_option_out_of_range_is_named():
    with pytest.raises(cairn.ConfigError, match="bundle_adjustment.max_iterations"):
        cairn.adjust_bundle(scene.Scene(3, 30).truth(), options={"max_iterations": -1})
    with pytest.raises(cairn.ConfigError, match="loss: 'square'"):
        cairn.adjust_bundle(scene.Scene(3, 30).truth(), options={"loss": "square"})


def test_unknown_ids_and_impossible_priors_are_named():
    model, prior = scene.Scene(3, 30).truth(), cairn.IntrinsicsPrior([1, 2], 0.1, 1)
    for wrong, text in (({"fixed_images": [99]}, "fixed_images: there is no image 99"),
                        ({"fixed_cameras": {99}}, "fixed_cameras: there is no camera 99"),
                        ({"fixed_images": "ab"}, "fixed_images: these are not whole numbers"),
                        ({"priors": {42: prior}}, "priors: there is no camera 42"),
                        ({"priors": {1: prior}}, r"priors\[1\]: PINHOLE takes 4 parameters, not 2")):
        with pytest.raises(cairn.ConfigError, match=text):
            cairn.adjust_bundle(model, focal_lengths=True, **wrong)
    for sigma in (0, -1, np.nan):
        with pytest.raises(cairn.ConfigError, match="focal_sigma: is not positive and finite"):
            cairn.IntrinsicsPrior([1, 2], sigma, 1)
    with pytest.raises(cairn.ConfigError, match="principal_point_sigma_px: is negative or not finite"):
        cairn.IntrinsicsPrior([1, 2], 0.1, -1)
