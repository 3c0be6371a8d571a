"""Logs of touches by Python's re, and the same numbers as CSV by polars.

    log_read.py re FILE REPEATS | log_read.py polars FILE REPEATS

Prints: seconds (fastest), touches, sum of X. polars takes its number of threads from POLARS_MAX_THREADS.
"""

import re
import sys
import time


def by_re(path):
    with open(path, "rb") as file:
        text = file.read()
    word = re.compile(rb"([A-Z]) *(-?) *([0-9.]+)")

    def read():
        columns = {letter: [] for letter in "NSXYZABCK"}
        for line in text.split(b"\n"):
            if line.startswith(b"P"):
                for letter, sign, digits in word.findall(line):
                    columns[letter.decode()].append(float(sign + digits))
        return len(columns["N"]), sum(columns["X"])

    return read


def by_polars(path):
    import polars

    with open(path, "rb") as file:
        text = file.read()

    def read():
        frame = polars.read_csv(text)
        return frame.height, frame["X"]

    return read


def main():
    how, path, repeats = sys.argv[1], sys.argv[2], int(sys.argv[3])
    read = by_re(path) if how == "re" else by_polars(path)
    best = float("inf")
    for _ in range(repeats):
        begin = time.perf_counter()
        count, xs = read()
        best = min(best, time.perf_counter() - begin)
    total = xs if isinstance(xs, float) else xs.sum()
    print(f"{best:.9g} {count} {total:.17g}")


main()
