"""Threads, forks, stderr, devices and memory of the kernels."""

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from armwright.exceptions import FailureError, SettingsError
from armwright.kinematics import devices
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.ik import ik as solve
from armwright.problem import problem
from armwright.problem.problem import Problem
from armwright.tasks.catalogue import load_task
from tests.support.command_line import PATIENCE

THREADS = """
import sys, threading
import numpy as np
from armwright.problem.evaluation import evaluate
from armwright.spaces.design_space import paper_space
arms = [paper_space().arm(d) for d in paper_space().sample(2, 0)]
threads = [threading.Thread(target=evaluate, args=(arms, np.zeros((1, 3)))) for _ in range(8)]
[t.start() for t in threads]
[t.join() for t in threads]
"""

FORK = """
import os
import numpy as np
from armwright.problem.evaluation import evaluate
from armwright.spaces.design_space import paper_space
arms = [paper_space().arm(d) for d in paper_space().sample(5000, 0)]
targets = np.full((1, 3), 0.3)
parent = evaluate(arms, targets).q
child = os.fork()
if child == 0:
    os._exit(0 if np.array_equal(evaluate(arms, targets).q, parent) else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, encoding="utf-8"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "heard"),
    [("", 'print("still heard", file=sys.stderr)', "still heard\n"), ("import os; os.close(2)\n", "", "")],
)
def test_first_use_by_many_threads_is_silent_and_restores_stderr(before: str, after: str, heard: str) -> None:
    """Warp's native code is silenced only while it starts; stderr may be closed."""
    done = run(before + THREADS + after)
    assert (done.returncode, done.stderr) == (0, heard)


@pytest.mark.slow
def test_forked_child_can_solve() -> None:
    """The child inherits the parent's pool, but not its threads."""
    assert run(FORK).returncode == 0


def test_auto_selects_cuda_for_many_designs_on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    for there, many, expected in ((True, True, "cuda"), (True, False, "cpu"), (False, True, "cpu")):
        monkeypatch.setattr(devices, "_has_cuda", lambda there=there: there)
        assert devices.resolve_device("auto", many) == expected
        assert devices.resolve_device("cpu", many) == "cpu"


def test_unavailable_devices_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "_has_cuda", lambda: False)
    with pytest.raises(SettingsError, match=r'device = "cuda": no NVIDIA GPU with its driver found; try .*"cpu"'):
        devices.resolve_device("cuda", many=True)
    with pytest.raises(SettingsError, match=r'device = "cud" is not one of auto, cpu, cuda. Did you mean "cuda"'):
        devices.resolve_device("cud", many=True)
    with pytest.raises(SettingsError, match="is not one of auto, cpu, cuda"):
        Problem(load_task("target-1"), device="gpu")  # type: ignore[arg-type]
    asking = Problem(load_task("target-1"), device="cuda")  # a run of another machine may say so
    designs = asking.space.sample(2, 0)
    with pytest.raises(SettingsError, match="no NVIDIA GPU"):
        asking.evaluate(designs)
    with pytest.raises(SettingsError, match="no NVIDIA GPU"):
        asking.evaluate(asking.space.matrix(designs))


COMPILE_FOR_CUDA = """
import sys
import warp as wp
from armwright.kinematics.contact.clearance_kernels import clearance_kernels
from armwright.kinematics.cycle.drive_kernels import drive_kernels
from armwright.kinematics.cycle.branch_kernels import branch_kernels
from armwright.kinematics.cycle.choice_kernels import choice_kernels
from armwright.kinematics.cycle.dynamics_kernels import dynamics_kernels
from armwright.kinematics.ik.ik_kernels import ik_kernels
from armwright.kinematics.cycle.load_kernels import load_kernels
from armwright.kinematics.cycle.path_kernels import path_kernels
variants = [ik_kernels("float32", 1, motions, "position") for motions in ("revolute", "any")]
variants += [ik_kernels("float32", 1, "any", "pose"), path_kernels(), branch_kernels()]
variants += [choice_kernels(), dynamics_kernels(), load_kernels(), drive_kernels(), clearance_kernels("float32")]
kernels = [value for variant in variants for value in vars(variant).values() if isinstance(value, wp.Kernel)]
modules = {kernel.module.name: kernel.module for kernel in kernels}
print(len(modules), file=open(sys.argv[1] + "/count", "w"))
for module in modules.values():
    print(*wp.compile_aot_module(module, arch=90, module_dir=sys.argv[1], use_ptx=True))
"""


