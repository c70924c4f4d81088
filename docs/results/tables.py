"""Fills the tables of the result pages from the runs of campaign.py.

    python3 docs/results/tables.py FOLDER [--check | --list] [PAGE ...]

FOLDER is campaign.py's --output. Rows that change are printed; with --check the
pages stay as they are; --list prints the runs that tables need. A table is
filled if it follows the comment

    <!-- table: WORDS
    rows: WORDS, WORDS, ...
    columns: WORDS, WORDS, ... -->

A cell is found by the words of its table, column and row; of two words for one
thing the last counts. Without "rows" the word of a row is its label up to " (".
"{}" in a word stands for the first word of the row. Cells that are empty, and
rows and columns with the word "-", stay as they are, as does a table whose runs
are not in FOLDER.

    runs/NAME              summary.csv of compare or sweep.csv of sweep there
    adam, adam:*, !adam*   a method; the best that matches, or does not match
    name=value             a column of sweep.csv and its value
    train_loss, metric, steps, ms_per_step, ...   what is shown; else test_loss
    s_to_0.001             what is shown: this column of the run's table.md
    range, median_range    of the seeds; else the median. A failed run is worst.
    worst                  the worst seed, not a failed run, over the median
    .4                     digits; else 2
    ratio                  the row's first loss over the lowest of its others
    overtakes              the seconds after which the method, a name without
                           options, is below the row's last loss: the median of
                           the seeds (history.csv)
    bold=row, bold=column  the lowest losses of the table are bold
"""

import csv
import fnmatch
import math
import pathlib
import re
import sys

PAGES = pathlib.Path(__file__).resolve().parent
TABLE = re.compile(r"<!-- table:((?:.|\n)*?)-->\n\n((?:\|.*\n)+)")
LOSSES = ("train_loss", "test_loss", "best_train_loss", "metric")
VALUES = (*LOSSES, "steps", "seconds", "ms_per_step")
# How a status begins, after the number of a phase.
FAILED = re.compile(r"(phase \d+: )?(diverged|refused|damaged|killed|failed|"
                    r"out of memory|not run|aborted)")


def number(value, digits):
    if not math.isfinite(value):
        return "failed"
    rounded = float(f"{value:.{digits}g}")  # 99.6 with two digits is 100
    if isinstance(value, int) or 10**digits <= rounded < 1e6:
        return f"{value:,.0f}"
    if 1e-3 <= rounded < 1e6 or value == 0:
        return f"{value:#.{digits}g}".rstrip(".")
    return f"{value:.{digits - 1}e}".replace("e-0", "e-").replace("e+", "e")


def read(file):
    """The runs of a CSV file, of those with alternatives the best."""
    with open(file, newline="") as lines:
        runs = [run for run in csv.DictReader(lines) if run.get("best") != "0"]
    for run in runs:
        run["method"] = run.get("method") or run["rule"]
        run["steps"] = int(run["steps"] or 0)
        for name in (*LOSSES, "seconds"):
            value = float(run[name] or "nan")
            failed = FAILED.match(run["status"]) and name in LOSSES
            run[name] = math.inf if failed or math.isnan(value) else value
        run["ms_per_step"] = 1e3 * run["seconds"] / max(run["steps"], 1)
    return runs


def from_table(file, method, title):
    rows = [[cell.strip() for cell in line.split("|")]
            for line in file.read_text().splitlines()]
    row = next(row for row in rows if row[1] == method)
    return row[rows[0].index(title)].replace("e-0", "e-")


def find(folder, words):
    name = [word for word in words if word.startswith("runs/")][-1]
    files = [*folder.glob(f"*/{name}/summary.csv"),
             *folder.glob(f"*/{name}/sweep.csv")]
    if not files:
        raise FileNotFoundError(f"{name} has not run")
    return files[0]


