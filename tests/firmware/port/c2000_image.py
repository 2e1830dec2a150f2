"""Complete C2000 images on the register model, built with the host's compiler from the
firmware's sources, changed ones if wanted; and the registers that they leave, in words.

`python tests/firmware/port/c2000_image.py` writes the golden files anew: look at the difference
before you keep it.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
GOLDEN = Path(__file__).parent / "golden"
BOARDS = {"f28335": "f28335", "f28377s": "f28377s", "launchxl_f28377s": "f28377s"}
FOLDERS = ("core", "app", "link", "port/host", "port/c2000", "port/c2000/image")
CAPTURE = "-DHT_CAPTURE_VALUES=2048u"
FLAGS = ["-std=c99", "-O1", "-fno-pie", "-ffp-contract=off"]
#: Processor in the loop: more folders, and what of the others it is without.
PIL_FOLDERS = ("pil", "pil/calls", "port/c2000/pil")
NOT_IN_PIL = (
    "ht_adc.c", "ht_cmpss.c", "ht_dead_man.c", "ht_eqep.c", "ht_image.c", "ht_pie.c",
    "ht_port_c2000.c", "ht_pwm.c", "ht_service.c", "ht_service_fast.c", "ht_service_requests.c",
    "ht_requests_drive.c", "ht_requests_sampling.c", "ht_requests_session.c",
    "ht_dictionary.c", "ht_log.c", "ht_log_ring.c", "ht_reset.c", "ht_store.c", "ht_no_store.c",
    "ht_virtual_period.c",
    "ht_burst.c", "ht_burst_rows.c", "ht_streams.c",
)  # fmt: skip
SIZES = {"ht_code_size": 64, "ht_const_size": 32}
CC = os.environ.get("CC") or next(filter(shutil.which, ("gcc", "clang", "cc")), "cc")


class Builder:
    """Makes programs that run an image. Object files are kept, so a changed source needs only its
    own compilation and a link."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _compile(self, source: Path, out: Path, *options: str) -> Path:
        include = [f"-I{ROOT / 'firmware' / f}" for f in (*FOLDERS, *PIL_FOLDERS, "port")]
        command = [CC, *FLAGS, *options, *include, "-c", source, "-o", out]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return out

    def _sources(
        self, board: str, pil: bool, active_low: bool
    ) -> dict[str, tuple[Path, Path, tuple[str, ...]]]:
        """Source name -> source, object, options."""
        firmware = ROOT / "firmware"
        folders = FOLDERS[:-1] + (PIL_FOLDERS if pil else ())
        found = [file for folder in folders for file in sorted((firmware / folder).glob("*.c"))]
        found += [
            firmware / FOLDERS[-1] / name for name in ("ht_image.c", "ht_no_store.c", "main.c")
        ]
        found.append(ROOT / "tests" / "c" / ("run_pil.c" if pil else "run_image.c"))
        of_board = {
            name: (f"-DHT_BOARD=ht_board_{board}", CAPTURE, "-Dmain=ht_target_main")
            for name in ("ht_image.c", "main.c", "ht_pil_chip.c")
        }
        of_board[found[-1].name] = (f"-DHT_BOARD_UNDER_TEST=ht_board_{board}",)
        sources = {}
        for source in found:
            if not (pil and source.name in NOT_IN_PIL):
                options = of_board.get(source.name, ())
                stem = f"{board}_{source.name}" if options else source.stem
                if "HT_GATES_ACTIVE_LOW" in source.read_text():
                    options += (f"-DHT_GATES_ACTIVE_LOW={int(active_low)}",)
                    stem += "_active_low" if active_low else "_active_high"
                sources[source.name] = source, self.folder / f"{stem}.o", options
        return sources

    def build(
        self,
        board: str,
        change: tuple[str, str, str] | None = None,
        pil: bool = False,
        active_low: bool = False,
    ) -> Path:
        """The program of a board. `change`: source name, text that must be there once,
        what takes its place. `active_low`: the build option for gate drivers that invert."""
        name, old, new = change or ("", "", "")
        objects = []
        sources = self._sources(board, pil, active_low)
        if change and name not in sources:
            raise ValueError(f"{name} is not in this image")
        for source, out, options in sources.values():
            if source.name == name:
                text = source.read_text()
                if text.count(old) != 1:
                    raise ValueError(f"{name}: {old!r} is there {text.count(old)} times")
                changed, out = self.folder / f"changed_{name}", self.folder / "changed.o"
                changed.write_text(text.replace(old, new))
                self._compile(changed, out, *options, f"-I{source.parent}")
            elif not out.exists():
                self._compile(source, out, *options)
            objects.append(out)
        program = self.folder / f"run_{'pil_' if pil else ''}{board}"
        sizes = [f"-Wl,--defsym={symbol}={size}" for symbol, size in SIZES.items()]
        command = [CC, "-no-pie", *objects, "-o", program, "-lm", *sizes]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return program


