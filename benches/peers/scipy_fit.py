"""SciPy's least_squares on a problem file: scipy_fit.py PROBLEM METHOD REPEATS (lm or trf; the best of so many). Writes the answer as JSON."""

import json
import sys
import time

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import least_squares

from model import Touches, evaluate


def read(path):
    """Touches, names of the unknowns, standard deviation of a touch (mm)."""
    with open(path, "rb") as f:
        if f.readline() != b"axiscal-peers/1\n":
            sys.exit(f"{path} is no problem file")
        n, n_set_ups, n_unknowns, sigma = f.readline().split()
        set_ups = [f.readline().split() for _ in range(int(n_set_ups))]
        names = [f.readline().decode().strip() for _ in range(int(n_unknowns))]
        rows = np.frombuffer(f.read(), dtype="<f8").reshape(int(n), 16)
    turns = [word == b"C" for word, *_ in set_ups]
    centre = [[float(x) for x in numbers] for _, *numbers in set_ups]
    touches = Touches(
        rows[:, 0:3], rows[:, 3], rows[:, 4], rows[:, 5:8], rows[:, 8:11], rows[:, 11], rows[:, 12:15], rows[:, 15], turns, centre
    )
    return touches, names, float(sigma)


class Problem:
    """Residuals and Jacobian in units of sigma, both from one pass over the touches."""

    def __init__(self, touches, names, sigma):
        self.touches, self.names, self.sigma = touches, names, sigma
        self.theta, self.rows = None, None

    def residual(self, theta):
        gap, rows = evaluate(self.touches, self.names, theta)
        self.theta, self.rows = theta.copy(), rows
        return gap / self.sigma

    def jacobian(self, theta):
        if not np.array_equal(theta, self.theta):
            self.residual(theta)
        return self.rows / self.sigma


def covariance(jacobian):
    scale = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / scale
    return cho_solve(cho_factor(scaled.T @ scaled), np.eye(len(scale))) / np.outer(scale, scale)


def fit(touches, names, sigma, method):
    start = time.perf_counter()
    p = Problem(touches, names, sigma)
    zero = np.zeros(len(names))
    # MINPACK's first step is bounded in scaled unknowns: large scales leave Gauss-Newton's own step
    scale = 1e6 / np.linalg.norm(p.jacobian(zero), axis=0)
    found = least_squares(p.residual, zero, p.jacobian, method=method, x_scale=scale, ftol=1e-12, xtol=1e-12, gtol=1e-15)
    fitted = time.perf_counter()
    sigmas = np.sqrt(np.diag(covariance(p.jacobian(found.x))))
    return {
        "fit_s": fitted - start,
        "covariance_s": time.perf_counter() - fitted,
        "iterations": int(found.nfev),
        "value": found.x.tolist(),
        "sigma": sigmas.tolist(),
    }


def peak():
    """The largest resident set of this very program, KiB (getrusage would count what the caller had before the exec)."""
    with open("/proc/self/status") as f:
        return next(int(line.split()[1]) for line in f if line.startswith("VmHWM:"))


def main():
    path, method, repeats = sys.argv[1], sys.argv[2], int(sys.argv[3])
    touches, names, sigma = read(path)
    loaded = peak()
    answers = [fit(touches, names, sigma, method) for _ in range(repeats)]
    best = min(answers, key=lambda a: a["fit_s"] + a["covariance_s"])
    json.dump({"solver": f"scipy {method}", "loaded_kb": loaded, "peak_kb": peak(), "name": names} | best, sys.stdout)


if __name__ == "__main__":
    main()
