"""bench/mslicer.py: mslicer (connorslade/mslicer) as a peer of scripts/bench: how its command line runs a fair job, and its images.

Read in its sources at commit ec4374ad, 2026-08-20 (slicer/bin/main.rs, slicer/src/slicer/raster, format/goo_format/src): layer i
is cut at i x the layer's height, so the part is lowered by half a layer to be cut in the middle, as ours is; a model is moved
so that its box, in millimetres, is centred on the display in pixels, which --position takes back; rows go up with y, ours
down. It writes one .goo of runs, of which a value above 127 counts as set.
"""
import os
import re
import struct
import subprocess

HEADER_BYTES = 0x2FB95    # Header::SIZE
LAYER_COUNT_AT = 4 + 8 + 32 + 24 + 24 + 3 * 32 + 3 * 2 + 2 * (116 * 116 + 290 * 290) + 2 * 2  # u32, then columns, rows: u16
LAYER_HEAD = 2 + 15 * 4 + 2 + 2  # pause, lengths and times, light, delimiter; then u32 bytes and 0x55
COMMIT_READ = "ec4374ad"


def box_of(path):
    """Lowest and highest corner of a binary STL, mm; facets are read a million at a time."""
    low, high = [float("inf")] * 3, [float("-inf")] * 3
    with open(path, "rb") as file:
        file.seek(84)
        while block := file.read(50 * 1_000_000):
            for axis in range(3):
                for corner in range(3):
                    at = 12 + 12 * corner + 4 * axis
                    column = bytearray(4 * (len(block) // 50))
                    for byte in range(4):
                        column[byte::4] = block[at + byte::50]
                    values = memoryview(column).cast("f")
                    low[axis], high[axis] = min(low[axis], min(values)), max(high[axis], max(values))
    return low, high


def command(program, part, output, size, pixels, layer, box):
    """size: of the display, mm; pixels: its columns and rows; box: of the part, which stands where the file says."""
    centre = [(low + high) / 2 for low, high in zip(*box)]
    position = [centre[axis] - pixels[axis] // 2 for axis in range(2)] + [-layer / 2]
    return [program, f"--platform-resolution={pixels[0]},{pixels[1]}",
            f"--platform-size={size[0]:.6f},{size[1]:.6f},{max(box[1][2], 1) + 10:.6f}", f"--layer-height={layer}", "--mesh", part,
            "--position=" + ",".join(f"{value:.6f}" for value in position), output]


def version(program):
    done = subprocess.run([program, "--version"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
    return done.stdout.strip() or os.path.basename(program)


class Goo:
    """A file of layers, read one at a time."""

    def __init__(self, path):
        self.path = path
        with open(path, "rb") as file:
            head = file.read(HEADER_BYTES)
            self.layers, self.columns, self.rows = struct.unpack_from(">IHH", head, LAYER_COUNT_AT)
            self.positions = []  # offset and bytes of the runs
            for _ in range(self.layers):
                size, magic = struct.unpack(">IB", file.read(LAYER_HEAD + 5)[LAYER_HEAD:])
                if magic != 0x55:
                    raise ValueError(f"{path}: layer {len(self.positions)} does not begin as a layer of a .goo does")
                self.positions.append((file.seek(0, os.SEEK_CUR), size - 2))
                file.seek(size - 2 + 1 + 2, os.SEEK_CUR)  # checksum, delimiter

    def runs(self, layer):
        """(length, value) of a layer; as LayerDecoder::next reads them."""
        at, size = self.positions[layer]
        with open(self.path, "rb") as file:
            file.seek(at)
            data = file.read(size)
        at, value = 0, 0
        while at < len(data):
            head = data[at]
            kind, more = head >> 6, head >> 4 & 3
            at += 1
            if kind == 2:  # a step from the value before; its length is 1 or the next byte
                value += -(head & 15) if more & 2 else head & 15
                length = data[at] if more & 1 else 1
                at += more & 1
            else:
                if kind == 1:
                    value = data[at]
                    at += 1
                else:
                    value = 255 if kind == 3 else 0
                length = head & 15 | int.from_bytes(data[at:at + more], "big") << 4
                at += more
            yield length, value

    def row_bits(self, layer):
        """Each row as a number of `columns` bits, the left pixel highest, from the front of the bed to its back."""
        rows, at = [0] * self.rows, 0
        for length, value in self.runs(layer):
            end = at + length
            while value > 127 and at < end:
                row, column = divmod(at, self.columns)
                if row >= self.rows:
                    break
                piece = min(end - at, self.columns - column)
                rows[row] |= ((1 << piece) - 1) << (self.columns - column - piece)
                at += piece
            at = end
        return rows


def pbm_bits(path):
    """Rows of a binary PBM as numbers, from its top to its bottom; and its columns."""
    with open(path, "rb") as file:
        data = file.read()
    head = re.match(rb"P4\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s", data)
    width, height = int(head[1]), int(head[2])
    stride, at = (width + 7) // 8, head.end()
    return [int.from_bytes(data[at + row * stride:at + (row + 1) * stride], "big") >> (8 * stride - width)
            for row in range(height)], width


def different_pixels(goo, layer, pbm):
    """Pixels that are set in one of both only."""
    ours, width = pbm_bits(pbm)
    if (width, len(ours)) != (goo.columns, goo.rows):
        raise ValueError(f"{goo.path}: {goo.columns} x {goo.rows} pixels, ours {width} x {len(ours)}")
    return sum((a ^ b).bit_count() for a, b in zip(reversed(ours), goo.row_bits(layer)))
