"""bench/real_page.py: the page of scripts/bench real."""
from tables import seconds, table

UNITS = {"processor": "x", "wall": "x", "peak": "x", "bytes": "x", "older": "x", "above": "ms", "MiB": "MiB"}
ABSOLUTE = {"wall": "s"}


def figure(row, value):
    if value is None:
        return "-"
    unit = UNITS[row["measure"]] if row["unit_of"] or row["measure"] not in ABSOLUTE else ABSOLUTE[row["measure"]]
    return f"{seconds(abs(value))} {unit}"


def verdict(row):
    return {True: "met", False: "MISSED", None: "not known"}[row["met"]]


def line(row):
    return f"  {row['name']}: {figure(row, row['value'])}, target {figure(row, row['target'])}: {verdict(row)}"


def run_text(run):
    return f"{seconds(run['wall'])} / {seconds(run['processor'])} / {run['peak']:.0f}" if run else "-"


def lines(result):
    about = result["machine"]
    yield "# Real jobs"
    yield ""
    yield "Written by `scripts/bench real`; edits are lost. Raw figures: `bench/results/real.json`."
    yield ""
    yield (f"{about['processor']}, {about['cores']} cores, {about['memory_gib']} GiB; commit {result['commit']} on {result['date']}. Medians of "
           f"{result['runs']} alternating runs, outputs in memory. Other programs used {100 * result['others']:.0f} % of the processors. Ratios are of "
           "processor seconds, or as the row states. Runs: wall seconds / processor seconds / peak MiB.")
    yield ""
    yield from table(["job", "now", "target", "goal", "", "the job", "compared with", "older build"], [
        [row["about"], figure(row, row["value"]), figure(row, row["target"]), figure(row, row["goal"]), verdict(row), run_text(row.get("new")),
         run_text(row.get("unit")), run_text(row.get("old"))] for row in result["rows"]])
