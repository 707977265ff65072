"""JSON for Blender's text blocks, in lines: filling one long line takes Blender minutes."""

import json

LINE_CHARACTERS = 200


def json_text(content: object) -> str:
    """Values as JSON in lines of a readable length.

    Raises:
        ValueError: A number is not finite.
    """
    # No string contains a line break in JSON, so each one stands between two values.
    lines, line, length = [], [], 0
    for part in json.dumps(content, allow_nan=False, separators=(",\n", ": ")).split("\n"):
        line.append(part)
        length += len(part)
        if length >= LINE_CHARACTERS:
            lines.append(" ".join(line))
            line, length = [], 0
    lines.append(" ".join(line))
    return "\n".join(lines)
