"""What a controller reports to its hosts, 25 times a second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openjtc import _native

__all__ = ["Response", "Status", "StatusReader"]


@dataclass(frozen=True)
class Response:
    """What became of a frame that the host sent.

    Attributes:
        frame_type: Its type byte; 0 where it is not known.
        accepted: It arrived well and was obeyed.
        words: Both in words.
        length: Bytes received.
    """

    frame_type: int
    accepted: bool
    words: str
    length: int


@dataclass(frozen=True, eq=False)
class Status:
    """One status. Arrays are (6,), base to wrist.

    Attributes:
        state: ``Start``, ``Init``, ``HoldPos``, ``Operate``, ``Teaching`` or ``Error``.
        trajectory: ``Null``, ``Stop`` (complete, at its start), ``Pause``, ``Execute`` or ``Finish``.
        point: Place on the trajectory, ms.
        errors: Error word; 0 is none.
        occurred: Errors since they were cleared.
        causes: The errors in words.
        position: rad.
        velocity: rad/s.
        torque: N·m.
        temperature: °C.
        drives: States of the drives, in words.
        response: What became of a frame, where this status reports it.
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
    """Finds the statuses in the bytes that a controller sends, however they are cut."""

    def __init__(self) -> None:
        self._native = _native.StatusReader()

    def feed(self, data: bytes) -> list[Status]:
        """The statuses that are complete with these bytes, oldest first."""
        found = []
        for values in self._native.feed(data):
            response = values.pop("response")
            found.append(Status(**values, response=None if response is None else Response(*response)))
        return found
