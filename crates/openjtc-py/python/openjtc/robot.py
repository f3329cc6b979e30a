"""One controller, real or simulated: motions, jogging, teaching, arms, payloads, what is wrong."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openjtc import _native
from openjtc._native import Arm, Trajectory
from openjtc.errors import Error, UsageError
from openjtc.motion import FilePath, Motion, Teaching, followed, options_of
from openjtc.payload import Payload
from openjtc.planning import Planner, Waypoints, flange_of, joints_of
from openjtc.results import Check, FlightLog, Plan, Run
from openjtc.status import Finding, Status

__all__ = ["Robot"]

Array = NDArray[np.float64]


class Robot:
    """A connection to one controller. Made by `connect`; a context manager that stops what it moves when it ends.

    Methods may be called from several threads: `status`, `pause`, `resume`, `stop` and `speed` act at once on a motion that another thread
    runs, where one that is still being uploaded is paused as it begins; everything else waits until the motion is over. Ctrl-C in the main
    thread stops the arm on its path, and is raised once it stands.
    """

    def __init__(self, link: _native.Link) -> None:
        self._link = link

    # The connection

    def __enter__(self) -> Robot:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
            return
        # What ended the block is what is to be seen.
        with contextlib.suppress(Error):
            self.close()

    def close(self) -> None:
        """Stops what moves here, switches off the teaching that was switched on here, and ends the connection. The controller holds the arm."""
        self._link.close()

    @property
    def is_closed(self) -> bool:
        """Nothing can be asked any more."""
        return self._link.is_closed

    def __repr__(self) -> str:
        return "Robot(closed)" if self.is_closed else f"Robot({self._link.port!r})"

    # What is

    @property
    def status(self) -> Status:
        """A fresh status of the controller."""
        return Status(**self._link.status())

    @property
    def position(self) -> Array:
        """Measured joint positions (6,), rad."""
        return self.status.position

    @property
    def arm(self) -> Arm:
        """The arm in the controller where it can be asked; else the one given to `connect`, or the built-in one."""
        return self._link.arm()

    @property
    def info(self) -> dict[str, Any] | None:
        """Who the controller is: board, firmware, arm, hash of its arm, boots, uptime (s); None for one without extensions."""
        return self._link.info()

    def doctor(self) -> list[Finding]:
        """Looks at link, bus and set-up for 1.5 s; what it found, the worst first."""
        return [Finding(**found) for found in self._link.doctor()]

    def wait_ready(self, timeout: float = 15.0) -> None:
        """Waits until the controller holds the arm with all drives enabled.

        Raises:
            DeviceError: It reports an error.
            Error: It does not hold the arm in this time (s); it may lack parameters (`use_defaults`, `push_arm`).
        """
        self._link.wait_ready(timeout)

    # Motions

    def plan(
        self,
        waypoints: Waypoints,
        *,
        times: ArrayLike | None = None,
        speed: float = 100.0,
        blend: float = 0.0,
        line: bool = False,
        degrees: bool = False,
    ) -> Plan:
        """Plans a motion of the controller's arm with its payload; nothing moves. Arguments are those of `Planner` and `Planner.through`."""
        mass, com, inertia = self._link.payload() if self.info else (0.0, [0.0] * 3, [0.0] * 6)
        payload = Payload(mass, tuple(com), tuple(inertia)) if mass else None
        planner = Planner(self.arm, speed=speed, blend=blend, line=line, payload=payload)
        return planner.through(waypoints, times=times, degrees=degrees)

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
            start: Where the arm is to stand (6,), rad; None: where it stands now.
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
        speed: float = 100.0,
        repeat: int = 1,
        record: FilePath | None = None,
        overwrite: bool = False,
        degrees: bool = False,
        accept_device_limits: bool = False,
    ) -> Motion:
        """Begins what `run` does, and returns at once. **The arm moves.**"""
        trajectory, name = self._trajectory(trajectory, degrees)
        options = options_of(name, approach, speed, repeat, record, overwrite, accept_device_limits)
        return Motion(self._link.run(trajectory, options), self._link)

    def run(
        self,
        trajectory: Trajectory | Plan | FilePath,
        *,
        approach: bool = False,
        speed: float = 100.0,
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
            approach: Whether an arm that stands elsewhere is moved to the first point, at half speed at most.
            speed: Percent of the trajectory's own speed, 1 to 100.
            repeat: How often it is run.
            record: A recording that is written while the arm moves, MCAP or CSV by the ending.
            overwrite: Whether a recording that is there is written over.
            degrees: Whether the numbers of a file are degrees.
            accept_device_limits: The controller's limits differ from the arm's, and are safe for it.
            progress: Whether a bar is drawn on standard error; None: at a terminal.

        Returns:
            What was seen: outcome, figures, samples. A motion that was stopped on its way is no error.

        Raises:
            RefusedError: The check refuses it: joint, point, value and limit are in the error; nothing was sent.
            FaultError, DeviceError, NoLinkError: It ended in an error; the message says whether the arm may be moving, and ``run`` of the
                error is what was seen until then.
        """
        trajectory, name = self._trajectory(trajectory, degrees)
        options = options_of(name, approach, speed, repeat, record, overwrite, accept_device_limits)
        return followed(Motion(self._link.run(trajectory, options), self._link), progress)

    async def run_async(self, trajectory: Trajectory | Plan | FilePath, **options: Any) -> Run:
        """As `run`, for asyncio; a task that is cancelled stops the arm. Options are those of `start`."""
        motion = self.start(trajectory, **options)
        try:
            while not motion.is_done:
                await asyncio.sleep(0.02)
        except asyncio.CancelledError:
            self.stop()
            raise
        return motion.wait()

    def move(
        self,
        to: ArrayLike | str | None = None,
        *,
        flange: ArrayLike | None = None,
        line: bool = False,
        speed: float = 100.0,
        degrees: bool = False,
        record: FilePath | None = None,
        overwrite: bool = False,
        accept_device_limits: bool = False,
        progress: bool | None = None,
    ) -> Run:
        """Moves the arm from where it stands to a place, and waits for its end. **The arm moves.** Ctrl-C stops it on its path.

        Args:
            to: Joint positions (6,), rad, or the name of a pose of the arm.
            flange: In its place x, y, z (m) and roll, pitch, yaw (rad) of the flange in the base frame.
            line: Whether the flange keeps to a straight line; else the joints do.
            speed: Percent of what the limits allow, 1 to 100.
            degrees: Whether angles are degrees.
            record, overwrite, accept_device_limits, progress: As of `run`.

        Raises:
            RefusedError: The place is outside the limits, cannot be reached, or no torque holds it; nothing was sent.
        """
        if (to is None) == (flange is None):
            raise UsageError("give either a place or `flange`; nothing was sent", "target")
        name = f"move to {to if isinstance(to, str) else 'a place'}"
        options = options_of(name, False, speed, 1, record, overwrite, accept_device_limits)
        if to is not None:
            place = joints_of(self.arm, to, degrees) if isinstance(to, str) or degrees else to
            motion = self._link.move_to_joints(place, line, options)
        else:
            motion = self._link.move_to_flange(flange_of(flange, degrees), line, options)
        return followed(Motion(motion, self._link), progress)

    def pause(self) -> None:
        """Pauses on the path."""
        self._link.pause()

    def resume(self) -> None:
        """Goes on after a pause. **The arm moves.**"""
        self._link.resume()

    def stop(self) -> None:
        """Stops the arm on its path, whoever moves it; what was asked for before, in whatever thread, is not done any more."""
        self._link.stop()

    @property
    def speed(self) -> float:
        """Speed on the path, 0.01 to 1 of the motion's own; may be set while the arm moves."""
        return self._link.speed()

    @speed.setter
    def speed(self, speed: float) -> None:
        self._link.set_speed(speed)

    def jog(self, velocity: ArrayLike, seconds: float, *, joint: int | None = None, degrees: bool = False) -> Array:
        """Jogs for some time, then waits until the arm rests. **The arm moves.**

        Args:
            velocity: rad/s of all joints (6,), or of `joint` alone.
            seconds: For how long.
            joint: The joint, counted from 1.
            degrees: Whether velocities are degrees/s.

        Returns:
            Where the arm rests (6,), rad.
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
        """The arm can be led by hand while the context lasts, and is held again at its end."""
        self._link.teach(True)
        try:
            yield Teaching(self._link)
        finally:
            if not self.is_closed:
                self._link.teach(False)

    def gripper(self, on: bool) -> None:
        """Pump on or off."""
        self._link.gripper(on)

    # What the controller has

    def push_arm(self, arm: Arm, *, store: bool = False) -> None:
        """Gives the controller an arm: friction, gains, model; with extensions also its limits and settings, which need Init or Error.

        Args:
            arm: The arm.
            store: Whether the controller keeps it over a loss of power.
        """
        self._link.push_arm(arm, store)

    def use_defaults(self) -> None:
        """The controller uses the friction, gains and arm model that are built into it, or that it has stored."""
        self._link.use_defaults()

    @property
    def payload(self) -> Payload:
        """What the controller reckons that the flange carries. Setting it takes half a second to come into the torques; None: nothing."""
        mass, com, inertia = self._link.payload()
        return Payload(mass, tuple(com), tuple(inertia))

    @payload.setter
    def payload(self, payload: Payload | None) -> None:
        self._link.set_payload((payload or Payload(0.0))._numbers())

    @property
    def settings(self) -> dict[str, float | list[float]]:
        """All settings of a controller with extensions, by their names; those of joints are lists of six."""
        return self._link.settings()

    def set_settings(self, values: Mapping[str, float | Sequence[float]]) -> None:
        """Changes settings by their names, all or none.

        Raises:
            UsageError, RefusedError: There is no such setting, or a value is out of its range.
        """
        flat: list[tuple[str, int, float]] = []
        for name, value in values.items():
            if isinstance(value, Sequence):
                flat += [(name, joint, float(v)) for joint, v in enumerate(value, 1)]
            else:
                flat.append((name, 0, float(value)))
        self._link.set_settings(flat)

    # What is wrong

    def recover(self, *, arm: Arm | None = None, defaults: bool = False) -> list[str]:
        """The whole way back to an arm that is held; the steps that were gone, in words.

        Args:
            arm: Whose parameters a controller is given that has lost them.
            defaults: Whether it is given those that are built into it.
        """
        return self._link.recover(arm, defaults)

    def clear(self) -> None:
        """Clears the errors of the controller and of all drives."""
        self._link.clear()

    def disable(self) -> None:
        """Takes the torque off at rest. **An arm without brakes falls.**"""
        self._link.disable()

    def flight_log(self) -> FlightLog:
        """Reads the flight recorder: every tick of the last seconds before the first error."""
        return FlightLog(self._link.fetch_log())

    def clear_flight_log(self) -> None:
        """Forgets the log; the recorder begins anew."""
        self._link.clear_log()

    # What is done to a simulated arm

    def push(self, joint: int, torque: float, seconds: float) -> None:
        """Somebody pushes a joint (from 1) of the simulated arm: N·m, for so many s."""
        self._link.simulate(f"push {joint} {torque} {seconds}")

    def lead(self, path: Trajectory | Plan) -> None:
        """A hand leads the simulated arm along these positions while it is taught."""
        self._link.lead(path.trajectory if isinstance(path, Plan) else path)

    def inject(self, faults: str) -> None:
        """Faults of a fault file (TOML, ``jtc help faults``) happen to the simulated arm; times are those since its start, `info["uptime"]`."""
        self._link.inject(faults)
