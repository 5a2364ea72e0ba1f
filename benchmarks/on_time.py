"""Wall clock of `armwright design --budget` against the budget, which it may exceed by 10 % or 3 s.

    python benchmarks/on_time.py          # some five minutes on two cores

The last runs begin with an empty cache of kernels, whose compilation does not count and may take 20 s.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

RUNS = (
    ("target-1", 5),
    ("machine-tending", 10),
    ("desk-sorting", 30),
    ("box-palletising", 60),
    ("desk-sorting", 60, "--robust"),
)
COLD = (("target-1", 10), ("desk-sorting", 30))
COMPILATION = 20.0  # [s] at most


def main() -> None:
    print(
        f"  {'':28s}{'budget':>8s}{'wall':>8s}{'search':>8s}{'evaluations':>13s}{'kept':>6s}{'figures':>9s}  simulated"
    )
    with tempfile.TemporaryDirectory() as place:
        for task, budget, *options in RUNS:
            show(Path(place) / f"{task}{len(options)}", task, budget, *options)
        for task, budget in COLD:
            cache = Path(place) / f"{task}-kernels"
            show(Path(place) / f"{task}-cold", task, budget, environment={"WARP_CACHE_PATH": str(cache)})
    print(f"load of the last minutes: {', '.join(f'{load:.1f}' for load in os.getloadavg())}")


def show(folder: Path, task: str, budget: int, *options: str, environment: dict[str, str] | None = None) -> None:
    command = [sys.executable, "-m", "armwright", "design", task, "--budget", f"{budget}s", "--no-stall", *options]
    started = time.monotonic()
    done = subprocess.run(
        [*command, "--out", str(folder)],
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    wall = time.monotonic() - started
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    allowed = budget + max(3.0, 0.1 * budget) + COMPILATION * bool(environment)
    figures = len(list((folder / "figures").glob("*.png")))
    recommended = summary.get("recommended", [])
    simulated = sum(not one["status"].startswith("not simulated") for one in recommended)
    name = " ".join([task, *options, *(["(cold)"] if environment else [])])
    print(
        f"  {name:28s}{budget:8d}{wall:8.1f}{summary['search']['seconds']:8.1f}"
        f"{summary['search']['evaluations']:13,d}{summary['n_trials']:6d}{figures:9d}"
        f"  {f'{simulated} of {len(recommended)}' if recommended else '-':9s}{'' if wall <= allowed else '  LATE'}",
        flush=True,
    )


if __name__ == "__main__":
    main()
