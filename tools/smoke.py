"""What an armwright that was just installed must do, without anything of the repository.

It has no extras, or `figures` and `studies`.

    python smoke.py FOLDER          # the Python that it is installed in, a folder

Run folders stay in FOLDER, which is empty for the base install; the other goes on there. Every command must end with
its code, without a traceback, and without a warning of ours.
"""

import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib import metadata
from pathlib import Path

EXPERIMENT = """
name: two-methods
tasks: [target-1, shelf]
seeds: 2
n_init: 4
n_total: 10
methods:
  bbo: {label: BBO, proposer: none}
  rules: {label: rules, proposer: rules, n_step: 5}
baseline: bbo
"""
PYTHON = """
import armwright as aw

if __name__ == "__main__":
    problem = aw.Problem(space=aw.paper_space(joints=4), task=aw.load_task("target-1"))
    assert problem.evaluate(problem.space.sample(100, seed=0)).values.shape == (100, 2)
    run = aw.optimize(problem, proposer="rules", n_total=20, seed=0, out="python")
    assert run.hypervolume[-1] > 0
    assert aw.to_urdf(run.front[0].arm).startswith("<?xml")
    assert len(aw.find_front(problem, evaluations=2000).front) > 20
    assert [path for path in aw.write_figures("python") if path.suffix == ".png"]
"""
FORMATS = ("urdf", "ros2_control", "mjcf")


def python(*args: str, code: int = 0, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a process of this Python and check its exit code."""
    # Deprecations in libraries are theirs; those in our own lines are told by the file that the warning names.
    env = {**os.environ, "PYTHONWARNINGS": "default", "ARMWRIGHT_MODEL": "", "NO_COLOR": "1", **environment}
    done = subprocess.run([sys.executable, "-P", *args], capture_output=True, encoding="utf-8", env=env)
    said = f"{' '.join(args)}\n{done.stdout}{done.stderr}"
    assert done.returncode == code, f"code {done.returncode}, not {code}: {said}"
    assert "Traceback" not in done.stderr, said
    ours = [line for line in done.stderr.splitlines() if "Warning:" in line and f"{os.sep}armwright{os.sep}" in line]
    assert not ours, said
    return done


def armwright(*args: str, code: int = 0, **environment: str) -> subprocess.CompletedProcess[str]:
    """Print and run an armwright command."""
    print("armwright", *args, flush=True)
    return python("-m", "armwright", *args, code=code, **environment)


def base() -> None:
    """Everything that needs no extra."""
    assert armwright("--version").stdout.strip() == metadata.version("armwright")
    assert "optimize" in armwright("--help").stdout
    armwright("design", "desk-sorting", "--evaluations", "1000", "--out", "front")
    for made in ("report.html", "summary.json", "front.csv"):
        assert (Path("front") / made).stat().st_size > 100, made
    urdfs = list(Path("front").glob("designs/*/arm.urdf"))
    assert urdfs
    assert all(ET.parse(urdf).getroot().tag == "robot" for urdf in urdfs)
    assert "is finished" in armwright("design", "desk-sorting", "--evaluations", "1000", "--out", "front").stdout
    armwright("pick", "front", "--by", "price")
    for kind in FORMATS:
        armwright("export", "front", "--format", kind, "--out", f"out/{kind}")
    assert "in MuJoCo" in armwright("simulate", "front").stdout
    armwright("report", "front")
    armwright("check", "target-1")
    assert len(json.loads(armwright("tasks", "--json").stdout)) > 30
    armwright("actuators")
    armwright("init", "mine.yaml")
    Path("out/urdf").rename("arm.urdf")
    armwright("compare-arms", "desk-sorting", "arm.urdf", "--run", "front")
    health = armwright("doctor").stdout
    assert health.count("ok extra") + health.count("-- extra") == 7, health


def studies() -> None:
    """Everything that needs the extras `studies` and `figures` alone, and what the base install does with its run."""
    for kind in FORMATS:
        armwright("export", "front", "--format", kind, "--out", f"out/{kind}")
    assert "in MuJoCo" in armwright("simulate", "front").stdout
    asked = ("optimize", "target-1", "--n-total", "40", "--out", "run")
    run = armwright(*asked)
    assert "hypervolume" in run.stdout
    for made in ("report.html", "summary.json", "front.csv", "figures/front.png", "figures/front.pdf"):
        assert (Path("run") / made).stat().st_size > 100, made
    assert "is finished" in armwright(*asked).stdout
    armwright("datasheet", "front")
    Path("two-methods.yaml").write_text(EXPERIMENT, encoding="utf-8")
    told = json.loads(armwright("experiment", "two-methods.yaml", "--out", "cells", "--json").stdout)
    assert told
    armwright("compare", "cells", "--out", "compared")
    armwright("optimize", "mine.yaml", "--n-total", "10", "--no-figures", "--robust", "--space", "slideopt")
    armwright("optimize", "target-1", "--print-prompt")
    assert 'pip install "armwright[llm]"' in armwright("doctor", "--model", "openai-chat:gpt-4o", code=1).stdout
    Path("script.py").write_text(PYTHON, encoding="utf-8")
    python("script.py")


def main(folder: Path) -> None:
    """Check what this installation can do, in an empty folder or in that of the base install."""
    installed = {str(distribution.metadata["Name"]).lower() for distribution in metadata.distributions()}
    assert not installed & {"pydantic-ai-slim", "starlette", "torch", "distributed", "robot-descriptions", "pytest"}
    os.chdir(folder)
    if "optuna" in installed:
        studies()
    else:
        assert not installed & {"cloudpickle", "jinja2", "matplotlib", "threadpoolctl"}
        base()
    print(f"all of it works on Python {sys.version.split()[0]}, in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
