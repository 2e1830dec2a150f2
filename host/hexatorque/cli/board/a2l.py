"""`hexatorque board a2l`: the board's parameters and channels for calibration tools."""

from __future__ import annotations

from pathlib import Path

import click

from .. import options
from ..group import examples


@click.command(
    "a2l",
    epilog=examples(
        "board a2l hexatorque.a2l",
        "board a2l bench.a2l --baud 937500",
        note="With a virtual board: hexatorque board serve --xcp 5555",
    ),
)
@click.argument("file", metavar="FILE.a2l", type=click.Path(path_type=Path), help="the new file")
@options.value(
    "--xcp", metavar="PORT", type=int, default=5555, help="TCP and UDP port of a virtual board"
)
@options.baud
def a2l(file, xcp, baud) -> int:
    """Write parameters and channels as an A2L file, for tools that speak XCP.

    Addresses are virtual, so the file serves each board of this version, real, virtual or emulated.
    See docs/xcp.md.
    """
    from ...boards.a2l import BAUD, text

    if file.suffix != ".a2l":
        raise options.Mistake(f"{file}: the name must end with .a2l")
    if not 0 < xcp <= 65535:
        raise options.Mistake(f"--xcp {xcp}: allowed range is 1 .. 65535")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text(xcp, baud or BAUD), encoding="utf-8")
    except OSError as error:
        raise options.Mistake(f"{file}: {error.strerror}") from None
    print(f"{file}: for XCP by TCP and UDP, port {xcp}, and by a serial port")
    return 0
