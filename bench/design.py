#!/usr/bin/env python3
"""bench/design.py: jobs that lamina designs for target properties, compared with the solver. scripts/bench design

    scripts/bench design [--voxel UM]     writes bench/design.md

Ten targets within what the configurations of Di Nisio 2022 span as lamina predicts them (bench/pores.md), five outside, and two
gradients over a height of 25.4 mm. Each job that is written is planned again by `lamina extrude` for a cylinder of 25.4 mm: it has
to end without a warning of its segments.
"""
import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import pores  # noqa: E402
import tables  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))

INSIDE = ["--porosity 24 --permeability 100", "--porosity 22 --permeability 150", "--porosity 20 --permeability 60",
          "--porosity 19 --permeability 45", "--porosity 23", "--porosity 18", "--permeability 80", "--permeability 200",
          "--pore 0.12x0.9", "--pore 0.1x1 --porosity 21"]
OUTSIDE = ["--porosity 40", "--permeability 2000", "--porosity 12 --permeability 200", "--pore 0.3x1", "--pore 0.1x6"]
GRADIENTS = ["--permeability 60:150", "--porosity 20:24"]
HEIGHT = 25.4  # mm


def design(target, job, voxel):
    words = [LAMINA, "design", *target.split(), "--machine", "anet-a8", "--voxel", str(voxel), "--json", "--overwrite", "-o", job]
    start, used = time.perf_counter(), processor_seconds()
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return json.loads(done.stdout), done, (time.perf_counter() - start, processor_seconds() - used)


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def plan(job, folder, part="part.stl"):
    """Warnings of the job's plan, and k1 as `lamina permeability` predicts it in the middle, where it finds the period."""
    toolpaths = os.path.join(folder, "part.gcode")
    said = subprocess.run([LAMINA, "extrude", os.path.join(folder, part), "--job", job, "--overwrite", "--json", "-o", toolpaths],
                          check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    found = json.loads(subprocess.run([LAMINA, "permeability", toolpaths, "--json"], check=True, stdout=subprocess.PIPE).stdout)
    flow = found["flow"][2]
    again = f"{flow['k1_darcy']:.1f} +- {flow['k1_error_darcy']:.1f}" if all(found["repeats"]) else "-"
    return [warning for warning in json.loads(said.stdout)["warnings"] if "segment" in json.dumps(warning)], again


def keys_of(found):
    keys = found["segment"]
    return (f"{keys['thick_mm']:g} / {keys['thin_mm']:g}", f"{keys['thick_extrusion_percent']:g}", str(keys["continuous_lines"]),
            f"{keys['spacing_sc_mm']:g}")


def reported(found):
    return f"{100 * found['porosity']:.2f} | {found['k1_darcy']:.1f} +- {found['k1_error_darcy']:.1f} | " + "{:.3f} x {:.2f}".format(*found["pore_mm"])


def gradients(voxel, folder):
    """Lines of each region, and a line for each gradient."""
    rows, ends = [], []
    pores.write_cylinder(os.path.join(folder, "high.stl"), 25.4, HEIGHT)
    for target in GRADIENTS:
        job = os.path.join(folder, "gradient.toml")
        found, _, seconds = design(f"{target} --height {HEIGHT}", job, voxel)
        print(target, found["met"], f"{100 * found['miss']:.1f} %", f"{seconds[0]:.0f} s", file=sys.stderr)
        warnings, again = plan(job, folder, "high.stl") if found["met"] else ([], "-")
        for i, step in enumerate(found["steps"]):
            requested = step["target"]
            requested = f"{100 * requested['porosity']:.4g} %" if "porosity" in requested else f"{requested['k1_darcy']:.4g} D"
            middle = i == len(found["steps"]) // 2
            rows.append([f"`{target}`" if i == 0 else "", f"{step['from_mm']:g} to {step['to_mm']:g}", requested, *keys_of(step),
                         *reported(step).split(" | "), f"{100 * step['miss']:.1f}", again if middle else ""])
        ends.append(f"`{target} --height {HEIGHT}`: {'met' if found['met'] else 'not met'} within {100 * found['miss']:.1f} %, {found['runs']} forward "
                    f"runs, {seconds[0]:.0f} s, {seconds[1]:.0f} s of processors; porosity of the whole {100 * found['porosity']:.2f} %, "
                    f"regions in series {found['k1_in_series_darcy']:.1f} D; {len(warnings)} warnings of `lamina extrude`.")
    return rows, ends


def page(voxel):
    inside, outside, warned, within = [], [], 0, 0
    longest, longest_outside = [0, 0], [0, 0]
    with tempfile.TemporaryDirectory() as folder:
        pores.write_cylinder(os.path.join(folder, "part.stl"), 25.4, 3)
        for i, target in enumerate(INSIDE):
            job = os.path.join(folder, f"{i}.toml")
            found, done, seconds = design(target, job, voxel)
            longest = list(map(max, longest, seconds))
            print(target, found["met"], f"{100 * found['miss']:.1f} %", f"{seconds[0]:.0f} s, {seconds[1]:.0f} of processors", file=sys.stderr)
            again = "-"
            if found["met"]:
                warnings, again = plan(job, folder)
                warned += bool(warnings)
                within += 1
            inside.append([f"`{target}`", *keys_of(found), *reported(found).split(" | "), f"{100 * found['miss']:.1f}", again,
                           str(found["runs"]), f"{found['k1_over_slots']:.2f}", f"{seconds[0]:.0f}, {seconds[1]:.0f}"])
        for target in OUTSIDE:
            found, done, seconds = design(target, os.path.join(folder, "none.toml"), voxel)
            longest_outside = list(map(max, longest_outside, seconds))
            refused = done.returncode == 5 and not os.path.exists(os.path.join(folder, "none.toml"))
            print(target, done.returncode, f"{seconds[0]:.0f} s, {seconds[1]:.0f} of processors", file=sys.stderr)
            outside.append([f"`{target}`", "yes" if refused else "no", *reported(found).split(" | "), str(found["runs"]), f"{seconds[0]:.0f}, {seconds[1]:.0f}"])
        regions, ends = gradients(voxel, folder)
    machine = figures.machine(ROOT)
    yield "# Fillings designed for target properties, compared with the solver"
    yield ""
    yield (f"`scripts/bench design`, commit {figures.commit(ROOT)}, {machine['processor']}, {machine['cores']} cores. "
           f"`lamina design TARGET --machine anet-a8 --voxel {voxel:g}`; all seconds are of the whole command.")
    yield ""
    yield "## Within what the tables span"
    yield ""
    yield from tables.table(["target", "thick / thin, mm", "extrusion, %", "continuous lines", "S-C, mm", "porosity, %", "k1, D", "pore, mm",
                             "miss, %", "k1 again, 10 um, D", "forward runs", "k1 / slots", "seconds, of processors"], inside)
    yield ""
    yield (f"{within} of {len(INSIDE)} within 5 %, the longest took {longest[0]:.0f} s, {longest[1]:.0f} s of processors "
           f"(load of the machine in the end: {os.getloadavg()[0]:.1f}). `lamina extrude` warns of {warned} of the jobs. "
           "k1 again: `lamina permeability` of the job planned for a cylinder of 25.4 mm, cubes of 10 um; - where the period is longer "
           "than the maximum of 3.6 mm.")
    yield ""
    yield "## Outside"
    yield ""
    yield (f"The longest took {longest_outside[0]:.0f} s, {longest_outside[1]:.0f} s of processors.")
    yield ""
    yield from tables.table(["target", "refused", "nearest: porosity, %", "k1, D", "pore, mm", "forward runs", "seconds, of processors"], outside)
    yield ""
    yield "## From the bottom to the top"
    yield ""
    yield from tables.table(["target", "heights, mm", "of the region", "thick / thin, mm", "extrusion, %", "continuous lines", "S-C, mm", "porosity, %",
                             "k1, D", "pore, mm", "miss, %", "k1 again, 10 um, D"], regions)
    yield ""
    yield from ends
    yield "k1 again: of the region in the middle of a cylinder as high as wide."


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxel", type=float, default=10, help="um, across the lines")
    options = parser.parse_args(arguments)
    lines = list(page(options.voxel))
    with open(os.path.join(ROOT, "bench/design.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    print("wrote bench/design.md")


if __name__ == "__main__":
    main(sys.argv[1:])
