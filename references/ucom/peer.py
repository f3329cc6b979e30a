"""A simulated chain, `ucom` commands on its bus, and a peer that only sends and receives frames."""

import json
import logging
import os
import pathlib
import signal
import subprocess
import tempfile
import threading
import time

import can

# python-can logs a warning whenever a frame comes in two pieces.
logging.getLogger("can").setLevel(logging.ERROR)

PROFILE = {"little": "", "big": 'endian = "big"\nprog.endian = "big"\n'}


class Chain:
    """`ucom sim` on a free port, and `ucom` commands on its bus. Both read words in the same byte order."""

    def __init__(self, program: str, *options: str, order: str = "little", profile: str = ""):
        self.program = program
        self.directory = tempfile.TemporaryDirectory()
        self.profile = self.write("profile.toml", PROFILE[order] + profile)
        self.process = subprocess.Popen(
            [program, "--profile", self.profile, "sim", "--listen", "127.0.0.1:0", *options],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )
        line = self.process.stdout.readline().strip()
        assert line.startswith("ready: socketcand:"), line
        self.url = line.removeprefix("ready: ")
        self.port = int(self.url.rsplit(":", 1)[1].split("/")[0])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        ended = self.process.wait(20)
        self.directory.cleanup()
        assert ended == 0, f"ucom sim ended with {ended}"

    def path(self, name: str) -> str:
        return str(pathlib.Path(self.directory.name) / name)

    def write(self, name: str, content: str | bytes) -> str:
        """Writes a file to this chain's directory; returns its path."""
        content = content.encode() if isinstance(content, str) else content
        pathlib.Path(self.path(name)).write_bytes(content)
        return self.path(name)

    def fault(self, line: str) -> None:
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        time.sleep(0.15)  # the simulator polls its stdin every 50 ms

    def start(self, *words: str, profile: str | None = None) -> "Command":
        return Command([self.program, "--json", "--bus", self.url, "--profile", profile or self.profile, *words], self)

    def peer(self) -> "Peer":
        return Peer(self.port)


class Command:
    """A running `ucom` command. Every line of its output is stored with its time."""

    def __init__(self, words: list[str], chain: Chain):
        environment = os.environ | {"UCOM_INVENTORY": chain.path("inventory.toml"), "UCOM_CACHE": chain.path("cache")}
        self.process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        )
        self.out: list[tuple[float, str]] = []
        self.notes: list[tuple[float, str]] = []
        self.readers = [
            threading.Thread(target=self.read, args=pair, daemon=True)
            for pair in ((self.process.stdout, self.out), (self.process.stderr, self.notes))
        ]
        for reader in self.readers:
            reader.start()

    def read(self, stream, lines: list[tuple[float, str]]) -> None:
        for line in stream:
            lines.append((time.time(), line.rstrip("\n")))

    def end(self, seconds: float = 120.0) -> int:
        """Waits for the end. Returns the exit code; -9 for a killed process."""
        try:
            code = self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.process.args[6:]} did not end within {seconds} s") from None
        for reader in self.readers:
            reader.join()
        return code

    def said(self) -> dict:
        """Returns the last JSON object of its output."""
        return json.loads(self.out[-1][1]) if self.out else {}

    def note(self, text: str) -> float | None:
        """Returns the time of the first line on stderr with this text."""
        return next((at for at, line in list(self.notes) if text in line), None)

    def wait_note(self, text: str, seconds: float) -> float | None:
        end = time.monotonic() + seconds
        while time.monotonic() < end and self.process.poll() is None and self.note(text) is None:
            time.sleep(0.02)
        return self.note(text)

    def wait_out(self, text: str, seconds: float = 30.0) -> float | None:
        """Waits for a line with this text on stdout, and returns its time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = next((at for at, line in list(self.out) if text in line), None)
            if found is not None or self.process.poll() is not None:
                return found
            time.sleep(0.02)
        return None


class Peer:
    """Sends and receives frames in candump notation, such as `1C1#0202`. The times of received frames come from the bus."""

    def __init__(self, port: int):
        self.bus = can.Bus(interface="socketcand", host="127.0.0.1", port=port, channel="can0", tcp_tune=True)
        self.stamp = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.bus.shutdown()

    def send(self, text: str) -> float:
        """Sends a frame; returns the time."""
        number, data = text.split("#")
        now = time.time()
        self.bus.send(can.Message(arbitration_id=int(number, 16), is_extended_id=False, data=bytes.fromhex(data)))
        return now

    def next(self, seconds: float) -> str | None:
        """Returns the next frame within a time. `stamp` is the time at which it was on the bus."""
        end = time.monotonic() + seconds
        while True:
            message = self.bus.recv(max(0.0, end - time.monotonic()))
            if message is not None:
                self.stamp = message.timestamp
                return f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"
            if time.monotonic() >= end:
                return None

    def all(self, seconds: float) -> list[str]:
        """Returns all frames within a time."""
        end, frames = time.monotonic() + seconds, []
        while (left := end - time.monotonic()) > 0:
            frame = self.next(left)
            if frame is not None:
                frames.append(frame)
        return frames

    def ask(self, text: str, seconds: float = 0.3) -> list[str]:
        """Sends a frame, and returns all frames within a time after it."""
        self.send(text)
        return self.all(seconds)

    def wait(self, *starts: str, seconds: float = 15.0) -> str:
        """Returns the next frame that begins with one of `starts`; empty if none came. Skips other frames."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            frame = self.next(left)
            if frame is not None and frame.startswith(starts):
                return frame
        return ""

    def answer(self, text: str, *starts: str, seconds: float = 5.0) -> str:
        """Sends a request and returns the first answer that begins with one of `starts`. The timeout is long enough for a busy computer."""
        self.send(text)
        return self.wait(*starts, seconds=seconds)
