"""What differs between operating systems is in host/hexatorque/system, and nowhere else."""

import ast
import re
from pathlib import Path

import pytest

HOST = Path(__file__).resolve().parents[2] / "host" / "hexatorque"
ROOM = HOST / "system"
FILES = sorted(path for path in HOST.rglob("*.py") if ROOM not in path.parents)
#: Modules that one of the systems lacks.
MODULES = {
    "fcntl", "grp", "msvcrt", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty",
    "winreg", "_winapi",
}  # fmt: skip
#: Names that one of the systems lacks, and questions which system this is.
NAMES = re.compile(
    r"sys\.platform|os\.name|platform\.(system|machine|uname)|sys\.getwindowsversion"
    r"|os\.(fork\w*|openpty|mkfifo|getuid|geteuid|getpgid|killpg|kill|setsid|pread|pwrite|ttyname"
    r"|sched_\w+affinity|uname|major|minor|O_DIRECTORY|O_CLOEXEC|startfile)"
    r"|socket\.(AF_UNIX|SO_PEERCRED|SO_REUSEADDR)|multiprocessing\.forkserver|forkserver\."
    r"|signal\.(SIGKILL|SIGHUP|SIGSTOP|SIGCONT|SIGUSR\d|SIGALRM|SIGBREAK|pause|alarm|setitimer)"
    r"|start_new_session|pass_fds|preexec_fn|creationflags"
)


def ties(source: str) -> list[str]:
    """What a source uses that not every system has."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names if alias.name in MODULES]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found += [node.module] if node.module in MODULES else []
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            found += [name for name in names if NAMES.fullmatch(name)]
        elif isinstance(node, ast.Attribute):
            found += [text for text in (ast.unparse(node),) if NAMES.fullmatch(text)]
        elif isinstance(node, ast.keyword):
            found += [node.arg] if node.arg and NAMES.fullmatch(node.arg) else []
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found += re.findall(r"^/proc/.*|^/dev/pts/.*", node.value)
    return found


def test_nothing_else_depends_on_the_system():
    assert len(FILES) > 200
    found = {str(file.relative_to(HOST)): ties(file.read_text()) for file in FILES}
    assert {file: names for file, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "source",
    [
        "import fcntl",
        "from termios import TIOCEXCL",
        "import sys\nif sys.platform == 'linux': pass",
        "from os import fork",
        "os.fork()",
        "signal.SIGKILL",
        "from multiprocessing import forkserver",
        "subprocess.Popen([], start_new_session=True)",
        "open(f'/proc/{pid}/stat')",
    ],
)
def test_the_check_sees_what_it_looks_for(source):
    assert len(ties(source)) == 1


def public(file: str) -> dict[str, str]:
    """The names that one of the two files gives to the others, with arguments and types."""
    found = {}
    for node in ast.parse((ROOM / file).read_text()).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            found[node.name] = f"{ast.unparse(node.args)} -> {ast.unparse(node.returns)}"
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            methods = [n.name for n in node.body if isinstance(n, ast.FunctionDef)]
            found[node.name] = str(sorted(name for name in methods if not name.startswith("_")))
        elif isinstance(node, ast.Assign):
            found |= {name.id: "" for name in node.targets if isinstance(name, ast.Name)}
    return found


def names_of_the_room(source: str) -> set[str]:
    """The names of host/hexatorque/system that a source uses."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "system":
            found.add(node.attr)
        elif isinstance(node, ast.ImportFrom) and node.module == "system":
            found |= {alias.name for alias in node.names}
    return found


def test_both_systems_offer_the_same():
    used = set().union(*(names_of_the_room(file.read_text()) for file in FILES))
    here, there = public("posix.py"), public("windows.py")
    assert len(used) > 20 and used - {"zig_target"} <= set(here)
    assert {name: here[name] for name in used & set(here)} == {
        name: there.get(name) for name in used & set(here)
    }


def test_texts_are_utf_8_everywhere():
    """Without a name, an encoding is that of the user's country on Windows."""
    unnamed = [
        f"{file.relative_to(HOST)}:{node.lineno}"
        for file in [*FILES, *ROOM.glob("*.py")]
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        and (node.func.attr, len(node.args)) in (("read_text", 0), ("write_text", 1))
        and "encoding" not in {keyword.arg for keyword in node.keywords}
    ]  # fmt: skip
    assert unnamed == []
