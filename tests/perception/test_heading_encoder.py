import math

import pytest
import torch

from pe_runtime.config import EncoderConfig
from pe_runtime.perception.heading_encoder import HeadingEncoder

ENCODER = EncoderConfig(design="residual", view="none", height=16, width=16, channels=(6, 8))
SEEING = EncoderConfig(design="attentive", view="camera", height=16, width=16, channels=(6, 8))


def module(encoder=ENCODER):
    torch.manual_seed(0)
    return HeadingEncoder(encoder)


def crops(count=4):
    return torch.rand(count, 3, 16, 16, generator=torch.Generator().manual_seed(1))


def pointing(u, v):
    """The angle when the head says (u, v) whatever it sees."""
    heading = module()
    with torch.no_grad():
        heading.direction.weight.zero_()
        heading.direction.bias.copy_(torch.tensor([u, v]))
        return float(heading(crops(1), torch.zeros(1, 0)))


@pytest.mark.parametrize(
    ("u", "v", "angle"),
    [
        (1.0, 0.0, 0.0),
        (0.0, 0.5, math.pi / 2),
        (-2.0, 0.0, math.pi),
        (0.3, -0.3, -math.pi / 4),
        (0.1, 0.9, math.atan2(math.tanh(0.9), math.tanh(0.1))),
        (0.0, 0.0, 0.0),
    ],
)
def test_the_angle_is_that_of_the_direction_pointed_at(u, v, angle):
    assert pointing(u, v) == pytest.approx(angle, abs=1e-6)


def test_fresh_headings_are_near_the_camera_s_and_differ_between_crops():
    with torch.no_grad():
        angles = module()(crops(), torch.zeros(4, 0))
    assert 1e-6 < angles.std() and angles.abs().max() < 0.2


@pytest.mark.parametrize("encoder", [ENCODER, SEEING], ids=["residual", "attentive"])
def test_every_weight_learns_and_no_gradient_explodes_at_the_start(encoder):
    heading = module(encoder)
    view = torch.zeros(4, 6 if encoder is SEEING else 0)
    (heading(crops(), view) * torch.tensor([1.0, -2.0, 3.0, 0.5])).sum().backward()
    sizes = [each.grad.abs().max() for each in heading.parameters()]
    assert min(sizes) > 0 and max(sizes) < 100
