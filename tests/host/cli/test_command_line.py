"""The tree of commands: its names, its help, its completion and its error messages."""

import errno
import os
import shlex
import shutil
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import click
import pytest
from forked import Forked

import hexatorque
from hexatorque.cli import simulate
from hexatorque.cli.main import app, main
from hexatorque.errors import HexatorqueError

ROOT = Path(__file__).resolve().parents[3]


def tree(command=app, path=()):
    """Every command and group, with its words."""
    yield path, command
    for name, child in getattr(command, "commands", {}).items():
        yield from tree(child, (*path, name))


COMMANDS = {path: command for path, command in tree() if not isinstance(command, click.Group)}
GROUPS = {path: command for path, command in tree() if isinstance(command, click.Group)}


def parse(words):
    """Read a command line as the program does, without running it."""
    command, ctx = app, None
    while isinstance(command, click.Group):
        command = command.commands[words[0]]
        ctx, words = command, words[1:]
    return ctx.make_context(ctx.name, list(words))


def lines_of(text):
    """The command lines in a text: indented, with `hexatorque` first."""
    joined = text.replace("\\\n", " ")
    found = [line.strip() for line in joined.splitlines() if line.startswith(("  ", "\t"))]
    return [shlex.split(line, comments=True) for line in found if line.startswith("hexatorque ")]


# -- names --------------------------------------------------------------------------------


def test_groups_are_small():
    for path, group in GROUPS.items():
        assert len(group.commands) <= (16 if path else 13), path


def test_daily_commands_are_at_the_top_level():
    simulate_and_see = {"run", "compare", "reach", "sweep", "plot", "convert", "setups"}
    own_machine = {"new", "check", "tune"}
    assert set(app.commands) == {*simulate_and_see, *own_machine, "fmu", "board", "evidence"}


def apart(one, other):
    """The number of letters to insert, delete or replace between two words."""
    row = list(range(len(other) + 1))
    for i, a in enumerate(one, 1):
        before, row[0] = row[0], i
        for j, b in enumerate(other, 1):
            before, row[j] = row[j], min(before + (a != b), row[j] + 1, row[j - 1] + 1)
    return row[-1]


def test_the_edit_distance_of_names():
    assert [apart("set", "get"), apart("scheme", "schemes"), apart("start", "stop")] == [1, 1, 3]
    assert apart("", "abc") == 3 and apart("abc", "abc") == 0


def test_no_two_names_of_a_group_differ_by_one_letter():
    for group in GROUPS.values():
        for one, other in combinations(group.commands, 2):
            assert apart(one, other) > 1, (one, other)


#: Commands of this group that open no board.
WITHOUT_BOARD = {("board", "serve"), ("board", "compare")}


def test_nothing_that_moves_a_machine_is_named_like_a_simulation():
    simulates = [*COMMANDS, ("board", "serve")]
    simulates = [path[-1] for path in simulates if path[0] != "board" or path[1] == "serve"]
    for path in COMMANDS:
        if path[0] == "board" and path[:2] not in WITHOUT_BOARD:
            assert min(apart(path[-1], name) for name in simulates) > 1, path


ELSEWHERE = {
    "status": "board status",
    "start": "board start",
    "stop": "board stop",
    "clear": "board clear",
    "params list": "board params",
    "stream state": "board stream",
    "capture state": "board capture",
    "watch state": "board watch",
    "monitor": "board monitor",
    "pil": "evidence pil",
    "budget": "evidence budget",
    "limit": "evidence limit",
}


@pytest.mark.parametrize("line", ELSEWHERE)
def test_a_command_of_another_group_is_shown_there(line, capsys):
    assert main(line.split()) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert said.err.startswith("hexatorque: ")
    assert said.err.endswith(f" it is `hexatorque {ELSEWHERE[line]}`\n")


