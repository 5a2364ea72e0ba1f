"""Builds sdist and wheel into dist/, looks into them, and tries the wheel in bare environments; checks CITATION.cff.

    python tools/package.py [PYTHON]        # a Python to install into, such as python3.13; without it, this one

The wheel is installed alone, with the newest versions of all that it needs, as pip does it; and with the extras
`figures` and `studies`, with the lowest versions that pyproject.toml allows. Both must pass tools/smoke.py.
"""

import shutil
import subprocess
import sys
import tarfile
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
CITED = ("--from", "cffconvert==2.0.0", "cffconvert", "--validate", "--infile", "CITATION.cff")
EXTRAS = ("figures", "studies")  # without which little can be tried
NOT_PACKED = (".ci/",)  # of what git holds


def run(*command: str | Path, folder: Path = ROOT) -> None:
    """Print and run a command; raises CalledProcessError if it fails."""
    print("$", *command, flush=True)
    subprocess.run([str(part) for part in command], cwd=folder, check=True)


def build() -> tuple[Path, Path]:
    """Build the sdist and, from it, the wheel; return both."""
    shutil.rmtree(DIST, ignore_errors=True)
    run(sys.executable, "-m", "build", "--outdir", DIST)
    (sdist,), (wheel,) = DIST.glob("*.tar.gz"), DIST.glob("*.whl")
    return sdist, wheel


def check_sdist(sdist: Path) -> None:
    """Check that the sdist holds exactly the files of git."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True, encoding="utf-8"
    ).stdout
    tracked = {name for name in listed.splitlines() if not name.startswith(NOT_PACKED)}
    with tarfile.open(sdist) as archive:
        packed = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    check("sdist", packed, tracked | {"PKG-INFO"})


def check_wheel(wheel: Path) -> None:
    """Check that the wheel holds src/armwright, its metadata and the licences, and nothing else."""
    listed = subprocess.run(
        ["git", "ls-files", "src"], cwd=ROOT, check=True, capture_output=True, text=True, encoding="utf-8"
    ).stdout
    tracked = {name.removeprefix("src/") for name in listed.splitlines()}
    info = "-".join(wheel.name.split("-")[:2]) + ".dist-info/"
    licences = {f"{info}licenses/{name}" for name in listed.splitlines() if name.endswith("LICENSE")}
    own = {info + name for name in ("METADATA", "WHEEL", "RECORD", "entry_points.txt", "licenses/LICENSE")}
    with ZipFile(wheel) as archive:
        check("wheel", set(archive.namelist()), tracked | licences | own)


def check(where: str, packed: set[str], wanted: set[str]) -> None:
    """SystemExit where what is packed is not what is wanted."""
    wrong = [f"- {name}" for name in sorted(wanted - packed)] + [f"+ {name}" for name in sorted(packed - wanted)]
    if wrong:
        sys.exit("\n".join([f"the {where} lacks (-), or holds though git does not (+):", *wrong]))
    print(f"{where}: {len(packed)} files, as git holds them")


def try_tests(sdist: Path, folder: Path) -> None:
    """All tests of the sdist are found, and those of its public face pass, without the checkout."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    unpacked = folder / sdist.name.removesuffix(".tar.gz")
    pytest = ("env", f"PYTHONPATH={unpacked / 'src'}", sys.executable, "-m", "pytest", "-n", "0")
    run(*pytest, "--collect-only", "--quiet", "--quiet", folder=unpacked)
    run(*pytest, "tests/test_public.py", "tests/tasks/test_task.py", folder=unpacked)


def install_newest(wheel: Path, python: str, folder: Path) -> Path:
    """Install the base, as a user does; return its Python."""
    own = environment(python, folder)
    run(own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel)
    return own


def install_lowest(wheel: Path, python: str, folder: Path) -> Path:
    """Install extras in the lowest versions that pyproject.toml allows; return their Python."""
    own = environment(python, folder)
    uv = (sys.executable, "-m", "uv", "pip", "install", "--quiet", "--system-certs", "--python", own)
    # The oldest versions have no wheels for the newest Pythons, whose lowest are then those that have.
    lowest = ("--resolution", "lowest-direct", "--only-binary", ":all:")
    extras = [option for extra in EXTRAS for option in ("--extra", extra)]
    run(*uv, *lowest, "--requirements", ROOT / "pyproject.toml", *extras)
    run(*uv, "--no-deps", wheel)
    return own


def environment(python: str, folder: Path) -> Path:
    """Create a bare environment and return its Python."""
    run(python, "-m", "venv", folder)
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def smoke(python: Path, folder: Path) -> None:
    """tools/smoke.py by that Python, away from the checkout."""
    (folder / "runs").mkdir(exist_ok=True)
    run(python, "-P", ROOT / "tools" / "smoke.py", folder / "runs", folder=folder)


def main(python: str) -> None:
    """All of it."""
    run(sys.executable, "-m", "uv", "tool", "run", "--quiet", "--system-certs", *CITED)
    sdist, wheel = build()
    check_sdist(sdist)
    check_wheel(wheel)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        newest = pool.submit(install_newest, wheel, python, Path(folder) / "newest")
        lowest = pool.submit(install_lowest, wheel, python, Path(folder) / "lowest")
        tests = pool.submit(try_tests, sdist, Path(folder))
        smoke(newest.result(), Path(folder))
        smoke(lowest.result(), Path(folder))  # on what the base install left
        tests.result()
    print(f"{sdist.name} and {wheel.name} are in {DIST}/")


if __name__ == "__main__":
    main(*sys.argv[1:] or [sys.executable])
