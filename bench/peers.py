#!/usr/bin/env python3
"""bench/peers.py: volumes by kind next to PrusaSlicer's and CuraEngine's, and times next to CuraEngine's. scripts/bench peers

    scripts/bench peers [--runs N] [--case volumes|time] [--part NAME]... [--models DIR] [--cache DIR] [--programs DIR --commit NAME]

0.2 mm layers, beads of 0.4 mm, two walls, 20 % grid, four solid layers above and three below, brim of 5 mm. The settings are equal where
programs have them (settings of PRUSA and CURA below). Every part is exported once by lamina, so that all programs load the same facets.

Volumes are E of beads times the section of the filament, by the ;TYPE: tags; moves without x and y (retraction) do not count. The sums
are compared with the totals that lamina and PrusaSlicer state, and the walls of a box with hand-calculated ones. CuraEngine tags beads
in gaps as skin and reduces the flow of overlapping walls: more runs without gaps and without the reduction give those volumes. Ribs of
several thicknesses show overlaps. Case time alternates lamina and CuraEngine on 3DBenchy, then compares the bytes of several numbers of
threads and the peak memory. Writes bench/results/peers.json and bench/peers.md, unless only some cases or parts are requested.
"""
import argparse
import hashlib
import json
import math
import os
import re
import shutil
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import heights  # noqa: E402
import measure  # noqa: E402
from tables import table  # noqa: E402

LAYER, WIDTH, WALLS, DENSITY, TOP, BOTTOM, BRIM, FILAMENT = 0.2, 0.4, 2, 20, 4, 3, 5, 1.75
RIBS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.15, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 2.0)  # mm
BED, SIDE, TAPER = 220, 20, 0.075  # mm; side and height of the box, and how much each layer of the frustum is further in
PITCH = WIDTH - LAYER * (1 - math.pi / 4)  # also the section of a stadium over its height
CASES = ("volumes", "time")
NEAR, TIMES = 0.03, 10  # limits of the walls, and how many times as fast as CuraEngine
PARTS = {"box": 0, "frustum": TAPER, "step": None, "3DBenchy": ("3DBenchy.3mf",), "nut": ("parameter_quality_nut.stl",),
         "motor_bracket": ("motor_bracket.stl.gz",), "nist_artifact": ("nist_am_test_artifact_v3b.stl",),
         "electronics_box": ("electronics_box_assembly_inch.stl", "--unit", "inch"), "dental_crown": ("dental_crown.stl",),
         "kickstarter_test": ("fdm_test_kickstarter_autodesk.stl",), "herringbone_wheels": ("herringbone_wheels_x4.stl",),
         "screw_cap": ("screw_cap_insert_threads.stl",), "am_coin": ("am_coin_embossed_text.stl",),
         "cube_gears": ("cube_gears_17_items.3mf",),
         "honeycomb_vase": ("honeycomb_vase_1mm_wall.stl.gz",)}
KINDS = ("outer", "inner", "thin", "gap", "solid", "sparse", "brim", "other")
KIND_OF = {  # of each tag of the three programs
    "External perimeter": "outer", "Perimeter": "inner", "Overhang perimeter": "inner", "Gap fill": "gap", "Solid infill": "solid",
    "Top solid infill": "solid", "Bridge infill": "solid", "Internal infill": "sparse", "Skirt/Brim": "brim", "Skirt": "brim",
    "WALL-OUTER": "outer", "WALL-INNER": "inner", "SKIN": "solid", "FILL": "sparse", "SKIRT": "brim"}
PRUSA = {"layer_height": LAYER, "first_layer_height": LAYER, "nozzle_diameter": 0.4, "filament_diameter": FILAMENT,
         "perimeters": WALLS, "fill_density": f"{DENSITY}%", "fill_pattern": "grid", "top_fill_pattern": "rectilinear",
         "bottom_fill_pattern": "rectilinear", "top_solid_layers": TOP, "bottom_solid_layers": BOTTOM, "top_solid_min_thickness": 0,
         "bottom_solid_min_thickness": 0, "solid_infill_every_layers": 0, "solid_infill_below_area": 0,
         "ensure_vertical_shell_thickness": 0, "extra_perimeters": 0, "thin_walls": 1, "gap_fill_enabled": 1, "overhangs": 0,
         "thick_bridges": 0, "bridge_flow_ratio": 1, "infill_overlap": 0, "infill_anchor": 0, "infill_anchor_max": 0,
         "brim_type": "outer_only", "brim_separation": 0, "skirts": 0, "support_material": 0, "elefant_foot_compensation": 0,
         "resolution": 0, "gcode_resolution": 0, "start_gcode": "", "end_gcode": "", "max_print_height": 250,
         "bed_shape": f"0x0,{BED}x0,{BED}x{BED},0x{BED}",
         **{name + "extrusion_width": WIDTH for name in ("", "external_perimeter_", "perimeter_", "first_layer_", "infill_", "solid_infill_",
                                                        "top_infill_", "support_material_")}}
