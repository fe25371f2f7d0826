#!/usr/bin/env python3
"""bench/stream.py: MB/s of print programs through a pipe, next to `cat` of the expanded program. Writes bench/stream.md.

    scripts/bench stream [LAMINA] [--layers 1000] [--folder DIR]    default: build/release/lamina, a folder of TMPDIR

The reader counts bytes and discards them. One more run of each compares them with the concatenated files of the job without
compression. --consume gets a copy of the job. Medians of 5 runs, alternating; the slowest is of stream without --consume.
Exit code 1 if a program differs, a consumed layer remains, or a rate is below 200 MB/s.
"""
import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import figures
import shapes

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PROFILE = """[machine]
name = "printer"
dialect = "{}"
[bed]
size_mm = [400, 300]
build_height_mm = 500
[head]
nozzles = 1000
pitch_um = 63.5
drop_pl = 85
[powder]
packing = 0.6
"""


def rate(words):
    """MB/s and bytes of what a call writes to a pipe."""
    buffer = bytearray(1 << 20)
    began, size = time.monotonic(), 0
    with subprocess.Popen(words, stdout=subprocess.PIPE) as process:
        while count := os.readv(process.stdout.fileno(), [buffer]):
            size += count
    if process.returncode != 0:
        sys.exit(f"bench: {' '.join(words)}: exit code {process.returncode}")
    return size / 1e6 / (time.monotonic() - began), size


def measure(lamina, work, dialect, compress, layers):
    """A row of the table, and whether it is within the limits."""
    job, whole, copy = (os.path.join(work, name) for name in ("job", "whole", "copy"))
    profile = os.path.join(work, "machine.toml")
    with open(profile, "w", encoding="ascii") as file:
        file.write(PROFILE.format(dialect))
    plan = [lamina, "jet", os.path.join(work, "part.stl"), "--machine", profile, "--layer", str(117.5 / layers), "--quiet", "--overwrite", "-o", job]
    subprocess.run([*plan, "--set", "program.compress=false"], check=True)
    folder = os.path.join(job, "program")
    names = sorted(name for name in os.listdir(folder) if name != "machine.toml")
    with open(whole, "wb") as file:
        for name in [f"start.{dialect}", *(name for name in names if name[0] == "0"), f"end.{dialect}"]:
            with open(os.path.join(folder, name.replace(dialect, names[0].split(".")[1])), "rb") as part:
                shutil.copyfileobj(part, file)
    if compress:
        subprocess.run(plan, check=True)
    with subprocess.Popen([lamina, "stream", job, "--quiet"], stdout=subprocess.PIPE) as process:
        same = subprocess.run(["cmp", "-", whole], stdin=process.stdout, check=False).returncode == 0
    rates = {"cat": [], "stream": [], "consume": []}
    for _ in range(5):
        shutil.copytree(job, copy, copy_function=os.link)
        rates["cat"].append(rate(["cat", whole])[0])
        for name, words in (("stream", [job]), ("consume", [copy, "--consume"])):
            mbs, size = rate([lamina, "stream", "--quiet", *words])
            same &= size == os.path.getsize(whole)
            rates[name].append(mbs)
        same &= not os.listdir(os.path.join(copy, "layers"))
        shutil.rmtree(copy)
    cat, stream, consume = (statistics.median(rates[name]) for name in ("cat", "stream", "consume"))
    kind = dialect + (", compressed" if compress else "")
    row = (f"| {kind} | {os.path.getsize(whole) / 1e9:.2f} | {layers} | {cat:.0f} | {stream:.0f} | {stream / cat:.2f} | {min(rates['stream']):.0f} | "
           f"{consume:.0f} | {consume / cat:.2f} | {'yes' if same else 'NO'} |\n")
    return row, same and min(stream, consume) >= 200


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lamina", nargs="?", default=os.path.join(ROOT, "build/release/lamina"))
    parser.add_argument("--layers", type=int, default=1000)
    parser.add_argument("--folder", default=None)
    chosen = parser.parse_args(arguments)
    load, good = os.getloadavg()[0], True
    text = "# Programs through a pipe, measured\n\n" + __doc__.split("\n\n", 2)[2].strip().rsplit("\nExit code", 1)[0] + "\n\n"
    facts = figures.machine(chosen.folder or tempfile.gettempdir())
    text += (f"{facts['processor']}, {facts['cores']} cores, {facts['system']}, files on {facts['files_on']}, load {load:.1f} before, commit "
             f"{figures.commit(ROOT)}.\n\n| program | GB | layers | cat, MB/s | stream, MB/s | of cat | slowest | --consume, MB/s | of cat | same bytes |\n"
             "|---|---|---|---|---|---|---|---|---|---|\n")
    with tempfile.TemporaryDirectory(dir=chosen.folder) as work:
        shapes.write_knot(os.path.join(work, "part.stl"), 4800, 5)
        for dialect, compress in (("planes", True), ("planes", False), ("raw", True), ("nuferbj", False)):
            row, within = measure(os.path.abspath(chosen.lamina), work, dialect, compress, chosen.layers)
            print(row, end="", file=sys.stderr, flush=True)
            text, good = text + row, good and within
    with open(os.path.join(ROOT, "bench/stream.md"), "w", encoding="utf-8") as file:
        file.write(text)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main(sys.argv[1:])
