"""What a job leaves, as one hash: names and bytes of layers, programs, toolpaths and tables.

Files about the job that are no product of it are left out: manifests and other JSON, job files, locks. Compressed files count
expanded and without .zst, because a codec's bytes depend on its version.
"""
import ctypes
import hashlib
import os


def expanded(content):
    """The content of a Zstandard frame that states its size."""
    zstd = ctypes.CDLL("libzstd.so.1")
    zstd.ZSTD_getFrameContentSize.restype = ctypes.c_ulonglong
    zstd.ZSTD_decompress.restype = ctypes.c_size_t
    size = zstd.ZSTD_getFrameContentSize(content, ctypes.c_size_t(len(content)))
    if size >= 1 << 32:
        raise ValueError("a frame does not state its size")
    out = ctypes.create_string_buffer(size)
    if zstd.ZSTD_decompress(out, ctypes.c_size_t(size), content, ctypes.c_size_t(len(content))) != size:
        raise ValueError("a frame is damaged")
    return out.raw


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
        if name.endswith(".zst"):
            name, content = name.removesuffix(".zst"), expanded(content)
        if version:
            content = content.replace(b"lamina " + version.encode(), b"lamina VERSION")
        whole.update(f"{name}\0{len(content)}\0".encode())
        whole.update(content)
    return whole.hexdigest() if names else ""
