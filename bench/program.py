#!/usr/bin/env python3
"""bench/program.py: what compiling and writing print programs costs, as a difference of whole jobs. scripts/bench program

    scripts/bench program [--runs N] [--layers N] [--models DIR] [--out DIR]     writes bench/program.md

Each case is planned twice with `--format null`, in turn: once with the machine, once with its bed and dpi alone. The
difference of processor seconds is the compiling and writing of the programs. The answer is checked first: a few layers are
planned with images, and `lamina verify` replays them. Raw write speed is the same bytes, in as many files at the same
place, written in pieces of 256 KiB and hashed by nothing, in the same turn. Memory: the same prism with 20 and with 2000
layers. The full bed has 100 layers (4.6 GB of programs): --layers for fewer.
"""
import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import shapes  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
BED, DPI = 400, 1200


def run(arguments, out):
    shutil.rmtree(out, ignore_errors=True)
    start = time.perf_counter()
    done = subprocess.run([LAMINA, "jet", *arguments, "--json", "--quiet", "-o", out], capture_output=True, text=True)
    wall = time.perf_counter() - start
    if done.returncode != 0:
        sys.exit(f"bench: {done.stderr}")
    return json.loads(done.stdout), wall


def processor_seconds():
    times = os.times()
    return times.children_user + times.children_system


def raw_write(folder, size, files):
    """Processor seconds of writing so many bytes into so many files, as programs lie in theirs."""
    os.makedirs(folder)
    piece = os.urandom(256 << 10)
    start = os.times()
    for number in range(files):
        left = size * (number + 1) // files - size * number // files
        with open(os.path.join(folder, str(number)), "wb", buffering=0) as file:
            while left > 0:
                left -= file.write(piece if left >= len(piece) else piece[:left])
    end = os.times()
    shutil.rmtree(folder)
    return end.user + end.system - start.user - start.system


def memory(out):
    """Peak resident MiB of 20 and of 2000 layers of the same prism."""
    prism = os.path.join(out, "prism.stl")
    shapes.write_box(prism, 20, 20, 100)
    peaks = []
    for layers in ("0:20", "0:2000"):
        summary, _ = run([prism, "--machine", "production-1200", "--margin", "0", "--layer", "0.05", "--layers", layers,
                          "--format", "null"],
                         os.path.join(out, "memory"))
        peaks.append(summary["peak_resident_bytes"] / 2**20)
        shutil.rmtree(os.path.join(out, "memory"))
    if abs(peaks[1] - peaks[0]) > 0.05 * peaks[0]:
        sys.exit(f"bench: 2000 layers take {peaks[1]:.1f} MiB, 20 take {peaks[0]:.1f}")
    return peaks


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--layers", type=int, default=100, help="of the full bed")
    parser.add_argument("--models", default=os.environ.get("LAMINA_MODELS", os.path.join(ROOT, "../shared/models")))
    parser.add_argument("--out", default="/dev/shm/lamina-bench-program")
    options = parser.parse_args(arguments)
    os.makedirs(options.out, exist_ok=True)
    box = os.path.join(options.out, "box.stl")
    shapes.write_box(box, 399.9, 399.9, 0.1 * max(10, options.layers))
    crown = os.path.join(options.models, "dental_crown.stl")
    cases = {
        "full bed": [box, "--layer", "0.1", "--layers", f"0:{options.layers}"],
        "96 crowns": [crown, "--copies", "96", "--layer", "0.1"],
    }
    bed = ["--bed", f"{BED}x{BED}", "--dpi", str(DPI)]
    machine = ["--machine", "production-1200", "--margin", "0"]
    rows = []
    for name, case in cases.items():
        check = os.path.join(options.out, "check")
        first = ["--layers", "0:2"] if name == "full bed" else ["--layers", "44:46"]
        arguments = [a for i, a in enumerate(case) if a != "--layers" and (i == 0 or case[i - 1] != "--layers")]
        run(arguments + first + machine, check)
        verified = subprocess.run([LAMINA, "verify", check], capture_output=True, text=True)
        if verified.returncode != 0:
            sys.exit(f"bench: {name}: {verified.stderr}")
        shutil.rmtree(check)
        differences, raws, peaks, data = [], [], [], {}
        for _ in range(options.runs):
            out = os.path.join(options.out, "job")
            before = processor_seconds()
            run(case + bed + ["--format", "null"], out)
            without = processor_seconds() - before
            before = processor_seconds()
            summary, _ = run(case + machine + ["--format", "null"], out)
            differences.append(processor_seconds() - before - without)
            data = summary
            peaks.append(summary["peak_resident_bytes"])
            shutil.rmtree(out)
            raws.append(raw_write(os.path.join(options.out, "raw"), summary["bytes_written"], summary["layers_planned"]))
        seconds, raw = max(statistics.median(differences), 1e-3), statistics.median(raws)
        pixels = data["columns"] * data["rows"] * data["layers_planned"]
        rows.append((name, data["layers_planned"], pixels / 1e9, data["bytes_written"] / 1e6, seconds, pixels / seconds / 1e9,
                     data["bytes_written"] / seconds / 1e9, raw / seconds, max(peaks) / 2**20))
        print("{}: {:.1f} Gpx/s a processor, {:.1f} MB at {:.2f} GB/s, {:.0%} of the raw write speed ({:.2f} GB/s)".format(
            name, rows[-1][5], rows[-1][3], rows[-1][6], rows[-1][7], rows[-1][6] / rows[-1][7]), file=sys.stderr, flush=True)
    peaks = memory(options.out)
    shutil.rmtree(options.out)
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        processor = next((l.split(":")[1].strip() for l in file if l.startswith("model name")), "unknown")
    with open(os.path.join(ROOT, "bench/program.md"), "w", encoding="utf-8") as file:
        file.write("# Print programs: compiling and writing\n\n"
                   "Written by `bench/program.py`. Profile `production-1200`: 1000 nozzles, 1200 dpi, 18,898 x 18,898 "
                   "pixels (357 Mpx) a layer, dialect planes. Processor seconds (all threads) of whole jobs with the machine "
                   "minus those without, medians; each answer was replayed by `lamina verify` first.\n\n"
                   f"{processor}, {os.cpu_count()} processors, commit {commit}, {options.runs} runs, output in memory "
                   f"({options.out.split('/')[1]}/{options.out.split('/')[2]}).\n\n"
                   "| case | layers | Gpx | written MB | processor s | Gpx/s a processor | GB/s | share of raw write speed | peak MiB |\n"
                   "|---|---|---|---|---|---|---|---|---|\n")
        for row in rows:
            file.write("| {} | {} | {:.1f} | {:.1f} | {:.2f} | {:.1f} | {:.2f} | {:.0%} | {:.0f} |\n".format(*row))
        file.write(f"\nPeak memory of a prism of 20 x 20 mm: {peaks[0]:.1f} MiB with 20 layers, {peaks[1]:.1f} MiB with 2000.\n")
        file.write("\nA full bed is bound by its bytes: every step of every sweep is a vector of 128 bytes. Parts are bound by their runs. "
                   "The raw write is `write()` of as many bytes and no more; programs are also hashed (XXH3) on their way.\n")


if __name__ == "__main__":
    main()