# -- mistakes -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", ["missing command", "run, compare", "evidence"]),
        ("board", ["missing command", "serve, list", "hexatorque board --help"]),
        ("board params", ["missing command", "list, get"]),
        ("plt", ["no command 'plt'", "did you mean plot?", "setups"]),
        ("board strat", ["no command 'strat'", "did you mean start?", "monitor"]),
        ("zzz", ["no command 'zzz': choose from run"]),
        ("run", ["missing argument 'SCENARIO.toml'", "hexatorque run --help"]),
        ("run a b", ["unexpected extra argument", "b"]),
        ("run a --outptu b", ["--outptu", "--output"]),
        ("board stream state", ["missing option", "--output"]),
        ("board stream -o x.csv", ["missing argument 'CH...'"]),
        ("board stream a --rate 1 --decimation 2 -o x.csv", ["--decimation: not with --rate"]),
        ("reach --load fast", ["--load", "'fast'", "a number is needed"]),
        ("reach --load", ["--load", "requires an argument"]),
        ("board capture state -o x.csv --samples 1.5", ["--samples", "'1.5'", "whole number"]),
        ("board watch state --window -1", ["--window", "'-1'", "above 0 s"]),
        ("board serve --break u3=open", ["--break", "'u3=open'", "u1, u2"]),
        ("board serve --break u1=lost", ["--break", "'u1=lost'", "blocked, upper"]),
        ("board serve --break u1=open@-1", ["--break", "'u1=open@-1'", "0 .. 1e+06 s"]),
        ("board serve --trip-pin 5+", ["--trip-pin", "'5+'", "SECONDS+LENGTH", "1e+06 s"]),
        ("board serve --trip-pin -1", ["--trip-pin", "'-1'", "SECONDS+LENGTH"]),
        ("board list --baud 1e6", ["--baud", "'1e6'", "above 0"]),
        ("board monitor --port 70000", ["--port", "'70000'", "0 .. 65535"]),
        ("board status --json=3", ["--json", "not take a value"]),
        ("board start --set rs_ohm --device /dev/null", ["'rs_ohm'", "NAME=VALUE"]),
        ("--show-completion tcsh", ["'tcsh'", "bash, zsh, fish"]),
        ("evidence limit --speed 900", ["--speed", "--setup is needed"]),
        ("evidence limit --f-sw 1e-3", ["(--f-sw) = 0.001 Hz", "allowed range is"]),
        ("evidence limit --setup paper-b --speed 9e3", ["V_dc", "allowed range is 0 .. 0.577"]),
        ("--json", ["no such option", "--json"]),
    ],
)
def test_a_mistake_is_one_line(line, words, capsys, monkeypatch):
    from hexatorque.cli.board import drive

    monkeypatch.setattr(drive, "open_drive", lambda *_: pytest.fail("a board was opened"))
    assert main(line.split()) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert said.err.startswith("hexatorque: ") and "─" not in said.err
    for word in words:
        assert word in said.err


def test_values_may_begin_with_a_minus_sign():
    assert parse(["reach", "--load", "-2"]).params["load"] == -2
    assert parse(["plot", "a.npz", "--window", "-0.1,0.2"]).params["window"] == "-0.1,0.2"
    assert parse(["board", "start", "--speed", "-400"]).params["speed"] == -400


@pytest.mark.parametrize(
    ("raised", "code", "line"),
    [
        (KeyboardInterrupt, 130, "interrupted"),
        (HexatorqueError("no reply"), 1, "no reply"),
        (type("Wrong", (HexatorqueError,), {"exit_code": 2})("rs_ohm = -1"), 2, "rs_ohm = -1"),
        (ZeroDivisionError("division by zero"), 1, "division by zero"),
    ],
)
def test_exit_codes_say_how_a_command_ended(raised, code, line, capsys, monkeypatch):
    def fail(**_):
        raise raised

    monkeypatch.setattr(simulate.reach, "callback", fail)
    assert main(["reach"]) == code
    assert capsys.readouterr().err.strip() == f"hexatorque: {line}"


# -- help ---------------------------------------------------------------------------------

#: How a text begins that leaves out what the option is.
NAMELESS = (
    "default", "of ", "for ", "at once", "also ", "before ", "those ", "what ", "where ", "which ",
)  # fmt: skip


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_every_option_says_what_it_is(path):
    for option in COMMANDS[path].params:
        if not getattr(option, "hidden", False):
            said = option.help or ""
            assert said and not said.startswith(NAMELESS), f"{option.opts}: {said!r}"
            assert not said.endswith("."), option.opts


@pytest.mark.parametrize("path", [path for path, _ in tree()], ids=" ".join)
def test_every_command_has_help_with_valid_examples(path, capsys):
    """The help has exit code 0, and every command shows examples, which are valid."""
    assert main([*path, "--help"]) == 0
    said = capsys.readouterr()
    assert said.err == "" and said.out.startswith(f"Usage: {' '.join(['hexatorque', *path])} ")
    assert max(map(len, said.out.splitlines())) <= 100
    examples = lines_of(said.out.partition("examples:\n")[2])
    assert examples
    for words in examples:
        assert tuple(words[1 : 1 + len(path)]) == path
        parse(words[1:])


@pytest.mark.parametrize("page", ["README.md", *(f"docs/{p.name}" for p in ROOT.glob("docs/*.md"))])
def test_the_pages_show_commands_as_they_are(page):
    for words in lines_of((ROOT / page).read_text()):
        parse(words[1:])


def test_the_version_is_printed(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"hexatorque {hexatorque.__version__}\n"


def python(*words, **environment):
    """Run Python in a process of its own, as from a shell."""
    package = str(Path(hexatorque.__file__).parents[1])
    return subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, timeout=60,
        env={**os.environ, "PYTHONPATH": package, **environment},
    )  # fmt: skip


def test_the_package_runs_as_a_module_of_python():
    done = python("-m", "hexatorque", "pil")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "hexatorque: no command 'pil' here: it is `hexatorque evidence pil`\n"