@pytest.mark.slow
def test_kernels_compile_for_cuda_without_a_gpu(tmp_path: Path) -> None:
    """Compile to PTX with Warp's compiler; only a GPU can run the result."""
    command = [sys.executable, "-c", COMPILE_FOR_CUDA, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    written = [path.read_text(encoding="utf-8") for path in tmp_path.glob("*.ptx")]
    assert len(written) == int((tmp_path / "count").read_text(encoding="utf-8")) >= 14
    assert all(".entry" in text and "sm_90" in text for text in written)


def test_chunk_is_halved_until_it_fits_gpu_memory() -> None:
    solved: list[range] = []

    def solving(rows: slice) -> None:
        if rows.stop - rows.start > 30:
            raise RuntimeError("Failed to allocate 123 bytes on device 'cuda:0'")
        solved.append(range(rows.start, rows.stop))

    in_chunks(solving, 107, 100, "cuda")
    assert [number for rows in solved for number in rows] == list(range(107))
    assert max(len(rows) for rows in solved) == 25

    def never(rows: slice) -> None:
        raise RuntimeError("CUDA error 2: out of memory")

    with pytest.raises(FailureError, match="one arm at all its targets does not fit"):
        in_chunks(never, 107, 100, "cuda")

    def broken(rows: slice) -> None:
        raise RuntimeError("CUDA error 700: an illegal memory access")

    with pytest.raises(RuntimeError, match="illegal"):
        in_chunks(broken, 107, 100, "cuda")


def test_results_do_not_depend_on_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """This holds for the solver's chunks and for chunks of designs."""
    asked = Problem(load_task("target-2"))
    matrix = asked.space.matrix(asked.space.sample(100, 3))
    whole = asked.evaluate(matrix).values
    assert np.array_equal(whole, asked.evaluate(asked.space.designs(matrix)).values)
    monkeypatch.setitem(solve.MAX_CHUNK, "cpu", 1)
    monkeypatch.setitem(problem.POSTURES_AT_ONCE, "cpu", 200)
    assert np.array_equal(asked.evaluate(matrix).values, whole)
    assert asked.evaluate(matrix[:0]).values.shape == (0, 2)


@pytest.mark.parametrize(("said", "most"), [("1", 1), ("3,1", 3), ("", 8), ("many", 8), ("0", 8), ("99", 8)])
def test_omp_num_threads_limits_cores(monkeypatch: pytest.MonkeyPatch, said: str, most: int) -> None:
    monkeypatch.setattr(devices.os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert devices.cores() == most


def test_concurrent_threads_get_the_same_bits() -> None:
    problems = [Problem(load_task(name)) for name in ("target-1", "target-2", "autodesign-1")]
    known = [(rows := p.space.matrix(p.space.sample(700, 0)), p.evaluate(rows).values) for p in problems]
    wrong: list[tuple[int, int]] = []

    def work(seed: int) -> None:
        rng = np.random.default_rng(seed)
        for _ in range(20):
            which, n = int(rng.integers(len(problems))), int(rng.choice([1, 2, 7, 33, 100, 250, 300, 600]))
            rows, values = known[which]
            first = int(rng.integers(0, 700 - n))
            part = slice(first, first + n)
            if not np.array_equal(problems[which].evaluate(rows[part]).values, values[part]):
                wrong.append((which, n))

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
