import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import (
    DTYPES,
    REPLIES,
    REQUESTS,
    TERMINAL,
    Message,
    failure,
    read_message,
    write_message,
)


def sent(*messages):
    stream = io.BytesIO()
    for message in messages:
        write_message(stream, message)
    return stream.getvalue()


def raw(header):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return io.BytesIO(len(text).to_bytes(8, "little") + text)


def test_messages_come_back_in_order_and_the_end_is_none():
    stream = io.BytesIO(sent(Message("hello", {"protocol": 1}), Message("stop")))
    assert read_message(stream) == Message("hello", {"protocol": 1})
    assert read_message(stream) == Message("stop")
    assert read_message(stream) is None


@given(
    dtype=st.sampled_from(DTYPES),
    shape=st.lists(st.integers(0, 5), max_size=4).map(tuple),
    seed=st.integers(0, 99),
)
def test_an_array_of_any_dtype_and_shape_comes_back_bit_for_bit(dtype, shape, seed):
    array = np.random.default_rng(seed).integers(0, 2, shape).astype(dtype)
    back = read_message(io.BytesIO(sent(Message("frame", {}, {"a": array, "b": array})))).buffers
    assert list(back) == ["a", "b"]
    assert back["b"].dtype == array.dtype
    np.testing.assert_array_equal(back["b"], array)


def test_strided_and_big_endian_arrays_arrive_as_the_same_numbers():
    array = np.arange(24, dtype=">f4").reshape(4, 6)[::-2, ::3]
    back = read_message(io.BytesIO(sent(Message("frame", {}, {"a": array}))))
    np.testing.assert_array_equal(back.buffers["a"], array)


def test_infinite_depth_travels_in_a_buffer():
    depth = np.array([[1.5, np.inf]], np.float32)
    back = read_message(io.BytesIO(sent(Message("frame", {}, {"depth": depth}))))
    np.testing.assert_array_equal(back.buffers["depth"], depth)


def test_a_stream_that_ends_anywhere_inside_a_message_is_an_error():
    whole = sent(Message("frame", {"number": 3}, {"rgb": np.zeros((2, 2, 3), np.uint8)}))
    for length in range(1, len(whole)):
        with pytest.raises(WorkerError, match="closed inside a message"):
            read_message(io.BytesIO(whole[:length]))


def test_a_stream_that_delivers_single_bytes_is_read_whole():
    class Dripping(io.BytesIO):
        def read(self, size=-1):
            return super().read(min(size, 1))

    message = Message("state", {"a": [1]}, {"p": np.arange(6.0).reshape(2, 3)})
    back = read_message(Dripping(sent(message)))
    assert back.fields == message.fields
    np.testing.assert_array_equal(back.buffers["p"], message.buffers["p"])


def test_text_on_the_wire_is_named_as_something_other_than_the_protocol():
    with pytest.raises(WorkerError, match="something other than the protocol"):
        read_message(io.BytesIO(b"Loading model, please wait\n"))


def test_a_message_above_the_size_limit_is_refused_before_memory_is_taken():
    entry = {"name": "a", "dtype": "float64", "shape": [1 << 20, 1 << 20]}
    with pytest.raises(WorkerError, match="larger than the wire"):
        read_message(raw({"type": "frame", "fields": {}, "buffers": [entry]}))


@pytest.mark.parametrize(
    "header",
    [
        b"not json",
        [],
        {"type": "frame", "fields": {}},
        {"type": "frame", "fields": [], "buffers": []},
        {"type": "nonsense", "fields": {}, "buffers": []},
        {"type": ["frame"], "fields": {}, "buffers": []},
        {"type": "frame", "fields": {}, "buffers": [{"name": "a", "dtype": "uint8"}]},
        {"type": "frame", "fields": {}, "buffers": [{"name": "a", "dtype": "object", "shape": []}]},
        {"type": "frame", "fields": {}, "buffers": [{"name": "a", "dtype": "bool", "shape": [-1]}]},
        {
            "type": "frame",
            "fields": {},
            "buffers": [{"name": "a", "dtype": "bool", "shape": [1.5]}],
        },
        {
            "type": "frame",
            "fields": {},
            "buffers": [{"name": "a", "dtype": "bool", "shape": [0]}] * 2,
        },
    ],
    ids=str,
)
def test_a_malformed_header_is_refused(header):
    with pytest.raises(WorkerError):
        read_message(raw(header))


def test_only_known_types_finite_fields_and_plain_dtypes_can_be_written():
    with pytest.raises(WorkerError, match="unknown message type 'rendr'"):
        sent(Message("rendr"))
    with pytest.raises(WorkerError, match="JSON"):
        sent(Message("state", {"x": float("nan")}))
    with pytest.raises(WorkerError, match="JSON"):
        sent(Message("state", {"x": object()}))
    with pytest.raises(WorkerError, match="complex128"):
        sent(Message("state", {}, {"x": np.zeros(2, complex)}))


def test_a_message_that_cannot_be_written_leaves_nothing_on_the_wire():
    stream = io.BytesIO()
    with pytest.raises(WorkerError):
        write_message(stream, Message("state", {"x": float("inf")}, {"a": np.zeros(3)}))
    assert stream.getvalue() == b""


def test_every_terminal_type_is_a_reply_and_no_word_means_both():
    assert set(REPLIES) >= TERMINAL
    assert not set(REPLIES) & set(REQUESTS)


def test_a_failure_names_its_kind_and_message():
    assert failure("ShotError", "bad").fields == {"kind": "ShotError", "message": "bad"}
