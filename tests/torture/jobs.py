"""Jobs of every command that writes: how each begins, how it continues after a kill, and what it leaves."""
import dataclasses
import hashlib
import json
import os
import shutil
import struct
import subprocess
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
CORPUS = os.path.join(ROOT, "tests", "corpus")
NIST = os.path.join(CORPUS, "nist_am_test_artifact_v3b.stl")
NUT = os.path.join(CORPUS, "parameter_quality_nut.stl")
CROWN = os.path.join(CORPUS, "dental_crown.stl")
LONGEST = 120  # seconds after which a command counts as hanging


@dataclasses.dataclass
class Job:
    """A command that writes `out` or files that begin so, in the folder in which it runs."""
    name: str
    begin: list                # arguments of the first run
    go_on: list                # of the run after a kill: --resume where the command has it, else --overwrite or nothing
    other: list = None         # another job of the same command and output
    before: list = dataclasses.field(default_factory=list)  # commands whose results the job reads
    unlike: tuple = ()         # names of files that hold times, so that two runs differ in them
    over: bool = False         # an older job of another kind stands there at first
    counts_layers: bool = False  # its --json names the layers that a second run keeps
    inputs: dict = dataclasses.field(default_factory=dict)  # files that the folder has from the beginning: name to bytes
    ends: int = 0              # exit code of a whole run
    when_done: int = None      # exit code of resuming finished work, if it is another one
    cut_short: list = dataclasses.field(default_factory=list)  # commands of `before` that are killed too
    whole: list = None         # a command that leaves the same files without the others


def jet(name, arguments, other_part=NUT):
    common = ["-o", "out", "--json"]
    return Job(name, ["jet", *arguments, *common], ["jet", *arguments, *common, "--resume"],
               other=["jet", other_part, *arguments[1:], *common], counts_layers=True)


def over_another(name, old, new, out="out"):
    """A run that replaces another job; after a kill it continues with --resume."""
    new = [*new, "-o", out, "--json"]
    return Job(name, [*new, "--overwrite"], [*new, "--resume"], before=[[*old, "-o", out, "--quiet"]], over=True)


def again(name, arguments, other_part=NUT, out="out"):
    """A command that starts anew."""
    common = ["-o", out, "--quiet"]
    return Job(name, [*arguments, *common], [*arguments, *common, "--overwrite"],
               other=[arguments[0], other_part, *arguments[2:], *common])


def resumed(name, arguments, other_part=NUT, out="out"):
    common = ["-o", out, "--json"]
    return Job(name, [*arguments, *common], [*arguments, *common, "--resume"],
               other=[arguments[0], other_part, *arguments[2:], *common], counts_layers=out == "out")


def merged(more=(), ending=""):
    job = ["jet", NIST, "--dpi", "300", "--layer", "0.1", "--quiet", *more]
    shards = [[*job, "--shard", f"{i}/4", "-o", f"s{i}{ending}"] for i in (1, 2, 3, 4)]
    merge = ["merge", *(f"s{i}{ending}" for i in (1, 2, 3, 4)), "-o", f"out{ending}", "--quiet"]
    return Job(" ".join(["merge of 4 shards", *more]), merge, merge, before=shards, whole=[*job, "-o", "out"])


def sharded(more=()):
    """Shards in one directory, each cut short and begun again, then merged there: the files of a whole run."""
    whole = ["jet", NIST, "--dpi", "300", "--layer", "0.1", "-o", "out", "--quiet", *more]
    shards = [[*whole, "--shard", f"{i}/3", "--resume"] for i in (1, 2, 3)]
    merge = ["merge", "out", "-o", "out", "--quiet"]
    return Job(" ".join(["shards in one directory", *more]), merge, merge, cut_short=shards, whole=whole)


def converted():
    """A stack of images to another format, and to grey."""
    images = ["jet", NIST, "--dpi", "300", "--layer", "0.1", "-o", "job", "--quiet"]
    begin = ["convert", "job/layers", "--format", "png-8", "-o", "out", "--quiet"]
    return Job("convert", begin, [*begin, "--overwrite"], before=[images],
               other=["convert", "job/layers", "--format", "bmp", "-o", "out", "--quiet"])


def image_part():
    """A part that is a stack of images."""
    images = ["jet", NUT, "--dpi", "200", "--layer", "0.2", "-o", "job", "--quiet"]
    begin = ["jet", "job/layers", "--layer", "0.2", "--dpi", "200", "-o", "out", "--json"]
    return Job("jet, image part", begin, [*begin, "--resume"], before=[images], counts_layers=True)


