"""Tests of boards by name on a simulated chain; a separate client observes the bus."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ucom_bus import ACTIVE, ADMIN_TO, SAFE, Bus, bus, numbered, numbered_bus, sim  # noqa: F401  # fixtures

from openjtc import errors, ucom

HEAD = """
[[board]]
flash_id = 0x21
[[board]]
flash_id = 0x22
[[board]]
flash_id = 0x23
"""


def test_a_chain_is_numbered_listed_and_driven_by_name(sim: ucom.SimulatedChain, bus: Bus) -> None:
    with ucom.connect(sim, names={"neck": 1}) as chain:
        assert chain.scan().boards == () and len(chain.scan().reports) == 3
        with pytest.raises(errors.NoLinkError) as no_numbers:
            chain.start()
        assert no_numbers.value.code == "no-numbers" and "ucom init" in no_numbers.value.next
        report = chain.init()
        assert [board.number for board in report.boards] == [1, 2, 3] and not report.findings
        one = chain.boards[1]
        assert one.description == "UCoM2 neck yaw" and one.flash_number == 0x21 and "INIT" in one.status
        assert chain.start(1)[1].state == "started" and bus.started(1) and not bus.runs(1)
        position = one.signals.outputs[0]
        assert (position.name, position.text, position.type) == ("position", "position [0.01 deg]", "int16")
        running = chain.run([1, 2], active=True, inputs={"neck.set_position": 1500}, parameters={"kp": 100})
        assert running.boards == (1, 2) and running.active and 0 < running.load_percent < running.load_limit_percent
        assert bus.runs(1) and bus.runs(2) and not bus.started(3)
        bus.wait(lambda: abs(float(chain["neck.position"] or 0) - 1500) < 60)
        chain["1.set_position"] = -500
        assert chain.set("neck.set_position", "-500") == -500 == chain["1.set_position"]
        bus.wait(lambda: abs(float(chain["neck.position"] or 0) + 500) < 60)
        assert chain["neck.kp"] == 100 and chain["neck.kd"] is None, "parameters cannot be read back"
        values = chain.values()
        assert len(values) == 10 and abs(float(values["1.position"] or 0) + 500) < 60
        of_one = chain.boards[1].values()
        assert of_one.array.shape == (5,) and not of_one.stale and of_one.age_s is not None and of_one.age_s < 0.5
        assert list(of_one.outputs) == ["position", "velocity", "current", "temperature", "reference"]
        assert chain.bus().is_master and chain.bus().load_percent > 0
    assert not bus.started(1) and not bus.started(2), "stopped at the end of the context"


def test_what_cannot_be_says_why_and_what_helps(numbered: ucom.SimulatedChain) -> None:
    with ucom.connect(numbered) as chain:
        with pytest.raises(errors.RefusedError) as refused:
            chain.signals(2)
        assert (refused.value.code, refused.value.board, refused.value.next) == ("no-application", 2, "ucom start 2")
        with pytest.raises(errors.NoLinkError) as silent:
            chain.info(7)
        assert silent.value.code == "no-answer" and silent.value.board == 7
        chain.start(1)
        with pytest.raises(errors.UsageError) as unknown:
            chain["1.set_positon"] = 3
        assert unknown.value.code == "no-edge" and "set_position" in str(unknown.value)
        with pytest.raises(errors.RefusedError) as range_:
            chain.set("1.set_position", 40_000)
        assert (range_.value.value, range_.value.limit, range_.value.board) == (40_000, 32_767, 1)
        with pytest.raises(errors.NoLinkError) as none:
            chain["1.position"]
        assert none.value.code == "no-outputs"
        with pytest.raises(errors.UsageError):
            chain.info("everyone")
        with pytest.raises(errors.UsageError):
            chain.update(Path("none.hex"), 1)
    with pytest.raises(errors.NoLinkError) as closed:
        chain.scan()
    assert closed.value.code == "closed"


def test_urls_that_are_none() -> None:
    for url in ("nothing", "http://127.0.0.1:8781", "sim:none.toml"):
        with pytest.raises(errors.UsageError):
            ucom.connect(url)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(errors.NoLinkError):
        ucom.connect(f"socketcand:127.0.0.1:{port}/can0")


def test_units_come_from_a_signal_table(numbered: ucom.SimulatedChain, tmp_path: Path) -> None:
    with ucom.connect(numbered) as chain:
        program = chain.boards[1].program_id
    table = tmp_path / "table.toml"
    table.write_text(
        f"[[program]]\nprogram_id = 0x{program:04X}\n"
        '[program.ci]\n"set_position" = { scale = 0.01, unit = "deg", min = -60, max = 60 }\n'
        '[program.so]\n"position" = { scale = 0.01, unit = "deg" }\n'
    )
    with ucom.connect(numbered, signals=table) as chain:
        chain.run(1, active=True, inputs={"set_position": "15 deg"})
        assert chain.boards[1].signals.inputs[0].maximum == 60
        assert chain["1.set_position"] == 15 and chain.board_values(1)[1].units["position"] == "deg"
        assert chain.set("1.set_position", 20.004, unit="deg") == 20.0
        with pytest.raises(errors.RefusedError, match="unit is missing"):
            chain["1.set_position"] = 15
        with pytest.raises(errors.RefusedError) as outside:
            chain["1.set_position"] = "61 deg"
        assert (outside.value.value, outside.value.limit) == (61, 60)


def test_samples_become_tables(numbered: ucom.SimulatedChain) -> None:
    with ucom.connect(numbered) as chain:
        chain.run("1-2")
        samples = list(chain.monitor(count=40))
        assert len(samples) == 40 and {sample.board for sample in samples} == {1, 2}
        tables = ucom.to_numpy(samples)
        assert tables[1].values.shape == (len(tables[1].time_s), 5) and tables[1].names[0] == "position"
        assert np.all(np.diff(tables[1].time_s) > 0)
        only = chain.monitor(2, seconds=0.2).to_numpy()
        assert set(only) == {2}
        pandas = pytest.importorskip("pandas")
        frame = chain.monitor(1, count=5).to_pandas()
        assert isinstance(frame, pandas.DataFrame) and list(frame.columns)[:3] == ["time_s", "board", "position"]
        assert len(frame) == 5 and len(ucom.to_pandas([])) == 0


def test_d62_what_nobody_has_written_here_is_not_verified(numbered: ucom.SimulatedChain, tmp_path: Path) -> None:
    image = bytes((37 * i + 11) % 256 for i in range(1000))
    with ucom.connect(numbered) as chain:
        assert chain.update(image, 1).boards[0].outcome == "verified"
    with ucom.connect(numbered) as chain:
        report = chain.update(image, 1, check=False)
        assert (report.boards[0].outcome, report.verified) == ("program-up-to-date", False)
        with pytest.raises(errors.RefusedError, match="nothing was sent"):
            chain.update(image, 1)
        accepted = chain.update(image, 1, unverified=True)
        assert (accepted.boards[0].outcome, accepted.verified) == ("program-up-to-date", False)
        assert chain.update(image, 1, rewrite=True).boards[0].outcome == "verified"
        with pytest.raises(errors.UsageError, match="these characters are not a program"):
            chain.update(b":00000001FF\n", 1, raw=True)


def test_an_update_is_proved_by_the_board(numbered: ucom.SimulatedChain, numbered_bus: Bus, tmp_path: Path) -> None:
    image = tmp_path / "image.bin"
    image.write_bytes(bytes((37 * i + 11) % 256 for i in range(1000)))
    with ucom.connect(numbered) as chain:
        steps: list[ucom.Progress] = []
        planned = chain.update(image, 2, dry_run=True, progress=steps.append)
        assert planned.dry_run and planned.boards[0].outcome == "not-started" and not steps
        done = chain.update(image, 2, progress=steps.append)
        # The golden update of the protocol's page: 1000 bytes have the Program ID 0x4B3F.
        assert done.verified and done.program_id == 0x4B3F and done.bytes == 2 * 17 * 64
        (result,) = done.boards
        assert (result.outcome, result.after[0], result.error) == ("verified", 0x4B3F, "")
        assert result.before[0] != 0x4B3F and result.flash_number == chain.boards[2].flash_number
        assert steps[-1].bytes == steps[-1].total_bytes and {step.cycle for step in steps} == {1, 2}
        again = chain.update(image, 2).boards[0]
        assert (again.outcome, again.verified, again.note) == ("up-to-date", True, "same Program ID and date")
        before = len(numbered_bus.frames)
        assert numbered_bus.status(2) is not None
        answer = next(data for identifier, data in numbered_bus.frames[before:] if identifier == 0x142)
        assert 0x4B3F in (int.from_bytes(answer[4:6], "little"), int.from_bytes(answer[4:6], "big"))
        with pytest.raises(errors.RefusedError) as other:
            chain.update(image.read_bytes(), 1, flash_number=0x7777, raw=True)
        assert other.value.code == "wrong-board" and other.value.board == 1
        kept = chain.update(image, 1, flash_number=0x7777, check=False)
        assert not kept.verified and "0x7777" in kept.boards[0].error


def test_outputs_and_single_acts(sim: ucom.SimulatedChain, bus: Bus) -> None:
    with ucom.connect(sim) as chain:
        chain.init()
        chain.run(1)
        assert not bus.came(ADMIN_TO + 1, ACTIVE)
        chain.outputs(True)
        enabled = bus.when(ADMIN_TO + 1, ACTIVE)
        before = len(bus.frames)
        chain.outputs(False)
        assert bus.when(ADMIN_TO + 1, SAFE, before) > enabled
        before = len(bus.frames)
        bus.wait(lambda: len(chain.values()) == 5 and any(one == 0x381 for one, _ in bus.frames[before:]))
        assert chain.stop(1, application=False)[1].state == "started"
        assert chain.stop(1)[1].state == "exloader"
        assert "ASTART" in chain.status(2, set=["ASTART"])[2].status
        assert "ASTART" not in chain.status(2, clear=["ASTART"])[2].status
        assert chain.xreset(2)[2].state == "programming"
        assert len(chain.reset(3)) == 1
        assert chain.repair(3).number == 3
        assert chain.reset() == tuple(sorted(chain.scan().reports))


def test_parameters_go_to_files_and_back(numbered: ucom.SimulatedChain, tmp_path: Path) -> None:
    file, cache = tmp_path / "parameters.yaml", tmp_path / "cache"
    with ucom.connect(numbered, cache=cache) as chain:
        chain.start()
        chain.set("2.kp", 77)
        assert chain["2.kp"] == 77 and chain.initial_inputs(2)["stiffness"] == 1000
        chain.save_parameters(file)
        assert "kp: 0x004D" in file.read_text()
        assert chain.apply_parameters(file, dry_run=True) == 1 == chain.apply_parameters(file)
        chain.stop()
        chain.run(2, file=file)
        assert chain["2.kp"] == 77


def test_inventories_name_boards_and_are_compared_with(tmp_path: Path) -> None:
    file = tmp_path / "inventory.toml"
    chain_file = tmp_path / "chain.toml"
    chain_file.write_text(HEAD)
    with ucom.connect(f"sim:{chain_file}", inventory=file) as chain:
        chain.init()
        assert chain.simulated is not None and chain.simulated.board_count == len(chain.boards) == 3
    text = file.read_text()
    assert text.count("[[board]]") == 3
    file.write_text(text.replace("number = 2\n", 'number = 2\nname = "nod"\n'))
    simulated = ucom.sim(boards=2)
    with ucom.connect(simulated, inventory=file) as chain:
        with pytest.raises(errors.DeviceError, match="missing"):
            chain.init()
        chain.init(renew=True)
        assert chain.boards[2].name == "nod" and file.read_text().count("[[board]]") == 2
        chain.run("nod", active=True, inputs={"nod.set_position": 300})
        bus_value = chain["NOD.set_position"]
        assert bus_value == 300
    # Names of the inventory are known before the first scan; "all" is never a name, even if an inventory has it.
    file.write_text(file.read_text().replace('name = "nod"', 'name = "all"'))
    with ucom.connect(simulated, inventory=file) as chain:
        assert set(chain.info("all")) == {1, 2} == set(chain.boards)
    file.write_text(file.read_text().replace('name = "all"', 'name = "nod"'))
    with ucom.connect(simulated, inventory=file) as chain:
        assert chain.start("nod")[2].state == "started"
        chain.stop()
        # Another program has exchanged the names and added a board; `init` still numbers the chain again.
        text = file.read_text().replace('name = "nod"\n', "")
        text = text.replace("number = 1\n", 'number = 1\nname = "nod"\n')
        file.write_text(text + "[[board]]\nnumber = 3\nflash_number = 0x77\n")
        with pytest.raises(errors.DeviceError):
            chain.init()
        assert set(chain.start("nod")) == {1}
    simulated.end()


def test_recordings_have_every_frame(sim: ucom.SimulatedChain, bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    with ucom.connect(sim) as chain:
        with chain.record(path) as recording:
            chain.init()
            with pytest.raises(errors.UsageError):
                chain.record(tmp_path / "other.log")
        with pytest.raises(errors.UsageError, match="already exists"):
            chain.record(path)
        with pytest.raises(errors.UsageError, match="ending .txt are not supported"):
            chain.record(tmp_path / "bus.txt")
    lines = path.read_text().splitlines()
    frames = [(int(found[1], 16), bytes.fromhex(found[2])) for found in (
        re.search(r" ([0-9A-F]{3})#([0-9A-F]*)", line) for line in lines) if found]
    assert len(frames) == recording.frames > 20
    seen = bus.frames[:]
    assert all(frame in seen for frame in frames), "the other client saw each, this chain's own among them"


def test_probe_and_conformance(numbered: ucom.SimulatedChain, numbered_bus: Bus) -> None:
    with ucom.connect(numbered) as chain:
        assert chain.probe().boards == (1, 2, 3)
        report = chain.conformance(1)
        assert report.tests and not report.failed and not report.left
        # The chain keeps its profile, and its boards are unchanged.
        chain.run(1)
        for asked in ({"alive": True}, {"init": True}):
            with pytest.raises(errors.RefusedError) as runs:
                chain.probe(**asked)
            assert (runs.value.code, runs.value.board) == ("running", 1)
        before = len(numbered_bus.frames)
        numbered_bus.wait(lambda: any(identifier == 0x381 for identifier, _ in numbered_bus.frames[before:]))
        chain.stop()
        measured = {row.key: row.decision for row in chain.probe(alive=True).rows if row.measured}
        assert measured["alive.mode"] == "broadcast" and chain.info(1)[1].state == "exloader"
        assert chain.probe(init=True).boards == (1, 2, 3) and chain.boards[1].number == 1


def test_the_example_runs(capfd: pytest.CaptureFixture[str]) -> None:
    example = os.environ.get("OPENJTC_EXAMPLES")
    path = Path(example) if example else Path(__file__).parent.parent / "examples"
    if not (path / "ucom_chain.py").exists():
        pytest.skip("the examples are not here")
    done = subprocess.run([sys.executable, str(path / "ucom_chain.py")], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "10 boards" in done.stdout and re.search(r"moved from -?0\.\d to 1[45]\.\d degrees", done.stdout), done.stdout
