"""Expected mistakes: each becomes one message and an exit code, never a traceback.

A message says what is wrong, where (file, key or channel), and the next step. The exit code is 2
where what was asked for cannot be, 3 where the lab or the machine failed
(`offboard.terminal.exit_codes`).
"""


class LabError(Exception):
    """Base of every expected mistake."""


class UsageError(LabError):
    """What was asked for cannot be done as it was typed, whatever the lab is like."""


class ConfigError(LabError):
    """A configuration file or an override cannot be used."""


class LogError(LabError):
    """A session log is missing, damaged or does not hold what is needed."""


class DataError(LabError):
    """A data set cannot be used, for example because it does not excite the dictionary."""


class ModelError(LabError):
    """A model file is missing, damaged, or belongs to another robot or dictionary."""


class BusError(LabError):
    """The LCM bus cannot be used, or a channel does not exist."""


class BusUrlError(BusError, UsageError):
    """A URL is of no bus that a lab can speak on."""


class UnknownChannelError(BusError, UsageError):
    """A name is of no channel of this lab."""


class InstallationError(LabError):
    """What is asked for needs packages that are not installed here."""


class LabStateError(LabError):
    """The lab is not in the state a command needs, for example a process did not start."""


class NotWrittenError(LabError):
    """A file that a command should leave cannot be written where a person named it."""


class LogNotWrittenError(LogError, NotWrittenError):
    """The disk takes no more of a session log; what it has taken is whole."""


class PluginError(LabError):
    """A row that another package adds to a table cannot be used."""


class ArgumentError(LabError, ValueError):
    """What was passed to a function cannot be used: its shape, or a number in it."""


class DiskError(LabError, OSError):
    """What is written cannot be: the disk is full or read-only, or the folder another's.

    It is an OSError too, made of ``errno``, ``strerror`` and ``filename``, so that whoever knows a
    better next step can say it instead.
    """

    def __str__(self) -> str:
        return (
            f"{self.filename}: cannot be written ({self.strerror}); make room on the disk, or "
            "choose another place"
        )