def test_help_loads_nothing_heavy():
    """Otherwise the help would take more than 0.4 s."""
    code = (
        "import sys; from hexatorque.cli.main import main; main(['board', 'status', '--help']); "
        "print(*{'numpy', 'numba', 'rich', 'matplotlib', 'cffi', 'serial', 'jinja2'}"
        " & set(sys.modules))"
    )
    done = python("-c", code)
    assert done.stderr == "" and done.stdout.splitlines()[-1] == ""


# -- completion ---------------------------------------------------------------------------


def completed(line, monkeypatch, capsys):
    """The shell's completions of the last word of a line."""
    words = line.split(" ")
    monkeypatch.setenv("_HEXATORQUE_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    with pytest.raises(SystemExit, match="0"):
        main([])
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("hexatorque re", ["plain,reach"]),
        ("hexatorque board st", [f"plain,{w}" for w in ("status", "start", "stop", "stream")]),
        ("hexatorque board params k", ["plain,keep"]),
        ("hexatorque reach --sch", ["plain,--schemes"]),
        ("hexatorque reach --schemes fdr,ddr", ["plain,fdr,ddr", "plain,fdr,ddr-ml"]),
        ("hexatorque reach --setup paper-b-", ["plain,paper-b-fitted"]),
        ("hexatorque reach --setup exam", ["file,exam"]),
        ("hexatorque run exam", ["file,exam"]),
        ("hexatorque compare --set machine.rs", ["plain,machine.rs_ohm="]),
        ("hexatorque run a.toml --set timing.latency=s", ["plain,timing.latency=shadow"]),
        ("hexatorque board start --scheme dtc3", ["plain,dtc3"]),
        ("hexatorque board set rs_", ["plain,rs_ohm=", "plain,rs_degC=", "plain,rs_tells="]),
        ("hexatorque board set rs_ohm=1.7 scheme=fd", ["plain,scheme=fdr"]),
        ("hexatorque board params get vdc_m", ["plain,vdc_min_V", "plain,vdc_max_V"]),
        ("hexatorque board watch speed_rp", ["plain,speed_rpm"]),
        ("hexatorque evidence studies li", ["plain,light-load", "plain,line"]),
        ("hexatorque evidence papers A-T", ["plain,A-T2", "plain,A-T3", "plain,A-T4"]),
    ],
)
def test_the_shell_completes_commands_and_options(line, offered, monkeypatch, capsys):
    assert completed(line, monkeypatch, capsys) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_installed_once(shell, tmp_path, monkeypatch, capsys):
    if shell == "bash" and not shutil.which("bash"):
        pytest.skip("no bash")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.setenv("SHELL", f"/usr/bin/{shell}")
    assert main(["--show-completion"]) == 0
    script = capsys.readouterr().out
    assert f"_HEXATORQUE_COMPLETE={shell}_complete" in script
    for arguments in (["--install-completion"], ["--install-completion", shell]):
        assert main(arguments) == 0
        assert "written: " in capsys.readouterr().out
    (written,) = [path for path in (tmp_path / ".config").rglob("*") if path.is_file()]
    assert written.read_text() == script
    start = tmp_path / f".{shell}rc"
    if shell == "fish":
        assert written == tmp_path / ".config/fish/completions/hexatorque.fish"
        assert not start.exists()
    else:
        assert start.read_text() == f"source '{written}'\n"  # once
    if shell == "bash":
        done = subprocess.run(
            ["bash", "-c", f"source '{start}'; complete -p hexatorque"],
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0 and "hexatorque" in done.stdout


def test_completion_that_cannot_be_written(tmp_path, monkeypatch, capsys):
    (tmp_path / ".config").write_text("")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    assert main(["--install-completion", "zsh"]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and ".config" in said


def test_what_libraries_warn_of_is_not_between_the_results():
    program = """
import sys, warnings
from hexatorque.cli.main import app, main

@app.command()
def noisy():
    warnings.warn("casting complex values discards the imaginary part", RuntimeWarning)
    print("R_r 1.5 Ω")

sys.exit(main(["noisy"]))
"""
    with Forked(["-c", program], pipes=("stdout", "stderr")) as process:
        assert process.communicate() == ("R_r 1.5 Ω\n", "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("words", [["setups"], ["setups", "--schema"], ["--help"], ["--version"]])
def test_a_full_disk_under_the_output_is_told_in_one_line(words):
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "hexatorque", *words],
            stdout=full, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
    assert done.stderr == f"hexatorque: output: {os.strerror(errno.ENOSPC)}\n"
    assert done.returncode == 1


@pytest.mark.parametrize("words", [["setups"], ["setups", "--schema"], ["--version"]])
def test_a_reader_that_has_seen_enough_is_no_mistake(words):
    read, write = os.pipe()
    os.close(read)
    with open(write, "wb") as closed:
        done = subprocess.run(
            [sys.executable, "-m", "hexatorque", *words],
            stdout=closed, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "")
