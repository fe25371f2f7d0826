#!/usr/bin/env python3
"""bench/cache.py: many jobs of few parts from a cache, and what happens to a damaged one. Writes bench/cache.md.

    scripts/bench cache [LAMINA] [--jobs 10000] [--folder DIR]    default: build/release/lamina, a folder of TMPDIR

200 parts of 4,800 triangles, 48 layers each. The first 200 jobs of the list have one part each, all others have one of these parts again,
under another output. Files of every job are compared with those of separate runs by hash. Then trials: the cache is removed, its disk is
full, 100 files are damaged, 8 processes use it at once, and 50 runs are killed; each time all outputs have to have the right bytes, or an
error. Exit code 1 if a limit is missed.
"""
import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import figures
import shapes

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
OPTIONS = ["--bed", "80x80", "--dpi", "600", "--layer", "0.5"]
PARTS = 200


def tree(folder):
    """A hash of names and bytes."""
    digest = hashlib.blake2b(digest_size=16)
    for base, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            path = os.path.join(base, name)
            with open(path, "rb") as file:
                data = file.read()
            digest.update(f"{os.path.relpath(path, folder)} {len(data)}\n".encode() + data)
    return digest.hexdigest()


def files_of(cache):
    found = [os.path.join(base, name) for kind in ("jobs", "objects") for base, _, names in os.walk(os.path.join(cache, kind)) for name in names]
    return sorted(found)


