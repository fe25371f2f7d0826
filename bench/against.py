"""bench/against.py: this build against an older one and against what the machine allows. scripts/bench against OLD

    scripts/bench against OLD              OLD is a program such as an older build/release/lamina; writes bench/against.md
    scripts/bench against OLD --case NAME  this part only (can be repeated); the page is left alone
    --new PROGRAM --bench PROGRAM          what is compared, and its lamina_bench; else build/release, built first
    --runs N                               counted runs of a kind (default 9; a third of it, at least 5, of the largest)
    --cache DIR --models DIR               where parts are made, and from what

Every kind of run is taken once to warm up, and its layers are compared with those of the old build, byte for byte, before
any clock starts. Then kinds take turns, in an order that turns with the round; printed are medians of wall seconds. Outputs
lie in memory (/dev/shm) where there is one. The limit is the one of `lamina jet --timing`: reading the part's file, writing files
of the same sizes, and touching each crossing once, on one thread. What the rays' tree costs, and the bound of what layers need,
are of bench/index.cpp.
"""
import argparse
import hashlib
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
from measure import build, busy_and_total, instruction_sets, models_default, say, started  # noqa: E402

# part, side of the bed (mm), layer (mm); names as in bench/jet.py
CASES = {
    "knot800k": ("knot800k.stl", 100, 0.05),
    "scan680k": ("scan680k.stl", 100, 0.1),
    "crowns-96": ("crowns96.stl", 400, 0.1),
    "benchy": ("benchy15.stl", 100, 0.1),
    "terrain": ("terrain.stl", 100, 0.1),
    "benchies": ("benchies72.stl", 400, 0.1),
}
# engine, times as fast as the old build, multiple of the limit, MiB
REQUESTED = {
    "knot800k": ("default", 2.0, 5.0, 45),
    "benchies": ("default", 2.4, 5.5, 400),
    "crowns-96": ("contours", 1.7, None, None),
    "benchy": ("contours", 1.4, None, None),
    "scan680k": ("contours", 2.3, None, 45),
}
PNG = ("knot800k", "crowns-96")
INFO = ("knot800k", "benchy", "terrain")


def kinds_of(case):
    """Name: (program, options) of each kind of run of a case."""
    kinds = {"old default": ("old", []), "old contours": ("old", ["--engine", "contours"]), "default": ("new", []),
             "contours": ("new", ["--engine", "contours"]), "plain": ("new", ["--isa", "plain"]),
             "contours plain": ("new", ["--engine", "contours", "--isa", "plain"])}
    if "avx512" in instruction_sets():
        kinds["avx2"] = ("new", ["--isa", "avx2"])
    if case in PNG:
        kinds["png"] = ("new", ["--format", "png"])
        kinds["old png"] = ("old", ["--format", "png"])
    return kinds


def digest(folder):
    """Of all layer files, by name; and their bytes."""
    whole, size = hashlib.sha256(), 0
    for name in sorted(os.listdir(folder)):
        with open(os.path.join(folder, name), "rb") as file:
            data = file.read()
        whole.update(name.encode() + hashlib.sha256(data).digest())
        size += len(data)
    return whole.hexdigest(), size


