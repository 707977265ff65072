import pytest
import torch
from small_world import small_clips, small_config, small_training
from thin_vgg import write_vgg

from pe_runtime.contract.errors import CheckpointError, ConfigError
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.perceptual import (
    RandomFeatures,
    VggDistance,
    build_perceptual,
    gradient_distance,
)
from pe_runtime.training.synthesis_phase import SynthesisPhase
from pe_runtime.vgg import load_vgg


def pictures(seed=0, size=(16, 12), frames=2):
    return torch.rand(frames, 3, *size, generator=torch.Generator().manual_seed(seed))


def naive_layer(image, filters):
    """relu(convolution with zero borders), pixel by pixel."""
    channels, height, width = image.shape
    padded = torch.zeros(channels, height + 2, width + 2, dtype=image.dtype)
    padded[:, 1:-1, 1:-1] = image
    result = torch.zeros(len(filters), height, width, dtype=image.dtype)
    for index, kernel in enumerate(filters):
        for y in range(height):
            for x in range(width):
                value = (padded[:, y : y + 3, x : x + 3] * kernel).sum()
                result[index, y, x] = max(float(value), 0.0)
    return result


def test_the_distance_agrees_with_its_definition_pixel_by_pixel():
    module = RandomFeatures(widths=(2, 3)).double()
    image, target = pictures(1, (4, 6), 1).double(), pictures(2, (4, 6), 1).double()
    first = [naive_layer(each[0], module.filters0) for each in (image, target)]
    smaller = [each.reshape(2, 2, 2, 3, 2).mean(dim=(2, 4)) for each in first]
    second = [naive_layer(each, module.filters1) for each in smaller]
    wanted = sum((a - b).abs().mean() for a, b in (first, second)) / 2
    torch.testing.assert_close(module(image, target), wanted)


def test_a_picture_is_at_no_distance_from_itself_and_at_some_from_others():
    module = RandomFeatures()
    assert float(module(pictures(), pictures())) == 0
    assert float(module(pictures(), pictures(1))) > 0


def test_the_filters_are_the_same_for_the_same_seed_whatever_torch_s_own():
    torch.manual_seed(1)
    one = RandomFeatures()(pictures(), pictures(1))
    torch.manual_seed(2)
    assert torch.equal(one, RandomFeatures()(pictures(), pictures(1)))
    assert not torch.equal(one, RandomFeatures(seed=8)(pictures(), pictures(1)))


def test_structure_counts_more_than_brightness():
    module, grey = RandomFeatures(), torch.full((1, 3, 32, 32), 0.5)
    stripes = grey.clone()
    stripes[..., ::2] += 0.1
    stripes[..., 1::2] -= 0.1
    assert module(stripes, grey) > 2 * module(grey + 0.1, grey)


def test_gradients_reach_the_picture_and_never_the_target():
    image, target = pictures().requires_grad_(), pictures(1).requires_grad_()
    RandomFeatures()(image, target).backward()
    assert image.grad.abs().max() > 0
    assert target.grad is None


def test_filters_are_no_parameters_and_are_not_saved():
    module = RandomFeatures()
    assert not list(module.parameters())
    assert not module.state_dict()


def test_gradient_distance_by_hand():
    step = torch.zeros(1, 3, 2, 3)
    step[..., 2] = 0.6
    assert float(gradient_distance(step, torch.zeros_like(step))) == pytest.approx(0.3)
    assert float(gradient_distance(step, step + 0.2)) == pytest.approx(0, abs=1e-7)


def test_the_vgg_distance_is_the_sum_of_the_layers_mean_differences(tmp_path):
    features = load_vgg(write_vgg(tmp_path / "vgg.pth"))
    images, targets = pictures(size=(16, 16)), pictures(1, (16, 16))
    pairs = zip(features(images), features(targets), strict=True)
    wanted = sum(float((a - b).abs().mean()) for a, b in pairs)
    assert float(VggDistance(features)(images, targets)) == pytest.approx(wanted, rel=1e-5)
    assert float(VggDistance(features)(images, images)) == 0


def test_gradients_of_the_vgg_distance_reach_the_picture_and_never_the_target(tmp_path):
    features = load_vgg(write_vgg(tmp_path / "vgg.pth"))
    image, target = (pictures(n, (16, 16)).requires_grad_() for n in (0, 1))
    VggDistance(features)(image, target).backward()
    assert image.grad.abs().max() > 0
    assert target.grad is None


def test_random_features_stand_in_where_no_vgg_is_given():
    assert isinstance(build_perceptual(small_training(), 8), RandomFeatures)


@pytest.mark.parametrize("asked", ["vgg", "vgg16"])
def test_a_training_compares_vgg_features_where_there_are_some(tmp_path, asked):
    path = str(write_vgg(tmp_path / "vgg.safetensors"))
    training = small_training(
        perceptual=asked, perceptual_weights=path, patch_height=24, patch_width=24
    )
    networks = SynthesisNetworks(small_config(width=40, height=24))
    phase = SynthesisPhase(networks, small_clips(), None, training)
    assert isinstance(phase.perceptual, VggDistance)
    torch.manual_seed(0)
    figures = phase.step(0.5)
    assert 0 < figures["perceptual"] < float("inf")
    assert not any("perceptual" in name or "vgg" in name for name in phase.tensors())


def test_a_vgg_of_another_depth_than_asked_for_is_refused(tmp_path):
    path = str(write_vgg(tmp_path / "vgg.pth", "vgg19"))
    with pytest.raises(ConfigError, match="'vgg16', but .* is a vgg19"):
        build_perceptual(small_training(perceptual="vgg16", perceptual_weights=path), 64)


def test_patches_too_small_for_a_vgg_are_refused_before_training(tmp_path):
    path = str(write_vgg(tmp_path / "vgg.pth"))
    with pytest.raises(ConfigError, match="16 pixels or more; patches leave 8"):
        build_perceptual(small_training(perceptual="vgg", perceptual_weights=path), 8)


def test_a_vgg_without_a_file_or_of_a_missing_one_is_refused():
    with pytest.raises(ConfigError, match="perceptual_weights"):
        small_training(perceptual="vgg19")
    with pytest.raises(CheckpointError, match="no VGG weights"):
        build_perceptual(small_training(perceptual="vgg", perceptual_weights="nowhere.pth"), 64)
