#!/usr/bin/env python3
"""bench/report_page.py: pages of `lamina report` about jobs of 1,000 layers, opened in headless Chromium. scripts/bench report

    scripts/bench report [--runs N] [--models DIR] [--out DIR]     writes bench/report.md

Each job is planned (22.3 million pixels a layer), its page is written, and opened N times, each time by a Chromium that has
just started with an empty profile (tests/report/browser.py). The page's own clock (performance.now, from the begin of the
navigation) says when it was parsed, when the first layer and the views were drawn, and when that was on the screen.
The answer is checked in every run: layer 500 as the page decodes it is the TIFF of layer 500 as libtiff decodes it, the
console is empty, no network request was made, and the page has less than 20 MB. LAMINA_PROGRAM names another program.
"""
import argparse
import ctypes
import datetime
import json
import os
import shutil
import statistics
import subprocess
import sys
import time

import figures
from measure import busy_and_total, say

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
BROWSER = os.path.join(ROOT, "tests/report/browser.py")
LAYERS, LAYER = 1000, 500
MAX_BYTES, MAX_SECONDS = 20_000_000, 2.0
BED = ["--bed", "100x100", "--dpi", "1200", "--layers", f"0:{LAYERS}"]

CASES = {  # every one has 1,000 layers at least
    "one bracket of 3,476 facets": ["nist_part_feature_open.stl", "--unit", "inch", "--scale", "0.75", "--layer", "0.026"],
    "36 dental crowns of 3,878 facets": ["dental_crown.stl", "--copies", "36", "--layer", "0.0095"],
    "terrain of 645,364 facets": ["st_helens_terrain_645k.stl.gz", "--scale", "0.55", "--layer", "0.0179"],
    "9 gyroids of 246,820 facets": ["gyroid_sheet_cyl_247k.stl.gz", "--copies", "9", "--layer", "0.0239"],
}


def run(words):
    """Seconds, and what it printed; a failure ends the benchmark."""
    start = time.perf_counter()
    done = subprocess.run([LAMINA, *words], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"bench: {' '.join(words)}: {done.stderr}")
    return time.perf_counter() - start, done.stdout


def tiff_runs(path):
    """Row offsets and columns where rows change colour, as the page has them, of a 1-bit TIFF decoded by libtiff."""
    tiff = ctypes.CDLL("libtiff.so.6")
    tiff.TIFFOpen.restype = ctypes.c_void_p
    tiff.TIFFScanlineSize.restype = ctypes.c_long
    tiff.TIFFScanlineSize.argtypes = tiff.TIFFClose.argtypes = [ctypes.c_void_p]
    tiff.TIFFReadScanline.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint16]
    tiff.TIFFGetField.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p]
    file = tiff.TIFFOpen(path.encode(), b"r")
    if not file:
        sys.exit(f"bench: {path}: libtiff cannot read it")
    width, height = ctypes.c_uint32(), ctypes.c_uint32()
    tiff.TIFFGetField(file, 256, ctypes.byref(width))   # ImageWidth
    tiff.TIFFGetField(file, 257, ctypes.byref(height))  # ImageLength; the photometry is min-is-white: a set bit is jetted
    row = ctypes.create_string_buffer(tiff.TIFFScanlineSize(file))
    offsets, changes = [0], []
    for y in range(height.value):
        if tiff.TIFFReadScanline(file, row, y, 0) != 1:
            sys.exit(f"bench: {path}: libtiff cannot read row {y}")
        if any(row.raw):
            bits = bin(int.from_bytes(b"\1" + row.raw, "big"))[3:3 + width.value]
            at, colour = 0, "1"
            while (at := bits.find(colour, at)) >= 0:
                changes.append(at)
                colour = "0" if colour == "1" else "1"
            if colour == "0":
                changes.append(width.value)
        offsets.append(len(changes))
    tiff.TIFFClose(file)
    return [offsets, changes], width.value * height.value