class Cache:
    def __init__(self, lamina, work):
        self.lamina, self.work = lamina, work
        self.cache = os.path.join(work, "cache")

    def path(self, *names):
        return os.path.join(self.work, *names)

    def make_parts(self):
        os.makedirs(self.path("parts"))
        for i in range(PARTS):
            shapes.write_knot(self.path("parts", f"knot{i:03}.stl"), 4800, 1 + i / 10000)

    def job(self, part):
        return ["jet", self.path("parts", f"knot{part:03}.stl"), *OPTIONS]

    def batch(self, jobs, out, *options):
        """Seconds of a batch of jobs, given as parts."""
        with open(self.path(out + ".txt"), "w", encoding="ascii") as file:
            for i, part in enumerate(jobs):
                file.write(" ".join(self.job(part)) + f" -o {i:05}\n")
        began = time.monotonic()
        code = subprocess.run([self.lamina, "batch", self.path(out + ".txt"), "-o", self.path(out), "--quiet", *options], check=False).returncode
        return time.monotonic() - began, code

    def single(self, part, out, *options, cache=True):
        """A run. returns  the code and what its summary states of the cache"""
        words = [self.lamina, *self.job(part), "-o", self.path(out), "--json", "--quiet", *options]
        done = subprocess.run(words + (["--cache", self.cache] if cache else []), check=False, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        return done.returncode, json.loads(done.stdout)["cache"] if done.returncode == 0 and cache else done.stderr.decode()

    def outcome(self, out):
        with open(self.path(out, "summary.json"), encoding="utf-8") as file:
            jobs = json.load(file)["jobs"]
        states = [job["result"]["cache"] for job in jobs]
        return {state: states.count(state) for state in set(states)}


def measure(bench, count, right):
    jobs = list(range(PARTS)) + [random.Random(1).randrange(PARTS) for _ in range(count - PARTS)]
    plain, code = bench.batch(jobs[:PARTS], "plain")
    first, code_first = bench.batch(jobs[:PARTS], "first", "--cache", bench.path("other"))
    all_jobs, code_all = bench.batch(jobs, "all", "--cache", bench.cache)
    for i in range(PARTS):
        right.append(tree(bench.path("plain", f"{i:05}")))
    wrong = sum(tree(bench.path("all", f"{i:05}")) != right[part] for i, part in enumerate(jobs))
    files = sum(len(names) for _, _, names in os.walk(bench.path("plain", "00000")))
    outcome = bench.outcome("all")
    added = 1000 * (all_jobs - first) / (count - PARTS)
    shutil.rmtree(bench.path("all"))
    return {"seconds of 200 without a cache": f"{plain:.2f}", "seconds of 200 that fill a cache": f"{first:.2f}",
            f"seconds of {count:,}": f"{all_jobs:.2f}", "files of a job": files, "ms of each further job": f"{added:.2f}",
            "jobs taken from the cache": outcome.get("hit", 0), "jobs with other bytes": wrong}, \
        code == code_first == code_all == 0 and wrong == 0 and added <= 2 + 0.02 * max(0, files - 50)


def trial(bench, right, what, act):
    """Runs `act`, which returns outputs with their parts. returns  outputs that differ"""
    del what
    wrong = 0
    for part, out in act():
        wrong += tree(bench.path(out)) != right[part]
        shutil.rmtree(bench.path(out), ignore_errors=True)
    return wrong


def damaged(bench):
    rng = random.Random(2)
    files = files_of(bench.cache)
    for number, path in enumerate(rng.sample(files, 100)):
        with open(path, "rb") as file:
            data = bytearray(file.read())
        if number % 3 == 0:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif number % 3 == 1:
            del data[rng.randrange(len(data)):]
        else:
            with open(rng.choice(files), "rb") as file:
                data = file.read()
        with open(path, "wb") as file:
            file.write(data)
    for part in range(PARTS):
        code, _ = bench.single(part, "damaged")
        assert code == 0
        yield part, "damaged"


def removed(bench):
    process = subprocess.Popen([bench.lamina, "batch", bench.path("plain.txt"), "-o", bench.path("removed"), "--cache", bench.cache, "--quiet"])
    while process.poll() is None:
        shutil.rmtree(bench.cache, ignore_errors=True)
        time.sleep(0.02)
    assert process.returncode == 0, process.returncode
    for part in range(PARTS):
        yield part, f"removed/{part:05}"


def full(bench):
    small = bench.path("small")
    os.makedirs(small)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", small], check=False).returncode != 0:
        raise PermissionError("needs root, to mount a small file system")
    try:
        done = subprocess.run([bench.lamina, "batch", bench.path("plain.txt"), "-o", bench.path("full"), "--cache", small + "/cache"], check=True,
                              stderr=subprocess.PIPE, text=True)
        assert done.stderr.count("note: cache") == 1, done.stderr[-500:]
    finally:
        subprocess.run(["umount", small], check=True)
    for part in range(PARTS):
        yield part, f"full/{part:05}"


def together(bench):
    shutil.rmtree(bench.cache, ignore_errors=True)
    processes = [subprocess.Popen([bench.lamina, "batch", bench.path("plain.txt"), "-o", bench.path(f"together{p}"), "--cache", bench.cache, "--quiet"])
                 for p in range(8)]
    assert [process.wait() for process in processes] == [0] * 8
    for p in range(8):
        for part in range(PARTS):
            yield part, f"together{p}/{part:05}"


def killed(bench):
    rng = random.Random(3)
    for number in range(50):
        if number % 5 == 0:
            shutil.rmtree(bench.cache, ignore_errors=True)
        words = [bench.lamina, "batch", bench.path("plain.txt"), "-o", bench.path("killed"), "--cache", bench.cache, "--quiet", "--resume"]
        process = subprocess.Popen(words, stderr=subprocess.DEVNULL)
        time.sleep(rng.uniform(0.02, 0.6))
        process.send_signal(signal.SIGKILL)
        process.wait()
        done = [name for name in sorted(os.listdir(bench.path("killed"))) if os.path.exists(bench.path("killed", name, "manifest.json"))] \
            if os.path.isdir(bench.path("killed")) else []
        for name in rng.sample(done, min(5, len(done))):
            yield int(name), f"killed/{name}"
    subprocess.run([bench.lamina, "batch", bench.path("plain.txt"), "-o", bench.path("killed"), "--cache", bench.cache, "--quiet", "--resume"], check=True)
    for part in range(PARTS):
        yield part, f"killed/{part:05}"


TRIALS = [("100 files damaged: bits, lengths, other files", damaged), ("folder removed every 20 ms during a batch", removed),
          ("disk of the cache full", full), ("8 batches at once", together), ("50 batches killed", killed)]


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lamina", nargs="?", default=os.path.join(ROOT, "build/release/lamina"))
    parser.add_argument("--jobs", type=int, default=10000)
    parser.add_argument("--folder", default=None)
    chosen = parser.parse_args(arguments)
    good, load = True, os.getloadavg()[0]
    with tempfile.TemporaryDirectory(dir=chosen.folder) as work:
        bench, right = Cache(os.path.abspath(chosen.lamina), work), []
        bench.make_parts()
        rows, within = measure(bench, chosen.jobs, right)
        good &= within
        trials = {}
        for what, act in TRIALS:
            trials[what] = trial(bench, right, what, lambda act=act: act(bench))
            good &= trials[what] == 0
            print(f"{what}: {trials[what]} outputs differ", file=sys.stderr, flush=True)
    text = "# A cache of jobs, measured\n\n" + __doc__.split("\n\n", 2)[2].strip().rsplit(" Exit code", 1)[0] + "\n\n"
    facts = figures.machine(chosen.folder or tempfile.gettempdir())
    text += (f"{facts['processor']}, {facts['cores']} cores, {facts['system']}, files on {facts['files_on']}, load {load:.1f} before, commit "
             f"{figures.commit(ROOT)}.\n\n| | |\n|---|---|\n")
    text += "".join(f"| {name} | {value} |\n" for name, value in rows.items())
    text += "\n| trial | outputs that differ |\n|---|---|\n" + "".join(f"| {name} | {value} |\n" for name, value in trials.items())
    with open(os.path.join(ROOT, "bench/cache.md"), "w", encoding="utf-8") as file:
        file.write(text)
    print(text)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main(sys.argv[1:])
