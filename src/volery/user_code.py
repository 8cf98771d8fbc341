"""Code that is not volery's: which files hold it, and what is said of the errors that it raises."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

from .errors import BadInput, VoleryError

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
_INSTALLED = {"site-packages", "dist-packages"}


def is_users(file: str | Path) -> bool:
    """Whether a source file is neither the standard library's, nor installed, nor volery's."""
    path = Path(file).absolute()
    return _INSTALLED.isdisjoint(path.parts) and not any(map(path.is_relative_to, _libraries()))


@cache
def _libraries() -> tuple[str, ...]:
    """Folders of the standard library, of installed commands, and of volery."""
    places = sysconfig.get_paths()
    return places["stdlib"], places["platstdlib"], places["scripts"], str(Path(__file__).parent)


def user_frames(error: BaseException) -> list[traceback.FrameSummary]:
    """Those frames of an error's traceback that run code of a user."""
    frames = traceback.extract_tb(error.__traceback__)
    return [one for one in frames if _is_of_user(one.filename)]


def _is_of_user(file: str) -> bool:
    """Whether code of this name, which need be no file, is a user's."""
    return not file.startswith("<frozen ") and not file.endswith(".pyx") and is_users(file)


def described(error: BaseException) -> str:
    """One sentence about an error, and below it the frames of the user's code; all where volery itself has failed."""
    kind, text = type(error).__name__, str(error)
    sentence = text if isinstance(error, VoleryError) and text else f"{kind}: {text}" if text else kind
    frames = user_frames(error)
    if not frames and not isinstance(error, VoleryError):
        frames = list(traceback.extract_tb(error.__traceback__))
    return f"{sentence}\n{''.join(traceback.format_list(frames))}".rstrip()


def names_user_code(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Decorate a function that calls a user's methods: what they raise becomes a BadInput that names method and lines.

    Errors of volery pass, and so do those without any frame of a user.
    """

    @wraps(function)
    def call(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        try:
            return function(*args, **kwargs)
        except VoleryError:
            raise
        except (Exception, SystemExit) as error:
            frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
            methods = [frame.f_code.co_qualname for frame in frames if _is_of_user(frame.f_code.co_filename)]
            if not methods:
                raise
            raise BadInput(f"{methods[0]} failed: {described(error)}") from error

    return call
