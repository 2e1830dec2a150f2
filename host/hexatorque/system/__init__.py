"""The differences between operating systems: locks, processes, ports, how programs find each other.

`posix.py` is for Linux and macOS, `windows.py` for Windows. Both have the same names. Nothing else
in the package asks which system it runs on, and nothing else uses a function that one of them
lacks.

No library replaces this. A lock of filelock empties the file that it locks, psutil does not tell
who has a serial port open, and platformdirs names other folders than those in use.
"""

from __future__ import annotations

import platform
import sys

if sys.platform == "win32":
    from .windows import *  # noqa: F403
else:
    from .posix import *  # noqa: F403


def zig_target() -> str:
    """This computer, as zig names it. The name of Linux has the oldest C library that will do."""
    processor = {"amd64": "x86_64", "arm64": "aarch64"}
    machine = platform.machine().lower()
    name = {"win32": "windows-gnu", "darwin": "macos"}.get(sys.platform, "linux-gnu.2.17")
    return f"{processor.get(machine, machine)}-{name}"
