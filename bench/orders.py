#!/usr/bin/env python3
"""bench/orders.py: orders of parts as builds. Writes bench/orders.md.

    bench/orders.py [LAMINA]         default: build/release/lamina; LAMINA_MODELS names the folder of real parts

An order of 160 parts of 8 kinds; crowns on a round bed; mixed orders against rows of boxes, as lamina jet arranges parts; 10,000 parts of
300 kinds. Every part has to be in exactly one build or among those left out. Rows are made here, by the rules of
stages/arrange/placement.h, from the sizes that lamina reports. Exit code 1 if a limit is missed.
"""
import csv
import json
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
import time

import figures

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MODELS = os.environ.get("LAMINA_MODELS", os.path.join(ROOT, "../shared/models"))
KINDS = ["dental_crown.stl", "parameter_quality_nut.stl", "3DBenchy.3mf", "motor_bracket.stl.gz", "am_coin_embossed_text.stl",
         "herringbone_wheels.stl", "screw_cap.stl", "nist_am_test_artifact_v3b.stl"]
GAP, MARGIN, BED = 5.0, 5.0, 400.0  # of production-1200


def found(name):
    stem = name.split(".")[0].split("_v3b")[0]
    for file in sorted(os.listdir(MODELS)):
        if file.startswith(stem[:12]) and file.lower().endswith((".stl", ".stl.gz", ".3mf", ".obj")):
            return os.path.join(MODELS, file)
    sys.exit(f"orders: {name} is not in {MODELS}")


def nest(lamina, table, out, *options):
    """The result and the builds' lists, checked: no part is missing or twice."""
    began = time.monotonic()
    answer = subprocess.run([lamina, "nest", table, "-o", out, "--overwrite", "--json", "--quiet", *options], check=True, text=True,
                            stdout=subprocess.PIPE).stdout
    seconds = time.monotonic() - began
    result = json.loads(answer)
    builds = []
    for b in range(len(result["builds"])):
        with open(os.path.join(out, f"build-{b + 1}", "parts.csv"), encoding="utf-8", newline="") as file:
            builds.append(list(csv.DictReader(file)))
    serials = [part["serial"] for build in builds for part in build]
    left = sum(each["copies"] for each in result["left_out"])
    if len(set(serials)) != len(serials) or len(serials) + left != result["copies"]:
        sys.exit(f"orders: {table}: {len(serials)} parts in builds, {left} left out, of {result['copies']}")
    return result, builds, seconds


def write_orders(path, rows):
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "copies", "order"])
        writer.writerows(rows)


def in_rows(parts, bed, margin, gap):
    """How many boxes rows of one level take, in the order of the parts, until one finds no position."""
    inner, x, y, depth, begun = bed - 2 * margin, 0.0, 0.0, 0.0, False
    for count, (width, length) in enumerate(parts):
        if begun and x + gap + width > inner:
            y, x, depth, begun = y + depth + gap, 0.0, 0.0, False
        elif begun:
            x += gap
        if y + length > inner:
            return count
        x, depth, begun = x + width, max(depth, length), True
    return len(parts)


def write_prism(path, points, height):
    """An STL file of a convex outline."""
    top = [(x, y, height) for x, y in points]
    low = [(x, y, 0.0) for x, y in points]
    facets = []
    for i in range(len(points)):
        k = (i + 1) % len(points)
        facets += [(low[i], low[k], top[k]), (low[i], top[k], top[i])]
        if 0 < i < len(points) - 1:
            facets += [(top[0], top[i], top[i + 1]), (low[0], low[i + 1], low[i])]
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(facets)))
        for facet in facets:
            file.write(struct.pack("<12fH", 0, 0, 0, *(v for corner in facet for v in corner), 0))


