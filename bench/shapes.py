"""bench/shapes.py: closed parts by formula, with as many triangles as wanted. Python's standard library only.

Facets are written as they are made, so that a part may be larger than memory; the same bytes every time.
"""
import itertools
import math
import os
import struct
import zipfile

HEADER = b"binary STL made by bench/shapes.py".ljust(80, b" ")
ZERO, END = bytes(12), bytes(2)  # normal; attribute word


def knot_rings(around, along, p=2, q=3):
    """Rings of corners around a (p, q) torus knot, 49 x 51 x 24 mm: its middle winds p times about z and q times about the
    middle of the torus."""
    def point(s):
        angle, radius = 2 * math.pi * s, 15 + 7 * math.cos(q * 2 * math.pi * s)
        return radius * math.cos(p * angle), radius * math.sin(p * angle), 7 * math.sin(q * angle)

    def crossed(a, b):
        return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]

    def unit(a):
        length = math.sqrt(sum(v * v for v in a))
        return tuple(v / length for v in a)

    turns = [(math.cos(t), math.sin(t)) for t in (2 * math.pi * j / around for j in range(around))]
    for i in range(along):
        middle, ahead, behind = point(i / along), point((i + 1) / along), point((i - 1) / along)
        forward = unit([a - b for a, b in zip(ahead, behind)])
        side = unit(crossed(forward, (middle[0], middle[1], 0)))
        other = crossed(side, forward)
        yield [[m + 4.8 * (c * u + s * v) for m, u, v in zip(middle, side, other)] for c, s in turns]


def knot_size(triangles):
    """Facets around and along of a knot with about so many triangles; ten times as many along, as in knot800k."""
    around = max(3, round(math.sqrt(triangles / 20)))
    return around, max(3, round(triangles / 2 / around))


def packed(ring, scale):
    """Corners as the file has them, 12 bytes each."""
    raw = struct.pack(f"<{3 * len(ring)}f", *(scale * v for point in ring for v in point))
    return [raw[at:at + 12] for at in range(0, len(raw), 12)]


def write_facets(path, count, blocks):
    """A binary STL of `count` facets in blocks of bytes."""
    with open(path + ".part", "wb") as file:
        file.write(HEADER + struct.pack("<I", count))
        for block in blocks:
            file.write(block)
        size = file.seek(0, os.SEEK_CUR)
    if size != 84 + 50 * count:
        raise ValueError(f"{path}: {size} bytes for {count} facets")
    os.replace(path + ".part", path)
    return count


def strip(here, there):
    """Facets between two rings of corners, closed around."""
    here_next, there_next = here[1:] + here[:1], there[1:] + there[:1]
    zero, end = itertools.repeat(ZERO), itertools.repeat(END)
    return b"".join(itertools.chain.from_iterable(
        zip(zero, here, there_next, here_next, end, zero, here, there, there_next, end)))


def write_knot(path, triangles, scale=1.0, position=None):
    """A torus knot of about so many triangles; how many. place: where a corner goes, if not where it is; scaled after that"""
    around, along = knot_size(triangles)

    def blocks():
        rings = (packed(ring if position is None else [position(*point) for point in ring], scale)
                 for ring in knot_rings(around, along))
        first = here = next(rings)
        for there in itertools.chain(rings, [first]):
            yield strip(here, there)
            here = there

    return write_facets(path, 2 * around * along, blocks())


def write_box(path, x, y, z):
    """A box with a corner at the origin, sides in mm: 12 triangles."""
    corners = [struct.pack("<3f", (i & 1) * x, (i >> 1 & 1) * y, (i >> 2 & 1) * z) for i in range(8)]
    faces = ((0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5))
    return write_facets(path, 12, (ZERO + b"".join(corners[i] for i in face) + END for face in faces))


