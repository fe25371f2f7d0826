"""tests/calibration/photographs/generator.py: photographs of printed layers and charts. Nothing is shared with lamina-scan.

A layer is a bitmap of drops. Each drop becomes a disc of its own size at a jittered position, with a satellite after it along the
scan. The sheet has grain; the camera is a pinhole above it, tilted and rotated, with uneven light, a shadow, blur, noise and JPEG.
Lengths are in mm of the image of the layer, from its upper left corner.
"""
import dataclasses
import io

import numpy as np
from PIL import Image


@dataclasses.dataclass
class Drops:
    """What the printer deposits: the position of each drop, its row and column in the bitmap."""
    x: np.ndarray
    y: np.ndarray
    row: np.ndarray
    column: np.ndarray
    pitch: tuple  # mm of a pixel in x and y


@dataclasses.dataclass
class Printing:
    jitter_um: float = 7
    satellites: float = 0.3  # fraction of drops
    radius: float = 0.75  # of a drop, in pixels of the layer
    radius_spread: float = 0.06
    along_x: bool = True


@dataclasses.dataclass
class Camera:
    pixels_per_mm: float
    rotation_deg: float = 0
    tilt_deg: tuple = (0, 0)
    distance_mm: float = 250
    margin_mm: float = 5
    paper: float = 0.75
    ink: float = 0.15
    grain: float = 0.03
    slope: tuple = (0, 0)
    shadow: float = 0.2
    shadow_mm: float = 4
    blur: float = 0.8  # pixels
    noise: float = 2  # grey values
    quality: int = 85  # of JPEG
    mirrored: bool = False


def drops_of(bitmap, pitch):
    row, column = np.nonzero(bitmap)
    return Drops((column + 0.5) * pitch[0], (row + 0.5) * pitch[1], row, column, pitch)


def add_discs(cover, x, y, radius):
    """Adds discs to a raster; positions and radii in cells, whose centres are whole numbers."""
    height, width = cover.shape
    reach = int(np.ceil(radius.max() + 1))
    around = np.arange(-reach, reach + 1)
    for begin in range(0, len(x), 20_000):
        part = slice(begin, begin + 20_000)
        column, row = np.rint(x[part]).astype(np.int64), np.rint(y[part]).astype(np.int64)
        ix, iy = column[:, None, None] + around, row[:, None, None] + around[:, None]
        distance = np.hypot(ix - x[part][:, None, None], iy - y[part][:, None, None])
        share = np.clip(radius[part][:, None, None] - distance + 0.5, 0, 1)
        index = np.broadcast_to(iy * width + ix, share.shape)
        inside = (share > 0) & (ix >= 0) & (ix < width) & (iy >= 0) & (iy < height)
        if not inside.any():
            continue
        cells, low = index[inside], int(index[inside].min())
        sums = np.bincount(cells - low, share[inside])
        cover.ravel()[low:low + len(sums)] += sums.astype(np.float32)
    np.clip(cover, 0, 1, out=cover)


