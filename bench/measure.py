"""What every comparison of whole programs does: build, run them, take their seconds and memory, take medians."""
import argparse
import os
import statistics
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def say(text):
    print(text, file=sys.stderr, flush=True)


def busy_and_total():
    """Processor seconds in use and in all since the machine started."""
    with open("/proc/stat", encoding="ascii") as file:
        user, nice, system, idle, wait, irq, softirq, steal = map(int, file.readline().split()[1:9])
    hertz = os.sysconf("SC_CLK_TCK")
    busy = user + nice + system + irq + softirq + steal
    return busy / hertz, (busy + idle + wait) / hertz


def measured(command, log):
    """Runs a command; wall seconds, processor seconds, peak resident MiB, and the share of the processors that other
    programs used meanwhile. Any failure ends the benchmark."""
    os.sync()
    before = busy_and_total()
    with open(log, "wb") as output:
        start = time.perf_counter()
        code = subprocess.call(["/usr/bin/time", "-q", "-o", log + ".time", "-f", "%U %S %M"] + command,
                               stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                               env=dict(os.environ, LC_ALL="C"))
        wall = time.perf_counter() - start
    if code != 0:
        sys.exit(f"bench: exit code {code} of: {' '.join(command)}\n" + open(log, errors="replace").read()[-2000:])
    after = busy_and_total()
    with open(log + ".time", encoding="ascii") as file:
        user, system, peak = file.read().split()[-3:]
    own = float(user) + float(system)
    others = max(0.0, after[0] - before[0] - own) / max(1e-9, after[1] - before[1])
    return {"wall": wall, "processor": own, "peak_mib": int(peak) / 1024, "others": others}


# A small interpreter of its own: the peak of a process counts that of the one it was started from.
STARTER = """import posix, sys, time
null = [(posix.POSIX_SPAWN_OPEN, fd, "/dev/null", posix.O_RDWR, 0) for fd in (0, 1)]
start = time.perf_counter()
_, status, usage = posix.wait4(posix.posix_spawn(sys.argv[1], sys.argv[1:], posix.environ, file_actions=null), 0)
print(time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss, posix.waitstatus_to_exitcode(status))"""


def started(command):
    """Runs a program: wall seconds, processor seconds, peak resident bytes. Any failure ends the benchmark."""
    done = subprocess.run([sys.executable, "-I", "-S", "-c", STARTER] + command, check=True, stdout=subprocess.PIPE)
    wall, processor, peak, code = map(float, done.stdout.split())
    if code != 0:
        sys.exit(f"bench: exit code {code:.0f} of: {' '.join(command)}")
    return wall, processor, peak * 1024


def median_of(runs):
    walls = [run["wall"] for run in runs]
    return {"wall": statistics.median(walls), "fastest": min(walls), "slowest": max(walls),
            "processor": statistics.median(run["processor"] for run in runs),
            "peak_mib": statistics.median(run["peak_mib"] for run in runs), "runs": len(runs),
            "others": sum(run["others"] * run["wall"] for run in runs) / sum(walls)}


def instruction_sets():
    """Those that this processor has and kernels have bodies for, as --isa names them (stages/geometry/isa.cpp), up to the one
    that LAMINA_ISA names."""
    with open("/proc/cpuinfo", encoding="ascii") as file:
        flags = set(next((line for line in file if line.startswith("flags")), "").split())
    sets = ["plain"]
    for name, needed in (("avx2", {"avx2", "bmi1", "bmi2", "popcnt"}), ("avx512", {"avx512f", "avx512bw", "avx512dq", "avx512vl"})):
        if sets[-1] == os.environ.get("LAMINA_ISA") or not needed <= flags:
            break
        sets.append(name)
    return sets


def models_default():
    return os.environ.get("LAMINA_MODELS", os.path.join(ROOT, "../shared/models"))


def build(*targets):
    """Installs what is compared with, and builds these targets of build/release."""
    subprocess.run([os.path.join(ROOT, "scripts/packages"), "--bench"], check=True)
    subprocess.run(["cmake", "--preset", "release"], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", "--preset", "release", "--target", *targets], cwd=ROOT, check=True)


def comparison(arguments, about, turns, name, targets, cases=(), runs=3):
    """Options of a comparison with other programs, the folder of ours, built if it was not named, and a folder to work in."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=runs, help="turns: " + turns)
    if cases:
        parser.add_argument("--case", action="append", choices=sorted(cases))
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    parser.add_argument("--programs", help=f"folder of {' and '.join(targets)}; else build/release, built first")
    options = parser.parse_args(arguments)
    if not options.programs:
        build(*targets)
    options.cache = os.path.abspath(options.cache)
    work = os.path.join(options.cache, "work-" + name)
    os.makedirs(work, exist_ok=True)
    return options, options.programs or os.path.join(ROOT, "build/release"), work
