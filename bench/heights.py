"""scripts/bench heights: layer tables of real parts compared with Debian's Slic3r 1.3 and CuraEngine 4.13; writes bench/heights.md.

    scripts/bench heights [--models DIR] [--cache DIR] [--lamina PROGRAM] [--part NAME]... [--no-times]

Every table, the peers' too, is measured by the same code (`lamina heights --measure`): the highest step that any sloped
facet gets, the mean step over the surface, flats of at least 5 mm2 that no layer ends on, and where the last layer ends.
Each peer makes layers of 0.05 to 0.3 mm; the target of our tables is the step that the peer left. Only Python's standard
library. CuraEngine's settings are defined in Debian's package `cura`, which is downloaded and unpacked, not installed. The peers' layers are kept in the cache;
remove it to have them sliced again.
"""
import argparse
import glob
import itertools
import json
import math
import os
import re
import subprocess
import sys

import make_parts
import figures
from measure import build, say

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MINIMUM, MAXIMUM, FLAT_MM2 = 0.05, 0.3, 5
FIRST_LAYERS = (MAXIMUM, 0.1, MINIMUM)
PARTS = {
    "3DBenchy": "3DBenchy.3mf",
    "NIST artifact": "nist_am_test_artifact_v3b.stl",
    "Kickstarter": "fdm_test_kickstarter_autodesk.stl",
    "bunny": "stanford_bunny.stl",
    "sphere of 40 mm": None,
}
# Layers and largest step of earlier tables of the same peers, whose settings are not known any more.
EARLIER = {"3DBenchy": (("Slic3r", 462, 0.182), ("CuraEngine", 395, 0.295))}
# At least so many per cent fewer layers than the peer, at the step that it leaves.
GOALS = {"3DBenchy": {"Slic3r": 45, "CuraEngine": 50}, "sphere of 40 mm": {"Slic3r": 23, "CuraEngine": 18}}


def run(command, log=None):
    """Standard output of a command; ends the benchmark if it fails."""
    with open(log, "wb") if log else open(os.devnull, "wb") as errors:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=errors, stdin=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        sys.exit(f"bench: exit code {done.returncode} of: {' '.join(command)}")
    return done.stdout.decode(errors="replace")


def sphere(radius, rings, sectors):
    def point(ring, sector):
        polar, around = math.pi * ring / rings, 2 * math.pi * (sector % sectors) / sectors
        return (radius * math.sin(polar) * math.cos(around), radius * math.sin(polar) * math.sin(around),
                radius * (1 - math.cos(polar)))
    axes = [[], [], []]
    for ring in range(rings):
        for sector in range(sectors):
            a, b, c, d = point(ring, sector), point(ring + 1, sector), point(ring + 1, sector + 1), point(ring, sector + 1)
            for corners in ([(a, c, b)] if ring < rings - 1 else []) + ([(a, d, c)] if ring > 0 else []):
                for corner in corners:
                    for axis in range(3):
                        axes[axis].append(corner[axis])
    return axes


def write_part(name, models, folder):
    """The part as a binary STL that stands on z = 0, for all three programs; returns its path."""
    path = os.path.join(folder, name.replace(" ", "_") + ".stl")
    if os.path.exists(path):
        return path
    if PARTS[name] is None:
        axes = sphere(20, 128, 256)
    else:
        source = os.path.join(models, PARTS[name])
        axes = make_parts.read_3mf(source) if source.endswith(".3mf") else make_parts.read_stl(source)
    lows = [min(axis) for axis in axes]
    axes = [[value - low for value in axis] for axis, low in zip(axes, lows)]
    make_parts.write_stl(path, axes)
    return path


def tops_of(gcode, comment):
    """Heights at which layers were put, in mm, from a G-code's lines: the height of the first extrusion of each layer.

    CuraEngine starts the bunny with two layers below the bed where its first layer is 0.05 mm; they are not counted."""
    tops, height, extruded_at = [], 0.0, None
    for line in open(gcode, errors="replace", encoding="utf-8"):
        if not line.startswith(("G0 ", "G1 ")):
            if line.startswith(comment):
                extruded_at = None
            continue
        words = dict((word[0], word[1:]) for word in line.split(";")[0].split()[1:])
        if "Z" in words:
            height = float(words["Z"])
        if "E" in words and ("X" in words or "Y" in words) and float(words["E"]) > 0 and height != extruded_at:
            extruded_at = height
            tops.append(height)
    return sorted(set(round(top, 6) for top in tops if top > 0))