CURA = {"layer_height": LAYER, "layer_height_0": LAYER, "wall_thickness": WALLS * WIDTH, "wall_line_count": WALLS,
        **{name + "line_width": WIDTH for name in ("", "wall_", "skin_", "infill_", "skirt_brim_", "roofing_")},
        "wall_line_width_0": WIDTH, "wall_line_width_x": WIDTH, "initial_layer_line_width_factor": 100, "wall_0_inset": 0,
        "top_layers": TOP, "bottom_layers": BOTTOM, "initial_bottom_layers": BOTTOM, "roofing_layer_count": 0,
        "skin_outline_count": 0, "skin_overlap": 0, "skin_overlap_mm": 0, "skin_preshrink": 0, "top_skin_preshrink": 0,
        "bottom_skin_preshrink": 0, "expand_skins_expand_distance": WIDTH, "top_skin_expand_distance": WIDTH,
        "bottom_skin_expand_distance": WIDTH, "infill_pattern": "grid", "infill_sparse_density": DENSITY,
        "infill_line_distance": WIDTH * 2 * 100 / DENSITY, "infill_overlap": 0, "infill_overlap_mm": 0,
        "infill_sparse_thickness": LAYER, "skin_edge_support_layers": 0, "skin_edge_support_thickness": 0,
        "fill_perimeter_gaps": "everywhere", "fill_outline_gaps": "true", "min_infill_area": 0, "ironing_enabled": "false",
        "brim_width": BRIM, "skirt_brim_minimal_length": 0, "support_enable": "false", "center_object": "true",
        "retraction_combing": "off", "machine_width": BED, "machine_depth": BED, "machine_height": 250, "machine_nozzle_size": 0.4,
        "material_diameter": FILAMENT, "machine_start_gcode": "", "machine_end_gcode": ""}
COMPENSATION = [f"travel_compensate_overlapping_walls{kind}_enabled" for kind in ("", "_0", "_x")]


def write_facets(path, facets):
    with open(path, "w", encoding="ascii") as file:
        file.write("solid made\n")
        for facet in facets:
            file.write("facet normal 0 0 0\nouter loop\n" + "".join("vertex %g %g %g\n" % corner for corner in facet) + "endloop\nendfacet\n")
        file.write("endsolid made\n")


def write_block(path, corners):
    """A convex body of eight corners, in the order of a box: x fastest, then y, then z."""
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    write_facets(path, [[corners[i] for i in facet] for a, b, c, d in sides for facet in ((a, b, c), (a, c, d))])


def write_frustum(path, taper):
    """A box whose sides are inclined: each layer is that far further in. Without, volumes are hand-calculated."""
    inset = taper * SIDE / LAYER
    write_block(path, [(abs(x - d), abs(y - d), z) for z, d in ((0, 0), (SIDE, inset)) for y in (0, SIDE) for x in (0, SIDE)])


def write_step(path):
    """The box without the upper half of its right half: a horizontal face at half of the height."""
    half = SIDE / 2
    outline = [(0, 0), (SIDE, 0), (SIDE, half), (half, half), (half, SIDE), (0, SIDE)]  # x, z; counter-clockwise
    front = [[(outline[i][0], 0, outline[i][1]) for i in facet] for facet in ((0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5))]
    back = [[(x, SIDE, z) for x, _, z in reversed(facet)] for facet in front]
    sides = []
    for (x, z), (to_x, to_z) in zip(outline, outline[1:] + outline[:1]):
        sides += [[(x, 0, z), (to_x, SIDE, to_z), (to_x, 0, to_z)], [(x, 0, z), (x, SIDE, z), (to_x, SIDE, to_z)]]
    write_facets(path, front + back + sides)


def prepare(lamina, models, name, folder):
    """The part as all programs load it: repaired and placed by `lamina export`."""
    path, options = os.path.join(folder, name + ".stl"), PARTS[name]
    if not isinstance(options, tuple):
        options = (os.path.join(folder, "made.stl"),)
        if name == "step":
            write_step(options[0])
        else:
            write_frustum(options[0], PARTS[name])
    subprocess.run([lamina, "export", os.path.join(models, options[0]), *options[1:], "--bed", f"{BED}x{BED}", "--overwrite", "--quiet",
                    "-o", path], check=True)
    return path


