"""Run an FMU by FMPy on Windows: fmu_there.py FMU INPUTS OUTPUTS

INPUTS: JSON, a list of what the FMU gets before each period. OUTPUTS: npz, with the bits of all
outputs after each period by name. It fails if FMPy finds a mistake in the file.
"""

import json
import sys
import zipfile
from pathlib import Path

# Python for Windows does not look into the folder of a script.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host" / "fmu"))

import numpy as np
from fmpy.validation import validate_fmu
from fmu_masters import Fmu


def main(file, inputs, outputs):
    assert validate_fmu(file) == []
    folder = Path(file).resolve().with_suffix("")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(folder)
    fmu = Fmu(folder).begin()
    names = [v.name for v in fmu.variables.values() if v.causality == "output"]
    rows = []
    for given in json.loads(Path(inputs).read_text()):
        fmu.set(**given)
        fmu.step()
        rows.append([float(x) for x in fmu.get(*names)])
    assert not fmu.said, fmu.said
    np.savez(outputs, **dict(zip(names, np.transpose(rows), strict=True)))


main(*sys.argv[1:])
