"""What procedures on a chain brought about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from openjtc.ucom.boards import Board

__all__ = [
    "BusState",
    "ConformanceReport",
    "ConformanceTest",
    "Event",
    "Examination",
    "Finding",
    "ProbeReport",
    "ProbeRow",
    "Progress",
    "RunReport",
    "ScanReport",
    "UpdateReport",
    "UpdateResult",
]


@dataclass(frozen=True)
class ScanReport:
    """Who is in the chain.

    Attributes:
        boards: Boards with a number, in the order of the chain.
        reports: Low bytes of the flash numbers of all that reported, boards without a number among them.
        findings: What is odd, in words; empty: nothing.
    """

    boards: tuple[Board, ...]
    reports: tuple[int, ...]
    findings: tuple[str, ...]


@dataclass(frozen=True)
class RunReport:
    """What runs now.

    Attributes:
        boards: The numbers of the boards whose control loops were started.
        active: Their outputs are enabled: things move.
        load_percent: Forecast of the load of the bus, % of its bit rate.
        load_limit_percent: What the profile allows, %.
    """

    boards: tuple[int, ...]
    active: bool
    load_percent: float
    load_limit_percent: float


@dataclass(frozen=True)
class Finding:
    """Something that a doctor found.

    Attributes:
        severity: ``problem``, ``warning`` or ``good``.
        what: What was found.
        why: The likely cause; may be empty.
        next: The next command or act; empty where there is nothing to do.
    """

    severity: str
    what: str
    why: str
    next: str


@dataclass(frozen=True)
class Examination:
    """What a doctor found.

    Attributes:
        healthy: No finding is a problem.
        findings: The worst first.
        boards: Boards that answered.
    """

    healthy: bool
    findings: tuple[Finding, ...]
    boards: tuple[Board, ...]


@dataclass(frozen=True)
class Event:
    """Something that happened on the bus.

    Attributes:
        number: Counts events, from 1.
        time_s: When, s since the chain was opened.
        kind: ``late``, ``lost``, ``back``, ``rebooted`` of heartbeats; ``left-loop``, ``stopped-by-policy``, ``in-loop`` of
            control loops; ``error`` and ``text`` of a board; ``competing-master``, ``foreign``, ``number-shared`` of the bus;
            ``updated``, what an update has made of a board; ``note``.
        board: The board's number; None where it is about none.
        text: In words.
    """

    number: int
    time_s: float
    kind: str
    board: int | None
    text: str


@dataclass(frozen=True)
class BusState:
    """The bus as it was last seen.

    Attributes:
        load_percent: Load, % of the bit rate, by what was received and sent.
        received: Frames that were received since the chain was opened.
        is_master: This chain sends heartbeats: it is the master of the bus.
        time_s: When, s since the chain was opened.
    """

    load_percent: float
    received: int
    is_master: bool
    time_s: float


@dataclass(frozen=True)
class Progress:
    """How far an update is.

    Attributes:
        boards: The boards that get the image now.
        attempt: From 1.
        cycle: 1 (the board checks the image) or 2 (it is written).
        bytes: Bytes of both cycles that were taken in this attempt.
        total_bytes: Bytes of both cycles.
        rate: Bytes per second so far.
        remaining_s: Remaining time at that rate, s.
    """

    boards: tuple[int, ...]
    attempt: int
    cycle: int
    bytes: int
    total_bytes: int
    rate: int
    remaining_s: float

    @classmethod
    def _of(cls, value: dict[str, Any]) -> Progress:
        return cls(**{**value, "boards": tuple(value["boards"])})


@dataclass(frozen=True)
class UpdateResult:
    """What became of one board.

    Attributes:
        board: Its number.
        flash_number: Its flash number; None: it did not answer.
        outcome: ``not-started``, ``cancelled``, ``up-to-date``, ``program-up-to-date``, ``incomplete``, ``unknown``, ``written``,
            ``verified`` or ``running``.
        note: What is to be said of a board that showed the program already; empty: of any other.
        verified: The board shows the Program ID and date of the image, and exactly this image was written to this address:
            now, or before by the inventory.
        before: Program ID and flash date that it showed before; None each: no valid application, or no answer.
        after: Program ID and flash date that it shows now.
        attempts: Attempts that were made.
        time_s: From the reset into the exloader to the last answer, s.
        error: Why it failed; empty: it did not.
    """

    board: int
    flash_number: int | None
    outcome: str
    note: str
    verified: bool
    before: tuple[int | None, str | None]
    after: tuple[int | None, str | None]
    attempts: int
    time_s: float
    error: str


@dataclass(frozen=True)
class UpdateReport:
    """What became of an update.

    Attributes:
        dry_run: Nothing was sent but questions.
        program_id: The Program ID that the boards have to show; None: nobody knows it.
        flash_date: The flash date of the image, ``YYYY-MM-DD``; None: no header carries it.
        bytes: Bytes of both cycles.
        unverifiable: Why nothing can prove what was written; None: it is read back.
        boards: In the order of their numbers.
    """

    dry_run: bool
    program_id: int | None
    flash_date: str | None
    bytes: int
    unverifiable: str | None
    boards: tuple[UpdateResult, ...]

    @property
    def verified(self) -> bool:
        """Every board shows the image."""
        return bool(self.boards) and all(one.verified for one in self.boards)

    @classmethod
    def _of(cls, value: dict[str, Any]) -> UpdateReport:
        boards = tuple(
            UpdateResult(**{**one, "before": tuple(one["before"]), "after": tuple(one["after"])})
            for one in value["boards"]
        )
        return cls(**{**value, "boards": boards})


@dataclass(frozen=True)
class ProbeRow:
    """One unknown of the protocol, and what was found out.

    Attributes:
        key: Key of the profile.
        unknown: What is unknown.
        published: What the published description has about it.
        observed: What was observed.
        decision: The value in the profile.
        measured: The observation decides; else the value is the one from before.
    """

    key: str
    unknown: str
    published: str
    observed: str
    decision: str
    measured: bool


@dataclass(frozen=True)
class ProbeReport:
    """How boards read the protocol.

    Attributes:
        boards: Numbers of the boards that answered.
        rows: What was unknown, and is measured or kept.
        profile: The profile with what was measured, TOML: for a file that `connect` takes.
    """

    boards: tuple[int, ...]
    rows: tuple[ProbeRow, ...]
    profile: str


@dataclass(frozen=True)
class ConformanceTest:
    """One test of one board, or of the chain.

    Attributes:
        id: Its name, as ``D-T10``.
        board: The board; None: the chain as a whole.
        expected: What was expected.
        verdict: ``pass``, ``fail`` or ``skipped``.
        why: What came instead, or why it was not done.
        sent: Frames that were sent, as candump writes them.
        came: Frames that came, at most 64.
    """

    id: str
    board: int | None
    expected: str
    verdict: str
    why: str
    sent: tuple[str, ...]
    came: tuple[str, ...]


@dataclass(frozen=True)
class ConformanceReport:
    """Whether boards keep to the protocol.

    Attributes:
        tests: In the order in which they were done.
        left: What is not as it was found; empty: nothing.
    """

    tests: tuple[ConformanceTest, ...]
    left: tuple[str, ...]

    @property
    def failed(self) -> tuple[ConformanceTest, ...]:
        """Tests that failed."""
        return tuple(test for test in self.tests if test.verdict == "fail")

    @classmethod
    def _of(cls, value: dict[str, Any]) -> ConformanceReport:
        def test(one: dict[str, Any]) -> ConformanceTest:
            frames = (tuple(one["sent"]), tuple(one["came"]))
            return ConformanceTest(
                one["id"], one["board"], one["expected"], one["verdict"], one.get("why") or "", *frames
            )

        return cls(tuple(test(one) for one in value["tests"]), tuple(value["left"]))
