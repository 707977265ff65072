"""Names of the scenes that the recorder can build, each with the number of views it is meant for.

duel           two blocky people before a camera that glides
court          tennis as television shows it: two players, a camera that pans and zooms
static-court   the same from a fixed camera, one player, one set of colours
"""

BUILT_IN_SCENES = {"duel": 1, "duel-camera": 2, "court": 1, "static-court": 1}
