#!/usr/bin/env python3
"""bench/density.py: fillings of a 20 mm box by density, from the E values of the G-code alone. Writes bench/density.md.

    bench/density.py [LAMINA]        default: build/release/lamina

Bead volume is E times the section of the filament; links count, the skirt does not. At 100 % it is compared with the box, below with the
volume inside the walls, by hand: two walls of 0.4 mm, the first half a bead inside, one pitch w - h (1 - pi/4) apart. Exit code 1 beyond
the limits: 1.5 and -0.5 % at 100 %, 1 point below.
"""
import math
import os
import re
import struct
import subprocess
import sys
import tempfile

import figures

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SIDE, WIDTH, HEIGHT, FILAMENT = 20, 0.4, 0.2, 1.75
PITCH = WIDTH - HEIGHT * (1 - math.pi / 4)
PATTERNS, DENSITIES = ["raster", "lines", "grid", "gyroid"], range(10, 100, 10)


def write_box(path):
    corners = [(x, y, z) for z in (0, SIDE) for y in (0, SIDE) for x in (0, SIDE)]
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    facets = [(a, b, c) for a, b, c, _ in sides] + [(a, c, d) for a, _, c, d in sides]
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(facets)))
        for facet in facets:
            file.write(struct.pack("<12fH", 0, 0, 0, *(v for corner in facet for v in corners[corner]), 0))


def volumes(path):
    """mm3 by the types of the file."""
    sums, kind = {}, ""
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line.startswith(";TYPE:"):
                kind = line[6:].strip()
            elif found := re.match(r"G1 X\S+ Y\S+ E(\S+)", line):
                sums[kind] = sums.get(kind, 0) + float(found[1]) * math.pi / 4 * FILAMENT**2
    return sums


def main():
    lamina = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "build/release/lamina")
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        box, out = os.path.join(folder, "box.stl"), os.path.join(folder, "box.gcode")
        write_box(box)

        def extruded(*words):
            subprocess.run([lamina, "extrude", box, "--machine", "marlin", "--layer", str(HEIGHT), "--bead", str(WIDTH), "--walls", "2",
                            "--overwrite", "--quiet", "-o", out, *words], check=True)
            return volumes(out)

        def solid(angle):
            sums = extruded("--density", "100", "--angle", str(angle))
            return 1 - sum(v for kind, v in sums.items() if kind != "Skirt/Brim") / SIDE**3

        inside = (SIDE - 2 * (WIDTH / 2 + PITCH + PITCH / 2)) ** 2 * SIDE
        lost = {angle: 100 * solid(angle) for angle in (0, 13, 45, 90)}
        wrong += sum(not -0.5 < value < 1.5 for value in lost.values())
        rows = []
        for pattern in PATTERNS:
            row = []
            for density in DENSITIES:
                sums = extruded("--pattern", pattern, "--density", str(density), "--top-layers", "0", "--bottom-layers", "0")
                row.append(100 * sums["Internal infill"] / inside)
                wrong += abs(row[-1] - density) > 1
            rows.append(f"| {pattern} | " + " | ".join(f"{value:.2f}" for value in row) + " |\n")
    with open(os.path.join(ROOT, "bench/density.md"), "w", encoding="utf-8") as page:
        page.write(f"""# Fillings by density

`bench/density.py` at commit {figures.commit(ROOT)}: a box of {SIDE} mm, layers of {HEIGHT} mm, two walls, beads of {WIDTH} mm. Volumes from E.

At 100 %, of the volume of the box is void: {", ".join(f"{value:.2f} % at {angle} degrees" for angle, value in lost.items())}. Limits: 1.5 and -0.5 %.

Percent of the volume inside the walls; limit: 1 point.

| pattern | {" | ".join(f"{density} %" for density in DENSITIES)} |
|---|{"---|" * len(DENSITIES)}
{"".join(rows)}""")
    print(f"density: {wrong} beyond the limits; bench/density.md")
    return 1 if wrong else 0


sys.exit(main())
