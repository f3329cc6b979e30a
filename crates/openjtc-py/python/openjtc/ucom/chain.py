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

    A thread of its own owns the session: it sends heartbeats for what this chain has started, supervises the boards, and takes one
    call after the other. Calls may come from any thread; they let other Python threads run. A context manager: at its end
    control loops, then applications that this chain has started are stopped, as ``ucom`` does. So does Ctrl-C while a call waits,
    before `KeyboardInterrupt` is raised, and the end of a program that has not closed its chain. One that is killed sends no
    heartbeats any more, and the boards make their outputs safe by themselves after 1.5 s.

    Inputs and outputs have names ``BOARD.SIGNAL``, the board by its number or its name (``"2.position"``, ``"gripper.position"``),
    or the signal's name alone where only one board has it.

    Every method may raise:
        NoLinkError: The bus is gone, or a board does not answer (``.board``).
        RefusedError: Another PC is master of the bus (``foreign-master``), or a check refuses it; nothing was changed.
        DeviceError: A board reports an error.
        FaultError: It went wrong on the way, or was cancelled.
    ``.next`` of an error names commands of ``ucom``; methods of the same name do the same here.
    """

    # Who is there.

    def init(self, *, renew: bool = False, force: bool = False, check: bool = True) -> ScanReport:
        """Resets all boards and gives them numbers along the init wire; their outputs become safe by that.

        The result is the inventory that updates of several boards go by. With an inventory file in `connect` it is compared with
        that file, and written to it where all is well.

        Args:
            renew: Write the inventory anew, whatever stood in it.
            force: Also when another PC is on the bus.
            check: Raise an error for findings; otherwise they are in the report.

        Raises:
            DeviceError: Boards are missing, in another order, or not reached (``init``).
            NoLinkError: No board reported (``init``).
        """
        # However it ends: names must not stand for the boards that had these numbers before.
        self._forget_boards()
        value = self._native.init(renew, force, check)
        return ScanReport(self._keep(value["boards"]), tuple(value["reports"]), tuple(value["findings"]))

    def info(self, boards: Boards = "all") -> dict[int, Board]:
        """What boards report about themselves now."""
        return self._seen(self._native.info(self._list(boards)), whole=True)

    def status(
        self, boards: Boards = "all", *, set: Sequence[str] = (), clear: Sequence[str] = (), force: bool = False
    ) -> dict[int, Board]:
        """Status of boards, after setting and clearing bits of it by name (``ASTART``, ``OPINIT``, …), with read-back."""
        return self._seen(self._native.status(self._list(boards), list(set), list(clear), force))

    def repair(self, board: int | str, *, flash_number: int | None = None, force: bool = False) -> Board:
        """Gives one board its number back; the others keep theirs.

        Args:
            board: The number.
            flash_number: Of the board that must stand there; None: as the inventory has it.
            force: Also when another PC is on the bus.
        """
        value = self._native.repair(self._number(board), flash_number, force)
        return self._seen([value])[value["number"]]

    # Applications and control loops.

    def start(self, boards: Boards = "all", *, force: bool = False) -> dict[int, Board]:
        """Starts applications; nothing moves by that. They are stopped when the chain is closed."""
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
        """Starts applications, writes parameters and inputs, then starts control loops, and supervises them from now on.

        Args:
            boards: Which.
            active: Enable the outputs: **things move**.
            inputs: Inputs to begin with, by ``BOARD.NAME``, or by name for all of them.
            parameters: Parameters to begin with, likewise.
            file: A parameter file, YAML, as ``ucom par --save`` and `save_parameters` write it.
            texts: Have the boards send the texts of their applications: events of the kind ``text``.
            force: Also when the bus would be too busy, or another PC is on it.

        Raises:
            RefusedError: A value is out of range (``value``, with ``.value`` and ``.limit``), the load of the bus too high
                (``load``), or another check refuses it. What was begun is taken back.
        """
        path = None if file is None else os.fspath(file)
        first, wanted = self._given(inputs or {}), self._given(parameters or {})
        value = self._native.run(self._list(boards), active, first, wanted, path, texts, force)
        return RunReport(
            tuple(value["boards"]), value["active"], value["load_percent"], value["load_limit_percent"]
        )

    def outputs(self, active: bool, boards: Boards = "all") -> None:
        """Enables the outputs of boards that run, or makes them safe; ``all`` are those that this chain runs."""
        self._native.outputs(self._list(boards), active)

    def stop(self, boards: Boards = "all", *, application: bool = True) -> dict[int, Board]:
        """Stops boards, whoever has started them: control loops at once, then what each confirms.

        It goes before whatever another thread does on this chain: that ends with the error ``cancelled``, but for an update, which
        goes on. Stopping is always allowed, also with another PC on the bus.

        Args:
            boards: Which; ``all`` by broadcast.
            application: End applications, too; otherwise only control loops.

        Raises:
            FaultError, NoLinkError: Boards are not stopped for certain.
        """
        return self._seen(self._native.stop(self._list(boards), application))

    def reset(self, boards: Boards = "all", *, force: bool = False) -> tuple[int, ...]:
        """Resets boards: outputs become safe, and their numbers are gone until `init` or `repair`.

        Returns:
            Low bytes of the flash numbers of those that reported.
        """
        reports = self._native.reset(self._list(boards), force)
        self._boards.clear()
        return tuple(reports)

    def xreset(self, boards: Boards, *, force: bool = False) -> dict[int, Board]:
        """Resets boards into their exloaders, with programming enabled."""
        return self._seen(self._native.xreset(self._list(boards), force))

    # What is wrong.

    def doctor(self) -> Examination:
        """Listens to the bus for 1.5 s, asks who is there unless another PC is its master, and reports what is wrong."""
        value = self._native.doctor()
        findings = tuple(Finding(**finding) for finding in value["findings"])
        return Examination(value["healthy"], findings, tuple(Board._of(one, self) for one in value["boards"]))

    def probe(
        self, *, init: bool = False, alive: bool = False, image: _Path | None = None, force: bool = False
    ) -> ProbeReport:
        """Measures how the boards read what the published protocol leaves open, by harmless questions.

        The chain goes on with the profile that it has: what was measured counts for those that are connected with it.

        Args:
            init: Also what shows only while numbers are given: resets and numbers the chain.
            alive: Start a control loop, outputs safe, to see which heartbeats count; it is stopped again.
            image: An image that is on a board, to find the checksum of Program IDs.
            force: Also when another PC is on the bus, or, with ``init`` or ``alive``, control loops run, which end by that.

        Raises:
            RefusedError: With ``init`` or ``alive``: control loops run (``running``), which would end by that.
        """
        if init:
            # However it ends: names must not stand for the boards that had these numbers before.
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
        """Tests whether boards keep to the protocol; without ``init`` and ``run`` by harmless requests alone.

        Args:
            boards: Which.
            init: Also tests that reset and number the chain anew.
            run: Also tests that start control loops, outputs safe; more than a minute a board.
            only: Only these tests, as ``D-T10``.
            force: Also when another PC is on the bus.
        """
        return ConformanceReport._of(self._native.conformance(self._list(boards), init, run, list(only), force))

    # Firmware.

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
        """Updates the firmware of boards: the image is checked, transferred twice, and read back by its Program ID and date.

        A board shows Program ID and date only. It is skipped as ``up-to-date`` if the inventory file (without one: this chain)
        also has it that the same bytes were written to the same address. Without that it is ``program-up-to-date``: nothing is
        sent, and an error is raised unless ``unverified``. After a failure the same call goes on where it ended. Ctrl-C and an
        exception of ``progress`` cancel it; what became of each board is in the notes of the exception (Python 3.11), and in
        `events` (``updated``).

        Args:
            image: Intel HEX, S-record or raw bytes of a ``.bin``, as a file; or the content of such a file.
            boards: One board by its number, several by an inventory (`init`, or a file in `connect`).
            flash_number: The flash number that the one board must have.
            second: What the other cycle carries, where the profile's ``prog.plan`` sends two images.
            raw: Take a file of any name as raw bytes; never records, and text only from a ``.bin``.
            addresses: What addresses of records count, where that cannot be seen.
            fill_gaps: Fill gaps between records with FF.
            date: Flash date; None: today, UTC, and a board that shows the program keeps its date.
            expect_program_id: Program ID that the boards must show at the end.
            name_target: The header names the board: another one refuses the image.
            group: All boards with one transfer, by broadcast.
            start: Start the application at the end; like what `start` has started it is stopped when the chain is closed.
            dry_run: Only the checks; nothing is sent that changes a board.
            unverified: What cannot be verified is as good as what was: also ``program-up-to-date``.
            force: Also when boards run, another PC is on the bus, or the board shows the program already.
            rewrite: Also when the board shows the program already; lifts no check.
            check: Raise an error where a board was not updated; otherwise it is in the report.
            progress: Called with each `Progress`; True: a line on a terminal's stderr.

        Raises:
            RefusedError, NoLinkError, DeviceError: Nothing was erased.
            FaultError: Something was erased: run it again.
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
    # A terminal that has gone, or a stderr that was closed, is no reason to cancel the update.
    with contextlib.suppress(OSError, ValueError):
        print(text, end=end, file=sys.stderr, flush=True)
