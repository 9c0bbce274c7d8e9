"""Eight doubles in one register: a numba scalar type for explicit SIMD.

LLVM's loop vectoriser gives up on the short, possibly aliasing loops of the film kernels (8 latitudes a column), so
they name their vectors. Values of type ``f64x8`` support ``+ - * /`` among themselves and with floats; memory is
reached with :func:`vload` and :func:`vstore`. LLVM maps them to one AVX-512, two AVX2 or four SSE/NEON registers.
"""

import functools
import operator

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

WIDTH = 8

# Kernels pass tuples of some fifty arrays to each other: counting references of each, atomically, would cost as much as the
# arithmetic. They allocate nothing, so numba's runtime stays out; numpy's rules for division keep tests out of the loops.
kernel = functools.partial(njit, cache=True, nogil=True, error_model="numpy", _nrt=False)
inner = functools.partial(kernel, forceinline=True)
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)


class _Vector8(types.Type):
    def __init__(self):
        super().__init__(name="f64x8")


f64x8 = _Vector8()


@register_model(_Vector8)
class _Vector8Model(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


def _pointer(context, builder, array_type, array, index):
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _is_flat(array):
    return (isinstance(array, types.Array) and array.ndim == 1 and array.layout == "C"
            and array.dtype == types.float64)


@intrinsic
def vload(typingctx, array, index):
    """Eight consecutive elements of a flat float64 array, from ``index`` on (unaligned, unchecked)."""
    if not _is_flat(array) or not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        return builder.load(_pointer(context, builder, signature.args[0], args[0], position), align=8)

    return f64x8(array, index), codegen


def _broadcast(builder, one):
    vector = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), one, cgutils.int32_t(0))
    return _lane(builder, vector, 0)


def _lane(builder, vector, k):
    """Element k in all places."""
    return builder.shuffle_vector(vector, ir.Constant(_VECTOR, ir.Undefined),
                                  ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [k] * WIDTH))


@intrinsic
def spread(typingctx, array, index):
    """One element of a flat float64 array in all eight places (unchecked: numba's own indexing tests for negatives)."""
    if not _is_flat(array) or not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        return _broadcast(builder, builder.load(builder.gep(data, [position])))

    return f64x8(array, index), codegen


@intrinsic
def vstore(typingctx, array, index, value):
    """Write eight consecutive elements of a flat float64 array, from ``index`` on (unaligned, unchecked)."""
    if not _is_flat(array) or not isinstance(index, types.Integer) or value != f64x8:
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        builder.store(args[2], _pointer(context, builder, signature.args[0], args[0], position), align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), codegen


@intrinsic
def splat(typingctx, value):
    """The same float in all eight places."""
    if value != types.float64:
        return None

    def codegen(context, builder, signature, args):
        return _broadcast(builder, args[0])

    return f64x8(value), codegen


def _binary(name):
    @intrinsic
    def vector_op(typingctx, a, b):
        if a != f64x8 or b != f64x8:
            return None

        def codegen(context, builder, signature, args):
            # 'contract' allows fused multiply-add; nothing that changes results between runs
            return getattr(builder, name)(args[0], args[1], flags=("contract",))

        return f64x8(a, b), codegen

    return vector_op


def _register(op, name):
    vector_op = _binary(name)

    @overload(op)
    def vector_overload(a, b):
        if a == f64x8 and b == f64x8:
            return lambda a, b: vector_op(a, b)
        if a == f64x8 and b == types.float64:
            return lambda a, b: vector_op(a, splat(b))
        if a == types.float64 and b == f64x8:
            return lambda a, b: vector_op(splat(a), b)
        return None


for _op, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv")):
    _register(_op, _name)


@overload(operator.neg)
def _negate(a):
    if a == f64x8:
        return lambda a: splat(-1.0) * a
    return None


def _neighbour(first):
    @intrinsic
    def shifted(typingctx, a, b):
        if a != f64x8 or b != f64x8:
            return None

        def codegen(context, builder, signature, args):
            lanes = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), list(range(first, first + WIDTH)))
            return builder.shuffle_vector(args[0], args[1], lanes)

        return f64x8(a, b), codegen

    return shifted


