import pytest
import torch

from pe_runtime.config import BendingConfig
from pe_runtime.field.bending import RayBending


def bending(scale=0.1, seed=0):
    torch.manual_seed(seed)
    return RayBending(BendingConfig(width=8, depth=2, octaves=2, output_scale=scale), 3)


def points(rays=6, samples=4, seed=1):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(rays, samples, 3, generator=generator) * 2 - 1


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_bent_points_stay_in_the_volume(scale):
    pose = torch.randn(2, 3, generator=torch.Generator().manual_seed(2)) * 10
    bent = bending(scale)(points(), torch.tensor([0, 1, 0, 1, 0, 1]), pose)
    assert bent.abs().max() <= 1


def test_bending_starts_near_the_identity_and_yet_feels_the_pose():
    module, at = bending(0.01), points() * 0.9
    frame = torch.zeros(6, dtype=torch.long)
    one, other = module(at, frame, torch.ones(1, 3)), module(at, frame, -torch.ones(1, 3))
    assert (one - at).abs().max() < 0.2
    assert not torch.equal(one, other)


def test_the_pose_gets_a_gradient_from_the_first_step_on():
    pose = torch.zeros(1, 3, requires_grad=True)
    bending(0.01)(points(), torch.zeros(6, dtype=torch.long), pose).square().sum().backward()
    assert pose.grad.abs().min() > 0


def test_every_ray_is_bent_by_the_pose_of_its_frame():
    module, at = bending(), points()
    poses = torch.randn(2, 3, generator=torch.Generator().manual_seed(3))
    frame = torch.tensor([0, 1, 1, 0, 1, 0])
    together = module(at, frame, poses)
    for number in range(2):
        alone = module(at, torch.zeros(6, dtype=torch.long), poses[number : number + 1])
        mine = frame == number
        torch.testing.assert_close(together[mine], alone[mine], atol=1e-6, rtol=1e-6)


def test_bending_agrees_with_its_formula_written_out():
    module = bending().double()
    at = points().double()
    pose = torch.tensor([[0.3, -1.0, 0.5]], dtype=torch.float64)
    bent = module(at, torch.zeros(6, dtype=torch.long), pose)
    for p, wanted in zip(at.reshape(-1, 3), bent.reshape(-1, 3), strict=True):
        angles = torch.cat([p * f for f in module.encoding.frequencies])
        encoded = torch.cat([p, angles.sin(), angles.cos()])
        hidden = module.layers[0].weight @ encoded + module.layers[0].bias
        hidden = hidden + module.pose.weight @ pose[0]
        hidden = module.layers[1].weight @ hidden.clamp(min=0) + module.layers[1].bias
        moved = p + module.output.weight @ hidden.clamp(min=0) + module.output.bias
        # The displacement passes through float32.
        torch.testing.assert_close(wanted, moved.clamp(-1, 1), atol=1e-6, rtol=1e-6)
