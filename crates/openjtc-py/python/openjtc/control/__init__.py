"""The real control code, one tick a call: what runs on the board, in the simulator, and here.

A tick is a millisecond. What the controller receives goes in, what it sends comes out; there is no clock, and no thread::

    controller = Controller()
    answers, host = [], b"".join(encode.use_defaults())
    while True:
        out = controller.tick(Inputs(bus=answers, host=host))
        answers, host = drives(out.bus), b""          # your drives: see openjtc.control.bus

:mod:`openjtc.control.encode` makes the frames of the host, :class:`StatusReader` reads what the controller reports, and
:mod:`openjtc.control.bus` has both ends of the joint bus. :class:`openjtc.sim.Simulator` is this controller with simulated drives.
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

#: A frame of the joint bus: 11-bit identifier and payload of at most 24 bytes (CAN FD).
Frame = tuple[int, bytes]


@dataclass(frozen=True)
class Inputs:
    """What a tick is given.

    Attributes:
        bus: Frames of the joint bus that were received since the last tick, oldest first.
        host: Bytes that the host sent since the last tick, in any pieces.
        acknowledged: The frame of the last tick was acknowledged on the bus.
        bus_off: The CAN controller is bus-off.
        safety_input: Level of the safety input; True is no error.
        status_free: The serial transmitter can take a status.
        ticked: The tick comes. False: the timer is late by a whole tick, and nothing is looked at but the bytes of the host; after ten in a
            row the watchdog resets the controller.
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
    """What a tick gives out; two of them are equal where every bit is.

    Attributes:
        bus: The frame for the joint bus; None in the first tick, and where the tick did not come.
        host: Bytes for the host: a status (25 times a second), an answer, or nothing.
        safety_output: Level of the safety output; True is no error. Where the tick did not come it is as before; after a reset False.
        telemetry: What the tick computed: set values, measured values, the torque in its parts.
        reset: The watchdog has reset the controller.
    """

    bus: Frame | None
    host: bytes
    safety_output: bool
    telemetry: Telemetry
    reset: bool = False


class Controller:
    """A controller on its board, with power just switched on.

    Args:
        arm: It has this arm stored, which :func:`openjtc.control.encode.use_defaults` then means; an arm whose file does not give all of
            it only sets the limits. None: a controller as new, with the built-in arm.
    """

    def __init__(self, arm: Arm | None = None) -> None:
        self._native = _native.Controller(arm)

    def tick(self, inputs: Inputs = Inputs()) -> Outputs:
        """One millisecond.

        Raises:
            UsageError: A frame that no joint bus carries.
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
        """What the last tick computed."""
        return self._native.telemetry

    @property
    def time(self) -> float:
        """Time since the start, s: a thousandth of the ticks."""
        return self._native.time
