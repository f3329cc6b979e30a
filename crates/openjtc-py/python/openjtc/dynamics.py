"""Dynamics and kinematics of an arm, over many states at once.

Joint vectors have the shape (6,) for one state or (N, 6) for N, one column a joint, base to wrist; arguments of both shapes mix: what is
(6,) holds for every row. Positions are rad, velocities rad/s, accelerations rad/s², torques N·m, lengths m. Poses are homogeneous
4×4 matrices in the base frame. Other threads run while a call computes.

    >>> from openjtc import Arm
    >>> from openjtc.dynamics import Dynamics
    >>> dynamics = Dynamics(Arm.avena())
    >>> dynamics.gravity([0, 0.5, -1, 0, 0.3, 0]).shape
    (6,)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openjtc import _native
from openjtc._native import Arm
from openjtc.errors import UsageError
from openjtc.payload import Payload

__all__ = ["Dynamics", "Payload"]

Floats = NDArray[np.float64]


class Dynamics:
    """An arm prepared for computing; it does not change.

    Args:
        arm: The arm.
        payload: What it carries at its flange.
        gravity: Acceleration of gravity (3,) in the base frame, m/s²; that of the arm's file where none is given.

    Raises:
        UsageError: The payload is no body, or gravity is no vector of finite numbers.
    """

    def __init__(self, arm: Arm, payload: Payload | None = None, gravity: ArrayLike | None = None) -> None:
        vector: Any = None if gravity is None else np.asarray(gravity, dtype=np.float64)
        if vector is not None and vector.shape != (3,):
            raise UsageError(f"gravity: has the shape {vector.shape}, not (3,)", "usage")
        self._native = _native.Dynamics(arm, None if payload is None else payload._numbers(), None if vector is None else vector.tolist())

    def inverse(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Floats:
        """Joint torques for positions, velocities and accelerations, by the recursive Newton-Euler algorithm.

        Rotors and friction are not in them: add ``rotor_inertia * qdd`` and :meth:`friction`.

        Returns:
            (6,) or (N, 6), N·m.

        Raises:
            UsageError: A wrong shape, rows that do not match, or a number that is not finite.
        """
        return self._native.inverse(q, qd, qdd)

    def forward(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, *, rotors: bool = True) -> Floats:
        """Joint accelerations under torques, without friction.

        Args:
            q: Positions, rad.
            qd: Velocities, rad/s.
            tau: Torques at the joints, N·m.
            rotors: With the rotor inertias of the arm (:attr:`rotor_inertia`), else the rigid bodies alone.

        Returns:
            (6,) or (N, 6), rad/s².

        Raises:
            UsageError: A wrong shape, rows that do not match, or a number that is not finite.
        """
        return self._native.forward(q, qd, tau, rotors)

    def gravity(self, q: ArrayLike) -> Floats:
        """Joint torques that hold the arm at rest: (6,) or (N, 6), N·m."""
        return self._native.gravity(q)

    def mass_matrix(self, q: ArrayLike) -> Floats:
        """Joint-space mass matrices, symmetric, without rotors: (6, 6) or (N, 6, 6), kg·m²."""
        return self._native.mass_matrix(q)

    def friction(self, qd: ArrayLike, temperature: ArrayLike = 25.0) -> Floats:
        """Friction torques against the motion, as the controller compensates them.

        Args:
            qd: Velocities, rad/s.
            temperature: Of the bearings, °C: one number for all, (6,) or (N, 6).

        Returns:
            (6,) or (N, 6), N·m.

        Raises:
            UsageError: The arm has no friction, or a velocity is beyond its table.
        """
        degrees = np.asarray(temperature, dtype=np.float64)
        return self._native.friction(qd, np.full(6, degrees) if degrees.ndim == 0 else degrees)

    def forward_kinematics(self, q: ArrayLike) -> Floats:
        """Poses of the flange: (4, 4) or (N, 4, 4)."""
        return self._native.forward_kinematics(q)

    def frames(self, q: ArrayLike) -> Floats:
        """Poses of the six joint frames, each after the rotation of its joint, and of the flange: (7, 4, 4) or (N, 7, 4, 4)."""
        return self._native.frames(q)

    def jacobian(self, q: ArrayLike) -> Floats:
        """Geometric Jacobians of the flange in the base frame: (6, 6) or (N, 6, 6).

        Rows 0 to 2 are its velocity (m/rad), rows 3 to 5 its angular velocity (rad/rad), a column a joint.
        """
        return self._native.jacobian(q)

    def inverse_kinematics(self, pose: ArrayLike, near: ArrayLike) -> Floats:
        """Joint positions within the limits that bring the flange to a pose: of all solutions the nearest to ``near``.

        Args:
            pose: (4, 4), or (N, 4, 4).
            near: (6,), or (N, 6): one for each pose.

        Returns:
            (6,) or (N, 6), rad; the flange is within 1 nm and 1 nrad of the pose.

        Raises:
            UsageError: A matrix is no pose.
            RefusedError: Out of reach, or within reach outside the limits only; ``joint``, ``value`` and ``limit`` say which.
        """
        return self._native.inverse_kinematics(pose, near)

    def all_inverse_kinematics(self, pose: ArrayLike) -> Floats:
        """All joint positions within the limits that bring the flange to one pose (4, 4): (M, 6), rad; M is 0 where there are none.

        A singular pose has infinitely many, of which some are returned.
        """
        return self._native.all_inverse_kinematics(pose)

    @property
    def rotor_inertia(self) -> Floats:
        """Reflected inertia of the rotors at the joints: (6,), kg·m²."""
        return self._native.rotor_inertia
