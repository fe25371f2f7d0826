"""Two processes on one output: one complete result remains, and a process that ends with exit 0 can rely on it."""
import os
import time

import jobs
import kill
from tally import Tally


def pairs(job):
    """Two runs of one output: equal ones and different ones, with --overwrite where the command has it."""
    yield job.begin, job.begin
    if job.other:
        yield job.begin, job.other
    if "--overwrite" in job.go_on or "--resume" in job.go_on:
        over = [word for word in job.begin if word != "--overwrite"] + ["--overwrite"]
        yield over, over
        if job.other:
            yield over, job.other + ["--overwrite"]


def whole(program, job, words, folder):
    jobs.fresh(folder, job)
    for earlier in (*job.before, *job.cut_short):
        program.run(earlier, folder)
    ran = program.run(words, folder)
    assert ran.code == job.ends, f"{' '.join(words)}: {ran.code} {ran.error}"
    return jobs.outputs(folder, job)


def one_trial(program, job, words, results, folder, seconds, tally, draw):
    jobs.fresh(folder, job)
    for earlier in (*job.before, *job.cut_short):
        program.run(earlier, folder)
    started = time.monotonic()
    first = program.start(words[0], folder)
    time.sleep(draw.choice([0, draw.uniform(0, 0.02), draw.uniform(0, seconds)]))
    second = program.start(words[1], folder)
    ran = [program.end(process, started) for process in (first, second)]
    codes = [one.code for one in ran]
    shown = f"exits {codes}: {' '.join(words[0])} against {' '.join(words[1])}"
    tally.trial(job.name, refused=codes.count(4))
    if None in codes:
        tally.fault(job.name, "hangs", shown)
        return
    for one in ran:
        if one.code not in (job.ends, 2, 4):
            tally.fault(job.name, "aborts" if one.aborted or one.code < 0 else "wrong", f"{shown}: {one.error[-300:]}")
    if job.ends not in codes:
        tally.fault(job.name, "lost", f"nothing is finished, {shown}: {ran[0].error[-200:]} {ran[1].error[-200:]}")
        return
    there = jobs.outputs(folder, job)
    allowed = [result for result, code in zip(results, codes) if code == job.ends]
    if there not in allowed:
        nearest = min(allowed, key=lambda result: len(set(result.items()) ^ set(there.items())))
        odd = sorted(set(dict(set(nearest.items()) ^ set(there.items()))))
        kind = "left" if all(nearest.get(name) == there.get(name) or name not in nearest for name in odd) else "torn"
        tally.fault(job.name, kind, f"{shown}: {', '.join(odd[:4])}")


def main(program, settings, draw):
    tally = Tally("two processes on one output")
    for job in settings.jobs:
        if job.cut_short:
            continue
        seconds = jobs.reference(program, job, os.path.join(settings.work, "whole")).seconds
        for words in pairs(job):
            results = [whole(program, job, one, os.path.join(settings.work, "whole")) for one in words]
            for _ in range(max(2, settings.trials // 8)):
                one_trial(program, job, words, results, os.path.join(settings.work, "trial"), seconds, tally, draw)
    return tally
