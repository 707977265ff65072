"""Which part of a picture an encoder looks at, and how it is cut out."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import ObjectClassConfig
from pe_runtime.geometry.boxes import box_in_image, visible_box_in_image
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.perception.region_pooling import max_pool_regions


def crop_boxes(
    config: ObjectClassConfig,
    cameras: Cameras,
    boxes: Float[Tensor, "frames 4"],
    positions: Float[Tensor, "frames 3"],
    headings: Float[Tensor, " frames"] | None = None,
) -> Float[Tensor, "frames 4"]:
    """The image region that E looks at, in pixels; NaN where there is none.

    "volume" cuts out the projected volume at the position found from the box, so that a crop has
    the same metric size whatever the limbs do; "visible-volume" what the picture shows of it; "box"
    cuts out the box; "frame" the whole picture. There is no region for a volume behind the camera,
    nor for a box of which the picture shows nothing.

    Args:
        config: The class, with the encoder that asks.
        cameras: One camera per frame.
        boxes: (left, top, right, bottom) in pixels; NaN where there is none.
        positions: Where the object stands, metres.
        headings: By how much it is turned, radians; None for not at all.
    """
    whole = positions.new_tensor([0.0, 0.0, cameras.width, cameras.height])
    crop = config.encoder.crop
    if crop == "frame":
        return whole.expand(len(cameras), 4)
    if crop == "box":
        meets = (boxes[:, :2] < whole[2:]).all(dim=-1) & (boxes[:, 2:] > 0).all(dim=-1)
        return torch.where(meets[:, None], _widened(config.encoder.widen, boxes, whole), torch.nan)
    low, high = positions.new_tensor(config.low), positions.new_tensor(config.high)
    if crop == "volume":
        region, ahead = box_in_image(cameras, positions, low, high, headings)
    else:
        region, ahead = visible_box_in_image(cameras, positions, low, high, headings)
    return torch.where(ahead[:, None], region.float(), torch.nan)


def _widened(
    shares: tuple[float, float],
    boxes: Float[Tensor, "frames 4"],
    whole: Float[Tensor, "4"],
) -> Float[Tensor, "frames 4"]:
    """Boxes with a share of their width more on either side and of their height on top."""
    if shares == (0.0, 0.0):
        return boxes
    left, top, right, bottom = boxes.unbind(dim=-1)
    aside, above = shares[0] * (right - left), shares[1] * (bottom - top)
    wide = torch.stack([left - aside, top - above, right + aside, bottom], dim=-1)
    return torch.minimum(wide.clamp(min=0), whole[2:].repeat(2))


def cut_out(
    images: Float[Tensor, "frames 3 height width"],
    regions: Float[Tensor, "frames 4"],
    height: int,
    width: int,
    resampling: str = "bilinear",
) -> Float[Tensor, "frames 3 crop_height crop_width"]:
    """Resample one region of each picture.

    Args:
        images: sRGB in [0, 1].
        regions: (left, top, right, bottom) in pixels; finite.
        height: Rows of the crop.
        width: Columns of the crop.
        resampling: "bilinear", where outside the picture is black; or the "max" of the pixels in
            each cell, where it is mid-grey.
    """
    if resampling == "max":
        return max_pool_regions(images, regions, height, width)
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
