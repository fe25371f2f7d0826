"""Signals at random moments: a known exit, no temporary files but those that can be resumed, and the right bytes after it."""
import os
import signal

import jobs
import kill
from tally import Tally

HEARD = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]  # lamina tidies up and ends with 130
FATAL = [signal.SIGQUIT, signal.SIGUSR1, signal.SIGALRM, signal.SIGXCPU]  # the system ends it
IGNORED = [signal.SIGPIPE, signal.SIGXFSZ]  # come as errors of the call that caused them


def may_stay(name, job):
    """Records and growing files that a later run continues."""
    return job.begin[0] in ("jet", "slice", "extrude", "batch") and (name.endswith(".part") or ".part." in name or "layers" in name)


def one_trial(program, job, ref, number, folder, tally, draw):
    jobs.fresh(folder, job)
    for words in (*job.before, *job.cut_short):
        program.run(words, folder)
    ran = program.run_and_signal(job.begin, folder, draw.uniform(0.01, ref.seconds), number)
    name = number.name
    if ran.code is None:
        tally.fault(name, "hangs", " ".join(job.begin))
    elif ran.code not in (job.ends, 130, -number):
        tally.fault(name, "aborts" if ran.aborted else "wrong", f"{job.name}: exit {ran.code}: {ran.error[-300:]}")
    there = jobs.outputs(folder, job)
    if not job.over:
        kill.check_whole(there, ref, tally, name)
    if ran.code == 130:
        strays = [path for path in there if path not in ref.files and not may_stay(path, job)]
        if strays:
            tally.fault(name, "left", f"{job.name}: {', '.join(strays[:3])}")
    ends = jobs.going_on_ends(job, there, ref)
    more = jobs.go_on(program, job, folder)
    if more.code != ends:
        tally.fault(name, "wrong", f"{job.name}, then: exit {more.code}: {more.error[-300:]}")
    kill.compare(jobs.outputs(folder, job), ref, tally, name)
    tally.trial(name, ended=int(ran.code != job.ends))


def main(program, settings, draw):
    tally = Tally("signals")
    for job in settings.jobs:
        ref = jobs.reference(program, job, os.path.join(settings.work, "whole"))
        for number in (*HEARD, *FATAL, *IGNORED):
            for _ in range(max(1, settings.trials // 25)):
                one_trial(program, job, ref, number, os.path.join(settings.work, "trial"), tally, draw)
    return tally