def smooth(image, sigma):
    """Gaussian blur by a separable kernel; edges are repeated."""
    if sigma <= 0:
        return image
    reach = int(np.ceil(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        wide = np.pad(image, [(reach, reach) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        length = image.shape[axis]
        image = sum(w * np.take(wide, range(i, i + length), axis) for i, w in enumerate(weights))
    return image


class Sheet:
    """The fraction of each cell of a printed sheet that ink covers."""

    def __init__(self, drops, printing, step_mm, random):
        self.step, margin = step_mm, 1.0
        self.left, self.top = drops.x.min() - margin, drops.y.min() - margin
        self.width, self.height = drops.x.max() + margin - self.left, drops.y.max() + margin - self.top
        self.cover = np.zeros((int(self.height / step_mm) + 1, int(self.width / step_mm) + 1), np.float32)
        jitter = printing.jitter_um * 1e-3
        x, y = (at + jitter * random.standard_normal(len(at)) for at in (drops.x, drops.y))
        pitch = np.sqrt(drops.pitch[0] * drops.pitch[1])
        radius = printing.radius * pitch * (1 + printing.radius_spread * random.standard_normal(len(x)))
        behind = random.random(len(x)) < printing.satellites
        offset = -random.uniform(0.5, 1.3, behind.sum()) * pitch
        aside = 0.1 * pitch * random.standard_normal(behind.sum())
        x_satellite = x[behind] + (offset if printing.along_x else aside)
        y_satellite = y[behind] + (aside if printing.along_x else offset)
        small = radius[behind] * random.uniform(0.3, 0.5, behind.sum())
        for xs, ys, rs in ((x, y, radius), (x_satellite, y_satellite, small)):
            add_discs(self.cover, (xs - self.left) / step_mm - 0.5, (ys - self.top) / step_mm - 0.5, rs / step_mm)
        grain = np.pad(smooth(random.standard_normal((256, 256)), 1.2), 0)
        self.grain = grain / grain.std()

    def at(self, x, y):
        """Coverage, bilinear; 0 outside."""
        u, v = (x - self.left) / self.step - 0.5, (y - self.top) / self.step - 0.5
        i, j = np.floor(u).astype(np.int32), np.floor(v).astype(np.int32)
        inside = (i >= 0) & (j >= 0) & (i + 1 < self.cover.shape[1]) & (j + 1 < self.cover.shape[0])
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        u, v = u - i, v - j
        c = self.cover
        value = (1 - v) * ((1 - u) * c[j, i] + u * c[j, i + 1]) + v * ((1 - u) * c[j + 1, i] + u * c[j + 1, i + 1])
        return np.where(inside, value, 0)

    def grain_at(self, x, y):
        """Fibres and grains of some 50 um; the pattern repeats."""
        return self.grain[(y / 0.03).astype(np.int64) % 256, (x / 0.03).astype(np.int64) % 256]


def sheet_of_pixel(camera, sheet, width, height):
    """A function from pixels of the photograph to mm of the sheet: the ray of a pinhole camera meets the plane of the sheet."""
    turn, (a, b) = np.radians(camera.rotation_deg), np.radians(camera.tilt_deg)
    about_z = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    rotated = about_y @ about_x @ about_z  # from the sheet, about its middle, to the camera, at a distance along z
    focal = camera.pixels_per_mm * camera.distance_mm
    to_pixel = np.diag([focal, focal, 1]) @ np.column_stack([rotated[:, 0], rotated[:, 1], [0, 0, camera.distance_mm]])
    back = np.linalg.inv(to_pixel)
    mid_x, mid_y = sheet.left + sheet.width / 2, sheet.top + sheet.height / 2

    def at(px, py):
        u, v = px - width / 2, py - height / 2
        x, y, w = (back[k, 0] * u + back[k, 1] * v + back[k, 2] for k in range(3))
        return mid_x + x / w, mid_y + y / w
    return at


def photograph(sheet, camera, random):
    """returns  the photograph, as a PIL image, after JPEG"""
    turn, scale = np.radians(camera.rotation_deg), camera.pixels_per_mm
    c, s = abs(np.cos(turn)), abs(np.sin(turn))
    width = int((sheet.width * c + sheet.height * s + 2 * camera.margin_mm) * scale)
    height = int((sheet.width * s + sheet.height * c + 2 * camera.margin_mm) * scale)
    at = sheet_of_pixel(camera, sheet, width, height)
    px, py = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    cover = np.zeros((height, width))
    for dx in (-1 / 3, 0, 1 / 3):
        for dy in (-1 / 3, 0, 1 / 3):
            cover += sheet.at(*at(px + dx, py + dy)) / 9
    grain = sheet.grain_at(*at(px, py))
    reflected = camera.paper * (1 + camera.grain * grain) * (1 - cover) + camera.ink * (1 + 0.5 * camera.grain * grain) * cover
    u, v = 2 * px / width - 1, 2 * py / height - 1
    angle, away = random.uniform(0, 2 * np.pi), random.uniform(-0.5, 0.5)
    edge = (np.cos(angle) * (px - width / 2) + np.sin(angle) * (py - height / 2)) / scale - away * min(width, height) / 2 / scale
    light = (1 + camera.slope[0] * u + camera.slope[1] * v) * (1 - camera.shadow / (1 + np.exp(-edge / camera.shadow_mm)))
    value = np.clip(smooth(reflected * light, camera.blur), 0, 1)
    tint = np.array([1.0, 0.97, 0.9])
    colour = np.clip(value[..., None] * tint, 0, 1)
    grey = np.where(colour <= 0.0031308, 12.92 * colour, 1.055 * colour ** (1 / 2.4) - 0.055) * 255
    grey += camera.noise * random.standard_normal((height, width, 1)) + 0.5 * camera.noise * random.standard_normal(grey.shape)
    image = Image.fromarray(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    if camera.mirrored:
        image = image.transpose(Image.Transpose.FLIP_LEFT_RIGHT)
    file = io.BytesIO()
    image.save(file, "JPEG", quality=camera.quality)
    return file.getvalue()


def random_camera(random, pixels_per_mm):
    return Camera(pixels_per_mm=pixels_per_mm, rotation_deg=random.uniform(0, 360), tilt_deg=tuple(random.uniform(-5, 5, 2)),
                  distance_mm=random.uniform(180, 400), margin_mm=random.uniform(3, 10), paper=random.uniform(0.6, 0.85),
                  ink=random.uniform(0.08, 0.3), grain=random.uniform(0.01, 0.05), slope=tuple(random.uniform(-0.2, 0.2, 2)),
                  shadow=random.uniform(0, 0.35), shadow_mm=random.uniform(2, 8), blur=random.uniform(0.6, 1.3),
                  noise=random.uniform(1, 4), quality=int(random.integers(70, 91)))


def random_printing(random, along_x):
    return Printing(jitter_um=random.uniform(5, 10), satellites=random.uniform(0, 0.5), radius=random.uniform(0.72, 0.85),
                    radius_spread=random.uniform(0.02, 0.08), along_x=along_x)


def random_layer(random, dpi):
    """Two to six parts with holes, as a bitmap of a bed of 80 mm."""
    side = int(80 / 25.4 * dpi)
    at = (np.arange(side) + 0.5) * 25.4 / dpi
    x, y = np.meshgrid(at, at)
    bitmap = np.zeros((side, side), bool)
    for _ in range(random.integers(2, 7)):
        u, v = x - random.uniform(20, 60), y - random.uniform(20, 60)
        turn, size = random.uniform(0, 2 * np.pi), random.uniform(4, 11)
        u, v = np.cos(turn) * u + np.sin(turn) * v, np.cos(turn) * v - np.sin(turn) * u
        if random.random() < 0.5:  # a bracket
            wall = random.uniform(0.25, 0.5) * size
            part = (abs(u) < size) & (abs(v) < 0.6 * size) & ((u < wall - size) | (v < wall - 0.6 * size))
        else:
            radius = size * (1 + random.uniform(0, 0.35) * np.sin(random.integers(2, 6) * np.arctan2(v, u)))
            distance = np.hypot(u, v)
            part = (distance < radius) & (distance > random.uniform(0, 0.5) * size)
        bitmap |= part
    return bitmap
