"""Motions from poses and waypoints, within the limits of velocity, acceleration, jerk and torque, without a controller."""

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
        arm: The arm; None: the built-in one.
        speed: Percent of what the limits allow, 1 to 100.
        blend: How far from a waypoint its corner may be rounded, rad of the joint that is furthest, 0.5 at most; 0: the arm stops at each
            waypoint. `through` takes one in degrees.
        blend_m: The same of corners between lines and arcs of the flange, m, 0.5 at most.
        line: Whether the flange keeps to a straight line where waypoints do not say how the arm gets there.
        jerk: Whether jerk is limited, too.
        temperature: Lowest bearing temperature at which friction has to be overcome, °C; None: that of a cold hall, 20.
        payload: What the flange carries.
        margin: Torque to leave for masses and friction that the model does not know, percent of each limit, 0 to 50; None: 15.
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
        """From a position at rest to another one, or to a pose of the flange.

        Args:
            start: Joint positions (6,), rad, or the name of a pose of the arm.
            to: The same.
            flange: In its place x, y, z (m) and roll, pitch, yaw (rad) of the flange in the base frame.
            degrees: Whether all angles given are degrees.

        Raises:
            RefusedError: The target is outside the limits, cannot be reached, or no torque holds it.
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
        """Through waypoints, from rest to rest.

        Args:
            waypoints: An array (N, 6) of joint positions (rad), a file, or a list of pose names and dicts.
            times: When to be at each waypoint of an array, s from the first one; NaN: as soon as the limits allow.
            blend: In the place of the planner's own; in degrees where `degrees` is true, else in rad.
            degrees: Whether angles are degrees, `blend` among them; not for what names its units itself.

        Returns:
            The plan. Its `notes` name waypoints that rounded corners miss by more than 0.05 rad.

        Raises:
            UsageError: A blend above 0.5 rad.
            RefusedError: There is no such motion; the message names the waypoint.
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
        """Checks a trajectory as a run would: limits at and between points, torques, room to stop.

        Args:
            trajectory: What is checked.
            start: Where the arm stands (6,), rad; None: at its first point.
        """
        if isinstance(trajectory, Plan):
            trajectory = trajectory.trajectory
        return Check(self._native.check(trajectory, start))


def _plain(waypoint: Any) -> dict[str, Any]:
    """Arrays of numpy in a dict as lists."""
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in dict(waypoint).items()}


def joints_of(arm: Arm, place: ArrayLike | str, degrees: bool) -> ArrayLike:
    """Joint positions in rad, of numbers or of a named pose."""
    if isinstance(place, str):
        if degrees:
            raise UsageError("a named pose has its unit: leave `degrees` out", "usage")
        return arm.pose(place)
    return radians_of(place, degrees)


def radians_of(place: ArrayLike, degrees: bool) -> ArrayLike:
    """Joint positions in rad, of numbers."""
    return np.radians(np.asarray(place, dtype=float)) if degrees else place


def flange_of(flange: ArrayLike | None, degrees: bool) -> ArrayLike:
    """x, y, z (m), roll, pitch, yaw (rad)."""
    numbers = np.array(flange, dtype=float)
    if degrees and numbers.shape == (6,):
        numbers[3:] = np.radians(numbers[3:])
    return numbers
