"""The `hexatorque` command: all groups of commands, and how a command ends.

Exit codes: 0 done; 1 it ran, but a drive tripped or did not reach its point, a study
found what must not be, or a target differs from the host or does not answer;
2 the command line, a file or a value is wrong; 130 interrupted.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from contextlib import suppress
from typing import Any

import click

from .. import __version__, system
from ..errors import HexatorqueError
from . import completion
from .board.app import board
from .evidence.app import evidence
from .fmu import fmu
from .group import Group, examples
from .output import complain
from .own_machine import check, new
from .recordings import convert, plot
from .simulate import compare, reach, run
from .sweep import sweep
from .tables import setups
from .tuning import tune


@click.group(
    cls=Group,
    context_settings={"show_default": True},
    epilog=examples(
        "compare --setup paper-b --schemes dtc1,dtc2,dtc3",
        "run examples/reversal.toml -o out/reversal.npz",
        "plot out/reversal.npz bench.csv",
        "setups paper-b",
        "board serve",
        "board start --speed 400",
        "evidence papers all",
    ),
)
@click.version_option(__version__, message="hexatorque %(version)s")
@completion.options
def app() -> None:
    """Direct torque control of six-phase drives: simulate the C firmware, and drive boards
    with it."""


COMMANDS = (
    run,
    compare,
    reach,
    sweep,
    plot,
    convert,
    setups,
    new,
    check,
    tune,
    fmu,
    board,
    evidence,
)
for command in COMMANDS:
    app.add_command(command)


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code. A user's mistake ends in one line on standard error.
    Libraries warn developers, not users: what they warn of is shown with PYTHONWARNINGS only."""
    system.prepare_output()
    if not sys.warnoptions:
        warnings.showwarning = _nothing
    try:
        code = app.main(
            argv,
            prog_name="hexatorque",
            complete_var=completion.VARIABLE,
            standalone_mode=False,
        )
        if sys.stdout is not None:
            sys.stdout.flush()  # here a full disk is still told in one line
        return code
    except click.Abort:  # before a command began
        complain("interrupted")
        return 130
    except click.ClickException as error:
        complain(_usage(error))
        return 2
    except HexatorqueError as error:
        complain(str(error))
        return error.exit_code
    except BrokenPipeError:  # the reader has seen enough
        _drop_output()
        return 1
    except OSError as error:  # of the output, or of a file that no command expects
        complain(f"{error.filename or 'output'}: {error.strerror or error}")
        _drop_output()
        return 1
    except ArithmeticError as error:  # compiled code of the plant knows no other errors
        complain(str(error))
        return 1


def _drop_output() -> None:
    """What standard output could not take would fail once more when Python ends."""
    with suppress(OSError), open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _nothing(*_: Any, **__: Any) -> None:
    pass


def _usage(error: click.ClickException) -> str:
    """The mistake in the command line, in one line."""
    ctx = getattr(error, "ctx", None)
    text = " ".join(error.format_message().split()).rstrip(".")
    text = re.sub(r"^Invalid value for '(?:-\w' / ')?([^']*)': ", r"\1: ", text)
    text = text[:1].lower() + text[1:]
    if ctx is None or "hexatorque" in text:
        return text
    if text == "missing command":
        text += f": choose from {', '.join(ctx.command.commands)}"
    return f"{text}; see `{ctx.command_path} --help`"