def run(program: Path, *arguments: str) -> tuple[bool, list[str]]:
    """Whether the program found no error, and its output."""
    done = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=60)
    return done.returncode == 0, done.stdout.splitlines()


def complaints(lines: list[str]) -> list[str]:
    return [line for line in lines if line.startswith(("check FAILED", "violation"))]


def _fields(value: int, fields: str) -> str:
    """ "15-14 FREE_SOFT, 2 PHSEN" and a value -> "FREE_SOFT=2 PHSEN=1", zeros left out."""
    words = []
    for position, name in re.findall(r"([\d-]+) (\w+)", fields):
        high, _, low = position.partition("-")
        low = int(low or high)
        part = value >> low & (1 << int(high) - low + 1) - 1
        if part:
            words.append(f"{name}={part}")
    if not fields and value > 9:
        words.append(str(value))
    return " ".join(words)


def _pins(title: str, value: int) -> str:
    """What a register of a GPIO port says about its pins, as far as it is not 0."""
    port, kind = re.fullmatch(r"GPIO\.GP(.)(\w+)", title).groups()
    first = 32 * (ord(port) - ord("A"))
    if kind in ("DIR", "PUD", "DAT"):
        want = 1 if kind == "DIR" else 0
        pins = [first + n for n in range(32) if value >> n & 1 == want]
        return " ".join(
            [{"DIR": "outputs:", "PUD": "pull-ups:", "DAT": "low:"}[kind], *map(str, pins)]
        )
    if kind == "CTRL":  # sampling period of eight pins each
        periods = [(first + 8 * n, value >> 8 * n & 0xFF) for n in range(4)]
        return " ".join(f"GPIO{pin}..{pin + 7}: {2 * n} clocks" for pin, n in periods if n)
    first += 16 * (kind[-1] == "2")
    pairs = [(first + n, value >> 2 * n & 3) for n in range(16)]
    return " ".join(f"GPIO{pin}={what}" for pin, what in pairs if what)


def describe(board: str, lines: list[str]) -> list[str]:
    """The registers in what a run printed: name, address, value, meaning."""
    from hexatorque.firmware import ffi, lib

    chip = ffi.new("ht_regfile *")
    lib.ht_regfile_reset(chip, ffi.addressof(getattr(lib, f"ht_{BOARDS[board]}")))
    table = {}
    for n in range(chip.bound_count):
        entry = chip.bound[n].reg
        table[lib.ht_regfile_address(chip, n)] = entry.bits, ffi.string(entry.fields).decode()
    name = ffi.new("char[64]")
    rows: list[tuple[str, str, int, str]] = []
    for line in lines:
        if not line.startswith("register"):
            continue
        address, value = (int(word, 16) for word in line.split()[1:])
        bits, fields = table[address]
        lib.ht_regfile_name(chip, address, name)
        title = ffi.string(name).decode()
        if title.startswith("VECTOR") and rows and rows[-1][0].startswith("VECTOR"):
            first = rows[-1][0].split("..")[0]
            if rows[-1][2] == value:  # the same function: one line
                rows[-1] = (f"{first}..{title[6:]}", rows[-1][1], value, "")
                continue
        shown = f"0x{value:0{bits // 4}X}"
        words = _pins(title, value) if title.startswith("GPIO") else _fields(value, fields)
        rows.append((title, f"0x{address:05X}", value, f"{shown:<11}{words}"))
    isr = {1: "unexpected", 2: "lost", 3: "fast", 4: "slow"}
    return [
        f"{title:<23} {address:<9}{isr[value] if title.startswith('VECTOR') else text}".rstrip()
        for title, address, value, text in rows
    ]


def golden(board: str, pil: bool = False) -> Path:
    return GOLDEN / f"{'pil_' if pil else ''}{board}.txt"


def main() -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        builder = Builder(Path(folder))
        GOLDEN.mkdir(exist_ok=True)
        for board in BOARDS:
            for pil in (False, True):
                arguments = ("registers",) if pil else ()
                good, lines = run(builder.build(board, pil=pil), *arguments)
                if not good:
                    sys.exit("\n".join([f"{board}:", *complaints(lines)]))
                golden(board, pil).write_text("\n".join(describe(board, lines)) + "\n")


if __name__ == "__main__":
    main()
