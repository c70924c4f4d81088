"""Runs the commands of the result pages, one after another.

    python3 docs/results/campaign.py --output=runs/campaign [PAGE ...]
    python3 docs/results/campaign.py --list [PAGE ...]

PAGE is a file of docs/results, for example fields.md, or one block of it, for
example fields.md:3. Without one all pages run, for many hours. Start it in the
root of the repository. A block of commands runs in OUTPUT/PAGE/NUMBER, with
links to all files of the current folder, such as data that you have put there,
and to the runs of the page's earlier blocks. Its log.txt has what it printed,
OUTPUT/times.csv the seconds and failed commands of each block. A failed command
does not stop the others (exit code 2: a method of a comparison failed, which
may be what the page shows). Start it again after an interruption: it runs the
blocks that have not ended, or whose text has changed. tables.py then writes the
numbers into the pages.
"""

import argparse
import csv
import pathlib
import re
import shutil
import subprocess
import sys
import time

PAGES = pathlib.Path(__file__).resolve().parent
BLOCK = re.compile(r"^( *)```sh\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
# Writes the exit code and the text of each command that fails.
TRAP = "trap 'echo \"$? $BASH_COMMAND\" >> failed.txt' ERR\n"


def blocks(page):
    """The texts marked ```sh."""
    return [match[2] for match in BLOCK.finditer(page.read_text())]


def run(folder, block):
    """The seconds, and the failed commands."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "runs").mkdir(parents=True)
    for entry in pathlib.Path.cwd().iterdir():
        if entry.name != "runs":
            (folder / entry.name).symlink_to(entry)
    for earlier in range(1, int(folder.name)):
        for entry in (folder.resolve().parent / str(earlier)).glob("runs/*"):
            if not entry.is_symlink():
                (folder / "runs" / entry.name).symlink_to(entry)
    start = time.monotonic()
    with open(folder / "log.txt", "w") as log:
        bash = subprocess.run(["bash", "-c", TRAP + block], cwd=folder,
                              stdout=log, stderr=subprocess.STDOUT, check=False)
    seconds = time.monotonic() - start
    if bash.returncode >= 0:  # no signal
        (folder / "done.txt").write_text(block)
    failed = folder / "failed.txt"
    return seconds, failed.read_text().splitlines() if failed.exists() else []


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("pages", nargs="*")
    parser.add_argument("--output", type=pathlib.Path)
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    if not options.list and options.output is None:
        parser.error("--output=FOLDER or --list")
    pages = options.pages or sorted(page.name for page in PAGES.glob("*.md"))
    for page in pages:
        name, _, only = page.partition(":")
        for number, block in enumerate(blocks(PAGES / name), start=1):
            if only not in ("", str(number)):
                continue
            if options.list:
                print(f"# {name}, block {number}\n{block}", end="")
                continue
            folder = options.output / pathlib.Path(name).stem / str(number)
            done = folder / "done.txt"
            if done.exists() and done.read_text() == block:
                continue
            seconds, failures = run(folder, block)
            with open(options.output / "times.csv", "a", newline="") as file:
                csv.writer(file).writerow(
                    [name, number, f"{seconds:.1f}", "; ".join(failures)])
            print(f"{name}, block {number}: {seconds:.1f} s, "
                  f"{len(failures)} failed", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
