"""kill -9 at random moments, once or more, then to the end: the bytes of an uninterrupted run, and only those."""
import os
import signal

import jobs
from tally import Tally

MAX_KILLS = 2  # before the run that is let finish


def cut(program, words, folder, ref, tally, name, draw, ends=0):
    """One run that is killed. returns  whether the kill landed"""
    ran = program.run_and_signal(words, folder, draw.uniform(0, 1.02 * ref.seconds), signal.SIGKILL)
    if ran.code is None:
        tally.fault(name, "hangs", " ".join(words))
    elif ran.code not in (ends, -signal.SIGKILL):
        tally.fault(name, "aborts" if ran.aborted else "wrong", f"exit {ran.code}: {ran.error[-300:]}")
    return ran.code == -signal.SIGKILL


def check_whole(files, ref, tally, name):
    for path, value in files.items():
        if path in ref.files and value != ref.files[path] and not path.endswith(".part"):
            tally.fault(name, "torn", path)


def one_trial(program, job, ref, folder, tally, draw):
    jobs.fresh(folder, job)
    for words in job.before:
        program.run(words, folder)
    kills = 0
    for words in job.cut_short:
        kills += cut(program, words, folder, jobs.Reference({}, 0.1, 0), tally, job.name, draw)
        ran = program.run(words, folder)
        if ran.code != 0:
            tally.fault(job.name, "wrong", f"{' '.join(words)}: exit {ran.code}: {ran.error[-300:]}")
    words = job.begin
    for _ in range(draw.randint(1, MAX_KILLS)):
        ends = jobs.going_on_ends(job, jobs.outputs(folder, job), ref)
        kills += cut(program, words, folder, ref, tally, job.name, draw, ends)
        # Over an older job its files may still stand there.
        if not job.over:
            check_whole(jobs.outputs(folder, job), ref, tally, job.name)
        words = job.begin if job.over else job.go_on
    on_disk = jobs.layer_files(set(jobs.outputs(folder, job)) & set(ref.files))
    a_layer = max(1, round(jobs.layer_files(ref.files) / max(1, total_layers(ref))))
    ends = jobs.going_on_ends(job, jobs.outputs(folder, job), ref)
    ran = jobs.go_on(program, job, folder)
    finished = ran.code == ends
    if ran.code is None:
        tally.fault(job.name, "hangs", " ".join(job.go_on))
    elif not finished:
        tally.fault(job.name, "aborts" if ran.aborted else "wrong", f"exit {ran.code}: {ran.error[-300:]}")
    if finished and job.counts_layers and "--resume" in job.go_on:
        kept = ran.summary().get("layers_kept", 0)
        if kept < on_disk // a_layer - 2 * ref.in_flight:
            tally.fault(job.name, "lost", f"{on_disk // a_layer} layers were whole on disk, {kept} kept, {ref.in_flight} in flight")
    compare(jobs.outputs(folder, job), ref, tally, job.name)
    tally.trial(job.name, kills=kills)


def total_layers(ref):
    return len({os.path.basename(name)[:6] for name in ref.files if name.startswith(os.path.join("out", "layers"))})


def compare(files, ref, tally, name):
    wrong = [path for path in ref.files if files.get(path) != ref.files[path]]
    extra = [path for path in files if path not in ref.files]
    if wrong:
        tally.fault(name, "differs", ", ".join(wrong[:4]))
    if extra:
        tally.fault(name, "left", ", ".join(extra[:4]))


def main(program, settings, draw):
    tally = Tally("kill -9")
    program.keeps_temporary = True
    folder = os.path.join(settings.work, "trial")  # one for all, since saved jobs have the paths of parts
    for job in settings.jobs:
        try:
            ref = jobs.reference(program, job, folder)
        except AssertionError as why:
            tally.fault(job.name, "wrong", str(why))
            continue
        for _ in range(settings.trials):
            one_trial(program, job, ref, folder, tally, draw)
    return tally
