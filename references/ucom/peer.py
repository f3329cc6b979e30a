"""A simulated chain and a peer of its bus that knows nothing but frames."""

import logging
import pathlib
import signal
import subprocess
import tempfile
import time

import can

# python-can warns whenever a frame comes in two pieces.
logging.getLogger("can").setLevel(logging.ERROR)


class Chain:
    """`ucom sim` on a free port, and `ucom` commands on its bus."""

    def __init__(self, program: str, *options: str):
        self.program = program
        self.directory = tempfile.TemporaryDirectory()
        self.process = subprocess.Popen(
            [program, "sim", "--listen", "127.0.0.1:0", *options],
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
        assert self.process.wait(10) == 0
        self.directory.cleanup()

    def path(self, name: str) -> str:
        return str(pathlib.Path(self.directory.name) / name)

    def fault(self, line: str) -> None:
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        time.sleep(0.15)  # it looks at its stdin every 50 ms

    def start(self, *words: str) -> subprocess.Popen:
        command = [self.program, "--json", "--bus", self.url, *words]
        environment = {"UCOM_INVENTORY": self.path("inventory.toml"), "UCOM_CACHE": self.path("cache")}
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)

    def peer(self) -> "Peer":
        return Peer(self.port)


class Peer:
    """Frames written as candump does: `1C1#0202`."""

    def __init__(self, port: int):
        self.bus = can.Bus(interface="socketcand", host="127.0.0.1", port=port, channel="can0")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.bus.shutdown()

    def send(self, text: str) -> None:
        number, data = text.split("#")
        self.bus.send(can.Message(arbitration_id=int(number, 16), is_extended_id=False, data=bytes.fromhex(data)))

    def next(self, seconds: float) -> str | None:
        """The next frame within a time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message is not None:
                return f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"
        return None

    def all(self, seconds: float) -> list[str]:
        """Everything within a time."""
        end, frames = time.monotonic() + seconds, []
        while (left := end - time.monotonic()) > 0:
            frame = self.next(left)
            if frame is not None:
                frames.append(frame)
        return frames

    def ask(self, text: str, seconds: float = 0.3) -> list[str]:
        """Everything within a time after a frame."""
        self.send(text)
        return self.all(seconds)

    def wait(self, start: str, seconds: float = 10.0) -> str:
        """The next frame that begins so; others are passed over."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            frame = self.next(left)
            if frame is not None and frame.startswith(start):
                return frame
        raise AssertionError(f"no {start} within {seconds} s")
