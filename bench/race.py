"""bench/race.py: the jobs of mslicer's published benchmark, as near as they can be stated, and mslicer itself. scripts/bench race

    scripts/bench race                      ours compared with the published figures; writes bench/race.md; a minute
    scripts/bench race --mslicer PROGRAM    and mslicer's command line (`slicer`) in alternating runs, its pixels compared with ours
    --program FILE                          a lamina; else build/release/lamina, built first
    --runs N                                counted runs of a kind (default 5), alternating; --cache DIR: where parts are made

Published: three models at 50 um on 11520 x 5120 pixels, with the number of faces and of layers. The models are not to be had
under these names, so parts by formula (bench/shapes.py) of the same class stand for them: as many faces, layers and pixels.
"""
import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import mslicer  # noqa: E402
import shapes  # noqa: E402
from measure import build, measured, median_of, say  # noqa: E402

# mslicer.com/docs/benchmark, dated 2026-04-15; the figures stand in its charts (content/docs/benchmark/*-chart.svg)
SOURCE = ("[mslicer.com/docs/benchmark](https://mslicer.com/docs/benchmark), 2026-04-15 (connorslade/mslicer.com, commit 5d53d91; the figures "
          "stand in its charts, commit b085d72)")
THEIR_MACHINE = "Core Ultra 7 165H, 6 performance cores at 5 GHz"
PIXELS, DPI, LAYER = (11520, 5120), (1337, 1058), 0.05
SIZE = [count * 25.4 / dpi for count, dpi in zip(PIXELS, DPI)]  # mm; 218.85 x 122.92, of the Saturn 3 Ultra 218.88 x 122.90
# name: faces, layers as published; seconds: mslicer, the fastest of four others
PUBLISHED = {"dragon": ("Stanford Dragon", "318 k", "1.9 k", 0.146, ("Photon Workshop", 33.9)),
             "wave": ("Wave Energy", "2.6 M", "242", 0.270, ("Photon Workshop", 10.3)),
             "stress": ("Stress Test", "29 k", "2 k", 1.3, ("Photon Workshop", 51.3))}
OURS = {"dragon": "a torus knot standing 95 mm high", "wave": "a block under waves, 112 x 112 mm", "stress": "625 columns, 100 mm high"}


def make(name, path):
    """Each stands on the bed where it shall stand; triangles."""
    if name == "dragon":  # stood up, so that y of the knot, 51 mm, is the height
        tall = 95 / 51.1
        return shapes.write_knot(path, 318_000, position=lambda x, y, z: (110 + tall * x, 60 - tall * z, 47.5 + tall * y))
    if name == "wave":
        return shapes.write_waves(path, 1140, 1140, 112, 112, 12.1 / 0.9)
    return shapes.write_columns(path, 25, 12, 120, 100)


