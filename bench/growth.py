"""bench/growth.py: how time and memory of jobs grow with their size, and what more cores could give. scripts/bench growth

    scripts/bench growth                writes bench/growth.md and the slopes in bench/README.md; about fifteen minutes on two cores
    scripts/bench growth --only NAME    this series only (can be repeated); no page is written. Names: triangles, layers, pixels, copies,
                                        meshes, threads of 1-bit jobs; PRODUCT-SIZE as in levels-copies; batch-jobs; overlaps-info,
                                        overlaps-near, overlaps-jet; pages-info, pages-convert, pages-jet: of a multi-page TIFF
    --keep                              with --only: these series replace those of the page, which names their commit
    --program FILE                      a lamina; else build/release/lamina, built first
    --runs N                            runs of a job; the minimum counts (default 3)
    --max TRIANGLES                    the largest part (default 10 million); --cache, --models: the parts of scripts/bench

Parts are made by formula (bench/shapes.py); in a series all is equal but one thing. The slope is that of least squares in
log-log over the upper two decades, of what a job takes beyond the smallest of its series against what it has beyond that one:
1 is linear, regardless of the fixed cost of a job. Jobs count that take twice the smallest at least, where there are three of them;
else those that take a tenth more; what never does is flat.
Exit 1 if a slope of processor time or memory is above 1.1: a term is worse than linear.
"""
import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import growth_page  # noqa: E402
import shapes  # noqa: E402
from amdahl import shares_of_parts  # noqa: E402
from measure import build, busy_and_total, models_default, say, started  # noqa: E402

STEEPEST = 1.1
BED, LARGE_BED = ["--bed", "100x100"], ["--bed", "400x400"]
GAP = ["--gap", "0.5"]  # of several parts


def powers(first, last):
    """1, 2, 5, 10 ... from first to last, both included."""
    values = [base * 10**e for e in range(12) for base in (1, 2, 5)]
    return [value for value in values if first <= value <= last]


# Options of each product, and the sizes that a series varies. `slice` and `extrude` have no pixels.
PRODUCTS = {
    "levels": ("jet", ["--levels", "4"], ["copies", "layers", "triangles", "pixels"]),
    "dither": ("jet", ["--core", "0.7"], ["copies", "layers", "triangles", "pixels"]),
    "program": ("jet", ["--machine", "production-1200", "--margin", "0", "--saturation", "70"], ["copies", "layers", "triangles"]),
    "fill": ("jet", ["--fill", "raster", "--walls", "2", "--bead", "0.2"], ["copies", "layers", "triangles", "pixels"]),
    "inspect": ("jet", ["--inspect"], ["copies", "layers", "triangles", "pixels"]),
    "slice": ("slice", [], ["copies", "layers", "triangles"]),
    "extrude": ("extrude", ["--machine", "anet-a8", "--fill", "raster", "--walls", "2"], ["copies", "layers", "triangles"]),
}
# Of products: 1-bit jobs go further.
MAX_SIZE = {"copies": 10_000, "layers": 3000, "triangles": 1e6, "pixels": 10_000}
MAX_COPIES = {"extrude": 2000, "fill": 3000}


