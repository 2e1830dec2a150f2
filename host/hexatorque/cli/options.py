"""Options that several commands take, each defined once, and how their text is read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import click

from ..errors import InputError
from ..given import real
from ..recording.formats import suffixes_text
from . import completion

#: The latest time of a --break option.
MOST_AFTER_S = 1e6


class Mistake(InputError):
    """A mistake in the command line."""


# -- reading ------------------------------------------------------------------------------


def number(text: str) -> float:
    try:
        return real(str(text))  # click passes a default of an option too
    except ValueError:
        raise click.BadParameter(f"{text!r}: a number is needed") from None


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise click.BadParameter(f"{text!r}: a whole number is needed") from None


def seconds(text: str) -> float:
    with suppress(ValueError):
        if 0 < real(str(text)) < math.inf:
            return real(str(text))
    raise click.BadParameter(f"{text!r}: a time above 0 s is needed")


def line_rate(text: str) -> int:
    if text.isdecimal() and int(text) > 0:
        return int(text)
    raise click.BadParameter(f"{text!r}: a rate above 0 is needed")


def http_port(text: str) -> int:
    if text.isdecimal() and int(text) < 65536:
        return int(text)
    raise click.BadParameter(f"{text!r}: allowed range is 0 .. 65535")


def break_given(text: str) -> tuple[str, str, float]:
    """Phase, kind and time of a --break option: u1=open, or u1=open@2.5."""
    from ..plant.legs import KINDS
    from ..plant.vsd import PHASES

    what, at, after = text.partition("@")
    phase, equals, kind = what.partition("=")
    if not equals or phase not in PHASES or kind not in KINDS:
        raise click.BadParameter(
            f"{text!r}: PHASE=KIND or PHASE=KIND@SECONDS is needed, with a phase of "
            f"{', '.join(PHASES)} and a kind of {', '.join(KINDS)}"
        )
    with suppress(ValueError):
        after_s = real(after) if at else 0.0
        if 0 <= after_s <= MOST_AFTER_S:
            return phase, kind, after_s
    raise click.BadParameter(f"{text!r}: allowed range of the time is 0 .. {MOST_AFTER_S:g} s")


def trip_pin_given(text: str) -> tuple[float, float | None]:
    """Begin and length of a --trip-pin option: 5, or 5+2."""
    after, plus, length = text.partition("+")
    with suppress(ValueError):
        after_s, for_s = real(after), real(length) if plus else None
        if 0 <= after_s <= MOST_AFTER_S and (for_s is None or 0 < for_s <= MOST_AFTER_S):
            return after_s, for_s
    raise click.BadParameter(
        f"{text!r}: SECONDS or SECONDS+LENGTH is needed, both up to {MOST_AFTER_S:g} s"
    )


def schemes_given(text: str | None, laws: bool = False) -> list[str]:
    """The schemes of a --schemes option; all of the firmware without one. `laws`: references, and
    files with a law, are among them."""
    from .. import firmware
    from ..laws import named

    if text is None:
        return list(firmware.schemes())
    return list(dict.fromkeys(named(part.strip(), laws) for part in text.split(",")))


def settings_given(texts: Sequence[str]) -> dict[str, str]:
    """Keys and values, still text, of --set options."""
    from ..setups.paths import assignment

    return dict(assignment(text, "--set") for text in texts)


#: The key that --scheme or --schemes stands for.
SCHEME = "controller.scheme"


def settings_beside(texts: Sequence[str], option: str, says: str) -> dict[str, str]:
    """The same for a command in which an option of its own says the scheme."""
    values = settings_given(texts)
    if SCHEME in values:
        raise Mistake(f"--set {SCHEME}: here {option} says {says}")
    return values


# -- options ------------------------------------------------------------------------------


def value(*names: str, metavar: str, type=str, **more):
    """An option with a value of which the help shows only our own metavar."""
    return click.option(*names, metavar=metavar, type=type, **more)


def file(*names: str, metavar: str, **more):
    """An option that names a file or a folder; whether it can be used is checked later."""
    return click.option(*names, metavar=metavar, type=click.Path(path_type=Path), **more)


def together(*options):
    """Several options as one decorator, in this order in the help."""

    def add(command):
        for option in reversed(options):
            command = option(command)
        return command

    return add


as_json = click.option("--json", "as_json", is_flag=True, help="result as JSON on standard output")
quick = click.option("--quick", is_flag=True, help="fewer cases, shorter runs")


def folder(default: str):
    return file(
        "-o", "--output", metavar="DIR", default=Path(default), help="folder for the results"
    )


def setup(default: str | None, without: str | None = None):
    """`without`: what is meant without this option, if no default says it."""
    return value(
        "--setup",
        metavar="NAME|FILE",
        default=default,
        help="a built-in set-up or a file" + (f"; default: {without}" if without else ""),
        shell_complete=completion.setup,
    )


schemes = value(
    "--schemes",
    metavar="A,B,...",
    help="control schemes; default: all",
    shell_complete=completion.schemes,
)
schemes_or_laws = value(
    "--schemes",
    metavar="A,B,...",
    help="control schemes, references and files with a law; default: all schemes of the firmware",
    shell_complete=completion.schemes_or_laws,
)
load = value("--load", metavar="NM", type=number, help="load torque; default: the set-up's point")


settings = value(
    "--set",
    "settings",
    metavar="SECTION.KEY=VALUE",
    multiple=True,
    help="another value for a key of the set-up, such as timing.latency=shadow; may be repeated",
    shell_complete=completion.setting,
)


def at_point(without: str, *between):
    """A set-up at an operating point. between: other options, after the set-up."""
    return together(
        setup(None, without),
        *between,
        value(
            "--speed",
            metavar="RPM",
            type=number,
            help="speed; default: the set-up's point, or half of rated speed",
        ),
        load,
        settings,
    )


def point(without: str, schemes=schemes):
    """Schemes of a set-up at an operating point."""
    return at_point(without, schemes)


baud = value(
    "--baud", metavar="N", type=line_rate, help="rate of the line; default: those of the images"
)
#: Which board.
board = together(
    value(
        "--device",
        metavar="PORT",
        help="the board's port: /dev/ttyUSB0, socket://host:port; default: the only board",
    ),
    baud,
)
duration = value(
    "--duration", metavar="S", type=seconds, help="seconds to run; default: until Ctrl-C"
)
#: What is set before a start.
before_start = together(
    value(
        "--scheme", metavar="NAME", help="set the scheme first", shell_complete=completion.scheme
    ),
    value("--speed", metavar="RPM", type=number, help="set the speed reference first"),
    value(
        "--set",
        "others",
        metavar="NAME=VALUE",
        multiple=True,
        help="set any other parameter first; may be repeated",
        shell_complete=completion.assignment,
    ),
)
#: For tables of oscilloscopes and other programs.
of_tables = together(
    value(
        "--map",
        "maps",
        metavar="CH1=NAME*K",
        multiple=True,
        help="rename and scale a channel: CH1=i_u1_A*100, /K, +OFFSET; may be repeated",
    ),
    value("--shift", metavar="S", help="seconds to add to the times of these files"),
)
channels = click.argument(
    "channels",
    metavar="CH...",
    nargs=-1,
    required=True,
    shell_complete=completion.channel,
    help="channels of the board",
)
recording = file(
    "-o", "--output", metavar="FILE", required=True, help=f"recording: {suffixes_text()}"
)
recording_or_none = file("-o", "--output", metavar="FILE", help=f"recording: {suffixes_text()}")


def scenario(required: bool):
    return click.argument(
        "scenario",
        metavar="SCENARIO.toml" if required else "[SCENARIO.toml]",
        required=required,
        shell_complete=completion.files,
        help="set-up with a section [profile]",
    )


of_setup = click.argument(
    "setup",
    metavar="NAME|FILE",
    shell_complete=completion.setup,
    help="a built-in set-up or a file",
)
