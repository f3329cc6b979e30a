"""The real control code, one tick per call. The same code runs on the board and in the simulator.

A tick is a millisecond. A call takes everything that the controller received and returns everything that the controller sends. The code has
neither a clock nor a thread::

    controller = Controller()
    answers, host = [], b"".join(encode.use_defaults())
    while True:
        out = controller.tick(Inputs(bus=answers, host=host))
        answers, host = drives(out.bus), b""          # your drives: see openjtc.control.bus

:mod:`openjtc.control.encode` makes the frames of the host, :class:`StatusReader` reads the controller's statuses, and
:mod:`openjtc.control.bus` contains both ends of the joint bus. :class:`openjtc.sim.Simulator` is this controller with simulated
drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from openjtc import _native
from openjtc._native import Arm, Telemetry
from openjtc.control import bus, encode
from openjtc.control.status import Response, Status, StatusReader

__all__ = [
    "Controller",
    "Frame",
    "Inputs",
    "Outputs",
    "Response",
    "Status",
    "StatusReader",
    "Telemetry",
    "bus",
    "encode",
]

#: Frame of the joint bus: 11-bit identifier and payload of at most 24 bytes (CAN FD).
Frame = tuple[int, bytes]


@dataclass(frozen=True)
class Inputs:
    """Inputs of a tick.

    Attributes:
        bus: Frames of the joint bus that were received since the last tick, oldest first.
        host: Bytes that the host sent since the last tick. Frames may be split at any byte.
        acknowledged: True if the frame of the last tick was acknowledged on the bus.
        bus_off: True if the CAN controller is bus-off.
        safety_input: Level of the safety input; True means no error.
        status_free: True if the serial transmitter can take a status.
        ticked: True if the tick occurs. If `ticked` is False, the timer is late by a whole tick, and the controller only reads the bytes of
            the host. After ten missing ticks in a row, the watchdog resets the controller.
    """

    bus: Sequence[Frame] = ()
    host: bytes = b""
    acknowledged: bool = True
    bus_off: bool = False
    safety_input: bool = True
    status_free: bool = True
    ticked: bool = True


@dataclass(frozen=True)
class Outputs:
    """Outputs of a tick. Two outputs are equal if every bit is equal.

    Attributes:
        bus: Frame for the joint bus; None in the first tick, and for a missing tick.
        host: Bytes for the host: a status (25 times a second), an answer, or no bytes.
        safety_output: Level of the safety output; True means no error. The level stays unchanged in a missing tick. After a reset it is
            False.
        telemetry: Values that the tick computed: set values, measured values, and the parts of the torque.
        reset: True if the watchdog has reset the controller.
    """

    bus: Frame | None
    host: bytes
    safety_output: bool
    telemetry: Telemetry
    reset: bool = False


class Controller:
    """A controller on its board, immediately after power-on.

    Args:
        arm: Stored arm of the controller, which :func:`openjtc.control.encode.use_defaults` selects. If the file of the arm is incomplete,
            only the limits are set. If `arm` is None, the controller is new and has the built-in arm.
    """

    def __init__(self, arm: Arm | None = None) -> None:
        self._native = _native.Controller(arm)

    def tick(self, inputs: Inputs = Inputs()) -> Outputs:
        """Runs one tick, which is 1 ms.

        Raises:
            UsageError: A frame is not valid on the joint bus.
        """
        frames = [(id, bytes(data)) for id, data in inputs.bus]
        sent, host, safety_output, reset = self._native.tick(
            frames,
            inputs.host,
            inputs.acknowledged,
            inputs.bus_off,
            inputs.safety_input,
            inputs.status_free,
            inputs.ticked,
        )
        return Outputs(sent, host, safety_output, self._native.telemetry, reset)

    @property
    def telemetry(self) -> Telemetry:
        """Values that the last tick computed."""
        return self._native.telemetry

    @property
    def time(self) -> float:
        """Time since the start of the controller, s: number of ticks / 1000."""
        return self._native.time
