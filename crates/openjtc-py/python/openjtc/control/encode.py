"""Frames that the host sends to the controller, as bytes of the serial line.

The controller answers each frame with a response in its next status (:class:`openjtc.control.StatusReader`).
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from openjtc import _native
from openjtc._native import Arm, Trajectory
from openjtc.dynamics import Payload

__all__ = [
    "clear_errors",
    "disable",
    "execute",
    "hold",
    "jog",
    "parameters",
    "pause",
    "payload",
    "pump",
    "stop",
    "teach",
    "trajectory",
    "use_defaults",
]


def use_defaults() -> list[bytes]:
    """Makes three frames that select the friction, model and gains of the controller's stored arm. If no arm is stored, they select the
    values of ``Arm.avena()``.

    Without parameters the controller does not power an arm.
    """
    return [_native.encode_command(f"default {what}") for what in ("friction", "model", "gains")]


def parameters(arm: Arm) -> list[bytes]:
    """Makes the frames of an arm's friction, model and gains. Parameters that the arm file lacks are omitted.

    Raises:
        UsageError: A number does not fit into a frame.
    """
    return _native.encode_parameters(arm)


def trajectory(trajectory: Trajectory, *, number: int = 1, points_a_frame: int = 100) -> list[bytes]:
    """Makes the frames of a trajectory, in the order in which they must be sent. `trajectory` checks only the number ranges of the frames.

    Args:
        trajectory: Points of the trajectory.
        number: Number of the trajectory, 0 to 65535.
        points_a_frame: Points per frame, 1 to 1500; a trajectory has at most 100 frames.

    Raises:
        UsageError: A number does not fit into a frame, or there are too many frames.
    """
    return _native.encode_trajectory(trajectory, number, points_a_frame)


def execute() -> bytes:
    """Makes the frame that starts a trajectory, or resumes it after a pause."""
    return _native.encode_command("execute")


def pause() -> bytes:
    """Makes the frame that pauses the arm on the path."""
    return _native.encode_command("pause")


def stop() -> bytes:
    """Makes the frame that stops the arm on the path. The controller forgets the reached point of the path."""
    return _native.encode_command("stop")


def teach() -> bytes:
    """Makes the frame that starts teaching, in which the arm can be guided by hand. :func:`hold` ends teaching."""
    return _native.encode_command("teach")


def hold() -> bytes:
    """Makes the frame that ends teaching. The controller then holds the position."""
    return _native.encode_command("hold")


def jog(velocity: ArrayLike) -> bytes:
    """Makes the frame that moves the joints with these velocities (6,), rad/s. The motion continues while the host repeats this frame."""
    return _native.encode_jog(velocity)


def pump(on: bool) -> bytes:
    """Makes the frame that switches the gripper's pump on or off."""
    return _native.encode_command("pump on" if on else "pump off")


def payload(payload: Payload) -> bytes:
    """Makes the frame that sets the payload of the arm.

    Raises:
        UsageError: The payload is not physically consistent.
    """
    return _native.encode_payload(payload._numbers())


def clear_errors() -> bytes:
    """Makes the frame that clears the errors of the controller and of all drives."""
    return _native.encode_command("clear errors")


def disable() -> bytes:
    """Makes the frame that switches the drive torque off. **An arm without brakes falls.**"""
    return _native.encode_command("disable")