class Jobs:
    """Command lines of the jobs of all series; parts are made when they are needed."""

    def __init__(self, work, maximum):
        self.work, self.maximum = work, maximum

    def path(self, name):
        return os.path.join(self.work, name)

    def knot(self, triangles):
        path = self.path(f"knot{triangles}.stl")
        if not os.path.exists(path):
            shapes.write_knot(path, triangles)
        return path, shapes.knot_size(triangles)

    def series(self, name):
        """Pairs of a size and the words of its job."""
        if name == "batch-jobs":
            yield from self.batch()
        elif name.startswith("pages-"):
            yield from self.pages(name.split("-")[1])
        elif name.startswith("overlaps"):
            yield from self.overlaps(name)
        elif "-" not in name:
            for x, words in getattr(self, name)():
                yield x, ["jet", *words]
        else:
            product, size = name.split("-")
            command, options, _ = PRODUCTS[product]
            for x, words in getattr(self, size)():
                if x > min(MAX_SIZE[size] ** (2 if size == "pixels" else 1), MAX_COPIES.get(product, 1e9) if size == "copies" else 1e9):
                    break
                if name == "program-layers":
                    # 70 % in the last job: so that all layers have as many drops.
                    options = [*options[:-1], f"{70 * x / 2000:g}"]
                if command != "jet" or "--machine" in options:
                    words = without(words, "--dpi", *(["--bed"] if "--machine" in options else []))
                yield x, [command, *words, *options]

    def triangles(self):
        """Decades and their thirds of triangles; 236 layers of 22 million pixels."""
        for wanted in [1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7]:
            if wanted > self.maximum:
                break
            path, (around, along) = self.knot(int(wanted))
            yield 2 * around * along, [path, *BED, "--dpi", "1200", "--layer", "0.1"]
            os.remove(path)

    def layers(self):
        """Of one part of 100,000 triangles, 5.6 million pixels each."""
        path, _ = self.knot(100_000)
        for count in powers(100, 10_000):
            yield count, [path, *BED, "--dpi", "600", "--layer", f"{math.ceil(23.6e6 / count) / 1e6:.6f}"]

    def pixels(self):
        """Of each of 100 layers of the same part on the same bed."""
        path, _ = self.knot(100_000)
        for side in (1000, 1400, 2000, 3200, 4500, 6300, 10_000, 14_000, 20_000):
            yield side * side, [path, *BED, "--dpi", str(math.floor(side * 25.4 / 100)), "--layer", "0.236"]

    def copies(self):
        """Copies of one part of 1,000 triangles on the same bed, 20 layers of 89 million pixels."""
        path = self.path("small.stl")
        shapes.write_knot(path, 1000, 0.05)
        for count in powers(1, 10_000):
            yield count, [path, *LARGE_BED, "--dpi", "600", "--layer", "0.06", *GAP[:2 * (count > 1)], "--copies", str(count)]

    def meshes(self):
        """Different files of 1,000 triangles each, no two of one size, on the same bed, 20 layers of 89 million pixels."""
        paths = []
        for count in powers(1, 1000):
            while len(paths) < count:
                paths.append(self.path(f"mesh{len(paths)}.stl"))
                shapes.write_knot(paths[-1], 1000, 0.05 - 0.01 * len(paths) / 1000)
            yield count, [*paths, *LARGE_BED, "--dpi", "600", "--layer", "0.06", *GAP[:2 * (count > 1)]]

    def overlaps(self, name):
        """Items of a 3MF build at one position: `info` and `jet`. Each 1 um from another one: `info`."""
        information, step = name != "overlaps-jet", 0.001 if name == "overlaps-near" else 0
        for count in [100, 200, 400, 800, 1600, 3200] if information else powers(100, 500_000):
            path = self.path("overlaps.3mf")
            shapes.write_items(path, count, step)
            yield count, ["info", path] if information else ["jet", path, *BED, "--dpi", "600", "--layer", "0.5"]

    def threads(self):
        """Of knot800k's job."""
        path, _ = self.knot(800_000)
        cores = len(os.sched_getaffinity(0))
        for count in sorted({1, 2, *(c for c in (4, 8, 16, 32, 64) if c < cores), cores}):
            yield count, [path, *BED, "--dpi", "1200", "--layer", "0.05", "--threads", str(count)]

    def pages(self, command):
        """Pages of one TIFF, 512 x 512 pixels each."""
        path, options = self.path("pages.tif"), {"jet": ["--dpi", "600", "--layer", "0.1"]}
        for count in (500, 1000, 2000, 4000):
            shapes.write_pages(path, count)
            yield count, [command, path, *options.get(command, [])]

    def batch(self):
        """Dry runs of a small part, in one list."""
        cube, jobs = self.path("cube.stl"), self.path("jobs.txt")
        shapes.write_box(cube, 2, 2, 2)
        for count in powers(100, 100_000):
            with open(jobs, "w", encoding="utf-8") as file:
                file.writelines(f"jet {cube} --bed 20x20 --dpi 100 --layer 0.5 --dry-run -o {number}\n" for number in range(count))
            yield count, ["batch", jobs]


def without(words, *options):
    """The words without these options and their values."""
    return [word for i, word in enumerate(words) if word not in options and (i == 0 or words[i - 1] not in options)]


SERIES = ["triangles", "layers", "pixels", "copies", "meshes", "threads",
          *(f"{product}-{size}" for product, (_, _, sizes) in PRODUCTS.items() for size in sizes), "batch-jobs",
          "overlaps-info", "overlaps-near", "overlaps-jet", "pages-info", "pages-convert", "pages-jet"]
MEASURES = ["wall", "processor", "peak"]


