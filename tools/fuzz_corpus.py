"""The fuzz targets' inputs: one file a target in tests/c/fuzz/corpus, one input a line, in hex.

python tools/fuzz_corpus.py unpack tests/c/fuzz/corpus/packet.hex FOLDER   a file for each input
python tools/fuzz_corpus.py pack FOLDER tests/c/fuzz/corpus/packet.hex     the files, sorted

libFuzzer reads folders of files; git and people prefer two files to four hundred.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path


def unpack(packed: Path, folder: Path) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    inputs = [bytes.fromhex(line) for line in packed.read_text().splitlines()]
    for data in inputs:
        (folder / hashlib.sha1(data).hexdigest()).write_bytes(data)  # libFuzzer's own names
    return len(inputs)


def pack(folder: Path, packed: Path) -> int:
    inputs = sorted({path.read_bytes() for path in folder.iterdir()}, key=lambda d: (len(d), d))
    packed.write_text("".join(f"{data.hex()}\n" for data in inputs))
    return len(inputs)


def main(arguments: list[str]) -> int:
    actions = {"unpack": unpack, "pack": pack}
    if len(arguments) != 3 or arguments[0] not in actions:
        print(__doc__, file=sys.stderr)
        return 2
    print(f"{actions[arguments[0]](Path(arguments[1]), Path(arguments[2]))} inputs")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