class Race:
    def __init__(self, options):
        self.options, self.work = options, os.path.join(os.path.abspath(options.cache), "race")
        os.makedirs(self.work, exist_ok=True)

    def ours(self, part, box, more):
        """The command line, and its output directory, which is empty when it starts."""
        out = os.path.join(self.work, "ours")
        shutil.rmtree(out, ignore_errors=True)
        bed = "x".join(f"{math.floor(side * 1000) / 1000:.3f}" for side in SIZE)
        at = ",".join(f"{low:.6f}" for low in box[0][:2])
        return [self.options.program, "jet", part, "--bed", bed, "--dpi", f"{DPI[0]}x{DPI[1]}", "--layer", str(LAYER), "--at", at,
                "--json", "--quiet", *more, "-o", out], out

    def theirs(self, part, box):
        goo = os.path.join(self.work, "theirs.goo")
        if os.path.exists(goo):
            os.remove(goo)
        return mslicer.command(self.options.mslicer, part, goo, SIZE, PIXELS, LAYER, box), goo

    def timing(self, part, box):
        command, _ = self.ours(part, box, ["--timing"])
        summary = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
        if (summary["columns"], summary["rows"]) != PIXELS:
            sys.exit(f"bench: {summary['columns']} x {summary['rows']} pixels, not {PIXELS}")
        return summary

    def cold(self, part, box):
        """A run whose part is not in the page cache, where the system lets go of it; None on file systems in memory."""
        with open(part, "rb") as file:
            os.fsync(file.fileno())
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        if resident_share(part) > 0.1:
            return None
        return measured(self.ours(part, box, [])[0], os.path.join(self.work, "log"))["wall"]

    def wrong_pixels(self, part, box, goo_path):
        """Of five layers of mslicer's."""
        goo, worst, whole = mslicer.Goo(goo_path), 0, 0
        layers = sorted({goo.layers * i // 10 for i in (1, 3, 5, 7, 9)})
        for layer in layers:
            command, out = self.ours(part, box, ["--format", "pbm", "--layers", f"{layer}:{layer + 1}"])
            measured(command, os.path.join(self.work, "log"))
            name = os.listdir(os.path.join(out, "layers"))[0]
            different = mslicer.different_pixels(goo, layer, os.path.join(out, "layers", name))
            worst, whole = max(worst, different), whole + different
        return {"layers": goo.layers, "compared": len(layers), "pixels": whole, "worst": worst}

    def run(self, name):
        part = os.path.join(self.work, name + ".stl")
        triangles = make(name, part)
        box, runs = mslicer.box_of(part), {"ours": [], "theirs": []}
        timings = [self.timing(part, box) for _ in range(3)]  # and the part is in the page cache
        for turn in range(self.options.runs):
            for who in (("ours", "theirs"), ("theirs", "ours"))[turn % 2]:
                if who == "ours":
                    runs[who].append(measured(self.ours(part, box, [])[0], os.path.join(self.work, "log")))
                elif self.options.mslicer:
                    command, goo = self.theirs(part, box)
                    runs[who].append(measured(command, os.path.join(self.work, "log")))
        found = {"triangles": triangles, "layers": timings[0]["layers_planned"], "ours": median_of(runs["ours"]),
                 "resident": resident_share(part),
                 "crossings": timings[0]["timing"]["limit"]["crossings"],
                 "limit": statistics.median(one["timing"]["limit"]["seconds"] for one in timings),
                 "layers_seconds": statistics.median(one["seconds"]["layers"] for one in timings)}
        if self.options.mslicer:
            found.update(theirs=median_of(runs["theirs"]), wrong=self.wrong_pixels(part, box, goo))
        found["cold"] = self.cold(part, box)
        say(f"  {name}: {found['ours']['wall']:.3f} s, processor {found['ours']['processor']:.2f} s, limit {found['limit']:.3f} s"
            + (f", mslicer {found['theirs']['wall']:.3f} s" if self.options.mslicer else ""))
        return found


def resident_share(path):
    """Of a file, in memory: by util-linux's fincore; 1 without it."""
    try:
        done = subprocess.run(["fincore", "--bytes", "--noheadings", "--output", "RES,SIZE", path], check=True, text=True,
                              stdout=subprocess.PIPE)
        resident, size = map(int, done.stdout.split())
        return resident / max(1, size)
    except (OSError, ValueError, subprocess.CalledProcessError):
        return 1.0


def page(found, others, options):
    machine = figures.machine(options.cache)
    yield "# The published race"
    yield ""
    yield "Written by `scripts/bench race` (`bench/race.py`); edits are lost."
    yield ""
    yield (f"Published: {SOURCE}; {THEIR_MACHINE}; {PIXELS[0]} x {PIXELS[1]} pixels, layers of {LAYER} mm, without anti-aliasing. The page does "
           "not say whether loading and writing count, and slicing and encoding have been two steps since v0.7. Its models are not to "
           "be had, so parts by formula with as many faces and layers stand for them: figures of different parts on different "
           "machines, in one order of magnitude at best.")
    yield ""
    yield (f"Ours: {machine['cores']} cores of {machine['processor']}, {machine['memory_gib']} GiB, {machine['system']}, commit {figures.commit(ROOT)}, "
           f"{time.strftime('%Y-%m-%d')}; files on {machine['files_on']}. Whole processes, STL to 1-bit TIFF files: reading, slicing, encoding "
           f"and writing; medians of {options.runs} runs. Exact pixels. Other programs used {100 * others:.0f} % of the processors.")
    yield ""
    rows = []
    for name, one in found.items():
        title, faces, layers, theirs, other = PUBLISHED[name]
        ours = one["ours"]
        rows.append([f"{title}: {faces} faces, {layers} layers", f"{figures.seconds(theirs)} s", f"{other[1]} s ({other[0]})",
                     f"{OURS[name]}: {one['triangles']:,} faces, {one['layers']:,} layers, {one['crossings'] / 1e6:.0f} million crossings",
                     figures.spread(ours),
                     f"{figures.seconds(ours['processor'])} s", f"{one['layers_seconds']:.3f} s", f"{ours['wall'] / one['limit']:.1f}",
                     f"{ours['peak_mib']:.0f} MiB"])
    yield from figures.table(["published job", "mslicer", "fastest of the others", "ours", "wall", "processor", "layers, in runs with `--timing`",
                              "times the limit", "peak memory"], rows)
    warm = min(one["resident"] for one in found.values())
    cold = ", ".join(f"{name} {one['cold']:.2f} s" for name, one in found.items() if one["cold"])
    yield (f"Pages: in these runs {100 * warm:.0f} % of every part was in the page cache. "
           + (f"Once with nothing of it there: {cold}." if cold else "Not measured with an empty one: this file system is memory."))
    yield ""
    if options.mslicer:
        yield from both(found, options)
    else:
        yield "mslicer itself was not run: `--mslicer PROGRAM` names its command line."


def both(found, options):
    yield (f"Alternating runs on this machine, with the same part files: {mslicer.version(options.mslicer)} to one `.goo`, and ours. Its "
           "parts are lowered by half a layer, so that it cuts in the middle too; pixels of five layers are compared (`bench/mslicer.py`).")
    yield ""
    rows = []
    for name, one in found.items():
        theirs, ours, wrong = one["theirs"], one["ours"], one["wrong"]
        rows.append([f"{OURS[name]}", figures.spread(theirs), f"{figures.seconds(theirs['processor'])} s", f"{theirs['wall'] / one['limit']:.1f}",
                     f"{theirs['peak_mib']:.0f} MiB", f"{wrong['pixels']} ({wrong['worst']} in the worst)", figures.spread(ours),
                     f"{figures.seconds(ours['processor'])} s", f"{ours['wall'] / one['limit']:.1f}", f"{ours['peak_mib']:.0f} MiB",
                     f"{theirs['wall'] / ours['wall']:.1f}"])
    yield from figures.table(["job", "mslicer", "processor", "times the limit", "peak memory", "wrong pixels of 5 layers", "ours",
                              "processor", "times the limit", "peak memory", "times as fast"], rows)


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mslicer", metavar="PROGRAM")
    parser.add_argument("--program")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    options = parser.parse_args(arguments)
    if not options.program:
        build("lamina")
        options.program = os.path.join(ROOT, "build/release/lamina")
    options.program = os.path.abspath(options.program)
    race = Race(options)
    found = {name: race.run(name) for name in PUBLISHED}
    shutil.rmtree(race.work)
    others = max(one["ours"]["others"] for one in found.values())
    text = "\n".join(page(found, others, options)).rstrip() + "\n"
    print(text)
    with open(os.path.join(ROOT, "bench/race.md"), "w", encoding="utf-8") as file:
        file.write(text)
    figures.write_readme(ROOT)
