"""Checks simulated boards with a raw-frame peer on python-can's socketcand interface, row by row of the protocol's tests.

Argument: the `ucom` program. Exit code 0: all agreed. The peer packs every byte by itself; nothing here comes from the
project's code. The rows of updates are in `boards_update.py`.
"""

import time

import boards_update
import rows
import wire
from boards_bench import chain_of, five, give_numbers, start, status
from rows import Bench

REPORTS = ["404#04", "441#21", "482#42", "4C3#63", "4DF#7F"]


def identity(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        peer.all(0.4)
        began = peer.send("000#")
        reports, last = [], 0.0
        while (frame := peer.next(1.0)) is not None:
            reports.append(frame)
            last = peer.stamp - began
        bench.same("D-T1", "reports", sorted(reports), REPORTS)
        late = bench.jitter.worst(began, began + last)
        bench.within("D-T1", "the last report", last, 0.0, 0.5 * rows.BENCH + late)
        bench.ok("D-T1")
        for frame in ("201#", "2C1#0000000000000000", "301#", "541#", "581#", "5C1#", "601#01000000"):
            bench.same("D-T3", f"answers to {frame}", peer.ask(frame, 0.1), [])
        bench.ok("D-T3")
        give_numbers(bench, peer, 1)
        for _ in range(2):
            bench.same("D-T2", "reports", sorted(peer.ask("240#", 0.6)), REPORTS)
        info = peer.answer("201#", "141#")
        flash = wire.word(bench.order, 0x21).hex().upper()
        bench.expect(info.startswith(f"141#{flash}011B"), "D-T2", "number and status as before", info)
        bench.ok("D-T2")


def numbers(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        peer.ask("000#", 0.6)
        bench.same("D-T4", "acknowledgement", peer.answer("281#", "0"), "0C1#01")
        bench.same("D-T4", "without a number", peer.ask("202#", 0.15), [])
        bench.same("D-T4", "the pin of board 1 is off, so", peer.ask("282#", 0.15), [])
        peer.ask("1C1#0202", 0.05)
        bench.same("D-T4", "acknowledgement", peer.answer("282#", "0"), "0C2#02")
        bench.ok("D-T4")
        bench.same("D-T5", "again, and nobody else:", peer.ask("281#", 0.3), ["0C1#01"])
        bench.ok("D-T5")


def bits(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 1)
        bench.same("D-T6", "status", status(peer, 1), "1B")
        peer.ask("1C1#0040", 0.05)
        bench.same("D-T6", "the second byte is not masked:", status(peer, 1), "5B")
        peer.ask("1C1#4000", 0.05)
        bench.same("D-T6", "status", status(peer, 1), "1B")
        bench.ok("D-T6")
        for frame in ("1C1#0100", "1C1#1000", "1C1#2020"):
            peer.ask(frame, 0.05)
            bench.same("D-T7", f"mirror bits after {frame}:", status(peer, 1), "1B")
        bench.ok("D-T7")


def walk(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 1)
        steps = [("041#", "", "1F"), ("301#", "501#", "8B"), ("541#", "601#01000000", "AB"),
                 ("601#00000000", "601#00000000", "8B"), ("1C1#8000", "", "1B")]
        seen = [status(peer, 1)]
        for frame, answer, _ in steps:
            began = peer.send(frame)
            if answer:
                bench.same("D-T9" if frame == "301#" else "D-T8", f"answer to {frame}", peer.wait(answer), answer)
                late = bench.jitter.worst(began, peer.stamp)
                bench.within("D-T9", answer, peer.stamp - began, 0.0, 2.0 * rows.BENCH + late)
            peer.all(0.1)
            seen.append(status(peer, 1))
        bench.same("D-T8", "status bytes", seen, ["1B", *(after for _, _, after in steps)])
        peer.ask("1C1#0800", 0.1)
        bench.same("D-T8", "without a number", peer.ask("201#", 0.2), [])
        bench.ok("D-T8")
    text = "".join(f"[[board]]\nflash_id = {i}\napplication = {'false' if i == 1 else 'true'}\n" for i in (1, 2))
    with chain_of(bench, text) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 1)
        bench.same("D-T9", "a start without an application", peer.ask("301#", 0.5), ["081#0B"])
        bench.ok("D-T9")


def process_data(bench: Bench) -> None:
    order = bench.order
    with five(bench) as chain, chain.peer() as peer:
        start(bench, peer)
        head = peer.answer("581#", "581#")
        dimensions = b"".join(wire.word(order, n) for n in (3, 5, 5))
        bench.same("D-T10", "dimensions", head, wire.frame(22, 1, dimensions))
        frames = [frame for frame in peer.all(1.0) if frame.startswith("581#")]
        texts = wire.texts(order, [wire.parts(frame)[2] for frame in frames])
        bench.same("D-T10", "strings: 1 + CI + SO + PAR =", len(texts), 1 + 3 + 5 + 5)
        bench.expect(texts[1].startswith("set_position"), "D-T10", "the names of the CI after the description", texts)
        answers = [frame for frame in peer.ask("581#00", 0.2) if frame.startswith("581")]
        bench.same("D-T10", "with data it is no request:", answers, [])
        bench.ok("D-T10")
        frames = [f for f in peer.ask("5C1#", 0.3) if f.startswith("6C1")]
        bench.same("D-T11", "initial inputs", frames, [wire.frame(27, 1, wire.package(order, 0, 0, 1000, 900))])
        late = wire.frame(13, 1, wire.package(order, 3, 7))
        bench.same("D-T12", "an index at the dimension:", peer.answer(late, "081"), "081#05")
        surplus = wire.frame(13, 1, wire.package(order, 2, 900, 7, 7))
        bench.same("D-T12", "words beyond it:", [f for f in peer.ask(surplus, 0.15) if f.startswith("081")], [])
        bench.ok("D-T12")
        odd = [f for f in peer.ask("601#02000000", 0.15) if f.startswith(("601", "081"))]
        bench.same("D-T15", "flags other than 0 and 1 are ignored:", odd, [])
        bench.same("D-T15", "three bytes:", peer.answer("601#000000", "081"), "081#07")
        bench.ok("D-T15")
    text = '[[board]]\nflash_id = 1\naxis = [{ name = "a" }, { name = "b" }, { name = "c" }]\n'
    with chain_of(bench, text) as chain, chain.peer() as peer:
        start(bench, peer)
        frames = [f for f in peer.ask("5C1#", 0.3) if f.startswith("6C1")]
        axis = [0, 1000, 900]
        bench.same("D-T11", "nine words", frames, [wire.frame(27, 1, p) for p in wire.packages(order, axis * 3)])
    text = text.replace(', { name = "c" }', "")
    with chain_of(bench, text) as chain, chain.peer() as peer:
        start(bench, peer)
        # With ten outputs, the last of four packages contains one output, and its other two words are 0.
        peer.send("680#")
        peer.send("541#")
        last = peer.wait("381#" + wire.word(order, 9).hex().upper())
        bench.expect(last[-8:] == "00000000", "D-T11", "words beyond the dimension are 0", last)
        bench.ok("D-T11")


def life_signs_missing(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        start(bench, peer)
        peer.send("680#")
        began = peer.send("541#")
        bench.same("D-T13", "flags", peer.wait("601#01"), "601#01000000")
        bench.expect(peer.wait("381#") != "", "D-T13", "outputs", "none")
        bench.same("D-T13", "safe:", peer.wait("601#00"), "601#00000000")
        lost = peer.stamp - began
        late = bench.jitter.worst(began, peer.stamp)
        bench.within("D-T13", "safe", lost, 1.5 / rows.BENCH - late, 1.5 * rows.BENCH + late)
        outputs = [f for f in peer.all(0.2) + peer.ask("680#", 0.3) if f.startswith("381")]
        bench.same("D-T13", "stopped, and heartbeats alone start nothing:", outputs, [])
        bench.same("D-T13", "a start does:", peer.answer("541#", "601#"), "601#01000000")
        bench.ok("D-T13", f"safe after {lost:.2f} s")


def life_signs(bench: Bench) -> None:
    """Checks D-T14 for a complete minute."""
    with five(bench) as chain, chain.peer() as peer:
        start(bench, peer)
        sent = [peer.send("680#")]
        peer.send("541#")
        bench.same("D-T14", "flags", peer.wait("601#"), "601#01000000")
        # A heartbeat is sent every 500 ms for a minute; then one is missing.
        due, stops, outputs = time.monotonic(), [], 0
        for step in [1] * 120 + [2, 1]:
            due += 0.5 * step
            while (left := due - time.monotonic()) > 0:
                frame = peer.next(left) or ""
                outputs += frame.startswith("381")
                if frame == "601#00000000":
                    stops.append(peer.stamp)
            sent.append(peer.send("680#"))
        gaps = sorted(after - before for before, after in zip(sent, sent[1:]))
        # If a pause is near the limit, this peer was too late, so the row says nothing about the board.
        if gaps[-1] < 1.4:
            bench.same("D-T14", "stops in a minute, and with one heartbeat missing:", stops, [])
        bench.expect(outputs > 60 * 100, "D-T14", "two packages of outputs every 10 ms", f"{outputs} in a minute")
        bench.same("D-T14", "three missing: flags", peer.wait("601#00000000", seconds=4.0), "601#00000000")
        safe, late = peer.stamp - sent[-1], bench.jitter.worst(sent[-1], peer.stamp)
        bench.within("D-T14", "three missing: safe", safe, 0.0, 1.5 * rows.BENCH + late)
        bench.ok("D-T14", f"{len(sent)} heartbeats, longest pause {gaps[-1]:.2f} s, safe after {safe:.2f} s")


def autostart(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        give_numbers(bench, peer, 1)
        peer.ask("1C1#4040", 0.05)
        peer.ask("000#", 0.6)
        began = peer.send("281#")
        bench.same("D-T16", "acknowledgement", peer.wait("0C1"), "0C1#01")
        heard = peer.all(0.25)
        pause = peer.send("041#") - began
        heard += peer.all(1.0)
        if pause < 0.4:
            bench.expect("501#" not in heard and status(peer, 1) == "5D", "D-T16", "the exloader keeps it", heard)
        bench.ok("D-T16", f"PC_XRESET after {pause * 1e3:.0f} ms")
        peer.ask("1C1#0400", 0.05)
        peer.ask("000#", 0.6)
        began = peer.send("281#")
        bench.same("D-25", "without PC_XRESET it starts by itself:", peer.wait("501#", seconds=5.0), "501#")
        started, late = peer.stamp - began, bench.jitter.worst(began, peer.stamp)
        bench.within("D-25", "the application", started, 0.5 / rows.BENCH - late, 0.5 * rows.BENCH + 2.0 + late)
        peer.ask("1C1#4000", 0.05)


def held_acknowledge(bench: Bench) -> None:
    with five(bench) as chain, chain.peer() as peer:
        peer.ask("000#", 0.6)
        chain.fault("ack-held board=1 for_s=0.8")
        heard = peer.ask("281#", 0.1) + peer.ask("281#", 0.1) + peer.all(1.2)
        bench.same("D-T20", "one acknowledgement, one error:", sorted(heard), ["080#09", "0C1#01"])
        peer.ask("1C1#0202", 0.05)
        bench.same("D-T20", "the next one is number 2:", peer.ask("282#", 0.3), ["0C2#02"])
        headers = [frame for frame in peer.ask("201#", 0.3) if len(wire.parts(frame)[2]) == 2]
        bench.same("D-T20", "boards that describe themselves as number 1:", len(headers), 1)
        bench.ok("D-T20")


def equal_flash(bench: Bench) -> None:
    with bench.chain("--boards", "2", "--flash-ids", "0x21,0x21") as chain, chain.peer() as peer:
        peer.all(0.3)
        reports = peer.ask("000#", 0.6)
        bench.expect(reports in (["441#21"], ["441#21", "441#21"]), "D-T21", "one visible report", reports)
        init = chain.start("init", "--renew")
        code, said = init.end(), init.said()
        findings = " ".join(said["findings"])
        bench.expect(code != 0 and "more boards" in findings, "D-T21", "more boards than reports", said)
        bench.ok("D-T21")


if __name__ == "__main__":
    rows.main([life_signs, *boards_update.ROWS, process_data, identity, numbers, bits, walk, life_signs_missing,
               autostart, held_acknowledge, equal_flash])
