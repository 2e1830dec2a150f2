"""What several commands share: options, tables, progress, JSON."""

from __future__ import annotations

import argparse
import json


def point_options(parser: argparse.ArgumentParser, setup: str) -> None:
    """Schemes of a set-up at an operating point; `setup` says what it is without one."""
    parser.add_argument("--setup", metavar="NAME|FILE", help=f"default: {setup}")
    parser.add_argument("--schemes", metavar="A,B,...", help="default: all")
    parser.add_argument("--speed", type=float, metavar="RPM", help="default: the set-up's point")
    parser.add_argument("--load", type=float, metavar="NM", help="default: the set-up's point")
    parser.add_argument(
        "--latency", metavar="L", help="none, immediate, shadow or predicted; default: the set-up's"
    )


def console_of(as_json: bool):
    """Tables go to standard output, or to standard error beside JSON."""
    from rich.console import Console

    return Console(stderr=as_json)


def progress(console):
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} s simulated"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )


def print_json(data: object) -> None:
    print(json.dumps(data, indent=1))


def schemes_given(text: str | None) -> list[str]:
    """The schemes of a --schemes option; all without one."""
    from . import firmware
    from .scenario import ScenarioError

    if text is None:
        return list(firmware.schemes())
    names = [part.strip() for part in text.split(",")]
    for name in names:
        if name not in firmware.schemes():
            raise ScenarioError(f"no scheme {name!r}: choose from {', '.join(firmware.schemes())}")
    return list(dict.fromkeys(names))
