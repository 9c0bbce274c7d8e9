"""Eight doubles in one register: a numba scalar type for explicit SIMD.

LLVM's loop vectoriser gives up on the short, possibly aliasing loops of the film kernels (8 latitudes a column), so
they name their vectors. Values of type ``f64x8`` support ``+ - * /`` among themselves and with floats; memory is
reached with :func:`vload` and :func:`vstore`. LLVM maps them to one AVX-512, two AVX2 or four SSE/NEON registers.
"""

import operator

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

WIDTH = 8
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


@intrinsic
def spread(typingctx, array, index):
    """One element of a flat float64 array in all eight places (unchecked: numba's own indexing tests for negatives)."""
    if not _is_flat(array) or not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, signature, args):
        position = context.cast(builder, args[1], signature.args[1], types.intp)
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), builder.load(builder.gep(data, [position])),
                                     cgutils.int32_t(0))
        return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined),
                                      ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))

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
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), args[0], cgutils.int32_t(0))
        return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined),
                                      ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))

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


@intrinsic
def vmin(typingctx, a, b):
    """The smaller of each pair of elements."""
    if a != f64x8 or b != f64x8:
        return None

    def codegen(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered("<", args[0], args[1]), args[0], args[1])

    return f64x8(a, b), codegen


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


def aligned_zeros(n):
    """A float64 array of ``n`` zeros that starts on a cache line (64 bytes), so that vectors do not straddle two."""
    raw = np.zeros(n + WIDTH)
    start = (-raw.ctypes.data % 64) // 8
    return raw[start:start + n]


__all__ = ["WIDTH", "aligned_zeros", "f64x8", "njit", "splat", "spread", "vload", "vmin", "vstore", "vsum"]
