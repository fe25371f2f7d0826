#!/usr/bin/env python3
"""bench/sync.py: what --sync costs: whole jobs with off, job and layer, in turn. scripts/bench sync

    scripts/bench sync [--runs N] [--cache DIR] [--out DIR]     writes bench/sync.md

Where the files lie decides: give a folder on the disk in question as --out (default: the cache). The page cache is synced
before each run, so that no run waits for another's bytes. Each kind of sync must give the same manifest.
"""
import argparse
import hashlib
import os
import shutil
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import jet  # noqa: E402
from measure import measured, median_of  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
KINDS = ("off", "job", "layer")
CASES = ("terrain", "benchy", "crowns-96")


def run(case, kind, parts, out):
    part, _, bed, layer, _ = jet.CASES[case]
    shutil.rmtree(out, ignore_errors=True)
    command = [LAMINA, "jet", os.path.join(parts, part), "--bed", f"{bed}x{bed}", "--dpi", str(jet.DPI), "--layer", str(layer),
               "--quiet", "-o", out, "--sync", kind]
    done = measured(command, out + ".log")  # after a sync of all that others have written
    with open(os.path.join(out, "manifest.json"), "rb") as file:
        return done, hashlib.sha256(file.read()).hexdigest()


def measure(case, parts, out, runs):
    runs_of, digests = {kind: [] for kind in KINDS}, set()
    for turn in range(runs):
        for kind in KINDS[turn % 3:] + KINDS[:turn % 3]:
            done, digest = run(case, kind, parts, out)
            runs_of[kind].append(done)
            digests.add(digest)
    if len(digests) != 1:
        sys.exit(f"bench: {case}: --sync changes the manifest")
    layers = os.listdir(os.path.join(out, "layers"))
    size = sum(os.path.getsize(os.path.join(out, "layers", name)) for name in layers)
    shutil.rmtree(out)
    return {kind: median_of(runs_of[kind]) for kind in KINDS}, len(layers), size


def main(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    parser.add_argument("--out", default="")
    parser.add_argument("--page", default=os.path.join(ROOT, "bench/sync.md"))
    options = parser.parse_args(words)
    parts, folder = os.path.join(options.cache, "parts"), options.out or options.cache
    machine, others = figures.machine(folder), 0
    lines = ["# What --sync costs", "", "Written by `scripts/bench sync`; edits are lost.", "", "", "",
             "| job | files | MB | off | job | layer | job, of off |", "|---|---|---|---|---|---|---|"]
    for case in CASES:
        found, layers, size = measure(case, parts, os.path.join(folder, "sync"), options.runs)
        others = max([others] + [found[kind]["others"] for kind in KINDS])
        cells = [f"{1000 * found[kind]['wall']:.0f} ({1000 * found[kind]['fastest']:.0f})" for kind in KINDS]
        share = found["job"]["wall"] / found["off"]["wall"]
        lines.append(f"| `{case}` | {layers} | {size / 1e6:.1f} | {' | '.join(cells)} | {share:.2f} |")
        print(lines[-1], flush=True)
    lines[4] = (f"{machine['processor']}, {machine['cores']} cores, kernel {machine['kernel']}, files on {machine['files_on']}. "
                f"Whole processes, ms: medians of {options.runs} turns, and the fastest. Other programs used at most "
                f"{100 * others:.0f} % of the processors.")
    with open(options.page, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
