"""Simulated boards against a raw-frame peer on python-can's socketcand interface, row by row of the protocol's tests.

Argument: the `ucom` program. Exit code 0: all agreed. The peer packs every byte by itself; nothing here comes from the
project's code.
"""

import sys
import time

from peer import Chain, Peer

FLASH = "0x21,0x42,0x63,0x04,0x7F"
REPORTS = {"441#21", "482#42", "4C3#63", "404#04", "4DF#7F"}


def status(peer: Peer, board: int) -> str:
    """Status byte of PC_INFO."""
    # A running board's process data come in between.
    answer = f"{0x140 + board:03X}#"
    frames = [frame for frame in peer.ask(f"{0x200 + board:03X}#", 0.15) if frame.startswith(answer)]
    return frames[0][10:12] if frames else ""


def number(peer: Peer, boards: int) -> None:
    peer.ask("000#", 0.5)
    for board in range(1, boards + 1):
        assert peer.ask(f"{0x280 + board:03X}#", 0.1) == [f"{0xC0 + board:03X}#{board:02X}"]
        peer.ask(f"{0x1C0 + board:03X}#0202", 0.02)


def identity(chain: Chain, peer: Peer) -> None:
    time.sleep(0.3)
    reports = peer.ask("000#", 0.5)
    assert set(reports) == REPORTS and len(reports) == 5, f"D-T1: {reports}"
    for _ in range(2):
        reports = peer.ask("240#", 0.4)
        assert set(reports) == REPORTS and len(reports) == 5, f"D-T2: {reports}"
    for frame in ("201#", "2C1#0000000000000000", "301#", "541#", "581#", "5C1#", "601#01000000"):
        assert peer.ask(frame, 0.1) == [], f"D-T3: {frame}"


def numbers(chain: Chain, peer: Peer) -> None:
    assert peer.ask("281#", 0.1) == ["0C1#01"], "D-T4"
    assert peer.ask("202#", 0.1) == [], "D-T4"
    assert peer.ask("282#", 0.1) == [], "D-T4: the pin of board 1 is off"
    peer.ask("1C1#0202", 0.05)
    assert peer.ask("282#", 0.1) == ["0C2#02"], "D-T4"
    assert peer.ask("281#", 0.1) == ["0C1#01"], "D-T5"


def bits(chain: Chain, peer: Peer) -> None:
    assert status(peer, 1) == "1B"
    peer.ask("1C1#0040", 0.05)
    assert status(peer, 1) == "5B", "D-T6: the second byte is not masked"
    peer.ask("1C1#4000", 0.05)
    assert status(peer, 1) == "1B", "D-T6"
    for frame in ("1C1#0100", "1C1#1000", "1C1#2020"):
        peer.ask(frame, 0.05)
        assert status(peer, 1) == "1B", f"D-T7: {frame}"


def walk(chain: Chain, peer: Peer) -> None:
    number(peer, 1)
    steps = [("041#", 0.3, "1F"), ("301#", 0.5, "8B"), ("541#", 0.1, "AB"), ("601#00000000", 0.1, "8B"), ("1C1#8000", 0.1, "1B")]
    seen = ["1B"]
    for frame, seconds, _ in steps:
        heard = peer.ask(frame, seconds)
        if frame == "301#":
            assert "501#" in heard, f"D-T9: {heard}"
        seen.append(status(peer, 1))
    assert seen == ["1B", *(after for _, _, after in steps)], f"D-T8: {seen}"
    peer.ask("1C1#0800", 0.1)
    assert status(peer, 1) == "", "D-T8: without a number no answer"


def strings(frames: list[str]) -> list[str]:
    """Texts of string packages: a count of two bytes, then so many packages."""
    texts, rest = [], [bytes.fromhex(frame.split("#")[1]) for frame in frames]
    while rest:
        count = int.from_bytes(rest.pop(0), "little")
        texts.append(b"".join(rest[:count]).decode("latin-1"))
        rest = rest[count:]
    return texts


