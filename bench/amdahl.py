"""bench/amdahl.py: what more cores could give a job, from the serial shares that `lamina jet --timing` finds.

Of a run on n threads each phase has its wall time w and its processor time p. If s seconds of it are one thread's alone and
all threads share the rest evenly, n w - p = (n - 1) s (G. M. Amdahl, "Validity of the single processor approach", 1967).
A run on m cores then takes at least the sum of s + (p - s) / m over the phases. Memory and files that all cores share make it
longer: it is a bound, not a forecast. Hyper-threads are no cores. Processor time of other programs appears as waiting time, so the
minimum of serial seconds over several runs counts.
"""
import json
import os
import shutil
import statistics
import subprocess

# job of bench/against.py: part, bed (mm), layer (mm)
from against import CASES
from measure import say

CORES = (2, 16, 64)
RUNS = 7


def timed(program, words):
    done = subprocess.run([program, "jet", *words, "--timing", "--json", "--quiet"], check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)["timing"]


def share_of(timings):
    """Of the runs of a job, by phase: the least seconds of the wall, of the processor, and of one thread alone."""
    phases = {}
    for name in timings[0]["phases"]:
        spans = [timing["phases"][name] for timing in timings]
        wall, processor = (min(span[key] for span in spans) for key in ("wall_seconds", "processor_seconds"))
        serial = min(span["serial_share"] * span["wall_seconds"] for span in spans)
        phases[name] = {"wall": wall, "processor": processor, "serial": min(serial, processor)}
    return phases


def bound(phases, cores):
    """Seconds on so many cores, at least."""
    return sum(span["serial"] + (span["processor"] - span["serial"]) / cores for span in phases.values())


def shares_of_parts(program, parts, work):
    """Of each job of bench/against.py whose part is there. The largest are those of scripts/bench --large."""
    with open(os.path.join(parts, "parts.json"), encoding="utf-8") as file:
        positions = json.load(file)
    found = {}
    for case, (part, bed, layer) in CASES.items():
        if part not in positions or not os.path.exists(os.path.join(parts, part)):
            say(f"  {case}: NOT RUN: no {part}")
            continue
        at = ",".join(f"{nm / 1e6:.6f}" for nm in positions[part]["at_nm"])
        words = [os.path.join(parts, part), "--bed", f"{bed}x{bed}", "--dpi", "1200", "--layer", str(layer), "--at", at]
        timings = []
        for _ in range(RUNS + 1):
            out = os.path.join(work, "out")
            shutil.rmtree(out, ignore_errors=True)
            timings.append(timed(program, [*words, "-o", out]))
        phases = share_of(timings[1:])
        found[case] = {"phases": phases, "threads": timings[0]["threads"], "bounds": {n: bound(phases, n) for n in CORES},
                       "limit": statistics.median(timing["limit"]["seconds"] for timing in timings[1:])}
        say(f"  {case}: " + ", ".join(f"{n} cores {1e3 * found[case]['bounds'][n]:.0f} ms" for n in CORES))
    return found
