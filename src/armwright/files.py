"""Files replaced in one step."""

import os
from pathlib import Path


def replace_file(target: Path, content: bytes) -> None:
    """Writes a file so that a crash, and whoever reads it meanwhile, finds the old one or the new one."""
    part = target.with_name(target.name + ".part")
    part.write_bytes(content)
    os.replace(part, target)
