"""The end of `make test`: what has failed, what was not run and why, and how many passed.

    python tools/summary.py FILE ...

Each stage has a file (`--results`, tests/conftest.py), and one more, with the ending `.again`, if
what had failed ran a second time. The slowest files are named. Ends with 1 if a test has failed or
a stage has not ended.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

#: How many files are named as slow, and from which time on.
SHOWN, SLOW_S = 20, 60.0


def summary(files: Sequence[Path]) -> tuple[list[str], bool]:
    """The lines, and whether all is well."""
    passed_alone: list[str] = []
    failed: list[str] = []
    skipped: Counter[str] = Counter()
    took_s: Counter[str] = Counter()
    passed = 0
    for file in files:
        found: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}
        if not found.get("ended"):
            failed.append(f"stage {file.stem}: it did not come to its end; see above")
        first = set(found.get("failed", []))
        again = file.with_suffix(".again")
        told = json.loads(again.read_text()) if again.exists() else {"passed": [], "failed": []}
        second = set(told["passed"]) - set(told["failed"])  # a passed test's end may have failed
        passed_alone += sorted(first & second)
        failed += sorted(first - second)
        passed += len(set(found.get("passed", [])) - first) + len(first & second)
        skipped.update(found.get("skipped", []))
        took_s.update(found.get("took_s", {}))
    lines = [f"not run, {n}: {why.removeprefix('Skipped: ')}" for why, n in sorted(skipped.items())]
    slow = [row for row in took_s.most_common(SHOWN) if row[1] >= SLOW_S]
    lines += [f"slow, {seconds:.0f} s: {file}" for file, seconds in slow]
    lines += [f"passed only when it ran again, alone: {test}" for test in passed_alone]
    lines += [f"FAILED {test}" for test in failed]
    lines.append(f"tests: {passed} passed, {len(failed)} failed, {skipped.total()} skipped")
    return lines, not failed


def main(arguments: Sequence[str]) -> int:
    lines, well = summary([Path(argument) for argument in arguments])
    print(*lines, sep="\n")
    return 0 if well else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
