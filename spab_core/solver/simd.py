"""Eight doubles in one register: a numba scalar type for explicit SIMD.

LLVM's loop vectoriser gives up on the short, possibly aliasing loops of the film kernels (4
latitudes of two columns in a register), so they name their vectors. Values of type ``f64x8``
support ``+ - * /`` among themselves and with floats; memory is reached with :func:`vload` and
:func:`vstore`. LLVM maps them to one AVX-512, two AVX2 or four SSE/NEON registers."""

import functools
import operator

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

WIDTH, HALF = 8, 4

# Kernels pass tuples of some fifty arrays to each other: counting references of each, atomically,
# would cost as much as the arithmetic. They allocate nothing, so numba's runtime stays out; numpy's
# rules for division keep tests out of the loops.
kernel = functools.partial(njit, cache=True, nogil=True, error_model="numpy", _nrt=False)
inlined = functools.partial(kernel, forceinline=True)
# unpacking those tuples for a call from Python takes the compiler longer than the kernel: for what
# only kernels call, left out
inner = functools.partial(inlined, no_cpython_wrapper=True, no_cfunc_wrapper=True)
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
    return (
        isinstance(array, types.Array)
        and array.ndim == 1
        and array.layout == "C"
        and array.dtype == types.float64
    )


@intrinsic
def vload(typingctx, array, index):
    """Eight consecutive elements of a flat float64 array, from ``index`` on (unaligned, unchecked)."""
    if not _is_flat(array) or not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        return builder.load(
            _pointer(context, builder, signature.args[0], args[0], position), align=8
        )

    return f64x8(array, index), codegen


def _broadcast(builder, one):
    vector = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), one, cgutils.int32_t(0))
    return _lane(builder, vector, 0)


def _shuffle(builder, a, b, lanes):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), lanes))


def _lane(builder, vector, k, span=WIDTH):
    """Element k of each ``span`` places in all of them."""
    lanes = [first + k for first in range(0, WIDTH, span) for _ in range(span)]
    return _shuffle(builder, vector, ir.Constant(_VECTOR, ir.Undefined), lanes)


@intrinsic
def spread(typingctx, array, index):
    """One element of a flat float64 array in all eight places (unchecked: numba's own indexing
    tests for negatives).
    """
    if not _is_flat(array) or not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        return _broadcast(builder, builder.load(builder.gep(data, [position])))

    return f64x8(array, index), codegen


@intrinsic
def vstore(typingctx, array, index, value):
    """Write eight consecutive elements of a flat float64 array, from ``index`` on (unaligned,
    unchecked).
    """
    if not _is_flat(array) or not isinstance(index, types.Integer) or value != f64x8:
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        builder.store(
            args[2], _pointer(context, builder, signature.args[0], args[0], position), align=8
        )
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


for _op, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _register(_op, _name)


@overload(operator.neg)
def _negate(a):
    if a == f64x8:
        return lambda a: splat(-1.0) * a
    return None


def _shuffled(lanes):
    @intrinsic
    def shuffled(typingctx, a, b):
        if a != f64x8 or b != f64x8:
            return None

        def codegen(context, builder, signature, args):
            return _shuffle(builder, args[0], args[1], lanes)

        return f64x8(a, b), codegen

    return shuffled


both_halves = _shuffled(
    [0, 1, 2, 3, 12, 13, 14, 15]
)  # (a, b): the first half of a and the second of b
swapped_halves = _shuffled([4, 5, 6, 7, 0, 1, 2, 3])  # (a, a): the halves of a exchanged


@intrinsic
def vmin(typingctx, a, b):
    """The smaller of each pair of elements."""
    if a != f64x8 or b != f64x8:
        return None

    def codegen(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered("<", args[0], args[1]), args[0], args[1])

    return f64x8(a, b), codegen


