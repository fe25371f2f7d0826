"""bench/real.py: jobs as shops run them, each as a multiple of its plain 1-bit job, against an older build. scripts/bench real OLD

    scripts/bench real OLD                 OLD is a program such as an older build/release/lamina; writes bench/real.md
    scripts/bench real OLD --row NAME      this row only (can be repeated); the page is left alone
    --new PROGRAM                          what is compared; else build/release/lamina, built first
    --runs N                               counted runs of a kind (default 5)
    --cache DIR --models DIR               where parts are made (default: build/bench), and from what

A row has kinds of runs: the job, what it is compared with, and the job of the older build. Each kind runs once, and the answers are
compared before any clock starts: pixels of images by decoding, print programs by their expanded bytes and `lamina verify`, texts byte
by byte. Then kinds take turns, in an order that turns with the round. Printed are medians; the ratio is that of processor seconds,
which other programs on the machine disturb least, and of wall seconds. Outputs are in memory (/dev/shm) where there is one.
Jobs of the older build that take more than a minute run once. Exit 1 if a row misses its target.
"""
import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import real_page  # noqa: E402
import shapes  # noqa: E402
from measure import build, busy_and_total, models_default, say, started  # noqa: E402
from real_answers import same_answer  # noqa: E402

LONG = 60  # wall seconds of a run that is not repeated


class Row:
    """One line of the page.

    job        words after the program; OUT is the output, PART:name a part, AT:name its position on its bed
    unit       words of the job that it is a multiple of
    measure    processor, wall, peak or bytes: what the target limits
    target     times the unit; without a unit, the unit of `measure` itself: seconds, MiB
    answer     how answers are compared (real_answers.py)
    """

    def __init__(self, name, about, job, unit=None, target=None, goal=None, measure="processor", answer="images", first=(), old=True):
        self.name, self.about, self.job, self.unit, self.target, self.goal = name, about, job, unit, target, goal
        self.measure, self.answer, self.first, self.old = measure, answer, first, old


PLATE = "jet PART:crowns96.stl --bed 400x400 --dpi 1200 --layer 0.1 --at AT:crowns96.stl -o OUT"
PLATE20 = PLATE.replace("0.1 ", "0.48 ")
MACHINE20 = "jet PART:crowns96.stl --machine production-1200 --margin 0 --layer 0.48 --at AT:crowns96.stl -o OUT"
MACHINE96 = MACHINE20.replace("0.48", "0.1")
BENCHY = "jet PART:benchy15.stl --bed 100x100 --dpi 1200 --layer 0.1 --at AT:benchy15.stl -o OUT"
PLATE72 = "jet PART:benchies72.stl --bed 400x400 --dpi 1200 --layer 0.1 --at AT:benchies72.stl -o OUT"
SMALL = "PART:small.stl --bed 400x400 --gap 0.5 --layer 0.06"


