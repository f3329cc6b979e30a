"""Frames from the host to the controller, as bytes of the serial line.

The controller answers each with a response in its next status (:class:`openjtc.control.StatusReader`).
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
    """Three frames: the controller takes the friction, model and gains of the arm that it has stored, else those of ``Arm.avena()``.

    Without parameters it does not power an arm.
    """
    return [_native.encode_command(f"default {what}") for what in ("friction", "model", "gains")]


def parameters(arm: Arm) -> list[bytes]:
    """The frames of an arm's friction, model and gains, as far as its file gives them.

    Raises:
        UsageError: A number that no frame carries.
    """
    return _native.encode_parameters(arm)


def trajectory(trajectory: Trajectory, *, number: int = 1, points_a_frame: int = 100) -> list[bytes]:
    """The frames of a trajectory, in the order in which they have to be sent. Nothing is checked but what a frame carries.

    Args:
        trajectory: The points.
        number: A number of its own, 0 to 65535.
        points_a_frame: 1 to 1500; a trajectory has at most 100 frames.

    Raises:
        UsageError: A number that no frame carries, or too many frames.
    """
    return _native.encode_trajectory(trajectory, number, points_a_frame)


def execute() -> bytes:
    """Begin, or resume after a pause."""
    return _native.encode_command("execute")


def pause() -> bytes:
    """Come to rest on the path."""
    return _native.encode_command("pause")


def stop() -> bytes:
    """Come to rest on the path, and forget the place on it."""
    return _native.encode_command("stop")


def teach() -> bytes:
    """Let the arm be led by hand; :func:`hold` ends it."""
    return _native.encode_command("teach")


def hold() -> bytes:
    """End of teaching: hold the position."""
    return _native.encode_command("hold")


def jog(velocity: ArrayLike) -> bytes:
    """Move the joints with these velocities (6,), rad/s, for as long as such frames keep coming."""
    return _native.encode_jog(velocity)


def pump(on: bool) -> bytes:
    """The gripper's pump."""
    return _native.encode_command("pump on" if on else "pump off")


def payload(payload: Payload) -> bytes:
    """What the arm carries from now on.

    Raises:
        UsageError: There is no such body.
    """
    return _native.encode_payload(payload._numbers())


def clear_errors() -> bytes:
    """Clear the errors of the controller and of all drives."""
    return _native.encode_command("clear errors")


def disable() -> bytes:
    """Take the torque from the drives: an arm without brakes falls."""
    return _native.encode_command("disable")
