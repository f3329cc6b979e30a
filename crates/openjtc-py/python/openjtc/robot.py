"""Motions, jogging and teaching with a real or simulated controller."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openjtc._native import Trajectory
from openjtc.connected import Connected
from openjtc.errors import UsageError
from openjtc.motion import FilePath, Motion, Teaching, followed, options_of
from openjtc.payload import Payload
from openjtc.planning import Planner, Waypoints, flange_of, joints_of, radians_of
from openjtc.results import Check, Plan, Run

__all__ = ["Robot"]

Array = NDArray[np.float64]


class Robot(Connected):
    """Connection to one controller, made by `connect`. Used as a context manager, it stops its own motions when the block ends.

    Methods may be called from several threads. `status`, `pause`, `resume`, `stop` and `speed` act at once on a motion that another thread
    runs. A motion that is still being uploaded is paused when it begins. All other methods wait until the motion has ended. If a request
    still waits when `stop` is called, the request is discarded and raises `FaultError` with the code ``cancelled``.

    While a method of this package waits in the main thread, Ctrl-C stops the arm on its path. The exception is raised when the arm is at
    rest. After `start`, while Python itself waits (``time.sleep``, ``thread.join``, the interpreter's prompt), Ctrl-C only raises
    `KeyboardInterrupt`. The end of the ``with`` block or of the program then stops the arm. At a prompt, call ``robot.stop()``.
    """

    def plan(
        self,
        waypoints: Waypoints,
        *,
        times: ArrayLike | None = None,
        speed: float = 100.0,
        blend: float = 0.0,
        line: bool = False,
        degrees: bool = False,
        margin: float | None = None,
    ) -> Plan:
        """Plans a motion of the controller's arm with its payload, without moving the arm.

        The arguments are those of `Planner` and `Planner.through`. `speed` is 100 % of the limits by default, even on a real arm. The
        `speed` of `run` sets how fast the arm executes the plan.
        """
        mass, com, inertia = self._link.payload() if self.info else (0.0, [0.0] * 3, [0.0] * 6)
        payload = Payload(mass, tuple(com), tuple(inertia)) if mass else None
        planner = Planner(self.arm, speed=speed, line=line, payload=payload, margin=margin)
        return planner.through(waypoints, times=times, blend=blend, degrees=degrees)

    def check(
        self,
        trajectory: Trajectory | Plan | FilePath,
        *,
        start: ArrayLike | None = None,
        degrees: bool = False,
        accept_device_limits: bool = False,
    ) -> Check:
        """Checks a trajectory like `run`, but does not send it.

        Args:
            trajectory: A trajectory, a plan, or a file of any form that ``jtc traj run`` reads.
            start: Start position (6,), rad; None: the present position, for which every joint must report its position.
            degrees: True if the numbers of a file are degrees.
            accept_device_limits: Accepts that the controller's limits differ from the arm's limits. Set it only if the controller's limits
                are safe for the arm.
        """
        trajectory, _ = self._trajectory(trajectory, degrees)
        return Check(self._link.check(trajectory, start, accept_device_limits))

    def _trajectory(self, given: Trajectory | Plan | FilePath, degrees: bool) -> tuple[Trajectory, str]:
        if isinstance(given, Plan):
            given = given.trajectory
        if isinstance(given, Trajectory):
            if degrees:
                raise UsageError("`degrees` applies only to a file; a trajectory object is in rad", "usage")
            return given, "trajectory"
        path = Path(given)
        return Trajectory.load(path, self.arm, degrees), path.stem

    def start(
        self,
        trajectory: Trajectory | Plan | FilePath,
        *,
        approach: bool = False,
        speed: float | None = None,
        repeat: int = 1,
        record: FilePath | None = None,
        overwrite: bool = False,
        degrees: bool = False,
        accept_device_limits: bool = False,
    ) -> Motion:
        """Begins a motion like `run`, and returns at once. **The arm moves.**

        If `trajectory` is a file, the method first reads it, with the joint names of the controller's arm. Reading these names waits for a
        running motion.
        """
        return self._start(
            self._link.asked(),
            trajectory,
            approach=approach,
            speed=speed,
            repeat=repeat,
            record=record,
            overwrite=overwrite,
            degrees=degrees,
            accept_device_limits=accept_device_limits,
        )

    def _start(
        self,
        asked: int,
        trajectory: Trajectory | Plan | FilePath,
        *,
        approach: bool = False,
        speed: float | None = None,
        repeat: int = 1,
        record: FilePath | None = None,
        overwrite: bool = False,
        degrees: bool = False,
        accept_device_limits: bool = False,
    ) -> Motion:
        # `asked` is the number of Stops at the time of the request. Reading the file may take a while, and a Stop may
        # be requested during this time.
        trajectory, name = self._trajectory(trajectory, degrees)
        options = options_of(asked, name, approach, speed, repeat, record, overwrite, accept_device_limits)
        return Motion(self._link.run(trajectory, options), self, asked)

    def run(
        self,
        trajectory: Trajectory | Plan | FilePath,
        *,
        approach: bool = False,
        speed: float | None = None,
        repeat: int = 1,
        record: FilePath | None = None,
        overwrite: bool = False,
        degrees: bool = False,
        accept_device_limits: bool = False,
        progress: bool | None = None,
    ) -> Run:
        """Checks a trajectory, uploads it, executes it and waits for its end. **The arm moves.** Ctrl-C stops the arm on its path.

        Args:
            trajectory: A trajectory, a plan, or a file of any form that ``jtc traj run`` reads.
            approach: If the arm is at another position, moves it to the first point, at `speed` percent of the limits, 50 at most. Without
                `speed`, the arm moves at 10 %, or at 25 % on a simulator.
            speed: Percent of the trajectory's own speed, 1 to 100; None: 100.
            repeat: Number of executions, 1 or more.
            record: Path of a recording that is written while the arm moves, MCAP or CSV by the file ending.
            overwrite: Replaces an existing recording after the new one is complete.
            degrees: True if the numbers of a file are degrees.
            accept_device_limits: Accepts that the controller's limits differ from the arm's limits. Set it only if the controller's limits
                are safe for the arm.
            progress: Draws a progress bar on standard error; None: only at a terminal.

        Returns:
            The run: outcome, figures and samples.

        Raises:
            RefusedError: The check refused the trajectory; the error has joint, point, value and limit. No frame was sent.
            StoppedError: The motion was stopped. ``run`` of the error has the samples until then.
            FaultError, DeviceError, NoLinkError: The motion ended in an error. The message says whether the arm may be moving, and ``run``
                of the error has the samples until then.
        """
        begin = functools.partial(
            self.start,
            trajectory,
            approach=approach,
            speed=speed,
            repeat=repeat,
            record=record,
            overwrite=overwrite,
            degrees=degrees,
            accept_device_limits=accept_device_limits,
        )
        return followed(self, begin, progress)

    async def run_async(self, trajectory: Trajectory | Plan | FilePath, **options: Any) -> Run:
        """Runs a trajectory like `run`, for asyncio. The options are those of `start`.

        An exception that ends the task early, such as a cancellation, stops the arm. The exception is raised when the arm is at rest.
        """
        asked = self._link.asked()
        loop = asyncio.get_running_loop()
        motion: Motion | None = None
        try:
            # The executor reads the file and queries the controller, so that the event loop never waits.
            motion = await loop.run_in_executor(None, functools.partial(self._start, asked, trajectory, **options))
            while not motion.is_done:
                await asyncio.sleep(0.02)
        except BaseException as error:
            if motion is not None or not isinstance(error, Exception):
                # The Stop takes effect at once. The Stop discards a motion that is about to begin in the executor,
                # because the request for this motion is older than the Stop.
                self._link.halt()
                # A closed coroutine must not wait.
                if not isinstance(error, GeneratorExit):
                    await asyncio.shield(loop.run_in_executor(None, self._link.rest))
            raise
        return motion._ended(False)

    def move(
        self,
        to: ArrayLike | str | None = None,
        *,
        flange: ArrayLike | None = None,
        line: bool = False,
        speed: float | None = None,
        degrees: bool = False,
        record: FilePath | None = None,
        overwrite: bool = False,
        accept_device_limits: bool = False,
        progress: bool | None = None,
        margin: float | None = None,
    ) -> Run:
        """Moves the arm from its present position to a target, and waits until the arm is there. **The arm moves.** Ctrl-C stops the arm on
        its path.

        Args:
            to: Joint positions (6,), rad, or the name of a pose of the arm.
            flange: Flange pose instead of `to`: x, y, z (m) and roll, pitch, yaw (rad) in the base frame.
            line: Moves the flange along a straight line; otherwise the path is straight in joint space.
            speed: Percent of the limits, 1 to 100; None: 10, or 25 on a simulator. `Run.notes` contains the speed that was used.
            degrees: True if angles are degrees.
            record, overwrite, accept_device_limits, progress: See `run`.
            margin: Torque reserve for masses and friction that the model does not know, percent of each limit, 0 to 50; None: 15.

        Raises:
            UsageError: The margin is out of range.
            RefusedError: The target is outside the limits, cannot be reached, or no torque can hold the arm there. No frame was sent.
            StoppedError: The motion was stopped. ``run`` of the error has the samples until then.
        """
        if (to is None) == (flange is None):
            raise UsageError("give either a target position or `flange`; nothing was sent", "target")
        # The method reads the number of Stops before any step that takes time, so that a Stop during such a step
        # cancels the motion.
        asked = self._link.asked()
        name = f"move to {to if isinstance(to, str) else 'a position'}"
        options = options_of(asked, name, False, speed, 1, record, overwrite, accept_device_limits)

        def begin() -> Motion:
            if isinstance(to, str):
                native = self._link.move_to_joints(joints_of(self.arm, to, degrees), line, margin, options)
            elif to is not None:
                native = self._link.move_to_joints(radians_of(to, degrees), line, margin, options)
            else:
                native = self._link.move_to_flange(flange_of(flange, degrees), line, margin, options)
            return Motion(native, self, asked)

        return followed(self, begin, progress)

    def pause(self) -> None:
        """Pauses the motion on its path.

        If the motion ends before the pause takes effect and another motion waits, the waiting motion is paused when it begins.
        """
        self._link.pause()

    def resume(self) -> None:
        """Resumes the motion after a pause, even if another program or the controller has paused it. **The arm moves.**

        If no thread of this program waits for the motion any more, the end of the connection stops it.
        """
        self._link.resume()

    def stop(self) -> None:
        """Stops the arm on its path and waits until the arm is at rest, even if another program moves it.

        A Stop discards earlier requests of all threads of this program. A Stop also ends teaching, even if another program has started it.
        The Stop is sent before all other frames. Stopping an arm that is already at rest is not an error.

        Raises:
            NoLinkError: No status confirms the Stop; the message says whether the arm may be moving.
        """
        try:
            self._link.stop()
        finally:
            self._note_stop()

    @property
    def speed(self) -> float:
        """Speed on the path, 0.05 to 1 times the motion's own speed. The speed may be set while the arm moves.

        The controller keeps this speed for later motions and connections. `Run.notes` reports a motion whose speed was not 1.
        """
        return self._link.speed()

    @speed.setter
    def speed(self, speed: float) -> None:
        self._link.set_speed(speed)

    def jog(self, velocity: ArrayLike, seconds: float, *, joint: int | None = None, degrees: bool = False) -> Array:
        """Jogs for a time, then waits until the arm is at rest. **The arm moves.**

        Args:
            velocity: Velocities of all joints (6,), rad/s, or of `joint` alone.
            seconds: Duration, s, up to 600.
            joint: Number of the joint, counted from 1.
            degrees: True if velocities are degrees/s.

        Returns:
            Joint positions at rest (6,), rad.

        Raises:
            StoppedError: The arm was stopped during the jog, and is at rest.
        """
        rate = np.asarray(velocity, dtype=float)
        if joint is not None:
            if rate.ndim != 0 or joint not in range(1, 7):
                raise UsageError(f"joint {joint}: expected a joint from 1 to 6 and one velocity; nothing was sent", "usage")
            rates = np.zeros(6)
            rates[joint - 1] = rate
            rate = rates
        return np.array(self._link.jog(np.radians(rate) if degrees else rate, seconds))

    @contextlib.contextmanager
    def teach(self) -> Iterator[Teaching]:
        """Allows a person to guide the arm by hand inside the context. The controller holds the arm again when the context ends, or after a
        Stop of this program."""
        try:
            self._link.teach(True)
            yield Teaching(self._link)
        finally:
            if not self.is_closed:
                self._link.teach(False)

    def gripper(self, on: bool) -> None:
        """Switches the gripper's pump on or off."""
        self._link.gripper(on)
