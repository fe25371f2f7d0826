#!/usr/bin/env python3
"""bench/extrude.py: toolpaths of 3DBenchy against Debian's CuraEngine, PrusaSlicer and Slic3r. scripts/bench extrude

    scripts/bench extrude [--runs N] [--case cura|slow|memory] [--models DIR] [--cache DIR] [--programs DIR]

0.1 mm layers, two walls, 30 % lines, no solid layers, no supports; mesh on disk to G-code on disk. All other settings
are defaults of each program: lamina's tolerance and its skirt, CuraEngine's resolution. Before the clock starts every program
runs once and the answers are compared: the number of layers; the filament, within a fifth of CuraEngine's; lamina's moves, at most 1.3
times CuraEngine's; lamina's file against its manifest. Then lamina and CuraEngine run alternately (case cura); the slow peers once (slow).
Case memory compares the peak memory of jobs with and without segmentation. Writes bench/results/extrude.json and
bench/extrude.md, unless only some cases are requested.
"""
import json
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import heights  # noqa: E402
import make_parts  # noqa: E402
import figures  # noqa: E402
import measure  # noqa: E402

TIMES = 10   # as fast as the fastest peer we mean to be
MOVES = 1.3  # times CuraEngine's, at most
SHORT_MM = 0.05
CASES = ("cura", "slow", "memory")
SLOW = ("prusa", "slic3r")
SLIC3R = ["--layer-height", "0.1", "--first-layer-height", "0.1", "--perimeters", "2", "--fill-density", "30%", "--fill-pattern",
          "rectilinear", "--top-solid-layers", "0", "--bottom-solid-layers", "0", "--skirts", "0", "--nozzle-diameter", "0.4"]
CURA = {"layer_height": 0.1, "layer_height_0": 0.1, "infill_line_distance": 1.5, "infill_sparse_density": 30, "infill_pattern": "lines",
        "top_layers": 0, "bottom_layers": 0, "wall_line_count": 2, "adhesion_type": "none", "machine_width": 220, "machine_depth": 220,
        "machine_height": 250, "line_width": 0.45, "center_object": "true", "roofing_layer_count": 0, "support_enable": "false",
        "machine_start_gcode": "", "machine_end_gcode": "", "material_diameter": 1.75}
NAMES = {"cura": "CuraEngine 4.13", "prusa": "PrusaSlicer 2.5", "slic3r": "Slic3r 1.3"}


def commands(lamina, part, work, definitions):
    """Each program's command and the file that it writes."""
    out = {name: os.path.join(work, name + ".gcode") for name in ("lamina", "cura", "prusa", "slic3r")}
    cura = ["CuraEngine", "slice", "-j", definitions]
    for scope in ([], ["-e0"]):
        cura += scope
        for name, value in CURA.items():
            cura += ["-s", f"{name}={value}"]
    own = [lamina, "extrude", part, "--machine", "marlin", "--layer", "0.1", "--walls", "2", "--bead", "0.45", "--fill", "raster",
           "--bead-gap", "1.05", "--overwrite", "--json", "--quiet", "-o", out["lamina"]]
    return {"lamina": own, "cura": cura + ["-l", part, "-o", out["cura"]], "prusa": ["prusa-slicer", "-g", part, *SLIC3R, "-o", out["prusa"]],
            "slic3r": ["slic3r", "--no-gui", part, *SLIC3R, "-o", out["slic3r"]]}, out


