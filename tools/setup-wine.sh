#!/bin/sh
# Install wine, which runs programs for Windows. For Debian and Ubuntu; needs root.
set -eu
echo "set-up: installing wine with apt"
apt-get update -qq
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends wine64 wine >/dev/null
