"""A pytest plugin: the tests run with another build of the firmware than the installed one.
HT_FIRMWARE has the path of its `_firmware.py`. Use:
`PYTHONPATH=tools python -m pytest -p other_firmware ...`."""

import importlib.util
import os
import sys

spec = importlib.util.spec_from_file_location("hexatorque._firmware", os.environ["HT_FIRMWARE"])
assert spec is not None and spec.loader is not None
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
sys.modules[spec.name] = module
