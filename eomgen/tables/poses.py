"""What the output `body_poses` says: positions and rotations of bodies at the rows of a run."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def places_of(poses: FloatArray) -> FloatArray:
    """The positions (n, nb, d) of centres of mass at poses, m."""
    return poses[..., :2] if poses.ndim == 3 else poses[..., 3]


def rotations_of(poses: FloatArray) -> FloatArray:
    """The rotation matrices (n, nb, d, d) from body axes to the world's."""
    if poses.ndim == 4:
        return poses[..., :3]
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def world_points(poses: FloatArray, body: int, at: FloatArray) -> FloatArray:
    """World positions (n, d) of a point of a body, `at` (d,) in body axes, m; -1 is the world."""
    if body < 0:
        return np.broadcast_to(at, (len(poses), len(at)))
    pose = poses[:, body]
    if poses.ndim == 4:
        return np.asarray(pose[..., :3] @ at + pose[..., 3])
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    turned = np.stack([c * at[0] - s * at[1], s * at[0] + c * at[1]], axis=-1)
    return np.asarray(pose[:, :2] + turned)
