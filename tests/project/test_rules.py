"""The firmware's build fails on what the C28x does not have and on what the core
must not keep. Each breach is planted in a copy of the tree."""

import filecmp
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


def tool(name: str) -> str | None:
    beside = BIN / name
    return str(beside) if beside.exists() else shutil.which(name)


CMAKE, NINJA = tool("cmake"), tool("ninja")
pytestmark = pytest.mark.skipif(not (CMAKE and NINJA), reason="cmake and ninja are needed")


def build(folder: Path) -> subprocess.CompletedProcess:
    """Configure and build the libraries; the result of the step that failed. No rule here depends
    on optimisation, and without it they compile in half the time."""
    configure = [CMAKE, "-S", folder, "-B", folder / "build", "-G", "Ninja",
                 f"-DCMAKE_MAKE_PROGRAM={NINJA}", "-DCMAKE_BUILD_TYPE=Debug"]  # fmt: skip
    done = subprocess.run(configure, capture_output=True, text=True)
    if done.returncode == 0:
        make = [CMAKE, "--build", folder / "build", "--target", "ht_app"]
        done = subprocess.run(make, capture_output=True, text=True)
    return done


@pytest.fixture(scope="module")
def built_tree(tmp_path_factory):
    """A copy of the tree, built once, and what the build said."""
    folder = tmp_path_factory.mktemp("tree")
    for name in ("firmware", "cmake", "tests/c"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("fuzz"))
    shutil.copy(ROOT / "CMakeLists.txt", folder)
    return folder, build(folder)


@pytest.fixture
def tree(built_tree):
    """That copy, without what earlier tests planted. Only what changed is compiled again."""
    folder, _ = built_tree
    shutil.copytree(ROOT / "firmware" / "core", folder / "firmware" / "core", dirs_exist_ok=True,
                    copy_function=copy_if_changed)  # fmt: skip
    return folder


def copy_if_changed(source: str, target: str) -> None:
    if not filecmp.cmp(source, target, shallow=False):
        shutil.copyfile(source, target)


def test_clean_tree_builds(built_tree):
    done = built_tree[1]
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("planted", "said"),
    [
        ("typedef uint8_t octet;", "uint8_t"),
        ("typedef int8_t octet;", "int8_t"),
        ("static inline double twice(float x) { return x; }", "double"),
        ("float ht_planted(float x);\nfloat ht_planted(float x) { return x * 2.5; }", "2.5"),
        ("float ht_planted(float x);\nfloat ht_planted(float x) { return x * 1e3; }", "1e3"),
        ("float ht_planted(void);\nfloat ht_planted(void) { int unused; return 0.0f; }", "unused"),
        ("float ht_planted(int x);\nfloat ht_planted(int x) { return x; }", "conversion"),
        (
            "int *ht_planted(void);\nint *ht_planted(void) { static int n; return &n; }",
            "mutable static data",
        ),
        (
            "int *ht_planted(void);\nint *ht_planted(void) { static int n = 3; return &n; }",
            "mutable static data",
        ),
    ],
)
def test_breach_fails_the_build(tree, planted, said):
    source = tree / "firmware" / "core" / "ht_speed.c"
    source.write_text(source.read_text() + "\n" + planted + "\n")
    done = build(tree)
    assert done.returncode != 0
    assert said in done.stdout + done.stderr


def test_words_in_comments_and_strings_do_not_count(tree):
    source = tree / "firmware" / "core" / "ht_speed.c"
    comment = '/* uint8_t, double, 2.5 */ // 1e3\nstatic const char note[] = "double 2.5";\n'
    use = "const char *ht_planted(void);\nconst char *ht_planted(void) { return note; }\n"
    source.write_text(source.read_text() + comment + use)
    done = build(tree)
    assert done.returncode == 0, done.stdout + done.stderr