def process_data(chain: Chain, peer: Peer) -> None:
    number(peer, 1)
    peer.ask("301#", 0.5)
    frames = peer.ask("581#", 0.4)
    frames = [frame for frame in frames if frame.startswith("581#")]
    assert frames[0] == "581#030005000500", f"D-T10: {frames[0]}"
    texts = strings(frames[1:])
    assert len(texts) == 1 + 3 + 5 + 5 and texts[1].startswith("set_position"), f"D-T10: {texts}"
    assert [f for f in peer.ask("581#00", 0.2) if f.startswith("581")] == [], "D-T10: with data it is no request"
    assert [f for f in peer.ask("5C1#", 0.1) if f.startswith("6C1")] == ["6C1#00000000E8038403"], "D-T11"
    assert "081#05" in peer.ask("341#0300000000000000", 0.1), "D-T12: offset at the dimension"
    assert [f for f in peer.ask("341#0200840300000000", 0.1) if f.startswith("081")] == [], "D-T12: surplus is ignored"
    assert [f for f in peer.ask("601#02000000", 0.1) if f.startswith(("601", "081"))] == [], "D-T15"
    assert "081#07" in peer.ask("601#000000", 0.1), "D-T15"


def supervision(chain: Chain, peer: Peer) -> None:
    number(peer, 1)
    peer.ask("301#", 0.5)
    peer.send("680#")
    peer.send("541#")
    start = time.monotonic()
    peer.wait("601#01000000")
    peer.wait("381#")
    peer.wait("601#00000000")
    lost = time.monotonic() - start
    assert 1.2 < lost < 1.9, f"D-T13: safe after {lost:.2f} s"
    assert [f for f in peer.all(0.1) if f.startswith("381")] == [], "D-T13: no outputs any more"
    assert [f for f in peer.ask("680#", 0.2) if f.startswith("381")] == [], "D-T13: life signs alone start nothing"
    peer.send("541#")
    peer.wait("601#01000000")
    # D-T14: every 500 ms; one missing; three missing.
    for missing in (0, 0, 1, 0):
        peer.send("680#")
        heard = peer.all(0.5 * (1 + missing))
        assert "601#00000000" not in heard, f"D-T14: {missing} missing"
    peer.send("680#")
    assert "601#00000000" in peer.all(2.0), "D-T14: three missing"


