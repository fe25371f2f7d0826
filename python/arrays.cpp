#include "arrays.h"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <memory>

#include "words.h"

namespace lamina::python {
namespace {

struct Kind {
  Fault fault;
  const char* name;
  PyObject** also;  // so that code which knows nothing of lamina catches it too
  const char* meaning;
};
const Kind kKinds[] = {
    {Fault::kUsage, "UsageError", &PyExc_ValueError, "a wrong setting or job"},
    {Fault::kInput, "InputError", &PyExc_ValueError, "a part file that cannot be planned"},
    {Fault::kOutput, "OutputError", &PyExc_OSError, "a result that could not be written"},
    {Fault::kVerification, "VerificationError", &PyExc_ValueError, "files that are not what they should be"},
    {Fault::kMemory, "OutOfMemoryError", &PyExc_MemoryError, "the system gives no more memory, threads or open files"},
};
PyObject* general_error = nullptr;
PyObject* errors[std::size(kKinds)] = {};

py::array bounds_array(const Box& box) {
  py::array_t<std::int32_t> array({2, 3});
  const Point3 corners[] = {box.lo, box.hi};
  std::memcpy(array.mutable_data(), corners, sizeof corners);
  return array;
}

const formats::ImageFormat& format_of(const std::string& path, const std::string& requested) {
  if (!requested.empty()) {
    if (const formats::ImageFormat* format = formats::find_image_format(requested)) return *format;
    raise({Fault::kUsage, fmt::format("format '{}': no such format; lamina.image_formats() lists them", requested)});
  }
  const std::string extension = std::filesystem::path(path).extension();
  const auto formats = formats::image_formats();
  const auto found = std::ranges::find_if(
      formats, [&](const formats::ImageFormat& format) { return !extension.empty() && format.extension == extension; });
  if (found == formats.end()) {
    raise({Fault::kUsage, fmt::format("{}: no format writes '{}'; name one, as format='tiff-g4'", path, extension)});
  }
  return *found;
}

formats::Bytes encode(const Image& image, const formats::ImageFormat& format) {
  return without_lock([&]() -> Result<formats::Bytes> {
    formats::Bytes file;
    const auto encoder = format.make_encoder();
    encoder->tag(image.tags);
    if (Status status = encoder->encode(image.runs, image.dpi_x, image.dpi_y, file); !status) return status.error();
    return file;
  });
}

py::array pixels(const Image& image, std::uint32_t top, std::optional<std::uint32_t> bottom, std::uint32_t left,
                 std::optional<std::uint32_t> right) {
  const RunsView runs = image.runs;
  return boolean_pixels(runs, top, bottom.value_or(runs.rows()), left, right.value_or(runs.columns));
}

}  // namespace

void define_errors(py::module_& module) {
  general_error = PyErr_NewExceptionWithDoc("lamina.Error",
                                            "One line: the place, what is wrong, what to do. `code` is the "
                                            "exit code of the program.",
                                            nullptr, nullptr);
  module.attr("Error") = py::reinterpret_borrow<py::object>(general_error);
  for (std::size_t i = 0; i < std::size(kKinds); ++i) {
    const Kind& kind = kKinds[i];
    const py::tuple bases = py::make_tuple(py::handle(general_error), py::handle(*kind.also));
    errors[i] = PyErr_NewExceptionWithDoc((std::string("lamina.") + kind.name).c_str(), kind.meaning, bases.ptr(), nullptr);
    module.attr(kind.name) = py::reinterpret_borrow<py::object>(errors[i]);
  }
}

void raise(const Error& error) {
  PyObject* type = general_error;
  for (std::size_t i = 0; i < std::size(kKinds); ++i) {
    if (kKinds[i].fault == error.fault) type = errors[i];
  }
  py::object exception = py::handle(type)(in_python(error.message));
  exception.attr("code") = static_cast<int>(error.fault);
  PyErr_SetObject(type, exception.ptr());
  throw py::error_already_set();
}

py::array boolean_pixels(const RunsView& runs, std::uint32_t top, std::uint32_t bottom, std::uint32_t left,
                         std::uint32_t right) {
  if (top > bottom || bottom > runs.rows() || left > right || right > runs.columns) {
    throw py::value_error(fmt::format("rows {} to {}, columns {} to {}: not within an image of {} x {} pixels", top, bottom,
                                      left, right, runs.columns, runs.rows()));
  }
  py::array_t<bool> array(std::vector<py::ssize_t>{py::ssize_t{bottom} - top, py::ssize_t{right} - left});
  bool* const values = array.mutable_data();
  {
    const py::gil_scoped_release release;
    const std::size_t width = right - left;
    std::memset(values, 0, width * (bottom - top));
    for (std::uint32_t row = top; row < bottom; ++row) {
      const auto changes = runs.row(row);
      bool* const line = values + (row - top) * width;
      for (std::size_t i = 0; i + 1 < changes.size(); i += 2) {
        const std::uint32_t begin = std::clamp(changes[i], left, right), end = std::clamp(changes[i + 1], left, right);
        std::memset(line + (begin - left), 1, end - begin);
      }
    }
  }
  return array;
}

void define_part(py::module_& module) {
  py::class_<Mesh, std::shared_ptr<Mesh>>(module, "Mesh", "A solid of a part file, repaired and closed unless repair was off.")
      .def_readonly("name", &Mesh::name, "The file, and the object in it where it holds several.")
      .def_readonly("closed", &Mesh::closed, "Whether every edge is walked as often one way as the other.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) {
            const auto& triangles = self.cast<const Mesh&>().triangles;
            return view(reinterpret_cast<const std::int32_t*>(triangles.data()),
                        {static_cast<py::ssize_t>(triangles.size()), 3, 3}, self);
          },
          "int32, n x 3 corners x (x, y, z), nm in the frame of the file; counter-clockwise as viewed from outside. A view of the "
          "mesh, read-only.")
      .def_property_readonly(
          "bounds", [](const Mesh& mesh) { return bounds_array(mesh.bounds); }, "int32, lowest and highest corner, nm.")
      .def("__len__", [](const Mesh& mesh) { return mesh.triangles.size(); });
  py::class_<Part, std::shared_ptr<Part>>(module, "Part", "A part file as loaded: its meshes, and where it puts them.")
      .def_readonly("path", &Part::path)
      .def_property_readonly("meshes",
                             [](const std::shared_ptr<Part>& part) {
                               py::list meshes;
                               for (Mesh& mesh : part->meshes) meshes.append(std::shared_ptr<Mesh>(part, &mesh));
                               return meshes;
                             })
      .def_property_readonly(
          "instances",
          [](const Part& part) {
            py::list instances;
            for (const Instance& i : part.instances)
              instances.append(py::make_tuple(i.mesh, py::make_tuple(i.offset.x, i.offset.y, i.offset.z)));
            return instances;
          },
          "(index into meshes, (x, y, z) in nm that is added to every corner), one for each copy.")
      .def_property_readonly(
          "bounds", [](const Part& part) { return bounds_array(part.bounds); }, "int32, lowest and highest corner, nm.")
      .def_property_readonly(
          "notes",
          [](const Part& part) {
            std::vector<std::string> notes;
            for (const Note& note : part.notes) notes.push_back((note.repair ? "repair: " : "") + note.text);
            return notes;
          },
          "What was noticed, and what was done about it; one line each.");
}

