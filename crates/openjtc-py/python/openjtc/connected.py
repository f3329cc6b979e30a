"""Connection to one controller: status, parameters, diagnosis."""

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
    """Base class of `openjtc.Robot`: all methods except motions."""

    def __init__(self, link: _native.Link) -> None:
        self._link = link
        #: Total number of Stops at the time of the last Stop that a thread requested, for each thread.
        self._stops: dict[int, int] = {}

    # The connection to the controller.

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
            # The error that ended the block is raised. The error of `close` is added to it as a note, because the
            # arm may be moving.
            text = f"and when the connection was closed: {second}"
            if hasattr(error, "add_note"):
                error.add_note(text)
            else:
                warnings.warn(text, RuntimeWarning, stacklevel=2)

    def close(self) -> None:
        """Stops the motion and ends the teaching of this connection, and closes the connection. The controller holds the arm."""
        try:
            self._link.close()
        finally:
            self._note_stop()

    def _note_stop(self) -> None:
        thread = threading.get_ident()
        # In a forked process, `asked` returns 0.
        self._stops[thread] = max(self._stops.get(thread, 0), self._link.asked())

    def _stopped_since(self, asked: int) -> bool:
        """Returns true if this thread has stopped the arm since the number of Stops was `asked`."""
        return self._stops.get(threading.get_ident(), 0) > asked

    @property
    def is_closed(self) -> bool:
        """True after the connection was closed. A closed connection refuses every request."""
        return self._link.is_closed

    def __repr__(self) -> str:
        return "Robot(closed)" if self.is_closed else f"Robot({self._link.port!r})"

    # Status and identity of the controller.
    @property
    def status(self) -> Status:
        """Status of the controller that arrived after this call began."""
        status = self._link.status()
        stop = status.pop("held_stop")
        return Status(**status, held_stop=HeldStop(**stop) if stop else None)

    @property
    def position(self) -> Array:
        """Measured joint positions (6,), rad."""
        return self.status.position

    @property
    def arm(self) -> Arm:
        """Arm of the controller. If the controller cannot report its arm, the value is the arm that was passed to `connect`, or the
        built-in arm.

        If another arm was passed to `connect`, the value is still the controller's arm. If the two arms differ, motions, jogging and
        teaching are refused.
        """
        return self._link.arm()

    @property
    def info(self) -> dict[str, Any] | None:
        """Identity of the controller: board, firmware, arm, hash of its arm, boots, uptime (s); None for a controller without extensions.

        ``reactions`` has ``last_held_stop``, joints that yield (``yields``) or whose encoder has jumped (``encoder_jumped``),
        ``path_rate``, and the time for which the controller has slowed down this run (``held_back_s``). ``reactions`` is None if the
        controller does not report reactions.
        """
        return self._link.info()

    def doctor(self) -> list[Finding]:
        """Checks link, bus and set-up for 1.5 s. Returns the findings; the worst finding is first."""
        return [Finding(**found) for found in self._link.doctor()]

    def wait_ready(self, timeout: float = 15.0) -> None:
        """Waits until the controller holds the arm with all drives enabled. The longest wait is `timeout` (s).

        Raises:
            DeviceError: The controller reports an error.
            Error: The controller does not hold the arm within `timeout`. The controller may lack parameters (`use_defaults`, `push_arm`).
        """
        self._link.wait_ready(timeout)

    # Parameters and settings of the controller.
    def push_arm(self, arm: Arm, *, store: bool = False) -> None:
        """Sends the friction, gains and model of an arm to the controller. A controller with extensions also gets the limits and settings
        of the arm. The controller accepts limits and settings only in Init or Error.

        Args:
            arm: Arm to send.
            store: Also stores the arm in the controller's non-volatile memory.
        """
        self._link.push_arm(arm, store)

    def use_defaults(self) -> None:
        """Makes the controller use its built-in or stored friction, gains and arm model."""
        self._link.use_defaults()

    @property
    def payload(self) -> Payload:
        """Payload at the flange that the controller uses. Set None for no payload. After a change, the torques change over 0.5 s."""
        mass, com, inertia = self._link.payload()
        return Payload(mass, tuple(com), tuple(inertia))

    @payload.setter
    def payload(self, payload: Payload | None) -> None:
        self._link.set_payload((payload or Payload(0.0))._numbers())

    @property
    def settings(self) -> dict[str, float | list[float]]:
        """All settings of a controller with extensions, by name. The value of a joint setting is a list of six numbers."""
        return self._link.settings()

    def set_settings(self, values: Mapping[str, float | Sequence[float] | Array]) -> None:
        """Changes settings by name. Either all settings are changed, or no setting is changed.

        Args:
            values: Value of each setting: a number, or six numbers for a joint setting, base to wrist.

        Raises:
            UsageError: A setting is unknown, or a value is out of range; the error has joint, value and limit. No setting was changed.
        """
        flat: list[tuple[str, int, float]] = []
        for name, value in values.items():
            numbers = np.asarray(value, dtype=float)
            if numbers.shape not in ((), (6,)):
                raise UsageError(f"{name}: shape {numbers.shape}, expected () or (6,); nothing was changed", "usage")
            if numbers.ndim:
                flat += [(name, joint, float(v)) for joint, v in enumerate(numbers, 1)]
            else:
                flat.append((name, 0, float(numbers)))
        self._link.set_settings(flat)

    # Errors of the controller, and diagnosis.
    def recover(
        self, *, arm: Arm | None = None, defaults: bool = False, accept_device_limits: bool = False
    ) -> list[str]:
        """Brings the controller back to position hold, and returns the steps in words.

        Args:
            arm: Arm with the parameters for a controller that has lost its parameters. The gains of this arm are checked before any frame
                is sent.
            defaults: Uses the parameters that are built into the controller.
            accept_device_limits: Accepts that the limits of the controller differ from the limits of ``arm``.
        """
        return self._link.recover(arm, defaults, accept_device_limits)

    def clear(self) -> None:
        """Clears the errors of the controller and of all drives."""
        self._link.clear()

    def disable(self) -> None:
        """Switches the drive torque off at rest. **An arm without brakes falls.**"""
        self._link.disable()

    def flight_log(self) -> FlightLog:
        """Reads the log of the flight recorder: every tick of the last seconds before the first error."""
        return FlightLog(self._link.fetch_log())

    def clear_flight_log(self) -> None:
        """Erases the log of the flight recorder and restarts the recorder."""
        self._link.clear_log()

    # Disturbances of a simulated arm
    def push(self, joint: int, torque: float, seconds: float) -> None:
        """Pushes a joint (from 1) of the simulated arm with `torque` (N·m) for `seconds` (s)."""
        self._link.simulate(f"push {joint} {torque} {seconds}")

    def lead(self, path: Trajectory | Plan) -> None:
        """Guides the simulated arm along the positions of `path` during teaching, like a hand."""
        self._link.lead(path.trajectory if isinstance(path, Plan) else path)

    def inject(self, faults: str) -> None:
        """Injects the faults of a fault file (TOML, ``jtc help faults``) into the simulated arm.

        Times in the file count from the start of the simulator, like `info["uptime"]`.
        """
        self._link.inject(faults)
