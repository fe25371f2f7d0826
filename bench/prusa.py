"""bench/prusa.py: PrusaSlicer 2.5 as the peer of scripts/bench: settings for a fair run, and its images."""
import re
import struct
import subprocess
import zipfile
import zlib

# No supports, no pad, no grey levels, no growth or shrinkage: every layer is sampled at its middle, as ours is.
SETTINGS = """\
printer_technology = SLA
bed_shape = 0x0,{bed}x0,{bed}x{bed},0x{bed}
display_width = {bed}
display_height = {bed}
display_pixels_x = {pixels}
display_pixels_y = {pixels}
display_orientation = landscape
display_mirror_x = 0
display_mirror_y = 0
max_print_height = 1000
layer_height = {layer}
initial_layer_height = {layer}
supports_enable = 0
pad_enable = 0
hollowing_enable = 0
support_object_elevation = 0
gamma_correction = 0
elefant_foot_compensation = 0
faded_layers = 2
slice_closing_radius = 0
relative_correction_x = 1
relative_correction_y = 1
relative_correction_z = 1
output_filename_format = [input_filename_base].sl1
"""


def write_settings(path, bed, dpi, layer):
    pixels = -(-bed * dpi * 5 // 127)  # ceil(bed * dpi / 25.4)
    with open(path, "w", encoding="ascii") as file:
        # The display is as wide as its pixels are, a little more than the bed, so that a pixel is 25.4 / dpi mm.
        width = f"{pixels * 25.4 / dpi:.6f}"
        text = SETTINGS.format(bed=bed, pixels=pixels, layer=layer)
        file.write(text.replace(f"display_width = {bed}\n", f"display_width = {width}\n")
                       .replace(f"display_height = {bed}\n", f"display_height = {width}\n"))


def command(settings, part, archive):
    return ["prusa-slicer", "--loglevel", "1", "--load", settings, "--dont-arrange", "--export-sla", "-o", archive, part]


def version():
    return subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "prusa-slicer"], check=True, text=True,
                          stdout=subprocess.PIPE).stdout


def image_names(archive):
    with zipfile.ZipFile(archive) as images:
        return sorted(name for name in images.namelist() if re.fullmatch(r"[^/]*\d{5}\.png", name))


def image_size(archive, name):
    with zipfile.ZipFile(archive) as images, images.open(name) as image:
        return struct.unpack(">II", image.read(24)[16:24])


def image_rows(archive, name):
    """Rows of an 8-bit grey PNG, one byte a pixel."""
    with zipfile.ZipFile(archive) as images:
        data = images.read(name)
    at, packed = 8, []
    width = height = 0
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlace = struct.unpack_from(">IIBBBBB", data, at + 8)
            if (depth, colour, interlace) != (8, 0, 0):
                raise ValueError(f"{name}: not an 8-bit grey PNG")
        elif kind == b"IDAT":
            packed.append(data[at + 8:at + 8 + size])
        at += 12 + size
    raw = zlib.decompress(b"".join(packed))
    for row in range(height):
        line = raw[row * (width + 1):(row + 1) * (width + 1)]
        if line[0] != 0:
            raise ValueError(f"{name}: row {row} has PNG filter {line[0]}, which PrusaSlicer 2.5 does not use")
        yield line[1:]


def different_pixels(archive, name, pbm):
    """Pixels set (grey > 127) in PrusaSlicer's image and not in the PBM, or the other way round."""
    white = bytes(0 if value < 128 else 1 for value in range(256))
    spread = [bytes((value >> (7 - bit)) & 1 for bit in range(8)) for value in range(256)]
    with open(pbm, "rb") as file:
        data = file.read()
    head = re.match(rb"P4\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s", data)
    width, height = int(head[1]), int(head[2])
    stride, at, different = (width + 7) // 8, head.end(), 0
    for row, theirs in enumerate(image_rows(archive, name)):
        packed = data[at + row * stride:at + (row + 1) * stride]
        ours = bytes(8 * stride) if not any(packed) else b"".join(map(spread.__getitem__, packed))
        theirs = theirs.translate(white)
        if ours[:width] != theirs:
            different += (int.from_bytes(ours[:width], "big") ^ int.from_bytes(theirs, "big")).bit_count()
    if row + 1 != height:
        raise ValueError(f"{name}: {row + 1} rows, ours {height}")
    return different
