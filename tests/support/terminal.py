"""Run armwright in a terminal of a given width."""

import fcntl
import os
import pty
import re
import struct
import sys
import termios

_ESCAPE = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]")


def in_terminal(width: int, *arguments: str) -> tuple[int, list[str]]:
    """Return the exit code of a command and what a terminal of this width has on its lines in the end."""
    child, terminal = pty.fork()
    if child == 0:
        environment = {name: value for name, value in os.environ.items() if name != "COLUMNS"} | {"TERM": "xterm"}
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
        os.execve(sys.executable, [sys.executable, "-m", "armwright", *arguments], environment)
    written = b""
    while True:
        try:
            part = os.read(terminal, 65536)
        except OSError:  # the command has ended
            break
        written += part
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    text = _ESCAPE.sub("", written.decode("utf-8", "replace")).replace("\r\n", "\n")
    return os.waitstatus_to_exitcode(status), [line.split("\r")[-1] for line in text.split("\n")]
