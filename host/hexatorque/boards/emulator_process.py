"""Targets that are emulators: processes that communicate through two pipes."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
import weakref
from pathlib import Path

from .. import system
from ..firmware import ffi, lib
from . import tools
from .processor import Target

#: Machine -> CMake preset of its images. The last machine is run by simavr, the others by QEMU.
MACHINES = {"mps2-an386": "mps2", "mps2-an500": "mps2-m7", "atmega2560": "avr"}
#: The programs that each machine needs.
NEEDS = {
    "mps2-an386": ("arm-none-eabi-gcc", "qemu-system-arm"),
    "mps2-an500": ("arm-none-eabi-gcc", "qemu-system-arm"),
    "atmega2560": ("avr-gcc", "libsimavr"),
}
#: Longest time for a reply. A step takes some 50 us, and the emulator starts in less than 1 s; on a
#: busy computer either may take much longer. An emulator that has ended is noticed at once.
TIMEOUT_S = 60.0
#: Longest time between the end of a process's pipes and its own.
ENDING_S = 10.0


def qemu(machine: str, image: Path, serial: tuple[str, ...] = ("-serial", "none")) -> list[str]:
    """The command that runs an image. It uses the files in the working directory."""
    return [
        tools.program("qemu-system-arm") or "qemu-system-arm", "-M", machine,
        "-kernel", str(image), "-display", "none", "-monitor", "none", *serial,
        "-semihosting-config", "enable=on,target=native",
    ]  # fmt: skip


def _end(process: subprocess.Popen, files: list[int], folder: tempfile.TemporaryDirectory) -> None:
    process.kill()
    process.wait()
    for file in files:
        with contextlib.suppress(OSError):
            os.close(file)
    folder.cleanup()


class ProcessTarget(Target):
    """A target in a process of its own. The process ends with `close`, or when this object is
    deleted. If this program dies, the process notices that its pipes are closed, and ends,
    even if it opens them only then."""

    def __init__(self, name: str, command: list[str], timeout_s: float = TIMEOUT_S) -> None:
        super().__init__()
        self.name = name
        folder = tempfile.TemporaryDirectory(prefix="hexatorque-")
        place = Path(folder.name)
        to_target, its_input = system.inherited_pipe(place, "to_target", 0)
        from_target, its_output = system.inherited_pipe(place, "from_target", 1)
        files = [to_target, from_target, *self.prepare(place)]
        self._said = place / "stderr"
        try:
            with self._said.open("w", encoding="utf-8") as said:
                self.process = system.emulator(command, place, said, (its_input, its_output))
        finally:  # if this program held them, the end of either process would not show
            os.close(its_input)
            os.close(its_output)
        self._end = weakref.finalize(self, _end, self.process, files, folder)
        self.link.local = ffi.NULL
        self.link.to_target, self.link.from_target = to_target, from_target
        self.link.timeout_ms = round(timeout_s * 1000)

    def prepare(self, place: Path) -> list[int]:
        """Prepare the working directory before the process starts. Returns descriptors that are
        closed at its end."""
        return []

    def close(self) -> None:
        self._end()

    def why_down(self) -> str:
        if not self._end.alive:
            return ""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(ENDING_S if self.link.error == lib.HT_LINK_CLOSED else 0.2)
        if self.process.returncode is None:
            return f" ({self.link.timeout_ms / 1000:g} s)"
        said = self._said.read_text(encoding="utf-8").strip().splitlines()
        last = f": {said[-1]}" if said else ""
        return f" (status {self.process.returncode}{last})"


def avr(image: Path) -> list[str]:
    """The command that runs an image on a simulated ATmega2560."""
    source = tools.source_root() / "firmware/port/avr/simulator/avr_machine.c"
    simulator = image.parent / "avr_machine"
    if not simulator.exists() or simulator.stat().st_mtime < source.stat().st_mtime:
        fresh = simulator.with_suffix(f".{os.getpid()}")
        tools.run([tools.program("cc") or "cc", "-O2", source, "-o", fresh, "-lsimavr", "-lelf"])
        fresh.replace(simulator)
    return [str(simulator), str(image)]


def emulator(machine: str = "mps2-an386", timeout_s: float = TIMEOUT_S) -> ProcessTarget:
    """Build the firmware for a machine and run it in the machine's emulator."""
    tools.need(*NEEDS[machine])
    folder = tools.build(MACHINES[machine], "pil")
    if machine == "atmega2560":
        command = avr(folder / "firmware/port/avr/pil")
    else:
        command = qemu(machine, folder / "firmware/port/mps2/pil")
    return ProcessTarget(machine, command, timeout_s)
