import cv2
import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from pe_runtime.images import (
    ImageError,
    check_finite,
    linear_from_srgb,
    read_image,
    read_metadata,
    srgb_from_linear,
    to_uint8,
    write_exr,
    write_png,
)

ALL_BYTES = np.arange(256, dtype=np.uint8).repeat(3).reshape(16, 16, 3)


def write_any(path, pixels):
    """Whatever OpenImageIO makes of these pixels: files from other programs."""
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(path))
    names = {"float32": "float", "float16": "half"}
    spec = oiio.ImageSpec(width, height, channels, names.get(pixels.dtype.name, pixels.dtype.name))
    output.open(str(path), spec)
    output.write_image(pixels)
    output.close()


def test_all_bytes_survive_a_png_and_the_float_inside(tmp_path):
    write_png(tmp_path / "a.png", ALL_BYTES)
    picture = read_image(tmp_path / "a.png")
    assert picture.dtype == np.float32
    np.testing.assert_array_equal(picture, ALL_BYTES.astype(np.float32) / np.float32(255))
    write_png(tmp_path / "b.png", picture)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_floats_are_rounded_half_up_and_clipped():
    below = np.nextafter(np.float32(0.5 / 255), np.float32(0))
    values = np.array([-1.0, 0.0, below, 0.5 / 255 + 1e-9, 1.0, 7.0], np.float32)
    assert to_uint8(values[[0, 1, 4, 5]]).tolist() == [0, 0, 255, 255]
    exact = np.array([0.49999999, 0.5, 1.4999, 1.5, 254.49999, 254.5]) / 255
    assert to_uint8(exact).tolist() == [0, 1, 1, 2, 254, 255]
    assert to_uint8(np.array([below])).tolist() == [int(np.floor(np.float64(below) * 255 + 0.5))]


def test_a_number_just_below_one_half_is_not_lifted_by_float32():
    value = np.float32(0.49999997 / 255)
    assert float(value) * 255 < 0.5
    assert to_uint8(np.array([value])).tolist() == [0]


def test_metadata_is_read_back_and_a_broken_file_has_none(tmp_path):
    write_png(tmp_path / "a.png", ALL_BYTES, {"frame_digest": "abc", "note": "two words"})
    found = read_metadata(tmp_path / "a.png")
    assert (found["frame_digest"], found["note"]) == ("abc", "two words")
    assert read_metadata(tmp_path / "missing.png") == {}
    (tmp_path / "b.png").write_bytes(b"nothing")
    assert read_metadata(tmp_path / "b.png") == {}


def test_a_16_bit_png_is_read_with_its_precision(tmp_path):
    pixels = np.array([[[0, 1, 65535], [32768, 257, 2]]], np.uint16)
    write_any(tmp_path / "a.png", pixels)
    np.testing.assert_array_equal(
        read_image(tmp_path / "a.png"), pixels.astype(np.float32) / np.float32(65535)
    )


def test_alpha_is_dropped_without_darkening_the_colours(tmp_path):
    rgba = np.dstack([ALL_BYTES, np.full((16, 16), 40, np.uint8)])
    cv2.imwrite(str(tmp_path / "a.png"), rgba[..., [2, 1, 0, 3]])
    np.testing.assert_array_equal(to_uint8(read_image(tmp_path / "a.png")), ALL_BYTES)


def test_grey_with_or_without_alpha_becomes_colour(tmp_path):
    write_any(tmp_path / "a.png", ALL_BYTES[..., :1])
    write_any(tmp_path / "b.png", np.full((2, 2, 2), 255, np.uint8))
    np.testing.assert_array_equal(to_uint8(read_image(tmp_path / "a.png")), ALL_BYTES)
    assert read_image(tmp_path / "b.png").shape == (2, 2, 3)


def test_a_jpeg_is_read_in_the_right_channel_order(tmp_path):
    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 2] = 255
    cv2.imwrite(str(tmp_path / "a.jpg"), red)
    np.testing.assert_allclose(read_image(tmp_path / "a.jpg")[8, 8], [1, 0, 0], atol=0.02)


@pytest.mark.parametrize("dtype", ["float32", "float16"])
def test_a_linear_exr_is_encoded_as_srgb_and_clipped(tmp_path, dtype):
    linear = np.array([[[0.0, 0.25, 1.0], [0.5, 0.001, 9.0]]], dtype)
    write_any(tmp_path / "a.exr", linear)
    expected = srgb_from_linear(np.clip(linear, 0, 1).astype(np.float32))
    np.testing.assert_allclose(read_image(tmp_path / "a.exr"), expected, atol=1e-6)
    assert read_image(tmp_path / "a.exr")[0, 0, 1] == pytest.approx(0.5371, abs=1e-4)


