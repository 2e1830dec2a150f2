"""Compiled Python functions to C99, with the same bits.

The functions are those that numba compiles; numba's rules decide about types and arithmetic. A
function is translated once for each combination of types that it is called with. The subset is what
the plant needs: numbers, records, arrays, tuples, `if`, `for` over ranges, `while`, calls. Anything
else is refused with its place (`Untranslatable`).

Two things differ from numba's code. A function that raises an exception sets `*failed` to the
number of its text, and its callers return. A division by zero follows IEEE 754 and raises nothing.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import uint64

from .types import (
    COMPLEX,
    FLAG,
    INT,
    OF_NUMPY,
    REAL,
    SINGLE,
    UINT,
    VOID,
    WORD,
    Array,
    Constant,
    Entry,
    Parts,
    Record,
    Scalar,
    Table,
    Tuple,
    Untranslatable,
    declared,
    name_of,
)  # fmt: skip

COMPLEX_TYPE = """\
typedef struct {
    double re, im;
} plant_complex;"""

#: Arithmetic that C lacks, as numba does it.
HELPERS = """\
static inline plant_complex complex_of(double re, double im)
{
    plant_complex z;
    z.re = re;
    z.im = im;
    return z;
}

static inline plant_complex complex_add(plant_complex a, plant_complex b)
{
    return complex_of(a.re + b.re, a.im + b.im);
}

static inline plant_complex complex_sub(plant_complex a, plant_complex b)
{
    return complex_of(a.re - b.re, a.im - b.im);
}

static inline plant_complex complex_mul(plant_complex a, plant_complex b)
{
    return complex_of(a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re);
}

static inline double least_d(double a, double b)
{
    return (b < a) ? b : a;
}

static inline double most_d(double a, double b)
{
    return (b > a) ? b : a;
}

static inline int64_t least_i(int64_t a, int64_t b)
{
    return (b < a) ? b : a;
}

static inline int64_t most_i(int64_t a, int64_t b)
{
    return (b > a) ? b : a;
}

static inline int64_t size_i(int64_t a)
{
    return (a < 0) ? -a : a;
}

static inline int64_t floor_div(int64_t a, int64_t b)
{
    int64_t q = a / b;
    return ((a % b != 0) && ((a < 0) != (b < 0))) ? q - 1 : q;
}

