"""A connection to one controller: what it reports, what it has, what is wrong with it."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from openjtc import _native
from openjtc._native import Arm, Trajectory
from openjtc.errors import Error, UsageError
from openjtc.payload import Payload
from openjtc.results import FlightLog, Plan
from openjtc.status import Finding, HeldStop, Status

__all__ = ["Connected"]

Array = NDArray[np.float64]
Self = TypeVar("Self", bound="Connected")


class Connected:
    """What `openjtc.Robot` has besides motions."""

    def __init__(self, link: _native.Link) -> None:
        self._link = link
        #: By thread: how many Stops there were after the last one that it asked for.
        self._stops: dict[int, int] = {}

    # The connection

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.close()
            return
        try:
            self.close()
        except Error as second:
            # What ended the block is what is raised; that the arm may be moving is to be seen all the same.
            text = f"and at the end of the connection: {second}"
            if hasattr(error, "add_note"):
                error.add_note(text)
            else:
                warnings.warn(text, RuntimeWarning, stacklevel=2)

    def close(self) -> None:
        """Stops what moves here, switches off the teaching that was switched on here, and ends the connection. The controller holds the arm."""
        try:
            self._link.close()
        finally:
            self._note_stop()

    def _note_stop(self) -> None:
        self._stops[threading.get_ident()] = self._link.asked()

    def _stopped_since(self, asked: int) -> bool:
        """This thread has stopped the arm after so many Stops."""
        return self._stops.get(threading.get_ident(), 0) > asked

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
        status = self._link.status()
        stop = status.pop("held_stop")
        return Status(**status, held_stop=HeldStop(**stop) if stop else None)

    @property
    def position(self) -> Array:
        """Measured joint positions (6,), rad."""
        return self.status.position

    @property
    def arm(self) -> Arm:
        """The arm in the controller where it can be asked; else the one given to `connect`, or the built-in one.

        Where `connect` was given another arm than the controller has, motions, jogging and teaching are refused; this is the controller's.
        """
        return self._link.arm()

    @property
    def info(self) -> dict[str, Any] | None:
        """Who the controller is: board, firmware, arm, hash of its arm, boots, uptime (s); None for one without extensions.

        Under ``reactions``, None where it does not report them: ``last_held_stop``, joints that yield (``yields``) or whose encoder has
        jumped (``encoder_jumped``), ``path_rate``, and for how long this run was held back (``held_back_s``).
        """
        return self._link.info()

    def doctor(self) -> list[Finding]:
        """Looks at link, bus and set-up for 1.5 s; what it found, the worst first."""
        return [Finding(**found) for found in self._link.doctor()]

    def wait_ready(self, timeout: float = 15.0) -> None:
        """Waits until the controller holds the arm with all drives enabled; not longer than `timeout` (s).

        Raises:
            DeviceError: It reports an error.
            Error: It does not hold the arm in this time (s); it may lack parameters (`use_defaults`, `push_arm`).
        """
        self._link.wait_ready(timeout)

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

    def set_settings(self, values: Mapping[str, float | Sequence[float] | Array]) -> None:
        """Changes settings by their names, all or none.

        Args:
            values: A number each, or six where it is a setting of joints, base to wrist.

        Raises:
            UsageError: There is no such setting, or a value is out of its range: joint, value and limit are in the error; nothing was changed.
        """
        flat: list[tuple[str, int, float]] = []
        for name, value in values.items():
            numbers = np.asarray(value, dtype=float)
            if numbers.shape not in ((), (6,)):
                raise UsageError(f"{name}: has the shape {numbers.shape}, not () or (6,); nothing was changed", "usage")
            if numbers.ndim:
                flat += [(name, joint, float(v)) for joint, v in enumerate(numbers, 1)]
            else:
                flat.append((name, 0, float(numbers)))
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
