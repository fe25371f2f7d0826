#!/usr/bin/env python3
"""bench/patterns.py: effects of line patterns on permeability, compared with published ones. scripts/bench patterns

    scripts/bench patterns [--voxel UM]     writes bench/patterns.md

Plans a cylinder with lamina's own filling and runs `lamina permeability` on the written toolpaths. Nothing is fitted.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import pores  # noqa: E402
import tables  # noqa: E402

WIDTH, GAP = 0.4, 0.4  # mm
COMMON = {"layers.thickness_mm": 0.3, "fill.width_mm": WIDTH, "fill.walls": 1, "fill.angle_deg": 90, "fill.angle_step_deg": 90}
CELLS = [(1.2, 0.1), (1.6, 0.05), (2.4, 0.05)]  # of quatrefoils: period and gap, mm


def raster(gap, stagger=0.0, group=1):
    """In groups the gaps grow with the group, so that the porosity stays."""
    keys = {"fill.pattern": '"raster"', "fill.gap_mm": round(group * gap, 4), "fill.group": group}
    if stagger:
        keys["fill.stagger_mm"] = f"[0, {stagger:g}]"
    return keys


class Predictions:
    """Of plans of one cylinder; each is computed once."""

    def __init__(self, folder, voxel):
        self.folder, self.voxel, self.known = folder, voxel, {}
        pores.write_cylinder(os.path.join(folder, "part.stl"), 25.4, 6)

    def of(self, keys, *options):
        name = json.dumps([keys, options])
        if name not in self.known:
            toolpaths = os.path.join(self.folder, "part.gcode")
            sets = [word for key, value in {**COMMON, **keys}.items() for word in ("--set", f"{key}={value}")]
            part = os.path.join(self.folder, "part.stl")
            subprocess.run([pores.LAMINA, "extrude", part, "--machine", "anet-a8", *sets, "--overwrite", "-o", toolpaths], check=True,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            voxel = 2 * self.voxel if "--window" in options else self.voxel
            found = pores.predict(toolpaths, voxel, ["--memory", "4G", *options])[0]
            print(keys, f"{found['flow'][2]['k1_darcy']:.0f} D", flush=True)
            self.known[name] = found
        return self.known[name]


def cells(name, found, of, published):
    along, across = found["flow"][2], found["flow"][0]
    ratio = along["k1_darcy"] / of["flow"][2]["k1_darcy"] if of else None
    return [name, f"{100 * found['porosity']:.1f}", f"{along['k1_darcy']:.0f} +- {along['k1_error_darcy']:.0f}",
            f"{across['k1_darcy']:.0f}", f"{100 * (ratio - 1):+.0f} %" if ratio else "", published]


def effects(reported):
    base, groups = reported.of(raster(GAP)), reported.of(raster(GAP, group=2))
    largest = reported.of(raster(GAP, 2 * WIDTH, 2))
    yield cells("lines, gap 0.4 mm", base, None, "")
    yield cells("stagger of 0.4 mm, half a pitch", reported.of(raster(GAP, WIDTH)), base,
                "-57 % (Entezari 2019), -18.4 % (Walejewska 2019)")
    yield cells("groups of 2", groups, base, "+160 % (Shigueoka 2019)")
    yield cells("groups of 2, stagger of 0.8 mm, against groups of 2", largest, groups,
                "to -76 % (Shigueoka 2019); the reference is not stated")
    yield cells("the same, against lines", largest, base, "")


def gaps(reported):
    for gap in (0.2, 0.4, 0.8):
        straight = reported.of(raster(gap))
        yield cells(f"lines, gap {gap} mm", straight, reported.of(raster(GAP)), "the strongest parameter (Too 2001)" if gap != GAP else "")
        yield cells("staggered by half a pitch, against the same", reported.of(raster(gap, (WIDTH + gap) / 2)), straight, "lower")


def waves(reported):
    """Quatrefoils compared with lines of the same porosity in the same window."""
    window = ["--window", "4.8,4.8,1.2"]
    bead = (WIDTH + GAP) * (1 - reported.of(raster(GAP))["porosity"])  # cross-section / thickness
    for cell, apart in CELLS:
        quatrefoil = reported.of({"fill.pattern": '"quatrefoil"', "fill.cell_mm": cell, "fill.gap_mm": apart}, *window)
        gap = round(bead / (1 - quatrefoil["porosity"]) - WIDTH, 3)
        lines = reported.of(raster(gap), *window)
        yield cells(f"lines, gap {gap:g} mm", lines, None, "")
        yield cells(f"quatrefoil, cells of {cell:g} mm, gap {apart:g} mm", quatrefoil, lines, "about x 2 (Entezari 2019, design D)")


HEAD = ["pattern", "porosity, %", "k1 along z, D", "along x", "k1 along z against that", "published"]


def page(voxel, folder):
    machine = figures.machine(ROOT)
    reported = Predictions(folder, voxel)
    yield "# Permeability of patterns compared with published effects"
    yield ""
    yield (f"`scripts/bench patterns --voxel {voxel:g}`, commit {figures.commit(ROOT)}, {machine['processor']}. Beads 0.4 mm wide, "
           "layers of 0.3 mm alternating between 0 and 90 degrees, as lamina plans them for Anet A8 and `lamina permeability` deposits "
           "them; one period, or a window where stated. Effects are those that Di Nisio 2022, section 2.5, reports. It does not state "
           "materials, gaps, widths or, mostly, directions of the flow, so only signs and order can be compared.")
    yield ""
    yield "## Stagger and groups"
    yield ""
    yield from tables.table(HEAD, effects(reported))
    yield "## The gap"
    yield ""
    yield from tables.table(HEAD, gaps(reported))
    yield "## Quatrefoil"
    yield ""
    yield ("The source draws curves like honeycombs that are kept apart and does not define them; lamina's are cosines "
           "([filling.md](../docs/reference/filling.md#patterns)), which do not repeat along x and y in layers that alternate between "
           "0 and 90 degrees. So a window of 4.8 x 4.8 x 1.2 mm with closed sides and voxels twice as large is compared with lines of "
           "about the same porosity.")
    yield ""
    yield from tables.table(HEAD, waves(reported))


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxel", type=float, default=20, help="edge, um (default 20); twice that in windows")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        text = "\n".join(page(options.voxel, folder)) + "\n"
    with open(os.path.join(ROOT, "bench/patterns.md"), "w", encoding="utf-8") as file:
        file.write(text.rstrip("\n") + "\n")
    print("wrote bench/patterns.md")


if __name__ == "__main__":
    main(sys.argv[1:])
