"""bench/real_answers.py: whether two builds give the same answer, before a clock starts: pixels, print programs, files, figures."""
import hashlib
import json
import os
import subprocess
import sys

SAMPLES = 3  # images that are decoded: first, middle, last


def differs(row, what):
    sys.exit(f"bench: {row.name}: the builds differ in {what}")


def content(path):
    with open(path, "rb") as file:
        return file.read()


def pixels(path):
    """Decoded pixels, a byte each."""
    from PIL import Image  # python3-pil
    Image.MAX_IMAGE_PIXELS = None
    with Image.open(path) as image:
        return image.size, image.mode, hashlib.sha256(image.tobytes()).hexdigest()


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
        if pixels(before) != pixels(after):
            differs(row, os.path.basename(after))


def program_hash(options, folder, streams):
    """Of start, layers in order and end, expanded."""
    whole = hashlib.sha256()
    if streams:
        with subprocess.Popen([options.new, "stream", folder], stdout=subprocess.PIPE) as child:
            while piece := child.stdout.read(1 << 20):
                whole.update(piece)
        if child.returncode != 0:
            sys.exit("bench: lamina stream failed")
        return whole.hexdigest()
    program = os.path.join(folder, "program")
    names = os.listdir(program)
    for name in [n for n in names if n.startswith("start.")] + sorted(n for n in names if n[0].isdigit()) + [n for n in names if n.startswith("end.")]:
        whole.update(content(os.path.join(program, name)))
    return whole.hexdigest()


def same_program(row, options, old, new):
    if program_hash(options, old, False) != program_hash(options, new, True):
        differs(row, "print programs")
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
    elif row.answer == "text":
        same_figures(row, options, words)