def main():
    lamina = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "build/release/lamina")
    files, missed, lines = [found(kind) for kind in KINDS], 0, []
    rng = random.Random(38)
    with tempfile.TemporaryDirectory() as folder:
        table, out = os.path.join(folder, "orders.csv"), os.path.join(folder, "out")
        sizes = {}
        for file in files:  # in the order's orientation
            write_orders(table, [(file, 1, "")])
            _, builds, _ = nest(lamina, table, out, "--bed", "1000x1000", "--turns", "0")
            sizes[file] = (float(builds[0][0]["width_mm"]), float(builds[0][0]["depth_mm"]))
        copies = [40, 30, 20, 20, 16, 14, 16, 4]
        write_orders(table, [(file, count, f"{1001 + i}") for i, (file, count) in enumerate(zip(files, copies))])
        result, builds, seconds = nest(lamina, table, out, "--machine", "production-1200")
        lines += [f"160 parts of 8 kinds on production-1200: {len(builds)} builds of {', '.join(str(len(b)) for b in builds)} parts, "
                  f"{len(result['left_out'])} rows left out, {seconds:.2f} s.", ""]
        missed += sum(len(b) for b in builds) != 160
        crowns = {}
        for turns in ("0", "0,90,180,270"):
            result, builds, _ = nest(lamina, files[0], out, "--copies", "99", "--machine", "nuferbj", "--builds", "1", "--turns", turns)
            crowns[turns] = len(builds[0])
        lines += [f"Crowns in one level of the round bed of nuferbj: {crowns['0']} without turns, {crowns['0,90,180,270']} with four; 18 in rows. "
                  "Target: 26.", ""]
        missed += crowns["0,90,180,270"] < 26
        lines += ["Parts in the first level of ten mixed orders, all of one priority, next to rows in the order of the table. Target: 1.3 times.",
                  "", "| order | rows | lamina | ratio | bed covered |", "|---|---|---|---|---|"]
        for order in range(10):
            kinds = rng.sample(files[:7], 4)
            counts = [rng.randint(20, 80) for _ in kinds]
            write_orders(table, [(file, count, "") for file, count in zip(kinds, counts)])
            rows = in_rows([sizes[file] for file, count in zip(kinds, counts) for _ in range(count)], BED, MARGIN, GAP)
            result, builds, _ = nest(lamina, table, out, "--machine", "production-1200", "--builds", "1")
            ratio = len(builds[0]) / rows
            missed += ratio < 1.3 and len(builds[0]) < sum(counts)
            lines.append(f"| {order + 1} | {rows} | {len(builds[0])} of {sum(counts)} | {ratio:.2f} | "
                         f"{100 * result['builds'][0]['bed_fraction']:.0f} % |")
        many = []
        for kind in range(300):
            corners = rng.randint(3, 12)
            angles = sorted(rng.uniform(0, 2 * math.pi) for _ in range(corners))
            radius = rng.uniform(4, 25)
            if max((b - a) % (2 * math.pi) for a, b in zip(angles, angles[1:] + angles[:1])) > 3:
                angles = [2 * math.pi * i / corners for i in range(corners)]
            path = os.path.join(folder, f"kind{kind}.stl")
            write_prism(path, [(radius * math.cos(a), radius * math.sin(a)) for a in angles], rng.uniform(3, 60))
            many.append((path, 33 + (kind < 100), f"{kind}"))
        write_orders(table, many)
        result, builds, seconds = nest(lamina, table, out, "--machine", "production-1200")
        missed += seconds > 60
        lines += ["", f"10,000 parts of 300 kinds on production-1200: {seconds:.1f} s, {len(builds)} builds. Target: 60 s."]
    machine = figures.machine(ROOT)
    with open(os.path.join(ROOT, "bench/orders.md"), "w", encoding="utf-8") as page:
        page.write(f"# Orders as builds\n\n`bench/orders.py` at commit {figures.commit(ROOT)}: {machine['processor']}, {machine['cores']} cores. Gap 5 mm, "
                   "margin of the machine, four turns.\n\n" + "\n".join(lines) + "\n")
    print(f"orders: {missed} limits missed; bench/orders.md")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
