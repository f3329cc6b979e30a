"""The examples of can-link for the checks."""

import os
import pathlib
import time

import can

ROOT = pathlib.Path(__file__).resolve().parents[2]


def program(name: str) -> list[str]:
    """Returns the command of an example, taken from $JTC_EXAMPLES or built with cargo."""
    built = os.environ.get("JTC_EXAMPLES")
    if built and (pathlib.Path(built) / name).exists():
        return [str(pathlib.Path(built) / name)]
    cargo = ["cargo", "run", "--quiet", "--package", "can-link", "--example", name]
    return [*cargo, "--manifest-path", str(ROOT / "Cargo.toml"), "--"]


def received(bus: can.BusABC, timeout_s: float) -> can.Message:
    """Returns the next message. Skips the results without a message, which python-can gives for confirmations and parts of lines."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        message = bus.recv(1.0)
        if message is not None:
            return message
    raise AssertionError("nothing came")