def rows():
    dithered = MACHINE20 + " --saturation 70"
    yield Row("saturation", "`--saturation 70`, plate of 96 on production-1200, 20 layers", dithered, MACHINE20, 7, 4, answer="program")
    yield Row("saturation-memory", "the same, peak memory in MiB", dithered, None, 150, measure="peak", answer="program")
    yield Row("saturation-bytes", "the same, bytes written against the older build", dithered, None, 1 / 40, 1 / 80, "bytes", "program")
    yield Row("saturation-threads", "the same, one thread against two", dithered + " --threads 1", dithered + " --threads 2", -1.8,
              measure="wall", answer="program", old=False)
    yield Row("levels-plate", "`--levels 4`, plate of 96", PLATE + " --levels 4", PLATE, 8, 5)
    yield Row("levels-benchy", "`--levels 4`, 3DBenchy x 1.5", BENCHY + " --levels 4", BENCHY, 8, 5)
    yield Row("levels-faces", "`--levels 4`, the plate with horizontal faces at mid-layer, against the plate without",
              PLATE.replace("crowns96", "crowns96_tie") + " --levels 4", PLATE + " --levels 4", 1.3, 1.1)
    pins = "jet PART:pins.stl --bed 100x100 --dpi 1200 --layer 0.1 --levels 4 --at AT:pins.stl -o OUT"
    yield Row("levels-pins", "`--levels 4`, 6,400 square pins on a face at mid-layer, against a face 7 um higher",
              pins.replace("pins", "pins_tie"), pins, 1.5)
    tiff = PLATE20 + " --levels 16 --format tiff-8"
    yield Row("levels-tiff", "`--levels 16 --format tiff-8`, plate of 96, 20 layers", tiff, PLATE20, 12)
    yield Row("levels-tiff-memory", "the same, peak memory in MiB", tiff, None, 40, measure="peak")
    copies = f"jet {SMALL} --dpi 600 --copies 10000 --levels 4 -o OUT"
    yield Row("levels-threads", "`--levels 4`, 10,000 copies, one thread against two", copies + " --threads 1", copies + " --threads 2", -1.8,
              measure="wall", old=False)
    yield Row("fill", "`--fill raster --walls 2`, plate of 96, 20 layers", PLATE20 + " --fill raster --walls 2", PLATE20, 10, 6)
    filled = f"jet {SMALL} --dpi 600 --fill raster --walls 1 --copies "
    yield Row("fill-copies", "`--fill raster`, 3,000 copies against 1,000", filled + "3000 -o OUT", filled + "1000 -o OUT", 3.3)
    yield Row("shell", "`--shell 1 --core 0.5`, plate of 96, 20 layers", PLATE20 + " --shell 1 --core 0.5", PLATE20, 8, 5)
    copies = f"slice {SMALL} --copies "
    yield Row("slice-copies", "`slice`, 10,000 copies, seconds", copies + "10000 -o OUT", None, 1.2, 0.8, "wall", "files")
    for part, about in (("benchy15", "3DBenchy x 1.5"), ("crowns96", "plate of 96"), ("terrain", "terrain")):
        bed = "400x400" if part == "crowns96" else "100x100"
        job = f"jet PART:{part}.stl --bed {bed} --dpi 1200 --layer 0.1 --at AT:{part}.stl -o OUT"
        yield Row(f"inspect-{part}", f"`--inspect`, {about}", job + " --inspect", job, 2.5)
    dither = "jet PART:crowns96.stl --bed 400x400 --dpi 1200 --layer 0.48 --at AT:crowns96.stl --saturation 70 --layers 5:6 --format png -o IN"
    image = [dither]
    for name, job in (("jet", "jet IN/layers/000005.png --bed 400x400 --dpi 1200 --layer 0.48 -o OUT --memory 64M"),
                      ("convert", "convert IN/layers/000005.png --format tiff-g4 -o OUT --memory 64M"),
                      ("info", "info IN/layers/000005.png --memory 64M"), ("preview", "preview IN -o OUT.png --memory 64M"),
                      ("report", "report IN -o OUT.html --memory 64M")):
        yield Row(f"image-{name}", f"`{name}` of a dithered image of 357 megapixels, peak memory in MiB", job, None, 256, measure="peak",
                  first=image, answer="images" if name in ("jet", "convert") else "files")
    yield Row("report", "`report` of 480 full-bed layers", "report IN -o OUT.html", PLATE72, 2, 1, first=[PLATE72.replace("OUT", "IN")],
              answer="page")
    yield Row("verify", "`verify` with replay, plate of 96 on production-1200, 96 layers", "verify IN", MACHINE96, 4, 2,
              first=[MACHINE96.replace("OUT", "IN")], answer="none")
    for part in ("knot800k", "benchies72", "scan680k"):
        dry = f"jet PART:{part}.stl --bed 400x400 --dpi 1200 --layer 0.1 --dry-run -o OUT"
        yield Row(f"info-{part}", f"`info` of {part}, against a dry run", f"info PART:{part}.stl", dry, 3, 2, answer="text")
        yield Row(f"info-{part}-memory", "the same, peak memory", f"info PART:{part}.stl", dry, 1.2, measure="peak", answer="text")
    for command in ("slice PART:benchies72.stl --bed 400x400 --layer 0.1 -o OUT",
                    "heights PART:benchies72.stl --layer 0.1 -o OUT.csv --format csv",
                    "export PART:benchies72.stl --bed 400x400 -o OUT.stl", "info PART:benchies72.stl"):
        name = command.split()[0]
        yield Row(f"{name}-memory", f"`{name}` of 811 MB, peak memory in MiB", command, None, 330, measure="peak",
                  answer="text" if name == "info" else "files")
    yield Row("batch", "100,000 batch jobs, peak memory in MiB", "batch PART:jobs.txt -o OUT --keep-going", None, 100, measure="peak",
              answer="none", old=False)
    cube = "jet PART:cube.stl --bed 100x100 --dpi 600 --layer 0.1 -o OUT"
    yield Row("dither-fixed", "dithered 10-layer cube, milliseconds above the plain one", cube + " --saturation 70", cube, 10, measure="above")
    for name, job in (("crowns-96", PLATE), ("benchy", BENCHY), ("crowns-96-machine", MACHINE96)):
        yield Row(f"one-bit-{name}", f"1-bit job {name}, against the older build", job, None, 1.02, measure="older",
                  answer="program" if "machine" in name else "images")


