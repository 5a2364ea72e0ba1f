"""Fuzzes the doors of armwright, each in a process of its own, and says how many inputs each was given.

    make fuzz                                       # some million inputs
    python -m tests.fuzz --target task --share 0.1
    python -m tests.fuzz --engine atheris           # led by which code an input reaches (Linux)
    python -m tests.fuzz --target task --input FILE # one input again

hypothesis draws how a valid document is changed; atheris changes those further that reached something new. Both stop at
the first defect of a target, and keep its input in fuzz-found/.
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
# Inputs of a whole run, by what one takes.
INPUTS = {
    "words": 200_000, "points": 200_000, "start": 200_000, "answer": 120_000, "urdf": 120_000, "request": 50_000,
    "trials": 30_000, "actuators": 30_000, "space": 20_000, "task": 20_000, "experiment": 10_000, "replay": 10_000,
    "arguments": 6_000, "draft": 1_500, "run config.yaml": 1_000, "run trials.jsonl": 1_000,
    "run transcripts.jsonl": 1_000, "run summary.json": 1_000, "run existing_arms.json": 500, "run control.json": 500,
    "run status.json": 500,
}  # fmt: skip


class TooSlowError(BaseException):
    """An input takes too long; not an Exception, so that no handler hides it."""


@contextmanager
def limited() -> Iterator[None]:
    """Raise TooSlowError after LONGEST CPU seconds of all threads, however busy the machine is."""

    def end(*_: object) -> None:
        raise TooSlowError(f"more than {LONGEST} s")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def with_hypothesis(name: str, inputs: int, seed: int) -> dict[str, Any]:
    """Fuzz a target with a number of inputs, in this process."""
    import hypothesis
    from hypothesis import strategies

    from tests.fuzz.target import check, seeds_of
    from tests.fuzz.targets import TARGETS

    target = TARGETS[name]
    seeds_of(target)
    given = passed = 0
    longest = 0.0

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=inputs, database=None, deadline=None, phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )  # fmt: skip
    @hypothesis.given(strategies.randoms(use_true_random=False))
    def fuzz(rng: Random) -> None:
        nonlocal given, passed, longest
        data = target.make(rng)
        started = time.process_time()
        try:
            with limited():
                passed += check(target, data)
        except BaseException:
            FOUND.mkdir(exist_ok=True)
            (FOUND / name.replace(" ", "-")).write_bytes(data)
            raise
        given += 1
        longest = max(longest, time.process_time() - started)

    started = time.perf_counter()
    fuzz()
    return {"inputs": given, "passed": passed, "seconds": time.perf_counter() - started, "longest": longest}


def with_atheris(name: str, inputs: int, seed: int) -> None:
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

    counted = Path(os.environ["ARMWRIGHT_FUZZ_COUNT"])
    options = [f"-runs={inputs}", f"-seed={seed + 1}", f"-timeout={10 * LONGEST:.0f}", f"-rss_limit_mb={LARGEST}",
    "-max_len=20000",
               f"-artifact_prefix={FOUND}/{name.replace(' ', '-')}-", "-print_final_stats=1", str(corpus)]  # fmt: skip
    atheris.Setup([sys.argv[0], *options], fuzz, custom_mutator=mutate)
    atheris.Fuzz()


def in_process(name: str, engine: str, inputs: int, seed: int) -> dict[str, Any]:
    """Fuzz a target in another process and return its counts."""
    command = [sys.executable, "-m", "tests.fuzz", "--alone", "--engine", engine, "--target", name]
    with tempfile.TemporaryDirectory() as home:
        count = Path(home) / "count.json"
        environment = {**os.environ, "XDG_CONFIG_HOME": home, "ARMWRIGHT_FUZZ_COUNT": str(count), "COLUMNS": "200"}
        started = time.perf_counter()
        done = subprocess.run(
            [*command, "--inputs", str(inputs), "--seed", str(seed)],
            capture_output=True, text=True, errors="replace", env=environment, encoding="utf-8",
        )  # fmt: skip
        seconds = time.perf_counter() - started
        told = json.loads(count.read_text(encoding="utf-8")) if count.exists() else {"inputs": 0, "passed": 0}
    said = f"{done.stdout}\n{done.stderr}"
    fault = (
        ""
        if done.returncode == 0
        else "\n".join([line for line in said.splitlines() if not line.startswith("#")][-40:])
    )
    return {"target": name, "engine": engine, "seconds": seconds, **told, "fault": fault}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--engine", choices=("hypothesis", "atheris"), default="hypothesis")
    parser.add_argument("--target", action="append", choices=tuple(INPUTS))
    parser.add_argument("--inputs", type=int, help="for each target, instead of its own number")
    parser.add_argument("--share", type=float, default=1.0, help="of the inputs of a whole run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--input", type=Path, help="a file to give to the target, alone")
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    names = asked.target or list(INPUTS)
    if asked.input is not None:
        from tests.fuzz.target import check
        from tests.fuzz.targets import TARGETS

        with limited():
            print("passed" if check(TARGETS[names[0]], asked.input.read_bytes()) else "refused")
        return
    counts = {name: asked.inputs or max(1, round(asked.share * INPUTS[name])) for name in names}
    if asked.alone:
        alone(names[0], asked.engine, counts[names[0]], asked.seed)
        return
    sum_of, defects = 0, 0
    with ThreadPoolExecutor(asked.jobs) as pool:
        for told in pool.map(lambda name: in_process(name, asked.engine, counts[name], asked.seed), names):
            sum_of += told["inputs"]
            defects += bool(told["fault"])
            share = told["passed"] / max(1, told["inputs"])
            more = "".join(f", {key} {told[key]:.2f}" for key in ("longest", "peak_gib") if key in told)
            print(
                f"{told['target']:22} {told['engine']:10} {told['inputs']:9,} inputs {told['seconds']:7.0f} s  "
                f"passed {share:4.0%}{more}{'  DEFECT' if told['fault'] else ''}",
                flush=True,
            )
            if told["fault"]:
                print(told["fault"], flush=True)
    print(f"{sum_of:,} inputs, {defects} defects")
    sys.exit(1 if defects else 0)


def alone(name: str, engine: str, inputs: int, seed: int) -> None:
    """Fuzz a target in this process and check its peak memory."""
    if engine == "atheris":
        with_atheris(name, inputs, seed)
        return
    told = with_hypothesis(name, inputs, seed)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # [GiB]
    Path(os.environ["ARMWRIGHT_FUZZ_COUNT"]).write_text(json.dumps({**told, "peak_gib": peak}), encoding="utf-8")
    assert peak < LARGEST / 1024, f"{peak:.2f} GiB were taken"


if __name__ == "__main__":
    main()
