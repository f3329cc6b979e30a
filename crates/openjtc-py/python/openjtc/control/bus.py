"""The joint bus from the side of the drives. The functions read requests of the controller and make answers.

On the bus, nodes are numbered from 0. Node 2 is the drive of joint 3, and node 6 is the gripper. A drive answers each
:class:`Move` with :func:`joint_answer`, each :class:`ChangeState` with :func:`state_answer`, and each :class:`Configure` with
:func:`configured_answer`. The gripper answers a :class:`Move` with :func:`gripper_answer`. Nodes do not answer resets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from openjtc import _native

__all__ = [
    "ENABLED",
    "FAULT",
    "GRIPPER",
    "INIT",
    "READY",
    "ChangeState",
    "Configure",
    "Move",
    "Request",
    "Reset",
    "configured_answer",
    "gripper_answer",
    "joint_answer",
    "parse",
    "state_answer",
]

#: Node of the gripper.
GRIPPER = 6
#: State of a node in which the motor is off and the node waits for its configuration.
INIT = 1
#: State of a node in which the node is configured and the motor is off.
READY = 2
#: State of a node in which the node follows its command.
ENABLED = 3
#: State of a node after a fault.
FAULT = 255


@dataclass(frozen=True, eq=False)
class Move:
    """Request for torques (6,) at the joints, N·m, and for the pump."""

    torque: NDArray[np.float64]
    pump: bool


@dataclass(frozen=True)
class ChangeState:
    """Request for a state of each of the seven nodes; 0 means no change."""

    target: tuple[int, ...]


@dataclass(frozen=True)
class Configure:
    """Request with the mode (1: torque) and configuration bits of each joint, and the configuration bits of the gripper."""

    mode: tuple[int, ...]
    config: tuple[int, ...]
    gripper: int


@dataclass(frozen=True)
class Reset:
    """Request for a restart of one node, or of all nodes (None)."""

    node: int | None


Request = Move | ChangeState | Configure | Reset


def parse(frame: tuple[int, bytes]) -> Request:
    """Reads the controller's request from a frame.

    Raises:
        UsageError: The frame is not a request of this bus.
    """
    kind, numbers = _native.bus_request(*frame)
    values = cast(Any, numbers)
    if kind == "move":
        return Move(*values)
    if kind == "state":
        return ChangeState(tuple(values))
    if kind == "configure":
        return Configure(tuple(values[0]), tuple(values[1]), values[2])
    return Reset(values)


def joint_answer(
    node: int,
    position: float,
    velocity: float,
    *,
    torque: float = 0.0,
    state: int = ENABLED,
    temperature: int = 25,
    errors: int = 0,
    warnings: int = 0,
) -> tuple[int, bytes]:
    """Makes a drive's answer to a :class:`Move`. Values outside the range of the bus are limited to this range.

    Args:
        node: Number of the node, 0 to 5.
        position: Position, rad.
        velocity: Velocity, rad/s.
        torque: Torque that the drive applies, N·m.
        state: :data:`INIT`, :data:`READY`, :data:`ENABLED` or :data:`FAULT`.
        temperature: Bearing temperature, °C.
        errors: Error bits of the drive.
        warnings: Warning bits of the drive.
    """
    return _native.bus_joint_answer(node, position, velocity, torque, temperature, state, errors, warnings)


def gripper_answer(*, pump: bool = False, part: bool = False, state: int = READY, errors: int = 0) -> tuple[int, bytes]:
    """Makes the gripper's answer to a :class:`Move`; ``part`` is true if both vacuum levels are reached."""
    return _native.bus_gripper_answer(pump, part, state, errors)


def state_answer(node: int, state: int) -> tuple[int, bytes]:
    """Makes a node's answer to a :class:`ChangeState`. The answer contains the state of the node when it receives the request."""
    return _native.bus_state_answer(node, state)


def configured_answer(node: int, accepted: bool = True) -> tuple[int, bytes]:
    """Makes a node's answer to a :class:`Configure`."""
    return _native.bus_configured_answer(node, accepted)
