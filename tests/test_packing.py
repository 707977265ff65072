"""The extension's zip: what is in it, what it refuses to be, and that it never varies."""

import io
import re
import zipfile
from pathlib import Path

import pytest

import pe_runtime
from pe_runtime.packing import extension, wheels
from pe_runtime.packing.archives import read_tree, zip_bytes
from pe_runtime.packing.content_checks import check_contents
from pe_runtime.packing.imports import missing_imports
from pe_runtime.packing.manifest_checks import MANIFEST, check_manifest
from pe_runtime.packing.wheels import PackingError

ROOT = Path(__file__).parents[1]
GOOD = f"""
schema_version = "1.0.0"
id = "sample"
version = "{pe_runtime.__version__}"
name = "Sample"
tagline = "Shows what is right"
maintainer = "Somebody"
type = "add-on"
blender_version_min = "4.5.0"
license = ["SPDX:GPL-3.0-or-later"]
tags = ["Render"]
wheels = ["./wheels/part-1-py3-none-any.whl"]
[permissions]
files = "Read pictures"
"""
PART = zip_bytes({"part/__init__.py": b"VALUE = 1", "part/inner.py": b"import numpy, json"})
FILES = {
    MANIFEST: GOOD.encode(),
    "__init__.py": b"from . import here\nfrom part.inner import json\nimport part, bpy, numpy",
    "here.py": b"from .room.thing import Thing\nfrom . import room\nfrom part import VALUE",
    "room/__init__.py": b"def f():\n    from .thing import Thing",
    "room/thing.py": b"import math\nclass Thing: pass\nfrom ..here import Thing as Again",
    "runtime/all-1-py3-none-any.whl": PART,
    "wheels/part-1-py3-none-any.whl": PART,
}


@pytest.fixture
def addon(tmp_path):
    """A small add-on's sources."""
    folder = tmp_path / "addon"
    folder.mkdir()
    manifest = "\n".join(line for line in GOOD.splitlines() if not line.startswith("wheels"))
    (folder / MANIFEST).write_text(manifest)
    (folder / "__init__.py").write_text("from pe_runtime.contract.camera import Camera\n")
    return folder


def problems(old="", new="", files=FILES):
    return list(check_manifest(GOOD.replace(old, new), files))


def test_a_manifest_that_is_right_passes():
    assert problems() == []


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("tagline", "tag_line", "unknown key 'tag_line'"),
        ("tagline", "tag_line", "'tagline' is missing"),
        ('type = "add-on"', 'type = "theme"', "expected 'add-on', found 'theme'"),
        ("SPDX:GPL", "GPL", "found 'GPL-3.0-or-later'"),
        ('"Render"', '"Rendering"', "Blender has no 'Rendering'"),
        ('["Render"]', '["Render", "Render"]', "one stands twice"),
        ("Read pictures", "Read pictures.", "must end without punctuation"),
        ("is right", "is right!", "tagline: must end without punctuation"),
        ('"Read pictures"', '""', "a reason must be given in words"),
        ('"Read pictures"', "true", "a reason must be given in words"),
        ("Read pictures", "Read pictures " * 9 + "x", "at most 64"),
        ("files =", "telepathy =", "Blender knows no 'telepathy'"),
        (f'"{pe_runtime.__version__}"', '"9.9.9"', "released together"),
        ("type =", 'blender_version_max = "4.5.0"\ntype =', "no Blender could install it"),
        ("type =", 'blender_version_max = "4.2.0"\ntype =', "no Blender could install it"),
        ('min = "4.5.0"', 'min = "four"', "expected such as '4.5.0', found 'four'"),
        ("part-1", "part-2", "'wheels/part-2-py3-none-any.whl' is not in the extension"),
        ("part-1", "part-2", "wheels/part-1-py3-none-any.whl is in the extension but not"),
    ],
)
def test_a_manifest_that_blender_would_take_is_refused_with_the_reason(old, new, what):
    assert any(what in problem for problem in problems(old, new))


def test_a_wheel_for_one_system_is_refused():
    odd = FILES | {"wheels/part-1-cp311-cp311-linux_x86_64.whl": PART}
    found = problems("part-1-py3-none-any", "part-1-cp311-cp311-linux_x86_64", odd)
    assert any("fits one system only" in problem for problem in found)


def test_contents_that_are_right_pass():
    assert list(check_contents(FILES)) == []


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"tests/test_here.py": b""}, "tests/test_here.py is no part"),
        ({"datagen/walk.py": b""}, "datagen/walk.py is no part"),
        ({"room/__pycache__/thing.cpython-311.pyc": b""}, "is no part"),
        ({"here.py.orig": b""}, "here.py.orig is no part"),
        ({"here.py": b"import torch"}, "addon.here:1 imports torch"),
        ({"here.py": b"\nfrom . import nowhere"}, "addon.here:2 imports addon.nowhere"),
        ({"here.py": b"from .room.thing import Things"}, "imports addon.room.thing.Things"),
        ({"here.py": b"from .room import things"}, "imports addon.room.things"),
        ({"here.py": b"import part.outer"}, "imports part.outer"),
        ({"here.py": b"from part import OTHER"}, "imports part.OTHER"),
        ({"room/thing.py": b"from ...outside import x"}, "addon.room.thing:1 imports"),
        ({"here.py": b"def :"}, "here.py:1 is no Python"),
        ({"wheels/part-1-py3-none-any.whl": zip_bytes({"part.py": b"import cv2"})}, "imports cv2"),
    ],
)
def test_what_is_foreign_or_cannot_be_imported_is_named(change, what):
    assert any(what in problem for problem in check_contents(FILES | change))


