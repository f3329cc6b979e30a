"""State of a board that a script plays, and its possible deviations."""

from collections.abc import Callable
from dataclasses import dataclass, field

MSTART, ASTART, MCARUN, EXLRUN, INIT, PROG, OPINIT, IPINIT = (1 << bit for bit in range(7, -1, -1))
NONE = (0xFFFF, 0xFFFF)


@dataclass
class Quirks:
    """Deviations and faults of these boards."""

    order: str = "little"
    inclusive: bool = False  # the count of a string includes its header
    all4: bool = False  # each board sends four reports
    auto_pin: bool = False  # the pin is switched on with the acknowledgement
    strict: bool = False  # surplus bytes are refused
    lost_acks: int = 0
    wrong_ack: bool = False
    lost_pins: int = 0  # number of PC_SETSTATUS for the pin that are lost
    other_number: bool = False  # DSP_INFO contains another number
    keeps_old: bool = False
    lost_finished: bool = False
    errors: dict[tuple[int, int], int] = field(default_factory=dict)  # error after a block of a cycle, from 0
    late: dict[tuple[int, int], float] = field(default_factory=dict)  # delay of DSP_READY after a block, in seconds
    late_by: Callable[[], float] = lambda: 0.0  # delay for all other blocks
    dump_gap: float = 0.0  # pause between frames of an IO description, in seconds
    between: Callable[[], list[str]] = list  # other frames between the frames of an IO description


class Board:
    """State of one board."""

    def __init__(self, place: int, flash: int, shape: tuple[int, int, int]):
        self.place, self.flash, self.shape = place, flash, shape
        self.number: int | None = None
        self.status = EXLRUN
        self.program = (0x1234, 0x386E)
        self.silent = False
        self.mute = False  # the board receives frames, but the frames that it sends are lost
        self.once: dict[tuple[int, int], int] = {}  # as `Quirks.errors`, each entry once
        self.dropping, self.busy = False, False
        self.block, self.blocks = b"", []
        self.serial = 0
        self.flags = bytes(4)
        self.text = f"python {flash:x}"

    def names(self) -> list[str]:
        """Returns the description of the board, and then the names of inputs, outputs and parameters."""
        kinds = zip(("ci", "so", "par"), self.shape)
        return [self.text] + [f"{kind}{i} of {self.flash:x}" for kind, n in kinds for i in range(n)]

    def initial(self) -> list[int]:
        return [(self.flash + i) & 0xFF for i in range(self.shape[0])]
