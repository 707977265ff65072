"""Encoder E of one object class: a crop of the picture -> style w and pose pi."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import EncoderConfig, ObjectClassConfig
from pe_runtime.perception.residual_trunks import AttentiveTrunk, ResidualTrunk
from pe_runtime.perception.views import view_size


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
        self.hidden = nn.Linear(narrow * cells + view_size(encoder), encoder.hidden)
        self.output = nn.Linear(encoder.hidden, outputs)

    def forward(
        self, crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops view"]
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
        shared = config.encoder.shared_trunk and style > 0
        self.style = Trunk(config, style + pose if shared else style) if style else None
        self.pose = Trunk(config, pose) if pose and not shared else None
        self.normalise = nn.BatchNorm1d(pose, affine=False, momentum=0.05) if pose else None

    def forward(
        self, crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops view"]
    ) -> tuple[Float[Tensor, "crops style"], Float[Tensor, "crops pose"]]:
        """Style and pose codes of crops in [0, 1] seen under the given views."""
        style = crops.new_zeros(len(crops), 0)
        if self.style is not None:
            style = self.style(crops, view).float()
        if self.normalise is None:
            return style, style.new_zeros(style.shape[0], 0)
        if self.pose is None:
            style, pose = style.split([self.config.style_features, self.config.pose_features], -1)
        else:
            pose = self.pose(crops, view)
        with torch.autocast(pose.device.type, enabled=False):
            return style, self._normalised(pose.float())

    def _normalised(self, pose: Tensor) -> Tensor:
        # What stands in for the plain layer knows the crops of other processes as well.
        if len(pose) > 1 or not isinstance(self.normalise, nn.BatchNorm1d):
            return self.normalise(pose)
        # A single crop has no deviation; it is seen by those of the crops before it.
        running = self.normalise.running_mean, self.normalise.running_var
        return nn.functional.batch_norm(pose, *running, eps=self.normalise.eps)


class ResidualEncoder(nn.Module):
    """E of the paper's authors: a residual trunk with one linear head for style, one for pose."""

    def __init__(self, config: ObjectClassConfig) -> None:
        super().__init__()
        self.trunk = build_trunk(config.encoder)
        style = config.style_features
        self.style = nn.Linear(self.trunk.features, style) if style else None
        pose = config.pose_features
        self.pose = nn.Linear(self.trunk.features, pose) if pose else None

    def forward(
        self, crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops view"]
    ) -> tuple[Float[Tensor, "crops style"], Float[Tensor, "crops pose"]]:
        """Style and pose codes of crops in [0, 1] seen under the given views."""
        features = self.trunk(with_view(crops, view))
        style = features.new_zeros(len(features), 0).float()
        if self.style is not None:
            style = self.style(features).float()
        if self.pose is None:
            return style, style.new_zeros(style.shape[0], 0)
        return style, self.pose(features).float()


def build_encoder(config: ObjectClassConfig) -> ObjectEncoder | ResidualEncoder:
    """E of a class, of the design it asks for."""
    compact = config.encoder.design == "compact"
    return ObjectEncoder(config) if compact else ResidualEncoder(config)


def build_trunk(encoder: EncoderConfig) -> ResidualTrunk | AttentiveTrunk:
    """The trunk of a "residual" or "attentive" encoder."""
    design = {"residual": ResidualTrunk, "attentive": AttentiveTrunk}[encoder.design]
    return design(3 + view_size(encoder), encoder.channels)


def with_view(
    crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops view"]
) -> Float[Tensor, "crops inputs height width"]:
    """Crops in [-1, 1] and, as further maps of one value each, the view."""
    maps = view.to(crops)[:, :, None, None].expand(-1, -1, *crops.shape[-2:])
    return torch.cat([crops * 2 - 1, maps], dim=1)
