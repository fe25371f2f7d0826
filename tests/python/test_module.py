"""tests/python/test_module.py LAMINA: the module `lamina` against the program LAMINA: its arrays are what the files decode to."""
import gc
import pathlib
import resource
import subprocess
import sys
import tempfile
import threading
import unittest

try:
    import numpy as np
except ImportError:
    print("NOT RUN: the Python module; install Debian's python3-numpy", file=sys.stderr)
    sys.exit(77)
import lamina

PROGRAM = sys.argv.pop(1)
ROOT = pathlib.Path(__file__).resolve().parents[2]
PART = str(ROOT / "tests/corpus/nist_am_test_artifact_v3b.stl")
CROWN = str(ROOT / "tests/corpus/dental_crown.stl")
SETTINGS = {"bed.size_mm": (200, 160), "bed.dpi": (300, 200), "layers.thickness_mm": 0.5}


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True)


class Module(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.position = tempfile.TemporaryDirectory()
        cls.directory = pathlib.Path(cls.position.name)
        done = run("jet", PART, "--bed", "200x160", "--dpi", "300x200", "--layer", "0.5", "--quiet", "-o", cls.directory / "out")
        assert done.returncode == 0, done.stderr
        cls.plan = lamina.plan(PART, SETTINGS)

    @classmethod
    def tearDownClass(cls):
        cls.position.cleanup()

    def file(self, index):
        return self.directory / "out/layers" / f"{index:06}.tif"

    def test_every_layer_is_the_decoded_file_of_the_program(self):
        count = 0
        for layer in self.plan:
            decoded = lamina.read_image(str(self.file(layer.index)))
            np.testing.assert_array_equal(layer.row_offset, decoded.row_offset)
            np.testing.assert_array_equal(layer.change, decoded.change)
            self.assertEqual(layer.encode(), self.file(layer.index).read_bytes())
            count += 1
        self.assertEqual(count, len(list((self.directory / "out/layers").iterdir())))
        self.assertEqual(count, len(self.plan))

    def test_pixels_are_those_of_a_reader_that_is_not_ours(self):
        layer = self.plan[3]
        layer.save(str(self.directory / "layer.pbm"))
        raw = (self.directory / "layer.pbm").read_bytes()
        bits = np.unpackbits(np.frombuffer(raw[-self.plan.rows * ((self.plan.columns + 7) // 8):], np.uint8)
                             .reshape(self.plan.rows, -1), axis=1)[:, :self.plan.columns]
        image = layer.pixels()
        self.assertEqual(image.dtype, bool)
        np.testing.assert_array_equal(image, bits != 0)
        self.assertEqual(int(image.sum()), layer.set_pixels)
        np.testing.assert_array_equal(layer.pixels(100, 300, 41, 777), image[100:300, 41:777])
        for wrong in ((5, 4), (0, self.plan.rows + 1), (0, 1, 0, self.plan.columns + 1)):
            with self.assertRaises(ValueError):
                layer.pixels(*wrong)

    def test_arrays_are_views_that_keep_their_owner(self):
        layer = self.plan[0]
        change = layer.change
        self.assertFalse(change.flags.owndata)
        self.assertFalse(change.flags.writeable)
        self.assertIs(change.base, layer)
        self.assertEqual(change.ctypes.data, layer.change.ctypes.data)
        copy = change.copy()
        del layer
        gc.collect()
        np.testing.assert_array_equal(change, copy)
        triangles = lamina.load(CROWN).meshes[0].triangles  # neither the part nor its mesh is held by anything else
        gc.collect()
        self.assertEqual(triangles.shape[1:], (3, 3))
        self.assertTrue((triangles.reshape(-1, 3).max(axis=0) > triangles.reshape(-1, 3).min(axis=0)).all())

    def test_layers_are_planned_when_they_are_requested_for_and_kept_by_none(self):
        plan = lamina.plan(PART, {**SETTINGS, "layers.thickness_mm": 0.0001})
        self.assertEqual(len(plan), 170000)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for layer in plan.layers(0, 1500):
            pass
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        self.assertLess(grown, 1500 * layer.change.nbytes // 1024 // 4)
        self.assertEqual(layer.index, 1499)
        self.assertEqual(plan[-1].index, 169999)
        with self.assertRaises(IndexError):
            plan[170000]

    def test_other_threads_work_while_a_layer_is_planned(self):
        plan = lamina.plan(PART, SETTINGS)
        made = [None] * len(plan)

        def work(begin):
            for index in range(begin, len(plan), 3):
                made[index] = plan[index]
        threads = [threading.Thread(target=work, args=(i,)) for i in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for layer, alone in zip(made, self.plan):
            np.testing.assert_array_equal(layer.change, alone.change)

    def test_heights_alone_are_those_of_the_plan_and_of_each_part(self):
        settings = {"heights.mode": "optimal", "heights.thickness_mm": "0.1..0.5"}
        table = lamina.heights(PART, settings)
        np.testing.assert_array_equal(table, lamina.plan(PART, {**SETTINGS, **settings}).heights)
        alone = lamina.heights([PART, CROWN], {**settings, "heights.per_part": True})
        tops = alone["bottom"].astype(int) + alone["thickness"]
        self.assertTrue((np.diff(tops) >= 0).all())
        self.assertGreater(len(alone), len(table))

    def test_contours_lie_where_the_images_of_a_machine_do(self):
        plan = lamina.plan(CROWN, {"machine.profile": "nuferbj", "layers.thickness_mm": 0.5})
        layer, index = plan[5], 5
        x = np.concatenate([contour[:, 0] for contour in plan.contours(index)]) / 1e6
        columns = np.flatnonzero(layer.pixels().any(axis=0))
        pitch = 25.4 / plan.dpi[0]
        self.assertLess(abs(columns[0] * pitch - x.min()), 2 * pitch)
        self.assertLess(abs((columns[-1] + 1) * pitch - x.max()), 2 * pitch)

    def test_heights_add_up(self):
        plan = lamina.plan(PART, {**SETTINGS, "heights.mode": "optimal", "heights.thickness_mm": "0.1..0.5"})
        table = plan.heights
        self.assertEqual(len(table), len(plan))
        np.testing.assert_array_equal(table["bottom"][1:], np.cumsum(table["thickness"])[:-1])
        self.assertEqual(table["bottom"][0], 0)
        self.assertEqual((plan[1].bottom, plan[1].thickness), tuple(table[1])[:2])
        self.assertEqual(plan[1].plane, plan[1].bottom + plan[1].thickness // 2)
        self.assertEqual(lamina.reasons[table["reason"][1]], plan[1].reason)
        said = run("heights", PART, "--heights", "optimal", "--thickness", "0.1..0.5", "--format", "csv", "-o", self.directory / "t.csv")
        self.assertEqual(said.returncode, 0, said.stderr)
        rows = (self.directory / "t.csv").read_text().count("\n")
        self.assertIn(rows - len(table), (0, 1, 2))  # with a line of names

    def test_contours_enclose_what_is_set(self):
        contours, layer = self.plan.contours(4), self.plan[4]
        area = 0.0
        for points in contours:
            self.assertEqual(points.dtype, np.int32)
            x, y = points.astype(float).T / 1e6
            area += 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        self.assertAlmostEqual(area, contours.area_mm2, delta=5e-7)
        pixel = 25.4 ** 2 / (self.plan.dpi[0] * self.plan.dpi[1])
        self.assertAlmostEqual(layer.set_pixels * pixel / area, 1, delta=5e-3)
        self.assertEqual(contours.offset[-1], len(contours.point))
        self.assertIs(contours.point.base, contours)

    def test_a_whole_job_gives_the_bytes_of_the_program(self):
        summary = lamina.jet(str(self.directory / "again"), PART, SETTINGS)
        self.assertEqual(summary["layers_total"], len(self.plan))
        for name in sorted(path.relative_to(self.directory / "out") for path in (self.directory / "out").rglob("*")):
            if (self.directory / "out" / name).is_file():
                self.assertEqual((self.directory / "out" / name).read_bytes(), (self.directory / "again" / name).read_bytes(), name)
        with self.assertRaises(lamina.UsageError):
            lamina.jet(str(self.directory / "again"), PART, {**SETTINGS, "bed.dpi": 100})

    def test_slices_and_toolpaths_have_the_bytes_of_the_program(self):
        done = run("slice", CROWN, "--layer", "0.4", "--walls", "1", "--quiet", "-o", self.directory / "cut")
        self.assertEqual(done.returncode, 0, done.stderr)
        summary = lamina.slice(str(self.directory / "own"), CROWN, {"layers.thickness_mm": 0.4, "fill.walls": 1})
        self.assertEqual(summary["command"], "slice")
        name = pathlib.Path(CROWN).stem + ".svg"
        self.assertEqual((self.directory / "cut" / name).read_bytes(), (self.directory / "own" / name).read_bytes())
        settings = {"layers.thickness_mm": 0.2, "fill.walls": 2, "machine.profile": "marlin"}
        one, two = self.directory / "one.gcode", self.directory / "two.gcode"
        done = run("extrude", CROWN, "--machine", "marlin", "--quiet", "-o", one)
        self.assertEqual(done.returncode, 0, done.stderr)
        summary = lamina.extrude(str(two), CROWN, settings)
        self.assertEqual(summary["layers_planned"], summary["layers_total"])
        self.assertEqual(one.read_bytes(), two.read_bytes())
        with self.assertRaises(lamina.UsageError):
            lamina.extrude(str(two), CROWN, settings)
        lamina.extrude(str(two), CROWN, {"machine.profile": "marlin"}, overwrite=True)
        self.assertEqual(one.read_bytes(), two.read_bytes(), "the defaults of the command")

    def test_each_powder_of_a_layer_is_the_decoded_file_of_its_own(self):
        rabbit, nut = (str(ROOT / "tests/corpus" / name) for name in ("rabbit_9_overlapping_shells.obj", "parameter_quality_nut.stl"))
        job = self.directory / "powders.toml"
        # They overlap in part of their layers; the nut is of bronze between two heights.
        job.write_text("[bed]\nsize_mm = [60, 50]\ndpi = 300\n[layers]\nthickness_mm = 0.4\n"
                       f"[[part]]\npath = '{rabbit}'\nat_mm = [5, 5]\nmaterial = 'steel'\n"
                       f"[[part]]\npath = '{nut}'\nat_mm = [15, 10]\nmaterial = 'bronze'\n"
                       "[[part.material_range]]\nfrom_mm = 4\nto_mm = 8\nmaterial = 'steel'\n"
                       "[[part.material_range]]\nfrom_mm = 8\nto_mm = 12\nmaterial = 'tin'\n")
        out = self.directory / "powders"
        said = run("jet", "--job", job, "--quiet", "-o", out)
        self.assertEqual(said.returncode, 0, said.stderr)
        plan = lamina.plan(job=str(job))
        self.assertEqual(plan.materials, ["steel", "bronze", "tin"])
        mixed = 0
        for layer in plan:
            images = layer.materials
            self.assertEqual(list(images), plan.materials)
            whole = layer.pixels()
            together = np.zeros(layer.shape, np.uint8)
            for name, image in images.items():
                decoded = lamina.read_image(str(out / f"layers/{layer.index:06}-{name}.tif"))
                np.testing.assert_array_equal(image.row_offset, decoded.row_offset)
                np.testing.assert_array_equal(image.change, decoded.change)
                self.assertEqual(image.dpi, layer.dpi)
                together += image.pixels()
            np.testing.assert_array_equal(together, whole.astype(np.uint8))  # so no pixel is set in two
            self.assertEqual(sum(image.set_pixels for image in images.values()), layer.set_pixels)
            mixed += sum(image.set_pixels > 0 for image in images.values()) > 1
        self.assertGreater(mixed, 20)
        # Views into the layer, which lives as long as they do.
        layer = plan[15]
        change = layer.materials["steel"].change
        self.assertFalse(change.flags.owndata)
        self.assertEqual(change.ctypes.data, layer.materials["steel"].change.ctypes.data)
        copy = change.copy()
        self.assertGreater(len(copy), 0)
        del layer, images, image
        gc.collect()
        np.testing.assert_array_equal(change, copy)

    def test_powders_are_named_for_all_parts_or_for_each(self):
        parts = [CROWN, str(ROOT / "tests/corpus/parameter_quality_nut.stl")]
        settings = {"bed.size_mm": (60, 60), "bed.dpi": 100, "layers.thickness_mm": 1}
        self.assertEqual(lamina.plan(parts, settings).materials, [])
        self.assertEqual(lamina.plan(parts, settings)[3].materials, {})
        one = lamina.plan(parts, settings, materials="steel")
        layer = one[3]
        self.assertEqual(one.materials, ["steel"])
        self.assertIs(layer.materials["steel"], layer)
        two = lamina.plan(parts, settings, materials=("steel", "bronze"))
        self.assertEqual(two.materials, ["steel", "bronze"])
        np.testing.assert_array_equal(two[3].change, layer.change)
        for name, part in zip(two.materials, parts):
            self.assertGreater(two[3].materials[name].set_pixels, 0, part)
        summary = lamina.jet(str(self.directory / "two"), parts, settings, materials=["steel", "bronze"])
        self.assertEqual(summary["layers_total"], len(two))
        self.assertEqual(len(list((self.directory / "two/layers").iterdir())), 2 * len(two))
        for wrong in ("steel,", ["a", "b", "c"], "two words"):
            with self.assertRaisesRegex(lamina.UsageError, "^materials: "):
                lamina.plan(parts, settings, materials=wrong)

    def test_errors_are_the_one_line_of_the_program(self):
        for call, kind, code, words in (
                (lambda: lamina.plan(str(ROOT / "tests/corpus/broken/empty_file.stl")), lamina.InputError, 3, "empty_file.stl"),
                (lambda: lamina.plan("nowhere.stl"), lamina.InputError, 3, "nowhere.stl"),
                (lambda: lamina.plan(PART, {"bed.dip": 600}), lamina.UsageError, 2, "bed.dip"),
                (lambda: lamina.plan(PART, {"bed.dpi": -1}), lamina.UsageError, 2, "bed.dpi"),
                (lambda: lamina.plan(), lamina.UsageError, 2, "part"),
                (lambda: self.plan[0].encode("gif"), lamina.UsageError, 2, "gif"),
                (lambda: self.plan[0].save(str(self.directory / "no/where.tif")), lamina.OutputError, 4, "where.tif"),
                (lambda: lamina.read_image(PART), lamina.VerificationError, 5, "nist")):
            with self.assertRaises(kind) as caught:
                call()
            self.assertEqual(caught.exception.code, code)
            self.assertIn(words, str(caught.exception))
            self.assertNotIn("\n", str(caught.exception))
            self.assertIsInstance(caught.exception, lamina.Error)
        self.assertTrue(issubclass(lamina.OutputError, OSError) and issubclass(lamina.UsageError, ValueError))

    def test_errors_speak_of_keys_and_arguments(self):
        again = str(self.directory / "spoken")
        lamina.jet(again, CROWN, {"bed.dpi": 100, "layers.thickness_mm": 1})
        for call, words, never in (
                (lambda: lamina.plan(PART, {"bed.dpy": 3}), "bed.dpy", "--set"),
                (lambda: lamina.plan(PART, {"heights.mode": "optimal"}), "'heights.thickness_mm'", "--"),
                (lambda: lamina.jet(again, CROWN, {"bed.dpi": 200, "layers.thickness_mm": 1}), "overwrite=True", "--overwrite"),
                (lambda: lamina.read_image(PART), "lamina.load reads parts", "plan the layer again")):
            with self.assertRaises(lamina.Error) as caught:
                call()
            self.assertIn(words, str(caught.exception))
            self.assertNotIn(never, str(caught.exception))

    def test_slices_of_a_plan_are_sequences_that_plan_on_demand(self):
        indices = list(range(len(self.plan)))
        for requested in (slice(0, 3), slice(None), slice(-2, None), slice(5, 2), slice(None, None, -4), slice(3, 1000, 2)):
            some = self.plan[requested]
            self.assertEqual([layer.index for layer in some], indices[requested])
            self.assertEqual(len(some), len(indices[requested]))
        some = self.plan[2:20:3]
        self.assertEqual((some[1].index, some[-1].index), (5, 17))
        self.assertEqual([layer.index for layer in some[::-2]], indices[2:20:3][::-2])
        np.testing.assert_array_equal(some[1].change, self.plan[5].change)
        with self.assertRaises(IndexError):
            some[6]
        with self.assertRaises(TypeError):
            self.plan["first"]
        self.assertIn("6 layers, 2 to 17", repr(some))

    def test_a_plan_describes_itself(self):
        said = repr(self.plan)
        for words in ("nist_am_test_artifact_v3b.stl", f"{len(self.plan)} layers", f"{self.plan.columns} x {self.plan.rows} pixels",
                      "300 x 200 dpi"):
            self.assertIn(words, said)

    def test_keys_are_those_of_job_files_and_everything_is_described(self):
        saved = self.directory / "job.toml"
        self.assertEqual(run("jet", PART, "--save-job", saved, "--dry-run", "--quiet").returncode, 0)
        keys = {key["key"] for key in lamina.keys()}
        for section in ("bed.size_mm", "layers.thickness_mm", "part.rotate_deg", "run.memory"):
            self.assertIn(section, keys)
        planned = lamina.plan(job=str(saved), settings=SETTINGS)
        np.testing.assert_array_equal(planned[2].change, self.plan[2].change)
        for name in ("load", "plan", "jet", "read_image", "image_formats", "keys", "Plan", "Layer", "Image", "Mesh", "Part", "Contours"):
            self.assertTrue(getattr(lamina, name).__doc__, name)
        self.assertEqual("lamina " + lamina.__version__, run("--version").stdout.strip())

    def test_a_plan_that_none_holds_is_gone_and_an_iterator_holds_its_plan(self):
        plan = lamina.plan(CROWN, {"bed.dpi": 100, "layers.thickness_mm": 1})
        layers = iter(plan)
        del plan
        gc.collect()
        self.assertEqual(sum(1 for _ in layers), 10)

    def test_the_example_draws_a_layer(self):
        picture = self.directory / "picture.png"
        said = subprocess.run([sys.executable, ROOT / "python/examples/plot_layer.py", CROWN, "--height", "4", "-o", picture, "--library"],
                              capture_output=True, text=True)
        self.assertEqual(said.returncode, 0, said.stderr)
        self.assertIn("mm2", said.stdout)
        self.assertGreater(lamina.read_image(str(picture)).set_pixels, 0)


if __name__ == "__main__":
    unittest.main(verbosity=1)
