// python/module.cpp: `import lamina`.
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <optional>

#include "arrays.h"

namespace lamina::python {
namespace {

using namespace pybind11::literals;
using pipeline::Job;

/// A value of a setting as a job's keys read it: lists are separated by commas.
std::string setting_text(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (py::isinstance<py::str>(value) || !py::hasattr(value, "__iter__")) return py::str(value);
  std::string text;
  for (const py::handle item : value) text += (text.empty() ? "" : ",") + setting_text(item);
  return text;
}

/// A checked job; one without an output writes nothing.
Job make_job(const py::object& parts, const py::dict& settings, const py::object& materials, const std::string& file,
             const std::string& output = {}) {
  Job job;
  if (!file.empty()) {
    if (Status status = pipeline::read_job(file, job); !status) raise(status.error());
  }
  const auto add = [&](const py::handle& path) {
    job.parts.emplace_back();
    job.parts.back().path = py::module_::import("os").attr("fspath")(path).cast<std::string>();
  };
  if (!parts.is_none()) {
    job.parts.clear();
    if (py::isinstance<py::str>(parts) || py::hasattr(parts, "__fspath__")) {
      add(parts);
    } else {
      for (const py::handle path : parts) add(path);
    }
  }
  for (const auto& [key, value] : settings) {
    const std::string assignment = fmt::format("{}={}", py::str(key).cast<std::string>(), setting_text(value));
    if (Status status = pipeline::set_key(job, assignment); !status) raise(status.error());
  }
  if (!materials.is_none()) {
    if (Status status = pipeline::set_materials(setting_text(materials), job); !status) {
      raise({Fault::kUsage, "materials: " + status.error().message});
    }
  }
  job.output = output;
  job.dry_run = output.empty();
  if (Status status = pipeline::check_job(job); !status) raise(status.error());
  return job;
}

/// A layer of a job: its place, the image that it has, and of a job of several powders those of each.
struct PlannedLayer : Image {
  Layer layer;
  std::vector<std::string> materials;
  std::vector<Image> images;  // one for each of several materials
};

struct LayerEntry {
  std::int32_t bottom, thickness;
  std::uint8_t reason;
};

py::array table_of(const std::vector<Layer>& layers) {
  py::array_t<LayerEntry> array(static_cast<py::ssize_t>(layers.size()));
  LayerEntry* entry = array.mutable_data();
  for (const Layer& layer : layers) *entry++ = {layer.bottom, layer.thickness, static_cast<std::uint8_t>(layer.reason)};
  return array;
}

class Plan {
 public:
  explicit Plan(const Job& job) : source_(without_lock([&] { return pipeline::LayerSource::make(job); })) {}

  const pipeline::LayerSource& of() const { return source_; }
  const PixelGrid& grid() const { return source_.grid(); }

  std::uint32_t index(std::int64_t requested) const {
    const std::int64_t count = of().layer_count(), index = requested < 0 ? requested + count : requested;
    if (index < 0 || index >= count) throw py::index_error(fmt::format("layer {}: there are {} layers", requested, count));
    return static_cast<std::uint32_t>(index);
  }

  PlannedLayer layer(std::uint32_t index) const {
    PlannedLayer made;
    auto images = without_lock([&] { return source_.images(index); });
    made.runs = std::move(images.whole);
    made.dpi_x = grid().x.dpi();
    made.dpi_y = grid().y.dpi();
    made.materials = source_.materials();
    made.tags = source_.tags(index);
    for (Runs& image : images.material) {
      made.images.push_back({std::move(image), made.dpi_x, made.dpi_y, made.tags});
      made.images.back().tags.material = made.materials[made.images.size() - 1];
    }
    made.layer = of().layer(index);
    return made;
  }

  std::unique_ptr<Contours> contours(std::uint32_t index) const {
    return std::make_unique<Contours>(without_lock([&] { return source_.contours(index); }));
  }

  py::array heights() const {
    std::vector<Layer> layers;
    for (std::uint32_t i = 0; i < of().layer_count(); ++i) layers.push_back(of().layer(i));
    return table_of(layers);
  }

 private:
  pipeline::LayerSource source_;
};

/// Some layers of a plan in an order, as plan[2:9:3] and its reverse: each is planned on request, and none is kept.
struct PlanSlice {
  std::shared_ptr<Plan> plan;
  std::int64_t first = 0, step = 1, count = 0;