def lamina_command(lamina, part, out, brim, *more):
    return [lamina, "extrude", part, "--machine", "marlin", "--layer", str(LAYER), "--bead", str(WIDTH), "--walls", str(WALLS), "--density",
            str(DENSITY), "--pattern", "grid", "--top-layers", str(TOP), "--bottom-layers", str(BOTTOM), "--skirt", "0",
            *(["--brim", str(BRIM)] if brim else []), "--overwrite", "--json", "--quiet", "-o", out, *more]


def prusa_command(part, out, generator, brim, **more):
    settings = out + ".ini"
    with open(settings, "w", encoding="ascii") as file:
        for key, value in {**PRUSA, **more}.items():
            file.write(f"{key} = {value}\n")
        file.write(f"perimeter_generator = {generator}\nbrim_width = {BRIM if brim else 0}\n")
    return ["prusa-slicer", "-g", part, "--load", settings, "--center", f"{BED // 2},{BED // 2}", "-o", out]


def cura_command(part, out, definitions, brim, **more):
    command = ["CuraEngine", "slice", "-j", definitions]
    adhesion = {"adhesion_type": "brim" if brim else "none", "brim_line_count": math.ceil(BRIM / WIDTH - 1e-9) if brim else 0}
    for scope in ([], ["-e0"]):
        command += scope
        for name, value in {**CURA, **adhesion, **more}.items():
            command += ["-s", f"{name}={value}"]
    return command + ["-l", part, "-o", out]


def volumes(path):
    """mm3 by kind, the number of layers with beads, and the total that the file states (mm3 or None)."""
    feeds, levels, kind, stated = dict.fromkeys(KINDS, 0.0), set(), "other", None
    e, z, relative, section = 0.0, "0", False, math.pi / 4 * FILAMENT**2
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            if line.startswith(";TYPE:"):
                kind = KIND_OF.get(line[6:].strip(), "other")
            elif line.startswith("; filament used [mm] ="):
                stated = float(line.split("=")[1]) * section
            elif line.startswith("M83"):
                relative = True
            elif line.startswith("M82"):
                relative = False
            elif line.startswith("G92"):
                found = re.search(r"E(-?[\d.]+)", line)
                e = float(found.group(1)) if found else e
            elif line.startswith(("G1 ", "G0 ")):
                words = {word[0]: word[1:] for word in line.split(";")[0].split()[1:]}
                z = words.get("Z", z)
                if "E" not in words:
                    continue
                fed = float(words["E"]) - (0 if relative else e)
                e = float(words["E"])
                if fed > 0 and ("X" in words or "Y" in words):
                    feeds[kind] += fed
                    levels.add(z)
            elif line.startswith(("G2 ", "G3 ")):
                sys.exit(f"bench: arc in {path}")
    return {kind: feed * section for kind, feed in feeds.items()}, len(levels), stated


def checked(name, path, stated):
    """Volumes of a file, whose sum has to be the stated one. stated  mm3 or None for that of the file"""
    found, layers, own = volumes(path)
    own = stated if stated is not None else own
    total = sum(found.values())
    if own is not None and abs(total / own - 1) > 0.005:
        sys.exit(f"bench: {name} states {own:.1f} mm3, its beads have {total:.1f}")
    if found["other"] > 0.001 * total:
        sys.exit(f"bench: {name} has {found['other']:.2f} mm3 of an unknown kind")
    return found | {"layers": layers}


def split_gaps(full, without_thin, without_gaps):
    """Moves CuraEngine's beads in thin walls and gaps from `solid` to their kinds, from runs without them."""
    full["thin"] = full["solid"] - without_thin["solid"]
    full["gap"] = without_thin["solid"] - without_gaps["solid"]
    full["solid"] = without_gaps["solid"]
    return full


