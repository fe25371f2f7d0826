"""Ctrl-C at random moments of long work: how long until the program has ended. More than a second is a fault."""
import os
import random
import signal
import struct
import time

import jobs
from tally import Tally

LONGEST = 1.0  # seconds
WINDOW = 8.0  # of a job, in which signals come


def large_part(path, facets):
    """A binary STL of a closed, wavy shell of about this many facets."""
    import math
    side = int(math.sqrt(facets / 2))
    draw = random.Random(1)
    ring = [[(math.cos(6.2831853 * i / side) * (20 + 3 * math.sin(j * 0.05 + 9 * i / side) + draw.random() * 1e-3),
              math.sin(6.2831853 * i / side) * (20 + 3 * math.sin(j * 0.05 + 9 * i / side) + draw.random() * 1e-3),
              60 * j / side) for i in range(side)] for j in range(side + 1)]
    pack = struct.Struct("<12fH").pack
    with open(path, "wb") as file:
        count = 2 * side * side + 2 * side
        file.write(b"\0" * 80 + struct.pack("<I", count))
        for j in range(side):
            for i in range(side):
                a, b, c, d = ring[j][i], ring[j][(i + 1) % side], ring[j + 1][(i + 1) % side], ring[j + 1][i]
                file.write(pack(0, 0, 0, *a, *b, *c, 0) + pack(0, 0, 0, *a, *c, *d, 0))
        for j, z in ((0, 0.0), (side, 60.0)):
            for i in range(side):
                a, b = ring[j][i], ring[j][(i + 1) % side]
                a, b = (b, a) if j == 0 else (a, b)
                file.write(pack(0, 0, 0, *a, *b, 0, 0, z, 0))


def all_jobs(part):
    done = ["jet", jobs.NIST, "--dpi", "1200", "--layer", "0.02", "--format", "pbm", "-o", "done", "--quiet"]
    halves = [["jet", jobs.NIST, "--dpi", "600", "--layer", "0.02", "--shard", f"{i}/2", "-o", f"s{i}", "--quiet"] for i in (1, 2)]
    gcode = ["extrude", jobs.NIST, "--machine", "anet-a8", "--scale", "1.5", "--layer", "0.1", "-o", "done.gcode", "--quiet"]
    porous = ["jet", jobs.NUT, "--dpi", "600", "--layer", "0.05", "--bed", "60x60", "--fill", "raster", "--bead", "0.2", "--bead-gap",
              "0.2", "-o", "porous", "--quiet"]
    filled = [jobs.NIST, "--scale", "2", "--layer", "0.2"]
    return [
        ("loading, repair and summary of a large file", ["info", part], []),
        ("Embree's tree of a large part, then layers", ["jet", part, "--dpi", "1200", "--layer", "0.01", "--format", "null", "-o", "out"], []),
        ("filled layers, 2400 dpi", ["jet", *filled, "--dpi", "2400", "--bed", "300x300", "--bead", "0.1", "--fill", "raster",
                                     "--bead-gap", "0.1", "-o", "out"], []),
        ("porous layers, contours", ["jet", *filled, "--dpi", "1200", "--bed", "300x300", "--bead", "0.1", "--fill", "contour",
                                     "--bead-gap", "0.1", "-o", "out"], []),
        ("100,000 copies", ["jet", jobs.CROWN, "--scale", "0.05", "--gap", "0.2", "--copies", "100000", "--bed", "400x400", "--layer",
                            "0.02", "-o", "out"], []),
        ("slice, contours", ["slice", *filled, "--bead", "0.05", "--pattern", "contour", "-o", "out"], []),
        ("extrude, segments", ["extrude", *filled, "--machine", "anet-a8", "--fill", "segmented", "-o", "out.gcode"], []),
        ("heights, a step each nanometre", ["heights", part, "--heights", "cusp", "--thickness", "0.01..0.3", "--cusp", "0.001"], []),
        ("verify a job", ["verify", "done"], [done]),
        ("verify a toolpath", ["verify", "done.gcode"], [gcode]),
        ("report", ["report", "done", "-o", "out.html"], [done]),
        ("preview", ["preview", "done", "-o", "out.png"], [done]),
        ("merge", ["merge", "s1", "s2", "-o", "out"], halves),
        ("permeability", ["permeability", "porous"], [porous]),
        ("batch", ["batch", part, jobs.NIST, "--with", "jet --dpi 1200 --layer 0.02 --bed 300x300", "-o", "out"], []),
        ("export", ["export", part, "-o", "out.3mf"], []),
    ]


def one_trial(program, name, words, folder, moment, tally):
    """returns  whether the signal came before the end"""
    process = program.start(words, folder)
    try:
        process.wait(timeout=moment)
    except Exception:  # it is still at work
        process.send_signal(signal.SIGINT)
        since = time.monotonic()
        ran = program.end(process, since, 60)
        waited = time.monotonic() - since
        tally.maximum(name, "slowest_ms", round(waited * 1000))
        if ran.code is None or waited > LONGEST:
            tally.fault(name, "hangs", f"{waited:.2f} s after a signal at {moment:.2f} s")
        elif ran.code not in (0, 130, -signal.SIGINT):
            tally.fault(name, "aborts" if ran.aborted else "wrong", f"exit {ran.code}: {ran.error[-300:]}")
        tally.trial(name, heard=1)
        return True
    ran = program.end(process, time.monotonic())
    tally.trial(name)
    if ran.code != 0:
        tally.fault(name, "wrong", f"exit {ran.code}: {ran.error[-300:]}")
    return False


def main(program, settings, draw):
    tally = Tally("Ctrl-C")
    shared = jobs.fresh(os.path.join(settings.work, "shared"))
    made = set()
    part = os.path.join(shared, "large.stl")
    for name, words, before in all_jobs(part):
        if not settings.matches(name):
            continue
        if part in words and not os.path.exists(part):
            large_part(part, 1_500_000)
        for made_by in before:
            if str(made_by) not in made:
                ran = program.run(made_by, shared, 600)
                assert ran.code == 0, f"{' '.join(made_by)}: {ran.code} {ran.error}"
                made.add(str(made_by))
        since = time.monotonic()
        process = program.start(words, shared)
        try:
            process.wait(timeout=WINDOW)
        except Exception:
            process.kill()
        program.end(process, since)
        longest = min(WINDOW, time.monotonic() - since)
        for _ in range(max(3, settings.trials // 5)):
            jobs.remove(os.path.join(shared, "out"))
            one_trial(program, name, words, shared, draw.uniform(0.01, longest), tally)
    return tally