def autostart(chain: Chain, peer: Peer) -> None:
    number(peer, 1)
    peer.ask("1C1#4040", 0.05)
    peer.ask("000#", 0.5)
    assert peer.ask("281#", 0.05) == ["0C1#01"]
    peer.ask("041#", 0.8)
    assert status(peer, 1)[0] in "15", "D-T16: the exloader has it"
    peer.ask("1C1#4000", 0.05)


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def header(cycle: int, image: bytes, date: int, target: int = 0xFFFF) -> bytes:
    words = [0x5543, 1, cycle, 0, 0, 0, len(image) // 2, 0, crc16(image), date, target] + [0xFFFF] * 20
    words.append(-sum(words) & 0xFFFF)
    return b"".join(word.to_bytes(2, "little") for word in words)


def block(peer: Peer, board: int, data: bytes) -> str:
    """Eight frames; what comes of them."""
    for i in range(0, 64, 8):
        peer.send(f"{0x2C0 + board:03X}#{data[i:i + 8].hex()}")
    return peer.wait("", 12.0)


def update(chain: Chain, peer: Peer) -> None:
    image = bytes((37 * i + 11) % 256 for i in range(1000))
    assert crc16(b"123456789") == 0x29B1 and crc16(image) == 0x4B3F
    first = header(1, image, 0x3AC1)
    assert first.hex().upper().startswith("43550100010000000000000" + "0F40100003F4BC13AFFFF"), first.hex()
    assert first.hex().upper().endswith("DC22"), first.hex()
    number(peer, 1)
    peer.ask("041#", 0.3)
    assert status(peer, 1) == "1F"
    padded = image + b"\xff" * (-len(image) % 64)
    for cycle in (1, 2):
        answers = [block(peer, 1, header(cycle, image, 0x3AC1))]
        answers += [block(peer, 1, padded[i:i + 64]) for i in range(0, len(padded), 64)]
        last = ["181#"] if cycle == 1 else ["101#"]
        assert answers == ["181#"] * 16 + last, f"D-T17: cycle {cycle}: {answers}"
    assert peer.ask("201#", 0.2)[0] == "141#2100011B3F4BC13A", "D-T17"


def refusals(chain: Chain, peer: Peer) -> None:
    image = bytes(range(256)) * 2
    good = header(1, image, 0x3AC1)
    wrong = bytearray(good)
    wrong[63] ^= 1
    number(peer, 1)

    def fresh() -> None:
        peer.ask("041#", 0.3)

    fresh()
    assert block(peer, 1, bytes(wrong)) == "081#05", "D-T18: bad sum"
    assert peer.ask("2C1#0000000000000000", 0.1) == [], "D-43: silence after an error"
    fresh()
    assert block(peer, 1, header(1, image, 0x3AC1, target=0x77)) == "081#02", "D-T18: wrong target"
    fresh()
    assert peer.ask("2C1#00000000000000", 0.1) == ["081#07"], "D-T18: DLC 7"
    fresh()
    assert peer.ask("2C1#4355010001000000", 0.4) == ["081#0A"], "D-T18: a pause in a block"
    fresh()
    assert block(peer, 1, header(2, image, 0x3AC1)) == "081#0A", "cycle 2 before cycle 1"
    fresh()
    assert block(peer, 1, good) == "181#"
    for i in range(0, 512, 64):
        assert block(peer, 1, image[i:i + 64]) == "181#"
    assert block(peer, 1, header(2, image + b"\0\0", 0x3AC1)) == "081#0A", "D-T18: cycle 2 is another image"
    assert peer.ask("201#", 0.2)[0][10:].startswith("1F"), "still programming"
    peer.ask("1C1#0400", 0.1)
    assert "501#" in peer.ask("301#", 0.5), "D-T18: the old application is still valid"


def group(chain: Chain, peer: Peer) -> None:
    image = bytes(range(128))
    number(peer, 3)
    peer.ask("041#", 0.3)
    peer.ask("043#", 0.3)
    for cycle in (1, 2):
        for data in (header(cycle, image, 0x3AC1), image[:64], image[64:]):
            for i in range(0, 64, 8):
                peer.send(f"2C0#{data[i:i + 8].hex()}")
            answers = {peer.wait("", 12.0), peer.wait("", 12.0)}
            assert answers in ({"181#", "183#"}, {"101#", "103#"}), f"D-T19: {answers}"
    assert answers == {"101#", "103#"}, "D-T19"
    assert peer.all(0.2) == [], "D-T19: board 2 is silent"


def held_acknowledge(chain: Chain, peer: Peer) -> None:
    peer.ask("000#", 0.5)
    chain.fault("ack-held board=1 for_s=0.6")
    assert peer.ask("281#", 0.1) == [] and peer.ask("281#", 0.1) == []
    heard = peer.all(0.8)
    assert heard.count("0C1#01") == 1 and heard.count("080#09") == 1, f"D-T20: {heard}"


def equal_flash(program: str) -> None:
    with Chain(program, "--boards", "2", "--flash-ids", "0x21,0x21") as chain, chain.peer() as peer:
        time.sleep(0.3)
        assert peer.ask("000#", 0.5) in (["441#21"], ["441#21", "441#21"]), "D-T21"


def main() -> None:
    program = sys.argv[1]
    rows = [identity, numbers, bits, walk, process_data, supervision, autostart, update, refusals, group, held_acknowledge]
    with Chain(program, "--boards", "5", "--flash-ids", FLASH) as chain, chain.peer() as peer:
        for row in rows:
            row(chain, peer)
            print(f"{row.__name__}: agreed")
    equal_flash(program)
    print("equal_flash: agreed")


if __name__ == "__main__":
    main()
