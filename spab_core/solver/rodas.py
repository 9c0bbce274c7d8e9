"""One step of RODAS4 (Hairer and Wanner, Solving ODEs II, section VI.4), with its tangent.

Rosenbrock, order 4(3), six stages, L-stable and stiffly accurate, with the exact Jacobian. The
tangent is the exact derivative of the step, second derivative of the slope included.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spab_core.solver.curvature import add_curvature, prepare_curvature
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.simd import (
    EIGHT,
    WIDTH,
    aligned_zeros,
    inlined,
    inner,
    load,
    splat,
    store,
    total,
)
from spab_core.solver.slope import error_norm, slope, slope_tangent, time_slope

DEFAULT_TOLERANCE = 1.5e-3
# how much larger than the state's the error of the unit tangent may be
TANGENT_SLACK = 10.0
# at the default tolerance the tangent alone asks for no shorter steps: modes that need them die
# within a fraction of a revolution
TANGENT_STEP = 2.0 * math.pi / 80.0

# RODAS4 in the form of Hairer and Wanner's code: gamma, a_ij, gamma c_ij, alpha_i, gamma_i
_GAMMA = 0.25
_A = np.array(
    [
        [0, 0, 0, 0, 0],
        [1.544, 0, 0, 0, 0],
        [0.9466785280815826, 0.2557011698983284, 0, 0, 0],
        [3.314825187068521, 2.896124015972201, 0.9986419139977817, 0, 0],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 0],
    ]
)
_ONE = np.ones(1)  # a_6j = a_5j and a_65 = 1: the sixth stage starts where the fifth ends
_C = _GAMMA * np.array(
    [
        [0, 0, 0, 0, 0],
        [-5.6688, 0, 0, 0, 0],
        [-2.430093356833875, -0.2063599157091915, 0, 0, 0],
        [-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0, 0],
        [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160, 0],
        [
            8.083246795921522,
            -7.981132988064893,
            -31.52159432874371,
            16.31930543123136,
            -6.058818238834054,
        ],
    ]
)
_ALPHA = np.array([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])
_GAMMA_I = np.array([0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0])


class Stages(NamedTuple):
    """Scratch memory of one step.

    Attributes
    ----------
    state, tangent : ndarray, (6, n)
        Stages of the state and of the tangent.
    new, new_tangent : ndarray, (n,)
        Both at the end of the step; during it, where the stage is evaluated.
    slope, slope_tangent : ndarray, (n,)
        The slope there, and its derivative along the tangent.
    time_slope : ndarray, (n,)
        Partial derivative of the slope with respect to tau.
    """

    state: np.ndarray
    tangent: np.ndarray
    new: np.ndarray
    new_tangent: np.ndarray
    slope: np.ndarray
    slope_tangent: np.ndarray
    time_slope: np.ndarray


def build_stages(size: int) -> Stages:
    """Allocate the scratch memory of a step for a state of length ``size``, a multiple of eight."""
    rows = aligned_zeros(17 * size).reshape(17, size)
    return Stages(rows[:6], rows[6:12], *rows[12:])


@inner
def _sum_of(scale, base, share, extra, stages, first, count, weights, out):
    """The sum of :func:`_weighted_sum` over ``count`` stages, a constant that lets the compiler
    unroll it.
    """
    size = out.size
    for k in range(0, size, WIDTH):
        value = load(base, k, EIGHT) * scale
        if share != 0.0:
            value = value + load(extra, k, EIGHT) * share
        for j in range(count):
            value = value + load(stages, (first + j) * size + k, EIGHT) * weights[j]
        store(out, k, value)


@inner
def _weighted_sum(scale, base, share, extra, stages, first, count, weights, out):
    """out = scale base + share extra + sum over j < count of weights[j] stages[first + j];
    ``stages`` is flat.
    """
    if count == 0:
        _sum_of(scale, base, share, extra, stages, first, 0, weights, out)
    elif count == 1:
        _sum_of(scale, base, share, extra, stages, first, 1, weights, out)
    elif count == 2:
        _sum_of(scale, base, share, extra, stages, first, 2, weights, out)
    elif count == 3:
        _sum_of(scale, base, share, extra, stages, first, 3, weights, out)
    elif count == 4:
        _sum_of(scale, base, share, extra, stages, first, 4, weights, out)
    else:
        _sum_of(scale, base, share, extra, stages, first, 5, weights, out)


@inlined
def rodas_step(system, work, stages, t, h, u, v, with_tangent):
    """One RODAS4 step of state ``u`` and tangent ``v``.

    Returns the error norm (inf: invalid); the results are ``stages.new`` and ``stages.new_tangent``.
    """
    new, new_v, du, dv = stages.new, stages.new_tangent, stages.slope, stages.slope_tangent
    rate = stages.time_slope
    if not linearise(system, _GAMMA * h, u, work):
        return math.inf
    time_slope(system, t, rate)
    if with_tangent:
        prepare_curvature(system, u, v, work)
    flat, flat_v = stages.state.reshape(-1), stages.tangent.reshape(-1)
    for i in range(6):
        if i < 5:
            _weighted_sum(1.0, u, 0.0, u, flat, 0, i, _A[i], new)
        else:
            _weighted_sum(1.0, new, 0.0, new, flat, 4, 1, _ONE, new)
        if with_tangent:
            if i < 5:
                _weighted_sum(1.0, v, 0.0, v, flat_v, 0, i, _A[i], new_v)
            else:
                _weighted_sum(1.0, new_v, 0.0, new_v, flat_v, 4, 1, _ONE, new_v)
            inside = slope_tangent(system, t + _ALPHA[i] * h, new, new_v, work, du, dv)
        else:
            inside = slope(system, t + _ALPHA[i] * h, new, work, du)
        if not inside:
            return math.inf
        scale, share = _GAMMA * h, _GAMMA * h * h * _GAMMA_I[i]
        _weighted_sum(scale, du, share, rate, flat, 0, i, _C[i], stages.state[i])
        for part in range(2 if with_tangent else 1):
            if part == 1:
                _weighted_sum(scale, dv, 0.0, rate, flat_v, 0, i, _C[i], stages.tangent[i])
                add_curvature(system, u, v, stages.state[i], scale, work, stages.tangent[i])
            solve(system, work, stages.state[i] if part == 0 else stages.tangent[i])
    # the last stage is the embedded error estimate
    error, error_v = stages.state[5], stages.tangent[5]
    size, wrong = splat(0.0, EIGHT), splat(0.0, EIGHT)
    for k in range(0, new.size, WIDTH):
        store(new, k, load(new, k, EIGHT) + load(error, k, EIGHT))
        if with_tangent:
            part_v = load(error_v, k, EIGHT)
            whole_v = load(new_v, k, EIGHT) + part_v
            store(new_v, k, whole_v)
            size, wrong = size + whole_v * whole_v, wrong + part_v * part_v
    norm = error_norm(system, work, new, error)
    # a light, fast mode that the orbit does not excite must not be damped by long steps
    if with_tangent:
        worth = 0.6 * DEFAULT_TOLERANCE * (h / TANGENT_STEP) ** 4
        norm = max(norm, min(math.sqrt(total(wrong) / total(size)) / TANGENT_SLACK, worth))
    return norm
