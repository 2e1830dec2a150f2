#!/bin/sh
# Install clang 19, which measures MC/DC and fuzzes. For Debian and Ubuntu; needs root.
set -eu
echo "set-up: installing clang-19 with apt"
apt-get update -qq
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
    clang-19 llvm-19 libclang-rt-19-dev >/dev/null
