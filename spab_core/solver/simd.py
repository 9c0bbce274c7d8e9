"""Numbers in groups of eight, a register each: numba types for explicit SIMD.

LLVM's loop vectoriser gives up on the short, possibly aliasing loops of the film kernels, so they
name their vectors: a value of type ``Ring(R)`` is 8 R numbers, the azimuths of one latitude; one of
``Ring(1)`` is any eight. Values support ``+ - * /`` among themselves and with floats. Which R is
told by a tuple of R integers (:class:`spab_core.solver.film.Film`, ``ring``), so that it is a
constant of the compiler's. LLVM maps eight doubles to one AVX-512, two AVX2 or four SSE/NEON
registers."""

import functools
import operator

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

WIDTH = 8
EIGHT = (0,)  # the ring of any eight numbers

# Kernels pass tuples of some fifty arrays to each other: counting references of each, atomically,
# would cost as much as the arithmetic. They allocate nothing, so numba's runtime stays out; numpy's
# rules for division keep tests out of the loops.
kernel = functools.partial(njit, cache=True, nogil=True, error_model="numpy", _nrt=False)
inlined = functools.partial(kernel, forceinline=True)
# unpacking those tuples for a call from Python takes the compiler longer than the kernel: for what
# only kernels call, left out
inner = functools.partial(inlined, no_cpython_wrapper=True, no_cfunc_wrapper=True)
# of a function whose body depends on types
chosen = functools.partial(
    overload,
    jit_options={
        "error_model": "numpy",
        "nogil": True,
        "forceinline": True,
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
    },
)
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
# allows fused multiply-add; nothing that changes results between runs
_CONTRACT = ("contract",)


class Ring(types.Type):
    """R times eight doubles."""

    def __init__(self, registers):
        self.registers = registers
        super().__init__(name=f"Ring({registers})")


@register_model(Ring)
class _RingModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.ArrayType(_VECTOR, kind.registers))


def _parts(builder, value):
    """The registers of a value."""
    return [builder.extract_value(value, k) for k in range(value.type.count)]


def _whole(builder, parts):
    """The value of these registers."""
    value = ir.Constant(ir.ArrayType(_VECTOR, len(parts)), ir.Undefined)
    for k, part in enumerate(parts):
        value = builder.insert_value(value, part, k)
    return value


def _is_flat(array):
    return (
        isinstance(array, types.Array)
        and array.ndim == 1
        and array.layout == "C"
        and array.dtype == types.float64
    )


def _address(context, builder, signature, args, k):
    """Where args[k + 1] points to in the array args[k]."""
    data = context.make_array(signature.args[k])(context, builder, args[k]).data
    index = context.cast(builder, args[k + 1], signature.args[k + 1], types.intp)
    return builder.gep(data, [index])


def _further(builder, address, count):
    """The eight numbers that lie ``count`` numbers further, as a register's place."""
    if isinstance(count, int):
        count = ir.Constant(ir.IntType(64), count)
    return builder.bitcast(builder.gep(address, [count]), _VECTOR.as_pointer())


def _load(builder, address, count):
    """Load so many registers from consecutive places."""
    return [builder.load(_further(builder, address, WIDTH * k), align=8) for k in range(count)]


def _broadcast(builder, one):
    vector = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), one, cgutils.int32_t(0))
    return _lane(builder, vector, 0)


def _shuffle(builder, a, b, lanes):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), lanes))


def _lane(builder, vector, k):
    """Element k in all places."""
    return _shuffle(builder, vector, ir.Constant(_VECTOR, ir.Undefined), [k] * WIDTH)


def _fused(builder, total, a, b):
    """total + a b."""
    return builder.fadd(total, builder.fmul(a, b, flags=_CONTRACT), flags=_CONTRACT)


@intrinsic
def load(typingctx, array, index, ring):
    """Consecutive elements of a flat float64 array, from ``index`` on, as many as ``ring`` tells
    (unaligned, unchecked).
    """
    if not _is_flat(array) or not isinstance(ring, types.BaseTuple):
        return None

    def codegen(context, builder, signature, args):
        address = _address(context, builder, signature, args, 0)
        return _whole(builder, _load(builder, address, len(ring)))

    return Ring(len(ring))(array, index, ring), codegen


@intrinsic
def store(typingctx, array, index, value):
    """Write a value to a flat float64 array, from ``index`` on (unaligned, unchecked)."""
    if not _is_flat(array) or not isinstance(value, Ring):
        return None

    def codegen(context, builder, signature, args):
        address = _address(context, builder, signature, args, 0)
        for k, part in enumerate(_parts(builder, args[2])):
            builder.store(part, _further(builder, address, WIDTH * k), align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), codegen


@intrinsic
def at(typingctx, array, index):
    """One element of a flat float64 array (unchecked: numba's own indexing tests for negatives)."""
    if not _is_flat(array):
        return None

    def codegen(context, builder, signature, args):
        return builder.load(_address(context, builder, signature, args, 0))

    return types.float64(array, index), codegen


