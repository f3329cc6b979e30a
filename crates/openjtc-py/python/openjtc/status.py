"""Status of a controller, and findings of its diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Finding", "HeldStop", "Status"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldStop:
    """Cause of a held stop.

    Attributes:
        kind: Kind of the cause: ``push``, ``overload``, ``position-error``, ``unstable``, ``encoder-jump`` …
        number: Number of the kind, as in Modbus.
        code: Code of the page that explains the cause: ``jtc explain CODE``.
        joint: Joint (from 1) at which the controller found the cause first; None: the cause does not belong to a joint.
        value: Value that was found; None if the kind has no value.
        limit: Limit of the value; None if the kind has no limit.
        unit: Unit of value and limit; empty if they have no unit.
        text: Cause in words.
        remedy: Step that removes the cause.
        ago_s: Time since the held stop began, s.
    """

    kind: str
    number: int
    code: str
    joint: int | None
    value: float | None
    limit: float | None
    unit: str
    text: str
    remedy: str
    ago_s: float


@dataclass(frozen=True)
class Status:
    """Status of the controller and the arm. Values that a silent or unready joint does not measure are NaN.

    Attributes:
        state: State of the controller: ``Init``, ``HoldPos``, ``Operate``, ``Teaching``, ``Error`` …
        trajectory: State of the trajectory: ``Null``, ``Stop``, ``Pause``, ``Execute``, ``Finish`` …
        point: Time on the path, ms.
        position: Measured positions (6,), rad.
        velocity: Measured velocities (6,), rad/s.
        torque: Torques that the drives report (6,), N·m.
        temperature: Bearing temperatures (6,), °C.
        joint_states: State of each drive.
        errors: Present errors, in words.
        warnings: Warnings of the drives.
        waiting_for: Present activity of the controller, or the event for which the controller waits, in one line.
        next: Next step for the user.
        held_stop: Present held stop with its cause; None: the arm is not in a held stop, or the controller does not report held stops.
    """

    state: str
    trajectory: str
    point: int
    position: Array
    velocity: Array
    torque: Array
    temperature: Array
    joint_states: list[str]
    errors: list[str]
    warnings: list[str]
    waiting_for: str
    next: str
    held_stop: HeldStop | None = None


@dataclass(frozen=True)
class Finding:
    """Finding about the link, the bus or the set-up.

    Attributes:
        severity: ``problem``, ``warning`` or ``good``.
        what: Description of the finding.
        why: Likely cause.
        next: Next step for the user.
    """

    severity: str
    what: str
    why: str
    next: str
