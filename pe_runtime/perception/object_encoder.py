"""Encoder E of one object class: a crop of the picture -> style w and pose pi."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import ObjectClassConfig
from pe_runtime.geometry.boxes import box_in_image
from pe_runtime.geometry.cameras import Cameras

VIEW_FEATURES = 6


class Trunk(nn.Module):
    """Stride-2 convolutions, then one hidden layer that also knows the view."""

    def __init__(self, config: ObjectClassConfig, outputs: int) -> None:
        super().__init__()
        encoder = config.encoder
        layers: list[nn.Module] = []
        narrow = 3
        for wide in encoder.channels:
            layers += [nn.Conv2d(narrow, wide, 3, 2, 1), nn.GroupNorm(4, wide), nn.ReLU()]
            narrow = wide
        self.convolutions = nn.Sequential(*layers)
        shrink = 2 ** len(encoder.channels)
        cells = -(-encoder.height // shrink) * -(-encoder.width // shrink)
        self.hidden = nn.Linear(narrow * cells + VIEW_FEATURES, encoder.hidden)
        self.output = nn.Linear(encoder.hidden, outputs)

    def forward(
        self, crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops 6"]
    ) -> Float[Tensor, "crops outputs"]:
        """Encode crops in [0, 1]."""
        seen = self.convolutions(crops * 2 - 1).flatten(1)
        return self.output(torch.relu(self.hidden(torch.cat([seen, view.to(seen)], dim=-1))))


class ObjectEncoder(nn.Module):
    """E: two trunks, one for style and one for pose; or one shared trunk as in the paper.

    With a shared trunk the pose starts with almost no gradient and is ignored for thousands of
    steps; batch normalisation keeps its scale, which the dynamics network relies on.
    """

    def __init__(self, config: ObjectClassConfig) -> None:
        super().__init__()
        self.config = config
        style, pose = config.style_features, config.pose_features
        shared = config.encoder.shared_trunk
        self.style = Trunk(config, style + pose if shared else style)
        self.pose = Trunk(config, pose) if pose and not shared else None
        self.normalise = nn.BatchNorm1d(pose, affine=False, momentum=0.05) if pose else None

    def forward(
        self, crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops 6"]
    ) -> tuple[Float[Tensor, "crops style"], Float[Tensor, "crops pose"]]:
        """Style and pose codes of crops in [0, 1] seen under the given views."""
        style = self.style(crops, view).float()
        if self.normalise is None:
            return style, style.new_zeros(style.shape[0], 0)
        if self.pose is None:
            style, pose = style.split([self.config.style_features, self.config.pose_features], -1)
        else:
            pose = self.pose(crops, view)
        with torch.autocast(pose.device.type, enabled=False):
            return style, self.normalise(pose.float())


def crop_boxes(
    config: ObjectClassConfig,
    cameras: Cameras,
    boxes: Float[Tensor, "frames 4"],
    positions: Float[Tensor, "frames 3"],
) -> Float[Tensor, "frames 4"]:
    """The image region that E looks at, in pixels; NaN where there is none.

    "volume" cuts out the projected volume at the position found from the box, so that a crop has
    the same metric size whatever the limbs do; "box" cuts out the box; "frame" the whole picture.
    """
    whole = positions.new_tensor([0.0, 0.0, cameras.width, cameras.height])
    if config.encoder.crop == "frame":
        return whole.expand(len(cameras), 4)
    if config.encoder.crop == "box":
        return boxes
    low, high = positions.new_tensor(config.low), positions.new_tensor(config.high)
    region, ahead = box_in_image(cameras, positions, low, high)
    return torch.where(ahead[:, None], region.float(), torch.nan)


def cut_out(
    images: Float[Tensor, "frames 3 height width"],
    regions: Float[Tensor, "frames 4"],
    height: int,
    width: int,
) -> Float[Tensor, "frames 3 crop_height crop_width"]:
    """Resample one region of each picture, bilinearly; outside the picture is black."""
    rows, columns = images.shape[-2:]
    down = (torch.arange(height, device=images.device) + 0.5) / height
    across = (torch.arange(width, device=images.device) + 0.5) / width
    u = regions[:, 0, None] + across * (regions[:, 2] - regions[:, 0])[:, None]
    v = regions[:, 1, None] + down * (regions[:, 3] - regions[:, 1])[:, None]
    grid = torch.stack(
        [
            (2 * u / columns - 1)[:, None, :].expand(-1, height, -1),
            (2 * v / rows - 1)[:, :, None].expand(-1, -1, width),
        ],
        dim=-1,
    )
    return nn.functional.grid_sample(images, grid.to(images), align_corners=False)


def view_features(
    cameras: Cameras, positions: Float[Tensor, "frames 3"], regions: Float[Tensor, "frames 4"]
) -> Float[Tensor, "frames 6"]:
    """How the object is seen: unit direction from the camera (world), and the region's size.

    The pose lives in the world's axes while a crop shows it in the camera's, so E must know the
    direction of view (a deviation from the paper, as in its authors' release).
    """
    away = positions.double() - cameras.centres
    away = away / away.norm(dim=-1, keepdim=True).clamp(min=1e-9)
    middle = (regions[:, 0] + regions[:, 2]) / (2 * cameras.width) - 0.5
    size = torch.stack(
        [
            (regions[:, 2] - regions[:, 0]) / cameras.width,
            (regions[:, 3] - regions[:, 1]) / cameras.height,
            middle,
        ],
        dim=-1,
    )
    return torch.cat([away.float(), size.float()], dim=-1)