@intrinsic
def splat(typingctx, value, ring):
    """The same float in all places."""
    if value != types.float64 or not isinstance(ring, types.BaseTuple):
        return None

    def codegen(context, builder, signature, args):
        return _whole(builder, [_broadcast(builder, args[0])] * len(ring))

    return Ring(len(ring))(value, ring), codegen


def _binary(name):
    @intrinsic
    def vector_op(typingctx, a, b):
        kinds = [kind for kind in (a, b) if isinstance(kind, Ring)]

        def codegen(context, builder, signature, args):
            sides = [
                _parts(builder, arg)
                if isinstance(kind, Ring)
                else [_broadcast(builder, arg)] * kinds[0].registers
                for arg, kind in zip(args, signature.args, strict=True)
            ]
            return _whole(
                builder,
                [
                    getattr(builder, name)(one, other, flags=_CONTRACT)
                    for one, other in zip(*sides, strict=True)
                ],
            )

        return kinds[0](a, b), codegen

    return vector_op


def _register(op, name):
    vector_op = _binary(name)

    @overload(op)
    def vector_overload(a, b):
        if isinstance(a, Ring) and (a == b or b == types.float64):
            return lambda a, b: vector_op(a, b)
        if a == types.float64 and isinstance(b, Ring):
            return lambda a, b: vector_op(a, b)
        return None


for _op, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _register(_op, _name)


@intrinsic
def smaller(typingctx, a, b):
    """The smaller of each pair of elements."""
    if not isinstance(a, Ring) or a != b:
        return None

    def codegen(context, builder, signature, args):
        pairs = zip(*(_parts(builder, arg) for arg in args), strict=True)
        return _whole(
            builder,
            [builder.select(builder.fcmp_ordered("<", one, two), one, two) for one, two in pairs],
        )

    return a(a, b), codegen


@intrinsic
def total(typingctx, value):
    """Sum of the elements, in a fixed order."""
    if not isinstance(value, Ring):
        return None

    def codegen(context, builder, signature, args):
        vector, *others = _parts(builder, args[0])
        for other in others:
            vector = builder.fadd(vector, other)
        for half in (4, 2, 1):  # fold
            lanes = [(k + half) % WIDTH for k in range(WIDTH)]
            vector = builder.fadd(vector, _shuffle(builder, vector, vector, lanes))
        return builder.extract_element(vector, cgutils.int32_t(0))

    return types.float64(value), codegen


