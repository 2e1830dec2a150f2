#!/bin/sh
# What README says, done on a fresh system: the smallest Debian that debootstrap makes.
#
#   tools/fresh.sh bookworm|trixie|forky [TESTS]
#
# TESTS: make's target for the tests there, as in tools/newcomer.sh.
# Needs root and debootstrap; ends with 77 where root may not make name spaces. The system is made in
# a temporary folder from this computer's own mirror and removed at the end. The rest is
# tools/newcomer.sh, in that system.
set -eu

suite=${1:-}
tests=${2:-test}
folder=${3:-}
tree=$(cd "$(dirname "$0")/.." && pwd)

fail() {
    echo "fresh: $*" >&2
    exit 1
}

case "$suite" in bookworm | trixie | forky) ;; *) fail "name a suite: tools/fresh.sh bookworm|trixie|forky" ;; esac
[ "$(id -u)" -eq 0 ] || fail "needs root, who can make another system"
unshare --mount --pid --fork true 2>/dev/null || {
    echo "fresh: this computer lets root make no name spaces, so nothing was run" >&2
    exit 77
}
command -v debootstrap >/dev/null || fail "debootstrap is missing: apt-get install debootstrap"

if [ -z "$folder" ]; then
    # In a name space of its own: its mounts and processes end with it, however it ends. Then the
    # folder can be removed.
    folder=$(mktemp -d)
    inner=
    end() {
        [ -z "$inner" ] || { kill "$inner" 2>/dev/null && wait "$inner"; } || true
        rm -rf --one-file-system "$folder"
    }
    trap end EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM HUP
    unshare --mount --pid --fork --kill-child --mount-proc "$0" "$suite" "$tests" "$folder" &
    inner=$!
    status=0
    wait $inner || status=$?
    inner=
    exit $status
fi

system=$folder/system
# This computer's own mirror if it is a Debian, else the one that debootstrap knows.
mirror=
! grep -qx 'ID=debian' /etc/os-release ||
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' |
        grep -v security | head -n 1)
echo "fresh: making Debian $suite"
script=/usr/share/debootstrap/scripts/$suite
[ -e "$script" ] || script=${script%/*}/sid # a suite that is newer than this debootstrap
debootstrap --variant=minbase --include=ca-certificates "$suite" "$system" "$mirror" "$script" \
    >"$folder/log" 2>&1 || {
    tail -n 20 "$folder/log" >&2
    fail "debootstrap could not make $suite"
}
mount -t proc proc "$system/proc"
mount --rbind /dev "$system/dev"
mount --rbind /sys "$system/sys"

in_system() {
    chroot "$system" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "$@"
}

# How this computer reaches its mirror and a package index.
apt-config dump | grep -E '^Acquire::(.*[Pp]roxy|Check-|https)' >"$system/etc/apt/apt.conf.d/99outside" || true
for file in /etc/resolv.conf /etc/hosts; do cat "$file" >"$system$file"; done
cp /usr/local/share/ca-certificates/*.crt "$system/usr/local/share/ca-certificates/" 2>/dev/null || true
in_system update-ca-certificates >/dev/null 2>&1
python3 "$tree/tools/pip_settings.py" >"$system/root/pip.conf"

printf '[safe]\n\tdirectory = *\n' >"$folder/gitconfig"
GIT_CONFIG_GLOBAL=$folder/gitconfig git clone --quiet "$tree" "$system/srv/hexatorque"
in_system /srv/hexatorque/tools/newcomer.sh /root/pip.conf "$tests"
