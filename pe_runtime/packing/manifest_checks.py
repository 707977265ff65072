"""What Blender's own validation of a manifest lets pass although it is wrong."""

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import pe_runtime
from pe_runtime.packing.archives import Contents

MANIFEST = "blender_manifest.toml"
KEYS = frozenset(
    "schema_version id version name tagline maintainer type blender_version_min "
    "blender_version_max license copyright website tags platforms wheels permissions build".split()
)
NEEDED = (
    "schema_version",
    "id",
    "version",
    "name",
    "tagline",
    "maintainer",
    "type",
    "blender_version_min",
    "license",
)
TAGS = frozenset(
    (
        "3D View",
        "Add Curve",
        "Add Mesh",
        "Animation",
        "Bake",
        "Camera",
        "Compositing",
        "Development",
        "Game Engine",
        "Geometry Nodes",
        "Grease Pencil",
        "Import-Export",
        "Lighting",
        "Material",
        "Mesh",
        "Modeling",
        "Node",
        "Object",
        "Paint",
        "Physics",
        "Pipeline",
        "Render",
        "Rigging",
        "Scene",
        "Sculpt",
        "Sequencer",
        "System",
        "Text Editor",
        "Tracking",
        "User Interface",
        "UV",
    )
)
"""Those that Blender's extensions platform takes of an add-on."""
PERMISSIONS = frozenset(("files", "network", "clipboard", "camera", "microphone"))
LONGEST_LINE = 64
"""Characters of a tagline or of a permission's reason."""
PUNCTUATION = tuple(".,;:!?")


def check_manifest(text: str, files: Contents) -> Iterator[str]:
    """What is wrong with a manifest.

    Args:
        text: The manifest's TOML.
        files: The files of the extension.
    """
    facts = tomllib.loads(text)
    yield from _keys(facts)
    yield from _lines(facts)
    yield from _tags(facts)
    yield from _versions(facts)
    yield from _wheels(facts, files)


def _keys(facts: Mapping[str, Any]) -> Iterator[str]:
    for key in sorted(facts.keys() - KEYS):
        yield f"{MANIFEST}: unknown key {key!r}; known are {', '.join(sorted(KEYS))}"
    for key in NEEDED:
        if not facts.get(key):
            yield f"{MANIFEST}: {key!r} is missing"
    if facts.get("type") != "add-on":
        yield f"{MANIFEST}: type: expected 'add-on', found {facts.get('type')!r}"
    for licence in facts.get("license", ()):
        if not str(licence).startswith("SPDX:"):
            yield f"{MANIFEST}: license: expected as 'SPDX:GPL-3.0-or-later', found {licence!r}"


def _lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """Lines that Blender shows beside a button: the tagline and why something is permitted."""
    permissions = facts.get("permissions", {})
    if not isinstance(permissions, Mapping):
        yield f"{MANIFEST}: permissions must be a table of reasons"
        return
    for name in sorted(permissions.keys() - PERMISSIONS):
        yield f"{MANIFEST}: permissions: Blender knows no {name!r}"
    named = {f"permissions.{name}": reason for name, reason in permissions.items()}
    for name, line in ({"tagline": facts.get("tagline", "")} | named).items():
        if not isinstance(line, str) or not line.strip():
            yield f"{MANIFEST}: {name}: a reason must be given in words, found {line!r}"
        elif line != line.strip() or line.endswith(PUNCTUATION):
            yield f"{MANIFEST}: {name}: must end without punctuation or space, found {line!r}"
        elif len(line) > LONGEST_LINE:
            yield f"{MANIFEST}: {name}: has {len(line)} characters, at most {LONGEST_LINE} show"


def _tags(facts: Mapping[str, Any]) -> Iterator[str]:
    tags = facts.get("tags", [])
    for tag in tags:
        if tag not in TAGS:
            yield f"{MANIFEST}: tags: Blender has no {tag!r}; it has {', '.join(sorted(TAGS))}"
    if len(set(tags)) < len(tags):
        yield f"{MANIFEST}: tags: one stands twice"


def _versions(facts: Mapping[str, Any]) -> Iterator[str]:
    if facts.get("version") != pe_runtime.__version__:
        yield (
            f"{MANIFEST}: version {facts.get('version')!r} is not the runtime's "
            f"{pe_runtime.__version__!r}; the two are released together"
        )
    lowest, highest = facts.get("blender_version_min"), facts.get("blender_version_max")
    numbers = {}
    for name, version in (("min", lowest), ("max", highest)):
        try:
            numbers[name] = None if version is None else [int(n) for n in version.split(".")]
        except (AttributeError, ValueError):
            yield f"{MANIFEST}: blender_version_{name}: expected such as '4.5.0', found {version!r}"
    if numbers.get("min") and numbers.get("max") and numbers["max"] <= numbers["min"]:
        yield (
            f"{MANIFEST}: blender_version_max {highest!r} is not above blender_version_min "
            f"{lowest!r}: no Blender could install it"
        )


def _wheels(facts: Mapping[str, Any], files: Contents) -> Iterator[str]:
    named = [str(wheel).removeprefix("./") for wheel in facts.get("wheels", [])]
    for wheel in named:
        if wheel not in files:
            yield f"{MANIFEST}: wheels: {wheel!r} is not in the extension"
        elif not wheel.endswith("-none-any.whl"):
            yield f"{MANIFEST}: wheels: {wheel!r} is not pure Python and fits one system only"
    for wheel in sorted(name for name in files if name.startswith("wheels/")):
        if wheel not in named:
            yield f"{wheel} is in the extension but not among the manifest's wheels"
