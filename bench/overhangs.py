#!/usr/bin/env python3
"""bench/overhangs.py: overhangs of four parts at three angles, and by boolean operations of GEOS. Writes bench/overhangs.md.

    /usr/bin/python3 bench/overhangs.py [LAMINA]     default: build/release/lamina

Targets are areas at very thin layers. A layer's area may differ from them by 3 % and by a strip of width max(w, r) along the edges of the
overhang; w is a bead of 0.4 mm, r the distance of the sampled planes times the tangent of the angle. GEOS (Debian: python3-shapely)
applies the definition to lamina's contours: it gives a second area, and the length of the edges. Exit code 1 beyond the limits.
"""
import json
import math
import os
import re
import subprocess
import sys
import tempfile

import figures

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MODELS = os.environ.get("LAMINA_MODELS", os.path.join(ROOT, "../shared/models"))
ANGLES, BEAD = (30, 45, 60), 0.4
PARTS = {"motor_bracket.stl.gz": (439, 354, 341), "3DBenchy.3mf": (1033, 529, 447), "dental_crown.stl": (73, 70, 47),
         "parameter_quality_nut.stl": (229, 137, 40)}
ALTERNATING = "0.1 and 0.3 mm"  # their middles are those of every second layer of 0.1 mm
LAYERS = {"0.05 mm": "0.05", "0.2 mm": "0.2", ALTERNATING: "0.1"}


def sections(path):
    """(sampled height, polygons) of each layer of an SVG file."""
    from shapely.geometry import Polygon
    from shapely.ops import unary_union
    made = []
    with open(path, encoding="utf-8") as file:
        for group in re.split(r"<g id=", file.read())[1:]:
            height = float(re.search(r'slice-z="([^"]+)"', group)[1])
            region = None
            for text in re.findall(r'<path d="([^"]+)"', group):
                for ring in text.split("z")[:-1]:
                    values = [float(v) for v in re.findall(r"-?\d+\.?\d*", ring)]
                    polygon = Polygon(list(zip(values[0::2], values[1::2]))).buffer(0)
                    region = polygon if region is None else region.symmetric_difference(polygon)
            made.append((height, unary_union([region] if region is not None else [])))
    return made


def by_geos(layers, angle):
    """Area of the overhang and length of its edges, by the definition."""
    from shapely.geometry import JOIN_STYLE
    area = edges = 0
    for (low, below), (high, own) in zip(layers, layers[1:]):
        reach = (high - low) * math.tan(math.radians(angle))
        # Faces at the angle itself hang: contours are rounded to nm.
        far = own.difference(below.buffer(reach - 1e-5, join_style=JOIN_STYLE.mitre, mitre_limit=2))
        if far.area < 1e-6:
            continue
        hanging = own.difference(below).intersection(far.buffer(reach + 1e-5, join_style=JOIN_STYLE.mitre, mitre_limit=2))
        area += hanging.area
        edges += hanging.length
    return area, edges


def main():
    lamina = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "build/release/lamina")
    wrong, rows = 0, []
    with tempfile.TemporaryDirectory() as folder:
        tops = os.path.join(folder, "tops.txt")
        with open(tops, "w", encoding="utf-8") as file:
            for i in range(1, 501):
                file.write(f"{0.2 * i - (0 if i % 2 == 0 else 0.1):.1f}\n")
        for part, targets in PARTS.items():
            path = os.path.join(MODELS, part)
            for name, layer in LAYERS.items():
                made = os.path.join(folder, re.sub(r"\W", "", part + name))

                def areas(angle):
                    """Of lamina; the contours are written on the way."""
                    command = ["slice", path, "--layer", layer, "--json", "--overwrite", "--format", "svg", "-o", made]
                    if name == ALTERNATING and os.path.isdir(made):
                        command = ["heights", path, "--measure", tops, "--format", "json"]
                    answer = subprocess.run([lamina, *command, "--support-angle", str(angle)], check=True, text=True,
                                            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
                    answer = json.loads(answer)
                    return (answer["tables"][0] if "tables" in answer else answer)["overhangs"]["area_mm2"]

                areas(ANGLES[0])
                files = [file for file in os.listdir(made) if file.endswith(".svg")]
                layers = sections(os.path.join(made, files[0]))[::2 if name == ALTERNATING else 1]
                thickness = max(b[0] - a[0] for a, b in zip(layers, layers[1:]))
                for angle, target in zip(ANGLES, targets):
                    area = areas(angle)
                    second, edges = by_geos(layers, angle)
                    strip = max(BEAD, thickness * math.tan(math.radians(angle))) * edges
                    within = abs(area - target) <= 0.03 * target + strip
                    wrong += not within or abs(area - second) > 0.015 * second + 0.5
                    rows.append(f"| {part.split('.')[0]} | {name} | {angle} | {target} | {area:.1f} | {100 * (area / target - 1):+.1f} % | "
                                f"{second:.1f} | {edges:.0f} | {0.03 * target + strip:.0f} |\n")
    with open(os.path.join(ROOT, "bench/overhangs.md"), "w", encoding="utf-8") as page:
        page.write(f"""# Areas of overhangs

`bench/overhangs.py` at commit {figures.commit(ROOT)}. Areas in mm2, of all layers of a part above the first. *GEOS*: the definition in
[warnings](../docs/reference/warnings.md#overhangs), applied by GEOS to the contours of the layers. *Edges*: the length of the edges of the overhang in
all layers, mm. *Limit*: 3 % of the target, and a strip of {BEAD} mm (or the reach, where it is wider) along the edges.

| part | layers | angle | target | lamina | difference | GEOS | edges | limit |
|---|---|---|---|---|---|---|---|---|
{"".join(rows)}""")
    print(f"overhangs: {wrong} beyond the limits; bench/overhangs.md")
    return 1 if wrong else 0


sys.exit(main())