def answer(path):
    """Heights at which beads are deposited, filament in mm, moves and short beads of a G-code file, by its text alone."""
    levels, moves, short, filament, e, relative = set(), 0, 0, 0.0, 0.0, False
    x = y = z = 0.0
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            if line.startswith("M83"):
                relative = True
            elif line.startswith("M82"):
                relative = False
            elif line.startswith("G92"):
                found = re.search(r"E(-?[\d.]+)", line)
                e = float(found.group(1)) if found else e
            if not line.startswith(("G1 ", "G0 ")):
                continue
            moves += 1
            words = {word[0]: word[1:] for word in line.split(";")[0].split()[1:]}
            z = float(words.get("Z", z))
            length = math.hypot(float(words.get("X", x)) - x, float(words.get("Y", y)) - y)
            x, y = float(words.get("X", x)), float(words.get("Y", y))
            if "E" not in words:
                continue
            fed = float(words["E"]) if relative else float(words["E"]) - e
            e = float(words["E"])
            if "X" in words or "Y" in words:
                filament += fed
                short += length < SHORT_MM
                levels.add(round(z, 3))
    return {"layers": len(levels), "filament_mm": filament, "moves": moves, "short": short, "bytes": os.path.getsize(path)}


def cura_resolution(definitions):
    """CuraEngine's own: segments shorter than the first may go if the path moves by no more than the second, mm."""
    with open(definitions, encoding="utf-8") as file:
        fixes = json.load(file)["settings"]["meshfix"]["children"]
    return [float(fixes["meshfix_maximum_" + name]["default_value"]) for name in ("resolution", "deviation")]


def compare_answers(lamina, answers, out):
    """Ends the benchmark where the programs did not do the same job."""
    own = answers["lamina"]
    for name in answers:
        if abs(answers[name]["layers"] - own["layers"]) > 1:
            sys.exit(f"bench: {name} deposited {answers[name]['layers']} layers, lamina {own['layers']}")
    share = own["filament_mm"] / answers["cura"]["filament_mm"]
    if abs(share - 1) > 0.2:
        sys.exit(f"bench: lamina's filament is {share:.2f} of CuraEngine's: not the same job")
    more = own["moves"] / answers["cura"]["moves"]
    if more > MOVES:
        sys.exit(f"bench: lamina writes {more:.2f} times CuraEngine's moves, more than {MOVES}")
    subprocess.run([lamina, "verify", out["lamina"], "--quiet"], check=True)


def run_all(options, cases, lamina, part, work, definitions):
    calls, out = commands(lamina, part, work, definitions)
    names = ["lamina", "cura"] + [name for name in SLOW if "slow" in cases]
    answers, runs = {}, {name: [] for name in names}
    for name in names:
        measure.say(f"bench: {name}, the answer")
        first = measure.measured(calls[name], os.path.join(work, name + ".log"))
        if name in SLOW:
            runs[name].append(first)
        answers[name] = answer(out[name])
    compare_answers(lamina, answers, out)
    for turn in range(options.runs):
        measure.say(f"bench: turn {turn + 1}")
        for name in ("lamina", "cura"):
            runs[name].append(measure.measured(calls[name], os.path.join(work, name + ".log")))
    result = {name: measure.median_of(runs[name]) | answers[name] for name in names}
    with open(os.path.join(work, "lamina.log"), encoding="utf-8") as file:
        summary = json.loads(file.read().splitlines()[-1])
    result["lamina"]["points"] = summary["stored_points"]
    result["lamina"]["tolerance_um"] = summary["tolerance_um"]
    result["cura"]["resolution_mm"], result["cura"]["deviation_mm"] = cura_resolution(definitions)
    return result


