"""The array type of the whole package, and files of arrays."""

import math
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_OBJECTIVE = 1e60  # in magnitude; the hypervolume of five objectives stays finite
MAX_ARRAYS = 1024 * 1024 * 1024  # [bytes] of a file's arrays, which may be packed a thousandfold


@contextmanager
def open_arrays(path: Path) -> Generator[Mapping[str, NDArray[Any]]]:
    """Open an npz file that may be a stranger's; ValueError if its arrays are too large."""
    with path.open("rb") as file:
        with ZipFile(file) as packed:  # which reads no more of an entry than the size that it states
            if sum(entry.file_size for entry in packed.infolist()) > MAX_ARRAYS:
                raise ValueError(f"expected arrays of at most {MAX_ARRAYS // 1024**2:,} MiB")
        file.seek(0)
        with np.load(file, allow_pickle=False) as arrays:
            yield arrays


def finite_or_none(value: float) -> float | None:
    """Return a value as float; None if it is not finite, which is how tables and JSON state what is not known."""
    return float(value) if math.isfinite(value) else None
