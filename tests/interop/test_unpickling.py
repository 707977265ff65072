"""Data comes out of the release's pickles; nothing in them is ever run."""

import builtins
import collections
import copyreg
import io
import os
import pickle
import struct
import sys

import numpy as np
import pytest
import torch
from interop import official_folders
from interop.official_folders import Spy, dumps, pose

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.interop import unpickling
from pe_runtime.interop.dataset_values import Pose
from pe_runtime.interop.unpickling import read_pickle


@pytest.fixture
def read(tmp_path):
    """Write bytes to a file and read it."""

    def read_bytes(content):
        path = tmp_path / "some.pkl"
        path.write_bytes(content)
        return read_pickle(path)

    return read_bytes


PLAIN = [
    None,
    True,
    -3,
    2**70,
    1.5,
    "täxt\n",
    b"\x00\xff",
    bytearray(b"ab"),
    [],
    {},
    (),
    set(),
    [1, [2, (3, (4,), (5, 6), (7, 8, 9), (1, 2, 3, 4))]],
    {"a": [1.0, float("inf")], 2: None, "deep": {"er": ()}},
    {1, 2, 3},
    frozenset({"a"}),
    collections.OrderedDict(a=1, b=2),
    list(range(3000)),
    {str(n): n for n in range(3000)},
]


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_plain_data_comes_back_as_it_was(read, protocol):
    for value in PLAIN:
        kind = type(value)
        if protocol < 2 and kind in (set, frozenset, bytearray):
            continue
        assert read(pickle.dumps(value, protocol)) == value


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
@pytest.mark.parametrize(
    "array",
    [
        np.arange(6, dtype=np.float32).reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.arange(24).reshape(2, 3, 4)[:, ::2, 1],
        np.array([True, False]),
        np.array(3.5),
        np.zeros((4, 0)),
        np.arange(3, dtype=">i2"),
        np.arange(3, dtype=np.uint8),
    ],
)
def test_arrays_come_back_in_every_protocol(read, protocol, array):
    for value in (array, [array, array]):
        found = read(pickle.dumps(value, protocol))
        found = found if isinstance(found, list) else [found]
        for each in found:
            assert each.dtype == array.dtype
            np.testing.assert_array_equal(each, array)


def test_arrays_are_read_whichever_numpy_wrote_them(read):
    content = pickle.dumps([np.arange(3.0), np.float32(2.5)], 2)
    old, new = b"numpy.core.", b"numpy._core."
    other = content.replace(old, new) if old in content else content.replace(new, old)
    assert other != content
    for each in (content, other):
        array, scalar = read(each)
        np.testing.assert_array_equal(array, np.arange(3.0))
        assert (scalar, scalar.dtype) == (2.5, np.float32)


def test_numbers_of_numpy_come_back_with_their_type(read):
    for value in (np.float64(0.1), np.int64(-5), np.bool_(True), np.float32(1.5)):
        found = read(pickle.dumps(value))
        assert (found, found.dtype) == (value, value.dtype)


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_poses_become_ours_though_their_class_does_not_exist(read, protocol):
    assert official_folders.PATH not in sys.modules
    first, second = read(dumps([pose((1, 2, 3), (4, 5, 6))] * 2, protocol))
    assert first is second
    assert type(first) is Pose
    np.testing.assert_array_equal(first.rotation, [1, 2, 3])
    np.testing.assert_array_equal(first.translation, [4, 5, 6])


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_poses_of_tensors_are_rebuilt_without_torch_loading_anything(read, protocol, monkeypatch):
    table = torch.arange(24.0).reshape(4, 6)
    older = official_folders.PoseParameters(table[1, ::2], table[:3, 4].double())
    content = dumps([older], protocol)
    monkeypatch.setattr(torch, "load", None)
    (found,) = read(content)
    np.testing.assert_array_equal(found.rotation, [6, 8, 10])
    np.testing.assert_array_equal(found.translation, [4, 10, 16])


def called(function, *arguments):
    return pickle.dumps([1, Spy(function, *arguments)])


class Plain:
    pass


def with_state(value, state):
    """A pickle of a value, followed by a BUILD of a state onto it."""
    return pickle.dumps(value, 2)[:-1] + pickle.dumps(state, 2)[2:-1] + pickle.BUILD + pickle.STOP


def reconstructed(*arguments):
    """Arguments of numpy's own way to make an array."""
    return called(np.zeros(1).__reduce__()[0], *arguments)


