"""Pictures of the target of discs, drawn with the camera model: a quick stand-in for the renderer."""

import numpy as np

from controllers.visual_servoing.camera import project_points, seen_points
from robots.dvrk.endoscope import StereoCamera
from robots.training.targets import BOX, DISC_RADIUS, DISCS

CAMERA = StereoCamera(360, 288, np.pi / 3.0)
POINTS = np.column_stack([DISCS, np.zeros(4)])
_ROUND = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]
_CIRCLE = DISC_RADIUS * np.stack([np.cos(_ROUND), np.sin(_ROUND), 0.0 * _ROUND], axis=1)
_CORNERS = 0.5 * np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]]) * [*BOX[:2], 0.0]


def picture(cv2, camera, target, covered=()):
    """The picture, shape (288, 360, 3), by the poses of camera and target in one frame.

    `covered`: indices of discs that cannot be seen.
    """
    image = np.full((CAMERA.height, CAMERA.width, 3), 20, np.uint8)
    _fill(cv2, image, camera, target, _CORNERS, (200, 15, 15))
    for i, point in enumerate(POINTS):
        if i not in covered:
            _fill(cv2, image, camera, target, point + _CIRCLE, (250, 250, 250))
    return image


def _fill(cv2, image, camera, target, outline, colour):
    seen = seen_points(camera, target, outline)
    if (seen[:, 2] > 0.01).all():
        corners = CAMERA.focal_length * project_points(seen) + CAMERA.intrinsics()[:2, 2]
        cv2.fillPoly(image, [np.round(corners * 16).astype(np.int32)], colour, cv2.LINE_AA, 4)


def features(camera, target):
    """Where the points are, normalised, shape (4, 2)."""
    return project_points(seen_points(camera, target, POINTS))
