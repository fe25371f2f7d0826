#!/usr/bin/env python3
"""bench/shares.py: how equal the shares of a batch are, by estimate and by measured processor time. scripts/bench shares

    scripts/bench shares [--models DIR] [--jobs N] [--shares N] [--work DIR]     writes bench/shares.md; 10,000 jobs take 20 min

The jobs are parts of DIR with layers of different thickness, by jet, slice and extrude. Shares run one after another, each job with
one processor. Parts of more than 4 MB are left out, and those of which a single job takes more than 5 % of a share. Costs of the
files, which are less near, are measured with at most 1,200 jobs.
"""
import argparse
import json
import os
import random
import resource
import shutil
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
from measure import models_default  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
LARGE = ("quad_knot.obj", "stanford_bunny.stl")  # seconds, by extrude
COMMANDS = ("jet --bed 300x300 --dpi 150", "jet --bed 300x300 --dpi 300", "slice", "extrude")


def write_list(path, models, count):
    """Jobs in random order of parts and thicknesses; the same every time."""
    rng = random.Random(1)
    parts = [os.path.join(models, name) for name in sorted(os.listdir(models)) if name.endswith((".stl", ".obj", ".3mf"))]
    parts = [part for part in parts if os.path.getsize(part) < 4e6 and os.path.basename(part) not in LARGE]
    with open(path, "w", encoding="utf-8") as file:
        for i in range(count):
            command, layer = rng.choice(COMMANDS), rng.choice((0.2, 0.25, 0.3)) if i % 4 else 0.2
            ending = ".gcode" if command == "extrude" else ""
            file.write(f"{command.split()[0]} '{rng.choice(parts)}' {' '.join(command.split()[1:])} --layer {layer} -o job{i}{ending}\n")


def run(words, folder):
    """Processor seconds of a call."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([LAMINA, *words], cwd=folder, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 2, 3, 5):  # a part that cannot be planned fails in the same way everywhere
        sys.exit(f"bench: lamina {' '.join(words)}: {done.stderr[-300:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def measure(options, folder, planned):
    """By estimate and by measurement: costs of the longest share / mean of the shares; seconds of the plan."""
    shutil.rmtree(os.path.join(folder, "out"), ignore_errors=True)
    plan = 0.0
    if planned:
        plan, _ = run(["batch", "jobs.txt", "-o", "out", "--plan-shares", str(options.shares), "--quiet"], folder)
    seconds = [run(["batch", "jobs.txt", "-o", "out", "--shard", f"{i}/{options.shares}", "--jobs", "1", "--quiet", "--sync", "off"],
                   folder)[0] for i in range(1, options.shares + 1)]
    sums = [0] * options.shares
    with open(os.path.join(folder, "out/shares.tsv"), encoding="utf-8") as file:
        for line in file:
            cells = line.split("\t")
            if cells[0].isdigit():
                sums[int(cells[1]) - 1] += int(cells[2])
    run(["merge", "out", "--quiet"], folder)
    with open(os.path.join(folder, "out/summary.json"), encoding="utf-8") as file:
        jobs = json.load(file)
    slowest = max(job["seconds"] for job in jobs["jobs"])
    return plan, max(sums) / (sum(sums) / len(sums)), max(seconds) / (sum(seconds) / len(seconds)), sum(seconds), slowest, jobs


def main(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--jobs", type=int, default=240)
    parser.add_argument("--shares", type=int, default=4)
    parser.add_argument("--work", default=os.path.join(ROOT, "build/bench/shares"))
    parser.add_argument("--page", default=os.path.join(ROOT, "bench/shares.md"))
    options = parser.parse_args(words)
    os.makedirs(options.work, exist_ok=True)
    machine = figures.machine(options.work)
    where = (f"{machine['processor']}, {machine['cores']} cores, {machine['system']}, files on {machine['files_on']}, "
             f"commit {figures.commit(ROOT)}.")
    lines = ["# Shares of a batch, measured", "", "Written by `scripts/bench shares`; edits are lost.", "", where, "",
             f"Jobs of real parts in {options.shares} shares. The ratio is that of the longest share to the mean; measured are processor",
             "seconds of one process per share.", "",
             "| costs | ratio by cost | ratio measured | all shares | plan | slowest job | jobs done |", "|---|---|---|---|---|---|---|"]
    for name, planned in (("of dry runs", True), ("of the files", False)):
        count = options.jobs if planned else min(options.jobs, 1200)
        write_list(os.path.join(options.work, "jobs.txt"), os.path.abspath(options.models), count)
        plan, estimated, measured, total, slowest, jobs = measure(options, options.work, planned)
        lines.append(f"| {name} | {estimated:.3f} | {measured:.3f} | {total:.1f} s | {plan:.1f} s | {slowest:.1f} s | {jobs['done']} of {jobs['jobs_total']} |")
        print(lines[-1], flush=True)
    with open(options.page, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
