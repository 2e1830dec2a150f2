"""Images are those of the sources that are installed now."""

import json
import os
import subprocess

from hexatorque.boards import tools


def test_a_source_that_is_older_than_its_image_is_compiled(tmp_path, monkeypatch):
    """An installed file keeps the time of its origin. Then not even an option has changed."""
    source, program = tmp_path / "source", tmp_path / "source/firmware/says.c"
    program.parent.mkdir(parents=True)
    (source / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.26)\nproject(says C)\n"
        "add_executable(says firmware/says.c)\n"
    )
    preset = {"name": "small", "cacheVariables": {"CMAKE_BUILD_TYPE": "Release"}}
    presets = {"version": 3, "configurePresets": [preset]}
    (source / "CMakePresets.json").write_text(json.dumps(presets))
    monkeypatch.setattr(tools, "source_root", lambda: source)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    build = getattr(tools.build, "__wrapped__", tools.build)

    def says(value: int) -> int:
        program.write_text(f"int main(void) {{ return {value}; }}\n")
        os.utime(program, (1.0e9, 1.0e9))
        return subprocess.run([build("small") / "says"]).returncode

    assert [says(3), says(4), says(4)] == [3, 4, 4]
