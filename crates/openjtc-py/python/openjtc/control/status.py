"""Status that a controller reports to its hosts, 25 times a second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openjtc import _native

__all__ = ["Response", "Status", "StatusReader"]


@dataclass(frozen=True)
class Response:
    """Response of the controller to a frame of the host.

    Attributes:
        frame_type: Type byte of the frame; 0 if it is not known.
        accepted: True if the frame arrived without error and was executed.
        words: Frame type and result in words.
        length: Number of bytes received.
    """

    frame_type: int
    accepted: bool
    words: str
    length: int


@dataclass(frozen=True, eq=False)
class Status:
    """A status of the controller. Arrays are (6,), base to wrist.

    Attributes:
        state: ``Start``, ``Init``, ``HoldPos``, ``Operate``, ``Teaching`` or ``Error``.
        trajectory: ``Null``, ``Stop`` (complete, arm at the start of the path), ``Pause``, ``Execute`` or ``Finish``.
        point: Point reached on the trajectory, ms.
        errors: Error word of the controller; 0 means no error.
        occurred: Error word of all errors since they were last cleared.
        causes: Errors in words.
        position: Positions of the joints, rad.
        velocity: Velocities of the joints, rad/s.
        torque: Torques of the joints, N·m.
        temperature: Temperatures of the bearings, °C.
        drives: States of the drives, in words.
        response: Response to a frame, if this status contains a response.
    """

    state: str
    trajectory: str
    point: int
    errors: int
    occurred: int
    causes: list[str]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    torque: NDArray[np.float64]
    temperature: NDArray[np.float64]
    drives: list[str]
    response: Response | None


class StatusReader:
    """Finds the statuses in the bytes that a controller sends. The caller may pass the bytes in pieces of any size."""

    def __init__(self) -> None:
        self._native = _native.StatusReader()

    def feed(self, data: bytes) -> list[Status]:
        """Returns the statuses that the bytes in `data` complete, oldest first."""
        found = []
        for values in self._native.feed(data):
            response = values.pop("response")
            found.append(Status(**values, response=None if response is None else Response(*response)))
        return found
