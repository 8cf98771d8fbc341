"""Errors of volery. A simulated loss is never an error."""


class VoleryError(Exception):
    """Base of all errors that volery raises on purpose; `exit_code` is the exit code of the command line."""

    exit_code = 1


class BadInput(VoleryError, ValueError):
    """Invalid input: the message names the value, the bound, the place and the remedy.

    `place`: keys and indices of the offending field, relative to the settings that refuse it.
    """

    exit_code = 2

    def __init__(self, message: str, place: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.place = place

    def __reduce__(self) -> tuple[type["BadInput"], tuple[str, tuple[str | int, ...]]]:
        """Pickle with both arguments, for other processes."""
        return type(self), (str(self), self.place)


class RunFailed(VoleryError):
    """A run failed: for example, a process died, a promise was broken, or the middleware lost a frame."""