def volumes_of(lamina, models, name, work, definitions, brim):
    part = prepare(lamina, models, name, work)
    row, log = {"programs": {}}, os.path.join(work, "peers.log")
    programs = row["programs"]

    def run(key, command, path):
        measure.say(f"bench: {name}, {key}")
        taken = measure.measured(command, log)
        stated = None
        with open(log, encoding="utf-8", errors="replace") as file:
            text = file.read()
        if key.startswith("lamina"):
            summary = json.loads(text.splitlines()[-1])
            stated, row["part_mm3"] = summary["filament_mm3"], summary["solid_mm3"]
        return checked(f"{name}, {key}", path, stated) | {"wall": taken["wall"], "peak_mib": taken["peak_mib"]}

    out = {key: os.path.join(work, key + ".gcode") for key in ("lamina", "rectangle", "classic", "arachne", "cura")}
    programs["lamina"] = run("lamina", lamina_command(lamina, part, out["lamina"], brim), out["lamina"])
    programs["rectangle"] = run("lamina, rectangles", lamina_command(lamina, part, out["rectangle"], brim, "--machine-set",
                                                                "material.bead_area=rectangle"), out["rectangle"])
    for generator in ("classic", "arachne"):
        programs[generator] = run("PrusaSlicer " + generator, prusa_command(part, out[generator], generator, brim), out[generator])
    programs["cura"] = run("cura", cura_command(part, out["cura"], definitions, brim), out["cura"])
    fewer = [run("cura without thin walls", cura_command(part, out["cura"], definitions, brim, fill_outline_gaps="false"), out["cura"]),
             run("cura without gaps", cura_command(part, out["cura"], definitions, brim, fill_outline_gaps="false",
                                                   fill_perimeter_gaps="nowhere"), out["cura"])]
    split_gaps(programs["cura"], *fewer)
    whole = run("cura without overlap compensation", cura_command(part, out["cura"], definitions, brim, **dict.fromkeys(COMPENSATION, "false")),
                out["cura"])
    programs["cura"]["compensated"] = whole["outer"] + whole["inner"] - programs["cura"]["outer"] - programs["cura"]["inner"]
    for of in programs.values():
        of["walls"] = of["outer"] + of["inner"] + of["thin"]
        of["body"] = sum(of[kind] for kind in KINDS if kind != "brim")
        of["total"] = of["body"] + of["brim"]
    with open(part, "rb") as file:
        row["facets"] = int.from_bytes(file.read(84)[80:], "little")
    row["digests"] = digests(lamina, part, work, brim)
    return row


def digests(lamina, part, work, brim):
    """SHA-256 of the file by numbers of threads."""
    out, found = os.path.join(work, "threads.gcode"), {}
    for threads in (1, 2, 4):
        subprocess.run(lamina_command(lamina, part, out, brim, "--threads", str(threads)), check=True, stdout=subprocess.DEVNULL)
        with open(out, "rb") as file:
            found[str(threads)] = hashlib.sha256(file.read()).hexdigest()
    return found


def ribs(lamina, work):
    """Extruded over true volume of upright ribs by their thickness, at 100 %: lamina, and PrusaSlicer classic."""
    part, out, rows = os.path.join(work, "rib.stl"), os.path.join(work, "rib.gcode"), []
    for thickness in RIBS:
        write_block(part, [(x, y, z) for z in (0, 4) for y in (0, thickness) for x in (0, 30)])
        own = lamina_command(lamina, part, out, False)
        for key, value in (("--density", "100"), ("--pattern", "raster")):
            own[own.index(key) + 1] = value
        for key in ("--top-layers", "--bottom-layers"):
            del own[own.index(key):own.index(key) + 2]
        row = {"thickness": thickness}
        for name, command in (("lamina", own), ("classic", prusa_command(part, out, "classic", False, fill_density="100%",
                                                                         fill_pattern="rectilinear"))):
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            row[name] = sum(volumes(out)[0].values()) / (30 * 4 * thickness)
        rows.append(row)
    return rows


def check_box(programs):
    """Ends the benchmark where the walls of the box differ from hand-calculated ones: stadiums one pitch apart, or rectangles."""
    for name, of in programs.items():
        pitch = WIDTH if name in ("rectangle", "cura") else PITCH
        for kind, inset in (("outer", WIDTH / 2), ("inner", WIDTH / 2 + pitch)):
            expected = 4 * (SIDE - 2 * inset) * SIDE * pitch  # section times height of all layers
            if abs(of[kind] / expected - 1) > 0.002:
                sys.exit(f"bench: {kind} walls of the box by {name}: {of[kind]:.2f} mm3, not {expected:.2f}")


