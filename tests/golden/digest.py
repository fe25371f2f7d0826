"""What a job leaves, as one hash: names and bytes of layers, programs, toolpaths and tables.

Files about the job that are no product of it are left out: manifests and other JSON, job files, locks.
"""
import hashlib
import os


def is_product(name):
    return not name.endswith((".json", ".part", ".lock")) and (name == "machine.toml" or not name.endswith(".toml"))


def product_files(position):
    """Paths below `place` of all files of the product, sorted."""
    found = []
    for folder, _, names in os.walk(position):
        found += [os.path.relpath(os.path.join(folder, name), position) for name in names if is_product(name)]
    return sorted(found)


def digest(position, version=""):
    """Hash of the product below the directory `place`; a program's `version` in its files counts as any other. No file: ''."""
    names = product_files(position)
    whole = hashlib.blake2b(digest_size=16)
    for name in names:
        with open(os.path.join(position, name), "rb") as file:
            content = file.read()
        if version:
            content = content.replace(b"lamina " + version.encode(), b"lamina VERSION")
        whole.update(f"{name}\0{len(content)}\0".encode())
        whole.update(content)
    return whole.hexdigest() if names else ""