def opened(page, runs):
    """One opening: the page's clock, after all that it must show was checked."""
    done = subprocess.run([sys.executable, BROWSER, page, str(LAYER), "--open"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"bench: {done.stderr or 'Chromium ended with ' + str(done.returncode)}")
    said = json.loads(done.stdout)
    if said["console"] or said["requests"]:
        sys.exit(f"bench: {page}: console {said['console']}, requests {said['requests']}")
    if said["runs"] != runs or said["shown"] != LAYER:
        sys.exit(f"bench: {page}: layer {LAYER} is not that of its TIFF")
    return said["clock_ms"]


def measure(name, words, options):
    out, page = os.path.join(options.out, "job"), os.path.join(options.out, "page.html")
    shutil.rmtree(out, ignore_errors=True)
    part = os.path.join(options.models, words[0])
    plan, printed = run(["jet", part, *words[1:], *BED, "--json", "--quiet", "-o", out])
    summary = json.loads(printed)
    if summary["layers_planned"] != LAYERS:
        sys.exit(f"bench: {name}: {summary['layers_planned']} layers")
    write, _ = run(["report", out, "-o", page, "--parts", part, "--quiet"])
    size = os.path.getsize(page)
    if size >= MAX_BYTES:
        sys.exit(f"bench: {name}: the page has {size} bytes")
    runs, pixels = tiff_runs(os.path.join(out, f"layers/{LAYER:06}.tif"))
    with open(page, encoding="utf-8") as file:
        held = file.read().count('<script type="text/plain" id="r')
    clocks = [opened(page, runs) for _ in range(options.runs)]
    drawn = sorted(clock["drawn"] / 1000 for clock in clocks)
    entry = {"name": name, "pixels": pixels, "runs": len(runs[1]) // 2, "plan": plan, "write": write, "bytes": size, "held": held,
             "parsed": statistics.median(clock["parsed"] for clock in clocks) / 1000,
             "loaded": statistics.median(clock["loaded"] for clock in clocks) / 1000,
             "drawn": statistics.median(drawn), "fastest": drawn[0], "slowest": drawn[-1]}
    say(f"{name}: {size / 1e6:.2f} MB, on the screen after {entry['drawn']:.2f} s ({drawn[0]:.2f} to {drawn[-1]:.2f})")
    return entry


def page_text(entries, options, about, busy):
    browser = subprocess.run(["chromium", "--version"], capture_output=True, text=True).stdout.strip().split(" built")[0]
    yield "# Pages about jobs, in a browser"
    yield ""
    yield "Written by `scripts/bench report` (`bench/report_page.py`); edits are lost."
    yield ""
    yield (f"{about['processor']}, {about['cores']} cores, {about['memory_gib']} GiB; {about['system']}, kernel {about['kernel']}, "
           f"files on {about['files_on']}; {browser}, headless, without a graphics processor. Commit {about['commit']} on "
           f"{datetime.date.today()}. Just before, other programs used {100 * busy:.0f} % of the processors.")
    yield ""
    yield (f"Jobs of {LAYERS:,} layers of {entries[0]['pixels'] / 1e6:.1f} million pixels (100 x 100 mm at 1200 dpi). Each page is opened "
           f"{options.runs} times, each time by a Chromium that has just started with an empty profile. Seconds are the page's own clock, from the "
           "begin of the navigation: until its text is parsed, until it is loaded, and until the layer in the middle, all plots and the parts "
           "from three sides are on the screen; medians, and the fastest and the slowest. Where all layers would make the page "
           "larger than 19 MB, every second one is left out (`--max-bytes`).")
    yield ""
    yield (f"In every one of these runs layer {LAYER} as the page decodes it was the TIFF of layer {LAYER} as libtiff decodes it, run for "
           "run; the console stayed empty, and no network request was made.")
    yield ""
    rows = [[e["name"], f"{e['runs']:,}", figures.seconds(e["plan"]), figures.seconds(e["write"]), f"{e['bytes'] / 1e6:.2f}",
             f"{e['held']:,}", figures.seconds(e["parsed"]), figures.seconds(e["loaded"]),
             f"{figures.seconds(e['drawn'])} ({figures.seconds(e['fastest'])} to {figures.seconds(e['slowest'])})"] for e in entries]
    yield from figures.table(["job", f"runs in layer {LAYER}", "planned, s", "page written, s", "page, MB", "layers in it", "parsed, s",
                             "loaded, s", "on the screen, s"], rows)
    slowest, largest = max(e["slowest"] for e in entries), max(e["bytes"] for e in entries)
    yield (f"Meant: below {MAX_BYTES / 1e6:.0f} MB ({'true' if largest < MAX_BYTES else 'not true'}: {largest / 1e6:.2f} MB at most), on the "
           f"screen within {MAX_SECONDS:.0f} s ({'true' if slowest <= MAX_SECONDS else 'not true'}: {slowest:.2f} s at most).")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--models", default=os.environ.get("LAMINA_MODELS", os.path.join(ROOT, "../shared/models")))
    parser.add_argument("--out", default="/dev/shm/lamina-bench-report")
    options = parser.parse_args(arguments)
    if shutil.which("chromium") is None:
        sys.exit("bench: no chromium; install Debian's")
    os.makedirs(options.out, exist_ok=True)
    before = busy_and_total()
    time.sleep(5)
    after = busy_and_total()
    busy, about = (after[0] - before[0]) / (after[1] - before[1]), figures.machine(options.out)
    about["commit"] = figures.commit(ROOT)  # before the runs: the program is of this one
    entries = [measure(name, words, options) for name, words in CASES.items()]
    shutil.rmtree(options.out)
    with open(os.path.join(ROOT, "bench/report.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(page_text(entries, options, about, busy)).rstrip() + "\n")


if __name__ == "__main__":
    main()
