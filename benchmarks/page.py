"""The page: how large it is, how long it takes to make and to open, and how soon a selection answers.

    python benchmarks/page.py      # needs chromium on the path; some minutes

A selection is timed from the call to the end of all that the page does for it, and to the next frame; without a
graphics card that frame is drawn in software, which is most of it.
"""

import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import armwright as aw

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.browser import Tab, browser, program

SELECT = """async () => {
  const { content, set } = armwright, front = content.head.front, found = [];
  for (let k = 0; k < 30; k++) {
    const began = performance.now();
    set({ design: front[(7 * k) % front.length] });
    const done = performance.now() - began;
    await new Promise((told) => requestAnimationFrame(() => setTimeout(told, 0)));
    found.push([done, performance.now() - began]);
    await new Promise((told) => setTimeout(told, 100));
  }
  return found;
}"""


def main() -> None:
    path = program()
    if path is None:
        sys.exit("chromium is not on the path")
    rng = np.random.default_rng(1)
    points = np.round(rng.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 0.8], (20, 3)), 3)
    twenty = aw.Task(name="twenty", targets=tuple(map(tuple, points.tolist())), reference_point=(12.5, 12.5))
    with tempfile.TemporaryDirectory() as place, browser(path) as started:
        cycle = aw.Problem(aw.load_task("desk-sorting"), aw.load_space("desk-sorting"))
        runs = {
            "210 designs, 9 targets": (aw.Problem(aw.load_task("target-2")), 200),
            "10,000 designs, 20 targets": (aw.Problem(twenty), 9_990),
            "front of `design`, with a cycle": (cycle, 0),
            "10,000 designs with a cycle": (cycle, 9_990),
        }
        print("| run | size | made in | opens in | a selection is done, shown after |\n|---|---|---|---|---|")
        for number, (name, (problem, n_total)) in enumerate(runs.items()):
            folder = Path(place, str(number))
            sampler, proposer = ("random", "none") if n_total > 200 else ("tpe", "rules")
            if n_total:
                aw.optimize(problem, proposer=proposer, sampler=sampler, n_total=n_total, out=folder, verify=False)
            else:
                aw.find_front(problem, evaluations=2000, out=folder)
            began = time.perf_counter()
            page = aw.write_report(folder)
            made = time.perf_counter() - began
            opened: list[float] = []
            selections: list[list[float]] = []
            for _ in range(3):
                tab = Tab(started, offline=True)
                began = time.perf_counter()
                tab.open(page)
                opened.append(time.perf_counter() - began)
                selections += tab.page.evaluate(SELECT)
                tab.close()
            done, shown = np.median(selections, axis=0)
            print(
                f"| {name} | {page.stat().st_size / 1e6:.2f} MB | {made:.2f} s | {statistics.median(opened):.2f} s | "
                f"{done:.0f} ms, {shown:.0f} ms |",
                flush=True,
            )


if __name__ == "__main__":
    main()
