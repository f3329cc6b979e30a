"""One controller, real or simulated: motions, jogging, teaching."""

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
    """A connection to one controller. Made by `connect`; a context manager that stops what it moves when it ends.

    Methods may be called from several threads: `status`, `pause`, `resume`, `stop` and `speed` act at once on a motion that another thread
    runs, where one that is still being uploaded is paused as it begins; everything else waits until the motion is over. What was asked for
    before a `stop` and waits for its turn is not done any more: it raises `FaultError` with the code ``cancelled``.

    Ctrl-C in the main thread stops the arm on its path, and is raised once it stands, wherever a method of this package waits. Where Python
    itself waits (``time.sleep``, ``thread.join``, the prompt of an interpreter) after `start`, Ctrl-C raises `KeyboardInterrupt` alone: the
    arm is stopped then by the end of the ``with`` block or of the program, and at a prompt by ``robot.stop()``.
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
        """Plans a motion of the controller's arm with its payload; nothing moves.

        Arguments are those of `Planner` and `Planner.through`. `speed` is 100 % of what the limits allow, also on a real arm: `run` and its
        `speed` decide how fast the plan is run.
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
        """Checks a trajectory as `run` would; nothing is sent.

        Args:
            trajectory: A trajectory, a plan, or a file of any form that ``jtc traj run`` reads.
            start: Where the arm is to stand (6,), rad; None: where it stands now, which every joint has to report.
            degrees: Whether the numbers of a file are degrees.
            accept_device_limits: The controller's limits differ from the arm's, and are safe for it.
        """
        trajectory, _ = self._trajectory(trajectory, degrees)
        return Check(self._link.check(trajectory, start, accept_device_limits))

    def _trajectory(self, given: Trajectory | Plan | FilePath, degrees: bool) -> tuple[Trajectory, str]:
        if isinstance(given, Plan):
            given = given.trajectory
        if isinstance(given, Trajectory):
            if degrees:
                raise UsageError("only the numbers of a file can be degrees; these are rad", "usage")
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
        """Begins what `run` does, and returns at once. **The arm moves.**

        A file is read before that, with the names of the controller's arm, for which a motion on its way is waited for.
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
        # Asked for so many Stops ago: what is found out before it begins may take its time.
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
        """Checks a trajectory, uploads it, executes it and waits for its end. **The arm moves.** Ctrl-C stops it on its path.

        Args:
            trajectory: A trajectory, a plan, or a file of any form that ``jtc traj run`` reads.
            approach: Whether an arm that stands elsewhere is moved to the first point: at `speed` percent of the limits, 50 at most; without
                `speed` at 10 %, and at 25 % where the controller is a simulator.
            speed: Percent of the trajectory's own speed, 1 to 100; None: 100.
            repeat: How often it is run, 1 or more.
            record: A recording that is written while the arm moves, MCAP or CSV by the ending.
            overwrite: Whether a recording that is there is replaced, once the new one is whole.
            degrees: Whether the numbers of a file are degrees.
            accept_device_limits: The controller's limits differ from the arm's, and are safe for it.
            progress: Whether a bar is drawn on standard error; None: at a terminal.

        Returns:
            What was seen: outcome, figures, samples.

        Raises:
            RefusedError: The check refuses it: joint, point, value and limit are in the error; nothing was sent.
            StoppedError: Somebody stopped it on its way; ``run`` of the error is what was seen until then.
            FaultError, DeviceError, NoLinkError: It ended in an error; the message says whether the arm may be moving, and ``run`` of the
                error is what was seen until then.
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
        """As `run`, for asyncio; whatever ends the task before, stops the arm, and is raised once it stands. Options are those of `start`."""
        asked = self._link.asked()
        loop = asyncio.get_running_loop()
        motion: Motion | None = None
        try:
            # A file is read, and the controller asked, where nothing else waits for it.
            motion = await loop.run_in_executor(None, functools.partial(self._start, asked, trajectory, **options))
            while not motion.is_done:
                await asyncio.sleep(0.02)
        except BaseException as error:
            if motion is not None or not isinstance(error, Exception):
                # At once: what is about to begin in the executor was asked for before.
                self._link.halt()
                # A coroutine that is thrown away may not wait any more.
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
        """Moves the arm from where it stands to a place, and waits for its end. **The arm moves.** Ctrl-C stops it on its path.

        Args:
            to: Joint positions (6,), rad, or the name of a pose of the arm.
            flange: In its place x, y, z (m) and roll, pitch, yaw (rad) of the flange in the base frame.
            line: Whether the flange keeps to a straight line; else the joints do.
            speed: Percent of what the limits allow, 1 to 100; None: 10, and 25 where the controller is a simulator. `Run.notes` says which.
            degrees: Whether angles are degrees.
            record, overwrite, accept_device_limits, progress: As of `run`.
            margin: Torque to leave for masses and friction that the model does not know, percent of each limit, 0 to 50; None: 15.

        Raises:
            UsageError: A margin out of range.
            RefusedError: The place is outside the limits, cannot be reached, or no torque holds it; nothing was sent.
            StoppedError: Somebody stopped it on its way; ``run`` of the error is what was seen until then.
        """
        if (to is None) == (flange is None):
            raise UsageError("give either a place or `flange`; nothing was sent", "target")
        # Before anything that takes time: a Stop meanwhile counts.
        asked = self._link.asked()
        name = f"move to {to if isinstance(to, str) else 'a place'}"
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
        """Pauses on the path. Where several motions wait for their turn, and the first one ends by then, the next one is paused as it begins."""
        self._link.pause()

    def resume(self) -> None:
        """Goes on after a pause, also one that another program or the controller has made. **The arm moves.** A motion that nobody waits for here
        any more is stopped by the end of the connection."""
        self._link.resume()

    def stop(self) -> None:
        """Stops the arm on its path, whoever moves it, and waits until it stands; what was asked for before, in whatever thread, is not done any
        more. Teaching that was switched on here ends.

        The Stop is sent before anything else, whatever the connection is busy with. That nothing moves is no error.

        Raises:
            NoLinkError: Nothing confirms it; the message says whether the arm may be moving.
        """
        try:
            self._link.stop()
        finally:
            self._note_stop()

    @property
    def speed(self) -> float:
        """Speed on the path, 0.05 to 1 of the motion's own; may be set while the arm moves.

        The controller keeps it, also for later motions and connections; `Run.notes` says where a motion ran at another one than 1.
        """
        return self._link.speed()

    @speed.setter
    def speed(self, speed: float) -> None:
        self._link.set_speed(speed)

    def jog(self, velocity: ArrayLike, seconds: float, *, joint: int | None = None, degrees: bool = False) -> Array:
        """Jogs for some time, then waits until the arm rests. **The arm moves.**

        Args:
            velocity: rad/s of all joints (6,), or of `joint` alone.
            seconds: For how long, up to 600.
            joint: The joint, counted from 1.
            degrees: Whether velocities are degrees/s.

        Returns:
            Where the arm rests (6,), rad.

        Raises:
            StoppedError: Somebody stopped the arm meanwhile; it rests.
        """
        rate = np.asarray(velocity, dtype=float)
        if joint is not None:
            if rate.ndim != 0 or joint not in range(1, 7):
                raise UsageError(f"joint {joint}: a joint is 1 to 6, and has one velocity; nothing was sent", "usage")
            rates = np.zeros(6)
            rates[joint - 1] = rate
            rate = rates
        return np.array(self._link.jog(np.radians(rate) if degrees else rate, seconds))

    @contextlib.contextmanager
    def teach(self) -> Iterator[Teaching]:
        """The arm can be led by hand while the context lasts, and is held again at its end, or as soon as somebody stops it here."""
        try:
            self._link.teach(True)
            yield Teaching(self._link)
        finally:
            if not self.is_closed:
                self._link.teach(False)

    def gripper(self, on: bool) -> None:
        """Pump on or off."""
        self._link.gripper(on)
