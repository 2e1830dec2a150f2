"""Shell completion: the values of options and arguments, and the shell's own part.

A function for values gets what is typed so far and says what it may become.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import click
from click.shell_completion import CompletionItem, get_completion_class

from ..errors import HexatorqueError

SHELLS = ("bash", "zsh", "fish")
#: The shell asks the program for completions when this variable is set.
VARIABLE = "_HEXATORQUE_COMPLETE"

# -- values -------------------------------------------------------------------------------


def starting(names: Iterable[str], begun: str, before: str = "") -> list[str]:
    """`names` that begin with `begun`, as the shell wants them: with the text `before` them."""
    return [before + name for name in names if name.startswith(begun)]


def files(ctx, param, incomplete: str) -> list:
    """The shell completes names of files itself."""
    return [CompletionItem(incomplete, type="file")]


def sweep(ctx, param, incomplete: str) -> list:
    from ..sweeps.files import ready

    return starting(ready(), incomplete) or files(ctx, param, incomplete)


def scheme(ctx, param, incomplete: str) -> list:
    from .. import firmware

    return starting(firmware.schemes(), incomplete)


def schemes(ctx, param, incomplete: str) -> list:
    """The last one of a list with commas."""
    from .. import firmware

    before, comma, last = incomplete.rpartition(",")
    return starting(firmware.schemes(), last, before + comma)


def schemes_or_laws(ctx, param, incomplete: str) -> list:
    from .. import firmware, laws

    before, comma, last = incomplete.rpartition(",")
    return starting((*firmware.schemes(), *laws.names()), last, before + comma)


def setup(ctx, param, incomplete: str) -> list:
    from .. import setups

    return starting(setups.builtin_names(), incomplete) or files(ctx, param, incomplete)


def setting(ctx, param, incomplete: str) -> list:
    """SECTION.KEY=, and the choices of a key that has some."""
    from ..setups import paths

    path, equals, begun = incomplete.partition("=")
    if not equals:
        return [f"{each}=" for each in starting(paths.every(), path)]
    section, _, key = path.partition(".")
    known = paths.keys(section) if section in paths.WITH_PATHS else {}
    return starting(known[key].choices, begun, f"{path}=") if key in known else []


def parameter(ctx, param, incomplete: str) -> list:
    from .. import firmware

    return starting(firmware.parameters(), incomplete)


def assignment(ctx, param, incomplete: str) -> list:
    """NAME=, and the choices of a parameter that has some."""
    from .. import firmware

    table = firmware.parameters()
    name, equals, begun = incomplete.partition("=")
    if not equals:
        return [f"{each}=" for each in starting(table, name)]
    return starting(table[name].choices, begun, f"{name}=") if name in table else []


def channel(ctx, param, incomplete: str) -> list:
    from .. import firmware

    return starting([name for name, _ in firmware.channels()], incomplete)


def metric(ctx, param, incomplete: str) -> list:
    from ..analysis.metrics import UNITS

    return starting(UNITS, incomplete)


def figure(ctx, param, incomplete: str) -> list:
    from ..evidence.papers import ENTRIES

    return starting(["all", *ENTRIES], incomplete)


def study(ctx, param, incomplete: str) -> list:
    from ..evidence.studies import STUDIES

    return starting(["all", *STUDIES], incomplete)


# -- the shell's part ---------------------------------------------------------------------


def options(command):
    """--install-completion and --show-completion; without a shell's name: of $SHELL."""
    for name, callback, help in (
        ("--show-completion", _show, "print the shell's part of completion"),
        ("--install-completion", _install, "let the shell complete the words of commands"),
    ):
        command = click.option(
            name,
            metavar=f"[{'|'.join(SHELLS)}]",
            is_flag=False,
            flag_value="",
            expose_value=False,
            is_eager=True,
            callback=callback,
            help=help,
        )(command)
    return command


def _shell(name: str) -> str:
    name = name or Path(os.environ.get("SHELL", "")).name
    if name not in SHELLS:
        raise click.BadParameter(f"shell {name!r}: choose from {', '.join(SHELLS)}")
    return name


def _script(ctx: click.Context, shell: str) -> str:
    completion = get_completion_class(shell)
    assert completion  # click has one for each of SHELLS
    return completion(ctx.command, {}, "hexatorque", VARIABLE).source()


def _show(ctx: click.Context, param: click.Parameter, given: str | None) -> None:
    if given is not None and not ctx.resilient_parsing:
        print(_script(ctx, _shell(given)))
        ctx.exit()


def _install(ctx: click.Context, param: click.Parameter, given: str | None) -> None:
    if given is None or ctx.resilient_parsing:
        return
    shell = _shell(given)
    config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    if shell == "fish":  # reads all files of its folder
        script, start = config / "fish" / "completions" / "hexatorque.fish", None
    else:
        script, start = config / "hexatorque" / f"completion.{shell}", Path.home() / f".{shell}rc"
    try:
        script.parent.mkdir(parents=True, exist_ok=True)
        script.write_text(_script(ctx, shell) + "\n", encoding="utf-8")
        line = f"source '{script}'\n"
        if start is not None and (
            not start.exists() or line not in start.read_text(encoding="utf-8")
        ):
            with start.open("a", encoding="utf-8") as file:
                file.write(line)
    except OSError as error:
        raise HexatorqueError(f"{error.filename}: {error.strerror}") from None
    print(f"written: {script}; it counts from the next {shell} on")
    ctx.exit()
