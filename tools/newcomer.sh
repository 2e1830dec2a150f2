#!/bin/sh
# What README says, done by a user who is new to this computer: needs root, who makes that user.
#
#   tools/newcomer.sh [PIP_CONF [TESTS]]
#
# Installs the packages that README names, clones this tree's commit into a folder whose name has a
# space, in the home of the user, and runs `make demo` and `make TESTS` there in an empty environment;
# TESTS is `test` if it is not given.
# HT_… variables are passed on. PIP_CONF tells the user's pip how to reach a package index, as
# tools/pip_settings.py writes it. The user is removed again unless it was there before.
set -eu

user=hexatorque-reader
path=/usr/local/bin:/usr/bin:/bin
tree=$(cd "$(dirname "$0")/.." && pwd)

[ "$(id -u)" -eq 0 ] || { echo "newcomer: needs root, who makes the user $user" >&2; exit 1; }

packages=$(sed -n 's/^ *sudo apt-get install \(.*\)$/\1/p' "$tree/README.md")
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086
apt-get install -y -qq --no-install-recommends $packages >/dev/null 2>&1 || {
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends $packages >/dev/null
}

made=
aside=
end() {
    [ -z "$aside" ] || rm -rf "$aside"
    [ -z "$made" ] || userdel --remove "$user" >/dev/null 2>&1 || true
}
trap end EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

id "$user" >/dev/null 2>&1 || { useradd --create-home "$user"; made=1; }
home=$(getent passwd "$user" | cut -d: -f6)
aside=$(mktemp -d "$home/new.XXXXXX")
chmod 755 "$aside"
mkdir "$aside/a place"
chown "$user" "$aside/a place"

wanted=$(env | grep '^HT_[A-Z_]*=[A-Za-z0-9,.-]*$') || true
as_user() { # with nothing of this environment but what concerns the tests
    # shellcheck disable=SC2086
    (cd "$home" && exec runuser -u "$user" -- env -i "PATH=$path" "HOME=$home" LANG=C.UTF-8 \
        $wanted "$@")
}

# The user needs what root's pip is told to reach a package index, and root may be told at home.
conf=${1:-}
[ -n "$conf" ] || { conf=$aside/pip.conf; python3 "$tree/tools/pip_settings.py" >"$conf"; }
as_user mkdir -p "$home/.config/pip"
install -o "$user" -m 600 "$conf" "$home/.config/pip/pip.conf"

# Git reads no repository of somebody else's. So root copies it, and the copy is the user's.
printf '[safe]\n\tdirectory = *\n' >"$aside/gitconfig"
GIT_CONFIG_GLOBAL=$aside/gitconfig git clone --quiet --bare "$tree" "$aside/hexatorque.git"
chown -R "$user" "$aside/hexatorque.git"
as_user git clone --quiet "$aside/hexatorque.git" "$aside/a place/hexatorque"
as_user make -C "$aside/a place/hexatorque" --no-print-directory demo
as_user make -C "$aside/a place/hexatorque" --no-print-directory "${2:-test}"