void define_image(py::module_& module) {
  py::class_<Image>(module, "Image", "A 1-bit image as the columns where its rows change colour.")
      .def_property_readonly("columns", [](const Image& image) { return image.runs.columns; })
      .def_property_readonly("rows", [](const Image& image) { return image.runs.view().rows(); })
      .def_property_readonly("shape",
                             [](const Image& image) { return py::make_tuple(image.runs.view().rows(), image.runs.columns); })
      .def_property_readonly(
          "dpi", [](const Image& image) { return py::make_tuple(image.dpi_x, image.dpi_y); }, "Along x and y.")
      .def_property_readonly("set_pixels", [](const Image& image) { return set_pixels(image.runs); })
      .def_property_readonly(
          "row_offset",
          [](const py::object& self) {
            const auto& offset = self.cast<const Image&>().runs.row_offset;
            return view(offset.data(), {static_cast<py::ssize_t>(offset.size())}, self);
          },
          "uint32, rows + 1: row r owns change[row_offset[r]:row_offset[r + 1]]. Row 0 is at the back of the bed. A view, "
          "read-only.")
      .def_property_readonly(
          "change",
          [](const py::object& self) {
            const auto& change = self.cast<const Image&>().runs.change;
            return view(change.data(), {static_cast<py::ssize_t>(change.size())}, self);
          },
          "uint32: for each row begin, end, begin, end, ... of its runs, in columns, ends exclusive. A view, read-only.")
      .def("pixels", &pixels, py::arg("top") = 0, py::arg("bottom") = py::none(), py::arg("left") = 0,
           py::arg("right") = py::none(),
           "bool, rows x columns: the image, or a window of it, in pixels. A byte a pixel: a whole bed may be large.")
      .def(
          "encode",
          [](const Image& image, const std::string& format) {
            const formats::Bytes file = encode(image, format_of("", format));
            return py::bytes(reinterpret_cast<const char*>(file.data()), file.size());
          },
          py::arg("format") = "tiff-g4", "The bytes of the image's file, as lamina jet writes them.")
      .def(
          "save",
          [](const Image& image, const std::string& path, const std::string& format) {
            const formats::ImageFormat& as = format_of(path, format);
            without_lock([&] { return pipeline::save_image(path, image.runs, image.dpi_x, image.dpi_y, as, image.tags); });
          },
          py::arg("path"), py::arg("format") = "",
          "Writes the image; the format follows from the name (.tif is tiff-g4) if none is given. The file appears whole.");
  module.def(
      "read_image",
      [](const std::string& path) {
        return without_lock([&]() -> Result<Image> {
          Result<formats::Image> read = formats::image(path);
          if (!read) return read.error();
          return Image{std::move(read->runs), read->dpi_x, read->dpi_y};
        });
      },
      py::arg("path"), "Reads a 1-bit TIFF, PNG or PBM, such as the layers of lamina jet.");
  module.def(
      "image_formats",
      [] {
        py::dict formats;
        for (const auto& format : formats::image_formats())
          formats[py::str(std::string(format.id))] = std::string(format.description);
        return formats;
      },
      "The formats of layer images and what they are.");
}

}  // namespace lamina::python