  std::uint32_t layer(std::int64_t position) const { return static_cast<std::uint32_t>(first + position * step); }
  PlannedLayer at(std::int64_t requested) const {
    const std::int64_t position = requested < 0 ? requested + count : requested;
    if (position < 0 || position >= count)
      throw py::index_error(fmt::format("layer {} of a slice: it has {}", requested, count));
    return plan->layer(layer(position));
  }
  PlanSlice part(const py::slice& requested) const {
    py::ssize_t start = 0, stop = 0, stride = 0, length = 0;
    if (!requested.compute(static_cast<py::ssize_t>(count), &start, &stop, &stride, &length)) throw py::error_already_set();
    return {plan, first + start * step, step * stride, length};
  }
};

/// Plans a layer when the next one is requested, and keeps none.
struct LayerIterator {
  PlanSlice of;
  std::int64_t next = 0;
};

LayerIterator iterate(const std::shared_ptr<Plan>& plan, std::int64_t first, std::int64_t end) {
  return {{plan, first, 1, std::max<std::int64_t>(end - first, 0)}};
}

/// Runs on a thread of its own, so that Ctrl-C stops it: finished layers are kept then. returns  the summary of --json
py::object run_job(const Job& job, Product product) {
  std::atomic<bool> cancel{false};
  auto running = std::async(std::launch::async, [&] {
    return pipeline::run(
        job, product, [](const pipeline::ProgressEvent&) {}, cancel);
  });
  while (true) {
    {
      const py::gil_scoped_release release;
      if (running.wait_for(std::chrono::milliseconds(100)) == std::future_status::ready) break;
    }
    if (PyErr_CheckSignals() == 0) continue;
    cancel = true;
    const py::gil_scoped_release release;
    running.wait();
    break;
  }
  if (cancel) throw py::error_already_set();
  auto summary = running.get();
  if (!summary) raise(summary.error());
  return py::module_::import("json").attr("loads")(summary->json());
}

template <Product product>
py::object plan_into(const std::string& output, const py::object& parts, const py::dict& settings, const std::string& file,
                     bool resume, bool overwrite, const py::object& materials) {
  if (output.empty()) raise({Fault::kUsage, "output is empty; name a directory or file"});
  Job job = make_job(parts, settings, materials, file, output);
  job.resume = resume;
  job.overwrite = overwrite;
  job.leave_to_machine = true;
  return run_job(job, product);
}

void define_layer(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(LayerEntry, bottom, thickness, reason);
  py::class_<PlannedLayer, Image>(module, "Layer",
                                  "A layer of a plan: an Image, and where it lies. Heights are nm above the bed.")
      .def_property_readonly(
          "index", [](const PlannedLayer& l) { return l.layer.index; }, "From 0 at the bottom.")
      .def_property_readonly("bottom", [](const PlannedLayer& l) { return l.layer.bottom; })
      .def_property_readonly("thickness", [](const PlannedLayer& l) { return l.layer.thickness; })
      .def_property_readonly(
          "plane", [](const PlannedLayer& l) { return l.layer.plane(); }, "Where the parts are sampled.")
      .def_property_readonly("reason", [](const PlannedLayer& l) { return std::string(reason_name(l.layer.reason)); })
      .def_property_readonly(
          "materials",
          [](const py::object& self) {
            auto& layer = self.cast<PlannedLayer&>();
            py::dict images;
            for (std::size_t m = 0; m < layer.materials.size(); ++m) {
              images[py::str(layer.materials[m])] =
                  layer.images.empty() ? self : py::cast(&layer.images[m], py::return_value_policy::reference_internal, self);
            }
            return images;
          },
          "dict: the Image of each powder by its name, in the plan's order; of several drops, that of the first. Together "
          "they are the layer; no pixel is set in two, but for voxels that get drops of both. Empty if no part names a material. They lie in the layer; nothing is copied.")
      .def("__repr__", [](const PlannedLayer& l) {
        return fmt::format("<lamina.Layer {}: {} to {} mm, {} x {} pixels, {} set>", l.layer.index, mm(l.layer.bottom),
                           mm(std::int64_t{l.layer.bottom} + l.layer.thickness), l.runs.columns, l.runs.view().rows(),
                           set_pixels(l.runs));
      });
  py::class_<Contours>(module, "Contours",
                       "Closed contours of a layer: a sequence of n x 2 arrays, nm on the bed, outer ones "
                       "counter-clockwise, those around holes clockwise.")
      .def("__len__", [](const Contours& c) { return c.size(); })
      .def("__getitem__",
           [](const py::object& self, std::int64_t requested) {
             const Contours& contours = self.cast<const Contours&>();
             const std::int64_t index = requested < 0 ? requested + contours.size() : requested;
             if (index < 0 || index >= contours.size())
               throw py::index_error(fmt::format("contour {}: there are {}", requested, contours.size()));
             const auto points = contours[static_cast<std::uint32_t>(index)];
             return view(&points.data()->x, {static_cast<py::ssize_t>(points.size()), 2}, self);
           })
      .def_property_readonly(
          "offset",
          [](const py::object& self) {
            const auto& offset = self.cast<const Contours&>().offset;
            return view(offset.data(), {static_cast<py::ssize_t>(offset.size())}, self);
          },
          "uint32, contours + 1: contour c owns point[offset[c]:offset[c + 1]]. A view, read-only.")
      .def_property_readonly(
          "point",
          [](const py::object& self) {
            const auto& point = self.cast<const Contours&>().point;
            return view(reinterpret_cast<const std::int32_t*>(point.data()), {static_cast<py::ssize_t>(point.size()), 2}, self);
          },
          "int32, points x (x, y), nm on the bed. A view, read-only.")
      .def_property_readonly("area_mm2", [](const Contours& c) { return square_mm(doubled_area(c)); });
  py::class_<LayerIterator>(module, "LayerIterator")
      .def("__iter__", [](LayerIterator& self) -> LayerIterator& { return self; })
      .def("__length_hint__", [](const LayerIterator& self) { return self.of.count - self.next; })
      .def("__next__", [](LayerIterator& self) {
        if (self.next >= self.of.count) throw py::stop_iteration();
        return self.of.at(self.next++);
      });
  py::class_<PlanSlice>(module, "PlanSlice",
                        "Some layers of a plan, as plan[10:20]: a sequence whose layers are planned on access.")
      .def("__len__", [](const PlanSlice& self) { return self.count; })
      .def("__getitem__", &PlanSlice::at)
      .def("__getitem__", &PlanSlice::part)
      .def("__iter__", [](const PlanSlice& self) { return LayerIterator{self}; })
      .def("__repr__", [](const PlanSlice& self) {
        return self.count == 0 ? std::string("<lamina.PlanSlice: no layers>")
                               : fmt::format("<lamina.PlanSlice: {} layers, {} to {}>", self.count, self.layer(0),
                                             self.layer(self.count - 1));
      });
}

/// What repr(plan) says.
std::string described(const Plan& plan) {
  const std::uint32_t count = plan.of().layer_count();
  const Layer top = count == 0 ? Layer() : plan.of().layer(count - 1);
  std::string parts;
  for (const auto& part : plan.of().parts()) parts += (parts.empty() ? "" : ", ") + part.path;
  return fmt::format("<lamina.Plan of {}: {} layers, {:g} mm high, {} x {} pixels at {:g} x {:g} dpi>", parts, count,
                     mm(std::int64_t{top.bottom} + top.thickness), plan.grid().columns(), plan.grid().rows(),
                     plan.grid().x.dpi(), plan.grid().y.dpi());
}

void define_plan(py::module_& module) {
  py::class_<Plan, std::shared_ptr<Plan>>(
      module, "Plan",
      "A job with its parts loaded: a sequence of layers that are planned on access. Several threads "
      "may read it at the same time; planning releases the interpreter's lock.")
      .def("__len__", [](const Plan& plan) { return plan.of().layer_count(); })
      .def("__getitem__", [](const Plan& plan, std::int64_t requested) { return plan.layer(plan.index(requested)); })
      .def(
          "__getitem__",
          [](const std::shared_ptr<Plan>& plan, const py::slice& requested) {
            return PlanSlice{plan, 0, 1, plan->of().layer_count()}.part(requested);
          },
          "A layer, or with plan[10:20] a sequence of layers, each planned on access.")
      .def("__repr__", &described)
      .def("__iter__", [](const std::shared_ptr<Plan>& plan) { return iterate(plan, 0, plan->of().layer_count()); })
      .def(
          "layers",
          [](const std::shared_ptr<Plan>& plan, std::uint32_t first, std::optional<std::uint32_t> end) {
            const std::uint32_t count = plan->of().layer_count();
            return iterate(plan, first, std::min(end.value_or(count), count));
          },
          "first"_a = 0, "end"_a = py::none(),
          "Iterator over layers first to end. Each is planned on access, and the plan does not keep it.")
      .def(
          "contours", [](Plan& plan, std::int64_t requested) { return plan.contours(plan.index(requested)); }, "index"_a,
          "Contours of a layer, as lamina slice cuts them. The first call loads the parts once more.")
      .def_property_readonly(
          "materials", [](const Plan& plan) { return plan.of().materials(); },
          "Names of the powders, by vat, else in the order in which parts name them; empty if none does.")
      .def_property_readonly(
          "heights", &Plan::heights,
          "Structured array, a row a layer: bottom and thickness in nm (int32), reason (index into lamina.reasons).")
      .def_property_readonly("columns", [](const Plan& plan) { return plan.grid().columns(); })
      .def_property_readonly("rows", [](const Plan& plan) { return plan.grid().rows(); })
      .def_property_readonly(
          "dpi", [](const Plan& plan) { return py::make_tuple(plan.grid().x.dpi(), plan.grid().y.dpi()); }, "Along x and y.")
      .def_property_readonly(
          "bed_mm", [](const Plan& plan) { return plan.of().bed_mm(); }, "Width (x) and depth (y).")
      .def_property_readonly(
          "job", [](const Plan& plan) { return pipeline::job_text(plan.of().job(), ""); },
          "The job as a TOML file would say it.")
      .def_property_readonly(
          "parts",
          [](const Plan& plan) {
            py::list parts;
            for (const auto& part : plan.of().parts()) {
              const auto& [lo, hi] = part.bounds;
              parts.append(py::dict("path"_a = part.path, "copies"_a = part.copies, "triangles"_a = part.triangles,
                                    "low"_a = py::make_tuple(lo.x, lo.y, lo.z), "high"_a = py::make_tuple(hi.x, hi.y, hi.z)));
            }
            return parts;
          },
          "One dict a part; low and high are the corners of the first copy's box on the bed, nm.");
}

}  // namespace
}  // namespace lamina::python

