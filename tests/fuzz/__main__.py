"""Fuzzes the doors of armwright, each in a process of its own, and says how many inputs each was given.

    make fuzz                                       # some million inputs
    python -m tests.fuzz --target task --share 0.1
    python -m tests.fuzz --engine atheris           # led by which code an input reaches (Linux)
    python -m tests.fuzz --target task --input FILE # one input again

A seeded generator draws how a valid document is changed; atheris changes those further that reached something new. Both
stop at the first defect of a target, and keep its input in fuzz-found/.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

FOUND = Path("fuzz-found")
LONGEST = 30.0  # [s] of an input
LARGEST = 1536  # [MiB] of a process


class TooSlowError(BaseException):
    """An input takes too long; not an Exception, so that no handler hides it."""


@contextmanager
def limited(seconds: float = LONGEST) -> Iterator[None]:
    """Raise TooSlowError after so many CPU seconds of all threads, however busy the machine is."""

    def end(*_: object) -> None:
        raise TooSlowError(f"more than {seconds} s")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def at_random(name: str, inputs: int, seed: int) -> dict[str, Any]:
    """Give a target a number of inputs in this process; its counts and longest time [s]."""
    from tests.fuzz.target import check
    from tests.fuzz.targets import TARGETS

    target = TARGETS[name]
    passed, longest = 0, 0.0
    for number in range(inputs):
        data = target.make(Random(f"{seed} {number}"))
        started = time.process_time()
        try:
            with limited():
                passed += check(target, data)
        except BaseException:
            FOUND.mkdir(exist_ok=True)
            (FOUND / name.replace(" ", "-")).write_bytes(data)
            raise
        longest = max(longest, time.process_time() - started)
    return {"inputs": inputs, "passed": passed, "longest": longest}


def with_atheris(name: str, inputs: int, seed: int, counted: Path) -> None:
    """Fuzz a target guided by coverage; the process ends with it."""
    import atheris

    with atheris.instrument_imports(include=["armwright"], enable_loader_override=False):
        from tests.fuzz.mutation import changed
        from tests.fuzz.target import check, seeds_of
        from tests.fuzz.targets import TARGETS

        target = TARGETS[name]
        for one in seeds_of(target):  # what a door needs is imported here
            check(target, one)
    corpus = Path(tempfile.mkdtemp())
    for number, one in enumerate(seeds_of(target)):
        (corpus / str(number)).write_bytes(one)
    FOUND.mkdir(exist_ok=True)
    given = passed = 0

    def fuzz(data: bytes) -> None:
        nonlocal given, passed
        with limited():
            passed += check(target, data)
        given += 1
        if given % 100 == 0 or given >= inputs:
            counted.write_text(json.dumps({"inputs": given, "passed": passed}), encoding="utf-8")

    def mutate(data: bytes, most: int, number: int) -> bytes:
        if number % 4 == 0:
            return atheris.Mutate(data, most)
        rng = Random(number)
        return (target.make(rng) if number % 4 == 1 else changed(data, target.form, rng))[:most]

    options = [
        f"-runs={inputs}", f"-seed={seed + 1}", f"-timeout={10 * LONGEST:.0f}", f"-rss_limit_mb={LARGEST}",
        "-max_len=20000", f"-artifact_prefix={FOUND}/{name.replace(' ', '-')}-", "-print_final_stats=1", str(corpus),
    ]  # fmt: skip
    atheris.Setup([sys.argv[0], *options], fuzz, custom_mutator=mutate)
    atheris.Fuzz()


def in_process(name: str, engine: str, inputs: int, seed: int) -> dict[str, Any]:
    """Fuzz a target in another process and return its counts."""
    asked = ["--engine", engine, "--target", name, "--inputs", str(inputs), "--seed", str(seed)]
    with tempfile.TemporaryDirectory() as home:
        count = Path(home) / "count.json"
        started = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "tests.fuzz", *asked, "--count", str(count)],
            capture_output=True, text=True, errors="replace", encoding="utf-8",
            env={**os.environ, "XDG_CONFIG_HOME": home, "COLUMNS": "200"},
        )  # fmt: skip
        seconds = time.perf_counter() - started
        counts = json.loads(count.read_text(encoding="utf-8")) if count.exists() else {"inputs": 0, "passed": 0}
    said = [line for line in f"{done.stdout}\n{done.stderr}".splitlines() if not line.startswith("#")]
    return {"target": name, "seconds": seconds, **counts, "fault": "\n".join(said[-40:]) if done.returncode else ""}


def alone(name: str, engine: str, inputs: int, seed: int, counted: Path) -> None:
    """Fuzz a target in this process and check its peak memory."""
    if engine == "atheris":
        with_atheris(name, inputs, seed, counted)
        return
    counts = at_random(name, inputs, seed)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # [GiB]
    counted.write_text(json.dumps({**counts, "peak_gib": peak}), encoding="utf-8")
    assert peak < LARGEST / 1024, f"{peak:.2f} GiB were taken"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--engine", choices=("random", "atheris"), default="random")
    parser.add_argument("--target", action="append")
    parser.add_argument("--inputs", type=int, help="for each target, instead of its own number")
    parser.add_argument("--share", type=float, default=1.0, help="of the inputs of a whole run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--input", type=Path, help="a file to give to the target, alone")
    parser.add_argument("--count", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.count is not None:  # before armwright is imported, which atheris does by itself
        alone(asked.target[0], asked.engine, asked.inputs, asked.seed, asked.count)
        return
    from tests.fuzz.target import check
    from tests.fuzz.targets import TARGETS

    names = asked.target or list(TARGETS)
    if set(names) - TARGETS.keys():
        parser.error(f"expected --target of {', '.join(TARGETS)}; got {', '.join(names)}")
    if asked.input is not None:
        with limited():
            print("passed" if check(TARGETS[names[0]], asked.input.read_bytes()) else "refused")
        return
    counts = {name: asked.inputs or max(1, round(asked.share * TARGETS[name].inputs)) for name in names}
    given, defects = 0, 0
    with ThreadPoolExecutor(asked.jobs) as pool:
        for found in pool.map(lambda name: in_process(name, asked.engine, counts[name], asked.seed), names):
            given += found["inputs"]
            defects += bool(found["fault"])
            more = "".join(f", {key} {found[key]:.2f}" for key in ("longest", "peak_gib") if key in found)
            print(
                f"{found['target']:22} {found['inputs']:9,} inputs {found['seconds']:7.0f} s  "
                f"passed {found['passed'] / max(1, found['inputs']):4.0%}{more}{'  DEFECT' if found['fault'] else ''}",
                flush=True,
            )
            if found["fault"]:
                print(found["fault"], flush=True)
    print(f"{given:,} inputs, {defects} defects")
    sys.exit(1 if defects else 0)


if __name__ == "__main__":
    main()