def run_job(options, words, work):
    """The least wall seconds, processor seconds and peak bytes of the runs: what comes from elsewhere only adds. The first run
    only warms up where it is short."""
    out, runs = os.path.join(work, "out"), []

    def once():
        shutil.rmtree(out, ignore_errors=True)
        for name in os.listdir(work):
            if name.startswith("out."):
                os.remove(os.path.join(work, name))
        output = [] if words[0] == "info" else ["--quiet", "-o", out + ".gcode" if words[0] == "extrude" else out]
        return started([options.program, *words, *output])

    first = once()
    runs = [first] if first[0] > 2 else []
    while len(runs) < options.runs:
        runs.append(once())
    layers = len(os.listdir(os.path.join(out, "layers"))) if words[0] == "jet" else 0
    shutil.rmtree(out, ignore_errors=True)
    return dict(zip(MEASURES, (min(column) for column in zip(*runs))), layers=layers)


def slope(entries, measure):
    """Of what a job takes beyond the first against what it has beyond it, over the upper two decades; None: flat."""
    start, zero = entries[0][measure], entries[0]["x"]

    def points_beyond(times):
        return [(math.log(entry["x"] - zero), math.log(entry[measure] - start)) for entry in entries[1:]
                if entry["x"] >= entries[-1]["x"] / 100 and entry[measure] > times * start]

    points = points_beyond(2)
    if len(points) < 3:
        points = points_beyond(1.1)
    if len(points) < 2:
        return None
    mean_x, mean_y = (sum(column) / len(points) for column in zip(*points))
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)


def measure_series(name, options, work):
    entries = []
    for x, words in Jobs(work, options.max).series(name):
        entry = dict(run_job(options, words, work), x=x)
        say(f"  {name} {x:>11,}: {entry['wall']:7.3f} s, processor {entry['processor']:7.3f} s, "
            f"{entry['peak'] / 2**20:7.1f} MiB")
        entries.append(entry)
    # Threads are no size of a job: their slope has no limit.
    slopes = {} if name == "threads" else {measure: slope(entries, measure) for measure in MEASURES}
    return {"entries": entries, "slopes": slopes}


def too_steep(series):
    """Growth worse than linear, as sentences. Wall time also depends on other programs on the machine, so it is not checked."""
    return [f"{measure} of {name}: slope {found['slopes'][measure]:.2f}" for name, found in series.items()
            for measure in ("processor", "peak") if (found["slopes"].get(measure) or 0) > STEEPEST]


def read_options(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=[*SERIES, "shares"])
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--program")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--max", type=float, default=1e7)
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    options = parser.parse_args(arguments)
    if not options.program:
        build("lamina")
        options.program = os.path.join(ROOT, "build/release/lamina")
    options.program = os.path.abspath(options.program)
    return options


def kept_with(record, found):
    """A record of all series in which those that were measured again replace the others."""
    measured = {name: dict(series, commit=found["commit"], date=found["date"]) for name, series in found["series"].items()}
    whole = {**record["series"], **measured}
    return dict(record, series={name: whole[name] for name in SERIES if name in whole})


def main(arguments):
    options = read_options(arguments)
    names, before, begun = options.only or [*SERIES, "shares"], busy_and_total(), os.times()
    commit = figures.commit(ROOT)  # before the runs: the program is of this one
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as work:
        series = {}
        for name in SERIES:
            if name in names:
                say(f"bench: growth with {name}")
                with tempfile.TemporaryDirectory(dir=work) as position:
                    series[name] = measure_series(name, options, position)
        shares = {}
        if "shares" in names:
            subprocess.run([sys.executable, os.path.join(ROOT, "bench/make_parts.py"), options.models,
                            os.path.join(os.path.abspath(options.cache), "parts"), "--made"], check=True)
            shares = shares_of_parts(options.program, os.path.join(os.path.abspath(options.cache), "parts"), work)
    after, ended = busy_and_total(), os.times()
    own = sum(ended[:4]) - sum(begun[:4])
    found = {"series": series, "shares": shares, "steepest": STEEPEST, "commit": commit,
             "date": time.strftime("%Y-%m-%d"), "machine": figures.machine(options.cache), "runs": options.runs,
             "others": max(0.0, after[0] - before[0] - own) / (after[1] - before[1])}
    if options.only and options.keep:
        found = kept_with(figures.load(ROOT, "growth"), found)
    steep = found["worse"] = too_steep(found["series"])
    text = "\n".join(growth_page.lines(found)).rstrip() + "\n"
    print(text)
    if not options.only or options.keep:
        figures.save(ROOT, "growth", found)
        with open(os.path.join(ROOT, "bench/growth.md"), "w", encoding="utf-8") as file:
            file.write(text)
        figures.write_readme(ROOT)
    if steep:
        sys.exit("bench: worse than linear: " + "; ".join(steep))
