"""A scene with exact truth, in NumPy alone: cameras on an arc before a rough wall, whose points have tangents."""
import numpy as np

import cairn

WIDTH, HEIGHT, FOCAL = 1200, 900, 1000.0


def look_at(center, target):
    """Rotation cam_from_world of a camera whose y axis points down (the world's z points up)."""
    z = (target - center) / np.linalg.norm(target - center)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def angle_deg(a, b):
    return np.degrees(cairn.Rotation3d(a).angle_to(cairn.Rotation3d(b)))


def direction_error_deg(a, b):
    cosine = np.dot(a, b) / (np.linalg.norm(a) * np.linalg.norm(b))
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


class Scene:
    """`wander`: how far the cameras look past the middle; where all look at one point, focal lengths are open."""

    def __init__(self, num_images=8, num_points=500, seed=0, wander=0.0):
        rng = np.random.default_rng(seed)
        self.camera = cairn.Camera("PINHOLE", WIDTH, HEIGHT, [FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2], camera_id=1,
                                   has_prior_focal_length=True)
        self.points = np.column_stack([rng.uniform(-1, 1, num_points), rng.uniform(-0.4, 0.4, num_points),
                                       rng.uniform(-0.7, 0.7, num_points)])
        turns = np.array([[[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]] for a in rng.uniform(0, 7, num_points)])
        self.tangents = (rng.normal(size=(num_points, 3, 2)) * 0.003 + np.eye(3)[:, [0, 2]] * 0.01) @ turns
        self.image_ids = np.arange(1, num_images + 1)
        self.rotations, self.centers = {}, {}
        for i, turn in zip(self.image_ids, np.linspace(-0.6, 0.6, num_images)):
            center = np.array([3 * np.sin(turn), -3 * np.cos(turn), 0.3 * np.cos(5 * turn)])
            roll = [[np.cos(i), -np.sin(i), 0], [np.sin(i), np.cos(i), 0], [0, 0, 1]]
            self.rotations[i], self.centers[i] = roll @ look_at(center, wander * rng.normal(size=3)), center
        # Keypoint k of image i shows point order[i][k].
        self.order = {i: rng.permutation(num_points) for i in self.image_ids}

    @property
    def pairs(self):
        return np.array([(i, j) for i in self.image_ids for j in self.image_ids if i < j])

    def pose(self, i):
        return cairn.Rigid3d(self.rotations[i], -self.rotations[i] @ self.centers[i])

    def relative(self, i, j):
        return self.pose(j) * self.pose(i).inverse()

    def observe(self, i):
        """Pixels (n, 2), affine shapes (n, 2, 2) and depth with its gradient (n, 3), a row a keypoint."""
        order, R = self.order[i], self.rotations[i]
        x = (self.points[order] - self.centers[i]) @ R.T
        z = x[:, 2]
        pixels = FOCAL * x[:, :2] / z[:, None] + [WIDTH / 2, HEIGHT / 2]
        dx = R @ self.tangents[order]
        shapes = FOCAL * (dx[:, :2] / z[:, None, None] - x[:, :2, None] * dx[:, 2:] / z[:, None, None] ** 2)
        # gradient * shape = the third row of dx
        (a, b), (c, d), (u, v) = shapes[:, 0].T, shapes[:, 1].T, dx[:, 2].T
        det = a * d - b * c
        return pixels, shapes, np.column_stack([z, (u * d - v * c) / det, (v * a - u * b) / det])

    def matches(self, i, j, num_wrong=0, seed=0):
        """(n, 2) keypoints: right ones, with wrong ones among them, and which are right."""
        place = {point: k for k, point in enumerate(self.order[j])}
        matches = np.array([(k, place[point]) for k, point in enumerate(self.order[i])])
        rng = np.random.default_rng(seed)
        wrong = rng.choice(len(matches), num_wrong, replace=False)
        matches[wrong, 1] = np.roll(matches[wrong, 1], 1)
        return matches, ~np.isin(np.arange(len(matches)), wrong)

    def truth(self):
        model = cairn.Reconstruction()
        model.add_camera(self.camera)
        for i in self.image_ids:
            model.add_image(cairn.Image(name_of(i), self.pose(i), 1, i, self.observe(i)[0]))
        places = {i: np.argsort(self.order[i]) for i in self.image_ids}
        for k, xyz in enumerate(self.points):
            model.add_point3D(xyz, [(i, places[i][k]) for i in self.image_ids], [10, 20, 30])
        return model

    def write(self, path, frames=False, depth=False, num_wrong=100):
        """A database as another program's features and matches fill it."""
        with cairn.Database(path) as database, database.transaction():
            camera_id = database.write_camera(self.camera)
            for i in self.image_ids:
                pixels, shapes, depths = self.observe(i)
                database.write_image(name_of(i), camera_id, i)
                columns = np.column_stack([pixels, shapes.reshape(-1, 4)]) if frames else pixels
                database.write_keypoints(i, columns)
                if depth:
                    database.write_depth_samples(i, depths * (1 + 0.1 * i))  # each map in its own unit
            for i, j in self.pairs:
                database.write_matches(i, j, self.matches(i, j, num_wrong)[0])


def name_of(image_id):
    return f"photo{image_id:02}.jpg"


def pose_error_deg(pose, truth):
    """The larger of the errors of rotation and translation direction."""
    return max(angle_deg(pose.rotation.matrix(), truth.rotation.matrix()),
               direction_error_deg(pose.translation, truth.translation))