@pytest.mark.parametrize("name", [MANIFEST, "__init__.py", "runtime/all-1-py3-none-any.whl"])
def test_a_file_that_is_needed_is_missed(name):
    rest = {each: data for each, data in FILES.items() if each != name}
    assert any(name.split("/")[0] in problem for problem in check_contents(rest))


def test_imports_of_blender_and_of_the_standard_library_need_nothing():
    assert (
        list(missing_imports({"__init__.py": b"import bpy.types, os.path, gpu, numpy"}, {})) == []
    )


def test_equal_sources_give_an_equal_zip(addon, tmp_path):
    first = extension.write_extension(tmp_path / "one", addon)
    for path in addon.iterdir():
        path.touch()
    second = extension.write_extension(tmp_path / "two", addon)
    assert first.name == second.name == f"sample-{pe_runtime.__version__}.zip"
    assert first.read_bytes() == second.read_bytes()
    assert [file.suffix for file in (tmp_path / "one").iterdir()] == [".zip"]


def test_the_zip_brings_the_contract_for_blender_and_the_runtime_for_another_python(addon):
    files = extension.extension_files(addon)
    (contract,) = [name for name in files if name.startswith("wheels/")]
    (runtime,) = [name for name in files if name.startswith("runtime/")]
    assert contract in files[MANIFEST].decode() and runtime not in files[MANIFEST].decode()
    inside = zipfile.ZipFile(io.BytesIO(files[runtime])).namelist()
    wanted = {"worker/__main__.py", "contract/shot.py", "models/duel.safetensors"}
    assert {f"pe_runtime/{name}" for name in wanted} <= set(inside)
    assert not [name for name in inside if "__pycache__" in name or "tests" in name]


def test_an_addon_that_is_wrong_makes_no_zip(addon, tmp_path):
    (addon / "lost.py").write_text("from . import nothing, of_it")
    with pytest.raises(PackingError, match="lost:1 imports .*nothing.*; .*of_it"):
        extension.write_extension(tmp_path / "out", addon)
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_manifest_is_no_addon(tmp_path):
    with pytest.raises(PackingError, match=MANIFEST):
        extension.extension_files(tmp_path)


@pytest.mark.parametrize(
    ("text", "what"), [("wheels = []\n", "must leave `wheels`"), ("= 3", "is no TOML")]
)
def test_a_manifest_that_cannot_take_the_wheel_is_named(addon, text, what):
    manifest = (addon / MANIFEST).read_text()
    (addon / MANIFEST).write_text(text + manifest)
    with pytest.raises(PackingError, match=what):
        extension.extension_files(addon)


def test_a_file_left_in_the_runtime_is_not_shipped(monkeypatch, tmp_path):
    (tmp_path / "notes.docx").write_bytes(b"")
    monkeypatch.setattr(wheels, "RUNTIME", tmp_path)
    with pytest.raises(PackingError, match=re.escape("notes.docx")):
        wheels.runtime_wheel()


def test_byte_code_is_never_read(tmp_path):
    for name in ("a.py", "b.pyc", "__pycache__/a.cpython-311.pyc", "datagen/c.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    assert set(read_tree(tmp_path, frozenset(["datagen"]))) == {"a.py"}


def test_the_pinned_requirements_are_the_versions_that_the_tests_ran_with():
    pinned = dict(
        line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines()
        if "==" in line
    )  # fmt: skip
    for need in wheels.requirements():
        name, version = need.split(";")[0].strip().split("==")
        older = not re.search(r'python_version >= "3.1[34]"', need)
        assert (pinned[name] == version) == older, need


def test_each_requirement_holds_once_on_every_python():
    from packaging.requirements import Requirement

    for python in ("3.11", "3.12", "3.13", "3.14"):
        needs = [Requirement(need) for need in wheels.requirements()]
        held = [
            n.name for n in needs if not n.marker or n.marker.evaluate({"python_version": python})
        ]
        assert len(held) == len(set(held)) == len({n.name for n in needs})


def test_the_wheel_of_the_runtime_states_what_it_needs_and_lists_its_files():
    name, data = wheels.wheel("playable-environments", {"a.py": b"1"}, ("torch==2.13.0",))
    archive = zipfile.ZipFile(io.BytesIO(data))
    stem = name.removesuffix("-py3-none-any.whl")
    assert "Requires-Dist: torch==2.13.0" in archive.read(f"{stem}.dist-info/METADATA").decode()
    listed = archive.read(f"{stem}.dist-info/RECORD").decode().splitlines()
    assert {line.split(",")[0] for line in listed} == set(archive.namelist())
