"""Checks `ucom probe` with boards that read the protocol differently, played on python-can's socketcand interface.

Argument: the `ucom` program. Exit code 0: all agreed.
"""

import itertools
import tomllib
from pathlib import Path

import rows
import wire
from pc_board import EXLRUN, MSTART
from pc_play import boards, intrusive, told
from rows import Bench

KEYS = ("inclusive", "all4", "auto_pin", "strict")


def flat(table: dict, before: str = "") -> dict:
    """Returns the keys of a profile; a key `b` in a table `a` becomes `a.b`."""
    out = {}
    for key, value in table.items():
        out |= flat(value, f"{before}{key}.") if isinstance(value, dict) else {f"{before}{key}": value}
    return out


def expected(order: str, quirks: dict) -> dict:
    """Returns the values that the profile must have for such boards."""
    yes = {True: ("yes", True), False: ("no", False)}
    return {
        "endian": (order,),
        "string.count_includes_header": yes[quirks.get("inclusive", False)],
        "report.mode": ("all4",) if quirks.get("all4") else ("flash7",),
        "chain.auto_opinit": yes[quirks.get("auto_pin", False)],
        "dlc.strict": yes[quirks.get("strict", False)],
        "addr.first": (1,),
        "addr.broadcast": (0, "0"),
    }


def agrees(bench: Bench, path: str, quirks: dict, without: tuple[str, ...] = ()) -> None:
    profile = flat(tomllib.loads(Path(path).read_text()))
    for key, values in expected(bench.order, quirks).items():
        if key not in without:
            bench.expect(profile.get(key) in values, "P-20", f"{key} = {values[0]} of {quirks}", profile.get(key))


def numbering(bench: Bench, several: list[dict]) -> None:
    """Checks `--init` with boards of all kinds; the probe begins with the default profile."""
    for quirks in several:
        with bench.bus() as chain, boards(bench, chain, bench.flash_ids(3), **quirks) as played:
            out = chain.path("found.toml")
            none = chain.write("none.toml", "")
            told(bench, "P-20", chain.start("probe", "--init", "--out", out, profile=none), 0)
            agrees(bench, out, quirks)
            # `ucom` works with the measured profile.
            said = told(bench, "P-20", chain.start("init", "--renew", profile=out), 0)
            seen = [(b["flash_number"], b["description"]) for b in said["boards"]]
            there = [(board.flash, board.names()[0]) for board in played.boards]
            bench.same("P-20", f"{quirks}: boards with this profile", seen, there)
        bench.ok("P-20", f"{bench.order} {' '.join(quirks) or 'and nothing else'}")


def as_decided(bench: Bench) -> None:
    numbering(bench, [{}])


def inclusive_counts(bench: Bench) -> None:
    numbering(bench, [{"inclusive": True}])


def four_reports(bench: Bench) -> None:
    numbering(bench, [{"all4": True}])


def own_pins(bench: Bench) -> None:
    numbering(bench, [{"auto_pin": True}])


def strict_lengths(bench: Bench) -> None:
    numbering(bench, [{"strict": True}])


def all_together(bench: Bench) -> None:
    numbering(bench, [dict.fromkeys(KEYS, True)])


def some_by_chance(bench: Bench) -> None:
    several = [some for n in (2, 3) for some in itertools.combinations(KEYS, n)]
    numbering(bench, [dict.fromkeys(some, True) for some in bench.random.sample(several, 2)])


def harmless(bench: Bench) -> None:
    """Checks that without `--init` numbered or started boards stay unchanged, and that the questions find all that they can."""
    for started in (False, True):
        quirks = {"inclusive": True, "all4": True}
        how = {"numbered": True, "shape": (7, 4, 2), "running": 3 if started else 0}
        with bench.bus() as chain, boards(bench, chain, bench.flash_ids(3), **quirks, **how) as played:
            out = chain.path("found.toml")
            image = bench.image()
            for board in played.boards:
                board.program = (wire.crc16(image), 0x386E)
            words = ("probe", "--out", out, "--image", chain.write("image.bin", image))
            told(bench, "P-20", chain.start(*words, profile=chain.write("none.toml", "")), 0)
            agrees(bench, out, quirks, without=("chain.auto_opinit",))
            checksum = flat(tomllib.loads(Path(out).read_text()))["prog.checksum"]
            bench.same("P-20", "checksum of Program IDs", checksum, "crc16")
            bench.same("P-20", "frames that do something", intrusive(played.frames()), [])
            states = {board.status & (MSTART | EXLRUN) for board in played.boards}
            bench.same("P-20", "states as before", states, {MSTART if started else EXLRUN})
    bench.ok("P-20", "harmless without --init")


if __name__ == "__main__":
    rows.main([some_by_chance, as_decided, inclusive_counts, four_reports, own_pins, strict_lengths, all_together,
               harmless])
