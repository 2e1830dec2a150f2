"""A 6 x 8 matrix times six numbers, with vector instructions.

Numba cannot know that the result and the matrix are different memory, so it computes row after row
with scalar instructions. As vectors these sums take so few instructions that the processor can
compute two integration steps side by side (`machine.rk4_two_steps`). Each sum adds the same
products in the same order, so the bits are those of the scalar code.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from .compiled import INLINE

_ROWS = 8
_EIGHT = ir.VectorType(ir.DoubleType(), _ROWS)
_INDEX = ir.IntType(32)


def add_columns(columns, a, b, c, d, e, f, out):
    """Write a*columns[0] + ... + f*columns[5] into out[0:8]. `columns` is (6, 8), both arrays are
    contiguous."""
    for r in range(_ROWS):
        out[r] = (
            (columns[0, r] * a + columns[1, r] * b)
            + (columns[2, r] * c + columns[3, r] * d)
            + (columns[4, r] * e + columns[5, r] * f)
        )


def _vectors(context, builder, kind, value):
    """The array's memory as vectors of eight numbers."""
    data = context.make_array(kind)(context, builder, value).data
    return builder.bitcast(data, _EIGHT.as_pointer())


def _eight_times(builder, number):
    """A vector of eight equal numbers."""
    anything = ir.Constant(_EIGHT, ir.Undefined)
    first = builder.insert_element(anything, number, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(first, anything, ir.Constant(ir.VectorType(_INDEX, _ROWS), None))


@intrinsic
def _add_columns(_typing, columns, a, b, c, d, e, f, out):
    def generate(context, builder, signature, arguments):
        kinds = signature.args
        at = _vectors(context, builder, kinds[0], arguments[0])
        parts = []
        for column, number in enumerate(arguments[1:7]):
            place = builder.gep(at, [ir.Constant(_INDEX, column)])
            # An array of doubles need not lie at a multiple of a vector's size.
            vector = builder.load(place, align=8)
            parts.append(builder.fmul(vector, _eight_times(builder, number)))
        pairs = [builder.fadd(parts[n], parts[n + 1]) for n in (0, 2, 4)]
        total = builder.fadd(builder.fadd(pairs[0], pairs[1]), pairs[2])
        builder.store(total, _vectors(context, builder, kinds[7], arguments[7]), align=8)
        return context.get_dummy_value()

    return types.void(columns, *[types.float64] * 6, out), generate


@overload(add_columns, strict=False, jit_options=INLINE)  # type: ignore[arg-type] # private
def _(columns, a, b, c, d, e, f, out):
    def compiled_sum(columns, a, b, c, d, e, f, out):
        _add_columns(columns, a, b, c, d, e, f, out)  # type: ignore[call-arg] # without the context

    return compiled_sum
