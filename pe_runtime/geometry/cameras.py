"""Batches of pinhole cameras: pixels to rays, points to pixels, feet to the ground."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pe_runtime.contract.camera import Camera

HORIZON = 1e-6
"""Smallest downward slope (sine) of a foot ray that still meets the ground at a usable place."""


@dataclass(frozen=True)
class Cameras:
    """Pinhole cameras of several frames, all with the same pixel grid.

    Attributes:
        width: Image width in pixels.
        height: Image height in pixels.
        intrinsics: K of each frame, pixels; float64.
        world_from_camera: Camera poses, OpenCV axes, metres; float64.
    """

    width: int
    height: int
    intrinsics: Float[Tensor, "frames 3 3"]
    world_from_camera: Float[Tensor, "frames 4 4"]

    @classmethod
    def stack(cls, cameras: Sequence[Camera], device: torch.device | str = "cpu") -> "Cameras":
        """Bundle cameras of equal image size; float64 is kept."""
        intrinsics = np.stack([c.intrinsics for c in cameras]).astype(np.float64)
        poses = np.stack([c.world_from_camera for c in cameras]).astype(np.float64)
        return cls(
            cameras[0].width,
            cameras[0].height,
            torch.from_numpy(intrinsics).to(device),
            torch.from_numpy(poses).to(device),
        )

    def __len__(self) -> int:
        """Number of frames."""
        return self.intrinsics.shape[0]

    @property
    def centres(self) -> Float[Tensor, "frames 3"]:
        """Camera positions in the world, metres; float64."""
        return self.world_from_camera[:, :3, 3]

    @property
    def rotations(self) -> Float[Tensor, "frames 3 3"]:
        """world_from_camera rotations; float64."""
        return self.world_from_camera[:, :3, :3]

    @property
    def headings(self) -> Float[Tensor, " frames"]:
        """Turns about the world's z axis from looking along +y, radians; float64.

        Positive is to the left. Arbitrary for a camera that looks straight up or down.
        """
        forward = self.rotations[:, :, 2]
        return torch.atan2(-forward[:, 0], forward[:, 1])


def ray_directions(
    cameras: Cameras,
    frame: Int[Tensor, " rays"],
    pixels: Float[Tensor, "rays 2"],
    dtype: torch.dtype = torch.float64,
) -> Float[Tensor, "rays 3"]:
    """World directions of the rays through pixel positions, d = R K^-1 (u, v, 1).

    Directions are not normalised: their camera z is 1, so the ray parameter is planar depth.

    Args:
        cameras: The frames' cameras.
        frame: Frame of each ray.
        pixels: (u, v), origin top-left, pixel centres at +0.5.
        dtype: In which everything is computed; float32 only to repeat somebody else's rounding.

    Returns:
        Directions in metres of path per metre of depth.
    """
    intrinsics = cameras.intrinsics.to(dtype)
    focal, middle = intrinsics[:, (0, 1), (0, 1)], intrinsics[:, :2, 2]
    aside = (pixels.to(dtype) - middle[frame]) / focal[frame]
    local = torch.cat([aside, torch.ones_like(aside[:, :1])], dim=-1)
    # Where networks multiply in bfloat16, rays may not: they would miss by whole pixels.
    with torch.autocast(local.device.type, enabled=False):
        return torch.einsum("rij,rj->ri", cameras.rotations.to(dtype)[frame], local)


def project(
    cameras: Cameras, points: Float[Tensor, "frames points 3"]
) -> tuple[Float[Tensor, "frames points 2"], Float[Tensor, "frames points"]]:
    """Project world points: pixel positions and planar depths (metres; <= 0 is behind).

    Points at or behind the camera plane get the pixel position of depth 1e-9; look at the depth.
    """
    relative = points.double() - cameras.centres[:, None]
    local = torch.einsum("fji,fpj->fpi", cameras.rotations, relative)
    depth = local[..., 2]
    image = torch.einsum("fij,fpj->fpi", cameras.intrinsics, local)
    return image[..., :2] / depth.clamp(min=1e-9)[..., None], depth


def ground_from_pixels(
    cameras: Cameras, pixels: Float[Tensor, "frames objects 2"]
) -> tuple[Float[Tensor, "frames objects 3"], Bool[Tensor, "frames objects"]]:
    """Intersect pixel rays with the ground plane z = 0.

    Returns:
        Ground points (metres, z exactly 0; zeros where there is none) and whether the ray meets the
        ground in front of the camera at all (false at or above the horizon, or from below ground).
    """
    frames, objects = pixels.shape[:2]
    frame = torch.arange(frames, device=pixels.device).repeat_interleave(objects)
    directions = ray_directions(cameras, frame, pixels.reshape(-1, 2)).reshape(frames, objects, 3)
    centres = cameras.centres[:, None]
    slope = directions[..., 2] / directions.norm(dim=-1)
    meets = (slope < -HORIZON) & (centres[..., 2] > 0)
    depth = -centres[..., 2] / torch.where(meets, directions[..., 2], -1.0)
    points = centres + depth[..., None] * directions
    points = torch.cat([points[..., :2], torch.zeros_like(points[..., :1])], dim=-1)
    meets = meets & torch.isfinite(points).all(dim=-1)
    return torch.where(meets[..., None], points, 0.0), meets
