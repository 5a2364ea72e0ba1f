"""Every figure of docs/benchmarks.md, one after the other.

python benchmarks/bench.py          # more than an hour on two cores
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

PARTS = ("evaluation.py", "overhead.py", "paper.py", "rules.py", "front.py", "time_to_front.py", "overlap.py")


def main() -> None:
    print(f"Machine: {processor()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    for part in PARTS:
        sys.stdout.flush()
        subprocess.run([sys.executable, Path(__file__).with_name(part)], check=True)
        print()


def processor() -> str:
    """The processor's name where Linux tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


if __name__ == "__main__":
    main()
