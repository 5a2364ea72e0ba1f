"""Make the pictures of README and docs again; some three minutes on two cores, and a browser.

python -m tools.pictures            # all of them
python -m tools.pictures page.png   # one
"""

import base64
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Locator, Page

from tests.support import browser
from tests.support.robots import robot

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
EXAMPLES = ROOT / "examples"
SIDE_BY_SIDE = """
main { display: inline-flex; gap: 16px; padding: 8px; background: white; font: 20px sans-serif; text-align: center }
figure { margin: 0 }
"""
Shot = Callable[[Path, Page, Path], None]


def armwright(folder: Path, *arguments: object) -> None:
    """Run an armwright command in a folder."""
    command = [Path(sys.executable).with_name("armwright"), *map(str, arguments)]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def once(folder: Path, run: str, *arguments: object) -> Path:
    """Run a command unless its run folder is there."""
    if not (folder / run).exists():
        armwright(folder, *arguments, "--out", run)
    return folder / run


def open_report(page: Page, run: Path, size: tuple[int, int], at: str = "", dark: bool = False) -> None:
    """Open the report of a run, and wait until it is drawn."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.emulate_media(color_scheme="dark" if dark else "light")
    page.goto((run / "report.html").as_uri() + at)
    page.locator("#loading").wait_for(state="hidden")
    page.wait_for_timeout(1500)  # the 3D view and the plots are drawn


def target_2(folder: Path) -> Path:
    """Return the run that most pictures show."""
    return once(folder, "runs/target-2", "optimize", "target-2", "--seed", 0)


def report(folder: Path, page: Page, file: Path) -> None:
    """Show the top of a report."""
    open_report(page, target_2(folder), (1280, 1340), "#design=120&target=2")
    page.screenshot(path=file)


def dark_report(folder: Path, page: Page, file: Path) -> None:
    """Compare two designs in the dark theme."""
    open_report(page, target_2(folder), (1280, 800), "#design=120", dark=True)
    page.locator("#compare").click()
    page.goto(page.url.partition("#")[0] + "#design=140")
    page.wait_for_timeout(1000)
    page.screenshot(path=file)


def engineer(size: tuple[int, int]) -> Shot:
    """Return a picture of the report that begins with the recommended designs, as three objectives have it."""

    def shot(folder: Path, page: Page, file: Path) -> None:
        command = ("design", EXAMPLES / "6-price-task.yaml", "--space", EXAMPLES / "6-price-space.yaml")
        open_report(page, once(folder, "runs/price", *command, "--evaluations", 2000), size)
        page.screenshot(path=file)

    return shot


def infeasible_report(folder: Path, page: Page, file: Path) -> None:
    """Show the report of a task that asks too much."""
    task = folder / "strict.yaml"
    text = (EXAMPLES / "8-stiffness-task.yaml").read_text(encoding="utf-8")
    task.write_text(text.replace("deflection <= 0.001", "deflection <= 0.0002"), encoding="utf-8")
    command = ("design", task, "--space", EXAMPLES / "8-stiffness-space.yaml", "--evaluations", 1000)
    open_report(page, once(folder, "runs/strict", *command), (1280, 700))
    page.screenshot(path=file)


def tutorial(folder: Path, page: Page, file: Path) -> None:
    """Show the report of the tutorial's second search."""
    text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    for name, key in (("feeder.yaml", "name: feeder"), ("space.yaml", "name: servo-arm")):
        block = next(b for b in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL) if b.startswith(key))
        (folder / name).write_text(block, encoding="utf-8")
    command = ["design", "feeder.yaml", "--space", "space.yaml", "--evaluations", 8000, "--seed", 14]
    open_report(page, once(folder, "runs/feeder", *command), (1280, 760), "#design=0&target=3")
    page.screenshot(path=file)


def open_arm(folder: Path, page: Page, task: str, space: str, evaluations: int, at: str, seed: int = 0) -> Locator:
    """Return the 3D view of an example, searched and opened."""
    command = ("design", EXAMPLES / task, "--space", EXAMPLES / space, "--evaluations", evaluations, "--seed", seed)
    open_report(page, once(folder, f"runs/{task}", *command), (1280, 1290), at)
    return page.locator("#arm-box")


def turn_arm(page: Page, drag: int, zoom: int) -> None:
    """Turn and enlarge the 3D view by the mouse."""
    page.locator("#arm-box canvas").scroll_into_view_if_needed()
    box = page.locator("#arm-box canvas").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + drag, y, steps=5)
    page.mouse.up()
    page.mouse.wheel(0, -zoom)
    page.wait_for_timeout(1000)