def _inversion(span):
    @intrinsic
    def invert_two(typingctx, array, first, second):
        if (
            not _is_flat(array)
            or not isinstance(first, types.Integer)
            or not isinstance(second, types.Integer)
        ):
            return None

        def codegen(context, builder, signature, args):
            contract = ("contract",)
            pointers, blocks = [], []
            for position, kind in zip(args[1:], signature.args[1:], strict=True):
                start = context.cast(builder, position, kind, types.intp)
                pointers.append(
                    [
                        _pointer(
                            context,
                            builder,
                            signature.args[0],
                            args[0],
                            builder.add(start, ir.Constant(start.type, WIDTH * i)),
                        )
                        for i in range(span)
                    ]
                )
                blocks.append([builder.load(pointer, align=8) for pointer in pointers[-1]])
            ones = ir.Constant(_VECTOR, [1.0] * WIDTH)
            for k in range(span):
                own = [i % span == k for i in range(WIDTH)]
                unit = ir.Constant(_VECTOR, [float(here) for here in own])
                for rows in blocks:
                    pivot = _lane(builder, builder.fdiv(ones, rows[k]), k, span)
                    at_pivot = _shuffle(
                        builder, rows[k], ones, [i + WIDTH * here for i, here in enumerate(own)]
                    )
                    rows[k] = builder.fmul(at_pivot, pivot)
                    # place k of the other rows must become - factor / pivot: one more in place k
                    # takes the factor itself away
                    used = builder.fadd(rows[k], unit)
                    for i in [*range(k + 1, span), *range(k)]:  # the next pivot's row first
                        scaled = builder.fmul(
                            _lane(builder, rows[i], k, span), used, flags=contract
                        )
                        rows[i] = builder.fsub(rows[i], scaled, flags=contract)
            for rows, places in zip(blocks, pointers, strict=True):
                for row, place in zip(rows, places, strict=True):
                    builder.store(row, place, align=8)
            return context.get_dummy_value()

        return types.void(array, first, second), codegen

    return invert_two


def _product(span):
    @intrinsic
    def times(typingctx, array, index, vector):
        if not _is_flat(array) or not isinstance(index, types.Integer) or vector != f64x8:
            return None

        def codegen(context, builder, signature, args):
            contract = ("contract",)
            start = context.cast(builder, args[1], signature.args[1], types.intp)
            totals = [None, None]  # two sums for latency
            for k in range(span):
                place = builder.add(start, ir.Constant(start.type, WIDTH * k))
                column = builder.load(
                    _pointer(context, builder, signature.args[0], args[0], place), align=8
                )
                product = builder.fmul(column, _lane(builder, args[2], k, span), flags=contract)
                total = totals[k % 2]
                totals[k % 2] = (
                    product if total is None else builder.fadd(total, product, flags=contract)
                )
            return builder.fadd(*totals, flags=contract)

        return f64x8(array, index, vector), codegen

    return times


# Blocks lie in a flat array by columns of eight. A block of "halves" is two 4 x 4 blocks side by
# side: its column k holds column k of one in its first four places and of the other in its last.
# invert(array, first, second): two of them in place, by Gauss-Jordan without pivoting, all in
# registers; the arithmetic of one hides the latency of the other. ``first`` may equal ``second``.
invert_blocks, invert_halves = _inversion(WIDTH), _inversion(HALF)
# times(array, index, vector): the product with a vector, which stays in its register
block_times, halves_times = _product(WIDTH), _product(HALF)


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


def aligned_zeros(n: int) -> np.ndarray:
    """A float64 array of ``n`` zeros that starts on a cache line (64 bytes), so that vectors do not
    straddle two.
    """
    raw = np.zeros(n + WIDTH)
    start = (-raw.ctypes.data % 64) // 8
    return raw[start : start + n]


__all__ = [
    "HALF",
    "WIDTH",
    "aligned_zeros",
    "block_times",
    "both_halves",
    "f64x8",
    "halves_times",
    "inlined",
    "inner",
    "invert_blocks",
    "invert_halves",
    "kernel",
    "splat",
    "spread",
    "swapped_halves",
    "vload",
    "vmin",
    "vstore",
    "vsum",
]
