"""Tests of armwright, its documentation and its packages."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
