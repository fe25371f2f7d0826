"""A disk that is full, of many sizes, or a limit on the size of files: exit 4 and one line, and what is whole stays."""
import os
import resource
import signal
import subprocess
import sys

import jobs
import kill
from tally import Tally

SIZES_KB = [round(4 * 1.2705 ** i / 4) * 4 for i in range(30)]  # 4 kB to 4 MB
LIMITS_KB = [1, 4, 8, 32, 64, 300]


def can_mount():
    """Whether this process, in a mount namespace of its own, may mount memory file systems."""
    return subprocess.run(["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True).returncode == 0


def enter_namespace():
    """Starts this script again in a mount namespace of its own, so that mounts end with it."""
    if os.environ.get("TORTURE_NAMESPACE"):
        return
    os.environ["TORTURE_NAMESPACE"] = "1"
    os.execvp("unshare", ["unshare", "-m", sys.executable, *sys.argv])


def mount(folder, size_kb):
    os.makedirs(folder, exist_ok=True)
    subprocess.run(["umount", "-q", folder], capture_output=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "none", folder], check=True)


def check(ran, words, tally, name, ends):
    """An end on a full disk: done, or exit 4 with a line that names a file."""
    if ran.code is None:
        tally.fault(name, "hangs", " ".join(words))
    elif ran.code not in (ends, 4):
        tally.fault(name, "aborts" if ran.aborted or ran.code < 0 else "wrong", f"exit {ran.code}: {ran.error[-300:]}")
    elif ran.code == 4 and not ran.error.strip():
        tally.fault(name, "wrong", "exit 4 without a word")


def full(program, job, ref, folder, size_kb, tally):
    """The job on a disk of this size, then on one that is large enough."""
    mount(folder, 1 << 18)
    jobs.add_inputs(folder, job)
    for words in (*job.before, *job.cut_short):
        program.run(words, folder)
    used = os.statvfs(folder)
    used_kb = (used.f_blocks - used.f_bfree) * used.f_frsize // 1024
    subprocess.run(["mount", "-o", f"remount,size={used_kb + size_kb}k", folder], check=True)
    ran = program.run(job.begin, folder)
    check(ran, job.begin, tally, job.name, job.ends)
    there = jobs.outputs(folder, job)
    if not job.over:
        kill.check_whole(there, ref, tally, job.name)
    subprocess.run(["mount", "-o", f"remount,size={1 << 18}k", folder], check=True)
    on_disk = jobs.layer_files(set(there) & set(ref.files))
    ends = jobs.going_on_ends(job, jobs.outputs(folder, job), ref)
    more = jobs.go_on(program, job, folder)
    if more.code != ends:
        tally.fault(job.name, "wrong", f"with room again: exit {more.code}: {more.error[-300:]}")
    elif job.counts_layers and "--resume" in job.go_on and ran.code == 4:
        a_layer = max(1, round(jobs.layer_files(ref.files) / max(1, kill.total_layers(ref))))
        kept = more.summary().get("layers_kept", 0)
        if kept < on_disk // a_layer - 2 * ref.in_flight:
            tally.fault(job.name, "lost", f"{size_kb} kB: {on_disk // a_layer} whole on disk, {kept} kept, {ref.in_flight} in flight")
    kill.compare(jobs.outputs(folder, job), ref, tally, job.name)
    tally.trial(job.name, full=int(ran.code == 4))
    subprocess.run(["umount", folder], check=True)


def limited(program, job, ref, folder, size_kb, tally):
    """No file may grow beyond this size."""
    jobs.fresh(folder, job)
    for words in (*job.before, *job.cut_short):
        program.run(words, folder)

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size_kb << 10, size_kb << 10))
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)

    ran = program.run(job.begin, folder, preexec_fn=limit)
    check(ran, job.begin, tally, job.name, job.ends)
    if not job.over:
        kill.check_whole(jobs.outputs(folder, job), ref, tally, job.name)
    ends = jobs.going_on_ends(job, jobs.outputs(folder, job), ref)
    more = jobs.go_on(program, job, folder)
    if more.code != ends:
        tally.fault(job.name, "wrong", f"without the limit: exit {more.code}: {more.error[-300:]}")
    kill.compare(jobs.outputs(folder, job), ref, tally, job.name)
    tally.trial(job.name, full=int(ran.code == 4))


def main(program, settings, draw):
    del draw
    mounts = can_mount()
    if mounts:
        enter_namespace()
    tally = Tally(f"full disk ({len(SIZES_KB)} sizes{'' if mounts else ': NOT RUN, mounting is not allowed'}) "
                  f"and limits on files ({len(LIMITS_KB)})")
    for job in settings.jobs:
        ref = jobs.reference(program, job, os.path.join(settings.work, "whole"))
        for size in SIZES_KB if mounts else []:
            full(program, job, ref, os.path.join(settings.work, "disk"), size, tally)
        for size in LIMITS_KB:
            limited(program, job, ref, os.path.join(settings.work, "limited"), size, tally)
    return tally
