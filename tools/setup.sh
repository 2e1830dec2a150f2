#!/bin/sh
# Create .venv and install hexatorque with its test tools into it.
#
#   tools/setup.sh [VENV_DIR]
#
# Needs Python 3.11 or newer and a C compiler. On Debian and Ubuntu the modules
# that Python's packages leave out (venv) are installed with apt if this
# runs as root; otherwise the command to run is printed.
#
# With HT_OLDEST=1 every library that pyproject.toml names has the oldest version that it allows.
#
# While the file VENV_DIR.half exists, the environment is not whole: set-up was interrupted, and the
# next one begins with nothing. VENV_DIR/.installed is there, for make, if it is whole.
set -eu

venv=${1:-.venv}
python=${PYTHON:-python3}
root=$(cd "$(dirname "$0")/.." && pwd)

fail() {
    echo "hexatorque set-up: $*" >&2
    exit 1
}

command -v "$python" >/dev/null 2>&1 || fail "$python not found; install Python 3.11 or newer"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    fail "$("$python" --version) is too old; Python 3.11 or newer is needed"
cc=${CC:-cc}
command -v "$cc" >/dev/null 2>&1 || cc=gcc
command -v "$cc" >/dev/null 2>&1 || fail "no C compiler found; install gcc or clang"
# A compiler may lack the C library's headers and start files: gcc only recommends them on Debian.
printf '#include <stdio.h>\nint main(void) { return 0; }\n' | "$cc" -x c -o /dev/null - 2>/dev/null ||
    fail "$cc cannot compile a program; on Debian and Ubuntu libc6-dev may be missing:" \
        "sudo apt-get install libc6-dev"

missing=""
"$python" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"
if [ -n "$missing" ]; then
    command -v apt-get >/dev/null 2>&1 || fail "Python lacks:$missing"
    [ "$(id -u)" -eq 0 ] || fail "run first: sudo apt-get install$missing"
    echo "hexatorque set-up: installing$missing with apt"
    apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
fi

# Without what Python keeps compiled, each start of a process would compile everything again.
unset PYTHONDONTWRITEBYTECODE

# One set-up at a time: a second one would begin with nothing, under the hands of the first.
exec 9<"$root"
"$python" -c 'import fcntl; fcntl.flock(9, fcntl.LOCK_EX)'

half=$venv.half
compiled=
before=
telling=
end() {
    # In a terminal Ctrl-C does not reach what runs in the background.
    told
    [ -z "$compiled" ] || { kill "$compiled" 2>/dev/null && wait "$compiled"; } || true
    [ -z "$before" ] || rm -rf "$before"
}
# tell WORK: say what is done, and every three seconds for how long already, until told.
tell() {
    echo "hexatorque set-up: $1"
    (
        trap 'kill $!; wait; exit' TERM
        took=3
        sleep 3 &
        while wait $! && kill -0 $$; do
            echo "hexatorque set-up: $1 ... $took s"
            took=$((took + 3))
            sleep 3 &
        done
    ) 9<&- 2>/dev/null &
    telling=$!
}
told() {
    [ -z "$telling" ] || { kill "$telling" 2>/dev/null && wait "$telling"; } || true
    telling=
}
# $!: the signal may come before the latest process in the background has its name.
trap end EXIT
trap 'compiled=${compiled:-${!-}}; exit 130' INT
trap 'compiled=${compiled:-${!-}}; exit 143' TERM HUP

if [ -e "$half" ] || ! "$venv/bin/python" -m pip --version >/dev/null 2>&1; then
    mkdir -p "$(dirname "$venv")"
    : >"$half"
    "$python" -m venv --clear "$venv"
fi
: >"$half"
rm -f "$venv/.installed"
tell "installing into $venv"
installed=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')/hexatorque
before=$(mktemp -d)
extras=$before/extras
# Kept for afterwards: the firmware's sources, and what numba has compiled.
[ ! -d "$installed" ] || (cd "$installed" &&
    find . \( -path './source/*' -o -name '*.nb?' \) -type f -exec cp -p --parents {} "$before" \;)

