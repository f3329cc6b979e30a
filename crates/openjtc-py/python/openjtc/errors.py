"""Errors of the package. Each error has the failed request, the position of the error, value and limit, the likely cause, and the
remedy."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from openjtc.results import Run


class Error(Exception):
    """Any error of openjtc. All other errors of the package are subclasses.

    Attributes:
        message: The failed request, the position of the error, value and limit.
        code: Short name for programs. If the command ``jtc`` has the same error, it uses the same name.
        joint: Joint, counted from 1; None if the error is not about one joint.
        point: Point of the trajectory, counted from 0; during a motion the time on the path, ms.
        value: Value that was found, in the unit of the message.
        limit: Allowed value, in the unit of ``value``.
        cause: Usual cause; empty if unknown.
        next: Next step for the user; empty if unknown.
        board: Number of the UCoM board; None if the error is not about a single board.
        run: Run of a motion that ended in this error; None for any other error.
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
    """A wrong argument, or an invalid file. No frame was sent."""


class RefusedError(Error):
    """A check refused the request. No frame was sent, and nothing was moved or changed."""


class DeviceError(Error):
    """The controller or a board reports an error."""


class NoLinkError(Error, ConnectionError):
    """No port or bus was found, or no device answers."""


class FaultError(Error):
    """A request failed or was cancelled while it ran. The message says whether the arm may be moving."""


class HeldStopError(FaultError):
    """The controller stopped the arm and holds it after a contact, or because of a load that its model does not include. The code is
    ``held-stop``.

    ``text``, ``joint``, ``value`` and ``limit`` describe the cause. The arm does not move until you call ``robot.recover()``. Look at the
    arm before that call.

    Attributes:
        kind: Kind of the cause: ``push``, ``overload``, ``position-error``, ``unstable``, ``encoder-jump`` …; empty if the controller does
            not report the cause.
        unit: Unit of ``value`` and ``limit``; empty if they have no unit.
        text: Cause in words; empty if the controller does not report the cause.
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
    """Another thread, another program or an operator stopped the arm during the call. The code is ``stopped``.

    ``run`` has the samples of the motion until the stop. A program that continues moves an arm that was stopped on purpose.
    """
