"""Print the modules whose functions run from a finished run to its page.

    python tools/call_path.py RUN

Imports do not count. The page of RUN is made before: what it shows is computed once, when a run ends.
"""

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import armwright
from armwright.page.page import write_report

PACKAGE = Path(armwright.__file__).parent


def modules_called(run: Path) -> list[str]:
    """Return the modules of the package, as paths, that writing the page of a run calls."""
    called: set[str] = set()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(str(PACKAGE)) and frame.f_code.co_name != "<module>":
            called.add(frame.f_code.co_filename)

    write_report(run)
    sys.setprofile(note)
    try:
        write_report(run)
    finally:
        sys.setprofile(None)
    return sorted(str(Path(name).relative_to(PACKAGE)) for name in called)


if __name__ == "__main__":
    found = modules_called(Path(sys.argv[1]))
    print("\n".join(found))
    print(f"{len(found)} modules")
