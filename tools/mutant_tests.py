"""The tests of the firmware, for tools/mutate.py: pytest that has collected them once and runs them
for each mutant in a copy of itself (fork). So a mutant costs what its tests compute and no start.

    python tools/mutant_tests.py FIRMWARE FOLDER ...

FIRMWARE is the module for Python as it is, and the folders have the tests. A line of standard
input, in JSON, is a request:

    files     files of tests, in the order in which they run
    limit_s   seconds of the processor that they may take
    changed   a library of one object file, which is put in place of the firmware's own
    symbols   name, kind and size of all that it defines

Where a function of the firmware began, the copy has a jump to the changed one. Constants are
overwritten. What a module of Python took from the firmware when it was imported stays as it is.

The answer, a line, has the code with which the copy ended, the first test that failed, and the
seconds of each file.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import signal
import struct
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import IO, Any

#: Bytes that the tests may take: a change may make them take ever more.
MEMORY = 4 << 30
#: Of the clock, in units of the limit for the processor: nobody waits for ever.
PATIENCE = 20
#: movabs rax, ...; jmp rax
JUMP, TO = b"\x48\xb8", b"\xff\xe0"


def replace(firmware: str, changed: str, symbols: list[tuple[str, str, int]]) -> None:
    of = ctypes.CDLL(firmware), ctypes.CDLL(changed)
    with open("/proc/self/mem", "r+b", buffering=0) as memory:
        for name, kind, size in symbols:
            old, new = (ctypes.addressof(ctypes.c_char.in_dll(library, name)) for library in of)
            code = JUMP + struct.pack("<Q", new) + TO
            memory.seek(old)
            memory.write(code if kind == "T" else ctypes.string_at(new, size))


class Plugin:
    def __init__(self, firmware: str, requests: IO[str], answers: IO[str]) -> None:
        self.firmware, self.requests, self.answers = firmware, requests, answers
        self.failed = ""

    def pytest_runtestloop(self, session: Any) -> bool:
        if session.testsfailed:
            return True  # a file could not be collected
        for line in self.requests:
            print(json.dumps(self.answer(session, json.loads(line))), file=self.answers, flush=True)
        return True

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    def answer(self, session: Any, request: dict[str, Any]) -> dict[str, Any]:
        files = [str(Path(name).resolve()) for name in request["files"]]
        items = [item for item in session.items if str(item.path) in files]
        items.sort(key=lambda item: files.index(str(item.path)))
        here, there = os.pipe()
        copy = os.fork()
        if copy == 0:
            os.close(here)
            self.run(items, request, there)
        os.close(there)
        end = time.monotonic() + PATIENCE * request["limit_s"]
        while not (ended := os.waitpid(copy, os.WNOHANG))[0]:
            if time.monotonic() > end:
                os.kill(copy, signal.SIGKILL)
            time.sleep(0.02)
        with os.fdopen(here) as pipe:
            told = pipe.read()
        answer = json.loads(told) if told else {"by": "", "seconds": {}}
        return {"code": os.waitstatus_to_exitcode(ended[1]), **answer}

    def run(self, items: list[Any], request: dict[str, Any], there: int) -> None:
        """Run tests in the copy of the process."""
        resource.setrlimit(resource.RLIMIT_CPU, (request["limit_s"], request["limit_s"] + 5))
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        seconds: dict[str, float] = defaultdict(float)
        try:
            replace(self.firmware, request["changed"], request["symbols"])
            for item, following in zip(items, [*items[1:], None]):
                begin = time.process_time()
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                seconds[item.nodeid.split("::")[0]] += time.process_time() - begin
                if self.failed:
                    break
        except BaseException as error:
            self.failed = self.failed or repr(error)
        os.write(there, json.dumps({"by": self.failed, "seconds": seconds}).encode())
        os._exit(1 if self.failed else 0)


def main() -> int:
    firmware, *folders = sys.argv[1:]
    # pytest takes these streams for itself.
    requests, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    os.environ["HT_FIRMWARE"] = firmware
    # The changed object file calls the other ones of this firmware.
    library = str(Path(firmware).with_name("libhexatorque.so"))
    ctypes.CDLL(library, os.RTLD_NOW | os.RTLD_GLOBAL)
    import hypothesis
    import other_firmware  # noqa: F401
    import pytest

    os.environ["HT_INPUTS"] = "new"  # so tests/conftest.py leaves this profile
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(
        "mutants", derandomize=True, database=None, phases=phases, deadline=None
    )
    hypothesis.settings.load_profile("mutants")
    words = ["-q", "-s", "-p", "no:cacheprovider", "-p", "no:logging", "-p", "no:xdist",
             "-W", "ignore::pytest.PytestAssertRewriteWarning"]  # fmt: skip
    plugin = Plugin(library, requests, answers)
    return int(pytest.main([*words, *folders], plugins=[plugin]))


if __name__ == "__main__":
    sys.exit(main())
