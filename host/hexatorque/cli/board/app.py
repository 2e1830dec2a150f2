"""`hexatorque board`: everything that touches a board, virtual or real."""

import click

from ..group import Group, examples
from .a2l import a2l
from .commission import commission
from .compare import compare
from .drive import clear, list_boards, set_parameters, start, status, stop
from .log import log
from .monitor import monitor
from .params import params
from .record import capture, stream, watch
from .serve import serve


@click.group(
    cls=Group,
    epilog=examples(
        "board serve",
        "board list",
        "board start --scheme ddr --speed 400",
        "board set speed=200",
    ),
)
def board() -> None:
    """Boards on a serial port, virtual or real: find, start, stop, set, record.

    The port is found by itself if there is one board. All hexatorque commands share a port.
    """


for command in (
    serve,
    list_boards,
    status,
    start,
    stop,
    clear,
    set_parameters,
    params,
    commission,
    stream,
    capture,
    watch,
    compare,
    log,
    monitor,
    a2l,
):
    board.add_command(command)
