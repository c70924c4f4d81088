"""Prints the table of control.md, section 3, from the runs of its command.

    python3 docs/results/control_table.py runs/unseen runs/unseen_others

Both folders hold a run of `compare` for each problem, the first with `adaptive`,
the second with the other methods. The column is the test loss, or the train loss
where there is no test loss; with `name:metric` after the folders, the problem's
metric for the problem `name`. Adam is the lowest of its settings.
"""

import csv
import math
import pathlib
import statistics
import sys

METHODS = ("geodesic", "levenberg_marquardt", "power", "half_inverse",
           "kfac_half_inverse", "adam")


def read(folder):
    with open(folder / "summary.csv", newline="") as file:
        return list(csv.DictReader(file))


def value(row, column):
    loss = float(row[column])
    return float(row["train_loss"]) if math.isnan(loss) else loss


def lowest(rows, method, column):
    losses = [value(row, column) for row in rows
              if row["method"].split(":")[0] == method]
    losses = [loss for loss in losses if math.isfinite(loss)]
    return min(losses, default=math.inf)


def main():
    ours, others = map(pathlib.Path, sys.argv[1:3])
    columns = dict(name.split(":") for name in sys.argv[3:])
    print("| problem | `adaptive`, median (range) | "
          + " | ".join(METHODS) + " | over the best other |")
    print("|---|---:|" + "---:|" * (len(METHODS) + 1))
    for folder in sorted(ours.iterdir()):
        column = columns.get(folder.name, "test_loss")
        losses = [value(row, column) for row in read(folder)]
        median = statistics.median(losses)
        other_rows = read(others / folder.name)
        best = [lowest(other_rows, method, column) for method in METHODS]
        cells = [f"{loss:.2g}" for loss in best]
        print(f"| {folder.name} | {median:.2g} "
              f"({min(losses):.2g} … {max(losses):.2g}) | "
              + " | ".join(cells) + f" | {median / min(best):.2g} |")


if __name__ == "__main__":
    main()
