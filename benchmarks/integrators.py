"""Which time integrator? Error and time of four schemes on the same semi-discrete system, one core,
one run.

    python benchmarks/integrators.py [--repeat 5]

Schemes, all compiled and all on the film kernels of spab_core: RODAS4 (production), ROS34PW2
(Rosenbrock-W of order 3, Rang and Angermann 2005, exact Jacobian), RKC2 (stabilised explicit,
Sommeijer, Shampine and Verwer 1998, stages from the film's spectral radius) and the paper's
differential transformation of order 6. Each is run at fixed steps over five revolutions from the
same settled state; the error is the largest difference of journal and disc positions (over C) from
RODAS4 at tolerance 1e-10. Told is the shortest time with an error of at most 1e-4, as a ratio to
production."""

from __future__ import annotations

import argparse
import math
import statistics
import time

import numpy as np
from numba import njit

from spab_core.design.model import reference_design
from spab_core.solver.film import build_film, film_size, suitable_mesh
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.rotor import build_rotor
from spab_core.solver.slope import slope, slope_and_jacobian, time_slope
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.solver.system import System

POINTS = {
    "4 kg, L 1": (4.0, 1.0),
    "4.52 kg, L 3 (period 2, e to 0.87)": (4.52, 3.0),
    "7 kg, L 6 (period 2)": (7.0, 6.0),
    "18 kg, L 4.5 (chaos, contact)": (18.0, 4.5),
    "10 kg, L 0.25 (stiff)": (10.0, 0.25),
}
REVOLUTIONS, SETTLE, TARGET = 5, 60, 1e-4

G = 0.43586652150845900
ALPHA = np.array(
    [
        [0, 0, 0, 0],
        [0.87173304301691801, 0, 0, 0],
        [0.84457060015369423, -0.11299064236484185, 0, 0],
        [0, 0, 1.0, 0],
    ]
)
GAMMA = np.array(
    [
        [G, 0, 0, 0],
        [-0.87173304301691801, G, 0, 0],
        [-0.90338057013044082, 0.054180672388095326, G, 0],
        [0.24212380706095346, -1.2232505839045147, 0.54526025533510214, G],
    ]
)
B = ALPHA[3] + GAMMA[3]  # stiffly accurate
INVERSE = np.linalg.inv(GAMMA)
A_ROS, M_ROS = ALPHA @ INVERSE, B @ INVERSE
C_ROS = np.diag(np.diag(INVERSE)) - INVERSE
T_ROS, D_ROS = ALPHA.sum(axis=1), GAMMA.sum(axis=1)