PYBIND11_MODULE(lamina, module) {
  using namespace lamina;
  using namespace lamina::python;
  module.doc() =
      "Slices parts for powder and filament printers: exact bitmaps, print programs, toolpaths.\n\n"
      "Settings are the keys of a job file (docs/reference/job.md), as {'bed.dpi': 600, 'layers.thickness_mm': 0.1}; lamina.keys() lists\n"
      "them. Lengths in settings are mm, as in job files; in arrays they are whole nanometres. What fails raises lamina.Error\n"
      "with one line that says where, what is wrong and what to do.";
  module.attr("__version__") = std::string(version());
  py::list reasons;
  for (int reason = 0; reason <= static_cast<int>(LayerReason::kFlat); ++reason) {
    reasons.append(std::string(reason_name(static_cast<LayerReason>(reason))));
  }
  module.attr("reasons") = reasons;
  define_errors(module);
  define_part(module);
  define_image(module);
  define_layer(module);
  define_plan(module);
  module.def(
      "load",
      [](const py::object& path, const py::dict& settings) {
        const pipeline::Job job = make_job(py::make_tuple(path), settings, py::none(), "");
        return without_lock([&]() -> Result<std::shared_ptr<Part>> {
          Result<Part> part = pipeline::load_part(job, job.parts[0]);
          if (!part) return part.error();
          return std::make_shared<Part>(std::move(*part));
        });
      },
      "path"_a, "settings"_a = py::dict(),
      "Reads a part file (STL, OBJ, 3MF, gzip). Settings that matter are part.* and load.*, as {'part.unit': 'inch'}.");
  module.def(
      "plan",
      [](const py::object& parts, const py::dict& settings, const std::string& job, const py::object& materials) {
        return std::make_shared<Plan>(make_job(parts, settings, materials, job));
      },
      "parts"_a = py::none(), "settings"_a = py::dict(), "job"_a = "", "materials"_a = py::none(),
      "A job ready to give its layers. parts: a path or several; job: a TOML job file, which settings override; materials: the "
      "powder of all parts, or a sequence with that of each.");
  module.def(
      "heights",
      [](const py::object& parts, const py::dict& settings, const std::string& job) {
        const pipeline::Job requested = make_job(parts, settings, py::none(), job);
        return table_of(without_lock([&] { return pipeline::layers_of(requested); }));
      },
      "parts"_a = py::none(), "settings"_a = py::dict(), "job"_a = "",
      "The layers alone, as lamina heights decides them: a structured array, a row a layer: bottom and thickness in nm (int32), "
      "reason (index into lamina.reasons).");
  const auto def_product = [&](const char* name, auto function, const char* meaning) {
    module.def(name, function, "output"_a, "parts"_a = py::none(), "settings"_a = py::dict(), "job"_a = "", "resume"_a = false,
               "overwrite"_a = false, "materials"_a = py::none(), meaning);
  };
  def_product(
      "jet", &plan_into<Product::kImages>,
      "Plans all layers into a directory, as lamina jet does, on all processors; returns its summary. Ctrl-C stops it, and "
      "resume=True continues it.");
  def_product("slice", &plan_into<Product::kContours>,
              "Contours and fillings of all layers into a directory, as lamina slice does; returns its summary.");
  def_product(
      "extrude", &plan_into<Product::kMoves>,
      "Toolpaths of all layers into a file, as lamina extrude --job does, with its defaults (one wall, layers of half of the nozzle); "
      "returns its summary.");
  module.def(
      "keys",
      [] {
        py::list list;
        for (const pipeline::KeyFacts& key : pipeline::key_facts()) {
          list.append(py::dict("key"_a = key.name, "flag"_a = key.flag, "value"_a = key.value, "default"_a = key.preset,
                               "meaning"_a = key.meaning, "decides_bytes"_a = key.decides_images));
        }
        return list;
      },
      "Every key of a job: key, option of the program, value, default, meaning, and whether it decides bytes.");
}
