"""Plans motions from poses and waypoints within the limits of velocity, acceleration, jerk and torque, without a controller."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from openjtc import _native
from openjtc._native import Arm, Trajectory
from openjtc.payload import Payload
from openjtc.errors import UsageError
from openjtc.results import Check, Plan

__all__ = ["Planner", "Waypoints"]

Waypoints: TypeAlias = "ArrayLike | Sequence[Mapping[str, Any] | str] | str | os.PathLike[str]"
"""Waypoints: an array (N, 6), a file (CSV or JSON), or a list of pose names and dicts as in a JSON file (``jtc help files``)."""


class Planner:
    """Plans motions of an arm.

    Args:
        arm: The arm; None: the built-in arm.
        speed: Percent of the limits, 1 to 100.
        blend: Distance from a waypoint within which the corner at the waypoint may be rounded, at most 0.5. The distance is in rad of the
            joint that is furthest away. 0: the arm stops at each waypoint. `through` also takes a blend in degrees.
        blend_m: Like `blend`, for corners between lines and arcs of the flange, m, 0.5 at most.
        line: Moves the flange along a straight line to each waypoint that does not itself contain this option.
        jerk: Also keeps the jerk within its limit.
        temperature: Lowest bearing temperature for which the planner includes friction torque, °C; None: 20, for a cold hall.
        payload: Payload at the flange.
        margin: Torque reserve for masses and friction that the model does not know, percent of each limit, 0 to 50; None: 15.
    """

    def __init__(
        self,
        arm: Arm | None = None,
        *,
        speed: float = 100.0,
        blend: float = 0.0,
        blend_m: float = 0.0,
        line: bool = False,
        jerk: bool = True,
        temperature: float | None = None,
        payload: Payload | None = None,
        margin: float | None = None,
    ) -> None:
        self.arm = arm or Arm.avena()
        numbers = payload._numbers() if payload else None
        self._native = _native.Planner(
            self.arm, speed, blend, blend_m, line, jerk, temperature, numbers, margin
        )

    def to(
        self,
        start: ArrayLike | str,
        to: ArrayLike | str | None = None,
        *,
        flange: ArrayLike | None = None,
        degrees: bool = False,
    ) -> Plan:
        """Plans a motion from one position at rest to another position at rest, or to a pose of the flange.

        Args:
            start: Joint positions (6,), rad, or the name of a pose of the arm.
            to: Target position (6,), rad, or the name of a pose of the arm.
            flange: Flange pose instead of `to`: x, y, z (m) and roll, pitch, yaw (rad) in the base frame.
            degrees: True if all angles of the arguments are degrees.

        Raises:
            RefusedError: The target is outside the limits, cannot be reached, or no torque can hold the arm there.
        """
        begin = joints_of(self.arm, start, degrees)
        if (to is None) == (flange is None):
            raise UsageError("give either `to` or `flange`", "target")
        if to is not None:
            return Plan(self._native.to(begin, joints_of(self.arm, to, degrees)))
        return Plan(self._native.to_flange(begin, flange_of(flange, degrees)))

    def through(
        self,
        waypoints: Waypoints,
        *,
        times: ArrayLike | None = None,
        blend: float | None = None,
        degrees: bool = False,
    ) -> Plan:
        """Plans a motion through waypoints, from rest to rest.

        Args:
            waypoints: An array (N, 6) of joint positions (rad), a file, or a list of pose names and dicts.
            times: Time of each waypoint of an array, s, counted from the first waypoint; NaN: as soon as the limits allow.
            blend: Replaces the planner's blend. The unit is degrees if `degrees` is true, otherwise rad.
            degrees: True if angles are degrees, including `blend`. The option does not affect data with its own units.

        Returns:
            The plan. The `notes` of the plan list the waypoints that rounded corners miss by more than 0.05 rad.

        Raises:
            UsageError: The blend is above 0.5 rad.
            RefusedError: The motion is not possible; the message contains the affected waypoint.
        """
        blend_rad = None if blend is None else float(np.radians(blend) if degrees else blend)
        if isinstance(waypoints, (str, os.PathLike)):
            return Plan(self._native.through_file(waypoints, blend_rad, degrees))
        if isinstance(waypoints, Sequence) and any(isinstance(w, (str, Mapping)) for w in waypoints):
            listed = [{"pose": w} if isinstance(w, str) else _plain(w) for w in waypoints]
            text = json.dumps({"waypoints": listed})
            return Plan(self._native.through_text(text, blend_rad, degrees))
        positions = np.asarray(waypoints, dtype=float)
        if degrees:
            positions = np.radians(positions)
        given = None if times is None else [float(t) for t in np.asarray(times, dtype=float)]
        return Plan(self._native.through(positions, blend_rad, given))

    def check(self, trajectory: Trajectory | Plan, *, start: ArrayLike | None = None) -> Check:
        """Checks a trajectory in the same way as a run does: limits at and between points, torques, and the distance to stop.

        Args:
            trajectory: A trajectory or a plan.
            start: Start position of the arm (6,), rad; None: the first point.
        """
        if isinstance(trajectory, Plan):
            trajectory = trajectory.trajectory
        return Check(self._native.check(trajectory, start))


def _plain(waypoint: Any) -> dict[str, Any]:
    """Returns the waypoint with its numpy arrays as lists."""
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in dict(waypoint).items()}


def joints_of(arm: Arm, place: ArrayLike | str, degrees: bool) -> ArrayLike:
    """Returns joint positions in rad. The argument is numbers or the name of a pose."""
    if isinstance(place, str):
        if degrees:
            raise UsageError("`degrees` does not apply to a named pose: leave out `degrees`", "usage")
        return arm.pose(place)
    return radians_of(place, degrees)


def radians_of(place: ArrayLike, degrees: bool) -> ArrayLike:
    """Returns joint positions in rad. The argument is numbers."""
    return np.radians(np.asarray(place, dtype=float)) if degrees else place


def flange_of(flange: ArrayLike | None, degrees: bool) -> ArrayLike:
    """Returns the flange pose as x, y, z (m), roll, pitch, yaw (rad)."""
    numbers = np.array(flange, dtype=float)
    if degrees and numbers.shape == (6,):
        numbers[3:] = np.radians(numbers[3:])
    return numbers
