#!/usr/bin/env python3
"""Makes the parts of scripts/bench from the models folder. Python's standard library only; the same bytes every time.

    bench/make_parts.py MODELS CACHE [--made] [--large]

A part that is in the cache already is not made again. Every part is a closed mesh in an uncompressed binary STL, where it
shall stand on the bed; parts.json says where that is, in nanometres:

    terrain.stl       St. Helens scaled to fit 100 x 100 mm: 645,364 triangles, 191 layers of 0.1 mm
    benchy.stl        3DBenchy: 225,154 triangles, 480 layers of 0.1 mm
    benchy15.stl      3DBenchy at 1.5 times its size: 225,154 triangles, 720 layers of 0.1 mm
    crown.stl         a dental crown made 27.8 x 29.6 x 9.6 mm: 3,878 triangles, 96 layers of 0.1 mm, 20 of 0.48 mm
    gyroid.stl        a gyroid sheet of 24 mm: 246,820 triangles, for the runs that measure memory
    crowns96.stl      96 of them in one mesh, 12 x 8 on 400 x 400 mm
    knot800k.stl      a torus knot by formula: 800,000 triangles, 472 layers of 0.05 mm (--made)
    pins.stl          80 x 80 square pins of 0.5 mm on a plate of 80 mm: 156,172 triangles, 16 layers of 0.1 mm (--made)
    pins_tie.stl      the same; the plate's face is 7 um lower, in the middle of a layer (--made)
    steps.stl         96 round towers of 12 horizontal steps, 12 x 8 on 400 x 400 mm: 13 layers of 0.1 mm (--made)
    steps_tie.stl     the same; each step is 7 um lower, in the middle of a layer (--made)
    scan680k.stl      a bumpy ball of 42 mm whose 683,280 triangles lie in disorder: 425 layers of 0.1 mm (--made)
    benchies72.stl    72 Benchies in one mesh, 6 x 12 on 400 x 400 mm: 811 MB, 480 layers of 0.1 mm (--large)
"""
import argparse
import array
import gzip
import json
import math
import os
import random
import struct
import sys
import zipfile
import xml.etree.ElementTree as xml

sys.dont_write_bytecode = True
from shapes import knot_rings  # noqa: E402

RECORD = 50  # bytes of a facet: normal, three corners (12 floats), attribute word
HEADER = b"binary STL made by bench/make_parts.py".ljust(80, b" ")


def read_stl(path):
    """Corner coordinates of a binary STL: [x, y, z], one array of doubles each, three entries a facet."""
    with (gzip.open if path.endswith(".gz") else open)(path, "rb") as file:
        data = file.read()
    count = struct.unpack_from("<I", data, 80)[0]
    body = memoryview(data)[84:84 + RECORD * count]
    axes = [array.array("d") for _ in range(3)]
    for record in struct.iter_unpack("<12fH", body):
        for axis in range(3):
            axes[axis].extend((record[3 + axis], record[6 + axis], record[9 + axis]))
    return axes


def read_3mf(path):
    """The same of a 3MF that holds one object in one untransformed item."""
    name = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    vertices, axes = [], [array.array("d") for _ in range(3)]
    with zipfile.ZipFile(path) as archive, archive.open("3D/3dmodel.model") as model:
        for _, element in xml.iterparse(model):
            if element.tag == name + "vertex":
                vertices.append(tuple(float(element.get(axis)) for axis in "xyz"))
                element.clear()
            elif element.tag == name + "triangle":
                for corner in ("v1", "v2", "v3"):
                    point = vertices[int(element.get(corner))]
                    for axis in range(3):
                        axes[axis].append(point[axis])
                element.clear()
            elif element.tag == name + "item" and element.get("transform"):
                numbers = [float(number) for number in element.get("transform").split()]
                if numbers[:9] != [1, 0, 0, 0, 1, 0, 0, 0, 1]:
                    sys.exit(f"{path}: its item is turned or scaled; not understood here")
    return axes


def tall(axes, height):
    """The factor that gives a part this height. A whole number of layers keeps both programs at the same count, if the
    height as a float is not below it: PrusaSlicer drops a last layer that is not full, lamina plans it."""
    return height / (max(axes[2]) - min(axes[2]))


def placed(axes, factors):
    """Scaled per axis, with the lowest corner of the box at the origin."""
    result = []
    for axis, factor in zip(axes, factors):
        low = min(axis) * factor
        result.append(array.array("d", [value * factor - low for value in axis]))
    return result


