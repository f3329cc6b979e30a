"""Robot descriptions of other projects: the URDF files of the package example-robot-data, without its 400 MB of meshes.

The files are downloaded once and stored in the folder OPENJTC_ROBOTS, or else next to the packages of the virtual environment.
"""

import hashlib
import os
import pathlib
import subprocess
import sys
import tempfile
import zipfile

LIST = pathlib.Path(__file__).resolve().parent.parent / "requirements-robots.txt"


def folder():
    """Returns the folder with the descriptions, one folder per robot; creates it if it is missing."""
    parent = pathlib.Path(os.environ.get("OPENJTC_ROBOTS") or sys.prefix)
    kept = parent / f"robots-{hashlib.sha256(LIST.read_bytes()).hexdigest()[:16]}"
    stamp = kept / "complete"
    if stamp.exists():
        return kept
    with tempfile.TemporaryDirectory() as scratch:
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
        subprocess.run([*pip, "--only-binary", ":all:", "--dest", scratch, "--requirement", LIST], check=True)
        for wheel in pathlib.Path(scratch).glob("*.whl"):
            with zipfile.ZipFile(wheel) as files:
                unpack(files, kept)
    stamp.touch()
    return kept


def unpack(files, kept):
    """Unpacks the descriptions and their licences."""
    for name in files.namelist():
        robot = name.partition("/robots/")[2]
        if robot and ".." not in robot and (robot.endswith(".urdf") or robot.endswith("LICENSE")):
            path = kept / robot
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(files.read(name))
