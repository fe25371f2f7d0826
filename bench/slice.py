#!/usr/bin/env python3
"""bench/slice.py: contours, whole programs and stages, against Debian's Slic3r 1.3 and admesh. scripts/bench slice

    scripts/bench slice [--runs N] [--models DIR] [--cache DIR]

Whole programs run in turn on the same binary STL: Slic3r's --export-svg and lamina slice to SVG; admesh's load and check,
and lamina slice on one thread with nothing written but its manifest. Before a figure is kept, the answers are compared:
the number of layers, and the area of all contours of every layer. Stages are timed by lamina_bench (bench/slice.cpp),
which checks its own answers. Writes bench/results/slice.json and bench/slice.md, unless only some cases are requested.
"""
import json
import os
import re
import shutil
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import measure  # noqa: E402

LAYER = 0.1
# part, how many times as fast as Slic3r we mean to be
CASES = {"terrain": ("terrain.stl", 40), "3dbenchy": ("benchy.stl", 20), "benchy15": ("benchy15.stl", 20)}
ADMESH_SHARE = 1 / 3
SEGMENTS = {"cut": 20e6, "cut+chain": 10e6}


def area_of(numbers):
    """Of a polygon x0 y0 x1 y1 ..., signed."""
    points = list(zip(numbers[0::2], numbers[1::2]))
    return sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(points, points[1:] + points[:1])) / 2


def slic3r_areas(path):
    """mm2 of each layer of Slic3r's SVG: its contours less its holes."""
    areas = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            if "<g id=" in line:
                areas.append(0.0)
            found = re.search(r'slic3r:type="(\w+)" points="([^"]*)"', line)
            if found:
                area = abs(area_of([float(number) for number in found[2].replace(",", " ").split()]))
                areas[-1] += area if found[1] == "contour" else -area
    return areas


def own_areas(path):
    areas = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            if "<g id=" in line:
                areas.append(0.0)
            found = re.search(r'<path d="([^"]*)" style="fill: white', line)
            if found:
                areas[-1] += sum(area_of([float(number) for number in contour.split()[1:]])
                                 for contour in found[1].split("z") if contour.strip())
    return [abs(area) for area in areas]


def compare(case, slic3r_svg, own_svg):
    theirs, ours = slic3r_areas(slic3r_svg), own_areas(own_svg)
    if abs(len(theirs) - len(ours)) > 1:
        sys.exit(f"bench: {case}: Slic3r has {len(theirs)} layers, ours {len(ours)}")
    total = sum(ours)
    differences = sorted((abs(a - b) for a, b in zip(theirs, ours)), reverse=True)
    different = sum(differences) / total
    # Where Slic3r cannot close a loop it leaves out a hole or an island: single layers, far off.
    torn = sum(1 for a, b in zip(theirs, ours) if abs(a - b) > 0.001 * b)
    measure.say(f"  {len(ours)} layers, Slic3r {len(theirs)}; areas differ by {100 * different:.4f} % of {total:.0f} mm2")
    if different > 0.01:
        sys.exit(f"bench: {case}: the areas are not Slic3r's")
    return {"layers": len(ours), "slic3r_layers": len(theirs), "area_difference": different, "torn_layers": torn,
            "area_difference_of_others": sum(differences[torn:]) / total, "area_mm2": total}


def bitmap_difference(lamina, path, out, answers):
    """Of all areas from the exact bitmaps at 1200 dpi, whose pixels are decided in integers without any contour."""
    subprocess.run([lamina, "jet", path, "--layer", str(LAYER), "--dpi", "1200", "--format", "null", "--quiet", "-o", out], check=True)
    with open(os.path.join(out, "manifest.json"), encoding="utf-8") as file:
        pixels = sum(int(count) for count in re.findall(r'"set_pixels": ?(\d+)', file.read()))
    return abs(pixels * (25.4 / 1200) ** 2 - answers["area_mm2"]) / answers["area_mm2"]