def exported(name, out):
    begin = ["export", NIST, "--copies", "2", "--bed", "400x400", "-o", out, "--quiet"]
    return Job(name, begin, [*begin, "--overwrite"], other=["export", NUT, "-o", out, "--quiet"])


def box(size):
    """A closed box in mm, from 0, as a binary STL."""
    corner = [[size[axis] if number >> axis & 1 else 0.0 for axis in range(3)] for number in range(8)]
    faces = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)]
    facets = [struct.pack("<12fH", 0, 0, 0, *corner[a], *corner[b], *corner[c], 0) for a, b, c in faces]
    return bytes(80) + struct.pack("<I", len(facets)) + b"".join(facets)


def read(*names):
    with open(os.path.join(ROOT, *names), "rb") as file:
        return file.read()


def table_rows():
    """The calls of tests/commands/outputs.tsv with their columns; those without a flag make inputs of the others."""
    lines = [line for line in read("tests", "commands", "outputs.tsv").decode().splitlines() if not line.startswith("#")]
    return [dict(zip(lines[0].split("\t"), line.split("\t"))) for line in lines[1:]]


def table_jobs():
    """Each call that names an output: none is without a kill test. That of watched folders is tests/watch/torture."""
    inputs = {"part.stl": box([6.0, 4.0, 3.0]), "drops.csv": read("tests", "reference", "dinisio2022", "table_18.tsv"),
              "printer.toml": read("pipeline", "machine", "shipped", "extruders", "anet-a8.toml"), "list.txt": b"info part.stl\n", "filament.ini": b"temperature = 200\n",
              "widths.csv": b"test,percent,thin_mm\nextrusion,90,0.3\nextrusion,80,0.25\nextrusion,70,0.2\n"}
    makers = [row["call"].split() for row in table_rows() if not row["flag"]]
    made = {words[words.index("-o") + 1]: words for words in makers}
    jobs = []
    for row in (row for row in table_rows() if row["flag"] and not row["call"].startswith("watch ")):
        words = row["call"].replace("@", "out").split()
        before, wanted = [], list(words)
        while wanted:
            maker = made.get(wanted.pop().split("/")[0])
            if maker and maker not in before:
                before.insert(0, maker)
                wanted += maker[:maker.index("-o")]
        # Tables of measurements may be filled in by now, and are not replaced.
        fills_in = row["lock"] == "/widths.csv"
        resumes = "product" in row["kind"] and words[0] in ("jet", "slice", "extrude", "batch") and "3mf" not in words
        again = ["--resume"] if resumes else [] if words[0] == "merge" else ["--overwrite"]
        jobs.append(Job(row["call"], words, [*words, *again], before=before, inputs=inputs,
                        unlike=("summary.json", "summary.tsv", "batch.jsonl"), when_done=2 if fills_in else None))
    return jobs


def reported():
    job = ["jet", NIST, "--dpi", "300", "--layer", "0.1", "-o", "job", "--quiet"]
    report = ["report", "job", "-o", "out.html", "--quiet"]
    return Job("report", report, report, before=[job])


def calibrated():
    begin = ["calibrate", "--machine", "anet-a8", "-o", "out", "--quiet"]
    # Its widths.csv may hold measurements by now.
    return Job("calibrate", begin, [*begin, "--overwrite"], other=["calibrate", "--machine", "marlin", "-o", "out", "--quiet"],
               when_done=2)


def batch():
    begin = ["batch", os.path.join(CORPUS, "broken"), CROWN, NUT, "--with", "jet --dpi 100 --layer 0.5 --bed 600x600",
             "-o", "out", "--quiet"]
    return Job("batch of the corpus", begin, [*begin, "--resume"], unlike=("summary.json", "summary.tsv", "batch.jsonl"), ends=3)


def plotted():
    begin = ["heights", NIST, "--heights", "cusp", "--thickness", "0.05..0.3", "--cusp", "0.02", "-o", "out.tsv", "--quiet"]
    return Job("heights", begin, begin)


def previewed():
    job = ["jet", NIST, "--dpi", "300", "--layer", "0.5", "-o", "job", "--quiet"]
    draw = ["preview", "job", "--layer", "12", "-o", "out.png", "--quiet"]
    return Job("preview", draw, draw, before=[job])


