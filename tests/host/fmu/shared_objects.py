"""Object files that the FMUs of all tests share: most of an FMU's sources are the same for all
set-ups, and compiling them takes longer than most tests do."""

import hashlib
import json
import re
import shutil
import subprocess

from hexatorque import system
from hexatorque.fmu import controller

HAS_ZIG = controller.has_zig()
ONE_COMMAND, ZIG = controller.compiled, controller.has_zig
OPTIONS = ["-fPIC", *controller.EXACT, *controller.HIDDEN]


def by_command(patch, zig):
    """From now on one command compiles each binary, as for a user; zig: with the extra `fmu`."""
    patch.setattr(controller, "compiled", ONE_COMMAND)
    patch.setattr(controller, "has_zig", ZIG if zig else lambda: False)


def by_objects(patch, kept):
    """From now on binaries are of object files in the folder `kept`, and for this system alone."""
    patch.setattr(controller, "compiled", lambda *given: compile_once(kept, *given))
    patch.setattr(controller, "has_zig", lambda: False)


def read_by(name, texts):
    """The names of the files in `texts` that the compiler may read for this one: those whose names
    are in quotes in it, and so on."""
    found, ahead = {name}, [name]
    while ahead:
        quoted = set(re.findall(r'"([\w.]+)"', texts[ahead.pop()])) & texts.keys()
        ahead += quoted - found
        found |= quoted
    return sorted(found)


def compile_once(kept, compiler, folder, output):
    """As `controller.compiled`. An object file that has been made of the same texts is taken again.
    Processes that share `kept` take turns."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}
    files = sorted(name for name in texts if name.endswith(".c"))
    objects = {}
    for name in files:
        read = [(other, texts[other]) for other in read_by(name, texts)]
        of = json.dumps([name, compiler, OPTIONS, read]).encode()
        objects[name] = kept / f"{hashlib.sha256(of).hexdigest()}.o"
    with (kept / ".lock").open("w") as lock:
        system.lock(lock.fileno(), wait=True)
        new = [name for name in files if not objects[name].exists()]
        if new:
            alone = [option for option in OPTIONS if option != "-shared"]
            subprocess.run([*compiler, *alone, "-c", *new], cwd=folder, check=True)
        for name in new:
            half = kept / "half"  # what has its own name is whole, though a process may be killed
            shutil.copy((folder / name).with_suffix(".o"), half)
            half.replace(objects[name])
    subprocess.run([*compiler, *OPTIONS, "-o", output, *objects.values(), "-lm"], check=True)
    return output.read_bytes()
