"""The figures of docs/benchmarks.md that go with the kernels and the search, one after the other.

    python benchmarks/bench.py          # some 25 minutes on two cores

rules.py takes long and is run by itself.
"""

import os
import platform
import shlex
import subprocess
import sys
from pathlib import Path

PAPER_TASKS = ("target-1", "target-2", "target-3")
PARTS = (
    ("evaluation.py",),
    ("overhead.py",),
    ("experiment.py",),
    ("front.py", "--seeds", "3", "--budget", "100000", "--populations", "100", "--tasks", *PAPER_TASKS),
    ("time_to_front.py",),
    ("front.py", "--seeds", "2", "--budget", "100000", "--populations"),
)


def main() -> None:
    print(f"Machine: {processor()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    for part, *options in PARTS:
        print(f"== {shlex.join(['python', f'benchmarks/{part}', *options])}\n", flush=True)
        subprocess.run([sys.executable, Path(__file__).with_name(part), *options], check=True)
        print()


def processor() -> str:
    """The processor's name where Linux tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


if __name__ == "__main__":
    main()