def write_stl(path, axes, offsets=((0.0, 0.0),), reported=True):
    """One binary STL with a copy of the part at every (x, y) of `offsets`; `reported` prints its size."""
    facets = len(axes[0]) // 3
    records = bytearray(RECORD * facets)  # normals and attributes stay zero

    def put(axis, shift):
        values = array.array("f", [value + shift for value in axes[axis]] if shift else axes[axis])
        if sys.byteorder == "big":
            values.byteswap()
        raw = values.tobytes()
        for corner in range(3):
            for byte in range(4):
                records[12 + 12 * corner + 4 * axis + byte::RECORD] = raw[4 * corner + byte::12]

    put(2, 0.0)
    with open(path + ".part", "wb") as file:
        file.write(HEADER + struct.pack("<I", facets * len(offsets)))
        last = (None, None)
        for offset in offsets:
            for axis in range(2):
                if offset[axis] != last[axis]:
                    put(axis, offset[axis])
            last = offset
            file.write(records)
    os.replace(path + ".part", path)
    if reported:
        print(f"{path}: {facets * len(offsets)} triangles, {os.path.getsize(path)} bytes", flush=True)


def grid(axes, columns, rows, side):
    """Offsets of columns x rows copies, spread evenly and centred on a square bed."""
    width, depth = max(axes[0]), max(axes[1])
    step_x = (side - columns * width) / columns + width
    step_y = (side - rows * depth) / rows + depth
    if step_x <= width or step_y <= depth:
        sys.exit(f"{columns} x {rows} copies of {width:.1f} x {depth:.1f} mm do not fit {side} mm")
    return [(round(column * step_x + (step_x - width) / 2, 2), round(row * step_y + (step_y - depth) / 2, 2))
            for row in range(rows) for column in range(columns)]


def torus_knot(around, along):
    """A tube along a torus knot, 2 x around x along facets."""
    rings = list(knot_rings(around, along))
    axes = [array.array("d") for _ in range(3)]
    for i in range(along):
        here, there = rings[i], rings[(i + 1) % along]
        for j in range(around):
            k = (j + 1) % around
            for corner in (here[j], there[k], here[k], here[j], there[j], there[k]):
                for axis in range(3):
                    axes[axis].append(corner[axis])
    return axes


def pins(face, across=80, side=0.5, height=1.6):
    """Square pins, 1 mm apart, on a plate whose face is at that height; mm. All share one grid of corners, which the underside
    has too, so that every edge has two facets."""
    lines = [0.0] + [i + k * side + (1 - side) / 2 for i in range(across) for k in range(2)] + [float(across)]
    cells, facets = range(len(lines) - 1), []

    def is_pin(i, k):
        return i % 2 == 1 and k % 2 == 1

    def quad(a, b, c, d):
        facets.extend((a, b, c, a, c, d))

    for i in cells:
        for k in cells:
            x0, x1, y0, y1 = lines[i], lines[i + 1], lines[k], lines[k + 1]
            z = height if is_pin(i, k) else face
            quad((x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z))
            quad((x0, y0, 0), (x0, y1, 0), (x1, y1, 0), (x1, y0, 0))
            walls = [((x0, y0), (x1, y0), k == 0), ((x1, y0), (x1, y1), i == cells[-1]),
                     ((x1, y1), (x0, y1), k == cells[-1]), ((x0, y1), (x0, y0), i == 0)]
            for (ax, ay), (bx, by), outside in walls:
                if outside or is_pin(i, k):
                    low = face if is_pin(i, k) else 0
                    quad((ax, ay, low), (bx, by, low), (bx, by, z), (ax, ay, z))
    return [array.array("d", [corner[axis] for corner in facets]) for axis in range(3)]


def steps(below, count=12, sides=48, radius=14.0):
    """A round tower whose horizontal steps are that far below whole tenths of a millimetre; mm."""
    def ring(size, z):
        turns = (2 * math.pi * (k + 0.25) / sides for k in range(sides))
        return [(radius + size * math.cos(t), radius + size * math.sin(t), z) for t in turns]

    rings = [ring(radius, 0.0)]
    for i in range(count):
        size, z = radius - i, (i + 1) / 10 - below
        rings += [ring(size, z), ring(size - 1, z)]
    rings[-1] = ring(radius - count, rings[-1][0][2])
    facets = []
    for here, there in zip(rings, rings[1:]):
        for j in range(sides):
            k = (j + 1) % sides
            facets += [here[j], here[k], there[k], here[j], there[k], there[j]]
    for ends in (rings[0][::-1], rings[-1]):
        middle = (radius, radius, ends[0][2])
        for j in range(sides):
            facets += [middle, ends[j], ends[(j + 1) % sides]]
    return placed([array.array("d", [corner[axis] for corner in facets]) for axis in range(3)], (1, 1, 1))


