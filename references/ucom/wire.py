"""Bytes of the protocol, packed only from its tables. `order` is "little" or "big", as for `int.to_bytes`."""


def frame(function: int, sequence: int, data: bytes = b"") -> str:
    """Returns a frame in candump notation: function in bits 10..6 of the identifier, sequence number in bits 4..0."""
    return f"{function << 6 | sequence:03X}#{data.hex().upper()}"


def parts(text: str) -> tuple[int, int, bytes]:
    """Returns function, sequence number and data of a frame."""
    number, data = text.split("#")
    return int(number, 16) >> 6, int(number, 16) & 0x1F, bytes.fromhex(data)


def word(order: str, value: int) -> bytes:
    return (value & 0xFFFF).to_bytes(2, order)


def number(order: str, data: bytes) -> int:
    return int.from_bytes(data, order)


def report(flash: int) -> str:
    """Returns DSP_REPORTk: bits 6..5 of the flash number select the function, bits 4..0 are the sequence field."""
    return frame(16 + (flash >> 5 & 3), flash & 0x1F, bytes([flash & 0xFF]))


def string(order: str, text: str, inclusive: bool = False) -> list[bytes]:
    """Returns a string's packages. The first contains the number of packages that follow (or of all), the others eight characters each."""
    data = text.encode("latin-1")
    packages = [data[i:i + 8] for i in range(0, len(data), 8)]
    return [word(order, len(packages) + inclusive), *packages]


def texts(order: str, payloads: list[bytes]) -> list[str]:
    """Returns the texts of string packages."""
    out, rest = [], list(payloads)
    while rest:
        count = number(order, rest.pop(0))
        out.append(b"".join(rest[:count]).decode("latin-1"))
        rest = rest[count:]
    return out


def package(order: str, offset: int, *words: int) -> bytes:
    """Returns a buffer package: index of the first word, then three words; missing words are 0."""
    words = (*words, 0, 0, 0)[:3]
    return word(order, offset) + b"".join(word(order, w) for w in words)


def packages(order: str, buffer: list[int]) -> list[bytes]:
    """Returns the packages of a whole buffer."""
    return [package(order, i, *buffer[i:i + 3]) for i in range(0, len(buffer), 3)]


def crc16(data: bytes) -> int:
    """Returns CRC-16/CCITT-FALSE, computed bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def header(order: str, cycle: int, image: bytes, date: int, target: int = 0xFFFF, address: int = 0,
           length: int | None = None) -> bytes:
    """Returns the header block of a cycle; its words add up to 0."""
    length = len(image) // 2 if length is None else length
    words = [0x5543, 1, cycle, 0, address & 0xFFFF, address >> 16, length & 0xFFFF, length >> 16]
    words += [crc16(image), date, target] + [0xFFFF] * 20
    words.append(-sum(words) & 0xFFFF)
    return b"".join(word(order, w) for w in words)


def padded(image: bytes) -> list[bytes]:
    """Returns the data blocks of an image."""
    image += b"\xff" * (-len(image) % 64)
    return [image[i:i + 64] for i in range(0, len(image), 64)]
