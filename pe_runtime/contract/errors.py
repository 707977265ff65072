"""The errors a user can meet. Each says what was expected, what was found, where, what to do."""


class PlayableEnvironmentError(Exception):
    """Any failure that is the user's to read: catch this at a door and show one clear line."""


class ConfigError(PlayableEnvironmentError):
    """A configuration has an unknown key, a wrong type or a value out of range."""


class EpisodeError(PlayableEnvironmentError):
    """A recorded episode or data set on disk is missing, incomplete or malformed."""


class CheckpointError(PlayableEnvironmentError):
    """A model file is missing, truncated, of another format, or does not fit its config."""


class ShotError(PlayableEnvironmentError):
    """A rendering job asks for something malformed or impossible."""


class WorkerError(PlayableEnvironmentError):
    """The worker process failed, died, or the messages on its pipe make no sense."""


class ClusterError(PlayableEnvironmentError):
    """A cluster cannot be reached, its workers cannot draw, or they are of another version."""


class CameraError(PlayableEnvironmentError):
    """A camera is not a pinhole, or the geometry seen through it has no answer."""