static inline int64_t floor_mod(int64_t a, int64_t b)
{
    return a - b * floor_div(a, b);
}
"""

#: Functions of one real number -> C's.
OF_LIBM = {
    getattr(module, name): "fabs" if name == "absolute" else name
    for module in (np, math)
    for name in ("sqrt", "exp", "expm1", "log", "cos", "sin", "tanh", "floor", "ceil", "copysign")
}  # fmt: skip
CASTS = {
    np.int64: INT, int: INT, np.float64: REAL, float: REAL, np.uint64: UINT, np.uint16: WORD,
    np.bool_: FLAG, bool: FLAG, uint64: UINT,
}  # fmt: skip
OPERATORS = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^",
    ast.LShift: "<<", ast.RShift: ">>",
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
}  # fmt: skip
FOLD: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a * a if b == 2 else a**b,
    ast.LShift: lambda a, b: a << b,
    ast.Eq: lambda a, b: a == b,
    ast.NotEq: lambda a, b: a != b,
    ast.Lt: lambda a, b: a < b,
    ast.In: lambda a, b: a in b,
}
#: Words of C that a variable may not be called.
RESERVED = {"switch", "default", "case", "register", "double", "float", "short", "long"}
INDENT = "    "


@dataclass
class Value:
    """An expression in C. by_address: the text is an address, for a record or named tuple; before:
    how many statements there were when it was made."""

    kind: Any
    text: str
    by_address: bool = True


@dataclass(frozen=True)
class Made:
    """A translated function. known: its value in any case, if it returns a known one."""

    name: str
    returns: Any
    raises: bool
    known: Value | None = None


def constant(value: Any) -> Value:
    return Value(Constant(value), "")


def literal(value: Any) -> Value:
    """A known number as an expression."""
    if isinstance(value, bool | np.bool_):
        return Value(FLAG, "true" if value else "false")
    if isinstance(value, np.uint64):
        return Value(UINT, f"UINT64_C({int(value)})")
    if isinstance(value, int | np.integer):
        number = int(value)
        return Value(INT, str(number) if abs(number) < 2**31 else f"INT64_C({number})")
    if isinstance(value, float):
        if math.isinf(value):
            return Value(REAL, "INFINITY" if value > 0 else "-INFINITY")
        return Value(REAL, repr(float(value)) if value >= 0 else f"({float(value)!r})")
    if isinstance(value, complex):
        return Value(COMPLEX, f"complex_of({value.real!r}, {value.imag!r})")
    raise Untranslatable(f"no constant in C for {value!r}")


def source_of(function: Callable) -> Callable:
    """The Python function behind a compiled one."""
    return getattr(function, "py_func", function)


class Translator:
    """Translates functions, each once, with all that they call.

    choose(function, kinds): the function that is meant by `function` with arguments of these
    types; for functions that have several implementations.
    """

    def __init__(self, choose: Callable[[Any, Sequence[Any]], Any]) -> None:
        self._choose = choose
        self._made: dict[tuple, Made] = {}
        self._names: set[str] = set()
        self._prototypes: list[str] = []
        self._public: list[str] = []
        self._bodies: list[str] = []
        self._tuples: dict[str, str] = {}
        self._records: dict[str, tuple[np.dtype, str]] = {}
        self._parts: dict[str, str] = {}
        self.errors: list[str] = []

    # -- what has been made -------------------------------------------------------------------

    def types(self) -> str:
        """Definitions of all types, for a header file."""
        tables = [
            f"struct table_{s.letter} {{\n    {s.name} *at;\n    int64_t rows, columns;\n}};"
            for s in (INT, SINGLE)
        ]
        records = [text for _, text in self._records.values()]
        return "\n\n".join([*tables, *records, *self._parts.values(), *self._tuples.values()])

    def declarations(self) -> str:
        """The declarations of the functions that others call."""
        return "\n".join(self._public)

    def functions(self) -> str:
        return "\n".join([*self._prototypes, "", *self._bodies])

    # -- types --------------------------------------------------------------------------------

    def record(self, dtype: np.dtype, name: str) -> Record:
        """The record's type, under this name."""
        dtype = np.dtype(dtype.descr) if dtype.type is np.record else dtype
        if name in self._records:
            if self._records[name][0] != dtype:
                raise Untranslatable(f"two types of record are called {name}")
            return Record(dtype, name)
        lines, at = [], 0
        for field, (inner, offset, *_) in (dtype.fields or {}).items():
            if offset != at or inner.itemsize % 8:
                raise Untranslatable(f"{name}.{field}: not where C puts it")
            at += inner.itemsize
            base, shape = inner.subdtype or (inner, ())
            if base.names:
                text = f"struct {self.record(base, f'{name}_{field}').name} {field}"
            else:
                count = f"[{int(np.prod(shape))}]" if shape else ""
                text = f"{OF_NUMPY[base].name} {field}{count}"
            lines.append(f"{INDENT}{text};\n")
        self._records[name] = (dtype, f"struct {name} {{\n{''.join(lines)}}};")
        return Record(dtype, name)

    def parts(self, name: str, **fields: Any) -> Parts:
        """A named tuple's type."""
        lines = [f"{INDENT}{declared(kind, field)};\n" for field, kind in fields.items()]
        self._parts[name] = f"struct {name} {{\n{''.join(lines)}}};"
        return Parts(name, tuple(fields.items()))

    def tuple(self, kind: Tuple) -> None:
        for one in kind.items:
            if isinstance(one, Tuple):
                self.tuple(one)
        lines = [f"{INDENT}{declared(one, f't{n}')};\n" for n, one in enumerate(kind.items)]
        self._tuples.setdefault(name_of(kind), f"{name_of(kind)} {{\n{''.join(lines)}}};")

    # -- functions ----------------------------------------------------------------------------

    def function(self, called: Callable, kinds: Sequence[Any], public: str = "") -> Made:
        """Translate the function for arguments of these types. public: its name, if others than
        translated functions call it."""
        python = source_of(self._choose(called, kinds))
        key = (python, tuple(kinds), public)
        if key not in self._made:
            body = Function(self, python, kinds)
            returns, raises, text = body.translate()
            if body.known:
                self._made[key] = Made("", returns, raises, body.known)
                return self._made[key]
            name = public or self._free_name(python.__name__.lstrip("_"))
            arguments = [declared(kind, n) for n, kind in zip(body.arguments, kinds)]
            if raises or public:
                arguments.append("int *failed")
            static = "" if public else "static "
            head = f"{static}{declared(returns, name)}({', '.join(arguments)})"
            (self._public if public else self._prototypes).append(f"{head};")
            self._bodies.append(f"{head}\n{{\n{text}}}\n")
            self._made[key] = Made(name, returns, raises)
        return self._made[key]

    def _free_name(self, wanted: str) -> str:
        name, n = f"plant_{wanted}", 1
        while name in self._names:
            n += 1
            name = f"plant_{wanted}_{n}"
        self._names.add(name)
        return name


