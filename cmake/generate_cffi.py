"""Write the cffi module `_firmware` from the firmware's own headers.

Usage: generate_cffi.py CC FIRMWARE_DIR OUTPUT.py

The headers alone define the interface. The C preprocessor processes them, without the system
headers, whose types cffi knows, and the result goes to `cdef`. The module is plain Python, the same
on every system and for every version of Python. It opens the library that lies beside it. cffi
works out how structures lie in memory; tests/firmware/test_layout.py compares that with compilers.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from cffi import FFI

HEADERS = (
    "ht_drive.h",
    "ht_misfit.h",
    "ht_magnet_observer.h",
    "ht_induction_rules.h",
    "ht_magnet_rules.h",
    "ht_store.h",
    "ht_log.h",
    "ht_comparator.h",
    "ht_vsd.h",
    "ht_vectors.h",
    "ht_drivers.h",
    "ht_regfile.h",
    "ht_board_of_device.h",
    "ht_pil_host.h",
    "ht_virtual_period.h",
    "ht_virtual_board.h",
    "ht_host_law.h",
    "ht_burst_rows.h",
    "ht_param_groups.h",
    "ht_texts.h",
    "ht_off_circle.h",
    "ht_octets.h",
    "ht_opcodes.h",
    "ht_xcp_codes.h",
    "ht_snapshot.h",
    "ht_dictionary.h",
    "ht_fmu_variables.h",
)


#: Where they and what they include lie.
FOLDERS = (
    "core",
    "app",
    "link",
    "link/xcp",
    "port",
    "port/c2000",
    "port/host",
    "port/virtual",
    "port/fmu/variables",
    "pil",
    "pil/registers",
    "pil/host",
)
#: The end of the module. A library's suffix is its system's.
OPEN = """
from pathlib import Path

(_library,) = Path(__file__).parent.glob("libhexatorque.*")
lib = ffi.dlopen(str(_library))
"""


def main() -> None:
    compiler, firmware, output = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    include = [f"-I{firmware / d}" for d in FOLDERS]
    source = "".join(f'#include "{h}"\n' for h in HEADERS)
    with tempfile.TemporaryDirectory() as empty:
        for name in ("stdint.h", "stdbool.h", "stddef.h", "math.h"):
            Path(empty, name).touch()
        cdef = subprocess.run(
            [compiler, "-E", "-P", "-nostdinc", f"-I{empty}", *include, "-x", "c", "-"],
            input=source,
            text=True,
            capture_output=True,
            check=True,
        ).stdout
    ffi = FFI()
    ffi.cdef(cdef)
    ffi.set_source("hexatorque._firmware", None)
    ffi.emit_python_code(str(output))
    output.write_text(output.read_text() + OPEN)


if __name__ == "__main__":
    main()
