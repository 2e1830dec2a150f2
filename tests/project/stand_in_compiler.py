"""CMake with a stand-in for TI's compiler. It compiles nothing and records its calls."""

import os
import subprocess

import pytest
from ccs_projects import CC, CMAKE, NINJA, STAND_IN

needs_cmake = pytest.mark.skipif(not (CMAKE and NINJA and CC), reason="cmake, ninja, gcc")


def configure(tree, preset, root="", *more):
    command = [CMAKE, "--preset", preset, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={NINJA}", *more]
    environment = {k: v for k, v in os.environ.items() if k != "TI_CGT_ROOT"}
    if root:
        environment["TI_CGT_ROOT"] = str(root)
    return subprocess.run(command, cwd=tree, capture_output=True, text=True, env=environment)


def stand_ins(tmp_path):
    """Make a compiler's folder. Returns the log of its calls."""
    log = tmp_path / "log"
    (tmp_path / "bin").mkdir()
    for name in ("cl2000", "ar2000"):
        (tmp_path / "bin" / name).write_text(STAND_IN.format(log=log, cc=CC))
        (tmp_path / "bin" / name).chmod(0o755)
    return log
