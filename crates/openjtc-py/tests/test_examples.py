"""Runs the unchanged examples on simulated arms, as fast as possible."""

from __future__ import annotations

import functools
import importlib.util
from pathlib import Path

import openjtc
import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


@pytest.mark.parametrize("name", ["first_motion", "waypoints", "teach_and_replay"])
def test_examples_run(name, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(openjtc, "connect", functools.partial(openjtc.connect, speed=None))
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main()
    shown = capsys.readouterr().out
    assert "finished" in shown and "RMS mrad" in shown


def test_examples_are_short():
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) < 60, path.name
