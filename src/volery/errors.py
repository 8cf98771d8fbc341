"""The one hierarchy of errors. A simulated loss is never an error."""


class VoleryError(Exception):
    """Base of every error that volery raises on purpose; `exit_code` is what the command line ends with."""

    exit_code = 1


class BadInput(VoleryError, ValueError):
    """What was asked for cannot be done: the message names the value, the bound, the place and the remedy.

    `place`: keys and indices that lead to the offending field, from the settings that refuse it.
    """

    exit_code = 2

    def __init__(self, message: str, place: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.place = place

    def __reduce__(self) -> tuple[type["BadInput"], tuple[str, tuple[str | int, ...]]]:
        """For other processes."""
        return type(self), (str(self), self.place)


class RunFailed(VoleryError):
    """A run could not be carried through: a process died, a promise was broken, the middleware lost a frame."""
