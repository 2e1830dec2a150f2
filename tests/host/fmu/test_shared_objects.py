"""The object files that these tests share are shared by equal texts only."""

import ctypes

import shared_objects

from hexatorque.fmu import controller


def test_a_header_that_differs_makes_another_object_file_and_the_same_texts_none(tmp_path):
    """The header is read through another one, whose name a macro has."""
    kept = tmp_path / "kept"
    kept.mkdir()
    seen = '__attribute__((visibility("default")))'
    texts = {
        "outer.h": '#include "inner.h"\n',
        "first.c": '#define OUTER "outer.h"\n#include OUTER\n'
        f"{seen} int first(void) {{ return VALUE; }}\n",
        "second.c": f"{seen} int second(void) {{ return 7; }}\n",
    }
    found, files = [], []
    for k, value in enumerate((1, 2, 1)):
        folder = tmp_path / str(k)
        folder.mkdir()
        for name, text in (texts | {"inner.h": f"#define VALUE {value}\n"}).items():
            (folder / name).write_text(text)
        output = tmp_path / f"{k}.so"
        image = shared_objects.compile_once(kept, [controller.program("cc")], folder, output)
        assert image == output.read_bytes()
        library = ctypes.CDLL(str(output))
        found.append((library.first(), library.second()))
        files.append(len(list(kept.glob("*.o"))))
    assert found == [(1, 7), (2, 7), (1, 7)] and files == [2, 3, 3]