def all_jobs():
    nuferbj = ["--machine", "nuferbj", "--layer", "0.5"]
    filled = ["--dpi", "300", "--layer", "0.25", "--fill", "segmented", "--shell", "1"]
    lines = ["--layer", "0.3", "--pattern", "raster", "--bead", "0.4"]
    return [
        jet("jet, tiff", [NIST, "--dpi", "300", "--layer", "0.05"]),
        jet("jet, png with a saturation", [NUT, *nuferbj, "--saturation", "60", "--format", "png"], CROWN),
        jet("jet, levels", [NIST, "--dpi", "300", "--layer", "0.2", "--levels", "16", "--format", "png-8"]),
        jet("jet, inspection", [NIST, "--dpi", "300", "--layer", "0.1", "--inspect"]),
        jet("jet, inspection of drops", [NUT, *nuferbj, "--saturation", "60", "--inspect", "--mirror", "x"], CROWN),
        jet("jet, print program", [NUT, *nuferbj], CROWN),
        jet("jet, two materials", [NUT, CROWN, "--material", "steel,bronze", "--bed", "60x40", "--dpi", "600", "--layer", "0.05"], CROWN),
        jet("jet, segmented with shell", [NUT, *filled, "--bed", "60x60"], CROWN),
        jet("jet, container", [NIST, "--dpi", "300", "--layer", "0.05", "--container", "zip"]),
        jet("jet, container with a program and inspection", [NUT, *nuferbj, "--inspect", "--container", "zip"], CROWN),
        jet("jet, container of two materials", [NUT, CROWN, "--material", "steel,bronze", "--bed", "60x40", "--dpi", "600", "--layer",
                                                "0.1", "--container", "zip", "--sync", "layer"], CROWN),
        jet("jet, pages of a TIFF file with a program and inspection", [NUT, *nuferbj, "--inspect", "--container", "tiff"], CROWN),
        jet("jet, pages of a TIFF file of two materials", [NUT, CROWN, "--material", "steel,bronze", "--bed", "60x40", "--dpi", "600",
                                                           "--layer", "0.1", "--container", "tiff"], CROWN),
        over_another("container over an older one", ["jet", NUT, "--dpi", "200", "--layer", "0.5", "--container", "zip"],
                     ["jet", NIST, "--dpi", "300", "--layer", "0.1", "--container", "zip"]),
        merged(["--container", "zip"], ".zip"),
        over_another("jet over an older job", ["jet", NUT, "--dpi", "200", "--layer", "0.5"],
                     ["jet", NIST, "--dpi", "300", "--layer", "0.1"]),
        over_another("slice over an older job", ["slice", NIST, "--layer", "0.5"], ["slice", NIST, *lines]),
        over_another("slice, a file a layer, over an older job", ["slice", NIST, "--layer", "0.3", "--file-a-layer"],
                     ["slice", NIST, "--layer", "0.1", "--file-a-layer"]),
        over_another("extrude over an older job", ["extrude", CROWN, "--machine", "anet-a8", "--layer", "0.3"],
                     ["extrude", NUT, "--machine", "anet-a8", "--layer", "0.3", "--fill", "segmented", "--scale", "2"],
                     "out.gcode"),
        resumed("slice, svg with filling", ["slice", NIST, *lines]),
        resumed("slice, a file a layer", ["slice", NIST, "--layer", "0.1", "--file-a-layer"]),
        resumed("slice, cli-binary", ["slice", NIST, *lines, "--format", "cli-binary"]),
        again("slice, 3mf", ["slice", NIST, "--layer", "0.1", "--format", "3mf"]),
        resumed("extrude, segmented", ["extrude", NUT, "--machine", "anet-a8", "--layer", "0.3", "--fill", "segmented",
                                       "--scale", "2"], CROWN, "out.gcode"),
        batch(), merged(), sharded(), merged(["--inspect"]), sharded(["--inspect"]), image_part(), converted(),
        exported("export, stl", "out.stl"), exported("export, 3mf", "out.3mf"), reported(), calibrated(), plotted(), previewed(),
        *table_jobs(),
    ]


def going_on_ends(job, files, ref):
    """The exit code that a run after these files has to have."""
    return job.when_done if job.when_done is not None and files == ref.files else job.ends


