"""Nothing in the package and the tools is unused, but what stands here with its reason."""

import re
from pathlib import Path

from vulture import Vulture

ROOT = Path(__file__).resolve().parents[2]
#: Why a name stays that no Python of ours uses.
REASONS = {
    "Python calls it by this name": {"__getattr__", "__dir__"},
    "a library calls it by this name": {
        "on_start", "on_end", "read_logs", "append_logs", "log_message", "do_GET", "do_POST",
        "InheritedTexts", "on_package", "pytest_runtestloop", "pytest_runtest_logreport",
        "on_config", "on_files", "css_class", "kwargs", "language", "md",
    },
    "a library or Python reads it": {
        "no_args_is_help", "showwarning", "daemon_threads", "request_queue_size", "baudrate",
        "allow_reuse_address",
        "protocol_version", "server_version", "sys_version", "close_connection", "sampler",
        "__pydantic_config__", "CACHE_DIR", "w_m", "on_cell_start", "repo_url", "repo_name",
    },
    "registered by its decorator, which is how it is found": {
        "list_parameters", "_", "_saturates", "_current_of_kind", "_per_H_of_kind",
    },
    "the tool takes it by the name of the program that it measures": {
        "motulator", "gem", "own_gym", "gem_gym",
    },
    "pyserial reads it": {"write_timeout"},
    "the C reads it": {
        "memory_size", "timer1", "wrong_locks", "wrong_percent", "never_locks", "no_crystal",
    },
    "keeps memory alive that the C uses": {"_own_registers", "_board"},
    "a field of a row that is written and read whole": {"adc_counts", "fault_s"},
    "one of a whole list of the firmware's or a file's words": {
        "PREDICTION", "LAW_SAMPLING", "HYPERCUBE",
    },
}  # fmt: skip
#: `evidence papers` finds a figure's function by its name in the paper.
FIGURE = re.compile(r"[ab](_t)?\d+")


def test_nothing_is_unused_without_a_reason():
    found = Vulture()
    found.scavenge([str(ROOT / room) for room in ("host", "tools", "tests")])
    unused = {
        item.name: item
        for item in found.get_unused_code(min_confidence=60)
        if ROOT / "tests" not in Path(item.filename).parents and not FIGURE.fullmatch(item.name)
    }
    reasons = set().union(*REASONS.values())
    new = [f"{unused[name].filename}: {name}" for name in unused if name not in reasons]
    assert new == [], "nothing uses this: delete it, or say here why it stays"
    assert reasons <= set(unused), "these are used, or gone: their reasons go"
