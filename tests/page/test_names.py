"""Names in a run folder are text on its page."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from armwright.page.page import write_report
from tests.fuzz.run_targets import EXISTING, a_run
from tests.support.browser import Tab

LINK = (
    '<a href="https://evil.example/">click</a><img src=x onerror="window.hacked = 1"><script>window.hacked = 2</script>'
)


def changed(file: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> list[dict[str, Any]]:
    """Change each line of a file of records."""
    records = [change(json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]
    file.write_text("".join(f"{json.dumps(record)}\n" for record in records), encoding="utf-8")
    return records


def test_names_in_a_run_folder_are_escaped(tmp_path: Path, tab: Tab) -> None:
    """The answers of a model, and names of objectives, sources, faults, arms and the folder, may be a stranger's."""
    folder = Path(shutil.copytree(a_run(), tmp_path / re.sub("[/]", "", LINK)[:60]))
    config = yaml.safe_load((folder / "config.yaml").read_text(encoding="utf-8"))
    for objective in config["objectives"]:
        objective |= {"label": LINK, "unit": LINK, "symbol": LINK}
    config["method"]["proposer"]["name"] = LINK
    config["space"]["name"] = LINK[:100]
    config["task"] |= {"description": LINK, "provenance": LINK}
    config["versions"]["armwright"] = LINK
    (folder / "config.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    names = {"source": LINK, "reason": LINK, "proposal": LINK, "fault": LINK}
    trials = changed(folder / "trials.jsonl", lambda trial: trial | (names if trial["number"] > 2 else {}))
    calls = changed(folder / "transcripts.jsonl", lambda call: call | {"prompt": LINK, "answer": LINK})
    fact = {"label": LINK, "unit": LINK, "explanation": LINK, "value": 0.5}
    arm = {**EXISTING, "values": trials[-1]["values"], "facts": {"mass": fact, LINK: fact}, "notes": [LINK]}
    (folder / "existing_arms.json").write_text(json.dumps([arm | {"name": LINK}]), encoding="utf-8")
    for file in (folder / "designs").glob("*/design.json"):
        record = json.loads(file.read_text(encoding="utf-8"))
        record["facts"] |= {name: {**one, "label": LINK, "explanation": LINK} for name, one in record["facts"].items()}
        file.write_text(json.dumps(record), encoding="utf-8")
    (folder / "command.txt").write_text(LINK, encoding="utf-8")
    page = write_report(folder)
    tab.open(page, "#design=5")
    tab.page.locator("#pareto").hover()
    tab.page.locator("#all-calls").check()
    assert tab.page.locator("#transcript .call").count() == len(calls)
    tab.page.locator("#configuration-box summary").click()
    assert tab.ask("window.hacked") is None
    made = tab.ask("[...document.querySelectorAll('a, img, image')].map((one) => one.outerHTML)")
    assert [html for html in made if re.search("evil|src=.?x", html)] == []
    assert "evil.example" in tab.ask("document.body.textContent")
    assert [address for address in tab.requests if not address.startswith(("file:", "data:", "blob:"))] == []