def tree(folder):
    """Every file below a folder with its hash; links and pipes by their kind."""
    found = {}
    for base, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(base, name)
            key = os.path.relpath(path, folder)
            if not os.path.isfile(path) or os.path.islink(path):
                found[key] = "special"
                continue
            with open(path, "rb") as file:
                found[key] = hashlib.md5(file.read()).hexdigest()
    return found


def outputs(folder, job):
    """What the job wrote: `out`, `out.*` and all other files that none of its predecessors wrote."""
    made = {word for words in (*job.before, *job.cut_short) for word in words} - {"out", "out.gcode"} | set(job.inputs)
    return {name: value for name, value in tree(folder).items()
            if name.split(os.sep)[0] not in made and os.path.basename(name) not in job.unlike}


@dataclasses.dataclass
class Ran:
    code: int      # that of the program; negative for a signal; None if it hung and was killed
    seconds: float
    out: str
    error: str

    @property
    def aborted(self):
        return self.code is not None and (self.code in (-6, -11, -7, -4, -8, 1, 134, 139) or "terminate called" in self.error)

    def summary(self):
        try:
            return json.loads(self.out)
        except ValueError:
            return {}


class Program:
    def __init__(self, path):
        self.path = os.path.abspath(path)
        self.keeps_temporary = False  # TMPDIR is in the folder of the run, whose files are compared

    def start(self, words, folder, **options):
        if self.keeps_temporary:
            temporary = os.path.join(folder, "tmp")
            os.makedirs(temporary, exist_ok=True)
            options["env"] = {**os.environ, "TMPDIR": temporary}
        return subprocess.Popen([self.path, *words], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True, errors="replace", **options)

    def end(self, process, since, longest=LONGEST):
        try:
            out, error = process.communicate(timeout=longest)
            return Ran(process.returncode, time.monotonic() - since, out, error)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Ran(None, longest, "", "hangs")

    def run(self, words, folder, longest=LONGEST, **options):
        since = time.monotonic()
        return self.end(self.start(words, folder, **options), since, longest)

    def run_and_signal(self, words, folder, seconds, signal):
        since = time.monotonic()
        process = self.start(words, folder)
        try:
            process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            process.send_signal(signal)
        return self.end(process, since)


def go_on(program, job, folder):
    """The run after one that ended early. What ended before it replaced an older job leaves that, which --resume refuses."""
    ran = program.run(job.go_on, folder)
    return program.run(job.begin, folder) if job.over and ran.code == 2 else ran


def remove(path):
    """A file or a folder, if there is one, and what else begins so."""
    for name in os.listdir(os.path.dirname(path)):
        whole = os.path.join(os.path.dirname(path), name)
        if name.startswith(os.path.basename(path)) and os.path.isdir(whole):
            shutil.rmtree(whole)
        elif name.startswith(os.path.basename(path)):
            os.remove(whole)


def add_inputs(folder, job):
    for name, content in job.inputs.items():
        with open(os.path.join(folder, name), "wb") as file:
            file.write(content)


def fresh(folder, job=None):
    """An empty folder, or one with the job's inputs."""
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    if job:
        add_inputs(folder, job)
    return folder


@dataclasses.dataclass
class Reference:
    files: dict        # of the uninterrupted run
    seconds: float
    in_flight: int     # layers at once at most, 0 where the command does not report it


def reference(program, job, folder):
    """The uninterrupted run, three times: their bytes have to agree."""
    files, seconds, in_flight = None, [], 0
    for _ in range(3):
        fresh(folder, job)
        for words in (*job.before, *job.cut_short):
            ran = program.run(words, folder)
            assert ran.code == 0, f"{job.name}: {' '.join(words)}: {ran.code} {ran.error}"
        ran = program.run(job.begin, folder)
        assert ran.code == job.ends, f"{job.name}: {' '.join(job.begin)}: {ran.code} {ran.error}"
        now = outputs(folder, job)
        assert files in (None, now), f"{job.name}: two whole runs differ"
        files = now
        if job.whole:
            program.run(job.whole, fresh(folder, job))
            assert outputs(folder, job) == files, f"{job.name}: not as {' '.join(job.whole)}"
        seconds.append(ran.seconds)
        in_flight = max(in_flight, ran.summary().get("max_layers_in_flight", 0))
    return Reference(files, sorted(seconds)[1], in_flight)


def layer_files(files):
    return sum(1 for name in files if name.startswith(os.path.join("out", "layers")) and "." in os.path.basename(name))
