"""Limits on address space (ulimit -v) of many sizes: done, or exit 6 and one line, and what is whole stays."""
import os
import resource

import jobs
import kill
from tally import Tally

SMALLEST_MB, LARGEST_MB = 60, 600


def reading_jobs():
    """Commands that write nothing, and some that do."""
    job = ["jet", jobs.NIST, "--dpi", "300", "--layer", "0.5", "-o", "job", "--quiet"]
    file = ["extrude", jobs.NUT, "--machine", "anet-a8", "--layer", "0.3", "-o", "job.gcode", "--quiet"]
    return [
        jobs.Job("info", ["info", jobs.NIST], ["info", jobs.NIST]),
        jobs.Job("info, obj", ["info", os.path.join(jobs.CORPUS, "quad_knot.obj")], ["info", jobs.NIST]),
        jobs.Job("verify a job", ["verify", "job"], ["verify", "job"], before=[job]),
        jobs.Job("verify a file", ["verify", "job.gcode"], ["verify", "job.gcode"], before=[file]),
        jobs.jet("jet, contours engine", [jobs.NIST, "--dpi", "600", "--layer", "0.2", "--engine", "contours"]),
        jobs.resumed("slice, contour filling", ["slice", jobs.NIST, "--layer", "0.5", "--pattern", "contour", "--bead", "0.4"]),
    ]


def limited(program, job, ref, folder, size_mb, tally):
    """A run within this much address space, then one without a limit. returns  the exit code of the first"""
    jobs.fresh(folder, job)
    for words in (*job.before, *job.cut_short):
        program.run(words, folder)
    size = int(size_mb * (1 << 20))
    ran = program.run(job.begin, folder, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (size, size)))
    if ran.code == 127:  # the loader had no room for the libraries
        tally.trial(job.name, not_begun=1)
        return 127
    said = [line for line in ran.error.splitlines() if line.startswith("lamina: ") and "out of memory" in line]
    where = f"{size_mb:.0f} MB: exit {ran.code}: {ran.error[-300:]}"
    if ran.code is None:
        tally.fault(job.name, "hangs", f"{size_mb:.0f} MB: {' '.join(job.begin)}")
    elif ran.code not in (job.ends, 6) or (ran.code == 6 and not said):
        tally.fault(job.name, "aborts" if ran.aborted or ran.code < 0 else "wrong", where)
    there = jobs.outputs(folder, job)
    if not job.over:
        kill.check_whole(there, ref, tally, job.name)
    if ran.code == job.ends:
        kill.compare(there, ref, tally, job.name)
    ends = jobs.going_on_ends(job, there, ref)
    more = jobs.go_on(program, job, folder)
    if more.code != ends:
        tally.fault(job.name, "wrong", f"after {where}, without the limit: exit {more.code}: {more.error[-300:]}")
    kill.compare(jobs.outputs(folder, job), ref, tally, job.name)
    tally.trial(job.name, out_of_memory=int(ran.code == 6))
    return ran.code


def main(program, settings, draw):
    tally = Tally(f"limits on memory ({SMALLEST_MB} to {LARGEST_MB} MB of address space)")
    trials = max(6, settings.trials // 2)
    for job in [*settings.jobs, *(job for job in reading_jobs() if settings.matches(job.name))]:
        ref = jobs.reference(program, job, os.path.join(settings.work, "whole"))
        # A third over the whole range; then where the program begins but may not end, which is a narrow one.
        coarse = trials // 3
        sizes = [SMALLEST_MB * (LARGEST_MB / SMALLEST_MB) ** (i / (coarse - 1)) for i in range(coarse)]
        codes = {size: limited(program, job, ref, os.path.join(settings.work, "trial"), size, tally) for size in sizes}
        low = max([size for size in sizes if codes[size] == 127], default=SMALLEST_MB)
        high = min([size for size in sizes if codes[size] == job.ends], default=LARGEST_MB)
        for _ in range(trials - coarse):
            limited(program, job, ref, os.path.join(settings.work, "trial"), draw.uniform(low, max(low, high)), tally)
    return tally