def bumpy_ball(across):
    """As a scanner leaves a surface: fine waves, and facets in no order. 2 x across x (across + 1) facets."""
    def point(i, j):
        a, b = math.pi * (i + 0.5) / (across + 1), 2 * math.pi * j / across
        radius = (20 + 1.5 * math.sin(5 * a) * math.sin(7 * b) + 0.4 * math.sin(31 * a + 3) * math.sin(29 * b)
                  + 0.05 * math.sin(173 * a) * math.sin(191 * b))
        return radius * math.sin(a) * math.cos(b), radius * math.sin(a) * math.sin(b), radius * math.cos(a)

    rings = [[point(i, j) for j in range(across)] for i in range(across + 1)]
    facets = []
    for here, there in zip(rings, rings[1:]):
        for j in range(across):
            k = (j + 1) % across
            facets += [(here[j], there[j], there[k]), (here[j], there[k], here[k])]
    for ring in (rings[0], rings[-1][::-1]):
        middle = tuple(sum(point[axis] for point in ring) / across for axis in range(3))
        facets += [(middle, ring[j], ring[(j + 1) % across]) for j in range(across)]
    random.Random(1).shuffle(facets)
    return [array.array("d", [corner[axis] for facet in facets for corner in facet]) for axis in range(3)]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("models")
    parser.add_argument("cache")
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--made", action="store_true")
    options = parser.parse_args()
    os.makedirs(options.cache, exist_ok=True)
    index = os.path.join(options.cache, "parts.json")
    parts = {}
    if os.path.exists(index):
        with open(index, encoding="utf-8") as file:
            parts = json.load(file)
    read = {}

    def model(name):
        if name not in read:
            path = os.path.join(options.models, name)
            read[name] = read_3mf(path) if name.endswith(".3mf") else read_stl(path)
        return read[name]

    def make(name, recipe):
        """recipe() gives a part with its corner at the origin and the places of its copies."""
        path = os.path.join(options.cache, name)
        if name in parts and os.path.exists(path):
            return
        axes, offsets = recipe()
        write_stl(path, axes, offsets)
        corner = [struct.unpack("<f", struct.pack("<f", min(offset[axis] for offset in offsets)))[0]
                  for axis in range(2)]
        parts[name] = {"at_nm": [round(value * 1e6) for value in corner],
                       "height_mm": max(axes[2]), "triangles": len(axes[0]) // 3 * len(offsets)}
        with open(index + ".part", "w", encoding="utf-8") as file:
            json.dump(parts, file, indent=2)
        os.replace(index + ".part", index)

    def one(axes, side=100.0):
        return axes, [tuple(round((side - max(axes[axis])) / 2, 2) for axis in range(2))]

    def many(axes, columns, rows):
        return axes, grid(axes, columns, rows, 400.0)

    def terrain():
        axes = model("st_helens_terrain_645k.stl.gz")
        return placed(axes, (0.588, 0.588, tall(axes, 19.1)))  # 158 x 169.5 mm become 92.9 x 99.7

    def crown():
        axes = model("dental_crown.stl")
        return placed(axes, (2.6, 2.6, tall(axes, 9.6)))

    def benchy(factor):
        return placed(model("3DBenchy.3mf"), (factor, factor, factor))

    make("terrain.stl", lambda: one(terrain()))
    make("benchy.stl", lambda: one(benchy(1.0)))
    make("benchy15.stl", lambda: one(benchy(1.5)))
    make("crown.stl", lambda: one(crown()))
    make("gyroid.stl", lambda: one(placed(model("gyroid_sheet_cyl_247k.stl.gz"), (1, 1, 1)), 30.0))
    make("crowns96.stl", lambda: many(crown(), 12, 8))
    if options.made:
        make("knot800k.stl", lambda: one(placed(torus_knot(200, 2000), (1, 1, 1))))
        for name, lift in (("", 0.007), ("_tie", 0.0)):
            make(f"pins{name}.stl", lambda: one(pins(1.05 + lift)))
            make(f"steps{name}.stl", lambda: many(steps(0.05 - lift), 12, 8))
        make("scan680k.stl", lambda: one(placed(bumpy_ball(584), (1, 1, 1))))
    if options.large:
        make("benchies72.stl", lambda: many(benchy(1.0), 6, 12))


if __name__ == "__main__":
    main()
