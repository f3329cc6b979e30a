"""Results of procedures on a chain of boards."""

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
    """Boards that were found in the chain.

    Attributes:
        boards: Boards with a number, in the order of the chain.
        reports: Low bytes of the flash numbers of all boards that reported, including boards without a number.
        findings: Irregularities, in words; empty if the chain is in order.
    """

    boards: tuple[Board, ...]
    reports: tuple[int, ...]
    findings: tuple[str, ...]


@dataclass(frozen=True)
class RunReport:
    """Control loops that were started.

    Attributes:
        boards: Numbers of the boards whose control loops were started.
        active: True if the outputs of these boards are enabled, so that things move.
        load_percent: Predicted bus load, % of the bit rate.
        load_limit_percent: Bus load that the profile allows, %.
    """

    boards: tuple[int, ...]
    active: bool
    load_percent: float
    load_limit_percent: float


@dataclass(frozen=True)
class Finding:
    """Finding of `Chain.doctor`.

    Attributes:
        severity: ``problem``, ``warning`` or ``good``.
        what: Description of the finding.
        why: Likely cause; may be empty.
        next: Next command or step; empty if no step is needed.
    """

    severity: str
    what: str
    why: str
    next: str


@dataclass(frozen=True)
class Examination:
    """Result of `Chain.doctor`.

    Attributes:
        healthy: True if no finding is a problem.
        findings: Findings, the worst first.
        boards: Boards that answered.
    """

    healthy: bool
    findings: tuple[Finding, ...]
    boards: tuple[Board, ...]


@dataclass(frozen=True)
class Event:
    """An event on the bus.

    Attributes:
        number: Number of the event, from 1.
        time_s: Time of the event, s since the chain was opened.
        kind: Heartbeats: ``late``, ``lost``, ``back``, ``rebooted``. Control loops: ``left-loop``, ``stopped-by-policy``,
            ``in-loop``. Board: ``error``, ``text``. Bus: ``competing-master``, ``foreign``, ``number-shared``. Others:
            ``updated``, with the result of an update for a board, and ``note``.
        board: Number of the board; None if the event is not about a board.
        text: Description of the event in words.
    """

    number: int
    time_s: float
    kind: str
    board: int | None
    text: str


@dataclass(frozen=True)
class BusState:
    """Last known state of the bus.

    Attributes:
        load_percent: Load, % of the bit rate, from received and sent frames.
        received: Number of frames received since the chain was opened.
        is_master: True if this chain sends heartbeats, so that it is the master of the bus.
        time_s: Time of this state, s since the chain was opened.
    """

    load_percent: float
    received: int
    is_master: bool
    time_s: float


@dataclass(frozen=True)
class Progress:
    """Progress of an update.

    Attributes:
        boards: Numbers of the boards that receive the image now.
        attempt: Number of the attempt, from 1.
        cycle: 1 (the board checks the image) or 2 (the board writes the image).
        bytes: Number of bytes that the boards have accepted in this attempt, counted over both cycles.
        total_bytes: Number of bytes of both cycles.
        rate: Average rate of this attempt, bytes/s.
        remaining_s: Remaining time at this rate, s.
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
    """Result of an update for one board.

    Attributes:
        board: Number of the board.
        flash_number: Flash number of the board; None: the board did not answer.
        outcome: ``not-started``, ``cancelled``, ``up-to-date``, ``program-up-to-date``, ``incomplete``, ``unknown``, ``written``,
            ``verified`` or ``running``.
        note: Remark about a board that already had the program; empty for any other board.
        verified: True if the board reports the Program ID and date of the image, and exactly this image was written to this address. The
            image was written in this update, or in an earlier update that the inventory records.
        before: Program ID and flash date before the update. Each value is None without a valid application or an answer.
        after: Program ID and flash date after the update.
        attempts: Number of attempts.
        time_s: Time from the reset into the exloader to the last answer, s.
        error: Reason of the failure; empty after a success.
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
    """Result of an update.

    Attributes:
        dry_run: True if only queries were sent.
        program_id: Program ID that the boards must show; None: the Program ID is not known.
        flash_date: Flash date of the image, ``YYYY-MM-DD``; None: no header contains a date.
        bytes: Number of bytes of both cycles.
        unverifiable: Reason why the written image cannot be verified; None: the image can be verified.
        boards: Results in the order of board numbers.
    """

    dry_run: bool
    program_id: int | None
    flash_date: str | None
    bytes: int
    unverifiable: str | None
    boards: tuple[UpdateResult, ...]

    @property
    def verified(self) -> bool:
        """True if every board is verified."""
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
    """Result for an open point of the protocol.

    Attributes:
        key: Key of the profile.
        unknown: Question about the protocol that the published description leaves open.
        published: Statement of the published description about the open point.
        observed: Observed behaviour of the boards.
        decision: Value of the key in the profile.
        measured: True if the observation decides the value; otherwise the earlier value stays in the profile.
    """

    key: str
    unknown: str
    published: str
    observed: str
    decision: str
    measured: bool


@dataclass(frozen=True)
class ProbeReport:
    """Measurement of how boards interpret the protocol.

    Attributes:
        boards: Numbers of the boards that answered.
        rows: Open points, with measured values or with values that were kept.
        profile: Profile with the measured values, TOML. Write it to a file to pass it to `connect`.
    """

    boards: tuple[int, ...]
    rows: tuple[ProbeRow, ...]
    profile: str


@dataclass(frozen=True)
class ConformanceTest:
    """A conformance test of one board, or of the chain.

    Attributes:
        id: Name of the test, such as ``D-T10``.
        board: Number of the board; None: the chain as a whole.
        expected: Expected behaviour.
        verdict: ``pass``, ``fail`` or ``skipped``.
        why: Observed behaviour after a failure, or the reason why the test was skipped.
        sent: Sent frames, in the format of candump.
        came: Received frames, at most 64.
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
    """Results of conformance tests.

    Attributes:
        tests: Tests in the order in which they ran.
        left: Changes of the boards that the tests could not undo; empty if all changes were undone.
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