# First what runs. The extras, a requirement a line, are installed while the simulation is compiled.
"$venv/bin/python" - "$root/pyproject.toml" "test${HT_EXTRAS:+,$HT_EXTRAS}" >"$extras" <<'END'
import re, sys, tomllib

with open(sys.argv[1], "rb") as file:
    of_extras = tomllib.load(file)["project"]["optional-dependencies"]

def show(names):
    for name in names.split(","):
        if name not in of_extras:
            sys.exit(f"no extra {name}: choose from {', '.join(of_extras)}")
        for requirement in of_extras[name]:
            own = re.fullmatch(r"hexatorque\[(.*)\]", requirement)
            show(own[1]) if own else print(requirement)

show(sys.argv[2])
END

# uv takes a fifth of pip's processor time. What it cannot install, pip tries: pip uses the settings
# of the user's pip.conf, and it says what is wrong. Modules are compiled when they are first used.
# Both trust the certificates of the computer. Nobody waits for LLVM to be compiled.
export UV_SYSTEM_CERTS=1 PIP_ONLY_BINARY=llvmlite,numba UV_NO_BUILD_PACKAGE="llvmlite numba"
add() {
    if [ -n "${HT_OLDEST:-}" ]; then
        "$venv/bin/python" -m uv pip install --quiet --python "$venv/bin/python" \
            --resolution lowest-direct "$@"
        return
    fi
    "$venv/bin/python" -m uv pip install --quiet --python "$venv/bin/python" "$@" 2>/dev/null &&
        return
    by_pip=0
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile "$@" \
        2>"$before/by_pip" || by_pip=1
    cat "$before/by_pip" >&2
    built=$(sed -n 's/.*Failed building wheel for //p' "$before/by_pip" | head -n 1)
    [ "$by_pip" -eq 0 ] || [ -z "$built" ] ||
        fail "$built could not be built with the C compiler $cc: the first error" \
            "above says why. Another compiler is used with CC=clang make demo"
    [ "$by_pip" -eq 0 ] ||
        fail "what is named above could not be installed from the package index. Is there a network?" \
            "llvmlite and numba may not exist for $("$python" --version) yet: another Python is used" \
            "with PYTHON=python3.13 make demo"
}
"$venv/bin/python" -m uv --version >/dev/null 2>&1 ||
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check uv 2>/dev/null || true
add "$root"
(cd "$before" && find . -name '*.nb?' -exec cp -p --parents {} "$installed" \;)

# A source of the firmware that is as it was before keeps its age: the images for other processors
# are compiled again only as far as something has changed.
[ ! -d "$before/source" ] || (cd "$before/source" && find . -type f -exec sh -c \
    'if cmp -s "$1" "$2"; then touch -r "$1" "$2"; fi' sh {} "$installed/source/{}" \;)
# An installed file gets the age of its source: numba keeps what it has compiled as long as neither
# content nor age of a file changes. So an edit of the C alone does not compile the plant again.
(cd "$root/host/hexatorque" && find . -name '*.py' -exec touch -r {} "$installed/{}" \;)
told
tell "compiling the simulation if its source has changed (about 15 s)"
# Numba looks for scipy when it starts. Only then the extras, with scipy, are installed. After them
# the other core imports, for the first time, what draws.
started=$before/started
"$venv/bin/python" -c 'import sys
import numba.np.arraymath
from hexatorque.drive.compiling import watched
from hexatorque.drive.simulated import compile_now
open(sys.argv[1], "w").close()
with watched(lambda: None, lambda: None): # the line above tells it
    compile_now()' "$started" &
compiled=$!
while kill -0 $compiled 2>/dev/null && [ ! -e "$started" ]; do sleep 0.1; done
add -r "$extras"
"$venv/bin/python" -c 'from hexatorque.analysis import plots, report' || true
wait $compiled
compiled=
told
rm -f "$half"
touch "$venv/.installed"