def test_colours_of_an_exr_are_found_by_name_among_other_channels(tmp_path):
    rgb = np.random.default_rng(0).random((4, 5, 3)).astype(np.float32)
    depth = np.full((4, 5), np.inf, np.float32)
    channels = {"Z": depth} | dict(zip("BGR", np.moveaxis(rgb[..., ::-1], -1, 0), strict=True))
    write_exr(tmp_path / "a.exr", channels)
    np.testing.assert_allclose(read_image(tmp_path / "a.exr"), srgb_from_linear(rgb), atol=1e-6)


def test_every_exr_channel_comes_back_bit_for_bit(tmp_path):
    depth = np.array([[1.5, np.inf], [0.1, 3e-8]], np.float32)
    write_exr(tmp_path / "a.exr", {"Z": depth, "mask.player_1": depth[::-1]}, {"note": "n"})
    source = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    names, pixels = source.spec().channelnames, source.read_image()
    np.testing.assert_array_equal(pixels[..., names.index("Z")], depth)
    assert read_metadata(tmp_path / "a.exr")["note"] == "n"


def test_equal_pixels_give_equal_files_whenever_they_are_written(tmp_path):
    for name in "ab":
        write_exr(tmp_path / f"{name}.exr", {"Z": np.ones((2, 2), np.float32)})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert b"1970" in (tmp_path / "a.exr").read_bytes()


def test_srgb_curves_undo_each_other_and_meet_at_the_knee():
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(values)), values, atol=1e-12)
    knee = np.array([0.0031308, np.nextafter(0.0031308, 1)])
    assert abs(np.diff(srgb_from_linear(knee))[0]) < 1e-7
    byte = np.arange(256) / 255
    back = to_uint8(srgb_from_linear(linear_from_srgb(byte.astype(np.float32))))
    assert back.tolist() == list(range(256))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_picture_that_is_not_finite_is_refused_with_the_place(tmp_path, value):
    picture = np.zeros((4, 6, 3), np.float32)
    picture[2, 5, 1] = value
    write_any(tmp_path / "a.exr", picture)
    with pytest.raises(ImageError, match="column 5, row 2"):
        read_image(tmp_path / "a.exr")
    with pytest.raises(ImageError, match="column 5, row 2"):
        write_png(tmp_path / "b.png", picture)
    assert not (tmp_path / "b.png").exists()


def test_nan_depth_is_refused_and_infinite_depth_is_not(tmp_path):
    with pytest.raises(ImageError, match="'Z'"):
        write_exr(tmp_path / "a.exr", {"Z": np.full((1, 1), np.nan, np.float32)})
    check_finite(np.zeros(3), "here")


def test_a_mask_keeps_its_values_and_reads_as_a_grey_picture(tmp_path):
    mask = np.array([[0, 1], [2, 255]], np.uint8)
    write_png(tmp_path / "a.png", mask)
    picture = np.rint(read_image(tmp_path / "a.png") * 255)
    np.testing.assert_array_equal(picture, np.repeat(mask[..., None], 3, axis=-1))


def test_missing_and_truncated_files_are_refused_by_name(tmp_path):
    with pytest.raises(ImageError, match=r"nothing\.png"):
        read_image(tmp_path / "nothing.png")
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", noise)
    (tmp_path / "b.png").write_bytes((tmp_path / "a.png").read_bytes()[:2000])
    (tmp_path / "c.png").write_bytes(b"GIF")
    for name in ("b.png", "c.png"):
        with pytest.raises(ImageError, match=name):
            read_image(tmp_path / name)


def test_a_failed_write_keeps_the_old_file_and_leaves_no_temporary_one(tmp_path):
    write_png(tmp_path / "a.png", ALL_BYTES)
    before = (tmp_path / "a.png").read_bytes()
    with pytest.raises(ImageError):
        write_png(tmp_path / "a.png", np.full((2, 2, 3), np.nan))
    with pytest.raises(ImageError, match="cannot be written"):
        write_png(tmp_path / "no_folder" / "a.png", ALL_BYTES)
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(ImageError, match="cannot be written"):
        write_png(tmp_path / "folder.png", ALL_BYTES)
    assert (tmp_path / "a.png").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "folder.png"]