def overtakes(folder, words, loss):
    column = [word for word in words if word in LOSSES] or ["test_loss"]
    method = [word for word in words
              if word not in (*LOSSES, "overtakes") and "/" not in word][-1]
    seconds = []
    for history in find(folder, words).parent.glob(
            f"{method}-seed*/history.csv"):
        with open(history, newline="") as lines:
            seconds.append(next((float(row["seconds"])
                                 for row in csv.DictReader(lines)
                                 if float(row[column[-1]] or "nan") < loss),
                                math.inf))
    seconds.sort()
    middle = seconds[(len(seconds) - 1) // 2]
    return number(middle, 2) if middle < math.inf else "never"


def fill(folder, words):
    """The text of a cell, and its loss (or None)."""
    file = find(folder, words)
    runs = read(file)
    names = set(runs[0])
    column, kind, digits, pattern, title = "test_loss", "", 2, "*", ""
    for word in words:
        key, _, value = word.partition("=")
        if word in VALUES:
            column = word
        elif word in ("range", "median_range", "worst"):
            kind = word
        elif re.fullmatch(r"\.\d", word):
            digits = int(word[1])
        elif word.startswith("s_to_"):
            title = word.replace("_", " ")
        elif key in names:
            runs = [run for run in runs if run[key] == value]
        elif not word.startswith(("runs/", "bold=")):
            pattern = word
    methods = {}
    for run in runs:
        if (fnmatch.fnmatchcase(run["method"], pattern.lstrip("!"))
                != pattern.startswith("!")):
            methods.setdefault(run["method"], []).append(run)
    if not methods:
        raise LookupError(f"no run for {' '.join(words)} in {file}")
    loss = column if column in LOSSES else "train_loss"
    for seeds in methods.values():
        seeds.sort(key=lambda run: run[loss])
    # As compare does: the run with the median loss, of two the lower.
    best, middle = min(((seeds, seeds[(len(seeds) - 1) // 2])
                        for seeds in methods.values()),
                       key=lambda pair: pair[1][loss])
    if title:
        return from_table(file.parent / "table.md", middle["method"],
                          title), None
    text = number(middle[column], digits)
    values = [run[column] for run in best if run[loss] < math.inf]
    if kind == "worst":
        return number(max(values) / middle[column], digits), None
    if kind and values:
        low, high = number(min(values), digits), number(max(values), digits)
        text = (f"{low} … {high}" if kind == "range" else
                f"{text} ({low} … {high})")
    if values and len(values) < len(best) and column in LOSSES:
        text += f", {len(best) - len(values)} of {len(best)} failed"
    return text, middle[loss] if column == loss and kind != "range" else None


def parse(spec, cells):
    """The words of each cell, by row; none for one that is written by hand."""
    table, rows, columns = re.fullmatch(
        r"((?:.|\n)*?)(?:rows:((?:.|\n)*))?columns:((?:.|\n)*)", spec).groups()
    rows = rows.split(",") if rows else [
        re.sub(r"[*`]", "", line[0].split(" (")[0]) for line in cells]
    columns = [table.split() + column.split() for column in columns.split(",")]
    if len(rows) != len(cells) or len(columns) != len(cells[0]) - 1:
        raise ValueError(f"{len(cells)} rows, {len(cells[0])} columns: {spec}")
    for row, line in zip(map(str.split, rows), cells):
        yield [[] if "-" in row + column or not cell else
               [word.replace("{}", row[0]) for word in column]
               + row["{}" in spec:]
               for column, cell in zip(columns, line[1:])]


def cells_of(table):
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            for line in table.splitlines()[2:]]


def rebuild(folder, spec, table):
    cells = cells_of(table)
    losses = {}
    for i, words_of_row in enumerate(parse(spec, cells)):
        for j, words in enumerate(words_of_row, start=1):
            if not words:
                continue
            of_row = [losses[at] for at in losses if at[0] == i]
            if "ratio" in words:
                cells[i][j] = number(of_row[0] / min(of_row[1:]), 2)
                continue
            if "overtakes" in words:
                cells[i][j] = overtakes(folder, words, of_row[-1])
                continue
            cells[i][j], loss = fill(folder, words)
            if loss is not None:
                losses[i, j] = loss
    for by, text in enumerate(("bold=row", "bold=column")):
        for at in losses if text in spec else ():
            if losses[at] == min(losses[other] for other in losses
                                 if other[by] == at[by]):
                i, j = at
                cells[i][j] = re.sub(r"^\S*[^\s,]", r"**\g<0>**",
                                     cells[i][j])
    rows = ["".join(f" {cell} |" if cell else " |" for cell in line)
            for line in cells]
    return table.splitlines()[:2] + ["|" + row for row in rows]


def update(page, folder, writes):
    """Whether the page differs from its runs."""
    text = page.read_text()
    filled = text
    for table in TABLE.finditer(text):
        try:
            lines = rebuild(folder / page.stem, *table.groups())
        except (FileNotFoundError, LookupError) as error:
            print(f"{page.name}: a table stays as it is: {error}")
            continue
        for old, new in zip(table[2].splitlines(), lines):
            if old != new:
                print(f"{page.name}:\n- {old}\n+ {new}")
        filled = filled.replace(table[2], "\n".join(lines) + "\n")
    if writes:
        page.write_text(filled)
    return filled != text


def main():
    options = {word for word in sys.argv[1:] if word.startswith("--")}
    words = [word for word in sys.argv[1:] if word not in options]
    if not words or not options <= {"--check", "--list"}:
        sys.exit(__doc__)
    folder, *names = words
    pages = [PAGES / name for name in names] or sorted(PAGES.glob("*.md"))
    if "--list" in options:
        for page in pages:
            for table in TABLE.finditer(page.read_text()):
                cells = sum(parse(table[1], cells_of(table[2])), [])
                for run in sorted({word for word in sum(cells, [])
                                   if "runs/" in word}):
                    print(page.name, run)
        return 0
    differ = [update(page, pathlib.Path(folder), "--check" not in options)
              for page in pages]
    return 1 if "--check" in options and any(differ) else 0


if __name__ == "__main__":
    sys.exit(main())
