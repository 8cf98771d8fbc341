"""Calls of methods of a user's class: what they raise and return is checked, and refused with class and call named."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from ..errors import BadInput
from ..quantities import Floats
from ..user_code import described, user_frames

_SHOWN = 60


class CheckedCalls:
    """Calls of the methods of one class; `what` names it in messages, as in "world my_world:Arena"."""

    def __init__(self, what: str) -> None:
        self._what = what

    def ask(self, owner: Any, method: str, *arguments: Any) -> Any:
        """What a method returns.

        Raises:
            BadInput: it raised something; the message has the lines of the user's code.
        """
        try:
            return getattr(owner, method)(*arguments)
        except (Exception, SystemExit) as error:
            reason = described(error) if user_frames(error) else f"{type(error).__name__}: {error}"
            raise BadInput(f"{self._what}: {called(method, *arguments)} failed: {reason}") from error

    def vector(self, owner: Any, method: str, *arguments: Any, may_have_rows: bool = False) -> Floats | None:
        """The numbers that a method returns, (k,), or rows (n, k) where there may be such; None for None or none.

        Raises:
            BadInput: it raised something, or returned no finite numbers of such a shape.
        """
        value = self.ask(owner, method, *arguments)
        if value is None:
            return None
        try:
            return numbers(value, may_have_rows=may_have_rows)
        except BadInput as error:
            self.refuse(called(method, *arguments), f"returned {error}")

    def refuse(self, call: str, why: str) -> NoReturn:
        """Refuse what a call, or an attribute, has given.

        Raises:
            BadInput: always.
        """
        raise BadInput(f"{self._what}: {call} {why}")


def called(method: str, *arguments: Any) -> str:
    """A call in words, as "measure('1', 'range', 3, 600000000)"."""
    plain = (repr(each) if isinstance(each, str | int | float | np.ndarray) else "…" for each in arguments)
    return f"{method}({', '.join(plain)})"


def shown(value: Any) -> str:
    """A value in words, on one short line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def numbers(value: Any, *, may_have_rows: bool = False) -> Floats | None:
    """A copy of numbers, (k,), or rows (n, k) where there may be such; None without any.

    Raises:
        BadInput: it says what the value is instead, and what is asked for.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise BadInput(f"{shown(value)}, whose rows differ in length") from error
    if array.size == 0:
        return None
    if array.dtype.kind not in "biuf":
        raise BadInput(f"{shown(value)}: return numbers")
    found = np.array(array, dtype=np.float64, ndmin=1)
    if found.ndim > (2 if may_have_rows else 1) or (found.ndim == 2 and found.shape[1] == 1):
        rows = ", or rows (n, k) whose first column says what each row measures" if may_have_rows else ""
        raise BadInput(f"an array of shape {found.shape}: return a number, a vector (k,){rows}")
    if not np.isfinite(found).all():
        raise BadInput(f"{shown(value)}, which is not finite: return None where there is nothing")
    return found
