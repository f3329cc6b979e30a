"""Dynamics and kinematics of an arm, for many states in one call.

Joint vectors have the shape (6,) for one state or (N, 6) for N states, with one column per joint, base to wrist. The two shapes of joint
vectors may be mixed: an argument of shape (6,) applies to every row. Positions are in rad, velocities in rad/s, accelerations in rad/s²,
torques in N·m, lengths in m. Poses are homogeneous 4×4 matrices in the base frame. Other Python threads can run during a call.

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
    """Dynamics of one arm. The object is immutable.

    Args:
        arm: Arm with the model.
        payload: Payload at the flange.
        gravity: Acceleration of gravity (3,) in the base frame, m/s²; None: the value in the arm file.

    Raises:
        UsageError: The payload is not physically consistent, or gravity is not a vector of finite numbers.
    """

    def __init__(self, arm: Arm, payload: Payload | None = None, gravity: ArrayLike | None = None) -> None:
        vector: Any = None if gravity is None else np.asarray(gravity, dtype=np.float64)
        if vector is not None and vector.shape != (3,):
            raise UsageError(f"gravity: shape {vector.shape}, expected (3,)", "usage")
        self._native = _native.Dynamics(arm, None if payload is None else payload._numbers(), None if vector is None else vector.tolist())

    def inverse(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Floats:
        """Computes joint torques from positions, velocities and accelerations, by the recursive Newton-Euler algorithm.

        The joint torques do not include rotors and friction. To include them, add ``rotor_inertia * qdd`` and :meth:`friction`.

        Returns:
            Torques (6,) or (N, 6), N·m.

        Raises:
            UsageError: A shape is wrong, numbers of rows differ, or a number is not finite.
        """
        return self._native.inverse(q, qd, qdd)

    def forward(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, *, rotors: bool = True) -> Floats:
        """Computes joint accelerations under torques, without friction.

        Args:
            q: Positions, rad.
            qd: Velocities, rad/s.
            tau: Torques at the joints, N·m.
            rotors: True includes the rotor inertias of the arm (:attr:`rotor_inertia`). False includes only the rigid bodies.

        Returns:
            Accelerations (6,) or (N, 6), rad/s².

        Raises:
            UsageError: A shape is wrong, numbers of rows differ, or a number is not finite.
        """
        return self._native.forward(q, qd, tau, rotors)

    def gravity(self, q: ArrayLike) -> Floats:
        """Computes the joint torques that hold the arm at rest: (6,) or (N, 6), N·m."""
        return self._native.gravity(q)

    def mass_matrix(self, q: ArrayLike) -> Floats:
        """Computes joint-space mass matrices: (6, 6) or (N, 6, 6), kg·m². The matrices are symmetric and do not include the rotor
        inertias."""
        return self._native.mass_matrix(q)

    def friction(self, qd: ArrayLike, temperature: ArrayLike = 25.0) -> Floats:
        """Computes the friction torques against the motion that the controller compensates.

        Args:
            qd: Velocities, rad/s.
            temperature: Temperatures of the bearings, °C: one number for all joints, (6,) or (N, 6).

        Returns:
            Torques (6,) or (N, 6), N·m.

        Raises:
            UsageError: The arm has no friction data, or a velocity is outside its friction table.
        """
        degrees = np.asarray(temperature, dtype=np.float64)
        return self._native.friction(qd, np.full(6, degrees) if degrees.ndim == 0 else degrees)

    def forward_kinematics(self, q: ArrayLike) -> Floats:
        """Computes poses of the flange in the base frame: (4, 4) or (N, 4, 4)."""
        return self._native.forward_kinematics(q)

    def frames(self, q: ArrayLike) -> Floats:
        """Computes poses of the six joint frames, each after the rotation of its joint, and of the flange: (7, 4, 4) or (N, 7, 4, 4)."""
        return self._native.frames(q)

    def jacobian(self, q: ArrayLike) -> Floats:
        """Computes geometric Jacobians of the flange in the base frame: (6, 6) or (N, 6, 6).

        Rows 0 to 2 are the velocity of the flange (m/rad). Rows 3 to 5 are the angular velocity of the flange (rad/rad). The matrix has one
        column per joint.
        """
        return self._native.jacobian(q)

    def inverse_kinematics(self, pose: ArrayLike, near: ArrayLike) -> Floats:
        """Computes joint positions within the limits that bring the flange to a pose. Returns the solution nearest to ``near``.

        Args:
            pose: Poses (4, 4) or (N, 4, 4).
            near: Joint positions (6,), or (N, 6) with one row for each pose, rad.

        Returns:
            Positions (6,) or (N, 6), rad; the flange is within 1 nm and 1 nrad of the pose.

        Raises:
            UsageError: A matrix is not a valid pose.
            RefusedError: The pose is out of reach, or can only be reached outside the limits; see ``joint``, ``value`` and ``limit``.
        """
        return self._native.inverse_kinematics(pose, near)

    def all_inverse_kinematics(self, pose: ArrayLike) -> Floats:
        """Computes all joint positions within the limits that bring the flange to one pose (4, 4). The array of joint positions is (M, 6),
        rad; M is 0 without a solution.

        A singular pose has infinitely many solutions; the function returns some of them.
        """
        return self._native.all_inverse_kinematics(pose)

    @property
    def rotor_inertia(self) -> Floats:
        """Reflected inertia of the rotors at the joints: (6,), kg·m²."""
        return self._native.rotor_inertia
