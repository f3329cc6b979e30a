"""Runs the Python lines of the documentation pages and compares their output with the pages.

``pycon`` blocks contain statements after ``>>>`` and the output of the statements. ``python`` blocks contain only statements. The blocks of
a page run one after the other in one namespace and one temporary folder. A comment directly above a block is an option:
``<!-- not run: REASON -->``, ``<!-- needs: PACKAGE -->`` (skips the block if the package is not installed), or ``<!-- numbers vary -->``
(does not compare numbers). ``UPDATE_DOCS=1`` updates the output in the page. Simulated arms run at ``SPEED`` times real time.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import io
import os
import re
import traceback
from pathlib import Path

import openjtc
import pytest

#: Speed of simulated arms, times real time.
SPEED = 6.0
ROOT = Path(__file__).resolve().parents[3]
BLOCK = re.compile(
    r"(?:^<!--(?P<notes>[^\n]*)-->\n)?^```(?P<kind>pycon|python)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
NUMBER = re.compile(r"(?<![A-Za-z_])[-+−]?(?:0x[0-9a-fA-F]+|\d[\d_]*(?:\.\d*)?(?:[eE][-+]?\d+)?)")


def pages() -> list[Path]:
    """Returns the pages with Python blocks. The list of pages is empty if the package is tested without its repository."""
    candidates = [ROOT / "README.md", ROOT / "crates/openjtc-py/README.md", *sorted((ROOT / "docs").glob("*.md"))]
    return [page for page in candidates if page.exists() and BLOCK.search(page.read_text(encoding="utf-8"))]


def examples(text: str) -> list[tuple[str, str]]:
    """Returns the source and the shown output of each statement of a ``pycon`` block."""
    found: list[tuple[list[str], list[str]]] = []
    for line in text.splitlines():
        if line == ">>>" or line.startswith(">>> "):
            found.append(([line[4:]], []))
        elif found and not found[-1][1] and (line == "..." or line.startswith("... ")):
            found[-1][0].append(line[4:])
        elif found:
            found[-1][1].append(line)
        else:
            raise AssertionError(f"output before the first line that is typed: {line}")
    return [("\n".join(source) + "\n", "\n".join(shown).rstrip()) for source, shown in found]


def run(source: str, names: dict[str, object], mode: str) -> tuple[str, bool]:
    """Runs a statement, or a script if `mode` is "exec". Returns the output, and True if the statement or script ended in an exception."""
    out = io.StringIO()
    try:
        # Progress bars are drawn on stderr.
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            exec(compile(source, "<page>", mode), names)
    except Exception as error:
        text = out.getvalue() + "Traceback (most recent call last):\n  ...\n"
        return text + "".join(traceback.format_exception_only(error)), True
    return out.getvalue(), False


def same(shown: str, printed: str, varying: bool) -> bool:
    """Returns True if the output matches the page. ``[...]`` in the page matches any text."""

    def prepared(text: str) -> str:
        if varying:
            # Joint and board numbers are compared, because such a number identifies a joint or a
            # board.
            text = re.sub(r"\b(joints?|boards?) (\d+)", lambda m: f"{m[1]} " + "abcdefghij"[int(m[2]) % 10], text)
            text = re.sub(r"\s", "", NUMBER.sub("#", text))
        return "\n".join(line.rstrip() for line in text.strip("\n").splitlines())

    pieces = [re.escape(prepared(piece)) for piece in shown.split("[...]")]
    return re.fullmatch(".*".join(pieces), prepared(printed), re.DOTALL) is not None


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_page(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(openjtc, "connect", functools.partial(openjtc.connect, speed=SPEED))
    text = page.read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "__page__"}
    wrong: list[str] = []
    ran, left_out = 0, 0

    def block(match: re.Match[str]) -> str:
        nonlocal ran, left_out
        notes = [note.strip() for note in (match["notes"] or "").split(";")]
        line = text.count("\n", 0, match.start()) + 1
        reasons = [note for note in notes if note.startswith("not run:")]
        needed = [note.removeprefix("needs:").strip() for note in notes if note.startswith("needs:")]
        reasons += [f"needs {name}" for name in needed if importlib.util.find_spec(name) is None]
        if reasons:
            left_out += 1
            print(f"line {line}: {reasons[0]}")
            return match[0]
        ran += 1
        if match["kind"] == "python":
            printed, failed = run(match["text"], names, "exec")
            if failed:
                wrong.append(f"line {line}:\n{printed}")
            return match[0]
        new, before = "", len(wrong)
        for source, shown in examples(match["text"]):
            printed, _ = run(source, names, "single")
            if not same(shown, printed, "numbers vary" in notes):
                wrong.append(f"line {line}: {source}--- the page shows\n{shown}\n--- it prints\n{printed}")
                shown = printed.rstrip()
            for number, part in enumerate(source.removesuffix("\n").split("\n")):
                new += f"{'...' if number else '>>>'} {part}".rstrip() + "\n"
            new += f"{shown}\n" if shown else ""
        return match[0] if len(wrong) == before else match[0].replace(match["text"], new)

    updated = BLOCK.sub(block, text)
    for name in ("robot", "arm", "chain"):
        close = getattr(names.get(name), "close", None)
        if callable(close):
            close()
    print(f"{page.name}: {ran} blocks run, {left_out} not")
    if os.environ.get("UPDATE_DOCS"):
        page.write_text(updated, encoding="utf-8")
    else:
        assert not wrong, "\n\n".join(wrong)


def told_to_install() -> list[tuple[Path, str]]:
    """Returns the arguments of every `pip install` in the project as a list of words."""
    places = ["README.md", "docs", "crates/openjtc-py", "crates/jtc-host/src", "crates/jtc-cli/src", "crates/ucom-cli/src", "references"]
    kinds = {".md", ".py", ".pyi", ".rs", ".ipynb", ".toml"}
    files = [file for place in places for file in [ROOT / place, *sorted((ROOT / place).rglob("*"))] if file.suffix in kinds]
    return [
        (file, word.lstrip("`'\"\\(").rstrip("`'\"\\),."))
        for file in files
        if "target" not in file.parts and file != Path(__file__).resolve() and file.is_file()
        for command in re.findall(r"pip3? install ([^\n#]*)", file.read_text(encoding="utf-8"))
        for word in re.split(r"\s+|\\n", command)
    ]


def test_nobody_is_told_to_install_a_name_that_is_not_ours():
    """The package is not in a package index, so `pip install` with its name could install code of another author. The documentation must
    give the path of the wheel."""
    words = told_to_install()
    if not (ROOT / "docs").exists():
        pytest.skip("the package is tested without its repository")
    assert any(word.startswith("./openjtc-") for _, word in words)
    wrong = [(str(file), word) for file, word in words if re.match(r"(openjtc|jtc|ucom)\b", word)]
    assert not wrong