def run_case(case, options, lamina, parts, work):
    part, target = CASES[case]
    path = os.path.join(parts, part)
    measure.say(f"bench: {case}: {part}, layers of {LAYER} mm")
    with open(path, "rb") as file:  # into the page cache, for all
        while file.read(1 << 22):
            pass
    out, svg = os.path.join(work, case), os.path.join(work, case + ".svg")
    runs = {"slic3r": [], "svg": [], "admesh": [], "null": []}
    commands = {
        "slic3r": ["slic3r", "--export-svg", "--layer-height", str(LAYER), "--first-layer-height", str(LAYER), "-o", svg, path],
        "svg": [lamina, "slice", path, "--layer", str(LAYER), "--json", "--quiet", "-o", out],
        "admesh": ["admesh", path],
        "null": [lamina, "slice", path, "--layer", str(LAYER), "--format", "null", "--threads", "1", "--json", "--quiet",
                 "-o", out + "-null"]}
    answers = None
    for turn in range(options.runs):
        for name in ("slic3r", "svg", "svg", "svg", "admesh", "null", "null", "null"):
            shutil.rmtree(out if name == "svg" else out + "-null", ignore_errors=True)
            runs[name].append(measure.measured(commands[name], os.path.join(work, name + ".log")))
        measure.say("  " + "  ".join(f"{name} {runs[name][-1]['wall']:.3f} s" for name in runs))
        if turn == 0:
            answers = compare(case, svg, os.path.join(out, os.path.splitext(part)[0] + ".svg"))
    answers["bitmap_difference"] = bitmap_difference(lamina, path, out + "-jet", answers)
    with open(os.path.join(work, "slic3r.log"), encoding="utf-8", errors="replace") as file:
        answers["slic3r_open_loops"] = file.read().count("Unable to close this loop")
    with open(os.path.join(work, "svg.log"), encoding="utf-8", errors="replace") as file:
        text = file.read()
    summary = json.loads(text[text.index("{"):])
    summary["output"] = os.path.basename(summary["output"])
    return {"part": part, "target": target, "layer_mm": LAYER, "answers": answers,
            "summary": summary, **{name: measure.median_of(of) for name, of in runs.items()}}


def stages(program, options):
    output = subprocess.run([program, "--benchmark_filter=^slice/(terrain_gz|benchy_3mf|gyroid_gz)/", "--benchmark_format=json",
                             "--benchmark_repetitions=3", "--benchmark_min_time=0.1"], check=True, stdout=subprocess.PIPE,
                            env=dict(os.environ, LAMINA_MODELS=options.models)).stdout
    return {entry["run_name"].removeprefix("slice/"): {key: entry[key] for key in ("cpu_time", "segments", "segments/s", "triangles/s")
                                                       if key in entry}
            for entry in json.loads(output)["benchmarks"] if entry.get("aggregate_name") == "median"}