class Against:
    def __init__(self, options, work):
        self.options, self.work = options, work
        self.parts = os.path.join(os.path.abspath(options.cache), "parts")
        with open(os.path.join(self.parts, "parts.json"), encoding="utf-8") as file:
            self.positions = {name: part["at_nm"] for name, part in json.load(file).items()}

    def command(self, case, which, more):
        part, bed, layer = CASES[case]
        at = ",".join(f"{nm / 1e6:.6f}" for nm in self.positions[part])
        return [self.options.old if which == "old" else self.options.new, "jet", os.path.join(self.parts, part), "--bed",
                f"{bed}x{bed}", "--dpi", "1200", "--layer", str(layer), "--at", at, "--quiet", *more]

    def run(self, case, which, more):
        out = os.path.join(self.work, "out")
        shutil.rmtree(out, ignore_errors=True)
        return started(self.command(case, which, more) + ["-o", out])

    def turns(self, case):
        """Alternating runs of all kinds: name to a list of (wall, processor, peak bytes), and the sizes of their layers."""
        kinds = kinds_of(case)
        answers, runs = {}, {name: [] for name in kinds}
        for name, (which, more) in kinds.items():
            self.run(case, which, more)
            answers[name] = digest(os.path.join(self.work, "out", "layers"))
        for name, (found, _) in answers.items():
            if "png" not in name and found != answers["old default"][0]:
                sys.exit(f"bench: {case}: {name} writes other layers than the old build")
        names = list(kinds)
        for turn in range(self.options.runs if case != "benchies" else max(5, self.options.runs // 3)):
            for name in names[turn % len(names):] + names[:turn % len(names)]:
                runs[name].append(self.run(case, *kinds[name]))
        return runs, {name: size for name, (_, size) in answers.items()}

    def limit(self, case):
        """Seconds of the limit and of its parts, as --timing has them: medians of five."""
        reported = []
        for _ in range(5):
            out = os.path.join(self.work, "out")
            shutil.rmtree(out, ignore_errors=True)
            done = subprocess.run(self.command(case, "new", ["--timing", "--json", "-o", out]), check=True, stdout=subprocess.PIPE)
            reported.append(json.loads(done.stdout)["timing"]["limit"])
        return {key: statistics.median(one[key] for one in reported)
                for key in ("read_seconds", "write_seconds", "touch_seconds", "seconds")}

    def benchmarks(self, cases):
        """What lamina_bench says of the parts: the rays' tree, the bound of layers. By kind and case."""
        found = {"tree": {}, "bound": {}}
        if self.options.bench:
            wanted = f"^({'|'.join(found)})/({'|'.join(cases)})(/|$)"
            output = subprocess.run([self.options.bench, f"--benchmark_filter={wanted}", "--benchmark_format=json"], check=True,
                                    stdout=subprocess.PIPE, env=dict(os.environ, LAMINA_BENCH_PARTS=self.parts)).stdout
            for entry in json.loads(output)["benchmarks"]:
                kind, case = entry["name"].split("/")[:2]
                found[kind][case] = dict(entry, seconds=entry["real_time"] / 1e3)
        return found

    def info(self, case):
        """`info` against a dry run of the job, in alternating runs."""
        part = os.path.join(self.parts, CASES[case][0])
        runs = {"info": [], "dry run": []}
        for _ in range(self.options.runs + 1):
            runs["info"].append(started([self.options.new, "info", part]))
            runs["dry run"].append(started(self.command(case, "new", ["--dry-run"])))
        return {name: taken[1:] for name, taken in runs.items()}


def wall(runs):
    return statistics.median(run[0] for run in runs)


def processor(runs):
    return statistics.median(run[1] for run in runs)


def peak(runs):
    return statistics.median(run[2] for run in runs) / 2**20


def not_above(value, maximum, digits=2):
    return f"{value:.{digits}f}" + ("" if maximum is None else f" (at most {maximum:g}: {'met' if value <= maximum else 'NOT MET'})")


def lower_bound(value, minimum):
    return f"{value:.2f}" + ("" if minimum is None else f" (at least {minimum:g}: {'met' if value >= minimum else 'NOT MET'})")


def rows_of(case, runs, limit):
    engine, minimum, multiple, mib = REQUESTED.get(case, (None, None, None, None))
    for which in ("default", "contours"):
        requested, old, new = which == engine, runs["old " + which], runs[which]
        yield [f"`{case}`", which, f"{1e3 * wall(old):.0f}", f"{1e3 * wall(new):.0f}",
               lower_bound(wall(old) / wall(new), minimum if requested else None), f"{processor(old) / processor(new):.2f}",
               not_above(wall(new) / limit["seconds"], multiple if requested else None), f"{peak(old):.0f}",
               not_above(peak(new), mib if which == "default" else None, 0)]


def wide_row(case, runs):
    return [f"`{case}`", lower_bound(wall(runs["old default"]) / wall(runs["plain"]), {"knot800k": 1.2}.get(case, 1.0)),
            lower_bound(wall(runs["old contours"]) / wall(runs["contours plain"]), 1.0),
            f"{wall(runs['old default']) / wall(runs['avx2']):.2f}" if "avx2" in runs else "-",
            not_above(wall(runs["default"]) / wall(runs["contours"]), 1.15)]


def png_lines(cases):
    png = [(case, runs, sizes) for case, (runs, sizes, _) in cases.items() if "png" in runs]
    if not png:
        return
    yield from figures.table(["job", "PNG, ms", "ratio to G4", "times as fast as the old PNG", "ratio of sizes, new to old PNG"], [
        [f"`{case}`", f"{1e3 * wall(runs['png']):.0f}", not_above(wall(runs["png"]) / wall(runs["default"]), 2.5),
         f"{wall(runs['old png']) / wall(runs['png']):.1f}", f"{sizes['png'] / sizes['old png']:.2f}"] for case, runs, sizes in png])
    both = sum(sizes["png"] for *_, sizes in png) / sum(sizes["old png"] for *_, sizes in png)
    yield f"PNG files of these jobs together: {not_above(both, 1.2)} of the old size."
    yield ""


def limit_lines(cases):
    """The limit in its parts."""
    yield "The limit in its parts, ms:"
    yield ""
    yield from figures.table(["job", "read", "write", "touch each crossing", "limit"], [
        [f"`{case}`"] + [f"{1e3 * limit[key]:.1f}" for key in ("read_seconds", "write_seconds", "touch_seconds", "seconds")]
        for case, (*_, limit) in cases.items()])


def index_lines(bench):
    """What the rays' tree costs, and the bound of what layers need."""
    if not bench["tree"]:
        return
    yield ("The tree of the rays, and the bound of a layer's memory (claimed) compared with its use (needed): clusters, segments, "
           "crossings, changes and rows, each written once; every 16th layer.")
    yield ""
    rows = []
    for case, tree in bench["tree"].items():
        bound = bench["bound"][case]
        rows.append([f"`{case}`", f"{tree['primitives']:,.0f}", f"{tree['bytes'] / 1e6:.2f}", f"{1e3 * tree['seconds']:.1f}",
                     f"{bound['claimed'] / 1e6:.1f} / {bound['needed'] / 1e6:.1f}", not_above(bound["claimed"] / bound["needed"], 2),
                     f"{bound['worst']:.2f}"])
    yield from figures.table(["job", "rays' tree: primitives", "MB", "ms", "layer bound: claimed / needed, MB", "ratio",
                              "of the worst layer"], rows)


def page(options, found, bench):
    machine = figures.machine(options.cache)
    yield "# This build compared with an older one and with the limit of the machine"
    yield ""
    yield (f"Written by `scripts/bench against`, {time.strftime('%Y-%m-%d')}, commit {figures.commit(ROOT)} compared with {options.name}: "
           f"{machine['cores']} cores of {machine['processor']}, {machine['memory_gib']} GiB, {machine['system']}; widest "
           f"instructions: {instruction_sets()[-1]}; part files in the page cache, outputs in memory. Other programs used "
           f"{100 * found['others']:.0f} % of the processors.")
    yield ""
    yield ("Medians of wall milliseconds of alternating runs. The limit is that of `--timing`: the time to read the part, write files "
           "of the same sizes and touch each crossing once on one thread. The layers of all kinds of runs are the same bytes.")
    yield ""
    rows = []
    for case, (runs, _, limit) in found["cases"].items():
        rows += rows_of(case, runs, limit)
    yield from figures.table(["job", "engine", "old, ms", "new, ms", "times as fast", "processor time", "times the limit", "old MiB",
                              "new MiB"], rows)
    yield from limit_lines(found["cases"])
    yield "Without wide instructions (`--isa plain`), with AVX2 only, and the two engines compared:"
    yield ""
    yield from figures.table(["job", "plain, times as fast", "the same, contours", "avx2, times as fast",
                              "default engine, part of contours' time"],
                             [wide_row(case, runs) for case, (runs, *_) in found["cases"].items()])
    yield from index_lines(bench)
    yield from png_lines(found["cases"])
    if found["info"]:
        yield from figures.table(["part", "`info`, ms", "dry run, ms", "time", "memory"], [
            [f"`{case}`", f"{1e3 * wall(runs['info']):.0f}", f"{1e3 * wall(runs['dry run']):.0f}",
             not_above(wall(runs["info"]) / wall(runs["dry run"]), 3), not_above(peak(runs["info"]) / peak(runs["dry run"]), 2)]
            for case, runs in found["info"].items()])


def read_options(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("--name", default="an older build", help="of the old build in the page, such as its commit")
    parser.add_argument("--new")
    parser.add_argument("--bench")
    parser.add_argument("--case", action="append", choices=list(CASES))
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    options = parser.parse_args(arguments)
    if not options.new:
        build("lamina", "lamina_bench")
        options.new = os.path.join(ROOT, "build/release/lamina")
        options.bench = os.path.join(ROOT, "build/release/lamina_bench")
    options.old, options.new = os.path.abspath(options.old), os.path.abspath(options.new)
    return options


def main(arguments):
    options = read_options(arguments)
    cases = options.case or list(CASES)
    subprocess.run([sys.executable, os.path.join(ROOT, "bench/make_parts.py"), options.models,
                    os.path.join(os.path.abspath(options.cache), "parts"), "--made"]
                   + ["--large"] * ("benchies" in cases), check=True)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as work:
        against, found, before, own = Against(options, work), {"cases": {}, "info": {}}, busy_and_total(), 0.0
        for case in cases:
            say(f"bench: {case}")
            runs, sizes = against.turns(case)
            found["cases"][case] = (runs, sizes, against.limit(case))
            for name, taken in runs.items():
                say(f"  {name:15} {1e3 * wall(taken):7.0f} ms {1e3 * processor(taken):7.0f} ms {peak(taken):6.1f} MiB")
            if case in INFO:
                found["info"][case] = against.info(case)
            own += sum(run[1] for kinds in (runs, found["info"].get(case, {})) for taken in kinds.values() for run in taken)
        after = busy_and_total()
        found["others"] = max(0.0, after[0] - before[0] - own) / (after[1] - before[1])
        text = "\n".join(page(options, found, against.benchmarks(cases))).rstrip() + "\n"
    print(text)
    if not options.case:
        with open(os.path.join(ROOT, "bench", "against.md"), "w", encoding="utf-8") as file:
            file.write(text)
