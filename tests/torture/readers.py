"""Every reader of images and meshes within limits on address space (ulimit -v) and on open files (ulimit -n): the same answer, or
exit 6 and one line with what is needed."""
import gzip
import os
import re
import resource
import struct
import sys
import zlib

import jobs
from tally import Tally

FORMATS = ["tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none", "png", "pbm", "bmp", "tiff-4", "tiff-8", "png-8"]
FILES = range(4, 17)
SMALLEST_MB, LARGEST_MB, STEP = 12, 6000, 1.12
NEEDED = re.compile(r"needs more than (\d+) MiB of address space|too many open files: needs more than (\d+);")

sys.path.insert(0, os.path.join(jobs.ROOT, "bench"))
import shapes  # noqa: E402


def pattern(side, row):
    """A row of bits: squares that change along the image."""
    return (bytes([0xff] * (1 + row // 64 % 7)) + bytes(5)).ljust(side // 8, b"\x0f")[:side // 8]


def write_pbm(path, side):
    with open(path, "wb") as file:
        file.write(b"P4\n# lamina dpi 600 600\n%d %d\n" % (side, side) + b"".join(pattern(side, row) for row in range(side)))


def write_pgm(path, side):
    """Of 8 bits, in binary and in ASCII."""
    rows = [bytes((column * row >> 4) & 255 for column in range(side)) for row in range(side)]
    with open(path, "wb") as file:
        file.write(b"P5\n%d %d\n255\n" % (side, side) + b"".join(rows))
    with open(path.replace("5.pgm", "2.pgm"), "w", encoding="ascii") as file:
        file.write(f"P2\n{side} {side}\n255\n" + "\n".join(" ".join(map(str, row)) for row in rows) + "\n")


def write_png(path, side):
    """Of 1 bit, row by row."""
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    packer = zlib.compressobj(1)
    data = b"".join(packer.compress(b"\0" + pattern(side, row)) for row in range(side)) + packer.flush()
    head = struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)
    metre = struct.pack(">IIB", 94488, 94488, 1)  # 2400 dpi
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"pHYs", metre) + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def write_meshes(folder):
    with open(jobs.NUT, "rb") as file:
        data = file.read()
    with open(os.path.join(folder, "nut.stl"), "wb") as file:
        file.write(data)
    with gzip.open(os.path.join(folder, "nut.stl.gz"), "wb") as file:
        file.write(data)
    with open(os.path.join(folder, "ascii.stl"), "w", encoding="ascii") as file:
        file.write("solid nut\n")
        for at in range(84, len(data), 50):
            corners = struct.unpack_from("<9f", data, at + 12)
            file.write("facet normal 0 0 0\nouter loop\n")
            file.writelines("vertex {!r} {!r} {!r}\n".format(*corners[i:i + 3]) for i in (0, 3, 6))
            file.write("endloop\nendfacet\n")
        file.write("endsolid nut\n")


def reading_jobs(program, folder):
    """Jobs by reader; their inputs are made in the folder."""
    at = jobs.fresh(os.path.join(folder, "inputs"))
    write_pbm(os.path.join(at, "base.pbm"), 2048)
    write_pgm(os.path.join(at, "grey5.pgm"), 512)
    write_png(os.path.join(at, "large.png"), 20000)
    shapes.write_pages(os.path.join(at, "pages.tif"), 40)
    write_meshes(at)
    stacks = {"400 megapixels": "large.png", "pgm": "grey5.pgm", "pgm, ASCII": "grey2.pgm", "tiff, 40 pages": "pages.tif"}
    for form in FORMATS:
        ran = program.run(["convert", "base.pbm", "--format", form, "-o", form, "--quiet"], at)
        assert ran.code == 0, ran.error
        stacks[form] = form
    meshes = {"stl": "nut.stl", "stl, ASCII": "ascii.stl", "stl, gzip": "nut.stl.gz", "obj": os.path.join(jobs.CORPUS, "quad_knot.obj"),
              "3mf": os.path.join(jobs.CORPUS, "arrow_scaled_mirrored.3mf")}
    found = []
    for name, path in stacks.items():
        path, dpi = os.path.join(at, path), "2400" if path == "large.png" else "600"
        found.append((f"info, {name}", ["info", path], []))
        found.append((f"convert, {name}", ["convert", path, "-o", "out", "--dpi", dpi, "--quiet"], []))
        if not path.endswith("pgm"):  # states no resolution
            found.append((f"jet, {name}", ["jet", path, "--layer", "0.1", "--dpi", dpi, "-o", "out", "--quiet"], []))
    for name, path in meshes.items():
        path = os.path.join(at, path)
        found.append((f"info, {name}", ["info", path], []))
        found.append((f"jet, {name}", ["jet", path, "--dpi", "150", "--layer", "0.5", "-o", "out", "--quiet"], []))
    for form in ("tiff-g4", "png", "bmp", "pbm"):
        job = ["jet", jobs.NUT, "--dpi", "300", "--layer", "0.5", "--format", form, "-o", "job", "--quiet"]
        found.append((f"verify, {form}", ["verify", "job"], [job]))
        found.append((f"preview, {form}", ["preview", "job", "--layer", "3", "-o", "out.png", "--quiet"], [job]))
    return found


def answer(program, words, folder, before, limits=None):
    """The run, and what it printed and wrote."""
    jobs.fresh(folder)
    for job in before:
        program.run(job, folder)
    ran = program.run(words, folder, preexec_fn=limits)
    return ran, (ran.out, {name: value for name, value in jobs.tree(folder).items() if not name.startswith("job")})


def check(name, ran, found, expected, limit, tally):
    """One run within a limit. limit  in words, and in the unit of the message. returns  whether it is complete"""
    words, value = limit
    if ran.code == 127 or ran.error.startswith(("\nlibgomp: ", "libgomp: ")) or ran.code in (-9, -11) and not ran.error and value < 30:
        tally.trial(name, not_begun=1)  # the loader had no room for the libraries
        return False
    tally.trial(name, done=int(ran.code == 0), refused=int(ran.code == 6))
    where = f"{words}: exit {ran.code}: {ran.error[-300:]}"
    needed = NEEDED.search(ran.error)
    if ran.code is None:
        tally.fault(name, "hangs", where)
    elif ran.code == 0 and found != expected:
        tally.fault(name, "differs", where)
    elif ran.code == 6 and (not needed or int(needed[1] or needed[2]) < value or ran.error.count("\n") != 1):
        tally.fault(name, "wrong", where)
    elif ran.code not in (0, 6):
        tally.fault(name, "aborts" if ran.aborted or ran.code < 0 else "wrong", where)
    return ran.code == 0


def main(program, settings, draw):
    del draw
    tally = Tally(f"readers within limits: ulimit -v from {SMALLEST_MB} MB up to enough, ulimit -n {FILES[0]} to {FILES[-1]}")
    folder = os.path.join(settings.work, "trial")
    for name, words, before in reading_jobs(program, settings.work):
        if not settings.matches(name):
            continue
        ran, expected = answer(program, words, folder, before)
        assert ran.code == 0, f"{name}: {ran.code} {ran.error}"
        size, complete = SMALLEST_MB, 0
        while size < LARGEST_MB and complete < 3:
            limit = int(size) << 20
            ran, found = answer(program, words, folder, before, lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
            complete += check(name, ran, found, expected, (f"-v {int(size)} MB", int(size)), tally)
            size *= STEP
        if complete == 0:
            tally.fault(name, "wrong", f"not complete with {LARGEST_MB} MB")
        for files in FILES:
            ran, found = answer(program, words, folder, before,
                                lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files)))
            check(name, ran, found, expected, (f"-n {files}", files), tally)
    return tally
