"""A group of commands, and its answer to an unknown name."""

from __future__ import annotations

from difflib import get_close_matches

import click

from .output import complain


def examples(*lines: str, note: str = "") -> str:
    """The end of a help text. The sign in front keeps the lines as they are."""
    shown = "\n".join(f"  hexatorque {line}" for line in lines)
    return f"\b\nexamples:\n{shown}" + (f"\n\n{note}" if note else "")


class Group(click.Group):
    """Commands in the order in which they were added. A name that is not among them, but in
    another group, is shown there. Called without a name it says so in one line, as
    for any mistake."""

    def __init__(self, *args, **attributes):
        super().__init__(*args, **attributes)
        self.no_args_is_help = False

    def list_commands(self, ctx):
        return list(self.commands)

    def resolve_command(self, ctx, args):
        name = args[0]
        if name not in self.commands and not ctx.resilient_parsing:
            ctx.fail(unknown(ctx, name))
        return super().resolve_command(ctx, args)

    def invoke(self, ctx):
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            complain("interrupted")
            ctx.exit(130)


def unknown(ctx, name: str) -> str:
    """The message for a command that this group does not have."""
    elsewhere = next(iter(paths_to(ctx.find_root().command, name)), None)
    if elsewhere is not None:
        return f"no command {name!r} here: it is `hexatorque {elsewhere}`"
    known = list(ctx.command.commands)
    close = get_close_matches(name, known, 1)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"no command {name!r}: {hint}choose from {', '.join(known)}"


def paths_to(command, name: str, path: str = "") -> list[str]:
    """The places of commands with this name in the tree."""
    found = []
    for own, child in getattr(command, "commands", {}).items():
        if own == name:
            found.append(f"{path}{own}")
        found += paths_to(child, name, f"{path}{own} ")
    return found
