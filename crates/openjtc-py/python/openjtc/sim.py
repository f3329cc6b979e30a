"""The simulated arm, with the real controller (:class:`Simulator`) or for your own controller (:class:`Plant`).

Time is virtual: only ``step`` advances the time, many times faster than real time. Equal arguments and calls give equal numbers, bit for
bit. Arrays are (6,), base to wrist; positions are in rad, velocities in rad/s, torques in N·m, times in s.

    >>> from openjtc.sim import Plant
    >>> plant = Plant(seed=3)
    >>> state = plant.step([0, 0, 0, 0, 0, 0], ms=10)
    >>> round(state.time, 3)
    0.01
"""

from __future__ import annotations

import json
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openjtc import _native
from openjtc._native import Arm
from openjtc.control import Frame, Inputs, Outputs, Status, StatusReader, Telemetry, encode
from openjtc.payload import Payload
from openjtc.errors import DeviceError, FaultError, NoLinkError, UsageError

__all__ = ["ModelError", "Plant", "PlantState", "Simulator"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ModelError:
    """Difference between the true arm and the arm file.

    Attributes:
        mass: Largest relative error of each link's mass and inertia, 0 to 1. The simulator draws the errors from the seed.
        friction: Largest relative error of each joint's friction, 0 to 1. The simulator draws the errors from the seed.
        mass_factors: Factors (7,) of the masses of the base and the six links, 0 to 10, instead of random factors.
        friction_factors: Factors (6,) of the friction of the six joints, 0 to 10, instead of random factors.
    """

    mass: float = 0.10
    friction: float = 0.20
    mass_factors: Sequence[float] | None = None
    friction_factors: Sequence[float] | None = None


def _natural(value: SupportsIndex, what: str) -> int:
    """Returns a whole number within 0 to 2^64-1, or raises `UsageError`."""
    number = operator.index(value)
    if not 0 <= number < 1 << 64:
        raise UsageError(f"{what}: {number} is out of range (0 to 2^64-1)", "usage")
    return number


def _floats(value: ArrayLike, count: int, what: str) -> list[float]:
    """Returns `count` numbers as floats, or raises `UsageError`."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (count,):
        raise UsageError(f"{what}: shape {array.shape}, expected ({count},)", "usage")
    return [float(number) for number in array]


def _plain(value: object) -> object:
    """Converts a numpy value to a Python value."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise UsageError(f"{value!r} is not a valid value in a fault", "usage", next="`jtc help faults` lists kinds and keys")


def _of_joints(value: ArrayLike | None, what: str) -> list[float] | None:
    """Returns six numbers. The argument is one number for all joints or one number for each joint."""
    if value is None:
        return None
    return _floats(np.full(6, value) if np.ndim(value) == 0 else value, 6, what)


def _arm(
    arm: Arm | None,
    seed: int,
    payload: Payload | None,
    model_error: ModelError | None,
    start: ArrayLike | None,
    friction: bool,
    gear_stiffness: ArrayLike | None,
    over_speed: ArrayLike | None,
) -> dict[str, object]:
    error = None
    if model_error is not None:
        masses, frictions = model_error.mass_factors, model_error.friction_factors
        error = (
            float(model_error.mass),
            float(model_error.friction),
            None if masses is None else _floats(masses, 7, "mass_factors"),
            None if frictions is None else _floats(frictions, 6, "friction_factors"),
        )
    return {
        "arm": arm,
        "seed": _natural(seed, "seed"),
        "payload": None if payload is None else payload._numbers(),
        "model_error": error,
        "start": None if start is None else _floats(start, 6, "start"),
        "friction": friction,
        "gear_stiffness": _of_joints(gear_stiffness, "gear_stiffness"),
        "over_speed": _of_joints(over_speed, "over_speed"),
    }


class Simulator:
    """Simulated system of host line, real controller, joint bus, drives and arm, starting at power-on.

    Args:
        arm: The arm; None: the built-in arm, and a new controller. The controller has stored the arm if the arm file is complete.
        seed: Seed of all random numbers.
        payload: True payload of the arm. The controller does not know the payload until :func:`openjtc.control.encode.payload` sends it.
        model_error: Difference between the true arm and its file; None: no difference.
        start: Positions at the start, rad; None: 0, or a position near the limit for a joint that cannot reach 0.
        friction: True gives the joints the friction of the arm file.
        gear_stiffness: Stiffness of the gears between motor and link, N·m/rad, for all joints or (6,); None: rigid gears. Drives measure
            the position at the motor.
        over_speed: Speed at which the drives trip, rad/s, for all joints or (6,); None: 1.2 times the velocity limit.
        support: Support of the arm while its drives are not enabled: ``"brakes"``, a ``"stand"`` until the drives are first enabled, or
            ``"none"``.
        baud: Rate of the serial line, bit/s; None: transmission takes no time.
        answer_jitter_ms: Largest random delay of the drives' answers, ms.
        faults: Faults and their times, as the text of a fault file (``jtc help faults``).
        watch: True keeps the inputs and outputs of the controller for :attr:`inputs` and :attr:`outputs`.

    Raises:
        UsageError: An argument is not valid.
    """

    def __init__(
        self,
        arm: Arm | None = None,
        *,
        seed: int = 1,
        payload: Payload | None = None,
        model_error: ModelError | None = ModelError(),
        start: ArrayLike | None = None,
        friction: bool = True,
        gear_stiffness: ArrayLike | None = None,
        over_speed: ArrayLike | None = None,
        support: str = "brakes",
        baud: int | None = 115_200,
        answer_jitter_ms: int = 0,
        faults: str | None = None,
        watch: bool = False,
    ) -> None:
        simulated = _arm(arm, seed, payload, model_error, start, friction, gear_stiffness, over_speed)
        self._native = _native.Simulator(
            simulated, support=support, baud=baud, answer_jitter_ms=answer_jitter_ms, faults=faults, watch=watch
        )
        self._reader = StatusReader()
        self._status: Status | None = None

    def step(self, ms: int = 1) -> None:
        """Advances the simulation by ``ms`` milliseconds. The method checks for Ctrl-C after each simulated second.

        Raises:
            UsageError: ``ms`` is negative.
        """
        self._native.step(_natural(ms, "ms"))

    @property
    def time(self) -> float:
        """Time since the start of the simulation, s."""
        return self._native.time_ms / 1000

    @property
    def position(self) -> Floats:
        """True positions of the joints, rad."""
        return self._native.truth("position")

    @property
    def velocity(self) -> Floats:
        """True velocities of the joints, rad/s."""
        return self._native.truth("velocity")

    @property
    def torque(self) -> Floats:
        """True torques of the drives, N·m."""
        return self._native.truth("torque")

    @property
    def outside_torque(self) -> Floats:
        """External torques of pushes, hands and walls at the joints, N·m."""
        return self._native.truth("outside")

    @property
    def temperature(self) -> Floats:
        """Temperatures of the bearings, °C."""
        return self._native.truth("temperature")

    @property
    def telemetry(self) -> Telemetry:
        """Values that the controller computed in its last tick."""
        return self._native.telemetry

    @property
    def inputs(self) -> Inputs:
        """Inputs of the controller in the last millisecond, for :meth:`openjtc.control.Controller.tick`. The property needs
        ``watch=True``."""
        return Inputs(*self._exchange()[0])

    @property
    def outputs(self) -> Outputs:
        """Outputs of the controller in the last millisecond. For a missing tick, only the safety output is valid. The property needs
        ``watch=True``."""
        return Outputs(*self._exchange()[1], self._native.telemetry)

    def _exchange(
        self,
    ) -> tuple[tuple[list[Frame], bytes, bool, bool, bool, bool, bool], tuple[Frame | None, bytes, bool]]:
        exchange = self._native.exchange()
        if exchange is None:
            raise RuntimeError("inputs and outputs need Simulator(watch=True)")
        return exchange

    def write(self, data: bytes) -> None:
        """Sends bytes from the host. The bytes reach the controller at the rate of the serial line."""
        self._native.write(data)

    def read(self) -> bytes:
        """Returns the bytes that have reached the host since the last call. :meth:`command` also removes these bytes."""
        return self._native.read()

    @property
    def status(self) -> Status | None:
        """Newest status that reached the host. Reading the property removes the bytes that :meth:`read` would return."""
        self._responses()
        return self._status

    def _responses(self) -> list[Status]:
        statuses = self._reader.feed(self._native.read())
        if statuses:
            self._status = statuses[-1]
        return [status for status in statuses if status.response is not None]

    def command(self, *frames: bytes, limit: float = 10.0) -> None:
        """Sends frames one after the other, and steps until the controller has answered each frame.

        Args:
            frames: Frames that :mod:`openjtc.control.encode` makes.
            limit: Longest time for a frame, s.

        Raises:
            DeviceError: The controller did not accept a frame.
            NoLinkError: The controller did not answer a frame within ``limit``.
        """
        for frame in frames:
            self.write(frame)
            until = self.time + limit
            while True:
                self.step()
                answers = [s.response for s in self._responses() if s.response and s.response.frame_type == frame[1]]
                if answers:
                    break
                if self.time >= until:
                    raise NoLinkError(f"frame 0x{frame[1]:02X}: no answer within {limit} s", "no-answer")
            if not answers[0].accepted:
                raise DeviceError(f"frame 0x{frame[1]:02X}: {answers[0].words}", "not-accepted")

    def wait(self, state: str, *, limit: float = 20.0) -> None:
        """Steps until the controller is in a state, such as ``"HoldPos"``.

        Raises:
            FaultError: The controller did not reach the state within ``limit`` (s).
        """
        until = self.time + limit
        while self.telemetry.state != state:
            if self.time >= until:
                status = self.status
                causes = ", ".join(status.causes) if status else ""
                raise FaultError(
                    f"the controller did not reach {state} within {limit} s: it is in {self.telemetry.state}", "timeout", cause=causes
                )
            self.step()

    def bring_up(self, arm: Arm | None = None) -> None:
        """Sends the parameters to the controller, and steps until it holds the arm with every drive enabled.

        Args:
            arm: Arm with the parameters; None: the stored or built-in parameters of the controller.

        Raises:
            DeviceError: The controller did not accept the parameters.
            FaultError: The controller does not hold the arm after 20 s.
        """
        self.command(*(encode.use_defaults() if arm is None else encode.parameters(arm)))
        self.wait("HoldPos")
        until = self.time + 20.0
        while set(self.telemetry.drives) != {"OperationEnable"} or self.telemetry.state != "HoldPos":
            if self.time >= until:
                drives = ", ".join(self.telemetry.drives)
                raise FaultError(f"the drives are not all enabled after 20 s: {drives}", "timeout")
            self.step()

    def inject(self, fault: Mapping[str, object]) -> None:
        """Adds a fault, with the keys of a fault file (``jtc help faults``): ``{"kind": "encoder-jump", "joint": 3, "rad": 0.1}``.

        Without ``at_s``, ``in_state`` or ``at_point`` the fault begins now. ``at_s`` counts from the start of the simulation.

        Raises:
            UsageError: The fault is not valid.
        """
        entry = dict(fault)
        if not {"at_s", "in_state", "at_point"} & entry.keys():
            entry["at_s"] = self.time
        # Strings and numbers are written in the same way in TOML and JSON.
        lines = "\n".join(f"{key} = {json.dumps(value, ensure_ascii=False, default=_plain)}" for key, value in entry.items())
        self._native.inject(f"format = 2\n[[fault]]\n{lines}\n")

    def push(self, joint: int, torque: float, seconds: float) -> None:
        """Pushes a joint (counted from 1) with a torque (N·m) for ``seconds`` (s), beginning now."""
        self.inject({"kind": "push", "joint": joint, "torque_nm": float(torque), "for_s": float(seconds)})

    def lead(self, path: ArrayLike, step: float = 0.01) -> None:
        """Simulates a hand that guides the arm along a path (N, 6), rad, when teaching begins. The time between two rows of the path is
        ``step`` seconds."""
        self._native.lead(path, step)

    def set_safety_input(self, level: bool) -> None:
        """Sets the level of the controller's safety input; True means no error."""
        self._native.set_safety_input(level)

    @property
    def safety_output(self) -> bool:
        """Level of the controller's safety output; True means no error."""
        return self._native.safety_output

    @property
    def bus_frames(self) -> list[Frame]:
        """All frames on the joint bus in the last millisecond, in the order of the bus."""
        return self._native.bus_frames()

    @property
    def events(self) -> list[tuple[float, str]]:
        """Events of the simulation, oldest first. Each event has a time (s) and a text."""
        return self._native.events()

    @property
    def statistics(self) -> dict[str, float]:
        """Counters since the start of the simulation: bytes, frames, resets, and the load of the joint bus."""
        return self._native.statistics()


@dataclass(frozen=True, eq=False)
class PlantState:
    """Measurements of the drives, for a controller. Arrays are (6,).

    Attributes:
        time: Time since the start of the plant, s.
        position: Positions read by the drives, rad, in steps of 0.1 mrad. A torque that is computed from a position acts 2 ms after the
            drive read the position.
        velocity: Velocities, rad/s; each is a mean over 10 ms.
        temperature: Temperatures of the bearings, °C.
        enabled: True if the drive holds its joint. After a trip, the brake holds the joint.
        errors: Error bits of the drives.
    """

    time: float
    position: Floats
    velocity: Floats
    temperature: Floats
    enabled: list[bool] = field(default_factory=list)
    errors: list[int] = field(default_factory=list)

    @property
    def faulted(self) -> bool:
        """True if a drive has tripped. The arm then stays at rest until :meth:`Plant.reset`."""
        return not all(self.enabled)


class Plant:
    """Arm and drives without a controller. In each millisecond the plant takes a torque and returns a measurement.

    The plant is the same as in :class:`Simulator`, with the same bodies, friction and end stops. The plant also has the same drives with
    their encoders, over-speed trip, working area and torque limit, and the same delay over the joint bus. The drives are enabled from the
    start. If drives trip, brakes hold the arm.

    Args:
        arm: The arm; None: the built-in arm.
        seed: Seed of all random numbers. With the same ``model_error`` and seed, the true arm is the same as in a :class:`Simulator`.
        payload: Payload of the arm.
        model_error: Difference between the true arm and its file; None: no difference.
        start: Positions at the start, rad; None: 0, or a position near the limit for a joint that cannot reach 0.
        friction: True gives the joints the friction of the arm file; False: no friction.
        gear_stiffness: Stiffness of the gears between motor and link, N·m/rad, for all joints or (6,); None: rigid gears. Drives measure
            the position at the motor.
        over_speed: Speed at which the drives trip, rad/s, for all joints or (6,); None: 1.2 times the velocity limit.
        drives: False simulates the arm without drives. Torques then act at once, measurements are exact, and no drive trips.

    Raises:
        UsageError: An argument is not valid.
    """

    def __init__(
        self,
        arm: Arm | None = None,
        *,
        seed: int = 1,
        payload: Payload | None = None,
        model_error: ModelError | None = ModelError(),
        start: ArrayLike | None = None,
        friction: bool = True,
        gear_stiffness: ArrayLike | None = None,
        over_speed: ArrayLike | None = None,
        drives: bool = True,
    ) -> None:
        simulated = _arm(arm, seed, payload, model_error, start, friction, gear_stiffness, over_speed)
        self._native = _native.Plant(simulated, drives=drives)

    def step(self, torque: ArrayLike, ms: int = 1) -> PlantState:
        """Applies torques (6,), N·m, for ``ms`` milliseconds. The drives round the torques to 0.011 N·m and limit them to
        :attr:`torque_max`.

        Raises:
            UsageError: The torques are not six finite numbers, or ``ms`` is negative.
        """
        self._native.step(torque, _natural(ms, "ms"))
        return self.state

    def reset(self, position: ArrayLike) -> PlantState:
        """Restarts the arm at time 0, cold and at rest at these positions (6,), rad, with its drives enabled.

        Raises:
            UsageError: A position is beyond an end stop.
        """
        self._native.reset(position)
        return self.state

    @property
    def state(self) -> PlantState:
        """Last measurement of the drives."""
        native = self._native
        return PlantState(
            native.time_ms / 1000, native.position, native.velocity, native.temperature, native.enabled, native.errors
        )

    @property
    def time(self) -> float:
        """Time since the start of the plant, s."""
        return self._native.time_ms / 1000

    @property
    def true_position(self) -> Floats:
        """True positions of the joints, rad."""
        return self._native.truth("position")

    @property
    def true_velocity(self) -> Floats:
        """True velocities of the joints, rad/s."""
        return self._native.truth("velocity")

    @property
    def true_torque(self) -> Floats:
        """True torques of the drives, N·m."""
        return self._native.truth("torque")

    @property
    def torque_max(self) -> Floats:
        """Largest torques of the drives, N·m."""
        return self._native.torque_max