def arm_of(task: str, space: str, evaluations: int, at: str, drag: int = 0, zoom: int = 0, seed: int = 0) -> Shot:
    """Return a picture of the 3D view of an example, turned and enlarged."""

    def shot(folder: Path, page: Page, file: Path) -> None:
        view = open_arm(folder, page, task, space, evaluations, at, seed)
        turn_arm(page, drag, zoom)
        view.screenshot(path=file)

    return shot


def stiffness(folder: Path, page: Page, file: Path) -> None:
    """Show the recommended arms without and with a bound for the deflection, side by side."""
    views = (
        ("8-stiffness-unbounded-task.yaml", 0, "#design=5&target=2", "deflection unbounded: 23 mm"),
        ("8-stiffness-task.yaml", 0, "#design=0&target=2", "deflection at most 1 mm"),
    )
    figures = ""
    for task, seed, at, caption in views:
        view = open_arm(folder, page, task, "8-stiffness-space.yaml", 2000, at, seed)
        turn_arm(page, drag=35, zoom=700)
        picture = base64.b64encode(view.locator("canvas").screenshot()).decode()
        figures += f"<figure><img src='data:image/png;base64,{picture}'><figcaption>{caption}</figcaption></figure>"
    page.set_content(f"<style>{SIDE_BY_SIDE}</style><main>{figures}</main>")
    page.locator("main").screenshot(path=file)


def shelves(folder: Path) -> Path:
    """Return a run that two existing arms are compared with."""
    run = folder / "runs/shelves"
    if run.exists():
        return run
    task, space = (EXAMPLES / f"7-compare-arms-{part}.yaml" for part in ("task", "space"))
    once(folder, "runs/shelves", "design", task, "--space", space, "--evaluations", 4000)
    for name, robot_file in (("so101", "so101"), ("ur3", "ur3_robot")):
        shutil.copy(robot(robot_file), folder / f"{name}.urdf")
    armwright(folder, "compare-arms", task, "so101.urdf", "ur3.urdf", "--run", run)
    return run


def existing_arms(folder: Path, page: Page, file: Path) -> None:
    """Show a front with two existing arms."""
    shutil.copy(shelves(folder) / "figures/front.png", file)


def comparison(folder: Path, page: Page, file: Path) -> None:
    """Show the report of a run that existing arms are compared with."""
    open_report(page, shelves(folder), (1280, 1560))
    page.screenshot(path=file)


def six_axes(folder: Path, page: Page, file: Path) -> None:
    """Show the report of arms with six axes."""
    open_report(page, once(folder, "runs/six", "design", "box-palletising", "--evaluations", 2000), (1280, 1900))
    page.screenshot(path=file)


def editor(folder: Path, page: Page, file: Path) -> None:
    """Show the editor of an example."""
    for part in ("task", "space"):
        shutil.copy(EXAMPLES / f"2-assembly-{part}.yaml", folder)
    command = [Path(sys.executable).with_name("armwright"), "edit", "2-assembly-task.yaml"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True, encoding="utf-8") as server:
        assert server.stdout is not None
        page.set_viewport_size({"width": 1280, "height": 1480})
        page.emulate_media(color_scheme="light")
        page.goto(server.stdout.readline().strip())
        page.locator("#loading").wait_for(state="hidden")
        page.wait_for_timeout(1000)
        page.screenshot(path=file)
        server.terminate()


def arms(folder: Path, page: Page, file: Path) -> None:
    """Show the designs of one run that its figure arms.png picks."""
    shutil.copy(target_2(folder) / "figures/arms.png", file)


PICTURES: dict[str, Shot] = {
    "arms.png": arms,
    "page.png": report,
    "page-dark.png": dark_report,
    "page-recommended.png": engineer((1280, 1500)),
    "page-phone.png": engineer((390, 844)),
    "page-infeasible.png": infeasible_report,
    "page-six-axes.png": six_axes,
    "page-comparison.png": comparison,
    "editor.png": editor,
    "tutorial.png": tutorial,
    "example-shelf.png": arm_of(
        "3-long-shelf-task.yaml", "3-long-shelf-space.yaml", 4000, "#design=0&target=4", drag=90, zoom=250, seed=1
    ),
    "example-obstacles.png": arm_of(
        "5-obstacle-reach.yaml", "5-obstacle-reach-space.yaml", 4000, "#design=13&target=3", zoom=-150, seed=2
    ),
    "example-stiffness.png": stiffness,
    "compare-arms.png": existing_arms,
}


def main() -> None:
    """Make the pictures that the command line names, or all."""
    names = sys.argv[1:] or list(PICTURES)
    program = browser.program()
    if program is None:
        raise SystemExit(f"found no browser; expected one of {', '.join(browser.NAMES)}")
    with tempfile.TemporaryDirectory() as temporary, browser.browser(program) as started:
        for name in names:
            page = started.new_page()
            PICTURES[name](Path(temporary), page, DOCS / name)
            page.close()
            print(name, flush=True)


if __name__ == "__main__":
    main()