def slic3r(part, folder, first):
    settings = os.path.join(folder, "slic3r.ini")
    with open(settings, "w", encoding="ascii") as file:
        file.write(f"adaptive_slicing = 1\nadaptive_slicing_quality = 75%\nmatch_horizontal_surfaces = 1\nlayer_height = {MAXIMUM}\n"
                   f"first_layer_height = {first}\nmin_layer_height = {MINIMUM}\nmax_layer_height = {MAXIMUM}\nnozzle_diameter = 0.4\n"
                   "fill_density = 0\nperimeters = 1\ntop_solid_layers = 0\nbottom_solid_layers = 0\nskirts = 0\n"
                   "use_relative_e_distances = 1\nretract_length = 0\nbed_shape = 0x0,400x0,400x400,0x400\n"
                   "print_center = 200,200\n")
    out = os.path.join(folder, "slic3r.gcode")
    run(["slic3r", "--no-gui", "--load", settings, "-o", out, part], os.path.join(folder, "slic3r.log"))
    return tops_of(out, ";;never")


def cura_definitions(cache):
    installed = "/usr/share/cura/resources/definitions/fdmprinter.def.json"
    if os.path.exists(installed):
        return installed
    folder = os.path.join(cache, "cura")
    found = os.path.join(folder, installed.lstrip("/"))
    if not os.path.exists(found):
        os.makedirs(folder, exist_ok=True)
        say("bench: downloading Debian's package cura for CuraEngine's definitions")
        subprocess.run(["apt-get", "download", "cura"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["dpkg", "-x", glob.glob(os.path.join(folder, "cura_*.deb"))[0], folder], check=True)
    return found


def cura(part, folder, first, definitions):
    out = os.path.join(folder, "cura.gcode")
    middle, variation = (MINIMUM + MAXIMUM) / 2, (MAXIMUM - MINIMUM) / 2
    settings = {"adaptive_layer_height_enabled": "true", "layer_height": middle, "layer_height_0": first,
                "adaptive_layer_height_variation": variation, "adaptive_layer_height_variation_step": 0.01,
                "adaptive_layer_height_threshold": 0.2, "infill_line_distance": 0, "top_layers": 0, "bottom_layers": 0,
                "wall_line_count": 1, "adhesion_type": "none", "machine_width": 400, "machine_depth": 400, "machine_height": 400,
                "relative_extrusion": "true", "layer_0_z_overlap": 0, "retraction_enable": "false", "machine_start_gcode": "",
                "machine_end_gcode": "", "center_object": "true", "roofing_layer_count": 0}
    command = ["CuraEngine", "slice", "-j", definitions]
    for scope in ([], ["-e0"]):
        command += scope
        for name, value in settings.items():
            command += ["-s", f"{name}={value}"]
    run(command + ["-l", part, "-o", out], os.path.join(folder, "cura.log"))
    return tops_of(out, ";LAYER:")


class Ours:
    def __init__(self, program):
        self.program = program

    def tables(self, part, *options):
        text = run([self.program, "heights", part, "--flat-area", str(FLAT_MM2), "--format", "json", "--quiet", *options])
        return json.loads(text)["tables"]

    def table(self, part, way, cusp, *options):
        return self.tables(part, "--heights", way, "--thickness", f"{MINIMUM}..{MAXIMUM}", "--cusp", f"{cusp:.6f}", *options)[0]

    def measure(self, part, tops):
        return self.tables(part, "--layer", str(MAXIMUM), "--measure", tops)[0]


def row(name, table, than=None):
    fewer = "" if than is None else f"{100 * (1 - table['layers'] / than['layers']):.1f} %"
    flats = f"{table['flats_missed']} of {table['flats']}"
    return (f"| {name} | {table['layers']} | {fewer} | {table['largest_cusp_mm']:.4f} | {table['mean_cusp_mm']:.4f} | {flats} | "
            f"{1000 * table['largest_miss_mm']:.1f} | {1000 * table['top_miss_mm']:+.1f} |")


def part_section(name, part, ours, folder, definitions):
    say(f"bench: {name}")
    lines = [f"## {name}", "", "| table | layers | fewer than the peer | largest step, mm | mean step, mm | flats missed | "
             "by up to, um | top off by, um |", "|---|---|---|---|---|---|---|---|"]
    verdict = []
    for (peer, slicer), first in itertools.product([("Slic3r", slic3r), ("CuraEngine", cura)], FIRST_LAYERS):
        tops = os.path.join(folder, f"{os.path.basename(part)[:-4]}-{peer}-{first}.tops")
        if not os.path.exists(tops):
            heights = slicer(part, folder, first, *([definitions] if slicer is cura else []))
            with open(tops + ".part", "w", encoding="ascii") as file:
                file.write("".join(f"{height:.6f}\n" for height in heights))
            os.replace(tops + ".part", tops)
        theirs = ours.measure(part, tops)
        cusp = theirs["largest_cusp_mm"]
        lines.append(row(f"**{peer}**, first layer {first}", theirs))
        best = ours.table(part, "optimal", cusp)
        goal, fewer = GOALS.get(name, {}).get(peer), 100 * (1 - best["layers"] / theirs["layers"])
        if goal is not None:
            verdict.append(f"{peer} with a first layer of {first} mm: {fewer:.1f} % fewer layers, target {goal} %, "
                          + ("met" if fewer >= goal else "not met"))
        lines.append(row(f"`optimal`, step {cusp:.4f}", best, theirs))
        for way in ("cusp", "stepwise"):
            lines.append(row(f"`{way}`, step {cusp:.4f}", ours.table(part, way, cusp), theirs))
        say(f"  {peer} {theirs['layers']}, first layer {first}, step {cusp:.4f}; optimal {best['layers']}")
    for peer, layers, cusp in EARLIER.get(name, ()):
        for way in ("optimal", "cusp"):
            table = ours.table(part, way, cusp)
            lines.append(row(f"`{way}`, step {cusp}, compared with {layers} layers of {peer} that were measured with other settings",
                             table, {"layers": layers}))
    for table in ours.tables(part, "--thickness", f"{MINIMUM}..{MAXIMUM}", "--cusp", "0.1", "--compare"):
        lines.append(row(f"`{table['name']}`, step 0.1", table))
    return lines + ["", *(["; ".join(verdict) + ".", ""] if verdict else [])]


def times(ours, part, *options, turns=7):
    """The minimum wall seconds that runs report: load, surface, layers."""
    found = []
    for _ in range(turns):
        done = subprocess.run([ours.program, "heights", part, "--format", "csv", *options], check=True,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        found.append([float(value) for value in re.findall(r"([0-9.]+) s", done.stderr.decode().split("time")[-1])[:3]])
    return [min(column) for column in zip(*found)]


def tall_part(folder, height, facets):
    """A wavy column: every layer has slopes of its own."""
    path = os.path.join(folder, f"tall_{height}_{facets}.stl")
    if os.path.exists(path):
        return path
    sectors = 32
    rings = facets // (2 * sectors)
    axes = [[], [], []]

    def point(ring, sector):
        z = height * ring / rings
        radius = 20 + 6 * math.sin(z / 7) + 2 * math.sin(z / 1.3)
        around = 2 * math.pi * (sector % sectors) / sectors
        return radius * math.cos(around) + 30, radius * math.sin(around) + 30, z
    for ring in range(rings):
        for sector in range(sectors):
            a, b, c, d = point(ring, sector), point(ring, sector + 1), point(ring + 1, sector + 1), point(ring + 1, sector)
            for corner in (a, b, c, a, c, d):
                for axis in range(3):
                    axes[axis].append(corner[axis])
    make_parts.write_stl(path, axes)
    return path


def time_section(ours, models, folder):
    lines = ["## Time", "", f"Wall milliseconds, the least of 7 runs (load of the machine before them: {os.getloadavg()[0]:.1f}): reading the file (repair of the open column included), the pass "
             "over all facets, deciding the layers.", "",
             "| part | triangles | way | read | surface | layers | surface and layers / read |", "|---|---|---|---|---|---|---|"]
    terrain = os.path.join(folder, "terrain.stl")
    if not os.path.exists(terrain):
        make_parts.write_stl(terrain, make_parts.read_stl(os.path.join(models, "st_helens_terrain_645k.stl.gz")))
    paths = ("angle", "cusp", "stepwise", "optimal")
    cases = [("terrain, binary STL, in memory", terrain, 645364, (f"{MINIMUM}..{MAXIMUM}",), paths),
             ("terrain, as published: gzipped STL", os.path.join(models, "st_helens_terrain_645k.stl.gz"), 645364,
              (f"{MINIMUM}..{MAXIMUM}",), paths)]
    cases += [("column of 100 mm", tall_part(folder, 100, facets), facets, ("0.02..0.3",), ("cusp", "optimal"))
              for facets in (20_000, 80_000, 320_000)]
    cases += [(f"column of {height} mm", tall_part(folder, height, 80_000), 80_000, ("0.02..0.3",), ("cusp", "optimal"))
              for height in (250, 500, 1000)]
    for name, part, triangles, (thickness,), paths in cases:
        for way in paths:
            load, surface, layers = times(ours, part, "--heights", way, "--thickness", thickness, "--cusp", "0.1")
            lines.append(f"| {name} | {triangles:,} | `{way}` | {1000 * load:.1f} | {1000 * surface:.1f} | {1000 * layers:.1f} | "
                         f"{(surface + layers) / load:.2f} |")
            say("  " + lines[-1])
    return lines + [""]


def main(arguments):
    parser = argparse.ArgumentParser(prog="scripts/bench heights", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", default=os.environ.get("LAMINA_MODELS", os.path.join(ROOT, "../shared/models")))
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    parser.add_argument("--lamina", help="the program; without it, a release build is made")
    parser.add_argument("--part", action="append", choices=list(PARTS), help="this part only")
    parser.add_argument("--no-times", action="store_true", help="leave the section of times out, as on a busy machine")
    options = parser.parse_args(arguments)
    if not os.path.isdir(options.models):
        sys.exit(f"bench: {options.models}: no such folder; name the folder of real parts with --models")
    folder = os.path.join(os.path.abspath(options.cache), "heights")
    os.makedirs(folder, exist_ok=True)
    if not options.lamina:
        build("lamina")
    machine = figures.machine(options.cache)
    ours = Ours(options.lamina or os.path.join(ROOT, "build/release/lamina"))
    definitions = cura_definitions(os.path.abspath(options.cache))
    lines = ["# Layer heights, measured", "", "Written by `scripts/bench heights`; edits are lost.", "",
             f"{machine['processor']}, {machine['cores']} cores; {machine['system']}. Commit {figures.commit(ROOT)}.", "",
             f"Layers of {MINIMUM} to {MAXIMUM} mm in steps of 0.001. Peers: Debian's Slic3r 1.3 with adaptive slicing at its quality of "
             "75 % and horizontal surfaces matched, CuraEngine 4.13 with adaptive layers around 0.175 mm, variation 0.125 mm, "
             "steps of 0.01 mm, threshold 0.2 mm; both with a first layer of 0.3 mm, as by default, whose step may be the highest of "
             "all, and with one of 0.1 and 0.05 mm, so that their own choice decides. Every table is measured by the same code. A step is thickness times |n_z| of a "
             f"sloped facet; flats are horizontal faces of at least {FLAT_MM2} mm2, and the top; a flat is missed if no layer ends "
             "within 1 um of it.", ""]
    for name in options.part or PARTS:
        lines += part_section(name, write_part(name, options.models, folder), ours, folder, definitions)
    if options.part:
        print("\n".join(lines))
        return
    if not options.no_times:
        lines += time_section(ours, options.models, folder)
    with open(os.path.join(ROOT, "bench/heights.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines))
