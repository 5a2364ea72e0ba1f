"""A PostgreSQL server of our own, on a socket in a folder of its own."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

PLACES = ("/usr/lib/postgresql", "/opt/homebrew/opt", "/usr/local/opt")
USER = "postgres"  # a server never runs as root; Debian's package makes this user


def binaries() -> Path | None:
    """The folder with initdb and pg_ctl, where PostgreSQL is installed."""
    on_path = shutil.which("initdb")
    if on_path is not None:
        return Path(on_path).resolve().parent
    found = [path.parent for place in PLACES for path in Path(place).glob("*/bin/initdb")]
    return max(found, default=None)


class PostgresServer:
    """Begins empty; `url` is what SQLAlchemy takes for a new database."""

    def __init__(self, programs: Path) -> None:
        self._programs = programs
        self._place = Path(tempfile.mkdtemp(prefix="pg", dir="/tmp"))  # a socket's path has at most 107 characters
        self._as_user = ["runuser", "-u", USER, "--"] if os.geteuid() == 0 else []
        if self._as_user:
            shutil.chown(self._place, USER)
        self._data = self._place / "data"
        self._run("initdb", "--auth=trust", f"--username={USER}", "--no-sync", f"--pgdata={self._data}")
        self._databases = 0

    def start(self) -> None:
        options = f"-k {self._place} -c listen_addresses='' -c fsync=off"
        log = self._place / "log"
        self._run("pg_ctl", "start", "--wait", f"--pgdata={self._data}", f"--log={log}", f"--options={options}")

    def stop(self, mode: str = "fast") -> None:
        self._run("pg_ctl", "stop", "--wait", f"--mode={mode}", f"--pgdata={self._data}")

    def database(self) -> str:
        """A new database."""
        self._databases += 1
        name = f"study{self._databases}"
        self._run("createdb", f"--host={self._place}", f"--username={USER}", name)
        return f"postgresql+psycopg://{USER}@/{name}?host={self._place}"

    def remove(self) -> None:
        shutil.rmtree(self._place)

    def _run(self, program: str, *arguments: str) -> None:
        # pg_ctl's server holds what it inherits; with pipes this call would never end.
        with (self._place / "words").open("w+") as words:
            command = [*self._as_user, str(self._programs / program), *arguments]
            done = subprocess.run(command, stdout=words, stderr=words, stdin=subprocess.DEVNULL, cwd="/")
            if done.returncode:
                words.seek(0)
                raise RuntimeError(f"{program}: {words.read()}")