class Real:
    def __init__(self, options, work):
        self.options, self.work = options, work
        self.parts = os.path.join(os.path.abspath(options.cache), "parts")
        with open(os.path.join(self.parts, "parts.json"), encoding="utf-8") as file:
            self.positions = {name: part["at_nm"] for name, part in json.load(file).items()}
        self.inputs = {}

    def part(self, name):
        path = os.path.join(self.parts, name)
        if os.path.exists(path):
            return path
        path = os.path.join(self.work, name)
        if not os.path.exists(path):
            if name == "small.stl":
                shapes.write_knot(path, 1000, 0.05)
            elif name == "cube.stl":
                shapes.write_box(path, 10, 10, 1)
            elif name == "jobs.txt":
                cube = self.part("cube.stl")
                with open(path, "w", encoding="utf-8") as file:
                    for number in range(100_000):
                        file.write(f"jet {cube} --bed 20x20 --dpi 100 --layer 0.5 --dry-run -o {number}\n")
            else:
                sys.exit(f"bench: no part {name}")
        return path

    def words(self, job, out, source):
        for word in job.split():
            if word.startswith("PART:"):
                yield self.part(word[5:])
            elif word.startswith("AT:"):
                yield ",".join(f"{nm / 1e6:.6f}" for nm in self.positions[word[3:]])
            elif word.startswith("OUT"):
                yield out + word[3:]
            elif word.startswith("IN"):
                yield source + word[2:]
            else:
                yield word

    def source_of(self, row, which):
        """The input of a row: what its first jobs wrote, by the build whose job reads it."""
        key = (which, *row.first)
        if row.first and key not in self.inputs:
            for folder in set(self.inputs.values()):
                shutil.rmtree(folder, ignore_errors=True)
            self.inputs = {kept: folder for kept, folder in self.inputs.items() if os.path.isdir(folder)}
            self.inputs[key] = os.path.join(self.work, "in-" + which)
            for job in row.first:
                self.run(which, job, "unused", self.inputs[key])
        return self.inputs.get(key, "")

    def run(self, which, job, out, source=""):
        """Seconds, processor seconds and peak of a run, and the bytes that it wrote; OUT and everything that begins like it is removed
        first."""
        for name in os.listdir(self.work):
            path = os.path.join(self.work, name)
            if path.startswith(out):
                shutil.rmtree(path) if os.path.isdir(path) else os.remove(path)
        program = self.options.old if which == "old" else self.options.new
        words = [word for word in self.words(job, out, source)]
        if which == "old" and "--memory" in words and words[0] not in ("jet", "extrude", "slice", "heights"):
            del words[words.index("--memory"):words.index("--memory") + 2]  # 73edc841 has it for no other command
        quiet = [] if words[0] in ("info",) else ["--quiet"]
        wall, processor, peak = started([program, *words, *quiet])
        return {"wall": wall, "processor": processor, "peak": peak / 2**20, "bytes": written(out) if which != "unit" else 0}

    def measure(self, row):
        kinds = {"new": ("new", row.job)}
        if row.unit:
            kinds["unit"] = ("new", row.unit)
        if row.old and self.options.old:
            kinds["old"] = ("old", row.job)
        runs, once = {kind: [] for kind in kinds}, {}
        for kind, (which, job) in kinds.items():
            once[kind] = self.run(which, job, os.path.join(self.work, kind), self.source_of(row, which))
        if "old" in kinds:
            old, new = (os.path.join(self.work, which) for which in ("old", "new"))
            same_answer(self.options, row, old, new, list(self.words(row.job, new, "")))
        names = list(kinds)
        for turn in range(self.options.runs):
            for kind in names[turn % len(names):] + names[:turn % len(names)]:
                which, job = kinds[kind]
                if once[kind]["wall"] < LONG:
                    runs[kind].append(self.run(which, job, os.path.join(self.work, kind), self.source_of(row, which)))
        found = {kind: {key: statistics.median(run[key] for run in runs[kind] or [once[kind]]) for key in once[kind]} for kind in kinds}
        return dict(found, **self.verdict(row, found))

    @staticmethod
    def verdict(row, found):
        """The figure that the target limits; a negative target is a minimum."""
        new, unit, old = found["new"], found.get("unit"), found.get("old")
        if row.measure == "bytes":
            value = new["bytes"] / old["bytes"] if old else None
        elif row.measure == "older":
            value = new["processor"] / old["processor"] if old else None
        elif row.measure == "above":
            value = 1000 * (new["processor"] - unit["processor"])
        else:
            value = new[row.measure] / unit[row.measure] if unit else new[row.measure]
        if value is None:
            return {"value": None, "met": None}
        return {"value": value, "met": value >= -row.target if row.target < 0 else value <= row.target}


