"""Runs the simulation examples with the commands in their docstrings, and checks their results."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(name):
    """Runs an example in a separate process and returns its output."""
    path = EXAMPLES / name
    assert len(path.read_text().splitlines()) < 60
    done = subprocess.run([sys.executable, path], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    return done.stdout


def test_own_controller():
    means = [float(m) for m in re.findall(r"mean ([\d.]+) mrad", run("own_controller.py"))]
    ours, own = means
    assert 0 < ours < own < 100


def test_gym_environment():
    pytest.importorskip("gymnasium")
    printed = run("gym_environment.py")
    assert "passes the check of Gymnasium" in printed and "tripped" not in printed
    distances = [float(d) for d in re.findall(r"([\d.]+) rad from the goal", printed)]
    assert len(distances) == 3 and max(distances) < 0.1
