#!/usr/bin/env python3
"""bench/containers.py: a batch with a ZIP file per job (--container zip) next to one with directories. Writes bench/containers.md.

    scripts/bench containers [LAMINA] [--models DIR] [--jobs 200] [--kills 50] [--runs 3]

The jobs are those of scripts/compare_batch: the part files of DIR, broken ones too, in rounds of other angles. Python's zipfile reads
every archive, tests its sums and compares each file with that of the directory; `unzip -t` tests them where it is installed. Then the
batch is killed (SIGKILL) at random moments and continued with --resume. Exit code 1 if anything differs.
"""
import argparse
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import time
import zipfile

import figures
from measure import ROOT, models_default

OWN = ("batch.jsonl", "summary.json", "summary.tsv")


def write_list(path, models, count):
    files = sorted(os.path.join(base, name) for base, _, names in os.walk(models) for name in names
                   if name.endswith((".stl", ".obj", ".3mf", ".gz")))
    with open(path, "w", encoding="utf-8") as out:
        for i in range(count):
            out.write(f"jet '{files[i % len(files)]}' --bed 600x600 --dpi 300 --layer 0.2 --rotate 0,0,{i // len(files) * 30} -o {i}\n")


def run(lamina, words):
    """Seconds. Broken parts of the list make exit code 3."""
    began = time.monotonic()
    code = subprocess.run([lamina, *words], stderr=subprocess.DEVNULL, check=False).returncode
    if code not in (0, 3):
        sys.exit(f"bench: exit code {code} of: {' '.join(words)}")
    return time.monotonic() - began


def files_of(folder):
    return sorted(os.path.relpath(os.path.join(base, name), folder) for base, _, names in os.walk(folder) for name in names
                  if not (base == folder and name in OWN))


def compare(plain, packed):
    """Files that differ from those of the directories, of all, and archives that unzip refuses."""
    wrong, entries = 0, 0
    archives = [name for name in files_of(packed) if name.endswith(".zip")]
    left = set(files_of(plain))
    for name in archives:
        with zipfile.ZipFile(os.path.join(packed, name)) as archive:
            wrong += archive.testzip() is not None
            for entry in archive.namelist():
                path = os.path.join(name[:-4], entry)
                entries += 1
                left.discard(path)
                with open(os.path.join(plain, path), "rb") as file:
                    wrong += file.read() != archive.read(entry)
    refused = 0
    if shutil.which("unzip"):
        refused = sum(subprocess.run(["unzip", "-tqq", os.path.join(packed, name)], check=False, stdout=subprocess.DEVNULL).returncode != 0
                      for name in archives)
    return wrong + len(left), entries, len(archives), refused


def kill_often(lamina, words, seconds, kills):
    """Continues a batch after each kill until so many hit it. returns  kills"""
    draw, landed = random.Random(5), 0
    while landed < kills:
        process = subprocess.Popen([lamina, *words, "--resume"], stderr=subprocess.DEVNULL)
        try:
            process.wait(timeout=draw.uniform(0, 1.5 * seconds / kills))
            shutil.rmtree(words[words.index("-o") + 1])  # finished before the kill: another one begins
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            landed += 1
    return landed


def main(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lamina", nargs="?", default=os.path.join(ROOT, "build/release/lamina"))
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--jobs", type=int, default=200)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--work", default=os.path.join(ROOT, "build/bench/containers"))
    options = parser.parse_args(words)
    lamina, load = os.path.abspath(options.lamina), os.getloadavg()[0]
    shutil.rmtree(options.work, ignore_errors=True)
    os.makedirs(options.work)
    listed, plain, packed, killed = (os.path.join(options.work, name) for name in ("jobs.txt", "plain", "packed", "killed"))
    write_list(listed, os.path.abspath(options.models), options.jobs)
    kinds = {plain: [], packed: ["--container", "zip"]}
    times = {plain: [], packed: []}
    for _ in range(options.runs):
        for folder, more in kinds.items():
            os.sync()
            times[folder].append(run(lamina, ["batch", listed, "-o", folder, "--quiet", "--overwrite", *more]))
    seconds = {folder: statistics.median(all_of) for folder, all_of in times.items()}
    wrong, entries, archives, refused = compare(plain, packed)
    verified = subprocess.run([lamina, "verify", packed, "--quiet"], check=False).returncode
    again = ["batch", listed, "-o", killed, "--quiet", "--container", "zip"]
    kills = kill_often(lamina, again, seconds[packed], options.kills)
    run(lamina, [*again, "--resume"])
    differ = len(set(files_of(killed)) ^ set(files_of(packed)))
    for name in files_of(packed):
        with open(os.path.join(packed, name), "rb") as one, open(os.path.join(killed, name), "rb") as other:
            differ += one.read() != other.read()
    machine = figures.machine(options.work)
    text = "# Containers, measured\n\nWritten by `scripts/bench containers`; edits are lost.\n\n"
    text += f"{machine['processor']}, {machine['cores']} cores, {machine['system']}, files on {machine['files_on']}, load {load:.1f} before, "
    text += f"commit {figures.commit(ROOT)}.\n\n| | directories | ZIP files |\n|---|---|---|\n"
    text += f"| files of {options.jobs} jobs | {len(files_of(plain)):,} | {len(files_of(packed)):,} |\n"
    text += f"| seconds, median of {options.runs} | {seconds[plain]:.1f} | {seconds[packed]:.1f} |\n\n"
    text += f"- {wrong} of {entries:,} files differ (Python's zipfile); `unzip -t` refuses {refused} of {archives} archives.\n"
    text += f"- `lamina verify`: exit code {verified}.\n- After {kills} kills and --resume, {differ} archives differ.\n"
    print(text)
    with open(os.path.join(ROOT, "bench/containers.md"), "w", encoding="utf-8") as file:
        file.write(text)
    shutil.rmtree(options.work)
    sys.exit(1 if wrong or refused or verified or differ else 0)


if __name__ == "__main__":
    main(sys.argv[1:])
