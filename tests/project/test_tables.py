"""What the firmware's tables say stands nowhere else: no text of a row, no name of a state and no
limit is written again by hand in Python or in the page's JavaScript."""

import ast
import re
from pathlib import Path

import pytest

from hexatorque import firmware
from hexatorque.firmware import ffi, lib
from hexatorque.results import RESULTS

ROOT = Path(__file__).resolve().parents[2]
HOST = ROOT / "host" / "hexatorque"
PYTHON = sorted(HOST.rglob("*.py"))
PAGE = sorted([*(HOST / "monitor" / "page").glob("*.js"), *(ROOT / "web").glob("*.js")])
STATES = "|".join(firmware.STATES)
#: States whose name is no other word of ours: wherever one is written, it is the state.
OWN_WORDS = set(firmware.STATES) - {"build", "run", "test", "fault"}
#: A text of so many letters is no common expression.
LONG = 20


def _demands() -> list[str]:
    return [ffi.string(lib.ht_misfit_demand(n)).decode() for n in range(1, lib.HT_MISFITS)]


TEXTS = [
    text
    for text in (
        *firmware.FAULTS.values(), *firmware.WARNINGS.values(), *firmware.PARAMETER_SETS,
        *(row.text for row in RESULTS.values()), *_demands(),
    )
    if len(text) >= LONG
]  # fmt: skip
#: Rows of two words or more, or of a word with a hyphen, whose whole text nothing else has.
NAMES = {
    name
    for name in (
        *firmware.FAULTS.values(), *firmware.WARNINGS.values(), *firmware.LIMITS.values(),
        *firmware.EVENTS.values(), *map(firmware.reset_cause, range(lib.HT_RESETS)),
    )
    if " " in name or "-" in name
}  # fmt: skip
#: Shares of other parameters that are limits. One of two digits may mean something else.
SHARES = {order.share for order in firmware.orders() if len(f"{order.share:g}") > 4}


def texts_in(source: str) -> set[str]:
    return {text for text in TEXTS if text in source}


def written(tree: ast.AST) -> str:
    """The texts of a module, without what describes it and its parts."""
    described = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    constants = (
        n for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in described
    )
    return "\n".join(n.value for n in constants if isinstance(n.value, str))


def names_in(tree: ast.AST) -> set[str]:
    """Constants that are the name of a row."""
    return {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)} & NAMES


def names_in_javascript(source: str) -> set[str]:
    return set(re.findall(r"[\"'`]([^\"'`\n]+)[\"'`]", source)) & NAMES


def states_in(tree: ast.AST) -> list[int]:
    """Lines that compare a state with a name, or that list several. Those of OWN_WORDS are found
    in any use."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in OWN_WORDS:
            found.append(node.lineno)
        if isinstance(node, ast.Match) and "state" in ast.unparse(node.subject):
            names = {n.value for n in ast.walk(node) if isinstance(n, ast.Constant)}
            if names & set(firmware.STATES):
                found.append(node.lineno)
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            parts = [one for side in sides for one in (*getattr(side, "elts", ()), side)]
            names = [one.value for one in parts if isinstance(one, ast.Constant)]
            asked = any("state" in ast.unparse(side) for side in sides)
            if asked and set(names) & set(firmware.STATES):
                found.append(node.lineno)
        elif isinstance(node, ast.Tuple | ast.List | ast.Set | ast.Dict):
            rows = node.keys if isinstance(node, ast.Dict) else node.elts
            listed = {one.value for one in rows if isinstance(one, ast.Constant)}
            if len(listed) > 1 and listed <= set(firmware.STATES):
                found.append(node.lineno)
    return sorted(set(found))


def states_in_javascript(source: str) -> list[str]:
    asked = re.findall(rf"state\)? *[!=]==? *[\"'](?:{STATES})[\"']", source)
    one = rf"[\"'](?:{STATES})[\"']"
    turned = rf"{one} *[!=]==? *[\w.]*state|case +{one} *:"
    lists = rf"\[ *{one} *(?:, *{one} *)+,? *\]|[\"'`](?:{'|'.join(OWN_WORDS)})[\"'`]"
    keys = rf"[{{,] *(?:{STATES}) *:[^,}}]*, *(?:{STATES}) *:"
    return [*asked, *(text for rule in (turned, lists, keys) for text in re.findall(rule, source))]


def shares_in(tree: ast.AST) -> set[float]:
    numbers = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return {n for n in numbers if isinstance(n, float) and n in SHARES}


def shares_in_javascript(source: str) -> set[float]:
    return {n for n in map(float, re.findall(r"\b0?\.\d+", source)) if n in SHARES}


def test_there_is_something_to_look_for():
    assert len(TEXTS) > 40 and SHARES == {0.885}
    for text in ("the machine turns faster", "a start without legs", "built-in: the saved set is"):
        assert any(found.startswith(text) for found in TEXTS)
    asks = "x = drive.state == 'run'\ny = now.state in ('idle', x)\nz = 0.885 * x\n"
    assert states_in(ast.parse(asks)) == [1, 2]
    matches = "match drive.state:\n    case 'run': pass\nx = {'run': 1, 'test': 2}\ny == 'idle'\n"
    assert states_in(ast.parse(matches)) == [1, 3, 4] and shares_in(ast.parse(asks)) == {0.885}
    assert states_in(ast.parse("WORKING = ('calibrate', 'build', 'run')\n")) == [1]
    assert states_in_javascript("if (now.state === 'run') f(['build', \"run\"]);") == [
        "state === 'run'", "['build', \"run\"]",
    ]  # fmt: skip
    turned = "if ('run' === drive.state) f({run: 1, test: 2}); switch (x) { case 'run': g(`idle`) }"
    assert len(states_in_javascript(turned)) == 4
    assert shares_in_javascript("i = 0.885 * full + .885 - 1.885") == {0.885}
    says = "def f():\n    'link lost'\n    return f'{x}: the session has ended'"
    assert texts_in(written(ast.parse(says))) == {"the session has ended"}
    assert names_in(ast.parse("x = ('dc link high', 'a trip', 'over-speed')")) == {
        "dc link high", "over-speed",
    }  # fmt: skip
    assert names_in_javascript("f('winding warm', `trip`)") == {"winding warm"}


@pytest.mark.parametrize("path", PYTHON, ids=lambda path: path.relative_to(HOST).as_posix())
def test_python_asks_the_tables(path):
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    assert (texts_in(written(tree)), states_in(tree), shares_in(tree)) == (set(), [], set())
    assert names_in(tree) == set()


@pytest.mark.parametrize("path", PAGE, ids=lambda path: path.name)
def test_the_page_asks_the_tables(path):
    source = path.read_text(encoding="utf-8")
    assert texts_in(source) == set()
    assert states_in_javascript(source) == []
    assert names_in_javascript(source) == shares_in_javascript(source) == set()
