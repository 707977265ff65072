"""LPIPS and FID proper: the arithmetic on small weights, and what is refused."""

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from pe_runtime.contract.errors import CheckpointError, ConfigError
from pe_runtime.evaluation.learnt_features import (
    InceptionFeatures,
    Lpips,
    WeightFiles,
    load_lpips,
)
from pe_runtime.interop.lpips_files import CHANNELS, read_heads

# Places of the convolutions in torchvision's VGG16, and their channels.
PLACES = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)
WIDTHS = (64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("weights")
    torch.manual_seed(0)
    narrow, tensors = 3, {}
    for place, wide in zip(PLACES, WIDTHS, strict=True):
        tensors[f"features.{place}.weight"] = torch.randn(wide, narrow, 3, 3) * (9 * narrow) ** -0.5
        tensors[f"features.{place}.bias"] = torch.zeros(wide)
        narrow = wide
    torch.save(tensors, folder / "vgg16.pth")
    heads = {
        f"lin{i}.model.1.weight": torch.full((1, wide, 1, 1), 0.1 * (i + 1))
        for i, wide in enumerate(CHANNELS)
    }
    torch.save(heads, folder / "heads.pth")
    save_file(heads, folder / "heads.safetensors")
    return folder


def pictures():
    return np.random.default_rng(0).random((2, 32, 32, 3)).astype(np.float32)


@pytest.mark.parametrize("heads", ["heads.pth", "heads.safetensors"])
def test_lpips_is_zero_for_equal_pictures_and_symmetric(files, heads):
    lpips = load_lpips(WeightFiles(vgg=files / "vgg16.pth", lpips_heads=files / heads))
    a, b = pictures()
    assert lpips.distance(a, a) == 0.0
    assert lpips.distance(a, b) == pytest.approx(lpips.distance(b, a))
    assert lpips.distance(a, b) > 0


def test_lpips_is_the_sum_over_layers_of_weighted_squares_of_unit_features(files):
    lpips = load_lpips(WeightFiles(vgg=files / "vgg16.pth", lpips_heads=files / "heads.pth"))
    a, b = pictures()
    images = torch.from_numpy(np.stack([a, b])).permute(0, 3, 1, 2)
    expected = 0.0
    for number, layer in enumerate(lpips.network(images)):
        one, two = (each / (each.norm(dim=0) + 1e-10) for each in layer)
        # All weights of a head are equal here: 0.1, 0.2, ...
        expected += 0.1 * (number + 1) * float(((one - two) ** 2).sum(dim=0).mean())
    assert lpips.distance(a, b) == pytest.approx(expected, rel=1e-4)


def test_without_files_there_is_no_lpips_and_half_of_them_is_a_mistake(files):
    assert load_lpips(WeightFiles()) is None
    with pytest.raises(ConfigError, match="--lpips-heads"):
        load_lpips(WeightFiles(vgg=files / "vgg16.pth"))


def test_heads_of_another_network_are_refused(tmp_path):
    torch.save({"lin0.model.1.weight": torch.zeros(1, 7, 1, 1)}, tmp_path / "alex.pth")
    with pytest.raises(CheckpointError, match="expected lin0"):
        read_heads(tmp_path / "alex.pth")
    with pytest.raises(CheckpointError, match="no LPIPS heads"):
        read_heads(tmp_path / "missing.pth")


class Trap:
    """Something that reading would execute."""

    def __reduce__(self):
        return (print, ("executed",))


def test_heads_that_would_run_code_are_refused(tmp_path, capsys):
    torch.save({"lin0.model.1.weight": Trap()}, tmp_path / "trap.pth")
    with pytest.raises(CheckpointError, match="more than weights"):
        read_heads(tmp_path / "trap.pth")
    assert capsys.readouterr().out == ""


def test_heads_that_do_not_fit_the_layers_are_refused(files):
    lpips = load_lpips(WeightFiles(vgg=files / "vgg16.pth", lpips_heads=files / "heads.pth"))
    with pytest.raises(CheckpointError, match="needs VGG16"):
        Lpips(lpips.network, lpips.heads[:3])


def test_fid_says_what_it_needs(tmp_path):
    with pytest.raises(CheckpointError, match="no Inception weights"):
        InceptionFeatures(tmp_path / "missing.pth")
    (tmp_path / "weights.pth").write_bytes(b"")
    if not _can_import("torch_fidelity"):
        with pytest.raises(ConfigError, match="torch-fidelity"):
            InceptionFeatures(tmp_path / "weights.pth")


def _can_import(name):
    import importlib.util

    return importlib.util.find_spec(name) is not None
