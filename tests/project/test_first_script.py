"""The first script of the tutorial: it loads a set-up, runs it, draws the torque, changes one key
and compares. It is taken from the page and run as it stands there."""

import contextlib
import io
import re
import runpy

from pages import DOCS, PART, plain

PAGE = (DOCS / "tutorial.md").read_text()


def test_the_script_on_the_page_runs_and_prints_what_the_page_says(tmp_path, monkeypatch):
    parts = list(PART.finditer(PAGE))
    at = next(k for k, part in enumerate(parts) if part["detail"] == "bands.py")
    script, command, printed, picture = parts[at : at + 4]
    assert command["text"].strip() == "python bands.py" and printed["kind"] == "text"
    for step in (r"load\(", r"measure\(", r'plot\("torque"', r'changed\(\{"\w+\.\w+":', "print"):
        assert re.search(step, script["text"]), step
    (tmp_path / "bands.py").write_text(script["text"])
    monkeypatch.chdir(tmp_path)
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        runpy.run_path("bands.py", run_name="__main__")
    for line in printed["text"].splitlines():
        assert plain(line) in plain(output.getvalue())
    assert (tmp_path / picture["detail"]).read_bytes().startswith(b"\x89PNG")
