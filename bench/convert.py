#!/usr/bin/env python3
"""bench/convert.py: lamina convert, G4 to G4, compared with raw reading and writing of the same files. scripts/bench convert

    scripts/bench convert [--runs N] [--cache DIR] [--out DIR]     writes bench/convert.md

Layers are those of `lamina jet`; what is converted must be the same bytes again. Raw: one process reads each file and writes
it elsewhere, and does nothing else.
"""
import argparse
import filecmp
import os
import shutil
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import jet  # noqa: E402
from measure import measured, median_of  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
CASES = ("terrain", "benchy", "crowns-96")
MIN_RATE = {"crowns-96": 60}  # Gpx/s


def measure(case, parts, out, runs):
    part, _, bed, layer, _ = jet.CASES[case]
    shutil.rmtree(out, ignore_errors=True)
    os.makedirs(out)
    planned, converted, raw = (os.path.join(out, name) for name in ("planned", "converted", "raw"))
    measured([LAMINA, "jet", os.path.join(parts, part), "--bed", f"{bed}x{bed}", "--dpi", str(jet.DPI), "--layer", str(layer),
              "--quiet", "-o", planned], out + ".log")
    layers = os.path.join(planned, "layers")
    names = sorted(os.listdir(layers))
    found = {"convert": [], "raw": []}
    for _ in range(runs):
        for folder in (converted, raw):
            shutil.rmtree(folder, ignore_errors=True)
        found["convert"].append(measured([LAMINA, "convert", layers, "--quiet", "-o", converted], out + ".log"))
        found["raw"].append(measured(["cp", "-r", layers, raw], out + ".log"))
        _, differ, missing = filecmp.cmpfiles(layers, converted, names, shallow=False)
        if differ or missing:
            sys.exit(f"bench: {case}: {(differ + missing)[0]} is not converted to itself")
    size = sum(os.path.getsize(os.path.join(layers, name)) for name in names)
    pixels = len(names) * (-(-bed * jet.DPI * 10 // 254)) ** 2
    shutil.rmtree(out)
    return {kind: median_of(found[kind]) for kind in found}, len(names), size, pixels


def main(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    parser.add_argument("--out", default="")
    parser.add_argument("--page", default=os.path.join(ROOT, "bench/convert.md"))
    parser.add_argument("--cases", default=",".join(CASES))
    options = parser.parse_args(words)
    parts, folder = os.path.join(options.cache, "parts"), options.out or options.cache
    machine, others = figures.machine(folder), 0
    lines = ["# Images to images", "", "Written by `scripts/bench convert`; edits are lost.", "", "", "",
             "| job | files | MB | lamina convert, ms | raw read and write, ms | Gpx/s |", "|---|---|---|---|---|---|"]
    for case in options.cases.split(","):
        found, files, size, pixels = measure(case, parts, os.path.join(folder, "convert"), options.runs)
        others = max([others] + [one["others"] for one in found.values()])
        cells = [f"{1000 * found[kind]['wall']:.0f} ({1000 * found[kind]['fastest']:.0f})" for kind in ("convert", "raw")]
        rate = pixels / found["convert"]["wall"] / 1e9
        minimum = MIN_RATE.get(case, 0)
        verdict = f" (at least {minimum}: {'met' if rate >= minimum else 'MISSED'})" if minimum else ""
        lines.append(f"| `{case}` | {files} | {size / 1e6:.1f} | {' | '.join(cells)} | {rate:.0f}{verdict} |")
        print(lines[-1], flush=True)
    lines[4] = (f"Commit {figures.commit(ROOT)}. G4 to G4, the same bytes. {machine['processor']}, {machine['cores']} cores, kernel {machine['kernel']}, files on "
                f"{machine['files_on']}. Whole processes: medians of {options.runs} turns, and the fastest. Other programs used at "
                f"most {100 * others:.0f} % of the processors.")
    with open(options.page, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
