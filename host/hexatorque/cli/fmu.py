"""`fmu`: the controller or the whole drive for other simulation tools."""

from __future__ import annotations

from pathlib import Path

import click

from . import options
from .group import examples


@click.command(
    "fmu",
    epilog=examples(
        "fmu mine.fmu --setup mine.toml",
        "fmu mine.fmu --setup mine.toml --fmi 3",
        "fmu drive.fmu --setup mine.toml --kind drive",
        "fmu out/dtc3.fmu --setup paper-b --set controller.scheme=dtc3 --only-here",
        note="With pip install 'hexatorque[fmu]' the file has binaries for Linux, Windows and "
        "macOS, else for Linux alone.",
    ),
)
@click.argument("file", metavar="FILE.fmu", type=click.Path(path_type=Path), help="the new FMU")
@options.setup("paper-a")
@options.settings
@click.option(
    "--kind",
    type=click.Choice(("controller", "drive")),
    default="controller",
    help="the controller alone, or with inverter, machine and sensors",
)
@click.option(
    "--fmi",
    "version",
    type=click.Choice(("2", "3")),
    default="2",
    help="version of FMI, 2.0 or 3.0",
)
@click.option("--only-here", is_flag=True, help="no binaries for other systems")
def fmu(file, setup, settings, kind, version, only_here) -> int:
    """Write the controller, or the whole drive, as an FMU, for co-simulation in other tools.

    The FMU has the whole firmware with its registers. Currents, voltage and shaft angle are its
    inputs, the legs' duty ratios and switching instants its outputs. See docs/fmu.md.
    """
    from .. import setups

    if file.suffix != ".fmu":
        raise options.Mistake(f"{file}: the name must end with .fmu")
    loaded = setups.load(setup).changed(options.settings_given(settings))
    from ..fmu import controller

    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        systems = controller.write(
            file,
            loaded,
            kind,
            int(version),
            only_here,
            lambda name: click.echo(f"compiling: {name}"),
        )
    except OSError as error:
        raise options.Mistake(f"{file}: {error.strerror}") from None
    print(f"{file}: FMI {version}.0 for {', '.join(systems)}, with sources")
    return 0