def time_case(lamina, models, work, definitions, brim, runs):
    """lamina and CuraEngine in alternation on 3DBenchy, and peak memory of lamina by layers, threads and limit."""
    part, log = prepare(lamina, models, "3DBenchy", work), os.path.join(work, "peers.log")
    out = {name: os.path.join(work, f"time-{name}.gcode") for name in ("lamina", "cura", "combing")}
    calls = {"lamina": lamina_command(lamina, part, out["lamina"], brim, "--tolerance", "25"), "cura": cura_command(part, out["cura"], definitions, brim),
             "combing": cura_command(part, out["combing"], definitions, brim, retraction_combing="all")}
    taken = {name: [] for name in calls}
    for turn in range(runs + 1):
        measure.say(f"bench: turn {turn} of {runs}")
        for name, call in calls.items():
            run = measure.measured(call, log)
            if turn > 0:  # the first one loads the files
                taken[name].append(run)
    result = {name: measure.median_of(of) | {"walls_s": [run["wall"] for run in of], "bytes": os.path.getsize(out[name])}
              for name, of in taken.items()}
    memory = []
    for layer in (0.2, 0.1, 0.05):
        for options in (("--threads", "1"), ("--threads", "2"), ("--threads", "4"), ("--threads", "4", "--memory", "32M")):
            command = lamina_command(lamina, part, out["lamina"], brim, *options)
            command[command.index("--layer") + 1] = str(layer)
            run = measure.measured(command, log)
            with open(out["lamina"], "rb") as file:
                digest = hashlib.sha256(file.read()).hexdigest()
            memory.append({"layer": layer, "options": " ".join(options), "peak_mib": run["peak_mib"], "wall": run["wall"],
                           "bytes": os.path.getsize(out["lamina"]), "sha256": digest})
    for layer in (0.2, 0.1, 0.05):
        if len({of["sha256"] for of in memory if of["layer"] == layer}) != 1:
            sys.exit(f"bench: layers of {layer} mm: the bytes depend on threads or memory")
    return result | {"memory": memory}


# --- the page

TEXT = [
    "Settings are equal where all programs have them (`PRUSA` and `CURA` in bench/peers.py). They differ in:", "",
    "- Section of a bead: lamina and PrusaSlicer extrude stadiums, "
    f"{LAYER * PITCH:.4f} mm2, with walls one pitch apart: {PITCH:.4f} mm. CuraEngine extrudes rectangles, {LAYER * WIDTH:.4f} mm2, with walls "
    f"{WIDTH} mm apart. The walls of a part then have {PITCH / WIDTH:.3f} of CuraEngine's volume, a little more with long inner walls. So lamina "
    "also runs with `--machine-set material.bead_area=rectangle`, which is CuraEngine's setting.",
    "- Solid layers beyond the edge of a face: one bead in lamina, set to the same in CuraEngine (no pre-shrinking). PrusaSlicer has a "
    "margin of 3 mm and no setting for it.",
    "- Solid layers next to inclined walls: lamina and PrusaSlicer count the walls of the layers above as cover. CuraEngine does not: it "
    f"compares with the area within the walls. Row `frustum`: each layer is {TAPER} mm further in, so walls of the next layers cover "
    "all of it.",
    "- Ends of sparse lines: overlap with walls is 0 in all programs. On the box, centres end 0.736 mm inside the surface in lamina, 0.8 mm in "
    "CuraEngine, 0.914 mm in PrusaSlicer (half a pitch earlier).",
    "- Bridges and overhangs: lamina makes none; PrusaSlicer has `overhangs` and `thick_bridges` off.",
    "- Links of sparse lines (`infill_anchor`) of PrusaSlicer are off; grids of lamina and CuraEngine have none either.",
    "- Resolution: lamina omits points within 10 um, PrusaSlicer none (`resolution` and `gcode_resolution` 0), CuraEngine by its default "
    "(segments below 0.5 mm, deviation 0.025 mm).",
    "- Travel: combing of CuraEngine is off, because lamina has none. All other settings are each program's defaults.", ""]
WALL_TEXT = [
    "The walls of the box agree with hand-calculated ones within 0.2 %, else the script stops. The column lamina / CuraEngine is near "
    f"{PITCH / WIDTH:.3f}, the ratio of the sections, except where walls are near each other. Arachne varies the widths of walls.", "",
    "CuraEngine reduces the flow of walls that overlap. lamina and PrusaSlicer classic keep opposite walls apart, and fill what is narrower "
    "with single beads; those of lamina are in its solid volume. Walls without CuraEngine's compensation:", ""]
RIB_TEXT = [
    "", "Ribs of 30 x 4 mm at 100 %: extruded volume over that of the rib. Above 1, opposite walls overlap.", ""]