TENSOR = b"ctorch.storage\n_load_from_bytes\n"
ATTACKS = {
    "a shell": (called(os.system, "touch touched"), "system"),
    "eval": (called(eval, "open('touched', 'w')"), r"builtins\.eval"),
    "exec": (called(exec, "open('touched', 'w')"), r"builtins\.exec"),
    "an import": (called(__import__, "antigravity"), r"builtins\.__import__"),
    "getattr": (called(getattr, [], "append"), r"builtins\.getattr"),
    "open": (called(open, "touched", "w"), r"io\.open|_io\.open"),
    "print": (called(print, "boo"), r"builtins\.print"),
    "another class": (pickle.dumps(Plain()), "Plain"),
    "copyreg": (pickle.dumps(Plain(), 0), r"copyreg\._reconstructor"),
    "a dotted name": (
        b"\x80\x04\x8c\x05numpy\x8c\x0ctesting.IS64\x93.",
        r"numpy\.testing",
    ),
    "through an allowed module": (
        b"\x80\x04\x8c\x05numpy\x8c\x11ndarray.__class__\x93.",
        r"numpy\.ndarray\.__class__",
    ),
    "an object of numpy's": (b"cnumpy\nload\n(X\x01\x00\x00\x00atR.", r"numpy\.load"),
    "an array of objects": (pickle.dumps(np.array([Plain(), None])), "type 'O8'|Plain"),
    "an array of numbers as objects": (pickle.dumps(np.array([1, None], object)), "type 'O8'"),
    "an array of texts": (pickle.dumps(np.array(["a"])), "type 'U1'"),
    "records": (pickle.dumps(np.zeros(1, "i4,f4")), "type 'V8'"),
    "an array of another class": (
        reconstructed(np.ma.MaskedArray, (0,), b"b"),
        "MaskedArray",
    ),
    "an array of no class": (
        pickle.dumps(np.zeros(0), 4).replace(
            b"\x8c\x05numpy\x94\x8c\x07ndarray\x94\x93\x94", b"K\x01", 1
        ),
        "no plain numpy array",
    ),
    "an array called directly": (called(np.ndarray, (3,), np.dtype("f8")), "no release of numpy"),
    "a call of a number": (b"\x80\x02K\x01)R.", "no constructor"),
    "a call of text": (b"\x80\x02X\x04\x00\x00\x00evalX\x01\x00\x00\x001\x85R.", "no constructor"),
    "a call of a pose": (b"\x80\x02K\x01K\x02\x86)R.", "no constructor"),
    "state of a list": (with_state([], {"append": 1}), "inside"),
    "state of a dictionary": (with_state({}, {"__class__": 1}), "inside"),
    "state of an array": (with_state(np.zeros(2), {"dtype": 1}), "inside"),
    "state of a constructor": (
        b"cnumpy\ndtype\n}X\x04\x00\x00\x00makeK\x01sb.",
        "inside",
    ),
    "a class by INST": (b"(X\x04\x00\x00\x00ls /ios\nsystem\n.", "INST"),
    "a class by OBJ": (b"(cnumpy\ndtype\nX\x02\x00\x00\x00f4o.", "OBJ"),
    "the extension registry": (b"\x82\x01.", "EXT1"),
    "a persistent id": (b"\x80\x02K\x01Q.", "outside itself"),
    "a persistent name": (b"Pname\n.", "PERSID"),
    "keyword arguments": (b"\x80\x04cnumpy\ndtype\n)}\x92.", "NEWOBJ_EX"),
    "an outer buffer": (b"\x80\x05\x97.", "NEXT_BUFFER"),
    "a pickle within a tensor": (
        b"\x80\x02"
        + TENSOR
        + pickle.dumps(called(os.system, "touch touched"), 3)[2:-1]
        + b"\x85R.",
        "system",
    ),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_is_no_data_is_refused_by_name_and_not_run(read, tmp_path, monkeypatch, attack):
    content, named = ATTACKS[attack]
    run = []
    for module, name in ((os, "system"), (builtins, "eval"), (builtins, "exec")):
        monkeypatch.setattr(module, name, lambda *a, name=name: run.append(name))
    monkeypatch.setattr(copyreg, "_reconstructor", lambda *a: run.append("reconstructor"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(EpisodeError, match=named) as refusal:
        read(content)
    assert "some.pkl" in str(refusal.value)
    assert "nothing of it was run" in str(refusal.value)
    assert run == []
    assert not (tmp_path / "touched").exists()


def test_a_name_is_refused_before_its_module_is_imported(read):
    sys.modules.pop("antigravity", None)
    with pytest.raises(EpisodeError, match=r"antigravity\.fly"):
        read(b"cantigravity\nfly\n.")
    assert "antigravity" not in sys.modules


def test_a_refused_file_changes_no_constructor(read):
    before = dict(unpickling.CONSTRUCTORS)
    with pytest.raises(EpisodeError):
        read(ATTACKS["state of a constructor"][0])
    assert dict(unpickling.CONSTRUCTORS) == before
    assert read(pickle.dumps(np.arange(2))).tolist() == [0, 1]


def array_state(shape, kind="f4", content=b"\0" * 8):
    """A pickle of an array that says these things of itself."""
    constructor, arguments, _ = np.zeros(1).__reduce__()

    class Array:
        def __reduce__(self):
            return constructor, arguments, (1, shape, np.dtype(kind), False, content)

    return pickle.dumps(Array())


def nested(depth):
    return b"\x80\x04" + b"]" * depth + b"a" * (depth - 1) + b"."


def tensor_of(count, numbers):
    """A pickled tensor whose storage says it has `count` numbers."""
    storage = torch.zeros(numbers).untyped_storage()
    content = pickle.dumps(torch.zeros(numbers), 2)
    return content.replace(struct.pack("<q", len(storage) // 4), struct.pack("<q", count))


def key_of_tuples(depth):
    return b"\x80\x04})" + b"\x85" * depth + b"K\x01s."


MISSHAPEN = {
    "nothing": b"",
    "no pickle": b"hello world",
    "only a stop": b".",
    "two values": b"K\x01K\x02.",
    "an empty stack": b"0.",
    "a mark that is missing": b"e.",
    "memory that is empty": b"h\x05.",
    "a length beyond the end": b"\x8e" + struct.pack("<Q", 2**62) + b"abc.",
    "a text that is no utf-8": b"\x8c\x02\xff\xfe.",
    "an array larger than its bytes": array_state((10**6, 10**6)),
    "an array smaller than its bytes": array_state((1,)),
    "an array of negative size": array_state((-2,)),
    "an array of very many axes": array_state((1,) * 40 + (2,)),
    "a shape that is a list": array_state([2]),
    "a shape of floats": array_state((2.0,)),
    "an array without state": b"cnumpy\ndtype\nX\x02\x00\x00\x00f4\x85R.",
    "lists nested too deep": nested(200_000),
    "tuples nested too deep": b"\x80\x04" + b"(" * 200_000 + b"t" * 200_000 + b".",
    "a key that is a tower of tuples": key_of_tuples(200_000),
    "a set of lists": b"\x80\x04\x8f(]\x90.",
    "a list that is appended to a number": b"K\x01K\x02a.",
    "a tensor that makes much of little": pickle.dumps(torch.zeros(1).expand(10**9)),
    "a tensor beyond its numbers": pickle.dumps(torch.zeros(3)).replace(b"K\x03\x85", b"K\x09\x85"),
    "a tensor shorter than it says": tensor_of(2**40, 3),
}


@pytest.mark.parametrize("case", MISSHAPEN)
def test_a_damaged_file_is_one_clear_error(read, case):
    with pytest.raises(EpisodeError, match=r"some\.pkl is damaged") as error:
        read(MISSHAPEN[case])
    assert len(str(error.value)) < 300


def test_every_truncation_of_a_file_is_one_clear_error(read):
    content = dumps([pose((1, 2, 3), (4, 5, 6)), np.arange(3), {"a": (1.5, "b")}])
    for length in range(len(content)):
        with pytest.raises(EpisodeError, match="damaged"):
            read(content[:length])


def test_flipped_bytes_are_read_or_refused_but_never_crash(read):
    content = dumps([pose((1, 2, 3), (4, 5, 6)), np.arange(3), np.float32(1), {"a": {1, 2}}])
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(400):
        changed = bytearray(content)
        for place in rng.integers(0, len(content), 2):
            changed[place] = rng.integers(0, 256)
        try:
            read(bytes(changed))
        except EpisodeError:
            refused += 1
    assert refused > 80


def test_too_large_a_file_and_too_many_instructions_are_refused(read, monkeypatch):
    monkeypatch.setattr(unpickling, "MOST_INSTRUCTIONS", 1000)
    with pytest.raises(EpisodeError, match="more than 1000 instructions"):
        read(pickle.dumps(list(range(2000))))
    monkeypatch.setattr(unpickling, "LARGEST_FILE", 100)
    with pytest.raises(EpisodeError, match="at most 100"):
        read(b"\0" * 101)


def test_a_missing_file_is_one_clear_error(tmp_path):
    with pytest.raises(EpisodeError, match="cannot be read: No such file"):
        read_pickle(tmp_path / "none.pkl")


@pytest.mark.parametrize(
    "wrong",
    [
        official_folders.PoseParametersNumpy(np.zeros(2), np.zeros(3)),
        official_folders.PoseParametersNumpy(np.zeros(3), "here"),
        official_folders.PoseParametersNumpy([0, 0, 0], np.zeros(3)),
    ],
)
def test_a_pose_that_is_none_is_one_clear_error(read, wrong):
    with pytest.raises(EpisodeError, match="is no array of 3 numbers"):
        read(dumps(wrong))


def test_a_pose_with_slots_or_without_attributes_is_refused(read):
    name = official_folders.PATH.encode() + b"\nPoseParametersNumpy\n"
    for state in (b"}}\x86", b"N", b"]"):
        with pytest.raises(EpisodeError, match="damaged"):
            read(b"\x80\x02c" + name + b")\x81" + state + b"b.")


def test_reading_goes_no_further_than_the_end_of_the_data():
    stream = io.BytesIO(pickle.dumps(5) + b"rest")
    assert unpickling._Machine({}).run(stream) == 5
    assert stream.read() == b"rest"