def write_block(path, x, y, z, radius):
    """A block in mm with a round hole upright through its middle, as text STL."""
    angles = [(i + 0.5) * math.pi / 180 for i in range(360)]
    angles += [math.atan2(sy * y, sx * x) % (2 * math.pi) for sx in (-1, 1) for sy in (-1, 1)]
    outer, inner = [], []
    for angle in sorted(angles):
        c, s = math.cos(angle), math.sin(angle)
        reach = min(x / 2 / abs(c) if abs(c) > 1e-12 else 1e9, y / 2 / abs(s) if abs(s) > 1e-12 else 1e9)
        outer.append((reach * c, reach * s))
        inner.append((radius * c, radius * s))
    with open(path, "w", encoding="ascii") as file:
        def facet(*corners):
            file.write("facet normal 0 0 0\nouter loop\n")
            file.writelines("vertex %.12g %.12g %.12g\n" % (*p, height) for p, height in corners)
            file.write("endloop\nendfacet\n")

        file.write("solid block\n")
        for a, b, c, d in zip(outer, outer[1:] + outer[:1], inner, inner[1:] + inner[:1]):
            facet((a, 0), (b, 0), (b, z))
            facet((a, 0), (b, z), (a, z))
            facet((a, z), (b, z), (d, z))
            facet((a, z), (d, z), (c, z))
            facet((a, 0), (d, 0), (b, 0))
            facet((a, 0), (c, 0), (d, 0))
            facet((c, 0), (d, z), (d, 0))
            facet((c, 0), (c, z), (d, z))
        file.write("endsolid block\n")


def memory_of_segments(lamina, work):
    """Peak MiB of jobs with and without segmentation, run in turn; medians of 15."""
    # name, block, job, segmentation, points of stretches that the summary has to count
    jobs = [("block of Fukuda 2020, 79 layers", (74, 100, 20, 12.5),
             ["--layer", "0.254", "--walls", "0", "--bead", "0.508", "--bead-gap", "2.4", "--angle", "0", "--angle-step", "0",
              "--set", "fill.first_line_mm=0.508", "--set", "fill.end_inset_mm=0.254"],
             ["--segment-rule", "fukuda", "--thin", "5", "--thick", "3"], 27334),
            ("200 x 200 x 6 mm, stretches of 0.5 mm", (200, 200, 6, 20), ["--layer", "0.2", "--walls", "1", "--bead", "0.4"],
             ["--thin", "0.5", "--thick", "0.5"], None)]
    rows = []
    for name, size, job, segments, points in jobs:
        part, log = os.path.join(work, "block.stl"), os.path.join(work, "memory.log")
        write_block(part, *size)
        for threads in (1, 2):
            measure.say(f"bench: memory, {name}, {threads} threads")
            row = {"name": name, "threads": threads}
            runs = {"plain": [], "segmented": []}
            for _ in range(15):
                for kind, fill in (("plain", ["--fill", "raster"]), ("segmented", ["--fill", "segmented", *segments])):
                    out = os.path.join(work, kind + ".gcode")
                    command = [lamina, "extrude", part, "--machine", "marlin", *job, *fill, "--overwrite", "--threads", str(threads), "--json", "--quiet", "-o", out]
                    runs[kind].append(measure.measured(command, log)["peak_mib"])
                    row[kind + "_bytes"] = os.path.getsize(out)
            with open(log, encoding="utf-8") as file:
                counted = json.loads(file.read().splitlines()[-1])["segments"]["points"]
            if points is not None and counted != points:
                sys.exit(f"bench: {counted} points of stretches, not {points}")
            row["points"] = counted
            for kind, peaks in runs.items():
                row[kind + "_mib"] = statistics.median(peaks)
            rows.append(row)
    return rows


def memory_lines(rows):
    lines = ["## Memory with and without segmentation", "",
             "The same job with `--fill raster` and `--fill segmented`, in alternating runs; medians of 15 peaks. Limit: 2 % above.", "",
             "| job | threads | points of stretches | plain file MB | segmented file MB | plain peak MiB | segmented peak MiB | difference |",
             "|---|---|---|---|---|---|---|---|"]
    for r in rows:
        lines.append(f"| {r['name']} | {r['threads']} | {r['points']} | {r['plain_bytes'] / 1e6:.2f} | {r['segmented_bytes'] / 1e6:.2f} | "
                     f"{r['plain_mib']:.2f} | {r['segmented_mib']:.2f} | {100 * (r['segmented_mib'] / r['plain_mib'] - 1):+.1f} % |")
    return lines + [""]