def _times(builder, address, parts):
    """Registers of the matrix at an address, by columns, times the numbers in these."""
    count = len(parts)
    sums = [[None] * 2 for _ in parts]  # two each, for latency
    for k in range(WIDTH * count):
        factor = _lane(builder, parts[k // WIDTH], k % WIDTH)
        for i in range(count):
            place = _further(builder, address, WIDTH * (k * count + i))
            column, before = builder.load(place, align=8), sums[i][k % 2]
            sums[i][k % 2] = (
                builder.fmul(column, factor, flags=_CONTRACT)
                if before is None
                else _fused(builder, before, column, factor)
            )
    return [builder.fadd(*both, flags=_CONTRACT) for both in sums]


@intrinsic
def product(typingctx, matrix, index, vector):
    """The matrix at matrix[index:], by columns, times a vector, which stays in its registers."""
    if not _is_flat(matrix) or not isinstance(vector, Ring):
        return None

    def codegen(context, builder, signature, args):
        address = _address(context, builder, signature, args, 0)
        return _whole(builder, _times(builder, address, _parts(builder, args[2])))

    return vector(matrix, index, vector), codegen


@intrinsic
def turn(typingctx, matrix, vector):
    """A circulant matrix, as :func:`circulant` stores it, times a vector."""
    if not _is_flat(matrix) or not isinstance(vector, Ring):
        return None

    def codegen(context, builder, signature, args):
        data = context.make_array(matrix)(context, builder, args[0]).data
        parts = _parts(builder, args[1])
        half = len(parts) // 2
        if len(parts) % 2:
            return _whole(builder, _times(builder, data, parts))
        halves = list(zip(parts[:half], parts[half:], strict=True))
        rest = builder.gep(data, [ir.Constant(ir.IntType(64), (WIDTH * half) ** 2)])
        sums = _times(builder, data, [builder.fadd(*pair) for pair in halves])
        rests = _times(builder, rest, [builder.fsub(*pair) for pair in halves])
        pairs = list(zip(sums, rests, strict=True))
        return _whole(
            builder,
            [builder.fadd(*pair) for pair in pairs] + [builder.fsub(*pair) for pair in pairs],
        )

    return vector(matrix, vector), codegen


def circulant(matrix: np.ndarray) -> np.ndarray:
    """Return a circulant matrix, shape (N, N), as :func:`turn` takes it, flat.

    Opposite halves of a vector are a sum and a difference, which such a matrix does not mix: where
    N is a multiple of sixteen half the products do."""
    n = len(matrix)
    parts = [matrix]
    if n % (2 * WIDTH) == 0:
        same, opposite = matrix[: n // 2, : n // 2], matrix[: n // 2, n // 2 :]
        parts = [0.5 * (same + opposite), 0.5 * (same - opposite)]
    out = aligned_zeros(sum(part.size for part in parts))
    out[:] = np.concatenate([part.T.ravel() for part in parts])
    return out


def _columns(context, builder, signature, args, k, stride):
    """Places of the eight columns of a block at args[k + 1] of the array args[k]."""
    address = _address(context, builder, signature, args, k)
    return [
        _further(builder, address, builder.mul(stride, ir.Constant(stride.type, c)))
        for c in range(WIDTH)
    ]


@intrinsic
def invert_block(typingctx, array, index, stride):
    """Invert a block of 8 x 8 in place, its columns ``stride`` apart, by Gauss-Jordan without
    row exchanges, all in registers.
    """
    if not _is_flat(array):
        return None

    def codegen(context, builder, signature, args):
        step = context.cast(builder, args[2], signature.args[2], types.intp)
        places = _columns(context, builder, signature, args, 0, step)
        columns = [builder.load(place, align=8) for place in places]
        ones = ir.Constant(_VECTOR, [1.0] * WIDTH)
        for k in range(0, WIDTH, 2):  # two pivots at a time: half as many divisions in a row
            pair = columns[k : k + 2]
            (a, c), (b, d) = ([_lane(builder, one, k + i) for i in (0, 1)] for one in pair)
            less = builder.fmul(b, c, flags=_CONTRACT)
            determinant = builder.fsub(builder.fmul(a, d, flags=_CONTRACT), less, flags=_CONTRACT)
            share = builder.fdiv(ones, determinant)
            units = [
                ir.Constant(_VECTOR, [float(i == k + other) for i in range(WIDTH)])
                for other in (0, 1)
            ]
            # the pivots' rows become those of the unit matrix
            lanes = [i + WIDTH * (i in (k, k + 1)) for i in range(WIDTH)]
            first, second = (
                _shuffle(builder, one, unit, lanes) for one, unit in zip(pair, units, strict=True)
            )
            for other, (one, two) in enumerate(((d, c), (a, b))):
                own, rest = (first, second) if other == 0 else (second, first)
                value = builder.fsub(
                    builder.fmul(own, one, flags=_CONTRACT),
                    builder.fmul(rest, two, flags=_CONTRACT),
                    flags=_CONTRACT,
                )
                columns[k + other] = builder.fmul(value, share)
            # places k and k + 1 of the other columns must become what is taken from them: one more
            # there takes the factors themselves away
            used = [builder.fadd(columns[k + other], unit) for other, unit in enumerate(units)]
            for i in [*range(k + 2, WIDTH), *range(k)]:  # the next pivots' columns first
                factors = [_lane(builder, columns[i], k + other) for other in (0, 1)]
                for factor, taken in zip(factors, used, strict=True):
                    scaled = builder.fmul(factor, taken, flags=_CONTRACT)
                    columns[i] = builder.fsub(columns[i], scaled, flags=_CONTRACT)
        for column, place in zip(columns, places, strict=True):
            builder.store(column, place, align=8)
        return context.get_dummy_value()

    return types.void(array, index, stride), codegen


@intrinsic(prefer_literal=True)
def block_product(typingctx, keep, scale, a, ia, b, ib, c, ic, stride):
    """c = keep c + scale a b for blocks of 8 x 8, whose columns are ``stride`` apart; ``keep`` is
    the constant 0 or 1. c may be the place of a or b.
    """
    if not isinstance(keep, types.IntegerLiteral) or not isinstance(scale, types.IntegerLiteral):
        return None

    def codegen(context, builder, signature, args):
        step = context.cast(builder, args[8], signature.args[8], types.intp)
        places = [_columns(context, builder, signature, args, k, step) for k in (2, 4, 6)]
        first, second = ([builder.load(place, align=8) for place in places[k]] for k in (0, 1))
        if scale.literal_value < 0:
            first = [builder.fneg(column) for column in first]
        zero = ir.Constant(_VECTOR, [0.0] * WIDTH)
        for column, place in zip(second, places[2], strict=True):
            value = builder.load(place, align=8) if keep.literal_value else zero
            for k in range(WIDTH):
                value = _fused(builder, value, first[k], _lane(builder, column, k))
            builder.store(value, place, align=8)
        return context.get_dummy_value()

    return types.void(keep, scale, a, ia, b, ib, c, ic, stride), codegen


def aligned_zeros(n: int) -> np.ndarray:
    """A float64 array of ``n`` zeros that starts on a cache line (64 bytes), so that vectors do not
    straddle two.
    """
    raw = np.zeros(n + WIDTH)
    start = (-raw.ctypes.data % 64) // 8
    return raw[start : start + n]


__all__ = [
    "EIGHT",
    "WIDTH",
    "Ring",
    "aligned_zeros",
    "at",
    "block_product",
    "chosen",
    "circulant",
    "inlined",
    "inner",
    "invert_block",
    "kernel",
    "load",
    "product",
    "smaller",
    "splat",
    "store",
    "total",
    "turn",
]