def page(result):
    machine = result["machine"]
    lines = ["# Contours, measured", "",
             "Written by `scripts/bench slice` from `bench/results/slice.json`; do not edit.", "",
             f"{result['date']}, commit {result['commit']}: {machine['cores']} cores of {machine['processor']}, "
             f"{machine['memory_gib']} GiB, {machine['system']}, g++ {machine['compiler']}; load of the machine before: "
             f"{result['load']:.1f}.", "",
             "## Whole programs", "",
             "Binary STL on disk to files on disk, medians. Slic3r 1.3 `--export-svg` against `lamina slice` to SVG, both with all "
             "cores; admesh's load and check against `lamina slice --format null --threads 1`, which loads, checks and indexes the mesh, "
             "cuts, chains, merges and nests the contours of every layer and writes none. admesh cuts no layers, so only our time grows "
             "with their number.", "",
             "| part | triangles | layers | Slic3r, s (cpu) | lamina, s (cpu) | times as fast, wall (cpu) | meant | areas differ by |",
             "|---|---|---|---|---|---|---|---|"]
    for case in result["cases"].values():
        theirs, ours = case["slic3r"], case["svg"]
        lines.append(f"| {case['part']} | {case['summary']['triangles']:,} | {case['answers']['layers']} | {theirs['wall']:.2f} "
                     f"({theirs['processor']:.2f}) | {ours['wall']:.3f} ({ours['processor']:.3f}) | "
                     f"**{theirs['wall'] / ours['wall']:.0f}** ({theirs['processor'] / ours['processor']:.0f}) | {case['target']} | "
                     f"{100 * case['answers']['area_difference']:.4f} % |")
    for case in result["cases"].values():
        answers = case["answers"]
        if "torn_layers" in answers:
            lines += ["", f"{case['part']}: Slic3r reports {answers['slic3r_open_loops']} loops that it cannot close. {answers['torn_layers']} "
                      f"layers differ by more than 0.1 %; all others together by {100 * answers['area_difference_of_others']:.6f} %. The areas of "
                      f"our contours differ from those of the exact 1200 dpi bitmaps at the same heights by {100 * answers['bitmap_difference']:.5f} %."]
    lines += ["", "| part | admesh, s (cpu) | lamina on one core, nothing written, s (cpu) | share of admesh's, wall (cpu) | meant |",
              "|---|---|---|---|---|"]
    for case in result["cases"].values():
        theirs, ours = case["admesh"], case["null"]
        lines.append(f"| {case['part']} | {theirs['wall']:.3f} ({theirs['processor']:.3f}) | {ours['wall']:.3f} ({ours['processor']:.3f}) | "
                     f"{ours['wall'] / theirs['wall']:.2f} ({ours['processor'] / theirs['processor']:.2f}) | {ADMESH_SHARE:.2f} |")
    lines += ["", "Peak memory: " + "; ".join(f"{case['part']}: Slic3r {case['slic3r']['peak_mib']:.0f} MiB, lamina "
                                              f"{case['svg']['peak_mib']:.0f} MiB" for case in result["cases"].values()) + ".", "",
              "## Stages, one core", "",
              "Layers of 0.1 mm. *cut*: find the facets of each plane and their crossings; *cut+chain*: and assemble them to closed "
              "chains; *contours*: and drop collinear points, find contacts, merge and nest.", "",
              "| part | stage | ms | million segments a second | meant |", "|---|---|---|---|---|"]
    for name, entry in result["stages"].items():
        part, stage = name.split("/")
        rate = entry.get("segments/s")
        lines.append(f"| {part} | {stage} | {entry['cpu_time']:.1f} | " +
                     (f"{rate / 1e6:.1f} | " if rate else f"({entry['triangles/s'] / 1e6:.1f} million triangles a second) | ") +
                     (f"{SEGMENTS[stage] / 1e6:.0f} |" if stage in SEGMENTS else "|"))
    lines += ["", "For scale, by their authors: Minetto et al. 2017 assemble 2.2 to 2.6 million segments a second, da Silva et al. 2025 "
              "slice and assemble 6 to 12 (other machines).", ""]
    with open(os.path.join(ROOT, "bench", "slice.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines))


def main(arguments):
    options, programs, work = measure.comparison(arguments, __doc__, "Slic3r once, ours three times, admesh once, ours three times",
                                                 "slice", ["lamina", "lamina_bench"], CASES)
    cache, parts = options.cache, os.path.join(options.cache, "parts")
    subprocess.run([sys.executable, os.path.join(ROOT, "bench/make_parts.py"), options.models, parts], check=True)
    result = {"date": time.strftime("%Y-%m-%d"), "commit": figures.commit(ROOT), "machine": figures.machine(cache),
              "load": round(os.getloadavg()[0], 1), "cases": {}}
    for case in options.case or CASES:
        result["cases"][case] = run_case(case, options, os.path.join(programs, "lamina"), parts, work)
    result["stages"] = stages(os.path.join(programs, "lamina_bench"), options)
    shutil.rmtree(work)
    if options.case:
        print(json.dumps(result, indent=1))
        return
    figures.save(ROOT, "slice", result)
    page(result)


if __name__ == "__main__":
    main(sys.argv[1:])