def speed_lines(programs):
    own = programs["lamina"]
    peers = [name for name in NAMES if name in programs]
    lines = [f"| program | wall s | processor s | peak MiB | layers | moves | of them beads below {SHORT_MM} mm | filament m | file MB |",
             "|---|---|---|---|---|---|---|---|---|"]
    for name, title in [("lamina", "lamina")] + [(name, NAMES[name]) for name in peers]:
        p = programs[name]
        lines.append(f"| {title} | {p['wall']:.2f} | {p['processor']:.2f} | {p['peak_mib']:.0f} | {p['layers']} | {p['moves']} | {p['short']} | "
                     f"{p['filament_mm'] / 1000:.2f} | {p['bytes'] / 1e6:.1f} |")
    cura = programs["cura"]
    ratios = {kind: {name: programs[name][kind] / own[kind] for name in peers} for kind in ("wall", "processor")}
    met = min(min(of.values()) for of in ratios.values()) >= TIMES
    return lines + [
        "", f"Deviation from the full contours: lamina {own['tolerance_um']:g} um at most; CuraEngine {1000 * cura['deviation_mm']:g} um, where segments "
        f"are shorter than {cura['resolution_mm']:g} mm. Moves: {own['moves'] / cura['moves']:.2f} times CuraEngine's, at most {MOVES}.",
        "Times as fast, by wall time: " + ", ".join(f"{NAMES[n]} {v:.1f}" for n, v in ratios["wall"].items()) + ". By processor seconds: " +
        ", ".join(f"{NAMES[n]} {v:.1f}" for n, v in ratios["processor"].items()) +
        f". Target: {TIMES} times as fast as the fastest, by both: {'met' if met else 'not met'}.",
        f"Peak memory {own['peak_mib']:.0f} MiB, the least of the others {min(programs[n]['peak_mib'] for n in peers):.0f} MiB. "
        f"{own['points'] / own['wall'] / 1e6:.2f} million toolpath points a second.", ""]


def page(result):
    machine = result["machine"]
    lines = ["# Toolpaths of 3DBenchy compared with other slicers", "",
             f"`scripts/bench extrude` on {result['date']} at {result['commit']}: {machine['processor']}, {machine['cores']} cores, "
             f"{machine['memory_gib']} GiB, {machine['system']}.", "",
             "225,154 triangles, 0.1 mm layers, two walls, 30 % lines, no solid layers, no supports; all else by each program's defaults; mesh "
             f"on disk to G-code on disk. Answers compared first; medians of {result['programs']['lamina']['runs']} alternating runs; the slow "
             "peers run once.", "", *speed_lines(result["programs"]), *memory_lines(result["memory"])]
    with open(os.path.join(ROOT, "bench/extrude.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines))
    print("\n".join(lines))


def main(arguments):
    options, programs, work = measure.comparison(arguments, __doc__, "lamina and CuraEngine once each", "extrude", ["lamina"], CASES, 5)
    cache, cases, lamina = options.cache, options.case or CASES, os.path.join(programs, "lamina")
    part = os.path.join(cache, "3DBenchy.stl")
    if not os.path.exists(part):
        axes = make_parts.read_3mf(os.path.join(options.models, "3DBenchy.3mf"))
        make_parts.write_stl(part, make_parts.placed(axes, (1, 1, 1)))
    result = {"date": time.strftime("%Y-%m-%d"), "commit": figures.commit(ROOT), "machine": figures.machine(cache)}
    if "cura" in cases or "slow" in cases:
        result["programs"] = run_all(options, cases, lamina, part, work, heights.cura_definitions(cache))
    if "memory" in cases:
        result["memory"] = memory_of_segments(lamina, work)
    shutil.rmtree(work)
    if set(cases) == set(CASES):
        figures.save(ROOT, "extrude", result)
        page(result)
    else:
        print("\n".join(speed_lines(result["programs"]) if "programs" in result else memory_lines(result["memory"])))


if __name__ == "__main__":
    main(sys.argv[1:])