NOTES = {
    "am_coin": "letters and rim are so narrow that opposite inner walls are less than a pitch apart: single beads in lamina and PrusaSlicer "
               "classic, two walls of reduced flow in CuraEngine.",
    "honeycomb_vase": "walls of 1 mm, wider in sections of inclined ones; the same cause as am_coin."}
TOTAL_TEXT = [
    "Reasons for totals outside of the peers':", "",
    "- Solid layers, for all others. PrusaSlicer's margin around a face is 3 mm, lamina's one bead. On the step, 2.6 mm more x 18.5 mm x 4 layers "
    "are 38.5 mm3: see *By kind*. CuraEngine adds strips next to inclined walls: on the frustum, it has nearly three times lamina's solid volume. "
    "lamina extrudes the four layers above and three below that were requested, with walls counted.",
    "- honeycomb_vase is above both peers, which leave 2 to 3 % of it empty: see *Accounted*.",
    "- Sparse lines. PrusaSlicer's end half a pitch earlier, so its accounted volume is less.",
    "- Brims. lamina's loops keep sharp corners, those of both peers are round (box: 1400, 1342 and 1252 mm of line, as "
    "hand-calculated), so the brim of the toothed herringbone_wheels is wider at the teeth. With rectangles, lamina has 12 loops "
    "(4.8 mm), CuraEngine 13 (5.2 mm). Both have loops around islands in holes (am_coin).", "",
    "By kind, in mm3, from the nearest peer:", ""]


def between(of):
    peers = [of[name]["total"] for name in ("classic", "arachne", "cura")]
    return min(peers) <= of["lamina"]["total"] <= max(peers)


def filled(of):
    return of["gap"] + of["solid"]


def at_equal_skins(own, peer):
    """lamina's total if it had the peer's solid volume: each mm3 of it replaces sparse lines of its density. Over the peer's total."""
    return (own["total"] + (1 - DENSITY / 100) * (filled(peer) - filled(own))) / peer["total"]


def walls_rows(parts):
    for name, part in parts.items():
        of = part["programs"]
        ratios = [of["lamina"]["walls"] / of["classic"]["walls"], of["rectangle"]["walls"] / of["cura"]["walls"],
                  of["lamina"]["walls"] / of["arachne"]["walls"], of["lamina"]["walls"] / of["cura"]["walls"]]
        met = all(abs(ratio - 1) <= NEAR for ratio in ratios[:2])
        yield [name, *(f"{of[program]['walls']:.1f}" for program in ("lamina", "classic", "arachne", "rectangle", "cura")),
               *(f"{ratio:.3f}" for ratio in ratios[:3]), f"{ratios[3]:.3f}", "yes" if met else "no"]


def overlap_rows(parts):
    for name, part in parts.items():
        of = part["programs"]
        whole = of["cura"]["walls"] + of["cura"]["compensated"]
        if of["cura"]["compensated"] > 0.005 * whole:
            yield [name, f"{of['rectangle']['walls']:.1f}", f"{whole:.1f}", f"{of['rectangle']['walls'] / whole:.3f}",
                   f"{of['lamina']['walls'] / (of['classic']['walls'] + of['classic']['gap']):.3f}"]


def total_rows(parts):
    for name, part in parts.items():
        of = part["programs"]
        yield [name, *(f"{of[program]['total']:.0f}" for program in ("lamina", "classic", "arachne", "cura")),
               "yes" if between(of) else "no",
               *(f"{filled(of[program]):.0f}" for program in ("lamina", "classic", "arachne", "rectangle", "cura")),
               f"{at_equal_skins(of['lamina'], of['classic']):.3f}", f"{at_equal_skins(of['lamina'], of['arachne']):.3f}",
               f"{at_equal_skins(of['rectangle'], of['cura']):.3f}",
               *(f"{accounted(part, program):.3f}" for program in ("lamina", "classic", "arachne", "cura"))]


TITLES = {"lamina": "lamina", "rectangle": "lamina, rectangles", "classic": "PrusaSlicer classic", "arachne": "PrusaSlicer Arachne",
          "cura": "CuraEngine"}


def kind_rows(parts):
    for name, part in parts.items():
        for program in TITLES:
            of = part["programs"][program]
            yield [name, TITLES[program], *(f"{of[kind]:.1f}" for kind in KINDS[:-1]), f"{of['body']:.1f}", f"{of['total']:.1f}",
                   str(of["layers"])]


