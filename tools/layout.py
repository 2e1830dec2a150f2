"""C source that compiles only if a compiler lays out the firmware's structures as cffi does."""

import sys
from pathlib import Path

from hexatorque._firmware import ffi

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "cmake"))
from generate_cffi import FOLDERS, HEADERS  # noqa: E402

#: Compiler's options for it.
OPTIONS = ("-std=c11", "-fsyntax-only", *(f"-I{ROOT / 'firmware' / d}" for d in FOLDERS))


def source() -> str:
    lines = [f'#include "{header}"' for header in HEADERS]
    for name in ffi.list_types()[0]:
        kind = ffi.typeof(name)
        if kind.kind not in ("struct", "union", "enum"):
            continue
        lines.append(f'_Static_assert(sizeof({name}) == {ffi.sizeof(kind)}, "{name}");')
        for field, found in (kind.fields or ()) if kind.kind != "enum" else ():
            place = f"__builtin_offsetof({name}, {field})"
            lines.append(f'_Static_assert({place} == {found.offset}, "{name}.{field}");')
    return "\n".join(lines) + "\n"
