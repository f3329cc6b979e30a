"""What a controller reports, and what a look at it finds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Finding", "HeldStop", "Status"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldStop:
    """Why the controller holds the arm.

    Attributes:
        kind: Kind of the cause: ``push``, ``overload``, ``position-error``, ``unstable``, ``encoder-jump`` …
        number: Number of the kind, as Modbus has it.
        code: Name of its page: ``jtc explain CODE``.
        joint: Joint from 1 that the cause was found at first; None: at none in particular.
        value: Value that was found; None where the kind has none.
        limit: Limit of the value; None where there is none.
        unit: Unit of value and limit; empty where they have none.
        text: Cause in words.
        remedy: What removes the cause.
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
    """What the controller reports of itself and the arm. A joint that is silent, or not ready yet, has NaN for what it does not measure.

    Attributes:
        state: State of the controller: ``Init``, ``HoldPos``, ``Operate``, ``Teaching``, ``Error`` …
        trajectory: What becomes of its trajectory: ``Null``, ``Stop``, ``Pause``, ``Execute``, ``Finish`` …
        point: Millisecond of the path.
        position: Measured positions (6,), rad.
        velocity: Measured velocities (6,), rad/s.
        torque: Torques that the drives report (6,), N·m.
        temperature: Bearing temperatures (6,), °C.
        joint_states: State of each drive.
        errors: What is wrong now, in words.
        warnings: What the drives warn of.
        waiting_for: What the controller does or waits for, in a line.
        next: What helps, or comes next.
        held_stop: The held stop that the arm is in, with its cause; None: it is in none, or the controller does not tell.
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
    """What a look at link, bus and set-up found.

    Attributes:
        severity: ``problem``, ``warning`` or ``good``.
        what: What was found.
        why: The likely cause.
        next: What helps.
    """

    severity: str
    what: str
    why: str
    next: str
