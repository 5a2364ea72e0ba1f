"""The boundary of the kernels: threads, forks, the process's stderr."""

import subprocess
import sys

import pytest

THREADS = """
import sys, threading
import numpy as np
from armwright.evaluation import evaluate
from armwright.space import paper_space
arms = [paper_space().arm(d) for d in paper_space().sample(2, 0)]
threads = [threading.Thread(target=evaluate, args=(arms, np.zeros((1, 3)))) for _ in range(8)]
[t.start() for t in threads]
[t.join() for t in threads]
print("still heard", file=sys.stderr)
"""

FORK = """
import os
import numpy as np
from armwright.evaluation import evaluate
from armwright.space import paper_space
arms = [paper_space().arm(d) for d in paper_space().sample(5000, 0)]
targets = np.full((1, 3), 0.3)
parent = evaluate(arms, targets).q
child = os.fork()
if child == 0:
    os._exit(0 if np.array_equal(evaluate(arms, targets).q, parent) else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)


def test_first_use_by_many_threads_leaves_stderr_as_it_was() -> None:
    """Warp's native code is silenced while it starts, and only then."""
    assert run(THREADS).stderr.splitlines()[-1] == "still heard"


@pytest.mark.parametrize("closed", ["", "import os; os.close(2)\n"])
def test_stderr_is_silent_and_may_be_closed(closed: str) -> None:
    done = run(closed + "from armwright.kinematics.devices import load; load('float32', 8, 'cpu')")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_forked_child_solves_too() -> None:
    """It has the parent's pool, but not its threads."""
    assert run(FORK).returncode == 0
