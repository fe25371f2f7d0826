"""A named pipe, a folder, a device or an endless line in place of every file that is read: one line, no hang."""
import os
import shutil
import subprocess

import jobs
from tally import Tally

SECONDS = 10  # after which reading counts as hanging


def pipe(path):
    os.mkfifo(path)


def folder(path):
    os.mkdir(path)


def device(path):
    os.symlink("/dev/zero", path)


def endless_line(path):
    with open(path, "wb") as file:
        file.write(b"{\n")
        file.truncate(6 << 30)


def deep_keys(path):
    with open(path, "w", encoding="ascii") as file:
        file.write(".".join(["a"] * 100000) + "=1\n")


def deep_brackets(path):
    with open(path, "w", encoding="ascii") as file:
        file.write("a=" + "[" * 100000 + "\n")


INPUTS = [pipe, folder, device, endless_line, deep_keys, deep_brackets]

# Commands with X in place of a file that they read.
READERS = [
    ["info", "X"], ["jet", "X", "-o", "o"], ["jet", "--job", "X", "-o", "o"], ["jet", jobs.NUT, "--machine", "./X", "-o", "o"],
    ["extrude", jobs.NUT, "--machine", "./X", "-o", "o.gcode"], ["extrude", "--job", "X", "-o", "o.gcode"],
    ["slice", "X", "-o", "o"], ["slice", "--job", "X", "-o", "o"], ["heights", "X"], ["heights", "--measure", "X"],
    ["heights", "--job", "X"], ["batch", "X", "-o", "o"], ["permeability", "X", "--area", "1", "--length", "1"],
    ["calibrate", "--machine", "anet-a8", "--measured", "X", "-o", "o.toml"], ["calibrate", "--machine", "./X", "-o", "o"],
    ["verify", "X"], ["report", "X", "-o", "o.html"], ["preview", "X", "-o", "o.png"], ["merge", "X", "-o", "o"],
    ["stream", "X"], ["machines", "--json", "./X"], ["export", "X", "-o", "o.stl"],
]

# Commands over a finished job, some file of which is replaced.
OVER_JOBS = [["verify", "out"], ["report", "out", "-o", "o.html"], ["preview", "out", "-o", "o.png"], ["merge", "out", "-o", "o"],
             ["merge", "out", "-o", "out"], ["stream", "out"]]


def check(ran, name, shown, tally, must_fail):
    tally.trial(name)
    if ran.code is None:
        tally.fault(name, "hangs", shown)
    elif ran.aborted or ran.code < 0 or ran.code > 5:
        tally.fault(name, "aborts", f"{shown}: exit {ran.code}: {ran.error[-300:]}")
    elif must_fail and ran.code == 0:
        tally.fault(name, "wrong", f"{shown}: exit 0")
    elif ran.code != 0 and not ran.error.strip() and not ran.out.strip():
        tally.fault(name, "wrong", f"{shown}: exit {ran.code} without a word")


def readers(program, work, tally):
    for position in INPUTS:
        for words in READERS:
            at = jobs.fresh(os.path.join(work, "read"))
            position(os.path.join(at, "X"))
            ran = program.run(words, at, SECONDS)
            # A folder is a fine list of parts for a batch, though an empty one.
            check(ran, f"{position.__name__} instead of what is read", " ".join(words), tally, must_fail=True)


def over_jobs(program, work, tally):
    made = jobs.fresh(os.path.join(work, "made"))
    begin = ["jet", jobs.NUT, "--machine", "nuferbj", "--layer", "2", "-o", "out", "--quiet"]
    ran = program.run(begin, made)
    assert ran.code == 0, ran.error
    names = sorted(jobs.tree(made))
    for position in INPUTS[:4]:
        for name in names:
            if name.count("0000") and not name.split(os.sep)[-1].startswith("000001"):
                continue  # one layer stands for all
            for words in [*OVER_JOBS, [*begin, "--resume"]]:
                at = os.path.join(work, "over")
                shutil.rmtree(at, ignore_errors=True)
                shutil.copytree(made, at)
                os.remove(os.path.join(at, name))
                position(os.path.join(at, name))
                ran = program.run(words, at, SECONDS)
                check(ran, f"{position.__name__} in a finished job", f"{name}: {' '.join(words)}", tally, must_fail=words[0] == "verify")


def main(program, settings, draw):
    del draw
    tally = Tally("pipes, folders, devices and endless lines in place of files")
    readers(program, settings.work, tally)
    over_jobs(program, settings.work, tally)
    subprocess.run(["rm", "-rf", os.path.join(settings.work, "over")], check=True)
    return tally
