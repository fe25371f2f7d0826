"""bench/real_answers.py: whether two builds give the same answer, before a clock starts: pixels, print programs, files, figures."""
import json
import os
import subprocess
import sys

# Part of a layer's pixels or drops that may differ: where a plane touches corners but for the noise of their floats, 73edc841 cut next
# to them. Layer 69 of the plate of 96 has 130 such pixels, terrain 9 in two layers.
NOISE = 1e-5
SAMPLES = 3  # images that are decoded: first, middle, last


def differs(row, what):
    sys.exit(f"bench: {row.name}: the builds differ in {what}")


def content(path):
    with open(path, "rb") as file:
        return file.read()


def different_pixels(one, other):
    """Their number as a part of the larger number of pixels that are set."""
    from PIL import Image, ImageChops  # python3-pil
    Image.MAX_IMAGE_PIXELS = None
    with Image.open(one) as a, Image.open(other) as b:
        if (a.size, a.mode) != (b.size, b.mode):
            return 1
        if a.tobytes() == b.tobytes():
            return 0
        grey = a.convert("L"), b.convert("L")
        counts = [sum(image.histogram()[1:]) for image in (ImageChops.difference(*grey), *map(ImageChops.invert, grey), *grey)]
        return counts[0] / max(1, min(max(counts[1:3]), max(counts[3:])))


def layer_files(folder):
    layers = os.path.join(folder, "layers")
    if not os.path.isdir(layers):
        layers = folder
    return sorted(os.path.join(layers, name) for name in os.listdir(layers) if name[0].isdigit())


def same_images(row, old, new):
    pairs = list(zip(layer_files(old), layer_files(new), strict=True))
    if not pairs:
        differs(row, "no images at all")
    unequal = [pair for pair in pairs if content(pair[0]) != content(pair[1])]
    step = max(1, len(unequal) // SAMPLES)
    for before, after in unequal[::step]:
        if different_pixels(before, after) > NOISE:
            differs(row, os.path.basename(after))


def same_program(row, options, old, new):
    """Hashes of expanded programs in both manifests; `lamina verify` holds the newer ones against files, firmware and plan."""
    def programs(folder):
        with open(os.path.join(folder, "manifest.json"), encoding="utf-8") as file:
            return [layer["program"] for layer in json.load(file)["layers"]]
    unequal = [(before["drops"], after["drops"]) for before, after in zip(programs(old), programs(new), strict=True)
               if before["xxh3_128"] != after["xxh3_128"]]
    if len(unequal) > 1 or any(abs(before - after) > NOISE * before for before, after in unequal):
        differs(row, f"programs of {len(unequal)} layers")
    subprocess.run([options.new, "verify", new, "--quiet"], check=True)


def same_files(row, old, new):
    def files(path):
        if os.path.isdir(path):
            return {os.path.relpath(os.path.join(base, name), path): os.path.join(base, name) for base, _, names in os.walk(path)
                    for name in names if not name.endswith((".json", ".toml", ".lock"))}
        folder, stem = os.path.split(path)
        return {name[len(stem):]: os.path.join(folder, name) for name in os.listdir(folder) if name.startswith(stem + ".") and not name.endswith(".json")}
    before, after = files(old), files(new)
    if before.keys() != after.keys() or not after:
        differs(row, "names of files")
    for name, path in before.items():
        if content(path) != content(after[name]):
            differs(row, name)


def similar_contours(row, old, new):
    """Layers and length of SVG files: corners near a plane, which 73edc841 cut by the noise of their floats, make their bytes differ."""
    def figures_of(folder):
        text = content(next(os.path.join(folder, name) for name in os.listdir(folder) if name.endswith(".svg")))
        return text.count(b"<g "), text.count(b" d=\""), len(text)
    before, after = figures_of(old), figures_of(new)
    if before[:2] != after[:2] or abs(before[2] - after[2]) > before[2] / 1000:
        differs(row, f"layers, parts and bytes: {before} and {after}")


def same_figures(row, options, words):
    """What `info --json` of both states under the same names; a later build may state more."""
    texts = [subprocess.run([program, *words, "--json"], check=True, stdout=subprocess.PIPE).stdout for program in (options.old, options.new)]
    before, after = (json.loads(text.splitlines()[0]) for text in texts)
    for key, value in before.items():
        if isinstance(value, (int, float)) and not key.endswith("seconds") and key in after and after[key] != value:
            differs(row, f"{key}: {value} and {after[key]}")


def same_answer(options, row, old, new, words):
    if row.answer == "images":
        same_images(row, old, new)
    elif row.answer == "program":
        same_program(row, options, old, new)
    elif row.answer == "files":
        same_files(row, old, new)
    elif row.answer == "contours":
        similar_contours(row, old, new)
    elif row.answer == "text":
        same_figures(row, options, words)
