import pytest
import torch
from safetensors.torch import save_file

from pe_runtime import checkpoint
from pe_runtime.checkpoint import fit, load_checkpoint, save_checkpoint
from pe_runtime.contract.errors import CheckpointError


def tensors():
    generator = torch.Generator().manual_seed(0)
    return {
        "a.weight": torch.randn(3, 4, generator=generator),
        "steps": torch.tensor(7),
        "empty": torch.zeros(0, 5),
        "half": torch.randn(5, generator=generator).bfloat16(),
        "turned": torch.randn(3, 4, generator=generator).T,
        "double": torch.tensor([1 / 3], dtype=torch.float64),
    }


def test_weights_and_header_come_back_exactly(tmp_path):
    header = {"kind": "model", "names": ["ä", "b"], "nested": {"x": 0.1, "y": None}}
    save_checkpoint(tmp_path / "deep" / "m.safetensors", tensors(), header)
    found_header, found = load_checkpoint(tmp_path / "deep" / "m.safetensors")
    assert found_header == {**header, "format": checkpoint.FORMAT}
    assert found.keys() == tensors().keys()
    for name, each in tensors().items():
        assert found[name].dtype == each.dtype
        assert torch.equal(found[name], each)


def test_nothing_but_the_checkpoint_is_left_in_the_folder(tmp_path):
    for _ in range(2):
        save_checkpoint(tmp_path / "m.safetensors", tensors(), {})
    assert [each.name for each in tmp_path.iterdir()] == ["m.safetensors"]


def test_others_may_read_a_checkpoint_as_they_may_any_file_written_here(tmp_path):
    (tmp_path / "any").write_bytes(b"")
    save_checkpoint(tmp_path / "m.safetensors", tensors(), {})
    modes = {(tmp_path / name).stat().st_mode for name in ("any", "m.safetensors")}
    assert len(modes) == 1


def test_parameters_that_need_gradients_can_be_saved(tmp_path):
    save_checkpoint(tmp_path / "m.safetensors", {"p": torch.nn.Parameter(torch.ones(2))}, {})
    assert not load_checkpoint(tmp_path / "m.safetensors")[1]["p"].requires_grad


def test_a_failed_write_leaves_the_old_checkpoint(tmp_path, monkeypatch):
    path = tmp_path / "m.safetensors"
    save_checkpoint(path, {"a": torch.zeros(2)}, {"step": 1})

    def full_disk(_):
        raise OSError("no space left on device")

    monkeypatch.setattr(checkpoint.os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space"):
        save_checkpoint(path, {"a": torch.ones(2)}, {"step": 2})
    header, found = load_checkpoint(path)
    assert header["step"] == 1
    assert not found["a"].any()


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_truncated_checkpoint_is_one_clear_error(tmp_path, share):
    path = tmp_path / "m.safetensors"
    save_checkpoint(path, tensors(), {"kind": "model"})
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(CheckpointError, match=r"m\.safetensors is damaged"):
        load_checkpoint(path)


def test_a_file_of_something_else_is_one_clear_error(tmp_path):
    path = tmp_path / "m.safetensors"
    path.write_bytes(b"PK\x03\x04 a pickle in a zip, as torch.save writes")
    with pytest.raises(CheckpointError, match="damaged or no safetensors"):
        load_checkpoint(path)


def test_somebody_else_s_safetensors_are_recognised(tmp_path):
    save_file({"a": torch.zeros(2)}, tmp_path / "m.safetensors", {"format": "pt"})
    with pytest.raises(CheckpointError, match="not a checkpoint of this project"):
        load_checkpoint(tmp_path / "m.safetensors")


def test_a_missing_file_and_a_folder_are_no_checkpoints(tmp_path):
    for path in (tmp_path / "nowhere.safetensors", tmp_path):
        with pytest.raises(CheckpointError, match="no checkpoint at"):
            load_checkpoint(path)


def test_a_newer_format_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "FORMAT", 99)
    save_checkpoint(tmp_path / "m.safetensors", {}, {})
    monkeypatch.undo()
    with pytest.raises(CheckpointError, match=r"format 99.*Install"):
        load_checkpoint(tmp_path / "m.safetensors")


def test_a_header_that_is_no_json_is_one_clear_error(tmp_path):
    save_file({"a": torch.zeros(2)}, tmp_path / "m.safetensors", {checkpoint.KEY: "{oops"})
    with pytest.raises(CheckpointError, match="damaged"):
        load_checkpoint(tmp_path / "m.safetensors")


def test_weights_that_fit_pass():
    fit(tensors(), tensors(), "this")


def test_all_misfits_are_named_at_once():
    wanted = {"a": torch.zeros(2), "b": torch.zeros(3), "c": torch.zeros(1)}
    found = {"b": torch.zeros(4), "c": torch.zeros(1), "d": torch.zeros(1)}
    with pytest.raises(CheckpointError, match=r"missing: a; unexpected: d; misshapen: b \(4,\)"):
        fit(wanted, found, "the module")
