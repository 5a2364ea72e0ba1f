"""What shows a finished run reads its records: no kernel is loaded, and no physics evaluated again."""

import subprocess
import sys
from pathlib import Path

import pytest

import armwright as aw
from tests import ROOT

SHOW = """
import sys


class NoWarp:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "warp":
            raise AssertionError("a renderer loads Warp")


sys.meta_path.insert(0, NoWarp())
from pathlib import Path

from armwright.page.page import write_report
from armwright.proof.selection import pick_from

run = Path(sys.argv[1])
write_report(run)
history, members, records = pick_from(run, by="deflection")
print(records[members[0].number].facts["deflection"].text)
"""


@pytest.mark.slow
def test_page_and_choice_of_a_finished_run_load_no_kernel(tmp_path: Path) -> None:
    examples = ROOT / "examples"
    problem = aw.Problem(
        aw.load_task(examples / "2-assembly-task.yaml"), aw.load_space(examples / "2-assembly-space.yaml")
    )
    aw.find_front(problem, evaluations=600, out=tmp_path / "run")
    done = subprocess.run(
        [sys.executable, "-c", SHOW, str(tmp_path / "run")], capture_output=True, encoding="utf-8", check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(" mm\n")
    assert (tmp_path / "run" / "report.html").is_file()
