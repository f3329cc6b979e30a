"""Checks the machine code of jtc-dynamics for the board: no panic, no branch, number of instructions.

    python check_codegen.py

Builds the crate for thumbv7em-none-eabihf with target-cpu=cortex-m7 (which computes f64 in hardware) and reads the assembly. The crate
may not mention `panicking` anywhere. The per-tick functions may not contain a call, a fused multiply-add or a conditional branch; a
branch that closes a loop over the six joints is allowed. So every call executes the same instructions, and the printed count is exact.
Exit code 1 on a finding.
"""

import glob
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TARGET = "thumbv7em-none-eabihf"
# `inverse` only selects an instance of `inverse_of` by the arm's shape, which no tick changes.
STRAIGHT = {"inverse_of": 3, "gravity_torque": 1, "mass_matrix": 1, "forward": 1}
JOINTS = 6


def assembly():
    command = ["cargo", "rustc", "--profile", "dist", "--quiet", "--package", "jtc-dynamics", "--lib", "--target", TARGET]
    command += ["--", "--emit", "asm", "-C", "lto=off", "-C", "codegen-units=1"]
    target_dir = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "codegen"
    environment = os.environ | {"CARGO_TARGET_DIR": str(target_dir), "RUSTFLAGS": "-C target-cpu=cortex-m7"}
    subprocess.run(command, cwd=ROOT, env=environment, check=True)
    files = glob.glob(str(target_dir / TARGET / "dist/deps/jtc_dynamics-*.s"))
    return pathlib.Path(max(files, key=os.path.getmtime)).read_text()


def functions(text):
    """Yields instructions and labels of each function `Dynamics::name` and `inverse::name`."""
    for match in re.finditer(r"^(_ZN12jtc_dynamics(?:8Dynamics|7inverse)\d+(\w+?)17h\w+):\n(.*?)^\.Lfunc_end", text, re.M | re.S):
        lines = (line.strip() for line in match[3].splitlines())
        yield match[2], [line for line in lines if line and (line[0] not in ".@" or re.match(r"\.LBB\w+:", line))]


def is_instruction(line):
    return not line.endswith(":") and ":" not in line.split()[0]


def inspect(body):
    """Returns the number of instructions per call, without those of `__aeabi_memclr8`, which clears a matrix; and the findings."""
    count, findings, loops = sum(map(is_instruction, body)), [], 0
    for place, line in enumerate(body):
        word, *operands = line.split()
        target = operands[-1] + ":" if operands else ""
        if re.fullmatch(r"vfn?m[as].*", word):
            findings.append(f"fused multiply-add: {line}")
        elif re.fullmatch(r"blx?(\.[nw])?", word) and operands != ["__aeabi_memclr8"]:
            findings.append(f"call: {line}")
        elif re.fullmatch(r"cbn?z|b(eq|ne|[lg][te]|[mv][is]|[mv]c|pl|hi|ls|hs|lo|cc|cs)(\.[nw])?", word):
            loops += 1
            if target in body[:place] and loops == 1:
                count += (JOINTS - 1) * sum(map(is_instruction, body[body.index(target) : place]))
            else:
                findings.append(f"branch: {line}")
    return count, findings


def main():
    text = assembly()
    findings = ["the crate mentions panicking"] if "panicking" in text else []
    found = list(functions(text))
    for name, instances in STRAIGHT.items():
        bodies = [body for found_name, body in found if found_name == name]
        if len(bodies) != instances:
            findings.append(f"{name}: {len(bodies)} times in the assembly, expected {instances}")
        for body in bodies:
            count, wrong = inspect(body)
            findings += [f"{name}: {w}" for w in wrong]
            print(f"{name} {count} instructions")
    for finding in findings:
        print("FAILED", finding)
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
