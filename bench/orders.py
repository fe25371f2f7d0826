#!/usr/bin/env python3
"""bench/orders.py: orders of parts as builds. Writes bench/orders.md.

    scripts/bench orders [LAMINA]    default: build/release/lamina; LAMINA_MODELS names the folder of real parts. The peer is compiled from
                                     bench/peers/nest_libnest2d.cpp, with Debian's libnest2d-dev, libnlopt-cxx-dev and libboost-dev

An order of 160 parts of 8 kinds; crowns on a round bed; mixed orders against rows of boxes, as lamina jet arranges parts; 10,000 parts of
300 kinds. Every part has to be in exactly one build or among those left out. Rows are made here, by the rules of
stages/arrange/placement.h, from the sizes that lamina reports. Exit code 1 if a limit is missed.
"""
import csv
import json
import math
import os
import random
import re
import shutil
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
PEER_SECONDS = 20  # at most, for a second run


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
                            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
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


def levels_in_rows(parts):
    levels = 0
    while parts:
        parts, levels = parts[in_rows(parts, BED, MARGIN, GAP):], levels + 1
    return levels


def hull_of(lamina, file, folder):
    """The convex outline of a part from above, counter-clockwise, in nm from its front left corner."""
    path = os.path.join(folder, "part.stl")
    subprocess.run([lamina, "export", file, "-o", path, "--overwrite", "--quiet"], check=True)
    with open(path, "rb") as stl:
        data = stl.read()
    points = sorted({struct.unpack_from("<2f", data, 84 + 50 * (i // 3) + 12 + 12 * (i % 3)) for i in range((len(data) - 84) // 50 * 3)})

    def half(chain):
        line = []
        for p in chain:
            while len(line) > 1 and (line[-1][0] - line[-2][0]) * (p[1] - line[-2][1]) <= (line[-1][1] - line[-2][1]) * (p[0] - line[-2][0]):
                line.pop()
            line.append(p)
        return line[:-1]

    low_x, low_y = min(x for x, _ in points), min(y for _, y in points)
    return [(round((x - low_x) * 1e6), round((y - low_y) * 1e6)) for x, y in half(points) + half(points[::-1])]


def built_peer(folder):
    """The peer's program, or None where it cannot be compiled."""
    program = os.path.join(folder, "nest_libnest2d")
    built = subprocess.run(["g++", "-O3", "-std=c++17", os.path.join(ROOT, "bench/peers/nest_libnest2d.cpp"), "-o", program, "-I",
                            "/usr/include/polyclipping", "-lpolyclipping", "-lnlopt_cxx", "-ltbb"], stderr=subprocess.DEVNULL)
    return program if built.returncode == 0 else None


def libnest2d(peer, wanted, hulls, seconds):
    """Parts on beds, beds and seconds of the peer, which stops after a time."""
    lines = [f"{round((BED - 2 * MARGIN) * 1e6)} " * 2 + f"{round(GAP * 1e6)}"]
    for file in dict.fromkeys(file for file, _ in wanted):
        copies = sum(count for name, count in wanted if name == file)
        lines.append(f"{copies} {len(hulls[file])} " + " ".join(f"{x} {y}" for x, y in hulls[file]))
    answer = subprocess.run([peer, f"{seconds:.3f}"], input="\n".join(lines) + "\n", check=True, text=True, stdout=subprocess.PIPE).stdout.split()
    return int(answer[0]), int(answer[1]), float(answer[2])


def compare(lamina, table, wanted, sizes, hulls, peer=None):
    """A line of the table, and whether a target is missed."""
    write_orders(table, [(file, count, f"{i + 1}") for i, (file, count) in enumerate(wanted)])
    parts = [sizes[file] for file, count in wanted for _ in range(count)]
    began = time.monotonic()  # of the arrangement alone, as for the peer
    answer = subprocess.run([lamina, "nest", table, "--machine", "production-1200", "--dry-run", "--json", "--quiet"], check=True, text=True,
                            stdout=subprocess.PIPE).stdout
    seconds = time.monotonic() - began
    builds = json.loads(answer)["builds"]
    rows, placed = levels_in_rows(parts), sum(build["parts"] for build in builds)
    ratio = rows / len(builds)
    line = f"{len(parts)} | {rows} | {len(builds)} | {ratio:.2f} |"
    if hulls is None:
        return line, placed != len(parts)
    if peer is None:
        return line + f" {seconds:.2f} s | - | - |", ratio < 1.3 or placed != len(parts)
    theirs, beds, _ = libnest2d(peer, wanted, hulls, seconds)
    later, later_beds, _ = libnest2d(peer, wanted, hulls, PEER_SECONDS)
    behind = theirs == len(parts) and beds < len(builds)
    return line + f" {seconds:.2f} s | {theirs} on {beds} | {later} on {later_beds} |", ratio < 1.3 or behind or placed != len(parts)


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


def quoted(lamina, table, out, folder):
    """Lines of the builds' estimates next to whole runs, and how far the worst one is off."""
    prices = os.path.join(folder, "prices.toml")
    with open(prices, "w", encoding="utf-8") as file:
        file.write("[cost]\nhour_price = 30\nbinder_price_l = 200\npowder_price_kg = 50\npowder_kg_l = 4.5\npowder_reuse = 0.9\n")
    result, builds, seconds = nest(lamina, table, out, "--machine", "production-1200", "--preset", prices)
    lines, worst = [], 0.0
    for b, build in enumerate(result["builds"]):
        cents = sum(round(100 * float(part["price_EUR"])) for part in builds[b])
        if cents != round(100 * build["use"]["cost"]):
            sys.exit(f"orders: prices of build {b + 1} do not add up")
        answer = subprocess.run([lamina, "jet", "--job", os.path.join(out, f"build-{b + 1}", "plate.toml"), "--dry-run", "--json", "--quiet"],
                                check=True, text=True, stdout=subprocess.PIPE).stdout
        whole = json.loads(answer)["use"]
        ratios = [build["use"][name] / whole[name] for name in ("print_seconds", "binder_mm3", "powder_fed_mm3", "cost")]
        worst = max(worst, *(abs(ratio - 1) for ratio in ratios))
        lines.append(f"| {b + 1} | {build['use']['cost']:.2f} | {whole['cost']:.2f} | " + " | ".join(f"{100 * (r - 1):+.2f} %" for r in ratios) + " |")
    return lines, worst, seconds


def printed_sheet(lamina, files, table, out):
    """Pages of the sheet of a build of 127 parts as Chromium prints it; its text has every number, serial number and position, and the hash."""
    write_orders(table, [(files[0], 60, "1001"), (files[1], 40, "1002"), (files[3], 10, "1003"), (files[4], 17, "1004")])
    _, builds, _ = nest(lamina, table, out, "--machine", "production-1200")
    sheet, pdf = os.path.join(out, "build-1", "sheet.html"), os.path.join(out, "sheet.pdf")
    subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer", f"--print-to-pdf={pdf}", sheet],
                   check=True, stderr=subprocess.DEVNULL)
    with open(pdf, "rb") as file:
        pages = len(re.findall(rb"/Type\s*/Page\b", file.read()))
    text = subprocess.run(["pdftotext", "-layout", pdf, "-"], check=True, text=True, stdout=subprocess.PIPE).stdout
    with open(sheet, encoding="utf-8") as file:
        digest = re.search(r"<code>([0-9a-f]+)</code>", file.read()).group(1)
    missing = [part["serial"] for part in builds[0]
               if not re.search(rf"\b{part['number']}\s+{part['serial']}\b.*?{float(part['x_mm']):.1f}, {float(part['y_mm']):.1f}", text)]
    if digest not in text or missing or len(builds[0]) != 127:
        sys.exit(f"orders: the sheet of {len(builds[0])} parts has no hash, or not the positions of {missing[:5]}")
    return pages


def main(arguments=()):
    lamina = arguments[0] if arguments else os.path.join(ROOT, "build/release/lamina")
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
        priced, worst, seconds = quoted(lamina, table, out, folder)
        lines += [f"The same with prices, by 64 layers of each build, in {seconds:.2f} s, next to `lamina jet --dry-run`; prices of parts add up to the cost.",
                  "", "| build | cost, EUR | whole run | hours | binder | powder | cost |", "|---|---|---|---|---|---|---|", *priced, ""]
        missed += worst > 0.02
        if shutil.which("chromium") and shutil.which("pdftotext"):
            pages = printed_sheet(lamina, files, table, out)
            lines += [f"The sheet of a build of 127 parts, printed by Chromium: {pages} A4 pages, with every number, serial number, position and the "
                      "hash in their text.", ""]
            missed += pages > 2
        crowns = {}
        for turns in ("0", "0,90,180,270"):
            result, builds, _ = nest(lamina, files[0], out, "--copies", "99", "--machine", "nuferbj", "--builds", "1", "--turns", turns)
            crowns[turns] = len(builds[0])
        lines += [f"Crowns in one level of the round bed of nuferbj: {crowns['0']} without turns, {crowns['0,90,180,270']} with four; 18 in rows. "
                  "Target: 26.", ""]
        missed += crowns["0,90,180,270"] < 26
        peer = built_peer(folder)
        hulls = {file: hull_of(lamina, file, folder) for file in files}
        lines += ["Levels of ten mixed orders: 60 rows of 1 to 12 copies of any of the 8 kinds. Rows are today's of `lamina jet`, in the order of the "
                  "table, by the same margin and gap. libnest2d arranges the convex outlines, as PrusaSlicer does; times are "
                  "those of the arrangement alone. Target: 1.3 times the parts per level of rows, and at least those of libnest2d in the same time.", "",
                  f"| order | parts | rows | lamina | ratio | lamina | libnest2d, parts on levels in this time | libnest2d in {PEER_SECONDS} s |",
                  "|---|---|---|---|---|---|---|---|"]
        for order in range(10):
            rng_order = random.Random(100 + order)
            wanted = [(rng_order.choice(files), rng_order.randint(1, 12)) for _ in range(60)]
            line, late = compare(lamina, table, wanted, sizes, hulls, peer)
            lines.append(f"| {order + 1} | {line}")
            missed += late
        lines += ["", "The same for ten orders of 4 kinds, each in one row of the table, which suits rows of boxes. Without a target: with a gap of 5 mm, "
                  "rows of equal boxes leave little to gain.", "", "| order | parts | rows | lamina | ratio |", "|---|---|---|---|---|"]
        for order in range(10):
            kinds = rng.sample(files[:7], 4)
            wanted = [(file, 10 * rng.randint(20, 80)) for file in kinds]
            line, _ = compare(lamina, table, wanted, sizes, None)
            lines.append(f"| {order + 1} | {line}")
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
        lines += ["", f"10,000 parts of 300 kinds on production-1200: {seconds:.1f} s with prices and files, {len(builds)} builds. Target: 60 s."]
    machine = figures.machine(ROOT)
    with open(os.path.join(ROOT, "bench/orders.md"), "w", encoding="utf-8") as page:
        page.write(f"# Orders as builds\n\n`bench/orders.py` at commit {figures.commit(ROOT)}: {machine['processor']}, {machine['cores']} cores. Gap 5 mm, "
                   "margin of the machine, four turns.\n\n" + "\n".join(lines) + "\n")
    print(f"orders: {missed} limits missed; bench/orders.md")
    if missed:
        sys.exit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
