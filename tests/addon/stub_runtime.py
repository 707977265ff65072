"""A runtime that weighs nothing: wheels that pip installs in seconds, without a network."""

import pe_runtime
from blender_addon.installing.plan import CPU, SetUpPlan
from pe_runtime.contract.messages import PROTOCOL
from pe_runtime.packing.wheels import wheel

TORCH = "0.0.1"
"""Older than any, so that no index or constraint of a machine has a say."""
HELLO = """
import json, sys
length = int.from_bytes(sys.stdin.buffer.read(8), "little")
assert json.loads(sys.stdin.buffer.read(length))["type"] == "hello"
reply = json.dumps({"type": "ready", "fields": {}, "buffers": []}).encode()
sys.stdout.buffer.write(len(reply).to_bytes(8, "little") + reply)
sys.stdout.flush()
sys.stdin.buffer.read(1)
"""
CARD = """
class cuda:
    is_available = staticmethod(lambda: True)
    get_device_name = staticmethod(lambda number: f"Card {number}")
"""


def write_wheels(folder, changes=None, version=pe_runtime.__version__, torch=TORCH, build="+cpu"):
    """Wheels of a stub runtime and of its torch; returns the runtime's path.

    `changes` are files of the runtime: other contents, or None for files it lacks.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "pe_runtime/__init__.py": f"__version__ = {version!r}",
        "pe_runtime/contract/__init__.py": "",
        "pe_runtime/contract/messages.py": f"PROTOCOL = {PROTOCOL}",
        "pe_runtime/worker/__init__.py": "",
        "pe_runtime/worker/model_world.py": "import torch",
        "pe_runtime/worker/__main__.py": HELLO,
    } | (changes or {})
    contents = {name: text.encode() for name, text in files.items() if text is not None}
    name, data = wheel("playable-environments", contents, (f"torch=={torch}",), version)
    (folder / name).write_bytes(data)
    torch_name, torch_data = wheel("torch", {"torch.py": CARD.encode()}, (), TORCH + build)
    (folder / torch_name).write_bytes(torch_data)
    return folder / name


def plan_for(base_python, wheel_path, folder, processor=CPU):
    """A plan that asks no index: pip finds all beside the wheel."""
    offline = ("--no-index", "--find-links", str(wheel_path.parent))
    return SetUpPlan(base_python, wheel_path, folder, processor, "linux", offline)