def write_columns(path, across, sides, size, height):
    """across x across columns with so many sides on size x size mm, a stress of rows; how many triangles."""
    pitch = size / across

    def column(number):
        x, y = pitch * (number % across + 0.5), pitch * (number // across + 0.5)
        ring = [[x + 0.3 * pitch * math.cos(2 * math.pi * j / sides), y + 0.3 * pitch * math.sin(2 * math.pi * j / sides), z]
                for z in (0, height) for j in range(sides)]
        corners = packed(ring, 1.0)
        low, high = corners[:sides], corners[sides:]
        floor, top = packed([[x, y, 0], [x, y, height]], 1.0)
        caps = b"".join(ZERO + floor + low[(j + 1) % sides] + low[j] + END + ZERO + top + high[j] + high[(j + 1) % sides] + END
                        for j in range(sides))
        # Rings run counter-clockwise from above, so that walls are those of a strip turned over.
        return strip(low[::-1], high[::-1]) + caps

    return write_facets(path, across * across * 4 * sides, (column(number) for number in range(across * across)))


def write_waves(path, across, deep, width, depth, height):
    """A block whose top is a field of interfering waves, about 2 x across x deep facets; how many triangles."""
    def top(i, j):
        x, y = i / across, j / deep
        wave = math.sin(40 * math.pi * x) * math.sin(26 * math.pi * y) + math.cos(90 * math.hypot(x - 0.3, y - 0.6))
        return [width * x, depth * y, height * (0.5 + 0.2 * wave)]

    def ring(j):
        """From the front-left corner of the floor along the top and back: a row of the field and the floor below it."""
        return packed([top(i, j) for i in range(across + 1)] + [[width, depth * j / deep, 0], [0, depth * j / deep, 0]], 1.0)

    def fan(corners):
        """Closes an end: the floor's corners see the row in one plane."""
        row, right, left = corners[:-2], corners[-2], corners[-1]
        split = len(row) // 2
        facets = [(left, b, a) for a, b in zip(row[:split + 1], row[1:split + 1])] + [(left, right, row[split])]
        return facets + [(right, b, a) for a, b in zip(row[split:], row[split + 1:])]

    def blocks():
        here = first = ring(0)
        for j in range(1, deep + 1):
            there = ring(j)
            yield strip(there, here)
            here = there
        yield b"".join(ZERO + a + c + b + END for a, b, c in fan(here))
        yield b"".join(ZERO + a + b + c + END for a, b, c in fan(first))

    return write_facets(path, 2 * (across + 3) * deep + 2 * (across + 1), blocks())


def write_pages(path, count, side=512, dpi=600):
    """A TIFF of `count` uncompressed 1-bit pages, a square that moves from page to page in each."""
    with open(path, "wb") as file:
        file.write(struct.pack("<2sHI", b"II", 42, 8))
        end, stride = 8, side // 8
        for page in range(count):
            at = end
            tags = [(256, 3, side), (257, 3, side), (258, 3, 1), (259, 3, 1), (262, 3, 0), (273, 4, 0), (277, 3, 1), (278, 3, side),
                    (279, 4, stride * side), (282, 5, 0), (283, 5, 0)]
            fraction = at + 2 + 12 * len(tags) + 4
            values = {273: fraction + 8, 282: fraction, 283: fraction}
            file.write(struct.pack("<H", len(tags)))
            for tag, kind, value in tags:
                file.write(struct.pack("<HHII", tag, kind, 1, values.get(tag, value)))
            end = fraction + 8 + stride * side
            file.write(struct.pack("<III", end if page + 1 < count else 0, dpi, 1))
            for row in range(side):
                solid = side // 4 <= row < side // 2
                left = (page % (stride // 2)) * solid
                file.write(bytes(left) + b"\xff" * (stride // 2 * solid) + bytes(stride - left - stride // 2 * solid))


def write_items(path, count, step):
    """A 3MF file whose build has `count` items of one cube of 10 mm, each `step` mm further along the diagonal."""
    corners = list(itertools.product((0, 10), repeat=3))
    facets = [(0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5)]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("_rels/.rels", '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
                         'Target="/3D/a.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>')
        package.writestr("3D/a.model", "".join([
            '<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1"><mesh><vertices>',
            *(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in corners), "</vertices><triangles>",
            *(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in facets), "</triangles></mesh></object></resources><build>",
            *(f'<item objectid="1" transform="1 0 0 0 1 0 0 0 1 {step * i:.6f} {step * i:.6f} 0"/>' for i in range(count)), "</build></model>"]))