def written(out):
    total = 0
    folder = os.path.dirname(out)
    for name in os.listdir(folder):
        path = os.path.join(folder, name)
        if path != out and not path.startswith(out + "."):
            continue
        if os.path.isfile(path):
            total += os.path.getsize(path)
        for base, _, files in os.walk(path):
            total += sum(os.path.getsize(os.path.join(base, file)) for file in files)
    return total


def read_options(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", nargs="?", type=os.path.abspath)
    parser.add_argument("--row", action="append", choices=[row.name for row in rows()], metavar="NAME")
    parser.add_argument("--new")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    options = parser.parse_args(arguments)
    if not options.new:
        build("lamina")
        options.new = os.path.join(ROOT, "build/release/lamina")
    options.new = os.path.abspath(options.new)
    options.cache = os.path.abspath(options.cache)
    return options


def main(arguments):
    options = read_options(arguments)
    commit, before, begun = figures.commit(ROOT), busy_and_total(), os.times()
    subprocess.run([sys.executable, os.path.join(ROOT, "bench/make_parts.py"), options.models, os.path.join(options.cache, "parts"),
                    "--made", "--large"], check=True)
    found = []
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as work:
        real = Real(options, work)
        for row in rows():
            if options.row and row.name not in options.row:
                continue
            result = real.measure(row)
            found.append(dict(result, name=row.name, about=row.about, measure=row.measure, target=row.target, goal=row.goal,
                              unit_of=bool(row.unit)))
            say(real_page.line(found[-1]))
    after, ended = busy_and_total(), os.times()
    own = sum(ended[:4]) - sum(begun[:4])
    result = {"rows": found, "commit": commit, "date": time.strftime("%Y-%m-%d"), "machine": figures.machine(options.cache),
              "runs": options.runs, "others": max(0.0, after[0] - before[0] - own) / (after[1] - before[1])}
    text = "\n".join(real_page.lines(result)).rstrip() + "\n"
    print(text)
    if not options.row and options.old:
        figures.save(ROOT, "real", result)
        with open(os.path.join(ROOT, "bench/real.md"), "w", encoding="utf-8") as file:
            file.write(text)
    missed = [row["name"] for row in found if row["met"] is False]
    if missed:
        sys.exit("bench: missed: " + ", ".join(missed))