next_rows = _neighbour(1)  # (a, b): elements 1 to 7 of a and 0 of b
previous_rows = _neighbour(WIDTH - 1)  # (a, b): element 7 of a and 0 to 6 of b


@intrinsic
def vmin(typingctx, a, b):
    """The smaller of each pair of elements."""
    if a != f64x8 or b != f64x8:
        return None

    def codegen(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered("<", args[0], args[1]), args[0], args[1])

    return f64x8(a, b), codegen


@intrinsic
def invert_two(typingctx, array, first, second):
    """Invert two 8 x 8 blocks of a flat array in place, by Gauss-Jordan without pivoting, all sixteen rows in registers.

    The two are independent: the arithmetic of one hides the latency of the other. ``first`` may equal ``second``.
    """
    if not _is_flat(array) or not isinstance(first, types.Integer) or not isinstance(second, types.Integer):
        return None

    def codegen(context, builder, signature, args):
        contract = ("contract",)
        pointers, blocks = [], []
        for position, kind in zip(args[1:], signature.args[1:], strict=True):
            start = context.cast(builder, position, kind, types.intp)
            pointers.append([_pointer(context, builder, signature.args[0], args[0],
                                      builder.add(start, ir.Constant(start.type, WIDTH * i))) for i in range(WIDTH)])
            blocks.append([builder.load(pointer, align=8) for pointer in pointers[-1]])
        one = ir.Constant(ir.DoubleType(), 1.0)
        for k in range(WIDTH):
            here = cgutils.int32_t(k)
            for rows in blocks:
                pivot = _broadcast(builder, builder.fdiv(one, builder.extract_element(rows[k], here)))
                rows[k] = builder.fmul(builder.insert_element(rows[k], one, here), pivot)
                # place k of the other rows must become - factor / pivot: one more in place k takes the factor itself away
                unit = ir.Constant(_VECTOR, [1.0 if i == k else 0.0 for i in range(WIDTH)])
                used = builder.fadd(rows[k], unit)
                for i in [*range(k + 1, WIDTH), *range(k)]:  # the next pivot's row first
                    scaled = builder.fmul(_lane(builder, rows[i], k), used, flags=contract)
                    rows[i] = builder.fsub(rows[i], scaled, flags=contract)
        for rows, places in zip(blocks, pointers, strict=True):
            for row, place in zip(rows, places, strict=True):
                builder.store(row, place, align=8)
        return context.get_dummy_value()

    return types.void(array, first, second), codegen


@intrinsic
def vsum(typingctx, value):
    """Sum of the eight elements, in a fixed order."""
    if value != f64x8:
        return None

    def codegen(context, builder, signature, args):
        total = builder.extract_element(args[0], cgutils.int32_t(0))
        for k in range(1, WIDTH):
            total = builder.fadd(total, builder.extract_element(args[0], cgutils.int32_t(k)))
        return total

    return types.float64(value), codegen


@intrinsic
def block_times(typingctx, array, index, vector):
    """The 8 x 8 block stored by columns at ``array[index:]`` times a vector, which stays in its register."""
    if not _is_flat(array) or not isinstance(index, types.Integer) or vector != f64x8:
        return None

    def codegen(context, builder, signature, args):
        contract = ("contract",)
        start = context.cast(builder, args[1], signature.args[1], types.intp)
        totals = [None, None]  # two sums for latency
        for k in range(WIDTH):
            place = builder.add(start, ir.Constant(start.type, WIDTH * k))
            column = builder.load(_pointer(context, builder, signature.args[0], args[0], place), align=8)
            product = builder.fmul(column, _lane(builder, args[2], k), flags=contract)
            total = totals[k % 2]
            totals[k % 2] = product if total is None else builder.fadd(total, product, flags=contract)
        return builder.fadd(*totals, flags=contract)

    return f64x8(array, index, vector), codegen


def aligned_zeros(n):
    """A float64 array of ``n`` zeros that starts on a cache line (64 bytes), so that vectors do not straddle two."""
    raw = np.zeros(n + WIDTH)
    start = (-raw.ctypes.data % 64) // 8
    return raw[start:start + n]


__all__ = ["WIDTH", "aligned_zeros", "block_times", "f64x8", "inner", "invert_two", "kernel", "next_rows", "previous_rows",
           "splat", "spread", "vload", "vmin", "vstore", "vsum"]
