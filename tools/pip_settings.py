"""How this user's pip reaches a package index, files and variables together, as the text of a
pip.conf for another user or system.

    python3 tools/pip_settings.py

Places on this computer are left out. The standard library is enough: that there is a pip is not
needed.
"""

import configparser
import os
import sys
from pathlib import Path

#: pip's order: a later one wins.
FILES = ("/etc/xdg/pip/pip.conf", "/etc/pip.conf", "~/.pip/pip.conf", "~/.config/pip/pip.conf")
KEPT = ("cert", "extra-index-url", "index-url", "proxy", "retries", "timeout", "trusted-host")


def settings() -> configparser.RawConfigParser:
    found = configparser.RawConfigParser()
    found.read([Path(file).expanduser() for file in FILES])
    wanted = configparser.RawConfigParser()
    wanted.add_section("global")
    for name in KEPT:
        variable = os.environ.get(f"PIP_{name.upper().replace('-', '_')}")
        value = variable or str(found.get("global", name, fallback=""))
        words = [word for word in value.split() if not word.startswith("file:")]
        if words:
            wanted.set("global", name, " ".join(words))
    return wanted


if __name__ == "__main__":
    settings().write(sys.stdout)
