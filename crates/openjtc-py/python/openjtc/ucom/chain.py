"""A chain of UCoM boards on a bus."""

from __future__ import annotations

import contextlib
import datetime
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from openjtc.ucom.boards import Board
from openjtc.ucom.reports import (
    ConformanceReport,
    Examination,
    Finding,
    ProbeReport,
    ProbeRow,
    Progress,
    RunReport,
    ScanReport,
    UpdateReport,
)
from openjtc.ucom.session import Boards
from openjtc.ucom.values import Settable, ValuesByName

__all__ = ["Chain"]

_Path = str | os.PathLike[str]


def _image(image: _Path | bytes | None) -> tuple[str | None, bytes | None]:
    if image is None:
        return None, None
    return (None, image) if isinstance(image, bytes) else (os.fspath(image), None)


class Chain(ValuesByName):
    """A chain of UCoM boards, made by `connect`.

    A separate thread owns the session. The thread of the session sends heartbeats for boards that the chain has started, supervises the
    boards, and executes one call after the other. Any Python thread may make calls. Other Python threads can run during a call.

    The end of the context stops the control loops, then the applications that this chain has started, like ``ucom``. Ctrl-C during a call
    stops them before `KeyboardInterrupt` is raised. The end of a program that has not closed its chain also stops them. A killed program
    sends no more heartbeats, and the boards make their outputs safe by themselves after 1.5 s.

    Inputs and outputs have names ``BOARD.SIGNAL``, with the board's number or name (``"2.position"``, ``"gripper.position"``). If only one
    board has the signal, the name of the signal alone is enough.

    Every method may raise:
        NoLinkError: The bus is lost, or a board does not answer (``.board``).
        RefusedError: Another PC is master of the bus (``foreign-master``), or a check refused the call. No board was changed.
        DeviceError: A board reports an error.
        FaultError: The call failed while it ran, or was cancelled.
    ``.next`` of an error suggests commands of ``ucom``. The methods with the same names as these commands have the same effect.
    """

    # Discovery and numbers of boards.

    def init(self, *, renew: bool = False, force: bool = False, check: bool = True) -> ScanReport:
        """Resets all boards and numbers them along the init wire. The reset makes the outputs of the boards safe.

        Updates of several boards use the result as inventory. If an inventory file was passed to `connect`, the result is compared with
        that file. If the result has no findings, it is written to the file.

        Args:
            renew: Replaces the inventory without a comparison.
            force: Continues even if another PC is on the bus.
            check: True raises an error for findings; False: findings are only in the report.

        Raises:
            DeviceError: Boards are missing, are in another order, or were not reached (``init``).
            NoLinkError: No board reported (``init``).
        """
        # The names are forgotten in any case, because they belong to the boards that had these numbers
        # before.
        self._forget_boards()
        value = self._native.init(renew, force, check)
        return ScanReport(self._keep(value["boards"]), tuple(value["reports"]), tuple(value["findings"]))

    def info(self, boards: Boards = "all") -> dict[int, Board]:
        """Reads the information that boards report at present."""
        return self._seen(self._native.info(self._list(boards)), whole=True)

    def status(
        self, boards: Boards = "all", *, set: Sequence[str] = (), clear: Sequence[str] = (), force: bool = False
    ) -> dict[int, Board]:
        """Sets and clears status bits of boards by name (``ASTART``, ``OPINIT``, …), and reads the status back."""
        return self._seen(self._native.status(self._list(boards), list(set), list(clear), force))

    def repair(self, board: int | str, *, flash_number: int | None = None, force: bool = False) -> Board:
        """Restores the number of one board; the other boards keep their numbers.

        Args:
            board: Number of the board.
            flash_number: Flash number of the board that must get the number; None: the flash number in the inventory.
            force: Continues even if another PC is on the bus.
        """
        value = self._native.repair(self._number(board), flash_number, force)
        return self._seen([value])[value["number"]]

    # Applications and control loops of boards.

    def start(self, boards: Boards = "all", *, force: bool = False) -> dict[int, Board]:
        """Starts the applications of boards, without any movement. Closing the chain stops these applications again."""
        return self._seen(self._native.start(self._list(boards), force))

    def run(
        self,
        boards: Boards = "all",
        *,
        active: bool = False,
        inputs: Mapping[str, Settable] | None = None,
        parameters: Mapping[str, Settable] | None = None,
        file: _Path | None = None,
        texts: bool = False,
        force: bool = False,
    ) -> RunReport:
        """Starts applications, writes parameters and inputs, and then starts control loops. From then on the chain supervises the boards.

        Args:
            boards: Boards to run.
            active: Enables the outputs: **things move**.
            inputs: Initial inputs, by ``BOARD.NAME``, or by name for all boards.
            parameters: Initial parameters, by ``BOARD.NAME``, or by name for all boards.
            file: Parameter file, YAML, as ``ucom par --save`` and `save_parameters` write it.
            texts: Lets the applications of the boards send texts, which become events of the kind ``text``.
            force: Continues even if the bus would be too busy, or another PC is on the bus.

        Raises:
            RefusedError: A value is out of range (``value``, with ``.value`` and ``.limit``), the bus load is too high (``load``), or
                another check refused the call. Steps that were already executed are undone.
        """
        path = None if file is None else os.fspath(file)
        first, wanted = self._given(inputs or {}), self._given(parameters or {})
        value = self._native.run(self._list(boards), active, first, wanted, path, texts, force)
        return RunReport(
            tuple(value["boards"]), value["active"], value["load_percent"], value["load_limit_percent"]
        )

    def outputs(self, active: bool, boards: Boards = "all") -> None:
        """Enables the outputs of running boards, or makes the outputs safe. ``all`` means the boards that this chain runs."""
        self._native.outputs(self._list(boards), active)

    def stop(self, boards: Boards = "all", *, application: bool = True) -> dict[int, Board]:
        """Stops boards, including boards that another program has started. First stops the control loops at once, then stops each board and
        waits for its confirmation.

        A stop interrupts a call of another thread on this chain, and that call ends with the error ``cancelled``. Updates are not
        interrupted. Stopping is always allowed, even with another PC on the bus.

        Args:
            boards: Boards to stop; ``all`` by broadcast.
            application: Also ends applications; False: ends only control loops.

        Raises:
            FaultError, NoLinkError: Some boards may not be stopped.
        """
        return self._seen(self._native.stop(self._list(boards), application))

    def reset(self, boards: Boards = "all", *, force: bool = False) -> tuple[int, ...]:
        """Resets boards. The outputs of the boards become safe, and the boards have no number until `init` or `repair`.

        Returns:
            Low bytes of the flash numbers of the boards that reported after the reset.
        """
        reports = self._native.reset(self._list(boards), force)
        self._boards.clear()
        return tuple(reports)

    def xreset(self, boards: Boards, *, force: bool = False) -> dict[int, Board]:
        """Resets boards into their exloaders, with programming enabled."""
        return self._seen(self._native.xreset(self._list(boards), force))

    # Diagnosis of the chain.

    def doctor(self) -> Examination:
        """Listens to the bus for 1.5 s, and queries all boards unless another PC is the master. Returns the findings."""
        value = self._native.doctor()
        findings = tuple(Finding(**finding) for finding in value["findings"])
        return Examination(value["healthy"], findings, tuple(Board._of(one, self) for one in value["boards"]))

    def probe(
        self, *, init: bool = False, alive: bool = False, image: _Path | None = None, force: bool = False
    ) -> ProbeReport:
        """Measures with harmless requests how the boards interpret points that the published protocol leaves open.

        The chain keeps its own profile. To use the measured profile, pass it to `connect`.

        Args:
            init: Also measures points that can be observed only while boards are numbered. The probe then resets and numbers the chain.
            alive: Starts a control loop with safe outputs to find out which heartbeats a board accepts. The loop is stopped again.
            image: Image of a board's present application, from which the probe finds the checksum algorithm of Program IDs.
            force: Continues even if another PC is on the bus, or if ``init`` or ``alive`` ends running control loops.

        Raises:
            RefusedError: Control loops run (``running``), and ``init`` or ``alive`` would end these control loops.
        """
        if init:
            # The names are forgotten in any case, because they belong to the boards that had these numbers
            # before.
            self._forget_boards()
        value = self._native.probe(init, alive, None if image is None else os.fspath(image), force)
        rows = tuple(ProbeRow(**row) for row in value["rows"])
        return ProbeReport(tuple(value["boards"]), rows, value["profile"])

    def conformance(
        self,
        boards: Boards = "all",
        *,
        init: bool = False,
        run: bool = False,
        only: Sequence[str] = (),
        force: bool = False,
    ) -> ConformanceReport:
        """Tests the boards against the protocol. Without ``init`` and ``run``, sends only harmless requests.

        Args:
            boards: Boards to test.
            init: Includes tests that reset and renumber the chain.
            run: Includes tests that start control loops with safe outputs. Tests with control loops take more than a minute per board.
            only: Runs only these tests, such as ``D-T10``.
            force: Continues even if another PC is on the bus.
        """
        return ConformanceReport._of(self._native.conformance(self._list(boards), init, run, list(only), force))

    # Firmware of the boards.

    def update(
        self,
        image: _Path | bytes,
        boards: Boards,
        *,
        flash_number: int | None = None,
        second: _Path | bytes | None = None,
        raw: bool = False,
        addresses: Literal["byte", "word"] | None = None,
        fill_gaps: bool = False,
        date: datetime.date | None = None,
        expect_program_id: int | None = None,
        name_target: bool = False,
        group: bool = False,
        start: bool = False,
        dry_run: bool = False,
        unverified: bool = False,
        force: bool = False,
        rewrite: bool = False,
        check: bool = True,
        progress: Callable[[Progress], None] | bool = True,
    ) -> UpdateReport:
        """Updates the firmware of boards: checks the image, transfers it twice, and reads back the Program ID and the date.

        A board reports only Program ID and date. Two outcomes show that a board already has the program. ``up-to-date``: the inventory file
        (without a file: this chain) also records that the same bytes were written to the same address, and the board is skipped.
        ``program-up-to-date``: this record is missing. Without this record, no image is sent, and an error is raised unless ``unverified``
        is true. After a failure, the same call continues from the point of failure.

        Ctrl-C and an exception of ``progress`` cancel the update. The notes of the exception (Python 3.11) and `events` (``updated``)
        contain the result of each board.

        Args:
            image: Intel HEX, S-record or raw bytes of a ``.bin``, as a file; or the content of such a file.
            boards: A single board by its number. Several boards require an inventory (`init`, or a file in `connect`).
            flash_number: Required flash number of the single board.
            second: Image of the other cycle, if the profile's ``prog.plan`` sends two images.
            raw: Reads a file with any name as raw bytes. Files with records are never read as raw bytes, and text is read only from a
                ``.bin``.
            addresses: Unit of the addresses in records, if the file does not show it.
            fill_gaps: Fills gaps between records with bytes FF.
            date: Flash date; None: today, UTC. A board that already has the program keeps its date.
            expect_program_id: Program ID that the boards must show at the end.
            name_target: Writes the board into the header of the image, so that any other board refuses the image.
            group: Updates all boards with one transfer, by broadcast.
            start: Starts the application at the end. Closing the chain stops the application, as after `start`.
            dry_run: Runs only the checks of the update. No frame that changes a board is sent.
            unverified: Accepts boards whose image cannot be verified, including ``program-up-to-date``.
            force: Continues even if boards run, another PC is on the bus, or the board already has the program.
            rewrite: Updates a board that already has the program. All checks are still made.
            check: True raises an error if a board was not updated; False: the failure is only in the report.
            progress: Function that is called with each `Progress`; True: progress is shown in a line on stderr, if it is a terminal.

        Raises:
            RefusedError, NoLinkError, DeviceError: No board was erased.
            FaultError: A board was erased. Run the update again.
        """
        today = datetime.datetime.now(datetime.timezone.utc).date()
        asked = None if date is None else (date.year, date.month, date.day)
        flags = [raw, fill_gaps, name_target, group, start, dry_run, unverified, force, rewrite, check]
        value = self._native.update(
            self._list(boards),
            _image(image),
            _image(second),
            flash_number,
            (asked, (today.year, today.month, today.day)),
            addresses,
            expect_program_id,
            flags,
            _reporter(progress),
        )
        return UpdateReport._of(value)


def _reporter(progress: Callable[[Progress], None] | bool) -> Callable[[dict[str, Any]], None] | None:
    if progress is True and (sys.stderr is None or not sys.stderr.isatty()):
        return None
    if isinstance(progress, bool):
        return _print_progress if progress else None
    report = progress
    return lambda value: report(Progress._of(value))


def _print_progress(value: dict[str, Any]) -> None:
    step = Progress._of(value)
    boards, what = ", ".join(map(str, step.boards)), "checking" if step.cycle == 1 else "writing"
    share, end = step.bytes / max(step.total_bytes, 1), "\n" if step.bytes >= step.total_bytes else ""
    text = f"\rboard {boards}: {what} {share:4.0%}, {step.rate / 1000:.1f} kB/s, {step.remaining_s:.0f} s left "
    # A lost terminal or a closed stderr must not cancel the update.
    with contextlib.suppress(OSError, ValueError):
        print(text, end=end, file=sys.stderr, flush=True)
