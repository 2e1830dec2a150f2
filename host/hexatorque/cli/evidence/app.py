"""`hexatorque evidence`: all that shows how far to trust simulation and firmware."""

import click

from ..group import Group, examples
from .measured import limit, papers, speed, studies
from .processors import budget, pil


@click.group(
    cls=Group,
    epilog=examples("evidence papers all", "evidence studies faults", "evidence pil --schemes ddr"),
)
def evidence() -> None:
    """Reproduce the papers, run accuracy and fault studies, measure cost.

    Both papers' figures and tables beside the printed numbers, studies of accuracy and of
    faults, the firmware on other processors held against the host's, and its cost there.
    """


for command in (papers, studies, limit, pil, budget, speed):
    evidence.add_command(command)
