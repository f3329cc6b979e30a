"""Errors: what was asked for, where, value and limit, the likely cause, and what helps."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from openjtc.results import Run


class Error(Exception):
    """Any error of openjtc.

    Attributes:
        message: What was asked for, where, value and limit.
        code: A short name for programs, that of ``jtc`` where it has the error, too.
        joint: The joint, counted from 1; None where it is about none.
        point: The point of the trajectory, counted from 0; in motion the millisecond of its path.
        value: What was found, in the unit of the message.
        limit: What is allowed, in the same unit.
        cause: What usually causes it; empty where that is not known.
        next: The next act that helps; empty where there is none.
        board: The UCoM board, by its number; None where it is about none, or about several.
        run: What was seen of a motion that ended in this error; None of any other error.
    """

    run: Run | None = None

    def __init__(
        self,
        message: str,
        code: str = "error",
        joint: int | None = None,
        point: int | None = None,
        value: float | None = None,
        limit: float | None = None,
        cause: str | None = None,
        next: str = "",
        board: int | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        self.joint = joint
        self.point = point
        self.value = value
        self.limit = limit
        self.cause = cause or ""
        self.next = next
        self.board = board

    def __str__(self) -> str:
        lines = [self.message]
        if self.cause and self.cause not in self.message:
            lines.append(f"cause: {self.cause}")
        if self.next:
            lines.append(f"next: {self.next}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[type[Error], tuple[object, ...]]:
        facts = (self.joint, self.point, self.value, self.limit, self.cause, self.next, self.board)
        return (type(self), (self.message, self.code, *facts))


class UsageError(Error, ValueError):
    """A wrong argument, or a file that cannot be understood. Nothing was sent."""


class RefusedError(Error):
    """A check refuses it: nothing was sent, moved or changed."""


class DeviceError(Error):
    """The controller or a board reports an error."""


class NoLinkError(Error, ConnectionError):
    """There is no port or bus, or nobody answers."""


class FaultError(Error):
    """It went wrong on the way, or was cancelled there. The message says whether the arm may be moving."""


class HeldStopError(FaultError):
    """The controller stopped the arm and holds it: it met something, or a load that its model lacks. Its code is ``held-stop``.

    ``text``, ``joint``, ``value`` and ``limit`` say what the controller found. Nothing moves until ``robot.recover()``, which comes after a
    look at the arm.

    Attributes:
        kind: Kind of the cause: ``push``, ``overload``, ``position-error``, ``unstable``, ``encoder-jump`` …; empty where the controller
            does not tell it.
        unit: Unit of ``value`` and ``limit``; empty where they have none.
        text: What the controller found, in words; empty where it does not tell.
    """

    def __init__(
        self,
        message: str,
        code: str = "held-stop",
        joint: int | None = None,
        point: int | None = None,
        value: float | None = None,
        limit: float | None = None,
        cause: str | None = None,
        next: str = "",
        board: int | None = None,
        kind: str = "",
        unit: str = "",
        text: str = "",
    ) -> None:
        super().__init__(message, code, joint, point, value, limit, cause, next, board)
        self.kind = kind
        self.unit = unit
        self.text = text

    def __reduce__(self) -> tuple[type[Error], tuple[object, ...]]:
        made, facts = super().__reduce__()
        return (made, (*facts, self.kind, self.unit, self.text))


class StoppedError(FaultError):
    """Somebody stopped the arm while this waited for it: another thread, another program, whoever looks after the arm. Its code is ``stopped``.

    ``run`` is what was seen of a motion until then. Who goes on all the same sets off an arm that somebody wanted to stand.
    """
