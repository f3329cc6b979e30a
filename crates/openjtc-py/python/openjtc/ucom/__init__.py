"""Chains of UCoM boards on a CAN bus: number the boards, examine them, drive them by name under supervision, and update them.

>>> from openjtc import ucom
>>> with ucom.connect("sim:") as chain:
...     chain.init()
...     chain.run(1, active=True, inputs={"set_position": 1500})
...     print(chain["1.position"])

The procedures are the same as in the command ``ucom``. Some functions exist only in ``ucom``: decoding and replaying recordings, signal
databases, conformance tests that program a board, and ``ucom serve``. An agent that owns a bus is reached over HTTP. The package
openjtc.ucom has no HTTP client yet.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Literal

from openjtc import _native
from openjtc._native import SimulatedChain
from openjtc.errors import UsageError
from openjtc.ucom.boards import Board, BoardValues, Signal, Signals, Value
from openjtc.ucom.chain import Chain
from openjtc.ucom.reports import (
    BusState,
    ConformanceReport,
    ConformanceTest,
    Event,
    Examination,
    Finding,
    ProbeReport,
    ProbeRow,
    Progress,
    RunReport,
    ScanReport,
    UpdateReport,
    UpdateResult,
)
from openjtc.ucom.samples import Monitor, OutputTable, Sample, to_numpy, to_pandas
from openjtc.ucom.session import Boards, Recording
from openjtc.ucom.values import Settable

__all__ = [
    "Board",
    "BoardValues",
    "Boards",
    "BusState",
    "Chain",
    "ConformanceReport",
    "ConformanceTest",
    "Event",
    "Examination",
    "Finding",
    "Monitor",
    "OutputTable",
    "ProbeReport",
    "ProbeRow",
    "Progress",
    "Recording",
    "RunReport",
    "Sample",
    "ScanReport",
    "Settable",
    "Signal",
    "Signals",
    "SimulatedChain",
    "UpdateReport",
    "UpdateResult",
    "Value",
    "connect",
    "sim",
    "to_numpy",
    "to_pandas",
]

_Path = str | os.PathLike[str]


def sim(
    chain: _Path | None = None,
    *,
    boards: int | None = None,
    faults: _Path | None = None,
    seed: int = 1,
    profile: _Path | None = None,
) -> SimulatedChain:
    """Starts a simulated chain in this process, in real time, like ``ucom sim``.

    ``.url`` of the chain is the URL of a socketcand bus on this computer, which other programs can join. ``.fault("silent board=3
    for_s=1")`` injects a fault (``ucom help faults``), and ``.end()`` ends the chain.

    Args:
        chain: Chain file, TOML (``ucom help sim``); None: a head with ten boards.
        boards: Number of boards, 0 to 31.
        faults: Fault file, TOML (``ucom help faults``).
        seed: Seed of all random numbers.
        profile: Profile that describes how the boards interpret the protocol, TOML (``ucom help profile``).

    Raises:
        UsageError: A file is not valid.
    """
    paths = (None if path is None else os.fspath(path) for path in (chain, faults, profile))
    chain_file, fault_file, profile_file = paths
    return SimulatedChain(chain_file, boards, fault_file, seed, profile_file)


def connect(
    bus: str | SimulatedChain,
    *,
    names: Mapping[str, int] | None = None,
    signals: _Path | None = None,
    inventory: _Path | None = None,
    profile: _Path | None = None,
    on_lost: Literal["report", "stop-board", "stop-all"] | None = None,
    cache: _Path | bool | None = None,
    deadline_s: float | None = None,
) -> Chain:
    """Opens a chain of boards on a bus, without sending a frame.

    Args:
        bus: ``"socketcan:can0"``, ``"slcan:/dev/ttyACM0@1000000"``, ``"socketcand:localhost:29536/can0"``, ``"multicast:…"``, ``"sim:"`` or
            ``"sim:FILE"`` for a simulated chain that ends with this connection, or the result of `sim`.
        names: Names of boards in addition to the inventory: ``{"gripper": 2}``.
        signals: Signal table, TOML: types, scales and units of signals (``ucom help edges``).
        inventory: Inventory file, TOML: the position of each board in the chain. `Chain.init` writes the file or compares the chain with
            it.
        profile: Profile that describes how the boards interpret the protocol, TOML (``ucom help profile``).
        on_lost: Reaction to a lost board; None: the reaction of the profile, which by default stops all boards.
        cache: Folder in which the names of signals are stored. True or None: the user's folder. False (and None for a simulated chain): no
            folder.
        deadline_s: Time without a call after which running boards are stopped, s. The next `Chain.check` then raises a `FaultError`
            (``deadline``). Without a deadline, boards run as long as this process lives, even if the program hangs.

    Raises:
        UsageError: The URL or a file is not valid.
        NoLinkError: The bus cannot be opened (``bus``).
    """
    simulated = bus if isinstance(bus, SimulatedChain) else None
    if isinstance(bus, str) and bus.startswith("sim:"):
        simulated = sim(bus.removeprefix("sim:") or None, profile=profile)
    url = bus if isinstance(bus, str) and simulated is None else ""
    if url.startswith(("http://", "https://")):
        raise UsageError(
            f"{url}: this package has no client for an agent (ucom serve)",
            "usage",
            next="give the bus while no agent owns it, or use the HTTP interface of the agent",
        )
    remember = (simulated is None or cache is not None) and cache is not False
    folder = None if cache is None or isinstance(cache, bool) else os.fspath(cache)
    paths = [None if path is None else os.fspath(path) for path in (signals, inventory, profile)]
    native = _native.Chain(
        simulated.url if simulated is not None else url,
        simulated,
        paths[2],
        on_lost,
        paths[0],
        paths[1],
        folder,
        remember,
        deadline_s,
    )
    return Chain(native, names or {}, simulated)
