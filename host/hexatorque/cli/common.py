"""What several commands share: options, tables, progress, JSON."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

COMPILING = "compiling the simulation: once, for up to a minute ..."


def point_options(parser: argparse.ArgumentParser, setup: str) -> None:
    """Schemes of a set-up at an operating point; `setup` says what it is without one."""
    parser.add_argument("--setup", metavar="NAME|FILE", help=f"default: {setup}")
    parser.add_argument("--schemes", metavar="A,B,...", help="default: all")
    parser.add_argument("--speed", type=float, metavar="RPM", help="default: the set-up's point")
    parser.add_argument("--load", type=float, metavar="NM", help="default: the set-up's point")
    parser.add_argument(
        "--latency", metavar="L", help="none, immediate, shadow or predicted; default: the set-up's"
    )


#: Width of what is no terminal: no line of a table is broken there.
WIDE = 1000


def console_of(as_json: bool, highlight: bool = True):
    """Tables go to standard output, or to standard error beside JSON. COLUMNS, or the
    terminal, says how wide they may be."""
    from rich.console import Console

    console = Console(stderr=as_json, highlight=highlight)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = WIDE
    return console


@contextmanager
def compiling() -> Iterator[None]:
    """Say so on standard error while the simulation is compiled in this block."""
    from rich.console import Console

    from ..drive.compiling import watched

    console, shown = Console(stderr=True), ExitStack()

    def begun() -> None:
        if console.is_terminal:
            shown.enter_context(console.status(COMPILING))
        else:
            print(COMPILING, file=sys.stderr, flush=True)

    with shown, watched(begun, shown.close):
        yield


def compile_now() -> None:
    """Before a command simulates: compile what has to be compiled, and say so."""
    from ..drive.compiling import compile_now

    with compiling():
        compile_now()


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
    from .. import firmware
    from ..setups import SetupError

    if text is None:
        return list(firmware.schemes())
    names = [part.strip() for part in text.split(",")]
    for name in names:
        if name not in firmware.schemes():
            raise SetupError(f"no scheme {name!r}: choose from {', '.join(firmware.schemes())}")
    return list(dict.fromkeys(names))
