"""What an encoder gets to see of its objects: crops of the pictures, and the views of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.config import ObjectClassConfig
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.perception.crops import crop_boxes, cut_out
from pe_runtime.perception.views import camera_features, view_features


@dataclass(frozen=True)
class Pictures:
    """Pictures of some frames and the cameras that took them.

    Attributes:
        images: sRGB in [0, 1].
        cameras: One camera per frame, with the pictures' pixel grid.
        native_up: Up axis of the world in whose axes networks are told camera angles.
    """

    images: Float[Tensor, "frames 3 height width"]
    cameras: Cameras
    native_up: str = "z"


@dataclass(frozen=True)
class Place:
    """Where one object was found in each frame.

    Attributes:
        boxes: (left, top, right, bottom) in pixels; NaN where there is none.
        positions: Metres.
        headings: Radians about the world's z axis; None for an object that keeps the world's axes.
    """

    boxes: Float[Tensor, "frames 4"]
    positions: Float[Tensor, "frames 3"]
    headings: Float[Tensor, " frames"] | None = None


@dataclass(frozen=True)
class Glimpse:
    """An encoder's input, and whether it shows anything.

    Attributes:
        crops: In [0, 1], all frames of the first object, then of the next; meaningless where
            nothing is seen.
        view: What the encoder is told of the view, in the same order.
        seen: Whether there is an image region to look at.
    """

    crops: Float[Tensor, "crops 3 height width"]
    view: Float[Tensor, "crops view"]
    seen: Bool[Tensor, "frames objects"]

    def split(self, codes: Float[Tensor, "crops *features"]) -> tuple[Tensor, ...]:
        """What an encoder said of the crops, (frames, ...) of each object."""
        frames, objects = self.seen.shape
        return codes.unflatten(0, (objects, frames)).unbind()


def look(config: ObjectClassConfig, pictures: Pictures, places: Sequence[Place]) -> Glimpse:
    """Cut out what the class's encoder looks at.

    Args:
        config: The class, with the encoder that asks.
        pictures: All frames.
        places: Where each object of the class is in them; one or more.
    """
    each = [_look_at(config, pictures, place) for place in places]
    crops, view, seen = zip(*each, strict=True)
    return Glimpse(torch.cat(crops), torch.cat(view), torch.stack(seen, dim=1))


def _look_at(
    config: ObjectClassConfig, pictures: Pictures, place: Place
) -> tuple[Tensor, Tensor, Tensor]:
    """Crops, view and visibility of one object."""
    encoder, cameras = config.encoder, pictures.cameras
    region = crop_boxes(config, cameras, place.boxes, place.positions, place.headings)
    seen = torch.isfinite(region).all(dim=-1)
    region = torch.where(seen[:, None], region, 0.0)
    crops = cut_out(pictures.images, region, encoder.height, encoder.width, encoder.resampling)
    if encoder.view == "direction":
        view = view_features(cameras, place.positions, region)
    elif encoder.view == "camera":
        view = camera_features(cameras, pictures.native_up, encoder.angle_middles)
    else:
        view = region.new_zeros(len(cameras), 0)
    return crops, view, seen
