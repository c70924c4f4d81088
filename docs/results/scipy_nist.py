#!/usr/bin/env python3
"""Solves the NIST regressions by scipy.optimize.least_squares (python3-scipy).

  scipy_nist.py FOLDER [SIGMA]    the folder with the *.dat files; SIGMA: relative
                                  noise on the starts, 20 draws of each

Prints for lm (MINPACK) and trf how many runs agree with the certified values in
more than four digits of every parameter, the evaluations and the seconds. The
Jacobians are exact (complex steps), x_scale is 'jac', all tolerances are 1e-14.
"""
import glob
import re
import sys
import time

import numpy as np
from scipy.optimize import least_squares


def read(path):
    """Starts (k x 2), certified values (k), and the residuals as a function."""
    lines = open(path).read().splitlines()
    number = r"[-+]?[\d.]+(?:E[-+]?\d+)?"
    rows = [re.findall(number, line.split("=")[1]) for line in lines
            if re.match(r" *b\d+ *=", line)]
    parameters = np.array(rows, dtype=float)
    begin = max(i for i, line in enumerate(lines) if line.startswith("Data:"))
    columns = lines[begin].split()[1:]
    data = np.array([line.split() for line in lines[begin + 1:] if line.split()],
                    dtype=float)
    text = " ".join(lines[lines.index(next(
        line for line in lines if line.startswith("Model:"))):begin])
    text = re.search(r"((?:log\[y\]|y) *=.*?) *\+ *e\b", text).group(1)
    left, right = (side.replace("[", "(").replace("]", ")")
                   for side in text.split("=", 1))
    names = {"exp": np.exp, "log": np.log, "cos": np.cos, "sin": np.sin,
             "arctan": np.arctan, "pi": np.pi}
    names.update((name, data[:, i]) for i, name in enumerate(columns))
    response, model = eval(left, names), compile(right.strip(), path, "eval")

    def residuals(b):
        values = {f"b{i + 1}": value for i, value in enumerate(b)}
        return eval(model, names, values) - response

    certified = parameters[:, 2]
    if "arctan" in right and np.sum(residuals(certified) ** 2) > 1.0:
        # The other of the two versions of Roszman1 that exist.
        names["arctan"] = lambda z: np.arctan(z) + np.pi
    return parameters[:, :2], certified, residuals


def jacobian(residuals):
    def at(b):
        columns = []
        for i in range(len(b)):
            moved = b.astype(complex)
            moved[i] += 1e-30j
            columns.append(residuals(moved).imag / 1e-30)
        return np.array(columns).T
    return at


def is_solved(residuals, start, certified, method, counts):
    begin = time.process_time()
    try:
        result = least_squares(residuals, start, jacobian(residuals), x_scale="jac",
                               method=method, max_nfev=2000,
                               ftol=1e-14, xtol=1e-14, gtol=1e-14)
    except ValueError:  # the residuals are not finite
        return False
    finally:
        counts[1] += time.process_time() - begin
    counts[0] += result.nfev
    return bool(np.all(np.abs(result.x - certified) < 1e-4 * np.abs(certified)))


def main(folder, sigma=0.0):
    np.seterr(all="ignore")
    draws = 20 if sigma > 0.0 else 1
    for method in ("lm", "trf"):
        random = np.random.default_rng(1)
        solved, runs, counts = 0, 0, [0, 0.0]
        for path in sorted(glob.glob(folder + "/*.dat")):
            starts, certified, residuals = read(path)
            for start in starts.T:
                for _ in range(draws):
                    noisy = start * (1.0 + sigma * random.standard_normal(len(start)))
                    solved += is_solved(residuals, noisy, certified, method, counts)
                    runs += 1
        print(f"{method}: {solved} of {runs} solved, {counts[0]} evaluations, {counts[1]:.2f} s")


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:]))
