#!/bin/sh
# Install missing tools: the targets' cross compilers and emulators, the second compiler for the
# static checks, the browser and node for the tests of the pages, and what makes a fresh Debian.
# For Debian and Ubuntu; needs root. `make test-targets` names missing tools and installs nothing.
set -eu

missing=""
need() { # program or header, packages
    command -v "$1" >/dev/null 2>&1 || [ -e "/usr/include/$1" ] || missing="$missing $2"
}
need arm-none-eabi-gcc "gcc-arm-none-eabi libnewlib-arm-none-eabi"
need qemu-system-arm "qemu-system-arm"
need avr-gcc "gcc-avr avr-libc"
need clang "clang"
need chromium "chromium"
need node "nodejs"
need debootstrap "debootstrap"
need simavr/sim_avr.h "libsimavr-dev libelf-dev"
if [ -n "$missing" ]; then
    echo "targets: installing$missing with apt"
    apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
fi