class Function:
    """One function while it is translated."""

    def __init__(self, translator: Translator, python: Callable, kinds: Sequence[Any]) -> None:
        self._t = translator
        self._python = python
        lines, self._first = inspect.getsourcelines(python)
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self._tree = tree
        self._seen = inspect.getclosurevars(python)
        self.arguments = [self._called(a.arg) for a in tree.args.args]
        if len(self.arguments) != len(kinds):
            raise Untranslatable(f"{python.__name__}: {len(kinds)} arguments")
        self._variables: dict[str, Any] = dict(zip(self.arguments, kinds))
        self.known: Value | None = None
        self._out: list[str] = []
        self._temporaries = 0
        self._returns: Any = None
        self._raises = False

    def translate(self) -> tuple[Any, bool, str]:
        """The type that it returns, whether it raises, and its body."""
        self._block(self._tree.body)
        returns = self._returns or VOID
        if isinstance(returns, Constant):
            returns = literal(returns.value).kind
        local = [
            f"{INDENT}{declared(kind, name)};\n"
            for name, kind in self._variables.items()
            if name not in self.arguments
        ]
        void = [f"{INDENT}(void){name};\n" for name in self.arguments]
        lines = [f"{INDENT}{line}\n" for line in self._out]
        text = "".join([*local, *void, *lines])
        zero = "" if returns is VOID else f" {self._zero(returns)}"
        return returns, self._raises, text.replace("return FAILED;", f"return{zero};")

    def _zero(self, kind: Any) -> str:
        return f"({name_of(kind)}){{0}}" if kind is COMPLEX or isinstance(kind, Tuple) else "0"

    def _refuse(self, node: ast.AST, why: str) -> Untranslatable:
        line = self._first + getattr(node, "lineno", 1) - 1
        error = Untranslatable(f"{self._python.__module__}, line {line}: {why}")
        error.placed = True
        return error

    @staticmethod
    def _called(name: str) -> str:
        return f"{name}_" if name in RESERVED else name

    # -- statements ---------------------------------------------------------------------------

    def _say(self, line: str) -> None:
        self._out.append(line)

    def _block(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                continue  # a text
            method = self._STATEMENTS.get(type(statement))
            if method is None:
                raise self._refuse(statement, type(statement).__name__)
            try:
                method(self, statement)
            except Untranslatable as error:
                raise error if error.placed else self._refuse(statement, str(error)) from None
            if isinstance(statement, ast.If) and self._ends:
                break

    _ends = False  # whether the last `if` was decided here and ends the function

    def _inside(self, body: Sequence[ast.stmt]) -> None:
        """A block in braces."""
        outer, self._out = self._out, []
        self._block(body)
        self._ends = False
        outer.extend(INDENT + line for line in self._out)
        self._out = outer

    def _do_expr(self, node: ast.Expr) -> None:
        value = self._of(node.value)
        if value.text:
            self._say(f"(void){value.text};")

    def _do_pass(self, node: ast.Pass) -> None:
        pass

    def _do_return(self, node: ast.Return) -> None:
        if node.value is None:
            self._say("return;")
            return
        value = self._of(node.value)
        if isinstance(value.kind, Constant) and not self._out and node in self._tree.body:
            self.known = value
        value = self._plain(value)
        if self._returns is None:
            self._returns = value.kind
        elif isinstance(value.kind, Scalar) and value.kind != self._returns:
            raise self._refuse(node, f"a return of a {value.kind} after one of a {self._returns}")
        self._say(f"return {self._as(value, self._returns, node)};")

    def _do_raise(self, node: ast.Raise) -> None:
        assert isinstance(node.exc, ast.Call) and isinstance(node.exc.args[0], ast.Constant)
        text = str(node.exc.args[0].value)
        if text not in self._t.errors:
            self._t.errors.append(text)
        self._raises = True
        self._say(f"*failed = {self._t.errors.index(text) + 1};")
        self._say("return FAILED;")

    def _do_break(self, node: ast.Break) -> None:
        self._say("break;")

    def _do_continue(self, node: ast.Continue) -> None:
        self._say("continue;")

    def _do_if(self, node: ast.If) -> None:
        test = self._of(node.test)
        if isinstance(test.kind, Constant):
            chosen = node.body if test.kind.value else node.orelse
            self._block(chosen)
            self._ends = bool(chosen) and isinstance(chosen[-1], ast.Return | ast.Raise)
            return
        self._say(f"if ({self._truth(test).text}) {{")
        self._inside(node.body)
        if node.orelse:
            self._say("} else {")
            self._inside(node.orelse)
        self._say("}")

    def _do_while(self, node: ast.While) -> None:
        outer, self._out = self._out, []
        test = self._of(node.test)
        before, self._out = self._out, outer
        text = "true" if isinstance(test.kind, Constant) else self._truth(test).text
        if before:
            self._say("for (;;) {")
            self._out.extend(INDENT + line for line in before)
            self._say(f"{INDENT}if (!({text})) {{")
            self._say(f"{INDENT * 2}break;")
            self._say(f"{INDENT}}}")
        else:
            self._say(f"while ({text}) {{")
        self._inside(node.body)
        self._say("}")

    def _do_for(self, node: ast.For) -> None:
        assert isinstance(node.target, ast.Name)
        name = self._called(node.target.id)
        if name == "_":
            name = self._new_name()
        self._variable(name, INT, node)
        if isinstance(node.iter, ast.Call) and self._of(node.iter.func).kind == Constant(range):
            bounds = [self._of(one) for one in node.iter.args]
            ends: list[Any] = [b if isinstance(b.kind, Constant) else self._kept(b) for b in bounds]
            first, last, step = {
                1: lambda: (constant(0), ends[0], 1),
                2: lambda: (*ends, 1),
                3: lambda: (ends[0], ends[1], ends[2].kind.value),
            }[len(ends)]()
            relation, change = ("<", "++") if step == 1 else (">", "--")
            if step not in (1, -1):
                raise self._refuse(node, "a step of a range other than 1 and -1")
            begin, end = self._as(first, INT, node), self._as(last, INT, node)
            self._say(f"for ({name} = {begin}; {name} {relation} {end}; {name}{change}) {{")
            self._inside(node.body)
        else:
            values = self._of(node.iter)
            if not (isinstance(values.kind, Constant) and isinstance(values.kind.value, tuple)):
                raise self._refuse(node, "a loop over other than a range or known numbers")
            listed, at = self._new_name(), self._new_name()
            numbers = ", ".join(self._as(constant(v), INT, node) for v in values.kind.value)
            count = len(values.kind.value)
            self._variable(at, INT, node)
            self._say(f"static const int64_t {listed}[{count}] = {{{numbers}}};")
            self._say(f"for ({at} = 0; {at} < {count}; {at}++) {{")
            self._say(f"{INDENT}{name} = {listed}[{at}];")
            self._inside(node.body)
        self._say("}")

    def _do_assign(self, node: ast.Assign) -> None:
        value = self._of(node.value)
        if len(node.targets) > 1 and not isinstance(value.kind, Constant):
            value = self._kept(value)
        for target in node.targets:
            self._assign(target, value, node)

    def _assign(self, target: ast.expr, value: Value, node: ast.stmt) -> None:
        if isinstance(target, ast.Tuple):
            parts = self._apart(value, len(target.elts), node)
            if isinstance(value.kind, list):  # a later assignment could change a part
                known = (Constant, Record)
                parts = [v if isinstance(v.kind, known) else self._kept(v) for v in parts]
            for one, part in zip(target.elts, parts):
                self._assign(one, part, node)
        elif isinstance(target, ast.Name):
            name = self._called(target.id)
            if name == "_":
                return
            plain = self._plain(value)
            if isinstance(plain.kind, Entry):
                raise self._refuse(node, "such a value in a variable")
            self._variable(name, plain.kind, node)
            self._say(f"{name} = {self._as(plain, self._variables[name], node)};")
        else:
            place = self._of(target)
            if isinstance(place.kind, Array):
                self._fill(place, value, node)
            else:
                self._say(f"{place.text} = {self._as(value, place.kind, node)};")

    def _fill(self, place: Value, value: Value, node: ast.stmt) -> None:
        """One number into all places of a row."""
        index = self._new_name()
        self._variable(index, INT, node)
        count = math.prod(n or 0 for n in place.kind.shape)
        self._say(f"for ({index} = 0; {index} < {count}; {index}++) {{")
        self._say(f"{INDENT}({place.text})[{index}] = {self._as(value, place.kind.item, node)};")
        self._say("}")

    def _do_augassign(self, node: ast.AugAssign) -> None:
        both = ast.copy_location(ast.BinOp(node.target, node.op, node.value), node)
        self._assign(node.target, self._of(both), node)

    # -- variables ----------------------------------------------------------------------------

    def _variable(self, name: str, kind: Any, node: ast.AST) -> None:
        """A variable keeps its type."""
        old = self._variables.setdefault(name, kind)
        if isinstance(old, Array) and isinstance(kind, Array) and old.item == kind.item:
            return
        if old != kind and not (old is INT and kind in (WORD, FLAG)):
            raise self._refuse(node, f"{name} is a {old} and a {kind}")

    def _new_name(self) -> str:
        self._temporaries += 1
        return f"_{self._temporaries}".replace("_", "t_")

    def _kept(self, value: Value) -> Value:
        """The value in a variable of its own."""
        plain = self._plain(value)
        name = self._new_name()
        self._variables[name] = plain.kind
        self._say(f"{name} = {plain.text};")
        return Value(plain.kind, name)

    def _plain(self, value: Value) -> Value:
        """A known number as an expression; a tuple as a structure; the address of a record."""
        if isinstance(value.kind, list):
            return self._tuple(value.kind)
        if isinstance(value.kind, Constant):
            if isinstance(value.kind.value, tuple):
                return self._tuple([constant(v) for v in value.kind.value])
            return literal(value.kind.value)
        if not value.by_address:
            return Value(value.kind, f"&{value.text}")
        return value

    def _tuple(self, values: list[Value]) -> Value:
        plain = [self._plain(v) for v in values]
        kind = Tuple(tuple(v.kind for v in plain))
        self._t.tuple(kind)
        return Value(kind, f"({name_of(kind)}){{{', '.join(v.text for v in plain)}}}")

    def _apart(self, value: Value, count: int, node: ast.AST) -> list[Value]:
        """The parts of a tuple."""
        if isinstance(value.kind, list):
            return value.kind
        if isinstance(value.kind, Constant):
            return [constant(v) for v in value.kind.value]
        if isinstance(value.kind, Parts):
            return [Value(kind, f"{value.text}->{name}") for name, kind in value.kind.fields]
        if isinstance(value.kind, Tuple) and len(value.kind.items) == count:
            whole = self._kept(value)
            return [Value(kind, f"{whole.text}.t{n}") for n, kind in enumerate(value.kind.items)]
        raise self._refuse(node, f"{value.kind} is no tuple of {count}")

    def _as(self, value: Value, kind: Any, node: ast.AST) -> str:
        """The value converted to a type."""
        plain = self._plain(value)
        have, text = plain.kind, plain.text
        if have == kind or (isinstance(have, Array) and isinstance(kind, Array)):
            return text
        if kind is COMPLEX and have in (REAL, INT):
            return f"complex_of({text}, 0.0)"
        if isinstance(kind, Scalar) and isinstance(have, Scalar) and COMPLEX not in (kind, have):
            return f"({kind.name})({text})"
        raise self._refuse(node, f"a {have} where a {kind} is needed")

    def _truth(self, value: Value) -> Value:
        plain = self._plain(value)
        if plain.kind is FLAG:
            return plain
        return Value(FLAG, f"({plain.text} != 0)")

    # -- expressions --------------------------------------------------------------------------

    def _of(self, node: ast.expr) -> Value:
        method = self._EXPRESSIONS.get(type(node))
        if method is None:
            raise self._refuse(node, type(node).__name__)
        return method(self, node)

    def _of_constant(self, node: ast.Constant) -> Value:
        return constant(node.value)

    def _of_name(self, node: ast.Name) -> Value:
        name = self._called(node.id)
        if name in self._variables:
            return Value(self._variables[name], name)
        for room in (self._seen.nonlocals, self._seen.globals, self._seen.builtins):
            if node.id in room:
                return constant(room[node.id])
        raise self._refuse(node, f"{node.id} is not known")

    def _of_tuple(self, node: ast.Tuple) -> Value:
        values = [self._of(one) for one in node.elts]
        if all(isinstance(v.kind, Constant) for v in values):
            return constant(tuple(v.kind.value for v in values))
        return Value(values, "")

    def _of_attribute(self, node: ast.Attribute) -> Value:
        whole = self._of(node.value)
        kind, name = whole.kind, node.attr
        if isinstance(kind, Constant):
            return constant(getattr(kind.value, name))
        if isinstance(kind, Record):
            if name == "dtype":
                return constant(kind.dtype)
            inner = kind.dtype[name]
            base, shape = inner.subdtype or (inner, ())
            text = f"{whole.text}{'->' if whole.by_address else '.'}{name}"
            if base.names:
                return Value(self._t.record(base, f"{kind.name}_{name}"), text, False)
            item = OF_NUMPY[base]
            return Value(Array(item, shape), text) if shape else Value(item, text)
        if isinstance(kind, Parts):
            return Value(dict(kind.fields)[name], f"{whole.text}->{name}")
        if isinstance(kind, Table) and name == "shape":
            return Value(
                [Value(INT, f"{whole.text}.rows"), Value(INT, f"{whole.text}.columns")], ""
            )
        if kind is COMPLEX and name in ("real", "imag"):
            # Two functions of the plant ask for both parts of a product.
            inside = whole if whole.text.isidentifier() else self._kept(whole)
            return Value(REAL, f"{inside.text}.{'re' if name == 'real' else 'im'}")
        raise self._refuse(node, f"{kind} has no {name}")

    def _of_subscript(self, node: ast.Subscript) -> Value:
        whole = self._of(node.value)
        if isinstance(node.slice, ast.Slice):
            if node.slice.lower or node.slice.upper or not isinstance(whole.kind, Array):
                raise self._refuse(node, "a part of an array")
            return whole
        listed = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        index = [self._of(one) for one in listed]
        kind = whole.kind
        if isinstance(kind, list | Tuple):
            return self._apart(whole, len(kind if isinstance(kind, list) else kind.items), node)[
                index[0].kind.value
            ]
        if isinstance(kind, Table):
            row = f"{whole.text}.at + {self._as(index[0], INT, node)} * {whole.text}.columns"
            if len(index) == 1:
                return Value(Array(kind.item, (None,)), row)
            return Value(kind.item, f"({row})[{self._as(index[1], INT, node)}]")
        if not isinstance(kind, Array):
            raise self._refuse(node, f"an index of a {kind}")
        text = ""
        for n, one in enumerate(index):
            number = self._plain(one).text
            size = kind.shape[n]
            text = f"({text}) * {size} + {number}" if text else number
        rest = kind.shape[len(index) :]
        if not rest:
            return Value(kind.item, f"{whole.text}[{text}]")
        return Value(
            Array(kind.item, rest), f"({whole.text} + ({text}) * {math.prod(n or 0 for n in rest)})"
        )

    def _of_unaryop(self, node: ast.UnaryOp) -> Value:
        value = self._of(node.operand)
        if isinstance(node.op, ast.Not):
            if isinstance(value.kind, Constant):
                return constant(not value.kind.value)
            return Value(FLAG, f"!{self._truth(value).text}")
        if isinstance(value.kind, Constant):
            number = value.kind.value
            return constant(-number if isinstance(node.op, ast.USub) else ~number)
        if isinstance(node.op, ast.USub) and value.kind in (INT, REAL):
            return Value(value.kind, f"(-{value.text})")
        raise self._refuse(node, f"this sign before a {value.kind}")

    def _in_order(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Operands or arguments, the earlier ones taken first even if a later one calls a
        function."""
        values: list[Value] = []
        for node in nodes:
            at = len(self._out)
            value = self._of(node)
            if len(self._out) > at:
                after, self._out = self._out[at:], self._out[:at]
                fixed = (Constant, Record, Array, Parts, Entry, list)
                values = [v if isinstance(v.kind, fixed) else self._kept(v) for v in values]
                self._out += after
            values.append(value)
        return values

    def _of_binop(self, node: ast.BinOp) -> Value:
        a, b = self._in_order([node.left, node.right])
        op = type(node.op)
        if isinstance(a.kind, Constant) and isinstance(b.kind, Constant):
            return constant(FOLD[op](a.kind.value, b.kind.value))
        if op is ast.Pow:
            return self._power(a, b, node)
        if op in (ast.FloorDiv, ast.Mod):
            name = "floor_div" if op is ast.FloorDiv else "floor_mod"
            parts = (self._as(one, INT, node) for one in (a, b))
            return Value(INT, f"{name}({', '.join(parts)})")
        kind = self._common(a, b, node)
        if op is ast.Div:
            kind = REAL if kind is INT else kind
            if kind is not REAL:
                raise self._refuse(node, f"a division of {kind}")
            return Value(REAL, f"({self._as(a, REAL, node)} / {self._as(b, REAL, node)})")
        left, right = self._as(a, kind, node), self._as(b, kind, node)
        if kind is COMPLEX:
            name = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}[op]
            return Value(COMPLEX, f"complex_{name}({left}, {right})")
        return Value(kind, f"({left} {OPERATORS[op]} {right})")

    def _power(self, a: Value, b: Value, node: ast.AST) -> Value:
        base = self._as(a, REAL, node)
        if b.kind == Constant(2):
            once = self._kept(Value(REAL, base)).text
            return Value(REAL, f"({once} * {once})")
        return Value(REAL, f"pow({base}, {self._as(b, REAL, node)})")

    def _common(self, a: Value, b: Value, node: ast.AST) -> Any:
        """The type of both, as numba chooses it."""
        kinds = {self._plain(v).kind for v in (a, b)}
        if kinds == {UINT}:
            return UINT
        kinds = {INT if kind in (WORD, FLAG) else kind for kind in kinds}
        for kind in (COMPLEX, REAL, INT):
            if kind in kinds and kinds <= {COMPLEX, REAL, INT}:
                return kind
        raise self._refuse(node, f"an operation on {kinds}")

    def _of_compare(self, node: ast.Compare) -> Value:
        if len(node.ops) != 1:
            raise self._refuse(node, "a chain of comparisons")
        a, b = self._in_order([node.left, node.comparators[0]])
        op = type(node.ops[0])
        if isinstance(a.kind, Constant) and isinstance(b.kind, Constant):
            return constant(FOLD[op](a.kind.value, b.kind.value))
        if op is ast.In:
            among = [constant(v) for v in b.kind.value]
            a = self._kept(a)
            tests = [f"{a.text} == {self._as(one, a.kind, node)}" for one in among]
            return Value(FLAG, f"({' || '.join(tests)})")
        kinds = {self._plain(v).kind for v in (a, b)}
        kind = FLAG if kinds == {FLAG} else self._common(a, b, node)
        return Value(FLAG, f"({self._as(a, kind, node)} {OPERATORS[op]} {self._as(b, kind, node)})")

    def _of_boolop(self, node: ast.BoolOp) -> Value:
        """The later parts are computed only if the earlier ones do not decide."""
        both = isinstance(node.op, ast.And)
        whole: Value | None = None
        for one in node.values:
            outer, self._out = self._out, []
            value = self._of(one)
            before, self._out = self._out, outer
            if isinstance(value.kind, Constant):
                if bool(value.kind.value) != both:
                    return value if whole is None else constant(not both)
                continue
            text = self._truth(value).text
            if whole is None:
                self._out += before
                whole = Value(FLAG, text)
            elif before:
                whole = self._kept(whole)
                self._say(f"if ({'' if both else '!'}{whole.text}) {{")
                self._out.extend(INDENT + line for line in before)
                self._say(f"{INDENT}{whole.text} = {text};")
                self._say("}")
            else:
                whole = Value(FLAG, f"({whole.text} {'&&' if both else '||'} {text})")
        return whole or constant(both)

    def _of_ifexp(self, node: ast.IfExp) -> Value:
        test = self._of(node.test)
        if isinstance(test.kind, Constant):
            return self._of(node.body if test.kind.value else node.orelse)
        sides = []
        for one in (node.body, node.orelse):
            outer, self._out = self._out, []
            value = self._of(one)
            sides.append((self._plain(value), self._out))
            self._out = outer
        (a, before_a), (b, before_b) = sides
        kind = a.kind if isinstance(a.kind, Array | Tuple) else self._common_of(a, b, node)
        text_a, text_b = self._as(a, kind, node), self._as(b, kind, node)
        if not before_a and not before_b:
            return Value(kind, f"({self._truth(test).text} ? {text_a} : {text_b})")
        name = self._new_name()
        self._variables[name] = kind
        self._say(f"if ({self._truth(test).text}) {{")
        self._out.extend(INDENT + line for line in [*before_a, f"{name} = {text_a};"])
        self._say("} else {")
        self._out.extend(INDENT + line for line in [*before_b, f"{name} = {text_b};"])
        self._say("}")
        return Value(kind, name)

    def _common_of(self, a: Value, b: Value, node: ast.AST) -> Any:
        return a.kind if a.kind == b.kind else self._common(a, b, node)

    # -- calls --------------------------------------------------------------------------------

    def _of_call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "conjugate":
            value = self._kept(self._of(node.func.value))
            return Value(COMPLEX, f"complex_of({value.text}.re, -{value.text}.im)")
        called = self._of(node.func)
        values = self._in_order(node.args)
        if isinstance(called.kind, Entry):
            texts = [self._as(v, UINT, node) for v in values]
            self._say(f"{called.text}({', '.join(texts)});")
            return Value(VOID, "")
        function = called.kind.value
        if function in CASTS:
            return self._cast(values[0], CASTS[function], node)
        if function in OF_LIBM:
            texts = [self._as(v, REAL, node) for v in values]
            return Value(REAL, f"{OF_LIBM[function]}({', '.join(texts)})")
        if function in (min, max, abs, complex):
            return self._builtin(function, values, node)
        if not inspect.isfunction(source_of(function)):
            raise self._refuse(node, f"a call of {getattr(function, '__name__', function)}")
        return self._user(function, values, node)

    def _cast(self, value: Value, kind: Scalar, node: ast.AST) -> Value:
        if isinstance(value.kind, Constant) and kind is not WORD:
            number = {INT: int, REAL: float, UINT: np.uint64, FLAG: bool}[kind](value.kind.value)
            return constant(number)
        if kind is FLAG:
            return self._truth(value)
        return Value(kind, f"({kind.name})({self._plain(value).text})")

    def _builtin(self, function: Any, values: list[Value], node: ast.AST) -> Value:
        if function is complex:
            texts = [self._as(v, REAL, node) for v in values]
            return Value(COMPLEX, f"complex_of({', '.join(texts)})")
        if function is abs:
            kind = values[0].kind
            name = {REAL: "fabs", INT: "size_i"}[kind]
            return Value(kind, f"{name}({values[0].text})")
        best = values[0]
        for value in values[1:]:
            kind = self._common(best, value, node)
            texts = [self._as(best, kind, node), self._as(value, kind, node)]
            name = f"{'least' if function is min else 'most'}_{kind.letter}"
            best = Value(kind, f"{name}({', '.join(texts)})")
        return best

    def _user(self, function: Any, values: list[Value], node: ast.AST) -> Value:
        plain = [self._plain(value) for value in values]
        made = self._t.function(function, [v.kind for v in plain])
        if made.known:
            return made.known
        texts = [v.text for v in plain]
        if made.raises:
            self._raises = True
            texts.append("failed")
        call = f"{made.name}({', '.join(texts)})"
        result = Value(VOID, "")
        if made.returns is VOID:
            self._say(f"{call};")
        else:
            result = self._kept(Value(made.returns, call))
        if made.raises:
            self._say("if (*failed != 0) {")
            self._say(f"{INDENT}return FAILED;")
            self._say("}")
        return result

    #: What translates a statement, and what an expression.
    _STATEMENTS: ClassVar[dict[type, Callable]] = {
        ast.Expr: _do_expr,
        ast.Pass: _do_pass,
        ast.Return: _do_return,
        ast.Raise: _do_raise,
        ast.Break: _do_break,
        ast.Continue: _do_continue,
        ast.If: _do_if,
        ast.While: _do_while,
        ast.For: _do_for,
        ast.Assign: _do_assign,
        ast.AugAssign: _do_augassign,
    }
    _EXPRESSIONS: ClassVar[dict[type, Callable]] = {
        ast.Constant: _of_constant,
        ast.Name: _of_name,
        ast.Tuple: _of_tuple,
        ast.Attribute: _of_attribute,
        ast.Subscript: _of_subscript,
        ast.UnaryOp: _of_unaryop,
        ast.BinOp: _of_binop,
        ast.Compare: _of_compare,
        ast.BoolOp: _of_boolop,
        ast.IfExp: _of_ifexp,
        ast.Call: _of_call,
    }
