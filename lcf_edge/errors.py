"""Errors that a user sees: one line that names the file, key or device and what to do."""


class LcfError(Exception):
    """Something that the user can fix; its text is the whole message. Exit status 1."""

    exit_status = 1


class UsageError(LcfError):
    """Wrong usage of a command. Exit status 2."""

    exit_status = 2


class ConfigError(UsageError):
    """A configuration that cannot be used. Exit status 2."""


class RecordingError(LcfError):
    """A recording that cannot be read at all (damage further in is only a warning)."""


class PublishError(LcfError):
    """The Zenoh session could not be opened."""