def reasons(parts):
    """How each total outside of the peers' differs from the nearest one, by kind."""
    for name, part in parts.items():
        of = part["programs"]
        if not between(of):
            nearest = min(("classic", "arachne", "cura"), key=lambda peer: abs(of[peer]["total"] - of["lamina"]["total"]))
            peer, own = of[nearest], of["lamina"]
            more = {"walls": own["walls"] - peer["walls"], "solid and gaps": filled(own) - filled(peer),
                    "sparse": own["sparse"] - peer["sparse"], "brim": own["brim"] - peer["brim"]}
            yield (f"- {name}: {own['total'] - peer['total']:+.0f} to {TITLES[nearest]}: " +
                   ", ".join(f"{kind} {value:+.0f}" for kind, value in more.items()))


def accounted(part, name):
    """The part's volume that beads stand for: sparse ones for 1 / density of theirs. 1: nothing is empty or filled twice."""
    of = part["programs"][name]
    return (of["walls"] + filled(of) + of["sparse"] * 100 / DENSITY) / part["part_mm3"]


def time_lines(of):
    own, cura, combing = of["lamina"], of["cura"], of["combing"]
    yield "## Time and memory"
    yield ""
    yield (f"3DBenchy, mesh on disk to G-code on disk, {own['runs']} alternating runs after one that is not counted; medians. Both programs "
           "use their default number of threads. Both may omit points within 25 um, CuraEngine's default. Processor seconds are user and system.")
    yield ""
    yield from table(["program", "wall s", "fastest to slowest", "processor s", "peak MiB", "file MB", "processors used by others"],
                     [[title, f"{p['wall']:.2f}", f"{p['fastest']:.2f} to {p['slowest']:.2f}", f"{p['processor']:.2f}", f"{p['peak_mib']:.1f}",
                       f"{p['bytes'] / 1e6:.1f}", f"{100 * p['others']:.0f} %"]
                      for title, p in (("lamina", own), ("CuraEngine", cura), ("CuraEngine, combing `all`", combing))])
    ratio = {kind: cura[kind] / own[kind] for kind in ("wall", "processor")}
    met = min(ratio.values()) >= TIMES
    yield (f"lamina is {ratio['wall']:.1f} times as fast as CuraEngine by wall time and {ratio['processor']:.1f} times by processor time; with "
           f"CuraEngine's default combing {combing['wall'] / own['wall']:.1f} and {combing['processor'] / own['processor']:.1f} times. Target: "
           f"{TIMES} times, {'met' if met else 'not met'}.")
    yield ""
    yield "Peak MiB of lamina on 3DBenchy. The bytes are equal in each row."
    yield ""
    options = list(dict.fromkeys(m["options"] for m in of["memory"]))
    yield from table(["layer mm", *(f"`{option}`" for option in options), "file MB"],
                     [[f"{layer:g}", *(f"{m['peak_mib']:.1f}" for m in of["memory"] if m["layer"] == layer),
                       f"{next(m['bytes'] for m in of['memory'] if m['layer'] == layer) / 1e6:.1f}"]
                      for layer in dict.fromkeys(m["layer"] for m in of["memory"])])


