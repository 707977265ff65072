"""What the players of the demo do, in the words of whatever actions a model has learnt."""

from collections.abc import Mapping, Sequence

from pe_runtime.shots.action_text import Runs

SCRIPT = (
    ((("back", "back-left"), 3), (("right", "forward-right"), 3), (("raise_arm", "gesture"), 4)),
    ((("raise_arm", "gesture"), 3), (("left", "back-left"), 4), (("forward",), 3)),
)
"""Per player: the wanted action or its substitutes, and the number of steps."""


def demo_runs(names: Sequence[str], action_names: Mapping[str, tuple[str, ...]]) -> Runs:
    """Actions for the players in a picture; more players than the script has repeat it.

    Args:
        names: Players in the picture.
        action_names: Per player the names of the model's actions.
    """
    return {
        name: [
            (find_action(wanted, action_names[name]), steps)
            for wanted, steps in SCRIPT[index % len(SCRIPT)]
        ]
        for index, name in enumerate(names)
    }


def find_action(wanted: Sequence[str], names: tuple[str, ...]) -> int:
    """Index of the first wanted name that exists, also with a number; else of standing."""
    for word in (*wanted, "idle", "stay"):
        for index, name in enumerate(names):
            if name == word or name.startswith(f"{word}-2"):
                return index
    return 0
