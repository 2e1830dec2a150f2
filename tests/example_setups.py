"""The examples that are set-ups: all but those that describe a sweep."""

import tomllib
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def example_setups() -> list[Path]:
    files = sorted(EXAMPLES.glob("*.toml"))
    return [file for file in files if "vary" not in tomllib.loads(file.read_text())]
