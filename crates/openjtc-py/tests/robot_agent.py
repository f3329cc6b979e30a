"""Agent of a simulated controller, in a separate process."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def agent(folder: Path) -> Iterator[tuple[str, str]]:
    """Starts ``jtc serve --sim``, and yields its address and an operator's token."""
    token = folder / "tokens"
    env = {**os.environ, "XDG_RUNTIME_DIR": str(folder), "XDG_STATE_HOME": str(folder), "HOME": str(folder)}
    serve = [os.environ["JTC"], "serve", "--sim", "--listen", "127.0.0.1:0", "--token-file", token, "--json"]
    with subprocess.Popen(serve, stdout=subprocess.PIPE, env=env, text=True) as running:
        try:
            line = next(line for line in running.stdout if "http://" in line)
            url = json.loads(line).get("url") or line[line.index("http://") :].split('"')[0]
            rows = token.read_text().splitlines()
            yield url, next(row.split('"')[1] for row in rows if row.startswith("operator"))
        finally:
            running.terminate()
