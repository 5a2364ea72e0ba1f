"""Runs armwright's commands in this process as after `pip install .`: no package of an extra can be imported.

python -m tests.support.base_install '[["check", "target-1"], ...]'     # prints [[exit code, stdout, stderr], ...]
"""

import json
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

from armwright.extras import EXTRAS

PACKAGES = {package for packages in EXTRAS.values() for package in packages}


class WithoutExtras:
    """Finds no package of an extra."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name in PACKAGES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


if __name__ == "__main__":
    sys.meta_path.insert(0, WithoutExtras())
    from tests.support.command_line import armwright

    ended = [armwright(*arguments) for arguments in json.loads(sys.argv[1])]
    print(json.dumps([(done.returncode, done.stdout, done.stderr) for done in ended]))