def page(result):
    parts, machine = {name: result["parts"][name] for name in PARTS if name in result["parts"]}, result["machine"]
    real = {name: part for name, part in parts.items() if isinstance(PARTS[name], tuple)}
    walls, totals = list(walls_rows(parts)), {name: between(part["programs"]) for name, part in real.items()}
    outside = [row[0] for row in walls if row[-1] == "no" and row[0] in real]
    below = [name for name, met in totals.items() if not met]
    lines = ["# Volumes and times compared with PrusaSlicer and CuraEngine", "",
             f"`scripts/bench peers` on {result['date']} at {result['commit']}: {machine['processor']}, {machine['cores']} cores, "
             f"{machine['memory_gib']} GiB, {machine['system']}. PrusaSlicer 2.5, CuraEngine 4.13.", "",
             f"{LAYER} mm layers, beads of {WIDTH} mm, {WALLS} walls, {DENSITY} % grid, {TOP} solid layers above, {BOTTOM} below, "
             f"{'brim of ' + str(BRIM) + ' mm' if result['brim'] else 'no brim (this commit of lamina has none)'}, no skirt, no supports. "
             "All programs load the same STL, exported by lamina. Volumes are in mm3, from E of moves with x or y.",
             *(["", result["note"]] if "note" in result else []), "", *TEXT, "## Walls", "",
             f"Outer, inner and thin walls. {len(real) - len(outside)} of {len(real)} parts are within {100 * NEAR:.0f} % of PrusaSlicer (classic) "
             f"and, with rectangles, of CuraEngine{': all' if not outside else '; not ' + ', '.join(outside)}.", "",
             *table(["part", "lamina", "PrusaSlicer classic", "PrusaSlicer Arachne", "lamina, rectangles", "CuraEngine", "lamina / classic",
                     "rectangles / CuraEngine", "lamina / Arachne", "lamina / CuraEngine", f"within {100 * NEAR:.0f} %"], walls),
             *WALL_TEXT, *table(["part", "lamina, rectangles", "CuraEngine without compensation", "ratio", "walls and gaps: lamina / classic"],
                                overlap_rows(parts)),
             *(f"- {name}: {NOTES.get(name, 'not explained.')}" for name in outside), *RIB_TEXT,
             *table(["rib mm", *(f"{row['thickness']:g}" for row in result["ribs"])],
                    [[title, *(f"{row[name]:.2f}" for row in result["ribs"])] for name, title in (("lamina", "lamina"),
                                                                                               ("classic", "PrusaSlicer classic"))]),
             "## Totals", "",
             f"The total is between those of the peers for {len(real) - len(below)} of {len(real)} parts"
             f"{'; not for ' + ', '.join(below) if below else ''}. The solid columns include gaps. *Equal solids*: lamina's total over the "
             "peer's, if lamina had the peer's solid volume. *Accounted*: volume of walls, solids and sparse / density, over that of the part; "
             "below 1 places are empty, above 1 beads overlap, up to a few percent by where sparse lines happen to be.", "",
             *table(["part", "lamina", "PrusaSlicer classic", "PrusaSlicer Arachne", "CuraEngine", "between", "solid: lamina", "classic", "Arachne",
                     "lamina, rectangles", "CuraEngine", "equal solids: classic", "Arachne", "rectangles, CuraEngine", "accounted: lamina", "classic",
                     "Arachne", "CuraEngine"], total_rows(parts)),
             *TOTAL_TEXT, *reasons(real), "", *(time_lines(result["time"])),
             f"`--threads` 1, 2 and 4 write the same bytes for {sum(len(set(part['digests'].values())) == 1 for part in parts.values())} of "
             f"{len(parts)} parts.", "", "## By kind", "",
             "`other` is empty in all files. CuraEngine tags gaps and thin walls as skin: their volume is the difference to runs without them. "
             "lamina tags both as solid; PrusaSlicer tags thin walls as outer walls.", "",
             *table(["part", "program", *KINDS[:-1], "without brim", "total", "layers"], kind_rows(parts)),
             "## Again", "", "    scripts/bench peers", "    scripts/bench peers --case time --runs 5", "    scripts/bench peers --part nut"]
    with open(os.path.join(ROOT, "bench/peers.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def main(arguments):
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--part", action="append", choices=list(PARTS))
    parser.add_argument("--commit", help="of --programs; default: of this clone")
    own, rest = parser.parse_known_args(arguments)
    options, programs, work = measure.comparison(rest, __doc__, "lamina and CuraEngine once each", "peers", ["lamina"], CASES, 5)
    lamina, cases = os.path.join(os.path.abspath(programs), "lamina"), options.case or CASES
    definitions = heights.cura_definitions(options.cache)
    help_text = subprocess.run([lamina, "extrude", "--help-all"], check=True, text=True, stdout=subprocess.PIPE).stdout
    result = {"date": time.strftime("%Y-%m-%d"), "commit": own.commit or figures.commit(ROOT), "machine": figures.machine(options.cache),
              "brim": "--brim" in help_text, "settings": {"prusa": PRUSA, "cura": CURA}}
    if "volumes" in cases:
        result["parts"] = {name: volumes_of(lamina, options.models, name, work, definitions, result["brim"]) for name in own.part or PARTS}
        if not own.part:
            result["ribs"] = ribs(lamina, work)
        if "box" in result["parts"]:
            check_box(result["parts"]["box"]["programs"])
    if "time" in cases:
        result["time"] = time_case(lamina, options.models, work, definitions, result["brim"], options.runs)
    shutil.rmtree(work)
    if set(cases) == set(CASES) and not own.part:
        figures.save(ROOT, "peers", result)
        page(result)
        return
    if "parts" in result:
        print("\n".join(table(["part", "program", *KINDS[:-1], "without brim", "total", "layers"], kind_rows(result["parts"]))))
    if "time" in result:
        print("\n".join(time_lines(result["time"])))


if __name__ == "__main__":
    main(sys.argv[1:])
