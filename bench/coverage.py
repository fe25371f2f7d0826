#!/usr/bin/env python3
"""bench/coverage.py: cost of fill fractions of voxels compared with 1-bit pixels. scripts/bench coverage

    scripts/bench coverage [--runs N] [--cache DIR]     writes bench/coverage.md

Images alone: layers on one thread, both kinds in one run of lamina_bench, which checks that they agree far from
any surface. Jobs: whole processes with and without --levels 4, in turn, where lamina jet has that option.
"""
import argparse
import json
import os
import shutil
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import jet  # noqa: E402
from measure import measured, median_of  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
TIMER = os.path.join(os.path.dirname(LAMINA), "lamina_bench")
CASES = ("crowns-96", "terrain")
MAX_RATIO = {"crowns-96": 4}  # times the time of 1 bit


def images_alone(case, parts):
    done = subprocess.run([TIMER, f"--benchmark_filter=^coverage/job/{case}$", "--benchmark_format=json"], check=True,
                          stdout=subprocess.PIPE, env=dict(os.environ, LAMINA_BENCH_PARTS=parts))
    found = json.loads(done.stdout)["benchmarks"]
    if not found or "error_message" in found[0]:
        sys.exit(f"bench: {case}: {found[0]['error_message'] if found else 'is not timed by lamina_bench'}")
    return found[0]


def jobs(case, parts, out, runs):
    """Seconds of whole jobs of 1 bit and of 4 levels; nothing if there is no such option."""
    if "--levels" not in subprocess.run([LAMINA, "jet", "--help"], check=True, stdout=subprocess.PIPE, text=True).stdout:
        return None
    part, _, bed, layer, _ = jet.CASES[case]
    found = ([], [])
    for _ in range(runs):
        for which, more in enumerate(([], ["--levels", "4"])):
            shutil.rmtree(out, ignore_errors=True)
            found[which].append(measured([LAMINA, "jet", os.path.join(parts, part), "--bed", f"{bed}x{bed}", "--dpi",
                                          str(jet.DPI), "--layer", str(layer), "--quiet", "-o", out] + more, out + ".log"))
    shutil.rmtree(out, ignore_errors=True)
    return [median_of(one) for one in found]


def verdict(case, times):
    if case not in MAX_RATIO:
        return f"{times:.1f}"
    return f"{times:.1f} (at most {MAX_RATIO[case]}: {'met' if times <= MAX_RATIO[case] else 'MISSED'})"


def main(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    parser.add_argument("--page", default=os.path.join(ROOT, "bench/coverage.md"))
    parser.add_argument("--cases", default=",".join(CASES))
    options = parser.parse_args(words)
    parts, machine = os.path.join(options.cache, "parts"), figures.machine(options.cache)
    lines = ["# Fill fractions of voxels compared with pixels", "", "Written by `scripts/bench coverage`; edits are lost.", "",
             f"Commit {figures.commit(ROOT)}. {machine['processor']}, {machine['cores']} cores, kernel {machine['kernel']}. 4 levels, 1200 dpi. Images alone: ms a "
             f"layer, one thread. Jobs: medians of {options.runs} turns, s; - where lamina jet has no --levels.", "",
             "| job | voxels with facets a layer | 1 bit | 4 levels | times | job of 1 bit | of 4 levels | times |",
             "|---|---|---|---|---|---|---|---|"]
    for case in options.cases.split(","):
        alone = images_alone(case, parts)
        whole = jobs(case, parts, os.path.join(options.cache, "coverage"), options.runs)
        cells = [f"{alone['held'] / 1e6:.2f} million", f"{alone['bitmap_ms']:.2f}", f"{alone['coverage_ms']:.2f}",
                 verdict(case, alone["times"])]
        cells += ["-", "-", "-"] if whole is None else [f"{whole[0]['wall']:.2f}", f"{whole[1]['wall']:.2f}",
                                                        verdict(case, whole[1]["wall"] / whole[0]["wall"])]
        lines.append(f"| `{case}` | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    with open(options.page, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