@njit(nogil=True)
def ros34pw2(system, work, u, tau, h, steps, a, c, m, t, d):
    n = u.size
    k, right, rate, new = np.zeros((4, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    for _ in range(steps):
        if not linearise(system, G * h, u, work):
            return False
        time_slope(system, tau, rate)
        for i in range(4):
            new[:] = u
            for j in range(i):
                new += a[i, j] * k[j]
            if not slope(system, tau + t[i] * h, new, work, right):
                return False
            k[i] = h * right + h * h * d[i] * rate
            for j in range(i):
                k[i] += c[i, j] * k[j]
            k[i] *= G
            solve(system, work, k[i])
        for i in range(4):
            u += m[i] * k[i]
        tau += h
    return True


@njit(nogil=True)
def rkc2(system, work, u, tau, h, steps, stages, mu, nu, mt, gt, c):
    n = u.size
    f0, f, before, y, new = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for _ in range(steps):
        if not slope(system, tau, u, work, f0):
            return False
        before[:] = u
        y[:] = u + mt[1] * h * f0
        for j in range(2, stages + 1):
            if not slope(system, tau + c[j - 1] * h, y, work, f):
                return False
            new[:] = (
                (1.0 - mu[j] - nu[j]) * u
                + mu[j] * y
                + nu[j] * before
                + mt[j] * h * f
                + gt[j] * h * f0
            )
            before[:] = y
            y[:] = new
        u[:] = y
        if not np.isfinite(u[0]):
            return False
        tau += h
    return True


def rkc_coefficients(stages):
    w0 = 1.0 + 2.0 / 13.0 / stages**2
    t, d1, d2 = [1.0, w0], [0.0, 1.0], [0.0, 0.0]
    for j in range(2, stages + 1):
        t.append(2 * w0 * t[j - 1] - t[j - 2])
        d1.append(2 * t[j - 1] + 2 * w0 * d1[j - 1] - d1[j - 2])
        d2.append(4 * d1[j - 1] + 2 * w0 * d2[j - 1] - d2[j - 2])
    w1 = d1[stages] / d2[stages]
    b = [0.0, 0.0] + [d2[j] / d1[j] ** 2 for j in range(2, stages + 1)]
    b[0] = b[1] = b[2]
    mu, nu, mt, gt, c = (np.zeros(stages + 1) for _ in range(5))
    mt[1] = c[1] = b[1] * w1
    for j in range(2, stages + 1):
        mu[j], nu[j], mt[j] = 2 * b[j] * w0 / b[j - 1], -b[j] / b[j - 2], 2 * b[j] * w1 / b[j - 1]
        gt[j] = -(1 - b[j - 1] * t[j - 1]) * mt[j]
        c[j] = mu[j] * c[j - 1] + nu[j] * c[j - 2] + mt[j] + gt[j]
    return mu, nu, mt, gt, c


def spectral_radius(system, states):
    """Largest eigenvalue magnitude of the whole Jacobian over some states of the orbit."""
    every = np.arange(len(states[0]))
    return max(
        np.abs(np.linalg.eigvals(slope_and_jacobian(system, s, every)[1])).max() for s in states
    )


class Problem:
    def __init__(self, mass, bearing_number):
        design = reference_design()
        self.film = build_film(design, bearing_number)
        self.system = System(self.film, build_rotor(design, mass, bearing_number))
        memory = build_memory(self.film)
        assert (
            advance(self.system, memory, Options(1e-6), 0, SETTLE, build_record(SETTLE, 0))[0] == 0
        )
        self.start = memory.state.copy()
        self.end = self.adaptive("rodas", 1e-10)[0]
        self.radius = 1.1 * spectral_radius(self.system, [self.start, self.end])

    def positions(self, state):
        n = film_size(self.film)
        return state[n : n + 4]

    def adaptive(self, method, tolerance):
        memory = build_memory(self.film, method)
        memory.state[:] = self.start
        memory.control[0] = 0.05
        options = Options(tolerance)
        record = build_record(REVOLUTIONS, 0)
        began = time.perf_counter()
        status, _ = advance(self.system, memory, options, SETTLE, REVOLUTIONS, record)
        seconds = time.perf_counter() - began
        return (
            (memory.state.copy() if status == 0 else None),
            seconds,
            memory.control[1] / REVOLUTIONS,
        )

    def fixed(self, scheme, per_revolution):
        u, work = self.start.copy(), build_memory(self.film).work
        h, steps = 2.0 * math.pi / per_revolution, per_revolution * REVOLUTIONS
        tau = 2.0 * math.pi * SETTLE
        if scheme == "ros34pw2":
            arguments = (A_ROS, C_ROS, M_ROS, T_ROS, D_ROS)
            run, stages = ros34pw2, 4
        else:
            stages = max(2, math.ceil(math.sqrt(1.0 + h * self.radius / 0.653)))
            arguments = (stages, *rkc_coefficients(stages))
            run = rkc2
        began = time.perf_counter()
        good = run(self.system, work, u, tau, h, steps, *arguments)
        return (u if good else None), time.perf_counter() - began, stages

    def error(self, state):
        return (
            math.inf
            if state is None or not np.all(np.isfinite(state))
            else float(np.abs(self.positions(state) - self.positions(self.end)).max())
        )


def best(problem, run, settings, repeat):
    """The cheapest setting that meets the target: (setting, error, median seconds, extra)."""
    for setting in settings:
        state, _, extra = run(setting)
        error = problem.error(state)
        if error <= TARGET:
            return setting, error, statistics.median(run(setting)[1] for _ in range(repeat)), extra
    return None


def compare(problem, repeat):
    """Print the four schemes at one operating point."""
    tolerances = [1e-3 / 2**k for k in range(24)]
    per_revolution = [round(12 * 2 ** (k / 3)) for k in range(42)]
    found = {
        "RODAS4, adaptive": best(
            problem, lambda s: problem.adaptive("rodas", s), tolerances, repeat
        ),
        "ROS34PW2, fixed": best(
            problem, lambda s: problem.fixed("ros34pw2", s), per_revolution, repeat
        ),
        "RKC2, fixed": best(problem, lambda s: problem.fixed("rkc2", s), per_revolution, repeat),
        "DTM order 6, adaptive": best(
            problem, lambda s: problem.adaptive("dtm", s), tolerances, repeat
        ),
    }
    base = found["RODAS4, adaptive"]
    for scheme, answer in found.items():
        if answer is None:
            print(f"  {scheme:22s} not reached within {per_revolution[-1]} steps a revolution")
            continue
        setting, error, seconds, extra = answer
        steps = (
            f"{extra:.0f} steps/rev"
            if "adaptive" in scheme
            else f"{setting} steps/rev, {extra} stages"
        )
        print(
            f"  {scheme:22s} {seconds / base[2]:7.1f} x   error {error:.1e}   {steps:28s} "
            f"{1e3 * seconds / REVOLUTIONS:.2f} ms/rev"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    repeat = parser.parse_args().repeat
    for name, (mass, bearing_number) in POINTS.items():
        print(
            f"\n{name}: error <= {TARGET:g} of the clearance after {REVOLUTIONS} revolutions, "
            f"mesh {suitable_mesh(reference_design())}"
        )
        compare(Problem(mass, bearing_number), repeat)


if __name__ == "__main__":
    main()
